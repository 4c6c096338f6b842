//! Pictures and pages of a run.
//!
//! ```text
//! samples ─┬─ record.rs ──► some passes ─┬─ scene.rs, picture.rs, furniture.rs ─► path.svg
//!          │     job ─► mesh.rs, view.rs ┤                                          │
//!          ├─ track.rs ──► all passes, thinned ─┐                                   │
//!          ├─ series.rs ─► spans of time ───────┼─ payload.rs ─► data ─┬─ page.rs ──► index.html
//!          └─ scallops.rs ─► heights ───────────┘   viewer/: scripts ──┘
//! study of the paper ─► chart.rs, paper/ ──────────────────────────────► index.html of `cargo sim paper`
//! ```
//!
//! All is drawn from the emitted samples; only the surface under them, the arc lengths, the errors and the distances
//! between passes are the oracle's. Nothing that is written names a folder of this machine or asks for the network.
//!
//! What is kept of a run is bounded, and nothing is left out in silence: a point of the view stands for the worst of its
//! samples, a point of a chart for the least and the largest, and the page says for how many.
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

#[cfg(test)]
mod data_tests;
mod embed;
mod furniture;
mod measure;
mod mesh;
pub mod number;
pub mod page;
mod payload;
mod picture;
mod record;
mod scallops;
mod scene;
mod series;
pub mod svg;
#[cfg(test)]
mod tests;
mod track;
mod vector;
mod view;

use std::io;
use std::path::{Path, PathBuf};

use approach::Kind;
use job::Job;
use oracle::{Oracle, PassSample, SampleCheck};
use verify::survey::SurveyResult;

pub use scallops::{RidgePlace, Scallops};

/// A figure for the page's summary.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What it is.
    pub what: String,
    /// Its value, as people read it.
    pub value: String,
}

/// What a page says besides what the samples show.
#[derive(Clone, Debug, Default)]
pub struct Remarks {
    /// What is wrong with the run, worst first: a fault with its remedy, a figure out of its bound. A sentence each; lines after
    /// the first are what helps.
    pub failures: Vec<String>,
    /// What is not wrong, but has to be known.
    pub warnings: Vec<String>,
    /// Whether the run was checked as a whole, so that a page without failures may say that it passed.
    pub verified: bool,
    /// Figures that the command found besides those of the samples.
    pub figures: Vec<Figure>,
    /// Scallop heights, if they were measured.
    pub scallops: Option<Scallops>,
}

/// Gathers what the report of a run shows: a bounded amount of data, whatever the run's length.
#[derive(Clone, Debug)]
pub struct Sketch {
    job: Job,
    approach: Kind,
    record: record::Record,
    track: track::Track,
    series: series::Series,
}

impl Sketch {
    /// A sketch of a run of this job. `passes`: how many are expected; it decides which of them are drawn.
    #[must_use]
    pub fn new(job: &Job, passes: usize) -> Self {
        let record = record::Record::new(job, passes);
        let period_s = job.machine.period_s();
        Self {
            job: job.clone(),
            approach: Kind::Surface,
            track: track::Track::new(job.feed_mm_s(), period_s, passes),
            series: series::Series::new(period_s, record.middle_pass),
            record,
        }
    }

    /// The same for a run by this approach.
    #[must_use]
    pub fn by(self, approach: Kind) -> Self {
        Self { approach, ..self }
    }

    /// The next sample of the run, in the order of the ticks, with what its check found.
    pub fn add(&mut self, sample: &PassSample, checked: &SampleCheck) {
        self.record.add(sample);
        self.track.add(sample, checked);
        self.series.add(sample, checked);
    }

    /// The picture of the surface and its passes, SVG. `job_name`, `findings`: as for [`Sketch::write`].
    ///
    /// # Errors
    /// The job asks for an upper side that the surface does not have.
    pub fn picture(&self, job_name: &Path, findings: &SurveyResult) -> io::Result<String> {
        let oracle = Oracle::new(&self.job).map_err(io::Error::other)?;
        let words = page::words(&self.job, &self.record, job_name, findings);
        let mesh = mesh::Mesh::new(&oracle);
        Ok(picture::picture(&mesh, &self.record, self.job.radius_mm, &words).svg)
    }

    /// Writes `path.svg` and `index.html` into a folder, which is made if there is none, and returns the page's path.
    /// `job_name`: the job's file, of which only the name is shown.
    ///
    /// # Errors
    /// The folder or the files cannot be written, or the job asks for an upper side that the surface does not have.
    pub fn write(
        &self,
        directory: &Path,
        job_name: &Path,
        findings: &SurveyResult,
        remarks: &Remarks,
    ) -> io::Result<PathBuf> {
        let oracle = Oracle::new(&self.job).map_err(io::Error::other)?;
        let mesh = mesh::Mesh::new(&oracle);
        let words = page::words(&self.job, &self.record, job_name, findings);
        let picture = picture::picture(&mesh, &self.record, self.job.radius_mm, &words);
        let page = page::page(&page::Content {
            job: &self.job,
            approach: self.approach,
            oracle: &oracle,
            mesh: &mesh,
            record: &self.record,
            track: &self.track,
            series: &self.series.finished(),
            findings,
            remarks,
            words: &words,
            picture: &picture,
        });
        std::fs::create_dir_all(directory)?;
        std::fs::write(directory.join("path.svg"), &picture.svg)?;
        let path = directory.join("index.html");
        std::fs::write(&path, page)?;
        Ok(path)
    }
}
