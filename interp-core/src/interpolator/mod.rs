//! The machine: load, tick, plan, hold, resume, abort.

mod motion;

use crate::command::Inputs;
use crate::fault::{Fault, Result};
use crate::job::stream::{RecordCopy, RowsNeeded};
use crate::job::{Header, STORE_WORDS};
use crate::sample::{RunStart, Sample, SpanParameter, State};
#[cfg(doc)]
use crate::{fault::FaultKind, front_words, job::Spacing};
use motion::Motion;

/// Periods over which an external fault decelerates the run to zero feed: 1/32 of the feed per period.
pub const STOP_PERIODS: u8 = 32;

/// The loaded surface evaluated at one pair of parameters, independent of any run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePoint {
    /// Cutter contact, nm.
    pub cc_nm: [i32; 3],
    /// Cutter location, nm.
    pub cl_nm: [i32; 3],
    /// Unit normal towards the tool.
    pub normal: [f32; 3],
    /// Path interval allowed here, in units of the side parameter; infinite where the scallop limit does not bound the interval.
    pub interval: f32,
}

/// The interpolator: one [`Interpolator::tick`] a period gives the next cutter location.
///
/// The job's data lie in a store of 32-bit words, owned (an array) or borrowed (a board's static one, which is then never moved
/// through the stack). The sample path is not generic over the store: it is compiled once, in this crate.
#[derive(Clone, Debug)]
pub struct Interpolator<S = [i32; STORE_WORDS]> {
    motion: Motion,
    store: S,
}

impl<const WORDS: usize> Default for Interpolator<[i32; WORDS]> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const WORDS: usize> Interpolator<[i32; WORDS]> {
    /// An idle machine without a job, with a store that it owns.
    #[must_use]
    pub const fn new() -> Self {
        Self::with_store([0; WORDS])
    }
}

impl<S> Interpolator<S> {
    /// An idle machine without a job. The length of the store is the longest job: its words and, at [`Spacing::Constant`] and its like, [`front_words`] besides.
    #[must_use]
    pub const fn with_store(store: S) -> Self {
        Self {
            motion: Motion::NEW,
            store,
        }
    }
}

impl<S: AsRef<[i32]> + AsMut<[i32]>> Interpolator<S> {
    /// Where the next run begins, of a job with axis limits; at the start of the job at power-up, after each start and each load. The passes before are skipped in
    /// the planning while the tool stands: those from there on are the same as in a run of the whole job. On a place within a pass the tool begins at rest, with that
    /// place's sample, and goes on along the same path; from the end of a pass, with the next one. A place that is on no pass is a fault of the run, [`FaultKind::WrongState`]
    /// with the pass.
    pub const fn begin_at(&mut self, start: RunStart) {
        self.motion.sequencer.begin_at(start);
    }

    /// The place on the pass that the tool is on, to begin another run with: pass and path parameter. None off the passes, and near the ends of a pass.
    #[must_use]
    pub fn place(&self) -> Option<RunStart> {
        let (pass, path, _) = self.motion.run.surface_position();
        let is_within = self.motion.state.is_under_way() && self.motion.sequencer.is_within();
        is_within.then_some(RunStart { pass, path })
    }

    /// Whether the tool has left the surface for a pause, and is held above it.
    #[must_use]
    pub fn is_lifted(&self) -> bool {
        self.motion.state == State::Held && self.motion.sequencer.is_lifted()
    }

    /// Begins to load a job of `words` data words; the previous job is dropped, and the machine is idle. Of the store it needs these and [`front_words`]; of a
    /// streamed job the least rows suffice ([`crate::job::stream`]).
    ///
    /// # Errors
    /// Refused, and nothing changes: [`FaultKind::WrongState`] while a job runs or is held, [`FaultKind::BadHeader`],
    /// [`FaultKind::TooManyPatches`] with the words of the store that the header implies, [`FaultKind::BadLength`] where `words` differs
    /// from the length that the header implies.
    pub fn load_begin(&mut self, header: &Header, words: u32) -> Result<()> {
        self.motion.load_begin(header, words, self.store.as_ref().len())
    }

    /// Writes data words at `offset`: at the end of the words received so far, or over them again.
    ///
    /// Of a streamed job, only at the end and up to [`Self::load_room`], but also while it runs.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`]; [`FaultKind::BadLength`] where no load has begun, the words leave a gap or exceed the
    /// job's length. Nothing is written on error.
    pub fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<()> {
        self.motion.may_continue_loading()?;
        self.motion.program.write(self.store.as_mut(), offset, words)
    }

    /// Number of records; [`Self::load_check`] has to be called for each.
    #[must_use]
    pub fn load_records(&self) -> u32 {
        self.motion.program.records()
    }

