//! The firmware in QEMU: a child process with a socket for its serial line, ended when it is dropped.

use std::fs::File;
use std::io::{self, Read};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use super::Stream;
use super::guard::GuardedFolder;
use programs::{Part, Unavailable};

/// QEMU's program for ARM.
const PROGRAM: &str = "qemu-system-arm";
/// QEMU's model of a board with the STM32F405.
const MACHINE: &str = "netduinoplus2";

/// Deterministic time: 8 ns per instruction, none while sleeping.
const CLOCK: &str = "shift=3,sleep=off";

/// Time in which QEMU has to open its socket: at once, but a machine may be busy or slow to read the program.
const START_TIMEOUT: Duration = Duration::from_secs(780);

/// Reason for which QEMU does not run.
#[derive(Debug, thiserror::Error)]
pub enum QemuError {
    /// The program is missing.
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
    folder: GuardedFolder,
    _place: Option<Place>,
}

/// The firmware for QEMU; in a checkout built first where it has changed.
///
/// # Errors
/// It is not there, or cannot be built: Cargo's own message.
pub fn firmware() -> Result<PathBuf, QemuError> {
    programs::find(Part::QemuImage).map_err(QemuError::Firmware)
}

/// Processors that QEMUs of this process run on, one entry a QEMU.
static IN_USE: Mutex<Vec<usize>> = Mutex::new(Vec::new());

/// The place of a QEMU on a processor, free again when it is dropped.
#[derive(Debug)]
struct Place(usize);

impl Place {
    /// On the processor with the fewest QEMUs, the last of those: several at a time, as in the tests, are to have one each.
    fn take() -> Option<Self> {
        let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
        let load = |processor: &usize| in_use.iter().filter(|used| *used == processor).count();
        let processor = processors().into_iter().rev().min_by_key(load)?;
        in_use.push(processor);
        Some(Self(processor))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = in_use.iter().position(|used| *used == self.0) {
            in_use.swap_remove(at);
        }
    }
}

/// Whether a program is there.
fn is_there(name: &str) -> bool {
    let found = Command::new(name)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    found.is_ok_and(|status| status.success())
}

/// The program, on one processor and as a batch process where the system can do that (util-linux): QEMU hands each tick from one of its
/// threads to another, which takes up to three times as long from processor to processor.
fn program() -> (Command, Option<Place>) {
    static CAN_BE_PLACED: OnceLock<bool> = OnceLock::new();
    let can_be_placed = || [PROGRAM, "taskset", "chrt"].into_iter().all(is_there);
    let place = CAN_BE_PLACED
        .get_or_init(can_be_placed)
        .then(Place::take)
        .flatten();
    let Some(place) = place else {
        return (Command::new(PROGRAM), None);
    };
    let mut command = Command::new("taskset");
    command.args([
        "--cpu-list",
        &place.0.to_string(),
        "chrt",
        "--batch",
        "0",
        PROGRAM,
    ]);
    (command, Some(place))
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

/// The plugin that counts cycles: a library for QEMU; in a checkout built first where it has changed.
///
/// # Errors
/// It is not there, or cannot be built: Cargo's own message.
pub fn cycle_plugin() -> Result<PathBuf, QemuError> {
    programs::find(Part::CyclePlugin).map_err(QemuError::Plugin)
}

/// QEMU's serial line, which QEMU's end closes.
impl Stream for UnixStream {
    fn is_process(&self) -> bool {
        true
    }
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
        let folder = GuardedFolder::new().map_err(failed)?;
        let socket = folder.serial();
        // The log (defmt frames) is on stdout, QEMU's own messages on stderr.
        let log = File::create(folder.path().join("log")).map_err(failed)?;
        let (mut program, place) = program();
        let child = program
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
        let mut qemu = Self {
            child,
            folder,
            _place: place,
        };
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

    /// Number of the process.
    #[must_use]
    pub fn process_id(&self) -> u32 {
        self.child.id()
    }

    /// What QEMU said on stderr; ends it.
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
