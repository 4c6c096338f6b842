//! The numbers of `import`: checked before a file is read.

use super::super::{Failure, Result};
use super::Arguments;
use job::{FEED_MAX_MM_MIN, FEED_MIN_MM_MIN, PERIOD_DEFAULT_US, RADIUS_MAX_MM};
use job_file::{TOLERANCE_MAX_MM, feed_max_within_limits};

/// A number above `least`, at most `most`.
fn within(name: &str, value: Option<f64>, [least, most]: [f64; 2], want: &str) -> Result<()> {
    match value {
        Some(value) if !(value > least && value <= most) => Err(Failure::input(
            format!("{name} must be above {least} and at most {most}, not {value}"),
            format!("give {want}"),
        )),
        _ => Ok(()),
    }
}

/// # Errors
/// A number is out of its range, or none.
pub(super) fn check(arguments: &Arguments) -> Result<()> {
    let radius_mm = arguments.radius_mm;
    within(
        "--tool",
        radius_mm,
        [0.0, RADIUS_MAX_MM],
        "the ball's radius in mm, e.g. 3",
    )?;
    let scallop_mm = arguments.scallop_mm;
    within(
        "--scallop-mm",
        scallop_mm,
        [0.0, RADIUS_MAX_MM],
        "the scallop height limit in mm, e.g. 0.01",
    )?;
    if let (Some(radius_mm), Some(scallop_mm)) = (radius_mm, scallop_mm)
        && scallop_mm >= radius_mm
    {
        return Err(Failure::input(
            format!("--scallop-mm must be below the ball's radius of {radius_mm} mm, not {scallop_mm}"),
            "give the scallop height limit in mm, e.g. 0.01",
        ));
    }
    // The jobs of a part have axis limits.
    let feed_max = if arguments.part {
        feed_max_within_limits(PERIOD_DEFAULT_US)
    } else {
        FEED_MAX_MM_MIN
    };
    within(
        "--feed-mm-min",
        arguments.feed_mm_min,
        [FEED_MIN_MM_MIN, feed_max],
        "the feed in mm/min, e.g. 1200",
    )?;
    within(
        "--tolerance",
        Some(arguments.tolerance),
        [0.0, TOLERANCE_MAX_MM],
        "the largest deviation of an approximation in mm, e.g. 0.001",
    )
}
