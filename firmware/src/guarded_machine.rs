//! The link's access to the machine: through a lock that delays the sample timer for one short call at a
//! time, and through a queue.

use controller::{
    jobs::JobStore,
    machine::{Busy, Instruction, Machine, describe},
    realtime::RealTime,
    safety::Order,
    settings::Settings,
    storage::StorageError,
};
use heapless::spsc::Producer;
use interp_core::{
    RunStart,
    fault::Fault,
    job::{Header, stream::RecordCopy},
    steps::{CheckedSteps, StepConfig},
};
use protocol::message::{Description, InputLines, Journal, MotionStatus, Offsets, Profile, Reason, Status};
use rtic::Mutex;

use crate::{
    board::{self, BOARD, FallingFlash, JobFlash, SettingsFlash},
    design_parameters::{FIRMWARE_VERSION, JOB_WORDS, PERIOD_US},
    drivers::supply::FallingRecord,
};

/// The real-time half of this board.
pub(crate) type BoardRealTime = RealTime<&'static mut [i32; JOB_WORDS]>;

/// [`Machine`] by means of RTIC. Every lock is held for one call of [`RealTime`], each of bounded length: a
/// chunk of words, a record, or a copy of the status.
pub(crate) struct GuardedMachine<'a, M, F> {
    /// The real-time half.
    pub(crate) real_time: M,
    /// The record of a failing supply.
    pub(crate) falling: F,
    /// Commands to the next tick.
    pub(crate) commands: &'a mut Producer<'static, Instruction>,
    /// The machine's profile, and the journal.
    pub(crate) settings: &'a mut Settings<SettingsFlash>,
    /// The jobs that the board keeps.
    pub(crate) jobs: &'a mut JobStore<JobFlash>,
}

/// The record of a failing supply of this board.
pub(crate) type BoardFalling = FallingRecord<FallingFlash>;

impl<M: Mutex<T = BoardRealTime>, F: Mutex<T = BoardFalling>> GuardedMachine<'_, M, F> {
    /// See [`RealTime::wants_tick`].
    pub(crate) fn wants_tick(&mut self) -> bool {
        self.real_time.lock(|real_time| real_time.wants_tick())
    }
}

impl<M: Mutex<T = BoardRealTime>, F: Mutex<T = BoardFalling>> Machine for GuardedMachine<'_, M, F> {
    fn description(&mut self) -> Description {
        describe(FIRMWARE_VERSION, BOARD.id, JOB_WORDS, PERIOD_US)
    }

    fn status(&mut self) -> Status {
        self.real_time.lock(|real_time| real_time.status())
    }

    fn load_begin(&mut self, header: &Header, words: u32) -> Result<(), Fault> {
        self.real_time
            .lock(|real_time| real_time.load_begin(header, words))
    }

    fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<(), Fault> {
        self.real_time
            .lock(|real_time| real_time.load_words(offset, words))
    }

    fn load_room(&mut self) -> [u32; 2] {
        self.real_time.lock(|real_time| real_time.load_room())
    }

    fn load_copy(&mut self, record: u32) -> Result<RecordCopy, Fault> {
        self.real_time.lock(|real_time| real_time.load_copy(record))
    }

    fn load_judged(&mut self, record: u32, checked: Result<(), Fault>) -> Result<(), Fault> {
        self.real_time
            .lock(|real_time| real_time.load_judged(record, checked))
    }

    fn load_records(&mut self) -> u32 {
        self.real_time.lock(|real_time| real_time.load_records())
    }

    fn load_check(&mut self, record: u32) -> Result<(), Fault> {
        self.real_time.lock(|real_time| real_time.load_check(record))
    }

    fn load_finish(&mut self) -> Result<(), Fault> {
        self.real_time.lock(|real_time| real_time.load_finish())
    }

    fn profile(&self) -> Option<&Profile> {
        self.settings.profile()
    }

    #[inline(never)]
    fn keep_profile(&mut self, profile: Option<&Profile>) -> Result<(), StorageError> {
        self.settings.keep(profile)
    }

    fn motion(&mut self) -> MotionStatus {
        self.real_time.lock(|real_time| real_time.motion())
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
        if board::HAS_JOURNAL {
            self.settings.keep_journal(journal)
        } else {
            Err(StorageError)
        }
    }

    fn end_journal(&mut self) -> Result<(), StorageError> {
        self.settings.end_journal()
    }

    fn prepare_journal(&mut self, journal: Option<&Journal>) {
        // The supply may have come back before it was too low. It may also fall now: the record of before is not written to the slot that the next one is
        // prepared for.
        let was_written = self.falling.lock(FallingRecord::withdraw);
        let prepared = self.settings.prepare_journal(journal, was_written);
        self.falling.lock(|falling| falling.set(prepared));
    }

    type JobFlash = JobFlash;

    fn jobs(&mut self) -> &mut JobStore<JobFlash> {
        self.jobs
    }

    fn loaded(&mut self) -> Option<(Header, u32)> {
        self.real_time.lock(|real_time| {
            let (header, words) = real_time.loaded()?;
            Some((*header, u32::try_from(words.len()).ok()?))
        })
    }

    fn loaded_words(&mut self, offset: u32, words: &mut [i32]) -> usize {
        self.real_time
            .lock(|real_time| real_time.loaded_words(offset, words))
    }

    fn place(&mut self) -> Option<RunStart> {
        self.real_time.lock(|real_time| real_time.place())
    }

    fn own_steps(&mut self) -> StepConfig {
        board::STEPS
    }

    fn set_steps(&mut self, checked: &CheckedSteps) -> Result<(), Fault> {
        self.real_time.lock(|real_time| real_time.set_steps(checked))
    }

    fn send(&mut self, command: Instruction) -> Result<(), Busy> {
        self.commands.enqueue(command).map_err(|_| Busy)
    }

    fn order(&mut self, order: Order) -> Result<(), Reason> {
        self.real_time.lock(|real_time| real_time.order(order))
    }

    fn may_start(&mut self) -> Result<(), Reason> {
        self.real_time.lock(|real_time| real_time.may_start())
    }

    fn may_start_next(&mut self, home_nm: Option<[i32; 3]>) -> Result<(), Reason> {
        self.real_time.lock(|real_time| real_time.may_start_next(home_nm))
    }

    fn heard(&mut self) {
        self.real_time.lock(|real_time| real_time.heard());
    }

    fn simulate(&mut self, lines: InputLines) -> bool {
        board::simulate(lines)
    }

    fn instructions_wait(&mut self) -> bool {
        !self.commands.is_empty()
    }

    fn start_waits(&mut self) -> bool {
        self.real_time.lock(|real_time| real_time.start_waits())
    }
}
