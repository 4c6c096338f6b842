//! Use of each axis's velocity, acceleration and jerk limit by an emitted tool path, from differences of its positions.
//!
//! A position is within 10 nm of the motion that it samples (the accuracy that `verify` requires of every sample, rounding included). A
//! difference of order k over a base of n periods, such as `x(t) - 3 x(t - nT) + 3 x(t - 2nT) - x(t - 3nT)`, divided by `(nT)^k`, is an
//! average of the k-th derivative over k bases. So
//!
//! - it is never above the derivative's largest magnitude, whatever the base, and
//! - the positions' error adds at most 20, 40 or 80 nm over `(nT)^k`: for the jerk over 1 ms 80 000 mm/s^3, over 6 ms 370.
//!
//! ```text
//! bases 1, 2, 3, 4, 6, 8, 12 .. periods ──► the largest difference less its error: surely reached ──► above the limit: violated
//!                                      └──► the shortest base with an error of at most 5 % of the limit: short enough? ──► met, or unknown
//! ```
//!
//! A violation of any kind raises the figure: a lasting one over long bases, where the error vanishes; a break over short ones, where it is
//! large. What escapes is a break so small that over the judged base it averages out: a step of the acceleration by less than 1.4 J nT, say
//! (168 mm/s^2 at 20 000 mm/s^3). Where even a step by the whole acceleration limit would average out, the base is too long for a verdict.

use crate::Verdict;
use job::units::MM_PER_NM;
use job::{AXES, AxisLimits, MachineSpec};

/// Names of the derivatives, and their units.
pub const ORDERS: [(&str, &str); 3] = [
    ("velocity", "mm/s"),
    ("acceleration", "mm/s^2"),
    ("jerk", "mm/s^3"),
];
/// Tolerances of the uses above 1: velocity and acceleration 1 %, jerk 5 %.
pub const TOLERANCES: [f64; 3] = [0.01, 0.01, 0.05];
/// Largest error of a position, nm: the bound of `verify` (`inspect::BOUNDS`).
const POSITION_NM: f64 = 10.0;
/// Sum of the magnitudes of the coefficients of a difference of each order.
const COEFFICIENTS: [f64; 3] = [2.0, 4.0, 8.0];
/// Largest error of a difference over the judged base, as a share of the limit.
const ERROR_SHARE: f64 = 0.05;
/// Longest base, as a share of the time in which the limits permit the derivative below to reach its own limit: a step by that limit is
/// averaged to at least 1.07 times the limit (the peak of the average's weight is 1 / nT for the acceleration, 3 / 4 nT for the jerk).
const STEP_SHARE: f64 = 0.7;
/// [`STEP_SHARE`] for the velocity, which has no steps: within the acceleration limit the velocity's average is within 5 % of the velocity.
const SPEED_SHARE: f64 = 0.2;
/// The longest base is this many times the longest judged base.
const LADDER_ABOVE: usize = 4;
/// Longest base, periods.
const LADDER_MAX: usize = 4096;

/// Largest magnitude of a derivative of the positions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peak {
    /// Largest magnitude on each axis that is surely reached; mm/s, mm/s^2 or mm/s^3.
    pub axes: [f64; 3],
    /// Tick of each axis' largest magnitude: the last sample of the difference.
    pub ticks: [u64; 3],
    /// The axis with the largest use of its limit (without limits: with the largest magnitude), 0 to 2.
    pub axis: usize,
    /// Use of this axis's limit, 1 = at the limit; `None` without a limit.
    pub share: Option<f64>,
    /// The base over which this axis's magnitude is reached, s.
    pub reached_s: f64,
    /// The judged base on this axis, s.
    pub base_s: f64,
    /// Error of a difference over that base, as a share of the limit; 0 without a limit.
    pub uncertainty: f64,
    /// Verdict on all axes; [`Verdict::Met`] without limits.
    pub verdict: Verdict,
}

/// Largest velocity, acceleration and jerk of a tool path.
pub type Peaks = [Peak; 3];

/// The largest difference over one base: magnitude, nm, and tick.
#[derive(Clone, Copy, Debug, Default)]
struct Largest {
    nm: i64,
    tick: u64,
}

/// One base, with the largest difference of each order and axis.
#[derive(Clone, Debug)]
struct Base {
    periods: usize,
    largest: [[Largest; 3]; 3],
}

/// Peaks of the derivatives of positions, one position per period, in the order of ticks.
#[derive(Clone, Debug)]
pub struct PeakMeter {
    period_s: f64,
    /// Limits of velocity, acceleration and jerk.
    limits: Option<[[f64; 3]; 3]>,
    bases: Vec<Base>,
    /// The last positions, nm, a ring; a power of two of them.
    ring: Vec<[i64; 3]>,
    /// Positions since the last discontinuity.
    count: usize,
    /// The axes rest at the first of these positions before it.
    rests: bool,
    tick: u64,
}

