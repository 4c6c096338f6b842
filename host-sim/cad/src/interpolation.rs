//! Interpolation of an edge between its points, which are at equal steps of its parameter.

use glam::DVec3;

/// The point at a share of the interval that begins with point `index`: on the cubic through the nearest four points, or on what fewer allow.
#[must_use]
pub(super) fn between(points: &[DVec3], index: usize, share: f64) -> DVec3 {
    let count = points.len().min(4);
    let first = index.saturating_sub(1).min(points.len() - count);
    let near = &points[first..first + count];
    let at = (index - first) as f64 + share;
    let weight = |k: usize| {
        let others = (0..count).filter(|other| *other != k);
        others
            .map(|other| (at - other as f64) / (k as f64 - other as f64))
            .product::<f64>()
    };
    (0..count).map(|k| near[k] * weight(k)).sum()
}

/// Largest distance of the interpolated middles of the intervals from those that are known: `finer` has a point in the middle of each.
#[must_use]
pub fn interpolation_error_mm(points: &[DVec3], finer: &[DVec3]) -> f64 {
    (0..points.len().saturating_sub(1))
        .map(|index| between(points, index, 0.5).distance(finer[2 * index + 1]))
        .fold(0.0, f64::max)
}
