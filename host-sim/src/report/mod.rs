//! Pictures and pages of a run.
//!
//! ```text
//! samples ──record.rs──► a bounded record ──┬─ scene.rs, picture.rs, furniture.rs ─► path.svg
//! job ──oracle──► mesh.rs ──► view.rs ──────┘                                          │
//!                 record, findings ──────────────── chart.rs, curves.rs, page.rs ──────────► index.html
//! study of the paper ────────────────────────────── chart.rs, paper/   ──────────► index.html of `cargo sim paper`
//! ```
//!
//! The picture is drawn from the emitted samples; only the surface under them, the arc lengths and the distances
//! between passes are the oracle's. Nothing that is written names a folder of this machine or asks for the network.

mod chart;
mod curves;
mod furniture;
mod measure;
mod mesh;
mod number;
mod page;
pub mod paper;
mod picture;
mod record;
mod scene;
mod svg;
#[cfg(test)]
mod tests;
mod vector;
mod view;

use std::io;
use std::path::{Path, PathBuf};

use crate::approach::Kind;
use crate::job_file::JobFile;
use crate::oracle::{Emitted, Oracle};
use crate::survey::Findings;

/// Gathers what the report of a run shows: a bounded amount of data, whatever the run's length.
#[derive(Clone, Debug)]
pub struct Sketch {
    job: JobFile,
    approach: Kind,
    record: record::Record,
}

impl Sketch {
    /// A sketch of a run of this job. `passes`: how many are expected; it decides which of them are drawn.
    #[must_use]
    pub fn new(job: &JobFile, passes: usize) -> Self {
        Self {
            job: job.clone(),
            approach: Kind::Surface,
            record: record::Record::new(job, passes),
        }
    }

    /// The same for a run by this approach.
    #[must_use]
    pub fn by(self, approach: Kind) -> Self {
        Self { approach, ..self }
    }

    /// The next sample of the run, in the order of the ticks.
    pub fn add(&mut self, sample: &Emitted) {
        self.record.add(sample);
    }

    /// The picture of the surface and its passes, SVG. `job_name`, `findings`: as for [`Sketch::write`].
    ///
    /// # Errors
    /// The job asks for an upper side that the surface does not have.
    pub fn picture(&self, job_name: &Path, findings: &Findings) -> io::Result<String> {
        let oracle = Oracle::new(&self.job).map_err(io::Error::other)?;
        let words = page::words(&self.job, &self.record, job_name, findings);
        Ok(picture::picture(
            &mesh::Mesh::new(&oracle),
            &self.record,
            self.job.radius_mm,
            &words,
        ))
    }

    /// Writes `path.svg` and `index.html` into a folder, which is made if there is none, and returns the page's path.
    /// `job_name`: the job's file, of which only the name is shown.
    ///
    /// # Errors
    /// The folder or the files cannot be written, or the job asks for an upper side that the surface does not have.
    pub fn write(&self, directory: &Path, job_name: &Path, findings: &Findings) -> io::Result<PathBuf> {
        let oracle = Oracle::new(&self.job).map_err(io::Error::other)?;
        let mesh = mesh::Mesh::new(&oracle);
        let words = page::words(&self.job, &self.record, job_name, findings);
        let picture = picture::picture(&mesh, &self.record, self.job.radius_mm, &words);
        let page = page::page(&page::Content {
            job: &self.job,
            approach: self.approach,
            oracle: &oracle,
            record: &self.record,
            findings,
            words: &words,
            picture: &picture,
        })?;
        std::fs::create_dir_all(directory)?;
        std::fs::write(directory.join("path.svg"), &picture)?;
        let path = directory.join("index.html");
        std::fs::write(&path, page)?;
        Ok(path)
    }
}
