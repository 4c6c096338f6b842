//! What `simulate` and `run` tell of a run: on the terminal and as JSON.

use std::path::Path;

use interp_core::Fault;
use serde_json::{Map, Value, json};

use crate::explain;
use crate::machine::Machine;
use crate::prepare::Prepared;
use crate::survey::Findings;

/// A fault with its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaultAt {
    pub(super) fault: Fault,
    pub(super) tick: u64,
    pub(super) pass: u32,
    pub(super) parameters: [f64; 2],
}

impl FaultAt {
    /// The fault that stopped this machine after so many samples.
    pub(super) fn of(fault: Fault, machine: &Machine, samples: u64, prepared: &Prepared) -> Self {
        let (pass, path, side) = machine.place();
        Self {
            fault,
            tick: samples,
            pass,
            parameters: prepared.parameters(path, side),
        }
    }

    pub(super) fn sentence(&self) -> String {
        let (what, remedy) = explain::fault(self.fault);
        let [u, v] = self.parameters;
        let (code, name) = (self.fault.kind.code(), self.fault.kind.name());
        format!(
            "fault {code} ({name}) at tick {}, pass {}, u = {u:.9}, v = {v:.9}: {what}\n  help: {remedy}",
            self.tick, self.pass
        )
    }

    fn json(&self) -> Value {
        let (message, remedy) = explain::fault(self.fault);
        let [u, v] = self.parameters;
        json!({
            "code": self.fault.kind.code(),
            "name": self.fault.kind.name(),
            "message": message,
            "remedy": remedy,
            "value": self.fault.value,
            "tick": self.tick,
            "pass": self.pass,
            "u": u,
            "v": v,
        })
    }
}

/// The outcome of a run.
#[derive(Debug)]
pub(super) struct Outcome<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) findings: &'a Findings,
    pub(super) period_s: f64,
    pub(super) digest: u64,
    pub(super) samples_per_second: f64,
    pub(super) fault: Option<FaultAt>,
}

impl Outcome<'_> {
    fn machining_time_s(&self) -> f64 {
        #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
        let ticks = self.findings.samples as f64;
        ticks * self.period_s
    }

    /// The keys of `simulate`.
    pub(super) fn json(&self) -> Map<String, Value> {
        let report = &self.findings.report;
        let finite = |value: f64| {
            if value.is_finite() {
                json!(value)
            } else {
                Value::Null
            }
        };
        let value = json!({
            "approach": "surface",
            "passes": self.findings.passes,
            "samples": self.findings.samples,
            "ticks": self.findings.samples,
            "cc_length_mm": report.cc_length_mm,
            "cl_length_mm": self.findings.cl_length_mm,
            "machining_time_s": self.machining_time_s(),
            "interval_min": finite(self.findings.interval_min),
            "ripple_max_pct": report.ripple_pct.max.abs(),
            "ripple_rms_pct": report.ripple_pct.rms(),
            "digest": format!("{:016x}", self.digest),
            "samples_per_second": self.samples_per_second,
            "patches": self.prepared.patches(),
            "fault": self.fault.as_ref().map_or(Value::Null, FaultAt::json),
        });
        match value {
            Value::Object(map) => map,
            _ => Map::new(),
        }
    }

    /// The same for a person, with the page if there is one.
    pub(super) fn print(&self, page: Option<&Path>) {
        let (findings, report) = (self.findings, &self.findings.report);
        let time = self.machining_time_s();
        println!(
            "  surface      {} patches, {:?}",
            self.prepared.patches(),
            self.prepared.header.kind
        );
        println!("  passes       {}", findings.passes);
        println!(
            "  samples      {} (one each {} us)",
            findings.samples,
            self.period_s * 1e6
        );
        println!(
            "  machining    {:.1} min, {:.1} mm of cutter contact, {:.1} mm of tool centre",
            time / 60.0,
            report.cc_length_mm,
            findings.cl_length_mm
        );
        println!("  interval     {:.7} at least", findings.interval_min);
        println!(
            "  feed ripple  {:.1e} % at most, {:.1e} % rms",
            report.ripple_pct.max.abs(),
            report.ripple_pct.rms()
        );
        println!("  digest       {:016x}", self.digest);
        println!(
            "  speed        {:.2} million samples a second",
            self.samples_per_second / 1e6
        );
        if let Some(page) = page {
            println!("  report       {}", page.display());
        }
    }
}
