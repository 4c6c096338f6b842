//! Scallop heights on the page: on the surface and by pass.

use serde_json::{Value, json};

use super::embed::{Scale, column, words};
use super::mesh::Mesh;
use job::Along;

/// Largest height on the colour scale, in units of the limit: regions that the ball cannot reach would otherwise use up the
/// scale.
const LIMITS_MAX: f64 = 4.0;

/// A point on the ridge between two passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RidgePoint {
    /// Parameter u of the surface under it.
    pub u: f64,
    /// Parameter v of the surface under it.
    pub v: f64,
    /// Height above the surface, mm; NaN if unknown.
    pub height_mm: f32,
}

/// Measured scallop heights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scallops {
    /// Scallop height limit of the job, mm.
    pub limit_mm: f64,
    /// What the measuring may be off, mm.
    pub measurement_error_mm: f64,
    /// One ridge for each gap between neighbouring passes: the gap's number (that of the pass before it), and places along it.
    pub ridges: Vec<(u32, Vec<RidgePoint>)>,
    /// The ridges are lines anywhere on the surface, along the path parameter, not between passes.
    pub anywhere: bool,
}

impl Scallops {
    /// Largest height; NaN if none is known.
    pub(super) fn largest_mm(&self) -> f32 {
        let places = self.ridges.iter().flat_map(|(_, places)| places);
        places.map(|place| place.height_mm).fold(f32::NAN, f32::max)
    }

    /// JSON: heights at the points of the mesh, largest and mean height of each gap.
    pub(super) fn json(&self, mesh: &Mesh, domain: [[f64; 2]; 2], along: Along) -> Value {
        let mut heights = self.over(mesh.cells(), domain, along);
        for height in &mut heights {
            if *height > LIMITS_MAX * self.limit_mm {
                *height = LIMITS_MAX * self.limit_mm;
            }
        }
        // From 0, so that the colours of two reports are comparable.
        let scale = Scale::of(heights.iter().copied().chain([0.0]));
        let finite = |places: &'_ [RidgePoint]| -> Vec<f64> {
            let heights = places.iter().map(|place| f64::from(place.height_mm));
            heights.filter(|height| height.is_finite()).collect()
        };
        let gaps: Vec<_> = self
            .ridges
            .iter()
            .map(|(gap, places)| (*gap, finite(places)))
            .filter(|(_, heights)| !heights.is_empty() && !self.anywhere)
            .collect();
        let largest = gaps
            .iter()
            .map(|(_, heights)| heights.iter().copied().fold(0.0, f64::max));
        let mean = gaps
            .iter()
            .map(|(_, heights)| heights.iter().sum::<f64>() / heights.len() as f64);
        json!({
            "limit": self.limit_mm,
            "error": self.measurement_error_mm,
            "highest": self.largest_mm(),
            "mesh": scale.json(words(heights.iter().map(|height| scale.above(*height)))),
            "gaps": gaps.iter().map(|(gap, _)| *gap).collect::<Vec<_>>(),
            "largest": column(largest),
            "mean": column(mean),
        })
    }

    /// Largest height around each point of a grid; NaN where no ridge is near.
    fn over(&self, cells: [usize; 2], domain: [[f64; 2]; 2], along: Along) -> Vec<f64> {
        let columns = cells[1] + 1;
        let mut heights = vec![f64::NAN; (cells[0] + 1) * columns];
        let index = |value: f64, k: usize| {
            let [low, high] = domain[k];
            let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
            (share * cells[k] as f64).round() as usize
        };
        for place in self.ridges.iter().flat_map(|(_, places)| places) {
            if !(place.u.is_finite() && place.v.is_finite()) {
                continue;
            }
            let at = &mut heights[index(place.u, 0) * columns + index(place.v, 1)];
            *at = at.max(f64::from(place.height_mm));
        }
        // Between ridges and between points of a ridge, the nearest height applies.
        for _ in 0..self.reach(cells, domain, along) {
            let known = heights.clone();
            let mut is_full = true;
            for (at, height) in heights.iter_mut().enumerate() {
                if height.is_nan() {
                    *height = nearest(&known, at, columns);
                    is_full &= !height.is_nan();
                }
            }
            if is_full {
                break;
            }
        }
        heights
    }

    /// Reach of a ridge point in cells: the largest gap between points on adjacent ridges or along one ridge.
    fn reach(&self, cells: [usize; 2], domain: [[f64; 2]; 2], along: Along) -> usize {
        let of = |place: &RidgePoint, k: usize| if k == 0 { place.u } else { place.v };
        let in_cells = |apart: f64, k: usize| (apart / (domain[k][1] - domain[k][0])).abs() * cells[k] as f64;
        let (path, side) = match along {
            Along::U => (0, 1),
            Along::V => (1, 0),
        };
        let along_one = self
            .ridges
            .iter()
            .flat_map(|(_, places)| places.windows(2))
            .map(|pair| in_cells(of(&pair[1], path) - of(&pair[0], path), path));
        let middles: Vec<_> = self
            .ridges
            .iter()
            .filter_map(|(_, places)| places.get(places.len() / 2))
            .map(|place| of(place, side))
            .collect();
        let across = middles.windows(2).map(|pair| in_cells(pair[1] - pair[0], side));
        let widest = along_one
            .chain(across)
            .filter(|apart| apart.is_finite())
            .fold(0.0, f64::max);
        // Half a step-over before the first and after the last ridge, plus one cell each way for rounding.
        widest.ceil() as usize + 2
    }
}

/// Largest known height adjacent to a point of the grid.
fn nearest(known: &[f64], at: usize, columns: usize) -> f64 {
    let column = at % columns;
    let beside = [
        (column > 0).then(|| at - 1),
        (column + 1 < columns).then(|| at + 1),
        at.checked_sub(columns),
        (at + columns < known.len()).then(|| at + columns),
    ];
    beside
        .into_iter()
        .flatten()
        .map(|index| known[index])
        .fold(f64::NAN, f64::max)
}
