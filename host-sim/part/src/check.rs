//! The check of a run against the whole part: verdicts on the depth of the tool, and on what the passes leave of the reachable face.

use glam::DVec3;
use job::Job;
use job::units::MM_PER_NM;
use job_file::FaceError;
use oracle::PassSample;

use crate::faces::Asked;
use crate::inside::Inside;
use crate::proof::{Deepest, LEFTOVER_SHARE, LEFTOVER_SIDE, Leftover, Passes, along, deepest, leftover};

/// Centres further apart than this, in radii of the ball, are not of one pass.
const JUMP_RADII: f64 = 1.0;
/// Share of the reachable area that is within the scallop limit, at least.
const WITHIN_SHARE: f64 = 0.99;

/// The ball's centres on the passes of a run.
#[derive(Clone, Debug, Default)]
pub struct PassCentres {
    centres: Vec<DVec3>,
    samples: Vec<(u64, u32)>,
}

impl PassCentres {
    /// Adds a sample of a pass; samples come in the order of the run.
    pub fn add(&mut self, sample: &PassSample) {
        self.centres
            .push(DVec3::from(sample.cl_nm.map(f64::from)) * MM_PER_NM);
        self.samples.push((sample.tick, sample.pass));
    }

    /// Places on the passes, close enough that checking each one checks the passes, and the tick of each: that of the sample before it.
    fn places(&self, radius_mm: f64) -> (Vec<DVec3>, Vec<u64>) {
        let (mut places, mut ticks) = (Vec::new(), Vec::new());
        for (index, (centre, (tick, _))) in self.centres.iter().zip(&self.samples).enumerate() {
            match self.piece(index, radius_mm) {
                // The end is the next sample.
                Some(ends) => {
                    let between = along(&ends, radius_mm);
                    places.extend_from_slice(&between[..between.len() - 1]);
                }
                None => places.push(*centre),
            }
            ticks.resize(places.len(), *tick);
        }
        (places, ticks)
    }

    /// The pieces of the passes.
    fn pieces(&self, radius_mm: f64) -> Vec<[DVec3; 2]> {
        let starts = 0..self.centres.len();
        starts.filter_map(|start| self.piece(start, radius_mm)).collect()
    }

    /// The piece from a sample to the next one, if both are of one pass.
    fn piece(&self, start: usize, radius_mm: f64) -> Option<[DVec3; 2]> {
        let ends = [*self.centres.get(start)?, *self.centres.get(start + 1)?];
        let ((tick, pass), (next_tick, next_pass)) = (self.samples[start], self.samples[start + 1]);
        let is_joined =
            pass == next_pass && next_tick == tick + 1 && ends[0].distance(ends[1]) < JUMP_RADII * radius_mm;
        is_joined.then_some(ends)
    }
}

/// A run against the whole part: the depth of the tool, and what the passes leave.
#[derive(Clone, Debug)]
pub struct PartCheck {
    /// The deepest place of the tool in the part on the passes and between them; `None`: the job names no part.
    pub deepest: Option<[Option<Deepest>; 2]>,
    /// Numbers of places of the ball's centre that were looked at: on passes, between them.
    pub counts: [usize; 2],
    /// Greatest depth that is allowed, mm.
    pub tolerance_mm: f64,
    /// Number of faces of the part that could not be read as surfaces: whether the tool cuts them is not known.
    pub unknown: usize,
    /// What the passes leave of the reachable part of the face.
    pub leftover: Leftover,
    /// Tick of the deepest place on the passes.
    pub tick: Option<u64>,
    /// Reasons against the job.
    pub failures: Vec<String>,
    /// What the check does not cover, and too large a leftover.
    pub warnings: Vec<String>,
}

