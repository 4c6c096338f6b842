//! A cell of a face: a quadratic in u and v through nine points of its surface, halved as far as a question needs.

use glam::DVec3;

use crate::inside::Inside;
use crate::tree::Block;
use crate::triangle::{beside, nearest};

/// Two triangles are as good as the cell when they are this near to it, mm.
const FINE_MM: f64 = 2e-4;
/// Rounding of a distance, mm: a bound that is nearer than this to another one decides nothing.
const ROUNDING_MM: f64 = 1e-9;
/// Steps towards the nearest place of a quad before it is halved.
const STEPS: usize = 2;

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
    /// What of it the trimmed region holds.
    trimmed: Trimmed,
    /// The box around it along its own axes.
    own_box: OwnBox,
}

/// Parts of a cell along each parameter of which it is known whether they are in the trimmed region: as far as most cells are halved.
const PARTS: usize = 8;

/// A bit for each of the [`PARTS`] times [`PARTS`] parts of a cell, along u first. Those on the region's edge are in neither.
#[derive(Clone, Copy, Debug)]
struct Trimmed {
    inside: u64,
    outside: u64,
}

impl Trimmed {
    /// All of the cell is in the region.
    const ALL: Self = Self {
        inside: u64::MAX,
        outside: 0,
    };

    /// Of a cell that these edges of the region may cross.
    fn new(uv: [[f64; 2]; 2], region: &Inside, edges: &[u32]) -> Self {
        let mut found = Self {
            inside: 0,
            outside: 0,
        };
        for index in 0..PARTS * PARTS {
            let part = [index % PARTS, index / PARTS];
            let ends: [[f64; 2]; 2] = std::array::from_fn(|k| {
                let [low, high] = uv[k];
                [0.0, 1.0].map(|end| low + (part[k] as f64 + end) / PARTS as f64 * (high - low))
            });
            let meets = |edge: &u32| may_meet(region.edges()[*edge as usize], ends);
            if edges.iter().any(meets) {
                continue;
            }
            if region.contains(ends.map(|[low, high]| 0.5 * (low + high))) {
                found.inside |= 1 << index;
            } else {
                found.outside |= 1 << index;
            }
        }
        found
    }

    /// The parts of a quad.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 8")]
    fn parts(quad: &Quad) -> u64 {
        let count = ((quad.size * PARTS as f64) as u32).max(1);
        let part = |from: f64| ((from * PARTS as f64) as u32).min(PARTS as u32 - 1);
        let (i, j) = (part(quad.from[0]), part(quad.from[1]));
        let row = (1_u64 << count) - 1;
        (0..count).fold(0, |parts, up| parts | row << (PARTS as u32 * (j + up) + i))
    }
}

/// Whether an edge may meet a rectangle, rounding included.
fn may_meet([a, b]: [[f64; 2]; 2], ends: [[f64; 2]; 2]) -> bool {
    let middle = ends.map(|[low, high]| 0.5 * (low + high));
    let half = ends.map(|[low, high]| (0.5 + 1e-6) * (high - low));
    let beside = |k: usize| a[k].min(b[k]) > middle[k] + half[k] || a[k].max(b[k]) < middle[k] - half[k];
    if beside(0) || beside(1) {
        return false;
    }
    // The distance of the middle from the edge's line, against that of the farthest corner, both times the edge's length.
    let [du, dv] = [0, 1].map(|k| b[k] - a[k]);
    let off = du * (middle[1] - a[1]) - dv * (middle[0] - a[0]);
    off.abs() <= du.abs() * half[1] + dv.abs() * half[0]
}

/// A box along any three axes at right angles.
#[derive(Clone, Copy, Debug)]
struct OwnBox {
    middle: DVec3,
    axes: [DVec3; 3],
    half: DVec3,
}

impl OwnBox {
    /// Around a cell that is not known.
    const EVERYWHERE: Self = Self {
        middle: DVec3::ZERO,
        axes: DVec3::AXES,
        half: DVec3::INFINITY,
    };

