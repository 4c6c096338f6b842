//! The real-time half: one call a tick of the sample timer.
//!
//! **Bound.** One [`Interpolator::tick`], a digest of 17 words (about 125 cycles on a Cortex-M4), no loop.
//! **Missed tick.** Counted; on a free clock while the tool moves it trips the run with
//! [`FaultKind::DeadlineMissed`], because the tool stood still for a period in which the feed was commanded.

use interp_core::{
    fault::{Fault, FaultKind, Result},
    interpolator::{Interpolator, Request},
    job::{Header, STORE_WORDS},
    sample::{Sample, State},
};
use protocol::{
    digest::Digest,
    message::{Clock, FaultReport, PassDigest, Report, Status},
};

use crate::machine::{Command, Event};

/// What a tick of the sample timer brings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickInput {
    /// The next command of the queue, if there is one.
    pub command: Option<Command>,
    /// Ticks of the sample timer that were missed since the last call.
    pub missed: u32,
    /// CPU cycles of the last tick; 0 where the board cannot measure.
    pub cycles: u32,
    /// Fewer than [`TickOutput::EVENTS_MAX`] places are left on the way to the link. In lockstep time stands still
    /// meanwhile, so that nothing is lost.
    pub output_full: bool,
}

/// What a tick of the sample timer yields.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TickOutput {
    /// The pass that is over: the one before `sample`'s, or the last.
    pub pass: Option<PassDigest>,
    /// The sample, if the host wants samples and this is one of the run.
    pub sample: Option<Sample>,
    /// The ticks of a `Run` are used up, or the run is over.
    pub halted: Option<Status>,
}

impl TickOutput {
    /// Most events that one tick yields.
    pub const EVENTS_MAX: usize = 3;

    /// The events, in the order in which the host is to see them.
    pub fn events(&self) -> impl Iterator<Item = Event> + use<> {
        let pass = self.pass.map(Event::Pass);
        let sample = self.sample.map(Event::Sample);
        let halted = self.halted.map(Event::Halted);
        pass.into_iter().chain(sample).chain(halted)
    }
}

/// What is kept of a run: counters and digests.
#[derive(Clone, Copy, Debug)]
struct Run {
    samples: u32,
    digest: Digest,
    pass: PassDigest,
    deadline_misses: u32,
    tick_cycles_max: u32,
    events_lost: u32,
}

impl Run {
    const NEW: Self = Self {
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
    };

    /// Counts a sample in; yields the pass before if the sample is the first of another.
    #[inline]
    fn add(&mut self, sample: &Sample, interval: f32) -> Option<PassDigest> {
        let over = if sample.pass == self.pass.pass {
            None
        } else {
            self.end_pass(interval)
        };
        if self.pass.samples == 0 {
            self.pass.pass = sample.pass;
            self.pass.first_tick = sample.tick;
        }
        self.pass.samples = self.pass.samples.saturating_add(1);
        self.samples = self.samples.saturating_add(1);
        self.digest.sample(sample);
        over
    }

