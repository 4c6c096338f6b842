//! The motion against the whole part, and what the passes leave of the reachable face: measured, as text and as JSON.

use glam::DVec3;
use job::Job;
use oracle::PassSample;
use part::{
    Asked, Deepest, Inside, LEFTOVER_SHARE, LEFTOVER_SIDE, Leftover, Passes, along, deepest, leftover,
};
use report::Mark;
use serde_json::{Value, json};

use super::out::say;
use super::{Failure, Result, region_words};

/// Centres further apart than this, in radii of the ball, are not of one pass.
const JUMP_RADII: f64 = 1.0;
/// Share of the reachable area that is within the scallop limit, at least.
const WITHIN_SHARE: f64 = 0.99;

/// The centres of the passes.
#[derive(Default)]
pub(super) struct Centres {
    centres: Vec<DVec3>,
    samples: Vec<(u64, u32)>,
}

impl Centres {
    pub(super) fn add(&mut self, sample: &PassSample) {
        self.centres.push(DVec3::from(sample.cl_nm.map(f64::from)) * 1e-6);
        self.samples.push((sample.tick, sample.pass));
    }

    /// The pieces of the passes.
    fn pieces(&self, radius_mm: f64) -> Vec<[DVec3; 2]> {
        let pairs = self.centres.windows(2).zip(self.samples.windows(2));
        let joined = pairs.filter(|(ends, samples)| {
            samples[0].1 == samples[1].1
                && samples[1].0 == samples[0].0 + 1
                && ends[0].distance(ends[1]) < JUMP_RADII * radius_mm
        });
        joined.map(|(ends, _)| [ends[0], ends[1]]).collect()
    }
}

/// What was measured.
pub(super) struct PartProof {
    /// The deepest place of the tool in the part on the passes and between them; `None`: the job names no part.
    deepest: Option<[Option<Deepest>; 2]>,
    /// Numbers of centres that were looked at: on passes, between them.
    counts: [usize; 2],
    tolerance_mm: f64,
    leftover: Leftover,
    tick: Option<u64>,
    failures: Vec<String>,
    warnings: Vec<String>,
}

/// Measures a job whose region was made from a face; `None` for others.
///
/// # Errors
/// A CAD file cannot be read.
pub(super) fn measure(job: &Job, centres: &Centres, links_mm: &[Vec<DVec3>]) -> Result<Option<PartProof>> {
    let (Some(source), Some(reach)) = (job.origin.cad(), job.origin.reach()) else {
        return Ok(None);
    };
    let asked = Asked::new(job, source).map_err(|error| Failure::input(error.what, error.remedy))?;
    let request = asked.request();
    let between: Vec<DVec3> = links_mm.iter().flat_map(|way| along(way)).collect();
    let deepest = asked
        .part()
        .map(|part| [&centres.centres, &between].map(|centres| deepest(part, asked.tool(), centres)));
    let places = request.places(&Inside::new(request.trimmed), LEFTOVER_SIDE);
    let passes = Passes::new(centres.pieces(job.radius_mm));
    let leftover = leftover(&request.clearance(), &places, &passes, job.scallop_mm);
    let tick = deepest
        .and_then(|[on_passes, _]| on_passes)
        .and_then(|found| centres.samples.get(found.index))
        .map(|(tick, _)| *tick);
    let mut proof = PartProof {
        deepest,
        counts: [centres.centres.len(), between.len()],
        tolerance_mm: request.touch_mm,
        leftover,
        tick,
        failures: Vec::new(),
        warnings: Vec::new(),
    };
    proof.judge(reach.unknown.len());
    Ok(Some(proof))
}

