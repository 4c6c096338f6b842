//! A session with the firmware in QEMU under the plugin: runs any number of jobs, and finds the worst-case tick of each.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use cycle_plugin::cost::Cycles;
use cycle_plugin::plan::Stage;
use cycle_plugin::record::{RECORD_BYTES, Record};
use fastrand::Rng;
use interp_core::{FaultKind, State};
use protocol::message::{Clock, Configuration, FaultReport, Report, Request, Status};

use super::BudgetError;
use super::figures::{Model, planning_cycles, tick_cycles};
use super::measure::{MeasurementSetup, yields_sample};
use machine::prepare::Prepared;
use machine::remote::operate::{self, Setup};
use machine::remote::qemu::Qemu;
use machine::remote::session::Event;
use machine::remote::{RemoteError, Session, drive};

/// Number of a run's costliest ticks that are repeated with coincident events.
const REPEATED_TICKS: usize = 2;

/// Ticks of one wait for a stop.
const STOP_TICKS: u32 = 10_000;
/// Largest number of waits for a stop: ten minutes of machine time together.
const STOP_WAITS: u32 = 60;

/// Ticks with random operator commands.
const OPERATOR_TICKS: u32 = 4500;
/// Largest number of ticks between two random commands.
const PAUSE_MAX: u32 = 24;
/// Seed of the random commands.
const OPERATOR_SEED: u64 = 7;

/// Ticks without commands after a start: the look-ahead of the first pass.
const LOOK_AHEAD_TICKS: u32 = 3000;

/// QEMU, the connection to the board in it, and the plugin's records.
pub struct MeasurementSession {
    session: Session,
    records: File,
    /// The bytes of an incomplete record.
    rest: Vec<u8>,
    stack_end: u32,
    stack_low: u32,
    /// Greatest cycles of a portion of the planning task so far, pessimistic model.
    planning_cycles_max: u32,
    /// Least cycles of [`Stage::Rest`] in a tick so far.
    idle: Option<Cycles>,
    _qemu: Qemu,
    _folder: tempfile::TempDir,
}

/// The records of a run.
#[derive(Clone, Debug, Default)]
pub struct RunRecords {
    /// Every tick from the start to the end, including those in which no time passes.
    pub records: Vec<Record>,
    /// Samples of the run.
    pub samples: u32,
    /// Name of the fault that ended it.
    pub fault: Option<&'static str>,
}

/// The worst-case tick of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorstTick {
    /// Its record.
    pub record: Record,
    /// Index: the number of samples before it.
    pub tick: u32,
    /// Events in it.
    pub events: Vec<&'static str>,
}

impl RunRecords {
    /// Greatest number of cycles of a tick, pessimistic model.
    #[must_use]
    pub fn cycles_max(&self) -> u32 {
        let cycles = self
            .records
            .iter()
            .map(|record| tick_cycles(record, Model::Pessimistic));
        cycles.max().unwrap_or(0)
    }

    /// Each tick with its index.
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

/// Name of a fault; a fault of another version has none.
fn fault_name(fault: &FaultReport) -> &'static str {
    fault.kind().map_or("a fault", FaultKind::name)
}

fn has_limits(job: &Prepared) -> bool {
    job.header.axes.is_some()
}

/// A random request of an operator in this state.
fn operator_request(random: &mut Rng, state: State) -> Request {
    if !state.is_under_way() {
        return match state {
            State::Faulted => Request::Abort,
            _ => Request::Start,
        };
    }
    match random.u8(..=u8::MAX) {
        0..64 => Request::Hold,
        64..152 => Request::Resume,
        // Rare: the look-ahead starts again after it.
        152 => Request::Stop,
        153 => Request::Abort,
        _ => Request::Override {
            percent: random.u8(..=200),
        },
    }
}

fn file_error(path: &Path, error: &std::io::Error) -> BudgetError {
    BudgetError::File(path.into(), error.to_string())
}

impl MeasurementSession {
    /// Starts QEMU.
    ///
    /// # Errors
    /// It does not start, or the board does not answer.
    pub fn new(setup: &MeasurementSetup) -> Result<Self, BudgetError> {
        let here = Path::new("a temporary file");
        let folder = tempfile::tempdir().map_err(|error| file_error(here, &error))?;
        let (arguments, records) = setup.plugin(folder.path())?;
        let (qemu, stream) = Qemu::start_with(setup.image(), &arguments)?;
        let mut session = Session::open(stream, 1)?;
        // A request within a measured tick would be a part of it.
        session.set_quiet(true);
        operate::make_ready(&mut session, &Setup::simulated(Configuration::DEFAULT))?;
        Ok(Self {
            session,
            records: File::open(&records).map_err(|error| file_error(&records, &error))?,
            rest: Vec::new(),
            stack_end: setup.stack_end(),
            stack_low: setup.stack_end(),
            planning_cycles_max: 0,
            idle: None,
            _qemu: qemu,
            _folder: folder,
        })
    }

    /// High-water mark of the stack since the beginning, bytes.
    #[must_use]
    pub fn stack_bytes(&self) -> u32 {
        self.stack_end.saturating_sub(self.stack_low)
    }

