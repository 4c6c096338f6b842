//! A board's image, executed on models of its chip by the program in `host-sim/chip`: a child process with a pseudo-terminal for its
//! serial line, in real time or faster.

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use boards::Board;
use serde::Deserialize;

use super::guard::GuardedFolder;
use super::{RemoteError, Stream, port};
use programs::Part;

/// Time in which the program has to open its line.
const START_TIMEOUT: Duration = Duration::from_secs(60);

/// Why the chip does not run.
#[derive(Debug, thiserror::Error)]
pub enum ChipError {
    /// The image or the program could not be built.
    #[error("{0} could not be built: {1}")]
    Build(&'static str, String),
    /// It did not start, or ended.
    #[error("the program that executes the image did not start: {0}")]
    Start(String),
}

/// What the models said in the end.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct Said {
    /// What a correct program does not do.
    pub complaints: Vec<String>,
    /// Bytes from the host that were lost in USART1, apart from those that came while a word was written to flash.
    pub bytes_lost: u64,
    /// The longest time from a byte's arrival to its being read, cycles of the core.
    pub byte_wait_max_cycles: u64,
    /// Times the chip was reset.
    pub resets: u32,
}

/// A chip at work.
#[derive(Debug)]
pub struct Chip {
    child: Child,
    folder: GuardedFolder,
}

/// Builds a board's image (at once where nothing changed).
///
/// # Errors
/// Cargo is missing or fails; its own words are passed on.
pub fn image(board: &'static Board) -> Result<PathBuf, ChipError> {
    programs::find(Part::BoardImage(board))
        .map_err(|error| ChipError::Build("the firmware", error.to_string()))
}

/// Builds the program that executes images.
///
/// # Errors
/// Likewise.
pub fn program() -> Result<PathBuf, ChipError> {
    let name = "the program that executes images (host-sim/chip)";
    programs::find(Part::ChipEmulator).map_err(|error| ChipError::Build(name, error.to_string()))
}

impl Chip {
    /// Starts an image, and opens its serial line as any other. `fast`: as fast as it goes, which no `host_gone` outlasts.
    ///
    /// # Errors
    /// The program does not start: libunicorn2 is missing, for instance.
    pub fn start(program: &Path, image: &Path, fast: bool) -> Result<(Self, Box<dyn Stream>), ChipError> {
        let failed = |error: io::Error| ChipError::Start(error.to_string());
        let folder = GuardedFolder::new().map_err(failed)?;
        let line = folder.serial();
        let child = Command::new(program)
            .arg(image)
            .arg("--pty")
            .arg(&line)
            .arg("--report")
            .arg(folder.path().join("report"))
            .args(fast.then_some("--fast"))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(failed)?;
        let mut chip = Self { child, folder };
        let stream = chip.open(&line)?;
        Ok((chip, stream))
    }

    fn open(&mut self, line: &Path) -> Result<Box<dyn Stream>, ChipError> {
        let deadline = Instant::now() + START_TIMEOUT;
        while !line.exists() {
            if self.child.try_wait().ok().flatten().is_some() || Instant::now() > deadline {
                let mut words = String::new();
                let _ = self.child.kill();
                if let Some(mut stderr) = self.child.stderr.take() {
                    // What cannot be read is not worth an error of its own.
                    let _ = stderr.read_to_string(&mut words);
                }
                return Err(ChipError::Start(words.trim().to_owned()));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let name = line.to_string_lossy();
        port::open(&name).map_err(|error| match error {
            RemoteError::Line(cause) => ChipError::Start(cause.to_string()),
            other => ChipError::Start(other.to_string()),
        })
    }

    /// Ends it, and asks the models what they have to say; nothing where they did not get to it.
    #[must_use]
    pub fn end(&mut self) -> Option<Said> {
        // The end of its input is its end.
        drop(self.child.stdin.take());
        let _ = self.child.wait();
        let said = std::fs::read(self.folder.path().join("report")).ok()?;
        serde_json::from_slice(&said).ok()
    }
}

impl Drop for Chip {
    fn drop(&mut self) {
        // Either it is gone already, or it goes now.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
