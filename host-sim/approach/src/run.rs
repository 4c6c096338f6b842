//! Runs an approach over a whole job.

use crate::{Approach, ApproachError, Kind, PassPath, SideCurve, side_curves};
use glam::DVec3;
use inspect::plain;
use job::units::NM_PER_MM;
use job::{Job, Pattern};
use machine::Machine;
use machine::prepare::{Prepared, prepare};
use oracle::{Oracle, OracleError, PassSample};

/// The position of the tool after a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// As a machine emits it.
    pub emitted: PassSample,
    /// Path parameter of the contact.
    pub path: f64,
    /// Side parameter of the contact.
    pub side: f64,
    /// CL, mm; rounded only for the product.
    pub cl_mm: DVec3,
}

/// Size of the CNC program of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Planned {
    /// Number of passes.
    pub passes: usize,
    /// Number of segments; for the product, of patches.
    pub segments: usize,
    /// Bytes of the program; for the product, of the header and the surface data.
    pub bytes: usize,
    /// Largest step of the commanded CL speed between two segments of a pass, mm/s.
    pub speed_step_mm_s: f64,
}

/// The passes of a job: those on `curves` where there are any, of [`crate::side_curves`], straight ones else.
///
/// # Errors
/// As [`passes`].
pub fn job_passes<'a>(oracle: &'a Oracle, curves: &'a [SideCurve]) -> Result<Vec<PassPath<'a>>, OracleError> {
    if curves.is_empty() {
        return passes(oracle);
    }
    Ok(curved_passes(oracle, curves))
}

/// Straight passes of a job, by the dense scan of the oracle.
///
/// # Errors
/// As [`Oracle::schedule`].
pub fn passes<'a>(oracle: &'a Oracle) -> Result<Vec<PassPath<'a>>, OracleError> {
    let [low, high] = oracle.path_range();
    let pass = |(index, side): (usize, f64)| PassPath {
        oracle,
        pass: index as u32,
        side,
        ends: if oracle.pattern == Pattern::Zigzag && index % 2 == 1 {
            [high, low]
        } else {
            [low, high]
        },
        curve: None,
    };
    let schedule = oracle.schedule()?;
    Ok(schedule
        .iter()
        .map(|pass| pass.side)
        .enumerate()
        .map(pass)
        .collect())
}

/// The passes on curves.
fn curved_passes<'a>(oracle: &'a Oracle, curves: &'a [SideCurve]) -> Vec<PassPath<'a>> {
    let pass = |(index, curve): (usize, &'a SideCurve)| {
        let ends = curve.ends();
        PassPath {
            oracle,
            pass: index as u32,
            side: curve.at(ends[0])[0],
            ends,
            curve: Some(curve),
        }
    };
    curves.iter().enumerate().map(pass).collect()
}

/// Runs a job by an approach, and passes on every sample.
///
/// # Errors
/// The geometry is undefined, a pass has no segments within the tolerance, or the core has a fault.
pub fn run(kind: Kind, job: &Job, each: &mut dyn FnMut(&Motion)) -> Result<Planned, ApproachError> {
    match kind.plan_for(job) {
        Some(approach) => {
            let oracle = Oracle::new(job)?;
            let curves = side_curves(job)?;
            planned(approach.as_ref(), job, &job_passes(&oracle, &curves)?, each)
        }
        None => on_the_core(job, each),
    }
}

