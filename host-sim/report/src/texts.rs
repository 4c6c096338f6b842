//! The texts of picture and page about a job and its passes.

use std::path::Path;

use super::record::Record;
use job::{Along, Job, Pattern};
use verify::survey::SurveyResult;

/// Texts of the picture.
#[derive(Clone, Debug)]
pub(super) struct PictureTexts {
    pub(super) title: String,
    pub(super) subtitle: String,
    /// Legend of the thin lines: "cutter contact, 55 of 164 passes".
    pub(super) passes: String,
    /// Legend of the ball: "ball, radius 6 mm".
    pub(super) ball: String,
    /// Alternative text.
    pub(super) description: String,
}

impl PictureTexts {
    /// The texts of a run of this job. `job_name`: path of the job file; only the file name is shown.
    pub(super) fn new(job: &Job, record: &Record, job_name: &Path, findings: &SurveyResult) -> Self {
        let title = job_name
            .file_stem()
            .map_or_else(|| "job".to_owned(), |name| name.to_string_lossy().into_owned());
        let along = parameter(job.along);
        let passes = findings.passes;
        let plural = if passes == 1 { "pass" } else { "passes" };
        let order = match job.pattern {
            Pattern::Zig => "zig",
            Pattern::Zigzag => "zigzag",
        };
        let subtitle = format!(
            "{} surface · {passes} {plural} along {along}, {order} · {} mm/min at the cutter contact · scallop {} mm",
            job.surface.kind(),
            job.feed_mm_min,
            job.scallop_mm
        );
        let drawn = record.drawn.len();
        let drawn_of = if drawn == passes as usize {
            String::new()
        } else {
            format!("{drawn} of ")
        };
        Self {
            subtitle,
            passes: format!("cutter contact, {drawn_of}{passes} {plural}"),
            ball: format!("ball, radius {} mm, to scale", job.radius_mm),
            description: format!(
                "The {} surface of job {title} in parallel projection, with {drawn} of its {passes} {plural} along {along}. \
                 One pass is highlighted, with its cutter location (CL) path above it; a ball of {} mm radius touches \
                 the surface on it.",
                job.surface.kind(),
                job.radius_mm
            ),
            title,
        }
    }
}

fn parameter(along: Along) -> &'static str {
    match along {
        Along::U => "u",
        Along::V => "v",
    }
}
