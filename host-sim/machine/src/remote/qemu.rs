//! The firmware in QEMU: a child process with a socket for its serial line, ended when it is dropped.

use std::fs::File;
use std::io::{self, Read};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::Stream;
use programs::{Part, Unavailable};

/// Program and machine: the STM32F405 as QEMU has it.
const PROGRAM: &str = "qemu-system-arm";
const MACHINE: &str = "netduinoplus2";

/// Deterministic time: 8 ns an instruction, and sleeping costs none.
const CLOCK: &str = "shift=3,sleep=off";

/// Time in which QEMU has to open its socket: at once, but a machine may be busy or slow to read the program.
const START_TIMEOUT: Duration = Duration::from_secs(120);

/// Why QEMU does not run.
#[derive(Debug, thiserror::Error)]
pub enum QemuError {
    /// The program is not there.
    #[error("{PROGRAM} is not installed; on Debian and Ubuntu: sudo apt-get install qemu-system-arm")]
    Missing,
    /// There is no firmware.
    #[error("there is no firmware: {0}\n  help: {remedy}", remedy = .0.remedy())]
    Firmware(Unavailable),
    /// There is no plugin that counts cycles.
    #[error("there is no plugin that counts cycles: {0}\n  help: {remedy}", remedy = .0.remedy())]
    Plugin(Unavailable),
    /// It did not start, or ended.
    #[error("QEMU did not start: {0}")]
    Start(String),
}

/// A running QEMU.
#[derive(Debug)]
pub struct Qemu {
    child: Child,
    folder: tempfile::TempDir,
}

/// The firmware for QEMU; in a checkout built first where it has changed.
///
/// # Errors
/// It is not there, or cannot be built: Cargo's own message.
pub fn firmware() -> Result<PathBuf, QemuError> {
    programs::find(Part::QemuImage).map_err(QemuError::Firmware)
}

/// The program, on one processor and as a batch process where the system can do that (util-linux): QEMU hands each tick from one of its
/// threads to another, which takes up to three times as long from processor to processor.
fn program() -> Command {
    static STARTED: AtomicUsize = AtomicUsize::new(0);
    let there = |name: &str| {
        let found = Command::new(name)
            .arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        found.is_ok_and(|status| status.success())
    };
    let processors = processors();
    if processors.is_empty() || !there(PROGRAM) || !there("taskset") || !there("chrt") {
        return Command::new(PROGRAM);
    }
    // Two at a time, as in the tests, are to have one each.
    let next = STARTED.fetch_add(1, Ordering::Relaxed);
    let processor = processors[(processors.len() - 1).wrapping_sub(next % processors.len())];
    let mut command = Command::new("taskset");
    command.args([
        "--cpu-list",
        &processor.to_string(),
        "chrt",
        "--batch",
        "0",
        PROGRAM,
    ]);
    command
}

/// The processors that this process may use; none where the system does not say.
fn processors() -> Vec<usize> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let list = status
        .lines()
        .find_map(|line| line.strip_prefix("Cpus_allowed_list:"))
        .unwrap_or_default();
    let range = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.parse().ok()?..=last.parse().ok()?)
    };
    list.trim().split(',').filter_map(range).flatten().collect()
}

/// The plugin that counts cycles: a library for QEMU; in a checkout built first where it has changed.
///
/// # Errors
/// It is not there, or cannot be built: Cargo's own message.
pub fn cycle_plugin() -> Result<PathBuf, QemuError> {
    programs::find(Part::CyclePlugin).map_err(QemuError::Plugin)
}

impl Qemu {
    /// Starts QEMU with a firmware image, and connects to its serial line.
    ///
    /// # Errors
    /// QEMU is missing, or does not start.
    pub fn start(image: &Path) -> Result<(Self, Box<dyn Stream>), QemuError> {
        Self::start_with(image, &[])
    }

    /// The same with further arguments.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_with(image: &Path, further: &[String]) -> Result<(Self, Box<dyn Stream>), QemuError> {
        let failed = |error: io::Error| QemuError::Start(error.to_string());
        let folder = tempfile::tempdir().map_err(failed)?;
        let socket = folder.path().join("serial");
        // The log (defmt frames) comes on stdout, QEMU's own words on stderr.
        let log = File::create(folder.path().join("log")).map_err(failed)?;
        let child = program()
            .args([
                "-machine",
                MACHINE,
                "-nodefaults",
                "-nographic",
                "-monitor",
                "none",
                "-icount",
                CLOCK,
            ])
            .args(["-semihosting-config", "enable=on,target=native"])
            .arg("-chardev")
            .arg(format!(
                "socket,id=link,path={},server=on,wait=on",
                socket.display()
            ))
            .args(["-serial", "chardev:link"])
            .args(further)
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null())
            .stdout(log)
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => QemuError::Missing,
                _ => failed(error),
            })?;
        let mut qemu = Self { child, folder };
        let stream = qemu.connect(&socket)?;
        stream
            .set_read_timeout(Some(Duration::from_millis(20)))
            .map_err(failed)?;
        Ok((qemu, Box::new(stream)))
    }

    fn connect(&mut self, socket: &Path) -> Result<UnixStream, QemuError> {
        let deadline = Instant::now() + START_TIMEOUT;
        loop {
            if let Ok(stream) = UnixStream::connect(socket) {
                return Ok(stream);
            }
            if let Some(status) = self.child.try_wait().ok().flatten() {
                return Err(QemuError::Start(format!("{status} {}", self.last_words())));
            }
            if Instant::now() > deadline {
                let words = self.last_words();
                return Err(QemuError::Start(format!(
                    "it did not open its serial line within {} s; is the machine very busy? {words}",
                    START_TIMEOUT.as_secs()
                )));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// What QEMU said on stderr; ends it.
    #[must_use]
    pub fn last_words(&mut self) -> String {
        self.end();
        let mut words = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            // What cannot be read is not worth an error of its own.
            let _ = stderr.read_to_string(&mut words);
        }
        words.trim().to_owned()
    }

    /// The firmware's log so far: defmt frames, to be decoded with the image.
    #[must_use]
    pub fn log(&self) -> PathBuf {
        self.folder.path().join("log")
    }

    fn end(&mut self) {
        // Either it is gone already, or it goes now.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        self.end();
    }
}
