//! Random sequences of hold, resume, start, stop, abort and override, on hops, step-overs, turns and curves. The campaign of a million is a command of its
//! own, `cargo run --release -p integration-tests --bin sequences -- 0 1000000`.

use integration_tests::sequences::{Course, run_all};

#[test]
fn no_sequence_of_commands_breaks_a_limit() {
    let (outcome, errors) = run_all(&Course::all(), 0..400);
    println!("{outcome:?}");
    assert_eq!((outcome.count, errors), (400, Vec::<String>::new()));
}

/// The tool stands at the start of the first pass already: no leg has a length. The retract that an abort had ended was followed to its end, 8 mm above, and the
/// next sample was on the pass (one of 70 000 sequences).
#[test]
fn a_start_from_where_the_first_pass_begins() {
    let outcome = Course::all()[1].start_again_from_the_first_pass().unwrap();
    assert_eq!(outcome.count, 92);
}

/// Where the plan is near the feed, the tool moves at exactly that: a slower pace that relied on the plan's own jerk used 1.026 of the limit.
#[test]
fn a_slower_pace_from_the_feed() {
    let course = Course::of_region(1, "[[0.1, 0.1], [0.9, 0.11], [0.9, 0.8], [0.1, 0.8]]");
    let outcome = course.pause_at_each_place().unwrap();
    assert!(outcome.count > 100, "{}", outcome.count);
}
