//! One convex programme for the motion along a pass: squared speed b and path acceleration a at the nodes of a grid in arc length, a
//! linear between them.
//!
//! Velocity and acceleration of an axis, `x' v` and `x'' b + x' a`, bound b and a linearly. Its jerk is `v (x''' b + 3 x'' a + x' da/ds)`, so
//! the bracket must stay below `J / sqrt(b)`. This bound is convex in b where a concave one is required; its tangent at the previous programme's
//! speeds is below it everywhere, so a solution holds the limit, and successive programmes become faster (F. Debrouwere et al.,
//! "Time-Optimal Path Following for Robots With Convex-Concave Constraints Using Sequential Convex Programming", IEEE Trans. Robotics 29, 2013).
//! Time is the sum of `ds / sqrt(b)`, as second-order cones.
//!
//! Where x' or x'' steps by d1, d2 from one smooth span to the next, differences over a period T contain a jerk of up to `d1 v / T^2 +
//! 3/4 d2 v^2 / T`, and an acceleration of up to `d1 v / T`, in addition to those of the spans.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use super::path::PathPoint;
use job::AxisLimits;

/// Variables per node: b over its previous value, a over its scale, sqrt(b), 1 / sqrt(b), scaled likewise.
const VARIABLES: usize = 4;
/// Coefficients below this share of a limit are omitted.
const COEFFICIENT_MIN: f64 = 1e-9;

/// Between two nodes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Interval {
    /// Length, mm.
    pub(super) length: f64,
    /// The path at its beginning, middle and end.
    pub(super) points: [PathPoint; 3],
    /// Magnitudes of the steps of x' and x'' at a break nearby.
    pub(super) steps: [[f64; 3]; 2],
    /// Shares of the acceleration and jerk limits that are used here.
    pub(super) limit_shares: [f64; 2],
}

/// A motion: squared speed and path acceleration at each node.
#[derive(Clone, Debug, Default)]
pub(super) struct MotionProfile {
    pub(super) squares: Vec<f64>,
    pub(super) accelerations: Vec<f64>,
}

/// Rows of the constraints, cone by cone.
#[derive(Default)]
struct Rows {
    places: Vec<(usize, usize, f64)>,
    right: Vec<f64>,
}

impl Rows {
    fn add(&mut self, entries: &[(usize, f64)], right: f64) {
        let row = self.right.len();
        self.places.extend(
            entries
                .iter()
                .filter(|(_, value)| *value != 0.0)
                .map(|(column, value)| (row, *column, *value)),
        );
        self.right.push(right);
    }
}

/// The programme linearised at a profile.
pub(super) struct Programme<'a> {
    pub(super) intervals: &'a [Interval],
    pub(super) limits: &'a AxisLimits,
    /// Largest squared speed at each node.
    pub(super) caps: &'a [f64],
    pub(super) period_s: f64,
    /// Squared speed and acceleration at the first and the last node; `None` where they are free.
    pub(super) ends: [Option<[f64; 2]>; 2],
}

