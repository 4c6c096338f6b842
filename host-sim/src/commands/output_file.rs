//! Output files: written whole or not at all, over an existing file only with `--force`, and never over a file that the command has read.
//!
//! A file is made without a name, or with one of its own beside its target, and takes the target's name when it is complete: a command that
//! fails or is killed leaves the existing file.

use std::fs::{File, Metadata, Permissions};
use std::io::{self, ErrorKind, Seek, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rustix::fs::{AtFlags, CWD, Mode, OFlags};
use tempfile::{Builder, NamedTempFile, TempPath};

use super::{Failure, Result, cannot_write};

/// Rights of a new file, before the user's mask.
const NEW_FILE: u32 = 0o666;
/// Beginning of the names of files that are not complete.
const UNFINISHED: &str = ".unfinished-";

/// The files that the command has read. They stay open, so that no other file gets their numbers.
static READ: Mutex<Vec<File>> = Mutex::new(Vec::new());

/// Notes a file that the command reads: nothing is written over it.
pub(super) fn note_input(path: &Path) {
    // A pipe without a writer cannot be opened.
    let regular = std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
    if let (true, Ok(file)) = (regular, File::open(path)) {
        READ.lock().unwrap_or_else(PoisonError::into_inner).push(file);
    }
}

/// Whether the command has read this file, by whatever name.
fn is_input(metadata: &Metadata) -> bool {
    let read = READ.lock().unwrap_or_else(PoisonError::into_inner);
    let same = |other: Metadata| (other.dev(), other.ino()) == (metadata.dev(), metadata.ino());
    read.iter().any(|file| file.metadata().is_ok_and(same))
}

/// What a path leads to.
enum Target {
    /// A file to be made or replaced, by its path without links.
    File(PathBuf),
    /// A device or a pipe, which is written as it is.
    Stream,
}

/// Whether the path may be written.
///
/// # Errors
/// The path is an input, a folder, or a file and `force` is not set; or its folder does not exist.
pub(super) fn check(path: &Path, force: bool) -> Result<()> {
    target(path, force).map(|_| ())
}

fn target(path: &Path, force: bool) -> Result<Target> {
    match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => Err(cannot_write(path, &ErrorKind::IsADirectory.into())),
        Ok(metadata) if !metadata.is_file() => Ok(Target::Stream),
        Ok(metadata) => {
            if is_input(&metadata) {
                return Err(Failure::input(
                    format!("{} is what the command reads", path.display()),
                    "name another file for the output",
                ));
            }
            if !force {
                return Err(exists(path));
            }
            let real = path.canonicalize().map_err(|error| cannot_write(path, &error))?;
            Ok(Target::File(real))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let folder = folder(path);
            match std::fs::metadata(folder) {
                Ok(metadata) if metadata.is_dir() => Ok(Target::File(path.to_owned())),
                Ok(_) => Err(cannot_write(path, &ErrorKind::NotADirectory.into())),
                Err(error) => Err(cannot_write(path, &error)),
            }
        }
        Err(error) => Err(cannot_write(path, &error)),
    }
}

/// The folder of a file.
fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

fn exists(path: &Path) -> Failure {
    Failure::input(
        format!("{} exists already", path.display()),
        "name another file, or overwrite it with --force",
    )
}

/// Gives a complete file its name.
fn rename(complete: TempPath, path: &Path, force: bool) -> Result<()> {
    let renamed = if force {
        complete.persist(path)
    } else {
        complete.persist_noclobber(path)
    };
    renamed.map_err(|error| match error.error.kind() {
        ErrorKind::AlreadyExists => exists(path),
        _ => cannot_write(path, &error.error),
    })
}

/// A new file beside its target.
fn beside(path: &Path) -> io::Result<NamedTempFile> {
    Builder::new()
        .prefix(UNFINISHED)
        .permissions(Permissions::from_mode(NEW_FILE))
        .tempfile_in(folder(path))
}

/// A new file without a name, in a folder; one that can be given a name where the file system has such.
fn unnamed(folder: &Path) -> io::Result<File> {
    let flags = OFlags::RDWR | OFlags::TMPFILE | OFlags::CLOEXEC;
    match rustix::fs::open(folder, flags, Mode::from_raw_mode(NEW_FILE)) {
        Ok(file) => Ok(file.into()),
        Err(_) => tempfile::tempfile_in(folder),
    }
}

