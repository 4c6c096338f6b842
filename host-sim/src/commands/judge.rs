//! `judge`: a motion from elsewhere against the exact surface, beside the motion of the core.

use std::path::PathBuf;

use clap::Args;
use inspect::FaultAt;
use job::Job;
use job::units::NM_PER_MM;
use oracle::{AccuracyReport, PassSample, SampleCheck};
use part::{PartCheck, PassCentres};
use report::{Figure, Mark, Remarks, RidgePoint, Scallops, Sketch};
use serde_json::{Value, json};
use verify::Verdict;
use verify::judge::{Judged, SCALLOP_SLACK, judge};
use verify::motion::limits::ORDERS;
use verify::reach::ReachFinding;
use verify::speeds::SpeedFigures;
use verify::survey::{SampleObserver, SurveyResult};
use verify::swept::{FieldPoint, Progress};

use super::out::say;
use super::outcome::fault_json;
use super::simulate::{WantedReport, report};
use super::{Bar, Failure, Result, load, numbers, part_words, reach_words};
use crate::motion::{self, MotionError};

/// Largest path error that is accepted, as a share of the scallop limit, unless `--path-tolerance` gives it.
const PATH_SHARE: f64 = 0.1;

/// Judges a motion from elsewhere on a job's surface, with its ball: samples of the ball's centre as CSV (t_s, x_mm, y_mm, z_mm; or a trace of
/// simulate), or a program in G-code, read by LinuxCNC's rs274. Contact feed and its ripple, path error, scallop, gouge, the reach of the tool,
/// the whole part, axis limits; beside the figures of the core's own run of the job.
///
/// The contact is the surface's nearest point, so the motion may follow any pattern. Samples more than a tenth of the radius from contact
/// are links. Of a program the velocity is judged; acceleration and jerk are the machine's.
///
/// Example: cargo sim judge jobs/torus.toml samples.csv
/// Example: cargo sim judge jobs/plate_machine.toml posted.ngc --tip --json
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job file (TOML): surface, tool, feed, scallop limit, machine.
    job: PathBuf,
    /// Samples (.csv), else a program in G-code.
    motion: PathBuf,
    /// The positions are those of the ball's lowest point, as most programs have it, not of its centre.
    #[arg(long)]
    tip: bool,
    /// Accepts centres this far from the exact offset surface, mm; default a tenth of the scallop limit.
    #[arg(long, value_name = "MM", value_parser = numbers::length, allow_negative_numbers = true)]
    path_tolerance: Option<f64>,
    /// Passes a motion although faces of the job's part are not known, so that whether the tool cuts them is not checked.
    #[arg(long)]
    accept_unknown_faces: bool,
    /// Judges the motion alone, without a run of the core.
    #[arg(long)]
    alone: bool,
    /// Writes a report page into this folder: 3D view, charts, the table.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Overwrites existing files of --report.
    #[arg(long)]
    force: bool,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

impl Arguments {
    /// Largest path error that is accepted, mm.
    fn path_tolerance_mm(&self, job: &Job) -> f64 {
        self.path_tolerance.unwrap_or(PATH_SHARE * job.scallop_mm)
    }
}

impl From<MotionError> for Failure {
    fn from(error: MotionError) -> Self {
        Self::input(error.what, error.remedy)
    }
}

/// The keys of the figures of a motion; one that no sample tells is null, and named.
fn object(job: &Job, judged: &Judged) -> Value {
    let mut value = figures(job, judged);
    let mut keys = Vec::new();
    nulls(&value, "", &mut keys);
    // Without limits there is no share of them.
    keys.retain(|key| key != "limits");
    value["not_measured"] = keys.into();
    value
}

/// Keys of null figures, those of objects within as `object.key`. What `reach` cannot measure has a verdict.
fn nulls(value: &Value, before: &str, keys: &mut Vec<String>) {
    for (key, value) in value.as_object().into_iter().flatten() {
        let key = format!("{before}{key}");
        match value {
            Value::Null => keys.push(key),
            Value::Object(_) if key != "reach" => nulls(value, &format!("{key}."), keys),
            _ => {}
        }
    }
}

