//! The side parameter as one integer over all spans, [`WHOLE`] from boundary to boundary, and the direction in which fronts move over it.

use crate::job::program::Job;
use crate::job::region::{FRONT_SIDE_BITS, front_side_scale, front_side_width};
use crate::math::arith::{power_of_two, to_f32};
use crate::sample::SpanParameter;

/// The whole side parameter.
pub(crate) const WHOLE: i32 = 1 << FRONT_SIDE_BITS;
/// The unit as a share of the whole.
pub(crate) const UNIT: f32 = power_of_two(-28);

/// Bits of a fine distance below the unit.
pub(crate) const FINE_BITS: u32 = 12;

/// A distance in fine units.
pub(crate) const fn fine(distance: i32) -> i64 {
    (distance as i64) << FINE_BITS
}

/// A fine distance in units, rounded down.
#[allow(clippy::cast_possible_truncation, reason = "distances are below 2^31 units")]
pub(crate) const fn coarse(distance: i64) -> i32 {
    (distance >> FINE_BITS) as i32
}

/// The direction of the fronts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Direction {
    /// Side parameter of the first front.
    pub(crate) origin: i32,
    /// Fronts move towards the end of the parameter, or towards its start.
    pub(crate) forwards: bool,
    /// Distance to the boundary.
    pub(crate) end: i32,
}

impl Direction {
    /// From the first boundary to the other.
    pub(crate) const FROM_EDGE: Self = Self {
        origin: 0,
        forwards: true,
        end: WHOLE,
    };
    /// From the last boundary to the first.
    pub(crate) const FROM_END: Self = Self {
        origin: WHOLE,
        forwards: false,
        end: WHOLE,
    };
    /// From the middle to the end, and from the middle to the start.
    pub(crate) const FROM_MIDDLE: [Self; 2] = [
        Self {
            origin: WHOLE / 2,
            forwards: true,
            end: WHOLE / 2,
        },
        Self {
            origin: WHOLE / 2,
            forwards: false,
            end: WHOLE / 2,
        },
    ];

    /// From the first line of a cell of a region to its last one.
    pub(crate) const fn over(first: i32, last: i32) -> Self {
        Self {
            origin: first,
            forwards: first <= last,
            end: (last - first).saturating_abs(),
        }
    }

    /// The side parameter at a distance from the first front.
    pub(crate) const fn side(&self, distance: i32) -> i32 {
        if self.forwards {
            self.origin.saturating_add(distance)
        } else {
            self.origin.saturating_sub(distance)
        }
    }

    /// Distance of a side parameter from the first front.
    pub(crate) const fn distance(&self, side: i32) -> i32 {
        if self.forwards {
            side - self.origin
        } else {
            self.origin - side
        }
    }

    /// Fronts are followed beyond the boundary up to here.
    pub(crate) const fn cap(&self) -> i32 {
        self.end + self.end / 2
    }

    /// The side parameter of the boundary.
    pub(crate) fn boundary(&self, job: &Job<'_>) -> SpanParameter {
        if self.forwards {
            SpanParameter {
                span: job.header.side_spans.saturating_sub(1),
                fraction: u64::MAX,
            }
        } else {
            SpanParameter { span: 0, fraction: 0 }
        }
    }

    /// The side parameter at a distance from the first front, fine units.
    const fn whole(&self, distance: i64) -> i64 {
        let origin = fine(self.origin);
        if self.forwards {
            origin.wrapping_add(distance)
        } else {
            origin.wrapping_sub(distance)
        }
    }

    /// Sign of the side parameter's change.
    pub(crate) const fn sign(&self) -> f32 {
        if self.forwards { 1.0 } else { -1.0 }
    }
}

/// A span of the side parameter, moved by neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SideCursor {
    /// Units per unit of the parameter's widths.
    scale: f32,
    span: u16,
    start: i32,
    width: i32,
}

impl SideCursor {
    pub(crate) const NONE: Self = Self {
        scale: 1.0,
        span: 0,
        start: 0,
        width: WHOLE,
    };

    /// At the first span of a job.
    pub(crate) fn new(job: &Job<'_>) -> Self {
        let spans = job.header.side_spans;
        let mut sum = 0.0;
        for span in 0..spans {
            sum += job.side_width(span);
        }
        let mut cursor = Self {
            scale: front_side_scale(sum),
            ..Self::NONE
        };
        cursor.width = cursor.width_of(job, 0);
        cursor
    }

    /// Width of a span, units of the fronts; the last span has the rest of the whole.
    fn width_of(&self, job: &Job<'_>, span: u16) -> i32 {
        if span + 1 >= job.header.side_spans {
            return WHOLE.saturating_sub(self.start).max(1);
        }
        front_side_width(job.side_width(span), self.scale)
    }

    pub(crate) const fn span(&self) -> u16 {
        self.span
    }

    /// Start of the span, and its width.
    pub(crate) const fn start(&self) -> i32 {
        self.start
    }

    pub(crate) const fn width(&self) -> i32 {
        self.width
    }

    /// Moves to the span after this one, or to that before it, if there is one.
    pub(crate) fn step(&mut self, job: &Job<'_>, after: bool) {
        if after && self.span + 1 < job.header.side_spans {
            self.span += 1;
            self.start = self.start.saturating_add(self.width);
            self.width = self.width_of(job, self.span);
        } else if !after && self.span > 0 {
            self.span -= 1;
            self.width = front_side_width(job.side_width(self.span), self.scale);
            self.start = self.start.saturating_sub(self.width);
        }
    }

    /// Whether a distance from the first front, fine units, is on a span after this one (true) or before it (false); `None` on this span, and where there is no further span.
    pub(crate) fn side_of(&self, job: &Job<'_>, direction: &Direction, distance: i64) -> Option<bool> {
        let from_start = direction.whole(distance).wrapping_sub(fine(self.start));
        if from_start < 0 && self.span > 0 {
            Some(false)
        } else if from_start > fine(self.width) && self.span + 1 < job.header.side_spans {
            Some(true)
        } else {
            None
        }
    }

    /// Moves to the span of a distance from the first front, fine units. Returns the side parameter, and the span's share of the whole parameter.
    pub(crate) fn seek(
        &mut self,
        job: &Job<'_>,
        direction: &Direction,
        distance: i64,
    ) -> (SpanParameter, f32) {
        let distance = distance.min(fine(direction.end)).max(0);
        let whole = direction.whole(distance);
        let at = coarse(whole);
        let spans = job.header.side_spans;
        for _ in 0..crate::job::SPANS_MAX {
            if at < self.start && self.span > 0 {
                self.step(job, false);
            } else if at.wrapping_sub(self.start) >= self.width && self.span + 1 < spans {
                self.step(job, true);
            } else {
                break;
            }
        }
        let fraction = if at >= WHOLE {
            u64::MAX
        } else {
            let within = whole.wrapping_sub(fine(self.start)).max(0).cast_unsigned();
            let width = u64::from(self.width.cast_unsigned());
            let fraction = (within << (32 - FINE_BITS)).checked_div(width).unwrap_or(0);
            fraction.min(0xffff_ffff) << 32
        };
        let place = SpanParameter {
            span: self.span,
            fraction,
        };
        (place, to_f32(self.width) * UNIT)
    }
}