/// Gives a file without a name one beside its target, at once.
fn named_beside(file: &File, target: &Path) -> io::Result<TempPath> {
    let open = format!("/proc/self/fd/{}", file.as_raw_fd());
    let link = |path: &Path| {
        let linked = rustix::fs::linkat(CWD, open.as_str(), CWD, path, AtFlags::SYMLINK_FOLLOW);
        linked.map_err(io::Error::from)
    };
    let named = Builder::new().prefix(UNFINISHED).make_in(folder(target), link)?;
    Ok(named.into_temp_path())
}

/// Copies a file into one beside its target.
fn copied_beside(file: &mut File, target: &Path) -> io::Result<TempPath> {
    let mut named = beside(target)?;
    file.rewind()?;
    io::copy(file, named.as_file_mut())?;
    named.as_file().sync_all()?;
    Ok(named.into_temp_path())
}

/// Writes a file.
///
/// # Errors
/// As [`check`], or the file cannot be written.
pub(super) fn write(path: &Path, bytes: &[u8], force: bool) -> Result<()> {
    let failed = |error: io::Error| cannot_write(path, &error);
    let target = match target(path, force)? {
        Target::File(target) => target,
        Target::Stream => return std::fs::write(path, bytes).map_err(failed),
    };
    let mut file = beside(&target).map_err(failed)?;
    file.write_all(bytes)
        .and_then(|()| file.as_file().sync_all())
        .map_err(failed)?;
    rename(file.into_temp_path(), &target, force)
}

/// A file that takes long to write. Until it is complete it has no name: nothing of it remains if the command is killed.
pub(super) struct OutputFile {
    path: PathBuf,
    force: bool,
    /// The file without a name; for a stream, the stream.
    file: File,
    stream: bool,
}

impl OutputFile {
    /// Begins a file.
    ///
    /// # Errors
    /// As [`check`], or the file cannot be made.
    pub(super) fn begin(path: &Path, force: bool) -> Result<Self> {
        let (file, stream) = match target(path, force)? {
            Target::File(target) => (unnamed(folder(&target)), false),
            Target::Stream => (File::options().write(true).open(path), true),
        };
        Ok(Self {
            path: path.to_owned(),
            force,
            file: file.map_err(|error| cannot_write(path, &error))?,
            stream,
        })
    }

    /// The file, to be written.
    ///
    /// # Errors
    /// The process has too many open files.
    pub(super) fn file(&self) -> Result<File> {
        self.file
            .try_clone()
            .map_err(|error| cannot_write(&self.path, &error))
    }

    /// Gives the complete file its name.
    ///
    /// # Errors
    /// As [`check`], or the file cannot be written.
    pub(super) fn finish(mut self) -> Result<()> {
        if self.stream {
            return Ok(());
        }
        let failed = |error: io::Error| cannot_write(&self.path, &error);
        let Target::File(target) = target(&self.path, self.force)? else {
            return Err(exists(&self.path));
        };
        self.file.sync_all().map_err(failed)?;
        let complete = named_beside(&self.file, &target).or_else(|_| copied_beside(&mut self.file, &target));
        rename(complete.map_err(failed)?, &target, self.force)
    }
}

/// Checks that files of these names may be written into a folder, which may not exist yet.
///
/// # Errors
/// As [`check`].
pub(super) fn check_folder(directory: &Path, names: &[&str], force: bool) -> Result<()> {
    match std::fs::metadata(directory) {
        Ok(metadata) if metadata.is_dir() => names
            .iter()
            .try_for_each(|name| check(&directory.join(name), force)),
        Ok(_) => Err(cannot_write(directory, &ErrorKind::NotADirectory.into())),
        // It is created with the files.
        Err(_) => Ok(()),
    }
}

/// The same before work of minutes: creates the folder, so that one that cannot be created is reported at once.
///
/// # Errors
/// As [`check`], or the folder cannot be created.
pub(super) fn prepare_folder(directory: &Path, names: &[&str], force: bool) -> Result<()> {
    check_folder(directory, names, force)?;
    std::fs::create_dir_all(directory).map_err(|error| cannot_write(directory, &error))
}

