//! Faults in sentences: cause and remedy.
//!
//! `fault` describes a fault that occurred, with its value; [`entries`](entry) explain every code, for
//! `cargo sim explain`.

mod faults;
mod reasons;

use interp_core::job::patches_max;
use interp_core::{Fault, FaultKind, STORE_WORDS, SurfaceKind};
use protocol::message::FaultReport;

/// Origin of a code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// A fault of the core: it stops a run, or refuses a job. Identified by its number.
    Fault,
    /// A board's reason to refuse a request. Identified by `R` and its number.
    Reason,
}

/// An explanation of one code.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Origin of the code.
    pub family: Family,
    /// The stable code.
    pub code: u8,
    /// The stable name.
    pub name: &'static str,
    /// Meaning.
    pub meaning: &'static str,
    /// Meaning of the value that accompanies the code.
    pub value: &'static str,
    /// Cause.
    pub why: &'static str,
    /// Remedy.
    pub remedy: &'static str,
    /// An example.
    pub example: &'static str,
}

impl Entry {
    /// The label that `cargo sim explain` accepts: `1`, `R1`.
    #[must_use]
    pub fn label(&self) -> String {
        match self.family {
            Family::Fault => self.code.to_string(),
            Family::Reason => format!("R{}", self.code),
        }
    }
}

/// All explanations: faults, then reasons, each in the order of codes.
#[must_use]
pub fn entries() -> Vec<Entry> {
    let faults = interp_core::FaultKind::ALL.into_iter().map(faults::entry);
    faults.chain(reasons::ENTRIES).collect()
}

/// The explanation of a code, by its label or its name.
#[must_use]
pub fn entry(wanted: &str) -> Option<Entry> {
    let mut all = entries().into_iter();
    all.find(|entry| entry.label().eq_ignore_ascii_case(wanted) || entry.name.eq_ignore_ascii_case(wanted))
}

/// A fault with its location in one line: code, name, location, description.
#[must_use]
pub fn fault_at(of: Fault, tick: u64, pass: u32, [u, v]: [f64; 2]) -> String {
    let (code, name, what) = (of.kind.code(), of.kind.name(), fault(of).0);
    format!("fault {code} ({name}) at tick {tick}, pass {pass}, u = {u:.9}, v = {v:.9}: {what}")
}

/// The key of the job file, `section.key`, most relevant to a fault.
#[must_use]
pub fn key(kind: FaultKind) -> &'static str {
    match kind {
        FaultKind::BallDoesNotFit => "tool.radius_mm",
        FaultKind::ParameterBackwards | FaultKind::PatchTooShort => "cut.feed_mm_min",
        FaultKind::IntervalTooSmall => "cut.scallop_mm",
        FaultKind::OutOfRange => "placement.translate_mm",
        FaultKind::StepRate => "machine.steps_per_mm",
        _ => "surface",
    }
}

