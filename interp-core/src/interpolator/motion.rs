//! The machine without its store: its state, and what a tick does in each.

use super::{STOP_PERIODS, SurfacePoint};
use crate::command::{Command, Inputs};
use crate::fault::{Fault, FaultKind, Result};
use crate::job::Header;
use crate::job::program::Program;
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::run::Run;
use crate::sample::{RunStart, Sample, SpanParameter, State, interval_of};
use crate::sequence::sequencer::{FeedCommand, Outcome, Sequencer};

/// The machine without its store.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    pub(super) state: State,
    pub(super) fault: Option<Fault>,
    /// Periods left of a controlled stop.
    slow: u8,
    pub(super) last: Sample,
    /// State after a stop without a fault.
    ending: Ending,
    pub(super) run: Run,
    pub(super) program: Program,
    pub(super) sequencer: Sequencer,
    /// The last tick waited for rows of a streamed job.
    pub(super) is_starved: bool,
    /// What is prepared of the next run.
    start: Start,
}

/// What is prepared of the next run: its tick has more to do than any other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Start {
    /// Nothing yet.
    Due,
    /// The first pass is begun, or known.
    Prepared,
    /// Nothing can be.
    None,
}

/// Remaining motion of an aborted run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    /// Stop on the path and stay there.
    Stand,
    /// Stop, then retract from the surface.
    Retract,
    /// The retract is under way, as a link.
    Retracting,
    /// Stop, then retract, and be held there.
    Lift,
}

impl Motion {
    pub(super) const NEW: Self = Self {
        state: State::Idle,
        fault: None,
        slow: 0,
        last: Sample::START,
        ending: Ending::Stand,
        run: Run::START,
        program: Program::new(),
        sequencer: Sequencer::START,
        is_starved: false,
        start: Start::None,
    };

    fn may_load(&self) -> Result<()> {
        if self.state.is_under_way() {
            return Err(Fault::new(FaultKind::WrongState, f32::from(self.state as u8)));
        }
        Ok(())
    }

    pub(super) fn may_continue_loading(&self) -> Result<()> {
        if self.program.is_streamed() {
            return Ok(());
        }
        self.may_load()
    }

    pub(super) fn load_begin(&mut self, header: &Header, words: u32, capacity: usize) -> Result<()> {
        self.may_load()?;
        self.program.begin(header, words, capacity)?;
        self.state = State::Idle;
        self.fault = None;
        self.sequencer.begin_at(RunStart::FIRST);
        Ok(())
    }

    pub(super) fn load_finish(&mut self, store: &[i32]) -> Result<()> {
        self.may_load()?;
        self.program.seal()?;
        self.state = State::Ready;
        self.prepare_start(store);
        Ok(())
    }

    /// Prepares the next run.
    #[inline(never)]
    fn prepare_start(&mut self, store: &[i32]) {
        self.restart(store);
        self.start = match self.program.job(store) {
            Ok(job) if self.run.prepare_start(&job) => Start::Prepared,
            _ => Start::None,
        };
    }

    /// Whether the next run is to be prepared.
    fn is_start_due(&self) -> bool {
        self.start == Start::Due && matches!(self.state, State::Ready | State::Finished)
    }

    pub(super) fn unload(&mut self) -> Result<()> {
        self.may_load()?;
        self.program.clear();
        self.state = State::Idle;
        self.fault = None;
        Ok(())
    }

    fn restart(&mut self, store: &[i32]) {
        if let Ok(job) = self.program.job(store) {
            self.run.restart(&self.program, &job);
        }
        self.fault = None;
        self.ending = Ending::Stand;
    }

    pub(super) fn controlled_stop(&mut self, fault: Fault) {
        match self.state {
            State::Running => {
                self.state = State::Stopping;
                self.slow = STOP_PERIODS;
                self.fault = Some(fault);
            }
            State::Linking | State::Holding | State::Stopping => {
                self.state = State::Stopping;
                self.ending = Ending::Stand;
                self.fault.get_or_insert(fault);
            }
            State::Held => self.fail(fault),
            _ => {}
        }
    }

    /// Only the first fault is kept.
    pub(super) fn fail(&mut self, fault: Fault) {
        self.state = State::Faulted;
        self.fault.get_or_insert(fault);
    }

