//! The content of the page: the job, the data of its run, and the findings.

use super::mesh::Mesh;
use super::picture::Picture;
use super::record::Record;
use super::scallops::Scallops;
use super::series::Series;
use super::texts::PictureTexts;
use super::track::Track;
use glam::DVec3;
use job::Job;
use oracle::Oracle;
use verify::motion::PassTime;
use verify::survey::SurveyResult;

/// A figure in the summary of the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name.
    pub what: String,
    /// Value and unit, formatted.
    pub value: String,
}

/// A place on the part to which a remark belongs.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// What is there, in a word or two: fault, gouge, shank in the surface.
    pub what: String,
    /// The place, mm.
    pub place_mm: DVec3,
    /// Tick of the tool there.
    pub tick: Option<u64>,
}

/// Remarks on a page besides the figures of the samples.
#[derive(Clone, Debug, Default)]
pub struct Remarks {
    /// Failures of the run, worst first: a fault, a figure out of bounds. One sentence each; further lines are the remedy.
    pub failures: Vec<String>,
    /// Warnings: no failures, but relevant for the run.
    pub warnings: Vec<String>,
    /// Whether all checks were made; only then a page without failures states that the run passed.
    pub verified: bool,
    /// Further figures of the command.
    pub figures: Vec<Figure>,
    /// Scallop heights, if they were measured.
    pub scallops: Option<Scallops>,
    /// Where the samples come from, if not from the core: for the footer.
    pub source: Option<String>,
    /// Places of faults, gouges and the like.
    pub marks: Vec<Mark>,
    /// The ways of the ball's centre between passes, mm.
    pub links_mm: Vec<Vec<DVec3>>,
    /// Passes against the fastest motion within the limits.
    pub passes: Vec<PassTime>,
}

/// Content of the page.
pub(super) struct Content<'a> {
    pub(super) job: &'a Job,
    pub(super) approach: Option<&'static str>,
    pub(super) oracle: &'a Oracle,
    pub(super) mesh: &'a Mesh,
    pub(super) record: &'a Record,
    pub(super) track: &'a Track,
    /// Finished.
    pub(super) series: &'a Series,
    pub(super) findings: &'a SurveyResult,
    pub(super) remarks: &'a Remarks,
    pub(super) words: &'a PictureTexts,
    pub(super) picture: &'a Picture,
}