fn figures(job: &Job, judged: &Judged) -> Value {
    let shares = judged.axes.map(|peak| {
        let peak = peak.filter(|peak| peak.verdict != Verdict::Unknown);
        peak.and_then(|peak| peak.share)
    });
    let [velocity, acceleration, jerk] = shares;
    let limits = json!({ "velocity": velocity, "acceleration": acceleration, "jerk": jerk });
    let [velocity, acceleration, jerk] = judged.axes.map(|peak| peak.map(|peak| peak.axes));
    let path_error_at = judged
        .path_error_mm
        .map(|at| json!({ "sample": at.sample, "u": at.uv[0], "v": at.uv[1] }));
    let scallop_at = judged
        .field
        .highest
        .map(|at| json!({ "u": at.uv[0], "v": at.uv[1], "place_mm": at.point_mm.to_array() }));
    json!({
        "samples": judged.samples,
        "in_contact": judged.in_contact,
        "jumps": judged.jumps,
        "time_s": judged.time_s,
        "feed_mm_s": { "programmed": job.feed_mm_s(), "min": judged.feed.range.map(|[least, _]| least), "mean": judged.feed.mean, "max": judged.feed.range.map(|[_, most]| most) },
        "ripple_max_pct": judged.feed.ripple_max_pct,
        "ripple_rms_pct": judged.feed.ripple_rms_pct,
        "path_error_max_mm": path_error_mm(judged),
        "path_error_rms_mm": judged.path_error_rms_mm,
        "path_error_at": path_error_at,
        "scallop_max_mm": judged.highest_mm(),
        "scallop_mean_mm": judged.field.mean_mm,
        "scallop_at": scallop_at,
        "uncut_share": judged.field.uncut_share,
        "gouge_max_mm": judged.gouge_mm(),
        "above_equator": judged.above_equator,
        "normal_z_min": judged.steepest.map(|steepest| steepest.value),
        "reach": reach_words::json(job, &judged.reach),
        "limits": job.machine.has_limits().then_some(limits),
        "travel": { "extent_mm": judged.travel.extent_mm, "beyond_mm": judged.travel.beyond_mm },
        "axes": { "velocity_mm_s": velocity, "acceleration_mm_s2": acceleration, "jerk_mm_s3": jerk },
    })
}

/// Largest path error, mm.
fn path_error_mm(judged: &Judged) -> Option<f64> {
    judged.path_error_mm.map(|error| error.value.abs())
}

/// A row of the table: name, unit, figure; `None` where the motion does not tell it.
type Row = (&'static str, &'static str, Box<dyn Fn(&Judged) -> Option<f64>>);

fn rows() -> Vec<Row> {
    let mut rows: Vec<Row> = vec![
        ("jumps", "steps", Box::new(|judged| Some(count(judged.jumps)))),
        ("time", "s", Box::new(|judged| Some(judged.time_s))),
        (
            "contact feed, least",
            "mm/s",
            Box::new(|judged| judged.feed.range.map(|[least, _]| least)),
        ),
        ("contact feed, mean", "mm/s", Box::new(|judged| judged.feed.mean)),
        (
            "contact feed, largest",
            "mm/s",
            Box::new(|judged| judged.feed.range.map(|[_, most]| most)),
        ),
        (
            "feed ripple, largest",
            "%",
            Box::new(|judged| judged.feed.ripple_max_pct),
        ),
        (
            "feed ripple, rms",
            "%",
            Box::new(|judged| judged.feed.ripple_rms_pct),
        ),
        (
            "path error, largest",
            "um",
            Box::new(|judged| um(path_error_mm(judged))),
        ),
        (
            "path error, rms",
            "um",
            Box::new(|judged| um(judged.path_error_rms_mm)),
        ),
        (
            "scallop, largest",
            "um",
            Box::new(|judged| um(judged.highest_mm())),
        ),
        ("scallop, mean", "um", Box::new(|judged| um(judged.field.mean_mm))),
        (
            "uncut",
            "%",
            Box::new(|judged| Some(100.0 * judged.field.uncut_share?)),
        ),
        ("gouge", "um", Box::new(|judged| um(judged.gouge_mm()))),
        (
            "above the equator",
            "samples",
            Box::new(|judged| Some(count(judged.above_equator))),
        ),
        (
            "surface looks down",
            "%",
            Box::new(|judged| Some(100.0 * judged.reach.facing.down_share)),
        ),
        (
            "reach: deepest touch",
            "um",
            Box::new(|judged| {
                let touches = judged.reach.findings.iter().map(ReachFinding::touch_mm);
                um(Some(touches.fold(0.0, f64::max)))
            }),
        ),
    ];
    for (order, (name, unit)) in ORDERS.into_iter().enumerate() {
        rows.push((
            name,
            unit,
            Box::new(move |judged| Some(judged.axes[order]?.axes.into_iter().fold(0.0, f64::max))),
        ));
    }
    rows
}

