//! The rows of a place: their derivatives, the greatest factor that keeps them, and how far a step may go.

use crate::feed::limits::MotionLimits;
use crate::feed::stations::Derivatives;
use crate::math::arith::{inverse_sqrt, sqrt};
use crate::math::number::Bounded;

/// Least slack of a row that is divided by.
pub(super) const SLACK_MIN: f32 = 1e-6;

/// Share of the way to the next limit that a step goes.
const STEP_SHARE: f32 = 0.97;

/// c, c' of the pace, and c'' before and after.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    pub(super) c: f32,
    pub(super) c1: f32,
    pub(super) c2: [f32; 2],
}

/// A place of the plan: its motion at pace 1, and the path there.
pub(super) struct Place {
    /// mm/s, mm/s^2; jerk before and after, mm/s^3; inverse time of an interval, 1/s.
    pub(super) v: f32,
    pub(super) a: f32,
    pub(super) j: [f32; 2],
    pub(super) h: f32,
    pub(super) q: Derivatives,
    /// Jerk that a jump nearby takes, and the speed over it, mm/s.
    pub(super) jump: [[f32; 2]; 3],
    pub(super) at_jump: f32,
}

/// The rows of an axis at a place.
#[derive(Clone, Copy, Debug)]
struct AxisRows {
    pub(super) x0: f32,
    pub(super) x1: f32,
    /// Y0 before and after.
    pub(super) y0: [f32; 2],
    pub(super) y1: f32,
    pub(super) y2: f32,
    pub(super) e1: f32,
    pub(super) e2: f32,
}

impl Place {
    /// The rows of each axis.
    #[inline(always)]
    fn rows(&self, limits: &MotionLimits, mut each: impl FnMut(&AxisRows)) {
        let (v, a, h) = (self.v, self.a, self.h);
        let v2 = v * v;
        let [before, after] = self.j;
        for (([q1, q2, q3], inverse), [first, second]) in self.q.iter().zip(&limits.inverse).zip(&self.jump) {
            let t1 = 0.5 * h * q1 * v;
            let t2 = q2 * v2 + q1 * a;
            let t3 = (q3 * v2 + 3.0 * q2 * a) * v;
            each(&AxisRows {
                x0: t2 * inverse.acceleration,
                x1: t1 * inverse.acceleration,
                y0: [
                    (t3 + q1 * before) * inverse.jerk,
                    (t3 + q1 * after) * inverse.jerk,
                ],
                y1: 1.5 * h * t2 * inverse.jerk,
                y2: h * t1 * inverse.jerk,
                e1: first * self.at_jump,
                e2: second * self.at_jump * self.at_jump,
            });
        }
    }

    /// Greatest factor of the pace that keeps the rows.
    pub(super) fn factor(&self, limits: &MotionLimits, speed: f32, pace: &Local) -> f32 {
        let Local { c, c1, c2 } = *pace;
        let c = c.at_least(1e-9);
        let root = sqrt(c);
        let mut factor = 1.0 / (speed * c).at_least(1e-9);
        self.rows(limits, |rows| {
            factor = factor.at_most(1.0 / (rows.x0 * c + rows.x1 * c1).abs().at_least(1e-9));
            let mut y = 0.0_f32;
            for (y0, c2) in rows.y0.iter().zip(&c2) {
                y = y.at_least((y0 * c + rows.y1 * c1 + rows.y2 * c2).abs());
            }
            // In z, the root of the factor: y root z^3 + e2 c z^2 + e1 root z < 1.
            let use_of = |z: f32| ((y * root * z + rows.e2 * c) * z + rows.e1 * root) * z;
            let mut z = sqrt(factor);
            for _ in 0..FACTOR_STEPS {
                if use_of(z) < 1.0 {
                    break;
                }
                z *= FACTOR_STEP;
            }
            factor = factor.at_most(z * z);
        });
        factor
    }

    /// The greatest use of an acceleration or a jerk.
    pub(super) fn most_used(&self, limits: &MotionLimits, pace: &Local) -> f32 {
        let Local { c, c1, c2 } = *pace;
        let root = inverse_sqrt(c.at_least(1e-12));
        let mut most = 0.0_f32;
        self.rows(limits, |rows| {
            most = most.at_least((rows.x0 * c + rows.x1 * c1).abs());
            let left = (1.0 - rows.e2 * c) * root - rows.e1;
            let inverse = 1.0 / left.at_least(1e-3 * root);
            for (y0, c2) in rows.y0.iter().zip(&c2) {
                most = most.at_least((y0 * c + rows.y1 * c1 + rows.y2 * c2).abs() * inverse);
            }
        });
        most
    }