/// Plans and follows these passes of a job.
///
/// # Errors
/// As [`run`].
pub fn planned(
    approach: &dyn Approach,
    job: &Job,
    passes: &[PassPath<'_>],
    each: &mut dyn FnMut(&Motion),
) -> Result<Planned, ApproachError> {
    let mut planned = Planned::default();
    let mut text = String::new();
    let mut tick = 0;
    for pass in passes {
        let program = approach.plan(pass)?;
        text.clear();
        program.write(&mut text);
        planned.passes += 1;
        planned.segments += program.segments();
        planned.bytes += text.len();
        planned.speed_step_mm_s = planned.speed_step_mm_s.max(program.speed_step_mm_s());
        let begin = pass.at(pass.ends[0])?.contact.cl_mm;
        // Delayed by one sample, because only the next one shows which is the last of the pass.
        let mut pending = motion(pass, begin, pass.ends[0], 0.0)?;
        pending.emitted.first_of_pass = true;
        let mut send = |mut motion: Motion| {
            motion.emitted.tick = tick;
            tick += 1;
            each(&motion);
        };
        let period_s = job.machine.period_s();
        program.follow(pass, period_s, &mut |cl_mm, guess| {
            let next = motion(pass, cl_mm, guess, job.feed_mm_s())?;
            send(std::mem::replace(&mut pending, next));
            Ok(())
        })?;
        if pending.emitted.first_of_pass {
            // A degenerate pass ends at its start.
            let next = motion(pass, begin, pass.ends[1], 0.0)?;
            send(std::mem::replace(&mut pending, next));
        }
        let (u, v) = pass.oracle.swapped(pass.ends[1], pass.side_at(pass.ends[1]));
        (pending.path, pending.emitted.u, pending.emitted.v) = (pass.ends[1], u, v);
        pending.emitted.last_of_pass = true;
        send(pending);
    }
    Ok(planned)
}

fn nanometres(mm: DVec3) -> [i32; 3] {
    mm.to_array().map(|x| (x * NM_PER_MM).round() as i32)
}

/// The motion to a commanded CL.
fn motion(pass: &PassPath<'_>, cl_mm: DVec3, guess: f64, feed_mm_s: f64) -> Result<Motion, OracleError> {
    let foot = pass.foot(cl_mm, guess)?;
    let side = pass.side_at(foot.path);
    let (u, v) = pass.oracle.swapped(foot.path, side);
    Ok(Motion {
        emitted: PassSample {
            tick: 0,
            pass: pass.pass,
            u,
            v,
            cc_nm: nanometres(foot.contact.cc_mm),
            cl_nm: nanometres(cl_mm),
            feed_mm_s,
            interval: foot.contact.interval,
            first_of_pass: false,
            last_of_pass: false,
        },
        path: foot.path,
        side,
        cl_mm,
    })
}

/// A sample of the core on a pass as a motion; `None` between passes.
fn of_sample(prepared: &Prepared, sample: &interp_core::Sample, first: bool) -> Option<Motion> {
    Some(Motion {
        emitted: plain(prepared, sample).emitted(first, false)?,
        path: prepared.path.parameter(sample.path),
        side: prepared.side.parameter(sample.side),
        cl_mm: DVec3::from(sample.cl_nm.map(f64::from)) / NM_PER_MM,
    })
}

/// The product.
fn on_the_core(job: &Job, each: &mut dyn FnMut(&Motion)) -> Result<Planned, ApproachError> {
    let mut prepared = prepare(job).map_err(|error| ApproachError::Fault(error.to_string()))?;
    // The approaches are compared at constant feed, as in the paper: without axis limits.
    prepared.header.axes = None;
    let sentence = |fault| {
        let (what, remedy) = explain::fault(fault);
        ApproachError::Fault(format!("{what}\n  help: {remedy}"))
    };
    let mut machine = Machine::load(&prepared).map_err(sentence)?;
    let oracle = Oracle::new(job)?;
    let mut ratio_step = 0.0_f64;
    let mut pending: Option<Motion> = None;
    let ran = machine.run(|sample| {
        let first = pending.is_none_or(|before| before.emitted.pass != sample.pass);
        let Some(motion) = of_sample(&prepared, sample, first) else {
            return true;
        };
        if let Some(mut before) = pending.take() {
            before.emitted.last_of_pass = first;
            each(&before);
        }
        if first {
            ratio_step = ratio_step.max(oracle.ratio_step(motion.side).unwrap_or(0.0));
        }
        pending = Some(motion);
        true
    });
    let last_pass = pending.map_or(0, |last| last.emitted.pass as usize + 1);
    if let Some(mut last) = pending {
        last.emitted.last_of_pass = ran.is_ok();
        each(&last);
    }
    ran.map_err(sentence)?;
    Ok(Planned {
        passes: last_pass,
        segments: prepared.patches(),
        bytes: prepared.bytes(),
        speed_step_mm_s: ratio_step * job.feed_mm_s(),
    })
}
