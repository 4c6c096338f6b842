//! `import --part`: a job for each face of a part that the tool reaches, in order, with a summary and a page.

mod picture;
mod summary;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use cad::{Face, Model};
use clap::ValueEnum;
use job::FaceReach;
use part_program::{CutOptions, FaceOrder, FacePlan, JobFolder, PartSetup, Planner, UpSide};

use super::super::out::say;
use super::super::{Failure, Result, output_file, progress};
use super::{Arguments, relative};
use picture::page;
use summary::{print, summary};

/// Causes that an error lists.
const CAUSES: usize = 3;

/// The side of the part that looks up on the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Up {
    /// The file's +z.
    #[value(name = "+z")]
    PlusZ,
    /// Its -z.
    #[value(name = "-z")]
    MinusZ,
    /// Its +x.
    #[value(name = "+x")]
    PlusX,
    /// Its -x.
    #[value(name = "-x")]
    MinusX,
    /// Its +y.
    #[value(name = "+y")]
    PlusY,
    /// Its -y.
    #[value(name = "-y")]
    MinusY,
    /// The one of the six of which most can be reached.
    Auto,
}

impl Up {
    /// The side; `None`: chosen automatically.
    const fn side(self) -> Option<UpSide> {
        match self {
            Self::PlusZ => Some(UpSide::PlusZ),
            Self::MinusZ => Some(UpSide::MinusZ),
            Self::PlusX => Some(UpSide::PlusX),
            Self::MinusX => Some(UpSide::MinusX),
            Self::PlusY => Some(UpSide::PlusY),
            Self::MinusY => Some(UpSide::MinusY),
            Self::Auto => None,
        }
    }
}

/// Where the jobs go: a file with all of them, or a folder with one for each face.
struct Output<'a> {
    path: &'a Path,
    is_file: bool,
}

impl<'a> Output<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            is_file: path.extension().is_some_and(|extension| extension == "toml"),
        }
    }

    fn folder(&self) -> PathBuf {
        match self.path.parent().filter(|_| self.is_file) {
            Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
            Some(parent) => parent.to_owned(),
            None => self.path.to_owned(),
        }
    }

    fn page(&self) -> PathBuf {
        if self.is_file {
            self.path.with_extension("html")
        } else {
            self.path.join("part.html")
        }
    }

    fn summary(&self) -> PathBuf {
        if self.is_file {
            self.path.with_extension("json")
        } else {
            self.path.join("summary.json")
        }
    }

    /// The job of a face, the `place`-th to be machined.
    fn job(&self, place: usize, face: usize) -> PathBuf {
        if self.is_file {
            PathBuf::from(format!("{}#{face}", self.path.display()))
        } else {
            self.path.join(format!("{place:03}-face-{face}.toml"))
        }
    }

    /// The jobs of an earlier import in the folder: files named as [`Self::job`] does.
    fn earlier_jobs(&self) -> Vec<PathBuf> {
        if self.is_file {
            return Vec::new();
        }
        let Ok(entries) = std::fs::read_dir(self.path) else {
            // There is no folder yet.
            return Vec::new();
        };
        let mut jobs: Vec<PathBuf> = entries
            .flatten()
            .filter(|entry| entry.file_name().to_str().is_some_and(is_job_name))
            .map(|entry| entry.path())
            .collect();
        jobs.sort();
        jobs
    }

    /// Removes those jobs of an earlier import over which none of these is written.
    fn remove_earlier_jobs(&self, jobs: &[Option<PathBuf>]) -> Result<()> {
        for stale in self.earlier_jobs() {
            if !jobs.iter().flatten().any(|job| *job == stale) {
                std::fs::remove_file(&stale).map_err(|error| super::super::cannot_write(&stale, &error))?;
            }
        }
        Ok(())
    }

    /// Checks that the files may be written and those of an earlier import removed, and makes their folder.
    fn begin(&self, force: bool) -> Result<PathBuf> {
        let folder = self.folder();
        if self.is_file {
            for path in [self.path.to_owned(), self.page(), self.summary()] {
                output_file::check(&path, force)?;
            }
        } else {
            output_file::check_folder(&folder, &["summary.json", "part.html"], force)?;
            for job in self.earlier_jobs() {
                output_file::check(&job, force)?;
            }
        }
        std::fs::create_dir_all(&folder).map_err(|error| super::super::cannot_write(&folder, &error))?;
        Ok(folder)
    }
}

