//! Random sequences of hold, resume, start, stop, abort and override, on hops, step-overs, turns and curves. The campaign of a million is a command of its
//! own, `cargo run --release -p integration-tests --bin sequences -- 0 1000000`.

use integration_tests::sequences::{Trajectory, run, run_all};
use interp_core::Command;

/// Longest hold, periods of a millisecond.
const HOLD_MAX: usize = 400;

#[test]
fn no_sequence_of_commands_breaks_a_limit() {
    let (outcome, errors) = run_all(&Trajectory::all(), 0..400);
    println!("{outcome:?}");
    assert_eq!((outcome.count, errors), (400, Vec::<String>::new()));
    assert!(outcome.hold.0 <= HOLD_MAX, "{:?}", outcome.hold);
    assert_eq!(outcome.stands, []);
}

/// Of a million sequences, the first ones with the longest holds: 404 to 413 ms where each attempt for a stop took a share of the change that had failed, up to the place at which it had.
/// And those that stood for 32 to 40 ms at the end of a pass where the slots of a stop on a pass never became shorter.
#[test]
fn the_longest_holds_and_stands_of_the_campaign() {
    let courses = Trajectory::all();
    for seed in [
        731_760, 885_837, 400_901, 268_253, 282_779, 45_862, 395_624, 418_900,
    ] {
        let outcome = run(&courses, seed).unwrap();
        assert!(outcome.hold.0 <= HOLD_MAX, "{seed}: {} periods", outcome.hold.0);
        assert_eq!(outcome.stands, []);
    }
}

/// The tool stands at the start of the first pass already: no leg has a length. The retract that an abort had ended was followed to its end, 8 mm above, and the
/// next sample was on the pass (one of 70 000 sequences).
#[test]
fn a_start_from_where_the_first_pass_begins() {
    let outcome = Trajectory::all()[1].start_again_from_the_first_pass().unwrap();
    assert_eq!(outcome.count, 92);
}

/// Where the plan is near the feed, the tool moves at exactly that: a slower pace that relied on the plan's own jerk used 1.026 of the limit.
#[test]
fn a_slower_pace_from_the_feed() {
    let course = Trajectory::of_region(1, "[[0.1, 0.1], [0.9, 0.11], [0.9, 0.8], [0.1, 0.8]]");
    let outcome = course.pause_at_each_place().unwrap();
    assert!(outcome.count > 100, "{}", outcome.count);
}

/// Longest stand in contact that no command has asked for, periods.
const STAND_MAX: u32 = 4;

/// The pass was planned for 200 %, so it lasted as long as the planning of the next one. The search for 100 % took the planning's time, and at the end of the pass the planner went on with
/// steps for which it took the time of a whole pass as left: 181 ms.
#[test]
fn a_lower_override_does_not_make_the_next_plan_late() {
    let steps = [
        (0, None, 200),
        (301, Some(Command::Resume), 200),
        (641, None, 100),
    ];
    let course = &Trajectory::all()[1];
    for wait in [560, 600, 620, 641, 660] {
        let mut steps = steps;
        steps[2].0 = wait;
        let outcome = course.run_from(3313, &steps).unwrap();
        assert!(
            outcome.stand.0 <= STAND_MAX,
            "{wait}: {} periods",
            outcome.stand.0
        );
    }
}

/// A hold near the end of a pass, resumed in any period around that end: the hop began at rest, and its pace was sought for 99 ms, though it can begin at any.
#[test]
fn a_resume_at_the_end_of_a_pass_is_followed_at_once() {
    let course = &Trajectory::all()[0];
    for wait in 30..45 {
        let steps = [(55, Some(Command::Hold), 100), (wait, Some(Command::Resume), 95)];
        let outcome = course.run_from(7959, &steps).unwrap();
        assert!(
            outcome.stand.0 <= STAND_MAX,
            "{wait}: {} periods",
            outcome.stand.0
        );
    }
}
