//! The debug-probe program: built on first use, run with a request, its events read.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::{Event, Problem, Request};
use machine::remote::qemu::{cargo, workspace};

/// How the program is built: like the firmware, in a folder of its own.
const BUILD: [&str; 9] = [
    "build",
    "--quiet",
    "--locked",
    "--profile",
    "plain",
    "-p",
    "debug-probe",
    "--target-dir",
    "target/debug-probe",
];
const BUILT: &str = "target/debug-probe/plain/debug-probe";

/// Failure of a request.
#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    /// The program reported a problem.
    #[error("{}", super::sentence(.0))]
    Problem(Problem),
    /// The program cannot be built or run, or its output is invalid.
    #[error("the debug-probe program {0}")]
    Program(String),
}

/// The program.
#[derive(Clone, Debug)]
pub struct Program(PathBuf);

impl Program {
    /// Whether it was built before; the first time takes some minutes.
    #[must_use]
    pub fn is_built() -> bool {
        workspace().join(BUILT).exists()
    }

    /// Builds it; at once where nothing changed.
    ///
    /// # Errors
    /// Cargo is missing or fails; its own words are passed on.
    pub fn build() -> Result<Self, ProbeError> {
        cargo(&BUILD, BUILT)
            .map(Self)
            .map_err(|words| ProbeError::Program(format!("cannot be built: {words}")))
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
