//! Whether the tool is installed or in a checkout, and where.

use std::env;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Programs that only the tool starts, and the plugin; from the prefix.
pub(crate) const LIBEXEC: &str = "libexec/isofeed";
/// Images, jobs, documents; from the prefix.
pub(crate) const SHARE: &str = "share/isofeed";

/// Where the tool runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// In an installation with this prefix.
    Installed(PathBuf),
    /// In the checkout with this root.
    Checkout(PathBuf),
    /// In neither.
    Nowhere,
}

/// Where this process runs; found once.
pub fn place() -> &'static Place {
    static PLACE: OnceLock<Place> = OnceLock::new();
    PLACE.get_or_init(|| {
        let executable = env::current_exe().unwrap_or_default();
        // Cargo sets the first for what `cargo run` and `cargo test` start.
        let manifest = env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
        find(
            &executable,
            manifest.as_deref(),
            &env::current_dir().unwrap_or_default(),
        )
    })
}

/// The folder of an installation for images, jobs and documents.
#[must_use]
pub fn share(prefix: &Path) -> PathBuf {
    prefix.join(SHARE)
}

/// The root of the checkout that this process runs in, if it does.
#[must_use]
pub fn checkout() -> Option<&'static Path> {
    match place() {
        Place::Checkout(root) => Some(root),
        Place::Installed(_) | Place::Nowhere => None,
    }
}

/// The place of a process with this executable, package and working directory.
pub(crate) fn find(executable: &Path, manifest: Option<&Path>, working: &Path) -> Place {
    let prefix = executable
        .parent()
        .filter(|folder| folder.ends_with("bin"))
        .and_then(Path::parent)
        .filter(|prefix| prefix.join(LIBEXEC).is_dir());
    if let Some(prefix) = prefix {
        return Place::Installed(prefix.to_owned());
    }
    [manifest, Some(executable), Some(working)]
        .into_iter()
        .flatten()
        .flat_map(Path::ancestors)
        .find(|folder| is_checkout(folder))
        .map_or(Place::Nowhere, |root| Place::Checkout(root.to_owned()))
}

/// By what `find` reads there: Cargo's aliases and the sources of this crate.
fn is_checkout(folder: &Path) -> bool {
    !folder.as_os_str().is_empty()
        && ["Cargo.lock", ".cargo/config.toml", "host-sim/programs/Cargo.toml"]
            .iter()
            .all(|file| folder.join(file).is_file())
}
