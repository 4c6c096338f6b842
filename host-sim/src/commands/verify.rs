//! `verify`: checks every sample of a job against the independent oracle.

use std::path::PathBuf;

use clap::Args;
use inspect::{BOUNDS, Requirements, RunMeasurements, Verification, verify_run};
use job::Job;
use machine::prepare::Prepared;
use oracle::{AccuracyFigure, PassSample, SampleCheck};
use report::{Remarks, RidgePoint, Scallops, Sketch};
use serde_json::Value;
use verify::survey::{SampleObserver, SurveyResult};
use verify::swept;

use super::out::say;
use super::simulate::{remarks, report, timed};
use super::{Bar, Failure, Result, along, load, motion_words, swept_words};

/// Checks a job before it runs on a machine. Every sample against an independent f64 oracle: positions, normals, feed ripple, path
/// intervals, schedule. The swept envelope of the ball against the surface: scallop height, local and global gouges. Axis travel. With
/// axis limits: the share of each limit that the samples use, and the duration of the first, middle and last pass against the
/// optimum. Least concave radius, machining time, size of the surface data.
///
/// Example: cargo sim verify jobs/plate.toml
/// Example: cargo sim verify jobs/plate_machine.toml --report out
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job file (TOML).
    job: PathBuf,
    /// Writes a report page into this folder: 3D view, charts, figures.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Computes the optimum of the first, middle and last pass within default axis limits if the job sets none.
    #[arg(long)]
    optimum: bool,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

/// A figure with the bound that applies to it.
fn line(figure: &AccuracyFigure) {
    let verdict = if figure.is_met() { "ok  " } else { "FAIL" };
    let at = figure.errors.at;
    say!(
        "  {verdict} {:<22} {:>10.3e} {:<4} (at most {:.3e}) at tick {}, pass {}, u = {:.6}, v = {:.6}",
        figure.label,
        figure.errors.max.abs(),
        figure.unit,
        figure.bound,
        at.tick,
        at.pass,
        at.u,
        at.v
    );
}

fn print(findings: &SurveyResult, scanned: Option<usize>) {
    // The step to the next pass has no closed form with exact spacing; it is checked by the scallop height.
    for figure in findings
        .report
        .figures(&BOUNDS)
        .iter()
        .filter(|figure| figure.errors.count > 0)
    {
        line(figure);
    }
    let scan = scanned.map_or_else(|| "no count".to_owned(), |passes| passes.to_string());
    say!(
        "  passes {} (dense scan of the surface: {scan}), samples {}",
        findings.passes,
        findings.samples
    );
}

/// The measured heights as the report shows them.
fn scallops(job: &Job, swept: &swept::SweptResult) -> Scallops {
    let place = |spot: &swept::RidgePoint| RidgePoint {
        u: spot.u,
        v: spot.v,
        height_mm: spot.height_mm,
    };
    let ridge = |ridge: &swept::Ridge| (ridge.gap, ridge.points.iter().map(place).collect());
    Scallops {
        limit_mm: job.scallop_mm,
        measurement_error_mm: swept.measurement_error_mm,
        ridges: swept.ridges.iter().map(ridge).collect(),
    }
}

/// The keys of `verify`.
fn json(job: &Job, prepared: &Prepared, found: &Verification) -> Value {
    let RunMeasurements {
        findings,
        swept,
        axes,
        times,
        optimum,
    } = &found.measured;
    let mut value = swept_words::json(job, prepared, findings, swept, axes);
    value.extend(motion_words::json(times, optimum));
    value.extend(along::json(job));
    value.insert("passes_scanned".to_owned(), found.scanned.into());
    value.insert("failures".to_owned(), found.failures.clone().into());
    value.insert("passed".to_owned(), found.failures.is_empty().into());
    Value::Object(value)
}

/// Prints the figures as text.
fn print_verification(job: &Job, prepared: &Prepared, found: &Verification) {
    let RunMeasurements {
        findings,
        swept,
        axes,
        times,
        optimum,
    } = &found.measured;
    say!("  along        {}", along::sentence(job));
    print(findings, found.scanned);
    swept_words::print(job, prepared, findings, swept, axes);
    motion_words::print(times, optimum);
    for failure in &found.failures {
        say!("  FAIL {failure}");
    }
    for warning in &found.warnings {
        say!("  warning: {warning}");
    }
    let passed = found.failures.is_empty();
    say!("  {}", if passed { "passed" } else { "FAILED" });
}

/// Distance of the CAD face from the job's surface, and its tolerance, mm; `None` where the surface is exact or no face is named.
fn original(job: &Job) -> Result<Option<(Box<swept::OriginalOffset<'static>>, f64)>> {
    let Some(source) = job.origin.cad() else {
        return Ok(None);
    };
    let face = cad::Original::read(source).map_err(|error| Failure::input(error.what, error.remedy))?;
    let surface = oracle::Surface::new(&source.surface);
    Ok(face.map(|face| {
        let offset = move |u: f64, v: f64| {
            let at = surface.at(u, v);
            face.from_surface(u, v, at.point)
                .dot(at.u.cross(at.v).normalize())
        };
        let boxed: Box<swept::OriginalOffset<'static>> = Box::new(offset);
        (boxed, source.tolerance_mm * source.scale)
    }))
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (job, prepared) = load(&arguments.job)?;
    let timed = timed(&job, &prepared)?;
    let original = original(&job)?;
    let requirements = Requirements {
        with_optimum: arguments.optimum || job.machine.has_limits(),
        swept: swept::Requirements {
            scallop_tolerance: 0.0,
            original: original
                .as_ref()
                .map(|(offset_mm, tolerance_mm)| swept::Original {
                    offset_mm: offset_mm.as_ref(),
                    tolerance_mm: *tolerance_mm,
                }),
        },
    };
    let directory = arguments.report.as_deref();
    let mut sketch = directory.map(|_| Sketch::new(&job, timed.passes.len()));
    let mut draw = sketch
        .as_mut()
        .map(|sketch| |emitted: &PassSample, checked: &SampleCheck| sketch.add(emitted, checked));
    let each = draw.as_mut().map(|draw| draw as &mut SampleObserver<'_>);
    let bar = Bar::new();
    let found = verify_run(&job, &prepared, &timed, each, &requirements, &bar);
    bar.clear();
    let found = found?;
    let RunMeasurements { findings, swept, .. } = &found.measured;
    let mut remarks = Remarks {
        failures: found.failures.clone(),
        verified: true,
        scallops: Some(scallops(&job, swept)),
        ..remarks(&timed, findings)
    };
    remarks.warnings.extend(found.warnings.iter().cloned());
    let page = report(&job, directory, sketch.as_ref(), findings, &remarks)?;
    if arguments.json {
        say!("{}", json(&job, &prepared, &found));
    } else {
        say!("{}", arguments.job.display());
        print_verification(&job, &prepared, &found);
        if let Some(page) = page {
            say!("  report {}", page.display());
        }
    }
    if found.failures.is_empty() {
        Ok(())
    } else {
        Err(Failure::Failed(None))
    }
}
