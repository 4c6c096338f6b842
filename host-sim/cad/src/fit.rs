//! Approximation of a surface without an exact form by a bicubic B-spline: interpolated at the Greville abscissae of its knots (C. de Boor, "A
//! Practical Guide to Splines", revised ed., chapter XIII), the spans subdivided where the error exceeds the tolerance.

use super::exact::joints;
use super::spline::{Axis, Pole, Side, SplineSurface};
use super::surface::{Periodic, Surface};
use glam::DVec3;
use interp_core::STORE_WORDS;
use interp_core::surface::POLYNOMIAL_WORDS;

/// Nonzero basis functions of a fit at a parameter: it is cubic.
const ORDER: usize = 4;
/// Largest number of spans in one direction: the data of more would not fit a job.
const SPANS_MAX: usize = 310;
/// Most patches that the board's store holds: a fit with more is refused, however near it is.
const PATCHES_MAX: usize = STORE_WORDS / POLYNOMIAL_WORDS;
/// Number of lines across, on which the error in one direction is measured.
const LINES: usize = 17;
/// Interior points per span at which the error on a line is measured.
const PLACES: usize = 6;
/// Interior points per span of the surface, in addition.
const PLACES_A_SPAN: usize = 2;
/// Points per side of a patch at which the deviation of the fit is measured.
const DENSE: usize = 9;
/// Points per side of a patch, a subset of the [`DENSE`] ones, for a fit of more patches than the store holds, whose number is reported only.
const SPARSE: usize = 3;
/// Share of the tolerance for each direction; reduced if both together exceed the tolerance.
const SHARE: f64 = 0.9;
/// Greatest jump of a first derivative that counts as rounding, as a share of the derivative.
const FIRST_JUMP: f64 = 1e-7;
/// Greatest jump of a second derivative times the range that counts as rounding, as a share of the first derivative.
const SECOND_JUMP: f64 = 1e-6;
/// Distance from a joint, as a share of the range, at which the derivatives of its sides are taken.
const BESIDE: f64 = 1e-9;
/// Largest number of reductions.
const ROUNDS: usize = 8;
/// `|S_u x S_v|` below this share of `|S_u| |S_v|`, as at a pole, leaves no normal to compare.
const SINE_MIN: f64 = 1e-6;

/// Deviation of a fit from the original, measured on a grid between the interpolated points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Largest distance at equal parameters, mm: an upper bound of the distance of the surfaces at these points.
    pub max_mm: f64,
    /// Largest angle between the normals, rad.
    pub normal_rad: f64,
    /// Number of measured points.
    pub places: usize,
}

/// Failure of a fit.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum FitError {
    /// The tolerance needs more spans than [`SPANS_MAX`].
    TooManySpans,
    /// This fit is within the tolerance, as far as [`SPARSE`] tells, and has more than [`PATCHES_MAX`].
    TooManyPatches(SplineSurface),
    /// The surface has no point at some parameters.
    NotFinite,
}

/// LU decomposition of the collocation matrix at the Greville abscissae.
struct Collocation {
    axis: Axis,
    places: Vec<f64>,
    /// Rows of L and U in place, and the row permutation.
    factors: Vec<Vec<f64>>,
    order: Vec<usize>,
}

impl Collocation {
    fn new(axis: Axis) -> Self {
        let n = axis.poles();
        let degree = axis.degree;
        let places: Vec<f64> = (0..n)
            .map(|i| axis.knots[i + 1..=i + degree].iter().sum::<f64>() / degree as f64)
            .map(|t| t.clamp(axis.domain()[0], axis.domain()[1]))
            .collect();
        let mut factors = vec![vec![0.0; n]; n];
        for (row, &t) in factors.iter_mut().zip(&places) {
            let (first, basis) = axis.basis::<ORDER>(t, Side::Above);
            row[first..=first + degree].copy_from_slice(&basis[0][..=degree]);
        }
        let order = decompose(&mut factors, degree);
        Self {
            axis,
            places,
            factors,
            order,
        }
    }

    /// Poles of the spline through these points.
    fn solve(&self, points: &[DVec3]) -> Vec<DVec3> {
        let n = points.len();
        let band = 2 * self.axis.degree;
        let mut x: Vec<DVec3> = self.order.iter().map(|row| points[*row]).collect();
        for i in 0..n {
            for j in i.saturating_sub(band)..i {
                let factor = self.factors[i][j];
                if factor != 0.0 {
                    let known = x[j];
                    x[i] -= factor * known;
                }
            }
        }
        for i in (0..n).rev() {
            for j in i + 1..(i + band + 1).min(n) {
                let factor = self.factors[i][j];
                let known = x[j];
                x[i] -= factor * known;
            }
            x[i] /= self.factors[i][i];
        }
        x
    }
}

