//! The queue of events from the sample task to the link.
//!
//! The status of an end is three times as long as any other event, and rare: it has a short queue of its own, and the
//! queue of events keeps only its place.

use controller::machine::{Event, Events};
use heapless::spsc::{Consumer, Producer, Queue};
use interp_core::sample::Sample;
use protocol::message::{PassDigest, Status};

/// Places for the status of an end. One is made at most in a period, and the link reads each before the request that can bring the next.
const STATUS_PLACES: usize = 4;

/// An event's place in the queue.
#[derive(Debug)]
enum Entry {
    Sample(Sample),
    Pass(PassDigest),
    Room(u32),
    /// The next one of the statuses.
    Halted,
}

/// The queues' memory, for `PLACES` events less one.
pub(crate) struct EventMemory<const PLACES: usize> {
    entries: Queue<Entry, PLACES>,
    statuses: Queue<Status, STATUS_PLACES>,
}

impl<const PLACES: usize> EventMemory<PLACES> {
    /// Empty queues.
    pub(crate) const fn new() -> Self {
        Self {
            entries: Queue::new(),
            statuses: Queue::new(),
        }
    }

    /// The writer's end and the reader's.
    pub(crate) fn split(&'static mut self) -> (EventQueue, EventSource) {
        let (entries_in, entries_out) = self.entries.split();
        let (statuses_in, statuses_out) = self.statuses.split();
        (
            EventQueue {
                entries: entries_in,
                statuses: statuses_in,
            },
            EventSource {
                entries: entries_out,
                statuses: statuses_out,
            },
        )
    }
}

/// The sample task's end.
pub(crate) struct EventQueue {
    entries: Producer<'static, Entry>,
    statuses: Producer<'static, Status>,
}

impl Events for EventQueue {
    #[inline]
    fn has_room(&self) -> bool {
        self.entries.capacity() - self.entries.len() >= Self::TICK_MAX && self.statuses.ready()
    }

    fn put(&mut self, event: Event) -> bool {
        let entry = match event {
            Event::Sample(sample) => Entry::Sample(sample),
            Event::Pass(pass) => Entry::Pass(pass),
            Event::Room(room) => Entry::Room(room),
            // The status first, so that it is in its queue when the entry is read.
            Event::Halted(status) if self.entries.ready() && self.statuses.enqueue(status).is_ok() => {
                Entry::Halted
            }
            Event::Halted(_) => return false,
        };
        self.entries.enqueue(entry).is_ok()
    }
}

/// The link's end.
pub(crate) struct EventSource {
    entries: Consumer<'static, Entry>,
    statuses: Consumer<'static, Status>,
}

impl EventSource {
    /// Whether there is an event.
    pub(crate) fn ready(&self) -> bool {
        self.entries.ready()
    }

    /// Takes out all events, in order; whether there was one. A function of its own, so that no request has an event on the stack.
    #[inline(never)]
    pub(crate) fn drain(&mut self, mut take: impl FnMut(&Event)) -> bool {
        let mut was_one = false;
        while let Some(event) = self.dequeue() {
            take(&event);
            was_one = true;
        }
        was_one
    }

    /// The next event, if there is one.
    fn dequeue(&mut self) -> Option<Event> {
        Some(match self.entries.dequeue()? {
            Entry::Sample(sample) => Event::Sample(sample),
            Entry::Pass(pass) => Event::Pass(pass),
            Entry::Room(room) => Event::Room(room),
            Entry::Halted => Event::Halted(self.statuses.dequeue()?),
        })
    }
}
