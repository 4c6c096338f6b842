//! One axis: its steps in a period, and the slots of their pulses.

use super::scale::Scale;
use super::{BUFFER_WORDS, SLOTS};

/// Bits of a slot's fraction: 22 leave ten for the slot, so that every value is a valid index into the buffer.
const FRACTION_BITS: u32 = 22;

/// Error allowance of the time arithmetic, units of 2^-22 slots: 1/2048 slot; f32 rounding is below 4e-4 slots. Subtracted, so that a
/// step at the end of a period stays in that period.
const GUARD: u32 = 1 << (FRACTION_BITS - 11);

/// The drive's timing requirements, slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Timing {
    /// Pulse length, and minimum pause after a pulse.
    pub(super) pulse: u32,
    /// Time from the beginning of a period to the first pulse in a new direction.
    pub(super) setup: u32,
}

impl Timing {
    /// Minimum distance of two pulses.
    const fn spacing(self) -> u32 {
        2 * self.pulse
    }

    /// Maximum steps of a period.
    pub(super) const fn steps_max(self) -> u32 {
        match SLOTS.checked_div(self.spacing()) {
            Some(steps) => steps,
            None => 0,
        }
    }
}

/// Equidistant pulses: time of the first and distance, in slots with [`FRACTION_BITS`] fraction bits.
#[derive(Clone, Copy)]
struct Row {
    first: u32,
    distance: u32,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    /// Position, steps.
    target: i32,
    /// Remainder of the position; see [`Scale`]. Within 0 to `d`, extended by [`Scale::hold`] at both ends.
    remainder: i64,
    /// Direction of the position's last step: -1, 1, or 0 before the first.
    heading: i8,
    /// Steps that were output.
    sent: i32,
    /// Direction set on the pin: -1, 1, or 0 before the first step.
    pointing: i8,
    /// Slots of the next period that the last pulse occupies, without and with its pause.
    high: u32,
    busy: u32,
}

impl Axis {
    pub(super) const fn new() -> Self {
        Self {
            target: 0,
            remainder: 0,
            heading: 0,
            sent: 0,
            pointing: 0,
            high: 0,
            busy: 0,
        }
    }

    pub(super) const fn position(&self) -> i32 {
        self.sent
    }

    pub(super) const fn is_negative(&self) -> bool {
        self.pointing < 0
    }

    /// Sets the position of the axis, without steps.
    pub(super) fn place(&mut self, scale: &Scale, nm: i32) {
        let (steps, remainder) = scale.divide(scale.d / 2, nm.into());
        self.target = narrow(steps);
        self.sent = self.target;
        self.remainder = remainder;
        self.heading = 0;
    }

    /// One period: adds its pulses to the slots. Returns 0, or the commanded steps where they exceed the limit.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        scale: &Scale,
        timing: Timing,
        travel_nm: i64,
        bit: u32,
        slots: &mut [u32; BUFFER_WORDS],
    ) -> u32 {
        if travel_nm == 0 && self.target == self.sent && self.busy == 0 {
            return 0;
        }
        // The remainder of a pulse that began in the last period.
        for slot in slots.iter_mut().take(self.high as usize) {
            *slot ^= bit;
        }
        let owed_before = self.target.wrapping_sub(self.sent);
        let from = self.remainder;
        let steps = self.advance(scale, travel_nm);
        let owed = self.target.saturating_sub(self.sent);
        let busy = core::mem::take(&mut self.busy);
        self.high = 0;
        if owed == 0 {
            return 0;
        }
        let way: i8 = if owed < 0 { -1 } else { 1 };
        let turns = way != self.pointing;
        if turns && busy > 0 {
            // Not within a pulse or its pause.
            return excess(steps, owed, timing);
        }
        self.pointing = way;
        let count = owed.unsigned_abs();
        let row = if owed_before == 0 && !turns {
            even(scale, timing, from, travel_nm, busy)
        } else {
            let free_from = if turns { busy.max(timing.setup) } else { busy };
            spread(timing, free_from, count)
        };
        let sent = self.fill(row, count, timing, bit, slots);
        self.sent = if way < 0 {
            self.sent.wrapping_sub_unsigned(sent)
        } else {
            self.sent.wrapping_add_unsigned(sent)
        };
        excess(steps, self.target.saturating_sub(self.sent), timing)
    }

    /// Moves the position, and returns its steps. A single reverse step is made only once the position is [`Scale::hold`] beyond the
    /// midpoint between two steps.
    #[inline(always)]
    fn advance(&mut self, scale: &Scale, travel_nm: i64) -> i32 {
        let (steps, remainder) = scale.divide(self.remainder, travel_nm);
        self.remainder = remainder;
        if steps == 1 && self.heading < 0 && remainder < scale.hold {
            self.remainder += scale.d;
        } else if steps == -1 && self.heading > 0 && remainder >= scale.d - scale.hold {
            self.remainder -= scale.d;
        } else if steps != 0 {
            self.heading = if steps < 0 { -1 } else { 1 };
            let steps = narrow(steps);
            self.target = self.target.wrapping_add(steps);
            return steps;
        }
        0
    }

    /// Adds those of these pulses that fit to the slots, and returns their number.
    #[inline(always)]
    fn fill(
        &mut self,
        row: Row,
        count: u32,
        timing: Timing,
        bit: u32,
        slots: &mut [u32; BUFFER_WORDS],
    ) -> u32 {
        const LAST: u32 = (SLOTS << FRACTION_BITS) - 1;
        let Some(room) = LAST.checked_sub(row.first) else {
            return 0;
        };
        let fit = room.checked_div(row.distance).unwrap_or(0) + 1;
        let count = count.min(fit);
        for slot in 0..timing.pulse {
            add(
                slots,
                row.first + (slot << FRACTION_BITS),
                row.distance,
                count,
                bit,
            );
        }
        let last = (row.first + (count - 1) * row.distance) >> FRACTION_BITS;
        self.high = (last + timing.pulse).saturating_sub(SLOTS);
        self.busy = (last + timing.spacing()).saturating_sub(SLOTS);
        count
    }
}