/// LU decomposition of a band matrix with row exchanges (Golub and Van Loan, "Matrix Computations", 4th ed., 4.3.3).
fn decompose(a: &mut [Vec<f64>], degree: usize) -> Vec<usize> {
    let n = a.len();
    let mut order: Vec<usize> = (0..n).collect();
    for column in 0..n {
        let below = (column + degree + 1).min(n);
        let pivot = (column..below)
            .max_by(|i, j| a[*i][column].abs().total_cmp(&a[*j][column].abs()))
            .unwrap_or(column);
        a.swap(column, pivot);
        order.swap(column, pivot);
        let right = (column + 2 * degree + 1).min(n);
        let (upper, lower) = a.split_at_mut(column + 1);
        let row = &upper[column];
        for target in &mut lower[..below - column - 1] {
            let factor = target[column] / row[column];
            target[column] = factor;
            for k in column + 1..right {
                target[k] -= factor * row[k];
            }
        }
    }
    order
}

/// Cubic knots at these breaks; `order`: order of continuity of the surface at each; 3 and more adds no multiplicity.
fn knots(breaks: &[(f64, usize)]) -> Axis {
    let mut knots = vec![breaks[0].0; 4];
    for (t, order) in &breaks[1..breaks.len() - 1] {
        knots.extend(vec![*t; 3 - (*order).min(2)]);
    }
    knots.extend(vec![breaks[breaks.len() - 1].0; 4]);
    Axis { degree: 3, knots }
}

/// Joints inside the range of a direction with the order of continuity that the surface has there. It may be higher than the knots allow: a circle of
/// four arcs has double knots of degree 2, at which only its second derivative jumps.
fn measured_joints(surface: &Surface, k: usize, ranges: [[f64; 2]; 2]) -> Vec<(f64, usize)> {
    let mut all = joints(surface, k, ranges[k]);
    for (t, order) in &mut all {
        *order = (*order).max(continuity(surface, k, ranges, *t));
    }
    all
}

/// Order of continuity at a joint, 2 at most, from the derivatives on both sides of it on lines across.
fn continuity(surface: &Surface, k: usize, ranges: [[f64; 2]; 2], joint: f64) -> usize {
    let whole = Periodic::new(surface);
    let width = ranges[k][1] - ranges[k][0];
    let derivatives = |t: f64, line: f64| {
        let at = if k == 0 {
            whole.at(t, line)
        } else {
            whole.at(line, t)
        };
        if k == 0 { [at.u, at.uu] } else { [at.v, at.vv] }
    };
    // Second derivatives of an offset are differences across the joint.
    let most = if matches!(surface, Surface::Offset { .. }) {
        1
    } else {
        2
    };
    lines(surface, 1 - k, ranges[1 - k])
        .into_iter()
        .map(|line| {
            let [before, after] = [-BESIDE, BESIDE].map(|by| derivatives(joint + by * width, line));
            let speed = before[0].length();
            let is_tangent = before[0].distance(after[0]) <= FIRST_JUMP * speed;
            let is_curved_alike = before[1].distance(after[1]) * width <= SECOND_JUMP * speed;
            match (is_tangent, is_curved_alike) {
                // A line that is a point says nothing.
                _ if speed == 0.0 => most,
                (true, true) => most,
                (true, false) => 1,
                (false, _) => 0,
            }
        })
        .min()
        .unwrap_or(0)
}

/// Places of the range across, on which a direction is measured: even ones, and the middle of each span of the surface, of which one may have a bump that the others do not show.
fn lines(surface: &Surface, across: usize, range: [f64; 2]) -> Vec<f64> {
    let [low, high] = range;
    let even = (0..LINES).map(|line| low + (high - low) * line as f64 / (LINES - 1) as f64);
    let spans = spans(surface, across, range);
    even.chain(spans.iter().map(|[start, end]| 0.5 * (start + end)))
        .collect()
}

/// Spans of the surface between its own knots within a range.
fn spans(surface: &Surface, k: usize, range: [f64; 2]) -> Vec<[f64; 2]> {
    let inside = joints(surface, k, range).into_iter().map(|(knot, _)| knot);
    let mut ends: Vec<f64> = inside.chain(range).collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    ends.windows(2).map(|span| [span[0], span[1]]).collect()
}

