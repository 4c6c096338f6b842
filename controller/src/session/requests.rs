//! The requests of a session, carried out.

use interp_core::{RunStart, command::Command, job::Header, sample::State};
use protocol::message::{
    Activity, Clock, Excess, OVERRIDE_MAX_PERCENT, ProfileLimit, Reason, Reply, Request, SpindleOrder,
    Status, job_mark,
};

use super::{
    Session,
    jobs::{delete_job, stored_job},
    kept::{beyond, configure, has_other_steps, own_steps},
};
use crate::{
    machine::{Busy, Instruction, Machine},
    manual::{Motion, ProbeMove},
    safety::{Order, may_go_on},
    upload::Upload,
};

impl Session {
    /// Answers a question, or executes a request.
    #[inline(never)]
    pub(super) fn answer(
        &mut self,
        number: u16,
        request: &Request,
        machine: &mut impl Machine,
        out: &mut impl FnMut(&[u8]),
    ) -> Reply {
        match *request {
            Request::Status => Reply::Status {
                number,
                status: self.complete_with_steps(machine),
            },
            Request::Profile => Reply::Profile {
                number,
                profile: machine.profile().copied(),
            },
            Request::Motion => Reply::Motion {
                number,
                motion: machine.motion(),
            },
            Request::Journal => Reply::Journal {
                number,
                journal: machine.journal(),
            },
            Request::Offsets => Reply::Offsets {
                number,
                offsets: machine.offsets(),
            },
            Request::StoredJob { index } => stored_job(number, index, machine),
            _ => match self.execute(request, machine, out) {
                Ok(()) => Reply::Ack { number },
                Err(reason) => Reply::Nak { number, reason },
            },
        }
    }

    /// Executes a request that is no question.
    ///
    /// # Errors
    /// The reason of the refusal.
    // Inlined into its only caller, because the checks of a streamed row below it need all of the stack.
    #[inline(always)]
    fn execute(
        &mut self,
        request: &Request,
        machine: &mut impl Machine,
        out: &mut impl FnMut(&[u8]),
    ) -> Result<(), Reason> {
        if needs_rest(request) {
            no_motion(machine)?;
        }
        if is_of_start(request) && (self.command_waits(machine) || machine.start_waits()) {
            return Err(Reason::Busy);
        }
        match *request {
            Request::SetProfile(ref profile) => self.set_profile(machine, profile.as_ref()),
            Request::SetOffsets(ref offsets) => self.set_offsets(machine, offsets),
            Request::Jog { way, speed_mm_s } => machine.order(Order::Move(Motion::Jog { way, speed_mm_s })),
            Request::Probe { axis, nm, speed_mm_s } => {
                machine.order(Order::Move(Motion::Probe(ProbeMove { axis, nm, speed_mm_s })))
            }
            Request::Spindle(order) => self.order_spindle(machine, order),
            Request::Turn { turning, rpm } => machine.order(Order::Turn { turning, rpm }),
            Request::Coolant { on } => machine.order(Order::Coolant { on }),
            Request::StoreJob {
                ref name,
                begins_anywhere,
            } => self.store_job(machine, name, begins_anywhere),
            Request::DeleteJob { ref name } => delete_job(machine, name),
            Request::StartJob { ref name, resumes } => self.start_job(machine, Some(name), resumes),
            Request::Home { axes } => machine.order(Order::Move(Motion::Home { axes })),
            Request::JobBegin {
                ref header,
                words,
                digest,
            } => self.job_begin(machine, header, words, digest),
            Request::JobChunk { offset, ref words } => match &mut self.upload {
                Some(upload) => upload.chunk(machine, offset, words.as_slice()),
                None => Err(Reason::NoUpload),
            },
            Request::JobEnd => self.job_end(machine),
            Request::Start
            | Request::Hold
            | Request::Resume
            | Request::Abort
            | Request::Stop
            | Request::Pause => match request.command() {
                Some(command) => self.operate(machine, command, RunStart::FIRST),
                None => Err(Reason::Unreadable),
            },
            Request::StartAt(start) => self.operate(machine, Command::Start, start),
            Request::Override { percent } => set_override(machine, percent),
            Request::Configure(configuration) => configure(machine, configuration),
            Request::Drives { on } => machine.order(Order::Drives { on }),
            Request::SetHome { home_nm } => machine.order(Order::SetHome { home_nm }),
            Request::Acknowledge => machine.order(Order::Acknowledge),
            Request::Simulate { lines } if machine.simulate(lines) => Ok(()),
            Request::Simulate { .. } => Err(Reason::Unsupported),
            Request::Clock(clock) => self.set_clock(machine, clock),
            Request::Run { .. } if self.clock != Clock::Lockstep => {
                Err(Reason::WrongClock { clock: self.clock })
            }
            Request::Run { ticks } => instruct(machine, Instruction::Run { ticks }),
            Request::Report(report) => instruct(machine, Instruction::Report(report)),
            Request::StepConfig(settings) if has_other_steps(machine, settings) => {
                Err(beyond(Excess::of(ProfileLimit::Steps)))
            }
            Request::StepConfig(settings) => self.set_steps(machine, settings.into()),
            Request::Repeat { event, count } if self.events.repeat(event, count, out) => Ok(()),
            Request::Repeat { .. } => Err(Reason::EventGone {
                first: self.events.first(),
            }),
            // Answered by the callers.
            Request::Hello { .. }
            | Request::Status
            | Request::Profile
            | Request::Motion
            | Request::Journal
            | Request::Offsets
            | Request::StoredJob { .. } => Err(Reason::Unreadable),
        }
    }

