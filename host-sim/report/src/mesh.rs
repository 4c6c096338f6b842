//! The surface as a grid of quads, evaluated by the oracle.

use glam::DVec3;
use oracle::Oracle;

/// Approximate number of shaded quads of the picture; their aspect ratio is as near 1 as the surface allows.
const QUADS: f64 = 4200.0;
/// Least and most quads along one parameter.
const QUADS_RANGE: [f64; 2] = [16.0, 160.0];
/// Fine cells along the side of a quad, for the depth buffer and for measurements.
pub(super) const FINE: usize = 3;

/// One quad.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quad {
    /// Corners in order around it, mm.
    pub(super) corners: [DVec3; 4],
    /// Unit normal towards the tool, at its middle.
    pub(super) normal: DVec3,
    /// Area, mm².
    pub(super) area: f64,
}

/// Points of a surface on a grid.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    /// Fine cells in u and v, multiples of [`FINE`].
    cells: [usize; 2],
    /// Row by row: u ascending, within it v.
    points: Vec<DVec3>,
    /// 1 or -1: the sign of the tool side on the grid's own normals.
    sign: f64,
    /// The boundary of the region that is machined.
    outline: Vec<Vec<DVec3>>,
}

/// Points of the outline an edge of the region.
const OUTLINE_PARTS: u32 = 24;

impl Mesh {
    /// The grid over a job's whole surface.
    pub(super) fn new(oracle: &Oracle) -> Self {
        let [u, v] = oracle.surface.domain();
        let at = |s: f64, t: f64| {
            oracle
                .surface
                .at(u[0] + (u[1] - u[0]) * s, v[0] + (v[1] - v[0]) * t)
                .point
        };
        let lengths = [measure(at), measure(|t, s| at(s, t))];
        let ratio = (lengths[0] / lengths[1].max(1e-12)).clamp(0.01, 100.0).sqrt();
        let [least, most] = QUADS_RANGE;
        let cells = [ratio, 1.0 / ratio]
            .map(|share| (QUADS.sqrt() * share).clamp(least, most).round() as usize * FINE);
        let points = (0..=cells[0])
            .flat_map(|i| (0..=cells[1]).map(move |j| (i, j)))
            .map(|(i, j)| at(i as f64 / cells[0] as f64, j as f64 / cells[1] as f64))
            .collect();
        Self {
            cells,
            points,
            sign: oracle.normal_sign,
            outline: oracle
                .region_outline(OUTLINE_PARTS)
                .into_iter()
                .map(|line| {
                    line.into_iter()
                        .map(|[u, v]| oracle.surface.at(u, v).point)
                        .collect()
                })
                .collect(),
        }
    }

    /// Cells in u and in v.
    pub(super) fn cells(&self) -> [usize; 2] {
        self.cells
    }

    /// Sign of the tool side on the cross product of a cell's sides along u and v.
    pub(super) fn sign(&self) -> f64 {
        self.sign
    }

    /// All points: u ascending, within it v, one more each way than there are cells.
    pub(super) fn points(&self) -> &[DVec3] {
        &self.points
    }

    fn point(&self, i: usize, j: usize) -> DVec3 {
        self.points[i * (self.cells[1] + 1) + j]
    }

    /// Every quad of `coarse` x `coarse` fine cells.
    pub(super) fn quads(&self, coarse: usize) -> impl Iterator<Item = Quad> + '_ {
        let rows = (0..self.cells[0]).step_by(coarse);
        rows.flat_map(move |i| {
            (0..self.cells[1])
                .step_by(coarse)
                .map(move |j| self.quad(i, j, coarse))
        })
    }

    fn quad(&self, i: usize, j: usize, coarse: usize) -> Quad {
        let (i_end, j_end) = (i + coarse, j + coarse);
        let corners = [
            self.point(i, j),
            self.point(i_end, j),
            self.point(i_end, j_end),
            self.point(i, j_end),
        ];
        // Half the cross product of the diagonals, which is also correct for a quad degenerated to a triangle.
        let product = (corners[2] - corners[0]).cross(corners[3] - corners[1]);
        Quad {
            corners,
            normal: (product * self.sign).normalize_or_zero(),
            area: 0.5 * product.length(),
        }
    }

    /// Corner points of the surface and some between, which the frame must contain.
    pub(super) fn extent(&self) -> Vec<DVec3> {
        self.points
            .iter()
            .copied()
            .step_by(FINE)
            .chain(self.points.last().copied())
            .collect()
    }

    /// The boundary curves of the surface, without degenerate ones, and of the region.
    pub(super) fn edges(&self) -> Vec<Vec<DVec3>> {
        let [rows, columns] = self.cells;
        let edges = [
            (0..=rows).map(|i| self.point(i, 0)).collect(),
            (0..=rows).map(|i| self.point(i, columns)).collect(),
            (0..=columns).map(|j| self.point(0, j)).collect(),
            (0..=columns).map(|j| self.point(rows, j)).collect::<Vec<_>>(),
        ];
        let is_long =
            |edge: &Vec<DVec3>| edge.windows(2).map(|ends| ends[1].distance(ends[0])).sum::<f64>() > 1e-9;
        let all = edges.into_iter().chain(self.outline.iter().cloned());
        all.filter(is_long).collect()
    }

    /// An iso-parametric line through the middle of the surface.
    pub(super) fn side(&self) -> DVec3 {
        let [rows, columns] = self.cells;
        let lines = [
            self.point(rows, columns / 2) - self.point(0, columns / 2),
            self.point(rows / 2, columns) - self.point(rows / 2, 0),
        ];
        let level = |line: &DVec3| line.x.hypot(line.y);
        if level(&lines[0]) > level(&lines[1]) {
            lines[0]
        } else {
            lines[1]
        }
    }

    /// Normal towards the tool, averaged over the area.
    pub(super) fn mean_normal(&self) -> DVec3 {
        let sum = self
            .quads(FINE)
            .fold(DVec3::ZERO, |sum, quad| sum + quad.normal * quad.area);
        let area: f64 = self.quads(FINE).map(|quad| quad.area).sum();
        sum / area.max(1e-12)
    }

    /// Length of the diagonal of the bounding box, mm.
    pub(super) fn diagonal(&self) -> f64 {
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] = self
            .points
            .iter()
            .fold(none, |[low, high], point| [low.min(*point), high.max(*point)]);
        high.distance(low)
    }
}

/// Mean length of three lines across a surface, each along the first argument at a fixed second one; both 0 to 1.
fn measure(at: impl Fn(f64, f64) -> DVec3) -> f64 {
    const STEPS: u32 = 48;
    let line = |s: f64| {
        let point = |k: u32| at(f64::from(k) / f64::from(STEPS), s);
        (0..STEPS).map(|k| point(k + 1).distance(point(k))).sum::<f64>()
    };
    [0.1, 0.5, 0.9].map(line).iter().sum::<f64>() / 3.0
}
