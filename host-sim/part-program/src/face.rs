//! The plan of a face: its reach, its region, its job.

use std::sync::Arc;

use cad::{CadError, Face, JobOptions, MachinableFace, write_job};
use glam::DVec3;
use job::{Along, FaceParameters, FaceReach, Job, JobError, Pattern, Region, SurfaceSpec};
use part::{Inside, State};

use crate::estimate::{PassEstimate, PassEstimator};
use crate::planner::{FaceSurface, JobFolder, Planner};
use crate::setup::{COARSE_PLACES, PartSetup};

/// Places along each parameter at which the reach of a face is measured.
pub(crate) const REACH_PLACES: usize = 64;

/// Picture cells along each parameter of a face as large as the part; smaller faces have fewer in proportion.
const CELLS: f64 = 80.0;
/// Least and greatest number of picture cells along each parameter of a face.
const CELLS_RANGE: [f64; 2] = [24.0, 48.0];
/// [`CELLS_RANGE`] for a part of more than [`MANY`] faces, so that its picture stays small.
const CELLS_RANGE_OF_MANY: [f64; 2] = [6.0, 32.0];
/// Number of faces above which a part has many.
const MANY: usize = 100;

/// Why a face has no job.
#[derive(Debug, thiserror::Error)]
pub enum FaceRefused {
    /// The face has no surface that the board machines.
    #[error("{}", .0.what)]
    Surface(CadError),
    /// No job can be written for the face.
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
    /// The passes, estimated.
    pub passes: PassEstimate,
    /// Estimated position of the ball's centre at the start of the first pass and at the end of the last one, mm.
    pub ends_mm: [DVec3; 2],
}

/// The plan of a face: its reach, and its job or the reason for having none.
#[derive(Debug)]
pub struct FacePlan {
    /// Number of the face in the file.
    pub number: usize,
    /// Reach of the tool over the face; `None` if it was not measured: without a surface, or without a valid job.
    pub reach: Option<FaceReach>,
    /// Job of the face; `None` where it is refused, or the tool reaches nothing of it.
    pub job: Option<FaceJob>,
    /// Why the face is refused; `None` for one with a job, and for one that the tool does not reach.
    pub refused: Option<FaceRefused>,
    /// Machined side, sign on `S_u x S_v`: `"+"` or `"-"`, as in job files.
    pub side: &'static str,
    /// Parameters of the surface.
    pub parameters: FaceParameters,
    /// Picture of the face: corners of each cell, mm, and the state of its middle. Empty for a plane, whose regions are exact polygons.
    pub cells: Vec<(State, [DVec3; 4])>,
    surface: Option<Arc<MachinableFace>>,
}

impl FacePlan {
    /// A plan without reach and job.
    fn new(face: &Face) -> Self {
        Self {
            number: face.number,
            reach: None,
            job: None,
            refused: None,
            side: side_of(face),
            parameters: FaceParameters::default(),
            cells: Vec::new(),
            surface: None,
        }
    }

    /// Whether this plan's job is better than the other plan's ([`PassEstimate::is_better_than`]); a job is better than none.
    pub(crate) fn is_better_than(&self, other: &Self) -> bool {
        match (&self.job, &other.job) {
            (Some(job), Some(other)) => job.passes.is_better_than(&other.passes),
            (job, _) => job.is_some(),
        }
    }

    /// Estimated time of the passes, s; 0 without a job.
    #[must_use]
    pub fn passes_s(&self) -> f64 {
        self.job.as_ref().map_or(0.0, |job| job.passes.time_s)
    }

    /// Makes the cells of the picture: more of them on a larger face.
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
        let [least, most] = if setup.part.faces.len() > MANY {
            CELLS_RANGE_OF_MANY
        } else {
            CELLS_RANGE
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let side = (CELLS * share).clamp(least, most) as usize;
        let loops = self
            .job
            .as_ref()
            .map_or([].as_slice(), |job| job.region.loops.as_slice());
        let sign = if self.side == "-" { -1.0 } else { 1.0 };
        self.cells = setup.with_request(face, sign, surface, |request| request.picture(loops, side));
    }
}

/// The machined side of a face as in job files.
const fn side_of(face: &Face) -> &'static str {
    if face.sense > 0.0 { "+" } else { "-" }
}

impl Planner<'_> {
    /// The plan of a face with this surface.
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
            // The machined side is known from here on.
            solid: true,
            ..face.clone()
        };
        let mut plan = FacePlan {
            parameters: surface.parameters,
            surface: Some(Arc::clone(surface)),
            ..FacePlan::new(face)
        };
        // Where a coarse look finds reachable places, making the region measures the reach.
        if setup.reach(face, surface, COARSE_PLACES).reachable_mm2 == 0.0 {
            let reach = setup.reach(face, surface, REACH_PLACES);
            let is_reached = reach.reachable_mm2 > 0.0;
            plan.reach = Some(reach);
            if !is_reached {
                return plan;
            }
        }
        match self.written_job(setup, folder, face, surface) {
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

    /// Writes the job of a face and reads it, which makes its region: the job and its text. Passes are along u unless the direction is given.
    fn written_job(
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
            side: Some(side_of(face).to_owned()),
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
        // A path in the folder: the job's paths are relative to it, and the region is cached beside it.
        let path = folder.path.join("face.toml");
        let job = job_file::parse_with(&path.display().to_string(), &written.text, &part::Faces);
        job.map(|job| (job, written.text)).map_err(FaceRefused::Job)
    }

    /// The job of a face with its direction chosen; `None` if it has no region.
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
        let mut places = setup.with_request(face, face.sense, machinable, |request| {
            request.places(&Inside::new(request.trimmed), REACH_PLACES)
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
