//! Motions from elsewhere: positions of the ball's centre, one a period.

mod program;
mod table;

use std::path::Path;

use glam::DVec3;
use job::Job;

/// A motion, one position a period.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Motion {
    /// Period, s.
    pub period_s: f64,
    /// Positions of the ball's centre, mm.
    pub centres_mm: Vec<DVec3>,
    /// Of a program: without acceleration of its own.
    pub is_program: bool,
}

/// Reason for which a motion cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub(crate) struct MotionError {
    /// The message, with file and line.
    pub what: String,
    /// The remedy.
    pub remedy: String,
}

impl MotionError {
    fn new(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            remedy: remedy.into(),
        }
    }
}

/// Largest magnitude of a coordinate, mm: a position is 32 bits of nanometres.
const COORDINATE_MAX_MM: f64 = 2147.0;

/// Reads a motion: a table of samples (`.csv`), else a program in G-code, which LinuxCNC's interpreter reads. `tip`: the positions are those
/// of the ball's lowest point.
///
/// # Errors
/// The file cannot be read or understood.
pub(crate) fn read(path: &Path, job: &Job, tip: bool) -> Result<Motion, MotionError> {
    let is_table = path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    let mut motion = if is_table {
        table::read(path)?
    } else {
        program::read(path, job)?
    };
    if tip {
        for centre in &mut motion.centres_mm {
            centre.z += job.radius_mm;
        }
    }
    let name = path.display();
    if let Some(index) = motion
        .centres_mm
        .iter()
        .position(|centre| !centre.is_finite() || centre.abs().max_element() > COORDINATE_MAX_MM)
    {
        return Err(MotionError::new(
            format!("{name}: position {index} is not within {COORDINATE_MAX_MM} mm of the origin"),
            "give millimetres",
        ));
    }
    if motion.centres_mm.len() < 2 {
        return Err(MotionError::new(
            format!("{name}: fewer than two positions"),
            "give the samples of a whole run",
        ));
    }
    Ok(motion)
}
