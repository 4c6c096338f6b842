//! Runs the first ticks of a job in QEMU and reads their records.

use std::path::{Path, PathBuf};

use cycle_plugin::plan::{Plan, Stage};
use cycle_plugin::record::Record;
use protocol::message::{Clock, Configuration, Report, Request};

use super::BudgetError;
use machine::prepare::Prepared;
use machine::remote::operate::{self, Setup};
use machine::remote::qemu::{self, Qemu};
use machine::remote::session::Event;
use machine::remote::{Session, drive};

/// The image, its plan and the plugin: the inputs of every measurement.
#[derive(Debug)]
pub struct MeasurementSetup {
    image: PathBuf,
    plugin: PathBuf,
    plan: Vec<u8>,
    stack_end: u32,
}

/// The records of a job's ticks.
#[derive(Clone, Debug, Default)]
pub struct Ticks {
    /// The ticks that yield a sample, in order.
    pub records: Vec<Record>,
    /// The portions of the planning task during the run, in order.
    pub planning: Vec<Record>,
    /// High-water mark of the stack, bytes.
    pub stack_bytes: u32,
}

/// Whether a tick yields a sample.
pub(super) fn yields_sample(record: &Record) -> bool {
    record.stages[Stage::Digest as usize].nominal > 0
}

fn file_error(path: &Path, error: &std::io::Error) -> BudgetError {
    BudgetError::File(path.into(), error.to_string())
}

impl MeasurementSetup {
    /// Builds the plugin for an image and its plan.
    ///
    /// # Errors
    /// The plugin cannot be built.
    pub fn new(image: &Path, plan: &Plan) -> Result<Self, BudgetError> {
        Ok(Self {
            image: image.into(),
            plugin: qemu::cycle_plugin()?,
            plan: plan.to_bytes(),
            stack_end: plan.stack_end,
        })
    }

    /// The image.
    pub(super) fn image(&self) -> &Path {
        &self.image
    }

    /// Address where the stack begins.
    pub(super) const fn stack_end(&self) -> u32 {
        self.stack_end
    }

    /// QEMU's arguments for the plugin, which writes into `folder`, and the file of its records.
    pub(super) fn plugin(&self, folder: &Path) -> Result<([String; 2], PathBuf), BudgetError> {
        let (plan, records) = (folder.join("plan"), folder.join("records"));
        std::fs::write(&plan, &self.plan).map_err(|error| file_error(&plan, &error))?;
        let plugin = format!(
            "{},plan={},records={}",
            self.plugin.display(),
            plan.display(),
            records.display()
        );
        Ok((["-plugin".to_owned(), plugin], records))
    }

    /// Runs `ticks` ticks of a job in lockstep and reads the plugin's records.
    ///
    /// # Errors
    /// QEMU does not start, the board refuses the job, or records are missing.
    pub fn run(&self, job: &Prepared, ticks: u32) -> Result<Ticks, BudgetError> {
        let here = Path::new("a temporary file");
        let folder = tempfile::tempdir().map_err(|error| file_error(here, &error))?;
        let (arguments, records) = self.plugin(folder.path())?;
        let samples = {
            let (_qemu, stream) = Qemu::start_with(&self.image, &arguments)?;
            let mut session = Session::open(stream, 1)?;
            // A request within a measured tick would be a part of it.
            session.set_quiet(true);
            operate::make_ready(&mut session, &Setup::simulated(Configuration::DEFAULT))?;
            drive::upload(&mut session, job, |_| {})?;
            run_ticks(&mut session, ticks)?
        };
        let bytes = std::fs::read(&records).map_err(|error| file_error(&records, &error))?;
        self.select(Record::read_all(&bytes), samples)
    }

    /// Selects the ticks that yield a sample; their number must be the board's.
    fn select(&self, records: Vec<Record>, samples: u32) -> Result<Ticks, BudgetError> {
        let last = records.last().copied().unwrap_or_default();
        if last.unknown > 0 {
            let what = format!("{} instructions are unknown to the decoder", last.unknown);
            return Err(BudgetError::Figures(what));
        }
        let (planning, mut records): (Vec<_>, Vec<_>) =
            records.into_iter().partition(|record| record.is_planning);
        records.retain(yields_sample);
        if records.len() != samples as usize {
            let what = format!(
                "{} ticks with a sample, but the board reports {samples} samples",
                records.len()
            );
            return Err(BudgetError::Figures(what));
        }
        Ok(Ticks {
            records,
            planning,
            stack_bytes: self.stack_end.saturating_sub(last.stack_low),
        })
    }
}

/// Runs `ticks` ticks of the loaded job. The number of samples that the board reports.
fn run_ticks(session: &mut Session, ticks: u32) -> Result<u32, BudgetError> {
    for request in [
        Request::Clock(Clock::Lockstep),
        Request::Report(Report::Digests),
        Request::Start,
        Request::Run { ticks },
    ] {
        session.command(&request)?;
    }
    loop {
        if let Event::Halted(status) = session.event()? {
            return Ok(status.samples);
        }
    }
}
