//! `new`: writes a commented template of a job file.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::import::advice_json;
use super::out::say;
use super::{Result, output_file, spinner};
use crate::template::{self, Kind};
use machine::advice::advise_spacing;

/// Writes a commented job file that runs at once, with its keys, their units, ranges and defaults.
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
    output_file::check(path, arguments.force)?;
    let name = path.display().to_string();
    let mut text = template::job(arguments.kind, &name);
    let mut advice = None;
    if arguments.kind != Kind::File {
        let bar = spinner("trying straight passes and those of constant scallop height");
        let found = advise_spacing(&job_file::parse(&name, &text)?);
        bar.finish_and_clear();
        if let Some(start) = found.spacing.start() {
            text = template::with_constant_spacing(&text, start);
        }
        advice = Some(found);
    }
    output_file::write(
        path,
        programs::with_command_name(&text).as_bytes(),
        arguments.force,
    )?;
    if arguments.json {
        say!(
            "{}",
            json!({ "job": path, "spacing": advice.as_ref().map(advice_json) })
        );
        return Ok(());
    }
    say!("{}", path.display());
    if let Some(advice) = &advice {
        say!("  passes: {}", advice.sentence());
    }
    match arguments.kind {
        Kind::File => say!(
            "  next: set path and face in [surface], then cargo sim simulate {}",
            path.display()
        ),
        _ => say!("  next: cargo sim simulate {}", path.display()),
    }
    Ok(())
}
