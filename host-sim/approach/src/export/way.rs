//! The way of the ball's centre that a program commands, and whether it is free: travel, stock, fixtures, the surface below the links.

use glam::DVec3;
use job::units::NM_PER_MM;
use job::{AXES, Job, JobError};
use oracle::Oracle;
use verify::Verdict;
use verify::reach::{self, Motion, Obstacle, ReachFinding};

use crate::gcode::{Blocks, Cut, RESOLUTION_MM};

/// Distance of an arc from the chords that are kept of it, mm.
const CHORD_MM: f64 = 2.5e-4;
/// Least number of parts of a cut that are kept as positions.
const CUT_PARTS: u32 = 8;

/// Writes the blocks of a program, and keeps the positions of the ball's centre.
pub(super) struct Writer<'a> {
    pub(super) blocks: Blocks<'a>,
    at: [Option<f64>; 3],
    low_mm: DVec3,
    high_mm: DVec3,
    motion: Motion,
}

impl<'a> Writer<'a> {
    pub(super) fn new(blocks: Blocks<'a>) -> Self {
        Self {
            blocks,
            at: [None; 3],
            low_mm: DVec3::INFINITY,
            high_mm: DVec3::NEG_INFINITY,
            motion: Motion::default(),
        }
    }

    /// The tool stands here before the program.
    pub(super) fn stands_at(&mut self, home_mm: DVec3) {
        self.add(home_mm, false);
    }

    /// Appends a rapid move of some axes.
    pub(super) fn rapid(&mut self, to_mm: [Option<f64>; 3]) {
        self.blocks.rapid(to_mm);
        self.at = [0, 1, 2].map(|axis| to_mm[axis].or(self.at[axis]));
        if let [Some(x), Some(y), Some(z)] = self.at {
            self.add(DVec3::new(x, y, z), false);
        }
    }

    /// Appends a cut on a pass or along the boundary.
    pub(super) fn cut(&mut self, cut: &Cut) {
        self.feed(cut, true);
    }

    /// Appends a plunge at the feed.
    pub(super) fn plunge(&mut self, cut: &Cut) {
        self.feed(cut, false);
    }

    fn feed(&mut self, cut: &Cut, in_contact: bool) {
        self.blocks.cut(cut);
        if let [Some(x), Some(y), Some(z)] = self.at {
            let from = DVec3::new(x, y, z);
            let parts = cut.parts(from, CHORD_MM).max(CUT_PARTS);
            for part in 1..=parts {
                self.add(cut.at(from, f64::from(part) / f64::from(parts)), in_contact);
            }
        }
    }

    /// Begins or ends a stretch in contact where the tool stands.
    pub(super) fn touch(&mut self, in_contact: bool) {
        if let [Some(x), Some(y), Some(z)] = self.at {
            self.add(DVec3::new(x, y, z), in_contact);
        }
    }

    fn add(&mut self, at_mm: DVec3, in_contact: bool) {
        self.at = at_mm.to_array().map(Some);
        self.low_mm = self.low_mm.min(at_mm);
        self.high_mm = self.high_mm.max(at_mm);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "saturates; a job is within 2147 mm"
        )]
        let nm = at_mm.to_array().map(|mm| (mm * NM_PER_MM).round() as i32);
        self.motion.add(nm, in_contact, false);
    }

    /// Checks that the way is within the travel, and that its links are clear.
    ///
    /// # Errors
    /// The place and the remedy, at the key of the job.
    pub(super) fn check(&self, job: &Job, oracle: &Oracle, safe_z_mm: f64) -> Result<(), JobError> {
        self.check_travel(job)?;
        check_start(job, safe_z_mm)?;
        let machine = &job.machine;
        let is_clear = machine.safe_z_mm.is_none() && machine.home_mm.is_none();
        if is_clear && job.setup.fixtures.is_empty() && job.setup.stock.is_none() {
            // The safe height is above the highest point of the surface, and the tool comes down straight above its contact.
            return Ok(());
        }
        let found = reach::measure_links(job, oracle, &self.motion);
        match found.iter().find(|finding| finding.verdict() != Verdict::Met) {
            Some(finding) => Err(in_the_way(job, finding)),
            None => Ok(()),
        }
    }

    fn check_travel(&self, job: &Job) -> Result<(), JobError> {
        let Some(travel) = job.machine.travel_mm else {
            return Ok(());
        };
        for (axis, [low, high]) in travel.into_iter().enumerate() {
            let (least, most) = (self.low_mm[axis], self.high_mm[axis]);
            if least < low - RESOLUTION_MM || most > high + RESOLUTION_MM {
                return Err(job.origin.error(
                    "machine.travel_mm",
                    format!(
                        "the exported program moves {} from {least:.3} to {most:.3} mm, beyond its travel of {low} to {high} mm",
                        AXES[axis]
                    ),
                    "place the part where it lies in the machine ([placement]), give other safe_z_mm and home_mm, or correct travel_mm",
                ));
            }
        }
        Ok(())
    }
}

