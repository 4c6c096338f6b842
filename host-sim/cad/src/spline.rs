//! B-splines of any degree, rational or not: evaluation, and exact restriction to a part of the domain
//! (Piegl and Tiller, "The NURBS Book", 2nd ed., A2.1 to A2.3, A4.4, A5.1; here "P&T").

use super::placement::Placement;
use glam::DVec3;
use oracle::Derivatives;
use serde::{Deserialize, Serialize};

/// A homogeneous point `(w x, w y, w z, w)`, mm and a weight.
pub type Pole = [f64; 4];

/// Highest degree that is read; CAD systems write at most 25 (OpenCASCADE).
pub const DEGREE_MAX: usize = 25;

/// Largest number of nonzero basis functions at a parameter.
const ORDER_MAX: usize = DEGREE_MAX + 1;
/// That of most files: clearing and copying room for more takes longer than the functions.
const ORDER_USUAL: usize = 6;

/// Parameters this close to a knot, as a share of the domain, are set to it: rounding of files and of point inversion.
const KNOT_SNAP: f64 = 1e-12;

/// The polynomial piece that is evaluated at a knot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The piece below.
    Below,
    /// The piece above.
    Above,
}

/// Knots of one direction. The domain is `[knots[degree], knots[knots.len() - 1 - degree]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Degree, 1 to [`DEGREE_MAX`].
    pub degree: usize,
    /// Knots, not descending, as many as poles + degree + 1.
    pub knots: Vec<f64>,
}

/// Values, first and second derivatives of the nonzero basis functions at a parameter, with room for N of them.
type Basis<const N: usize> = [[f64; N]; 3];

impl Axis {
    /// Number of poles for these knots.
    #[must_use]
    pub fn poles(&self) -> usize {
        self.knots.len() - self.degree - 1
    }

    /// Range of the parameter, ascending.
    #[must_use]
    pub fn domain(&self) -> [f64; 2] {
        [self.knots[self.degree], self.knots[self.poles()]]
    }

    /// Ends of the domain and the distinct knots between them, ascending.
    #[must_use]
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks = self.knots[self.degree..=self.poles()].to_vec();
        breaks.dedup();
        breaks
    }

    /// Multiplicity of a knot.
    #[must_use]
    pub fn multiplicity(&self, knot: f64) -> usize {
        self.knots.iter().filter(|other| **other == knot).count()
    }

    /// The span that contains `t`: `knots[span] <= t < knots[span + 1]`, or at a knot the one below it for `Side::Below` (P&T A2.1).
    fn span(&self, t: f64, side: Side) -> usize {
        let inside = &self.knots[self.degree..=self.poles()];
        let [start, end] = self.domain();
        let above = if t >= end || (side == Side::Below && t > start) {
            inside.partition_point(|knot| *knot < t.min(end))
        } else {
            inside.partition_point(|knot| *knot <= t.max(start))
        };
        self.degree + above.max(1) - 1
    }

    /// Index of the first pole with influence at `t`, and the basis functions with two derivatives (P&T A2.2, eqn 2.9).
    /// N is above the degree.
    pub(super) fn basis<const N: usize>(&self, t: f64, side: Side) -> (usize, Basis<N>) {
        let (p, span) = (self.degree, self.span(t, side));
        let (mut one, mut two) = ([[0.0; N]; 3], [[0.0; N]; 3]);
        let (mut lower, mut next) = (&mut one, &mut two);
        lower[0][0] = 1.0;
        for d in 1..=p {
            let derived = d + 2 > p;
            for functions in next.iter_mut() {
                functions[..=d].fill(0.0);
            }
            for r in 0..d {
                // The support of function r of degree d - 1 is [knots[span - d + 1 + r], knots[span + 1 + r]].
                let (low, high) = (self.knots[span + 1 + r - d], self.knots[span + 1 + r]);
                let width = 1.0 / (high - low);
                let value = lower[0][r] * width;
                next[0][r] += (high - t) * value;
                next[0][r + 1] += (t - low) * value;
                if derived {
                    // A derivative of degree d is d times the difference of the next lower order of degree d - 1.
                    let order = d + 2 - p;
                    for k in 1..=order.min(2) {
                        let slope = d as f64 * lower[k - 1][r] * width;
                        next[k][r] -= slope;
                        next[k][r + 1] += slope;
                    }
                }
            }
            (lower, next) = (next, lower);
        }
        (span - p, *lower)
    }

    /// The parameter, set to a knot that it equals to rounding.
    fn snapped(&self, t: f64) -> f64 {
        let [start, end] = self.domain();
        let near = self
            .knots
            .iter()
            .find(|knot| (*knot - t).abs() <= KNOT_SNAP * (end - start));
        near.copied().unwrap_or(t)
    }
}

/// A value that can be blended linearly: a pole, or a row of poles.
pub(super) trait Blend: Clone {
    fn blend(&self, other: &Self, share: f64) -> Self;
}

impl Blend for Pole {
    fn blend(&self, other: &Self, share: f64) -> Self {
        std::array::from_fn(|k| (1.0 - share) * self[k] + share * other[k])
    }
}

