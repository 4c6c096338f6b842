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
use programs::{Part, Unavailable};

/// Time in which the program has to open its line.
const START_TIMEOUT: Duration = Duration::from_secs(60);

/// Why the chip does not run.
#[derive(Debug, thiserror::Error)]
pub enum ChipError {
    /// The image or the program is not there, and cannot be built.
    #[error("{0} is not available: {1}")]
    Unavailable(&'static str, Unavailable),
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
    programs::find(Part::BoardImage(board)).map_err(|error| ChipError::Unavailable("the firmware", error))
}

/// Builds the program that executes images.
///
/// # Errors
/// Likewise.
pub fn program() -> Result<PathBuf, ChipError> {
    let name = "the program that executes images (host-sim/chip)";
    programs::find(Part::ChipEmulator).map_err(|error| ChipError::Unavailable(name, error))
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
                let _ = self.child.kill();
                return Err(ChipError::Start(self.stderr()));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let name = line.to_string_lossy();
        port::open(&name).map_err(|error| match error {
            RemoteError::Line(cause) => ChipError::Start(cause.to_string()),
            other => ChipError::Start(other.to_string()),
        })
    }

    /// What it has written to its standard error, once it has ended.
    fn stderr(&mut self) -> String {
        let mut words = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            // What cannot be read is not worth an error of its own.
            let _ = stderr.read_to_string(&mut words);
        }
        words.trim().to_owned()
    }

    /// Ends it, and returns why it may have left the line: the models' first complaint, or its own error.
    #[must_use]
    pub fn trouble(&mut self) -> Option<String> {
        let first = self.end().and_then(|said| said.complaints.into_iter().next());
        first
            .map(|complaint| format!("the models of the chip complain: {complaint}"))
            .or_else(|| Some(self.stderr()).filter(|words| !words.is_empty()))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A shell script in the program's place.
    fn chip(script: &str) -> Chip {
        let folder = GuardedFolder::new().unwrap();
        let child = Command::new("sh")
            .args(["-c", script, "chip"])
            .arg(folder.path())
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Chip { child, folder }
    }

    #[test]
    fn the_first_complaint_or_its_own_error_is_its_trouble() {
        let report = |complaints: &str| {
            format!(
                "printf '%s' '{{\"complaints\": [{complaints}], \"bytes_lost\": 0, \"byte_wait_max_cycles\": 9, \"resets\": 0}}' > \"$1/report\""
            )
        };
        let of = |script: &str| chip(script).trouble();
        let missing = of("echo 'error: libunicorn.so.2 is not installed' >&2; exit 2");
        assert_eq!(
            missing.as_deref(),
            Some("error: libunicorn.so.2 is not installed")
        );
        let complained = of(&report(r#""TIM2 without its clock", "another""#));
        assert_eq!(
            complained.as_deref(),
            Some("the models of the chip complain: TIM2 without its clock")
        );
        // It ends with its input, and has nothing to say.
        assert_eq!(of(&format!("read -r _; {}", report(""))), None);
    }
}
