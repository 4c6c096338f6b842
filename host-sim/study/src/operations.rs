//! Operations of a sample (steps 2 to 4) in the paper's Table 1. Ours are counted by `cycles::operations`.

use cycles::golden;
use cycles::operations::Operations;

/// A row of the paper's Table 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PaperRow {
    /// Name of the surface in [`cycles::SURFACES`].
    pub surface: &'static str,
    /// Operations but for the sines.
    pub operations: Operations,
    /// Sines and cosines. Ours are polynomials, so that their operations are additions and multiplications.
    pub sines: u32,
}

/// The paper's Table 1. It has no row for a ruled surface.
pub const PAPER: [PaperRow; 3] = [
    PaperRow {
        surface: "revolved along u",
        operations: Operations::new(39, 52, 8, 4),
        sines: 0,
    },
    PaperRow {
        surface: "revolved along v",
        operations: Operations::new(21, 40, 8, 4),
        sines: 2,
    },
    PaperRow {
        surface: "bicubic",
        operations: Operations::new(75, 92, 9, 4),
        sines: 0,
    },
];

/// The paper's row of a kind of surface.
#[must_use]
pub fn of_paper(surface: &str) -> Option<PaperRow> {
    PAPER.into_iter().find(|row| row.surface == surface)
}

/// Our operations in the order of [`PAPER`], from a text of the golden table of `budget`.
#[must_use]
pub fn in_table(table: &str) -> Option<[Operations; 3]> {
    let [u, v, bicubic] = PAPER.map(|row| golden::operations(table, row.surface));
    Some([u?, v?, bicubic?])
}
