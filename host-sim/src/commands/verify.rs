//! `verify`: every sample of a job against the independent oracle.

use super::out::say;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use indicatif::ProgressBar;
use interp_core::State;
use serde_json::Value;

use super::motion_words::{self, Judged};
use super::simulate::{Timed, machine, oracle, remarks, report, timed};
use super::{Failure, Result, along, load, progress, spinner, swept_words};
use crate::job_file::{JobFile, Spacing};
use crate::motion::{Gauge, Peaks, limits};
use crate::oracle::{Bounds, Checked, Emitted, Figure};
use crate::prepare::Prepared;
use crate::report::{Remarks, RidgePlace, Scallops, Sketch};
use crate::survey::{Findings, Survey};
use crate::swept::{self, Track};
use crate::travel;

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

/// Checks a job before anything moves. Every sample against an independent f64 oracle: positions, normals, feed ripple, path
/// intervals, schedule. The ball's swept envelope against the surface: scallop height everywhere, gouges, local or by another
/// part of the path. Travel of the axes; what all samples use of the axes' limits, and what the first, the middle and the last pass
/// take against the best motion within them, where the job sets limits. The tightest hollow, machining time, size of the data.
///
/// Example: cargo sim verify jobs/plate.toml
/// Example: cargo sim verify jobs/plate_machine.toml --report out
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job file (TOML).
    job: PathBuf,
    /// Writes a page with a view that turns, charts and figures into this folder.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Times the first, the middle and the last pass by the best motion within usual axis limits, where the job sets none.
    #[arg(long)]
    optimum: bool,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

/// Passes that a dense scan of the surface comes to, where the samples only see their own places.
fn scanned_passes(job: &crate::job_file::JobFile) -> Result<Option<usize>> {
    Ok(oracle(job)?.schedule().ok().map(|passes| passes.len()))
}

fn line(name: &str, figure: &Figure, bound: f64, unit: &str) {
    let verdict = if figure.max.abs() <= bound { "ok  " } else { "FAIL" };
    let at = figure.at;
    say!(
        "  {verdict} {name:<22} {:>10.3e} {unit:<4} (at most {bound:.0e}) at tick {}, pass {}, u = {:.6}, v = {:.6}",
        figure.max.abs(),
        at.tick,
        at.pass,
        at.u,
        at.v
    );
}

fn print(findings: &Findings, scanned: Option<usize>, first_order: bool) {
    let report = &findings.report;
    line("cutter location", &report.position_nm, BOUNDS.position_nm, "nm");
    line("cutter contact", &report.contact_nm, BOUNDS.contact_nm, "nm");
    line("tool normal", &report.normal_rad, BOUNDS.normal_rad, "rad");
    line("feed ripple", &report.ripple_pct, BOUNDS.ripple_pct, "%");
    line("interval candidates", &report.interval, BOUNDS.interval, "rel");
    // Exact spacing has no closed form to be held against: the scallop height tells.
    if first_order {
        line(
            "step to the next pass",
            &report.side_step,
            BOUNDS.side_step,
            "rel",
        );
    }
    line("ball fits (r k)", &report.fit, BOUNDS.fit, "");
    let scan = scanned.map_or_else(|| "no count".to_owned(), |passes| passes.to_string());
    say!(
        "  passes {} (dense scan of the surface: {scan}), samples {}",
        findings.passes,
        findings.samples
    );
}

/// What the axes do, sample by sample. Where the job sets limits, from standstill to standstill with all that lies between;
/// without, within passes: there the feed jumps between them, and a pass's last step is cut short by its end.
struct Axes {
    gauge: Gauge,
    limited: bool,
    begun: bool,
}

impl Axes {
    fn new(job: &JobFile) -> Self {
        let machine = &job.machine;
        let limited = machine.velocity_max_mm_s.is_some()
            || machine.acceleration_max_mm_s2.is_some()
            || machine.jerk_max_mm_s3.is_some();
        Self {
            gauge: Gauge::new(machine),
            limited,
            begun: false,
        }
    }

