//! The machine in this process: the core with a job loaded, one call a period.

use interp_core::steps::BUFFER_WORDS;
use interp_core::{Command, Fault, Inputs, Interpolator, Place, Sample, State, Steps, SurfacePoint};

use crate::prepare::Prepared;

/// The core, with the same store as the board's.
#[derive(Debug)]
pub struct Machine {
    core: Box<Interpolator>,
    steps: Option<(Steps, Box<[u32; BUFFER_WORDS]>)>,
}

impl Machine {
    /// A machine that is ready to run this job. Where it names steps, a run that asks too many of a period faults.
    ///
    /// # Errors
    /// What the core says against the job: too many patches, a header value out of range, a bad patch.
    pub fn load(job: &Prepared) -> Result<Self, Fault> {
        let mut core = Box::new(Interpolator::new());
        let words = u32::try_from(job.words.len()).unwrap_or(u32::MAX);
        core.load_begin(&job.header, words)?;
        core.load_words(0, &job.words)?;
        for record in 0..core.load_records() {
            core.load_check(record)?;
        }
        core.load_finish()?;
        // A configuration that cannot be used is refused by the board, too, and by the reader of the job file before.
        let checked = job.steps.and_then(|config| config.check().ok());
        let steps = checked.map(|checked| (Steps::new(checked, [0, 1, 2]), Box::new([0; BUFFER_WORDS])));
        Ok(Self { core, steps })
    }

    /// Runs the job from its beginning, and hands every sample on, until its end or a fault. Stops early, and returns
    /// `Ok`, when `each` says so by returning `false`.
    ///
    /// # Errors
    /// The fault that stopped the run; [`Self::place`] says where.
    pub fn run(&mut self, mut each: impl FnMut(&Sample) -> bool) -> Result<(), Fault> {
        // A fault of the run before is acknowledged by an abort; otherwise it is ignored.
        self.core.tick(Command::Abort);
        let mut command = Some(Command::Start);
        let mut pass = None;
        let has_limits = self.core.has_limits();
        loop {
            let sample = self.core.tick(command);
            command = None;
            if !matches!(sample.state, State::Running | State::Linking) {
                break;
            }
            if let Some((steps, slots)) = &mut self.steps {
                // Nothing led to the first sample of a run, nor of a pass without limits; the board takes it the same way.
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
            if !each(sample) {
                self.core.tick(Command::Abort);
                break;
            }
        }
        self.core.fault().map_or(Ok(()), Err)
    }

    /// Lets one period pass.
    pub fn tick(&mut self, inputs: impl Into<Inputs>) -> &Sample {
        self.core.tick(inputs)
    }

    /// State after the last period.
    #[must_use]
    pub fn state(&self) -> State {
        self.core.state()
    }

    /// The fault that the machine is in.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.core.fault()
    }

    /// The surface at a place, outside of any run.
    ///
    /// # Errors
    /// As [`Interpolator::evaluate`].
    pub fn evaluate(&self, path: Place, side: Place) -> Result<SurfacePoint, Fault> {
        self.core.evaluate(path, side)
    }

    /// Where the run is: pass, path and side place; after a fault, where that is.
    #[must_use]
    pub fn place(&self) -> (u32, Place, Place) {
        self.core.place()
    }
}
