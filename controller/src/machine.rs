//! The interface between the link and the real-time half of the board.

use embedded_storage::nor_flash::NorFlash;
use interp_core::{
    RunStart,
    command::Command,
    fault::Fault,
    job::{Header, SurfaceKind, patches_max, stream::RecordCopy},
    steps::{CheckedSteps, StepConfig},
};
use protocol::message::{
    CHUNK_WORDS_MAX, Clock, Description, InputLines, Journal, MotionStatus, Offsets, PassDigest, Profile,
    Reason, Report, Status,
};

use crate::{jobs::JobStore, safety::Order, storage::StorageError};

/// Instructions from the link to the real-time half; executed with the next tick of the sample timer, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instruction {
    /// The operator's command; goes to the interpolator with the next period that passes.
    Command(Command),
    /// Time base of the board.
    Clock(Clock),
    /// Lockstep: this number of further periods.
    Run {
        /// Periods, added to the remaining ones.
        ticks: u32,
    },
    /// Reports of a run to the host.
    Report(Report),
    /// Feed override, percent.
    Override {
        /// At most [`protocol::message::OVERRIDE_MAX_PERCENT`].
        percent: u8,
    },
}

/// Events from the real-time half to the link, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "an item of a queue of fixed size; there is no allocator to box with"
)]
pub enum Event {
    /// A sample of the run.
    Sample(interp_core::sample::Sample),
    /// A pass is over.
    Pass(PassDigest),
    /// A streamed job: words up to which there is room.
    Room(u32),
    /// The ticks of a `Run` are used up, or the run is over.
    Halted(Status),
}

/// Sink for the events of the real-time half: a queue that never blocks.
pub trait Events {
    /// Maximum events of one tick.
    const TICK_MAX: usize = 3;

    /// Whether [`Self::TICK_MAX`] events fit.
    fn has_room(&self) -> bool;

    /// Enqueues an event; false where the queue is full and the event is lost.
    fn put(&mut self, event: Event) -> bool;
}

/// The queue of instructions is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy;

/// The description of a board with this store and period; a name longer than the message holds is omitted.
#[must_use]
pub fn describe(firmware: [u16; 3], board: &str, store_words: usize, period_us: u32) -> Description {
    let count = |words: usize| u32::try_from(words).unwrap_or(u32::MAX);
    Description {
        firmware,
        board: heapless::String::try_from(board).unwrap_or_default(),
        store_words: count(store_words),
        patches_max_polynomial: count(patches_max(SurfaceKind::Polynomial, store_words)),
        patches_max_rational: count(patches_max(SurfaceKind::Rational, store_words)),
        chunk_words_max: u16::try_from(CHUNK_WORDS_MAX).unwrap_or(u16::MAX),
        period_us,
    }
}

/// The link's interface to the real-time half. Every call is short, because it may delay the sample timer for its duration.
pub trait Machine {
    /// Identity and capacities of the board.
    fn description(&mut self) -> Description;

    /// The status, without what the link fills in: `frames_bad`, `events`, `steps`, `profile`.
    fn status(&mut self) -> Status;

    /// [`interp_core::Interpolator::load_begin`] through [`crate::realtime::RealTime`].
    ///
    /// # Errors
    /// The core's.
    fn load_begin(&mut self, header: &Header, words: u32) -> Result<(), Fault>;

    /// [`interp_core::Interpolator::load_words`]; at most [`protocol::message::CHUNK_WORDS_MAX`] words.
    ///
    /// # Errors
    /// The core's.
    fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<(), Fault>;

    /// [`interp_core::Interpolator::load_room`].
    fn load_room(&mut self) -> [u32; 2];

    /// [`interp_core::Interpolator::load_copy`]; one record.
    ///
    /// # Errors
    /// The core's.
    fn load_copy(&mut self, record: u32) -> Result<RecordCopy, Fault>;

    /// [`crate::realtime::RealTime::load_judged`].
    ///
    /// # Errors
    /// The core's.
    fn load_judged(&mut self, record: u32, checked: Result<(), Fault>) -> Result<(), Fault>;

    /// [`interp_core::Interpolator::load_records`].
    fn load_records(&mut self) -> u32;

