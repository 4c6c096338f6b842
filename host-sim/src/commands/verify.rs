//! `verify`: checks every sample of a job against the independent oracle.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use clap::Args;
use inspect::{BOUNDS, Requirements, RunMeasurements, TimedRun, Verification, verify_run};
use job::units::S_PER_MIN;
use job::{Job, Spacing};
use machine::prepare::Prepared;
use oracle::{AccuracyFigure, PassSample, SampleCheck};
use part::{PartCheck, PassCentres};
use part_program::{Stop, stops};
use report::{Figure, Mark, Remarks, RidgePoint, Scallops, Sketch};
use serde_json::Value;
use verify::Verdict;
use verify::survey::{SampleObserver, SurveyResult};
use verify::swept;

use super::out::{complain, say};
use super::simulate::{WantedReport, remarks, report, timed};
use super::{
    Bar, Failure, Result, along, error_json, home, motion_words, numbers, part_words, reach_words,
    read_profile, settled, swept_words,
};

/// Checks a job before it runs on a machine. Every sample against an independent f64 oracle: positions, normals, feed ripple, path
/// intervals, schedule. The swept envelope of the ball against the surface: scallop height, local and global gouges. Axis travel. With
/// axis limits: the share of each limit that the samples use, and the duration of the first, middle and last pass, and of those
/// that could be slowest, against the optimum. Least concave radius, machining time, size of the surface data.
///
/// Several jobs are verified one after the other; the JSON object then has the list `jobs`, with an error for one that cannot be read.
///
/// Example: cargo sim verify jobs/plate.toml
/// Example: cargo sim verify jobs/plate_machine.toml --report out
/// Example: cargo sim verify jobs/plate.toml jobs/torus.toml --scallop-tolerance 1% --json
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job files (TOML).
    #[arg(required = true, value_name = "JOB")]
    jobs: Vec<PathBuf>,
    /// Machine profile (TOML): what the job does not say of the machine is the profile's, and the job may not exceed it.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    placed: home::Placed,
    /// Writes a report page into this folder: 3D view, charts, figures. With several jobs: a folder for each in it.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Overwrites existing files of --report.
    #[arg(long)]
    force: bool,
    /// Computes the optimum within default axis limits if the job sets none: of the first, middle and last pass.
    #[arg(long)]
    optimum: bool,
    /// Accepts scallops this much above the limit: in percent, or as a share (1% or 0.01).
    #[arg(long, value_name = "SHARE", value_parser = numbers::share, default_value = "0%")]
    scallop_tolerance: f64,
    /// Passes a job although faces of its part are not known, so that whether the tool cuts them is not checked.
    #[arg(long)]
    accept_unknown_faces: bool,
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
        anywhere: false,
    }
}

/// Figures of curved passes for the page.
fn figures(measured: &RunMeasurements) -> Vec<Figure> {
    let Some(curved) = &measured.curved else {
        return Vec::new();
    };
    let mean = (measured.swept.scallop_verdict != Verdict::Unknown).then(|| {
        (
            "Mean scallop height",
            format!("{:.5} mm", measured.swept.scallop_mean_mm),
        )
    });
    let words = along::curved_words(curved).into_iter().chain(mean);
    words
        .map(|(what, value)| Figure {
            what: what.to_owned(),
            value,
        })
        .collect()
}

/// Places of what is wrong.
fn marks(job: &Job, timed: &TimedRun, measured: &RunMeasurements) -> Vec<Mark> {
    let mut marks = Vec::new();
    if let Some(fault) = &timed.fault {
        let [u, v] = fault.parameters;
        marks.push(Mark {
            what: format!("fault {}: {}", fault.fault.kind.code(), fault.fault.kind.name()),
            place_mm: oracle::Surface::new(&job.surface).at(u, v).point,
            tick: Some(fault.tick),
        });
    }
    let swept = &measured.swept;
    if let Some(gouge) = swept.violating_gouge() {
        marks.push(Mark {
            what: format!("gouge {:.4} mm", gouge.depth_mm),
            place_mm: gouge.point_mm,
            tick: Some(gouge.tick),
        });
    }
    if swept.scallop_verdict == Verdict::Violated {
        marks.push(Mark {
            what: format!("scallop {:.5} mm", swept.scallop_max.height_mm),
            place_mm: swept.scallop_max.point_mm,
            tick: None,
        });
    }
    if let Some(highest) = swept.violating_place() {
        marks.push(Mark {
            what: format!("{:.5} mm left in the region", highest.height_mm),
            place_mm: highest.point_mm,
            tick: None,
        });
    }
    marks.extend(reach_words::marks(job, &measured.reach));
    marks
}

