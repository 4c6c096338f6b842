//! `budget --search`: the worst-case tick that can be found, and the job that causes it.

use std::path::Path;

use cycle_plugin::plan::Stage;
use serde_json::{Value, json};

use super::super::out::{say, say_part};
use super::super::{Failure, Result, output_file, progress};
use super::Arguments;
use cycles::PERIOD_CYCLES;
use cycles::figures::{Model, tick_cycles};
use cycles::measure::MeasurementSetup;
use cycles::search::genes::JobClass;
use cycles::search::{SearchResult, search, text};
use cycles::session::{MeasurementSession, WorstTick};

/// Duration of a tick, percent of the period.
fn share_pct(cycles: u32) -> f64 {
    100.0 * f64::from(cycles) / f64::from(PERIOD_CYCLES)
}

/// The worst-case tick as text.
pub(super) fn describe(worst: &WorstTick) -> String {
    let total = |model| tick_cycles(&worst.record, model);
    let (nominal, pessimistic) = (total(Model::Nominal), total(Model::Pessimistic));
    let mut text = format!(
        "worst-case tick: {pessimistic} cycles pessimistic ({:.2} % of the period), {nominal} nominal; tick {} of the run\n  in it: {}\n",
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
fn json(worst: &WorstTick) -> Value {
    let stages = Stage::ALL.map(|stage| {
        let cycles = worst.record.stages[stage as usize];
        json!({
            "stage": stage.name(),
            "cycles_nominal": cycles.nominal,
            "cycles_pessimistic": cycles.pessimistic,
        })
    });
    let pessimistic = tick_cycles(&worst.record, Model::Pessimistic);
    json!({
        "tick": worst.tick,
        "events": worst.events,
        "cycles_nominal": tick_cycles(&worst.record, Model::Nominal),
        "cycles_pessimistic": pessimistic,
        "period_share_pct": share_pct(pessimistic),
        "stages": stages,
    })
}

fn print(result: &SearchResult, session: &MeasurementSession, seed: u64, out: &Path) {
    let faults: Vec<&str> = result.faults.iter().copied().collect();
    say!(
        "seed {seed}: {} jobs ran, {} faulted at once, {} were refused, {} samples, stack {} bytes, planning at most {} cycles; faults met: {}",
        result.executed,
        result.skipped,
        result.refused,
        result.samples,
        session.stack_bytes(),
        session.planning_cycles_max(),
        if faults.is_empty() {
            "none".to_owned()
        } else {
            faults.join(", ")
        }
    );
    if let Some(found) = result.elite.first() {
        say_part!("{}", describe(&found.worst));
        say!("  job: {}", out.display());
        say!("  repeat: cargo sim budget {}", out.display());
    }
}

/// The options of a class of jobs.
fn options(class: JobClass) -> String {
    let options = [
        (class.limits, " --limits"),
        (class.constant, " --constant"),
        (class.region, " --region"),
    ];
    options
        .iter()
        .filter(|(is_set, _)| *is_set)
        .map(|(_, name)| *name)
        .collect()
}

/// Searches, prints the worst-case tick, and writes the job that causes it.
pub(super) fn command(setup: &MeasurementSetup, jobs: u32, arguments: &Arguments) -> Result<()> {
    let Arguments {
        seed,
        limits,
        constant,
        region,
        ref out,
        force,
        json: as_json,
        ..
    } = *arguments;
    let mut session = MeasurementSession::new(setup)?;
    let bar = progress(u64::from(jobs), "searching");
    let class = JobClass {
        limits,
        constant,
        region,
    };
    let result = search(&mut session, jobs, seed, class, || bar.inc(1))?;
    bar.finish_and_clear();
    let Some(found) = result.elite.first() else {
        return Err(Failure::Failed(Some(format!(
            "none of {jobs} jobs ran; try more"
        ))));
    };
    let comment = format!(
        "The worst job that `cargo sim budget --search {jobs} --seed {seed}{}` found.\n{}",
        options(class),
        describe(&found.worst)
    );
    let text = text::text(&found.job, &programs::with_command_name(&comment));
    output_file::write(out, text.as_bytes(), force)?;
    if as_json {
        let report = json!({
            "seed": seed,
            "jobs": result.executed,
            "faulted_at_once": result.skipped,
            "refused": result.refused,
            "samples": result.samples,
            "faults": result.faults,
            "stack_bytes": session.stack_bytes(),
            "planning_cycles_max": session.planning_cycles_max(),
            "job": out,
            "worst": json(&found.worst),
        });
        say!("{report}");
    } else {
        print(&result, &session, seed, out);
    }
    Ok(())
}
