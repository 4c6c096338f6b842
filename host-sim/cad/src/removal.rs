//! Removal of knots that a B-spline surface does not need: it is as smooth as its poles make it, to the digits of its file (P&T A5.8).

use super::spline::{Axis, Pole, SplineSurface, transposed};

/// How far all removals along one direction may move the surface, mm: rounding of the file.
const ROUNDING_MM: f64 = 2e-5;

/// The surface without knots, or with fewer of the same, where that moves it by rounding alone. At a knot that is left, a derivative jumps by more than that.
#[must_use]
pub(super) fn without_needless_knots(spline: &SplineSurface) -> SplineSurface {
    let (axis_u, rows) = lowered(&spline.axes[0], &spline.poles);
    let (axis_v, columns) = lowered(&spline.axes[1], &transposed(&rows));
    SplineSurface {
        axes: [axis_u, axis_v],
        poles: transposed(&columns),
    }
}

/// One direction: `rows[i]` belongs to pole i.
fn lowered(axis: &Axis, rows: &[Vec<Pole>]) -> (Axis, Vec<Vec<Pole>>) {
    let (mut axis, mut rows) = (axis.clone(), rows.to_vec());
    // How far the surface was moved where a pole has influence.
    let mut moved = vec![0.0; rows.len()];
    let breaks = axis.breaks();
    for knot in breaks.iter().skip(1).take(breaks.len().saturating_sub(2)) {
        while removed(&mut axis, &mut rows, &mut moved, *knot) {}
    }
    (axis, rows)
}

/// Removes a knot within the domain once, if that is rounding (P&T A5.8 for one removal).
fn removed(axis: &mut Axis, rows: &mut Vec<Vec<Pole>>, moved: &mut Vec<f64>, knot: f64) -> bool {
    let (p, s) = (axis.degree, axis.multiplicity(knot));
    if s == 0 || s > p {
        return false;
    }
    // The last of the equal knots; the poles from `first` to `last` change.
    let r = axis.knots.partition_point(|other| *other <= knot) - 1;
    let (first, last) = (r - p, r - s);
    let share = |i: usize| (knot - axis.knots[i]) / (axis.knots[i + p + 1] - axis.knots[i]);
    let (mut from_below, mut from_above) = (vec![rows[first - 1].clone()], vec![rows[last + 1].clone()]);
    let (mut i, mut j) = (first, last);
    while i < j {
        let (below, above) = (
            &from_below[from_below.len() - 1],
            &from_above[from_above.len() - 1],
        );
        // P_i = share Q_i + (1 - share) Q_(i - 1), solved for the new pole from either side.
        let next = [
            mixed(&rows[i], below, 1.0 / share(i)),
            mixed(&rows[j], above, 1.0 / (1.0 - share(j))),
        ];
        let [below, above] = next;
        from_below.push(below);
        from_above.push(above);
        (i, j) = (i + 1, j - 1);
    }
    let (below, above) = (
        &from_below[from_below.len() - 1],
        &from_above[from_above.len() - 1],
    );
    let by = if i > j {
        apart(below, above)
    } else {
        apart(&rows[i], &mixed(above, below, share(i)))
    };
    let before = moved[first - 1..=last + 1]
        .iter()
        .fold(0.0, |most: f64, by| most.max(*by));
    if before + by > ROUNDING_MM {
        return false;
    }
    if i > j {
        // Both are of one pole: their middle.
        let middle = mixed(below, above, 0.5);
        from_above.pop();
        if let Some(last) = from_below.last_mut() {
            *last = middle;
        }
    }
    let new = from_below[1..]
        .iter()
        .chain(from_above[1..].iter().rev())
        .cloned();
    let new: Vec<Vec<Pole>> = new.collect();
    moved.splice(first..=last, vec![0.0; new.len()]);
    moved[first - 1..=first + new.len()].fill(before + by);
    rows.splice(first..=last, new);
    axis.knots.remove(r);
    true
}

/// `share` of the first row and the rest of the second.
pub(super) fn mixed(first: &[Pole], second: &[Pole], share: f64) -> Vec<Pole> {
    let pole = |(a, b): (&Pole, &Pole)| std::array::from_fn(|k| share * a[k] + (1.0 - share) * b[k]);
    first.iter().zip(second).map(pole).collect()
}

/// How far a curve is moved where one row takes the place of the other, mm, at most.
pub(super) fn apart(first: &[Pole], second: &[Pole]) -> f64 {
    let length = |p: &Pole| p[0].hypot(p[1]).hypot(p[2]);
    let each = first.iter().zip(second).map(|(a, b)| {
        let apart = length(&[a[0] - b[0], a[1] - b[1], a[2] - b[2], 0.0]);
        // By what (w x, w y, w z) does, and by its own distance from the origin times what w does, over w (P&T eqn 5.30).
        let by_weight = (a[3] - b[3]).abs() * length(a) / a[3].abs();
        (apart + by_weight) / a[3].abs().min(b[3].abs())
    });
    // Not a number: too far.
    each.fold(0.0, |most: f64, by| if by <= most { most } else { by })
}