    /// A sample as the machine emitted it.
    fn emitted(&mut self, tick: u32, cl_nm: [i32; 3]) {
        if self.limited {
            if !std::mem::replace(&mut self.begun, true) {
                self.gauge.stand(cl_nm);
            }
            self.gauge.add(tick.into(), cl_nm);
        }
    }

    /// A sample on a pass.
    fn on_pass(&mut self, sample: &Emitted) {
        if self.limited || sample.last_of_pass {
            return;
        }
        if sample.first_of_pass {
            self.gauge.gap();
        }
        self.gauge.add(sample.tick, sample.cl_nm);
    }

    fn finish(mut self) -> Peaks {
        if self.limited {
            self.gauge.come_to_stand();
        }
        self.gauge.peaks()
    }
}

/// What a verified run came to.
pub(super) struct Measured {
    pub(super) findings: Findings,
    pub(super) swept: swept::Findings,
    pub(super) axes: Peaks,
    pub(super) motion: Vec<Judged>,
}

/// Runs the core again, measures every sample, then the swept ball against the surface.
pub(super) fn measured(
    job: &JobFile,
    prepared: &Prepared,
    timed: &Timed,
    mut sketch: Option<&mut Sketch>,
    with_optimum: bool,
) -> Result<Measured> {
    let oracle = oracle(job)?;
    let bar = progress(timed.samples, "measuring");
    // On a machine with limits the feed is low at the ends of passes.
    let spacing_nm = match prepared.header.axes {
        Some(_) => 0.5e6 * job.feed_mm_s() * job.machine.period_s(),
        None => 0.0,
    };
    let mut track = Track::with_spacing(spacing_nm);
    let axes = RefCell::new(Axes::new(job));
    let mut keep = |emitted: &Emitted, checked: &Checked| {
        track.add(emitted, job.along);
        axes.borrow_mut().on_pass(emitted);
        if let Some(sketch) = &mut sketch {
            sketch.add(emitted, checked);
        }
    };
    let mut survey = Survey::new(prepared, &oracle, None, Some(&mut keep));
    let mut written = Ok(());
    let mut running = BTreeMap::<u32, u64>::new();
    let ran = machine(job, prepared)?.run(|sample| {
        axes.borrow_mut().emitted(sample.tick, sample.cl_nm);
        if sample.state == State::Running {
            *running.entry(sample.pass).or_default() += 1;
        }
        written = survey.add(sample);
        if sample.tick % 65_536 == 0 {
            bar.set_position(sample.tick.into());
        }
        written.is_ok()
    });
    let findings = written
        .and_then(|()| survey.finish(ran.is_ok()))
        .map_err(|error| Failure::Failed(Some(error.to_string())))?;
    let swept = swept::measure(job, &oracle, &track, ran.is_ok(), &Bar(&bar));
    bar.finish_and_clear();
    let motion = if with_optimum {
        let bar = spinner("the best motion");
        let judged = motion_words::judged(job, &oracle, &track, &running);
        bar.finish_and_clear();
        judged
    } else {
        Vec::new()
    };
    Ok(Measured {
        findings,
        swept,
        axes: axes.into_inner().finish(),
        motion,
    })
}

/// The measured heights as the report shows them.
fn scallops(job: &JobFile, swept: &swept::Findings) -> Scallops {
    let place = |spot: &swept::RidgeSpot| RidgePlace {
        u: spot.u,
        v: spot.v,
        height_mm: spot.height_mm,
    };
    let ridge = |ridge: &swept::Ridge| (ridge.gap, ridge.spots.iter().map(place).collect());
    Scallops {
        limit_mm: job.scallop_mm,
        measuring_error_mm: swept.measuring_error_mm,
        ridges: swept.ridges.iter().map(ridge).collect(),
    }
}

/// One bar for all parts of the measuring.
struct Bar<'a>(&'a ProgressBar);