    /// Around a cell, one axis along its normal: a box along the machine's axes around an inclined cell is mostly empty.
    fn around(nodes: &Nodes) -> Self {
        let p = &nodes.0;
        let along = (p[2][1] - p[0][1]).normalize_or(DVec3::X);
        let normal = along
            .cross(p[1][2] - p[1][0])
            .normalize_or(along.any_orthonormal_vector());
        let axes = [along, normal.cross(along), normal];
        let controls = nodes.controls();
        if !controls.as_flattened().iter().all(|control| control.is_finite()) {
            return Self::EVERYWHERE;
        }
        let middle = p[1][1];
        let [mut low, mut high] = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for control in controls.iter().flatten() {
            let from = DVec3::from(axes.map(|axis| axis.dot(*control - middle)));
            (low, high) = (low.min(from), high.max(from));
        }
        let shift = 0.5 * (low + high);
        Self {
            middle: middle + axes[0] * shift.x + axes[1] * shift.y + axes[2] * shift.z,
            axes,
            half: 0.5 * (high - low) + ROUNDING_MM,
        }
    }

    /// A vector along its axes.
    #[inline]
    fn along(&self, vector: DVec3) -> DVec3 {
        let [a, b, c] = &self.axes;
        DVec3::new(a.dot(vector), b.dot(vector), c.dot(vector))
    }

    /// Whether all of it above a height is farther than `distance` from the vertical line through a point.
    fn is_beside(&self, from: DVec3, above: f64, distance: f64) -> bool {
        let reach = |way: DVec3| self.along(way).abs().dot(self.half);
        let to = (self.middle - from).with_z(0.0);
        let length = to.length();
        if length - reach(to / length) > distance {
            return true;
        }
        // Along the normal, per unit of its level part: where that leads down, it is no more than the distance from the line for all that is above the height.
        let normal = self.axes[2] / self.axes[2].truncate().length();
        let off = normal.dot(self.middle - from.with_z(above));
        normal.z * off <= 0.0 && off.abs() - reach(normal) > distance
    }

    fn distance_squared(&self, to: DVec3) -> f64 {
        let along = self.along(to - self.middle);
        (along.abs() - self.half).max(DVec3::ZERO).length_squared()
    }
}

/// Nine points of a quadratic in s and t, 0 to 1: `[i][j]` at i halves of s and j of t.
#[derive(Clone, Copy)]
struct Nodes([[DVec3; 3]; 3]);

/// A quadratic with its derivatives.
struct Bent {
    point: DVec3,
    s: DVec3,
    t: DVec3,
    ss: DVec3,
    st: DVec3,
    tt: DVec3,
}

/// Weights of three nodes at a parameter.
#[inline]
fn values(x: f64) -> [f64; 3] {
    [
        (1.0 - x) * (1.0 - 2.0 * x),
        4.0 * x * (1.0 - x),
        x * (2.0 * x - 1.0),
    ]
}

/// Weights of three nodes at a parameter, and their derivatives.
#[inline]
fn weights(x: f64) -> [[f64; 3]; 3] {
    [
        values(x),
        [4.0 * x - 3.0, 4.0 - 8.0 * x, 4.0 * x - 1.0],
        [4.0, -8.0, 4.0],
    ]
}

/// The least value between 0 and 1 of the quadratic through three values at 0, 1/2 and 1; not a number where one of them is none.
fn least([low, middle, high]: [f64; 3]) -> f64 {
    let bend = low - 2.0 * middle + high;
    let slope = 4.0 * middle - 3.0 * low - high;
    let end = if low < high { low } else { high };
    // f(x) = low + slope x + 2 bend x^2.
    if bend > 0.0 && slope < 0.0 && -slope < 4.0 * bend {
        low - slope * slope / (8.0 * bend)
    } else {
        end + 0.0 * (low + middle + high)
    }
}

impl Bent {
    /// The parameters of a nearer place, `way` being from the measure to this one: a step of Newton's, within 0 to 1.
    fn nearer(&self, [s, t]: [f64; 2], way: DVec3, measure: &impl Measure) -> [f64; 2] {
        let [by_s, by_t] = [self.s, self.t].map(|along| measure.across(along));
        let (down_s, down_t) = (by_s.dot(way), by_t.dot(way));
        let ss = by_s.length_squared() + self.ss.dot(way);
        let tt = by_t.length_squared() + self.tt.dot(way);
        let st = by_s.dot(by_t) + self.st.dot(way);
        let determinant = ss * tt - st * st;
        let inside = |x: f64| x.clamp(0.0, 1.0);
        let step = |down: f64, bend: f64| if bend > 0.0 { down / bend } else { 0.0 };
        if determinant > 1e-6 * ss * tt && ss > 0.0 {
            let to = [
                s - (tt * down_s - st * down_t) / determinant,
                t - (ss * down_t - st * down_s) / determinant,
            ];
            if to.iter().all(|x| (0.0..=1.0).contains(x)) {
                return to;
            }
            // On a side that the step crosses: the nearest place along it.
            let t_on = inside(to[1]);
            let s_on = inside(to[0]);
            return if s_on == to[0] {
                [inside(s - step(down_s + st * (t_on - t), ss)), t_on]
            } else {
                [s_on, inside(t - step(down_t + st * (s_on - s), tt))]
            };
        }
        [inside(s - step(down_s, ss)), inside(t - step(down_t, tt))]
    }
}

