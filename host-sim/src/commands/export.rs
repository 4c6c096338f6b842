//! `export`: writes a job as G-code for another controller.

use job::units::S_PER_MIN;
use job::{AT_SPEED_DEFAULT_MS, Job, MachineProfile, Spindle};
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::out::say;
use super::{Failure, Result, along, home, numbers, output_file, progress, read_profile, spinner};
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
    /// Clearance of the safe height, mm, instead of the job's `clearance_mm`.
    #[arg(long, value_name = "MM", value_parser = numbers::height, allow_negative_numbers = true)]
    clearance: Option<f64>,
    /// Machine profile (TOML): travel, and the time that the spindle needs to its speed (3 s without it).
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Speed of the spindle, rev/min, instead of the job's.
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
            ExportError::Refused(error) => error.into(),
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

/// Gives the job the clearance and the spindle's speed of the command line.
fn override_machine(job: &mut Job, arguments: &Arguments, profile: Option<&MachineProfile>) -> Result<()> {
    if let Some(clearance_mm) = arguments.clearance {
        if job.machine.safe_z_mm.is_some() {
            let what = "--clearance and safe_z_mm: the job gives the safe height itself";
            let remedy = "leave --clearance out, or remove safe_z_mm";
            return Err(job.origin.error("machine.safe_z_mm", what, remedy).into());
        }
        job.machine.clearance_mm = clearance_mm;
    }
    if let Some(rpm) = arguments.spindle {
        let own = job.machine.spindle.unwrap_or(Spindle {
            rpm: 0,
            counterclockwise: false,
            coolant: false,
        });
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "above 0, at most 1e6"
        )]
        let rpm = rpm.round().max(1.0) as u32;
        check_rpm(rpm, profile)?;
        job.machine.spindle = Some(Spindle { rpm, ..own });
    }
    Ok(())
}

/// Checks the speed of the command line as that of a job is.
fn check_rpm(rpm: u32, profile: Option<&MachineProfile>) -> Result<()> {
    match profile.map(|profile| profile.spindle) {
        Some(None) => Err(Failure::input(
            format!("--spindle {rpm}: the machine's profile has no spindle"),
            "leave it out, or add [spindle] with max_rpm to the profile",
        )),
        Some(Some(drive)) if rpm > drive.max_rpm => Err(Failure::input(
            format!(
                "--spindle {rpm} exceeds the machine's profile: {} there",
                drive.max_rpm
            ),
            "lower it",
        )),
        _ => Ok(()),
    }
}

/// Time from switching the spindle on to the first motion, s.
fn run_up_s(profile: Option<&MachineProfile>) -> f64 {
    let drive = profile.and_then(|profile| profile.spindle);
    1e-3 * drive.map_or(AT_SPEED_DEFAULT_MS, |drive| drive.at_speed_ms)
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let profile = read_profile(arguments.machine.as_ref())?;
    let (mut job, _) = home::load(&arguments.job, profile.as_ref(), None, None)?;
    super::whole_surface(&job, "export")?;
    output_file::check(&arguments.output, arguments.force)?;
    override_machine(&mut job, arguments, profile.as_ref())?;
    let options = Options {
        dialect: arguments.format,
        kind: arguments.approach,
        feed_mode: arguments.feed_mode,
        run_up_s: run_up_s(profile.as_ref()),
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
            "home_mm": job.machine.home_mm,
            "spindle_rpm": job.machine.spindle.map(|spindle| spindle.rpm),
            "warnings": exported.notes,
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
    for note in &exported.notes {
        say!("  warning: {note}");
    }
    Ok(())
}