/// Knots of one direction with which the lines in that direction are within the tolerance.
fn direction(
    surface: &Surface,
    k: usize,
    ranges: [[f64; 2]; 2],
    tolerance_mm: f64,
) -> Result<Axis, FitError> {
    let range = ranges[k];
    let mut breaks = vec![(range[0], 0)];
    // A break of continuity C2 or more needs no knot of its own.
    breaks.extend(
        measured_joints(surface, k, ranges)
            .into_iter()
            .filter(|(_, order)| *order < 2),
    );
    breaks.push((range[1], 0));
    // Number of equal parts of each span between joints.
    let mut parts = vec![1_usize; breaks.len() - 1];
    loop {
        if parts.iter().sum::<usize>() > SPANS_MAX {
            return Err(FitError::TooManySpans);
        }
        let collocation = Collocation::new(knots(&divided(&breaks, &parts)));
        let worst = errors(surface, k, ranges, &collocation, &breaks, &parts)?;
        if worst.iter().all(|worst| *worst <= tolerance_mm) {
            return Ok(collocation.axis);
        }
        for (parts, worst) in parts.iter_mut().zip(&worst) {
            if *worst > tolerance_mm {
                // The error of a cubic spline is of order 4 in the width; limits the refinement far from that regime.
                let wanted = (worst / tolerance_mm).powf(0.25).min(2.0) * *parts as f64;
                #[allow(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a few hundred"
                )]
                let wanted = wanted.floor() as usize;
                *parts = wanted.max(*parts + 1);
            }
        }
    }
}

/// Knots of one direction with which the lines in that direction are within the tolerance. Of the surface's own knots only those at which the tangent plane jumps are kept. A span
/// is halved while it is beyond the tolerance. Surfaces of many short pieces that join smoothly need fewer spans than with their own knots.
fn fewest(surface: &Surface, k: usize, ranges: [[f64; 2]; 2], tolerance_mm: f64) -> Result<Axis, FitError> {
    let range = ranges[k];
    let mut breaks = vec![(range[0], 0)];
    breaks.extend(
        measured_joints(surface, k, ranges)
            .into_iter()
            .filter(|(_, order)| *order == 0),
    );
    breaks.push((range[1], 0));
    loop {
        if breaks.len() > SPANS_MAX + 1 {
            return Err(FitError::TooManySpans);
        }
        let collocation = Collocation::new(knots(&breaks));
        let whole = vec![1; breaks.len() - 1];
        let worst = errors(surface, k, ranges, &collocation, &breaks, &whole)?;
        if worst.iter().all(|worst| *worst <= tolerance_mm) {
            return Ok(collocation.axis);
        }
        let parts: Vec<usize> = worst
            .iter()
            .map(|worst| 1 + usize::from(*worst > tolerance_mm))
            .collect();
        breaks = divided(&breaks, &parts);
    }
}

/// The largest error between two breaks each, on lines in that direction: at [`PLACES`] for each of the parts, and at [`PLACES_A_SPAN`] in each span of the surface.
fn errors(
    surface: &Surface,
    k: usize,
    ranges: [[f64; 2]; 2],
    collocation: &Collocation,
    breaks: &[(f64, usize)],
    parts: &[usize],
) -> Result<Vec<f64>, FitError> {
    let whole = Periodic::new(surface);
    let point = |t: f64, line: f64| {
        let (u, v) = if k == 0 { (t, line) } else { (line, t) };
        whole.at(u, v).point
    };
    let evenly = |[start, end]: [f64; 2], count: usize| {
        (0..count).map(move |i| start + (end - start) * (i as f64 + 0.5) / count as f64)
    };
    let of_parts = breaks.windows(2).zip(parts);
    let of_spans = spans(surface, k, ranges[k]).into_iter();
    let places: Vec<f64> = of_parts
        .flat_map(|(span, parts)| evenly([span[0].0, span[1].0], PLACES * parts))
        .chain(of_spans.flat_map(|span| evenly(span, PLACES_A_SPAN)))
        .collect();
    let mut worst = vec![0.0_f64; parts.len()];
    for line in lines(surface, 1 - k, ranges[1 - k]) {
        let points: Vec<DVec3> = collocation.places.iter().map(|t| point(*t, line)).collect();
        if !points.iter().all(|point| point.is_finite()) {
            return Err(FitError::NotFinite);
        }
        let poles = collocation.solve(&points);
        for &t in &places {
            let fitted = on_curve(&collocation.axis, &poles, t);
            let after = breaks.partition_point(|(knot, _)| *knot <= t);
            let worst = &mut worst[after.clamp(1, parts.len()) - 1];
            *worst = worst.max(fitted.distance(point(t, line)));
        }
    }
    Ok(worst)
}

/// The breaks with each span divided into `parts`; new breaks have full continuity.
fn divided(breaks: &[(f64, usize)], parts: &[usize]) -> Vec<(f64, usize)> {
    let mut all = Vec::new();
    for (span, parts) in breaks.windows(2).zip(parts) {
        all.push(span[0]);
        let inner = (1..*parts).map(|k| k as f64 / *parts as f64);
        all.extend(inner.map(|share| (span[0].0 + (span[1].0 - span[0].0) * share, 3)));
    }
    all.extend(breaks.last());
    all
}

