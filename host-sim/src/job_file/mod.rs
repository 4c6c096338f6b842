//! What people write (TOML) -> a raw job in f64, checked for shape and range.
//!
//! ```text
//! text --toml--> spanned tables --section.rs--> typed values --mod.rs, surface.rs--> JobFile
//!                                  any step --error.rs--> JobFileError: file, line, caret, remedy
//! ```
//!
//! Lengths are millimetres and angles radians, as in the file; the feed stays in mm/min. What a [`JobFile`] holds is
//! finite and in its documented range, but whether the ball fits the surface is not known here.

mod error;
mod file;
mod placement;
mod section;
mod steps;
mod surface;
#[cfg(test)]
mod tests;
mod text;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

pub use error::JobFileError;
use interp_core::StepConfig;
use protocol::message::{Configuration, LinkTimeoutAction};
use section::{Reader, Section};
pub use surface::{NurbsSpec, SurfaceSpec};

/// Largest ball radius, mm: ten times any ball-end mill; what the core accepts.
pub const RADIUS_MAX_MM: f64 = 1000.0;
/// Largest height of [machine], mm.
const HEIGHT_MAX_MM: f64 = 1000.0;
/// Least feed, mm/min (1 um/s): below it the core's parameter step loses digits; a feed is above it.
pub const FEED_MIN_MM_MIN: f64 = 0.06;
/// Largest feed, mm/min (10 m/s): what the core accepts.
pub const FEED_MAX_MM_MIN: f64 = 600_000.0;
/// Shortest and longest sampling period, µs: what the core accepts.
pub const PERIOD_RANGE_US: [f64; 2] = [10.0, 100_000.0];
/// Sampling period of a job that names none, µs: the paper's.
pub const PERIOD_DEFAULT_US: f64 = 1000.0;
/// Silence of the host after which it counts as gone, ms: shortest, so that a host that shares its processor is not taken for
/// one that is gone, and longest.
pub const HOST_GONE_RANGE_MS: [f64; 2] = [100.0, 60_000.0];
/// The same for a job that does not say.
pub const HOST_GONE_DEFAULT_MS: f64 = 1000.0;
/// Chord error limit of a job that names none, mm: the paper's.
pub const CHORD_DEFAULT_MM: f64 = 0.005;

/// The surface parameter that runs along a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Along {
    /// Passes run along u; v is fixed on a pass.
    U,
    /// Passes run along v; u is fixed on a pass.
    V,
}

impl Along {
    /// The parameter's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::U => "u",
            Self::V => "v",
        }
    }
}

/// One direction of the passes, run on the core to see what it takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trial {
    /// The direction.
    pub along: Along,
    /// Periods of the whole job; up to the fault where there is one.
    pub ticks: u64,
    /// Why it cannot be machined this way.
    pub against: Option<String>,
}

/// How a job came by the direction of its passes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AlongChoice {
    /// The job file names it.
    #[default]
    Given,
    /// The job file leaves it to [`direction::settle`](crate::direction::settle); until then the job cannot be prepared.
    Auto,
    /// It was settled so: u and v, in this order.
    Chosen([Trial; 2]),
}

/// The side of the surface that the tool is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Towards +z, whichever sign of `S_u x S_v` that is.
    Up,
    /// The tool normal is `+ S_u x S_v`, whatever the pass direction.
    Plus,
    /// The tool normal is `- S_u x S_v`, whatever the pass direction.
    Minus,
}

/// Order of the passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Every pass runs the same way.
    Zig,
    /// Every second pass runs backwards.
    Zigzag,
}

/// How far apart passes lie for the scallop height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// As far as the height allows over the gap to the next pass.
    Exact,
    /// By the paper's interval at the pass alone, which may exceed the height.
    FirstOrder,
}

