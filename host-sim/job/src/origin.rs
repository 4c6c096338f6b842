//! Origin of a job: a later error points at the line of the key that causes it.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use crate::{Along, JobError, Spacing, SurfaceSpec};

/// Result of a run of the core with the passes in one direction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DirectionTrial {
    /// The direction.
    pub along: Along,
    /// Periods of the whole job; up to the fault if there is one.
    pub ticks: u64,
    /// Reason for which the job cannot be machined in this direction.
    pub rejection: Option<String>,
}

/// Origin of the direction of the passes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AlongChoice {
    /// The job file names it.
    #[default]
    Given,
    /// The job file requests a trial of both directions; before the trial the job cannot be prepared.
    Auto,
    /// Chosen by trials along u and v, in this order.
    Chosen([DirectionTrial; 2]),
}

/// Result of a run of the core with one rule for the distance between passes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpacingTrial {
    /// The rule, with the start of passes of constant scallop height.
    pub spacing: Spacing,
    /// Periods of the whole job; up to the fault if there is one.
    pub ticks: u64,
    /// Reason for which the job cannot be machined so.
    pub rejection: Option<String>,
}

/// Origin of the start of passes of constant scallop height.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum StartChoice {
    /// The job file names it, or the passes are straight.
    #[default]
    Given,
    /// The job file requests a trial of both; before the trial the job cannot be prepared.
    Auto,
    /// Chosen by trials from the edge and from the middle, in this order, in the direction of the job.
    Chosen([SpacingTrial; 2]),
}

/// The parameters of a face of a CAD file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum FaceParameters {
    /// Along the four edges of the face, which then are the edges of the job's surface; a face without four edges: as [`Self::Surface`].
    #[default]
    Edges,
    /// Parameters of the face's surface, which extends beyond the face where the CAD file's surface does.
    Surface,
}

impl FaceParameters {
    /// Name in job files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Edges => "edges",
            Self::Surface => "surface",
        }
    }
}

/// The face of a CAD file from which a job's surface was made.
#[derive(Clone, Debug, PartialEq)]
pub struct CadSource {
    /// The CAD file, relative to the working directory.
    pub path: PathBuf,
    /// Number of the face in the file, from 1.
    pub face: usize,
    /// Tolerance of an approximation, mm.
    pub tolerance_mm: f64,
    /// A trimmed face is machined over the rectangle that encloses it.
    pub untrimmed: bool,
    /// Choice of the face's parameters.
    pub parameters: FaceParameters,
    /// The job's surface before its placement, with the parameters of the face if it is an approximation.
    pub surface: SurfaceSpec,
    /// Distance by which the job's surface extends beyond the face where the CAD file's surface does, mm.
    pub around_mm: f64,
    /// The face is trimmed: the job's region is made from it.
    pub trimmed: bool,
    /// Scale of the placement.
    pub scale: f64,
}

/// What must not be cut: all faces of a CAD file.
#[derive(Clone, Debug, PartialEq)]
pub struct PartSource {
    /// The CAD file, relative to the working directory.
    pub path: PathBuf,
    /// Depth to which the tool may enter the part, mm.
    pub tolerance_mm: f64,
    /// Steepest angle of the surface from the horizontal that is machined, degrees.
    pub steepest_deg: f64,
}

/// Reach of a tool over a face.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaceReach {
    /// Area of the face, mm2.
    pub area_mm2: f64,
    /// Area that the tool reaches, mm2.
    pub reachable_mm2: f64,
    /// Reachable area within the job's region, mm2.
    pub region_mm2: f64,
    /// Area that the tool does not reach, mm2, by the first rule that it breaks: `steep`, `degenerate`, `fit`, `ball`, `shank`, `holder`.
    pub unreachable_mm2: Vec<(String, f64)>,
    /// Radius of the largest ball that reaches 99 % of the area that is not too steep, mm; `None` if no ball above 0.05 mm does.
    pub radius_mm: Option<f64>,
    /// Highest point of the whole part, mm; `None` without one.
    pub top_mm: Option<f64>,
    /// Faces of the part that are not known, by their numbers in the file: gouging them is not checked.
    pub unknown: Vec<usize>,
}

