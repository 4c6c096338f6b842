//! Axis travel of a tool path.

use job::AXES;
use job::MachineSpec;

/// Axis travel of a tool path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisTravel {
    /// Least and largest position of each axis, mm; `None` without samples.
    pub extent_mm: Option<[[f64; 2]; 3]>,
    /// Excess over the travel limits of each axis, below and above, mm: 0 within the travel, or without travel limits.
    pub beyond_mm: [[f64; 2]; 3],
}

impl AxisTravel {
    /// Measures the travel of a tool path from least to greatest positions.
    #[must_use]
    pub fn new(extent_mm: Option<[[f64; 2]; 3]>, machine: &MachineSpec) -> Self {
        let mut beyond_mm = [[0.0; 2]; 3];
        if let (Some(extent), Some(travel)) = (extent_mm, machine.travel_mm) {
            for axis in 0..3 {
                beyond_mm[axis] = [
                    (travel[axis][0] - extent[axis][0]).max(0.0),
                    (extent[axis][1] - travel[axis][1]).max(0.0),
                ];
            }
        }
        Self { extent_mm, beyond_mm }
    }

    /// Whether the path stays within the travel of every axis.
    #[must_use]
    pub fn within_travel(&self) -> bool {
        self.beyond_mm.iter().flatten().all(|beyond| *beyond <= 0.0)
    }

    /// One sentence per axis whose travel is exceeded.
    pub(crate) fn failures(&self, machine: &MachineSpec) -> Vec<String> {
        let (Some(extent), Some(travel)) = (self.extent_mm, machine.travel_mm) else {
            return Vec::new();
        };
        (0..3)
            .filter(|axis| self.beyond_mm[*axis].iter().any(|beyond| *beyond > 0.0))
            .map(|axis| {
                let ([low, high], [least, most]) = (extent[axis], travel[axis]);
                format!(
                    "{} moves from {low:.3} to {high:.3} mm, but machine.travel_mm is {least} to {most} mm: move the part, or correct the travel",
                    AXES[axis]
                )
            })
            .collect()
    }
}
