//! From the faces of a file to their plans: surfaces, setup, a plan for each face, their order.

use std::path::PathBuf;
use std::sync::Arc;

use cad::{CadError, Face, MachinableFace, Model, Options, machinable_once};
use job::{AxisLimits, FaceParameters, FaceReach};
use part::{HeightMap, Times, Tool};
use rayon::prelude::*;

use crate::face::{FacePlan, REACH_PLACES};
use crate::order::{FaceLinks, FaceOrder};
use crate::setup::{PartSetup, UpSide};

/// Places along each parameter of a face at which its reach is sampled to compare the six sides of a part.
const UP_SIDE_PLACES: usize = 16;

/// Tool and cut of all faces.
#[derive(Clone, Debug, PartialEq)]
pub struct CutOptions {
    /// Ball radius, mm.
    pub radius_mm: f64,
    /// Scallop height limit, mm; `None`: the default for this ball.
    pub scallop_mm: Option<f64>,
    /// Feed along the surface, mm/min; `None`: the default.
    pub feed_mm_min: Option<f64>,
    /// Surface parameter along a pass, as in job files; `None`: chosen for each face.
    pub along: Option<String>,
    /// Order of the passes, as in job files; `None`: zigzag.
    pub pattern: Option<String>,
    /// Largest deviation of an approximated surface, mm.
    pub tolerance_mm: f64,
}

impl CutOptions {
    /// Scallop height limit, mm.
    #[must_use]
    pub fn scallop_mm(&self) -> f64 {
        self.scallop_mm
            .unwrap_or_else(|| cad::default_scallop_mm(self.radius_mm))
    }

    /// Feed along the surface, mm/min.
    #[must_use]
    pub fn feed_mm_min(&self) -> f64 {
        self.feed_mm_min.unwrap_or(cad::FEED_MM_MIN)
    }

    fn tool(&self) -> Tool {
        Tool::new(self.radius_mm, &job::ToolBody::default())
    }

    /// Options for making the surface of a face with these parameters.
    fn surface_options(&self, parameters: FaceParameters) -> Options {
        Options {
            tolerance_mm: self.tolerance_mm,
            untrimmed: false,
            parameters,
            around_mm: job_file::STEP_OVERS_AROUND
                * job::plane_step_over_mm(self.radius_mm, self.scallop_mm()),
        }
    }
}

/// Where the jobs are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobFolder {
    /// The folder, which exists; regions are kept in it.
    pub path: PathBuf,
    /// Path of the CAD file from the folder, `/` between names; `None` where TOML cannot express it.
    pub source: Option<String>,
}

/// A face's surface, or why it has none.
pub(crate) type FaceSurface = Result<Arc<MachinableFace>, CadError>;

/// Plans the jobs of the faces of a part.
pub struct Planner<'a> {
    /// The CAD file, for messages and comments.
    pub(crate) file: &'a str,
    pub(crate) model: &'a Arc<Model>,
    pub(crate) cut: &'a CutOptions,
    /// The faces, each with its surface; a face of four edges has its parameters between them.
    faces: Vec<(&'a Face, FaceSurface)>,
}

impl<'a> Planner<'a> {
    /// A planner for these faces of the model of `file`. Makes their surfaces, on all cores.
    #[must_use]
    pub fn new(file: &'a str, model: &'a Arc<Model>, faces: &[&'a Face], cut: &'a CutOptions) -> Self {
        let options = cut.surface_options(FaceParameters::Edges);
        let surfaces = faces
            .par_iter()
            .map(|face| (*face, machinable_once(file, model, face.number, &options)));
        Self {
            file,
            model,
            cut,
            faces: surfaces.collect(),
        }
    }

    /// The setup with this side up.
    #[must_use]
    pub fn setup(&self, side: UpSide) -> PartSetup {
        PartSetup::new(side, self.model, self.cut.tool(), self.cut.scallop_mm())
    }

    /// The setup in which the tool reaches the largest area; of equal ones the first of [`UpSide::ALL`].
    #[must_use]
    pub fn best_setup(&self) -> PartSetup {
        let tried = UpSide::ALL.map(|side| {
            let setup = self.setup(side);
            let known = self
                .faces
                .par_iter()
                .filter_map(|(face, surface)| Some((face, surface.as_ref().ok()?)));
            let reached: f64 = known
                .map(|(face, surface)| setup.reach(face, surface, UP_SIDE_PLACES).reachable_mm2)
                .sum();
            (reached, side)
        });
        let best = tried.into_iter().fold(
            (-1.0, UpSide::PlusZ),
            |best, one| if one.0 > best.0 { one } else { best },
        );
        self.setup(best.1)
    }

    /// The reach of each face, in the order of the faces; an error for a face without a surface. `done` is called after each face, from several threads.
    #[must_use]
    pub fn reaches(&self, setup: &PartSetup, done: impl Fn() + Sync) -> Vec<Result<FaceReach, CadError>> {
        let found = self.faces.par_iter().map(|(face, surface)| {
            let reach = match surface {
                Ok(surface) => Ok(setup.reach(face, surface, REACH_PLACES)),
                Err(error) => Err(error.clone()),
            };
            done();
            reach
        });
        found.collect()
    }

    /// The plan of each face, in the order of the faces. `done` is called after each face, from several threads.
    #[must_use]
    pub fn plans(&self, setup: &PartSetup, folder: &JobFolder, done: impl Fn() + Sync) -> Vec<FacePlan> {
        let plans = self.faces.par_iter().map(|(face, surface)| {
            let plan = self.plan(setup, folder, face, surface);
            done();
            plan
        });
        plans.collect()
    }

    /// The better of a face's plans: with parameters between its edges, and with those of its own surface.
    fn plan(&self, setup: &PartSetup, folder: &JobFolder, face: &Face, by_edges: &FaceSurface) -> FacePlan {
        let mut plan = self.plan_with(setup, folder, face, by_edges);
        // Lines between edges that are not parallel spread: the surface's own parameters may take less time.
        if by_edges.as_ref().is_ok_and(|surface| surface.by_edges) {
            let options = self.cut.surface_options(FaceParameters::Surface);
            let own = machinable_once(self.file, self.model, face.number, &options);
            let other = self.plan_with(setup, folder, face, &own);
            if other.is_better_than(&plan) {
                plan = other;
            }
        }
        plan.draw(setup, face);
        plan
    }

    /// The order in which the faces that have a job are machined.
    #[must_use]
    pub fn order(&self, setup: &PartSetup, plans: &[FacePlan]) -> FaceOrder {
        let jobs = plans.iter().enumerate();
        let (faces, ends_mm): (Vec<usize>, Vec<_>) = jobs
            .filter_map(|(index, plan)| Some((index, plan.job.as_ref()?.ends_mm)))
            .unzip();
        let links = FaceLinks::new(
            &HeightMap::new(&setup.part, self.cut.radius_mm),
            &Times::new(
                self.cut.feed_mm_min() / job::units::S_PER_MIN,
                AxisLimits::DEFAULT,
            ),
            &ends_mm,
            setup.home_mm(),
        );
        let order = links.order();
        FaceOrder {
            links_s: links.sum_s(&order),
            faces: order.into_iter().map(|place| faces[place]).collect(),
        }
    }
}
