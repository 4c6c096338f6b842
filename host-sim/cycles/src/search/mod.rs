//! The search for the worst tick: jobs at random and made to be bad, then hill climbing from the worst found.
//!
//! ```text
//!  genes ──job──► prepare ──► one QEMU for all (lab) ──► worst tick of a job ──► elite ──mutation──► genes
//! ```
//!
//! Of each job's run every tick counts, also one that yields no sample. The worst are run again so that all that can come together
//! with them does: a command in the same tick, a resume from a hold, samples reported, the run's ticks used up. Jobs with limits also
//! run with an operator who holds, resumes, overrides, stops and aborts at any moment.

pub mod genes;
pub mod text;

use std::collections::BTreeSet;

use fastrand::Rng;
use interp_core::State;

use super::BudgetError;
use super::figures::{Model, whole};
use super::lab::{Lab, Worst};
use genes::Genes;
use job::Job;
use machine::Machine;
use machine::prepare::{Prepared, prepare};
use machine::remote::RemoteError;

/// Ticks of each job, and of one with limits: before its first pass it is looked over, which takes some thousand.
const TICKS: u32 = 600;
const TICKS_WITHIN_LIMITS: u32 = 4500;

/// Jobs that hill climbing starts from.
const ELITE: usize = 8;

/// Samples of a run that is long enough, and of how many shorter ones one is tried.
const SAMPLES_MIN: u32 = 4;
const SHORT: u8 = 8;

/// Share of the jobs that are drawn afresh; the others come of the worst so far.
const FRESH: f64 = 0.35;

/// A job, and its worst tick.
#[derive(Clone, Debug)]
pub struct Found {
    /// The job.
    pub job: Job,
    /// Its worst tick.
    pub worst: Worst,
    genes: Genes,
}

impl Found {
    fn cycles(&self) -> u32 {
        whole(&self.worst.record, Model::Pessimistic)
    }
}

/// What a campaign came to.
#[derive(Clone, Debug, Default)]
pub struct Campaign {
    /// The worst jobs, the very worst first.
    pub elite: Vec<Found>,
    /// Jobs that ran.
    pub ran: u32,
    /// Jobs that the host or the board refused.
    pub refused: u32,
    /// Jobs that would have faulted at once.
    pub skipped: u32,
    /// Samples that they made: ticks besides those that ended a run.
    pub samples: u64,
    /// Names of the faults that ended runs.
    pub faults: BTreeSet<&'static str>,
}

/// A job that the machine takes, and whether it gets as far as a few samples: one that faults at once has little to show.
fn prepared(job: &Job) -> Option<(Prepared, bool)> {
    let prepared = prepare(job).ok()?;
    let mut machine = Machine::load(&prepared).ok()?;
    let (mut samples, mut ticks) = (0, 0);
    // How it ends is the board's to say.
    let _ = machine.run(|sample| {
        ticks += 1;
        samples += u32::from(sample.state == State::Running);
        samples < SAMPLES_MIN && ticks < TICKS_WITHIN_LIMITS
    });
    Some((prepared, samples >= SAMPLES_MIN))
}

/// Tries so many jobs, with `limits` or without; the same seed tries the same. `progress` is called after each.
///
/// # Errors
/// QEMU or the line to it breaks.
pub fn search(
    lab: &mut Lab,
    jobs: u32,
    seed: u64,
    limits: bool,
    mut progress: impl FnMut(),
) -> Result<Campaign, BudgetError> {
    let mut random = Rng::with_seed(seed);
    let mut campaign = Campaign::default();
    for _ in 0..jobs {
        let genes = draw(&mut random, &campaign.elite);
        let job = genes.job(limits);
        match prepared(&job) {
            Some((prepared, runs)) if runs || random.u8(..SHORT) == 0 => {
                try_job(lab, &mut campaign, genes, job, &prepared)?;
            }
            Some(_) => campaign.skipped += 1,
            None => campaign.refused += 1,
        }
        progress();
    }
    Ok(campaign)
}

fn draw(random: &mut Rng, elite: &[Found]) -> Genes {
    if elite.is_empty() || random.f64() < FRESH {
        return if random.u8(..4) == 0 {
            Genes::random(random)
        } else {
            Genes::adversarial(random)
        };
    }
    // The worst more often than the others.
    let among = random.usize(1..=elite.len());
    elite[random.usize(..among)].genes.mutated(random)
}

fn try_job(
    lab: &mut Lab,
    campaign: &mut Campaign,
    genes: Genes,
    job: Job,
    prepared: &Prepared,
) -> Result<(), BudgetError> {
    let ticks = if prepared.header.axes.is_some() {
        TICKS_WITHIN_LIMITS
    } else {
        TICKS
    };
    let run = match lab.run(prepared, ticks) {
        Err(BudgetError::Remote(RemoteError::Refused { .. })) => {
            campaign.refused += 1;
            return Ok(());
        }
        run => run?,
    };
    campaign.ran += 1;
    campaign.samples += u64::from(run.samples);
    campaign.faults.extend(run.fault);
    let least = campaign.elite.last().map_or(0, Found::cycles);
    // What comes together with a tick costs some hundred cycles; a tick that is far off is not worth a second run.
    if campaign.elite.len() == ELITE && run.most() + ALONGSIDE < least {
        return Ok(());
    }
    let worst = lab.worst(prepared, &run)?;
    campaign.elite.push(Found { job, worst, genes });
    campaign
        .elite
        .sort_by_key(|found| std::cmp::Reverse(found.cycles()));
    campaign.elite.truncate(ELITE);
    Ok(())
}

/// Cycles that commands and reports add to a tick at most.
const ALONGSIDE: u32 = 1500;
