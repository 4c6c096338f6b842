//! One QEMU with the plugin for many jobs: runs them, and finds the worst tick of each.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use cycle_plugin::plan::Stage;
use cycle_plugin::record::{RECORD_BYTES, Record};
use interp_core::{FaultKind, State};
use protocol::message::{Clock, Configuration, FaultReport, Report, Request, Status};

use super::BudgetError;
use super::figures::{Model, whole};
use super::measure::{Bench, yields_sample};
use crate::prepare::Prepared;
use crate::remote::operate::{self, Setup};
use crate::remote::qemu::Qemu;
use crate::remote::session::Event;
use crate::remote::{Session, drive};

/// Ticks of a run that are tried with all that can come together.
const TRIED: usize = 2;

/// Ticks that a stop is waited for at a time, and how often: ten minutes of it.
const STOP_TICKS: u32 = 10_000;
const SETTLE_ROUNDS: u32 = 60;

/// QEMU, the line to the board in it, and what the plugin writes.
pub struct Lab {
    session: Session,
    records: File,
    /// A record that has been written in part.
    rest: Vec<u8>,
    stack_end: u32,
    stack_low: u32,
    _qemu: Qemu,
    _folder: tempfile::TempDir,
}

/// What the ticks of a run took.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Every tick from the start to the end, those included in which no time passed.
    pub records: Vec<Record>,
    /// Samples that the board made.
    pub samples: u32,
    /// The fault that ended it.
    pub fault: Option<&'static str>,
}

/// The worst tick of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Worst {
    /// What it took.
    pub record: Record,
    /// Samples before it: the number of the tick.
    pub tick: u32,
    /// What happened in it.
    pub events: Vec<&'static str>,
}

impl Run {
    /// Most cycles of a tick.
    #[must_use]
    pub fn most(&self) -> u32 {
        let cycles = self
            .records
            .iter()
            .map(|record| whole(record, Model::Pessimistic));
        cycles.max().unwrap_or(0)
    }

    /// Each tick with the samples before it.
    fn numbered(&self) -> Vec<(u32, Record)> {
        let mut samples = 0;
        self.records
            .iter()
            .map(|record| {
                let numbered = (samples, *record);
                samples += u32::from(yields_sample(record));
                numbered
            })
            .collect()
    }
}

/// Name of a fault; the board's may be of another version.
fn fault_name(fault: &FaultReport) -> &'static str {
    fault.kind().map_or("a fault", FaultKind::name)
}

fn file_error(path: &Path, error: &std::io::Error) -> BudgetError {
    BudgetError::File(path.into(), error.to_string())
}

impl Lab {
    /// Starts QEMU.
    ///
    /// # Errors
    /// It does not start, or the board does not answer.
    pub fn new(bench: &Bench) -> Result<Self, BudgetError> {
        let here = Path::new("a temporary file");
        let folder = tempfile::tempdir().map_err(|error| file_error(here, &error))?;
        let (arguments, records) = bench.plugin(folder.path())?;
        let (qemu, stream) = Qemu::start_with(bench.image(), &arguments)?;
        let mut session = Session::open(stream, 1)?;
        operate::make_ready(&mut session, &Setup::simulated(Configuration::DEFAULT))?;
        Ok(Self {
            session,
            records: File::open(&records).map_err(|error| file_error(&records, &error))?,
            rest: Vec::new(),
            stack_end: bench.stack_end(),
            stack_low: bench.stack_end(),
            _qemu: qemu,
            _folder: folder,
        })
    }

    /// High-water mark of the stack since the beginning, bytes.
    #[must_use]
    pub fn stack_bytes(&self) -> u32 {
        self.stack_end.saturating_sub(self.stack_low)
    }

    /// The records since the last call.
    fn take(&mut self) -> Result<Vec<Record>, BudgetError> {
        let here = Path::new("the plugin's records");
        self.records
            .read_to_end(&mut self.rest)
            .map_err(|error| file_error(here, &error))?;
        let whole = self.rest.len() / RECORD_BYTES * RECORD_BYTES;
        let records = Record::read_all(&self.rest[..whole]);
        self.rest.drain(..whole);
        if let Some(last) = records.last() {
            self.stack_low = last.stack_low;
            if last.unknown > 0 {
                let what = format!("{} instructions are unknown to the decoder", last.unknown);
                return Err(BudgetError::Figures(what));
            }
        }
        Ok(records)
    }

    fn commands(&mut self, requests: &[Request]) -> Result<(), BudgetError> {
        for request in requests {
            self.session.command(request)?;
        }
        Ok(())
    }

