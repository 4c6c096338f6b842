//! A surface of kind "file": a face of a CAD file, resolved when the job is read.

use std::path::Path;

use super::JobFileError;
use super::section::Section;
use super::surface::SurfaceSpec;
use crate::cad::{self, CadError, Options};

/// Largest number of a face.
const FACE_MAX: f64 = 1e6;

/// Reads the face that the section names. The path is relative to the job file.
pub(super) fn read(section: &Section<'_>, elsewhere: &[(&str, &str)]) -> Result<SurfaceSpec, JobFileError> {
    section.only(&["kind", "path", "face", "tolerance_mm", "untrimmed"], elsewhere)?;
    let path = section.text("path")?;
    let number = read_face(section)?;
    let mut options = Options {
        untrimmed: section.switch("untrimmed")?,
        ..Options::default()
    };
    if section.has("tolerance_mm") {
        let want = "the tolerance of an approximation in mm, e.g. 0.001";
        options.tolerance_mm = section.number_within("tolerance_mm", 0.0, cad::TOLERANCE_MAX_MM, want)?;
    }
    let folder = Path::new(section.file()).parent().unwrap_or(Path::new(""));
    let path = folder.join(path);
    let file = path.display().to_string();
    let told = |error: CadError| {
        let key = if error.of_face { "face" } else { "path" };
        section.error(key, error.to_string(), error.remedy)
    };
    let model = cad::read(&path).map_err(told)?;
    let count = model.faces.len();
    let Some(face) = model.faces.get(number - 1) else {
        return Err(section.error(
            "face",
            format!("{file} has no face {number}: it has {count}"),
            format!("give a face from 1 to {count}; `cargo sim import {file} --list` shows them"),
        ));
    };
    let made = cad::machinable(&file, face, &options).map_err(told)?;
    Ok(made.spec())
}

/// The face's number, 1 where it is left out.
fn read_face(section: &Section<'_>) -> Result<usize, JobFileError> {
    if !section.has("face") {
        return Ok(1);
    }
    let number = section.number("face")?;
    if number.fract() == 0.0 && (1.0..=FACE_MAX).contains(&number) {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number within the range"
        )]
        return Ok(number as usize);
    }
    Err(section.error(
        "face",
        format!("`face` must be a whole number from 1, not {number}"),
        "give the face's number, as `cargo sim import FILE --list` shows it",
    ))
}
