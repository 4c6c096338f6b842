//! Operations of a sample (steps 2 to 4) in the terms of the paper's Table 1.

/// Operations in the columns of the paper's Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// Additions and subtractions.
    pub add: u32,
    /// Multiplications.
    pub multiply: u32,
    /// Divisions.
    pub divide: u32,
    /// Square roots.
    pub root: u32,
    /// Sines and cosines. Where they are polynomials, their additions and multiplications are among the others too.
    pub sine: u32,
}

/// The paper's Table 1, by the names of [`cycles::SURFACES`]. It has no row for a ruled surface.
pub const PAPER: [(&str, Operations); 3] = [
    (
        "revolved along u",
        Operations {
            add: 39,
            multiply: 52,
            divide: 8,
            root: 4,
            sine: 0,
        },
    ),
    (
        "revolved along v",
        Operations {
            add: 21,
            multiply: 40,
            divide: 8,
            root: 4,
            sine: 2,
        },
    ),
    (
        "bicubic",
        Operations {
            add: 75,
            multiply: 92,
            divide: 9,
            root: 4,
            sine: 0,
        },
    ),
];

/// The paper's row of a kind of surface.
#[must_use]
pub fn of_paper(surface: &str) -> Option<Operations> {
    PAPER
        .iter()
        .find_map(|(name, row)| (*name == surface).then_some(*row))
}
