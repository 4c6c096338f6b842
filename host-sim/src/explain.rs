//! Faults in sentences: what happened, and what to do about it.

use interp_core::job::patches_max;
use interp_core::{Fault, FaultKind, STORE_WORDS, SurfaceKind};

/// A fault with its place in one line: code, name, where, and what it says to a person.
#[must_use]
pub fn fault_at(of: Fault, tick: u64, pass: u32, [u, v]: [f64; 2]) -> String {
    let (code, name, what) = (of.kind.code(), of.kind.name(), fault(of).0);
    format!("fault {code} ({name}) at tick {tick}, pass {pass}, u = {u:.9}, v = {v:.9}: {what}")
}

/// What a fault says to a person, and the remedy.
#[must_use]
pub fn fault(fault: Fault) -> (String, &'static str) {
    let value = fault.value;
    match fault.kind {
        FaultKind::BallDoesNotFit => (
            format!(
                "the ball does not fit: its radius times the surface's curvature towards it is {value:.4}, which must stay below 1"
            ),
            "take a smaller ball, or machine this region with another tool",
        ),
        FaultKind::DegenerateSurface => (
            format!(
                "the surface has no normal, or folds over: the sine between S_u and S_v is {value:.2e}, below {:.0e}",
                interp_core::surface::SINE_MIN
            ),
            "end the surface before this place, or parametrise it anew; a boundary that is exactly one point is allowed",
        ),
        FaultKind::ParameterBackwards => (
            format!(
                "the parametrisation changes its speed too fast for one period: the correction of the step is {value:.2} of it"
            ),
            "lower the feed, or parametrise the surface more evenly",
        ),
        FaultKind::OutOfRange => (
            format!("a cutter location lies at {value:.3} m, outside ±2.147 m"),
            "move the part nearer to the origin",
        ),
        FaultKind::TooManyPatches => (
            format!(
                "the job has {value} words of surface data; the machine stores {STORE_WORDS}: at most {} polynomial or {} rational patches",
                patches_max(SurfaceKind::Polynomial, STORE_WORDS),
                patches_max(SurfaceKind::Rational, STORE_WORDS)
            ),
            "use fewer knots, or cut the part into several jobs",
        ),
        FaultKind::PatchTooShort => (
            format!("one period's arc reaches past a whole patch; {value:.4} mm of it were left over"),
            "lower the feed, or remove knots that lie closer together than one period's arc",
        ),
        FaultKind::IntervalTooSmall => (
            format!("the path interval, {value:.1e} of a patch, does not advance the side parameter"),
            "take a larger scallop height or a larger ball",
        ),
        FaultKind::BadHeader => (
            format!("the job's header has a value out of its range: {value}"),
            "see the ranges of the job file",
        ),
        FaultKind::BadPatch => (
            format!("patch {value} is outside the range in which its polynomials cannot overflow"),
            "this is a defect of the host tool: please report the job",
        ),
        FaultKind::BadLength => (
            format!("the job's data have the wrong length; {value} words arrived"),
            "load the job again",
        ),
        FaultKind::WrongState => (
            "the machine's state does not allow this".to_owned(),
            "abort the run first",
        ),
        FaultKind::DeadlineMissed => (
            format!("{value} ticks of the sample timer were missed"),
            "this is a defect of the firmware, or a debugger held the chip",
        ),
        FaultKind::TickOverBudget => (
            format!("a tick took {value} cycles, more than the board allows it"),
            "this is a defect of the firmware: please report the job",
        ),
    }
}