/// Origin of a job: the file and the ranges of its keys, to which later errors refer, and the choice of the direction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    name: Arc<str>,
    text: Arc<str>,
    keys: BTreeMap<String, Range<usize>>,
    along_choice: AlongChoice,
    start_choice: StartChoice,
    cad: Option<Arc<CadSource>>,
    part: Option<Arc<PartSource>>,
    reach: Option<Arc<FaceReach>>,
    rotate_deg: [f64; 3],
}

impl Origin {
    /// The origin of a job that gives its direction. `keys`: byte range of each section, and of the value of each `section.key`.
    #[must_use]
    pub fn new(name: &str, text: &str, keys: BTreeMap<String, Range<usize>>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
            keys,
            along_choice: AlongChoice::Given,
            start_choice: StartChoice::Given,
            cad: None,
            part: None,
            reach: None,
            rotate_deg: [0.0; 3],
        }
    }

    /// The file's name as given; empty for a job that does not come from a file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Location of the value of `section.key` (or of the section), and its line: `job.toml:10: radius_mm = 10`.
    #[must_use]
    pub fn quote(&self, key: &str) -> Option<String> {
        let section = key.split('.').next().unwrap_or(key);
        let span = self.keys.get(key).or_else(|| self.keys.get(section))?;
        let before = self.text.get(..span.start)?.matches('\n').count();
        let line = self.text.lines().nth(before)?;
        let line = line.split('#').next().unwrap_or(line).trim();
        Some(format!("{}:{}: {line}", self.name, before + 1))
    }

    /// Origin of the direction of the passes.
    #[must_use]
    pub fn along_choice(&self) -> &AlongChoice {
        &self.along_choice
    }

    /// Records the origin of the direction.
    pub fn set_along_choice(&mut self, choice: AlongChoice) {
        self.along_choice = choice;
    }

    /// Origin of the start of passes of constant scallop height.
    #[must_use]
    pub fn start_choice(&self) -> &StartChoice {
        &self.start_choice
    }

    /// Records the origin of the start.
    pub fn set_start_choice(&mut self, choice: StartChoice) {
        self.start_choice = choice;
    }

    /// Whether a direction or a start is to be chosen by trials.
    #[must_use]
    pub fn has_to_choose(&self) -> bool {
        self.along_choice == AlongChoice::Auto || self.start_choice == StartChoice::Auto
    }

    /// The face of a CAD file that the job names as the source of its surface.
    #[must_use]
    pub fn cad(&self) -> Option<&CadSource> {
        self.cad.as_deref()
    }

    /// Rotation of the job's placement about x, y and z, in this order, degrees.
    #[must_use]
    pub fn rotate_deg(&self) -> [f64; 3] {
        self.rotate_deg
    }

    /// Records the rotation of the placement.
    pub fn set_rotate_deg(&mut self, rotate_deg: [f64; 3]) {
        self.rotate_deg = rotate_deg;
    }

    /// Records the source of the surface.
    pub fn set_cad(&mut self, cad: Option<CadSource>) {
        self.cad = cad.map(Arc::new);
    }

    /// The part that must not be cut.
    #[must_use]
    pub fn part(&self) -> Option<&PartSource> {
        self.part.as_deref()
    }

    /// Records the part.
    pub fn set_part(&mut self, part: Option<PartSource>) {
        self.part = part.map(Arc::new);
    }

    /// What the tool reaches of the face, if the region was made from it.
    #[must_use]
    pub fn reach(&self) -> Option<&FaceReach> {
        self.reach.as_deref()
    }

    /// Records what the tool reaches.
    pub fn set_reach(&mut self, reach: FaceReach) {
        self.reach = Some(Arc::new(reach));
    }

    /// An error at the value of `section.key`; at the section, else at the file, where the key is missing.
    #[must_use]
    pub fn error(&self, key: &str, what: impl Into<String>, remedy: impl Into<String>) -> JobError {
        let section = key.split('.').next().unwrap_or(key);
        let span = self
            .keys
            .get(key)
            .or_else(|| self.keys.get(section))
            .cloned()
            .unwrap_or(0..0);
        JobError::at(&self.name, &self.text, span, what.into(), remedy.into())
    }
}
