//! Patches that are not much longer than wide: all coordinates of one have the same unit on the board, so that a narrow patch has few digits across.

use super::spline::{Axis, Pole, SplineSurface, insert, transposed};

/// Most that a patch may be longer than wide: at 225 the normal on a rational one was 3e-6 rad off.
const ASPECT_MAX: f64 = 64.0;
/// Most patches that are made: the board's store holds fewer, and a sliver would need millions.
const PATCHES_MAX: usize = 512;
/// Places of a patch, along and across, at which it is measured.
const SHARES: [f64; 3] = [0.02, 0.5, 0.98];

/// The surface with further knots, so that no patch is much longer than wide; `None` where no patch is, or where that would take more than [`PATCHES_MAX`] patches.
#[must_use]
pub(super) fn with_even_patches(spline: &SplineSurface) -> Option<SplineSurface> {
    let knots = [dividing(spline, 0)?, dividing(spline, 1)?];
    let spans = |k: usize| spline.axes[k].breaks().len() - 1 + knots[k].len();
    if knots.iter().all(Vec::is_empty) || spans(0) * spans(1) > PATCHES_MAX {
        return None;
    }
    let (axis_u, rows) = divided(&spline.axes[0], &spline.poles, &knots[0]);
    let (axis_v, columns) = divided(&spline.axes[1], &transposed(&rows), &knots[1]);
    Some(SplineSurface {
        axes: [axis_u, axis_v],
        poles: transposed(&columns),
    })
}

fn divided(axis: &Axis, rows: &[Vec<Pole>], knots: &[f64]) -> (Axis, Vec<Vec<Pole>>) {
    let (mut axis, mut rows) = (axis.clone(), rows.to_vec());
    for knot in knots {
        insert(&mut axis, &mut rows, *knot);
    }
    (axis, rows)
}

/// Knots that divide the patches that are too long along one parameter; `None` if there are too many.
fn dividing(spline: &SplineSurface, k: usize) -> Option<Vec<f64>> {
    let (along, across) = (spline.axes[k].breaks(), spline.axes[1 - k].breaks());
    let mut knots = Vec::new();
    for span in along.windows(2) {
        let aspect = across
            .windows(2)
            .map(|other| aspect(spline, k, [[span[0], span[1]], [other[0], other[1]]]))
            .fold(1.0, f64::max);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive; the cast saturates"
        )]
        let parts = (aspect / ASPECT_MAX).ceil() as usize;
        if parts > PATCHES_MAX {
            return None;
        }
        knots.extend((1..parts).map(|part| span[0] + (span[1] - span[0]) * part as f64 / parts as f64));
    }
    Some(knots)
}

/// How much longer along parameter k than wide a patch is, where it is widest.
fn aspect(spline: &SplineSurface, k: usize, [along, across]: [[f64; 2]; 2]) -> f64 {
    let (mut length, mut width) = (0.0_f64, 0.0_f64);
    for s in SHARES {
        for t in SHARES {
            let [a, b] = [(along, s), (across, t)].map(|([low, high], share)| low + share * (high - low));
            let at = if k == 0 { spline.at(a, b) } else { spline.at(b, a) };
            let [long, wide] = if k == 0 { [at.u, at.v] } else { [at.v, at.u] };
            length = length.max(long.length() * (along[1] - along[0]));
            width = width.max(wide.length() * (across[1] - across[0]));
        }
    }
    if width > 0.0 { length / width } else { 1.0 }
}
