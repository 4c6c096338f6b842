//! Resolves the faces of jobs with `kind = "file"`.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use job::{CadSource, FaceParameters};
use job_file::{Face, FaceError};

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
            parameters: source.parameters,
            around_mm: source.around_mm,
        };
        let file = source.path.display().to_string();
        let made = machinable_once(&file, &model, source.face, &options)?;
        Ok(matches!(made.form, Form::Fitted { .. }).then(|| Self {
            surface: face.surface.clone(),
            scale: source.scale,
        }))
    }

    /// Vector from a point of the job's surface before its placement to the face's point at the same parameters, which may lie beyond its seam, times the
    /// placement's scale.
    #[must_use]
    pub fn from_surface(&self, u: f64, v: f64, point: DVec3) -> DVec3 {
        (self.surface.at_periodic(u, v).point - point) * self.scale
    }
}

/// The surface of a face that a job asks for. Those of the last model are kept: a job asks for its surface, its region and its original.
///
/// # Errors
/// The face cannot be machined.
pub fn surface_of(wanted: &Face, model: &Arc<Model>) -> Result<Arc<MachinableFace>, FaceError> {
    let options = Options {
        tolerance_mm: wanted.tolerance_mm,
        untrimmed: wanted.untrimmed,
        parameters: wanted.parameters,
        around_mm: wanted.around_mm,
    };
    let file = wanted.path.display().to_string();
    Ok(machinable_once(&file, model, wanted.number, &options)?)
}

/// [`machinable`] of a face of a model, by its number, once for the same options.
///
/// # Errors
/// As [`machinable`].
pub fn machinable_once(
    file: &str,
    model: &Arc<Model>,
    number: usize,
    options: &Options,
) -> Result<Arc<MachinableFace>, CadError> {
    type Key = (usize, u64, bool, FaceParameters, u64);
    type Last = Option<(Arc<Model>, HashMap<Key, Arc<MachinableFace>>)>;
    static LAST: Mutex<Last> = Mutex::new(None);
    let lock = || LAST.lock().unwrap_or_else(PoisonError::into_inner);
    let key = (
        number,
        options.tolerance_mm.to_bits(),
        options.untrimmed,
        options.parameters,
        options.around_mm.to_bits(),
    );
    if let Some((of, made)) = lock().as_ref()
        && Arc::ptr_eq(of, model)
        && let Some(made) = made.get(&key)
    {
        return Ok(Arc::clone(made));
    }
    let made = Arc::new(machinable(file, &model.faces[number - 1], options)?);
    let mut last = lock();
    match last.as_mut() {
        Some((of, all)) if Arc::ptr_eq(of, model) => {
            all.insert(key, Arc::clone(&made));
        }
        _ => *last = Some((Arc::clone(model), HashMap::from([(key, Arc::clone(&made))]))),
    }
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::fits::tube;

    /// Beyond its seam a closed face is compared with its beginning, which lies there.
    #[test]
    fn a_face_is_compared_beyond_its_seam() {
        let spline = tube();
        let [[start, end], _] = spline.domain();
        let original = Original {
            surface: crate::Surface::Spline(spline.clone()),
            scale: 2.0,
        };
        let beside = DVec3::new(0.0, 0.0, 0.5);
        for share in [0.1, 0.5, 0.9] {
            let u = start + share * (end - start);
            let point = spline.at(u, 0.3).point;
            for u in [u, u + (end - start)] {
                let from = original.from_surface(u, 0.3, point - beside);
                assert!(from.distance(2.0 * beside) < 1e-9, "{from} at {u}");
            }
        }
    }
}