    /// Whether a command of the session is still queued.
    fn command_waits(&mut self, machine: &mut impl Machine) -> bool {
        self.commanded = self.commanded && machine.instructions_wait();
        self.commanded
    }

    /// Refuses while commands for the previous job are queued.
    #[inline(never)]
    pub(super) fn job_begin(
        &mut self,
        machine: &mut impl Machine,
        header: &Header,
        words: u32,
        digest: u64,
    ) -> Result<(), Reason> {
        if self.command_waits(machine) {
            return Err(Reason::Busy);
        }
        if let (Some(profile), Some(axes)) = (machine.profile(), &header.axes)
            && let Some(excess) = profile.exceeded_by(axes)
        {
            return Err(beyond(excess));
        }
        self.commanded = false;
        self.spindle = SpindleOrder::OFF;
        let upload = Upload::begin(machine, header, words, digest)?;
        self.forget_places(machine);
        self.job = (header.axes.is_some() && !upload.is_streamed()).then(|| job_mark(header, digest));
        self.upload = Some(upload);
        self.is_outdated = false;
        // Those of the job before are not for this one.
        let own = own_steps(machine);
        self.set_steps(machine, own)
    }

    #[inline(never)]
    pub(super) fn job_end(&mut self, machine: &mut impl Machine) -> Result<(), Reason> {
        let upload = self.upload.as_ref().ok_or(Reason::NoUpload)?;
        if upload.is_streamed() {
            return upload.finish(machine);
        }
        upload.check_complete()?;
        let finished = upload.finish(machine);
        self.upload = None;
        finished
    }

    /// Queues a command if the state permits it. `start`: where a start begins.
    #[inline(never)]
    pub(super) fn operate(
        &mut self,
        machine: &mut impl Machine,
        command: Command,
        start: RunStart,
    ) -> Result<(), Reason> {
        let ends = matches!(
            command,
            Command::Hold | Command::Stop | Command::Abort | Command::Pause
        );
        let activity = machine.motion().activity;
        let Status { state, safety, .. } = machine.status();
        if ends && activity != Activity::Rest && !state.is_under_way() {
            return machine.order(Order::Move(Motion::Stop));
        }
        let takes_back = command == Command::Hold && state == State::Held && activity == Activity::SpinUp;
        if !command.is_allowed(state) && !takes_back {
            return Err(Reason::WrongState { state });
        }
        if command == Command::Resume {
            may_go_on(&safety, state)?;
        }
        if command == Command::Start {
            if self.is_outdated {
                return Err(Reason::OtherProfile);
            }
            machine.may_start()?;
            if !start.is_first() {
                machine.order(Order::BeginAt(start))?;
            }
        }
        let sent = instruct(machine, Instruction::Command(command));
        if sent.is_err() && !start.is_first() {
            machine.order(Order::BeginAt(RunStart::FIRST))?;
        }
        sent?;
        if command == Command::Start {
            self.journal_start(machine, start);
        }
        self.commanded = true;
        Ok(())
    }

    /// A change of the clock during a motion would be a velocity step of the axes.
    fn set_clock(&mut self, machine: &mut impl Machine, clock: Clock) -> Result<(), Reason> {
        no_run(machine)?;
        if self.command_waits(machine) {
            return Err(Reason::Busy);
        }
        instruct(machine, Instruction::Clock(clock))?;
        self.clock = clock;
        Ok(())
    }
}

/// Whether the axes must not move outside a job while the request is carried out.
const fn needs_rest(request: &Request) -> bool {
    matches!(
        request,
        Request::JobBegin { .. }
            | Request::Start
            | Request::StartAt(_)
            | Request::Clock(_)
            | Request::StepConfig(_)
            | Request::SetProfile(_)
            | Request::SetOffsets(_)
            | Request::Spindle(_)
            | Request::StoreJob { .. }
            | Request::DeleteJob { .. }
            | Request::StartJob { .. }
    )
}

/// Whether the request changes what a start is checked by, or what it starts with.
const fn is_of_start(request: &Request) -> bool {
    matches!(
        request,
        Request::SetProfile(_) | Request::SetOffsets(_) | Request::Spindle(_) | Request::StepConfig(_)
    )
}

/// Refuses while a run is under way.
#[inline(never)]
pub(super) fn no_run(machine: &mut impl Machine) -> Result<(), Reason> {
    let state = machine.status().state;
    if state.is_under_way() {
        return Err(Reason::WrongState { state });
    }
    Ok(())
}

/// Refuses while the axes move outside a job, or a start waits for the spindle. What a resume that waits refuses, the run under way does.
#[inline(never)]
fn no_motion(machine: &mut impl Machine) -> Result<(), Reason> {
    if machine.motion().activity == Activity::Rest || machine.status().state.is_under_way() {
        return Ok(());
    }
    Err(Reason::Moving)
}

fn set_override(machine: &mut impl Machine, percent: u8) -> Result<(), Reason> {
    if percent > OVERRIDE_MAX_PERCENT {
        return Err(Reason::OutOfRange {
            most: OVERRIDE_MAX_PERCENT.into(),
            wanted: percent.into(),
        });
    }
    instruct(machine, Instruction::Override { percent })
}

fn instruct(machine: &mut impl Machine, instruction: Instruction) -> Result<(), Reason> {
    machine.send(instruction).map_err(|Busy| Reason::Busy)
}
