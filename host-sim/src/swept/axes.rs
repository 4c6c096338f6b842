//! What the axes have to do for a tool path: how far they travel, and how much of their limits they use.

use super::track::Track;
use crate::job_file::Machine;

const MM_PER_NM: f64 = 1e-6;
/// Names of the axes.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];
/// Largest sum that the rounding of a position to whole nanometres, 1/2 nm each, leaves in a difference of the first, second and
/// third order: half of 1 + 1, 1 + 2 + 1, 1 + 3 + 3 + 1.
const ROUNDING_NM: [f64; 3] = [1.0, 2.0, 4.0];

/// Largest magnitude of a derivative of the emitted positions, on the axis where it uses most of its limit (without limits: where
/// it is largest).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peak {
    /// Magnitude of each axis, mm/s, mm/s^2 or mm/s^3.
    pub axes: [f64; 3],
    /// Tick of each axis' largest one: the last of the samples that it is the difference of.
    pub ticks: [u64; 3],
    /// Share of the limit that the most loaded axis uses, 1 = at the limit; `None` without a limit.
    pub share: Option<f64>,
    /// That axis: 0, 1 or 2.
    pub axis: usize,
    /// Share of the limit that the rounding of positions to nanometres can feign.
    pub rounding_share: f64,
}

/// What the axes have to do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axes {
    /// Least and largest position of each axis, mm; `None` without samples.
    pub extent_mm: Option<[[f64; 2]; 3]>,
    /// By how much the path leaves the travel of each axis, below and above, mm: 0 where it does not, or no travel is given.
    pub beyond_mm: [[f64; 2]; 3],
    /// Velocity, from first differences within passes.
    pub velocity: Peak,
    /// Acceleration, from second differences.
    pub acceleration: Peak,
    /// Jerk, from third differences.
    pub jerk: Peak,
}

impl Axes {
    /// Measures a tool path. Differences are taken within passes: between them, and from and to standstill, the feed jumps. The
    /// last step of a pass, which is cut short by its end, is left out too.
    #[must_use]
    pub fn new(track: &Track, machine: &Machine) -> Self {
        let extent_mm = track.extent_mm();
        let mut beyond_mm = [[0.0; 2]; 3];
        if let (Some(extent), Some(travel)) = (extent_mm, machine.travel_mm) {
            for axis in 0..3 {
                beyond_mm[axis] = [
                    (travel[axis][0] - extent[axis][0]).max(0.0),
                    (extent[axis][1] - travel[axis][1]).max(0.0),
                ];
            }
        }
        let [velocity, acceleration, jerk] = peaks(
            track,
            machine.period_s(),
            [
                machine.velocity_max_mm_s,
                machine.acceleration_max_mm_s2,
                machine.jerk_max_mm_s3,
            ],
        );
        Self {
            extent_mm,
            beyond_mm,
            velocity,
            acceleration,
            jerk,
        }
    }

    /// Whether the path stays within the travel of every axis.
    #[must_use]
    pub fn within_travel(&self) -> bool {
        self.beyond_mm.iter().flatten().all(|beyond| *beyond <= 0.0)
    }

    /// A sentence for each axis that the path leaves.
    pub(super) fn failures(&self, machine: &Machine) -> Vec<String> {
        let (Some(extent), Some(travel)) = (self.extent_mm, machine.travel_mm) else {
            return Vec::new();
        };
        (0..3)
            .filter(|axis| self.beyond_mm[*axis].iter().any(|beyond| *beyond > 0.0))
            .map(|axis| {
                let ([low, high], [least, most]) = (extent[axis], travel[axis]);
                format!(
                    "{} runs from {low:.3} to {high:.3} mm, but machine.travel_mm ends at {least} and {most} mm: move the part or the travel",
                    AXES[axis]
                )
            })
            .collect()
    }
}

/// Largest first, second and third differences of each axis.
fn peaks(track: &Track, period_s: f64, limits: [Option<[f64; 3]>; 3]) -> [Peak; 3] {
    // Exact: nanometres in 64 bits.
    let mut largest = [[(0_i64, 0_u64); 3]; 3];
    for pass in &track.passes {
        let samples = &pass.cl_nm[..pass.cl_nm.len().saturating_sub(1)];
        for axis in 0..3 {
            let mut before: [Option<i64>; 3] = [None; 3];
            for (tick, centre) in (pass.first_tick..).zip(samples) {
                let mut value = i64::from(centre[axis]);
                for (order, last) in before.iter_mut().enumerate() {
                    let Some(was) = last.replace(value) else {
                        break;
                    };
                    value -= was;
                    let most = &mut largest[order][axis];
                    if value.abs() > most.0 {
                        *most = (value.abs(), tick);
                    }
                }
            }
        }
    }
    [0, 1, 2].map(|order| {
        let per = MM_PER_NM / period_s.powi(order + 1);
        let order = order.unsigned_abs() as usize;
        #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
        let axes = largest[order].map(|(nm, _)| nm as f64 * per);
        let limit = limits[order];
        let share = |axis: usize| axes[axis] / limit.map_or(1.0, |limit| limit[axis]);
        let axis = (1..3).fold(
            0,
            |most, axis| if share(axis) > share(most) { axis } else { most },
        );
        Peak {
            axes,
            ticks: largest[order].map(|(_, tick)| tick),
            share: limit.map(|_| share(axis)),
            axis,
            rounding_share: limit.map_or(0.0, |limit| ROUNDING_NM[order] * per / limit[axis]),
        }
    })
}
