//! A table of samples: CSV with the columns `t_s, x_mm, y_mm, z_mm`, or a trace of `simulate`.

use job::units::MM_PER_NM;
use std::path::Path;

use glam::DVec3;

use super::{Motion, MotionError};

/// Largest deviation of a sample's time from the even spacing, as a share of the period.
const UNEVEN: f64 = 0.01;

/// Names of the columns, with the factor to mm.
const COLUMNS: [([&str; 3], f64); 2] = [
    (["x_mm", "y_mm", "z_mm"], 1.0),
    (["cl_x_nm", "cl_y_nm", "cl_z_nm"], MM_PER_NM),
];

/// Reads the table.
pub(super) fn read(path: &Path) -> Result<Motion, MotionError> {
    let name = path.display();
    let unreadable =
        |error: csv::Error| MotionError::new(format!("{name}: {error}"), "give a CSV file of samples");
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(unreadable)?;
    let header = reader.headers().map_err(unreadable)?.clone();
    let column = |wanted: &str| header.iter().position(|column| column == wanted);
    let place = |names: [&str; 3]| Some([column(names[0])?, column(names[1])?, column(names[2])?]);
    let found = COLUMNS
        .into_iter()
        .find_map(|(names, factor)| Some((place(names)?, factor)));
    let (Some(time), Some((axes, factor))) = (column("t_s"), found) else {
        return Err(MotionError::new(
            format!("{name}:1: the columns are not t_s, x_mm, y_mm, z_mm"),
            "name them in the first line; x, y, z are the ball's centre, or its tip with --tip",
        ));
    };
    let (mut times, mut centres_mm) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(unreadable)?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |index: usize| -> Result<f64, MotionError> {
            let text = record.get(index).unwrap_or_default();
            let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| {
                MotionError::new(
                    format!("{name}:{line}: `{text}` is no number"),
                    "write numbers with a decimal point",
                )
            })
        };
        times.push((number(time)?, line));
        centres_mm.push(DVec3::new(number(axes[0])?, number(axes[1])?, number(axes[2])?) * factor);
    }
    Ok(Motion {
        period_s: period_s(path, &times)?,
        centres_mm,
        is_program: false,
    })
}

/// The period of evenly spaced times.
fn period_s(path: &Path, times: &[(f64, u64)]) -> Result<f64, MotionError> {
    let name = path.display();
    let (Some((first, _)), Some((last, _))) = (times.first(), times.last()) else {
        return Err(MotionError::new(
            format!("{name}: no samples"),
            "give the samples of a whole run",
        ));
    };
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let period_s = (last - first) / (times.len() - 1).max(1) as f64;
    if period_s <= 0.0 || period_s.is_nan() {
        return Err(MotionError::new(
            format!("{name}: the times do not ascend"),
            "give one row for each sample, in seconds",
        ));
    }
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let uneven = times
        .iter()
        .enumerate()
        .find(|(index, (time, _))| (time - first - period_s * *index as f64).abs() > UNEVEN * period_s);
    match uneven {
        None => Ok(period_s),
        Some((_, (time, line))) => Err(MotionError::new(
            format!(
                "{name}:{line}: the samples are not evenly spaced: t_s = {time} is off the period of {period_s:.6e} s"
            ),
            "give one sample for each period; interpolate missing ones as the machine would",
        )),
    }
}