/// Description of a fault, and its remedy.
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
        FaultKind::DegenerateSurface if value == 0.0 => (
            "the surface folds over between two samples, or its tangent plane jumps at a knot (a crease)"
                .to_owned(),
            "end the surface before this place; at a crease cut it into two faces at the knot",
        ),
        FaultKind::DegenerateSurface => (
            format!(
                "the surface has no normal, or folds over: the sine between S_u and S_v is {value:.2e}, below {:.0e}",
                interp_core::surface::SINE_MIN
            ),
            "end the surface before this point, or reparametrise the surface; a boundary that is exactly one point is allowed",
        ),
        FaultKind::ParameterBackwards => (
            format!(
                "the speed of the parametrisation changes too much within one period: the step's correction is {value:.2} of the step"
            ),
            "lower the feed, or parametrise the surface more evenly",
        ),
        FaultKind::OutOfRange => (
            format!("a cutter location is at {value:.3} m, outside ±2.147 m"),
            "move the part nearer to the origin",
        ),
        FaultKind::TooManyPatches => (
            format!(
                "the job has {value} words of surface data that have to be there at once; the machine stores {STORE_WORDS}: at most {} polynomial or {} rational patches",
                patches_max(SurfaceKind::Polynomial, STORE_WORDS),
                patches_max(SurfaceKind::Rational, STORE_WORDS)
            ),
            "use fewer knots, or cut the part into several jobs",
        ),
        FaultKind::PatchTooShort => (
            format!("the arc of one period is longer than a whole patch; {value:.4} mm of the arc remain"),
            "lower the feed, or remove knots closer together than the arc of one period",
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
            format!(
                "patch {value} is outside the range in which its polynomials cannot overflow, or the edges of the region are wrong; in a run: pass {value} meets more than 32 edges of it"
            ),
            "with spacing = \"constant\" within a region: write spacing = \"exact\", or cut the region into several jobs; else this is a defect of the host tool: please report the job",
        ),
        FaultKind::BadLength => (
            format!("the job's data have the wrong length; {value} words arrived"),
            "load the job again",
        ),
        FaultKind::WrongState => (
            "the machine's state does not allow this".to_owned(),
            "`operate status` tells the state; docs/operating.md, which command it allows",
        ),
        FaultKind::DeadlineMissed => (
            format!("{value} deadlines of the sample timer were missed"),
            "this is a defect of the firmware, or a debugger halted the chip",
        ),
        FaultKind::TickOverBudget => (
            format!("a tick took {value} cycles, more than the board's limit"),
            "this is a defect of the firmware: please report the job",
        ),
        FaultKind::SoftLimit => (
            format!("an axis would be {value:.3} mm outside its travel"),
            "move the part with [placement], or correct `travel_mm` in [machine]",
        ),
        FaultKind::LinkBlocked if value > 0.0 => (
            format!("the tool centre would be {value:.3} mm above the safe height"),
            "raise `safe_z_mm` in [machine]",
        ),
        FaultKind::LinkBlocked => (
            "the surface does not face up at a point of retract or plunge".to_owned(),
            "turn the part so that it faces up ([placement]), or take the pattern \"zigzag\" where only the ends of passes are in the way",
        ),
        FaultKind::EmergencyStop => (
            "the emergency stop was pressed: the drives are off, the home position is lost".to_owned(),
            "release the button; then `operate acknowledge`, `on`, and `home`",
        ),
        FaultKind::LimitSwitch => (
            inputs("an axis is at the end of its travel", fault),
            "jog the axis off its switch, from x- by `operate jog x+2`; without a machine profile: `off`, move it by hand, `on`, and declare home again",
        ),
        FaultKind::DriveFault => (
            inputs(
                "the drives are off and the home position is lost because of",
                fault,
            ),
            "find the cause at the drive; then `operate acknowledge`, `on`, and `home`",
        ),
        FaultKind::NotHomed => (
            "the machine is not homed: the position of its axes has not been declared".to_owned(),
            "home it by its switches: `operate on`, `operate home`; or position the axes by hand and declare where they stand: `operate home X,Y,Z`. On a bench without axes: homing_required = false in [machine]",
        ),
        FaultKind::StepRate => (
            format!("an axis demands {value} steps in one period, more than the capacity of a period"),
            "lower the feed, or set coarser microsteps and steps_per_mm with them",
        ),
        FaultKind::StepOutput => (
            if value > 0.0 {
                format!(
                    "the direction pins were set {value} slots late, within the pulses of an axis that reverses"
                )
            } else {
                "the DMA that outputs the step pulses has stopped".to_owned()
            },
            "home the machine; this is a defect of the firmware, or a debugger halted the chip",
        ),
        FaultKind::SpindleSpeed => (
            format!("the spindle did not report that it turns at {value} turns a minute"),
            "look at the spindle's drive and at the wire of its contact; give it more time (`at_speed_ms` in the profile's [spindle]); then abort to acknowledge",
        ),
        FaultKind::DoorOpen => (
            "the safety door is open".to_owned(),
            "close it; `operate status` then no longer names it",
        ),
    }
}

