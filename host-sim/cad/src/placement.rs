//! Where a part stands: an affine map, rigid but for a scale.

use super::spline::Pole;
use oracle::vector::{Vector, cross, dot, length};
use serde::{Deserialize, Serialize};

/// How far a placement's matrix may be from a rotation times a scale, relative: the rounding of files.
const SIMILARITY_SLACK: f64 = 1e-6;

/// `rows` times a point, the last column added. mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Three rows of the matrix and the translation, mm.
    pub rows: [[f64; 4]; 3],
}

impl Placement {
    /// Where it is.
    pub const IDENTITY: Self = Self {
        rows: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    };

    /// `self` after `inner`.
    #[must_use]
    pub fn after(&self, inner: &Self) -> Self {
        let rows = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let moved = if j == 3 { self.rows[i][3] } else { 0.0 };
                (0..3).map(|k| self.rows[i][k] * inner.rows[k][j]).sum::<f64>() + moved
            })
        });
        Self { rows }
    }

    /// A point, placed.
    #[must_use]
    pub fn point(&self, p: Vector) -> Vector {
        self.rows
            .map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3])
    }

    /// A vector, turned and scaled.
    #[must_use]
    pub fn vector(&self, p: Vector) -> Vector {
        self.rows.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2])
    }

    /// A homogeneous point, placed.
    #[must_use]
    pub fn pole(&self, p: Pole) -> Pole {
        let [x, y, z] = self
            .rows
            .map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3] * p[3]);
        [x, y, z, p[3]]
    }

    fn column(&self, k: usize) -> Vector {
        self.rows.map(|row| row[k])
    }

    /// Whether it mirrors.
    #[must_use]
    pub fn mirrors(&self) -> bool {
        dot(cross(self.column(0), self.column(1)), self.column(2)) < 0.0
    }

    /// The scale, if the map is a rotation or reflection, a scale and a move.
    #[must_use]
    pub fn similarity(&self) -> Option<f64> {
        let columns: [Vector; 3] = std::array::from_fn(|k| self.column(k));
        let size = length(columns[0]);
        let slack = SIMILARITY_SLACK * size;
        let even = columns.iter().all(|c| (length(*c) - size).abs() <= slack);
        let square = (0..3).all(|k| dot(columns[k], columns[(k + 1) % 3]).abs() <= slack * size);
        (size > 0.0 && size.is_finite() && even && square).then_some(size)
    }
}