/// The machine that is to run the job. Where a limit is `None`, the file gave none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    /// Sampling period T, µs, in [`PERIOD_RANGE_US`].
    pub period_us: f64,
    /// Velocity limit of the axes x, y, z, mm/s, above 0.
    pub velocity_max_mm_s: Option<[f64; 3]>,
    /// Acceleration limit of the axes, mm/s², above 0.
    pub acceleration_max_mm_s2: Option<[f64; 3]>,
    /// Jerk limit of the axes, mm/s³, above 0.
    pub jerk_max_mm_s3: Option<[f64; 3]>,
    /// Travel of the axes, mm, `[least, most]`.
    pub travel_mm: Option<[[f64; 2]; 3]>,
    /// Where the tool's centre stands before the run, mm.
    pub home_mm: Option<[f64; 3]>,
    /// Height (z of the tool's centre) at which the tool is clear of everything, mm.
    pub safe_z_mm: Option<f64>,
    /// How far above the surface's highest place that is, mm, where `safe_z_mm` is not given.
    pub clearance_mm: Option<f64>,
    /// The last part of the way down that is gone at the feed, mm.
    pub plunge_mm: Option<f64>,
    /// A run on a board starts only where its axes are homed.
    pub homing_required: bool,
    /// What a run on a board does when the host is gone.
    pub host_gone: LinkTimeoutAction,
    /// Silence after which the host is gone, ms, in [`HOST_GONE_RANGE_MS`].
    pub host_gone_ms: f64,
    /// What the axes' drives want: exact steps a millimetre, pulses, directions.
    pub steps: Option<StepConfig>,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            period_us: PERIOD_DEFAULT_US,
            velocity_max_mm_s: None,
            acceleration_max_mm_s2: None,
            jerk_max_mm_s3: None,
            travel_mm: None,
            home_mm: None,
            safe_z_mm: None,
            clearance_mm: None,
            plunge_mm: None,
            homing_required: true,
            host_gone: LinkTimeoutAction::Finish,
            host_gone_ms: HOST_GONE_DEFAULT_MS,
            steps: None,
        }
    }
}

impl Machine {
    /// Sampling period T, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.period_us * 1e-6
    }

    /// What a board is told of the machine.
    #[must_use]
    pub fn configuration(&self) -> Configuration {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "1 to 6e6 by the ranges of both"
        )]
        let link_timeout_ticks = (self.host_gone_ms * 1e3 / self.period_us).ceil() as u32;
        Configuration {
            homing_required: self.homing_required,
            on_link_timeout: self.host_gone,
            link_timeout_ticks,
        }
    }
}

/// A job as its file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct JobFile {
    /// The surface to be cut, placed where the file's `[placement]` wants it.
    pub surface: SurfaceSpec,
    /// Ball radius r, mm, above 0, at most [`RADIUS_MAX_MM`].
    pub radius_mm: f64,
    /// Feed of the cutter contact along the surface, mm/min, above [`FEED_MIN_MM_MIN`], at most [`FEED_MAX_MM_MIN`].
    pub feed_mm_min: f64,
    /// Scallop height limit h, mm, above 0, below the ball radius.
    pub scallop_mm: f64,
    /// The path parameter. With `along = "auto"` it says nothing before [`direction::settle`](crate::direction::settle) was asked.
    pub along: Along,
    /// The side of the tool.
    pub side: Side,
    /// Order of the passes.
    pub pattern: Pattern,
    /// How far apart the passes lie.
    pub spacing: Spacing,
    /// Chord error limit delta, mm, above 0, below the ball radius; for the approaches that cut chords.
    pub chord_mm: f64,
    /// The machine.
    pub machine: Machine,
    /// Where in which file all this stands.
    pub origin: Origin,
}

impl JobFile {
    /// Reads a job from a file.
    ///
    /// # Errors
    /// The file cannot be read, is not TOML, or a value in it is missing, unknown, of the wrong shape or out of range.
    pub fn load(path: &Path) -> Result<Self, JobFileError> {
        let name = path.display().to_string();
        let text = text::read(path)?;
        Self::parse(&name, &text)
    }

