//! Random sequences of operator commands on passes within random regions.

use integration_tests::sequences::{Outcome, Trajectory, run_all};
use job::{AxisLimits, Side};
use machine::Machine;
use machine::links::{self, Link};
use machine::prepare::prepare;

use super::{random_job, seeds};

/// Sequences on each job.
const EACH: u64 = 30;
/// Most links of a job that are straight; half of the jobs have none.
const LINKS: usize = 100;
/// Fewest passes of a job that is run.
const PASSES: u32 = 3;

/// The job of a random region with axis limits, and its undisturbed run. None of a region that holds no pass, or few, and of a run that ends in a fault.
fn course(seed: u64, is_curved: bool) -> Option<Trajectory> {
    let mut job = random_job(seed, is_curved);
    (job.machine.limits, job.side) = (Some(AxisLimits::DEFAULT), Side::Up);
    let (job, _) = machine::direction::choose(job).ok()?;
    let mut prepared = prepare(&job).unwrap();
    if (seed / 2).is_multiple_of(2) {
        links::add(&mut prepared, &[Link::Straight; LINKS]);
    }
    let mut machine = Machine::load(&prepared).unwrap();
    let mut pass = 0;
    let end = machine.run(|sample| {
        pass = sample.pass;
        true
    });
    if let Err(fault) = end {
        println!("seed {seed}: {fault:?}");
    }
    (end.is_ok() && pass >= PASSES)
        .then(|| Trajectory::of(&format!("region {seed} {:?}", job.spacing), &prepared))
}

/// Limits are kept, each pass ends where it does without commands, the tool never stands in contact, and each run comes to its end.
fn run_sequences(is_curved: bool) {
    let (mut all, mut errors) = (Outcome::default(), Vec::new());
    let seeds = seeds(8);
    let least = (seeds.end - seeds.start) * EACH / 2;
    for seed in seeds {
        let Some(course) = course(seed, is_curved) else {
            continue;
        };
        let (outcome, broken) = run_all(&[course], seed * EACH..(seed + 1) * EACH);
        println!("seed {seed}: {outcome:?}");
        all.add(&outcome);
        errors.extend(broken);
    }
    println!("{all:?}");
    assert!(errors.is_empty(), "{errors:#?}");
    assert!(all.stands.is_empty(), "{:?}", all.stands);
    assert!(all.count as u64 >= least, "{} sequences", all.count);
}

#[test]
fn no_sequence_breaks_a_limit_on_curved_passes() {
    run_sequences(true);
}

#[test]
fn no_sequence_breaks_a_limit_on_straight_passes() {
    run_sequences(false);
}

/// Changes of the pace where the plan's own jerk changes by its whole limit within an interval of the plan. A change that kept the limit in the middle of a slot once used up to
/// 1.064 of it at the slot's start.
#[test]
fn a_pace_that_changes_where_the_jerk_does() {
    for (region, sequence) in [(239, 7185), (418, 12546), (502, 15076), (518, 15567)] {
        let course = course(region, true).unwrap();
        let (outcome, errors) = run_all(&[course], sequence..sequence + 1);
        assert_eq!((outcome.count, errors), (1, Vec::<String>::new()));
    }
}

/// The tool rises for every wait at the end of a pass: of up to 15 ms it stood here.
#[test]
fn no_wait_is_in_contact() {
    for (region, is_curved, sequence) in [(88, false, 2649), (105, true, 3151), (513, true, 15396)] {
        let course = course(region, is_curved).unwrap();
        let (outcome, errors) = run_all(&[course], sequence..sequence + 1);
        assert_eq!((outcome.stands, errors), (vec![], Vec::<String>::new()));
    }
}