/// Pulses at the times at which a uniform motion crosses the midpoints between steps. `busy`: occupied slots at the beginning.
#[inline(always)]
fn even(scale: &Scale, timing: Timing, from: i64, travel_nm: i64, busy: u32) -> Row {
    let to_first = if travel_nm < 0 { from + 1 } else { scale.d - from };
    // Relative errors of 2^-24 each are below 4e-4 slots at the period's end.
    #[allow(clippy::cast_precision_loss, reason = "24 bits tell times to 1e-4 of a slot")]
    let (to_first, travel) = (
        to_first.max(0) as f32,
        travel_nm.unsigned_abs() as f32 * scale.n_f32,
    );
    #[allow(clippy::cast_precision_loss, reason = "exact: 1000 times a power of two")]
    let per_unit = (u64::from(SLOTS) << FRACTION_BITS) as f32 / travel;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "not negative; what does not fit saturates, and lies past the period's end"
    )]
    let (first, distance) = ((to_first * per_unit) as u32, (scale.d_f32 * per_unit) as u32);
    Row {
        first: first.saturating_sub(GUARD).max(busy << FRACTION_BITS),
        distance: distance.max(timing.spacing() << FRACTION_BITS),
    }
}

/// A number of pulses distributed uniformly over the free part of the period.
#[inline(always)]
fn spread(timing: Timing, free_from: u32, count: u32) -> Row {
    let first = free_from << FRACTION_BITS;
    let room = (SLOTS - free_from.min(SLOTS)) << FRACTION_BITS;
    let least = timing.spacing() << FRACTION_BITS;
    let distance = room.checked_div(count).unwrap_or(0);
    if distance < least {
        Row {
            first,
            distance: least,
        }
    } else {
        Row {
            first: first + distance / 2,
            distance,
        }
    }
}

/// Sets the bit in the slots of a pulse.
#[inline(always)]
fn add(slots: &mut [u32; BUFFER_WORDS], first: u32, distance: u32, count: u32, bit: u32) {
    let mut place = first;
    let mut pulse = || {
        // Ten bits are always within the buffer, so the compiler removes the bounds check.
        if let Some(slot) = slots.get_mut((place >> FRACTION_BITS) as usize) {
            *slot ^= bit;
        }
        place = place.wrapping_add(distance);
    };
    for _ in 0..count / 4 {
        pulse();
        pulse();
        pulse();
        pulse();
    }
    for _ in 0..count % 4 {
        pulse();
    }
}

/// 0, or the commanded steps where they exceed the period's limit, or where the steps carried over exceed it.
#[inline(always)]
fn excess(steps: i32, owed: i32, timing: Timing) -> u32 {
    let most = timing.steps_max();
    let asked = steps.unsigned_abs().max(owed.unsigned_abs());
    if asked > most { asked } else { 0 }
}

/// Steps fit an i32: the position has 32 bits of nanometres, and a step is at least 2 nm.
#[allow(
    clippy::cast_possible_truncation,
    reason = "the position has 32 bits of nanometres, and a step is two at least"
)]
const fn narrow(steps: i64) -> i32 {
    steps as i32
}
