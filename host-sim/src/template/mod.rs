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

/// A template with passes of constant scallop height.
#[must_use]
pub fn with_constant_spacing(text: &str, start: job::Start) -> String {
    text.replace(
        "# spacing = \"exact\"          ",
        "spacing = \"constant\"         ",
    )
    .replace(
        "# start = \"edge\"             ",
        &format!("{:<31}", format!("start = \"{}\"", start.name())),
    )
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

    /// The text of a template with its optional keys and sections uncommented.
    fn with_optional_keys(kind: Kind) -> String {
        let is_key = |line: &str| {
            line.split_once(" = ").is_some_and(|(key, _)| {
                key.chars()
                    .all(|c| c.is_ascii_lowercase() || c == '_' || c.is_ascii_digit())
            })
        };
        let text = job(kind, "job.toml");
        let lines = text.lines().map(|line| match line.strip_prefix("# ") {
            Some(rest) if is_key(rest) || rest.starts_with('[') => rest,
            _ => line,
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    /// The optional keys of the templates have valid values, and those that the comments call defaults leave the job unchanged.
    #[test]
    fn optional_keys_are_valid() {
        for kind in [Kind::Bicubic, Kind::Ruled, Kind::Revolved, Kind::Nurbs] {
            let full = job_file::parse("job.toml", &with_optional_keys(kind)).unwrap();
            let plain = job_file::parse("job.toml", &job(kind, "job.toml")).unwrap();
            assert_eq!(
                (&full.surface, full.pattern, full.spacing, full.chord_mm),
                (&plain.surface, plain.pattern, plain.spacing, plain.chord_mm)
            );
            assert_eq!(full.machine.period_us, plain.machine.period_us);
            assert_eq!(configuration(&full.machine), configuration(&plain.machine));
            assert!(full.machine.travel_mm.is_some() && full.machine.step_output.is_some());
            assert!(full.machine.has_limits());
        }
    }

    /// The keys that the reader of job files accepts in a section of a template: it lists them when it refuses an unknown one.
    fn accepted_keys(text: &str, section: &str) -> Vec<String> {
        let head = format!("[{section}]\n");
        assert!(text.contains(&head), "[{section}] is missing in\n{text}");
        let text = text.replace(&head, &format!("{head}xxxxxxxxxxxxxxxx = 0\n"));
        let error = job_file::parse("job.toml", &text).unwrap_err();
        assert!(error.what().contains("unknown key"), "{}", error.what());
        let names = error.remedy().split('`').skip(1).step_by(2);
        names.map(str::to_owned).collect()
    }

    /// A template shows every key that the reader of job files accepts for its kind of surface, used or commented out.
    #[test]
    fn every_accepted_key_is_in_the_template() {
        for kind in Kind::ALL {
            let text = with_optional_keys(kind);
            let mut count = 0;
            for section in ["surface", "placement", "tool", "stock", "cut", "machine"] {
                // A CAD file's face is resolved before the sections after it are read; they are the same for every kind.
                if kind == Kind::File && section != "surface" {
                    continue;
                }
                let head = format!("[{section}]\n");
                let body = text.split(&head).nth(1).unwrap();
                let body = body.split("\n[").next().unwrap();
                for key in accepted_keys(&text, section) {
                    assert!(
                        body.lines().any(|line| line.starts_with(&format!("{key} = "))),
                        "{kind:?}: [{section}] lacks `{key}`"
                    );
                    count += 1;
                }
            }
            assert!(
                count >= if kind == Kind::File { 5 } else { 29 },
                "{kind:?}: {count} keys"
            );
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
}
