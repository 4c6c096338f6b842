//! A cell of a face: a quadratic in u and v through nine points of its surface, halved as far as a question needs.

use glam::DVec3;

use crate::inside::Inside;
use crate::tree::Block;
use crate::triangle::{beside, nearest};

/// Two triangles are as good as the cell when they are this near to it, mm.
const FINE_MM: f64 = 2e-4;

/// A cell.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) face: u32,
    /// Least and greatest u and v.
    pub(crate) uv: [[f64; 2]; 2],
    /// `[i][j]`: at i halves of the way in u, and j in v.
    points: [[DVec3; 3]; 3],
    /// Largest distance of its two triangles from the surface, mm.
    pub(crate) deviation: f64,
    /// An edge of the trimmed region crosses it.
    pub(crate) is_cut: bool,
}

/// A part of a cell: `[s, t]` of its corners, and the corners.
#[derive(Clone, Copy)]
struct Quad {
    from: [f64; 2],
    size: f64,
    corners: [[DVec3; 2]; 2],
    deviation: f64,
}

/// What a cell is asked: how near it is to a point, or to a vertical line.
pub(crate) trait Measure {
    /// The distance of a triangle and the weights of the nearest point; its height may be off by `slack`.
    fn triangle(&self, corners: [DVec3; 3], slack: f64) -> Option<(f64, [f64; 2])>;
    /// A distance that the cell is surely within, where this one is to its triangles and off by as much as they; infinite where some of it does not count.
    fn surely(&self, _distance: f64) -> f64 {
        f64::INFINITY
    }
    /// Whether all of a quad does not count.
    fn ignores(&self, _corners: &[[DVec3; 2]; 2], _slack: f64) -> bool {
        false
    }
    /// Whether a nearest point does not count.
    fn ignores_point(&self, _point: DVec3) -> bool {
        false
    }
}

/// The distance from a point. Places within the radius around `skip` do not count.
pub(crate) struct FromPoint {
    pub(crate) point: DVec3,
    pub(crate) skip: Option<(DVec3, f64)>,
}

impl Measure for FromPoint {
    fn triangle(&self, corners: [DVec3; 3], _: f64) -> Option<(f64, [f64; 2])> {
        Some(nearest(self.point, corners))
    }

    fn surely(&self, distance: f64) -> f64 {
        if self.skip.is_none() {
            distance
        } else {
            f64::INFINITY
        }
    }

    fn ignores(&self, corners: &[[DVec3; 2]; 2], slack: f64) -> bool {
        self.skip.is_some_and(|(place, radius)| {
            corners
                .iter()
                .flatten()
                .all(|corner| corner.distance(place) + slack < radius)
        })
    }

    fn ignores_point(&self, point: DVec3) -> bool {
        self.skip
            .is_some_and(|(place, radius)| point.distance(place) < radius)
    }
}

/// The distance from a vertical line, of what lies between two heights.
pub(crate) struct FromLine {
    pub(crate) point: DVec3,
    pub(crate) z: [f64; 2],
}

impl Measure for FromLine {
    fn triangle(&self, corners: [DVec3; 3], slack: f64) -> Option<(f64, [f64; 2])> {
        beside(self.point, corners, [self.z[0] - slack, self.z[1] + slack])
    }
}

impl Cell {
    /// Through nine points: `[i][j]` as above.
    pub(crate) fn new(face: u32, uv: [[f64; 2]; 2], points: [[DVec3; 3]; 3], is_cut: bool) -> Self {
        let p = &points;
        let bend = |a: DVec3, b: DVec3, c: DVec3| 4.0 * (a - 2.0 * b + c).length();
        let in_u = (0..3)
            .map(|j| bend(p[0][j], p[1][j], p[2][j]))
            .fold(0.0, f64::max);
        let in_v = (0..3)
            .map(|i| bend(p[i][0], p[i][1], p[i][2]))
            .fold(0.0, f64::max);
        let twist = (0..4)
            .map(|k| (k / 2, k % 2))
            .map(|(i, j)| 4.0 * (p[i + 1][j + 1] - p[i + 1][j] - p[i][j + 1] + p[i][j]).length())
            .fold(0.0, f64::max);
        Self {
            face,
            uv,
            points,
            deviation: (in_u + 2.0 * twist + in_v) / 8.0,
            is_cut,
        }
    }

    /// How much of the deviation is due to u, and to v.
    pub(crate) fn bends(&self) -> [f64; 2] {
        let p = &self.points;
        let bend = |a: DVec3, b: DVec3, c: DVec3| (a - 2.0 * b + c).length();
        [
            (0..3)
                .map(|j| bend(p[0][j], p[1][j], p[2][j]))
                .fold(0.0, f64::max),
            (0..3)
                .map(|i| bend(p[i][0], p[i][1], p[i][2]))
                .fold(0.0, f64::max),
        ]
    }

