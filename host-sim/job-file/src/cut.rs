//! The section `[cut]`.

use interp_core::command::OVERRIDE_MAX_PERCENT;
use interp_core::job::STEP_MAX_MM;
use job::{
    Along, CHORD_DEFAULT_MM, FEED_MAX_MM_MIN, FEED_MIN_MM_MIN, Job, JobError, OVERRUN_MAX_MM, Pattern, Side,
    Spacing, Start,
};

use crate::section::Section;

const KEYS: [&str; 9] = [
    "feed_mm_min",
    "scallop_mm",
    "along",
    "side",
    "pattern",
    "spacing",
    "start",
    "chord_mm",
    "overrun_mm",
];

/// The cut of a job; lengths and ranges as in [`Job`].
pub(super) struct CutSpec {
    /// `None`: chosen by trials.
    pub(super) along: Option<Along>,
    pub(super) spacing: Spacing,
    /// The start of passes of constant scallop height is chosen by trials.
    pub(super) is_start_auto: bool,
    pub(super) feed_mm_min: f64,
    pub(super) scallop_mm: f64,
    pub(super) side: Side,
    pub(super) pattern: Pattern,
    pub(super) chord_mm: f64,
    pub(super) overrun_mm: f64,
}

/// Least scallop height and chord error, mm: far below the resolution of positions, and still no 0 in a job's header.
const LEAST_MM: f64 = 1e-12;

/// Reads `[cut]` for a ball.
pub(super) fn read(cut: &Section<'_>, radius_mm: f64) -> Result<CutSpec, JobError> {
    cut.only(&KEYS, &[])?;
    let below_radius = |key: &str, remedy: &str| {
        let value = cut.number(key)?;
        if value >= LEAST_MM && value < radius_mm {
            return Ok(value);
        }
        let what = if value > 0.0 && value < LEAST_MM {
            format!("`{key}` must be at least {LEAST_MM:e} mm, not {value:e}")
        } else {
            format!("`{key}` must be above 0 and below the ball radius of {radius_mm} mm, not {value}")
        };
        Err(cut.error(key, what, remedy))
    };
    let directions = [("u", Some(Along::U)), ("v", Some(Along::V)), ("auto", None)];
    let along = cut.choice("along", &directions)?;
    let (spacing, is_start_auto) = read_spacing(cut)?;
    Ok(CutSpec {
        along,
        spacing,
        is_start_auto,
        feed_mm_min: cut.number_within(
            "feed_mm_min",
            FEED_MIN_MM_MIN,
            FEED_MAX_MM_MIN,
            "the feed in mm/min, e.g. 600",
        )?,
        scallop_mm: below_radius("scallop_mm", "give the scallop height limit in mm, e.g. 0.005")?,
        side: cut.choice("side", &[("up", Side::Up), ("+", Side::Plus), ("-", Side::Minus)])?,
        pattern: match cut.has("pattern") {
            true => cut.choice("pattern", &[("zig", Pattern::Zig), ("zigzag", Pattern::Zigzag)])?,
            false => Pattern::Zig,
        },
        chord_mm: match cut.has("chord_mm") {
            true => below_radius("chord_mm", "give the chord error limit in mm, e.g. 0.005")?,
            false => CHORD_DEFAULT_MM.min(0.5 * radius_mm),
        },
        overrun_mm: match cut.has("overrun_mm") {
            true => read_overrun(cut)?,
            false => 0.0,
        },
    })
}

/// Largest feed of a job with axis limits, mm/min: a period at the maximum override is the core's maximum step.
#[must_use]
pub fn feed_max_within_limits(period_us: f64) -> f64 {
    f64::from(STEP_MAX_MM) * 100.0 / f64::from(OVERRIDE_MAX_PERCENT) * 60e6 / period_us
}

/// Refuses a feed whose period is longer than a step of the core within axis limits.
pub(super) fn check_feed(cut: &Section<'_>, job: &Job) -> Result<(), JobError> {
    let period_us = job.machine.period_us;
    let most = feed_max_within_limits(period_us);
    if !job.machine.has_limits() || job.feed_mm_min <= most {
        return Ok(());
    }
    let what = format!(
        "`feed_mm_min` must be at most {most} on a machine with limits and a period of {period_us} us, not {}",
        job.feed_mm_min
    );
    Err(cut.error("feed_mm_min", what, "lower the feed, or shorten period_us"))
}

/// Refuses an overrun of a job that has no turns.
pub(super) fn check_overrun(cut: &Section<'_>, job: &Job) -> Result<(), JobError> {
    if job.overrun_mm <= 0.0 {
        return Ok(());
    }
    let (what, remedy) = if job.pattern != Pattern::Zigzag {
        (
            "passes in one direction have no turns beyond the boundary",
            "remove it, or write pattern = \"zigzag\"",
        )
    } else if !job.machine.has_limits() {
        (
            "without axis limits there are no turns beyond the boundary",
            "remove it, or give the limits in [machine] or a profile by --machine",
        )
    } else {
        return Ok(());
    };
    Err(cut.error("overrun_mm", what, remedy))
}

/// The rule for the distance between passes, and where passes of constant scallop height start; whether that start is chosen by trials.
fn read_spacing(cut: &Section<'_>) -> Result<(Spacing, bool), JobError> {
    let starts = [
        ("edge", Some(Start::Edge)),
        ("middle", Some(Start::Middle)),
        ("auto", None),
    ];
    let start = match cut.has("start") {
        true => cut.choice("start", &starts)?,
        false => Some(Start::Edge),
    };
    let choices = [
        ("exact", Spacing::Exact),
        ("first-order", Spacing::FirstOrder),
        ("constant", Spacing::Constant(start.unwrap_or(Start::Edge))),
    ];
    let spacing = match cut.has("spacing") {
        true => cut.choice("spacing", &choices)?,
        false => Spacing::Exact,
    };
    if start != Some(Start::Edge) && !spacing.is_constant() {
        let word = start.map_or("auto", Start::name);
        return Err(cut.error(
            "start",
            format!("`start = \"{word}\"` is for passes of constant scallop height only"),
            "remove it, or write spacing = \"constant\"",
        ));
    }
    Ok((spacing, start.is_none()))
}

/// The overrun of turns, mm.
fn read_overrun(cut: &Section<'_>) -> Result<f64, JobError> {
    let value = cut.number("overrun_mm")?;
    if value > 0.0 && read_spacing(cut)?.0.is_constant() {
        return Err(cut.error(
            "overrun_mm",
            "passes of constant scallop height have no turns beyond the boundary",
            "remove it, or write spacing = \"exact\"",
        ));
    }
    if (0.0..=OVERRUN_MAX_MM).contains(&value) {
        return Ok(value);
    }
    let what = format!("`overrun_mm` must be at least 0 and at most {OVERRUN_MAX_MM}, not {value}");
    Err(cut.error(
        "overrun_mm",
        what,
        "give the greatest overrun of a turn in mm, e.g. 2, or 0 for none",
    ))
}
