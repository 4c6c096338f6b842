//! Resolves the faces of jobs with `kind = "file"`.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use job::CadSource;
use job_file::{Face, FaceError, FaceSurface};

use crate::{CadError, Form, MachinableFace, Model, Options, machinable, read_once};

impl From<CadError> for FaceError {
    fn from(error: CadError) -> Self {
        Self {
            what: error.to_string(),
            of_face: error.of_face,
            remedy: error.remedy,
        }
    }
}

/// The model of a file that has a face of this number.
///
/// # Errors
/// The file cannot be read, or has no such face.
pub fn model_with(path: &Path, number: usize) -> Result<Arc<Model>, FaceError> {
    let file = path.display().to_string();
    let model = read_once(path)?;
    let count = model.faces.len();
    if number == 0 || number > count {
        return Err(FaceError {
            what: format!("{file} has no face {number}: it has {count}"),
            remedy: format!("give a face from 1 to {count}; `cargo sim import {file} --list` shows them"),
            of_face: true,
        });
    }
    Ok(model)
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
        let model = model_with(&source.path, source.face)?;
        let face = &model.faces[source.face - 1];
        let options = Options {
            tolerance_mm: source.tolerance_mm,
            untrimmed: source.untrimmed,
            around_mm: source.around_mm,
        };
        let made = machinable(&source.path.display().to_string(), face, &options)?;
        Ok(matches!(made.form, Form::Fitted { .. }).then(|| Self {
            surface: face.surface.clone(),
            scale: source.scale,
        }))
    }

    /// Vector from a point of the job's surface before its placement to the face's point at the same parameters, times the placement's scale.
    #[must_use]
    pub fn from_surface(&self, u: f64, v: f64, point: DVec3) -> DVec3 {
        (self.surface.at(u, v).point - point) * self.scale
    }
}

/// The surface of a face that a job asks for, and whether the face is less of it.
///
/// # Errors
/// The face cannot be machined.
pub fn surface_of(wanted: &Face, face: &crate::Face) -> Result<(MachinableFace, FaceSurface), FaceError> {
    let options = Options {
        tolerance_mm: wanted.tolerance_mm,
        untrimmed: wanted.untrimmed,
        around_mm: wanted.around_mm,
    };
    let made = machinable(&wanted.path.display().to_string(), face, &options)?;
    let surface = FaceSurface {
        surface: made.spec(),
        trimmed: made.trimmed.is_some(),
    };
    Ok((made, surface))
}
