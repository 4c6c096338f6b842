//! Whether the tool reaches the surface, with the spindle along z: the side of the ball that touches; neck, shank and holder against the surface;
//! the whole tool against stock and fixtures.
//!
//! ```text
//! samples ──contact.rs──► height of the contact above the ball's centre
//!    └──path.rs──► chords in a tree ─┬─search.rs, surface.rs──► deepest place of the surface in neck, shank, holder; between passes in the ball
//!  job ──body.rs──► solids           ├─search.rs, stock.rs────► of the stock that no pass clears, in the whole tool
//!                                    └─fixture.rs─────────────► of each fixture
//! ```
//!
//! All emitted samples count, links included. The surface's places under the ball are the gouge's (`swept`) on passes, and are found here between them: in
//! step-overs, turns, approaches, retracts, traverses.
//!
//! **Error bound**: each figure has an upper bound over all places and positions, besides the depth found. A part touches where the depth found is
//! above [`TOUCH_MM`]; it is clear where the bound is not; else the verdict is unknown.

mod body;
mod contact;
mod findings;
mod fixture;
mod path;
mod search;
mod stock;
mod surface;
#[cfg(test)]
mod tests;

pub use body::{Solid, ToolPart, solids};
pub use contact::{ContactPlace, ContactSide};
pub use findings::{Obstacle, ReachFinding, ReachResult, TOUCH_MM};
pub use path::Motion;

use glam::DVec3;
use job::{Fixture, Job};
use oracle::{Oracle, facing};

use crate::swept::Progress;
use path::{CHORD_MM, PathTree, chords, links};
use search::{Searched, Shape, search};
use stock::StockObstacle;
use surface::SurfaceObstacle;

/// Longest chord, in radii of the ball.
const CHORD_RADII: f64 = 1.0;

/// Measures the reach of a job's tool over a motion. `contact`: the contacts of the motion.
#[must_use]
pub fn measure(
    job: &Job,
    oracle: &Oracle,
    motion: &Motion,
    contact: &ContactSide,
    progress: &dyn Progress,
) -> ReachResult {
    let tree = PathTree::new(chords(motion, CHORD_RADII * job.radius_mm));
    let solids = solids(job);
    let mut findings = Vec::new();
    if tree.chords.is_empty() {
        return ReachResult::new(
            job,
            *contact,
            facing(&oracle.surface, oracle.normal_sign),
            findings,
        );
    }
    progress.begin("reach", 0);
    let surface = SurfaceObstacle::new(oracle);
    // The surface goes on where its face has ended; `verify` and `judge` check the whole part, face by face (`part::check_run`).
    let is_obstacle = job.origin.part().is_none();
    if is_obstacle {
        findings.extend(ball_between_passes(job, &surface, motion));
    }
    for solid in solids.iter().filter(|_| is_obstacle) {
        let shape = Shape::Solid(*solid);
        let found = search(&surface, &tree, &shape, floor(&shape));
        let uv = found.deepest.map(|deepest| surface.parameters(&deepest.cell));
        findings.push(finding(&shape, Obstacle::Surface, &found, uv));
    }
    findings.extend(against_setup(job, &tree));
    ReachResult::new(
        job,
        *contact,
        facing(&oracle.surface, oracle.normal_sign),
        merged(findings),
    )
}

/// Measures the links of a motion: the ball against the surface between passes, the whole tool against stock and fixtures.
#[must_use]
pub fn measure_links(job: &Job, oracle: &Oracle, motion: &Motion) -> Vec<ReachFinding> {
    let tree = PathTree::new(chords(motion, CHORD_RADII * job.radius_mm));
    let mut findings = against_setup(job, &tree);
    findings.extend(ball_between_passes(job, &SurfaceObstacle::new(oracle), motion));
    merged(findings)
}

/// The ball against the surface between passes.
fn ball_between_passes(job: &Job, surface: &SurfaceObstacle<'_>, motion: &Motion) -> Option<ReachFinding> {
    let between = PathTree::new(links(motion, CHORD_RADII * job.radius_mm));
    if between.chords.is_empty() {
        return None;
    }
    let shape = Shape::Ball(job.radius_mm);
    let found = search(surface, &between, &shape, floor(&shape));
    let uv = found.deepest.map(|deepest| surface.parameters(&deepest.cell));
    Some(finding(&shape, Obstacle::Surface, &found, uv))
}

