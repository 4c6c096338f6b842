//! Resolves the faces of jobs with `kind = "file"`.

use job::SurfaceSpec;
use job_file::{Face, FaceError, FaceReader};

use crate::{CadError, Options, machinable, read};

/// The [`FaceReader`] that uses the reader of CAD files.
#[derive(Clone, Copy, Debug)]
pub struct Faces;

impl From<CadError> for FaceError {
    fn from(error: CadError) -> Self {
        Self {
            what: error.to_string(),
            of_face: error.of_face,
            remedy: error.remedy,
        }
    }
}

impl FaceReader for Faces {
    fn surface(&self, wanted: &Face) -> Result<SurfaceSpec, FaceError> {
        let file = wanted.path.display().to_string();
        let model = read(&wanted.path)?;
        let Some(face) = model.faces.get(wanted.number - 1) else {
            let count = model.faces.len();
            return Err(FaceError {
                what: format!("{file} has no face {}: it has {count}", wanted.number),
                remedy: format!("give a face from 1 to {count}; `cargo sim import {file} --list` shows them"),
                of_face: true,
            });
        };
        let options = Options {
            tolerance_mm: wanted.tolerance_mm,
            untrimmed: wanted.untrimmed,
        };
        Ok(machinable(&file, face, &options)?.spec())
    }
}
