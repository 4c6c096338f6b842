//! What the link needs of the machine: the seam between the two halves of the board.

use interp_core::{
    command::Command,
    fault::Fault,
    job::{Header, SurfaceKind, patches_max},
    steps::CheckedSteps,
};
use protocol::message::{
    CHUNK_WORDS_MAX, Clock, Description, InputLines, PassDigest, Reason, Report, Status,
};

use crate::safety::Order;

/// What the link asks of the real-time half; taken up with the next tick of the sample timer, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instruction {
    /// The operator's command; goes to the interpolator with the next period that passes.
    Command(Command),
    /// What drives time.
    Clock(Clock),
    /// Lockstep: so many more periods.
    Run {
        /// Periods, added to those that are left.
        ticks: u32,
    },
    /// What a run tells the host.
    Report(Report),
    /// Feed override, percent.
    Override {
        /// At most [`protocol::message::OVERRIDE_MAX_PERCENT`].
        percent: u8,
    },
}

/// What the real-time half tells the link, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "an item of a queue of fixed places; there is no allocator to box with"
)]
pub enum Event {
    /// A sample of the run.
    Sample(interp_core::sample::Sample),
    /// A pass is over.
    Pass(PassDigest),
    /// The ticks of a `Run` are used up, or the run is over.
    Halted(Status),
}

/// Where the real-time half puts its events: a queue that never makes it wait.
pub trait Events {
    /// Most events that one tick puts in.
    const TICK_MAX: usize = 3;

    /// Whether so many find room.
    fn has_room(&self) -> bool;

    /// Puts an event in; false where it found no room, and is lost.
    fn put(&mut self, event: Event) -> bool;
}

/// No room in the queue of instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy;

/// The description of a board with this store and period; a name longer than the message holds is left out.
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

/// The real-time half as the link sees it. Every call is short: it may hold up the sample timer for its time.
pub trait Machine {
    /// The board and what it can hold.
    fn description(&mut self) -> Description;

    /// The status, without the link's own counter `frames_bad`.
    fn status(&mut self) -> Status;

    /// [`interp_core::Interpolator::load_begin`] by way of [`crate::realtime::RealTime`].
    ///
    /// # Errors
    /// The core's.
    fn load_begin(&mut self, header: &Header, words: u32) -> Result<(), Fault>;

    /// [`interp_core::Interpolator::load_words`]; at most [`protocol::message::CHUNK_WORDS_MAX`] words.
    ///
    /// # Errors
    /// The core's.
    fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<(), Fault>;

    /// [`interp_core::Interpolator::load_records`].
    fn load_records(&mut self) -> u32;

    /// [`interp_core::Interpolator::load_check`]; one record.
    ///
    /// # Errors
    /// The core's.
    fn load_check(&mut self, record: u32) -> Result<(), Fault>;

    /// [`interp_core::Interpolator::load_finish`] by way of [`crate::realtime::RealTime`].
    ///
    /// # Errors
    /// The core's.
    fn load_finish(&mut self) -> Result<(), Fault>;

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

    /// Does what the host asks of drives and home, at once.
    ///
    /// # Errors
    /// Why not; nothing has changed then.
    fn order(&mut self, order: Order) -> Result<(), Reason>;

    /// [`crate::realtime::RealTime::may_start`].
    ///
    /// # Errors
    /// Why no run may start.
    fn may_start(&mut self) -> Result<(), Reason>;

    /// A frame of the host arrived, whole.
    fn heard(&mut self);

    /// Gives the board these inputs; false where it reads its own.
    fn simulate(&mut self, lines: InputLines) -> bool {
        let _ = lines;
        false
    }

    /// Whether instructions sent before still wait in the queue: a start that waits there is not to meet another job than
    /// was loaded when it was sent.
    fn instructions_wait(&mut self) -> bool;
}