    #[inline(never)]
    pub(super) fn tick(&mut self, store: &[i32], inputs: Inputs) {
        self.is_starved = false;
        if let Some(command) = inputs.command {
            self.execute(store, command);
        }
        if self.program.header().axes.is_some() {
            self.tick_within_limits(store, inputs.feed_factor());
        } else {
            match self.state {
                State::Running => self.advance(store),
                State::Stopping => self.stop(store),
                _ => {}
            }
        }
        self.last.state = self.state;
    }

    /// Whether a tick that begins a pass, or the way to one, has to wait for the rows of patches that it and the planning after it need. Those before the tool's row
    /// are free.
    #[cold]
    #[inline(never)]
    fn waits_for_rows(&mut self, store: &[i32]) -> Result<bool> {
        let Self {
            program,
            sequencer,
            run,
            ..
        } = self;
        let job = program.job(store)?;
        let has_limits = job.header.axes.is_some();
        let rows = if has_limits {
            sequencer.rows_needed(&job, run)
        } else {
            run.rows_needed(&job)
        };
        let Some(rows) = rows else {
            return Ok(false);
        };
        if !program.ask(store, &rows)? {
            self.is_starved = true;
        } else if has_limits {
            sequencer.set_has_rows();
            if let (Some(estimator), _) = run.estimator_and_lines() {
                estimator.grant_rows(&rows);
            }
        }
        Ok(self.is_starved)
    }

    pub(super) fn has_to_plan(&self) -> bool {
        if self.is_starved {
            return false;
        }
        if self.is_start_due() {
            return true;
        }
        let header = self.program.header();
        if header.axes.is_none() {
            return self.state == State::Running && self.run.has_to_plan(header.spacing);
        }
        matches!(
            self.state,
            State::Running | State::Linking | State::Holding | State::Held | State::Stopping
        ) && self.sequencer.has_to_plan(&self.run)
    }

    #[inline(never)]
    pub(super) fn plan(&mut self, store: &mut [i32]) {
        if !self.has_to_plan() {
            return;
        }
        if self.is_start_due() {
            let interval = self.run.last_interval();
            self.prepare_start(store);
            self.run.keep_interval(interval);
            return;
        }
        let Self {
            program,
            sequencer,
            run,
            ..
        } = self;
        if program.header().axes.is_some() {
            sequencer.plan(program, store, run);
            return;
        }
        // A piece of a front is read from the words after the job's.
        let spent = program.job(store).map_or(0, |job| run.prepare_piece(&job));
        if let Ok((job, rest)) = program.job_and_rest(store) {
            run.plan(&job, rest, spent);
        }
        if let Ok(job) = program.job(store) {
            run.prepare_front(&job);
            run.move_ahead(&job, 1.0);
        }
    }

    /// One period of a job with axis limits.
    #[inline(never)]
    fn tick_within_limits(&mut self, store: &[i32], feed_factor: f32) {
        let feed_factor = match self.state {
            State::Running | State::Linking => feed_factor,
            State::Holding | State::Stopping => 0.0,
            _ => return,
        };
        if feed_factor == 0.0 && self.sequencer.is_at_rest() && self.stand() {
            return;
        }
        if self.program.is_streamed()
            && matches!(self.state, State::Running | State::Linking)
            && self.sequencer.may_wait_for_rows()
        {
            match self.waits_for_rows(store) {
                Ok(false) => {}
                Ok(true) => return,
                Err(fault) => return self.fail(fault),
            }
        }
        let command = FeedCommand {
            feed_factor,
            is_fault: self.fault.is_some(),
        };
        let Self {
            program,
            sequencer,
            run,
            last,
            ..
        } = self;
        let outcome = program
            .job(store)
            .and_then(|job| sequencer.tick(&job, run, command, last));
        match (outcome, self.state) {
            (Ok(Outcome::Pass), State::Linking) => {
                self.state = State::Running;
                self.program.release(self.run.row());
            }
            (Ok(Outcome::Link), State::Running) => self.state = State::Linking,
            (Ok(Outcome::Finished), _) if self.ending == Ending::Retracting => self.state = State::Ready,
            (Ok(Outcome::Finished), _) => self.state = State::Finished,
            (Ok(Outcome::Lifted), State::Linking) => self.state = State::Held,
            (Ok(_), _) => {}
            (Err(fault), _) => self.fail(fault),
        }
    }