/// Makes files in a folder, which is created if missing: `make` writes them into another one.
///
/// # Errors
/// As [`check`], or that of `make`.
pub(super) fn write_folder(
    directory: &Path,
    names: &[&str],
    force: bool,
    make: impl FnOnce(&Path) -> io::Result<()>,
) -> Result<()> {
    let failed = |error: io::Error| cannot_write(directory, &error);
    check_folder(directory, names, force)?;
    std::fs::create_dir_all(directory).map_err(failed)?;
    let made = Builder::new()
        .prefix(UNFINISHED)
        .tempdir_in(directory)
        .map_err(failed)?;
    make(made.path()).map_err(failed)?;
    for name in names {
        let path = directory.join(name);
        let target = match target(&path, force)? {
            Target::File(target) => target,
            Target::Stream => return Err(exists(&path)),
        };
        let complete = TempPath::try_from_path(made.path().join(name)).map_err(failed)?;
        rename(complete, &target, force)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    fn said(result: Result<()>) -> String {
        match result {
            Err(Failure::Input(report)) => report.to_string(),
            Err(Failure::Failed(message)) => panic!("{message:?}"),
            Ok(()) => String::new(),
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn nothing_is_overwritten_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ngc");
        write(&path, b"first", false).unwrap();
        assert!(said(write(&path, b"second", false)).contains("exists already"));
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        write(&path, b"third", true).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"third");
        // Others may read it as they may any new file, and a link stays one.
        let plain = folder.path().join("plain");
        std::fs::write(&plain, "").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&plain));
        let link = folder.path().join("link");
        symlink(&path, &link).unwrap();
        write(&link, b"through", true).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"through");
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(names(folder.path()), ["a.ngc", "link", "plain"]);
        // A device is no file that could be lost.
        write(Path::new("/dev/null"), b"x", false).unwrap();
        assert!(said(write(folder.path(), b"x", true)).contains("cannot write"));
        assert!(said(write(&folder.path().join("none/x"), b"x", true)).contains("cannot write"));
    }

    #[test]
    fn inputs_stay() {
        let folder = tempfile::tempdir().unwrap();
        let [job, link] = ["job.toml", "link.toml"].map(|name| folder.path().join(name));
        std::fs::write(&job, "job").unwrap();
        std::fs::hard_link(&job, &link).unwrap();
        note_input(&job);
        for path in [&job, &link] {
            assert!(said(write(path, b"x", true)).contains("is what the command reads"));
            assert!(said(OutputFile::begin(path, true).map(|_| ())).contains("is what the command reads"));
        }
        assert_eq!(std::fs::read(&job).unwrap(), b"job");
    }

    #[test]
    fn what_is_not_complete_has_no_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.csv");
        let output = OutputFile::begin(&path, false).unwrap();
        output.file().unwrap().write_all(b"tick\n1\n").unwrap();
        assert!(names(folder.path()).is_empty());
        drop(output);
        assert!(names(folder.path()).is_empty());
        let output = OutputFile::begin(&path, false).unwrap();
        output.file().unwrap().write_all(b"tick\n1\n").unwrap();
        output.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"tick\n1\n");
        assert!(said(OutputFile::begin(&path, false).map(|_| ())).contains("exists already"));
        // Made by another program meanwhile.
        let other = folder.path().join("other.csv");
        let output = OutputFile::begin(&other, false).unwrap();
        std::fs::write(&other, "other").unwrap();
        assert!(said(output.finish()).contains("exists already"));
        assert_eq!(std::fs::read(&other).unwrap(), b"other");
    }

    #[test]
    fn folders_are_made_whole() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out/of/here");
        let files = ["index.html", "path.svg"];
        let make = |text: &'static str| {
            move |folder: &Path| {
                files
                    .iter()
                    .try_for_each(|name| std::fs::write(folder.join(name), text))
            }
        };
        write_folder(&out, &files, false, make("1")).unwrap();
        assert_eq!(names(&out), files);
        assert!(said(write_folder(&out, &files, false, make("2"))).contains("exists already"));
        let broken = write_folder(&out, &files, true, |_| Err(io::Error::other("no")));
        assert!(said(broken).contains("no"));
        assert_eq!(std::fs::read(out.join("path.svg")).unwrap(), b"1");
        write_folder(&out, &files, true, make("3")).unwrap();
        assert_eq!(std::fs::read(out.join("path.svg")).unwrap(), b"3");
        assert_eq!(names(&out), files);
    }
}
