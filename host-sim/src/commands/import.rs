//! `import`: converts a face of a CAD file to a job.

mod condition;
mod list;
mod numbers;
mod page;
mod whole_part;

use super::out::{complain, say};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::{Failure, Result, output_file, region_words, spinner};
use cad::{
    CadError, Face, Form, JobOptions, JobText, MachinableFace, Model, Options, machinable, read_once,
    write_job,
};
use condition::Condition;
use job::{FaceReach, Start};
use job_file::TOLERANCE_DEFAULT_MM;
use list::Key;
use machine::advice::{SpacingAdvice, advise_spacing};
use whole_part::Up;

/// Converts a face of a STEP, IGES or 3DM file to a job, or lists the faces.
///
/// Planes, cylinders, cones, spheres, tori, surfaces of revolution, extrusions and B-splines of degree up to 3 are converted exactly.
/// Others are approximated within the tolerance, and the deviation is measured.
///
/// Example: cargo sim import jobs/cad/blade.step --list
/// Example: cargo sim import jobs/cad/blade.step --list --only up --only whole --sort area --reverse
/// Example: cargo sim import jobs/cad/blade.step --list --page faces.html
/// Example: cargo sim import jobs/cad/blade.step --face 2 -o blade.toml --radius-mm 4
/// Example: cargo sim import jobs/cad/blade.step --part --tool 3 -o part.toml
/// Example: cargo sim import jobs/cad/blade.step --part --tool 3 -o blade/
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// STEP, IGES or 3DM file.
    file: PathBuf,
    /// Lists the faces; writes nothing.
    #[arg(long, conflicts_with_all = ["face", "output"])]
    list: bool,
    /// With --list: only faces that meet this; repeatable. `up` (the machined side faces up), `whole` (not trimmed), `kind=WORD`, `name=WORD`,
    /// `colour=#RRGGBB`, `area>MM2`, `area<MM2`.
    #[arg(long, value_name = "CONDITION", requires = "list")]
    only: Vec<Condition>,
    /// With --list: order of the faces.
    #[arg(long, value_enum, requires = "list", default_value = "face")]
    sort: Key,
    /// With --list: the other way round.
    #[arg(long, requires = "list")]
    reverse: bool,
    /// With --list: writes a page with the picture of the part, on which faces are chosen, into this file.
    #[arg(long, value_name = "FILE.html", requires = "list")]
    page: Option<PathBuf>,
    /// Number of the face in the list; optional if the file has one face.
    #[arg(long, value_name = "N")]
    face: Option<usize>,
    /// Writes the job into this file.
    #[arg(short, long, value_name = "JOB")]
    output: Option<PathBuf>,
    /// Overwrites an existing job file or page; with --part, removes the jobs of an earlier import from the folder -o.
    #[arg(long)]
    force: bool,
    /// Largest deviation of an approximation from the surface, mm.
    #[arg(long, value_name = "MM", default_value_t = TOLERANCE_DEFAULT_MM)]
    tolerance: f64,
    /// Machines a trimmed face over the whole rectangle of the surface around its boundary.
    #[arg(long)]
    untrimmed: bool,
    /// A job of all faces of the part that the tool reaches without touching another, into the file -o (.toml), or a job for each into the folder -o; with a summary
    /// and a page of the part.
    #[arg(long, conflicts_with_all = ["list", "face", "untrimmed", "side", "page"], requires = "output")]
    part: bool,
    /// With --part: only these faces, e.g. 1,4,7.
    #[arg(long, value_name = "N,...", value_delimiter = ',', requires = "part")]
    faces: Vec<usize>,
    /// With --part: the side of the part that looks up.
    #[arg(
        long,
        value_enum,
        requires = "part",
        default_value = "+z",
        allow_hyphen_values = true
    )]
    up: Up,
    /// Ball radius, mm. Default: the largest standard radius below the least concave radius.
    #[arg(long, value_name = "MM", visible_alias = "tool")]
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
    /// Distance between passes: "exact", "constant" (curves of constant scallop height; --start) or "first-order". Default: "constant" where that saves more
    /// than 2 % of the time of the whole job, by a trial, else "exact".
    #[arg(long, value_name = "SPACING", conflicts_with_all = ["list", "part"])]
    spacing: Option<String>,
    /// With --spacing constant: the first pass is on the "edge", or in the "middle"; "auto": the faster.
    #[arg(long, value_name = "START", requires = "spacing")]
    start: Option<String>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

