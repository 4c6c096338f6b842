//! The host's end of the serial line: a pseudo-terminal, opened like any serial port.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

pub(crate) struct Line {
    master: OwnedFd,
    /// Kept open, so that the line stays valid when the host closes its end.
    _slave: File,
    link: PathBuf,
}

impl Line {
    /// Opens a pair, and a link to the host's end.
    pub(crate) fn open(link: &Path) -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?;
        let name = name.to_str().map_err(io::Error::other)?;
        let no_terminal = OFlags::NOCTTY.bits().cast_signed();
        let slave = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(no_terminal)
            .open(name)?;
        let mut settings = tcgetattr(&slave)?;
        settings.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &settings)?;
        fcntl_setfl(&master, fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        let _ = std::fs::remove_file(link);
        symlink(name, link)?;
        Ok(Self {
            master,
            _slave: slave,
            link: link.to_owned(),
        })
    }

    /// Bytes sent by the host.
    pub(crate) fn read(&self, to: &mut impl Extend<u8>) {
        let mut bytes = [0; 4096];
        if let Ok(count) = rustix::io::read(&self.master, &mut bytes[..]) {
            to.extend(bytes[..count].iter().copied());
        }
    }

    /// Sends a byte to the host; waits up to 1 s while the host's buffer is full.
    pub(crate) fn write(&self, byte: u8) {
        for _ in 0..5_000 {
            match rustix::io::write(&self.master, &[byte]) {
                Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => {
                    std::thread::sleep(Duration::from_micros(200))
                }
                _ => return,
            }
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.link);
    }
}
