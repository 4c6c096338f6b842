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
/// The same for the velocity, which no step precedes: within the acceleration limit the velocity's average is within 5 % of the velocity.
const SPEED_SHARE: f64 = 0.2;
/// The longest base is this many times the longest judged one, at most this many periods.
const LADDER_ABOVE: usize = 4;
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
                (judged.reached, judged.tick) = (value - error, largest.tick);
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
    let mut sentences = Vec::new();
    for (peak, (name, unit)) in peaks.iter().zip(ORDERS) {
        let axis = peak.axis;
        let share = peak.share.unwrap_or(0.0);
        match peak.verdict {
            Verdict::Met => {}
            Verdict::Violated => sentences.push(format!(
                "{} uses {share:.3} of its {name} limit ({:.1} {unit}) at tick {}",
                AXES[axis], peak.axes[axis], peak.ticks[axis]
            )),
            Verdict::Unknown => sentences.push(format!(
                "cannot tell whether {} keeps its {name} limit: over the {:.3} ms that positions known to {POSITION_NM} nm need, a break of the \
                 limit averages out; at least {share:.3} of it is used",
                AXES[axis],
                1e3 * peak.base_s
            )),
        }
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::*;
    use job::AxisLimits;

    fn machine(velocity: f64, acceleration: f64, jerk: f64) -> MachineSpec {
        MachineSpec {
            limits: Some(AxisLimits {
                velocity_mm_s: [velocity; 3],
                acceleration_mm_s2: [acceleration; 3],
                jerk_mm_s3: [jerk; 3],
            }),
            ..MachineSpec::default()
        }
    }

    fn nm(mm: f64) -> i32 {
        (mm * 1e6).round() as i32
    }

    fn near(ours: f64, exact: f64, by: f64) {
        assert!((ours - exact).abs() <= by, "{ours} for {exact}");
    }

    /// Piecewise constant jerk: duration, s, and jerk, mm/s^3.
    type Profile = Vec<(f64, f64)>;

    /// From rest to a speed and back to rest at these peaks.
    fn to_and_fro(speed: f64, acceleration: f64, jerk: f64) -> Profile {
        let rise = (acceleration / jerk).min((speed / jerk).sqrt());
        let hold = (speed / (jerk * rise) - rise).max(0.0);
        let ramp = |sign: f64| [(rise, sign * jerk), (hold, 0.0), (rise, -sign * jerk)];
        let cruise = [(0.05, 0.0)];
        [&ramp(1.0)[..], &cruise, &ramp(-1.0)].concat()
    }

    /// Position at a time, with a step of the acceleration and of the velocity at a time of their own.
    fn position(profile: &[(f64, f64)], steps: [f64; 2], step_at: f64, t: f64) -> f64 {
        let (mut x, mut v, mut a, mut at) = (0.0, 0.0, 0.0, 0.0);
        for (duration, jerk) in profile {
            let d = (t - at).clamp(0.0, *duration);
            x += v * d + a * d * d / 2.0 + jerk * d * d * d / 6.0;
            v += a * d + jerk * d * d / 2.0;
            a += jerk * d;
            at += duration;
        }
        x += v * (t - at).max(0.0);
        let since = (t - step_at).max(0.0);
        x + steps[0] * since * since / 2.0 + steps[1] * since
    }

    /// The peaks of a motion on x. `noise`: error of each position, nm, by its tick.
    fn peaks_of(
        machine: &MachineSpec,
        position: impl Fn(f64) -> f64,
        end_s: f64,
        noise: impl Fn(u32) -> f64,
    ) -> Peaks {
        let mut meter = PeakMeter::new(machine);
        meter.start_at_rest([0; 3]);
        let ticks = (end_s / machine.period_s()) as u32;
        for tick in 1..=ticks {
            let x = 1e6 * position(f64::from(tick) * machine.period_s()) + noise(tick);
            meter.add(tick.into(), [x.round() as i32, 0, 0]);
        }
        meter.peaks()
    }

    /// The worst case of 9.5 nm for a difference of order 3: alternating. And random.
    fn noises(seed: u64) -> [Box<dyn Fn(u32) -> f64>; 3] {
        let random = move |tick: u32| {
            let mut bits = seed ^ u64::from(tick).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            bits ^= bits >> 29;
            bits = bits.wrapping_mul(0xBF58_476D_1CE4_E5B9);
            bits ^= bits >> 32;
            (bits % 19_001) as f64 / 1000.0 - 9.5
        };
        [
            Box::new(|_| 0.0),
            Box::new(|tick| if tick % 2 == 0 { 9.5 } else { -9.5 }),
            Box::new(random),
        ]
    }

    /// Jerk limits of ordinary machines, at ordinary accelerations and feeds, at three periods.
    fn cases() -> Vec<(MachineSpec, [f64; 3])> {
        let mut cases = Vec::new();
        for jerk in [1000.0, 2000.0, 5000.0, 20_000.0, 80_000.0] {
            for acceleration in [300.0, 1000.0, 3000.0] {
                for period_us in [250.0, 1000.0, 2000.0] {
                    let spec = MachineSpec {
                        period_us,
                        ..machine(100.0, acceleration, jerk)
                    };
                    cases.push((spec, [100.0, acceleration, jerk]));
                }
            }
        }
        cases
    }

    #[test]
    fn a_motion_at_its_limits_is_never_blamed() {
        for (seed, (spec, [velocity, acceleration, jerk])) in (1_u64..).zip(cases()) {
            let profile = to_and_fro(velocity, acceleration, jerk);
            let end: f64 = profile.iter().map(|(duration, _)| duration).sum();
            for noise in noises(seed) {
                let peaks = peaks_of(&spec, |t| position(&profile, [0.0; 2], 0.0, t), end + 0.1, noise);
                for (peak, (name, _)) in peaks.iter().zip(ORDERS) {
                    let share = peak.share.unwrap();
                    assert!(share <= 1.0 + 1e-9, "{name} {share} at {jerk} {acceleration}");
                    assert_ne!(peak.verdict, Verdict::Violated);
                }
                // The velocity is reached for 50 ms, longer than every base.
                assert!(peaks[0].share.unwrap() > 0.99, "{:?}", peaks[0]);
                let told = peaks[2].verdict == Verdict::Met;
                // The jerk has a verdict unless the acceleration's ramp is shorter than the base that the noise needs.
                assert!(
                    told || acceleration / jerk < 0.012,
                    "{jerk} {acceleration} {peaks:?}"
                );
                assert!(peaks[2].uncertainty <= ERROR_SHARE || !told);
            }
        }
    }

    #[test]
    fn a_motion_above_its_limits_is_found() {
        for (seed, (spec, [velocity, acceleration, jerk])) in (1_u64..).zip(cases()) {
            for (order, by) in [(0, 1.03), (1, 1.08), (2, 1.15)] {
                let mut at = [velocity, acceleration, jerk];
                at[order] *= by;
                if order == 2 && acceleration / jerk < 0.02 {
                    continue; // Too short for the jerk's base, see above.
                }
                if order == 1 && acceleration * acceleration / jerk > 0.9 * velocity {
                    continue; // The acceleration is not reached.
                }
                let profile = to_and_fro(at[0], at[1], at[2]);
                let reached = profile[0].0 * profile[0].1;
                assert!(order != 1 || reached > acceleration, "{reached}");
                let end: f64 = profile.iter().map(|(duration, _)| duration).sum();
                for noise in noises(seed) {
                    let peaks = peaks_of(&spec, |t| position(&profile, [0.0; 2], 0.0, t), end + 0.1, noise);
                    assert_eq!(
                        peaks[order].verdict,
                        Verdict::Violated,
                        "{order}: {at:?} {peaks:?}"
                    );
                    let sentence = &failures(&peaks)[0];
                    assert!(sentence.starts_with("x uses 1."), "{sentence}");
                }
            }
        }
    }

    /// Breaks without a ramp, in the middle of a motion within its limits.
    #[test]
    fn breaks_are_found_and_where_they_are() {
        for (seed, (spec, [velocity, acceleration, jerk])) in (1_u64..).zip(cases()) {
            let base_s = required_s(2, jerk).max(spec.period_s());
            if base_s > STEP_SHARE * acceleration / jerk {
                continue;
            }
            let profile = to_and_fro(0.6 * velocity, 0.5 * acceleration, 0.5 * jerk);
            let step_at = 0.0301;
            // A step of the acceleration that the judged base resolves (bases are up to 1.5 times the one required, in whole periods); a
            // step of the velocity that takes more than the acceleration limit within a period.
            let step = (2.0 * jerk * (1.5 * base_s + spec.period_s())).min(acceleration);
            let speed_step = 1.3 * acceleration * (1.5 * required_s(1, acceleration) + spec.period_s());
            for steps in [[step, 0.0], [0.0, speed_step]] {
                for noise in noises(seed) {
                    let peaks = peaks_of(
                        &spec,
                        |t| position(&profile, steps, step_at, t),
                        step_at + 0.02,
                        noise,
                    );
                    let order = if steps[0] > 0.0 { 2 } else { 1 };
                    assert_eq!(
                        peaks[order].verdict,
                        Verdict::Violated,
                        "{spec:?} {steps:?} {peaks:?}"
                    );
                    let found_s = peaks[order].ticks[0] as f64 * spec.period_s();
                    assert!(found_s >= step_at && found_s <= step_at + 0.02, "{found_s}");
                }
            }
        }
    }

    #[test]
    fn where_no_base_can_it_says_so() {
        // The acceleration is reached within 1 ms: a base of 3 ms, as the jerk's 5 % require, sees nothing of it.
        let spec = machine(100.0, 100.0, 100_000.0);
        let shaken = |t: f64| 0.02 * (1.0 - (t * 60.0).cos());
        let peaks = peaks_of(&spec, shaken, 0.5, |tick| if tick % 2 == 0 { 9.0 } else { -9.0 });
        assert_eq!(peaks[2].verdict, Verdict::Unknown, "{peaks:?}");
        let told = failures(&peaks).join("; ");
        assert!(
            told.contains("cannot tell whether x keeps its jerk limit"),
            "{told}"
        );
        // At rest nothing is above anything, whatever the base.
        assert_eq!(peaks_of(&spec, |_| 0.0, 0.5, |_| 0.0)[2].verdict, Verdict::Met);
        // A velocity step is a violation on any base.
        let broken = peaks_of(&spec, |t| 5.0 * (t - 0.1).max(0.0), 0.2, |_| 0.0);
        assert_eq!(broken[2].verdict, Verdict::Violated);
        assert_eq!(broken[1].verdict, Verdict::Violated);
    }

    #[test]
    fn rest_has_no_peaks() {
        let mut gauge = PeakMeter::new(&machine(1.0, 1.0, 1.0));
        gauge.start_at_rest([5, 5, 5]);
        for tick in 0..100_u64 {
            let up = if tick % 2 == 0 { 9 } else { -9 };
            gauge.add(tick, [5 + up, 5, 5]);
        }
        gauge.end_at_rest();
        for peak in gauge.peaks() {
            assert_eq!(peak.share, Some(0.0));
        }
    }

    /// A step of velocity v is an acceleration of v / T and a jerk of v / T^2 in one period.
    #[test]
    fn a_start_without_a_ramp_counts_only_from_standstill() {
        let run = |from_standstill: bool| {
            let mut gauge = PeakMeter::new(&machine(20.0, 1000.0, 20_000.0));
            if from_standstill {
                gauge.start_at_rest([0; 3]);
            }
            for tick in 1..50_i32 {
                gauge.add(tick as u64, [0, 10_000 * tick, 0]);
            }
            gauge
        };
        let mut gauge = run(false);
        near(gauge.peaks()[0].share.unwrap(), 0.5, 1e-3);
        assert_eq!(gauge.peaks()[1].share, Some(0.0));
        // A stop from full speed.
        gauge.end_at_rest();
        near(gauge.peaks()[1].axes[1], 1e4 - 40.0, 1e-6);
        near(gauge.peaks()[2].axes[1], 1e7 - 80_000.0, 1e-3);
        assert_eq!(failures(&gauge.peaks()).len(), 2);
        let gauge = run(true);
        near(gauge.peaks()[2].share.unwrap(), (1e7 - 80_000.0) / 2e4, 1e-6);
        assert_eq!((gauge.peaks()[1].axis, gauge.peaks()[1].ticks[1]), (1, 1));
        let mut apart = run(false);
        apart.discontinuity();
        apart.add(60, [1_000_000, 0, 0]);
        apart.add(61, [1_010_000, 0, 0]);
        near(apart.peaks()[0].share.unwrap(), 0.5, 1e-3);
    }

    /// A circle of radius R at speed v: v, v^2 / R, v^3 / R^2 on each of its axes.
    #[test]
    fn a_circle_has_its_exact_peaks() {
        let (radius, speed) = (25.0, 90.0);
        let mut gauge = PeakMeter::new(&machine(100.0, 500.0, 4000.0));
        for tick in 0..4000_u32 {
            let angle = f64::from(tick) * 1e-3 * speed / radius;
            gauge.add(
                tick.into(),
                [0, nm(radius * angle.cos()), nm(radius * angle.sin())],
            );
        }
        let [velocity, acceleration, jerk] = gauge.peaks();
        near(velocity.axes[2], speed, 0.05);
        near(acceleration.axes[1], 324.0, 0.5);
        // 8 ms are the base of 4000 mm/s^3, 12 and 16 ms the next ones.
        near(jerk.axes[1], speed.powi(3) / radius.powi(2), 0.03 * 1166.0);
        assert!(failures(&gauge.peaks()).is_empty());
        assert!(velocity.axes[0] == 0.0 && velocity.share.unwrap() < 0.91);
    }

    #[test]
    fn without_limits_peaks_have_no_share() {
        let mut gauge = PeakMeter::new(&MachineSpec::default());
        for tick in 0..10_i32 {
            gauge.add(tick as u64, [3000 * tick, -8000 * tick, 0]);
        }
        let velocity = gauge.peaks()[0];
        near(velocity.axes[1], 8.0, 0.021);
        assert_eq!((velocity.axis, velocity.share), (1, None));
        assert!(failures(&gauge.peaks()).is_empty());
    }
}
