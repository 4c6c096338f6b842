//! Knots that a surface does not need.

use super::*;
use crate::removal::without_needless_knots;
use crate::spline::{Side, insert, transposed};

/// The same surface with ends and all its inner knots repeated: Bezier patches.
fn in_pieces(surface: &SplineSurface) -> SplineSurface {
    let mut made = surface.cut(surface.domain());
    for k in 0..2 {
        let mut axis = made.axes[k].clone();
        let mut rows = if k == 0 {
            made.poles.clone()
        } else {
            transposed(&made.poles)
        };
        let breaks = axis.breaks();
        for knot in &breaks[1..breaks.len() - 1] {
            while axis.multiplicity(*knot) < axis.degree {
                insert(&mut axis, &mut rows, *knot);
            }
        }
        made.axes[k] = axis;
        made.poles = if k == 0 { rows } else { transposed(&rows) };
    }
    made
}

#[test]
fn inserted_knots_are_removed_and_no_others() {
    for p in 2..=5 {
        for q in [2, 3] {
            let surface = wavy(p, q);
            let surface = surface.cut(surface.domain());
            let pieces = in_pieces(&surface);
            assert!(pieces.poles.len() > surface.poles.len());
            let again = without_needless_knots(&pieces);
            assert_eq!(again.axes, surface.axes, "degrees {p}, {q}");
            for (u, v) in [(0.0, 0.0), (0.35, 0.34), (1.0, 0.7), (1.7, 0.99), (2.2, 1.0)] {
                near(
                    surface.at(u, v).point,
                    again.at(u, v).point,
                    1e-9,
                    "the same surface",
                );
            }
        }
    }
}

#[test]
fn digits_that_a_file_rounds_make_no_crease() {
    let surface = wavy(3, 3);
    let surface = surface.cut(surface.domain());
    let mut rounded = in_pieces(&surface);
    let poles = rounded.poles.iter_mut().flatten();
    poles
        .flat_map(|pole| &mut pole[..3])
        .for_each(|x| *x = (*x * 1e7).round() * 1e-7);
    let mended = without_needless_knots(&rounded);
    assert_eq!(mended.axes, surface.axes);
    let knot = mended.axes[0].breaks()[1];
    let slopes = |of: &SplineSurface| {
        [Side::Below, Side::Above].map(|side| of.at_side([knot, 0.4], [side, Side::Above]).u)
    };
    let [below, above] = slopes(&rounded);
    assert!(below.distance(above) > 1e-8, "the test has a crease");
    let [below, above] = slopes(&mended);
    assert!(below.distance(above) < 1e-12);
    for (u, v) in [(0.1, 0.2), (1.0, 0.7), (1.7, 0.99)] {
        near(
            mended.at(u, v).point,
            rounded.at(u, v).point,
            1e-5,
            "moved by rounding",
        );
    }
}

#[test]
fn a_corner_stays() {
    let mut roof = in_pieces(&wavy(3, 3));
    let knots = roof.axes[0].breaks().len();
    roof.poles[3].iter_mut().for_each(|pole| pole[2] += 1e-3);
    let left = without_needless_knots(&roof);
    assert_eq!(left.axes[0].breaks().len(), knots);
    assert_eq!(left.axes[0].multiplicity(left.axes[0].breaks()[1]), 3);
}
