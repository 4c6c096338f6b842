//! Where the tool finds the files that it needs at run time: programs, board images, sample jobs, golden tables.
//!
//! ```text
//! current_exe ──► PREFIX/bin/isofeed beside PREFIX/libexec/isofeed?  ──yes──► Installed: every file is there, nothing is built
//!                     │ no
//!                     ▼
//!                 a checkout around CARGO_MANIFEST_DIR, the executable or the working directory
//!                                                                    ──yes──► Checkout: Cargo builds a file when it is asked for
//! ```
//!
//! This is the only crate that starts Cargo. No path of the machine that built the tool is in it: both places are found at run time.

mod cargo;
mod name;
mod part;
mod place;
#[cfg(test)]
mod tests;

pub use name::{command_name, installed_name, with_command_name};
pub use part::Part;
pub use place::{Place, checkout, place, share};

use std::path::PathBuf;

/// Why a file is not there.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unavailable {
    /// The installation is not whole.
    #[error("the installation in {} has no {file}", .prefix.display())]
    Incomplete {
        /// Where it is.
        prefix: PathBuf,
        /// The file, from there.
        file: String,
    },
    /// The tool is neither installed nor in a checkout.
    #[error("this program lies neither in an installation nor in a checkout of the project")]
    Nowhere,
    /// Cargo is missing or fails; its own message.
    #[error("{0}")]
    Build(String),
}

impl Unavailable {
    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Incomplete { .. } => "unpack the whole archive again, and leave its folders as they are",
            Self::Nowhere => {
                "start it as bin/isofeed of an unpacked archive, or by `cargo sim` in a checkout"
            }
            Self::Build(_) => {
                "mend what Cargo reports; where a part of the toolchain is missing, ./demo installs it"
            }
        }
    }
}

/// The path of a program or an image. In a checkout, Cargo brings it up to date first: at once where nothing has changed, minutes
/// where [`needs_build`].
///
/// # Errors
/// The installation lacks the file; Cargo is missing or fails; there is neither an installation nor a checkout.
pub fn find(part: Part) -> Result<PathBuf, Unavailable> {
    match place() {
        Place::Installed(prefix) => {
            let file = part.installed();
            let path = prefix.join(&file);
            if path.is_file() {
                Ok(path)
            } else {
                Err(Unavailable::Incomplete {
                    prefix: prefix.clone(),
                    file,
                })
            }
        }
        Place::Checkout(root) => cargo::build(root, part),
        Place::Nowhere => Err(Unavailable::Nowhere),
    }
}

/// Whether [`find`] will build the file from nothing.
#[must_use]
pub fn needs_build(part: Part) -> bool {
    matches!(place(), Place::Checkout(root) if !root.join(part.built()).exists())
}

/// The sample job of this name, without its ending.
#[must_use]
pub fn sample_job(name: &str) -> PathBuf {
    let file = format!("{name}.toml");
    match place() {
        Place::Installed(prefix) => share(prefix).join("jobs").join(file),
        Place::Checkout(root) => root.join("jobs").join(file),
        Place::Nowhere => PathBuf::from("jobs").join(file),
    }
}

/// A file of the golden tables (`tests/golden` in a checkout), and of the jobs that they are about.
#[must_use]
pub fn golden(file: &str) -> PathBuf {
    match place() {
        Place::Installed(prefix) => share(prefix).join("golden").join(file),
        Place::Checkout(root) => root.join("tests/golden").join(file),
        Place::Nowhere => PathBuf::from("tests/golden").join(file),
    }
}

/// How to get an image that a command asks for: by Cargo's alias in a checkout; an installation has all of them.
#[must_use]
pub fn image_remedy(part: Part) -> String {
    match (place(), part.alias()) {
        (Place::Installed(_), _) | (_, None) => {
            "leave the option out: the installation has the image".to_owned()
        }
        (_, Some(alias)) => format!("build it with `cargo {alias}`, or leave the option out"),
    }
}