    /// Lets so many periods pass, and waits for them.
    fn pass(&mut self, ticks: u32) -> Result<Status, BudgetError> {
        self.session.command(&Request::Run { ticks })?;
        loop {
            if let Event::Halted(status) = self.session.event()? {
                return Ok(status);
            }
        }
    }

    /// Gives up what runs. On a machine with limits the tool slows down along its path first, and where a fault is behind that, the
    /// fault is left to be acknowledged.
    fn settle(&mut self) -> Result<(), BudgetError> {
        let mut state = self.session.status()?.state;
        for _ in 0..SETTLE_ROUNDS {
            if matches!(state, State::Idle | State::Ready | State::Finished) {
                return self.commands(&[Request::Clock(Clock::Lockstep)]);
            }
            let ticks = if state == State::Stopping {
                STOP_TICKS
            } else {
                self.session.command(&Request::Abort)?;
                1
            };
            state = self.pass(ticks)?.state;
        }
        let what = format!("a run does not end: {}", state.name());
        Err(BudgetError::Figures(what))
    }

    /// Loads a job, and runs its first ticks.
    ///
    /// # Errors
    /// The board refuses the job, the line breaks, or the records are not whole.
    pub fn run(&mut self, job: &Prepared, ticks: u32) -> Result<Run, BudgetError> {
        self.settle()?;
        drive::upload(&mut self.session, job, |_| {})?;
        self.again(Report::Digests, ticks)
    }

    /// Runs the first ticks of the loaded job.
    fn again(&mut self, report: Report, ticks: u32) -> Result<Run, BudgetError> {
        self.settle()?;
        self.commands(&[Request::Report(report)])?;
        self.take()?;
        self.commands(&[Request::Start])?;
        let status = self.pass(ticks)?;
        let records = self.take()?;
        let run = Run {
            records,
            samples: status.samples,
            fault: status.fault.map(|fault| fault_name(&fault)),
        };
        let counted = run.records.iter().filter(|record| yields_sample(record)).count();
        if counted != run.samples as usize {
            let what = format!("{counted} ticks with a sample, the board made {}", run.samples);
            return Err(BudgetError::Figures(what));
        }
        Ok(run)
    }

    /// The worst tick of the loaded job, of which this was a run: as it was in the run, or with all that can come
    /// together with it.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn worst(&mut self, run: &Run) -> Result<Worst, BudgetError> {
        let mut ticks = run.numbered();
        let cycles = |record: &Record| whole(record, Model::Pessimistic);
        ticks.sort_by_key(|(_, record)| std::cmp::Reverse(cycles(record)));
        let mut worst = Worst::default();
        for (tick, record) in ticks.iter().take(TRIED) {
            let plain = Worst {
                record: *record,
                tick: *tick,
                events: events(record, run, *tick),
            };
            let crowded = self.crowded(*tick)?;
            for found in [plain, crowded] {
                if cycles(&found.record) > cycles(&worst.record) {
                    worst = found;
                }
            }
        }
        Ok(worst)
    }

    /// Runs up to a tick, holds, and lets the tick come with a resume, a command and the end of the credit.
    fn crowded(&mut self, tick: u32) -> Result<Worst, BudgetError> {
        if tick == 0 {
            self.settle()?;
        } else {
            self.again(Report::Samples, tick)?;
            self.commands(&[Request::Hold])?;
            self.pass(1)?;
        }
        self.take()?;
        let begin = if tick == 0 {
            Request::Start
        } else {
            Request::Resume
        };
        self.commands(&[Request::Report(Report::Samples), begin])?;
        let status = self.pass(1)?;
        let records = self.take()?;
        let run = Run {
            records,
            samples: 0,
            fault: status.fault.map(|fault| fault_name(&fault)),
        };
        let worst = run
            .records
            .iter()
            .max_by_key(|record| whole(record, Model::Pessimistic))
            .copied()
            .unwrap_or_default();
        let mut events = events(&worst, &run, 0);
        events.extend([
            if tick == 0 {
                "the start"
            } else {
                "a resume from a hold"
            },
            "a command",
            "the end of the run's ticks",
        ]);
        Ok(Worst {
            record: worst,
            tick,
            events,
        })
    }
}

/// What happened in a tick.
fn events(record: &Record, run: &Run, tick: u32) -> Vec<&'static str> {
    let mut events = Vec::new();
    let took = |stage: Stage| record.stages[stage as usize].nominal > 0;
    if took(Stage::PassChange) {
        events.push("a change of pass");
    }
    if took(Stage::PatchChange) {
        events.push("a change of patch");
    }
    if yields_sample(record) {
        events.push("a sample");
    } else if let Some(fault) = run.fault.filter(|_| tick == run.samples) {
        events.push(fault);
    } else {
        events.push("no sample");
    }
    events
}
