//! The requests of a session, carried out.

use interp_core::{command::Command, job::Header};
use protocol::message::{
    Activity, Clock, Excess, OVERRIDE_MAX_PERCENT, ProfileLimit, Reason, Reply, Request, Status, job_mark,
};

use super::{
    Session,
    kept::{beyond, configure, has_other_steps, own_steps},
};
use crate::{
    machine::{Busy, Instruction, Machine},
    manual::Motion,
    safety::{Order, may_resume},
    upload::Upload,
};

impl Session {
    /// Executes a request.
    #[inline(never)]
    pub(super) fn answer(
        &mut self,
        number: u16,
        request: &Request,
        machine: &mut impl Machine,
        out: &mut impl FnMut(&[u8]),
    ) -> Reply {
        let done = match *request {
            Request::Status => {
                return Reply::Status {
                    number,
                    status: self.complete_with_steps(machine),
                };
            }
            Request::Profile => {
                return Reply::Profile {
                    number,
                    profile: machine.profile(),
                };
            }
            Request::Motion => {
                return Reply::Motion {
                    number,
                    motion: machine.motion(),
                };
            }
            Request::Journal => {
                return Reply::Journal {
                    number,
                    journal: machine.journal(),
                };
            }
            Request::Offsets => {
                return Reply::Offsets {
                    number,
                    offsets: machine.offsets(),
                };
            }
            _ if needs_rest(request) && machine.motion().activity != Activity::Rest => Err(Reason::Moving),
            Request::SetProfile(ref profile) => self.set_profile(machine, profile.as_ref()),
            Request::SetOffsets(ref offsets) => self.set_offsets(machine, offsets),
            Request::Jog { way, speed_mm_s } => machine.order(Order::Move(Motion::Jog { way, speed_mm_s })),
            Request::Probe { axis, nm, speed_mm_s } => {
                machine.order(Order::Move(Motion::Probe { axis, nm, speed_mm_s }))
            }
            Request::Spindle(order) => machine.order(Order::Spindle(order)),
            Request::Turn { turning, rpm } => machine.order(Order::Turn { turning, rpm }),
            Request::Coolant { on } => machine.order(Order::Coolant { on }),
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
                Some(command) => self.operate(machine, command, 0),
                None => Err(Reason::Unreadable),
            },
            Request::StartAt { pass } => self.operate(machine, Command::Start, pass),
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
            // Answered by the caller.
            Request::Hello { .. } => Err(Reason::Unreadable),
        };
        match done {
            Ok(()) => Reply::Ack { number },
            Err(reason) => Reply::Nak { number, reason },
        }
    }

    /// Refuses while commands for the previous job are queued.
    #[inline(never)]
    fn job_begin(
        &mut self,
        machine: &mut impl Machine,
        header: &Header,
        words: u32,
        digest: u64,
    ) -> Result<(), Reason> {
        if self.commanded && machine.instructions_wait() {
            return Err(Reason::Busy);
        }
        let profile = machine.profile();
        if let (Some(profile), Some(axes)) = (profile, &header.axes)
            && let Some(excess) = profile.exceeded_by(axes)
        {
            return Err(beyond(excess));
        }
        self.commanded = false;
        let upload = Upload::begin(machine, header, words, digest)?;
        self.job = (header.axes.is_some() && !upload.is_streamed()).then(|| job_mark(header, digest));
        self.upload = Some(upload);
        self.is_outdated = false;
        // Those of the job before are not for this one.
        let own = own_steps(machine);
        self.set_steps(machine, own)
    }

    #[inline(never)]
    fn job_end(&mut self, machine: &mut impl Machine) -> Result<(), Reason> {
        let upload = self.upload.ok_or(Reason::NoUpload)?;
        if upload.is_streamed() {
            return upload.finish(machine);
        }
        upload.check_complete()?;
        self.upload = None;
        upload.finish(machine)
    }

    /// Queues a command if the state permits it. `pass`: the one that a start begins with.
    #[inline(never)]
    fn operate(&mut self, machine: &mut impl Machine, command: Command, pass: u32) -> Result<(), Reason> {
        let ends = matches!(
            command,
            Command::Hold | Command::Stop | Command::Abort | Command::Pause
        );
        if ends && machine.motion().activity != Activity::Rest {
            return machine.order(Order::Move(Motion::Stop));
        }
        let Status { state, safety, .. } = machine.status();
        if !command.is_allowed(state) {
            return Err(Reason::WrongState { state });
        }
        if command == Command::Resume {
            may_resume(&safety)?;
        }
        if command == Command::Start {
            if self.is_outdated {
                return Err(Reason::OtherProfile);
            }
            machine.may_start()?;
            if pass > 0 {
                machine.order(Order::BeginAt(pass))?;
            }
        }
        let sent = instruct(machine, Instruction::Command(command));
        if sent.is_err() && pass > 0 {
            machine.order(Order::BeginAt(0))?;
        }
        sent?;
        if command == Command::Start {
            self.journal_start(machine, pass);
        }
        self.commanded = true;
        Ok(())
    }

    /// A change of the clock during a motion would be a velocity step of the axes.
    fn set_clock(&mut self, machine: &mut impl Machine, clock: Clock) -> Result<(), Reason> {
        no_run(machine)?;
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
            | Request::StartAt { .. }
            | Request::Clock(_)
            | Request::StepConfig(_)
            | Request::SetProfile(_)
            | Request::SetOffsets(_)
            | Request::Spindle(_)
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
