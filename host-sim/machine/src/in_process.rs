//! The machine in this process: the core with a job loaded, a tick and the planning of the period in one call.

use interp_core::job::stream::RowsNeeded;
use interp_core::steps::BUFFER_WORDS;
use interp_core::{
    Command, Fault, Inputs, Interpolator, RunStart, STORE_WORDS, Sample, SpanParameter, State, Steps,
    SurfacePoint,
};

use crate::prepare::Prepared;

/// The core, with the job store of the board's capacity; for a job that a board is given while it runs, with one that holds all of it.
#[derive(Debug)]
pub struct Machine {
    core: Box<Interpolator<Vec<i32>>>,
    steps: Option<(Steps, Box<[u32; BUFFER_WORDS]>)>,
    start: RunStart,
}

impl Machine {
    /// A machine with this job loaded. If the job gives a step output, a run faults when a period needs too many steps.
    ///
    /// # Errors
    /// The core refuses the job: too many patches, a header value out of range, an invalid patch.
    pub fn load(job: &Prepared) -> Result<Self, Fault> {
        let capacity = if job.header.window > 0 {
            job.words.len()
        } else {
            STORE_WORDS
        };
        let mut core = Box::new(Interpolator::with_store(vec![0; capacity]));
        let words = u32::try_from(job.words.len()).unwrap_or(u32::MAX);
        core.load_begin(&job.header, words)?;
        core.load_words(0, &job.words)?;
        for record in 0..core.load_records() {
            core.load_check(record)?;
        }
        core.load_finish()?;
        // The board and the reader of the job file refuse an invalid configuration before this point.
        let checked = job.steps.and_then(|config| config.check().ok());
        let steps = checked.map(|checked| (Steps::new(checked, [0, 1, 2]), Box::new([0; BUFFER_WORDS])));
        Ok(Self {
            core,
            steps,
            start: job.start,
        })
    }

    /// Runs the job from where it is to begin, and calls `each` with every sample, until its end or a fault. Stops early and returns
    /// `Ok` when `each` returns `false`.
    ///
    /// # Errors
    /// The fault that stopped the run; [`Self::place`] is its location.
    pub fn run(&mut self, mut each: impl FnMut(&Sample) -> bool) -> Result<(), Fault> {
        // A fault of the run before is acknowledged by an abort; otherwise it is ignored.
        self.core.tick(Command::Abort);
        self.core.begin_at(self.start);
        let mut command = Some(Command::Start);
        let mut pass = None;
        let has_limits = self.core.has_limits();
        loop {
            let sample = *self.tick(command);
            command = None;
            if !matches!(sample.state, State::Running | State::Linking) {
                break;
            }
            if let Some((steps, slots)) = &mut self.steps {
                // The first sample of a run, and of a pass without limits, has no predecessor: the steps begin there, as on the board.
                if pass
                    .replace(sample.pass)
                    .is_none_or(|pass| pass != sample.pass && !has_limits)
                {
                    steps.place(sample.cl_nm);
                }
                if let Err(fault) = steps.step(sample.cl_nm, slots) {
                    self.core.tick(Command::Abort);
                    return Err(fault);
                }
            }
            if !each(&sample) {
                self.core.tick(Command::Abort);
                break;
            }
        }
        self.core.fault().map_or(Ok(()), Err)
    }

    /// Runs a streamed job to its end or a fault: the rows that each pass after the first one needs.
    pub(crate) fn rows_needed(&mut self) -> Vec<RowsNeeded> {
        let mut needed = Vec::new();
        let mut command = Some(Command::Start);
        let mut last = None;
        loop {
            let sample = *self.tick(command.take());
            if !matches!(sample.state, State::Running | State::Linking) {
                return needed;
            }
            // Those that need the same rows as the pass before them are not listed again.
            let asked = self.core.rows_needed();
            if asked != last {
                needed.extend(asked);
                last = asked;
            }
        }
    }

    /// Executes one period: the tick, then the planning.
    pub fn tick(&mut self, inputs: impl Into<Inputs>) -> &Sample {
        self.core.tick(inputs);
        self.core.plan();
        self.core.last()
    }

    /// Whether the tool is held above the surface, for a pause.
    #[must_use]
    pub fn is_lifted(&self) -> bool {
        self.core.is_lifted()
    }

    /// State after the last period.
    #[must_use]
    pub fn state(&self) -> State {
        self.core.state()
    }

    /// The current fault.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.core.fault()
    }

    /// The surface at a point, independent of any run.
    ///
    /// # Errors
    /// As [`Interpolator::evaluate`].
    pub fn evaluate(&self, path: SpanParameter, side: SpanParameter) -> Result<SurfacePoint, Fault> {
        self.core.evaluate(path, side)
    }

    /// Position in the run: pass, path and side place; after a fault, the location of the fault.
    #[must_use]
    pub fn place(&self) -> (u32, SpanParameter, SpanParameter) {
        self.core.surface_position()
    }
}