/// The keys of `verify`.
fn json(job: &Job, prepared: &Prepared, found: &Verification) -> Value {
    let RunMeasurements {
        findings,
        swept,
        reach,
        axes,
        times,
        optimum,
        ..
    } = &found.measured;
    let mut value = swept_words::json(job, prepared, findings, swept, axes);
    value.extend(motion_words::json(times, optimum));
    value.extend(along::json(job));
    value.insert("reach".to_owned(), reach_words::json(job, reach));
    if let (Some(key), Some(Value::Array(keys))) =
        (reach_words::not_measured(reach), value.get_mut("not_measured"))
    {
        keys.push(key.into());
    }
    let curved = found.measured.curved.as_ref();
    value.insert(
        "curved".to_owned(),
        curved.map_or(Value::Null, along::curved_json),
    );
    value.insert("passes_scanned".to_owned(), found.scanned.into());
    value.insert("failures".to_owned(), found.failures.clone().into());
    value.insert("warnings".to_owned(), found.warnings.clone().into());
    value.insert("passed".to_owned(), found.failures.is_empty().into());
    Value::Object(value)
}

/// Prints the figures as text.
fn print_verification(job: &Job, prepared: &Prepared, found: &Verification, check: Option<&PartCheck>) {
    let RunMeasurements {
        findings,
        swept,
        reach,
        axes,
        times,
        optimum,
        ..
    } = &found.measured;
    say!("  along        {}", along::sentence(job));
    if let Some(start) = along::start_sentence(job) {
        say!("  start        {start}");
    }
    print(findings, found.scanned);
    for (what, value) in found.measured.curved.iter().flat_map(along::curved_words) {
        say!("  {}: {value}", what.to_lowercase());
    }
    swept_words::print(job, prepared, findings, swept, axes);
    reach_words::print(job, reach);
    if let Some(check) = check {
        part_words::print(job, check);
    }
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
    let face = cad::Original::read(source)?;
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

/// Folder of a job's report among those of several: `part-34` for face 34 of `part.toml`.
fn folder_of(job: &Path) -> String {
    let name = job.file_name().unwrap_or(job.as_os_str()).to_string_lossy();
    match name.split_once(".toml#") {
        Some((stem, face)) => format!("{stem}-{face}"),
        None => job
            .file_stem()
            .unwrap_or(job.as_os_str())
            .to_string_lossy()
            .into_owned(),
    }
}

/// Refuses jobs whose reports would be in one folder.
fn have_own_folders<'a>(jobs: impl Iterator<Item = &'a Path>) -> Result<()> {
    let mut folders: HashMap<String, &Path> = HashMap::new();
    for job in jobs {
        let folder = folder_of(job);
        if let Some(other) = folders.insert(folder.clone(), job) {
            return Err(Failure::input(
                format!(
                    "the reports of {} and {} would both be in the folder {folder}",
                    other.display(),
                    job.display()
                ),
                "verify them one after the other, each with a folder of its own for --report",
            ));
        }
    }
    Ok(())
}

