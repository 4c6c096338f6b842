/// A surface as given in the job file. Lengths in mm.
#[derive(Clone, Debug, PartialEq)]
pub enum SurfaceSpec {
    /// A cubic profile turned about z: `(R(u) cos v, R(u) sin v, Z(u))`.
    Revolved {
        /// Coefficients of R(u), mm, highest power first; R is not negative on the range.
        radius_mm: [f64; 4],
        /// Coefficients of Z(u), mm, highest power first.
        height_mm: [f64; 4],
        /// Range of u, ascending.
        u: [f64; 2],
        /// Range of v, rad, ascending, at most one full turn.
        v_rad: [f64; 2],
    },
    /// Straight lines between two cubic space curves: `(1 - v) rail0(u) + v rail1(u)`.
    Ruled {
        /// Coefficients of the rail at v = 0: x, y, z; mm, highest power first.
        rail0_mm: [[f64; 4]; 3],
        /// Coefficients of the rail at v = 1.
        rail1_mm: [[f64; 4]; 3],
        /// Range of u, ascending.
        u: [f64; 2],
        /// Range of v, ascending.
        v: [f64; 2],
    },
    /// One bicubic patch in power form.
    Bicubic {
        /// `[k][i][j]` multiplies `u^(3-i) v^(3-j)` of coordinate k, mm.
        coefficients_mm: [[[f64; 4]; 4]; 3],
        /// Range of u, ascending.
        u: [f64; 2],
        /// Range of v, ascending.
        v: [f64; 2],
    },
    /// A B-spline surface, polynomial or rational, over its whole domain.
    Nurbs(NurbsSpec),
}

/// A B-spline surface of degree p in u and q in v. Its domain is `[knots[p], knots[n]]` with n poles, in u and in v.
#[derive(Clone, Debug, PartialEq)]
pub struct NurbsSpec {
    /// `[p, q]`, each 1 to 3.
    pub degree: [usize; 2],
    /// Knots in u, not descending, number of poles + p + 1 of them. The end knots need not be repeated.
    pub knots_u: Vec<f64>,
    /// Knots in v.
    pub knots_v: Vec<f64>,
    /// `[i][j]` = `[x, y, z, w]`, i along u: a point in mm (not multiplied by w) and its weight, above 0.
    pub poles_mm: Vec<Vec<[f64; 4]>>,
    /// Whether the weights differ. Equal weights are stored as 1.
    pub rational: bool,
}

impl SurfaceSpec {
    /// Ranges of u and v, both ascending.
    #[must_use]
    pub fn domain(&self) -> [[f64; 2]; 2] {
        match self {
            Self::Revolved { u, v_rad, .. } => [*u, *v_rad],
            Self::Ruled { u, v, .. } | Self::Bicubic { u, v, .. } => [*u, *v],
            Self::Nurbs(nurbs) => nurbs.domain(),
        }
    }

    /// The kind's name in job files.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Revolved { .. } => "revolved",
            Self::Ruled { .. } => "ruled",
            Self::Bicubic { .. } => "bicubic",
            Self::Nurbs(_) => "nurbs",
        }
    }
}

impl NurbsSpec {
    /// Ranges of u and v, both ascending.
    #[must_use]
    pub fn domain(&self) -> [[f64; 2]; 2] {
        let range = |knots: &[f64], degree: usize| [knots[degree], knots[knots.len() - 1 - degree]];
        [
            range(&self.knots_u, self.degree[0]),
            range(&self.knots_v, self.degree[1]),
        ]
    }
}
