//! A board within the host process: both halves connected by function calls, with a byte stream and ticks as its interface.

use std::collections::VecDeque;
use std::vec::Vec;

use embedded_storage::nor_flash::NorFlash;
use interp_core::{
    RunStart,
    fault::Fault,
    job::{Header, STORE_WORDS, stream::RecordCopy},
    steps::{BUFFER_WORDS, CheckedSteps, StepConfig},
};
use protocol::message::{Description, InputLines, Journal, MotionStatus, Offsets, Profile, Reason, Status};

use crate::{
    jobs::JobStore,
    link::Link,
    machine::{Busy, Event, Events, Instruction, Machine, describe},
    ram_flash::RamFlash,
    realtime::{RealTime, TickInput},
    safety::Order,
    settings::Settings,
    storage::{Prepared, StorageError},
};

/// Capacity of the instruction queue, as in the firmware.
pub const COMMANDS_MAX: usize = 4;

/// An unbounded queue of events.
impl Events for Vec<Event> {
    fn has_room(&self) -> bool {
        true
    }

    fn put(&mut self, event: Event) -> bool {
        self.push(event);
        true
    }
}

/// The real-time half and its instruction queue: the link's [`Machine`].
#[derive(Debug)]
struct Half<const WORDS: usize> {
    real_time: RealTime<[i32; WORDS]>,
    commands: VecDeque<Instruction>,
    lines: InputLines,
    settings: Settings<RamFlash<SECTOR>>,
    prepared: Option<Prepared>,
    jobs: JobStore<RamFlash<JOB_SECTOR>>,
}

/// Bytes of a flash sector for settings and journal.
const SECTOR: usize = 16 * 1024;
/// Bytes of a flash sector for jobs.
const JOB_SECTOR: usize = 32 * 1024;

impl<const WORDS: usize> Machine for Half<WORDS> {
    fn description(&mut self) -> Description {
        describe([0, 1, 0], "in-process", WORDS, 1000)
    }

    fn status(&mut self) -> Status {
        self.real_time.status()
    }

    fn load_begin(&mut self, header: &Header, words: u32) -> Result<(), Fault> {
        self.real_time.load_begin(header, words)
    }

    fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<(), Fault> {
        self.real_time.load_words(offset, words)
    }

    fn load_room(&mut self) -> [u32; 2] {
        self.real_time.load_room()
    }

    fn load_copy(&mut self, record: u32) -> Result<RecordCopy, Fault> {
        self.real_time.load_copy(record)
    }

    fn load_judged(&mut self, record: u32, checked: Result<(), Fault>) -> Result<(), Fault> {
        self.real_time.load_judged(record, checked)
    }

    fn load_records(&mut self) -> u32 {
        self.real_time.load_records()
    }

    fn load_check(&mut self, record: u32) -> Result<(), Fault> {
        self.real_time.load_check(record)
    }

    fn load_finish(&mut self) -> Result<(), Fault> {
        self.real_time.load_finish()
    }

    fn profile(&self) -> Option<&Profile> {
        self.settings.profile()
    }

    fn keep_profile(&mut self, profile: Option<&Profile>) -> Result<(), StorageError> {
        self.settings.keep(profile)
    }

    fn motion(&mut self) -> MotionStatus {
        self.real_time.motion()
    }

    fn offsets(&mut self) -> Offsets {
        self.settings.offsets()
    }

    fn keep_offsets(&mut self, offsets: &Offsets) -> Result<(), StorageError> {
        self.settings.keep_offsets(offsets)
    }

    fn journal(&mut self) -> Option<Journal> {
        self.settings.journal()
    }

    fn keep_journal(&mut self, journal: &Journal) -> Result<(), StorageError> {
        self.settings.keep_journal(journal)
    }

    fn end_journal(&mut self) -> Result<(), StorageError> {
        self.settings.end_journal()
    }

    fn prepare_journal(&mut self, journal: Option<&Journal>) {
        self.prepared = self.settings.prepare_journal(journal, false);
    }

    type JobFlash = RamFlash<JOB_SECTOR>;

    fn jobs(&mut self) -> &mut JobStore<Self::JobFlash> {
        &mut self.jobs
    }

    fn loaded(&mut self) -> Option<(Header, u32)> {
        let (header, words) = self.real_time.loaded()?;
        Some((*header, u32::try_from(words.len()).ok()?))
    }

    fn loaded_words(&mut self, offset: u32, words: &mut [i32]) -> usize {
        self.real_time.loaded_words(offset, words)
    }

    fn place(&mut self) -> Option<RunStart> {
        self.real_time.place()
    }

    fn own_steps(&mut self) -> StepConfig {
        StepConfig::DEFAULT
    }

    fn set_steps(&mut self, checked: &CheckedSteps) -> Result<(), Fault> {
        self.real_time.set_steps(checked)
    }

    fn send(&mut self, instruction: Instruction) -> Result<(), Busy> {
        if self.commands.len() >= COMMANDS_MAX {
            return Err(Busy);
        }
        self.commands.push_back(instruction);
        Ok(())
    }

    fn order(&mut self, order: Order) -> Result<(), Reason> {
        self.real_time.order(order)
    }

    fn may_start(&mut self) -> Result<(), Reason> {
        self.real_time.may_start()
    }

    fn may_start_next(&mut self, home_nm: Option<[i32; 3]>) -> Result<(), Reason> {
        self.real_time.may_start_next(home_nm)
    }

