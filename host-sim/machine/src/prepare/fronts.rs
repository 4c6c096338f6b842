//! What passes of constant scallop height are refused for.

use interp_core::surface::{Edges, PolynomialRecord, RationalRecord};
use interp_core::{STORE_WORDS, Spacing, SurfaceKind, front_words};
use job::{Job, JobError};

use super::Prepared;
use super::geometry::SurfaceEvaluator;

const REMEDY: &str = "write spacing = \"exact\"";
/// Number of points of each knot line at which the derivatives on both sides are compared.
const CREASE_POINTS: u32 = 9;
/// Distance from the knot line at which the derivatives are taken, as a share of the range.
const CREASE_STEP: f64 = 1e-9;
/// Greatest relative difference of these derivatives: a pass bends by as much there.
const CREASE_MAX: f64 = 1e-3;
/// Radius of a circle that is a point, mm.
const POINT_MM: f64 = 1e-5;

/// Checks a job with passes of constant scallop height.
///
/// # Errors
/// The region ends on a point, there are too many path spans, or the store has no room for the stations.
pub(super) fn check(job: &Job, prepared: &Prepared) -> Result<(), JobError> {
    if !job.spacing.is_constant() {
        return Ok(());
    }
    let no = |what: String, remedy: &str| Err(job.origin.error("cut.spacing", what, remedy));
    if ends_on_point(job, prepared) {
        return no(
            "passes of constant scallop height within a region cannot come to a boundary that is a single point, only begin there".to_owned(),
            &format!("end the region before it, let the passes run along the other parameter, or {REMEDY}"),
        );
    }
    let Some(words) = front_words(&prepared.header) else {
        return no(
            format!(
                "passes of constant scallop height cross {} patches each, more than the board has stations for",
                prepared.path.spans()
            ),
            REMEDY,
        );
    };
    if prepared.words.len() + words > STORE_WORDS {
        return no(
            format!(
                "the surface and the stations of its passes of constant scallop height take {} words, more than the {STORE_WORDS} of the board's store, and they need all of it at once",
                prepared.words.len() + words
            ),
            "use fewer knots, cut the part into several jobs, or write spacing = \"exact\"",
        );
    }
    Ok(())
}

/// Widths of the spans for which the surface's first derivatives are continuous where only the parametrisation jumps at a knot, by one factor all
/// along it: a front crosses it without a bend, and a straight pass before it is as far from the next one as it should be.
///
/// # Errors
/// With passes of constant scallop height, a knot at which there is no such factor: the tangent plane jumps, or the factor is not the same all along.
pub(super) fn smooth_widths(job: &Job, prepared: &mut Prepared) -> Result<(), JobError> {
    let surface = SurfaceEvaluator::new(&job.surface);
    let other = |along| match along {
        job::Along::U => job::Along::V,
        job::Along::V => job::Along::U,
    };
    let axes = [
        (other(job.along), &prepared.side, &prepared.path),
        (job.along, &prepared.path, &prepared.side),
    ];
    let mut words = Vec::new();
    for (along, own, across) in axes {
        let (widths, crease) = smooth(&surface, along, &own.breaks, &across.breaks);
        if let Some(knot) = crease.filter(|_| job.spacing.is_constant()) {
            let name = along.name();
            let what = format!(
                "passes of constant scallop height need a tangent plane that is continuous, but the derivative along {name} jumps at {name} = {knot}"
            );
            return Err(job.origin.error("cut.spacing", what, REMEDY));
        }
        words.extend(super::width_words(job, widths.into_iter())?);
    }
    prepared.words.splice(..words.len(), words);
    Ok(())
}

