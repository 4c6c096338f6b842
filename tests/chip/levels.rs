//! Step pulses and drive enables whose levels the machine's profile inverts: on the pins, before and after a processor fault and a reset.

use boards::{Axis, Level, Line, SKR_PRO};

use super::emulated::{CYCLES_US, Emulated, Job, sim};

const PROFILE: &str = "[machine]
velocity_max_mm_s = [20, 20, 10]
acceleration_max_mm_s2 = [100, 100, 50]
jerk_max_mm_s3 = [1000, 1000, 500]
steps_per_mm = [400, 400, 400]
pulse_us = 2
step_inverted = [true, false, true]
enable_inverted = [false, true, false]
";
const STEP_INVERTED: [bool; 3] = [true, false, true];
const ENABLE_INVERTED: [bool; 3] = [false, true, false];
const PULSE_US: u64 = 2;

/// Longest time from a reset until the pins have the profile's levels, cycles: two seconds and a half, because two sectors are erased first, a second each, once after the first
/// record. Until then the pins have the levels of the board's table.
const LEVELS_CYCLES: u64 = 2_500_000 * CYCLES_US;

/// The active level of a line.
fn active(line: &Line, is_inverted: bool) -> bool {
    (line.active == Level::High) != is_inverted
}

#[test]
fn levels_of_steps_and_enables_are_the_profiles() {
    let board = &SKR_PRO;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("machine.toml");
    std::fs::write(&file, PROFILE).unwrap();
    let emulated = Emulated::recorded(board, &["--seed", "7", "--at", "motion+1500:fault"]);
    let port = emulated.port();
    let (done, said) = sim(["settings", "--port", &port, "--machine", file.to_str().unwrap()]);
    assert!(done, "{said}");
    assert!(said.contains("step_inverted = [true, false, true]\n"), "{said}");
    let (done, said) = emulated.run(&Job::square(20.0, 600.0, "").path, "0,0,60");
    assert!(!done, "{said}");
    let status = emulated.status();
    assert!(status.contains("last reset: watchdog"), "{status}");
    let ended = emulated.end();
    ended.no_complaint();
    let (fault, reset) = (ended.event("fault"), ended.event("reset"));

    for axis in Axis::ALL {
        let (lines, index) = (board.axis(axis), axis as usize);
        // The level at a time.
        let at = |line: &Line, cycle: u64| {
            let changes = ended.changes(line);
            changes.iter().rfind(|(at, _)| *at <= cycle).unwrap().1
        };
        // Pulses have their length, and the pin is idle at the other level between them.
        let on = active(&lines.step, STEP_INVERTED[index]);
        let steps = ended.changes(&lines.step);
        let moved = ended.first_pulse();
        let widths: Vec<u64> = steps
            .windows(2)
            .filter(|pair| pair[0].0 >= moved && pair[1].0 < fault && pair[0].1 == Some(on))
            .map(|pair| pair[1].0 - pair[0].0)
            .collect();
        assert!(
            axis == Axis::Y || widths.len() > 500,
            "{axis:?}: {}",
            widths.len()
        );
        assert!(
            widths.iter().all(|width| *width == PULSE_US * CYCLES_US),
            "{axis:?}"
        );
        assert_eq!(
            at(&lines.step, moved - 1),
            Some(!on),
            "{axis:?} before the first pulse"
        );
        // The drive is on in the run, off within 20 us of the fault, and off again after the reset.
        let holds = active(&lines.enable, ENABLE_INVERTED[index]);
        assert_eq!(
            at(&lines.enable, fault - 1),
            Some(holds),
            "{axis:?}: the drive is on"
        );
        assert_eq!(
            at(&lines.enable, fault + 20 * CYCLES_US),
            Some(!holds),
            "{axis:?}: off by the fault"
        );
        let last = |line: &Line| {
            let changes = ended.changes(line);
            changes.last().copied().unwrap()
        };
        for (line, level) in [(&lines.enable, !holds), (&lines.step, !on)] {
            let (since, is) = last(line);
            assert_eq!(is, Some(level), "{} after the reset", line.role);
            println!(
                "{}: {} cycles after the reset",
                line.role,
                since.saturating_sub(reset)
            );
            assert!(since.saturating_sub(reset) <= LEVELS_CYCLES, "{}", line.role);
        }
    }
}