    fn heard(&mut self) {
        self.real_time.heard();
    }

    fn simulate(&mut self, lines: InputLines) -> bool {
        self.lines = lines;
        true
    }

    fn instructions_wait(&mut self) -> bool {
        !self.commands.is_empty()
    }

    fn start_waits(&mut self) -> bool {
        self.real_time.start_waits()
    }
}

/// The whole board except its pins.
#[derive(Debug)]
pub struct Board<const WORDS: usize = STORE_WORDS> {
    half: Half<WORDS>,
    link: Link,
    sent: Vec<u8>,
    carriages: [i32; 3],
    periods: u32,
}

impl<const WORDS: usize> Default for Board<WORDS> {
    fn default() -> Self {
        Self::with_flash(RamFlash::new(), RamFlash::new())
    }
}

impl<const WORDS: usize> Board<WORDS> {
    /// A board after its first power-up.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A board after power-up, with what its flash has.
    fn with_flash(settings: RamFlash<SECTOR>, jobs: RamFlash<JOB_SECTOR>) -> Self {
        let mut half = Half {
            real_time: RealTime::default(),
            commands: VecDeque::new(),
            lines: InputLines::NONE,
            settings: Settings::open(settings),
            prepared: None,
            jobs: JobStore::open(jobs),
        };
        let mut link = Link::new();
        link.power_up(&mut half);
        Self {
            half,
            link,
            sent: Vec::new(),
            carriages: [0; 3],
            periods: 0,
        }
    }

    /// Cuts the power, and restores it.
    #[must_use]
    pub fn power_cycle(self) -> Self {
        Self::with_flash(self.half.settings.into_flash(), self.half.jobs.into_flash())
    }

    /// Cuts the power, and restores it, with a supply that lasts until the record of its falling is written.
    #[must_use]
    pub fn power_cycle_slowly(self) -> Self {
        let prepared = self.half.prepared;
        let mut settings = self.half.settings.into_flash();
        if let Some(Prepared { offset, bytes }) = prepared {
            // In RAM; it is within the sectors.
            let _ = settings.write(offset, &bytes);
        }
        Self::with_flash(settings, self.half.jobs.into_flash())
    }

    /// Receives bytes from the host.
    pub fn receive(&mut self, bytes: &[u8]) {
        let sent = &mut self.sent;
        for byte in bytes {
            self.link.receive(*byte, &mut self.half, &mut |answer| {
                sent.extend_from_slice(answer)
            });
        }
    }

    /// One tick of the sample timer and the planning after it; the events are then written to the line.
    pub fn tick(&mut self) {
        self.tick_with(0, 0);
    }

    /// One tick of the sample timer with the number of ticks missed before it and the cycles of the previous tick, and the planning after it.
    pub fn tick_with(&mut self, missed: u32, cycles: u32) {
        self.tick_without_planning(missed, cycles);
        self.half.real_time.plan();
    }

    /// As [`Self::tick_with`], without the planning after it.
    pub fn tick_without_planning(&mut self, missed: u32, cycles: u32) {
        let mut events = Vec::new();
        if let Some(command) = self.half.commands.pop_front() {
            self.half.real_time.obey(command, &mut events);
        }
        let input = TickInput {
            missed,
            cycles,
            lines: self.half.lines,
        };
        self.half.real_time.tick(input, &mut events);
        if self.half.real_time.steps().is_some() {
            let mut slots = [0; BUFFER_WORDS];
            self.half.real_time.pulses(&mut slots);
            self.count(&slots);
        }
        let sent = &mut self.sent;
        for event in events {
            self.link
                .event(&event, &mut |bytes| sent.extend_from_slice(bytes));
        }
        self.periods = self.periods.wrapping_add(1);
        self.link.keep_journal(self.periods, &mut self.half);
    }

    /// Adds the pulses of a period to the carriages, with pins 0 to 2 as the axes' step pins.
    fn count(&mut self, slots: &[u32; BUFFER_WORDS]) {
        let minus = self.half.real_time.directions();
        for (axis, carriage) in self.carriages.iter_mut().enumerate() {
            let is_high = |word: &u32| word >> axis & 1 != 0;
            let begins = slots.iter().zip(slots.iter().skip(1));
            let pulses = begins
                .filter(|(before, after)| !is_high(before) && is_high(after))
                .count()
                + usize::from(slots.first().is_some_and(is_high));
            let pulses = i32::try_from(pulses).unwrap_or(i32::MAX);
            *carriage += if minus >> axis & 1 != 0 { -pulses } else { pulses };
        }
    }

    /// Steps that the drives have received, once the pulses computed so far are over: those of the last tick two ticks later.
    #[must_use]
    pub const fn carriages(&self) -> [i32; 3] {
        self.carriages
    }

    /// Sets the board's inputs directly, not over the line.
    pub const fn simulate(&mut self, lines: InputLines) {
        self.half.lines = lines;
    }

    /// The bytes that the board has sent since the last call.
    pub fn take_sent(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.sent)
    }

    /// The status, not over the line.
    #[must_use]
    pub fn status(&mut self) -> Status {
        self.half.status()
    }

    /// The real-time half.
    pub const fn real_time(&mut self) -> &mut RealTime<[i32; WORDS]> {
        &mut self.half.real_time
    }
}