/// Verifies the jobs, prints the figures, and fails if any job does; with the exit code of bad input if a job cannot be read.
pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let mut jobs = Vec::new();
    for path in &arguments.jobs {
        let faces = job_file::jobs_of(path)?;
        let stops = stops(&faces, |face| load(arguments, face).ok())?;
        jobs.extend(faces.into_iter().zip(stops));
    }
    if arguments.report.is_some() {
        have_own_folders(jobs.iter().map(|(job, _)| job.as_path()))?;
    }
    if let [(job, stop)] = jobs.as_slice() {
        let (passed, value) = verify_job(arguments, job, *stop, arguments.report.as_deref())?;
        if arguments.json {
            say!("{value}");
        }
        return if passed {
            Ok(())
        } else {
            Err(Failure::Failed(None))
        };
    }
    let (mut values, mut all_passed, mut refused) = (Vec::new(), true, None);
    for (job, stop) in &jobs {
        let directory = arguments
            .report
            .as_ref()
            .map(|directory| directory.join(folder_of(job)));
        match verify_job(arguments, job, *stop, directory.as_deref()) {
            Ok((passed, value)) => {
                all_passed &= passed;
                values.push(value);
            }
            Err(failure) => {
                all_passed = false;
                let mut value = error_json::of_failure(&failure).unwrap_or_default();
                value["job"] = job.display().to_string().into();
                value["passed"] = false.into();
                values.push(value);
                match &failure {
                    Failure::Input(report) => complain!("{report:?}"),
                    Failure::Failed(message) => {
                        complain!("error: {}", message.as_deref().unwrap_or_default())
                    }
                }
                if matches!(failure, Failure::Input(_)) && refused.is_none() {
                    refused = Some(job.display().to_string());
                }
            }
        }
    }
    if arguments.json {
        say!("{}", serde_json::json!({ "jobs": values, "passed": all_passed }));
    } else {
        summary(&values);
    }
    match refused {
        Some(job) => Err(Failure::input(
            format!("{job} was not verified"),
            "correct what is said above; the other jobs were verified",
        )),
        None if all_passed => Ok(()),
        None => Err(Failure::Failed(None)),
    }
}

/// The jobs together: how many passed, their time, and what they leave of a part.
fn summary(values: &[Value]) {
    let passed = values.iter().filter(|value| value["passed"] == true).count();
    let sum =
        |of: &dyn Fn(&Value) -> &Value| values.iter().filter_map(|value| of(value).as_f64()).sum::<f64>();
    let left = |key: &str| sum(&|value| &value["part"]["left"][key]);
    let [reachable_mm2, within_mm2] = ["reachable_mm2", "within_mm2"].map(left);
    if reachable_mm2 > 0.0 {
        say!(
            "{:.3} % of {reachable_mm2:.3} mm2 within {} of the scallop limit",
            100.0 * within_mm2 / reachable_mm2,
            1.0 + part::LEFTOVER_SHARE
        );
    }
    say!(
        "{passed} of {} jobs passed, {:.2} min in all",
        values.len(),
        sum(&|value| &value["time_s"]["whole"]) / S_PER_MIN
    );
}

fn load(arguments: &Arguments, path: &Path) -> Result<(Job, Prepared)> {
    let profile = read_profile(arguments.machine.as_ref())?;
    home::load(path, profile.as_ref(), arguments.placed.origin, None)
}

/// The job of passes of constant scallop height with straight ones, as it would be run.
fn straight(job: &Job, stop: Stop) -> Option<(Job, Prepared)> {
    let job = Job {
        spacing: Spacing::Exact,
        ..job.clone()
    };
    let (mut job, mut prepared) = settled(job).ok()?;
    stop.apply(&mut job, &mut prepared);
    Some((job, prepared))
}