impl Programme<'_> {
    /// The fastest motion within the limits as linearised at these squared speeds (all above 0); `None` if the solver fails.
    pub(super) fn solve(&self, around: &[f64]) -> Option<MotionProfile> {
        let scales = self.scales(around);
        let nodes = around.len();
        let mut rows = Rows::default();
        self.equalities(around, &scales, &mut rows);
        let equal = rows.right.len();
        for (node, cap) in self.caps.iter().enumerate() {
            rows.add(&[(VARIABLES * node, 1.0)], cap / around[node]);
        }
        for k in 0..self.intervals.len() {
            self.accelerations(k, around, &scales, &mut rows);
            self.jerks(k, around, &scales, &mut rows);
        }
        let below = rows.right.len() - equal;
        let mut cones = vec![
            SupportedConeT::ZeroConeT(equal),
            SupportedConeT::NonnegativeConeT(below),
        ];
        let mut cost = vec![0.0; VARIABLES * nodes];
        for (node, square) in around.iter().enumerate() {
            let [b, _, root, inverse] = std::array::from_fn(|k| VARIABLES * node + k);
            // root^2 <= b, root inverse >= 1
            rows.add(&[(b, -1.0)], 1.0);
            rows.add(&[(b, -1.0)], -1.0);
            rows.add(&[(root, -2.0)], 0.0);
            rows.add(&[(inverse, -1.0), (root, -1.0)], 0.0);
            rows.add(&[(inverse, -1.0), (root, 1.0)], 0.0);
            rows.add(&[], 2.0);
            cones.extend([
                SupportedConeT::SecondOrderConeT(3),
                SupportedConeT::SecondOrderConeT(3),
            ]);
            let beside = |k: Option<usize>| k.and_then(|k| self.intervals.get(k)).map_or(0.0, |i| i.length);
            let share = 0.5 * (beside(node.checked_sub(1)) + beside(Some(node)));
            cost[inverse] = share / square.sqrt();
        }
        let whole: f64 = cost.iter().sum();
        cost.iter_mut().for_each(|share| *share /= whole);
        let solution = solved(&rows, &cost, &cones)?;
        let of = |offset: usize, scale: &[f64]| {
            (0..nodes)
                .map(|node| solution[VARIABLES * node + offset] * scale[node])
                .collect()
        };
        Some(MotionProfile {
            squares: of(0, around),
            accelerations: of(1, &scales),
        })
    }

    /// Accelerations consistent with the speeds: those of a ramp from standstill at the jerk limit.
    fn scales(&self, around: &[f64]) -> Vec<f64> {
        let jerk = self
            .limits
            .jerk_mm_s3
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        around.iter().map(|b| (2.0 * jerk * b.sqrt()).sqrt()).collect()
    }

    /// The given ends; `b1 - b0 = (a0 + a1) ds`.
    fn equalities(&self, around: &[f64], scales: &[f64], rows: &mut Rows) {
        let last = around.len() - 1;
        for (node, end) in [(0, self.ends[0]), (last, self.ends[1])] {
            let Some([square, acceleration]) = end else {
                continue;
            };
            rows.add(&[(VARIABLES * node, 1.0)], square / around[node]);
            rows.add(&[(VARIABLES * node + 1, 1.0)], acceleration / scales[node]);
        }
        for (k, interval) in self.intervals.iter().enumerate() {
            let (node, next) = (VARIABLES * k, VARIABLES * (k + 1));
            let unit = around[k].max(around[k + 1]);
            rows.add(
                &[
                    (next, around[k + 1] / unit),
                    (node, -around[k] / unit),
                    (node + 1, -interval.length * scales[k] / unit),
                    (next + 1, -interval.length * scales[k + 1] / unit),
                ],
                0.0,
            );
        }
    }

    /// `|x'' b + x' a| <= A`, at both ends of an interval.
    fn accelerations(&self, k: usize, around: &[f64], scales: &[f64], rows: &mut Rows) {
        let interval = &self.intervals[k];
        for (node, point) in [(k, &interval.points[0]), (k + 1, &interval.points[2])] {
            for axis in 0..3 {
                let limit = self.limits.acceleration_mm_s2[axis] * interval.limit_shares[0];
                let by_square = point.second[axis] * around[node] / limit;
                let by_acceleration = point.first[axis] * scales[node] / limit;
                // sqrt(b) is below its tangent.
                let step = 0.5 * interval.steps[0][axis] * around[node].sqrt() / (self.period_s * limit);
                if by_square.abs() + by_acceleration.abs() + step <= COEFFICIENT_MIN {
                    continue;
                }
                for sign in [1.0, -1.0] {
                    rows.add(
                        &[
                            (VARIABLES * node, sign * by_square + step),
                            (VARIABLES * node + 1, sign * by_acceleration),
                        ],
                        1.0 - step,
                    );
                }
            }
        }
    }

    /// `|x''' b + 3 x'' a + x' da/ds| <= J / sqrt(b)`, in the middle of an interval.
    fn jerks(&self, k: usize, around: &[f64], scales: &[f64], rows: &mut Rows) {
        let interval = &self.intervals[k];
        let (h, point) = (interval.length, &interval.points[1]);
        let middle = 0.5 * (around[k] + around[k + 1]);
        let speed = middle.sqrt();
        let columns: [usize; 4] = [0, 1, VARIABLES, VARIABLES + 1].map(|offset| VARIABLES * k + offset);
        // In the middle b is the mean of the ends minus h^2 b'' / 8, and b'' = 2 da/ds.
        let square = [
            0.5 * around[k],
            0.25 * h * scales[k],
            0.5 * around[k + 1],
            -0.25 * h * scales[k + 1],
        ];
        let acceleration = [0.0, 0.5 * scales[k], 0.0, 0.5 * scales[k + 1]];
        let change = [0.0, -scales[k] / h, 0.0, scales[k + 1] / h];
        for axis in 0..3 {
            let unit = speed / (self.limits.jerk_mm_s3[axis] * interval.limit_shares[1]);
            let own: [f64; 4] = std::array::from_fn(|n| {
                unit * (point.third[axis] * square[n]
                    + 3.0 * point.second[axis] * acceleration[n]
                    + point.first[axis] * change[n])
            });
            let first_step = unit * interval.steps[0][axis] / self.period_s.powi(2);
            let second_step = unit * 0.75 * interval.steps[1][axis] * speed / self.period_s;
            if own.iter().map(|value| value.abs()).sum::<f64>() + first_step + second_step <= COEFFICIENT_MIN
            {
                continue;
            }
            for sign in [1.0, -1.0] {
                let by = |n: usize| sign * own[n] + (0.5 + 0.5 * second_step) * square[n] / middle;
                rows.add(
                    &std::array::from_fn::<_, 4, _>(|n| (columns[n], by(n))),
                    1.5 - first_step - 0.5 * second_step,
                );
            }
        }
    }
}

/// The solution; `None` if the solver fails.
fn solved(rows: &Rows, cost: &[f64], cones: &[SupportedConeT<f64>]) -> Option<Vec<f64>> {
    let columns = cost.len();
    let part = |of: fn(&(usize, usize, f64)) -> usize| rows.places.iter().map(of).collect::<Vec<_>>();
    let values = rows.places.iter().map(|place| place.2).collect();
    let matrix = CscMatrix::new_from_triplets(
        rows.right.len(),
        columns,
        part(|place| place.0),
        part(|place| place.1),
        values,
    );
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .max_iter(200)
        .build()
        .ok()?;
    let quadratic = CscMatrix::zeros((columns, columns));
    let mut solver = DefaultSolver::new(&quadratic, cost, &matrix, &rows.right, cones, settings).ok()?;
    solver.solve();
    matches!(
        solver.solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved
    )
    .then(|| solver.solution.x.clone())
}
