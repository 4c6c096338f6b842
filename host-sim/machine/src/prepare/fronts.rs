//! What passes of constant scallop height are refused for.

use interp_core::surface::{Edges, PolynomialRecord, RationalRecord};
use interp_core::{STORE_WORDS, Spacing, SurfaceKind, front_words};
use job::{Job, JobError};

use super::Prepared;
use super::geometry::SurfaceEvaluator;

const REMEDY: &str = "write spacing = \"exact\"";
/// Points of each knot line at which the derivatives on both sides are compared, their distance from it as a share of the range, and their greatest relative
/// difference: a pass bends by as much there.
const CREASE_POINTS: u32 = 9;
const CREASE_STEP: f64 = 1e-9;
const CREASE_MAX: f64 = 1e-3;
/// Radius of a circle that is a point, mm.
const POINT_MM: f64 = 1e-5;

/// Refuses a crease, too many path spans, and a job for whose stations the store has no room.
///
/// # Errors
/// As above.
pub(super) fn check(job: &Job, prepared: &Prepared) -> Result<(), JobError> {
    if !job.spacing.is_constant() {
        return Ok(());
    }
    let no = |what: String, remedy: &str| Err(job.origin.error("cut.spacing", what, remedy));
    if let Some(crease) = crease(job, prepared) {
        return no(crease, REMEDY);
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

/// A knot at which the surface's first derivatives jump.
fn crease(job: &Job, prepared: &Prepared) -> Option<String> {
    let surface = SurfaceEvaluator::new(&job.surface);
    let (path, side) = (&prepared.path.breaks, &prepared.side.breaks);
    let names = match job.along {
        job::Along::U => ["u", "v"],
        job::Along::V => ["v", "u"],
    };
    for (name, knots, across) in [(names[0], path, side), (names[1], side, path)] {
        let [low, high] = [across[0], across[across.len() - 1]];
        let width = knots[knots.len() - 1] - knots[0];
        for knot in &knots[1..knots.len() - 1] {
            for k in 0..CREASE_POINTS {
                let at = low + (high - low) * (f64::from(k) + 0.5) / f64::from(CREASE_POINTS);
                let sides = [-CREASE_STEP, CREASE_STEP].map(|step| {
                    let moved = knot + step * width;
                    let frame = if name == "u" {
                        surface.at(moved, at)
                    } else {
                        surface.at(at, moved)
                    };
                    if name == "u" { frame.u } else { frame.v }
                });
                let [before, after] = sides;
                if before.distance(after) > CREASE_MAX * before.length().max(after.length()) {
                    return Some(format!(
                        "passes of constant scallop height need a smooth parametrisation, but its derivative along {name} jumps at {name} = {knot}"
                    ));
                }
            }
        }
    }
    None
}

/// Where passes from the edge begin: on the last side boundary where that alone is a single point.
pub(super) fn spacing_from_edge(job: &Job, prepared: &Prepared) -> Spacing {
    match side_poles(job, prepared) {
        [false, true] => Spacing::ConstantFromEnd,
        _ => Spacing::Constant,
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
            for words in records.as_chunks().0 {
                add(PolynomialRecord::from_words(words).edges);
            }
        }
        SurfaceKind::Rational => {
            for words in records.as_chunks().0 {
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
