//! The program that talks to probes: built when it is first wanted, run, listened to.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::{Event, Problem, Request};
use programs::{Part, Unavailable};

/// Why nothing came of a request.
#[derive(Debug, thiserror::Error)]
pub enum NotRun {
    /// The program says why.
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
    pub fn find() -> Result<Self, NotRun> {
        programs::find(Part::DebugProbe)
            .map(Self)
            .map_err(NotRun::Unavailable)
    }

    /// Another program in its place, for tests of what is made of its answers.
    #[must_use]
    pub fn at(path: &Path) -> Self {
        Self(path.to_owned())
    }

    /// Runs a request to its end, and hands over each event on the way. `recorded` is what a recorded log is read from.
    ///
    /// # Errors
    /// The program does not run, names a problem, or ends before it is done.
    pub fn run(
        &self,
        request: &Request,
        recorded: Option<File>,
        mut on_event: impl FnMut(&Event),
    ) -> Result<(), NotRun> {
        let failed = |error: &dyn std::fmt::Display| NotRun::Program(format!("does not run: {error}"));
        let request = serde_json::to_string(request).map_err(|error| failed(&error))?;
        let child = Command::new(&self.0)
            .arg(request)
            .stdin(recorded.map_or_else(Stdio::null, Stdio::from))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| failed(&error))?;
        let mut child = Ended(child);
        let Some(output) = child.0.stdout.take() else {
            return Err(failed(&"it has no output"));
        };
        for line in BufReader::new(output).lines() {
            let line = line.map_err(|error| failed(&error))?;
            match serde_json::from_str(&line) {
                Ok(Event::Failed(problem)) => return Err(NotRun::Problem(problem)),
                Ok(Event::Done) => return Ok(()),
                Ok(event) => on_event(&event),
                Err(error) => {
                    return Err(NotRun::Program(format!(
                        "says what it should not ({error}): {line}"
                    )));
                }
            }
        }
        // It ended without a word: a panic of a library, say.
        let mut words = String::new();
        if let Some(mut stderr) = child.0.stderr.take() {
            let _ = std::io::Read::read_to_string(&mut stderr, &mut words);
        }
        Err(NotRun::Program(format!(
            "ended before it was done: {}",
            words.trim()
        )))
    }
}

/// A program that does not outlive our interest in it.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        // Either it is gone already, or it goes now.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