fn on_curve(axis: &Axis, poles: &[DVec3], t: f64) -> DVec3 {
    let (first, basis) = axis.basis::<ORDER>(t, Side::Above);
    let acting = poles[first..=first + axis.degree].iter().zip(&basis[0]);
    acting.map(|(pole, share)| share * pole).sum()
}

/// The spline on given knots that interpolates the surface at all pairs of Greville abscissae.
fn interpolated(surface: &Surface, axes: [Axis; 2]) -> Result<SplineSurface, FitError> {
    let [in_u, in_v] = axes.map(Collocation::new);
    let surface = Periodic::new(surface);
    let mut rows: Vec<Vec<DVec3>> = Vec::with_capacity(in_u.places.len());
    for &u in &in_u.places {
        let points: Vec<DVec3> = in_v.places.iter().map(|v| surface.at(u, *v).point).collect();
        if !points.iter().all(|point| point.is_finite()) {
            return Err(FitError::NotFinite);
        }
        rows.push(in_v.solve(&points));
    }
    let mut poles: Vec<Vec<Pole>> = vec![vec![[0.0; 4]; in_v.places.len()]; in_u.places.len()];
    for j in 0..in_v.places.len() {
        let column: Vec<DVec3> = rows.iter().map(|row| row[j]).collect();
        for (row, pole) in poles.iter_mut().zip(in_u.solve(&column)) {
            row[j] = pole.extend(1.0).to_array();
        }
    }
    Ok(SplineSurface {
        axes: [in_u.axis, in_v.axis],
        poles,
    })
}

/// The deviation of a surface with the same parameters, of which a pole is moved by at most `moved_mm`.
pub(super) fn deviation_of_moved(surface: &Surface, fit: &SplineSurface, moved_mm: f64) -> Deviation {
    let measured = deviation(surface, fit, DENSE);
    Deviation {
        max_mm: measured.max_mm.max(moved_mm),
        ..measured
    }
}

/// Largest distance and angle between a surface and its fit, at this many points per side of each patch of the fit, and [`PLACES_A_SPAN`] per side of each patch of the surface at least.
fn deviation(surface: &Surface, fit: &SplineSurface, each: usize) -> Deviation {
    let places = |k: usize| -> Vec<f64> {
        let breaks = fit.axes[k].breaks();
        let own = spans(surface, k, fit.domain()[k]);
        let in_patch = |patch: &[f64]| -> Vec<f64> {
            let [start, end] = [patch[0], patch[1]];
            let within = own.iter().filter(|[low, high]| *high > start && *low < end);
            let count = each.max(PLACES_A_SPAN * within.count());
            let place = |i: usize| start + (end - start) * (i as f64 + 0.5) / count as f64;
            (0..count).map(place).collect()
        };
        breaks.windows(2).flat_map(in_patch).collect()
    };
    let (us, vs) = (places(0), places(1));
    let surface = Periodic::new(surface);
    let mut worst = Deviation {
        places: us.len() * vs.len(),
        ..Deviation::default()
    };
    for &u in &us {
        for &v in &vs {
            let (a, b) = (surface.at(u, v), fit.at(u, v));
            worst.max_mm = worst.max_mm.max(a.point.distance(b.point));
            let (m, n) = (a.u.cross(a.v), b.u.cross(b.v));
            if m.length() > SINE_MIN * a.u.length() * a.v.length() {
                // The arc tangent is exact for small angles, where the arc cosine is not.
                let angle = m.cross(n).length().atan2(m.dot(n));
                worst.normal_rad = worst.normal_rad.max(angle);
            }
        }
    }
    worst
}

/// Which knots of a surface a fit keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Knots {
    /// Those at which a second derivative jumps: the fit is C2 where the surface is.
    OfSurface,
    /// Those at which its tangent plane jumps.
    Fewest,
}

/// A bicubic B-spline within the tolerance of the surface over a rectangle, with a nearly minimal number of spans for these knots.
pub(super) fn fit(
    surface: &Surface,
    ranges: [[f64; 2]; 2],
    tolerance_mm: f64,
    knots: Knots,
) -> Result<(SplineSurface, Deviation), FitError> {
    let mut share = SHARE;
    for _ in 0..ROUNDS {
        let axis = |k: usize| match knots {
            Knots::OfSurface => direction(surface, k, ranges, share * tolerance_mm),
            Knots::Fewest => fewest(surface, k, ranges, share * tolerance_mm),
        };
        let axes = [axis(0)?, axis(1)?];
        let fit = interpolated(surface, axes)?;
        let is_too_large = fit.patches() > PATCHES_MAX;
        let measured = deviation(surface, &fit, if is_too_large { SPARSE } else { DENSE });
        if measured.max_mm <= tolerance_mm {
            return if is_too_large {
                Err(FitError::TooManyPatches(fit))
            } else {
                Ok((fit, measured))
            };
        }
        share *= 0.75;
    }
    Err(FitError::TooManySpans)
}
