//! The machine: load, tick, hold, resume, abort.

use crate::command::{Command, Inputs};
use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Program;
use crate::job::{Header, STORE_WORDS};
use crate::pass::patch::Patch;
use crate::pass::position::Line;
use crate::pass::run::Run;
use crate::sample::{Place, Sample, State, interval_of};
use crate::sequence::course::{Course, Outcome};

/// Periods over which the feed falls to nothing when a fault from outside stops the run: 1/32 less each period.
pub const STOP_PERIODS: u8 = 32;

/// The loaded surface at one place, outside of any run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePoint {
    /// Cutter contact, nm.
    pub cc_nm: [i32; 3],
    /// Cutter location, nm.
    pub cl_nm: [i32; 3],
    /// Unit normal towards the tool.
    pub normal: [f32; 3],
    /// Candidate of the path interval, in units of the side parameter; infinite where it sets no limit.
    pub interval: f32,
}

/// Everything that decides where the tool goes, behind one [`Interpolator::tick`] a period.
///
/// The job's data lie in a store of 32-bit words, owned (an array) or lent (a board's static one, which then need not pass
/// over the stack). The sample path does not depend on which: it is compiled once, in this crate.
#[derive(Debug)]
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
    /// An idle machine without a job, with a store of its own.
    #[must_use]
    pub const fn new() -> Self {
        Self::with_store([0; WORDS])
    }
}

impl<S> Interpolator<S> {
    /// An idle machine without a job; its jobs may be as long as the store.
    #[must_use]
    pub const fn with_store(store: S) -> Self {
        Self {
            motion: Motion::NEW,
            store,
        }
    }
}

impl<S: AsRef<[i32]> + AsMut<[i32]>> Interpolator<S> {
    /// Begins to load a job of so many data words; what was loaded before is gone, and the machine is idle.
    ///
    /// # Errors
    /// Refused, and nothing changes: [`FaultKind::WrongState`] while a job runs or is held, [`FaultKind::BadHeader`],
    /// [`FaultKind::TooManyPatches`] with the words that the header implies, [`FaultKind::BadLength`] where `words` are not
    /// as many.
    pub fn load_begin(&mut self, header: &Header, words: u32) -> Result<()> {
        self.motion.load_begin(header, words, self.store.as_ref().len())
    }

    /// Writes data words at this offset: in order, or again over what was written.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`]; [`FaultKind::BadLength`] where no load has begun, the words leave a gap or reach past the
    /// job's end. Nothing is written then.
    pub fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<()> {
        self.motion.may_load()?;
        self.motion.program.write(self.store.as_mut(), offset, words)
    }

    /// Records that [`Self::load_check`] has to be called for.
    #[must_use]
    pub fn load_records(&self) -> u32 {
        self.motion.program.records()
    }

    /// Checks one record: some thousand cycles, so that a board can do it between ticks. In order from 0.
    ///
    /// # Errors
    /// [`FaultKind::BadPatch`] with the record's index, [`FaultKind::BadHeader`] for a span width,
    /// [`FaultKind::BadLength`] where words are missing or the order is not kept.
    pub fn load_check(&mut self, record: u32) -> Result<()> {
        self.motion.may_load()?;
        self.motion.program.check(self.store.as_ref(), record)
    }

    /// Seals the job: the machine is ready.
    ///
    /// # Errors
    /// [`FaultKind::BadLength`] where words or checks are missing; the machine stays idle.
    pub fn load_finish(&mut self) -> Result<()> {
        self.motion.load_finish()
    }

    /// Gives up what was loaded: the machine is idle. Refused like [`Self::load_begin`].
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

    /// Where the run is: pass, path and side place. After a fault, where that is, which is past the last sample.
    #[must_use]
    pub fn place(&self) -> (u32, Place, Place) {
        self.motion
            .course
            .place()
            .unwrap_or_else(|| self.motion.run.place())
    }

    /// Whether the loaded job is run within the axes' limits, from standstill to standstill, so that a way leads to each of its samples.
    #[must_use]
    pub const fn has_limits(&self) -> bool {
        self.motion.program.header().axes.is_some()
    }

    /// The loaded job's home, nm: where its run begins unless the tool is known to stand elsewhere. None for a job without limits.
    #[must_use]
    pub fn home_nm(&self) -> Option<[i32; 3]> {
        self.motion.program.header().axes.map(|axes| axes.home_nm)
    }

