//! The job file: TOML to a [`Job`], checked for shape and range.
//!
//! ```text
//! text --toml--> spanned tables --section.rs--> typed values --surface.rs, machine.rs, steps.rs--> Job
//!                                  any step --JobError--> file, line, caret, remedy
//! ```
//!
//! Reading a job file starts no process: a surface of `kind = "file"` is resolved by the [`FaceReader`] that the caller passes.

mod file;
mod homing;
mod machine;
mod placement;
mod program;
mod region;
mod section;
mod setup;
mod spindle;
mod steps;
mod surface;
#[cfg(test)]
mod tests;
mod text;

use std::path::Path;

use interp_core::command::OVERRIDE_MAX_PERCENT;
use interp_core::job::STEP_MAX_MM;
use job::{
    Along, AlongChoice, CHORD_DEFAULT_MM, CadSource, FEED_MAX_MM_MIN, FEED_MIN_MM_MIN, Job, JobError,
    MachineProfile, MachineSpec, OVERRUN_MAX_MM, Pattern, Side, Spacing, Start, StartChoice,
};
use patches::placement::Placement;
use section::{Reader, Section};

pub use file::{
    Face, FaceError, FaceReader, FaceRegion, FaceSurface, PART_TOLERANCE_MM, STEEPEST_DEG,
    TOLERANCE_DEFAULT_MM, TOLERANCE_MAX_MM,
};
pub use program::jobs_of;
pub use steps::slots_max_us;

/// How far the surface of a face goes on beyond it, in step-overs on a plane: passes begin and end half a step-over beside it, which on concave places
/// is twice as long.
pub const STEP_OVERS_AROUND: f64 = 1.1;

/// Reads a job without a surface of `kind = "file"` from a file.
///
/// # Errors
/// As [`load_with`].
pub fn load(path: &Path) -> Result<Job, JobError> {
    load_with(path, &file::NoFaces)
}

/// Reads a job from a file; `faces` resolves a surface of `kind = "file"`.
///
/// # Errors
/// The file cannot be read, is not TOML, or a value in it is missing, unknown, of the wrong shape or out of range; the errors of `faces`.
pub fn load_with(path: &Path, faces: &dyn FaceReader) -> Result<Job, JobError> {
    let name = path.display().to_string();
    let text = program::read(path)?;
    parse_with(&name, &text, faces)
}

/// Reads a job from a file for a machine with this profile: what the job does not say of the machine is the profile's.
///
/// # Errors
/// As [`load_with`]; the job exceeds the profile.
pub fn load_on(
    path: &Path,
    faces: &dyn FaceReader,
    profile: Option<&MachineProfile>,
) -> Result<Job, JobError> {
    let name = path.display().to_string();
    let text = program::read(path)?;
    parse_on(&name, &text, faces, profile)
}

/// Reads a machine's profile from a file: one section `[machine]`, with the keys of a job's that are the machine's.
///
/// # Errors
/// The file cannot be read, is not TOML, or a value in it is missing, unknown, of the wrong shape or out of range.
pub fn load_profile(path: &Path) -> Result<MachineProfile, JobError> {
    parse_profile(&path.display().to_string(), &text::read(path)?)
}

/// Reads a machine's profile from text; errors name the file `name`.
///
/// # Errors
/// As [`load_profile`].
pub fn parse_profile(name: &str, text: &str) -> Result<MachineProfile, JobError> {
    let document = Reader::new(name, text).document()?;
    document.only(&["machine", "home", "probe", "door", "spindle"], &[])?;
    machine::read_profile(&document)
}

/// Reads a job without a surface of `kind = "file"` from text; errors name the file `name`.
///
/// # Errors
/// As [`load_with`].
pub fn parse(name: &str, text: &str) -> Result<Job, JobError> {
    parse_with(name, text, &file::NoFaces)
}

/// Reads a job from text; errors name the file `name`, `faces` resolves a surface of `kind = "file"`.
///
/// # Errors
/// As [`load_with`].
pub fn parse_with(name: &str, text: &str, faces: &dyn FaceReader) -> Result<Job, JobError> {
    parse_on(name, text, faces, None)
}

