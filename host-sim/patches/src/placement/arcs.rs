//! A cubic profile revolved about z, as a rational B-spline: cubic along the profile, circular arcs around the axis.

use std::f64::consts::FRAC_PI_2;

use job::NurbsSpec;

/// Rounding allowance before one more arc is added, as a share of a quarter turn.
const QUARTER_TOLERANCE: f64 = 1e-9;

/// The same point set with the same u. v equals the angle at the ends and in the middle of each arc; in between it is the rational
/// parameter of the arc, which differs by at most 0.0161 rad (0.92 degrees).
///
/// An arc covers at most a quarter turn (weights 1, cos(half its angle), 1; P&T section 7.3), so its weights vary by at most a factor of 1.42.
pub(super) fn revolved(
    radius_mm: &[f64; 4],
    height_mm: &[f64; 4],
    u: [f64; 2],
    v_rad: [f64; 2],
) -> NurbsSpec {
    let profile = [bezier(radius_mm, u), bezier(height_mm, u)];
    let [start, end] = v_rad;
    let extent = end - start;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a turn has four quarters"
    )]
    let arcs = ((extent / FRAC_PI_2 - QUARTER_TOLERANCE).ceil() as usize).max(1);
    #[allow(clippy::cast_precision_loss, reason = "a turn has four quarters")]
    let share = |halves: usize| halves as f64 / (2 * arcs) as f64;
    let at = |halves: usize| start * (1.0 - share(halves)) + end * share(halves);
    let weight = (0.5 * (at(2) - at(0))).cos();
    // Poles at every half arc: on the circle, or at the intersection of the tangents.
    let around: Vec<(f64, f64, f64)> = (0..=2 * arcs)
        .map(|half| {
            let (sine, cosine) = at(half).sin_cos();
            if half % 2 == 0 {
                (cosine, sine, 1.0)
            } else {
                (cosine / weight, sine / weight, weight)
            }
        })
        .collect();
    let row = |k: usize| {
        let (radius, height) = (profile[0][k], profile[1][k]);
        around
            .iter()
            .map(|&(x, y, w)| [radius * x, radius * y, height, w])
            .collect()
    };
    let mut knots_v = vec![start];
    for arc in 0..=arcs {
        knots_v.extend([at(2 * arc); 2]);
    }
    knots_v.push(at(2 * arcs));
    NurbsSpec {
        degree: [3, 2],
        knots_u: [[u[0]; 4], [u[1]; 4]].concat(),
        knots_v,
        poles_mm: (0..4).map(row).collect(),
        rational: true,
    }
}

/// Bezier poles of a cubic (highest power first) over a range: its polar form at the range's ends.
fn bezier([c3, c2, c1, c0]: &[f64; 4], [start, end]: [f64; 2]) -> [f64; 4] {
    std::array::from_fn(|k| {
        let at = |i: usize| if i < 3 - k { start } else { end };
        let (a, b, c) = (at(0), at(1), at(2));
        c3 * a * b * c + c2 * (a * b + b * c + c * a) / 3.0 + c1 * (a + b + c) / 3.0 + c0
    })
}