impl Blend for Vec<Pole> {
    fn blend(&self, other: &Self, share: f64) -> Self {
        self.iter().zip(other).map(|(a, b)| a.blend(b, share)).collect()
    }
}

/// Inserts a knot once (P&T A5.1), which adds one pole.
pub(super) fn insert<P: Blend>(axis: &mut Axis, poles: &mut Vec<P>, t: f64) {
    let p = axis.degree;
    let k = axis.knots.partition_point(|knot| *knot <= t) - 1;
    let s = axis.multiplicity(t);
    let first = k + 1 - p;
    let mut inserted: Vec<P> = poles[..first].to_vec();
    for i in first..=k - s {
        let (low, high) = (axis.knots[i], axis.knots[i + p]);
        inserted.push(poles[i - 1].blend(&poles[i], (t - low) / (high - low)));
    }
    inserted.extend_from_slice(&poles[k - s..]);
    axis.knots.insert(k + 1, t);
    *poles = inserted;
}

/// The part over a range within the domain, its end knots repeated degree + 1 times. Exact.
fn cut<P: Blend>(axis: &Axis, poles: &[P], range: [f64; 2]) -> (Axis, Vec<P>) {
    let (mut axis, mut poles) = (axis.clone(), poles.to_vec());
    let domain = axis.domain();
    let range = range.map(|t| axis.snapped(t.clamp(domain[0], domain[1])));
    for t in range {
        while axis.multiplicity(t) < axis.degree {
            insert(&mut axis, &mut poles, t);
        }
    }
    let [start, end] = range;
    let first = axis.knots.partition_point(|knot| *knot <= start) - 1 - axis.degree;
    let after = axis.knots.partition_point(|knot| *knot < end);
    let mut knots = vec![start; axis.degree + 1];
    knots.extend(axis.knots.iter().filter(|knot| **knot > start && **knot < end));
    knots.extend(vec![end; axis.degree + 1]);
    let poles = poles[first..after].to_vec();
    (
        Axis {
            degree: axis.degree,
            knots,
        },
        poles,
    )
}

/// A B-spline curve in space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplineCurve {
    /// Degree and knots.
    pub axis: Axis,
    /// Homogeneous poles.
    pub poles: Vec<Pole>,
}

impl SplineCurve {
    /// The curve, transformed by a placement.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Self {
        Self {
            axis: self.axis.clone(),
            poles: self.poles.iter().map(|pole| by.pole(*pole)).collect(),
        }
    }

    /// Point, first and second derivative, mm.
    #[must_use]
    pub fn at(&self, t: f64) -> [DVec3; 3] {
        if self.axis.degree < ORDER_USUAL {
            self.at_of_order::<ORDER_USUAL>(t)
        } else {
            self.at_of_order::<ORDER_MAX>(t)
        }
    }

    fn at_of_order<const N: usize>(&self, t: f64) -> [DVec3; 3] {
        let (first, basis) = self.axis.basis::<N>(t, Side::Above);
        let mut sums = [[0.0; 4]; 3];
        for (r, pole) in self.poles[first..=first + self.axis.degree].iter().enumerate() {
            for (sum, functions) in sums.iter_mut().zip(&basis) {
                for k in 0..4 {
                    sum[k] += functions[r] * pole[k];
                }
            }
        }
        let [w, d_w, dd_w] = sums.map(|sum| sum[3]);
        let [s, d, dd] = sums.map(|[x, y, z, _]| DVec3::new(x, y, z));
        let first = (d - d_w * s / w) / w;
        [s / w, first, (dd - 2.0 * d_w * first - dd_w * s / w) / w]
    }

    /// The part over a range within the domain. Exact.
    #[must_use]
    pub fn cut(&self, range: [f64; 2]) -> Self {
        let (axis, poles) = cut(&self.axis, &self.poles, range);
        Self { axis, poles }
    }

    /// Whether the weights differ.
    #[must_use]
    pub fn rational(&self) -> bool {
        self.poles.iter().any(|pole| pole[3] != self.poles[0][3])
    }

    /// The curve in the opposite direction, on the same range.
    pub(super) fn reversed(&self) -> Self {
        let [start, end] = self.axis.domain();
        Self {
            axis: Axis {
                degree: self.axis.degree,
                knots: self
                    .axis
                    .knots
                    .iter()
                    .rev()
                    .map(|knot| start + end - knot)
                    .collect(),
            },
            poles: self.poles.iter().rev().copied().collect(),
        }
    }

    /// This curve with a degree of at least its own: each span is raised separately (P&T 5.5).
    pub(super) fn raised(&self, degree: usize) -> Self {
        let mut curve = self.clone();
        while curve.axis.degree < degree {
            curve = curve.raised_once();
        }
        curve
    }

    fn raised_once(&self) -> Self {
        let p = self.axis.degree;
        let mut curve = self.clone();
        let breaks = self.axis.breaks();
        for knot in &breaks[1..breaks.len() - 1] {
            while curve.axis.multiplicity(*knot) < p {
                insert(&mut curve.axis, &mut curve.poles, *knot);
            }
        }
        let mut poles = vec![curve.poles[0]];
        for span in 0..breaks.len() - 1 {
            let bezier = &curve.poles[span * p..=(span + 1) * p];
            poles.extend((1..=p).map(|i| bezier[i].blend(&bezier[i - 1], i as f64 / (p + 1) as f64)));
            poles.push(bezier[p]);
        }
        let last = breaks.len() - 1;
        let knots = breaks.iter().enumerate().flat_map(|(index, knot)| {
            let times = if index == 0 || index == last { p + 2 } else { p + 1 };
            vec![*knot; times]
        });
        Self {
            axis: Axis {
                degree: p + 1,
                knots: knots.collect(),
            },
            poles,
        }
    }

    /// Inserts the knots of an axis of the same degree and range that this curve lacks. Exact; a knot that equals one of this curve to rounding is taken for it.
    pub(super) fn take_knots(&mut self, of: &Axis) {
        for knot in of.breaks() {
            let own = self.axis.snapped(knot);
            while self.axis.multiplicity(own) < of.multiplicity(knot) {
                insert(&mut self.axis, &mut self.poles, own);
            }
        }
    }
}