/// The whole tool against stock and fixtures.
fn against_setup(job: &Job, tree: &PathTree) -> Vec<ReachFinding> {
    let mut findings = Vec::new();
    let shapes: Vec<Shape> = [Shape::Ball(job.radius_mm)]
        .into_iter()
        .chain(solids(job).into_iter().map(Shape::Solid))
        .collect();
    if let Some(block) = &job.setup.stock {
        let cleared = tree.part(true);
        let links = tree.part(false);
        let stock = StockObstacle {
            block,
            cleared: &cleared,
            radius_mm: job.radius_mm,
        };
        for shape in &shapes {
            // In contact, what is no wider than the ball is within what the ball clears.
            let is_wide = shape.widest() > job.radius_mm;
            let floor = floor(shape);
            let found = search(&stock, if is_wide { tree } else { &links }, shape, floor);
            let mut finding = finding(shape, Obstacle::Stock, &found, None);
            // A column of the stock is found by its foot.
            finding.place_mm.z = block.high_mm[2];
            findings.push(finding);
        }
    }
    for (number, fixture) in job.setup.fixtures.iter().enumerate() {
        for shape in &shapes {
            findings.push(against(fixture, number, shape, tree));
        }
    }
    findings
}

/// The depth from which on a search goes into the matter. How far ball, neck and shank are from what they cut beside is no figure that anybody
/// wants; how far the holder is, is one.
fn floor(shape: &Shape) -> f64 {
    match shape.part() {
        ToolPart::Holder(_) => f64::NEG_INFINITY,
        _ => TOUCH_MM,
    }
}

/// The result of a search as a finding.
fn finding<C>(shape: &Shape, obstacle: Obstacle, found: &Searched<C>, uv: Option<[f64; 2]>) -> ReachFinding {
    let deepest = found.deepest.as_ref();
    let depth_mm = deepest.map_or(f64::NEG_INFINITY, |deepest| deepest.depth_mm);
    ReachFinding {
        part: shape.part(),
        obstacle,
        depth_mm,
        bound_mm: found.bound_mm.max(depth_mm) + CHORD_MM,
        place_mm: deepest.map_or(DVec3::ZERO, |deepest| deepest.place),
        centre_mm: deepest.map_or(DVec3::ZERO, |deepest| deepest.centre),
        sample: deepest.map_or(0, |deepest| deepest.sample),
        uv,
    }
}

/// A fixture against a part of the tool.
fn against(fixture: &Fixture, number: usize, shape: &Shape, tree: &PathTree) -> ReachFinding {
    let mut best = (f64::NEG_INFINITY, None);
    for chord in &tree.chords {
        if let Some((depth, share)) = fixture::deepest(&fixture.block, shape, chord, best.0)
            && depth > best.0
        {
            best = (depth, Some((chord, share)));
        }
    }
    let at = best
        .1
        .map(|(chord, share)| (chord.at(share), chord.sample(share)));
    let centre_mm = at.map_or(DVec3::ZERO, |(centre, _)| centre);
    ReachFinding {
        part: shape.part(),
        obstacle: Obstacle::Fixture(number),
        depth_mm: best.0,
        bound_mm: best.0 + CHORD_MM,
        place_mm: fixture::nearest(&fixture.block, centre_mm),
        centre_mm,
        sample: at.map_or(0, |(_, sample)| sample),
        uv: None,
    }
}

/// One finding for each part and obstacle: a part of several solids counts by its deepest.
fn merged(findings: Vec<ReachFinding>) -> Vec<ReachFinding> {
    let mut merged: Vec<ReachFinding> = Vec::new();
    for finding in findings {
        let same = |own: &&mut ReachFinding| (own.part, own.obstacle) == (finding.part, finding.obstacle);
        match merged.iter_mut().find(same) {
            Some(own) => {
                let bound_mm = own.bound_mm.max(finding.bound_mm);
                if finding.depth_mm > own.depth_mm {
                    *own = finding;
                }
                own.bound_mm = bound_mm;
            }
            None => merged.push(finding),
        }
    }
    merged
}
