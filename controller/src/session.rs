//! A session with the host: its version, the numbers of its requests, and their answers.

use heapless::Vec;
use interp_core::{
    command::Command,
    fault::{Fault, FaultKind},
    job::Header,
    sample::State,
    steps::{StepConfig, StepConfigError},
};
use protocol::{
    frame::{DELIMITER, FRAME_MAX, Frame, write_reply},
    message::{
        Activity, Capabilities, Clock, Configuration, Excess, Journal, NO_NUMBER, OVERRIDE_MAX_PERCENT,
        Offsets, PassDigest, Profile, ProfileLimit, Reason, Reply, Request, Status, StepSettings, job_mark,
        next_number, read_request,
    },
    version::PROTOCOL_VERSION,
};

use crate::{
    history::History,
    journal::Journalling,
    machine::{Busy, Instruction, Machine},
    manual::{Motion, Setup},
    safety::Order,
    storage::StorageError,
    upload::Upload,
};

/// Maximum length of an answer stored for a retransmission, bytes: a frame of a `Profile` with every varint at its maximum length. That of a
/// `Status` is shorter.
const ANSWER_MAX: usize = 199;

/// State of the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Peer {
    Nobody,
    /// The host sent `Hello` with another version.
    Stranger {
        version: u16,
    },
    /// The host sent `Hello` with this version.
    Host {
        session: u32,
    },
}

/// The last answered request, with its answer for a retransmission.
#[derive(Debug)]
struct Last {
    number: u16,
    length: usize,
    crc: u32,
    answer: Vec<u8, ANSWER_MAX>,
}

impl Last {
    const fn new() -> Self {
        Self {
            number: NO_NUMBER,
            length: 0,
            crc: 0,
            answer: Vec::new(),
        }
    }

    fn is(&self, number: u16, frame: &Frame<'_>) -> bool {
        !self.answer.is_empty()
            && self.number == number
            && self.length == frame.payload.len()
            && self.crc == frame.crc
    }

    #[inline(never)]
    fn set(&mut self, number: u16, frame: &Frame<'_>, answer: &Reply) {
        self.number = number;
        self.length = frame.payload.len();
        self.crc = frame.crc;
        let capacity = self.answer.capacity();
        self.answer.resize_default(capacity).ok();
        let length = write_reply(answer, &mut self.answer).map_or(0, <[u8]>::len);
        self.answer.truncate(length);
    }
}

#[derive(Debug)]
pub(crate) struct Session {
    peer: Peer,
    last: Last,
    upload: Option<Upload>,
    /// The clock after the commands sent so far; the status shows it one tick later.
    clock: Clock,
    /// A start, hold, resume, stop or abort was sent, and may still be queued.
    commanded: bool,
    frames_bad: u32,
    events: History,
    /// Settings of the drives in force; none before the first job: the board's own.
    steps: Option<StepConfig>,
    /// Digest of the profile that the board keeps.
    profile: u32,
    /// The job was loaded under another profile.
    is_outdated: bool,
    /// [`job_mark`] of the job whose runs are journalled; none where the loaded one's are not.
    job: Option<u64>,
    journalling: Journalling,
}

impl Session {
    pub(crate) const fn new() -> Self {
        Self {
            peer: Peer::Nobody,
            last: Last::new(),
            upload: None,
            clock: Clock::Free,
            commanded: false,
            frames_bad: 0,
            events: History::new(),
            steps: None,
            profile: 0,
            is_outdated: false,
            job: None,
            journalling: Journalling::NONE,
        }
    }

    /// Puts the profile that the board keeps in force: at power-up, and after a change.
    ///
    /// # Errors
    /// A run is under way.
    pub(crate) fn enforce_profile(&mut self, machine: &mut impl Machine) -> Result<(), Reason> {
        self.profile = supervise(machine)?;
        set_up(machine)?;
        let own = own_steps(machine);
        self.set_steps(machine, own)
    }

    /// Keeps another profile, or none.
    #[inline(never)]
    fn set_profile(&mut self, machine: &mut impl Machine, profile: Option<&Profile>) -> Result<(), Reason> {
        no_run(machine)?;
        if profile.is_some_and(|profile| !profile.is_valid()) {
            return Err(Reason::BadProfile);
        }
        machine
            .keep_profile(profile)
            .map_err(|StorageError| Reason::Storage)?;
        self.is_outdated = true;
        self.upload = None;
        self.enforce_profile(machine)
    }