    /// Derivatives of the barrier of every row, times `mu`.
    #[inline(always)]
    pub(super) fn barrier(&self, limits: &MotionLimits, pace: &Local, mu: f32, sums: &mut Sums) {
        let Local { c, c1, c2 } = *pace;
        let inverse_mu = 1.0 / mu;
        let root = inverse_sqrt(c.at_least(1e-12));
        let inverse = root * root;
        self.rows(limits, |rows| {
            let AxisRows { x0, x1, y1, y2, .. } = *rows;
            let x = x0 * c + x1 * c1;
            let u = 1.0 / (1.0 - x * x).at_least(SLACK_MIN);
            let slope = 2.0 * mu * x * u;
            let bend = 2.0 * mu * (1.0 + x * x) * u * u;
            sums.g0 += x0 * slope;
            sums.g1 += x1 * slope;
            sums.k00 += x0 * x0 * bend;
            sums.k01 += x0 * x1 * bend;
            sums.k11 += x1 * x1 * bend;
            let w = (1.0 - rows.e2 * c) * root - rows.e1;
            let wc = -0.5 * root * (inverse + rows.e2);
            let part = y1 * c1;
            let Sums { sides, .. } = sums;
            let [mut g0, mut g1, mut k00, mut k01, mut k11] = [0.0; 5];
            for ((side, y0), c2) in sides.iter_mut().zip(&rows.y0).zip(&c2) {
                let y = y0 * c + part + y2 * c2;
                let t = mu / (w * w - y * y).at_least(SLACK_MIN * w * w);
                let (up, down) = ((w + y) * t, (w - y) * t);
                let (slope, sum) = (up - down, up + down);
                let bend = (up * up + down * down) * inverse_mu;
                let skew = slope * sum * inverse_mu;
                let cross = y0 * bend - wc * skew;
                g0 += y0 * slope - wc * sum;
                g1 += slope;
                k00 += y0 * cross + wc * (wc * bend - y0 * skew);
                k01 += cross;
                k11 += bend;
                side.g2 += y2 * slope;
                side.k02 += y2 * cross;
                side.k12 += y1 * y2 * bend;
                side.k22 += y2 * y2 * bend;
            }
            sums.g0 += g0;
            sums.g1 += y1 * g1;
            sums.k00 += k00;
            sums.k01 += y1 * k01;
            sums.k11 += y1 * y1 * k11;
        });
    }

    /// The row that is used up first along a direction.
    #[inline(always)]
    pub(super) fn reach(&self, limits: &MotionLimits, pace: &Local, direction: &Local, reach: &mut Reach) {
        let Local { c, c1, c2 } = *pace;
        let (d, d1, d2) = (direction.c, direction.c1, direction.c2);
        let root = inverse_sqrt(c.at_least(1e-12));
        let inverse = root * root;
        self.rows(limits, |rows| {
            let (x, dx) = (rows.x0 * c + rows.x1 * c1, rows.x0 * d + rows.x1 * d1);
            // Of the two sides of a row only that which is approached is used up.
            reach.add(1.0 - if dx < 0.0 { -x } else { x }, dx.abs());
            let w = (1.0 - rows.e2 * c) * root - rows.e1;
            let dw = -0.5 * root * (inverse + rows.e2) * d;
            let (part, dpart) = (rows.y1 * c1, rows.y1 * d1);
            for ((y0, c2), d2) in rows.y0.iter().zip(&c2).zip(&d2) {
                let y = y0 * c + part + rows.y2 * c2;
                let dy = y0 * d + dpart + rows.y2 * d2;
                reach.add(w - y, dy - dw);
                reach.add(w + y, -dy - dw);
            }
        });
    }
}

/// Derivatives by c, c' and by c'' on each side.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub(super) g0: f32,
    pub(super) g1: f32,
    pub(super) k00: f32,
    pub(super) k01: f32,
    pub(super) k11: f32,
    pub(super) sides: [Side; 2],
}
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Side {
    pub(super) g2: f32,
    pub(super) k02: f32,
    pub(super) k12: f32,
    pub(super) k22: f32,
}

/// Steps of the search for a row's factor.
const FACTOR_STEPS: u8 = 32;
const FACTOR_STEP: f32 = 0.85;

/// The least ratio of a slack to what it loses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    slack: f32,
    loss: f32,
}

impl Reach {
    /// None yet.
    pub(crate) const NONE: Self = Self {
        slack: 0.0,
        loss: 0.0,
    };

    /// No row is used up.
    pub(crate) const FAR: Self = Self {
        slack: 1.0,
        loss: 0.0,
    };

    pub(super) fn add(&mut self, slack: f32, loss: f32) {
        if loss * self.slack > slack * self.loss {
            (self.slack, self.loss) = (slack, loss);
        }
    }

    /// Length of a step that keeps every row.
    pub(crate) fn step(&self) -> f32 {
        if self.loss > 0.0 {
            (STEP_SHARE * self.slack / self.loss).at_least(0.0).at_most(1.0)
        } else {
            1.0
        }
    }
}