    /// The pass so far, if it has samples; the next sample begins another.
    fn end_pass(&mut self, interval: f32) -> Option<PassDigest> {
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

/// The real-time half of the board. `S`: the job store, see [`Interpolator`].
#[derive(Debug)]
pub struct RealTime<S = [i32; STORE_WORDS]> {
    interpolator: Interpolator<S>,
    clock: Clock,
    credit: u32,
    report: Report,
    /// Waits for a period to pass.
    request: Request,
    run: Run,
}

impl<const WORDS: usize> Default for RealTime<[i32; WORDS]> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const WORDS: usize> RealTime<[i32; WORDS]> {
    /// An idle machine on a free clock, reporting digests, with a store of its own.
    #[must_use]
    pub const fn new() -> Self {
        Self::with_store([0; WORDS])
    }
}

impl<S> RealTime<S> {
    /// An idle machine on a free clock, reporting digests.
    #[must_use]
    pub const fn with_store(store: S) -> Self {
        Self {
            interpolator: Interpolator::with_store(store),
            clock: Clock::Free,
            credit: 0,
            report: Report::Digests,
            request: Request::None,
            run: Run::NEW,
        }
    }
}

impl<S: AsRef<[i32]> + AsMut<[i32]>> RealTime<S> {
    /// One tick of the sample timer.
    pub fn tick(&mut self, input: TickInput) -> TickOutput {
        self.run.tick_cycles_max = self.run.tick_cycles_max.max(input.cycles);
        let mut output = TickOutput::default();
        if let Some(command) = input.command {
            output.halted = self.obey(command);
        }
        let was_under_way = self.interpolator.state().is_under_way();
        self.count_missed(input.missed);
        if self.time_passes(input.output_full) {
            self.step(was_under_way, &mut output);
        }
        output
    }

    /// Takes a command up; a `Run` that gives no time halts at once.
    fn obey(&mut self, command: Command) -> Option<Status> {
        match command {
            // An abort that waits for its period is not to be undone by what comes behind it.
            Command::Request(_) if self.request == Request::Abort => {}
            Command::Request(request) => self.request = request,
            Command::Clock(clock) => {
                self.clock = clock;
                self.credit = 0;
            }
            Command::Run { ticks } => {
                if self.clock == Clock::Lockstep {
                    self.credit = self.credit.saturating_add(ticks);
                }
                if self.credit == 0 {
                    return Some(self.status());
                }
            }
            Command::Report(report) => self.report = report,
        }
        None
    }

    fn count_missed(&mut self, missed: u32) {
        if missed == 0 {
            return;
        }
        self.run.deadline_misses = self.run.deadline_misses.saturating_add(missed);
        let moves = matches!(
            self.interpolator.state(),
            State::Running | State::Holding | State::Stopping
        );
        if self.clock == Clock::Free && moves {
            self.interpolator
                .trip(Fault::new(FaultKind::DeadlineMissed, count(missed)));
        }
    }

    fn time_passes(&mut self, output_full: bool) -> bool {
        match self.clock {
            Clock::Free => true,
            Clock::Lockstep if output_full || self.credit == 0 => false,
            Clock::Lockstep => {
                self.credit -= 1;
                true
            }
        }
    }

    /// Lets one period pass.
    #[inline]
    fn step(&mut self, was_under_way: bool, output: &mut TickOutput) {
        let request = core::mem::take(&mut self.request);
        let starts = request == Request::Start;
        if starts && request.is_allowed(self.interpolator.state()) {
            self.run = Run::NEW;
        }
        let sample = *self.interpolator.tick(request);
        if matches!(sample.state, State::Running | State::Stopping) {
            output.pass = self.run.add(&sample, self.interpolator.last_interval());
            output.sample = (self.report == Report::Samples).then_some(sample);
        }
        let over = (was_under_way || starts) && !sample.state.is_under_way();
        if over {
            output.pass = self.run.end_pass(self.interpolator.last_interval());
            self.credit = 0;
        }
        if over || (self.clock == Clock::Lockstep && self.credit == 0) {
            output.halted = Some(self.status());
        }
    }

    /// Counts events that found no room on their way to the link.
    pub const fn count_lost(&mut self, events: u32) {
        self.run.events_lost = self.run.events_lost.saturating_add(events);
    }

    /// All that is known of the run; `frames_bad` is the link's to fill in.
    #[must_use]
    pub fn status(&self) -> Status {
        let last = self.interpolator.last();
        let fault = self.interpolator.fault();
        let (pass, path, side) = if fault.is_some() {
            self.interpolator.place()
        } else {
            (last.pass, last.path, last.side)
        };
        Status {
            state: self.interpolator.state(),
            fault: fault.map(FaultReport::from),
            clock: self.clock,
            credit: self.credit,
            report: self.report,
            tick: last.tick,
            pass,
            path,
            side,
            samples: self.run.samples,
            digest: self.run.digest.value(),
            interval: self.interpolator.last_interval(),
            deadline_misses: self.run.deadline_misses,
            tick_cycles_max: self.run.tick_cycles_max,
            samples_lost: self.run.events_lost,
            frames_bad: 0,
        }
    }

    /// The sample that the axes stand on.
    #[must_use]
    pub const fn last(&self) -> &Sample {
        self.interpolator.last()
    }

    /// Begins to load a job; a request that waits for a period meant the job before, and is dropped.
    ///
    /// # Errors
    /// Those of [`Interpolator::load_begin`]; nothing changes then.
    pub fn load_begin(&mut self, header: &Header, words: u32) -> Result<()> {
        self.interpolator.load_begin(header, words)?;
        self.request = Request::None;
        Ok(())
    }

    /// [`Interpolator::load_words`].
    ///
    /// # Errors
    /// Those of the interpolator.
    pub fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<()> {
        self.interpolator.load_words(offset, words)
    }

    /// [`Interpolator::load_records`].
    #[must_use]
    pub fn load_records(&self) -> u32 {
        self.interpolator.load_records()
    }

    /// [`Interpolator::load_check`].
    ///
    /// # Errors
    /// Those of the interpolator.
    pub fn load_check(&mut self, record: u32) -> Result<()> {
        self.interpolator.load_check(record)
    }

    /// Seals the job: ready, with the counters of a run that has not begun.
    ///
    /// # Errors
    /// Those of [`Interpolator::load_finish`].
    pub fn load_finish(&mut self) -> Result<()> {
        self.interpolator.load_finish()?;
        self.request = Request::None;
        self.run = Run::NEW;
        Ok(())
    }
}

/// A count as the value of a fault: exact to 2^24, which is hours of missed ticks.
#[allow(
    clippy::cast_precision_loss,
    reason = "a count of missed ticks beyond 2^24 needs no last digit"
)]
const fn count(ticks: u32) -> f32 {
    ticks as f32
}