    /// Greatest cycles of a portion of the planning task since the beginning, pessimistic model.
    #[must_use]
    pub const fn planning_cycles_max(&self) -> u32 {
        self.planning_cycles_max
    }

    /// Reads the records of the sample task since the last call; of those of the planning task the worst is kept.
    fn read_records(&mut self) -> Result<Vec<Record>, BudgetError> {
        let here = Path::new("the plugin's records");
        self.records
            .read_to_end(&mut self.rest)
            .map_err(|error| file_error(here, &error))?;
        let whole = self.rest.len() / RECORD_BYTES * RECORD_BYTES;
        let mut records = Record::read_all(&self.rest[..whole]);
        self.rest.drain(..whole);
        if let Some(last) = records.last() {
            self.stack_low = last.stack_low;
            if last.unknown > 0 {
                let what = format!("{} instructions are unknown to the decoder", last.unknown);
                return Err(BudgetError::Figures(what));
            }
        }
        let planning = records.iter().filter(|record| record.is_planning);
        let worst = planning.map(|record| planning_cycles(record, Model::Pessimistic));
        self.planning_cycles_max = worst.fold(self.planning_cycles_max, u32::max);
        records.retain(|record| !record.is_planning);
        Ok(records)
    }

    /// Cycles that a command costs: those of the worst-case tick before the first sample, less those of the cheapest idle tick. In
    /// lockstep no period passes in a tick with a command; with the board's own clock a period does.
    fn command_cycles(&mut self, records: &[Record]) -> Cycles {
        let rest = |record: &Record| record.stages[Stage::Rest as usize];
        let Some(first) = records.iter().position(yields_sample) else {
            return Cycles::default();
        };
        let before = records.iter().take(first);
        let (mut least, mut most) = (self.idle.unwrap_or(Cycles::both(u32::MAX)), Cycles::default());
        for record in before.filter(|record| record.is_idle()) {
            let Cycles { nominal, pessimistic } = rest(record);
            least.nominal = least.nominal.min(nominal);
            least.pessimistic = least.pessimistic.min(pessimistic);
            most.nominal = most.nominal.max(nominal);
            most.pessimistic = most.pessimistic.max(pessimistic);
        }
        self.idle = Some(least);
        Cycles {
            nominal: most.nominal.saturating_sub(least.nominal),
            pessimistic: most.pessimistic.saturating_sub(least.pessimistic),
        }
    }

    fn commands(&mut self, requests: &[Request]) -> Result<(), BudgetError> {
        for request in requests {
            self.session.command(request)?;
        }
        Ok(())
    }

