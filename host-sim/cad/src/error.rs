//! What can go wrong with a CAD file: what, where, and what to do.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A fault in a CAD file, or in what is asked of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CadError {
    /// The file.
    pub file: String,
    /// Line in it, from 1, where it is known.
    pub line: Option<usize>,
    /// What is wrong, with the entity where there is one.
    pub what: String,
    /// What to do about it.
    pub remedy: String,
    /// The face's number rather than the file is to blame: a job file points at `face` then.
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

    /// An error of the face that was asked for.
    #[must_use]
    pub fn face(file: &str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            of_face: true,
            ..Self::new(file, what, remedy)
        }
    }

    /// The same at a line.
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