    /// Reads a job from text; `name` stands for the file in errors.
    ///
    /// # Errors
    /// As [`JobFile::load`].
    pub fn parse(name: &str, text: &str) -> Result<Self, JobFileError> {
        let reader = Reader::new(name, text);
        let document = reader.document()?;
        document.only(&["surface", "placement", "tool", "cut", "machine"], &[])?;
        let surface = surface::read(&document.section("surface")?)?;
        let surface = match document.optional_section("placement")? {
            Some(section) => placement::place(&section, &surface)?,
            None => surface,
        };
        let radius_mm = read_tool(&document.section("tool")?)?;
        let cut = document.section("cut")?;
        cut.only(
            &[
                "feed_mm_min",
                "scallop_mm",
                "along",
                "side",
                "pattern",
                "spacing",
                "chord_mm",
            ],
            &[],
        )?;
        let below_radius = |key: &str, remedy: &str| {
            let value = cut.number(key)?;
            if value > 0.0 && value < radius_mm {
                return Ok(value);
            }
            let what =
                format!("`{key}` must be above 0 and below the ball radius of {radius_mm} mm, not {value}");
            Err(cut.error(key, what, remedy))
        };
        let directions = [("u", Some(Along::U)), ("v", Some(Along::V)), ("auto", None)];
        let along = cut.choice("along", &directions)?;
        let mut origin = reader.origin(&document);
        if along.is_none() {
            origin.set_along_choice(AlongChoice::Auto);
        }
        Ok(Self {
            surface,
            radius_mm,
            feed_mm_min: cut.number_within(
                "feed_mm_min",
                FEED_MIN_MM_MIN,
                FEED_MAX_MM_MIN,
                "the feed in mm/min, e.g. 600",
            )?,
            scallop_mm: below_radius("scallop_mm", "give the scallop height limit in mm, e.g. 0.005")?,
            along: along.unwrap_or(Along::U),
            side: cut.choice("side", &[("up", Side::Up), ("+", Side::Plus), ("-", Side::Minus)])?,
            pattern: match cut.has("pattern") {
                true => cut.choice("pattern", &[("zig", Pattern::Zig), ("zigzag", Pattern::Zigzag)])?,
                false => Pattern::Zig,
            },
            spacing: match cut.has("spacing") {
                true => cut.choice(
                    "spacing",
                    &[("exact", Spacing::Exact), ("first-order", Spacing::FirstOrder)],
                )?,
                false => Spacing::Exact,
            },
            chord_mm: match cut.has("chord_mm") {
                true => below_radius("chord_mm", "give the chord error limit in mm, e.g. 0.005")?,
                false => CHORD_DEFAULT_MM.min(0.5 * radius_mm),
            },
            machine: document
                .optional_section("machine")?
                .map_or(Ok(Machine::default()), |s| read_machine(&s))?,
            origin,
        })
    }

    /// Feed along the surface, mm/s.
    #[must_use]
    pub fn feed_mm_s(&self) -> f64 {
        self.feed_mm_min / 60.0
    }
}

/// The tool's radius, mm.
fn read_tool(tool: &Section<'_>) -> Result<f64, JobFileError> {
    tool.only(&["kind", "radius_mm"], &[])?;
    tool.choice("kind", &[("ball", ())])?;
    tool.number_within(
        "radius_mm",
        0.0,
        RADIUS_MAX_MM,
        "the ball's radius in mm (half its diameter), e.g. 10",
    )
}