    /// Data words received, and up to which there is room now: for a streamed job that runs, up to the row of the tool again.
    #[must_use]
    pub fn load_room(&self) -> [u32; 2] {
        self.motion.program.room()
    }

    /// Whether the job is streamed: loaded while it runs.
    #[must_use]
    pub const fn is_streamed(&self) -> bool {
        self.motion.program.is_streamed()
    }

    /// Copies the next record of a streamed job, so that it can be checked while the job runs: first [`RecordCopy::check`], then [`Self::load_accept`] or
    /// [`Self::load_reject`]. A row's records are there once its digest is.
    ///
    /// # Errors
    /// [`FaultKind::BadLength`] where the record is not the next one, or its row is not complete.
    pub fn load_copy(&self, record: u32) -> Result<RecordCopy> {
        self.motion.program.copy(self.store.as_ref(), record)
    }

    /// Seals a record of a streamed job that was checked. A run goes on to a row once all of its records are sealed.
    ///
    /// # Errors
    /// As [`Self::load_copy`]; [`FaultKind::BadHeader`] for a span width, with the first record.
    pub fn load_accept(&mut self, record: u32) -> Result<()> {
        self.motion.program.accept(self.store.as_ref(), record)
    }

    /// The next record of a streamed job is not sound: a run stops with this fault where it would need its row.
    pub const fn load_reject(&mut self, fault: Fault) {
        self.motion.program.reject(fault);
    }

    /// Whether the last tick did not count for the run, because the next rows of a streamed job are not loaded. The tool stands, the sample stays, and nothing is planned.
    #[must_use]
    #[inline]
    pub const fn is_starved(&self) -> bool {
        self.motion.is_starved
    }

    /// The rows of a streamed job that the planning of the latest pass needed; none for the first pass, which may look at those of the window.
    #[must_use]
    pub const fn rows_needed(&self) -> Option<RowsNeeded> {
        self.motion.program.asked()
    }

    /// Whether the loaded job can start: the first rows of a streamed job are no longer there once it has run.
    #[must_use]
    pub fn can_start(&self) -> bool {
        self.motion.program.can_rewind()
    }

    /// Checks one record, in order from 0. Takes a few thousand cycles, so that a board can check between ticks.
    ///
    /// # Errors
    /// [`FaultKind::BadPatch`] with the record's index, [`FaultKind::BadHeader`] for a span width,
    /// [`FaultKind::BadLength`] where words are missing or the order is not kept.
    pub fn load_check(&mut self, record: u32) -> Result<()> {
        self.motion.may_continue_loading()?;
        let Motion { program, run, .. } = &mut self.motion;
        program.check(self.store.as_ref(), record, run.lines.scratch())
    }

    /// Header of the loaded job, and its data words; none where none is loaded, or it is streamed.
    #[must_use]
    pub fn loaded(&self) -> Option<(&Header, &[i32])> {
        let is_loaded = self.motion.state != State::Idle && !self.is_streamed();
        let [words, _] = self.motion.program.room();
        let words = self.store.as_ref().get(..words as usize).filter(|_| is_loaded)?;
        Some((self.motion.program.header(), words))
    }

    /// Seals the job: the machine is ready.
    ///
    /// # Errors
    /// [`FaultKind::BadLength`] where words or checks are missing, of a streamed job those of the first rows; the machine stays idle.
    pub fn load_finish(&mut self) -> Result<()> {
        self.motion.load_finish(self.store.as_ref())
    }

    /// Drops the loaded job: the machine is idle.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] while a job runs or is held.
    pub fn unload(&mut self) -> Result<()> {
        self.motion.unload()
    }

    /// State after the last tick or load call.
    #[must_use]
    pub const fn state(&self) -> State {
        self.motion.state
    }

    /// The fault, while the state is [`State::Stopping`] or [`State::Faulted`].
    #[must_use]
    pub const fn fault(&self) -> Option<Fault> {
        self.motion.fault
    }

    /// Pass, path and side parameter of the run. After a fault, those where the fault occurred, beyond the last sample.
    #[must_use]
    pub fn surface_position(&self) -> (u32, SpanParameter, SpanParameter) {
        self.motion
            .sequencer
            .fault_position()
            .unwrap_or_else(|| self.motion.run.surface_position())
    }

    /// Whether the loaded job has axis limits: each pass then starts and ends at standstill, unless a turn joins it to the next, and links join the
    /// passes.
    #[must_use]
    pub const fn has_limits(&self) -> bool {
        self.motion.program.header().axes.is_some()
    }

