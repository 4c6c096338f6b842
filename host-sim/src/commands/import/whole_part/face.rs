//! A face of a part: its reach, its region, its job.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use cad::{CadError, Face, JobOptions, MachinableFace, Placement, write_job};
use glam::DVec3;
use job::{Along, FaceParameters, FaceReach, Job, Pattern, Region, SurfaceSpec};
use part::{Inside, Part, Request, Tool};

use super::super::{Arguments, relative};
use super::effort::{Passes, is_better};
use super::setup::Setup;

/// Places a side at which it is asked whether anything of a face is reached, and how much.
const LOOK_SIDE: usize = 12;
const REACH_SIDE: usize = 64;

/// What becomes of a face.
pub(super) struct Outcome {
    pub(super) number: usize,
    /// Area and reach; `None` if the face is not known.
    pub(super) reach: Option<FaceReach>,
    /// Why it has no job.
    pub(super) refused: Option<String>,
    pub(super) region: Option<(Region, SurfaceSpec)>,
    pub(super) job: Option<PathBuf>,
    /// The ball's centre at the start of the first pass and at the end of the last, about, mm.
    pub(super) ends_mm: [DVec3; 2],
    pub(super) text: String,
    /// Direction of the passes, side of the tool and parameters of the surface, as in job files.
    pub(super) along: &'static str,
    pub(super) side: &'static str,
    pub(super) parameters: FaceParameters,
    /// Time of the passes, about, s, and the share of the area that they leave too high.
    effort: [f64; 2],
    /// The surface.
    pub(super) made: Option<Arc<MachinableFace>>,
    /// The face in cells, each with its colour; none for a plane, whose regions are exact polygons.
    pub(super) cells: Vec<([u8; 3], [[f64; 3]; 4])>,
}

/// The request for the region of a face with this surface.
pub(super) struct Asked<'a> {
    pub(super) part: &'a Part,
    pub(super) tool: &'a Tool,
    pub(super) scallop_mm: f64,
    pub(super) setup: &'a Setup,
}

impl Asked<'_> {
    /// Something of the request for the region of a face.
    pub(super) fn of<T>(
        &self,
        face: &Face,
        sign: f64,
        made: &MachinableFace,
        take: impl FnOnce(&Request<'_>) -> T,
    ) -> T {
        let placed = face.placed(&self.setup.placement);
        let spec = made.spec();
        let [[u0, u1], [v0, v1]] = spec.domain();
        let whole = vec![vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1]]];
        // In the coordinates of the file the surface is placed by its poles.
        let surface = oracle::Surface::new(&moved(&spec, &self.setup.placement));
        let request = Request {
            surface: &surface,
            trimmed: made.trimmed.as_ref().unwrap_or(&whole),
            face: placed.as_ref().unwrap_or(face),
            placement: &Placement::IDENTITY,
            sign,
            tool: self.tool,
            scallop_mm: self.scallop_mm,
            steepest_deg: job_file::STEEPEST_DEG,
            touch_mm: job_file::PART_TOLERANCE_MM,
            part: Some((self.part, self.part.index(face.number))),
        };
        take(&request)
    }

    /// The side of a face that is machined: out of the material. Of one that bounds no solid the file does not tell where that is: the side of which more
    /// is reached.
    fn sign(&self, face: &Face, made: &MachinableFace) -> f64 {
        if face.solid {
            return face.sense;
        }
        let reached = |sign| {
            self.of(face, sign, made, |request| request.reach(LOOK_SIDE))
                .reachable_mm2
        };
        if reached(-face.sense) > reached(face.sense) {
            -face.sense
        } else {
            face.sense
        }
    }

    pub(super) fn reach(&self, face: &Face, made: &MachinableFace, side: usize) -> FaceReach {
        let found = self.of(face, self.sign(face, made), made, |request| request.reach(side));
        FaceReach {
            area_mm2: found.area_mm2,
            reachable_mm2: found.reachable_mm2,
            unreachable_mm2: found
                .unreachable_mm2
                .iter()
                .map(|(reason, area)| (reason.name().to_owned(), *area))
                .collect(),
            ..FaceReach::default()
        }
    }
}

/// A surface by its poles, transformed.
pub(super) fn moved(spec: &SurfaceSpec, by: &Placement) -> SurfaceSpec {
    let SurfaceSpec::Nurbs(nurbs) = spec else {
        return spec.clone();
    };
    let mut nurbs = nurbs.clone();
    for pole in nurbs.poles_mm.iter_mut().flatten() {
        let [x, y, z, weight] = *pole;
        let [x, y, z] = by.point([x, y, z].into()).to_array();
        *pole = [x, y, z, weight];
    }
    SurfaceSpec::Nurbs(nurbs)
}

/// What becomes of a face; its job is not written yet. Of the surfaces that it can have, each with its parameters, the one that takes less time is taken.
pub(super) fn outcome(
    arguments: &Arguments,
    file: &str,
    face: &Face,
    made: &[std::result::Result<Arc<MachinableFace>, CadError>],
    asked: &Asked<'_>,
    folder: &Path,
) -> Outcome {
    let mut best: Option<Outcome> = None;
    for made in made {
        let found = match made {
            Ok(made) => with_surface(arguments, file, face, made, asked, folder),
            Err(error) => Outcome {
                refused: Some(error.what.clone()),
                ..Outcome::none(face)
            },
        };
        best = Some(match best {
            Some(best) if !found.is_better_than(&best) => best,
            _ => found,
        });
    }
    best.unwrap_or_else(|| Outcome::none(face))
}

