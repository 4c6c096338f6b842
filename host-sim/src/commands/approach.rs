//! `simulate --approach`: the paper's other approaches on a job.

use super::outcome::Outcome;
use super::simulate::WantedReport;
use super::{Result, WantedTrace, begun, completed, progress, spinner, unheld_limits};
use approach::{ApproachError, Kind, job_passes, measure, side_curves};
use job::Job;
use oracle::Oracle;
use report::{Remarks, Sketch};

fn count_passes(job: &Job) -> std::result::Result<usize, ApproachError> {
    let oracle = Oracle::new(job)?;
    let curves = side_curves(job)?;
    Ok(job_passes(&oracle, &curves)?.len())
}

pub(super) fn command(
    kind: Kind,
    job: &Job,
    wanted: Option<WantedTrace<'_>>,
    directory: Option<WantedReport<'_>>,
    as_json: bool,
) -> Result<()> {
    super::whole_surface(job, "--approach")?;
    let bar = spinner("computing the passes");
    let passes = count_passes(job)?;
    bar.finish_and_clear();
    let mut sketch = directory.map(|_| Sketch::new(job, passes).by(kind.name()));
    let (mut trace, output) = begun(wanted, job)?;
    let mut written = Ok(());
    let bar = progress(passes as u64, "following");
    let start = std::time::Instant::now();
    let measured = measure(kind, job, |motion, _, checked| {
        let emitted = &motion.emitted;
        if let Some(sketch) = &mut sketch {
            sketch.add(emitted, checked);
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
    let samples_per_second = measured.findings.samples as f64 / start.elapsed().as_secs_f64().max(1e-9);
    completed(written, trace, output, wanted)?;
    let remarks = Remarks {
        warnings: unheld_limits(job).into_iter().collect(),
        ..Remarks::default()
    };
    let page = super::simulate::report(job, directory, sketch.as_ref(), &measured.findings, &remarks)?;
    let outcome = Outcome {
        kind,
        job,
        segments: measured.planned.segments,
        bytes: measured.planned.bytes,
        findings: &measured.findings,
        digest: measured.digest,
        samples_per_second,
        fault: None,
    };
    outcome.output(as_json, page.as_deref());
    Ok(())
}
