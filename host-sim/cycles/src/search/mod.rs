//! Search for the worst-case tick: random and adversarial jobs, then hill climbing from the worst found.
//!
//! ```text
//!  genes ──job──► prepare ──► one QEMU session ──► worst-case tick of a job ──► elite ──mutation──► genes
//! ```
//!
//! Every tick of a run is considered, including those without a sample. The worst are repeated with coincident events: a command in
//! the same tick, a resume from a hold, samples reported, the last tick of the run. Jobs with limits also run under random commands
//! of an operator.

pub mod genes;
pub mod text;

use std::collections::BTreeSet;

use fastrand::Rng;
use interp_core::State;

use super::BudgetError;
use super::figures::{Model, tick_cycles};
use super::session::{MeasurementSession, WorstTick};
use genes::{Genes, JobClass};
use job::Job;
use machine::Machine;
use machine::prepare::{Prepared, prepare};
use machine::remote::RemoteError;

/// Ticks measured of a job without axis limits.
const TICKS: u32 = 600;
/// Ticks measured of a job with axis limits, whose look-ahead takes some thousand ticks before the first pass.
const TICKS_WITHIN_LIMITS: u32 = 4500;

/// Number of jobs that hill climbing starts from.
const ELITE: usize = 8;

/// Least number of samples of a run that is always measured.
const SAMPLES_MIN: u32 = 4;
/// Of runs with fewer samples than [`SAMPLES_MIN`], one in this number is measured.
const SHORT: u8 = 8;

/// Share of jobs drawn at random; the others are mutations of the worst so far.
const RANDOM_SHARE: f64 = 0.35;

/// A job with its worst-case tick.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The job.
    pub job: Job,
    /// Its worst-case tick.
    pub worst: WorstTick,
    genes: Genes,
}

impl Candidate {
    fn cycles(&self) -> u32 {
        tick_cycles(&self.worst.record, Model::Pessimistic)
    }
}

/// Result of a search.
#[derive(Clone, Debug, Default)]
pub struct SearchResult {
    /// The worst jobs, the worst first.
    pub elite: Vec<Candidate>,
    /// Number of jobs that ran.
    pub executed: u32,
    /// Number of jobs that the host or the board refused.
    pub refused: u32,
    /// Number of jobs left out because they fault within a few samples.
    pub skipped: u32,
    /// Samples of all runs.
    pub samples: u64,
    /// Names of the faults that ended runs.
    pub faults: BTreeSet<&'static str>,
}

/// Prepares a job; `None` if it is refused. Whether it yields at least [`SAMPLES_MIN`] samples: one that faults before is seldom
/// measured.
fn prepared(job: &Job) -> Option<(Prepared, bool)> {
    let prepared = prepare(job).ok()?;
    let mut machine = Machine::load(&prepared).ok()?;
    let (mut samples, mut ticks) = (0, 0);
    // The board's run decides how it ends.
    let _ = machine.run(|sample| {
        ticks += 1;
        samples += u32::from(sample.state == State::Running);
        samples < SAMPLES_MIN && ticks < TICKS_WITHIN_LIMITS
    });
    Some((prepared, samples >= SAMPLES_MIN))
}

/// Searches `jobs` jobs of a class; the same seed gives the same jobs. Calls `progress` after each.
///
/// # Errors
/// QEMU or the connection to it fails.
pub fn search(
    session: &mut MeasurementSession,
    jobs: u32,
    seed: u64,
    class: JobClass,
    mut progress: impl FnMut(),
) -> Result<SearchResult, BudgetError> {
    let mut random = Rng::with_seed(seed);
    let mut result = SearchResult::default();
    for _ in 0..jobs {
        let genes = draw(&mut random, &result.elite);
        let job = genes.job(class);
        match prepared(&job) {
            Some((prepared, runs)) if runs || random.u8(..SHORT) == 0 => {
                try_job(session, &mut result, genes, job, &prepared)?;
            }
            Some(_) => result.skipped += 1,
            None => result.refused += 1,
        }
        progress();
    }
    Ok(result)
}

fn draw(random: &mut Rng, elite: &[Candidate]) -> Genes {
    if elite.is_empty() || random.f64() < RANDOM_SHARE {
        return if random.u8(..4) == 0 {
            Genes::random(random)
        } else {
            Genes::adversarial(random)
        };
    }
    // Prefers the worst.
    let among = random.usize(1..=elite.len());
    elite[random.usize(..among)].genes.mutated(random)
}

fn try_job(
    session: &mut MeasurementSession,
    result: &mut SearchResult,
    genes: Genes,
    job: Job,
    prepared: &Prepared,
) -> Result<(), BudgetError> {
    let ticks = if prepared.header.axes.is_some() {
        TICKS_WITHIN_LIMITS
    } else {
        TICKS
    };
    let run = match session.run(prepared, ticks) {
        Err(BudgetError::Remote(RemoteError::Refused { .. })) => {
            result.refused += 1;
            return Ok(());
        }
        run => run?,
    };
    result.executed += 1;
    result.samples += u64::from(run.samples);
    result.faults.extend(run.fault);
    let least = result.elite.last().map_or(0, Candidate::cycles);
    // Coincident events cost some hundred cycles; a tick that is far below needs no second run.
    if result.elite.len() == ELITE && run.cycles_max() + COINCIDENT_CYCLES_MAX < least {
        return Ok(());
    }
    let worst = session.worst_tick(prepared, &run)?;
    result.elite.push(Candidate { job, worst, genes });
    result
        .elite
        .sort_by_key(|found| std::cmp::Reverse(found.cycles()));
    result.elite.truncate(ELITE);
    Ok(())
}

/// Greatest number of cycles that coincident commands and reports add to a tick.
const COINCIDENT_CYCLES_MAX: u32 = 1500;
