//! The latest events of a session, as they were sent, so that the host can request them again.
//!
//! A ring of bytes: for each event the length of its frame (two bytes, low one first) and the frame. A new event drops the oldest ones. Only the link touches
//! it, so it costs the sample timer nothing.

use protocol::frame::FRAME_MAX;

/// Bytes kept: about a hundred passes, or the samples of 60 to 70 periods, in which a host that reads every 20 ms misses a frame, notices, and asks.
const BYTES: usize = 4096;

/// Bytes of a frame's length.
const LENGTH_BYTES: usize = 2;

const _: () = assert!(FRAME_MAX + LENGTH_BYTES <= BYTES, "the longest event has to fit");

/// The latest events, and their numbers: 1, 2, .. without a gap.
#[derive(Debug)]
pub(crate) struct History {
    bytes: [u8; BYTES],
    /// Where the oldest event begins.
    start: usize,
    /// Bytes of all events kept.
    used: usize,
    /// Number of the oldest event kept; of the next one where none is.
    first: u32,
    /// Number of the next event.
    next: u32,
}

impl History {
    /// Before the first event of a session.
    pub(crate) const fn new() -> Self {
        Self {
            bytes: [0; BYTES],
            start: 0,
            used: 0,
            first: 1,
            next: 1,
        }
    }

    /// Begins the numbers again, for another session.
    pub(crate) const fn clear(&mut self) {
        (self.start, self.used, self.first, self.next) = (0, 0, 1, 1);
    }

    /// Number of the oldest event kept; of the next one where none is.
    pub(crate) const fn first(&self) -> u32 {
        self.first
    }

    /// Number of the next event.
    pub(crate) const fn next(&self) -> u32 {
        self.next
    }

    /// Number of the last event; 0 before the first.
    pub(crate) const fn last(&self) -> u32 {
        self.next.wrapping_sub(1)
    }

    /// Keeps the frame of the next event.
    pub(crate) fn push(&mut self, frame: &[u8]) {
        let needed = frame.len() + LENGTH_BYTES;
        while BYTES - self.used < needed && self.used > 0 {
            self.drop_oldest();
        }
        let length = u16::try_from(frame.len()).unwrap_or(0);
        for byte in length.to_le_bytes().iter().chain(frame) {
            let place = (self.start + self.used) % BYTES;
            if let Some(place) = self.bytes.get_mut(place) {
                *place = *byte;
                self.used += 1;
            }
        }
        self.next = self.next.wrapping_add(1);
    }

    /// Writes the kept events from this number on, `count` at most. False where the first one is not kept.
    pub(crate) fn repeat(&self, event: u32, count: u8, out: &mut impl FnMut(&[u8])) -> bool {
        let kept = self.next.wrapping_sub(self.first);
        let before = event.wrapping_sub(self.first);
        if before >= kept {
            return false;
        }
        let mut start = self.start;
        for index in 0..before.saturating_add(count.into()).min(kept) {
            let length = self.length_at(start);
            if index >= before {
                self.write(start + LENGTH_BYTES, length, out);
            }
            start = (start + LENGTH_BYTES + length) % BYTES;
        }
        true
    }

    fn drop_oldest(&mut self) {
        let length = LENGTH_BYTES + self.length_at(self.start);
        self.start = (self.start + length) % BYTES;
        self.used = self.used.saturating_sub(length);
        self.first = self.first.wrapping_add(1);
    }

    /// Length of the frame of the event that begins here.
    fn length_at(&self, start: usize) -> usize {
        let byte = |at: usize| self.bytes.get(at % BYTES).copied().unwrap_or(0);
        usize::from(u16::from_le_bytes([byte(start), byte(start + 1)]))
    }

    /// Writes bytes of the ring, in two parts where it begins anew between them.
    fn write(&self, start: usize, length: usize, out: &mut impl FnMut(&[u8])) {
        let start = start % BYTES;
        let end = start + length;
        let parts = [start..end.min(BYTES), 0..end.saturating_sub(BYTES)];
        for part in parts.into_iter().filter(|part| !part.is_empty()) {
            if let Some(part) = self.bytes.get(part) {
                out(part);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// The frame of event n: its number over and over, of a length that differs from event to event.
    fn frame(event: u32) -> Vec<u8> {
        let length = 1 + (event as usize * 37) % FRAME_MAX;
        std::iter::repeat_n(event.to_le_bytes()[0], length).collect()
    }

    fn repeated(history: &History, event: u32, count: u8) -> Option<Vec<u8>> {
        let mut sent = Vec::new();
        history
            .repeat(event, count, &mut |bytes| sent.extend_from_slice(bytes))
            .then_some(sent)
    }

    #[test]
    fn nothing_is_kept_before_the_first() {
        let history = History::new();
        assert_eq!((history.first(), history.last()), (1, 0));
        for event in [0, 1, 2, u32::MAX] {
            assert_eq!(repeated(&history, event, 1), None);
        }
    }

    /// After any number of turns of the ring, every event from the first kept to the last equals the pushed one, read alone and in rows.
    #[test]
    fn the_latest_are_kept_as_they_were() {
        let mut history = History::new();
        for event in 1..=400 {
            history.push(&frame(event));
            assert_eq!(history.last(), event);
            let first = history.first();
            let bytes: usize = (first..=event)
                .map(|event| frame(event).len() + LENGTH_BYTES)
                .sum();
            // One more would not have fitted.
            let one_more = first.checked_sub(1).filter(|event| *event > 0);
            assert!(
                bytes <= BYTES
                    && one_more.is_none_or(|event| bytes + frame(event).len() + LENGTH_BYTES > BYTES)
            );
            for asked in first..=event {
                assert_eq!(repeated(&history, asked, 1), Some(frame(asked)));
            }
            let row = (first..=event).take(9).flat_map(frame).collect();
            assert_eq!(repeated(&history, first, 9), Some(row));
            assert_eq!(repeated(&history, event, 200), Some(frame(event)));
            for gone in [first - 1, event + 1] {
                assert_eq!(repeated(&history, gone, 1), None);
            }
        }
        assert!(history.first() > 300);
        history.clear();
        assert_eq!((history.first(), history.last()), (1, 0));
    }
}