impl Outcome {
    /// No job yet.
    fn none(face: &Face) -> Self {
        Self {
            number: face.number,
            reach: None,
            refused: None,
            region: None,
            job: None,
            ends_mm: [DVec3::ZERO; 2],
            text: String::new(),
            along: "u",
            side: if face.sense > 0.0 { "+" } else { "-" },
            parameters: FaceParameters::default(),
            effort: [0.0; 2],
            made: None,
            cells: Vec::new(),
        }
    }

    /// Whether its job is better than another one's, by the rule for the direction of passes.
    fn is_better_than(&self, other: &Self) -> bool {
        match (&self.region, &other.region) {
            (Some(_), Some(_)) => is_better(self.effort, other.effort),
            (is_job, _) => is_job.is_some(),
        }
    }

    /// Time of the passes, about, s.
    pub(super) const fn passes_s(&self) -> f64 {
        self.effort[0]
    }
}

/// What becomes of a face with a surface.
fn with_surface(
    arguments: &Arguments,
    file: &str,
    face: &Face,
    made: &Arc<MachinableFace>,
    asked: &Asked<'_>,
    folder: &Path,
) -> Outcome {
    let face = &Face {
        sense: asked.sign(face, made),
        // From here on its side is known.
        solid: true,
        ..face.clone()
    };
    let mut outcome = Outcome {
        parameters: made.parameters,
        made: Some(Arc::clone(made)),
        ..Outcome::none(face)
    };
    // Where a few places tell that something is reached, the region tells how much.
    if asked.reach(face, made, LOOK_SIDE).reachable_mm2 == 0.0 {
        let reach = asked.reach(face, made, REACH_SIDE);
        let is_reached = reach.reachable_mm2 > 0.0;
        outcome.reach = Some(reach);
        if !is_reached {
            return outcome;
        }
    }
    match read_back(arguments, file, face, made, asked, folder) {
        Ok((job, text)) => settle(&mut outcome, arguments, face, made, asked, (job, text)),
        Err(why) => outcome.refused = Some(why),
    }
    outcome
}

/// The job of a face and its text, with passes along u.
fn read_back(
    arguments: &Arguments,
    file: &str,
    face: &Face,
    made: &MachinableFace,
    asked: &Asked<'_>,
    folder: &Path,
) -> std::result::Result<(Job, String), String> {
    // In the folder: paths are relative to it, and the region is kept there.
    let path = folder.join("face.toml");
    let none = Outcome::none(face);
    let along = arguments.along.clone().unwrap_or_else(|| none.along.to_owned());
    let options = JobOptions {
        radius_mm: arguments.radius_mm,
        feed_mm_min: arguments.feed_mm_min,
        scallop_mm: Some(asked.scallop_mm),
        along: Some(along),
        side: Some(none.side.to_owned()),
        pattern: arguments.pattern.clone(),
        in_part: true,
        rotate_deg: asked.setup.up.rotate_deg(),
        translate_mm: asked.setup.translate_mm,
        source: relative(&arguments.file, &path).map(|source| (source, arguments.tolerance)),
    };
    let written = write_job(file, face, made, &options).map_err(|error| error.to_string())?;
    let job = job_file::parse_with(&path.display().to_string(), &written.text, &part::Faces);
    job.map(|job| (job, written.text))
        .map_err(|error| error.what().to_owned())
}

/// Reach, region, direction, time and text of a job.
fn settle(
    outcome: &mut Outcome,
    arguments: &Arguments,
    face: &Face,
    made: &MachinableFace,
    asked: &Asked<'_>,
    (job, text): (Job, String),
) {
    if let Some(reach) = job.origin.reach() {
        outcome.reach = Some(reach.clone());
    }
    let step_over_mm = job.plane_step_over_mm();
    let Some(region) = job.region else {
        return;
    };
    let surface = oracle::Surface::new(&job.surface);
    let inside = Inside::new(&region.loops);
    let mut places = asked.of(face, face.sense, made, |request| {
        request.places(&Inside::new(request.trimmed), REACH_SIDE)
    });
    places.retain(|(place, _)| inside.contains(*place));
    let passes = Passes {
        surface: &surface,
        region: &region,
        step_over_mm,
        feed_mm_s: job.feed_mm_min / 60.0,
        is_zigzag: job.pattern == Pattern::Zigzag,
        places: &places,
    };
    let best = match arguments.along.as_deref() {
        Some("u") => passes.effort(Along::U),
        Some("v") => passes.effort(Along::V),
        _ => passes.best(),
    };
    outcome.along = match best.along {
        Along::U => "u",
        Along::V => "v",
    };
    outcome.effort = [best.time_s, best.left];
    outcome.ends_mm = best.ends.map_or([DVec3::ZERO; 2], |ends| {
        ends.map(|[u, v]| {
            let at = surface.at(u, v);
            let normal = at.u.cross(at.v).normalize_or_zero() * face.sense;
            at.point + normal * job.radius_mm
        })
    });
    outcome.region = Some((region, job.surface));
    outcome.text = match &arguments.along {
        Some(_) => text,
        None => text.replacen("along = \"u\"", &format!("along = \"{}\"", outcome.along), 1),
    };
}
