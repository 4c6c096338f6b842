//! A pass from place to place, on a line of constant side parameter or on a front, and its pieces.

use crate::job::program::Job;
use crate::job::{Header, Pattern};
use crate::math::arith::fraction_to_f32;
use crate::math::number::Bounded;
use crate::pass::front::{FrontLine, FrontPiece, PiecePlace};
use crate::pass::patch::OnFront;
use crate::pass::position::PassPosition;
use crate::sample::SpanParameter;

/// Least share of a patch that counts.
const SHARE_MIN: f32 = 1e-3;

/// A pass from place to place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Route {
    /// Side parameter of the line; of a pass on a front that of the surface's start.
    pub(crate) side: SpanParameter,
    pub(crate) reversed: bool,
    /// Start and end, by the surface's own path parameter.
    pub(crate) ends: [SpanParameter; 2],
    /// A curved pass in a region: the region reaches to its start from the end of the pass before along a boundary of the path parameter, if that ends there, too.
    pub(crate) joins: bool,
    /// The front that it lies on, if it is not a line.
    pub(crate) front: Option<FrontLine>,
}

/// A part of a pass within one patch; on a front also within one interval between its stations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) position: PassPosition,
    /// Start and end: fractions of the span in the direction of travel.
    pub(crate) range: [u64; 2],
    pub(crate) front: Option<FrontPiece>,
}

impl Route {
    pub(crate) const NONE: Self = Self {
        side: SpanParameter { span: 0, fraction: 0 },
        reversed: false,
        ends: [SpanParameter { span: 0, fraction: 0 }; 2],
        joins: false,
        front: None,
    };

    /// The whole line at a side parameter.
    pub(crate) const fn whole(side: SpanParameter, reversed: bool, path_spans: u16) -> Self {
        let near = SpanParameter { span: 0, fraction: 0 };
        let far = SpanParameter {
            span: path_spans.saturating_sub(1),
            fraction: u64::MAX,
        };
        Self {
            side,
            reversed,
            ends: if reversed { [far, near] } else { [near, far] },
            joins: false,
            front: None,
        }
    }

    /// The whole line of the pass with this number.
    pub(crate) fn of_pass(header: &Header, pass: u32, side: SpanParameter) -> Self {
        let reversed = header.pattern == Pattern::Zigzag && pass % 2 == 1;
        Self::whole(side, reversed, header.path_spans)
    }

    /// Whether a path parameter is between start and end.
    pub(crate) fn is_within(&self, path: SpanParameter) -> bool {
        let [start, end] = self.ends;
        if self.reversed {
            start > path && path > end
        } else {
            start < path && path < end
        }
    }

    /// Begins at this path parameter instead.
    pub(crate) const fn begin_at(&mut self, path: SpanParameter) {
        let [_, end] = self.ends;
        self.ends = [path, end];
        if let Some(front) = &mut self.front {
            let [_, ends_on] = front.are_on_boundary;
            front.are_on_boundary = [false, ends_on];
        }
    }

    /// A fraction in the direction of travel, from one in the surface's own direction, or back.
    pub(crate) const fn turned(&self, fraction: u64) -> u64 {
        if self.reversed { !fraction } else { fraction }
    }

    pub(crate) const fn is_on_front(&self) -> bool {
        self.front.is_some()
    }

    /// Whether it starts and whether it ends at the surface's boundaries.
    pub(crate) fn reach_boundaries(&self, job: &Job<'_>) -> [bool; 2] {
        let whole = Self::whole(self.side, self.reversed, job.header.path_spans);
        let ([start, end], [first, last]) = (self.ends, whole.ends);
        [start == first, end == last]
    }

    /// The first piece.
    pub(crate) fn first(&self, job: &Job<'_>) -> Piece {
        let [start, _] = self.ends;
        match &self.front {
            Some(front) => self.on_front(front.first(job, &self.ends, self.reversed)),
            None => self.piece(start.span),
        }
    }

    /// The last piece of a pass on a line.
    pub(crate) fn last_on_line(&self) -> Piece {
        let [_, end] = self.ends;
        self.piece(end.span)
    }

    /// The piece after another, if there is one.
    pub(crate) fn next(&self, job: &Job<'_>, piece: &Piece) -> Option<Piece> {
        if let (Some(front), Some(on)) = (&self.front, &piece.front) {
            let next = front.next(job, &self.ends, self.reversed, (on, piece.end()));
            return next.map(|next| self.on_front(next));
        }
        let [_, end] = self.ends;
        if piece.position.span == end.span {
            return None;
        }
        let next = piece.position.next(job.header.path_spans)?;
        Some(self.piece(next.span))
    }

    /// Length of a pass on a line by the path parameter: the number of its patches, of which the first and the last may be parts.
    pub(crate) fn spans(&self) -> f32 {
        let [start, end] = self
            .ends
            .map(|end| f32::from(end.span) + fraction_to_f32(end.fraction));
        (end - start).abs().at_least(SHARE_MIN)
    }

    /// The curve of a piece of a front on the patch of another; none where it is on another patch.
    pub(crate) fn curve_on_same_patch(&self, job: &Job<'_>, piece: &Piece, next: &Piece) -> Option<OnFront> {
        let (front, on) = (self.front.as_ref()?, next.front.as_ref()?);
        let (here, there) = (&piece.position, &next.position);
        let is_same = here.span == there.span && here.side.span == there.side.span;
        is_same.then(|| OnFront::new(job, front, on))
    }

    const fn on_front(&self, place: PiecePlace) -> Piece {
        let PiecePlace {
            piece,
            span,
            side_span,
            range,
        } = place;
        Piece {
            position: PassPosition {
                side: SpanParameter {
                    span: side_span,
                    fraction: 0,
                },
                reversed: self.reversed,
                span,
            },
            range,
            front: Some(piece),
        }
    }

    fn piece(&self, span: u16) -> Piece {
        let [start, end] = self.ends;
        let from = if span == start.span {
            self.turned(start.fraction)
        } else {
            0
        };
        let to = if span == end.span {
            self.turned(end.fraction)
        } else {
            u64::MAX
        };
        Piece {
            position: PassPosition {
                side: self.side,
                reversed: self.reversed,
                span,
            },
            range: [from, to],
            front: None,
        }
    }
}

impl Piece {
    pub(crate) const NONE: Self = Self {
        position: PassPosition {
            side: SpanParameter { span: 0, fraction: 0 },
            reversed: false,
            span: 0,
        },
        range: [0, u64::MAX],
        front: None,
    };

    pub(crate) const fn start(&self) -> u64 {
        let [start, _] = self.range;
        start
    }

    pub(crate) const fn end(&self) -> u64 {
        let [_, end] = self.range;
        end
    }

    /// Whether another piece of the same pass is this one.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.position.span == other.position.span && self.range == other.range
    }

    /// Whether it is as long as the patch.
    pub(crate) const fn is_whole(&self) -> bool {
        matches!(self.range, [0, u64::MAX])
    }

    /// The share of the patch that it is.
    pub(crate) fn share(&self) -> f32 {
        fraction_to_f32(self.end().saturating_sub(self.start())).at_least(SHARE_MIN)
    }
}