impl PartProof {
    fn judge(&mut self, unknown: usize) {
        for (found, place) in self.deepest.iter().flatten().zip(["on a pass", "between passes"]) {
            if let Some(found) = found.filter(|found| found.depth_mm > self.tolerance_mm) {
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
        if unknown > 0 {
            self.warnings.push(format!(
                "{unknown} faces of the part are not known: whether the tool cuts them is not checked"
            ));
        }
        if self.leftover.within_mm2 < WITHIN_SHARE * self.leftover.reachable_mm2 {
            self.warnings.push(format!(
                "{:.2} % of the reachable area is within {} times the scallop limit, less than {} %",
                100.0 * self.within(),
                1.0 + LEFTOVER_SHARE,
                100.0 * WITHIN_SHARE
            ));
        }
    }

    fn within(&self) -> f64 {
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

    /// Reasons against the job.
    pub(super) fn failures(&self) -> &[String] {
        &self.failures
    }

    /// What is to be known.
    pub(super) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Where the tool enters the part.
    pub(super) fn marks(&self) -> Vec<Mark> {
        let found = self.deepest.iter().flatten().flatten();
        let deep = found.filter(|found| found.depth_mm > self.tolerance_mm);
        deep.map(|found| Mark {
            what: format!(
                "{} {:.4} mm in face {}",
                found.part.name(),
                found.depth_mm,
                found.face
            ),
            place_mm: found.centre_mm,
            tick: self.tick,
        })
        .collect()
    }

    /// As text.
    pub(super) fn print(&self, job: &Job) {
        if let Some(reach) = job.origin.reach() {
            for line in region_words::lines(reach) {
                say!("       {:<22} {line}", "face: reach");
            }
        }
        for (index, name) in ["part: on passes", "part: between passes"]
            .into_iter()
            .enumerate()
        {
            let Some(found) = self.deepest.map(|deepest| deepest[index]) else {
                continue;
            };
            let mark = if found.is_some_and(|found| found.depth_mm > self.tolerance_mm) {
                "FAIL"
            } else {
                "ok  "
            };
            match found {
                Some(found) => say!(
                    "  {mark} {name:<22} {} {:.4} mm in face {} at [{:.3}, {:.3}, {:.3}] (at most {}); {} centres",
                    found.part.name(),
                    found.depth_mm,
                    found.face,
                    found.centre_mm.x,
                    found.centre_mm.y,
                    found.centre_mm.z,
                    self.tolerance_mm,
                    self.counts[index]
                ),
                None => say!(
                    "  {mark} {name:<22} nowhere deeper than 0.0005 mm; {} centres",
                    self.counts[index]
                ),
            }
        }
        let left = &self.leftover;
        say!(
            "       {:<22} {:.3} % of {:.3} mm2 within {} of the scallop limit; {} at u = {:.6}, v = {:.6}",
            "face: left",
            100.0 * self.within(),
            left.reachable_mm2,
            1.0 + LEFTOVER_SHARE,
            if left.highest_mm.is_finite() {
                format!("highest {:.5} mm", left.highest_mm)
            } else {
                "not cut".to_owned()
            },
            left.uv[0],
            left.uv[1]
        );
    }

    /// The key `part`.
    pub(super) fn json(&self, job: &Job) -> Value {
        let place = |found: Option<Deepest>| {
            found.map(|found| {
                json!({
                    "depth_mm": found.depth_mm, "tool_part": found.part.name(), "face": found.face, "centre_mm": found.centre_mm.to_array(),
                })
            })
        };
        let left = &self.leftover;
        json!({
            "checked": self.deepest.is_some(),
            "tolerance_mm": self.tolerance_mm,
            "centres": self.counts[0],
            "centres_between": self.counts[1],
            "deepest": self.deepest.and_then(|[found, _]| place(found)),
            "deepest_between": self.deepest.and_then(|[_, found]| place(found)),
            "left": {
                "reachable_mm2": left.reachable_mm2, "within_mm2": left.within_mm2, "within_share": self.within(),
                "highest_mm": left.highest_mm.is_finite().then_some(left.highest_mm), "uv": left.uv, "place_mm": left.place_mm.to_array(),
            },
            "face": job.origin.reach().map(region_words::json),
        })
    }
}