    /// The loaded job's home, nm: start of its run unless another tool position is known. None for a job without limits.
    #[must_use]
    pub fn home_nm(&self) -> Option<[i32; 3]> {
        self.motion.program.header().axes.map(|axes| axes.home_nm)
    }

    /// The tool's position, nm, where it is known: the end of the last run within limits, or the position set by [`Self::stand_at`].
    #[must_use]
    pub const fn stands_nm(&self) -> Option<[i32; 3]> {
        self.motion.sequencer.stands_nm()
    }

    /// Sets the tool's position, nm, from which the next run within limits starts; `None` where it is unknown: that run then
    /// starts at its job's home. Ignored while a run is under way.
    pub const fn stand_at(&mut self, at_nm: Option<[i32; 3]>) {
        if !self.motion.state.is_under_way() {
            self.motion.sequencer.stand_at(at_nm);
        }
    }

    /// The last sample. A fault leaves its position unchanged.
    #[must_use]
    pub const fn last(&self) -> &Sample {
        &self.motion.last
    }

    /// Smallest path interval of the last finished pass, in units of the side parameter.
    #[must_use]
    pub const fn last_interval(&self) -> f32 {
        self.motion.run.last_interval()
    }

    /// Evaluates the loaded surface at these parameters, in any state of the machine. Not for the sample path:
    /// each call collapses a patch. The side fraction is truncated to 2^-32.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] without a loaded job or for a span outside its grid; the fault of the surface
    /// at these parameters.
    pub fn evaluate(&self, path: SpanParameter, side: SpanParameter) -> Result<SurfacePoint> {
        self.motion.evaluate(self.store.as_ref(), path, side)
    }

    /// Controlled stop (IEC 60204-1 category 1) with an external fault, such as a missed deadline: the tool decelerates along the path to zero feed ([`State::Stopping`]):
    /// within 1.1 times the acceleration and 1.5 times the jerk limits of a job that has them, else over [`STOP_PERIODS`] or until the end of the pass if that is
    /// nearer. A held run faults immediately. Ignored where no run is under way.
    pub fn controlled_stop(&mut self, fault: Fault) {
        self.motion.controlled_stop(fault);
    }

    /// An external fault of a tool at rest: a start that does not come about, or a run that cannot go on. Ignored without a job, and while the tool moves.
    pub fn fail_at_rest(&mut self, fault: Fault) {
        if matches!(self.motion.state, State::Ready | State::Finished | State::Held) {
            self.motion.fail(fault);
        }
    }

    /// Uncontrolled stop (category 0) with an external fault: ends the run in this period, because the drives are off and the axes no longer
    /// follow the path. The first fault is kept. Ignored where no run is under way.
    pub fn uncontrolled_stop(&mut self, fault: Fault) {
        if self.motion.state.is_under_way() {
            self.motion.fail(fault);
        }
    }

    /// One period. Does not block or panic; execution time is bounded by one patch collapse and its evaluation at a few
    /// points, and at the start of a pass by a loop over 16 side spans.
    ///
    /// While the job runs, each call yields a sample with [`State::Running`], [`State::Linking`], [`State::Holding`] or [`State::Stopping`], counted by its `tick` from 0;
    /// the one after the last has [`State::Finished`]. In every state at standstill the sample repeats the last position.
    ///
    /// Also needs [`Self::plan`], once after each tick. Without it the tool of a job with axis limits waits at the start of a pass for ever; that of a job without
    /// them has passes spaced by the surface at each pass alone, not by that of the gap beside it: up to some percent over the scallop limit, and more where
    /// path lines are skew.
    #[inline(always)]
    pub fn tick(&mut self, inputs: impl Into<Inputs>) -> &Sample {
        self.motion.tick(self.store.as_ref(), inputs.into());
        &self.motion.last
    }

    /// Whether [`Self::plan`] has work in this period. With axis limits: a pass ahead of the tool is not planned, or the next tick is not prepared. Without: the current pass is
    /// not scanned for the step to the next one. At rest: the next run is not prepared.
    #[must_use]
    #[inline]
    pub fn has_to_plan(&self) -> bool {
        self.motion.has_to_plan()
    }

    /// The planning of one period: a fixed portion of work; the largest one found takes 36 000 cycles of a Cortex-M4F by the pessimistic model, 28 100 by the nominal one. To be called once after each tick and before the
    /// next, on a board from a task of lower priority than the tick's, under a lock that keeps the tick from preempting it. The samples depend on the number of calls between two ticks: with one after each,
    /// they are the same on every machine. Does nothing where [`Self::has_to_plan`] is false. A fault of the surface ahead is reported by the tick that
    /// reaches it.
    #[inline(always)]
    pub fn plan(&mut self) {
        self.motion.plan(self.store.as_mut());
    }
}