impl Nodes {
    /// The Bezier points, in whose hull the quadratic lies.
    fn controls(&self) -> [[DVec3; 3]; 3] {
        let between = |[a, b, c]: [DVec3; 3]| [a, 2.0 * b - 0.5 * (a + c), c];
        let rows = self.0.map(between);
        let columns = [0, 1, 2].map(|j| between([rows[0][j], rows[1][j], rows[2][j]]));
        std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]))
    }

    fn at(&self, [s, t]: [f64; 2]) -> Bent {
        let (in_s, in_t) = (weights(s), weights(t));
        let mut rows = [[DVec3::ZERO; 3]; 3];
        for (i, [a, b, c]) in self.0.iter().enumerate() {
            for (order, weights) in in_t.iter().enumerate() {
                rows[order][i] = *a * weights[0] + *b * weights[1] + *c * weights[2];
            }
        }
        let sum = |of_s: usize, of_t: usize| {
            rows[of_t][0] * in_s[of_s][0] + rows[of_t][1] * in_s[of_s][1] + rows[of_t][2] * in_s[of_s][2]
        };
        Bent {
            point: sum(0, 0),
            s: sum(1, 0),
            t: sum(0, 1),
            ss: sum(2, 0),
            st: sum(1, 1),
            tt: sum(0, 2),
        }
    }

    /// Whether all of the quadratic is farther from a plane through `from` than `bound`, in a direction of length 1. Exact where it bends along one parameter only.
    fn is_beyond(&self, from: DVec3, direction: DVec3, bound: f64) -> bool {
        let mut f = [[0.0; 3]; 3];
        for (values, row) in f.iter_mut().zip(&self.0) {
            for (value, node) in values.iter_mut().zip(row) {
                *value = direction.dot(*node - from);
            }
        }
        let control = |a: f64, b: f64, c: f64| 2.0 * b - 0.5 * (a + c);
        // Between the quadratics through its Bezier points along one parameter it is a mean of them.
        let is_beyond = |f: [[f64; 3]; 3]| {
            let [a, b, c] = f;
            let middle = [
                control(a[0], b[0], c[0]),
                control(a[1], b[1], c[1]),
                control(a[2], b[2], c[2]),
            ];
            least(a) >= bound && least(c) >= bound && least(middle) >= bound
        };
        let turned = [
            [f[0][0], f[1][0], f[2][0]],
            [f[0][1], f[1][1], f[2][1]],
            [f[0][2], f[1][2], f[2][2]],
        ];
        is_beyond(f) || is_beyond(turned)
    }
}

/// A part of a cell: `[s, t]` of its corners, and the corners.
#[derive(Clone, Copy)]
struct Quad {
    from: [f64; 2],
    size: f64,
    corners: [[DVec3; 2]; 2],
    deviation: f64,
}