    /// Lengths along u and v.
    pub(crate) fn sizes(&self) -> [f64; 2] {
        let p = &self.points;
        [
            (0..3)
                .map(|j| p[0][j].distance(p[1][j]) + p[1][j].distance(p[2][j]))
                .fold(0.0, f64::max),
            (0..3)
                .map(|i| p[i][0].distance(p[i][1]) + p[i][1].distance(p[i][2]))
                .fold(0.0, f64::max),
        ]
    }

    /// The box around it.
    pub(crate) fn block(&self) -> Block {
        let p = &self.points;
        Block::around([p[0][0], p[0][2], p[2][0], p[2][2]]).grown(self.deviation)
    }

    /// Its point at `[s, t]`, each 0 to 1.
    pub(crate) fn at(&self, [s, t]: [f64; 2]) -> DVec3 {
        let of = |x: f64| {
            [
                (1.0 - x) * (1.0 - 2.0 * x),
                4.0 * x * (1.0 - x),
                x * (2.0 * x - 1.0),
            ]
        };
        let (in_u, in_v) = (of(s), of(t));
        let row = |i: usize| {
            self.points[i][0] * in_v[0] + self.points[i][1] * in_v[1] + self.points[i][2] * in_v[2]
        };
        row(0) * in_u[0] + row(1) * in_u[1] + row(2) * in_u[2]
    }

    /// Lowers `best` to the distance of the cell's part within the trimmed region, if that is below it. `any`: a distance below the first bound will do.
    /// Returns the nearest place, if it was lowered.
    pub(crate) fn lower(
        &self,
        measure: &impl Measure,
        inside: &Inside,
        best: &mut f64,
        any: bool,
    ) -> Option<[f64; 2]> {
        let p = &self.points;
        let whole = Quad {
            from: [0.0; 2],
            size: 1.0,
            corners: [[p[0][0], p[0][2]], [p[2][0], p[2][2]]],
            deviation: self.deviation,
        };
        let mut found = None;
        self.visit(&whole, measure, inside, best, any, &mut found);
        found
    }

    fn place(&self, [s, t]: [f64; 2]) -> [f64; 2] {
        let [[u0, u1], [v0, v1]] = self.uv;
        [u0 + s * (u1 - u0), v0 + t * (v1 - v0)]
    }

    fn visit(
        &self,
        quad: &Quad,
        measure: &impl Measure,
        inside: &Inside,
        best: &mut f64,
        any: bool,
        found: &mut Option<[f64; 2]>,
    ) {
        if any && found.is_some() {
            return;
        }
        let is_fine = quad.deviation <= FINE_MM;
        let slack = if is_fine { 0.0 } else { quad.deviation };
        let [[a, b], [c, d]] = quad.corners;
        // (s, t) of a, c, d, b: (0, 0), (1, 0), (1, 1), (0, 1).
        let below = measure
            .triangle([a, c, d], slack)
            .map(|(distance, [x, y])| (distance, [x + y, y]));
        let above = measure
            .triangle([a, d, b], slack)
            .map(|(distance, [x, y])| (distance, [x, x + y]));
        let Some((distance, at)) = [below, above]
            .into_iter()
            .flatten()
            // What is not a number may be below every number.
            .filter(|(distance, _)| distance.is_finite())
            .min_by(|a, b| a.0.total_cmp(&b.0))
        else {
            return;
        };
        if distance - slack >= *best || measure.ignores(&quad.corners, slack) {
            return;
        }
        if any && !self.is_cut && measure.surely(distance + slack) < *best {
            *found = Some(self.place([0, 1].map(|k| quad.from[k] + quad.size * at[k])));
            *best = measure.surely(distance + slack);
            return;
        }
        let st = [quad.from[0] + quad.size * at[0], quad.from[1] + quad.size * at[1]];
        if is_fine {
            let point = self.at(st);
            if measure.ignores_point(point) || self.is_cut && !inside.contains(self.place(st)) {
                return;
            }
            *best = distance;
            *found = Some(self.place(st));
            return;
        }
        let half = 0.5 * quad.size;
        let at_half =
            |i: usize, j: usize| self.at([quad.from[0] + half * i as f64, quad.from[1] + half * j as f64]);
        let (left, right) = (at_half(0, 1), at_half(2, 1));
        let (bottom, top, middle) = (at_half(1, 0), at_half(1, 2), at_half(1, 1));
        let nodes = [[a, left, b], [bottom, middle, top], [c, right, d]];
        // The quarter with the nearest point first.
        let first = [usize::from(at[0] > 0.5), usize::from(at[1] > 0.5)];
        for k in 0..4 {
            let (i, j) = ((k / 2) ^ first[0], (k % 2) ^ first[1]);
            let quarter = Quad {
                from: [quad.from[0] + half * i as f64, quad.from[1] + half * j as f64],
                size: half,
                corners: [
                    [nodes[i][j], nodes[i][j + 1]],
                    [nodes[i + 1][j], nodes[i + 1][j + 1]],
                ],
                deviation: 0.25 * quad.deviation,
            };
            self.visit(&quarter, measure, inside, best, any, found);
        }
    }
}
