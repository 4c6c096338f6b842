//! `new`: writes a commented template of a job file.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::out::say;
use super::{Result, whole};
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
    whole::write(
        path,
        programs::with_command_name(&text).as_bytes(),
        arguments.force,
    )?;
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