/// Checks that what the job names is below the ball at the safe height, where the way from the tool's place to the first pass is not known.
fn check_start(job: &Job, safe_z_mm: f64) -> Result<(), JobError> {
    if job.machine.home_mm.is_some() {
        return Ok(());
    }
    let setup = &job.setup;
    let stock = setup
        .stock
        .iter()
        .map(|block| (Obstacle::Stock, block.high_mm[2]));
    let fixtures = setup.fixtures.iter().enumerate();
    let fixtures = fixtures.map(|(index, fixture)| (Obstacle::Fixture(index), fixture.block.high_mm[2]));
    for (obstacle, top_mm) in stock.chain(fixtures) {
        if top_mm > safe_z_mm - job.radius_mm {
            return Err(job.origin.error(
                key(obstacle),
                format!(
                    "{} reaches z = {top_mm} mm, and the ball's lowest point is at {:.3} mm on traverses: the exported program begins where the tool \
                     stands, so its way to the first pass is not known",
                    obstacle.describe(job),
                    safe_z_mm - job.radius_mm
                ),
                format!(
                    "give safe_z_mm of at least {:.3}, or home_mm, from where the way is checked",
                    top_mm + job.radius_mm
                ),
            ));
        }
    }
    Ok(())
}

/// The key of a job that an obstacle comes from.
fn key(obstacle: Obstacle) -> &'static str {
    match obstacle {
        Obstacle::Surface => "machine.safe_z_mm",
        Obstacle::Stock => "stock",
        Obstacle::Fixture(_) => "fixture",
    }
}

fn in_the_way(job: &Job, finding: &ReachFinding) -> JobError {
    let [x, y, z] = finding.place_mm.to_array();
    let [cx, cy, cz] = finding.centre_mm.to_array();
    let how = match finding.verdict() {
        Verdict::Violated => format!("is {:.4} mm deep in", finding.depth_mm),
        _ => format!("may be {:.4} mm deep in", finding.bound_mm),
    };
    job.origin.error(
        key(finding.obstacle),
        format!(
            "the {} {how} {} at x = {x:.3}, y = {y:.3}, z = {z:.3} where the exported program moves the ball's centre to x = {cx:.3}, y = {cy:.3}, z = {cz:.3}",
            finding.part.name(),
            finding.obstacle.describe(job)
        ),
        finding.remedy(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::{FeedMode, Plane, Shape};

    /// An arc of 45 degrees on a radius of 200 mm whose highest place is between its eighths.
    #[test]
    fn an_arc_is_kept_to_its_outermost_place() {
        let radius_mm = 200.0;
        let at = |degrees: f64| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            DVec3::new(radius_mm * cosine, radius_mm * sine, 3.0)
        };
        let mut out = String::new();
        let mut writer = Writer::new(Blocks::new(&mut out, FeedMode::G94));
        let from = 90.0 - 22.5 - 45.0 / 16.0;
        writer.rapid(at(from).to_array().map(Some));
        writer.cut(&Cut {
            to_mm: at(from + 45.0),
            length_mm: radius_mm * 45_f64.to_radians(),
            speed_mm_s: 10.0,
            shape: Shape::Arc {
                plane: Plane::Xy,
                centre_mm: DVec3::new(0.0, 0.0, 3.0),
                clockwise: false,
            },
        });
        let short_mm = radius_mm - writer.high_mm.y;
        assert!(short_mm < 1.5 * CHORD_MM, "{short_mm} mm");
    }
}
