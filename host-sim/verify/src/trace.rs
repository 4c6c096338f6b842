//! The trace of a run: CSV with a header line, one row per sample.

use std::fs::File;
use std::io::{self, BufWriter};

use oracle::PassSample;

use crate::EmittedSample;

/// Columns of a trace.
pub const COLUMNS: [&str; 14] = [
    "tick",
    "t_s",
    "state",
    "pass",
    "u",
    "v",
    "feed_mm_s",
    "cc_x_mm",
    "cc_y_mm",
    "cc_z_mm",
    "cl_x_nm",
    "cl_y_nm",
    "cl_z_nm",
    "interval",
];

/// Values of a row.
struct Row {
    tick: u64,
    state: &'static str,
    pass: u32,
    /// `None` between passes, where there is no contact.
    parameters: Option<[f64; 2]>,
    feed_mm_s: String,
    cc_nm: [i32; 3],
    cl_nm: [i32; 3],
    interval: Option<String>,
}

/// A trace file under construction.
pub struct Trace {
    writer: csv::Writer<BufWriter<File>>,
    period_us: f64,
}

impl Trace {
    /// Writes the header line into a new file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn new(file: File, period_us: f64) -> io::Result<Self> {
        let mut writer = csv::Writer::from_writer(BufWriter::new(file));
        writer.write_record(COLUMNS)?;
        Ok(Self { writer, period_us })
    }

    /// Writes a sample's row.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&mut self, sample: &EmittedSample) -> io::Result<()> {
        self.row(&Row {
            tick: sample.tick,
            state: sample.state,
            pass: sample.pass,
            parameters: sample.parameters,
            feed_mm_s: sample.feed_mm_s.to_string(),
            cc_nm: sample.cc_nm,
            cl_nm: sample.cl_nm,
            interval: sample.parameters.and_then(|_| finite(sample.interval)),
        })
    }

    /// Writes the row of a sample that an approach other than the core emitted.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_emitted(&mut self, emitted: &PassSample) -> io::Result<()> {
        self.row(&Row {
            tick: emitted.tick,
            state: "running",
            pass: emitted.pass,
            parameters: Some([emitted.u, emitted.v]),
            feed_mm_s: emitted.feed_mm_s.to_string(),
            cc_nm: emitted.cc_nm,
            cl_nm: emitted.cl_nm,
            interval: finite(emitted.interval),
        })
    }

    fn row(&mut self, row: &Row) -> io::Result<()> {
        let on_pass = row.parameters.is_some();
        let [cc_x, cc_y, cc_z] = row
            .cc_nm
            .map(|nm| if on_pass { millimetres(nm) } else { String::new() });
        let [cl_x, cl_y, cl_z] = row.cl_nm;
        let [u, v] = row
            .parameters
            .map_or([const { String::new() }; 2], |pair| pair.map(digits));
        #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
        let time_s = row.tick as f64 * self.period_us * 1e-6;
        let fields = [
            row.tick.to_string(),
            format!("{time_s:.6}"),
            row.state.to_owned(),
            row.pass.to_string(),
            u,
            v,
            row.feed_mm_s.clone(),
            cc_x,
            cc_y,
            cc_z,
            cl_x.to_string(),
            cl_y.to_string(),
            cl_z.to_string(),
            row.interval.clone().unwrap_or_default(),
        ];
        self.writer.write_record(fields)?;
        Ok(())
    }

    /// Flushes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

/// 17 significant digits: every f64 exactly.
fn digits(value: f64) -> String {
    format!("{value:.16e}")
}

/// An interval in decimals; `None` if it is infinite.
fn finite(interval: impl Into<f64> + Copy + ToString) -> Option<String> {
    interval.into().is_finite().then(|| interval.to_string())
}

/// Nanometres as millimetres, exactly.
fn millimetres(nm: i32) -> String {
    let sign = if nm < 0 { "-" } else { "" };
    let nm = nm.unsigned_abs();
    format!("{sign}{}.{:06}", nm / 1_000_000, nm % 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lose_nothing() {
        assert_eq!(millimetres(-1), "-0.000001");
        assert_eq!(millimetres(i32::MIN), "-2147.483648");
        assert_eq!(millimetres(12_345_678), "12.345678");
        let value = 0.1_f64 + 0.2;
        assert_eq!(digits(value).parse::<f64>(), Ok(value));
    }
}