    /// Keeps other work offsets. The job loaded was placed by those before.
    #[inline(never)]
    fn set_offsets(&mut self, machine: &mut impl Machine, offsets: &Offsets) -> Result<(), Reason> {
        no_run(machine)?;
        machine
            .keep_offsets(offsets)
            .map_err(|StorageError| Reason::Storage)?;
        self.is_outdated = true;
        self.upload = None;
        Ok(())
    }

    pub(crate) const fn is_open(&self) -> bool {
        matches!(self.peer, Peer::Host { .. })
    }

    pub(crate) const fn count_bad_frame(&mut self) {
        self.frames_bad = self.frames_bad.saturating_add(1);
    }

    /// The status of an answer: with the link's counters, and the settings of the drives.
    #[inline(never)]
    fn complete_with_steps(&mut self, machine: &mut impl Machine) -> Status {
        let config = self.steps.unwrap_or_else(|| own_steps(machine));
        self.steps = Some(config);
        self.complete(machine.status())
    }

    /// The machine's status with the link's own counters.
    fn complete(&self, status: Status) -> Status {
        let steps = self.steps.map_or(0, |config| StepSettings::from(config).digest());
        Status {
            steps,
            profile: self.profile,
            frames_bad: self.frames_bad,
            events: self.events.last(),
            ..status
        }
    }

    /// Journals that a run of the loaded job begins at a pass.
    #[inline(never)]
    fn journal_start(&mut self, machine: &mut impl Machine, pass: u32) {
        self.journalling = Journalling::NONE;
        if let Some(journal) = self.journal(pass, false) {
            // A run is not hindered by a journal that is full, or absent.
            let _ = machine.keep_journal(&journal);
        }
    }

    /// How far a run of the loaded job came, if its runs are journalled.
    fn journal(&self, pass: u32, is_finished: bool) -> Option<Journal> {
        self.job.map(|job| Journal {
            job,
            profile: self.profile,
            pass,
            is_finished,
        })
    }

    /// A pass of a run is over.
    pub(crate) fn note_pass(&mut self, pass: &PassDigest) {
        self.journalling
            .note(self.journal(pass.pass.saturating_add(1), false));
    }

    /// A run has come to its end, or to that of its ticks.
    pub(crate) fn note_halt(&mut self, status: &Status) {
        if status.state == State::Finished {
            self.journalling.note(self.journal(status.pass, true));
        } else if !status.state.is_under_way() {
            // Its last pass is not complete.
            self.journalling = Journalling::NONE;
        }
    }

    /// Journals what is due.
    pub(crate) fn keep_journal(&mut self, now: u32, machine: &mut impl Machine) {
        if let Some(journal) = self.journalling.due(now) {
            let _ = machine.keep_journal(&journal);
        }
    }

    /// Writes the next event, made with its number, and keeps it. Without a session it is dropped.
    pub(crate) fn event(&mut self, make: impl FnOnce(u32) -> Reply, out: &mut impl FnMut(&[u8])) {
        if !self.is_open() {
            return;
        }
        let mut buffer = [0; FRAME_MAX];
        if let Ok(frame) = write_reply(&make(self.events.next()), &mut buffer) {
            self.events.push(frame);
            out(frame);
        }
    }

    /// Writes the end of a run, or that its ticks are used up.
    #[inline(never)]
    pub(crate) fn halted(&mut self, status: &Status, out: &mut impl FnMut(&[u8])) {
        let status = self.complete(*status);
        self.event(|events| Reply::Halted(Status { events, ..status }), out);
    }

    /// Answers a frame. Whether it is a sign of life: a request that was carried out or refused on its merits, now or when it was first sent. Noise, frames of
    /// another session and requests out of order are none.
    #[inline(never)]
    pub(crate) fn frame(
        &mut self,
        frame: Frame<'_>,
        machine: &mut impl Machine,
        out: &mut impl FnMut(&[u8]),
    ) -> bool {
        let read = read_request(frame.payload);
        let number = match &read {
            Ok((number, _)) => *number,
            Err(unreadable) => unreadable.number,
        };
        if let Ok((_, Request::Hello { version, session })) = read {
            self.hello(number, version, session);
            send_capabilities(number, session, machine, out);
            return self.is_open();
        }
        if self.last.is(number, &frame) {
            out(&self.last.answer);
            return true;
        }
        if let Some(reason) = self.refusal(number) {
            refuse(number, reason, out);
            return false;
        }
        if let Ok((_, request)) = &read {
            let answer = self.answer(number, request, machine, out);
            self.last.set(number, &frame, &answer);
            out(&self.last.answer);
            true
        } else {
            refuse(number, Reason::Unreadable, out);
            false
        }
    }