fn um(mm: Option<f64>) -> Option<f64> {
    mm.map(|mm| 1e3 * mm)
}

/// A figure in the table.
fn cell(figure: Option<f64>) -> String {
    figure.map_or_else(|| "-".to_owned(), |figure| format!("{figure:.6}"))
}

#[allow(clippy::cast_precision_loss, reason = "below 2^53")]
fn count(number: usize) -> f64 {
    number as f64
}

fn print(theirs: &Judged, ours: Option<&Judged>) {
    let heading = if ours.is_some() { "this core" } else { "" };
    say!("  {:<24}{:>16} {heading:>16}", "", "given");
    for (name, unit, figure) in rows() {
        let own = ours.map_or_else(String::new, |ours| cell(figure(ours)));
        say!("  {name:<24}{:>16} {own:>16} {unit}", cell(figure(theirs)));
    }
}

/// The core's own run, judged.
struct OwnRun {
    judged: Judged,
    /// The fault that has ended it before its end: its figures are those of a part of the job.
    fault: Option<FaultAt>,
}

/// That the core's figures are those of a part of the job, and why.
fn partial(fault: &FaultAt) -> String {
    format!(
        "this core stopped before the end of the job: {}",
        fault.sentence()
    )
}

/// Samples of a motion in contact, with what was found for each.
type Samples = Vec<(PassSample, SampleCheck)>;

/// What speaks against a motion.
struct Found {
    check: Option<PartCheck>,
    failures: Vec<String>,
    warnings: Vec<String>,
}

impl Found {
    fn new(arguments: &Arguments, job: &Job, judged: &Judged, samples: &Samples) -> Result<Self> {
        let mut failures = judged.failures(job, arguments.path_tolerance_mm(job));
        let mut centres = PassCentres::default();
        samples.iter().for_each(|(sample, _)| centres.add(sample));
        let accepted_mm = arguments.path_tolerance.unwrap_or(0.0);
        let check = part::check_run(job, &centres, &judged.links_mm, accepted_mm)?;
        let reasons = |check| part_words::reasons(check, arguments.accept_unknown_faces);
        let (of_part, warnings) = check.as_ref().map(reasons).unwrap_or_default();
        failures.extend(of_part);
        Ok(Self {
            check,
            failures,
            warnings,
        })
    }
}

/// The page of a judged motion, beside the core's.
fn page(
    arguments: &Arguments,
    wanted: Option<WantedReport<'_>>,
    job: &Job,
    samples: &Samples,
    (judged, own): (&Judged, Option<&OwnRun>),
    found: &Found,
) -> Result<Option<PathBuf>> {
    if wanted.is_none() {
        return Ok(None);
    }
    let mut sketch = Sketch::new(job, judged.stretches as usize);
    for (sample, check) in samples {
        sketch.add(sample, check);
    }
    let name = arguments
        .motion
        .file_name()
        .unwrap_or(arguments.motion.as_os_str());
    let figures = rows().into_iter().map(|(name, unit, figure)| {
        let given = cell(figure(judged));
        let own = own.map_or_else(String::new, |own| format!(" | {}", cell(figure(&own.judged))));
        Figure {
            what: format!("{name}, {unit}"),
            value: format!("{given}{own}"),
        }
    });
    let line = |(number, line): (u32, &Vec<FieldPoint>)| {
        let place = |at: &FieldPoint| RidgePoint {
            u: at.uv[0],
            v: at.uv[1],
            #[allow(clippy::cast_possible_truncation, reason = "for a picture")]
            height_mm: at.height_mm as f32,
        };
        (number, line.iter().map(place).collect())
    };
    let highest: Vec<FieldPoint> = judged.field.highest.into_iter().collect();
    let mut marks = reach_words::marks(job, &judged.reach);
    let mut mark = |what, at: &FieldPoint| {
        marks.push(Mark {
            what,
            place_mm: at.point_mm,
            tick: None,
        });
    };
    if let Some(lowest) = judged.violating_gouge(arguments.path_tolerance_mm(job)) {
        mark(format!("gouge {:.4} mm", -lowest.height_mm), lowest);
    }
    if let Some(highest) = judged.violating_scallop(job) {
        mark(format!("scallop {:.5} mm", highest.height_mm), highest);
    }
    marks.extend(found.check.iter().flat_map(part_words::marks));
    let fault = own.and_then(|own| own.fault.as_ref()).map(partial);
    let remarks = Remarks {
        failures: found.failures.clone(),
        warnings: fault.into_iter().chain(found.warnings.iter().cloned()).collect(),
        verified: true,
        figures: figures.collect(),
        scallops: Some(Scallops {
            limit_mm: job.scallop_mm,
            measurement_error_mm: SCALLOP_SLACK * job.scallop_mm,
            // With the highest place, which was searched between the lines.
            ridges: (0..)
                .zip(judged.field_lines.iter().chain([&highest]))
                .map(line)
                .collect(),
            anywhere: true,
        }),
        source: Some(name.to_string_lossy().into_owned()),
        marks,
        links_mm: judged.links_mm.clone(),
        ..Remarks::default()
    };
    report(job, wanted, Some(&sketch), &survey(judged), &remarks)
}