/// A sentence with the inputs that a fault names.
fn inputs(what: &str, fault: Fault) -> String {
    let names: Vec<_> = FaultReport::from(fault).lines().names().collect();
    format!("{what}: {}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frame::FrameError;
    use protocol::message::{Clock, Reason};

    #[test]
    fn every_fault_is_explained_by_number_and_name() {
        for kind in FaultKind::ALL {
            let by_number = entry(&kind.code().to_string()).unwrap();
            let by_name = entry(kind.name()).unwrap();
            assert_eq!((by_number.code, by_name.code), (kind.code(), kind.code()));
            assert_eq!(by_number.family, Family::Fault);
        }
    }

    /// One of each kind.
    fn reasons() -> Vec<Reason> {
        vec![
            Reason::BadFrame {
                error: FrameError::TooLong,
            },
            Reason::Unreadable,
            Reason::SayHello,
            Reason::Version { host: 1, board: 2 },
            Reason::OutOfOrder { expected: 7 },
            Reason::WrongState {
                state: interp_core::State::Running,
            },
            Reason::WrongClock { clock: Clock::Free },
            Reason::Busy,
            Reason::Job {
                fault: FaultReport { code: 1, value: 0.5 },
                record: None,
            },
            Reason::TooLong { limit: 1, wanted: 2 },
            Reason::NoUpload,
            Reason::WrongOffset { expected: 3 },
            Reason::Incomplete {
                wanted: 2,
                received: 1,
            },
            Reason::WrongDigest {
                wanted: 1,
                received: 2,
            },
            Reason::Unsafe {
                fault: FaultReport { code: 20, value: 0.0 },
            },
            Reason::DrivesOff,
            Reason::OutOfRange {
                most: 200,
                wanted: 201,
            },
            Reason::Unsupported,
            Reason::NotAtHome {
                home_nm: [1, -2, 3],
                stands_nm: Some([4, 5, 6]),
            },
            Reason::EventGone { first: 4 },
            Reason::BeyondProfile {
                excess: protocol::message::Excess::of(protocol::message::ProfileLimit::Jerk),
            },
            Reason::BadProfile,
            Reason::Storage,
            Reason::OtherProfile,
            Reason::NoLimits,
            Reason::Moving,
            Reason::NoProfile,
            Reason::BeyondTravel {
                axis: 0,
                travel_nm: [0, 1],
                wanted_nm: 2,
            },
            Reason::NoHoming,
            Reason::ProbeTripped,
            Reason::NoSpindle,
            Reason::RowsGone,
            Reason::WholeOnly,
            Reason::SpindleTurns,
            Reason::NoFeed,
            Reason::NoStoredJob,
            Reason::NoRoom { words: 7 },
            Reason::NothingToResume,
            Reason::BadSpeed { mm_s: -1.0 },
        ]
    }

    /// Every code of the wire has an entry, and every entry a code of the wire.
    #[test]
    fn every_reason_is_explained() {
        let reasons = reasons();
        for (index, reason) in reasons.iter().enumerate() {
            let mut buffer = [0; 64];
            let bytes = postcard::to_slice(reason, &mut buffer).unwrap();
            assert_eq!((bytes[0], usize::from(reason.code())), (reason.code(), index));
            let entry = entry(&format!("R{index}")).unwrap();
            assert_eq!((entry.family, entry.code), (Family::Reason, reason.code()));
        }
        let mut beyond = [0; 32];
        beyond[0] = u8::try_from(reasons.len()).unwrap();
        assert!(postcard::from_bytes::<Reason>(&beyond).is_err());
        assert_eq!(reasons::ENTRIES.len(), reasons.len());
    }

    #[test]
    fn names_are_unique_and_texts_are_whole() {
        let mut names: Vec<_> = entries().iter().map(|entry| entry.name).collect();
        names.sort_unstable();
        let count = names.len();
        names.dedup();
        assert_eq!(names.len(), count);
        for entry in entries() {
            for text in [entry.meaning, entry.value, entry.why, entry.remedy, entry.example] {
                assert!(
                    text.ends_with('.')
                        && text.starts_with(|c: char| !c.is_lowercase() || text.starts_with("jobs/")),
                    "{}: {text}",
                    entry.name
                );
            }
        }
    }
}