    /// Opens a session, unless it is open already: then this `Hello` is a retransmission, and changes nothing.
    #[inline(never)]
    fn hello(&mut self, number: u16, version: u16, session: u32) {
        let peer = if version == PROTOCOL_VERSION {
            Peer::Host { session }
        } else {
            Peer::Stranger { version }
        };
        if peer != self.peer {
            self.peer = peer;
            // A streamed job is under way, or may be: the next session goes on with it.
            self.upload = self.upload.filter(Upload::is_streamed);
            self.events.clear();
            self.last = Last {
                number,
                ..Last::new()
            };
        }
    }

    /// The reason to refuse a request by its number, if any.
    fn refusal(&self, number: u16) -> Option<Reason> {
        match self.peer {
            Peer::Nobody => Some(Reason::SayHello),
            Peer::Stranger { version } => Some(Reason::Version {
                host: version,
                board: PROTOCOL_VERSION,
            }),
            Peer::Host { .. } => {
                let expected = next_number(self.last.number);
                (number != expected).then_some(Reason::OutOfOrder { expected })
            }
        }
    }

    /// Executes a request.
    #[inline(never)]
    fn answer(
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
            Request::Jog {
                axis,
                way,
                speed_mm_s,
            } => machine.order(Order::Move(Motion::Jog {
                axis,
                way,
                speed_mm_s,
            })),
            Request::Probe { axis, nm, speed_mm_s } => {
                machine.order(Order::Move(Motion::Probe { axis, nm, speed_mm_s }))
            }
            Request::Spindle(order) => machine.order(Order::Spindle(order)),
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

    fn set_steps(&mut self, machine: &mut impl Machine, config: StepConfig) -> Result<(), Reason> {
        set_steps(machine, config)?;
        self.steps = Some(config);
        Ok(())
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
        let state = machine.status().state;
        if !command.is_allowed(state) {
            return Err(Reason::WrongState { state });
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
fn no_run(machine: &mut impl Machine) -> Result<(), Reason> {
    let state = machine.status().state;
    if state.is_under_way() {
        return Err(Reason::WrongState { state });
    }
    Ok(())
}

/// Puts the supervision of the kept profile in force; returns the profile's digest, 0 where there is none.
#[inline(never)]
fn supervise(machine: &mut impl Machine) -> Result<u32, Reason> {
    let profile = machine.profile();
    let configuration = profile.map_or(Configuration::DEFAULT, |profile| profile.configuration);
    machine.order(Order::Configure(configuration))?;
    Ok(profile.map_or(0, |profile| profile.digest()))
}

/// Puts what the kept profile says of motion outside a job in force.
#[inline(never)]
fn set_up(machine: &mut impl Machine) -> Result<(), Reason> {
    #[allow(clippy::cast_precision_loss, reason = "a period is below 2^24 us")]
    let period_s = machine.description().period_us as f32 * 1e-6;
    let profile = machine.profile();
    machine.order(Order::SetUp(
        profile.map(|profile| Setup::new(&profile, period_s)),
    ))
}

/// The settings of the drives of a job that has none: the profile's, or the board's own.
#[inline(never)]
fn own_steps(machine: &mut impl Machine) -> StepConfig {
    match machine.profile() {
        Some(profile) => profile.steps.into(),
        None => machine.own_steps(),
    }
}

const fn beyond(excess: Excess) -> Reason {
    Reason::BeyondProfile { excess }
}

/// Whether these settings differ from the profile's, if the board keeps one.
fn has_other_steps(machine: &mut impl Machine, settings: StepSettings) -> bool {
    machine.profile().is_some_and(|profile| profile.steps != settings)
}

/// A job may want a machine to be homed that need not be, but not the other way round.
fn configure(machine: &mut impl Machine, configuration: Configuration) -> Result<(), Reason> {
    let must_home = machine
        .profile()
        .is_some_and(|profile| profile.configuration.homing_required);
    if must_home && !configuration.homing_required {
        return Err(beyond(Excess::of(ProfileLimit::Homing)));
    }
    machine.order(Order::Configure(configuration))
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

/// Validated here, outside the tick; applied between two ticks.
fn set_steps(machine: &mut impl Machine, config: StepConfig) -> Result<(), Reason> {
    no_run(machine)?;
    let refused = |value: f32, record| Reason::Job {
        fault: Fault::new(FaultKind::BadHeader, value).into(),
        record,
    };
    let checked = config.check().map_err(|error| match error {
        #[allow(clippy::cast_precision_loss, reason = "a value to be read by a person")]
        StepConfigError::StepsPerMm { axis, steps, mm } => {
            refused(steps as f32 / mm as f32, Some(axis.into()))
        }
        StepConfigError::PulseSlots(slots) => refused(slots.into(), None),
        StepConfigError::SetupSlots(slots) => refused(slots.into(), None),
    })?;
    machine
        .set_steps(&checked)
        .map_err(|fault| refused(fault.value, None))
}

fn instruct(machine: &mut impl Machine, instruction: Instruction) -> Result<(), Reason> {
    machine.send(instruction).map_err(|Busy| Reason::Busy)
}

/// Writes what the board is. Apart from [`Session::frame`], like the refusal, so that its stack is not a part of every request's.
#[inline(never)]
fn send_capabilities(number: u16, session: u32, machine: &mut impl Machine, out: &mut impl FnMut(&[u8])) {
    out(&[DELIMITER]);
    send(
        &Reply::Capabilities(Capabilities {
            number,
            version: PROTOCOL_VERSION,
            session,
            description: machine.description(),
        }),
        out,
    );
}

#[inline(never)]
fn refuse(number: u16, reason: Reason, out: &mut impl FnMut(&[u8])) {
    send(&Reply::Nak { number, reason }, out);
}

/// Writes one reply as a frame. Every message fits into [`FRAME_MAX`], as a test of the protocol checks.
pub(crate) fn send(reply: &Reply, out: &mut impl FnMut(&[u8])) {
    let mut buffer = [0; FRAME_MAX];
    if let Ok(frame) = write_reply(reply, &mut buffer) {
        out(frame);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use interp_core::sample::SpanParameter;
    use protocol::message::{FaultReport, InputLines, Report, SafetyStatus, StreamStatus};

    #[test]
    fn the_longest_answers_are_kept() {
        let place = SpanParameter {
            span: u16::MAX,
            fraction: u64::MAX,
        };
        let status = Status {
            state: State::Faulted,
            fault: Some(FaultReport {
                code: u8::MAX,
                value: f32::MAX,
            }),
            clock: Clock::Lockstep,
            credit: u32::MAX,
            report: Report::Samples,
            tick: u32::MAX,
            pass: u32::MAX,
            path: place,
            side: place,
            samples: u32::MAX,
            digest: u64::MAX,
            interval: f32::MAX,
            deadline_misses: u32::MAX,
            tick_cycles_max: u32::MAX,
            samples_lost: u32::MAX,
            frames_bad: u32::MAX,
            halts: u32::MAX,
            events: u32::MAX,
            steps: u32::MAX,
            profile: u32::MAX,
            stream: StreamStatus {
                received: u32::MAX,
                room: u32::MAX,
                starved: u32::MAX,
            },
            safety: SafetyStatus {
                lines: InputLines(u16::MAX),
                latched: InputLines(u16::MAX),
                configuration: Configuration {
                    link_timeout_ticks: u32::MAX,
                    ..Configuration::DEFAULT
                },
                ..SafetyStatus::DEFAULT
            },
        };
        let mut last = Last::new();
        last.set(
            u16::MAX,
            &Frame { payload: &[], crc: 0 },
            &Reply::Status {
                number: u16::MAX,
                status,
            },
        );
        assert!(!last.answer.is_empty() && last.answer.len() < ANSWER_MAX);
        let axis = interp_core::steps::AxisSteps {
            steps: u32::MAX,
            mm: u32::MAX,
            inverted: true,
        };
        let steps = StepConfig {
            axes: [axis; 3],
            pulse_slots: u8::MAX,
            setup_slots: u16::MAX,
        };
        let profile = Profile {
            steps: steps.into(),
            velocity_mm_s: [1.0; 3],
            acceleration_mm_s2: [1.0; 3],
            jerk_mm_s3: [1.0; 3],
            travel_nm: Some([[i32::MIN, i32::MAX]; 3]),
            configuration: status.safety.configuration,
            homing: Some(protocol::message::Homing {
                order: [2, 1, 0],
                at_upper_end: [true; 3],
                position_nm: [i32::MIN; 3],
                seek_mm_s: [1.0; 3],
                approach_mm_s: [1.0; 3],
                back_off_nm: [i32::MAX; 3],
                survives_off: true,
            }),
            probe_inverted: true,
            step_inverted: 0b111,
            enable_inverted: 0b111,
            spindle: Some(protocol::message::SpindleSettings {
                max_rpm: u32::MAX,
                at_speed_ticks: u32::MAX,
                stops_at_pause: true,
            }),
        };
        let longest = Reply::Profile {
            number: u16::MAX,
            profile: Some(profile),
        };
        last.set(u16::MAX, &Frame { payload: &[], crc: 0 }, &longest);
        assert_eq!(last.answer.len(), ANSWER_MAX);
    }
}
