//! `new`: writes a commented template of a job file.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::out::say;
use super::{Failure, Result, cannot_write};
use crate::template::{self, Kind};

/// Writes a commented job file that runs at once, with every key, its unit, range and default.
///
/// Example: cargo sim new
/// Example: cargo sim new -o dome.toml --kind revolved
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The file to write; an existing file is not overwritten.
    #[arg(short, long, value_name = "JOB", default_value = "job.toml")]
    output: PathBuf,
    /// Kind of the surface.
    #[arg(long, value_enum, default_value = "bicubic")]
    kind: Kind,
    /// Overwrites an existing file.
    #[arg(long)]
    force: bool,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let path = &arguments.output;
    let text = template::job(arguments.kind, &path.display().to_string());
    let mut options = OpenOptions::new();
    options.write(true);
    if arguments.force {
        options.create(true).truncate(true);
    } else {
        options.create_new(true);
    }
    let written = options
        .open(path)
        .and_then(|mut file| file.write_all(programs::with_command_name(&text).as_bytes()));
    written.map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists if !path.is_dir() => Failure::input(
            format!("{} exists already", path.display()),
            "give another file with -o, or overwrite it with --force",
        ),
        ErrorKind::AlreadyExists => cannot_write(path, &ErrorKind::IsADirectory.into()),
        _ => cannot_write(path, &error),
    })?;
    if arguments.json {
        say!("{}", json!({ "job": path }));
        return Ok(());
    }
    say!("{}", path.display());
    match arguments.kind {
        Kind::File => say!(
            "  next: set path and face in [surface], then cargo sim simulate {}",
            path.display()
        ),
        _ => say!("  next: cargo sim simulate {}", path.display()),
    }
    Ok(())
}
