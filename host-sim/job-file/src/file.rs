//! A surface of `kind = "file"`: a face of a CAD file, resolved by the caller's [`FaceReader`].

use std::fmt;
use std::path::{Path, PathBuf};

use job::{JobError, SurfaceSpec};

use crate::section::Section;

/// Largest face number that a job may give: far above the number of faces in any file.
const FACE_MAX: f64 = 1e6;
/// Default of the tolerance of an approximated face, mm.
pub const TOLERANCE_DEFAULT_MM: f64 = 0.001;
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
    fn surface(&self, face: &Face) -> Result<SurfaceSpec, FaceError>;
}

/// A reader that refuses every CAD file.
pub(crate) struct NoFaces;

impl FaceReader for NoFaces {
    fn surface(&self, face: &Face) -> Result<SurfaceSpec, FaceError> {
        Err(FaceError {
            what: format!(
                "{} is a CAD file, which this command cannot read",
                face.path.display()
            ),
            remedy: "make a job of the face with `cargo sim import`".to_owned(),
            of_face: false,
        })
    }
}

/// The surface of kind "file", and its face.
pub(crate) fn read(
    section: &Section<'_>,
    elsewhere: &[(&str, &str)],
    faces: &dyn FaceReader,
) -> Result<(SurfaceSpec, Face), JobError> {
    section.only(&["kind", "path", "face", "tolerance_mm", "untrimmed"], elsewhere)?;
    let face = Face {
        path: beside(section, section.text("path")?),
        number: read_number(section, "face")?,
        tolerance_mm: read_tolerance(section)?,
        untrimmed: section.switch("untrimmed")?,
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
    }))
}

/// A path relative to the job file.
fn beside(section: &Section<'_>, path: impl AsRef<Path>) -> PathBuf {
    Path::new(section.file())
        .parent()
        .unwrap_or(Path::new(""))
        .join(path)
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
