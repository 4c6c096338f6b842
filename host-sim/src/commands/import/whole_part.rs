//! `import --part`: a job for each face of a part that the tool reaches, in order, with a summary and a page.

mod effort;
mod face;
mod order;
mod picture;
mod program;
mod setup;
mod summary;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use job::{FaceParameters, FaceReach};
use rayon::prelude::*;

use super::super::out::say;
use super::super::{Failure, Result, output_file, progress};
use super::Arguments;
use cad::{CadError, Face, MachinableFace, Model, Options, machinable_once};
use face::{Asked, Outcome, outcome};
use order::Links;
use part::{HeightMap, Times, Tool};
use picture::{cells, page};
use program::program;
pub(super) use setup::Up;
use setup::{Setup, best_side};
use summary::{Sums, print, summary};

/// How far the surface of a face goes on beyond it, in step-overs: as for a job.
const STEP_OVERS_AROUND: f64 = job_file::STEP_OVERS_AROUND;

/// Causes that an error tells.
const CAUSES: usize = 3;

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
}

/// The scallop height limit, mm, and how the faces become surfaces.
fn options(arguments: &Arguments, radius_mm: f64) -> (f64, Options) {
    let scallop_mm = arguments
        .scallop_mm
        .unwrap_or_else(|| cad::default_scallop_mm(radius_mm));
    let options = Options {
        tolerance_mm: arguments.tolerance,
        untrimmed: false,
        parameters: FaceParameters::Edges,
        around_mm: STEP_OVERS_AROUND * job::plane_step_over_mm(radius_mm, scallop_mm),
    };
    (scallop_mm, options)
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
    let (scallop_mm, options) = options(arguments, radius_mm);
    let tool = Tool::new(radius_mm, &job::ToolBody::default());
    let wanted = |face: &&Face| arguments.faces.is_empty() || arguments.faces.contains(&face.number);
    let faces: Vec<&Face> = model.faces.iter().filter(wanted).collect();
    let made: Vec<std::result::Result<Arc<MachinableFace>, CadError>> = faces
        .par_iter()
        .map(|face| machinable_once(file, model, face.number, &options))
        .collect();
    let by_surface = Options {
        parameters: FaceParameters::Surface,
        ..options
    };
    let setup = match arguments.up {
        Up::Auto => best_side(model, &faces, &made, &tool, scallop_mm),
        up => Setup::new(up, model, scallop_mm),
    };
    let asked = Asked {
        part: &setup.part,
        tool: &tool,
        scallop_mm,
        setup: &setup,
    };
    let folder = output.folder();
    if output.is_file {
        for path in [output.path.to_owned(), output.page(), output.summary()] {
            output_file::check(&path, arguments.force)?;
        }
    } else {
        output_file::check_folder(&folder, &["summary.json", "part.html"], arguments.force)?;
    }
    std::fs::create_dir_all(&folder).map_err(|error| super::super::cannot_write(&folder, &error))?;
    let bar = progress(faces.len() as u64, "regions");
    let each = faces.par_iter().zip(made).map(|(face, made)| {
        let mut all = vec![made];
        // Lines between edges that are not parallel spread: the surface's own parameters may take less time.
        if all[0].as_ref().is_ok_and(|made| made.by_edges) {
            all.push(machinable_once(file, model, face.number, &by_surface));
        }
        let mut found = outcome(arguments, file, face, &all, &asked, &folder);
        if let (Some(made), true) = (found.made.clone(), face.surface.kind() != "plane") {
            found.cells = cells(&asked, face, &made, &found);
        }
        bar.inc(1);
        found
    });
    let outcomes = each.collect();
    bar.finish_and_clear();
    write(arguments, file, model, &output, &setup, outcomes)
}