/// Widths of the spans between knots of one parameter, and the first knot at which the derivative jumps by more than one factor; `across`: knots of the
/// other parameter.
fn smooth(
    surface: &SurfaceEvaluator,
    along: job::Along,
    knots: &[f64],
    across: &[f64],
) -> (Vec<f64>, Option<f64>) {
    let [low, high] = [across[0], across[across.len() - 1]];
    let width = knots[knots.len() - 1] - knots[0];
    let derivative = |knot: f64, k: u32| {
        let at = low + (high - low) * (f64::from(k) + 0.5) / f64::from(CREASE_POINTS);
        match along {
            job::Along::U => surface.at(knot, at).u,
            job::Along::V => surface.at(at, knot).v,
        }
    };
    let mut scale = 1.0;
    let mut widths = vec![knots[1] - knots[0]];
    let mut crease = None;
    for ends in knots[1..].windows(2) {
        let sides = |k: u32| [-CREASE_STEP, CREASE_STEP].map(|step| derivative(ends[0] + step * width, k));
        let [before, after] = sides(CREASE_POINTS / 2);
        let ratio = after.length() / before.length();
        let factor = if ratio.is_finite() && (ratio - 1.0).abs() > CREASE_MAX {
            ratio
        } else {
            1.0
        };
        let is_smooth = (0..CREASE_POINTS).all(|k| {
            let [before, after] = sides(k);
            let before = before * factor;
            before.distance(after) <= CREASE_MAX * before.length().max(after.length())
        });
        if !is_smooth {
            crease = crease.or(Some(ends[0]));
        }
        scale *= factor;
        widths.push((ends[1] - ends[0]) * scale);
    }
    (widths, crease)
}

/// Whether a region reaches to a side boundary that is a single point, where its passes do not begin there.
fn ends_on_point(job: &Job, prepared: &Prepared) -> bool {
    let Some(region) = &job.region else {
        return false;
    };
    let [us, vs] = job.surface.domain();
    let [of_u, of_v] = region.extent();
    let ([first, last], [low, high]) = match job.along {
        job::Along::U => (vs, of_v),
        job::Along::V => (us, of_u),
    };
    let [is_first_point, is_last_point] = side_poles(job, prepared);
    let begins_there = job.spacing == job::Spacing::Constant(job::Start::Edge);
    is_last_point && high >= last || is_first_point && low <= first && !begins_there
}

/// Where passes from the edge begin: on the last side boundary where that alone is a single point.
pub(super) fn spacing_from_edge(job: &Job, prepared: &Prepared) -> Spacing {
    match side_poles(job, prepared) {
        [false, true] => Spacing::ConstantFromEnd,
        _ => Spacing::Constant,
    }
}

/// The spacing of straight passes within axis limits.
pub(super) fn exact_spacing(job: &Job, prepared: &Prepared) -> Spacing {
    match side_poles(job, prepared) {
        [_, true] => Spacing::ExactToPoint,
        _ => Spacing::Exact,
    }
}

/// Whether the first and the last side boundary are single points.
fn side_poles(job: &Job, prepared: &Prepared) -> [bool; 2] {
    let widths = prepared.path.spans() + prepared.side.spans();
    let records = prepared.words.get(widths..).unwrap_or(&[]);
    let mut poles = [false; 2];
    let mut add = |edges: Edges| {
        poles = [poles[0] || edges.side_start, poles[1] || edges.side_end];
    };
    match prepared.header.kind {
        SurfaceKind::Polynomial => {
            for words in records.as_chunks().0.iter().take(prepared.patches()) {
                add(PolynomialRecord::from_words(words).edges);
            }
        }
        SurfaceKind::Rational => {
            for words in records.as_chunks().0.iter().take(prepared.patches()) {
                add(RationalRecord::from_words(words).edges);
            }
        }
        SurfaceKind::RevolvedAlongProfile => {}
        SurfaceKind::RevolvedAroundAxis => {
            if let job::SurfaceSpec::Revolved { radius_mm, u, .. } = &job.surface {
                let [c3, c2, c1, c0] = *radius_mm;
                poles = u.map(|u| (((c3 * u + c2) * u + c1) * u + c0).abs() < POINT_MM);
            }
        }
    }
    poles
}
