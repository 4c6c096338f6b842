//! The trace of a run: CSV with a header line, a row a sample.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use interp_core::Sample;

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

/// A trace that is being written.
pub struct Trace {
    writer: csv::Writer<BufWriter<File>>,
    period_us: f64,
}

impl Trace {
    /// Creates the file, and writes the header line.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, period_us: f64) -> io::Result<Self> {
        let mut writer = csv::Writer::from_writer(BufWriter::new(File::create(path)?));
        writer.write_record(COLUMNS)?;
        Ok(Self { writer, period_us })
    }

    /// Writes a sample's row.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&mut self, sample: &Sample, [u, v]: [f64; 2]) -> io::Result<()> {
        let [cc_x, cc_y, cc_z] = sample.cc_nm.map(millimetres);
        let [cl_x, cl_y, cl_z] = sample.cl_nm;
        let interval = sample.interval();
        let interval = if interval.is_finite() {
            interval.to_string()
        } else {
            String::new()
        };
        let fields = [
            sample.tick.to_string(),
            format!("{:.6}", f64::from(sample.tick) * self.period_us * 1e-6),
            sample.state.name().to_owned(),
            sample.pass.to_string(),
            digits(u),
            digits(v),
            sample.feed_mm_s.to_string(),
            cc_x,
            cc_y,
            cc_z,
            cl_x.to_string(),
            cl_y.to_string(),
            cl_z.to_string(),
            interval,
        ];
        self.writer.write_record(fields)?;
        Ok(())
    }

    /// Writes what is left.
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