fn parse_on(
    name: &str,
    text: &str,
    faces: &dyn FaceReader,
    profile: Option<&MachineProfile>,
) -> Result<Job, JobError> {
    let reader = Reader::new(name, text);
    let document = reader.document()?;
    document.only(
        &[
            "surface",
            "placement",
            "region",
            "tool",
            "stock",
            "fixture",
            "part",
            "cut",
            "machine",
            "spindle",
        ],
        &[],
    )?;
    let part = match document.optional_section("part")? {
        Some(section) => Some(file::part(&section)?),
        None => None,
    };
    let around_mm = if part.is_some() {
        around_mm(&document)?
    } else {
        0.0
    };
    let (of_face, face) = surface::read(&document.section("surface")?, faces, around_mm)?;
    let (unplaced, trimmed) = (of_face.surface, of_face.trimmed);
    let (surface, placement) = match document.optional_section("placement")? {
        Some(section) => placement::place(&section, &unplaced)?,
        None => (unplaced.clone(), Placement::default()),
    };
    let region = match document.optional_section("region")? {
        Some(section) => Some(region::read(&section, &surface)?),
        None => None,
    };
    let (radius_mm, body) = setup::tool(&document.section("tool")?)?;
    let setup = setup::read(&document)?;
    let cut = document.section("cut")?;
    cut.only(
        &[
            "feed_mm_min",
            "scallop_mm",
            "along",
            "side",
            "pattern",
            "spacing",
            "start",
            "chord_mm",
            "overrun_mm",
        ],
        &[],
    )?;
    let below_radius = |key: &str, remedy: &str| {
        let value = cut.number(key)?;
        if value > 0.0 && value < radius_mm {
            return Ok(value);
        }
        let what =
            format!("`{key}` must be above 0 and below the ball radius of {radius_mm} mm, not {value}");
        Err(cut.error(key, what, remedy))
    };
    let directions = [("u", Some(Along::U)), ("v", Some(Along::V)), ("auto", None)];
    let along = cut.choice("along", &directions)?;
    let mut origin = reader.origin(&document);
    origin.set_cad(face.map(|face| CadSource {
        path: face.path,
        face: face.number,
        tolerance_mm: face.tolerance_mm,
        untrimmed: face.untrimmed,
        parameters: face.parameters,
        around_mm: face.around_mm,
        trimmed,
        surface: unplaced,
        scale: placement.scale,
    }));
    origin.set_part(part);
    origin.set_rotate_deg(placement.rotate_deg);
    if along.is_none() {
        origin.set_along_choice(AlongChoice::Auto);
    }
    let (spacing, is_start_auto) = read_spacing(&cut)?;
    if is_start_auto {
        origin.set_start_choice(StartChoice::Auto);
    }
    let mut job = Job {
        surface,
        region,
        radius_mm,
        body,
        setup,
        feed_mm_min: cut.number_within(
            "feed_mm_min",
            FEED_MIN_MM_MIN,
            FEED_MAX_MM_MIN,
            "the feed in mm/min, e.g. 600",
        )?,
        scallop_mm: below_radius("scallop_mm", "give the scallop height limit in mm, e.g. 0.005")?,
        along: along.unwrap_or(Along::U),
        side: cut.choice("side", &[("up", Side::Up), ("+", Side::Plus), ("-", Side::Minus)])?,
        pattern: match cut.has("pattern") {
            true => cut.choice("pattern", &[("zig", Pattern::Zig), ("zigzag", Pattern::Zigzag)])?,
            false => Pattern::Zig,
        },
        spacing,
        chord_mm: match cut.has("chord_mm") {
            true => below_radius("chord_mm", "give the chord error limit in mm, e.g. 0.005")?,
            false => CHORD_DEFAULT_MM.min(0.5 * radius_mm),
        },
        overrun_mm: match cut.has("overrun_mm") {
            true => read_overrun(&cut)?,
            false => 0.0,
        },
        machine: MachineSpec {
            spindle: document
                .optional_section("spindle")?
                .map(|spindle| spindle::read(&spindle, profile))
                .transpose()?,
            ..machine::read_on(document.optional_section("machine")?.as_ref(), profile)?
        },
        origin,
    };
    check_feed(&cut, &job)?;
    if trimmed || job.origin.part().is_some() {
        own_region(&document, &mut job, faces)?;
    }
    Ok(job)
}

