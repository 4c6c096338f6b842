//! Patches of about the same length along and across.

use super::*;
use crate::aspect::with_even_patches;

#[test]
fn narrow_patches_are_divided_along() {
    let wide = wavy(3, 2);
    let wide = wide.cut(wide.domain());
    assert_eq!(with_even_patches(&wide), None, "nothing to divide");
    let mut narrow = wide.clone();
    for (i, row) in narrow.poles.iter_mut().enumerate() {
        for (j, pole) in row.iter_mut().enumerate() {
            let (x, y) = (7.0 * i as f64, 0.005 * j as f64);
            *pole = [x, y, (0.2 * x).cos(), 1.0].map(|c| c * pole[3]);
        }
    }
    for flipped in [false, true] {
        let surface = if flipped {
            SplineSurface {
                axes: [narrow.axes[1].clone(), narrow.axes[0].clone()],
                poles: crate::spline::transposed(&narrow.poles),
            }
        } else {
            narrow.clone()
        };
        let even = with_even_patches(&surface).unwrap();
        assert!(even.patches() > surface.patches());
        for (s, t) in [(0.1, 0.2), (0.5, 0.7), (0.83, 0.99)] {
            let [[u0, u1], [v0, v1]] = surface.domain();
            let (u, v) = (u0 + s * (u1 - u0), v0 + t * (v1 - v0));
            near(
                surface.at(u, v).point,
                even.at(u, v).point,
                1e-9,
                "the same surface",
            );
        }
    }
}

/// A face without a width is not divided into as many patches as there is memory for.
#[test]
fn slivers_are_left_as_they_are() {
    let wide = wavy(3, 2);
    for width in [1e-4, 1e-9, 1e-300, 0.0] {
        let mut sliver = wide.cut(wide.domain());
        for (i, row) in sliver.poles.iter_mut().enumerate() {
            for (j, pole) in row.iter_mut().enumerate() {
                *pole = [7.0 * i as f64, width * j as f64, 0.0, 1.0];
            }
        }
        assert_eq!(with_even_patches(&sliver), None, "{width}");
    }
}