/// A B-spline surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplineSurface {
    /// Degrees and knots in u and in v.
    pub axes: [Axis; 2],
    /// Homogeneous poles, `[i][j]`, i along u.
    pub poles: Vec<Vec<Pole>>,
}

impl SplineSurface {
    /// The surface, transformed by a placement.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Self {
        let row = |row: &Vec<Pole>| row.iter().map(|pole| by.pole(*pole)).collect();
        Self {
            axes: self.axes.clone(),
            poles: self.poles.iter().map(row).collect(),
        }
    }

    /// Ranges of u and v.
    #[must_use]
    pub fn domain(&self) -> [[f64; 2]; 2] {
        [self.axes[0].domain(), self.axes[1].domain()]
    }

    /// Whether the weights differ.
    #[must_use]
    pub fn rational(&self) -> bool {
        let weight = self.poles[0][0][3];
        self.poles.iter().flatten().any(|pole| pole[3] != weight)
    }

    /// Patches: spans in u times spans in v.
    #[must_use]
    pub fn patches(&self) -> usize {
        self.axes.iter().map(|axis| axis.breaks().len() - 1).product()
    }

    /// S and its derivatives; at a knot, those of the piece on the named side.
    #[must_use]
    pub fn at_side(&self, place: [f64; 2], sides: [Side; 2]) -> Derivatives {
        if self.axes.iter().all(|axis| axis.degree < ORDER_USUAL) {
            self.at_of_order::<ORDER_USUAL>(place, sides)
        } else {
            self.at_of_order::<ORDER_MAX>(place, sides)
        }
    }

    fn at_of_order<const N: usize>(&self, [u, v]: [f64; 2], [side_u, side_v]: [Side; 2]) -> Derivatives {
        let (first_u, basis_u) = self.axes[0].basis::<N>(u, side_u);
        let (first_v, basis_v) = self.axes[1].basis::<N>(v, side_v);
        // [order in u][order in v], of total order up to 2.
        let mut sums = [[[0.0; 4]; 3]; 3];
        for (r, row) in self.poles[first_u..=first_u + self.axes[0].degree]
            .iter()
            .enumerate()
        {
            let mut in_v = [[0.0; 4]; 3];
            for (c, pole) in row[first_v..=first_v + self.axes[1].degree].iter().enumerate() {
                for (sum, functions) in in_v.iter_mut().zip(&basis_v) {
                    for k in 0..4 {
                        sum[k] += functions[c] * pole[k];
                    }
                }
            }
            for (a, functions) in basis_u.iter().enumerate() {
                for (b, value) in in_v.iter().enumerate().take(3 - a) {
                    for k in 0..4 {
                        sums[a][b][k] += functions[r] * value[k];
                    }
                }
            }
        }
        let [[s, s_v, s_vv], [s_u, s_uv, _], [s_uu, _, _]] = sums;
        Derivatives::from_homogeneous([s, s_u, s_v, s_uu, s_uv, s_vv])
    }

    /// S and its derivatives.
    #[must_use]
    pub fn at(&self, u: f64, v: f64) -> Derivatives {
        self.at_side([u, v], [Side::Above; 2])
    }

    /// The part over a rectangle within the domain. Exact.
    #[must_use]
    pub fn cut(&self, [u, v]: [[f64; 2]; 2]) -> Self {
        let (axis_u, rows) = cut(&self.axes[0], &self.poles, u);
        let (axis_v, columns) = cut(&self.axes[1], &transposed(&rows), v);
        Self {
            axes: [axis_u, axis_v],
            poles: transposed(&columns),
        }
    }
}

/// Transposes.
pub(super) fn transposed(rows: &[Vec<Pole>]) -> Vec<Vec<Pole>> {
    (0..rows.first().map_or(0, Vec::len))
        .map(|j| rows.iter().map(|row| row[j]).collect())
        .collect()
}