    /// Where the tool stands, nm, as far as is known: where the last run within limits left it, or where it was said to stand.
    #[must_use]
    pub const fn stands_nm(&self) -> Option<[i32; 3]> {
        self.motion.course.stands_nm()
    }

    /// Says where the tool stands, nm, and so where the next run within limits begins; none where nobody knows: then that run
    /// begins at its job's home. Ignored while a run is under way.
    pub const fn stand_at(&mut self, at_nm: Option<[i32; 3]>) {
        if !self.motion.state.is_under_way() {
            self.motion.course.stand_at(at_nm);
        }
    }

    /// The last sample: its position is kept after a fault.
    #[must_use]
    pub const fn last(&self) -> &Sample {
        &self.motion.last
    }

    /// Least path interval of the pass that was finished last, in units of the side parameter.
    #[must_use]
    pub const fn last_interval(&self) -> f32 {
        self.motion.run.last_interval()
    }

    /// Evaluates the loaded surface at these parameters: what a sample there would say, whatever the machine is doing. Not for the sample path:
    /// it collapses a patch each time. The side fraction counts in steps of 2^-32.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] without a loaded job or for a span that it does not have; what is wrong with the surface
    /// there.
    pub fn evaluate(&self, path: Place, side: Place) -> Result<SurfacePoint> {
        self.motion.evaluate(self.store.as_ref(), path, side)
    }

    /// Stops a run with a fault from outside, such as a missed deadline: along the path, the feed falling to nothing over
    /// [`STOP_PERIODS`] ([`State::Stopping`]), or at the end of the pass if that is nearer. Where the run is held, it faults at
    /// once. Ignored where nothing runs.
    pub fn trip(&mut self, fault: Fault) {
        self.motion.trip(fault);
    }

    /// Ends a run with a fault from outside in this very period, because the drives are off and nothing follows the path any
    /// more. The first fault is kept. Ignored where no run is under way.
    pub fn cut(&mut self, fault: Fault) {
        if self.motion.state.is_under_way() {
            self.motion.fail(fault);
        }
    }

    /// One period. Never blocks, never panics; bounded by the collapse of a patch and its evaluation at a few
    /// places, and at the start of a pass by a walk over 16 side spans.
    ///
    /// While the job runs, each call yields a sample with [`State::Running`] or [`State::Stopping`], counted by its `tick` from 0;
    /// the one after the last has [`State::Finished`]. In every state that does not move, the sample repeats the last position.
    #[inline(always)]
    pub fn tick(&mut self, inputs: impl Into<Inputs>) -> &Sample {
        self.motion.tick(self.store.as_ref(), inputs.into());
        &self.motion.last
    }
}

/// The machine without its store.
#[derive(Debug)]
struct Motion {
    state: State,
    fault: Option<Fault>,
    /// Periods until a stop is over.
    slow: u8,
    last: Sample,
    /// What comes of a stop that no fault asked for.
    ending: Ending,
    run: Run,
    program: Program,
    course: Course,
}

/// What a run that is given up still has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    /// Stand where it stops.
    Stand,
    /// Leave the surface then.
    Leave,
    /// It is on its way up.
    Leaving,
}

impl Motion {
    const NEW: Self = Self {
        state: State::Idle,
        fault: None,
        slow: 0,
        last: Sample::START,
        ending: Ending::Stand,
        run: Run::START,
        program: Program::new(),
        course: Course::START,
    };

    fn may_load(&self) -> Result<()> {
        if self.state.is_under_way() {
            return Err(Fault::new(FaultKind::WrongState, f32::from(self.state as u8)));
        }
        Ok(())
    }

    fn load_begin(&mut self, header: &Header, words: u32, capacity: usize) -> Result<()> {
        self.may_load()?;
        self.program.begin(header, words, capacity)?;
        self.state = State::Idle;
        self.fault = None;
        Ok(())
    }

    fn load_finish(&mut self) -> Result<()> {
        self.may_load()?;
        self.program.seal()?;
        self.state = State::Ready;
        self.restart();
        Ok(())
    }

    fn unload(&mut self) -> Result<()> {
        self.may_load()?;
        self.program.clear();
        self.state = State::Idle;
        self.fault = None;
        Ok(())
    }

