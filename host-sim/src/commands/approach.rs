//! `simulate --approach`: the paper's other approaches on a job.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::{Result, cannot_write, progress, trace};
use crate::approach::{Kind, Measured, measure};
use crate::job_file::JobFile;
use crate::report::Sketch;

/// The keys that tell what a CNC has to be fed.
pub(super) fn data_keys(segments: usize, bytes: usize) -> Map<String, Value> {
    [("segments", segments), ("program_bytes", bytes)]
        .into_iter()
        .map(|(key, value)| (key.to_owned(), json!(value)))
        .collect()
}

/// The keys of `simulate`, and what only the approaches have.
fn keys(kind: Kind, measured: &Measured, samples_per_second: f64) -> Map<String, Value> {
    let report = &measured.report;
    let value = json!({
        "approach": kind.name(),
        "passes": measured.planned.passes,
        "samples": measured.samples,
        "ticks": measured.samples,
        "cc_length_mm": report.cc_length_mm,
        "cl_length_mm": measured.cl_length_mm,
        "machining_time_s": measured.time_s,
        "interval_min": measured.interval_min.is_finite().then_some(measured.interval_min),
        "ripple_max_pct": report.ripple_pct.max,
        "ripple_rms_pct": report.ripple_pct.rms(),
        "digest": format!("{:016x}", measured.digest),
        "samples_per_second": samples_per_second,
        "fault": Value::Null,
        "cc_mm_s": measured.cc_mm_s,
        "cl_mm_s": measured.cl_mm_s,
        "cl_step_mm_s": measured.planned.speed_step_mm_s,
        "cl_change_mm_s": measured.cl_change_mm_s,
        "position_error_max_nm": report.position_nm.max,
    });
    let mut keys = data_keys(measured.planned.segments, measured.planned.bytes);
    if let Value::Object(map) = value {
        keys.extend(map);
    }
    keys
}

fn print(kind: Kind, job: &JobFile, measured: &Measured, page: Option<&Path>) {
    let (planned, report) = (&measured.planned, &measured.report);
    let [cc, cl] = [measured.cc_mm_s, measured.cl_mm_s];
    println!("  approach     {}", kind.name());
    println!("  passes       {}", planned.passes);
    println!(
        "  program      {} segments, {} bytes",
        planned.segments, planned.bytes
    );
    println!(
        "  samples      {} (one each {} us)",
        measured.samples, job.machine.period_us
    );
    println!(
        "  machining    {:.1} min, {:.1} mm of cutter contact, {:.1} mm of tool centre",
        measured.time_s / 60.0,
        report.cc_length_mm,
        measured.cl_length_mm
    );
    println!(
        "  CC speed     {:.3} to {:.3} mm/s, of {:.3}",
        cc[0],
        cc[1],
        job.feed_mm_s()
    );
    println!("  CL speed     {:.3} to {:.3} mm/s", cl[0], cl[1]);
    println!(
        "  CL steps     {:.3} mm/s at most between segments, {:.3} from period to period",
        planned.speed_step_mm_s, measured.cl_change_mm_s
    );
    println!("  interval     {:.7} at least", measured.interval_min);
    println!(
        "  feed ripple  {:.1e} % at most, {:.1e} % rms",
        report.ripple_pct.max,
        report.ripple_pct.rms()
    );
    println!("  CL off path  {:.3} um at most", report.position_nm.max * 1e-3);
    if let Some(page) = page {
        println!("  report       {}", page.display());
    }
}

pub(super) fn command(
    kind: Kind,
    job: &JobFile,
    trace_file: Option<&PathBuf>,
    directory: Option<&Path>,
    as_json: bool,
) -> Result<()> {
    let passes = super::simulate::oracle(job)?
        .schedule()
        .map_err(crate::approach::ApproachError::from)?;
    let mut sketch = directory.map(|_| Sketch::new(job, passes.len()).by(kind));
    let mut trace = trace(trace_file, job)?;
    let mut written = Ok(());
    let bar = progress(passes.len() as u64, "following");
    let start = std::time::Instant::now();
    let measured = measure(kind, job, |motion, _| {
        let emitted = &motion.emitted;
        if let Some(sketch) = &mut sketch {
            sketch.add(emitted);
        }
        if let (Some(trace), true) = (&mut trace, written.is_ok()) {
            written = trace.write_emitted(emitted);
        }
        if emitted.last_of_pass {
            bar.inc(1);
        }
    })?;
    bar.finish_and_clear();
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let samples_per_second = measured.samples as f64 / start.elapsed().as_secs_f64().max(1e-9);
    let name = trace_file.cloned().unwrap_or_default();
    written
        .and_then(|()| trace.map_or(Ok(()), crate::trace::Trace::finish))
        .map_err(|error| cannot_write(&name, &error))?;
    let findings = measured.findings();
    let page = directory
        .zip(sketch.as_ref())
        .map(|(directory, sketch)| {
            sketch
                .write(directory, Path::new(job.origin.name()), &findings)
                .map_err(|error| cannot_write(directory, &error))
        })
        .transpose()?;
    if as_json {
        println!("{}", Value::Object(keys(kind, &measured, samples_per_second)));
    } else {
        println!("{}", job.origin.name());
        print(kind, job, &measured, page.as_deref());
    }
    Ok(())
}
