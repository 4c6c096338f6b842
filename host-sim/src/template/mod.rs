//! A job to begin with: one commented file for each kind of surface.

/// Kind of surface in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// One patch of degree 3 by 3, by its coefficients.
    Bicubic,
    /// Straight lines between two cubic curves.
    Ruled,
    /// A cubic profile turned about z.
    Revolved,
    /// A B-spline surface, rational or not.
    Nurbs,
    /// A face of a CAD file.
    File,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Bicubic,
        Self::Ruled,
        Self::Revolved,
        Self::Nurbs,
        Self::File,
    ];

    fn surface(self) -> &'static str {
        match self {
            Self::Bicubic => include_str!("bicubic.toml"),
            Self::Ruled => include_str!("ruled.toml"),
            Self::Revolved => include_str!("revolved.toml"),
            Self::Nurbs => include_str!("nurbs.toml"),
            Self::File => include_str!("file.toml"),
        }
    }
}

/// The text of a job file of this kind; `name`: the file's, for the commands in its comments.
#[must_use]
pub fn job(kind: Kind, name: &str) -> String {
    let head = include_str!("head.toml").replace("JOB", name);
    [&head, kind.surface(), include_str!("tail.toml")].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use machine::Machine;
    use machine::direction;
    use machine::prepare::configuration;

    /// Every job that needs no other file loads and runs to its end.
    #[test]
    fn templates_run_at_once() {
        for kind in Kind::ALL {
            let job = job_file::parse("job.toml", &job(kind, "job.toml"));
            if kind == Kind::File {
                // The CAD file is still to be named: the error points into the section.
                let (line, _) = job.unwrap_err().line_and_column().unwrap();
                assert!((8..=10).contains(&line), "line {line}");
                continue;
            }
            let (job, prepared) = direction::choose(job.unwrap()).unwrap();
            let mut samples = 0;
            Machine::load(&prepared)
                .unwrap()
                .run(|_| {
                    samples += 1;
                    true
                })
                .unwrap();
            assert!(samples > 10_000, "{kind:?}: {samples} samples");
            assert_eq!(job.pattern, job::Pattern::Zig);
        }
    }

    /// With what is commented out switched on, everything is still read: so the comments show valid values, and what they call defaults
    /// leaves the surface as it was.
    #[test]
    fn optional_keys_are_valid() {
        for kind in [Kind::Bicubic, Kind::Ruled, Kind::Revolved, Kind::Nurbs] {
            let plain = job(kind, "job.toml");
            let is_key = |line: &str| {
                line.split_once(" = ").is_some_and(|(key, _)| {
                    key.chars()
                        .all(|c| c.is_ascii_lowercase() || c == '_' || c.is_ascii_digit())
                })
            };
            let lines = plain.lines().map(|line| match line.strip_prefix("# ") {
                Some(rest) if is_key(rest) || rest.starts_with('[') => rest,
                _ => line,
            });
            let full = lines.collect::<Vec<_>>().join("\n");
            let full = job_file::parse("job.toml", &full).unwrap();
            let plain = job_file::parse("job.toml", &plain).unwrap();
            assert_eq!(
                (&full.surface, full.pattern, full.chord_mm),
                (&plain.surface, plain.pattern, plain.chord_mm)
            );
            assert_eq!(full.machine.period_us, plain.machine.period_us);
            assert_eq!(configuration(&full.machine), configuration(&plain.machine));
            assert!(full.machine.travel_mm.is_some() && full.machine.step_output.is_some());
            assert!(full.machine.has_limits());
        }
    }

    /// The reference in docs/ knows every key that a template shows.
    #[test]
    fn the_reference_has_every_key() {
        let reference = include_str!("../../../docs/job-file.md");
        let mut keys = 0;
        for line in Kind::ALL
            .iter()
            .flat_map(|kind| kind.surface().lines())
            .chain(include_str!("tail.toml").lines())
        {
            let Some((key, _)) = line.trim_start_matches("# ").split_once(" = ") else {
                continue;
            };
            if key
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
            {
                assert!(
                    reference.contains(&format!("`{key}`")),
                    "{key} is not in docs/job-file.md"
                );
                keys += 1;
            }
        }
        assert!(keys >= 40, "{keys}");
    }

    /// The job that the bring-up guide has people run in the air is within its limits and ends where it says.
    #[test]
    fn the_guides_job_runs() {
        let guide = include_str!("../../../docs/bring-up.md");
        let text = guide
            .split("```toml\n")
            .nth(1)
            .unwrap()
            .split("```")
            .next()
            .unwrap();
        let (job, prepared) = direction::choose(job_file::parse("axes.toml", text).unwrap()).unwrap();
        let mut last = [0; 3];
        Machine::load(&prepared)
            .unwrap()
            .run(|sample| {
                last = sample.cl_nm;
                true
            })
            .unwrap();
        assert_eq!(job.machine.home_mm, Some([0.0, 0.0, 60.0]));
        assert_eq!(last, [0, 0, 60_000_000]);
    }
}
