//! Writes a job as a job file that reads back as the same job.

use std::fmt::Write;

use job::{Along, Job, Pattern, Side, Spacing, SurfaceSpec};

/// The shortest text that reads back as the same number.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn list<T>(values: &[T], text: impl Fn(&T) -> String) -> String {
    let values: Vec<String> = values.iter().map(text).collect();
    format!("[{}]", values.join(", "))
}

fn numbers(values: &[f64]) -> String {
    list(values, |value| number(*value))
}

fn surface(surface: &SurfaceSpec) -> Vec<(&'static str, String)> {
    let cubics = |rail: &[[f64; 4]; 3]| list(rail, |axis| numbers(axis));
    match surface {
        SurfaceSpec::Revolved {
            radius_mm,
            height_mm,
            u,
            v_rad,
        } => vec![
            ("radius_mm", numbers(radius_mm)),
            ("height_mm", numbers(height_mm)),
            ("u", numbers(u)),
            ("v_rad", numbers(v_rad)),
        ],
        SurfaceSpec::Ruled {
            rail0_mm,
            rail1_mm,
            u,
            v,
        } => vec![
            ("rail0_mm", cubics(rail0_mm)),
            ("rail1_mm", cubics(rail1_mm)),
            ("u", numbers(u)),
            ("v", numbers(v)),
        ],
        SurfaceSpec::Bicubic {
            coefficients_mm,
            u,
            v,
        } => vec![
            (
                "coefficients_mm",
                list(coefficients_mm, |axis| list(axis, |row| numbers(row))),
            ),
            ("u", numbers(u)),
            ("v", numbers(v)),
        ],
        SurfaceSpec::Nurbs(nurbs) => vec![
            ("degree", format!("{:?}", nurbs.degree)),
            ("knots_u", numbers(&nurbs.knots_u)),
            ("knots_v", numbers(&nurbs.knots_v)),
            (
                "poles_mm",
                list(&nurbs.poles_mm, |row| list(row, |pole| numbers(pole))),
            ),
        ],
    }
}

/// The text of a job; of the machine, the period and the axis limits.
#[must_use]
pub fn text(job: &Job, comment: &str) -> String {
    let mut text = String::new();
    for line in comment.lines() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# {line}");
    }
    let _ = writeln!(text, "\n[surface]\nkind = \"{}\"", job.surface.kind());
    for (key, value) in surface(&job.surface) {
        let _ = writeln!(text, "{key} = {value}");
    }
    let _ = writeln!(
        text,
        "\n[tool]\nkind = \"ball\"\nradius_mm = {}",
        number(job.radius_mm)
    );
    if let Some(region) = &job.region {
        let loops = list(&region.loops, |points| list(points, |point| numbers(point)));
        let _ = writeln!(text, "\n[region]\nloops = {loops}");
    }
    let along = match job.along {
        Along::U => "u",
        Along::V => "v",
    };
    let side = match job.side {
        Side::Up => "up",
        Side::Plus => "+",
        Side::Minus => "-",
    };
    let pattern = match job.pattern {
        Pattern::Zig => "zig",
        Pattern::Zigzag => "zigzag",
    };
    let _ = writeln!(
        text,
        "\n[cut]\nfeed_mm_min = {}\nscallop_mm = {}\nalong = \"{along}\"\nside = \"{side}\"\npattern = \"{pattern}\"",
        number(job.feed_mm_min),
        number(job.scallop_mm)
    );
    match job.spacing {
        Spacing::Exact => {}
        Spacing::FirstOrder => text.push_str("spacing = \"first-order\"\n"),
        Spacing::Constant(start) => {
            let _ = writeln!(text, "spacing = \"constant\"\nstart = \"{}\"", start.name());
        }
    }
    let _ = writeln!(
        text,
        "chord_mm = {}\n\n[machine]\nperiod_us = {}",
        number(job.chord_mm),
        number(job.machine.period_us)
    );
    if let Some(limits) = &job.machine.limits {
        let keys = ["velocity_max_mm_s", "acceleration_max_mm_s2", "jerk_max_mm_s3"];
        for (key, limit) in keys.iter().zip(limits.by_order()) {
            let _ = writeln!(text, "{key} = {}", numbers(&limit));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::genes::{Genes, JobClass};
    use job::Origin;

    #[test]
    fn reads_back_as_the_same_job() {
        let mut random = fastrand::Rng::with_seed(1);
        for count in 0..200 {
            let class = JobClass {
                limits: count % 2 == 1,
                constant: count % 3 == 1,
                region: count % 5 == 1,
            };
            let mut job = Genes::random(&mut random).job(class);
            if class.limits {
                // The job file refuses more, as the core does.
                job.feed_mm_min = job
                    .feed_mm_min
                    .min(job_file::feed_max_within_limits(job.machine.period_us));
            }
            let mut read =
                job_file::parse("a job", &text(&job, "one\ntwo")).unwrap_or_else(|error| panic!("{error:?}"));
            read.origin = Origin::default();
            assert_eq!(read, job);
        }
    }
}