/// The optional section `[machine]`.
fn read_machine(machine: &Section<'_>) -> Result<Machine, JobFileError> {
    const AXES: &str = "three numbers above 0, one each for x, y and z, e.g. [100, 100, 50]";
    machine.only(
        &[
            "period_us",
            "velocity_max_mm_s",
            "acceleration_max_mm_s2",
            "jerk_max_mm_s3",
            "travel_mm",
            "home_mm",
            "safe_z_mm",
            "clearance_mm",
            "plunge_mm",
            "homing_required",
            "host_gone",
            "host_gone_ms",
            steps::KEYS[0],
            steps::KEYS[1],
            steps::KEYS[2],
            steps::KEYS[3],
        ],
        &[],
    )?;
    let mut read = Machine::default();
    if machine.has("period_us") {
        let [least, most] = PERIOD_RANGE_US;
        read.period_us = machine.number("period_us")?;
        if !(least..=most).contains(&read.period_us) {
            let what = format!("`period_us` must be {least} to {most}, not {}", read.period_us);
            return Err(machine.error(
                "period_us",
                what,
                "give the sampling period in microseconds, e.g. 1000",
            ));
        }
    }
    read.velocity_max_mm_s = machine.positive_axes("velocity_max_mm_s", AXES)?;
    read.acceleration_max_mm_s2 = machine.positive_axes("acceleration_max_mm_s2", AXES)?;
    read.jerk_max_mm_s3 = machine.positive_axes("jerk_max_mm_s3", AXES)?;
    read.steps = steps::read(machine, read.period_us)?;
    if machine.has("travel_mm") {
        let travel: [[f64; 2]; 3] = machine.matrix("travel_mm")?;
        for (range, axis) in travel.iter().zip(["x", "y", "z"]) {
            if range[0] >= range[1] {
                let what = format!(
                    "the travel of {axis} must ascend, not run from {} to {}",
                    range[0], range[1]
                );
                return Err(machine.error("travel_mm", what, "give [least, most] for each axis, in mm"));
            }
        }
        read.travel_mm = Some(travel);
    }
    if machine.has("home_mm") {
        read.home_mm = Some(machine.numbers("home_mm")?);
    }
    if machine.has("safe_z_mm") {
        read.safe_z_mm = Some(machine.number("safe_z_mm")?);
    }
    for (key, value) in [
        ("clearance_mm", &mut read.clearance_mm),
        ("plunge_mm", &mut read.plunge_mm),
    ] {
        if machine.has(key) {
            *value = Some(machine.number_within(key, 0.0, HEIGHT_MAX_MM, "a height in mm, e.g. 2")?);
        }
    }
    read_care(machine, &mut read)?;
    Ok(read)
}

/// The keys of `[machine]` for what may start a run, and what may interrupt it.
fn read_care(machine: &Section<'_>, read: &mut Machine) -> Result<(), JobFileError> {
    if machine.has("homing_required") {
        read.homing_required = machine.switch("homing_required")?;
    }
    if machine.has("host_gone") {
        let choices = [
            ("finish", LinkTimeoutAction::Finish),
            ("hold", LinkTimeoutAction::Hold),
        ];
        read.host_gone = machine.choice("host_gone", &choices)?;
    }
    if machine.has("host_gone_ms") {
        let [least, most] = HOST_GONE_RANGE_MS;
        read.host_gone_ms = machine.number("host_gone_ms")?;
        if !(least..=most).contains(&read.host_gone_ms) {
            let what = format!(
                "`host_gone_ms` must be {least} to {most}, not {}",
                read.host_gone_ms
            );
            let remedy = "give the silence in milliseconds after which the host is gone, e.g. 1000";
            return Err(machine.error("host_gone_ms", what, remedy));
        }
    }
    Ok(())
}

/// Where a job came from: the file, which an error found later needs to point at the line, and who chose its direction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    name: Arc<str>,
    text: Arc<str>,
    keys: BTreeMap<String, Range<usize>>,
    along_choice: AlongChoice,
}

impl Origin {
    /// The file's name as it was given, empty for a job that came from no file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where the value of `section.key` (or the section) stands, and its line: `job.toml:10: radius_mm = 10`.
    #[must_use]
    pub fn quote(&self, key: &str) -> Option<String> {
        let section = key.split('.').next().unwrap_or(key);
        let span = self.keys.get(key).or_else(|| self.keys.get(section))?;
        let before = self.text.get(..span.start)?.matches('\n').count();
        let line = self.text.lines().nth(before)?;
        let line = line.split('#').next().unwrap_or(line).trim();
        Some(format!("{}:{}: {line}", self.name, before + 1))
    }

    /// How the job came by the direction of its passes.
    #[must_use]
    pub fn along_choice(&self) -> &AlongChoice {
        &self.along_choice
    }

    pub(crate) fn set_along_choice(&mut self, choice: AlongChoice) {
        self.along_choice = choice;
    }

    /// An error that points at the value of `section.key` (or at the section, or at the file, where there is none).
    #[must_use]
    pub fn error(&self, key: &str, what: impl Into<String>, remedy: impl Into<String>) -> JobFileError {
        let section = key.split('.').next().unwrap_or(key);
        let span = self
            .keys
            .get(key)
            .or_else(|| self.keys.get(section))
            .cloned()
            .unwrap_or(0..0);
        JobFileError::at(&self.name, &self.text, span, what.into(), remedy.into())
    }
}
