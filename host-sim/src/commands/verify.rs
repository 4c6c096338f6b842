//! `verify`: every sample of a job against the independent oracle.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::simulate::{oracle, remarks, report, surveyed, timed};
use super::{Failure, Result, load, warn_of_limits};
use crate::oracle::{Bounds, Figure};
use crate::report::Remarks;
use crate::survey::Findings;

/// What every sample has to hold to: the figures of the README.
pub const BOUNDS: Bounds = Bounds {
    position_nm: 10.0,
    contact_nm: 10.0,
    normal_rad: 1e-6,
    ripple_pct: 0.001,
    interval: 1e-5,
    side_step: 1e-5,
    fit: 1.0,
};

/// Checks every sample of a job against an independent f64 oracle: positions, normals, feed ripple, path intervals,
/// schedule, and whether the ball fits.
///
/// Example: cargo sim verify jobs/plate.toml
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job file (TOML).
    job: PathBuf,
    /// Writes a page with a view that turns, charts and figures into this folder.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Passes that a dense scan of the surface comes to, where the samples only see their own places.
fn scanned_passes(job: &crate::job_file::JobFile) -> Result<Option<usize>> {
    Ok(oracle(job)?.schedule().ok().map(|passes| passes.len()))
}

fn line(name: &str, figure: &Figure, bound: f64, unit: &str) {
    let verdict = if figure.max.abs() <= bound { "ok  " } else { "FAIL" };
    let at = figure.at;
    println!(
        "  {verdict} {name:<22} {:>10.3e} {unit:<4} (at most {bound:.0e}) at tick {}, pass {}, u = {:.6}, v = {:.6}",
        figure.max.abs(),
        at.tick,
        at.pass,
        at.u,
        at.v
    );
}

fn print(findings: &Findings, scanned: Option<usize>, failures: &[String]) {
    let report = &findings.report;
    line("cutter location", &report.position_nm, BOUNDS.position_nm, "nm");
    line("cutter contact", &report.contact_nm, BOUNDS.contact_nm, "nm");
    line("tool normal", &report.normal_rad, BOUNDS.normal_rad, "rad");
    line("feed ripple", &report.ripple_pct, BOUNDS.ripple_pct, "%");
    line("interval candidates", &report.interval, BOUNDS.interval, "rel");
    line(
        "step to the next pass",
        &report.side_step,
        BOUNDS.side_step,
        "rel",
    );
    line("ball fits (r k)", &report.fit, BOUNDS.fit, "");
    let scan = scanned.map_or_else(|| "no count".to_owned(), |passes| passes.to_string());
    println!(
        "  passes {} (dense scan of the surface: {scan}), samples {}",
        findings.passes, findings.samples
    );
    for failure in failures {
        println!("  FAIL {failure}");
    }
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (job, prepared) = load(&arguments.job)?;
    warn_of_limits(&job);
    let timed = timed(&job, &prepared)?;
    let directory = arguments.report.as_deref();
    let (findings, sketch) = surveyed(&job, &prepared, &timed, None, directory.is_some())?;
    let figures = &findings.report;
    let scanned = scanned_passes(&job)?;
    let mut failures = figures.failures(&BOUNDS);
    if let Some(scanned) =
        scanned.filter(|scanned| *scanned != findings.passes as usize && timed.fault.is_none())
    {
        failures.push(format!(
            "{} passes, but a dense scan of the surface needs {scanned}",
            findings.passes
        ));
    }
    if let Some(fault) = &timed.fault {
        failures.insert(0, fault.sentence());
    }
    let passed = failures.is_empty();
    let remarks = Remarks {
        failures: failures.clone(),
        verified: true,
        ..remarks(&job, &timed, &findings)
    };
    let page = report(&job, directory, sketch.as_ref(), &findings, &remarks)?;
    if arguments.json {
        let value = json!({
            "position_error_max_nm": figures.position_nm.max.abs(),
            "position_error_rms_nm": figures.position_nm.rms(),
            "normal_error_max_rad": figures.normal_rad.max.abs(),
            "ripple_max_pct": figures.ripple_pct.max.abs(),
            "interval_error_max": figures.interval.max.abs(),
            "passes": findings.passes,
            "passes_scanned": scanned,
            "samples": findings.samples,
            "fit_max": figures.fit.max,
            // Not measured yet: these take the swept envelope of the ball, and limits take a machine that has some.
            "scallop_max_mm": Value::Null,
            "scallop_mean_mm": Value::Null,
            "gouge_max_mm": Value::Null,
            "limits": Value::Null,
            "failures": failures,
            "passed": passed,
        });
        println!("{value}");
    } else {
        println!("{}", arguments.job.display());
        print(&findings, scanned, &failures);
        println!("  {}", if passed { "passed" } else { "FAILED" });
        if let Some(page) = page {
            println!("  report {}", page.display());
        }
    }
    if passed {
        Ok(())
    } else {
        Err(Failure::Failed(None))
    }
}