/// Largest feed of a job with axis limits, mm/min: a period at the maximum override is the core's maximum step.
#[must_use]
pub fn feed_max_within_limits(period_us: f64) -> f64 {
    f64::from(STEP_MAX_MM) * 100.0 / f64::from(OVERRIDE_MAX_PERCENT) * 60e6 / period_us
}

fn check_feed(cut: &Section<'_>, job: &Job) -> Result<(), JobError> {
    let period_us = job.machine.period_us;
    let most = feed_max_within_limits(period_us);
    if !job.machine.has_limits() || job.feed_mm_min <= most {
        return Ok(());
    }
    let what = format!(
        "`feed_mm_min` must be at most {most} on a machine with limits and a period of {period_us} us, not {}",
        job.feed_mm_min
    );
    Err(cut.error("feed_mm_min", what, "lower the feed, or shorten period_us"))
}

/// How far the surface of a face must go on beyond it, in mm of its file, for passes to begin and end beside it.
fn around_mm(document: &Section<'_>) -> Result<f64, JobError> {
    let (radius_mm, _) = setup::tool(&document.section("tool")?)?;
    let scallop_mm = document.section("cut")?.number("scallop_mm")?;
    let scale = match document.optional_section("placement")? {
        Some(section) => placement::read(&section)?.scale,
        None => 1.0,
    };
    Ok(STEP_OVERS_AROUND * job::plane_step_over_mm(radius_mm, scallop_mm.max(0.0)) / scale)
}

/// Makes the region of a job from its face and its part.
fn own_region(document: &Section<'_>, job: &mut Job, faces: &dyn FaceReader) -> Result<(), JobError> {
    if let Some(section) = document.optional_section("region")? {
        return Err(section.error(
            "loops",
            "the region is made from the trimmed face and the part, and the job gives another",
            "remove [region]; or remove [part] and set untrimmed = true in [surface]",
        ));
    }
    let made = faces.region(job).map_err(|error| {
        let (section, key) = match (error.of_face, job.origin.part().is_some()) {
            (false, true) => (document.section("part"), "path"),
            _ => (document.section("surface"), "face"),
        };
        match section {
            Ok(section) => section.error(key, error.what, error.remedy),
            Err(error) => error,
        }
    })?;
    job.region = Some(made.region);
    job.machine.part_top_mm = made.reach.top_mm;
    job.origin.set_reach(made.reach);
    Ok(())
}

/// The rule for the distance between passes, and where passes of constant scallop height start; whether that start is chosen by trials.
fn read_spacing(cut: &Section<'_>) -> Result<(Spacing, bool), JobError> {
    let starts = [
        ("edge", Some(Start::Edge)),
        ("middle", Some(Start::Middle)),
        ("auto", None),
    ];
    let start = match cut.has("start") {
        true => cut.choice("start", &starts)?,
        false => Some(Start::Edge),
    };
    let choices = [
        ("exact", Spacing::Exact),
        ("first-order", Spacing::FirstOrder),
        ("constant", Spacing::Constant(start.unwrap_or(Start::Edge))),
    ];
    let spacing = match cut.has("spacing") {
        true => cut.choice("spacing", &choices)?,
        false => Spacing::Exact,
    };
    if start != Some(Start::Edge) && !spacing.is_constant() {
        let word = start.map_or("auto", Start::name);
        return Err(cut.error(
            "start",
            format!("`start = \"{word}\"` is for passes of constant scallop height only"),
            "remove it, or write spacing = \"constant\"",
        ));
    }
    Ok((spacing, start.is_none()))
}

/// The overrun of turns, mm.
fn read_overrun(cut: &Section<'_>) -> Result<f64, JobError> {
    let value = cut.number("overrun_mm")?;
    if value > 0.0 && read_spacing(cut)?.0.is_constant() {
        return Err(cut.error(
            "overrun_mm",
            "passes of constant scallop height have no turns beyond the boundary",
            "remove it, or write spacing = \"exact\"",
        ));
    }
    if (0.0..=OVERRUN_MAX_MM).contains(&value) {
        return Ok(value);
    }
    let what = format!("`overrun_mm` must be at least 0 and at most {OVERRUN_MAX_MM}, not {value}");
    Err(cut.error(
        "overrun_mm",
        what,
        "give the greatest overrun of a turn in mm, e.g. 2, or 0 for none",
    ))
}