/// Verifies one job and prints its figures unless JSON is requested. Returns whether it passed, and its JSON object.
fn verify_job(
    arguments: &Arguments,
    path: &Path,
    stop: Stop,
    directory: Option<&Path>,
) -> Result<(bool, Value)> {
    let (mut job, mut prepared) = load(arguments, path)?;
    stop.apply(&mut job, &mut prepared);
    let directory = WantedReport::new(directory, arguments.force)?;
    let timed = timed(&job, &prepared)?;
    let original = original(&job)?;
    let straight = (job.spacing.is_constant())
        .then(|| straight(&job, stop))
        .flatten();
    let requirements = Requirements {
        with_optimum: arguments.optimum || job.machine.has_limits(),
        swept: swept::Requirements {
            scallop_tolerance: arguments.scallop_tolerance,
            original: original
                .as_ref()
                .map(|(offset_mm, tolerance_mm)| swept::Original {
                    offset_mm: offset_mm.as_ref(),
                    tolerance_mm: *tolerance_mm,
                }),
        },
        straight: straight.as_ref().map(|(job, prepared)| (job, prepared)),
    };
    let mut sketch = directory.map(|_| Sketch::new(&job, timed.passes.len()));
    let mut centres = job.origin.reach().map(|_| PassCentres::default());
    let mut draw = |emitted: &PassSample, checked: &SampleCheck| {
        if let Some(centres) = &mut centres {
            centres.add(emitted);
        }
        if let Some(sketch) = &mut sketch {
            sketch.add(emitted, checked);
        }
    };
    let each: &mut SampleObserver<'_> = &mut draw;
    let bar = Bar::new();
    let found = verify_run(&job, &prepared, &timed, Some(each), &requirements, &bar);
    bar.clear();
    let mut found = found?;
    let check = match &centres {
        Some(centres) => part::check_run(&job, centres, &found.measured.links_mm, 0.0)?,
        None => None,
    };
    if let Some(check) = &check {
        let (failures, warnings) = part_words::reasons(check, arguments.accept_unknown_faces);
        found.failures.extend(failures);
        found.warnings.extend(warnings);
    }
    let RunMeasurements { findings, swept, .. } = &found.measured;
    let mut remarks = Remarks {
        failures: found.failures.clone(),
        verified: true,
        scallops: Some(scallops(&job, swept)),
        marks: marks(&job, &timed, &found.measured),
        links_mm: found.measured.links_mm.clone(),
        figures: figures(&found.measured),
        passes: found.measured.optimum.passes.clone(),
        ..remarks(&timed, findings)
    };
    remarks.warnings.extend(found.warnings.iter().cloned());
    remarks.marks.extend(check.iter().flat_map(part_words::marks));
    let page = report(&job, directory, sketch.as_ref(), findings, &remarks)?;
    let passed = found.failures.is_empty();
    if !arguments.json {
        say!("{}", path.display());
        print_verification(&job, &prepared, &found, check.as_ref());
        if let Some(page) = page {
            say!("  report {}", page.display());
        }
    }
    let mut value = json(&job, &prepared, &found);
    value["part"] = check
        .as_ref()
        .map_or(Value::Null, |check| part_words::json(&job, check));
    value["job"] = path.display().to_string().into();
    Ok((passed, value))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A place of the region that is too high does not make the ridges so: it has its own figures and its own mark.
    #[test]
    fn a_region_and_its_ridges_have_their_own_figures() {
        let text = include_str!("../../../jobs/region.toml");
        let mut job = job_file::parse("region.toml", text).unwrap();
        job.scallop_mm = 0.2;
        let (job, prepared) = settled(job).unwrap();
        let timed = timed(&job, &prepared).unwrap();
        let requirements = Requirements {
            with_optimum: false,
            swept: swept::Requirements::default(),
            straight: None,
        };
        let mut found = verify_run(&job, &prepared, &timed, None, &requirements, &()).unwrap();
        assert!(found.failures.is_empty(), "{:?}", found.failures);
        let highest = found.measured.swept.region.unwrap().highest.unwrap();
        found.measured.swept.region_verdict = Verdict::Violated;
        let [mark] = &marks(&job, &timed, &found.measured)[..] else {
            panic!("one mark: the region's");
        };
        assert_eq!(mark.place_mm, highest.point_mm);
        assert!(mark.what.contains("in the region"), "{}", mark.what);
        found.measured.swept.scallop_verdict = Verdict::Unknown;
        let json = json(&job, &prepared, &found);
        assert_eq!(
            (&json["scallop_max_mm"], &json["scallop_at"]),
            (&Value::Null, &Value::Null)
        );
        assert_eq!(json["region_heights"]["highest_mm"], highest.height_mm);
    }

    #[test]
    fn no_two_reports_share_a_folder() {
        let jobs = |names: &[&'static str]| have_own_folders(names.iter().map(Path::new));
        assert!(jobs(&["a/part.toml#1", "a/part.toml#2", "a/plate.toml"]).is_ok());
        for same in [
            ["a/part.toml", "b/part.toml"],
            ["part.toml#34", "part-34.toml"],
            ["a.toml", "a.toml"],
        ] {
            assert!(jobs(&same).is_err(), "{same:?}");
        }
    }

    #[test]
    fn each_face_of_a_part_has_a_folder() {
        assert_eq!(folder_of(Path::new("a/part.toml#34")), "part-34");
        assert_eq!(folder_of(Path::new("a/plate.v2.toml")), "plate.v2");
    }
}
