//! `budget --search`: searches the worst-case tick and the job that causes it.

use std::path::Path;

use cycle_plugin::plan::Stage;
use serde_json::{Value, json};

use super::super::out::{say, say_part};
use super::super::{Failure, Result, cannot_write, progress};
use super::Arguments;
use cycles::PERIOD_CYCLES;
use cycles::figures::{Model, whole};
use cycles::lab::{Lab, Worst};
use cycles::measure::Bench;
use cycles::search::{Campaign, search, text};

/// Duration of a tick, percent of the period.
fn share_pct(cycles: u32) -> f64 {
    100.0 * f64::from(cycles) / f64::from(PERIOD_CYCLES)
}

/// The worst-case tick as text.
pub(super) fn describe(worst: &Worst) -> String {
    let total = |model| whole(&worst.record, model);
    let (nominal, pessimistic) = (total(Model::Nominal), total(Model::Pessimistic));
    let mut text = format!(
        "worst-case tick: {pessimistic} cycles pessimistic ({:.2} % of the period), {nominal} nominal; tick {} of the run\n  events: {}\n",
        share_pct(pessimistic),
        worst.tick,
        worst.events.join(", ")
    );
    for stage in Stage::ALL {
        let cycles = worst.record.stages[stage as usize];
        text.push_str(&format!(
            "  {:<25} {:>6} nominal {:>6} pessimistic\n",
            stage.name(),
            cycles.nominal,
            cycles.pessimistic
        ));
    }
    text
}

/// The worst-case tick as JSON.
fn json(worst: &Worst) -> Value {
    let stages = Stage::ALL.map(|stage| {
        let cycles = worst.record.stages[stage as usize];
        json!({
            "stage": stage.name(),
            "cycles_nominal": cycles.nominal,
            "cycles_pessimistic": cycles.pessimistic,
        })
    });
    let pessimistic = whole(&worst.record, Model::Pessimistic);
    json!({
        "tick": worst.tick,
        "events": worst.events,
        "cycles_nominal": whole(&worst.record, Model::Nominal),
        "cycles_pessimistic": pessimistic,
        "period_share_pct": share_pct(pessimistic),
        "stages": stages,
    })
}

fn print(campaign: &Campaign, lab: &Lab, seed: u64, out: &Path) {
    let faults: Vec<&str> = campaign.faults.iter().copied().collect();
    say!(
        "seed {seed}: {} jobs ran, {} faulted at the first tick, {} were refused, {} samples, stack {} bytes; faults: {}",
        campaign.ran,
        campaign.skipped,
        campaign.refused,
        campaign.samples,
        lab.stack_bytes(),
        if faults.is_empty() {
            "none".to_owned()
        } else {
            faults.join(", ")
        }
    );
    if let Some(found) = campaign.elite.first() {
        say_part!("{}", describe(&found.worst));
        say!("  job: {}", out.display());
        say!("  repeat: cargo sim budget {}", out.display());
    }
}

/// Searches, prints the worst-case tick, and writes the job that causes it.
pub(super) fn command(bench: &Bench, jobs: u32, arguments: &Arguments) -> Result<()> {
    let Arguments {
        seed,
        limits,
        ref out,
        json: as_json,
        ..
    } = *arguments;
    let mut lab = Lab::new(bench)?;
    let bar = progress(u64::from(jobs), "searching");
    let campaign = search(&mut lab, jobs, seed, limits, || bar.inc(1))?;
    bar.finish_and_clear();
    let Some(found) = campaign.elite.first() else {
        return Err(Failure::Failed(Some(format!(
            "none of {jobs} jobs ran; try more"
        ))));
    };
    let comment = format!(
        "The worst job that `cargo sim budget --search {jobs} --seed {seed}{}` found.\n{}",
        if limits { " --limits" } else { "" },
        describe(&found.worst)
    );
    std::fs::write(
        out,
        text::text(&found.job, &programs::with_command_name(&comment)),
    )
    .map_err(|error| cannot_write(out, &error))?;
    if as_json {
        let report = json!({
            "seed": seed,
            "jobs": campaign.ran,
            "faulted_at_once": campaign.skipped,
            "refused": campaign.refused,
            "samples": campaign.samples,
            "faults": campaign.faults,
            "stack_bytes": lab.stack_bytes(),
            "job": out,
            "worst": json(&found.worst),
        });
        say!("{report}");
    } else {
        print(&campaign, &lab, seed, out);
    }
    Ok(())
}