/// The figures of a judged motion as those of a survey.
fn survey(judged: &Judged) -> SurveyResult {
    let mut report = AccuracyReport::default();
    report.samples = judged.in_contact as u64;
    report.passes = judged.stretches;
    report.cc_length_mm = judged.contact_length_mm;
    report.complete = true;
    report.position_nm.max = NM_PER_MM * path_error_mm(judged).unwrap_or(0.0);
    report.ripple_pct.max = judged.feed.ripple_max_pct.unwrap_or(0.0);
    SurveyResult {
        samples: judged.samples as u64,
        passes: judged.stretches,
        speeds: SpeedFigures::default(),
        interval_min: f64::INFINITY,
        report,
    }
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (own_job, prepared) = load(&arguments.job)?;
    let oracle = inspect::oracle(&own_job)?;
    let wanted = WantedReport::new(arguments.report.as_deref(), arguments.force)?;
    let given = motion::read(&arguments.motion, &own_job, arguments.tip)?;
    // The motion's own period, for its speeds; everything else is the job's.
    let mut job = own_job.clone();
    job.machine.period_us = 1e6 * given.period_s;
    let bar = Bar::new();
    let progress: &dyn Progress = &bar;
    let mut samples = Samples::new();
    let mut keep = |sample: &PassSample, check: &SampleCheck| samples.push((*sample, *check));
    let is_kept = wanted.is_some() || job.origin.reach().is_some();
    let each = is_kept.then_some(&mut keep as &mut SampleObserver<'_>);
    let mut theirs = judge(&job, &oracle, &given.centres_mm, each, progress);
    if given.is_program {
        theirs = theirs.of_program();
    }
    let own = if arguments.alone {
        None
    } else {
        let (centres_mm, fault) = inspect::centres_of_run(&own_job, &prepared)?;
        let judged = judge(&own_job, &oracle, &centres_mm, None, progress);
        Some(OwnRun { judged, fault })
    };
    bar.clear();
    let core_fault = own.as_ref().and_then(|own| own.fault.as_ref());
    let found = Found::new(arguments, &job, &theirs, &samples)?;
    let passed = found.failures.is_empty();
    let page = page(arguments, wanted, &job, &samples, (&theirs, own.as_ref()), &found)?;
    if arguments.json {
        let value = json!({
            "job": arguments.job.display().to_string(), "motion": arguments.motion.display().to_string(), "period_s": given.period_s,
            "given": object(&job, &theirs), "core": own.as_ref().map(|own| object(&own_job, &own.judged)),
            "core_fault": core_fault.map(fault_json), "part": found.check.as_ref().map(|check| part_words::json(&job, check)),
            "failures": found.failures, "warnings": found.warnings, "passed": passed,
        });
        say!("{value}");
    } else {
        say!("{} on {}", arguments.motion.display(), arguments.job.display());
        say!(
            "  {} samples, period {:.6} ms, {} in contact; heights at {} points and searched from the highest",
            theirs.samples,
            1e3 * given.period_s,
            theirs.in_contact,
            theirs.field.points
        );
        print(&theirs, own.as_ref().map(|own| &own.judged));
        if given.is_program {
            say!("  acceleration and jerk are those of the machine that runs the program: not judged");
        }
        if let Some(fault) = core_fault {
            say!("  {}", partial(fault));
        }
        reach_words::print(&job, &theirs.reach);
        if let Some(check) = &found.check {
            part_words::print(&job, check);
        }
        for failure in &found.failures {
            say!("  FAIL {failure}");
        }
        for warning in &found.warnings {
            say!("  warning: {warning}");
        }
        if let Some(page) = page {
            say!("  report {}", page.display());
        }
        say!("  {}", if passed { "passed" } else { "FAILED" });
    }
    if passed {
        Ok(())
    } else {
        Err(Failure::Failed(None))
    }
}
