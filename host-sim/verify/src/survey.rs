//! Processes a stream of samples: counts, errors against the oracle, the trace.

use crate::EmittedSample;
use crate::speeds::{SpeedFigures, SpeedRecorder};
use crate::trace::Trace;
use glam::DVec3;
use job::units;
use oracle::{AccuracyReport, Oracle, PassSample, SampleCheck, Verifier};

/// Result of the survey of a run.
#[derive(Clone, Debug)]
pub struct SurveyResult {
    /// Number of samples, and of periods of the run.
    pub samples: u64,
    /// Number of passes.
    pub passes: u32,
    /// Speeds of contact and centre, and the length of the centre's path.
    pub speeds: SpeedFigures,
    /// Least candidate of the path interval, in units of the side parameter; infinite without candidates.
    pub interval_min: f64,
    /// Errors against the oracle.
    pub report: AccuracyReport,
}

/// A sample held back until the next one shows whether it is the last of its pass.
#[derive(Clone, Copy)]
struct PendingSample {
    sample: EmittedSample,
    first: bool,
}

/// Callback for every sample on a pass, with its errors.
pub type SampleObserver<'a> = dyn FnMut(&PassSample, &SampleCheck) + 'a;

/// The survey of one run.
pub struct Survey {
    verifier: Verifier,
    trace: Option<Trace>,
    pending: Option<PendingSample>,
    samples: u64,
    oracle: Oracle,
    speeds: SpeedRecorder,
    ratio_step: f64,
    feed_mm_s: f64,
    interval_min: f64,
}

impl Survey {
    /// A survey of a run of this job. It writes the trace, if there is one.
    #[must_use]
    pub fn new(oracle: &Oracle, trace: Option<Trace>) -> Self {
        Self {
            verifier: Verifier::new(oracle),
            trace,
            pending: None,
            samples: 0,
            oracle: oracle.clone(),
            speeds: SpeedRecorder::new(oracle.period_s),
            ratio_step: 0.0,
            feed_mm_s: 0.0,
            interval_min: f64::INFINITY,
        }
    }

    /// Adds the next sample of the run. `each` is called for the sample on a pass that this one shows to be complete, with its errors.
    ///
    /// # Errors
    /// The trace cannot be written.
    pub fn add(&mut self, sample: &EmittedSample, each: &mut SampleObserver<'_>) -> std::io::Result<()> {
        self.samples += 1;
        if let Some(trace) = &mut self.trace {
            trace.write(sample)?;
        }
        let stands = |before: &PendingSample| {
            before.sample.pass == sample.pass && before.sample.parameters == sample.parameters
        };
        if sample.parameters.is_none() || self.pending.as_ref().is_some_and(stands) {
            return Ok(());
        }
        let first = match self.pending {
            Some(before) => {
                let over = before.sample.pass != sample.pass;
                self.emit(before, over, each);
                over
            }
            None => true,
        };
        self.interval_min = self.interval_min.min(sample.interval.into());
        self.pending = Some(PendingSample {
            sample: *sample,
            first,
        });
        Ok(())
    }

    fn emit(
        &mut self,
        PendingSample { sample, first }: PendingSample,
        last: bool,
        each: &mut SampleObserver<'_>,
    ) {
        let Some(emitted) = sample.emitted(first, last) else {
            return;
        };
        let checked = self.verifier.add(&emitted);
        self.speeds.add(
            &emitted,
            checked.arc_mm,
            DVec3::from(units::position_mm(sample.cl_nm)),
        );
        if first {
            // A point without a normal is reported by the verifier.
            let (_, side) = self.oracle.swapped(emitted.u, emitted.v);
            self.ratio_step = self.ratio_step.max(self.oracle.ratio_step(side).unwrap_or(0.0));
            self.feed_mm_s = self.feed_mm_s.max(emitted.feed_mm_s);
        }
        each(&emitted, &checked);
    }

    /// The result, after the run's last sample; `complete`: the run reached its end. `each` is called for the last sample on a pass.
    ///
    /// # Errors
    /// The trace cannot be written.
    pub fn finish(mut self, complete: bool, each: &mut SampleObserver<'_>) -> std::io::Result<SurveyResult> {
        if let Some(pending) = self.pending {
            self.emit(pending, complete, each);
        }
        if let Some(trace) = self.trace {
            trace.finish()?;
        }
        let report = self.verifier.finish();
        Ok(SurveyResult {
            samples: self.samples,
            passes: self.pending.map_or(0, |pending| pending.sample.pass + 1),
            speeds: self.speeds.finish(self.ratio_step * self.feed_mm_s),
            interval_min: self.interval_min,
            report,
        })
    }
}
