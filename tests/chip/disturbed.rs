//! Runs that a safety input, a processor that hangs, a hard fault or a brown-out ends.

use boards::{Board, SKR_PRO, STM32F405};

use super::emulated::{CYCLES_US, Emulated, Ended, Job, PERIOD, RESET_CYCLES_US, REST_US};

/// A run with an event a third of a second after the first pulse. Returns the output of `run`, and of `operate status` after it.
fn disturbed(board: &'static Board, what: &str) -> (Ended, String, String) {
    let emulated = Emulated::recorded(board, &["--seed", "6", "--at", &format!("motion+333.3:{what}")]);
    let (done, said) = emulated.run(&Job::slow_square().path, "0,0,60");
    assert!(!done, "{what}: {said}");
    let status = emulated.status();
    let ended = emulated.end();
    ended.no_complaint();
    // A processor that has stopped receives nothing.
    if ended.number("resets") == 0 {
        ended.no_byte_lost();
    }
    (ended, said, status)
}

/// Emergency stop and drive fault switch the drives off: immediately, and after three ticks. A limit switch stops the run along its path.
#[test]
fn each_safety_input_stops_the_run() {
    // Measured from the edge: the next tick and its execution time; for the drive fault two more ticks, because three in a row must see it.
    let at_once = PERIOD + 100 * CYCLES_US;
    let (board, every) = (
        &STM32F405,
        [
            "emergency-stop",
            "drive-fault",
            "x-min",
            "x-max",
            "y-min",
            "y-max",
            "z-min",
            "z-max",
        ],
    );
    let some = ["emergency-stop", "drive-fault", "z-max"];
    for (board, input) in every
        .map(|input| (board, input))
        .into_iter()
        .chain(some.map(|input| (&SKR_PRO, input)))
    {
        let (ended, said, status) = disturbed(board, input);
        let event = ended.event(input);
        let off = ended.drives(false, event).map(|at| at - event);
        match input {
            "emergency-stop" => assert!(off.is_some_and(|off| off <= at_once), "{off:?}"),
            "drive-fault" => assert!(
                off.is_some_and(|off| (2 * PERIOD..=at_once + 2 * PERIOD).contains(&off)),
                "{off:?}"
            ),
            _ => {
                assert_eq!(off, None, "{input}: the drives hold");
                // 10 mm/s at 100 mm/s^2 and 1000 mm/s^3: 0.2 s.
                let stopped = ended.last_pulse(u64::MAX) - event;
                assert!(
                    (2 * PERIOD..400 * PERIOD).contains(&stopped),
                    "{input}: {stopped}"
                );
            }
        }
        let name = if input.contains('-') && input.len() == 5 {
            "limit"
        } else {
            &input.replace('-', " ")
        };
        assert!(
            said.contains(name) && status.contains(name),
            "{input}: {said}\n{status}"
        );
    }
}

/// If the processor hangs, the watchdog resets the chip 8 to 23 ms after it was last reloaded, at any LSI frequency; pulses stop earlier.
#[test]
fn a_processor_that_hangs_is_reset() {
    for (lsi_hz, us) in [("47000", 8_000), ("32000", 11_750), ("17000", 22_118)] {
        let emulated = Emulated::recorded(&STM32F405, &["--lsi-hz", lsi_hz, "--at", "motion+333.3:hang"]);
        let (done, said) = emulated.run(&Job::slow_square().path, "0,0,60");
        assert!(!done, "{said}");
        let status = emulated.status();
        let ended = emulated.end();
        ended.no_complaint();
        let (hang, reset) = (ended.event("hang"), ended.event("reset"));
        assert!(
            ended.last_pulse(reset) - hang <= 2 * PERIOD,
            "what was worked out, and no more"
        );
        let after_us = (reset - hang) / CYCLES_US;
        assert!(
            (us - 1_100..=us + 10).contains(&after_us),
            "{lsi_hz} Hz: {after_us} us"
        );
        let rest = ended.rest_after(reset, reset + REST_US * RESET_CYCLES_US);
        assert!(rest > reset, "the outputs were let go, and set again");
        assert!(status.contains("last reset: watchdog"), "{status}");
    }
}

/// A hard fault: the outputs go to rest first, then the fault is logged, then the watchdog resets the chip.
#[test]
fn a_hard_fault_puts_the_outputs_to_rest() {
    let (ended, _, status) = disturbed(&SKR_PRO, "fault");
    let (fault, reset) = (ended.event("fault"), ended.event("reset"));
    assert_eq!(ended.number("hard_faults"), 1);
    let off = ended.drives(false, fault).unwrap() - fault;
    assert!(off <= 20 * CYCLES_US, "{off} cycles");
    assert!(ended.last_pulse(reset) - fault <= 2 * PERIOD);
    assert!(status.contains("last reset: watchdog"), "{status}");
}

/// Brown-out: the outputs float, are inactive again within 100 us, and stay inactive; the status reports the cause.
#[test]
fn a_brown_out_leaves_everything_at_rest() {
    for board in [&STM32F405, &SKR_PRO] {
        let (ended, _, status) = disturbed(board, "brown-out");
        let reset = ended.event("reset");
        assert_eq!(ended.number("resets"), 1);
        let rest = ended.rest_after(reset, reset + REST_US * RESET_CYCLES_US);
        assert!(rest > reset);
        assert_eq!(ended.drives(true, reset), None, "no drive is on afterwards");
        assert!(status.contains("brown"), "{status}");
    }
}
