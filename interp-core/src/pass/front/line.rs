//! A pass on a front: its pieces, each within one interval between stations and one span of the side parameter.

use crate::job::program::Job;
use crate::job::stations::Stations;
use crate::math::arith::{power_of_two, sqrt, to_f32, truncated};
use crate::pass::front::side::{Direction, SideCursor, fine};
use crate::pass::front::spline::Cubic;
use crate::pass::front::table::{Column, Pair, Table};
use crate::sample::SpanParameter;
use crate::surface::SideCurve;

/// 2^-31, the unit of a place within an interval.
const WITHIN: f32 = power_of_two(-31);
/// Bisections of the place at which a front crosses a knot of the side parameter.
const BISECTIONS: u8 = 31;

/// A front that a pass lies on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrontLine {
    pub(super) direction: Direction,
    pub(super) stations: Stations,
    /// Its columns in the table.
    pub(super) pair: Pair,
    /// A span of the side parameter.
    pub(super) cursor: SideCursor,
    /// Whether start and end of the pass are on the last side boundary.
    pub(crate) are_on_boundary: [bool; 2],
    /// Pieces of the pass, about.
    pub(crate) pieces: u16,
}

/// A piece of a pass on a front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrontPiece {
    interval: u16,
    /// The span of the side parameter.
    cursor: SideCursor,
    /// The piece ends at the knot before the span, or after it.
    ends_at_knot: Option<bool>,
    /// Whether start and end are on the last side boundary.
    are_on_boundary: [bool; 2],
    /// Number of the piece on the pass, from 0.
    pub(crate) number: u16,
}

/// A piece's place: side span, and range of fractions of the path span in the direction of travel.
pub(crate) struct PiecePlace {
    pub(crate) piece: FrontPiece,
    pub(crate) span: u16,
    pub(crate) side_span: u16,
    pub(crate) range: [u64; 2],
}

impl FrontPiece {
    /// Whether the piece ends at a knot of the side parameter.
    pub(crate) const fn is_at_knot(&self) -> bool {
        self.ends_at_knot.is_some()
    }
}

impl FrontLine {
    fn cubic(&self, job: &Job<'_>, interval: u16) -> Cubic {
        let table = Table::new(job.rest(), self.stations, [self.pair; 2]);
        let length = self.stations.length(job, interval);
        Cubic::of(&table, [Column::Front, Column::Slope], interval, length)
    }

    /// The first piece of a pass with these ends.
    pub(crate) fn first(&self, job: &Job<'_>, ends: &[SpanParameter; 2], reversed: bool) -> PiecePlace {
        let [start, _] = *ends;
        let (interval, within) = self.stations.interval(start);
        let at = self.cubic(job, interval).fine(within);
        let mut cursor = self.cursor;
        cursor.seek(job, &self.direction, at);
        self.piece(job, ends, reversed, start, (interval, cursor, 0))
    }

    /// The piece after another; none at the end of the pass. `end`: the end of the other, a fraction in the direction of travel.
    pub(crate) fn next(
        &self,
        job: &Job<'_>,
        ends: &[SpanParameter; 2],
        reversed: bool,
        (piece, end): (&FrontPiece, u64),
    ) -> Option<PiecePlace> {
        let [_, last] = *ends;
        let turned = |fraction: u64| if reversed { !fraction } else { fraction };
        let span = self.stations.span(piece.interval);
        if span == last.span && end >= turned(last.fraction) {
            return None;
        }
        let mut cursor = piece.cursor;
        let number = piece.number.saturating_add(1);
        if let Some(after) = piece.ends_at_knot {
            cursor.step(job, after);
        }
        let (interval, start) = match end.checked_add(1) {
            Some(from) => {
                let start = SpanParameter {
                    span,
                    fraction: turned(from),
                };
                (self.stations.interval(start).0, start)
            }
            None => {
                let interval = if reversed {
                    piece.interval.checked_sub(1)?
                } else {
                    piece.interval.checked_add(1)?
                };
                let span = self.stations.span(interval);
                let fraction = turned(0);
                (interval, SpanParameter { span, fraction })
            }
        };
        Some(self.piece(job, ends, reversed, start, (interval, cursor, number)))
    }

