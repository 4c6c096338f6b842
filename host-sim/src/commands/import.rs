//! `import`: converts a face of a CAD file to a job.

use super::out::{complain, say};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args;
use serde_json::{Value, json};

use super::{Failure, Result, cannot_write, progress};
use cad::{
    CadError, Face, Form, JobOptions, JobText, MachinableFace, Measures, Model, Options, degrees, machinable,
    measure, read, write_job,
};
use job_file::TOLERANCE_DEFAULT_MM;

/// Converts a face of a STEP, IGES or 3DM file to a job, or lists the faces.
///
/// Planes, cylinders, cones, spheres, tori, surfaces of revolution, extrusions and B-splines of degree up to 3 are converted exactly.
/// Others are approximated within the tolerance, and the deviation is measured.
///
/// Example: cargo sim import jobs/cad/blade.step --list
/// Example: cargo sim import jobs/cad/blade.step --face 2 -o blade.toml --radius-mm 4
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// STEP, IGES or 3DM file.
    file: PathBuf,
    /// Lists the faces; writes nothing.
    #[arg(long, conflicts_with_all = ["face", "output"])]
    list: bool,
    /// Number of the face in the list; optional if the file has one face.
    #[arg(long, value_name = "N")]
    face: Option<usize>,
    /// Writes the job into this file.
    #[arg(short, long, value_name = "JOB")]
    output: Option<PathBuf>,
    /// Overwrites an existing job file.
    #[arg(long)]
    force: bool,
    /// Largest deviation of an approximation from the surface, mm.
    #[arg(long, value_name = "MM", default_value_t = TOLERANCE_DEFAULT_MM)]
    tolerance: f64,
    /// Machines a trimmed face over the whole rectangle of the surface around its boundary.
    #[arg(long)]
    untrimmed: bool,
    /// Ball radius, mm. Default: the largest standard radius below the least concave radius.
    #[arg(long, value_name = "MM")]
    radius_mm: Option<f64>,
    /// Feed along the surface, mm/min.
    #[arg(long, value_name = "F")]
    feed_mm_min: Option<f64>,
    /// Scallop height limit, mm.
    #[arg(long, value_name = "MM")]
    scallop_mm: Option<f64>,
    /// Surface parameter along a pass: "u", "v" or "auto".
    #[arg(long, value_name = "U|V")]
    along: Option<String>,
    /// Machined side: "up", "+" or "-". Default: away from the material; "up" if that faces up or is unknown.
    #[arg(long, value_name = "SIDE", allow_hyphen_values = true)]
    side: Option<String>,
    /// Order of the passes: "zig" or "zigzag".
    #[arg(long, value_name = "PATTERN")]
    pattern: Option<String>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

impl From<CadError> for Failure {
    fn from(error: CadError) -> Self {
        Self::input(error.to_string(), error.remedy)
    }
}

/// A line of the list.
struct Row<'f> {
    face: &'f Face,
    trimmed: Option<String>,
    becomes: std::result::Result<(MachinableFace, Measures), CadError>,
}

