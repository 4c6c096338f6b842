//! The events of a board, in order and each once, whatever the line loses.
//!
//! ```text
//! frame with number n ──► n is the next ──► ready ──► poll, event
//!                    └──► n is later ─────► held, and the numbers before it are missing ──► Repeat, or given up
//! status ─► announces the last number;  counts the ends (halts), so that an end is known whose event never came
//! ```

use std::collections::{BTreeMap, VecDeque};

use interp_core::Sample;
use protocol::message::{PassDigest, Status};

/// Events asked for at once: as many as take some 10 ms on the line.
const REPEAT_MAX: u32 = 4;

/// Events that a board sends without a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The next sample, in order.
    Sample(Sample),
    /// A pass is over.
    Pass(PassDigest),
    /// The ticks of a `Run` request are used up, or the run is over.
    Halted(Status),
    /// This number of events did not come, and the board does not keep them any more. They came before the events that follow.
    Lost(u32),
}

/// What a line lost of a session's events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineLosses {
    /// Events that came when they were asked for again.
    pub repeated: u64,
    /// Events that never came.
    pub lost: u64,
}

/// The events received so far.
#[derive(Debug)]
pub(super) struct Received {
    ready: VecDeque<Event>,
    /// Number of the next event.
    next: u32,
    /// Events that came before an earlier one.
    held: BTreeMap<u32, Vec<Event>>,
    /// Number of the board's last event, as its last status reported.
    announced: u32,
    /// Count of the last end that was delivered, or that was before the session or the run; none before the first status.
    halts: Option<u32>,
    losses: LineLosses,
}

impl Received {
    /// Before the first event of a session.
    pub(super) const fn new() -> Self {
        Self {
            ready: VecDeque::new(),
            next: 1,
            held: BTreeMap::new(),
            announced: 0,
            halts: None,
            losses: LineLosses { repeated: 0, lost: 0 },
        }
    }

    /// What was lost so far.
    pub(super) const fn losses(&self) -> LineLosses {
        self.losses
    }

    /// Takes the events of a frame. One that has come already is dropped.
    pub(super) fn take(&mut self, number: u32, events: Vec<Event>) {
        if number >= self.next {
            self.held.insert(number, events);
            self.deliver();
        }
    }

    /// Events up to the first that is missing become ready.
    fn deliver(&mut self) {
        while let Some(events) = self.held.remove(&self.next) {
            self.next += 1;
            self.ready.extend(events);
        }
    }

    /// A status reported the number of the board's last event.
    pub(super) fn announce(&mut self, last: u32) {
        self.announced = self.announced.max(last);
    }

    /// Number of the first missing event, and how many to ask for at once.
    pub(super) fn missing(&self) -> Option<(u32, u8)> {
        let count = self.gap_end().checked_sub(self.next).filter(|count| *count > 0)?;
        Some((self.next, u8::try_from(count.min(REPEAT_MAX)).unwrap_or(1)))
    }

    /// Number after the last of the events that are missing in a row.
    fn gap_end(&self) -> u32 {
        let held = self.held.first_key_value().map(|(number, _)| *number);
        held.unwrap_or_else(|| self.announced.saturating_add(1))
    }

    /// Number of the next event.
    pub(super) const fn next(&self) -> u32 {
        self.next
    }

    /// Events came that had been asked for again.
    pub(super) fn count_repeated(&mut self, events: u32) {
        self.losses.repeated += u64::from(events);
    }

    /// The missing events before this number will not come: at least the first, at most those missing in a row.
    pub(super) fn give_up(&mut self, before: u32) {
        let before = before.max(self.next + 1).min(self.gap_end());
        let count = before.saturating_sub(self.next);
        if count > 0 {
            self.losses.lost += u64::from(count);
            self.ready.push_back(Event::Lost(count));
            self.next = before;
            self.deliver();
        }
    }

    /// Ends up to this count are over: only a later one is delivered.
    pub(super) const fn ends_are_over(&mut self, halts: u32) {
        self.halts = Some(halts);
    }

    /// Whether this count of ends tells one that was not delivered.
    pub(super) fn tells_an_end(&self, halts: u32) -> bool {
        // The counter goes round: a difference in the lower half is later.
        self.halts
            .is_none_or(|last| (1..1 << 31).contains(&halts.wrapping_sub(last)))
    }

    /// The end that a status tells takes the place of an event that never came.
    pub(super) fn end(&mut self, status: Status) {
        self.ready.push_back(Event::Halted(status));
    }

    /// Whether no event is ready.
    pub(super) fn is_empty(&self) -> bool {
        self.ready.is_empty()
    }

    /// Drops the events that are ready.
    pub(super) fn drop_ready(&mut self) {
        self.ready.clear();
    }

    /// The next event. An end that is over already, because a status reported it, is passed over.
    pub(super) fn pop(&mut self) -> Option<Event> {
        loop {
            let event = self.ready.pop_front()?;
            if let Event::Halted(status) = &event {
                if !self.tells_an_end(status.halts) {
                    continue;
                }
                self.halts = Some(status.halts);
            }
            return Some(event);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(pass: u32) -> Event {
        Event::Pass(PassDigest {
            pass,
            ..PassDigest::default()
        })
    }

    fn halted(halts: u32) -> Event {
        Event::Halted(Status {
            halts,
            ..Status::default()
        })
    }

    fn all(received: &mut Received) -> Vec<Event> {
        std::iter::from_fn(|| received.pop()).collect()
    }

    #[test]
    fn events_come_in_order_and_once() {
        let mut received = Received::new();
        for number in [1, 4, 2, 2, 1, 5, 3, 4] {
            received.take(number, vec![pass(number)]);
        }
        assert_eq!(all(&mut received), [1, 2, 3, 4, 5].map(pass));
        assert_eq!(
            (received.missing(), received.losses()),
            (None, LineLosses::default())
        );
    }

    #[test]
    fn a_gap_is_seen_by_the_next_event_or_by_a_status() {
        let mut received = Received::new();
        received.take(1, vec![pass(1)]);
        assert_eq!(received.missing(), None);
        received.announce(3);
        assert_eq!(received.missing(), Some((2, 2)));
        received.take(9, vec![pass(9)]);
        assert_eq!(received.missing(), Some((2, 4)));
        received.take(2, vec![pass(2)]);
        received.give_up(6);
        received.give_up(99);
        assert_eq!(
            all(&mut received),
            [pass(1), pass(2), Event::Lost(3), Event::Lost(3), pass(9)]
        );
        assert_eq!((received.losses().lost, received.missing()), (6, None));
        // There is nothing to give up.
        received.give_up(99);
        assert_eq!((received.next(), all(&mut received)), (10, vec![]));
    }

    #[test]
    fn an_end_is_delivered_once_whether_a_status_or_its_event_tells_it() {
        let mut received = Received::new();
        received.ends_are_over(u32::MAX);
        assert!(!received.tells_an_end(u32::MAX) && !received.tells_an_end(u32::MAX - 1));
        assert!(received.tells_an_end(0));
        received.take(1, vec![halted(u32::MAX)]);
        assert_eq!(received.pop(), None);
        received.end(Status::default());
        received.take(2, vec![halted(0)]);
        received.take(3, vec![halted(1)]);
        assert_eq!(all(&mut received), [halted(0), halted(1)]);
    }
}