    /// The tool has come to the commanded standstill: sets the next state of the run. Returns whether the period is complete.
    fn stand(&mut self) -> bool {
        match self.state {
            State::Holding if self.ending == Ending::Lift => {
                // A link like any other.
                self.ending = Ending::Stand;
                self.state = if self.sequencer.lift(&self.run) {
                    State::Linking
                } else {
                    State::Held
                };
            }
            State::Holding => self.state = State::Held,
            State::Stopping if self.fault.is_some() => self.state = State::Faulted,
            State::Stopping if self.ending == Ending::Retract => {
                // A link like any other: it obeys hold, abort and override.
                self.ending = Ending::Retracting;
                self.state = State::Linking;
                self.sequencer.retract(&self.run);
            }
            State::Stopping => self.state = State::Ready,
            _ => return false,
        }
        true
    }

    #[inline(always)]
    fn advance(&mut self, store: &[i32]) {
        let begins = self.program.is_streamed() && !self.run.is_along();
        if begins {
            match self.waits_for_rows(store) {
                Ok(false) => {}
                Ok(true) => return,
                Err(fault) => return self.fail(fault),
            }
        }
        let job = match self.program.job(store) {
            Ok(job) => job,
            Err(fault) => return self.fail(fault),
        };
        match self.run.advance(&job, &mut self.last) {
            Ok(true) if begins => self.program.release(self.run.row()),
            Ok(true) => {}
            Ok(false) => self.state = State::Finished,
            Err(fault) => self.fail(fault),
        }
    }

    /// One period of a stop: reduces the feed by 1/32, until it is zero or the pass ends.
    #[inline(never)]
    fn stop(&mut self, store: &[i32]) {
        self.slow = self.slow.saturating_sub(1);
        if self.slow == 0 || !self.run.is_along() {
            self.state = State::Faulted;
            return;
        }
        let feed_factor = f32::from(self.slow) / f32::from(STOP_PERIODS);
        let job = self.program.job(store);
        if let Err(fault) = job.and_then(|job| self.run.advance_far(&job, feed_factor, &mut self.last)) {
            self.fail(fault);
        }
    }

    #[cold]
    #[inline(never)]
    fn execute(&mut self, store: &[i32], command: Command) {
        if !command.is_allowed(self.state) {
            return;
        }
        let has_limits = self.program.header().axes.is_some();
        self.state = match command {
            Command::Start => {
                if self.start == Start::Prepared {
                    self.start = Start::Due;
                    self.run.forget_interval();
                } else {
                    self.restart(store);
                }
                if let Err(fault) = self.program.rewind() {
                    return self.fail(fault);
                }
                let Self {
                    program,
                    sequencer,
                    run,
                    ..
                } = self;
                match program.job(store) {
                    Ok(job) if has_limits => {
                        if let Some(axes) = &job.header.axes {
                            let first = run.take_first_route(&job);
                            sequencer.restart(first, axes);
                            run.expect_pass(sequencer.first_pass());
                        }
                        State::Linking
                    }
                    _ => State::Running,
                }
            }
            Command::Pause if has_limits => {
                // A stop that retracts is on its way up already.
                if self.ending != Ending::Retracting {
                    self.ending = Ending::Lift;
                }
                State::Holding
            }
            Command::Hold if has_limits => State::Holding,
            Command::Hold | Command::Pause => State::Held,
            Command::Resume if has_limits => {
                if self.ending == Ending::Lift {
                    self.ending = Ending::Stand;
                }
                self.sequencer.come_back();
                if self.sequencer.is_link() {
                    State::Linking
                } else {
                    State::Running
                }
            }
            Command::Resume => State::Running,
            Command::Abort | Command::Stop if has_limits && self.state != State::Faulted => {
                self.ending = if command == Command::Stop {
                    Ending::Retract
                } else {
                    Ending::Stand
                };
                State::Stopping
            }
            Command::Abort | Command::Stop => {
                self.fault = None;
                State::Ready
            }
        };
    }

    pub(super) fn evaluate(
        &self,
        store: &[i32],
        path: SpanParameter,
        side: SpanParameter,
    ) -> Result<SurfacePoint> {
        let job = self.program.job(store)?;
        let header = self.program.header();
        if path.span >= header.path_spans || side.span >= header.side_spans {
            return Err(Fault::new(FaultKind::WrongState, f32::from(self.state as u8)));
        }
        let mut patch = Patch::NONE;
        patch.collapse(
            &job,
            &PassPosition {
                side,
                reversed: false,
                span: path.span,
            },
        )?;
        let (contact, located) = patch.evaluate(path.fraction)?;
        Ok(SurfacePoint {
            cc_nm: located.cc_nm,
            cl_nm: located.cl_nm,
            normal: patch.ball.normal(contact.offset),
            interval: interval_of(patch.interval.inv_interval_sq(&contact)),
        })
    }
}
