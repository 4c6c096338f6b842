//! `export`: writes a job as G-code for another controller.

use job::units::S_PER_MIN;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::out::say;
use super::{Failure, Result, along, load, numbers, output_file, progress, spinner};
use approach::export::{Dialect, ExportError, Options, export};
use approach::gcode::FeedMode;
use approach::{Kind, passes};

/// Writes a job as a G-code program for LinuxCNC or Grbl: straight cuts, or arcs.
///
/// Example: cargo sim export jobs/freeform.toml --format linuxcnc -o freeform.ngc
/// Example: cargo sim export jobs/revolved_v.toml --format grbl --approach curve -o bell.nc
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job file (TOML).
    job: PathBuf,
    /// G-code dialect.
    #[arg(long, value_enum)]
    format: Dialect,
    /// Writes the program into this file.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Overwrites an existing file.
    #[arg(long)]
    force: bool,
    /// Approximation of the tool path; `curve` is written as arcs.
    #[arg(long, value_parser = written(), default_value = "linear")]
    approach: Kind,
    /// Unit of the F words: G93 inverse time, or G94 mm/min.
    #[arg(long, value_enum, default_value = "g94")]
    feed_mode: FeedMode,
    /// Clearance, mm: of the safe height above the highest cut, and of the start of a plunge above its cut.
    #[arg(long, value_name = "MM", default_value_t = 5.0, value_parser = numbers::length, allow_negative_numbers = true)]
    clearance: f64,
    /// Switches the spindle on at this speed, rev/min.
    #[arg(long, value_name = "RPM", value_parser = numbers::rpm, allow_negative_numbers = true)]
    spindle: Option<f64>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

/// The approaches that G-code can represent. `surface` is accepted but hidden, so that it is refused with a remedy.
fn written() -> impl TypedValueParser<Value = Kind> {
    let values = Kind::ALL.into_iter().filter_map(|kind| {
        let value = kind.to_possible_value()?;
        Some(value.hide(kind == Kind::Surface))
    });
    PossibleValuesParser::new(values).try_map(|name| Kind::from_str(&name, false))
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Approach(error) => error.into(),
            ExportError::SurfaceNeedsTheCore => Self::input(
                "G-code cannot represent a surface",
                "export it with --approach linear or curve; the firmware runs it as a surface: cargo sim run",
            ),
            ExportError::FacesDown { u, v } => Self::Failed(Some(format!(
                "the surface faces down at u = {u:.6}, v = {v:.6}: the tool cannot be lifted off it\n  \
                 help: turn the part, or machine this region in another set-up"
            ))),
        }
    }
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (job, _) = load(&arguments.job)?;
    super::whole_surface(&job, "export")?;
    output_file::check(&arguments.output, arguments.force)?;
    let options = Options {
        dialect: arguments.format,
        kind: arguments.approach,
        feed_mode: arguments.feed_mode,
        clearance_mm: arguments.clearance,
        spindle_rpm: arguments.spindle,
    };
    let oracle = inspect::oracle(&job)?;
    let bar = if job.spacing.is_constant() {
        spinner("planning the passes that the core makes")
    } else {
        let bar = spinner("computing the passes");
        let count = passes(&oracle).map_err(ExportError::from)?.len();
        bar.finish_and_clear();
        progress(count as u64, "planning")
    };
    let exported = export(&job, &options, &|| bar.inc(1))?;
    bar.finish_and_clear();
    output_file::write(&arguments.output, exported.text.as_bytes(), arguments.force)?;
    let (bytes, blocks) = (exported.text.len(), exported.text.lines().count());
    if arguments.json {
        let mut value = json!({
            "approach": options.kind.name(),
            "feed_mode": options.feed_mode.word(),
            "passes": exported.passes,
            "segments": exported.cuts,
            "blocks": blocks,
            "program_bytes": bytes,
            "cutting_time_s": exported.cutting_time_s,
            "safe_z_mm": exported.safe_z_mm,
        });
        if let Some(keys) = value.as_object_mut() {
            keys.extend(along::json(&job));
        }
        say!("{value}");
        return Ok(());
    }
    say!("{}", arguments.output.display());
    say!("  along        {}", along::sentence(&job));
    say!("  passes       {}", exported.passes);
    say!(
        "  program      {} cuts, {blocks} blocks, {bytes} bytes",
        exported.cuts
    );
    say!(
        "  cutting      {:.1} min, without links",
        exported.cutting_time_s / S_PER_MIN
    );
    say!("  safe height  {:.4} mm", exported.safe_z_mm);
    Ok(())
}
