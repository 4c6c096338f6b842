//! Passes of constant scallop height beside straight ones: number, length, time and crests.

use std::collections::BTreeMap;

use glam::DVec3;
use job::{Job, Spacing, units};
use machine::prepare::{Prepared, prepare};
use oracle::{Oracle, PassSample};
use verify::EmittedSample;
use verify::swept::{self, SweptResult, ToolPath};

use crate::run::machine;
use crate::{InspectError, is_on_pass, plain};

/// Distance from an end of the path parameter below which a pass reaches it, as a share of its range.
const END_SHARE: f64 = 1e-6;

/// The path of a whole job.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathFigures {
    /// Number of passes.
    pub passes: usize,
    /// Number of passes that do not go from one end of the path parameter to the other.
    pub partial: usize,
    /// Length of all passes at the contact, mm.
    pub length_mm: f64,
    /// Time of the job from its first sample to its last, s.
    pub time_s: f64,
}

/// A job of constant scallop height beside straight passes at the exact step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvedFigures {
    /// The job's path.
    pub own: PathFigures,
    /// The path of straight passes along the same parameter; `None` where the core does not machine the job with these.
    pub straight: Option<PathFigures>,
}

impl CurvedFigures {
    /// Saved shares of the length and of the time of straight passes; negative where curved passes need more.
    #[must_use]
    pub fn saved(&self) -> Option<[f64; 2]> {
        let straight = self.straight?;
        let of = |own: f64, other: f64| 1.0 - own / other.max(f64::MIN_POSITIVE);
        Some([
            of(self.own.length_mm, straight.length_mm),
            of(self.own.time_s, straight.time_s),
        ])
    }
}

/// Runs a job on the core and measures its path.
///
/// # Errors
/// The core refuses the job, or a fault ends it.
pub fn path_figures(job: &Job, prepared: &Prepared) -> Result<PathFigures, InspectError> {
    follow(job, prepared, &Oracle::new(job)?, &mut |_| ())
}

/// Runs a job on the core and measures its path ([`path_figures`]) and the crests that the passes leave, from samples at least this far apart.
///
/// # Errors
/// As [`path_figures`].
pub fn path_and_crests(
    job: &Job,
    prepared: &Prepared,
    spacing_mm: f64,
) -> Result<(PathFigures, SweptResult), InspectError> {
    let oracle = Oracle::new(job)?;
    let mut track = ToolPath::with_spacing(spacing_mm * units::NM_PER_MM, job.scallop_mm);
    // Held back until the next sample shows whether it is the last of its pass.
    let mut held: Option<PassSample> = None;
    let path = follow(job, prepared, &oracle, &mut |sample| {
        let first = held.is_none_or(|before| before.pass != sample.pass);
        if let Some(before) = &mut held {
            if !first && sample.parameters == Some([before.u, before.v]) {
                return;
            }
            before.last_of_pass = first;
            track.add(before, job.along);
        }
        held = sample.emitted(first, false);
    })?;
    if let Some(mut last) = held {
        last.last_of_pass = true;
        track.add(&last, job.along);
    }
    let requirements = swept::Requirements::default();
    let swept = swept::measure(job, &oracle, &track, true, &requirements, &());
    Ok((path, swept))
}

/// Runs a job on the core, measures its path, and passes on every sample on a pass.
fn follow(
    job: &Job,
    prepared: &Prepared,
    oracle: &Oracle,
    each: &mut dyn FnMut(&EmittedSample),
) -> Result<PathFigures, InspectError> {
    let mut passes = BTreeMap::<u32, [f64; 2]>::new();
    let (mut length_mm, mut ticks) = (0.0, 0_u32);
    let mut last: Option<(u32, DVec3)> = None;
    let mut core = machine(job, prepared)?;
    let ran = core.run(|sample| {
        ticks = sample.tick;
        let emitted = plain(prepared, sample);
        let Some([u, v]) = emitted.parameters.filter(|_| is_on_pass(sample)) else {
            last = None;
            return true;
        };
        each(&emitted);
        let (path, _) = oracle.swapped(u, v);
        let ends = passes.entry(sample.pass).or_insert([path; 2]);
        *ends = [ends[0], path];
        let contact = DVec3::from(units::position_mm(sample.cc_nm));
        if let Some((pass, before)) = last
            && pass == sample.pass
        {
            length_mm += before.distance(contact);
        }
        last = Some((sample.pass, contact));
        true
    });
    ran.map_err(|fault| crate::load_error(job, fault))?;
    let [low, high] = oracle.path_range();
    let near = END_SHARE * (high - low);
    let is_partial = |ends: &&[f64; 2]| {
        let [least, most] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        least > low + near || most < high - near
    };
    Ok(PathFigures {
        passes: passes.len(),
        partial: passes.values().filter(is_partial).count(),
        length_mm,
        time_s: f64::from(ticks + 1) * job.machine.period_s(),
    })
}

/// Measures a job of constant scallop height beside straight passes; `None` for other jobs. `straight`: the job with these, where it is prepared already, with the words of
/// its links.
///
/// # Errors
/// As [`path_figures`], of the job itself.
pub fn curved_figures(
    job: &Job,
    prepared: &Prepared,
    straight: Option<(&Job, &Prepared)>,
) -> Result<Option<CurvedFigures>, InspectError> {
    if !job.spacing.is_constant() {
        return Ok(None);
    }
    let own = path_figures(job, prepared)?;
    let straight = match straight {
        Some((job, prepared)) => path_figures(job, prepared).ok(),
        None => {
            let job = Job {
                spacing: Spacing::Exact,
                ..job.clone()
            };
            let prepared = prepare(&job).ok();
            prepared.and_then(|prepared| path_figures(&job, &prepared).ok())
        }
    };
    Ok(Some(CurvedFigures { own, straight }))
}