impl Quad {
    /// Distance of its two triangles, and `[s, t]` of their nearest point.
    fn nearest(&self, measure: &impl Measure, slack: f64) -> Option<(f64, [f64; 2])> {
        let [[a, b], [c, d]] = self.corners;
        // (s, t) of a, c, d, b: (0, 0), (1, 0), (1, 1), (0, 1).
        let below = measure
            .triangle([a, c, d], slack)
            .map(|(distance, [x, y])| (distance, [x + y, y]));
        let above = measure
            .triangle([a, d, b], slack)
            .map(|(distance, [x, y])| (distance, [x, x + y]));
        // What is not a number may be below every number.
        let known = [below, above]
            .into_iter()
            .flatten()
            .filter(|(distance, _)| distance.is_finite());
        known.min_by(|a, b| a.0.total_cmp(&b.0))
    }
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
    /// Where it is measured from.
    fn origin(&self) -> DVec3;
    /// The part of a vector that counts for the distance.
    fn across(&self, vector: DVec3) -> DVec3;
    /// Whether a point surely counts that may be off by `slack`.
    fn counts(&self, point: DVec3, slack: f64) -> bool;
    /// The corner of a quad that is nearest, if it is nearer than `bound`; none where that does not decide whether the quad is.
    fn corner_within(&self, _corners: &[[DVec3; 2]; 2], _bound: f64) -> Option<[f64; 2]> {
        None
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

    fn origin(&self) -> DVec3 {
        self.point
    }

    fn across(&self, vector: DVec3) -> DVec3 {
        vector
    }

    fn counts(&self, _: DVec3, _: f64) -> bool {
        self.skip.is_none()
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

    fn corner_within(&self, corners: &[[DVec3; 2]; 2], bound: f64) -> Option<[f64; 2]> {
        let mut found = (bound * bound, None);
        for (k, corner) in corners.as_flattened().iter().enumerate() {
            let square = corner.distance_squared(self.point);
            if square < found.0 {
                found = (square, Some([(k / 2) as f64, (k % 2) as f64]));
            }
        }
        found.1
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
    fn origin(&self) -> DVec3 {
        self.point
    }

    fn across(&self, vector: DVec3) -> DVec3 {
        vector.with_z(0.0)
    }

    fn counts(&self, point: DVec3, slack: f64) -> bool {
        point.z - slack > self.z[0] && point.z + slack < self.z[1]
    }

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
            trimmed: Trimmed::ALL,
            own_box: OwnBox::around(&Nodes(points)),
        }
    }

    /// The cell, with what of it the trimmed region holds; `edges`: those of the region that may cross it.
    pub(crate) fn trimmed_by(self, region: &Inside, edges: &[u32]) -> Self {
        Self {
            trimmed: Trimmed::new(self.uv, region, edges),
            ..self
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

    /// Whether it is surely farther from a point than this.
    pub(crate) fn is_beyond(&self, point: DVec3, distance: f64) -> bool {
        self.own_box.distance_squared(point) > distance * distance
    }

    /// Whether all of it above a height is surely farther than this from the vertical line through a point.
    pub(crate) fn is_beside(&self, point: DVec3, above: f64, distance: f64) -> bool {
        self.own_box.is_beside(point, above, distance)
    }

    /// Its point at `[s, t]`, each 0 to 1.
    pub(crate) fn at(&self, [s, t]: [f64; 2]) -> DVec3 {
        let (in_u, in_v) = (values(s), values(t));
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
        let parts = if self.is_cut { Trimmed::parts(quad) } else { 0 };
        if self.is_cut && parts & !self.trimmed.outside == 0 {
            return;
        }
        let is_cut = parts & !self.trimmed.inside != 0;
        let is_fine = quad.deviation <= FINE_MM;
        let slack = if is_fine { 0.0 } else { quad.deviation };
        let [[a, b], [c, d]] = quad.corners;
        // Near the edge of the trimmed region much of a cell is in the tool without being of the part: there a corner saves the triangles.
        let corner = (any && is_cut && !is_fine).then(|| measure.corner_within(&quad.corners, *best));
        let corner = corner.flatten();
        let (distance, at) = match corner {
            Some(corner) => (0.0, corner),
            None => match quad.nearest(measure, slack) {
                Some(found) => found,
                None => return,
            },
        };
        if distance - slack >= *best || measure.ignores(&quad.corners, slack) {
            return;
        }
        if any && !is_cut && measure.surely(distance + slack) < *best {
            *found = Some(self.place([0, 1].map(|k| quad.from[k] + quad.size * at[k])));
            *best = measure.surely(distance + slack);
            return;
        }
        let st = [quad.from[0] + quad.size * at[0], quad.from[1] + quad.size * at[1]];
        if is_fine {
            let point = self.at(st);
            if measure.ignores_point(point) || is_cut && !inside.contains(self.place(st)) {
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
        let nodes = Nodes([[a, left, b], [bottom, middle, top], [c, right, d]]);
        let decided = match corner {
            Some(_) => Decided::Open((nodes.0[1][1] - measure.origin()).normalize_or_zero()),
            None => self.decided(&nodes, at, measure, *best, any && !is_cut),
        };
        let direction = match decided {
            Decided::Beyond => return,
            Decided::Within(distance) => {
                *best = distance;
                *found = Some(self.place(st));
                return;
            }
            Decided::Open(direction) => direction,
        };
        let nodes = nodes.0;
        let from = measure.origin();
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
            let slack = if quarter.deviation <= FINE_MM {
                0.0
            } else {
                quarter.deviation
            };
            let bound = *best + slack + ROUNDING_MM;
            let corners = quarter.corners.as_flattened();
            if corners
                .iter()
                .all(|corner| direction.dot(*corner - from) >= bound)
            {
                continue;
            }
            self.visit(&quarter, measure, inside, best, any, found);
        }
    }
    /// Whether all of a quad is beyond the best distance, or some of it surely within: by the plane at right angles to the way from the measure to a near point of its
    /// quadratic. The triangles of its smallest parts have their corners on the quadratic, so that they are beyond as well.
    fn decided(
        &self,
        nodes: &Nodes,
        mut at: [f64; 2],
        measure: &impl Measure,
        best: f64,
        any: bool,
    ) -> Decided {
        let from = measure.origin();
        let mut direction = DVec3::NAN;
        for step in 0..=STEPS {
            let near = nodes.at(at);
            let way = measure.across(near.point - from);
            let distance = way.length();
            direction = way / distance;
            if any
                && distance + FINE_MM + ROUNDING_MM < best
                && measure.counts(near.point, FINE_MM + ROUNDING_MM)
            {
                return Decided::Within(distance + FINE_MM);
            }
            if distance < best {
                return Decided::Open(direction);
            }
            if nodes.is_beyond(from, direction, best + ROUNDING_MM) {
                return Decided::Beyond;
            }
            if step < STEPS {
                at = near.nearer(at, way, measure);
            }
        }
        Decided::Open(direction)
    }
}

/// What is known of a quad without halving it.
enum Decided {
    /// All of it is beyond the best distance.
    Beyond,
    /// Some of it is within this distance, which is below the best one.
    Within(f64),
    /// Neither; the direction to a near point.
    Open(DVec3),
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A share of 0 to 1 that differs from call to call.
    fn share(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Random bent cells and measures: no bound is beyond a place of the cell, and most bounds are within a tenth of a millimetre where the cell bends little.
    #[test]
    fn bounds_of_a_cell_hold_all_of_it() {
        let mut state = 1;
        let mut close = 0;
        for _ in 0..300 {
            let mut vector = |size: f64| size * DVec3::from([0; 3].map(|_| 2.0 * share(&mut state) - 1.0));
            let (u, v, from) = (vector(3.0), vector(3.0), vector(6.0));
            let points: [[DVec3; 3]; 3] =
                std::array::from_fn(|i| std::array::from_fn(|j| i as f64 * u + j as f64 * v + vector(0.02)));
            let cell = Cell::new(0, [[0.0, 1.0]; 2], points, false);
            let nodes = Nodes(points);
            let places =
                (0..=20).flat_map(|i| (0..=20).map(move |j| [f64::from(i) / 20.0, f64::from(j) / 20.0]));
            let places: Vec<DVec3> = places.map(|place| cell.at(place)).collect();
            let least =
                |of: &dyn Fn(DVec3) -> f64| places.iter().map(|q| of(*q)).fold(f64::INFINITY, f64::min);

            let ball = least(&|q| q.distance(from));
            assert!(!cell.is_beyond(from, ball), "{points:?}, {from}: {ball}");
            close += usize::from(cell.is_beyond(from, ball - 0.1));

            let above = from.z;
            let line = least(&|q| {
                if q.z < above {
                    f64::INFINITY
                } else {
                    (q - from).truncate().length()
                }
            });
            assert!(!cell.is_beside(from, above, line), "{points:?}, {from}: {line}");

            let direction = vector(1.0).normalize();
            let plane = least(&|q| direction.dot(q - from));
            assert!(!nodes.is_beyond(from, direction, plane + 1e-9));
            assert!(nodes.is_beyond(from, direction, plane - 0.3));
        }
        assert!(close > 60, "{close}");
    }

    /// A cell cut by a triangle: the parts that are taken to be in the region or beside it are, up to their sides.
    #[test]
    fn parts_of_a_cut_cell_are_inside_or_outside() {
        let region = Inside::new(&[vec![[-1.0, 0.3], [1.5, 0.1], [0.4, 2.0]]]);
        let uv = [[0.0, 1.0], [0.0, 1.0]];
        let found = Trimmed::new(uv, &region, &[0, 1, 2]);
        assert!(found.inside != 0 && found.outside != 0 && found.inside & found.outside == 0);
        for index in 0..PARTS * PARTS {
            for (i, j) in (0..=10).flat_map(|i| (0..=10).map(move |j| (i, j))) {
                let at = |part: usize, step: i32| (part as f64 + f64::from(step) / 10.0) / PARTS as f64;
                let is_in = region.contains([at(index % PARTS, i), at(index / PARTS, j)]);
                assert!(!is_in || found.outside >> index & 1 == 0, "{index}");
                assert!(is_in || found.inside >> index & 1 == 0, "{index}");
            }
        }
    }
}