impl From<CadError> for Failure {
    fn from(error: CadError) -> Self {
        Self::input(error.to_string(), error.remedy)
    }
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

/// The rule for the distance between passes that a trial advises.
pub(super) fn advice_json(advice: &SpacingAdvice) -> Value {
    json!({
        "spacing": advice.spacing.name(),
        "start": advice.spacing.start().map(Start::name),
        "time_saved_pct": advice.saved().map(|saved| 100.0 * saved),
        "against": advice.rejection(),
    })
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

/// The job's text with this rule for the distance between passes.
fn spaced(text: &str, spacing: &str, start: Option<&str>) -> String {
    let mut keys = format!(
        "spacing = {spacing:?}      # \"exact\": straight passes; \"constant\": curves of constant scallop height\n"
    );
    if let Some(start) = start {
        let _ = writeln!(
            keys,
            "start = {start:?}             # the first curve: on the \"edge\", in the \"middle\"; \"auto\": the faster"
        );
    }
    match text.find("\npattern = ") {
        Some(place) => format!("{}{keys}{}", &text[..=place], &text[place + 1..]),
        None => format!("{text}{keys}"),
    }
}

/// A job that was written, and what it was made from.
struct Written<'a> {
    path: &'a Path,
    face: &'a Face,
    made: &'a MachinableFace,
    text: &'a JobText,
    reach: Option<&'a FaceReach>,
    advice: Option<&'a SpacingAdvice>,
}

impl Written<'_> {
    /// How the face became a surface.
    fn becomes(&self) -> &'static str {
        if self.made.form == Form::Exact {
            "exact"
        } else {
            "approximated"
        }
    }

    fn json(&self) -> Value {
        let Self {
            path,
            face,
            made,
            text,
            ..
        } = self;
        json!({
            "job": path.display().to_string(),
            "face": face.number,
            "entity": face.entity,
            "kind": face.surface.kind(),
            "patches": made.patches,
            "rational": made.nurbs.rational,
            "size_mm": text.measures.size_mm(),
            "least_concave_radius_mm": { "plus": text.measures.concave_mm[0], "minus": text.measures.concave_mm[1] },
            "becomes": self.becomes(),
            "deviation": deviation_json(&made.form),
            "trimmed": made.trimmed.is_some(),
            "untrimmed": made.outline.trimmed.is_some() && made.trimmed.is_none(),
            "radius_mm": text.radius_mm,
            "side": text.side,
            "warnings": text.warnings,
            "region": self.reach.map(region_words::json),
            "spacing": self.advice.map(advice_json),
        })
    }

    fn print(&self) {
        let Self {
            path,
            face,
            made,
            text,
            ..
        } = self;
        let [x, y, z] = text.measures.size_mm();
        say!("{}", path.display());
        say!(
            "  face         {} ({}, {})",
            face.number,
            face.entity,
            face.surface.kind()
        );
        say!("  size         {x:.3} x {y:.3} x {z:.3} mm");
        say!("  surface      {} patches, {}", made.patches, self.becomes());
        say!(
            "  tool         ball of radius {} mm, side \"{}\"",
            text.radius_mm,
            text.side
        );
        if let Some(advice) = self.advice {
            say!("  passes       {}", advice.sentence());
        }
        for line in self.reach.iter().flat_map(|reach| region_words::lines(reach)) {
            say!("  reach        {line}");
        }
        for warning in &text.warnings {
            say!("  note         {warning}");
        }
        say!("  next         cargo sim verify {}", path.display());
    }
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let file = arguments.file.display().to_string();
    let options = Options {
        tolerance_mm: arguments.tolerance,
        untrimmed: arguments.untrimmed,
        ..Options::default()
    };
    numbers::check(arguments)?;
    if !arguments.list && arguments.output.is_none() {
        return Err(Failure::input(
            "neither --list nor a job file to write",
            "show the faces with --list, or write a job with -o JOB.toml",
        ));
    }
    output_file::note_input(&arguments.file);
    for path in arguments
        .output
        .iter()
        .filter(|_| !arguments.part)
        .chain(&arguments.page)
    {
        output_file::check(path, arguments.force)?;
    }
    let model = read_once(&arguments.file)?;
    for warning in &model.warnings {
        complain!("warning: {warning}");
    }
    for number in &arguments.faces {
        chosen(&file, &model, Some(*number))?;
    }
    if let Some(folder) = arguments.output.as_ref().filter(|_| arguments.part) {
        return whole_part::command(arguments, &file, &model, folder);
    }
    let Some(path) = arguments.output.as_ref().filter(|_| !arguments.list) else {
        return list::list(arguments, &file, &model, &options);
    };
    let face = chosen(&file, &model, arguments.face)?;
    let made = machinable(&file, face, &options)?;
    let mut written = write_job(
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
            in_part: false,
            rotate_deg: [0.0; 3],
            translate_mm: [0.0; 3],
            source: relative(&arguments.file, path).map(|source| (source, arguments.tolerance)),
        },
    )?;
    // The job is parsed before it is written, so that the options are checked by the rules of the job file.
    let name = path.display().to_string();
    if let Some(spacing) = &arguments.spacing {
        written.text = spaced(&written.text, spacing, arguments.start.as_deref());
    }
    let job = job_file::parse_with(&name, &written.text, &part::Faces)?;
    let advice = (arguments.spacing.is_none() && job.region.is_none()).then(|| {
        let bar = spinner("trying straight passes and those of constant scallop height");
        let advice = advise_spacing(&job);
        bar.finish_and_clear();
        advice
    });
    if let Some(start) = advice.as_ref().and_then(|advice| advice.spacing.start()) {
        written.text = spaced(&written.text, "constant", Some(start.name()));
        job_file::parse_with(&name, &written.text, &part::Faces)?;
    }
    output_file::write(path, written.text.as_bytes(), arguments.force)?;
    let written = Written {
        path,
        face,
        made: &made,
        text: &written,
        reach: job.origin.reach(),
        advice: advice.as_ref(),
    };
    if arguments.json {
        say!("{}", written.json());
    } else {
        written.print();
    }
    Ok(())
}
