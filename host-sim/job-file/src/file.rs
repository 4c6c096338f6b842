//! A surface of `kind = "file"`: a face of a CAD file, resolved by the caller's [`FaceReader`].

use std::fmt;
use std::path::{Path, PathBuf};

use job::{FaceParameters, FaceReach, Job, JobError, PartSource, Region, SurfaceSpec};

use crate::section::Section;

/// Largest face number that a job may give: far above the number of faces in any file.
const FACE_MAX: f64 = 1e6;
/// Default of the tolerance of an approximated face, mm.
pub const TOLERANCE_DEFAULT_MM: f64 = 0.001;
/// Default depth to which the tool may enter the part, mm.
pub const PART_TOLERANCE_MM: f64 = 0.002;
/// Largest such depth, mm.
const PART_TOLERANCE_MAX_MM: f64 = 1.0;
/// Default of the steepest angle that is machined, degrees: steeper, the ball cuts with its equator and the shank rubs.
pub const STEEPEST_DEG: f64 = 85.0;
/// Largest of these angles, degrees.
const STEEPEST_MAX_DEG: f64 = 89.9;
/// Largest tolerance of an approximated face, mm.
pub const TOLERANCE_MAX_MM: f64 = 1.0;

/// A face requested by a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// The CAD file, relative to the working directory.
    pub path: PathBuf,
    /// Number of the face in the file, from 1.
    pub number: usize,
    /// Tolerance of an approximation, mm, above 0, at most [`TOLERANCE_MAX_MM`].
    pub tolerance_mm: f64,
    /// A trimmed face is machined over the rectangle that encloses it.
    pub untrimmed: bool,
    /// Its parameters.
    pub parameters: FaceParameters,
    /// How far the surface goes on beyond the face, where it has more, mm.
    pub around_mm: f64,
}

/// The surface of a face.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceSurface {
    /// The surface.
    pub surface: SurfaceSpec,
    /// The face is less of it: its region is made by [`FaceReader::region`].
    pub trimmed: bool,
}

/// The region of a face.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceRegion {
    /// The region.
    pub region: Region,
    /// What the tool reaches.
    pub reach: FaceReach,
}

/// Reason for which a face cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaceError {
    /// The message.
    pub what: String,
    /// The remedy.
    pub remedy: String,
    /// The error concerns the face, not the file, and points at the key `face`.
    pub of_face: bool,
}

impl fmt::Display for FaceError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.what)
    }
}

/// Reads faces of CAD files.
pub trait FaceReader {
    /// The surface of a face.
    ///
    /// # Errors
    /// The file cannot be read, has no such face, or the face cannot be machined.
    fn surface(&self, face: &Face) -> Result<FaceSurface, FaceError>;

    /// The region of a job whose surface is of a trimmed face, or that names its part.
    ///
    /// # Errors
    /// A file cannot be read; the tool reaches nothing of the face.
    fn region(&self, job: &Job) -> Result<FaceRegion, FaceError>;
}

/// A reader that refuses every CAD file.
pub(crate) struct NoFaces;

impl FaceReader for NoFaces {
    fn surface(&self, face: &Face) -> Result<FaceSurface, FaceError> {
        Err(no_reader(&face.path))
    }

    fn region(&self, job: &Job) -> Result<FaceRegion, FaceError> {
        let path = job.origin.part().map(|part| part.path.clone());
        Err(no_reader(&path.unwrap_or_default()))
    }
}

fn no_reader(path: &Path) -> FaceError {
    FaceError {
        what: format!("{} is a CAD file, which this command cannot read", path.display()),
        remedy: "make a job of the face with `cargo sim import`".to_owned(),
        of_face: false,
    }
}

