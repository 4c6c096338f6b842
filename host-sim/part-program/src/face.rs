//! The plan of a face: its reach, its region, its job.

use std::sync::Arc;

use cad::{CadError, Face, JobOptions, MachinableFace, write_job};
use glam::DVec3;
use job::{Along, FaceParameters, FaceReach, Job, JobError, Pattern, Region, SurfaceSpec};
use part::{Inside, State};

use crate::estimate::{PassEstimate, PassEstimator};
use crate::planner::{FaceSurface, JobFolder, Planner};
use crate::setup::{LOOK_SIDE, PartSetup};

/// Places along each parameter at which the reach of a face is measured.
pub(crate) const REACH_SIDE: usize = 64;

/// Cells a side of the picture of a face as large as the part, and the least and the most of a face: of a part of few faces, and of many.
const CELLS: f64 = 80.0;
const CELLS_OF_FACE: [[f64; 2]; 2] = [[24.0, 48.0], [6.0, 32.0]];
/// Number of faces above which they are many.
const MANY: usize = 100;

/// Why a face has no job.
#[derive(Debug, thiserror::Error)]
pub enum FaceRefused {
    /// It has no surface that the board machines.
    #[error("{}", .0.what)]
    Surface(CadError),
    /// No job can be written for it.
    #[error("{0}")]
    Options(CadError),
    /// The job is not valid.
    #[error("{}", .0.what())]
    Job(JobError),
}

/// The job of a face.
#[derive(Clone, Debug)]
pub struct FaceJob {
    /// The job file's text.
    pub text: String,
    /// The region that is machined.
    pub region: Region,
    /// The surface, placed.
    pub surface: SurfaceSpec,
    /// Its passes.
    pub passes: PassEstimate,
    /// The ball's centre at the start of the first pass and at the end of the last, mm; an estimate.
    pub ends_mm: [DVec3; 2],
}

/// What becomes of a face.
#[derive(Debug)]
pub struct FacePlan {
    /// Its number in the file.
    pub number: usize,
    /// Its reach; `None` if the face is not known.
    pub reach: Option<FaceReach>,
    /// Its job; `None` where it is refused, or the tool reaches nothing of it.
    pub job: Option<FaceJob>,
    /// Why it has no job, where that is not its reach.
    pub refused: Option<FaceRefused>,
    /// UpSide of the tool, as in job files.
    pub side: &'static str,
    /// Parameters of the surface.
    pub parameters: FaceParameters,
    /// The face in cells, mm, each with what becomes of it: for a picture. Empty for a plane, whose regions are exact polygons.
    pub cells: Vec<(State, [DVec3; 4])>,
    surface: Option<Arc<MachinableFace>>,
}

impl FacePlan {
    /// Without a job.
    fn new(face: &Face) -> Self {
        Self {
            number: face.number,
            reach: None,
            job: None,
            refused: None,
            side: if face.sense > 0.0 { "+" } else { "-" },
            parameters: FaceParameters::default(),
            cells: Vec::new(),
            surface: None,
        }
    }

    /// Whether its job is better than another one's, by the rule for the direction of passes.
    pub(crate) fn is_better_than(&self, other: &Self) -> bool {
        match (&self.job, &other.job) {
            (Some(job), Some(other)) => job.passes.is_better_than(&other.passes),
            (job, _) => job.is_some(),
        }
    }

    /// Time of the passes, s, an estimate; 0 without a job.
    #[must_use]
    pub fn passes_s(&self) -> f64 {
        self.job.as_ref().map_or(0.0, |job| job.passes.time_s)
    }

    /// Makes the cells of the picture: smaller ones on larger faces.
    pub(crate) fn draw(&mut self, setup: &PartSetup, face: &Face) {
        let Some(surface) = self.surface.as_ref().filter(|_| face.surface.kind() != "plane") else {
            return;
        };
        let block = setup.part.block();
        let share = cad::measure(&surface.spec())
            .size_mm()
            .into_iter()
            .fold(0.0, f64::max)
            / (block.high - block.low).max_element();
        let [least, most] = CELLS_OF_FACE[usize::from(setup.part.faces.len() > MANY)];
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let side = (CELLS * share).clamp(least, most) as usize;
        let loops = self
            .job
            .as_ref()
            .map_or([].as_slice(), |job| job.region.loops.as_slice());
        let sign = if self.side == "-" { -1.0 } else { 1.0 };
        self.cells = setup.request(face, sign, surface, |request| request.picture(loops, side));
    }
}

