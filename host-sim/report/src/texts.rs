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
    /// The texts of a run of this job. `job_name`: path of the job file, `part.toml#5` for a face of a part's; only the file name and the face are shown.
    pub(super) fn new(job: &Job, record: &Record, job_name: &Path, findings: &SurveyResult) -> Self {
        let title = title_of(job_name);
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

/// The file's name without its ending, with the face of a part: "part, face 5" for `part.toml#5`.
fn title_of(job_name: &Path) -> String {
    let name = job_name
        .file_name()
        .map_or_else(|| "job".into(), |name| name.to_string_lossy());
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let face = name.rsplit_once('#').filter(|(_, face)| is_number(face));
    let (file, face) = face.map_or((&*name, None), |(file, face)| (file, Some(face)));
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    match face {
        Some(face) => format!("{stem}, face {face}"),
        None => stem.to_owned(),
    }
}

fn parameter(along: Along) -> &'static str {
    match along {
        Along::U => "u",
        Along::V => "v",
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::title_of;

    #[test]
    fn titles_tell_faces_of_a_part_apart() {
        for (path, title) in [
            ("parts/p.toml#5", "p, face 5"),
            ("parts/p.toml", "p"),
            ("a#b.toml", "a#b"),
            ("no ending", "no ending"),
        ] {
            assert_eq!(title_of(Path::new(path)), title);
        }
    }
}
