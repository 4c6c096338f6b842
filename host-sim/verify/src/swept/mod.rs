//! Scallop height and gouge, measured from the ball's swept envelope, with axis travel and concave radii.
//!
//! ```text
//! samples ──track.rs, smooth.rs──► ToolPath ──height.rs──► where a ray from the surface enters one pass's swept ball
//!                         │   ──tree.rs────► the same, and the nearest ball, over the whole path
//!                         │        │
//!                         │        ├──ridge.rs──► the ridge in each gap between two passes: maximum, mean, points
//!                         │        ├──region.rs─► heights in a drawn region, place by place
//!                         │        └──gouge.rs──► the deepest gouge (cells of grid.rs, split where it matters)
//!                         └──axes.rs──► travel        shape.rs: tightest concave radius, degenerate points
//! ```
//!
//! Neither the formula of the path intervals nor anything of the core is used: the input is the tool path as
//! emitted, and the surface as given in the job file (`oracle`, f64).
//!
//! **Scallop height** at a surface point P is the distance along the tool normal from P to the swept ball: the material
//! left there. Between samples the centre moves on the cubic through them, in chords (`smooth.rs`). On a line across the gap between two passes the maximum is at the point
//! where both passes leave the same height (the crest), unless the surface has a feature in the gap: each part of the line between knots is
//! therefore also evaluated at eight points. Any other part of the path may lower a crest. If it lowers the crest below the surface, the height is
//! negative and the crest is not searched elsewhere: the gouge is reported. First and last pass are on the surface's boundaries.
//!
//! **Error bound**: stated with the result, [`MeasurementError`]. Chords and stations are refined until it is below
//! [`ERROR_SHARE_MAX`] of the limit; where that fails, the verdict is [`Verdict::Unknown`](crate::Verdict::Unknown). Results do not depend on
//! the number of threads.

mod axes;
mod field;
mod findings;
mod gouge;
pub(crate) mod grid;
mod height;
mod original;
mod region;
mod ridge;
mod shape;
mod smooth;
#[cfg(test)]
mod tests;
mod track;
mod tree;

pub use axes::AxisTravel;
pub use field::{FieldPoint, HeightField, height_field};
pub use findings::{Gouge, HighestScallop, MeasurementError, Ridge, RidgePoint, SweptResult};
pub use original::OriginalDeviation;
pub use region::RegionHeights;
pub use ridge::MISSED_RADII;
pub use shape::{ConcaveRadius, SurfaceCheck};
pub use track::{ToolPath, ToolPathPass};

use gouge::{GougeSearch, GougeSearchResult};
use grid::CellGrid;
use height::PassHeight;
use rayon::prelude::*;
use region::RegionSearch;
use ridge::{Gap, GapRidge};
use smooth::SmoothPath;
use tree::PathTree;

use job::Job;
use oracle::Oracle;

/// Position tolerance of `verify`, mm (see `inspect::BOUNDS`): depths up to this are no
/// gouge.
const POSITION_MM: f64 = 10e-6;
/// Chords of the path may deviate from the centre's curve by this share of the scallop limit.
const CHORD_SHARE: f64 = 1e-3;
/// Largest error of the measured height as a share of the scallop limit; above it the height is not measured.
pub const ERROR_SHARE_MAX: f64 = 0.01;

/// Receives the progress of a measurement.
pub trait Progress: Sync {
    /// A part begins, with this number of steps.
    fn begin(&self, what: &'static str, steps: u64);
    /// This number of steps is complete.
    fn done(&self, steps: u64);
}

/// Ignores the progress.
impl Progress for () {
    fn begin(&self, _: &'static str, _: u64) {}
    fn done(&self, _: u64) {}
}

/// Signed distance of the surface's original from the surface at (u, v), along S_u x S_v, mm.
pub type OriginalOffset<'a> = dyn Fn(f64, f64) -> f64 + Sync + 'a;

/// The original of a surface that approximates it.
#[derive(Clone, Copy)]
pub struct Original<'a> {
    /// Where it is.
    pub offset_mm: &'a OriginalOffset<'a>,
    /// Permitted deviation of the surface from it, mm.
    pub tolerance_mm: f64,
}

/// What a measurement requires besides the job's own limits.
#[derive(Clone, Copy, Default)]
pub struct Requirements<'a> {
    /// Permitted excess of the scallop height, as a share of its limit.
    pub scallop_tolerance: f64,
    /// Heights are measured from this original, and may exceed the scallop limit there by its tolerance, but not from the surface itself.
    pub original: Option<Original<'a>>,
}

/// Measures a tool path against the job's surface, on all cores. `complete`: the run reached its end; otherwise its last pass
/// is left out of the ridges.
#[must_use]
pub fn measure(
    job: &Job,
    oracle: &Oracle,
    track: &ToolPath,
    complete: bool,
    requirements: &Requirements<'_>,
    progress: &dyn Progress,
) -> SweptResult {
    let emitted = track;
    let smooth = SmoothPath::new(emitted, CHORD_SHARE * job.scallop_mm);
    let track: &ToolPath = &smooth.path;
    let tree = PathTree::new(track, oracle.radius_mm);
    let whole = track.passes.len() - usize::from(!complete && !track.passes.is_empty());
    let heights: Vec<PassHeight<'_>> = track.passes[..whole]
        .par_iter()
        .map(|pass| PassHeight::new(pass, oracle.radius_mm))
        .collect();
    let gaps = Gap::all(oracle, &heights, &tree);
    progress.begin("scallop", gaps.len() as u64);
    let mut ridges: Vec<GapRidge> = gaps
        .par_iter()
        .map(|gap| {
            let ridge = gap.ridge();
            progress.done(1);
            ridge
        })
        .collect();
    let over_surface_mm = ridges
        .iter()
        .flat_map(|ridge| &ridge.crests)
        .map(|crest| crest.height_mm)
        .fold(0.0, f64::max);
    if let Some(original) = &requirements.original {
        ridges.par_iter_mut().zip(&gaps).for_each(|(ridge, gap)| {
            for crest in &mut ridge.crests {
                let (u, v) = oracle.swapped(crest.path, gap.side(crest.path, crest.share));
                crest.height_mm -= oracle.normal_sign * (original.offset_mm)(u, v);
            }
        });
    }
    let is_drawn = job.region.is_some() && job.origin.reach().is_none();
    let region = (is_drawn && complete).then(|| {
        let search = RegionSearch {
            job,
            oracle,
            tree: &tree,
            gaps: &gaps,
            ridges: &ridges,
            limit_mm: job.scallop_mm * (1.0 + requirements.scallop_tolerance),
        };
        search.search(progress)
    });
    let grid = CellGrid::new(oracle);
    let deviation_mm = smooth.deviation_max_mm();
    progress.begin("gouge", grid.count() as u64);
    let search: GougeSearchResult = GougeSearch {
        oracle,
        tree: &tree,
        grid: &grid,
        floor_mm: POSITION_MM + deviation_mm,
    }
    .search(&|steps| progress.done(steps));
    let parts = findings::Measurements {
        gaps: &gaps,
        ridges: &ridges,
        search,
        deviation_mm: &smooth.deviation_mm,
        axes: AxisTravel::new(emitted.extent_mm(), &job.machine),
        shape: SurfaceCheck::new(oracle, &grid),
        complete,
        requirements,
        region,
        original: OriginalDeviation::new(oracle, &grid, requirements, over_surface_mm),
    };
    SweptResult::new(job, oracle, track, &parts)
}
