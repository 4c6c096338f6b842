//! Where a job came from: an error found later points at the line of the key that caused it.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use crate::{Along, JobError};

/// One direction of the passes, run on the core to see what it takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trial {
    /// The direction.
    pub along: Along,
    /// Periods of the whole job; up to the fault where there is one.
    pub ticks: u64,
    /// Why it cannot be machined this way.
    pub against: Option<String>,
}

/// How a job came by the direction of its passes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AlongChoice {
    /// The job file names it.
    #[default]
    Given,
    /// The job file leaves it to the trial of both directions; until then the job cannot be prepared.
    Auto,
    /// It was settled so: u and v, in this order.
    Chosen([Trial; 2]),
}

/// Where a job came from: the file, which an error found later needs to point at the line, and who chose its direction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    name: Arc<str>,
    text: Arc<str>,
    keys: BTreeMap<String, Range<usize>>,
    along_choice: AlongChoice,
}

impl Origin {
    /// The origin of a job that names its direction. `keys`: byte range of each section, and of the value of each `section.key`.
    #[must_use]
    pub fn new(name: &str, text: &str, keys: BTreeMap<String, Range<usize>>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
            keys,
            along_choice: AlongChoice::Given,
        }
    }

    /// The file's name as it was given, empty for a job that came from no file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where the value of `section.key` (or the section) stands, and its line: `job.toml:10: radius_mm = 10`.
    #[must_use]
    pub fn quote(&self, key: &str) -> Option<String> {
        let section = key.split('.').next().unwrap_or(key);
        let span = self.keys.get(key).or_else(|| self.keys.get(section))?;
        let before = self.text.get(..span.start)?.matches('\n').count();
        let line = self.text.lines().nth(before)?;
        let line = line.split('#').next().unwrap_or(line).trim();
        Some(format!("{}:{}: {line}", self.name, before + 1))
    }

    /// How the job came by the direction of its passes.
    #[must_use]
    pub fn along_choice(&self) -> &AlongChoice {
        &self.along_choice
    }

    /// Records how the job came by its direction.
    pub fn set_along_choice(&mut self, choice: AlongChoice) {
        self.along_choice = choice;
    }

    /// An error that points at the value of `section.key` (or at the section, or at the file, where there is none).
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
