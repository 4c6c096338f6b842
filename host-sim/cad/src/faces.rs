//! Resolves the faces of jobs with `kind = "file"`.

use std::path::Path;

use glam::DVec3;
use job::{CadSource, SurfaceSpec};
use job_file::{Face, FaceError, FaceReader};

use crate::{CadError, Form, Options, machinable, read};

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

/// The face of this number.
fn face_of(path: &Path, number: usize) -> Result<crate::Face, FaceError> {
    let file = path.display().to_string();
    let mut model = read(path)?;
    let count = model.faces.len();
    if number == 0 || number > count {
        return Err(FaceError {
            what: format!("{file} has no face {number}: it has {count}"),
            remedy: format!("give a face from 1 to {count}; `cargo sim import {file} --list` shows them"),
            of_face: true,
        });
    }
    Ok(model.faces.swap_remove(number - 1))
}

/// The face that a job's surface approximates.
#[derive(Clone, Debug)]
pub struct Original {
    surface: crate::Surface,
    scale: f64,
}

impl Original {
    /// Reads the face that a job names as the source of its surface; `None` where the surface is exact.
    ///
    /// # Errors
    /// The file cannot be read, or has no such face, or the face cannot be machined.
    pub fn read(source: &CadSource) -> Result<Option<Self>, FaceError> {
        let face = face_of(&source.path, source.face)?;
        let options = Options {
            tolerance_mm: source.tolerance_mm,
            untrimmed: source.untrimmed,
            around_mm: 0.0,
        };
        let made = machinable(&source.path.display().to_string(), &face, &options)?;
        Ok(matches!(made.form, Form::Fitted { .. }).then(|| Self {
            surface: face.surface,
            scale: source.scale,
        }))
    }

    /// Vector from a point of the job's surface before its placement to the face's point at the same parameters, times the placement's scale.
    #[must_use]
    pub fn from_surface(&self, u: f64, v: f64, point: DVec3) -> DVec3 {
        (self.surface.at(u, v).point - point) * self.scale
    }
}

impl FaceReader for Faces {
    fn surface(&self, wanted: &Face) -> Result<SurfaceSpec, FaceError> {
        let file = wanted.path.display().to_string();
        let face = face_of(&wanted.path, wanted.number)?;
        let options = Options {
            tolerance_mm: wanted.tolerance_mm,
            untrimmed: wanted.untrimmed,
            around_mm: 0.0,
        };
        Ok(machinable(&file, &face, &options)?.spec())
    }
}