    /// Sends a request; whether the board accepted it, which depends on its state.
    fn try_command(&mut self, request: &Request) -> Result<bool, BudgetError> {
        match self.session.command(request) {
            Ok(()) => Ok(true),
            Err(RemoteError::Refused { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Runs `ticks` periods.
    fn run_ticks(&mut self, ticks: u32) -> Result<Status, BudgetError> {
        self.session.command(&Request::Run { ticks })?;
        loop {
            if let Event::Halted(status) = self.session.event()? {
                return Ok(status);
            }
        }
    }

    /// Aborts the run. On a machine with limits the tool first decelerates along its path, and a fault that stopped it has to be
    /// acknowledged. Switching the drives off discards the position, so that each run begins at its job's home and is reproducible.
    fn end_run(&mut self) -> Result<(), BudgetError> {
        let mut state = self.session.status()?.state;
        for _ in 0..STOP_WAITS {
            if matches!(state, State::Idle | State::Ready | State::Finished) {
                return self.commands(&[
                    Request::Clock(Clock::Lockstep),
                    Request::Drives { on: false },
                    Request::Drives { on: true },
                ]);
            }
            let ticks = if state == State::Stopping {
                STOP_TICKS
            } else {
                self.session.command(&Request::Abort)?;
                1
            };
            state = self.run_ticks(ticks)?.state;
        }
        let what = format!("a run does not end: {}", state.name());
        Err(BudgetError::Figures(what))
    }

    /// Loads a job and runs its first ticks.
    ///
    /// # Errors
    /// The board refuses the job, the connection breaks, or records are missing.
    pub fn run(&mut self, job: &Prepared, ticks: u32) -> Result<RunRecords, BudgetError> {
        self.end_run()?;
        drive::upload(&mut self.session, job, |_| {})?;
        self.restart(Report::Digests, ticks)
    }

    /// Runs the first ticks of the loaded job.
    fn restart(&mut self, report: Report, ticks: u32) -> Result<RunRecords, BudgetError> {
        self.end_run()?;
        self.commands(&[Request::Report(report)])?;
        self.read_records()?;
        self.commands(&[Request::Start])?;
        let status = self.run_ticks(ticks)?;
        let records = self.read_records()?;
        let run = RunRecords {
            records,
            samples: status.samples,
            fault: status.fault.map(|fault| fault_name(&fault)),
        };
        let counted = run.records.iter().filter(|record| yields_sample(record)).count();
        if counted != run.samples as usize {
            let what = format!(
                "{counted} ticks with a sample, but the board reports {} samples",
                run.samples
            );
            return Err(BudgetError::Figures(what));
        }
        Ok(run)
    }

    /// The worst-case tick of the loaded job, given a run of it: as in the run, or repeated with coincident events, or, with limits,
    /// under random commands of an operator.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn worst_tick(&mut self, job: &Prepared, run: &RunRecords) -> Result<WorstTick, BudgetError> {
        let mut ticks = run.numbered();
        let cycles = |record: &Record| tick_cycles(record, Model::Pessimistic);
        ticks.sort_by_key(|(_, record)| std::cmp::Reverse(cycles(record)));
        let mut worst = WorstTick::default();
        // With limits a run takes long, and the operator's commands follow.
        let repeated = if has_limits(job) { 1 } else { REPEATED_TICKS };
        for (tick, record) in ticks.iter().take(repeated) {
            let plain = WorstTick {
                record: *record,
                tick: *tick,
                events: events(record, run, *tick),
            };
            let coincident = self.coincident(job, *tick)?;
            for found in [plain, coincident] {
                if cycles(&found.record) > cycles(&worst.record) {
                    worst = found;
                }
            }
        }
        if has_limits(job) {
            let found = self.under_operator()?;
            if cycles(&found.record) > cycles(&worst.record) {
                worst = found;
            }
        }
        Ok(worst)
    }

    /// Runs the loaded job, which has limits, under random commands of an operator: hold, resume, override, stop, abort. The
    /// worst-case tick.
    fn under_operator(&mut self) -> Result<WorstTick, BudgetError> {
        let mut random = Rng::with_seed(OPERATOR_SEED);
        self.end_run()?;
        self.commands(&[Request::Report(Report::Samples)])?;
        self.read_records()?;
        let mut worst = WorstTick::default();
        let (mut ticks, mut state) = (0, State::Ready);
        while ticks < OPERATOR_TICKS {
            let request = operator_request(&mut random, state);
            let starts = request == Request::Start;
            // A refused request was valid in an earlier state.
            self.try_command(&request)?;
            let pause = random.u32(1..=PAUSE_MAX);
            state = self.run_ticks(pause)?.state;
            if starts {
                // Reporting samples would take as long as the run.
                self.commands(&[Request::Report(Report::Digests)])?;
                state = self.run_ticks(LOOK_AHEAD_TICKS)?.state;
                ticks += LOOK_AHEAD_TICKS;
                self.commands(&[Request::Report(Report::Samples)])?;
            }
            let records = self.read_records()?;
            let command_cycles = self.command_cycles(&records);
            for (passed, record) in (0..).zip(records) {
                let record = with_command(record, command_cycles);
                let cycles = |record: &Record| tick_cycles(record, Model::Pessimistic);
                if cycles(&record) > cycles(&worst.record) {
                    let mut events = events(&record, &RunRecords::default(), 0);
                    events.push("an operator's command");
                    worst = WorstTick {
                        record,
                        tick: ticks + passed,
                        events,
                    };
                }
            }
            ticks += pause;
        }
        Ok(worst)
    }

    /// Runs up to a tick, holds, and repeats the tick together with a resume and a command; with limits, where a hold takes many
    /// ticks, together with the hold. Zero cycles if the run has ended by then or is stopping because of a fault.
    fn coincident(&mut self, job: &Prepared, tick: u32) -> Result<WorstTick, BudgetError> {
        let limited = has_limits(job);
        if tick == 0 {
            self.end_run()?;
        } else {
            self.restart(Report::Digests, tick)?;
            if !limited {
                self.commands(&[Request::Report(Report::Samples)])?;
                if !self.try_command(&Request::Hold)? {
                    return Ok(WorstTick::default());
                }
                self.run_ticks(1)?;
            }
        }
        self.read_records()?;
        let (begin, name) = match tick {
            0 => (Request::Start, "the start"),
            _ if limited => (Request::Hold, "a hold"),
            _ => (Request::Resume, "a resume from a hold"),
        };
        self.commands(&[Request::Report(Report::Samples)])?;
        if !self.try_command(&begin)? {
            return Ok(WorstTick::default());
        }
        let status = self.run_ticks(1)?;
        let records = self.read_records()?;
        let run = RunRecords {
            records,
            samples: 0,
            fault: status.fault.map(|fault| fault_name(&fault)),
        };
        let command_cycles = self.command_cycles(&run.records);
        let worst = run
            .records
            .iter()
            .max_by_key(|record| tick_cycles(record, Model::Pessimistic))
            .copied()
            .unwrap_or_default();
        let worst = with_command(worst, command_cycles);
        let mut events = events(&worst, &run, 0);
        events.extend([name, "a command"]);
        Ok(WorstTick {
            record: worst,
            tick,
            events,
        })
    }
}

/// The record of a tick that also executes a command.
fn with_command(mut record: Record, command_cycles: Cycles) -> Record {
    let rest = &mut record.stages[Stage::Rest as usize];
    rest.nominal += command_cycles.nominal;
    rest.pessimistic += command_cycles.pessimistic;
    record
}

/// Events in a tick.
fn events(record: &Record, run: &RunRecords, tick: u32) -> Vec<&'static str> {
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
