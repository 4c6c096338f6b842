//! One QEMU with the plugin for many jobs: runs them, and finds the worst tick of each.

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
use super::figures::{Model, whole};
use super::measure::{Bench, yields_sample};
use machine::prepare::Prepared;
use machine::remote::operate::{self, Setup};
use machine::remote::qemu::Qemu;
use machine::remote::session::Event;
use machine::remote::{RemoteError, Session, drive};

/// Ticks of a run that are tried with all that can come together.
const TRIED: usize = 2;

/// Ticks that a stop is waited for at a time, and how often: ten minutes of it.
const STOP_TICKS: u32 = 10_000;
const SETTLE_ROUNDS: u32 = 60;

/// Periods in which an operator disturbs a run, those between two commands at most, and the seed of what comes when.
const DISTURBED_TICKS: u32 = 4500;
const PAUSE_MAX: u32 = 24;
const DISTURBED_SEED: u64 = 7;

/// Periods after a start that are left alone: the first pass is looked over.
const WAIT_TICKS: u32 = 3000;

/// QEMU, the line to the board in it, and what the plugin writes.
pub struct Lab {
    session: Session,
    records: File,
    /// A record that has been written in part.
    rest: Vec<u8>,
    stack_end: u32,
    stack_low: u32,
    /// Cycles of everything else in the cheapest tick so far.
    idle: Option<Cycles>,
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

fn has_limits(job: &Prepared) -> bool {
    job.header.axes.is_some()
}

/// What an operator may do next.
fn operators(random: &mut Rng, state: State) -> Request {
    if !state.is_under_way() {
        return match state {
            State::Faulted => Request::Abort,
            _ => Request::Start,
        };
    }
    match random.u8(..=u8::MAX) {
        0..64 => Request::Hold,
        64..152 => Request::Resume,
        // Seldom: what follows is looked over anew.
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

    /// What it takes to obey a command: the dearest of the ticks before the first with a sample, over the cheapest tick that there was. In
    /// lockstep no period passes in a tick with a command; on the board's own clock one does.
    fn obeying(&mut self, records: &[Record]) -> Cycles {
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

    /// Sends a request, and says whether the board took it: some states refuse it.
    fn is_taken(&mut self, request: &Request) -> Result<bool, BudgetError> {
        match self.session.command(request) {
            Ok(()) => Ok(true),
            Err(RemoteError::Refused { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
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
    /// fault is left to be acknowledged. Where the tool then is gets lost with the drives: each run begins at its job's home, and is
    /// the same again.
    fn settle(&mut self) -> Result<(), BudgetError> {
        let mut state = self.session.status()?.state;
        for _ in 0..SETTLE_ROUNDS {
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

    /// The worst tick of this job, of which this was a run and which is loaded: as it was in the run, with all that can come
    /// together with it, or, with limits, while an operator does this and that.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn worst(&mut self, job: &Prepared, run: &Run) -> Result<Worst, BudgetError> {
        let mut ticks = run.numbered();
        let cycles = |record: &Record| whole(record, Model::Pessimistic);
        ticks.sort_by_key(|(_, record)| std::cmp::Reverse(cycles(record)));
        let mut worst = Worst::default();
        // With limits an operator's doings come on top, and each run takes long.
        let tried = if has_limits(job) { 1 } else { TRIED };
        for (tick, record) in ticks.iter().take(tried) {
            let plain = Worst {
                record: *record,
                tick: *tick,
                events: events(record, run, *tick),
            };
            let crowded = self.crowded(job, *tick)?;
            for found in [plain, crowded] {
                if cycles(&found.record) > cycles(&worst.record) {
                    worst = found;
                }
            }
        }
        if has_limits(job) {
            let found = self.disturbed()?;
            if cycles(&found.record) > cycles(&worst.record) {
                worst = found;
            }
        }
        Ok(worst)
    }

    /// Runs the loaded job, which has limits, with an operator who holds, resumes, overrides, stops and aborts it at any moment; the
    /// worst tick of that.
    fn disturbed(&mut self) -> Result<Worst, BudgetError> {
        let mut random = Rng::with_seed(DISTURBED_SEED);
        self.settle()?;
        self.commands(&[Request::Report(Report::Samples)])?;
        self.take()?;
        let mut worst = Worst::default();
        let (mut ticks, mut state) = (0, State::Ready);
        while ticks < DISTURBED_TICKS {
            let request = operators(&mut random, state);
            let starts = request == Request::Start;
            // Where it is refused, it was about a state that is over.
            self.is_taken(&request)?;
            let pause = random.u32(1..=PAUSE_MAX);
            state = self.pass(pause)?.state;
            if starts {
                // Its samples are of no use: what is reported takes as long as what is run.
                self.commands(&[Request::Report(Report::Digests)])?;
                state = self.pass(WAIT_TICKS)?.state;
                ticks += WAIT_TICKS;
                self.commands(&[Request::Report(Report::Samples)])?;
            }
            let records = self.take()?;
            let obeying = self.obeying(&records);
            for (passed, record) in (0..).zip(records) {
                let record = with_command(record, obeying);
                let cycles = |record: &Record| whole(record, Model::Pessimistic);
                if cycles(&record) > cycles(&worst.record) {
                    let mut happened = events(&record, &Run::default(), 0);
                    happened.push("an operator's doing");
                    worst = Worst {
                        record,
                        tick: ticks + passed,
                        events: happened,
                    };
                }
            }
            ticks += pause;
        }
        Ok(worst)
    }

    /// Runs up to a tick, holds, and lets the tick come with a resume and a command. With limits a hold takes its
    /// time: there the tick comes with the hold. Nothing where the run is over by then, or is stopping because of a fault.
    fn crowded(&mut self, job: &Prepared, tick: u32) -> Result<Worst, BudgetError> {
        let limited = has_limits(job);
        if tick == 0 {
            self.settle()?;
        } else {
            self.again(Report::Digests, tick)?;
            if !limited {
                self.commands(&[Request::Report(Report::Samples)])?;
                if !self.is_taken(&Request::Hold)? {
                    return Ok(Worst::default());
                }
                self.pass(1)?;
            }
        }
        self.take()?;
        let (begin, name) = match tick {
            0 => (Request::Start, "the start"),
            _ if limited => (Request::Hold, "a hold"),
            _ => (Request::Resume, "a resume from a hold"),
        };
        self.commands(&[Request::Report(Report::Samples)])?;
        if !self.is_taken(&begin)? {
            return Ok(Worst::default());
        }
        let status = self.pass(1)?;
        let records = self.take()?;
        let run = Run {
            records,
            samples: 0,
            fault: status.fault.map(|fault| fault_name(&fault)),
        };
        let obeying = self.obeying(&run.records);
        let worst = run
            .records
            .iter()
            .max_by_key(|record| whole(record, Model::Pessimistic))
            .copied()
            .unwrap_or_default();
        let worst = with_command(worst, obeying);
        let mut events = events(&worst, &run, 0);
        events.extend([name, "a command"]);
        Ok(Worst {
            record: worst,
            tick,
            events,
        })
    }
}

/// A tick in which a command is obeyed, too.
fn with_command(mut record: Record, obeying: Cycles) -> Record {
    let rest = &mut record.stages[Stage::Rest as usize];
    rest.nominal += obeying.nominal;
    rest.pessimistic += obeying.pessimistic;
    record
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
