//! What passes of constant scallop height are refused for.

use interp_core::surface::{PolynomialRecord, RationalRecord};
use interp_core::{STORE_WORDS, SurfaceKind, front_words};
use job::{Job, JobError};

use super::Prepared;

const REMEDY: &str = "write spacing = \"exact\"";
/// Radius of a circle that is a point, mm.
const POINT_MM: f64 = 1e-5;

/// Refuses what the fronts are not made for, before the surface is prepared.
///
/// # Errors
/// Axis limits.
pub(super) fn check_job(job: &Job) -> Result<(), JobError> {
    if job.spacing.is_constant() && job.machine.has_limits() {
        return Err(job.origin.error(
            "cut.spacing",
            "passes of constant scallop height are made for jobs without axis limits only",
            "write spacing = \"exact\", or remove the axis limits",
        ));
    }
    Ok(())
}

/// Refuses a pole beside the passes, too many path spans, and a job for whose stations the store has no room.
///
/// # Errors
/// As above.
pub(super) fn check(job: &Job, prepared: &Prepared) -> Result<(), JobError> {
    if !job.spacing.is_constant() {
        return Ok(());
    }
    let no = |what: String, remedy: &str| Err(job.origin.error("cut.spacing", what, remedy));
    if has_pole_beside(job, prepared) {
        let other = match job.along {
            job::Along::U => "v",
            job::Along::V => "u",
        };
        let remedy = format!("write along = \"{other}\", so that the passes end at the pole, or {REMEDY}");
        return no(
            "passes of constant scallop height cannot be made where a boundary beside them is a single point"
                .to_owned(),
            &remedy,
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
                "the surface and the stations of its passes take {} words, more than the {STORE_WORDS} of the board's store",
                prepared.words.len() + words
            ),
            "use fewer knots, cut the part into several jobs, or write spacing = \"exact\"",
        );
    }
    Ok(())
}

/// Whether a side boundary is a single point.
fn has_pole_beside(job: &Job, prepared: &Prepared) -> bool {
    let widths = prepared.path.spans() + prepared.side.spans();
    let records = prepared.words.get(widths..).unwrap_or(&[]);
    match prepared.header.kind {
        SurfaceKind::Polynomial => records
            .as_chunks()
            .0
            .iter()
            .map(|words| PolynomialRecord::from_words(words).edges)
            .any(|edges| edges.side_start || edges.side_end),
        SurfaceKind::Rational => records
            .as_chunks()
            .0
            .iter()
            .map(|words| RationalRecord::from_words(words).edges)
            .any(|edges| edges.side_start || edges.side_end),
        SurfaceKind::RevolvedAlongProfile => false,
        SurfaceKind::RevolvedAroundAxis => match &job.surface {
            job::SurfaceSpec::Revolved { radius_mm, u, .. } => u.iter().any(|u| {
                let [c3, c2, c1, c0] = *radius_mm;
                (((c3 * u + c2) * u + c1) * u + c0).abs() < POINT_MM
            }),
            _ => false,
        },
    }
}
