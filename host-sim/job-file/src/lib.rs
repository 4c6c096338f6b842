//! The job file: TOML to a [`Job`], checked for shape and range.
//!
//! ```text
//! text --toml--> spanned tables --section.rs--> typed values --surface.rs, cut.rs, machine.rs, ..--> Job
//!                                  any step --JobError--> file, line, caret, remedy
//! ```
//!
//! Reading a job file starts no process: a surface of `kind = "file"` is resolved by the [`FaceReader`] that the caller passes.

mod cut;
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

use job::{
    Along, AlongChoice, CadSource, Job, JobError, MachineProfile, MachineSpec, StartChoice, SurfaceSpec,
};
use patches::placement::Placement;
use section::{Reader, Section};

use cut::CutSpec;

pub use cut::feed_max_within_limits;
pub use file::{
    Face, FaceError, FaceReader, FaceRegion, FaceSurface, PART_TOLERANCE_MM, STEEPEST_DEG,
    TOLERANCE_DEFAULT_MM, TOLERANCE_MAX_MM,
};
pub use machine::HEIGHT_MAX_MM;
pub use program::{file_of, jobs_of};
pub use steps::slots_max_us;

/// Distance by which the surface of a face extends beyond the face, in step-overs on a plane: passes begin and end half a step-over beside the face, and a step-over on a
/// concave place is up to twice as long.
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

/// The sections of a job.
const SECTIONS: [&str; 10] = [
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
];

fn parse_on(
    name: &str,
    text: &str,
    faces: &dyn FaceReader,
    profile: Option<&MachineProfile>,
) -> Result<Job, JobError> {
    let reader = Reader::new(name, text);
    let document = reader.document()?;
    document.only(&SECTIONS, &[])?;
    let part = match document.optional_section("part")? {
        Some(section) => Some(file::part(&section)?),
        None => None,
    };
    let around_mm = if part.is_some() {
        around_mm(&document)?
    } else {
        0.0
    };
    let PlacedSurface {
        surface,
        rotate_deg,
        cad,
        trimmed,
    } = read_surface(&document, faces, around_mm)?;
    let region = match document.optional_section("region")? {
        Some(section) => Some(region::read(&section, &surface)?),
        None => None,
    };
    let (radius_mm, body) = setup::tool(&document.section("tool")?)?;
    let setup = setup::read(&document)?;
    let cut = document.section("cut")?;
    let CutSpec {
        along,
        spacing,
        is_start_auto,
        feed_mm_min,
        scallop_mm,
        side,
        pattern,
        chord_mm,
        overrun_mm,
    } = cut::read(&cut, radius_mm)?;
    let mut origin = reader.origin(&document);
    origin.set_cad(cad);
    origin.set_part(part);
    origin.set_rotate_deg(rotate_deg);
    if along.is_none() {
        origin.set_along_choice(AlongChoice::Auto);
    }
    if is_start_auto {
        origin.set_start_choice(StartChoice::Auto);
    }
    let mut job = Job {
        surface,
        region,
        radius_mm,
        body,
        setup,
        feed_mm_min,
        scallop_mm,
        along: along.unwrap_or(Along::U),
        side,
        pattern,
        spacing,
        chord_mm,
        overrun_mm,
        machine: machine_and_spindle(&document, profile)?,
        origin,
    };
    cut::check_feed(&cut, &job)?;
    cut::check_overrun(&cut, &job)?;
    if trimmed || job.origin.part().is_some() {
        own_region(&document, &mut job, faces)?;
    }
    Ok(job)
}

/// The sections of the machine and its spindle.
fn machine_and_spindle(
    document: &Section<'_>,
    profile: Option<&MachineProfile>,
) -> Result<MachineSpec, JobError> {
    Ok(MachineSpec {
        spindle: document
            .optional_section("spindle")?
            .map(|spindle| spindle::read(&spindle, profile))
            .transpose()?,
        ..machine::read_on(document.optional_section("machine")?.as_ref(), profile)?
    })
}

/// The surface of a job, where its file places it.
struct PlacedSurface {
    surface: SurfaceSpec,
    /// As in `[placement]`.
    rotate_deg: [f64; 3],
    /// The face of a CAD file that it is of.
    cad: Option<CadSource>,
    /// The face is less of it.
    trimmed: bool,
}

/// Reads `[surface]` and `[placement]`; `around_mm`: how far the surface of a face goes on beyond it.
fn read_surface(
    document: &Section<'_>,
    faces: &dyn FaceReader,
    around_mm: f64,
) -> Result<PlacedSurface, JobError> {
    let (
        FaceSurface {
            surface: unplaced,
            trimmed,
        },
        face,
    ) = surface::read(&document.section("surface")?, faces, around_mm)?;
    let (surface, placement) = match document.optional_section("placement")? {
        Some(section) => placement::place(&section, &unplaced)?,
        None => (unplaced.clone(), Placement::default()),
    };
    let cad = face.map(|face| CadSource {
        path: face.path,
        face: face.number,
        tolerance_mm: face.tolerance_mm,
        untrimmed: face.untrimmed,
        parameters: face.parameters,
        around_mm: face.around_mm,
        trimmed,
        surface: unplaced,
        scale: placement.scale,
    });
    Ok(PlacedSurface {
        surface,
        rotate_deg: placement.rotate_deg,
        cad,
        trimmed,
    })
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
