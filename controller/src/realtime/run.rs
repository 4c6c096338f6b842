//! The record of a run.

use interp_core::sample::Sample;
use protocol::{digest::Digest, message::PassDigest};

/// The record of a run: counters and digests.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunRecord {
    pub(super) samples: u32,
    /// Digest of all samples.
    pub(super) digest: Digest,
    /// The present pass; its digest and interval are filled in at its end.
    pub(super) pass: PassDigest,
    /// Ticks missed.
    pub(super) deadline_misses: u32,
    /// Most cycles of a tick.
    pub(super) tick_cycles_max: u32,
    /// Events for which the queue had no room.
    pub(super) events_lost: u32,
    /// Periods in which the run waited for the words of a streamed job.
    pub(super) starved: u32,
}

impl RunRecord {
    pub(super) const NEW: Self = Self {
        samples: 0,
        digest: Digest::new(),
        pass: PassDigest {
            pass: 0,
            first_tick: 0,
            samples: 0,
            digest: Digest::EMPTY,
            interval: 0.0,
        },
        deadline_misses: 0,
        tick_cycles_max: 0,
        events_lost: 0,
        starved: 0,
    };

    /// Whether the sample is the first of a pass.
    pub(super) const fn begins_pass(&self, sample: &Sample) -> bool {
        self.pass.samples == 0 || sample.pass != self.pass.pass
    }

    /// Begins the pass of this sample; returns the previous pass.
    #[cold]
    pub(super) fn begin_pass(&mut self, sample: &Sample, interval: f32) -> Option<PassDigest> {
        let over = self.end_pass(interval);
        self.pass.pass = sample.pass;
        self.pass.first_tick = sample.tick;
        over
    }

    /// Adds a sample. Not generic and not inlined, so that it is compiled in this crate, for speed, independent of its callers' optimisation level.
    #[inline(never)]
    pub(super) fn add(&mut self, sample: &Sample) {
        self.pass.samples = self.pass.samples.saturating_add(1);
        self.samples = self.samples.saturating_add(1);
        self.digest.sample(sample);
    }

    /// The pass so far, if it has samples; the next sample begins a new one.
    pub(super) fn end_pass(&mut self, interval: f32) -> Option<PassDigest> {
        let digest = self.digest.value();
        let samples = core::mem::take(&mut self.pass.samples);
        (samples > 0).then_some(PassDigest {
            samples,
            digest,
            interval,
            ..self.pass
        })
    }
}
