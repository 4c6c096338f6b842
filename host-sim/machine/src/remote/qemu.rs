//! The firmware in QEMU: a child process with a socket for its serial line, ended when it is dropped.

use std::fs::File;
use std::io::{self, Read};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::Stream;

/// Program and machine: QEMU's model of the STM32F405.
const PROGRAM: &str = "qemu-system-arm";
const MACHINE: &str = "netduinoplus2";

/// Deterministic time: 8 ns per instruction, none while sleeping.
const CLOCK: &str = "shift=3,sleep=off";

/// Time-out for QEMU to open its socket, which is immediate on an idle computer.
const START_TIMEOUT: Duration = Duration::from_secs(120);

/// Reason for which QEMU does not run.
#[derive(Debug, thiserror::Error)]
pub enum QemuError {
    /// The program is missing.
    #[error("{PROGRAM} is not installed; on Debian and Ubuntu: sudo apt-get install qemu-system-arm")]
    Missing,
    /// The firmware could not be built.
    #[error("the firmware for QEMU could not be built: {0}")]
    Firmware(String),
    /// The plugin that counts cycles could not be built.
    #[error("the plugin that counts cycles could not be built: {0}")]
    Plugin(String),
    /// QEMU did not start, or ended.
    #[error("QEMU did not start: {0}")]
    Start(String),
}

/// A running QEMU.
#[derive(Debug)]
pub struct Qemu {
    child: Child,
    folder: tempfile::TempDir,
}

/// The workspace that this tool was built in.
#[must_use]
pub fn workspace() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap_or(here).to_owned()
}

/// Builds the firmware for QEMU (`cargo fw-qemu`; at once where nothing changed), and returns the image.
///
/// # Errors
/// Cargo is missing or fails; the error contains its output.
pub fn firmware() -> Result<PathBuf, QemuError> {
    cargo(
        &["fw-qemu", "--quiet"],
        "target/qemu/thumbv7em-none-eabihf/release/firmware",
    )
    .map_err(QemuError::Firmware)
}

/// Runs cargo in the workspace, and returns the path of the file that it builds; cargo's output where it fails.
pub fn cargo(arguments: &[&str], built: &str) -> Result<PathBuf, String> {
    let workspace = workspace();
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(arguments)
        .current_dir(&workspace)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| error.to_string())?;
    if output.status.success() {
        Ok(workspace.join(built))
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

/// The QEMU program, pinned to one processor and as a batch process where the system supports it (util-linux): QEMU passes each tick from one
/// thread to another, which takes up to three times as long between processors.
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
    // Two concurrent processes, as in the tests, get one processor each.
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

/// The processors available to this process; empty where the system does not report them.
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

/// Builds the plugin that counts cycles, and returns the library.
///
/// # Errors
/// Cargo is missing or fails; the error contains its output.
pub fn cycle_plugin() -> Result<PathBuf, QemuError> {
    const BUILD: [&str; 7] = [
        "build",
        "--release",
        "--quiet",
        "-p",
        "cycle-plugin",
        "--target-dir",
        "target/plugin",
    ];
    cargo(&BUILD, "target/plugin/release/libcycle_plugin.so").map_err(QemuError::Plugin)
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
        // The log (defmt frames) is on stdout, QEMU's own messages on stderr.
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

    /// Ends QEMU, and returns its stderr.
    #[must_use]
    pub fn last_words(&mut self) -> String {
        self.end();
        let mut words = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            // A read error here is not reported separately.
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
        // QEMU may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        self.end();
    }
}