impl Planner<'_> {
    /// The plan of a face with a surface.
    pub(crate) fn plan_with(
        &self,
        setup: &PartSetup,
        folder: &JobFolder,
        face: &Face,
        surface: &FaceSurface,
    ) -> FacePlan {
        let surface = match surface {
            Ok(surface) => surface,
            Err(error) => {
                return FacePlan {
                    refused: Some(FaceRefused::Surface(error.clone())),
                    ..FacePlan::new(face)
                };
            }
        };
        let face = &Face {
            sense: setup.sign(face, surface),
            // From here on its side is known.
            solid: true,
            ..face.clone()
        };
        let mut plan = FacePlan {
            parameters: surface.parameters,
            surface: Some(Arc::clone(surface)),
            ..FacePlan::new(face)
        };
        // Where a few places show that something is reached, the region measures how much.
        if setup.reach(face, surface, LOOK_SIDE).reachable_mm2 == 0.0 {
            let reach = setup.reach(face, surface, REACH_SIDE);
            let is_reached = reach.reachable_mm2 > 0.0;
            plan.reach = Some(reach);
            if !is_reached {
                return plan;
            }
        }
        match self.read_back(setup, folder, face, surface) {
            Ok((job, text)) => {
                if let Some(reach) = job.origin.reach() {
                    plan.reach = Some(reach.clone());
                }
                plan.job = self.face_job(setup, face, surface, job, text);
            }
            Err(why) => plan.refused = Some(why),
        }
        plan
    }

    /// The job of a face and its text, with passes along u unless the direction is given.
    fn read_back(
        &self,
        setup: &PartSetup,
        folder: &JobFolder,
        face: &Face,
        surface: &MachinableFace,
    ) -> Result<(Job, String), FaceRefused> {
        let options = JobOptions {
            radius_mm: Some(self.cut.radius_mm),
            feed_mm_min: self.cut.feed_mm_min,
            scallop_mm: Some(setup.scallop_mm),
            along: Some(self.cut.along.clone().unwrap_or_else(|| "u".to_owned())),
            side: Some(FacePlan::new(face).side.to_owned()),
            pattern: self.cut.pattern.clone(),
            in_part: true,
            rotate_deg: setup.side.rotate_deg(),
            translate_mm: setup.translate_mm,
            source: folder
                .source
                .clone()
                .map(|source| (source, self.cut.tolerance_mm)),
        };
        let written = write_job(self.file, face, surface, &options).map_err(FaceRefused::Options)?;
        // In the folder: paths are relative to it, and the region is kept there.
        let path = folder.path.join("face.toml");
        let job = job_file::parse_with(&path.display().to_string(), &written.text, &part::Faces);
        job.map(|job| (job, written.text)).map_err(FaceRefused::Job)
    }

    /// Region, direction, time and text of a job; `None` if it has no region.
    fn face_job(
        &self,
        setup: &PartSetup,
        face: &Face,
        machinable: &MachinableFace,
        job: Job,
        text: String,
    ) -> Option<FaceJob> {
        let step_over_mm = job.plane_step_over_mm();
        let feed_mm_s = job.feed_mm_s();
        let region = job.region?;
        let surface = oracle::Surface::new(&job.surface);
        let inside = Inside::new(&region.loops);
        let mut places = setup.request(face, face.sense, machinable, |request| {
            request.places(&Inside::new(request.trimmed), REACH_SIDE)
        });
        places.retain(|(place, _)| inside.contains(*place));
        let estimator = PassEstimator {
            surface: &surface,
            region: &region,
            step_over_mm,
            feed_mm_s,
            is_zigzag: job.pattern == Pattern::Zigzag,
            places: &places,
        };
        let passes = match self.cut.along.as_deref() {
            Some("u") => estimator.along(Along::U),
            Some("v") => estimator.along(Along::V),
            _ => estimator.best(),
        };
        let ends_mm = passes.ends.map_or([DVec3::ZERO; 2], |ends| {
            ends.map(|[u, v]| {
                let at = surface.at(u, v);
                let normal = at.u.cross(at.v).normalize_or_zero() * face.sense;
                at.point + normal * job.radius_mm
            })
        });
        let text = match &self.cut.along {
            Some(_) => text,
            None => text.replacen(
                "along = \"u\"",
                &format!("along = \"{}\"", passes.along.name()),
                1,
            ),
        };
        Some(FaceJob {
            text,
            region,
            surface: job.surface,
            passes,
            ends_mm,
        })
    }
}
