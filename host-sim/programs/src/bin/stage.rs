//! Lays out an installation: `stage PREFIX TOOL [--as-tested]` copies the tool, its programs, the images, jobs and documents below PREFIX.
//! `./dist` runs it, and makes the archive of what it leaves.

use std::error::Error;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use programs::{Part, checkout, find, installed_name, share};

/// Documents of the root; `docs/` besides.
const DOCUMENTS: [&str; 6] = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "LICENSE-APACHE",
    "LICENSE-MIT",
];

/// What of `tests/golden` the tool reads besides job files.
const GOLDEN: [&str; 1] = ["cycles.txt"];

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let (prefix, tool, reader) = match arguments.as_slice() {
        [prefix, tool] => (prefix, tool, Part::FastCadReader),
        [prefix, tool, option] if option == Path::new("--as-tested") => (prefix, tool, Part::CadReader),
        _ => {
            eprintln!("usage: stage PREFIX TOOL [--as-tested] (`./dist` is what you want)");
            return ExitCode::from(2);
        }
    };
    match stage(prefix, tool, reader) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn stage(prefix: &Path, tool: &Path, reader: Part) -> Outcome<()> {
    let root = checkout().ok_or("stage runs in a checkout only")?;
    copy(tool, &prefix.join("bin/isofeed"))?;
    for part in Part::installation(reader) {
        copy(&find(part)?, &prefix.join(part.installed()))?;
    }
    let share = share(prefix);
    for file in DOCUMENTS {
        copy(&root.join(file), &share.join(file))?;
    }
    copy_folder(&root.join("docs"), &share.join("docs"), &|_| true)?;
    copy_folder(&root.join("jobs"), &share.join("jobs"), &|_| true)?;
    copy_folder(&root.join("tests/golden"), &share.join("golden"), &|file| {
        file.extension() == Some(OsStr::new("toml")) || GOLDEN.iter().any(|name| file.ends_with(name))
    })?;
    copy(&root.join("docs/install.md"), &prefix.join("INSTALL.md"))
}

/// All files below a folder that are wanted.
fn copy_folder(from: &Path, to: &Path, wanted: &dyn Fn(&Path) -> bool) -> Outcome<()> {
    for entry in fs::read_dir(from).map_err(|error| format!("{}: {error}", from.display()))? {
        let entry = entry?;
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if entry.file_type()?.is_dir() {
            copy_folder(&source, &target, wanted)?;
        } else if wanted(&source) {
            copy(&source, &target)?;
        }
    }
    Ok(())
}

/// A file with its permissions. What people read names the tool as an installation does.
fn copy(from: &Path, to: &Path) -> Outcome<()> {
    let failed = |error: std::io::Error| format!("{} to {}: {error}", from.display(), to.display());
    fs::create_dir_all(to.parent().unwrap_or(to)).map_err(failed)?;
    fs::copy(from, to).map_err(failed)?;
    let is_text = ["md", "toml", "txt"]
        .iter()
        .any(|ending| from.extension() == Some(OsStr::new(ending)));
    if is_text {
        let text = fs::read_to_string(from).map_err(failed)?;
        fs::write(to, installed_name(&text).as_ref()).map_err(failed)?;
    }
    Ok(())
}
