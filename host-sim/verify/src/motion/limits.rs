//! Use of each axis's velocity, acceleration and jerk limit by an emitted tool path, from finite differences of its positions.
//!
//! A position is rounded to whole nanometres: its error is at most half a nanometre. A difference of the first, second and third
//! order, `x1 - x0`, `x2 - 2 x1 + x0`, `x3 - 3 x2 + 3 x1 - x0`, has an error of at most half the sum of its coefficients: 1, 2
//! and 4 nm. These are subtracted, so a path within its limits is never reported as exceeding them; at a period of 1 ms and a jerk limit
//! of 20 000 mm/s^3 the subtraction is a fifth of the limit.

use job::{AXES, MachineSpec};

/// Names of the derivatives, and their units.
pub const ORDERS: [(&str, &str); 3] = [
    ("velocity", "mm/s"),
    ("acceleration", "mm/s^2"),
    ("jerk", "mm/s^3"),
];
/// Tolerances of the uses above 1: velocity and acceleration 1 %, jerk 5 %.
pub const TOLERANCES: [f64; 3] = [0.01, 0.01, 0.05];
/// Largest rounding error in a difference of each order, nm.
const ROUNDING_NM: [i64; 3] = [1, 2, 4];
const MM_PER_NM: f64 = 1e-6;

/// Largest magnitude of a derivative of the positions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peak {
    /// Largest magnitude on each axis, minus the largest rounding error; mm/s, mm/s^2 or mm/s^3.
    pub axes: [f64; 3],
    /// Tick of each axis' largest magnitude: the last sample of the difference.
    pub ticks: [u64; 3],
    /// The axis with the largest use of its limit (without limits: with the largest magnitude), 0 to 2.
    pub axis: usize,
    /// Use of this axis's limit, 1 = at the limit; `None` without a limit.
    pub share: Option<f64>,
    /// Share of the limit subtracted for rounding, on this axis; 0 without a limit.
    pub rounding_share: f64,
}

/// Largest velocity, acceleration and jerk of a tool path.
pub type Peaks = [Peak; 3];

/// Peaks of the derivatives of positions, one position per period, in the order of ticks. Stores three positions.
#[derive(Clone, Debug)]
pub struct PeakMeter {
    period_s: f64,
    /// Limits of velocity, acceleration and jerk.
    limits: Option<[[f64; 3]; 3]>,
    /// The last position and its differences of first and second order, nm; `None` until enough positions are known.
    last: [Option<[i64; 3]>; 3],
    /// Largest magnitude, nm per period^k, and its tick, for each order and axis.
    largest: [[(i64, u64); 3]; 3],
    tick: u64,
}

impl PeakMeter {
    /// A meter for a machine's limits.
    #[must_use]
    pub fn new(machine: &MachineSpec) -> Self {
        Self {
            period_s: machine.period_s(),
            limits: machine.limits.map(|limits| limits.by_order()),
            last: [None; 3],
            largest: [[(0, 0); 3]; 3],
            tick: 0,
        }
    }

    /// The axes are at rest at a position before the next sample.
    pub fn start_at_rest(&mut self, cl_nm: [i32; 3]) {
        self.last = [Some(cl_nm.map(i64::from)), Some([0; 3]), Some([0; 3])];
    }

    /// Discontinuity: no differences are taken across it.
    pub fn discontinuity(&mut self) {
        self.last = [None; 3];
    }

    /// The position of the next period, nm.
    pub fn add(&mut self, tick: u64, cl_nm: [i32; 3]) {
        self.tick = tick;
        let mut value = cl_nm.map(i64::from);
        for (last, largest) in self.last.iter_mut().zip(&mut self.largest) {
            let Some(before) = last.replace(value) else {
                return;
            };
            for axis in 0..3 {
                value[axis] -= before[axis];
                let magnitude = value[axis].abs();
                if magnitude > largest[axis].0 {
                    largest[axis] = (magnitude, tick);
                }
            }
        }
    }

    /// The axes stop at the last position: the differences of the stop count.
    pub fn end_at_rest(&mut self) {
        if let Some(at) = self.last[0] {
            // In range: the position was converted from an i32.
            #[allow(clippy::cast_possible_truncation, reason = "it was an i32 before")]
            let at = at.map(|nm| nm as i32);
            for _ in 0..3 {
                self.add(self.tick + 1, at);
            }
        }
    }

    /// The peaks so far.
    #[must_use]
    pub fn peaks(&self) -> Peaks {
        std::array::from_fn(|order| self.peak(order))
    }

    fn peak(&self, order: usize) -> Peak {
        let periods = self.period_s.powi([1, 2, 3][order]);
        let per = MM_PER_NM / periods;
        #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
        let axes = self.largest[order].map(|(nm, _)| (nm - ROUNDING_NM[order]).max(0) as f64 * per);
        let limits = self.limits.map(|limits| limits[order]);
        let share = |axis: usize| axes[axis] / limits.map_or(1.0, |limits| limits[axis]);
        let axis = (1..3).fold(
            0,
            |most, axis| if share(axis) > share(most) { axis } else { most },
        );
        #[allow(clippy::cast_precision_loss, reason = "1, 2 or 4")]
        let rounding = ROUNDING_NM[order] as f64 * per;
        Peak {
            axes,
            ticks: self.largest[order].map(|(_, tick)| tick),
            axis,
            share: limits.map(|_| share(axis)),
            rounding_share: limits.map_or(0.0, |limits| rounding / limits[axis]),
        }
    }
}

