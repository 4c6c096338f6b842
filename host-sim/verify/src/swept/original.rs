//! Deviation of the surface from its original.

use rayon::prelude::*;

use super::Requirements;
use super::grid::CellGrid;
use oracle::Oracle;

/// Deviation of a surface from the original that it approximates, at the middles of all cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OriginalDeviation {
    /// Largest distance of the original above the surface, towards the tool, mm: so deep the ball cuts into the original.
    pub above_mm: f64,
    /// Largest distance of the original below the surface, mm.
    pub below_mm: f64,
    /// Permitted distance, mm.
    pub tolerance_mm: f64,
    /// The highest ridge from the surface itself, mm.
    pub over_surface_mm: f64,
}

impl OriginalDeviation {
    pub(super) fn new(
        oracle: &Oracle,
        grid: &CellGrid,
        requirements: &Requirements<'_>,
        over_surface_mm: f64,
    ) -> Option<Self> {
        let original = requirements.original.as_ref()?;
        let [below, above] = (0..grid.count())
            .into_par_iter()
            .map(|index| {
                let (u, v) = grid.cell(index).middle();
                let off = oracle.normal_sign * (original.offset_mm)(u, v);
                // Without a normal there is no side.
                if off.is_nan() { [0.0; 2] } else { [-off, off] }
            })
            .reduce(|| [0.0; 2], |a, b| [a[0].max(b[0]), a[1].max(b[1])]);
        Some(Self {
            above_mm: above,
            below_mm: below,
            tolerance_mm: original.tolerance_mm,
            over_surface_mm,
        })
    }

    /// A sentence if the surface deviates by more than is permitted.
    pub(super) fn failure(&self) -> Option<String> {
        let most_mm = self.above_mm.max(self.below_mm);
        // The tolerance was kept at other points.
        (most_mm > SLACK * self.tolerance_mm).then(|| {
            format!(
                "the surface deviates by {most_mm:.6} mm from the CAD face, more than its tolerance of {} mm: import the face again",
                self.tolerance_mm
            )
        })
    }
}

/// Permitted excess over the tolerance, which was measured on another grid.
const SLACK: f64 = 1.05;
