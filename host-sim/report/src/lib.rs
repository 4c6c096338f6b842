//! Pictures and pages of a run.
//!
//! ```text
//! samples ─┬─ record.rs ─► drawn passes ─┬─ scene.rs, picture.rs, furniture.rs, marks.rs ─► path.svg
//!          │     job ─► mesh.rs, view.rs ┤                                          │
//!          ├─ track.rs ──► all passes, thinned ─┐                                   │
//!          ├─ series.rs ─► spans of time ───────┼─ payload.rs ─► data ─┬─ page.rs ──► index.html
//!          ├─ scallops.rs ─► heights ───────────┤   viewer/: scripts ──┘
//!          ├─ binding.rs ──► speed and limits ──┤
//!          └─ setting.rs ──► marks, machine ────┘
//! ```
//!
//! `page`, `number` and `svg` also serve the page of `cargo sim paper` (crate `study`).
//!
//! The path is drawn from the emitted samples; the surface, the arc lengths, the errors and the distances between passes come
//! from the oracle. The output contains no local path and loads nothing from the network.
//!
//! The stored data of a run is bounded. A point of the view represents the worst of its samples, a point of a chart the minimum and
//! the maximum, and the page states the number of samples per point.

mod binding;
mod content;
#[cfg(test)]
mod data_tests;
mod embed;
mod furniture;
mod marks;
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
mod setting;
pub mod svg;
#[cfg(test)]
mod tests;
mod texts;
mod track;
mod view;

use std::io;
use std::path::{Path, PathBuf};

use job::Job;
use oracle::{Oracle, PassSample, SampleCheck};
use verify::survey::SurveyResult;

use content::Content;
use texts::PictureTexts;

pub use content::{Figure, Mark, Remarks};
pub use scallops::{RidgePoint, Scallops};

/// Collects the data of a report in bounded memory, independent of the length of the run.
#[derive(Clone, Debug)]
pub struct Sketch {
    job: Job,
    /// Name of the approach; `None`: the product, on the core.
    approach: Option<&'static str>,
    record: record::Record,
    track: track::Track,
    series: series::Series,
}

impl Sketch {
    /// A sketch of a run of this job. `passes`: expected number, which determines the passes that are drawn.
    #[must_use]
    pub fn new(job: &Job, passes: usize) -> Self {
        let record = record::Record::new(job, passes);
        let period_s = job.machine.period_s();
        Self {
            job: job.clone(),
            approach: None,
            track: track::Track::new(job.feed_mm_s(), period_s, passes),
            series: series::Series::new(period_s, record.middle_pass),
            record,
        }
    }

    /// Names the approach of a run that is not the core's.
    #[must_use]
    pub fn by(self, approach: &'static str) -> Self {
        Self {
            approach: Some(approach),
            ..self
        }
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
        let words = PictureTexts::new(&self.job, &self.record, job_name, findings);
        let mesh = mesh::Mesh::new(&oracle);
        let marks = marks::Marks::default();
        Ok(picture::picture(&mesh, &self.record, self.job.radius_mm, &words, &marks).svg)
    }

    /// Writes `path.svg` and `index.html` into a folder, which is created if missing, and returns the path of the page.
    /// `job_name`: path of the job file; only the file name is shown.
    ///
    /// # Errors
    /// The folder or the files cannot be written, or `side = "up"` and the surface has no upper side.
    pub fn write(
        &self,
        directory: &Path,
        job_name: &Path,
        findings: &SurveyResult,
        remarks: &Remarks,
    ) -> io::Result<PathBuf> {
        let oracle = Oracle::new(&self.job).map_err(io::Error::other)?;
        let mesh = mesh::Mesh::new(&oracle);
        let words = PictureTexts::new(&self.job, &self.record, job_name, findings);
        let marks = marks::Marks::new(&oracle, remarks);
        let picture = picture::picture(&mesh, &self.record, self.job.radius_mm, &words, &marks);
        let page = page::page(&Content {
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
