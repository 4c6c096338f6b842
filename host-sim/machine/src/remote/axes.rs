//! Motion outside a job, as an operator asks for it: followed to its end, and what came of it in sentences.

use std::time::Duration;

use protocol::message::{Activity, InputLines, MotionEnd, MotionStatus, Request};

use super::session::{RemoteError, Session};

/// Interval of the requests that keep a motion going.
const LOOK: Duration = Duration::from_millis(20);

/// Asks for a motion, and follows it until the axes rest. `goes_on` is asked on the way; at its first no the axes are stopped along their ramp.
///
/// # Errors
/// The line breaks, or the board refuses.
pub fn go(
    session: &mut Session,
    request: &Request,
    mut goes_on: impl FnMut() -> bool,
) -> Result<MotionStatus, RemoteError> {
    session.command(request)?;
    loop {
        std::thread::sleep(LOOK);
        let motion = session.motion()?;
        if motion.activity == Activity::Rest {
            return Ok(motion);
        }
        if !goes_on() {
            return stop(session);
        }
    }
}

/// Stops axes that move, along their ramp, and waits until they rest.
///
/// # Errors
/// The line breaks.
pub fn stop(session: &mut Session) -> Result<MotionStatus, RemoteError> {
    match session.command(&Request::Hold) {
        // At rest by now.
        Ok(()) | Err(RemoteError::Refused { .. }) => {}
        Err(error) => return Err(error),
    }
    loop {
        let motion = session.motion()?;
        if motion.activity == Activity::Rest {
            return Ok(motion);
        }
        std::thread::sleep(LOOK);
    }
}

/// Names of inputs, as they are in a sentence.
fn names(lines: InputLines) -> String {
    let names: Vec<_> = lines.names().collect();
    if names.is_empty() {
        "an input".to_owned()
    } else {
        names.join(", ")
    }
}

/// Why a motion ended early, and the remedy; `None` for one that was carried out.
#[must_use]
pub fn failure(motion: &MotionStatus) -> Option<(String, &'static str)> {
    let lines = names(motion.lines);
    Some(match motion.end {
        MotionEnd::None | MotionEnd::Done => return None,
        MotionEnd::Stopped => ("stopped by the operator".to_owned(), "ask again to go on"),
        MotionEnd::HostGone => (
            "the board stopped the motion, because this computer was not heard".to_owned(),
            "check the line and the computer's load, and ask again",
        ),
        MotionEnd::LimitSwitch => (
            format!("{lines} stopped the motion"),
            "jog away from it; once homed, the travel of the profile keeps the axes off the switches",
        ),
        MotionEnd::Door => (
            "the safety door was opened: the axes have stopped along their ramp".to_owned(),
            "close it and ask again; while it is open, axes move at 33 mm/s at most",
        ),
        MotionEnd::StepRate => (
            "an axis was to make more steps than a period holds: the axes have stopped along their ramp, and no step is lost".to_owned(),
            "lower its velocity_max_mm_s in the profile, take coarser microsteps or a shorter pulse_us",
        ),
        MotionEnd::StepOutput => (
            "the board could not output its step pulses in time: the position is lost".to_owned(),
            "home again; if it recurs, report it: explain step-output",
        ),
        MotionEnd::DrivesOff => (
            "the drives went off: emergency stop or drive fault".to_owned(),
            "release it, then: operate acknowledge, operate on, and home again",
        ),
        MotionEnd::NotTripped => (
            "the probe did not trip on the way".to_owned(),
            "start nearer, or ask for more; press the probe by hand: operate status must name it",
        ),
        MotionEnd::Bounces => (
            format!("{lines} does not stay closed: its contact bounces, or picks up noise"),
            "check plug, cable and screen; replace the switch",
        ),
        MotionEnd::NotFound => (
            format!("{lines} was not found"),
            "press it by hand: operate status must name it; if it does, check travel_mm, at_upper_end and direction_inverted in the profile",
        ),
        MotionEnd::Stuck => (
            format!("{lines} does not release"),
            "it is stuck, its wire is broken, its plug is out, or it closes when pressed; it must open when pressed",
        ),
        MotionEnd::WrongSwitch => (
            format!("{lines} tripped, which is not the switch that was looked for"),
            "plugs are swapped, the axis turns the wrong way (direction_inverted), or its switch is at the other end (at_upper_end); press each switch by hand and compare with operate status",
        ),
    })
}
