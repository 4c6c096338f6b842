//! Placement of a part: an affine map.

use super::spline::Pole;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Relative tolerance of a placement's matrix against a rotation times a scale, for rounding in files.
const SIMILARITY_SLACK: f64 = 1e-6;

/// `rows` times a point, the last column added. mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Three rows of the matrix and the translation, mm.
    pub rows: [[f64; 4]; 3],
}

impl Placement {
    /// The identity.
    pub const IDENTITY: Self = Self {
        rows: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    };

    /// Composition: applies `inner`, then `self`.
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

    /// Transforms a point.
    #[must_use]
    pub fn point(&self, p: DVec3) -> DVec3 {
        let coordinate = |[a, b, c, moved]: [f64; 4]| a * p.x + b * p.y + c * p.z + moved;
        self.rows.map(coordinate).into()
    }

    /// Transforms a vector: rotation and scale.
    #[must_use]
    pub fn vector(&self, p: DVec3) -> DVec3 {
        self.rows.map(|[a, b, c, _]| a * p.x + b * p.y + c * p.z).into()
    }

    /// Transforms a homogeneous point.
    #[must_use]
    pub fn pole(&self, p: Pole) -> Pole {
        let [x, y, z] = self
            .rows
            .map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3] * p[3]);
        [x, y, z, p[3]]
    }

    fn column(&self, k: usize) -> DVec3 {
        self.rows.map(|row| row[k]).into()
    }

    /// Whether it contains a reflection.
    #[must_use]
    pub fn mirrors(&self) -> bool {
        self.column(0).cross(self.column(1)).dot(self.column(2)) < 0.0
    }

    /// The scale if the map is a similarity, otherwise `None`.
    #[must_use]
    pub fn similarity(&self) -> Option<f64> {
        let columns: [DVec3; 3] = std::array::from_fn(|k| self.column(k));
        let size = columns[0].length();
        let slack = SIMILARITY_SLACK * size;
        let even = columns.iter().all(|c| (c.length() - size).abs() <= slack);
        let square = (0..3).all(|k| columns[k].dot(columns[(k + 1) % 3]).abs() <= slack * size);
        (size > 0.0 && size.is_finite() && even && square).then_some(size)
    }
}
