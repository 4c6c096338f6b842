//! Errors of CAD files: cause, location, remedy.

use serde::{Deserialize, Serialize};
use std::fmt;

/// An error of a CAD file or of its import.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CadError {
    /// The file.
    pub file: String,
    /// Line in the file, from 1, if known.
    pub line: Option<usize>,
    /// The cause, with the entity if known.
    pub what: String,
    /// The remedy.
    pub remedy: String,
    /// The error is in the number of the face, not in the file: a job file points at `face`.
    pub of_face: bool,
}

impl CadError {
    /// An error of the file.
    #[must_use]
    pub fn new(file: &str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            file: file.to_owned(),
            line: None,
            what: what.into(),
            remedy: remedy.into(),
            of_face: false,
        }
    }

    /// An error of the requested face.
    #[must_use]
    pub fn face(file: &str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            of_face: true,
            ..Self::new(file, what, remedy)
        }
    }

    /// Sets the line.
    #[must_use]
    pub fn at_line(mut self, line: usize) -> Self {
        self.line = Some(line);
        self
    }
}

impl fmt::Display for CadError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(out, "{}:{line}: {}", self.file, self.what),
            None => write!(out, "{}: {}", self.file, self.what),
        }
    }
}

impl std::error::Error for CadError {}
