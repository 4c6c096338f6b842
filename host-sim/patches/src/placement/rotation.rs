//! Rotations about the fixed axes.

/// A rotation matrix, by rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation(pub [[f64; 3]; 3]);

impl Rotation {
    /// The identity.
    pub const IDENTITY: Self = Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);

    /// Rotates about x, then y, then z; the axes are fixed, and a positive angle is anticlockwise seen from the positive end of the axis.
    /// Multiples of 90 degrees are exact.
    #[must_use]
    pub fn of_degrees([x, y, z]: [f64; 3]) -> Self {
        let ((sx, cx), (sy, cy), (sz, cz)) = (sine_cosine(x), sine_cosine(y), sine_cosine(z));
        let about_x = Self([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]]);
        let about_y = Self([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]]);
        let about_z = Self([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]]);
        about_z.after(about_y).after(about_x)
    }

    /// The rotation `first`, followed by this one.
    fn after(self, first: Self) -> Self {
        Self(
            self.0
                .map(|row| std::array::from_fn(|j| (0..3).map(|k| row[k] * first.0[k][j]).sum())),
        )
    }

    /// The angle of a rotation about z, rad; `None` for a rotation that moves the z axis.
    pub(super) fn about_z_rad(self) -> Option<f64> {
        let [[cosine, _, xz], [sine, _, yz], last] = self.0;
        (last == [0.0, 0.0, 1.0] && xz == 0.0 && yz == 0.0).then(|| sine.atan2(cosine))
    }
}

/// Sine and cosine of an angle in degrees: the nearest quarter turn, which is exact, plus the remainder.
fn sine_cosine(degrees: f64) -> (f64, f64) {
    let turned = degrees.rem_euclid(360.0);
    let quarter = (turned / 90.0).round();
    let (sine, cosine) = (turned - 90.0 * quarter).to_radians().sin_cos();
    if quarter == 1.0 {
        (cosine, -sine)
    } else if quarter == 2.0 {
        (-sine, -cosine)
    } else if quarter == 3.0 {
        (-cosine, sine)
    } else {
        (sine, cosine)
    }
}
