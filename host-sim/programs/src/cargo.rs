//! Builds by Cargo, in a checkout.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::{Part, Unavailable};

/// Builds a file, and returns its path.
pub(crate) fn build(root: &Path, part: Part) -> Result<PathBuf, Unavailable> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    if part.alias().is_some() {
        // An image is the same, cycle for cycle, whoever builds it: an incremental build cuts its crates differently.
        command.env("CARGO_INCREMENTAL", "0");
    }
    let output = command
        .args(part.build())
        .current_dir(root)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| Unavailable::Build(format!("cargo does not start: {error}")))?;
    if output.status.success() {
        Ok(root.join(part.built()))
    } else {
        Err(Unavailable::Build(
            String::from_utf8_lossy(&output.stderr).into_owned(),
        ))
    }
}