/// Whether a file is named as the job of a face in a folder is: `007-face-12.toml`.
fn is_job_name(name: &str) -> bool {
    let digits =
        |text: &str, least: usize| text.len() >= least && text.bytes().all(|byte| byte.is_ascii_digit());
    name.strip_suffix(".toml")
        .and_then(|name| name.split_once("-face-"))
        .is_some_and(|(place, face)| digits(place, 3) && digits(face, 1))
}

/// A planned part, and the paths of its output files.
struct Planned<'a> {
    file: &'a str,
    model: &'a Model,
    setup: &'a PartSetup,
    plans: &'a [FacePlan],
    order: &'a FaceOrder,
    /// The job of each face that has one, in the order of the plans.
    jobs: Vec<Option<PathBuf>>,
    page: PathBuf,
}

impl Planned<'_> {
    /// Faces that have a job, each with its path, in the order of machining.
    fn machined(&self) -> impl Iterator<Item = (&FacePlan, &Path)> {
        let faces = self.order.faces.iter();
        faces.filter_map(|index| Some((&self.plans[*index], self.jobs[*index].as_deref()?)))
    }
}

/// Tool and cut by the arguments.
fn cut(arguments: &Arguments, radius_mm: f64) -> CutOptions {
    CutOptions {
        radius_mm,
        scallop_mm: arguments.scallop_mm,
        feed_mm_min: arguments.feed_mm_min,
        along: arguments.along.clone(),
        pattern: arguments.pattern.clone(),
        tolerance_mm: arguments.tolerance,
    }
}

/// Writes a job for each face, the summary and the page.
///
/// # Errors
/// No tool is given; the folder cannot be written.
pub(super) fn command(arguments: &Arguments, file: &str, model: &Arc<Model>, output: &Path) -> Result<()> {
    let output = Output::new(output);
    let Some(radius_mm) = arguments.radius_mm else {
        return Err(Failure::input(
            "no tool is given",
            "give the ball's radius in mm with --tool R",
        ));
    };
    let cut = cut(arguments, radius_mm);
    let wanted = |face: &&Face| arguments.faces.is_empty() || arguments.faces.contains(&face.number);
    let faces: Vec<&Face> = model.faces.iter().filter(wanted).collect();
    let planner = Planner::new(file, model, &faces, &cut);
    let setup = match arguments.up.side() {
        Some(side) => planner.setup(side),
        None => planner.best_setup(),
    };
    let folder = output.begin(arguments.force)?;
    let folder = JobFolder {
        source: relative(&arguments.file, &folder.join("face.toml")),
        path: folder,
    };
    let bar = progress(faces.len() as u64, "regions");
    let plans = planner.plans(&setup, &folder, || bar.inc(1));
    bar.finish_and_clear();
    let order = planner.order(&setup, &plans);
    if output.is_file && order.faces.is_empty() {
        return Err(without_jobs(arguments, file, radius_mm, &plans));
    }
    let mut jobs = vec![None; plans.len()];
    for (place, index) in (1..).zip(&order.faces) {
        jobs[*index] = Some(output.job(place, plans[*index].number));
    }
    output.remove_earlier_jobs(&jobs)?;
    for (plan, path) in plans.iter().zip(&jobs).filter(|_| !output.is_file) {
        if let (Some(job), Some(path)) = (&plan.job, path) {
            output_file::write(path, job.text.as_bytes(), arguments.force)?;
        }
    }
    if output.is_file {
        let text = planner.text(&setup, &folder, output.path, &order, &plans);
        output_file::write(output.path, text.as_bytes(), arguments.force)?;
    }
    let planned = Planned {
        file,
        model,
        setup: &setup,
        plans: &plans,
        order: &order,
        jobs,
        page: output.page(),
    };
    conclude(arguments, &planned, &output)
}