impl swept::Progress for Bar<'_> {
    fn begin(&self, what: &'static str, steps: u64) {
        self.0.reset();
        self.0.set_length(steps);
        self.0.set_message(what);
    }

    fn done(&self, steps: u64) {
        self.0.inc(steps);
    }
}

/// All that speaks against the job, the gravest first.
fn failures(job: &JobFile, timed: &Timed, measured: &Measured, scanned: Option<usize>) -> Vec<String> {
    let findings = &measured.findings;
    let mut failures: Vec<String> = timed.fault.iter().map(|fault| fault.sentence()).collect();
    failures.extend(findings.report.failures(&BOUNDS));
    if let Some(scanned) =
        scanned.filter(|scanned| *scanned != findings.passes as usize && timed.fault.is_none())
    {
        failures.push(format!(
            "{} passes, but a dense scan of the surface needs {scanned}",
            findings.passes
        ));
    }
    failures.extend(measured.swept.failures.iter().cloned());
    if let Err(error) = travel::check(job) {
        failures.push(format!("{}: {}", error.what(), error.remedy()));
    }
    failures.extend(limits::failures(&measured.axes));
    failures
}

/// What is told of a verified job.
struct Told<'a> {
    job: &'a JobFile,
    prepared: &'a Prepared,
    measured: &'a Measured,
    scanned: Option<usize>,
    failures: &'a [String],
    warnings: Vec<&'a String>,
}

impl Told<'_> {
    fn json(&self) -> Value {
        let Measured {
            findings,
            swept,
            axes,
            motion,
        } = self.measured;
        let mut value = swept_words::json(self.job, self.prepared, findings, swept, axes);
        value.insert("motion".to_owned(), motion_words::json(motion));
        value.extend(along::json(self.job));
        value.insert("passes_scanned".to_owned(), self.scanned.into());
        value.insert("failures".to_owned(), self.failures.into());
        value.insert("passed".to_owned(), self.failures.is_empty().into());
        Value::Object(value)
    }

    fn print(&self) {
        let Measured {
            findings,
            swept,
            axes,
            motion,
        } = self.measured;
        say!("  along        {}", along::sentence(self.job));
        print(findings, self.scanned, self.job.spacing == Spacing::FirstOrder);
        swept_words::print(self.job, self.prepared, findings, swept, axes);
        motion_words::print(motion);
        for failure in self.failures {
            say!("  FAIL {failure}");
        }
        for warning in &self.warnings {
            say!("  warning: {warning}");
        }
        let passed = self.failures.is_empty();
        say!("  {}", if passed { "passed" } else { "FAILED" });
    }
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (job, prepared) = load(&arguments.job)?;
    let timed = timed(&job, &prepared)?;
    let with_optimum = arguments.optimum || motion_words::limits(&job).is_some();
    let directory = arguments.report.as_deref();
    let mut sketch = directory.map(|_| Sketch::new(&job, timed.passes.len()));
    let measured = measured(&job, &prepared, &timed, sketch.as_mut(), with_optimum)?;
    let scanned = scanned_passes(&job)?;
    let failures = failures(&job, &timed, &measured, scanned);
    let Measured { findings, swept, .. } = &measured;
    let warnings: Vec<&String> = swept
        .warnings
        .iter()
        .filter(|warning| !failures.contains(warning))
        .collect();
    let mut remarks = Remarks {
        failures: failures.clone(),
        verified: true,
        scallops: Some(scallops(&job, swept)),
        ..remarks(&timed, findings)
    };
    remarks.warnings.extend(warnings.iter().copied().cloned());
    let page = report(&job, directory, sketch.as_ref(), findings, &remarks)?;
    let told = Told {
        job: &job,
        prepared: &prepared,
        measured: &measured,
        scanned,
        failures: &failures,
        warnings,
    };
    if arguments.json {
        say!("{}", told.json());
    } else {
        say!("{}", arguments.job.display());
        told.print();
        if let Some(page) = page {
            say!("  report {}", page.display());
        }
    }
    if failures.is_empty() {
        Ok(())
    } else {
        Err(Failure::Failed(None))
    }
}