    /// The piece from a place to the end of the interval, of the pass or of the side span.
    fn piece(
        &self,
        job: &Job<'_>,
        ends: &[SpanParameter; 2],
        reversed: bool,
        from: SpanParameter,
        (interval, cursor, number): (u16, SideCursor, u16),
    ) -> PiecePlace {
        let [first, last] = *ends;
        let turned = |fraction: u64| if reversed { !fraction } else { fraction };
        let start = turned(from.fraction);
        let mut end = start | u64::MAX >> self.stations.bits;
        let last_end = turned(last.fraction);
        let mut is_end = false;
        if from.span == last.span && last_end <= end {
            (end, is_end) = (last_end.max(start), true);
        }
        // Places within the interval.
        let within = |fraction: u64| {
            let place = SpanParameter {
                span: from.span,
                fraction: turned(fraction),
            };
            self.stations.interval(place).1
        };
        let cubic = self.cubic(job, interval);
        let mut ends_at_knot = None;
        let [low, high] = [within(start), within(end)];
        if let Some((at, after)) = self.leaves(job, &cubic, &cursor, [low, high]) {
            let place = self.stations.place_within(interval, at);
            let fraction = turned(place.fraction);
            if fraction < end {
                (end, is_end) = (fraction.max(start), false);
                ends_at_knot = Some(after);
            }
        }
        let [from_boundary, to_boundary] = self.are_on_boundary;
        PiecePlace {
            piece: FrontPiece {
                interval,
                cursor,
                ends_at_knot,
                are_on_boundary: [from_boundary && from == first, to_boundary && is_end],
                number,
            },
            span: from.span,
            side_span: cursor.span(),
            range: [start, end],
        }
    }

    /// The last place before a front leaves the side span between two places of an interval, and whether it leaves it at its end.
    fn leaves(
        &self,
        job: &Job<'_>,
        cubic: &Cubic,
        cursor: &SideCursor,
        [from, to]: [i32; 2],
    ) -> Option<(i32, bool)> {
        let outside = |at: i32| cursor.side_of(job, &self.direction, cubic.fine(at));
        let mut beyond = None;
        for at in cubic.extrema().into_iter().flatten() {
            let is_between = (at - from).signum() * (to - at).signum() > 0;
            if is_between && outside(at).is_some() {
                beyond = Some(at);
            }
        }
        let beyond = match (outside(to), beyond) {
            (_, Some(at)) => at,
            (Some(_), None) => to,
            (None, None) => return None,
        };
        let after = outside(beyond)?;
        let (mut low, mut high) = (from, beyond);
        for _ in 0..BISECTIONS {
            let middle = i32::midpoint(low, high);
            if outside(middle).is_some() {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some((low, after))
    }

    /// The side parameter on a piece, as a function of the path.
    pub(crate) fn side_curve(&self, job: &Job<'_>, piece: &FrontPiece) -> SideCurve {
        let cubic = self.cubic(job, piece.interval);
        let direction = &self.direction;
        let [origin, span_start] = [fine(direction.origin), fine(piece.cursor.start())];
        let own = fine(cubic.start);
        let sign = if direction.forwards { 1 } else { -1 };
        let from_origin = if direction.forwards {
            own
        } else {
            own.wrapping_neg()
        };
        let turn = |value: i32| value.wrapping_mul(sign);
        SideCurve::new(
            origin.wrapping_add(from_origin).wrapping_sub(span_start),
            [cubic.first, cubic.second, cubic.third].map(turn),
            u8::try_from(cubic.shift).unwrap_or(0),
            self.stations.bits,
            piece.cursor.width(),
        )
    }

    /// Whether the piece's start and end are on the last side boundary, and whether that is the end of a side span.
    pub(crate) const fn boundary_of(&self, piece: &FrontPiece) -> ([bool; 2], bool) {
        (piece.are_on_boundary, self.direction.forwards)
    }
}

impl Cubic {
    /// Places within the interval at which the cubic has an extremum.
    pub(super) fn extrema(&self) -> [Option<i32>; 2] {
        self.extrema_over(0.0)
    }

    /// Places within the interval at which its height over a line has an extremum, by the line's rise over the interval.
    pub(super) fn extrema_over(&self, rise: f32) -> [Option<i32>; 2] {
        let rise = rise * power_of_two(self.shift.cast_signed());
        let [a, b, c] = [
            3.0 * to_f32(self.third),
            to_f32(self.second),
            to_f32(self.first) - rise,
        ];
        // a t^2 + 2 b t + c
        let root = b * b - a * c;
        if !(root >= 0.0) {
            return [None; 2];
        }
        let q = -(b + if b < 0.0 { -sqrt(root) } else { sqrt(root) });
        [q / a, c / q].map(|t| (t > 0.0 && t < 1.0).then(|| truncated(t / WITHIN)))
    }
}
