//! A height map of the part, to compare orders of faces by the time of their links: an exact height takes milliseconds for each link. The links of a job use exact heights.

use glam::DVec3;

use crate::body::Part;

/// Largest number of places along each side of the map.
const SIDE: f64 = 200.0;
/// Largest number of places across the ball's radius.
const ACROSS: f64 = 4.0;

/// Heights of a ball's centre over a part.
pub struct HeightMap {
    low: DVec3,
    step: f64,
    size: [usize; 2],
    /// Least height of the centre of a ball that touches the part, row by row.
    centres: Vec<f64>,
}

impl HeightMap {
    /// Of a part and a ball.
    #[must_use]
    pub fn new(part: &Part, radius: f64) -> Self {
        let block = part.block();
        let extent = block.high - block.low;
        let step = (extent.x.max(extent.y) / SIDE).max(radius / ACROSS);
        let mut map = Self {
            low: block.low,
            step,
            size: [extent.x, extent.y].map(|length| index(length / step) + 1),
            centres: Vec::new(),
        };
        let mut tops = vec![f64::NEG_INFINITY; map.size[0] * map.size[1]];
        part.points(step, &mut |point| {
            let [i, j] = map.place(point);
            let top = &mut tops[i * map.size[1] + j];
            *top = top.max(point.z);
        });
        map.centres = map.touched(&tops, radius);
        map
    }

    /// The place in the map, the nearest one for what is beside it.
    fn place(&self, point: DVec3) -> [usize; 2] {
        let from = (point - self.low) / self.step;
        [
            index(from.x).min(self.size[0] - 1),
            index(from.y).min(self.size[1] - 1),
        ]
    }

    /// The least heights of the centre, from those of the part.
    fn touched(&self, tops: &[f64], radius: f64) -> Vec<f64> {
        let [rows, columns] = self.size;
        let reach = index(radius / self.step);
        let around = |at: usize, count: usize| at.saturating_sub(reach)..(at + reach + 1).min(count);
        let centre = |i: usize, j: usize| {
            let mut height = f64::NEG_INFINITY;
            for row in around(i, rows) {
                for column in around(j, columns) {
                    let beside = self.step * (row.abs_diff(i) as f64).hypot(column.abs_diff(j) as f64);
                    if beside < radius {
                        let above = (radius * radius - beside * beside).sqrt();
                        height = height.max(tops[row * columns + column] + above);
                    }
                }
            }
            height
        };
        (0..rows)
            .flat_map(|i| (0..columns).map(move |j| (i, j)))
            .map(|(i, j)| centre(i, j))
            .collect()
    }

    /// The least height at which the ball goes straight from one place to another, mm, not below them; about.
    #[must_use]
    pub fn over(&self, [from, to]: [DVec3; 2]) -> f64 {
        let steps = index((to - from).truncate().length() / self.step) + 1;
        // At the ends the ball touches the part, and is clear above.
        let between = (1..steps).map(|k| {
            let [i, j] = self.place(from.lerp(to, k as f64 / steps as f64));
            self.centres[i * self.size[1] + j]
        });
        between.fold(from.z.max(to.z), f64::max)
    }
}

/// A number of steps, rounded down.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, and a map has a few hundred places a side"
)]
fn index(steps: f64) -> usize {
    steps as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A roof of 40 mm x 40 mm, its ridge at 10 mm along v: a link over the ridge goes a radius above it, one along the eaves stays low.
    #[test]
    fn a_link_goes_over_the_ridge() {
        let text = "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [0, 0, 1, 2, 2]\nknots_v = [0, 0, 1, 1]\n\
            poles_mm = [[[0, 0, 0], [0, 40, 0]], [[20, 0, 10], [20, 40, 10]], [[40, 0, 0], [40, 40, 0]]]\n\
            [tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 1200\nscallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n";
        let job = job_file::parse("roof.toml", text).unwrap();
        let roof = Part::of_surface(&oracle::Surface::new(&job.surface));
        let map = HeightMap::new(&roof, 3.0);
        let over = map.over([DVec3::new(3.0, 20.0, 5.0), DVec3::new(38.0, 15.0, 5.0)]);
        assert!((over - 13.0).abs() < 0.4, "{over}");
        // Beside the slope the ball's centre is r / cos(slope) above the surface.
        let along = map.over([DVec3::new(4.0, 5.0, 5.4), DVec3::new(4.0, 35.0, 5.4)]);
        assert!((along - 5.4).abs() < 0.4, "{along}");
    }
}
