//! A digest of source files, for the build script and its test.

use std::fs;
use std::io::Result;
use std::path::{Path, PathBuf};

/// What the run of a prepared job depends on: the core, the crate that runs it, and the versions of their dependencies.
pub(crate) const CORE: [&str; 3] = ["../../interp-core/src", "../machine/src", "../../Cargo.lock"];

/// FNV-1a of the names and the bytes of all files in these folders, as hexadecimal digits.
pub(crate) fn digest(root: &Path, places: &[&str]) -> Result<String> {
    let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
    let mut add = |bytes: &[u8]| {
        for byte in bytes.iter().chain(&[0]) {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    };
    for place in places {
        let place = root.join(place);
        for file in files(&place)? {
            let name = file.strip_prefix(&place).unwrap_or(&file);
            add(name.to_string_lossy().as_bytes());
            add(&fs::read(&file)?);
        }
    }
    Ok(format!("{hash:016x}"))
}

/// A file itself, or the files in a folder and below, sorted.
fn files(place: &Path) -> Result<Vec<PathBuf>> {
    if !place.is_dir() {
        return Ok(vec![place.to_owned()]);
    }
    let mut entries = fs::read_dir(place)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<Vec<_>>>()?;
    entries.sort();
    let mut found = Vec::new();
    for entry in entries {
        found.extend(files(&entry)?);
    }
    Ok(found)
}
