//! The debug-probe program: built on first use, run with a request, its events read.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::{Event, Problem, Request};
use programs::{Part, Unavailable};

/// Failure of a request.
#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    /// The program reported a problem.
    #[error("{}", super::sentence(.0))]
    Problem(Problem),
    /// The program does not run, or not as it should: an error of ours.
    #[error("the program that talks to debug probes {0}")]
    Program(String),
    /// The program is not there.
    #[error("there is no program that talks to debug probes: {0}")]
    Unavailable(Unavailable),
}

/// The program.
#[derive(Clone, Debug)]
pub struct Program(PathBuf);

impl Program {
    /// Whether [`Self::find`] builds it from nothing, which takes some minutes.
    #[must_use]
    pub fn needs_build() -> bool {
        programs::needs_build(Part::DebugProbe)
    }

    /// Finds it; in a checkout it is built first where it has changed.
    ///
    /// # Errors
    /// It is not there, or cannot be built: Cargo's own message.
    pub fn find() -> Result<Self, ProbeError> {
        programs::find(Part::DebugProbe)
            .map(Self)
            .map_err(ProbeError::Unavailable)
    }

    /// Another program instead, for tests of the handling of its output.
    #[must_use]
    pub fn at(path: &Path) -> Self {
        Self(path.to_owned())
    }

    /// Runs a request to its end and passes on each event. `recorded`: the file of a recorded log.
    ///
    /// # Errors
    /// The program does not run, reports a problem, or ends early.
    pub fn run(
        &self,
        request: &Request,
        recorded: Option<File>,
        mut on_event: impl FnMut(&Event),
    ) -> Result<(), ProbeError> {
        let failed = |error: &dyn std::fmt::Display| ProbeError::Program(format!("does not run: {error}"));
        let request = serde_json::to_string(request).map_err(|error| failed(&error))?;
        let child = Command::new(&self.0)
            .arg(request)
            .stdin(recorded.map_or_else(Stdio::null, Stdio::from))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| failed(&error))?;
        let mut child = ChildGuard(child);
        let Some(output) = child.0.stdout.take() else {
            return Err(failed(&"it has no output"));
        };
        for line in BufReader::new(output).lines() {
            let line = line.map_err(|error| failed(&error))?;
            match serde_json::from_str(&line) {
                Ok(Event::Failed(problem)) => return Err(ProbeError::Problem(problem)),
                Ok(Event::Done) => return Ok(()),
                Ok(event) => on_event(&event),
                Err(error) => {
                    return Err(ProbeError::Program(format!(
                        "wrote invalid output ({error}): {line}"
                    )));
                }
            }
        }
        // The program ended without an event, for example by a panic.
        let mut words = String::new();
        if let Some(mut stderr) = child.0.stderr.take() {
            let _ = std::io::Read::read_to_string(&mut stderr, &mut words);
        }
        Err(ProbeError::Program(format!(
            "ended before it was done: {}",
            words.trim()
        )))
    }
}

/// A child process that is ended on drop.
struct ChildGuard(Child);

impl Drop for ChildGuard {
    fn drop(&mut self) {
        // Errors are ignored: the process may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