/// Checks the run of a job whose region was made from a face, with the ball's centres on its links, mm; `None` for other jobs. `accepted_mm`: a depth in the part that is
/// accepted even if it is more than the part's tolerance.
///
/// # Errors
/// A CAD file cannot be read.
pub fn check_run(
    job: &Job,
    centres: &PassCentres,
    links_mm: &[Vec<DVec3>],
    accepted_mm: f64,
) -> Result<Option<PartCheck>, FaceError> {
    let (Some(source), Some(reach)) = (job.origin.cad(), job.origin.reach()) else {
        return Ok(None);
    };
    let asked = Asked::new(job, source)?;
    let request = asked.request();
    let between: Vec<DVec3> = links_mm
        .iter()
        .flat_map(|way| along(way, job.radius_mm))
        .collect();
    let (on_passes, ticks) = centres.places(job.radius_mm);
    let deepest = asked
        .part()
        .map(|part| [&on_passes, &between].map(|centres| deepest(part, asked.tool(), centres)));
    let places = request.places(&Inside::new(request.trimmed), LEFTOVER_SIDE);
    let passes = Passes::new(centres.pieces(job.radius_mm));
    let leftover = leftover(&request.clearance(), &places, &passes, job.scallop_mm);
    let tick = deepest
        .and_then(|[found, _]| found)
        .and_then(|found| ticks.get(found.index).copied());
    let mut check = PartCheck {
        deepest,
        counts: [on_passes.len(), between.len()],
        tolerance_mm: request.touch_mm.max(accepted_mm),
        unknown: reach.unknown.len() + asked.part().map_or(0, |part| part.left_out),
        leftover,
        tick,
        failures: Vec::new(),
        warnings: Vec::new(),
    };
    check.judge();
    Ok(Some(check))
}

impl PartCheck {
    /// Why not all faces of the part were looked at; `None` where they were.
    #[must_use]
    pub fn unknown_faces(&self) -> Option<String> {
        (self.unknown > 0).then(|| {
            format!(
                "{} faces of the part are not known: whether the tool cuts them is not checked",
                self.unknown
            )
        })
    }

    fn judge(&mut self) {
        for (found, place) in self.deepest.iter().flatten().zip(["on a pass", "between passes"]) {
            if let Some(found) = found.filter(|found| self.is_too_deep(found)) {
                self.failures.push(format!(
                    "the {} enters face {} of the part by {:.4} mm {place}, more than {} mm",
                    found.part.name(),
                    found.face,
                    found.depth_mm,
                    self.tolerance_mm
                ));
            }
        }
        if self.deepest.is_none() {
            self.warnings.push(
                "the neighbouring faces are not known to the job: whether the tool cuts them is not checked; name their file in [part]"
                    .to_owned(),
            );
        }
        if self.leftover.within_mm2 < WITHIN_SHARE * self.leftover.reachable_mm2 {
            self.warnings.push(format!(
                "{:.2} % of the reachable area is within {} times the scallop limit, less than {} %",
                100.0 * self.within_share(),
                1.0 + LEFTOVER_SHARE,
                100.0 * WITHIN_SHARE
            ));
        }
    }

    /// Whether the tool enters the part deeper than allowed.
    #[must_use]
    pub fn is_too_deep(&self, found: &Deepest) -> bool {
        found.depth_mm > self.tolerance_mm
    }

    /// Share of the reachable area that is within the scallop limit; 0 where nothing is reached.
    #[must_use]
    pub fn within_share(&self) -> f64 {
        let Leftover {
            reachable_mm2,
            within_mm2,
            ..
        } = self.leftover;
        if reachable_mm2 > 0.0 {
            within_mm2 / reachable_mm2
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a pass that are 0.4 mm apart have places between them, less apart for a small ball; samples of two passes have none.
    #[test]
    fn passes_are_looked_at_between_their_samples() {
        let mut centres = PassCentres::default();
        for (tick, pass, x_nm) in [(5, 0, 0), (6, 0, 400_000), (7, 1, 800_000), (8, 1, 850_000)] {
            centres
                .centres
                .push(DVec3::new(f64::from(x_nm) * MM_PER_NM, 0.0, 0.0));
            centres.samples.push((tick, pass));
        }
        let (places, ticks) = centres.places(3.0);
        let wanted = [0.0, 0.1, 0.2, 0.3, 0.4, 0.8, 0.85].map(|x| DVec3::new(x, 0.0, 0.0));
        assert_eq!(places.len(), wanted.len(), "{places:?}");
        assert!(
            places.iter().zip(wanted).all(|(a, b)| a.distance(b) < 1e-12),
            "{places:?}"
        );
        assert_eq!(ticks, [5, 5, 5, 5, 6, 7, 8]);
        // sqrt(8 r d) is 0.045 mm: 9 steps of 0.4 mm, 2 of 0.05.
        assert_eq!(centres.places(0.5).0.len(), 4 + 8 + 1);
    }
}
