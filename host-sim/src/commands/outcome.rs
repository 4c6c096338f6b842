//! The result of a run, as printed by `simulate` and `run`: as text and as JSON.

use std::path::Path;

use serde_json::{Map, Value, json};

use super::along;
use super::out::say;
use approach::Kind;
use inspect::FaultAt;
use job::Job;
use job::units::S_PER_MIN;
use verify::speeds::SpeedRange;
use verify::survey::SurveyResult;

/// A fault with its position, as JSON.
pub(super) fn fault_json(at: &FaultAt) -> Value {
    let (message, remedy) = explain::fault(at.fault);
    let [u, v] = at.parameters;
    json!({
        "code": at.fault.kind.code(),
        "name": at.fault.kind.name(),
        "message": message,
        "remedy": remedy,
        "value": at.fault.value,
        "tick": at.tick,
        "pass": at.pass,
        "u": u,
        "v": v,
    })
}

/// The outcome of a run, by any approach.
#[derive(Debug)]
pub(super) struct Outcome<'a> {
    pub(super) kind: Kind,
    pub(super) job: &'a Job,
    /// Segments of the program; for the approach `surface`, the patches.
    pub(super) segments: usize,
    /// Bytes of the program; for the approach `surface`, of the header and the surface data.
    pub(super) bytes: usize,
    pub(super) findings: &'a SurveyResult,
    pub(super) digest: u64,
    pub(super) samples_per_second: f64,
    pub(super) fault: Option<FaultAt>,
}

fn finite(value: f64) -> Value {
    if value.is_finite() {
        json!(value)
    } else {
        Value::Null
    }
}

/// Null where there is no sample.
fn span(span: &SpeedRange) -> Value {
    if !span.min.is_finite() {
        return json!({ "min": null, "mean": null, "max": null });
    }
    json!({ "min": span.min, "mean": span.mean(), "max": span.max })
}

/// As text; without a sample after a fault in the first pass.
fn span_text(span: &SpeedRange) -> String {
    if !span.min.is_finite() {
        return "not measured".to_owned();
    }
    format!("{:.3} to {:.3} mm/s, mean {:.3}", span.min, span.max, span.mean())
}

impl Outcome<'_> {
    fn machining_time_s(&self) -> f64 {
        self.job.machine.time_s(self.findings.samples)
    }

    /// The keys of `simulate`, the same for all approaches.
    pub(super) fn json(&self) -> Map<String, Value> {
        let (report, speeds) = (&self.findings.report, &self.findings.speeds);
        let value = json!({
            "approach": self.kind.name(),
            "passes": self.findings.passes,
            "samples": self.findings.samples,
            "ticks": self.findings.samples,
            "segments": self.segments,
            "program_bytes": self.bytes,
            "cc_length_mm": report.cc_length_mm,
            "cl_length_mm": speeds.cl_length_mm,
            "machining_time_s": self.machining_time_s(),
            "interval_min": finite(self.findings.interval_min),
            "ripple_max_pct": report.ripple_pct.max.abs(),
            "ripple_rms_pct": report.ripple_pct.rms(),
            "cc_speed_mm_s": span(&speeds.cc),
            "cl_speed_mm_s": span(&speeds.cl),
            "cl_step_mm_s": speeds.cl_step_mm_s,
            "cl_change_mm_s": speeds.cl_change_mm_s,
            "position_error_max_nm": report.position_nm.max,
            "digest": format!("{:016x}", self.digest),
            "samples_per_second": self.samples_per_second,
            "fault": self.fault.as_ref().map_or(Value::Null, fault_json),
        });
        let mut keys = match value {
            Value::Object(map) => map,
            _ => Map::new(),
        };
        keys.extend(along::json(self.job));
        if self.kind == Kind::Surface {
            keys.insert("patches".to_owned(), json!(self.segments));
        }
        keys
    }

    /// Prints the outcome as one JSON object or as text.
    pub(super) fn output(&self, as_json: bool, page: Option<&Path>) {
        if as_json {
            say!("{}", Value::Object(self.json()));
        } else {
            say!("{}", self.job.origin.name());
            self.print(page);
        }
    }

    /// Prints the outcome as text, with the path of the report page if there is one.
    pub(super) fn print(&self, page: Option<&Path>) {
        let (findings, report, speeds) = (self.findings, &self.findings.report, &self.findings.speeds);
        let parts = match self.kind {
            Kind::Surface => "patches",
            _ => "segments",
        };
        say!("  approach     {}", self.kind.name());
        say!("  along        {}", along::sentence(self.job));
        if let Some(start) = along::start_sentence(self.job) {
            say!("  start        {start}");
        }
        say!("  program      {} {parts}, {} bytes", self.segments, self.bytes);
        say!("  passes       {}", findings.passes);
        say!(
            "  samples      {} (period {} us)",
            findings.samples,
            self.job.machine.period_us
        );
        say!(
            "  machining    {:.1} min, CC path {:.1} mm, CL path {:.1} mm",
            self.machining_time_s() / S_PER_MIN,
            report.cc_length_mm,
            speeds.cl_length_mm
        );
        if self.findings.samples == 0 {
            return;
        }
        let feed = self.job.feed_mm_s();
        for (name, of, span) in [
            ("CC", format!(", programmed {feed:.3}"), &speeds.cc),
            ("CL", String::new(), &speeds.cl),
        ] {
            say!("  {name} speed     {}{of}", span_text(span));
        }
        say!(
            "  CL jumps     {:.3} mm/s at most between {parts}, {:.3} between periods",
            speeds.cl_step_mm_s,
            speeds.cl_change_mm_s
        );
        say!("  CL error     {:.3} um at most", report.position_nm.max * 1e-3);
        if findings.interval_min.is_finite() {
            say!("  interval     {:.7} at least", findings.interval_min);
        }
        say!(
            "  feed ripple  {:.6} % at most, {:.6} % rms",
            report.ripple_pct.max.abs(),
            report.ripple_pct.rms()
        );
        say!("  digest       {:016x}", self.digest);
        say!(
            "  speed        {:.2} million samples per second",
            self.samples_per_second / 1e6
        );
        if let Some(page) = page {
            say!("  report       {}", page.display());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_without_samples_is_not_measured() {
        assert_eq!(span_text(&SpeedRange::default()), "not measured");
    }
}
