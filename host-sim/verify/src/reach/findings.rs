//! The result, in figures and in sentences.

use glam::DVec3;
use job::Job;
use oracle::{Facing, turned_further};

use super::body::ToolPart;
use super::contact::ContactSide;
use super::path::CHORD_MM;
use crate::Verdict;

/// A part of the tool that is deeper than this in an obstacle touches it, mm.
pub const TOUCH_MM: f64 = 2e-3;

/// What a part of the tool may touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// The surface.
    Surface,
    /// The stock.
    Stock,
    /// A fixture, by its index.
    Fixture(usize),
}

impl Obstacle {
    /// Its name in a sentence.
    #[must_use]
    pub fn describe(self, job: &Job) -> String {
        match self {
            Self::Fixture(_) => self.name(job),
            _ => format!("the {}", self.name(job)),
        }
    }

    /// Its name in a job.
    #[must_use]
    pub fn name(self, job: &Job) -> String {
        match self {
            Self::Surface => "surface".to_owned(),
            Self::Stock => "stock".to_owned(),
            Self::Fixture(index) => {
                let name = job.setup.fixtures.get(index).map(|fixture| fixture.name.as_str());
                format!("fixture {}", job::one_line(name.unwrap_or_default()))
            }
        }
    }
}

/// A part of the tool against an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachFinding {
    /// The part.
    pub part: ToolPart,
    /// The obstacle.
    pub obstacle: Obstacle,
    /// Largest depth of the obstacle in the part, mm: the shortest motion that frees it. Below zero: the distance. Minus infinity where nothing
    /// was near enough to be measured.
    pub depth_mm: f64,
    /// Upper bound of it, mm.
    pub bound_mm: f64,
    /// Place of the obstacle, mm.
    pub place_mm: DVec3,
    /// Centre of the ball, mm.
    pub centre_mm: DVec3,
    /// Sample of the motion, from 0.
    pub sample: usize,
    /// (u, v) on the surface.
    pub uv: Option<[f64; 2]>,
}

impl ReachFinding {
    /// Whether the part touches the obstacle.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.depth_mm > TOUCH_MM + CHORD_MM {
            Verdict::Violated
        } else if self.bound_mm <= TOUCH_MM + 2.0 * CHORD_MM {
            Verdict::Met
        } else {
            Verdict::Unknown
        }
    }

    /// The obstacle in a sentence; the ball is sought in the surface between passes only.
    #[must_use]
    pub fn describe(&self, job: &Job) -> String {
        match (self.part, self.obstacle) {
            (ToolPart::Ball, Obstacle::Surface) => "the surface between passes".to_owned(),
            (_, obstacle) => obstacle.describe(job),
        }
    }

    /// What frees the part.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match (self.part, self.obstacle) {
            (ToolPart::Ball, Obstacle::Surface) => {
                "raise safe_z_mm, let turns overrun less (overrun_mm), or take a smaller ball"
            }
            (ToolPart::Ball, _) => "raise safe_z_mm, or move what is in the way",
            (ToolPart::Holder(_), _) => "take a longer tool (length_mm) or a slimmer holder",
            (_, Obstacle::Surface) => {
                "take a slimmer shank, a longer neck or a larger ball, or turn the part"
            }
            (_, _) => "take a slimmer or longer tool, raise safe_z_mm, or move what is in the way",
        }
    }

    /// Depth, mm, if the part touches; else 0.
    #[must_use]
    pub fn touch_mm(&self) -> f64 {
        if self.verdict() == Verdict::Violated {
            self.depth_mm
        } else {
            0.0
        }
    }

    /// Least distance, mm, if the part is surely off the obstacle.
    #[must_use]
    pub fn clearance_mm(&self) -> Option<f64> {
        (self.bound_mm < 0.0).then_some(-self.bound_mm)
    }
}

/// The reach of a job's tool.
#[derive(Clone, Debug)]
pub struct ReachResult {
    /// Which half of the ball touches.
    pub contact: ContactSide,
    /// The part of the surface that looks down; the turn in it applies to the placed surface.
    pub facing: Facing,
    /// The job's `rotate_deg` with which nothing would look down; `None` where there is none, or none is needed.
    pub rotate_deg: Option<[f64; 3]>,
    /// Parts against obstacles.
    pub findings: Vec<ReachFinding>,
    /// One sentence for each reason against the job, with the remedy.
    pub failures: Vec<String>,
}

impl ReachResult {
    pub(super) fn new(job: &Job, contact: ContactSide, facing: Facing, findings: Vec<ReachFinding>) -> Self {
        let rotate_deg = facing
            .turn_deg
            .filter(|turn| turn.iter().any(|angle| *angle != 0.0))
            .map(|turn| turned_further(job.origin.rotate_deg(), turn));
        let mut result = Self {
            contact,
            facing,
            rotate_deg,
            findings,
            failures: Vec::new(),
        };
        result.failures = result.sentences(job);
        result
    }

    /// The verdict on the whole.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let all = || {
            let findings = self.findings.iter().map(ReachFinding::verdict);
            findings.chain([self.contact.verdict()])
        };
        if all().any(|verdict| verdict == Verdict::Violated) {
            Verdict::Violated
        } else if all().any(|verdict| verdict == Verdict::Unknown) {
            Verdict::Unknown
        } else {
            Verdict::Met
        }
    }

    fn sentences(&self, job: &Job) -> Vec<String> {
        let mut sentences = Vec::new();
        if let (Verdict::Violated, Some(at)) = (self.contact.verdict(), self.contact.at) {
            let remedy = match self.rotate_deg {
                Some(turn) => format!("turn the part: rotate_deg = {turn:?} in [placement]"),
                None => format!(
                    "{:.1} % of the surface looks down, and no turn changes that: machine it in several jobs, each of a part that looks up",
                    100.0 * self.facing.down_share
                ),
            };
            sentences.push(format!(
                "reach: at {} of {} contacts the surface touches the ball above its equator, by {:.4} mm at u = {:.6}, v = {:.6}, pass {}: no tool \
                 along z is there; {remedy}",
                self.contact.above_equator, self.contact.contacts, self.contact.height_max_mm, at.uv[0], at.uv[1], at.pass
            ));
        }
        for finding in &self.findings {
            sentences.extend(sentence(job, finding));
        }
        sentences
    }
}

fn sentence(job: &Job, finding: &ReachFinding) -> Option<String> {
    let (part, obstacle) = (finding.part.name(), finding.describe(job));
    let [x, y, z] = finding.place_mm.to_array();
    let at = format!("x = {x:.3}, y = {y:.3}, z = {z:.3}, at tick {}", finding.sample);
    match finding.verdict() {
        Verdict::Met => None,
        Verdict::Unknown => Some(format!(
            "reach: whether the {part} touches {obstacle} could not be measured: up to {:.4} mm near {at}",
            finding.bound_mm
        )),
        Verdict::Violated => Some(format!(
            "reach: the {part} is {:.4} mm deep in {obstacle} at {at}; {}",
            finding.depth_mm,
            finding.remedy()
        )),
    }
}