/// What a ball reaches of each of these faces from above; why not where a face is not known.
pub(super) fn reaches(
    arguments: &Arguments,
    file: &str,
    model: &Arc<Model>,
    faces: &[&Face],
    radius_mm: f64,
) -> Vec<std::result::Result<FaceReach, String>> {
    let (scallop_mm, options) = options(arguments, radius_mm);
    let setup = Setup::new(Up::PlusZ, model, scallop_mm);
    let asked = Asked {
        part: &setup.part,
        tool: &Tool::new(radius_mm, &job::ToolBody::default()),
        scallop_mm,
        setup: &setup,
    };
    let bar = progress(faces.len() as u64, "reach");
    let found = faces.par_iter().map(|face| {
        let made = machinable_once(file, model, face.number, &options);
        bar.inc(1);
        made.map(|made| asked.reach(face, &made, 64))
            .map_err(|error| error.what)
    });
    let found = found.collect();
    bar.finish_and_clear();
    found
}

/// The indices of the faces that have a job, in the order whose links take least time, and that time about, s.
fn ordered(arguments: &Arguments, setup: &Setup, outcomes: &[Outcome]) -> (Vec<usize>, f64) {
    let with_job: Vec<usize> = (0..outcomes.len())
        .filter(|index| outcomes[*index].region.is_some())
        .collect();
    let radius_mm = arguments.radius_mm.unwrap_or(0.0);
    let home_mm = setup.home_mm(radius_mm);
    let feed_mm_s = arguments.feed_mm_min.unwrap_or(cad::FEED_MM_MIN) / 60.0;
    let ends_mm: Vec<_> = with_job.iter().map(|index| outcomes[*index].ends_mm).collect();
    let links = Links::new(
        &HeightMap::new(&setup.part, radius_mm),
        &Times::new(feed_mm_s, job::AxisLimits::DEFAULT),
        &ends_mm,
        home_mm,
    );
    let order = links.order();
    let links_s = links.sum_s(&order);
    (order.into_iter().map(|place| with_job[place]).collect(), links_s)
}

/// Why no face has a job.
fn without_jobs(arguments: &Arguments, file: &str, outcomes: &[Outcome]) -> Failure {
    let refused: Vec<String> = (outcomes.iter())
        .filter_map(|outcome| Some(format!("face {}: {}", outcome.number, outcome.refused.as_ref()?)))
        .collect();
    if refused.is_empty() {
        return Failure::input(
            format!(
                "a ball of radius {} mm reaches no face of {file}",
                arguments.radius_mm.unwrap_or(0.0)
            ),
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
        match refused.len() == outcomes.len() {
            true => "mend the faces in the CAD system, or see what import --face N says of each",
            false => "take a smaller ball for the others, or another side up with --up auto",
        },
    )
}

/// Writes everything.
fn write(
    arguments: &Arguments,
    file: &str,
    model: &Arc<Model>,
    output: &Output<'_>,
    setup: &Setup,
    mut outcomes: Vec<Outcome>,
) -> Result<()> {
    let (order, links_s) = ordered(arguments, setup, &outcomes);
    if output.is_file && order.is_empty() {
        return Err(without_jobs(arguments, file, &outcomes));
    }
    for (place, index) in (1..).zip(&order) {
        let outcome = &mut outcomes[*index];
        let path = output.job(place, outcome.number);
        if !output.is_file {
            output_file::write(&path, outcome.text.as_bytes(), arguments.force)?;
        }
        outcome.job = Some(path);
    }
    if output.is_file {
        let text = program(arguments, file, output, setup, &order, &outcomes);
        output_file::write(output.path, text.as_bytes(), arguments.force)?;
    }
    let sums = Sums::of(&outcomes);
    let page = page(file, model, setup, &order, &outcomes);
    let page_path = output.page();
    output_file::write(&page_path, page.as_bytes(), arguments.force)?;
    let summary = summary(
        arguments,
        file,
        setup,
        (&order, links_s),
        &outcomes,
        &sums,
        &page_path,
    );
    let text = serde_json::to_string_pretty(&summary).unwrap_or_default();
    output_file::write(&output.summary(), text.as_bytes(), arguments.force)?;
    if arguments.json {
        say!("{summary}");
        return Ok(());
    }
    print(file, &page_path, setup, (&order, links_s), &outcomes, &sums);
    Ok(())
}