/// Bases: 1, 2, 3, 4, 6, 8, 12, 16, ... periods, up to this one at least.
fn ladder(last: usize) -> Vec<usize> {
    let mut periods = vec![1];
    let mut power = 2;
    while periods.last().is_some_and(|longest| *longest < last) {
        periods.extend([power, power + power / 2]);
        power *= 2;
    }
    periods
}

impl PeakMeter {
    /// A meter for a machine's limits.
    #[must_use]
    pub fn new(machine: &MachineSpec) -> Self {
        let period_s = machine.period_s();
        let limits = machine.limits.map(|limits| limits.by_order());
        let longest = limits
            .unwrap_or(AxisLimits::DEFAULT.by_order())
            .iter()
            .enumerate()
            .flat_map(|(order, limits)| limits.map(|limit| required_s(order, limit)))
            .fold(0.0, f64::max);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive and clamped"
        )]
        let longest = ((longest / period_s).ceil() as usize).clamp(1, LADDER_MAX / LADDER_ABOVE);
        let bases: Vec<Base> = ladder(LADDER_ABOVE * longest)
            .into_iter()
            .map(|periods| Base {
                periods,
                largest: [[Largest::default(); 3]; 3],
            })
            .collect();
        let reach = bases.last().map_or(1, |base| 3 * base.periods + 1);
        Self {
            period_s,
            limits,
            bases,
            ring: vec![[0; 3]; reach.next_power_of_two()],
            count: 0,
            rests: false,
            tick: 0,
        }
    }

    /// The axes are at rest at a position before the next sample.
    pub fn start_at_rest(&mut self, cl_nm: [i32; 3]) {
        self.count = 1;
        self.ring[0] = cl_nm.map(i64::from);
        self.rests = true;
    }

    /// Discontinuity: no differences are taken across it.
    pub fn discontinuity(&mut self) {
        (self.count, self.rests) = (0, false);
    }

    /// The position `back` periods before the last one; `None` before the first one of a moving axis.
    fn position(&self, back: usize) -> Option<[i64; 3]> {
        let index = match self.count.checked_sub(back + 1) {
            Some(index) => index,
            None if self.rests => self.count.saturating_sub(self.ring.len()),
            None => return None,
        };
        Some(self.ring[index & (self.ring.len() - 1)])
    }

    /// The position of the next period, nm.
    pub fn add(&mut self, tick: u64, cl_nm: [i32; 3]) {
        self.tick = tick;
        let mask = self.ring.len() - 1;
        self.ring[self.count & mask] = cl_nm.map(i64::from);
        self.count += 1;
        let mut bases = std::mem::take(&mut self.bases);
        for base in &mut bases {
            let Some(differences) = self.differences(base.periods) else {
                break;
            };
            for (largest, value) in base.largest.iter_mut().zip(differences) {
                for (largest, value) in largest.iter_mut().zip(value.into_iter().flatten()) {
                    if value.abs() > largest.nm {
                        *largest = Largest {
                            nm: value.abs(),
                            tick,
                        };
                    }
                }
            }
        }
        self.bases = bases;
    }

    /// Differences of each order over a base that ends at the last position, nm; `None` for one that begins before the first position, of
    /// all orders if the shortest one does.
    fn differences(&self, periods: usize) -> Option<[Option<[i64; 3]>; 3]> {
        let (a, b) = (self.position(0)?, self.position(periods)?);
        let (c, d) = (self.position(2 * periods), self.position(3 * periods));
        let each = |of: &dyn Fn(usize) -> i64| [of(0), of(1), of(2)];
        let second = c.map(|c| each(&|k| a[k] - 2 * b[k] + c[k]));
        let third = c.zip(d).map(|(c, d)| each(&|k| a[k] - 3 * (b[k] - c[k]) - d[k]));
        Some([Some(each(&|k| a[k] - b[k])), second, third])
    }

    /// The axes stop at the last position: the differences of the stop count.
    pub fn end_at_rest(&mut self) {
        if let Some(at) = self.position(0) {
            // In range: the position was converted from an i32.
            #[allow(clippy::cast_possible_truncation, reason = "it was an i32 before")]
            let at = at.map(|nm| nm as i32);
            let longest = self.bases.last().map_or(1, |base| base.periods);
            let tick = self.tick + 1;
            for _ in 0..3 * longest {
                self.add(tick, at);
            }
        }
    }

    /// The peaks so far.
    #[must_use]
    pub fn peaks(&self) -> Peaks {
        std::array::from_fn(|order| self.peak(order))
    }

    fn peak(&self, order: usize) -> Peak {
        let limits = self.limits.map(|limits| limits[order]);
        let axes: [Judged; 3] = std::array::from_fn(|axis| self.judge(order, axis));
        let share = |axis: usize| axes[axis].reached / limits.map_or(1.0, |limits| limits[axis]);
        let axis = (1..3).fold(
            0,
            |most, axis| if share(axis) > share(most) { axis } else { most },
        );
        let verdicts = axes.each_ref().map(|judged| judged.verdict);
        let worst = [Verdict::Violated, Verdict::Unknown]
            .into_iter()
            .find(|verdict| verdicts.contains(verdict));
        Peak {
            axes: axes.each_ref().map(|judged| judged.reached),
            ticks: axes.each_ref().map(|judged| judged.tick),
            axis,
            share: limits.map(|_| share(axis)),
            reached_s: axes[axis].reached_s,
            base_s: axes[axis].base_s,
            uncertainty: limits.map_or(0.0, |limits| error(order, axes[axis].base_s) / limits[axis]),
            verdict: worst.unwrap_or_default(),
        }
    }

    fn judge(&self, order: usize, axis: usize) -> Judged {
        let by_order = self.limits.unwrap_or(AxisLimits::DEFAULT.by_order());
        let limit = by_order[order][axis];
        let mut judged = Judged {
            reached: 0.0,
            tick: 0,
            reached_s: self.period_s,
            base_s: self.period_s,
            verdict: Verdict::Unknown,
        };
        // The time in which the derivative below reaches its limit.
        let longest_s = match order {
            0 => SPEED_SHARE * limit / by_order[1][axis],
            _ => STEP_SHARE * by_order[order - 1][axis] / limit,
        };
        let permitted = (1.0 + TOLERANCES[order]) * limit;
        let mut found = false;
        for base in &self.bases {
            #[allow(clippy::cast_precision_loss, reason = "small")]
            let base_s = base.periods as f64 * self.period_s;
            let error = error(order, base_s);
            let largest = base.largest[order][axis];
            #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
            let value = largest.nm as f64 * MM_PER_NM / power(base_s, order);
            if value - error > judged.reached {
                (judged.reached, judged.tick, judged.reached_s) = (value - error, largest.tick, base_s);
            }
            // Nothing shorter than a period is emitted, so one period is never too long.
            let short = base.periods == 1 || base_s <= longest_s;
            let exact = error <= ERROR_SHARE * limit;
            if !found && exact {
                (judged.base_s, found) = (base_s, true);
                if short {
                    judged.verdict = Verdict::Met;
                }
            }
            if short && value + error <= permitted {
                judged.verdict = Verdict::Met;
            }
        }
        if judged.reached > permitted {
            judged.verdict = Verdict::Violated;
        }
        if self.limits.is_none() {
            judged.verdict = Verdict::Met;
        }
        judged
    }
}

