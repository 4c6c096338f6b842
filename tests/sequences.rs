//! Random sequences of hold, resume, start, stop, abort and override, on hops, step-overs, turns and curves. The campaign of a million is a command of its
//! own, `cargo run --release -p integration-tests --bin sequences -- 0 1000000`.

use integration_tests::sequences::{Course, run_all};

#[test]
fn no_sequence_of_commands_breaks_a_limit() {
    let (outcome, errors) = run_all(&Course::all(), 0..400);
    println!("{outcome:?}");
    assert_eq!((outcome.count, errors), (400, Vec::<String>::new()));
}