/// Measures all faces on all cores; rows in the order of the faces.
fn rows<'f>(file: &str, faces: &'f [Face], options: &Options) -> Vec<Row<'f>> {
    let bar = progress(faces.len() as u64, "measuring");
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(faces.len()));
    // A trimmed face is listed with the size of its untrimmed rectangle.
    let options = Options {
        untrimmed: true,
        ..*options
    };
    let threads = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    std::thread::scope(|scope| {
        for _ in 0..threads.min(faces.len()) {
            scope.spawn(|| {
                while let Some(face) = faces.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let becomes = machinable(file, face, &options).map(|made| {
                        let measures = measure(&made.spec());
                        (made, measures)
                    });
                    let trimmed = becomes
                        .as_ref()
                        .ok()
                        .and_then(|(made, _)| made.outline.trimmed.clone());
                    bar.inc(1);
                    if let Ok(mut done) = done.lock() {
                        done.push(Row {
                            face,
                            trimmed,
                            becomes,
                        });
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    let mut rows = done.into_inner().unwrap_or_default();
    rows.sort_by_key(|row| row.face.number);
    rows
}

fn row_json(row: &Row<'_>) -> Value {
    let face = row.face;
    let mut value = json!({
        "face": face.number,
        "entity": face.entity,
        "kind": face.surface.kind(),
        "degree": degrees(&face.surface),
        "solid": face.solid,
        "trimmed": row.trimmed.is_some(),
        "trimmed_why": row.trimmed,
    });
    let more = match &row.becomes {
        Ok((made, measures)) => json!({
            "poles": [made.nurbs.poles_mm.len(), made.nurbs.poles_mm[0].len()],
            "patches": made.patches,
            "rational": made.nurbs.rational,
            "size_mm": measures.size_mm(),
            "corners_mm": measures.corners_mm,
            "least_concave_radius_mm": { "plus": measures.concave_mm[0], "minus": measures.concave_mm[1] },
            "becomes": if made.form == Form::Exact { "exact" } else { "approximated" },
            "deviation": deviation_json(&made.form),
            "error": Value::Null,
        }),
        Err(error) => json!({ "becomes": Value::Null, "error": error.what }),
    };
    if let (Value::Object(value), Value::Object(more)) = (&mut value, more) {
        value.extend(more);
    }
    value
}

fn deviation_json(form: &Form) -> Value {
    match form {
        Form::Exact => Value::Null,
        Form::Fitted { why, deviation } => json!({
            "why": why,
            "max_mm": deviation.max_mm,
            "normal_max_rad": deviation.normal_rad,
            "places": deviation.places,
        }),
    }
}

fn print_rows(rows: &[Row<'_>]) {
    say!(
        "{:>5} {:<18} {:<6} {:>8} {:>26} {:>11} {:>11} {:<8} becomes",
        "face",
        "kind",
        "degree",
        "patches",
        "size mm",
        "concave +",
        "concave -",
        "trimmed"
    );
    for row in rows {
        let face = row.face;
        let degree = degrees(&face.surface).map_or("-".to_owned(), |[p, q]| format!("{p} x {q}"));
        let (kind, number) = (face.surface.kind(), face.number);
        let trimmed = if row.trimmed.is_some() { "yes" } else { "no" };
        match &row.becomes {
            Ok((made, measures)) => {
                let [x, y, z] = measures.size_mm();
                let size = format!("{x:.2} x {y:.2} x {z:.2}");
                let [plus, minus] = measures
                    .concave_mm
                    .map(|radius| radius.map_or("-".to_owned(), |radius| format!("{radius:.3}")));
                let becomes = match &made.form {
                    Form::Exact => "exact".to_owned(),
                    Form::Fitted { deviation, .. } => {
                        format!("approximated, within {:.1e} mm", deviation.max_mm)
                    }
                };
                let patches = made.patches;
                say!(
                    "{number:>5} {kind:<18} {degree:<6} {patches:>8} {size:>26} {plus:>11} {minus:>11} {trimmed:<8} {becomes}"
                );
            }
            Err(error) => say!("{number:>5} {kind:<18} {degree:<6} {:>8} {}", "-", error.what),
        }
    }
}

fn list(arguments: &Arguments, file: &str, model: &Model, options: &Options) {
    let rows = rows(file, &model.faces, options);
    if arguments.json {
        let value = json!({
            "file": file,
            "faces": rows.iter().map(row_json).collect::<Vec<_>>(),
            "warnings": model.warnings,
        });
        say!("{value}");
        return;
    }
    print_rows(&rows);
    say!(
        "concave: least concave radius, mm, seen from the side of + or - S_u x S_v. Size and radii of a trimmed face are those \
         of the rectangle around it."
    );
}

/// The face of this number; without a number, the only one.
pub(crate) fn chosen<'m>(
    file: &str,
    model: &'m Model,
    number: Option<usize>,
) -> std::result::Result<&'m Face, CadError> {
    let count = model.faces.len();
    match number {
        None if count == 1 => Ok(&model.faces[0]),
        None => Err(CadError::new(
            file,
            format!("the file has {count} faces"),
            "choose one with --face N; import --list shows them",
        )),
        Some(number) => number
            .checked_sub(1)
            .and_then(|index| model.faces.get(index))
            .ok_or_else(|| {
                CadError::face(
                    file,
                    format!("there is no face {number}: the file has {count}"),
                    format!("give a face from 1 to {count}; import --list shows them"),
                )
            }),
    }
}

fn write(path: &Path, text: &str, force: bool) -> Result<()> {
    if path.exists() && !force {
        return Err(Failure::input(
            format!("{} exists already", path.display()),
            "name another file, or overwrite it with --force",
        ));
    }
    std::fs::write(path, text).map_err(|error| cannot_write(path, &error))
}

/// Path of a CAD file as its job file names it: relative to the job's folder where both have a common one. `None` where TOML cannot
/// express it plainly.
fn relative(file: &Path, job: &Path) -> Option<String> {
    let folder = job.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
    let file = file.canonicalize().ok()?;
    let common = file
        .components()
        .zip(folder.components())
        .take_while(|(a, b)| a == b)
        .count();
    let up = folder
        .components()
        .skip(common)
        .map(|_| std::path::Component::ParentDir);
    let path: PathBuf = up.chain(file.components().skip(common)).collect();
    let text = path.to_str()?;
    (!text.chars().any(char::is_control)).then(|| text.to_owned())
}

fn report(arguments: &Arguments, path: &Path, face: &Face, made: &MachinableFace, written: &JobText) {
    let size = written.measures.size_mm();
    if arguments.json {
        let value = json!({
            "job": path.display().to_string(),
            "face": face.number,
            "entity": face.entity,
            "kind": face.surface.kind(),
            "patches": made.patches,
            "rational": made.nurbs.rational,
            "size_mm": size,
            "least_concave_radius_mm": { "plus": written.measures.concave_mm[0], "minus": written.measures.concave_mm[1] },
            "becomes": if made.form == Form::Exact { "exact" } else { "approximated" },
            "deviation": deviation_json(&made.form),
            "untrimmed": made.outline.trimmed.is_some(),
            "radius_mm": written.radius_mm,
            "side": written.side,
            "warnings": written.warnings,
        });
        say!("{value}");
        return;
    }
    say!("{}", path.display());
    say!(
        "  face         {} ({}, {})",
        face.number,
        face.entity,
        face.surface.kind()
    );
    say!(
        "  size         {:.3} x {:.3} x {:.3} mm",
        size[0],
        size[1],
        size[2]
    );
    let exact = if made.form == Form::Exact {
        "exact"
    } else {
        "approximated"
    };
    say!("  surface      {} patches, {exact}", made.patches);
    say!(
        "  tool         ball of {} mm, side \"{}\"",
        written.radius_mm,
        written.side
    );
    for warning in &written.warnings {
        say!("  note         {warning}");
    }
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let file = arguments.file.display().to_string();
    let options = Options {
        tolerance_mm: arguments.tolerance,
        untrimmed: arguments.untrimmed,
    };
    if !arguments.list && arguments.output.is_none() {
        return Err(Failure::input(
            "neither --list nor a job file to write",
            "show the faces with --list, or write a job with -o JOB.toml",
        ));
    }
    let model = read(&arguments.file)?;
    for warning in &model.warnings {
        complain!("warning: {warning}");
    }
    let Some(path) = arguments.output.as_ref().filter(|_| !arguments.list) else {
        list(arguments, &file, &model, &options);
        return Ok(());
    };
    let face = chosen(&file, &model, arguments.face)?;
    let made = machinable(&file, face, &options)?;
    let written = write_job(
        &file,
        face,
        &made,
        &JobOptions {
            radius_mm: arguments.radius_mm,
            feed_mm_min: arguments.feed_mm_min,
            scallop_mm: arguments.scallop_mm,
            along: arguments.along.clone(),
            side: arguments.side.clone(),
            pattern: arguments.pattern.clone(),
            source: relative(&arguments.file, path).map(|source| (source, arguments.tolerance)),
        },
    );
    // The job is parsed before it is written, so that the options are checked by the rules of the job file.
    job_file::parse_with(&path.display().to_string(), &written.text, &cad::Faces)?;
    write(path, &written.text, arguments.force)?;
    report(arguments, path, face, &made, &written);
    Ok(())
}