/// The verdict on one axis.
struct Judged {
    /// Largest magnitude that is surely reached, and its tick.
    reached: f64,
    tick: u64,
    /// The base over which it is reached.
    reached_s: f64,
    /// The shortest base with a small enough error; a period where there is none.
    base_s: f64,
    verdict: Verdict,
}

/// A base to the power of its order: 1, 2 or 3.
fn power(base_s: f64, order: usize) -> f64 {
    base_s.powi([1, 2, 3][order])
}

/// Error of a difference over a base by the positions' errors: mm/s, mm/s^2, mm/s^3.
fn error(order: usize, base_s: f64) -> f64 {
    COEFFICIENTS[order] * POSITION_NM * MM_PER_NM / power(base_s, order)
}

/// Base over which the error is small enough for a limit, s.
fn required_s(order: usize, limit: f64) -> f64 {
    let exponent = [1.0, 0.5, 1.0 / 3.0][order];
    (error(order, 1.0) / (ERROR_SHARE * limit)).powf(exponent)
}

/// One sentence per limit that is exceeded by more than its tolerance, or of which the positions do not tell.
#[must_use]
pub fn failures(peaks: &Peaks) -> Vec<String> {
    let sentences = peaks
        .iter()
        .enumerate()
        .filter_map(|(order, peak)| failure(order, peak));
    sentences.collect()
}

/// The sentence for one of the [`ORDERS`].
pub(crate) fn failure(order: usize, peak: &Peak) -> Option<String> {
    let (name, unit) = ORDERS[order];
    let axis = peak.axis;
    let share = peak.share.unwrap_or(0.0);
    match peak.verdict {
        Verdict::Met => None,
        Verdict::Violated => Some(format!(
            "{} uses {share:.3} of its {name} limit ({:.1} {unit}) at tick {}: lower the feed",
            AXES[axis], peak.axes[axis], peak.ticks[axis]
        )),
        Verdict::Unknown => Some(format!(
            "cannot tell whether {} keeps its {name} limit: over the {:.3} ms that positions known to {POSITION_NM} nm need, a break of the \
             limit averages out; at least {share:.3} of it is used",
            AXES[axis],
            1e3 * peak.base_s
        )),
    }
}

#[cfg(test)]
mod tests;
