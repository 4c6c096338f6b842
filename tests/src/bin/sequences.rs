//! The campaign of random command sequences: `cargo run --release -p integration-tests --bin sequences -- FROM COUNT`. Each seed is a sequence of its own,
//! so a campaign goes on with the seed after the last.

use integration_tests::sequences::{Trajectory, run_all};
use std::process::ExitCode;

/// Seeds between two lines of progress.
const TOLD: u64 = 1000;

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u64>());
    let (Some(Ok(from)), Some(Ok(count)), None) = (numbers.next(), numbers.next(), numbers.next()) else {
        eprintln!("sequences FROM COUNT: runs the sequences of COUNT seeds, the first one FROM");
        return ExitCode::from(2);
    };
    let courses = Trajectory::all();
    let mut failed = false;
    let mut first = from;
    while first < from + count {
        let next = (first + TOLD).min(from + count);
        let (outcome, errors) = run_all(&courses, first..next);
        println!(
            "seeds {first} to {}: {} periods, {:.4?} of the limits, longest hold {:?}, stands {} (longest {:?})",
            next - 1,
            outcome.periods,
            outcome.worst,
            outcome.hold,
            outcome.stands.len(),
            outcome.stand
        );
        for (seed, periods) in outcome.stands {
            println!("seed {seed} stands for {periods} periods");
        }
        for error in errors {
            failed = true;
            println!("{error}");
        }
        first = next;
    }
    ExitCode::from(u8::from(failed))
}