/// The section `[part]`.
pub(crate) fn part(section: &Section<'_>) -> Result<PartSource, JobError> {
    section.only(&["path", "tolerance_mm", "steepest_deg"], &[])?;
    let or = |key: &str, default: f64, least: f64, most: f64, want: &str| match section.has(key) {
        true => section.number_within(key, least, most, want),
        false => Ok(default),
    };
    Ok(PartSource {
        path: beside(section, section.text("path")?),
        tolerance_mm: or(
            "tolerance_mm",
            PART_TOLERANCE_MM,
            0.0,
            PART_TOLERANCE_MAX_MM,
            "how deep the tool may enter the part, in mm, e.g. 0.002",
        )?,
        steepest_deg: or(
            "steepest_deg",
            STEEPEST_DEG,
            0.0,
            STEEPEST_MAX_DEG,
            "the steepest angle from the horizontal that is machined, in degrees, e.g. 85",
        )?,
    })
}

/// The surface of kind "file", and its face.
pub(crate) fn read(
    section: &Section<'_>,
    elsewhere: &[(&str, &str)],
    faces: &dyn FaceReader,
    around_mm: f64,
) -> Result<(FaceSurface, Face), JobError> {
    section.only(
        &["kind", "path", "face", "tolerance_mm", "untrimmed", "parameters"],
        elsewhere,
    )?;
    let face = Face {
        path: beside(section, section.text("path")?),
        number: read_number(section, "face")?,
        tolerance_mm: read_tolerance(section)?,
        untrimmed: section.switch("untrimmed")?,
        parameters: read_parameters(section)?,
        around_mm,
    };
    let surface = faces.surface(&face).map_err(|error| {
        let key = if error.of_face { "face" } else { "path" };
        section.error(key, error.what, error.remedy)
    })?;
    Ok((surface, face))
}

/// The face of which a surface of kind "nurbs" is an approximation, if the section names one. It is not read here.
pub(crate) fn source(section: &Section<'_>) -> Result<Option<Face>, JobError> {
    if !section.has("source") {
        return match ["source_face", "tolerance_mm"]
            .into_iter()
            .find(|key| section.has(key))
        {
            None => Ok(None),
            Some(key) => Err(section.error(
                key,
                format!("`{key}` belongs to `source`"),
                "name the CAD file, e.g. source = \"part.step\"",
            )),
        };
    }
    Ok(Some(Face {
        path: beside(section, section.text("source")?),
        number: read_number(section, "source_face")?,
        tolerance_mm: read_tolerance(section)?,
        untrimmed: true,
        parameters: FaceParameters::Surface,
        around_mm: 0.0,
    }))
}

/// A path relative to the job file.
fn beside(section: &Section<'_>, path: impl AsRef<Path>) -> PathBuf {
    Path::new(section.file())
        .parent()
        .unwrap_or(Path::new(""))
        .join(path)
}

/// The parameters of a face.
fn read_parameters(section: &Section<'_>) -> Result<FaceParameters, JobError> {
    if !section.has("parameters") {
        return Ok(FaceParameters::default());
    }
    let all = [FaceParameters::Edges, FaceParameters::Surface];
    section.choice(
        "parameters",
        &all.map(|parameters| (parameters.name(), parameters)),
    )
}

/// The tolerance of an approximation, mm.
fn read_tolerance(section: &Section<'_>) -> Result<f64, JobError> {
    if !section.has("tolerance_mm") {
        return Ok(TOLERANCE_DEFAULT_MM);
    }
    let want = "the tolerance of an approximation in mm, e.g. 0.001";
    section.number_within("tolerance_mm", 0.0, TOLERANCE_MAX_MM, want)
}

/// The face's number, from 1.
fn read_number(section: &Section<'_>, key: &str) -> Result<usize, JobError> {
    if !section.has(key) {
        return Ok(1);
    }
    let number = section.number(key)?;
    if number.fract() == 0.0 && (1.0..=FACE_MAX).contains(&number) {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number within the range"
        )]
        return Ok(number as usize);
    }
    Err(section.error(
        key,
        format!("`{key}` must be a whole number from 1, not {number}"),
        "give the face's number, as `cargo sim import FILE --list` shows it",
    ))
}
