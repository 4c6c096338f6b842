//! What a run by an approach came to: the same figures for all four, by the same yardstick.

use protocol::digest::Digest;

use super::{ApproachError, Kind, Motion, Planned, run};
use crate::job_file::JobFile;
use crate::oracle::vector::{length, subtract};
use crate::oracle::{Oracle, Report, Verifier};
use crate::survey::Findings;

/// Mean speeds over one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speed {
    /// Time at the period's end since the pass began, s.
    pub time_s: f64,
    /// Length of the contact's path since the pass began, at the period's middle, mm.
    pub arc_mm: f64,
    /// Of the contact along the surface, mm/s.
    pub cc_mm_s: f64,
    /// Of the tool centre, mm/s.
    pub cl_mm_s: f64,
}

/// Figures of a run.
#[derive(Clone, Debug)]
pub struct Measured {
    /// What a CNC has to be fed.
    pub planned: Planned,
    /// Errors and ripple against the oracle.
    pub report: Report,
    /// Samples.
    pub samples: u64,
    /// Machining time, s: samples times the period, as the product counts it.
    pub time_s: f64,
    /// Length of the tool centre's path within the passes, mm.
    pub cl_length_mm: f64,
    /// Least and largest speed of the contact over a period, mm/s; the last, cut short, of each pass left out.
    pub cc_mm_s: [f64; 2],
    /// The same of the tool centre.
    pub cl_mm_s: [f64; 2],
    /// Largest change of the centre's speed from one period to the next, mm/s.
    pub cl_change_mm_s: f64,
    /// Least candidate of the path interval.
    pub interval_min: f64,
    /// Digest of all samples: tick, pass, CC and CL of each, as words.
    pub digest: u64,
}

impl Measured {
    /// The same as a run of the core reports it.
    #[must_use]
    pub fn findings(&self) -> Findings {
        Findings {
            samples: self.samples,
            passes: u32::try_from(self.planned.passes).unwrap_or(u32::MAX),
            cl_length_mm: self.cl_length_mm,
            interval_min: self.interval_min,
            report: self.report,
        }
    }
}

/// Follows motions period by period.
struct Follower<'a> {
    oracle: &'a Oracle,
    before: Option<Motion>,
    time_s: f64,
    arc_mm: f64,
}

impl Follower<'_> {
    /// The speeds over the period that this motion ends; none at the beginning of a pass.
    fn speed(&mut self, motion: &Motion) -> Option<Speed> {
        let before = self
            .before
            .replace(*motion)
            .filter(|_| !motion.emitted.first_of_pass);
        let Some(before) = before else {
            (self.time_s, self.arc_mm) = (0.0, 0.0);
            return None;
        };
        let period = self.oracle.period_s;
        let arc = self
            .oracle
            .arc_length(before.path, motion.path, motion.side)
            .abs();
        self.time_s += period;
        self.arc_mm += arc;
        Some(Speed {
            time_s: self.time_s,
            arc_mm: self.arc_mm - 0.5 * arc,
            cc_mm_s: arc / period,
            cl_mm_s: length(subtract(motion.cl_mm, before.cl_mm)) / period,
        })
    }
}

fn widen([low, high]: &mut [f64; 2], value: f64) {
    (*low, *high) = (low.min(value), high.max(value));
}

/// Runs a job by an approach and measures it; hands every motion on, with the speeds over its period if it ends one.
///
/// # Errors
/// As [`run`].
pub fn measure(
    kind: Kind,
    job: &JobFile,
    mut each: impl FnMut(&Motion, Option<Speed>),
) -> Result<Measured, ApproachError> {
    measure_run(job, &mut each, |each| run(kind, job, each))
}

/// As [`measure`], for any way to run.
///
/// # Errors
/// Those of the run.
pub fn measure_run(
    job: &JobFile,
    each: &mut dyn FnMut(&Motion, Option<Speed>),
    run: impl FnOnce(&mut dyn FnMut(&Motion)) -> Result<Planned, ApproachError>,
) -> Result<Measured, ApproachError> {
    let oracle = Oracle::new(job)?;
    let mut verifier = Verifier::new(&oracle);
    let mut follower = Follower {
        oracle: &oracle,
        before: None,
        time_s: 0.0,
        arc_mm: 0.0,
    };
    let mut digest = Digest::new();
    let (mut cc, mut cl) = ([f64::INFINITY, 0.0], [f64::INFINITY, 0.0]);
    let (mut length_mm, mut change, mut interval) = (0.0, 0.0_f64, f64::INFINITY);
    let mut last: Option<Speed> = None;
    let planned = run(&mut |motion| {
        verifier.add(&motion.emitted);
        interval = interval.min(motion.emitted.interval);
        digest.word(motion.emitted.tick as u32);
        digest.word(motion.emitted.pass);
        digest.words(&motion.emitted.cc_nm);
        digest.words(&motion.emitted.cl_nm);
        let speed = follower.speed(motion);
        if let Some(speed) = speed {
            length_mm += speed.cl_mm_s * oracle.period_s;
            if !motion.emitted.last_of_pass && motion.emitted.feed_mm_s > 0.0 {
                widen(&mut cc, speed.cc_mm_s);
                widen(&mut cl, speed.cl_mm_s);
                if let Some(last) = last {
                    change = change.max((speed.cl_mm_s - last.cl_mm_s).abs());
                }
            }
        }
        last = speed.filter(|_| !motion.emitted.last_of_pass);
        each(motion, speed);
    })?;
    let report = verifier.finish();
    Ok(Measured {
        planned,
        samples: report.samples,
        time_s: report.samples as f64 * oracle.period_s,
        report,
        cl_length_mm: length_mm,
        cc_mm_s: cc,
        cl_mm_s: cl,
        cl_change_mm_s: change,
        interval_min: interval,
        digest: digest.value(),
    })
}
