//! Corners of a B-spline surface that are too small for an edge: where its pieces meet at an angle of less than 0.06 degrees, the poles between them are moved onto
//! the lines between the poles on either side (P&T 3.2: the derivatives below and above a knot are along those lines).

use super::removal::{apart, mixed};
use super::spline::{Axis, Pole, SplineSurface, transposed};

/// Largest corner that is straightened, rad; a larger one may be meant.
const CORNER_MAX_RAD: f64 = 1e-3;
/// Smallest one, rad: over it the centre of a ball of 10 mm jumps by 5 nm, within a period of 1 ms all of the default jerk limit of the z axis.
const CORNER_MIN_RAD: f64 = 5e-7;

/// The surface without corners that take poles by at most this distance, mm, and how far the poles are moved; `None` where there are no such corners. Lines across
/// keep their directions and lengths of parameters.
#[must_use]
pub(super) fn straightened(spline: &SplineSurface, most_mm: f64) -> Option<(SplineSurface, f64)> {
    let (rows, by_u) = joined(&spline.axes[0], &spline.poles, most_mm);
    let (columns, by_v) = joined(&spline.axes[1], &transposed(&rows), most_mm - by_u);
    let moved_mm = by_u + by_v;
    let straight = SplineSurface {
        axes: spline.axes.clone(),
        poles: transposed(&columns),
    };
    (moved_mm > 0.0).then_some((straight, moved_mm))
}

/// One direction: `rows[i]` belongs to pole i. Of degree 1 neighbours would be moved in turn.
fn joined(axis: &Axis, rows: &[Vec<Pole>], most_mm: f64) -> (Vec<Vec<Pole>>, f64) {
    let mut rows = rows.to_vec();
    let mut moved_mm = 0.0_f64;
    let breaks = axis.breaks();
    for knot in breaks.iter().skip(1).take(breaks.len().saturating_sub(2)) {
        if axis.degree < 2 || axis.multiplicity(*knot) != axis.degree {
            continue;
        }
        let at = axis.knots.partition_point(|other| other < knot) - 1;
        let [below, own, above] = [at - 1, at, at + 1].map(|i| &rows[i]);
        let straight = mixed(above, below, share(below, own, above));
        let by = apart(own, &straight);
        let corner = by * (1.0 / apart(own, below) + 1.0 / apart(own, above));
        if by <= most_mm && (CORNER_MIN_RAD..CORNER_MAX_RAD).contains(&corner) {
            rows[at] = straight;
            moved_mm = moved_mm.max(by);
        }
    }
    (rows, moved_mm)
}

/// Where between two rows of poles another one is nearest to the line, as a share of the way.
fn share(below: &[Pole], own: &[Pole], above: &[Pole]) -> f64 {
    let (mut along, mut whole) = (0.0, 0.0);
    for ((below, own), above) in below.iter().zip(own).zip(above) {
        for k in 0..4 {
            along += (own[k] - below[k]) * (above[k] - below[k]);
            whole += (above[k] - below[k]).powi(2);
        }
    }
    along / whole
}