    fn restart(&mut self) {
        self.run.restart();
        self.fault = None;
    }

    fn trip(&mut self, fault: Fault) {
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

    /// The first fault is the one that is kept.
    fn fail(&mut self, fault: Fault) {
        self.state = State::Faulted;
        self.fault.get_or_insert(fault);
    }

    #[inline(never)]
    fn tick(&mut self, store: &[i32], inputs: Inputs) {
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

    /// One period of a machine that has limits.
    #[inline(never)]
    fn tick_within_limits(&mut self, store: &[i32], share: f32) {
        let share = match (self.state, self.ending) {
            (State::Running | State::Linking, _) => share,
            (State::Stopping, Ending::Leaving) => 1.0,
            (State::Holding | State::Stopping, _) => 0.0,
            _ => return,
        };
        if share == 0.0 && self.course.is_at_rest() && self.stand() {
            return;
        }
        let Self {
            program,
            course,
            run,
            last,
            ..
        } = self;
        let outcome = program.job(store).and_then(|job| match &job.header.axes {
            Some(axes) => course.tick(&job, axes, run, share, last),
            None => Ok(Outcome::Finished),
        });
        match (outcome, self.state) {
            (Ok(Outcome::Pass), State::Linking) => self.state = State::Running,
            (Ok(Outcome::Link), State::Running) => self.state = State::Linking,
            (Ok(Outcome::Finished), State::Stopping) => self.state = State::Ready,
            (Ok(Outcome::Finished), _) => self.state = State::Finished,
            (Ok(_), _) => {}
            (Err(fault), _) => self.fail(fault),
        }
    }

    /// The tool stands, and is to: what becomes of the run. Whether the period is over with that.
    fn stand(&mut self) -> bool {
        match self.state {
            State::Holding => self.state = State::Held,
            State::Stopping if self.fault.is_some() => self.state = State::Faulted,
            State::Stopping if self.ending == Ending::Leave => {
                self.ending = Ending::Leaving;
                self.course.leave(&self.run);
            }
            State::Stopping => self.state = State::Ready,
            _ => return false,
        }
        true
    }

    #[inline(always)]
    fn advance(&mut self, store: &[i32]) {
        let job = match self.program.job(store) {
            Ok(job) => job,
            Err(fault) => return self.fail(fault),
        };
        match self.run.advance(&job, &mut self.last) {
            Ok(true) => {}
            Ok(false) => self.state = State::Finished,
            Err(fault) => self.fail(fault),
        }
    }

    /// One period of a stop: 1/32 of the feed less than in the last, until it is nothing or the pass is over.
    #[inline(never)]
    fn stop(&mut self, store: &[i32]) {
        self.slow = self.slow.saturating_sub(1);
        if self.slow == 0 || !self.run.is_along() {
            self.state = State::Faulted;
            return;
        }
        let share = f32::from(self.slow) / f32::from(STOP_PERIODS);
        let job = self.program.job(store);
        if let Err(fault) = job.and_then(|job| self.run.advance_far(&job, share, &mut self.last)) {
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
                self.restart();
                let Self { program, course, .. } = self;
                match program.job(store) {
                    Ok(job) if has_limits => {
                        if let Some(axes) = &job.header.axes {
                            course.restart(&job, axes);
                        }
                        State::Linking
                    }
                    _ => State::Running,
                }
            }
            Command::Hold if has_limits => State::Holding,
            Command::Hold => State::Held,
            Command::Resume if has_limits && self.course.is_link() => State::Linking,
            Command::Resume => State::Running,
            Command::Abort | Command::Stop if has_limits && self.state != State::Faulted => {
                self.ending = if command == Command::Stop {
                    Ending::Leave
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

    fn evaluate(&self, store: &[i32], path: Place, side: Place) -> Result<SurfacePoint> {
        let job = self.program.job(store)?;
        let header = self.program.header();
        if path.span >= header.path_spans || side.span >= header.side_spans {
            return Err(Fault::new(FaultKind::WrongState, f32::from(self.state as u8)));
        }
        let mut patch = Patch::NONE;
        patch.collapse(
            &job,
            &Line {
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
            interval: interval_of(patch.interval.density(&contact)),
        })
    }
}
