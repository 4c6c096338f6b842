//! Links between passes.

use super::way::Writer;
use crate::gcode::Cut;
use crate::{ApproachError, from_segment};
use glam::DVec3;
use job::Job;
use oracle::{Oracle, OracleError};

/// Largest number of cuts of a step-over.
const CUTS_MAX: u32 = 1 << 12;

/// Parts of a cut of a step-over between whose ends its chord error is evaluated.
const PARTS: u32 = 8;

/// The heights and the home of a job's links.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heights {
    /// z of traverses between passes, mm.
    pub(super) safe_z_mm: f64,
    /// Where the program begins and ends; `None`: where the tool stands, and above the last pass.
    pub(super) home_mm: Option<DVec3>,
}

impl Heights {
    /// z of the ways from home and to it, mm: the tool does not go down before it is above the first pass.
    fn home_way_z_mm(&self) -> f64 {
        self.home_mm
            .map_or(self.safe_z_mm, |home| home.z.max(self.safe_z_mm))
    }

    /// The way from home to the first pass, up to above it.
    pub(super) fn leave_home(&self, writer: &mut Writer<'_>) {
        if let Some(home) = self.home_mm {
            writer.stands_at(home);
            writer.rapid([None, None, Some(self.home_way_z_mm())]);
            writer.rapid([Some(home.x), Some(home.y), None]);
        }
    }

    /// Retract after the last pass, and the way home.
    pub(super) fn go_home(&self, writer: &mut Writer<'_>) {
        writer.rapid([None, None, Some(self.home_way_z_mm())]);
        if let Some(home) = self.home_mm {
            writer.rapid([Some(home.x), Some(home.y), None]);
            writer.rapid([None, None, Some(home.z)]);
        }
    }
}

/// Retract, traverse, rapid plunge, and its last part, `plunge_mm`, at the feed. On a surface that faces up everywhere, the ball is free above each of its contacts.
pub(super) fn approach(writer: &mut Writer<'_>, to_mm: DVec3, heights: &Heights, is_first: bool, job: &Job) {
    let [x, y, z] = to_mm.to_array();
    let near = (z + job.machine.plunge_mm).min(heights.safe_z_mm);
    let over = if is_first {
        heights.home_way_z_mm()
    } else {
        heights.safe_z_mm
    };
    writer.rapid([None, None, Some(over)]);
    writer.rapid([Some(x), Some(y), None]);
    writer.rapid([None, None, Some(near)]);
    writer.plunge(&Cut::line(DVec3::new(x, y, near), to_mm, job.feed_mm_s()));
}

/// Greatest distance of the ends of two curved passes between which the tool stays on the boundary, mm.
const BESIDE_MM: f64 = 6.0;

/// Whether a step-over leads from one end to the next start, path and side parameters: both are on the same boundary, curved ones near each other.
pub(super) fn is_beside([from, to]: [[f64; 2]; 2], [from_mm, to_mm]: [DVec3; 2], is_curved: bool) -> bool {
    let is_on_one = from[0] == to[0] || from[1] == to[1];
    !is_curved || (is_on_one && from_mm.distance(to_mm) <= BESIDE_MM)
}

/// Step-over along the boundary from one place to another, path and side parameters, in chords within the tolerance, at the
/// speed that keeps the contact at the feed.
pub(super) fn step_over(
    oracle: &Oracle,
    [from, to]: [[f64; 2]; 2],
    job: &Job,
) -> Result<Vec<Cut>, ApproachError> {
    let at = |share: f64| {
        let [path, side] = [0, 1].map(|index| from[index] + (to[index] - from[index]) * share);
        oracle.offset(path, side).map(|at| at.contact)
    };
    let [path, side] = from;
    let holds = |count: u32| -> Result<bool, OracleError> {
        let places: Result<Vec<_>, _> = (0..=PARTS * count)
            .map(|k| at(f64::from(k) / f64::from(PARTS * count)).map(|contact| contact.cl_mm))
            .collect();
        let places = places?;
        let most = job.chord_mm * (1.0 - 1.0 / f64::from(PARTS * PARTS));
        let is_near = |chord: &[DVec3]| {
            let (from, to) = (chord[0], chord[chord.len() - 1]);
            chord.iter().all(|place| from_segment(*place, from, to) <= most)
        };
        let parts = PARTS as usize;
        Ok(places.windows(parts + 1).step_by(parts).all(is_near))
    };
    let mut count = 1;
    while !holds(count)? {
        if count == CUTS_MAX {
            return Err(ApproachError::NoSegment { path, side });
        }
        count *= 2;
    }
    let mut cuts = Vec::new();
    let mut begin = at(0.0)?;
    for k in 1..=count {
        let end = at(f64::from(k) / f64::from(count))?;
        let contact = end.cc_mm.distance(begin.cc_mm);
        let centre = end.cl_mm.distance(begin.cl_mm);
        if contact > 0.0 && centre > 0.0 {
            cuts.push(Cut::line(
                begin.cl_mm,
                end.cl_mm,
                job.feed_mm_s() * centre / contact,
            ));
        }
        begin = end;
    }
    Ok(cuts)
}