    /// [`interp_core::Interpolator::load_check`]; one record.
    ///
    /// # Errors
    /// The core's.
    fn load_check(&mut self, record: u32) -> Result<(), Fault>;

    /// [`interp_core::Interpolator::load_finish`] through [`crate::realtime::RealTime`].
    ///
    /// # Errors
    /// The core's.
    fn load_finish(&mut self) -> Result<(), Fault>;

    /// The profile that the board keeps, if any.
    fn profile(&self) -> Option<&Profile>;

    /// Keeps a profile beyond a power cut; none: forgets it. Takes some milliseconds.
    ///
    /// # Errors
    /// The storage cannot be written: the profile is as before.
    fn keep_profile(&mut self, profile: Option<&Profile>) -> Result<(), StorageError>;

    /// [`crate::realtime::RealTime::motion`].
    fn motion(&mut self) -> MotionStatus;

    /// Work offsets and tool length.
    fn offsets(&mut self) -> Offsets;

    /// Keeps work offsets and tool length beyond a power cut.
    ///
    /// # Errors
    /// The storage cannot be written: they are as before.
    fn keep_offsets(&mut self, offsets: &Offsets) -> Result<(), StorageError>;

    /// How far the last run came; none where none was journalled. Takes some milliseconds.
    fn journal(&mut self) -> Option<Journal>;

    /// Journals how far a run came. Takes 0.2 ms, and is held back where a word would delay a tick.
    ///
    /// # Errors
    /// The storage cannot be written, or is full until the next power-up.
    fn keep_journal(&mut self, journal: &Journal) -> Result<(), StorageError>;

    /// Journals the end of the run that the newest record is of, where [`Self::keep_journal`] finds the storage full.
    ///
    /// # Errors
    /// The storage cannot be written.
    fn end_journal(&mut self) -> Result<(), StorageError>;

    /// Sets the record that is written when the supply falls; none: nothing is written then. To be set again after each [`Self::keep_journal`].
    fn prepare_journal(&mut self, journal: Option<&Journal>);

    /// [`crate::realtime::RealTime::place`].
    fn place(&mut self) -> Option<RunStart>;

    /// Where jobs are kept.
    type JobFlash: NorFlash;

    /// The jobs that the board keeps.
    fn jobs(&mut self) -> &mut JobStore<Self::JobFlash>;

    /// Header and number of words of the loaded job; none where none is loaded, or it is streamed.
    fn loaded(&mut self) -> Option<(Header, u32)>;

    /// Copies words of the loaded job from an offset on; returns their number.
    fn loaded_words(&mut self, offset: u32, words: &mut [i32]) -> usize;

    /// The board's own settings of the drives: those of a job that has none, on a board without a profile.
    fn own_steps(&mut self) -> StepConfig;

    /// [`crate::realtime::RealTime::set_steps`].
    ///
    /// # Errors
    /// Refused while a run is under way.
    fn set_steps(&mut self, checked: &CheckedSteps) -> Result<(), Fault>;

    /// Queues an instruction for the next tick of the sample timer.
    ///
    /// # Errors
    /// [`Busy`] where the queue is full.
    fn send(&mut self, instruction: Instruction) -> Result<(), Busy>;

    /// Executes the host's order for drives and home immediately.
    ///
    /// # Errors
    /// The reason of the refusal; nothing has changed.
    fn order(&mut self, order: Order) -> Result<(), Reason>;

    /// [`crate::realtime::RealTime::may_start`].
    ///
    /// # Errors
    /// Why no run may start.
    fn may_start(&mut self) -> Result<(), Reason>;

    /// [`crate::realtime::RealTime::may_start_next`].
    ///
    /// # Errors
    /// Why no run of this job may start.
    fn may_start_next(&mut self, home_nm: Option<[i32; 3]>) -> Result<(), Reason>;

    /// Reports a sign of life of the host: a request that the session answered.
    fn heard(&mut self);

    /// Sets simulated inputs; false where the board reads real ones.
    fn simulate(&mut self, lines: InputLines) -> bool {
        let _ = lines;
        false
    }

    /// Whether earlier instructions are still queued: a queued start must not be applied to another job than
    /// the one loaded when it was sent.
    fn instructions_wait(&mut self) -> bool;

    /// [`crate::realtime::RealTime::start_waits`].
    fn start_waits(&mut self) -> bool;
}