/// One sentence per limit that is exceeded by more than its tolerance.
#[must_use]
pub fn failures(peaks: &Peaks) -> Vec<String> {
    let mut sentences = Vec::new();
    for ((peak, (name, unit)), tolerance) in peaks.iter().zip(ORDERS).zip(TOLERANCES) {
        if let Some(share) = peak.share.filter(|share| *share > 1.0 + tolerance) {
            let axis = peak.axis;
            sentences.push(format!(
                "{} uses {share:.3} of its {name} limit ({:.1} {unit}) at tick {}",
                AXES[axis], peak.axes[axis], peak.ticks[axis]
            ));
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

    /// x = J t^3 / 6: the third difference is J T^3 exactly, the second J T^2 (t - T).
    #[test]
    fn a_cubic_has_its_exact_peaks() {
        let mut gauge = PeakMeter::new(&machine(100.0, 1000.0, 40_000.0));
        gauge.start_at_rest([nm(-7.0), 0, 0]);
        for tick in 1..=40_u32 {
            let t = f64::from(tick) * 1e-3;
            gauge.add(tick.into(), [nm(-7.0 + 40_000.0 * t.powi(3) / 6.0), 0, 0]);
        }
        let [velocity, acceleration, jerk] = gauge.peaks();
        // Mean velocity of the last period: J T^2 (40^3 - 39^3) / 6, less 1 nm a period.
        near(velocity.axes[0], 0.04 * (64_000.0 - 59_319.0) / 6.0, 0.0021);
        near(acceleration.axes[0], 40_000.0 * 0.039, 4.1);
        assert!(acceleration.share.unwrap() <= 1.56 && acceleration.ticks[0] == 40);
        // Rounding adds up to 4 nm to 40, which are subtracted.
        let share = jerk.share.unwrap();
        assert!((0.8..=1.0).contains(&share), "{share}");
        near(jerk.rounding_share, 0.1, 1e-12);
        assert_eq!((velocity.axis, jerk.axis), (0, 0));
    }

    #[test]
    fn rest_has_no_peaks_and_rounding_is_subtracted() {
        let mut gauge = PeakMeter::new(&machine(1.0, 1.0, 1.0));
        gauge.start_at_rest([5, 5, 5]);
        for tick in 0..100_u64 {
            // The worst case of rounding for a machine at rest at a half nanometre.
            let up = i32::from(tick % 2 == 0);
            gauge.add(tick, [5 + up, 5, 5]);
        }
        gauge.end_at_rest();
        for peak in gauge.peaks() {
            assert_eq!(peak.share, Some(0.0));
        }
        assert!(failures(&gauge.peaks()).is_empty());
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
        near(gauge.peaks()[0].share.unwrap(), 0.5 * 0.9999, 1e-9);
        assert_eq!(gauge.peaks()[1].share, Some(0.0));
        // A stop from full speed.
        gauge.end_at_rest();
        near(gauge.peaks()[1].axes[1], 1e4 - 2.0, 1e-6);
        near(gauge.peaks()[2].axes[1], 1e7 - 4000.0, 1e-3);
        assert_eq!(failures(&gauge.peaks()).len(), 2);
        let gauge = run(true);
        near(gauge.peaks()[2].share.unwrap(), (1e7 - 4000.0) / 2e4, 1e-6);
        assert_eq!((gauge.peaks()[1].axis, gauge.peaks()[1].ticks[1]), (1, 1));
        let mut apart = run(false);
        apart.discontinuity();
        apart.add(60, [1_000_000, 0, 0]);
        apart.add(61, [1_010_000, 0, 0]);
        near(apart.peaks()[0].share.unwrap(), 0.5 * 0.9999, 1e-9);
    }

    /// A circle of radius R at speed v: v, v^2 / R, v^3 / R^2 on each of its axes; periods as short as they come.
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
        near(velocity.axes[2], speed, 0.002);
        near(acceleration.axes[1], 324.0, 4.0);
        let exact = speed.powi(3) / radius.powi(2);
        assert!(jerk.axes[1] <= exact && jerk.axes[1] >= exact - 8000.0);
        assert!(failures(&gauge.peaks()).is_empty());
        assert!(velocity.axes[0] == 0.0 && velocity.share.unwrap() < 0.9);
    }

    #[test]
    fn without_limits_peaks_have_no_share() {
        let mut gauge = PeakMeter::new(&MachineSpec::default());
        for tick in 0..10_i32 {
            gauge.add(tick as u64, [3000 * tick, -8000 * tick, 0]);
        }
        let velocity = gauge.peaks()[0];
        near(velocity.axes[1], 8.0, 0.0011);
        assert_eq!((velocity.axis, velocity.share), (1, None));
        assert!(failures(&gauge.peaks()).is_empty());
    }
}