/// Writes page and summary of the part, and prints the summary.
fn conclude(arguments: &Arguments, planned: &Planned<'_>, output: &Output<'_>) -> Result<()> {
    output_file::write(&planned.page, page(planned).as_bytes(), arguments.force)?;
    let summary = summary(planned);
    let text = serde_json::to_string_pretty(&summary).unwrap_or_default();
    output_file::write(&output.summary(), text.as_bytes(), arguments.force)?;
    if arguments.json {
        say!("{summary}");
    } else {
        print(planned);
    }
    Ok(())
}

/// What a ball reaches of each of these faces from above; why not where a face is not known.
pub(super) fn reaches(
    arguments: &Arguments,
    file: &str,
    model: &Arc<Model>,
    faces: &[&Face],
    radius_mm: f64,
) -> Vec<std::result::Result<FaceReach, String>> {
    let cut = cut(arguments, radius_mm);
    let bar = progress(faces.len() as u64, "reach");
    let planner = Planner::new(file, model, faces, &cut);
    let found = planner.reaches(&planner.setup(UpSide::PlusZ), || bar.inc(1));
    bar.finish_and_clear();
    found
        .into_iter()
        .map(|reach| reach.map_err(|error| error.what))
        .collect()
}

/// In the sentence on a face without a fit within the tolerance.
const WITHOUT_FIT: &str = "no fit within";

/// Why a face is refused: many sentences name it themselves.
fn of_face(number: usize, why: &str) -> String {
    let name = format!("face {number}");
    match why
        .strip_prefix(&name)
        .is_some_and(|rest| rest.starts_with([' ', ':']))
    {
        true => why.to_owned(),
        false => format!("{name}: {why}"),
    }
}

/// Why no face has a job.
fn without_jobs(arguments: &Arguments, file: &str, radius_mm: f64, plans: &[FacePlan]) -> Failure {
    let refused: Vec<String> = (plans.iter())
        .filter_map(|plan| Some(of_face(plan.number, &plan.refused.as_ref()?.to_string())))
        .collect();
    if refused.is_empty() {
        return Failure::input(
            format!("a ball of radius {radius_mm} mm reaches no face of {file}"),
            match arguments.up {
                Up::Auto => "take a smaller ball; import --list --tool R tells why of each face",
                _ => "take a smaller ball, or turn another side up with --up auto",
            },
        );
    }
    let more = match refused.len().saturating_sub(CAUSES) {
        0 => String::new(),
        more => format!("; and {more} more"),
    };
    Failure::input(
        format!(
            "no face of {file} has a job: {}{more}",
            refused[..refused.len().min(CAUSES)].join("; ")
        ),
        match refused.len() == plans.len() {
            true if refused.iter().any(|why| why.contains(WITHOUT_FIT)) => {
                "give a larger --tolerance, mend the faces in the CAD system, or see what import --face N says of each"
            }
            true => "mend the faces in the CAD system, or see what import --face N says of each",
            false => "take a smaller ball for the others, or another side up with --up auto",
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_of_an_earlier_import_are_known_by_their_names() {
        for name in ["001-face-13.toml", "1000-face-2.toml"] {
            assert!(is_job_name(name), "{name}");
        }
        for name in [
            "01-face-1.toml",
            "001-face-.toml",
            "001-face-1b.toml",
            "001-face-1.toml~",
            "a01-face-1.toml",
            "part.html",
        ] {
            assert!(!is_job_name(name), "{name}");
        }
    }

    #[test]
    fn a_refusal_names_its_face_once() {
        assert_eq!(
            of_face(1, "face 1 (#17, plane): flat"),
            "face 1 (#17, plane): flat"
        );
        assert_eq!(of_face(1, "face 12 is hidden"), "face 1: face 12 is hidden");
        assert_eq!(of_face(2, "it is a point"), "face 2: it is a point");
    }
}
