//! The folder of a program that is started for a run, and a guard: where this process is killed, the program ends and the folder goes.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Name of the file in the folder that is in the program's arguments: by it the guard knows the program.
const SERIAL: &str = "serial";

/// Waits for the end of its input, which is that of this process however it ends, and cleans up. An interrupt that ends both goes to it, too, and
/// is ignored. The guard has the folder in its own arguments without the file, so it does not find itself.
const SCRIPT: &str = r#"
trap '' HUP INT QUIT TERM
read -r _
for process in /proc/[0-9]*; do
    if grep -qsaF -e "$1/$2" "$process/cmdline"; then kill -KILL "${process#/proc/}"; fi
done
rm -rf -- "$1"
"#;

/// A temporary folder with its guard.
#[derive(Debug)]
pub(super) struct GuardedFolder {
    folder: tempfile::TempDir,
    /// None where there is no shell: then only an orderly end cleans up.
    guard: Option<Child>,
}

impl GuardedFolder {
    /// Makes the folder. The guard is there before anything is started with it.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub(super) fn new() -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let guard = Command::new("sh")
            .args(["-c", SCRIPT, "guard"])
            .arg(folder.path())
            .arg(SERIAL)
            .current_dir("/")
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .ok();
        Ok(Self { folder, guard })
    }

    /// The folder.
    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// The file or socket for the program's serial line, which has to be in its arguments.
    pub(super) fn serial(&self) -> PathBuf {
        self.folder.path().join(SERIAL)
    }
}

impl Drop for GuardedFolder {
    fn drop(&mut self) {
        if let Some(guard) = &mut self.guard {
            // Before the end of its input, so that it has nothing to do.
            let _ = guard.kill();
            let _ = guard.wait();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};
    use std::time::{Duration, Instant};

    /// Set for the copy of this test that is killed.
    const KILLED: &str = "GUARD_TEST_IS_KILLED";

    fn running(marker: &str) -> bool {
        let processes = std::fs::read_dir("/proc").unwrap().flatten();
        processes
            .filter_map(|process| std::fs::read(process.path().join("cmdline")).ok())
            .any(|line| line.windows(marker.len()).any(|part| part == marker.as_bytes()))
    }

    fn within_seconds(what: &str, mut holds: impl FnMut() -> bool) {
        let deadline = Instant::now() + Duration::from_secs(20);
        while !holds() {
            assert!(Instant::now() < deadline, "{what}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// A program with the folder in its arguments.
    fn program(folder: &GuardedFolder) -> Child {
        let mut command = Command::new("sh");
        command
            .args(["-c", "while :; do sleep 1; done", "program"])
            .arg(folder.serial());
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .unwrap()
    }

    #[test]
    fn a_killed_process_leaves_no_program_and_no_folder() {
        if std::env::var_os(KILLED).is_some() {
            let folder = GuardedFolder::new().unwrap();
            let mut program = program(&folder);
            println!("\nfolder {}", folder.path().display());
            // This process is killed before the program ends.
            program.wait().unwrap();
        }
        let mut host = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "remote::guard::tests::a_killed_process_leaves_no_program_and_no_folder",
                "--nocapture",
            ])
            .env(KILLED, "1")
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(host.stdout.take().unwrap()).lines();
        let folder = lines
            .map_while(Result::ok)
            .find_map(|line| line.strip_prefix("folder ").map(PathBuf::from))
            .unwrap();
        let marker = folder.join(SERIAL).display().to_string();
        within_seconds("the program does not start", || running(&marker));
        assert!(folder.is_dir());
        host.kill().unwrap();
        host.wait().unwrap();
        within_seconds("the program goes on", || !running(&marker));
        within_seconds("the folder stays", || !folder.exists());
    }

    #[test]
    fn an_orderly_end_leaves_the_program_to_its_owner() {
        let folder = GuardedFolder::new().unwrap();
        let path = folder.path().to_owned();
        let mut program = program(&folder);
        drop(folder);
        assert!(!path.exists());
        std::thread::sleep(Duration::from_millis(300));
        assert!(program.try_wait().unwrap().is_none(), "it was ended by the guard");
        program.kill().unwrap();
        program.wait().unwrap();
        assert!(!running(&path.display().to_string()), "the guard goes on");
    }
}
