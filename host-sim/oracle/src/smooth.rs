//! A parameter whose spans have widths for which the first derivative is continuous over the knots, also where the surface's own parametrisation jumps:
//! passes of constant scallop height are smooth in it, and steps to straight ones are continuous.

use job::Along;

use super::contact::Oracle;

/// Change of the derivative's length over a knot, a share, above which the parametrisation jumps.
const JUMP: f64 = 1e-3;
/// Distance from a knot, a share of the range, at which it is measured.
const BESIDE: f64 = 1e-9;

/// A span: its start, the place of that in the smooth parameter, and the smooth parameter's change per unit of the own.
#[derive(Clone, Copy, Debug)]
struct Span {
    start: f64,
    place: f64,
    scale: f64,
}

/// The smooth parameter of one direction.
#[derive(Clone, Debug)]
pub(super) struct SmoothParameter {
    spans: Vec<Span>,
    end: f64,
}

impl SmoothParameter {
    pub(super) fn new(oracle: &Oracle, along: Along) -> Self {
        let other = match along {
            Along::U => Along::V,
            Along::V => Along::U,
        };
        let [low, high] = oracle.surface.range(other);
        let middle = 0.5 * (low + high);
        let speed = |at: f64| {
            let (u, v) = match along {
                Along::U => (at, middle),
                Along::V => (middle, at),
            };
            oracle.surface.tangent(u, v, along).length()
        };
        let breaks = oracle.surface.breaks(along);
        let [first, last] = oracle.surface.range(along);
        let beside = BESIDE * (last - first);
        let mut spans: Vec<Span> = Vec::new();
        let mut scale = 1.0;
        for start in &breaks[..breaks.len() - 1] {
            let place = spans.last().map_or(*start, |span| span.at(*start));
            if !spans.is_empty() {
                let ratio = speed(start + beside) / speed(start - beside);
                if ratio.is_finite() && (ratio - 1.0).abs() > JUMP {
                    scale *= ratio;
                }
            }
            let start = *start;
            spans.push(Span { start, place, scale });
        }
        Self { spans, end: last }
    }

    fn span(&self, is_before: impl Fn(&Span) -> bool) -> Span {
        let index = self.spans.partition_point(is_before);
        self.spans[index.max(1) - 1]
    }

    /// The smooth parameter at a place.
    pub(super) fn of(&self, at: f64) -> f64 {
        self.span(|span| span.start <= at).at(at)
    }

    /// The place of a smooth parameter, and the change of the smooth parameter per unit of the own.
    pub(super) fn own(&self, place: f64) -> (f64, f64) {
        let span = self.span(|span| span.place <= place);
        (span.start + (place - span.place) / span.scale, span.scale)
    }

    /// Change of the smooth parameter per unit of the own at a place; at a knot, after it.
    pub(super) fn scale(&self, at: f64) -> f64 {
        self.span(|span| span.start <= at).scale
    }

    /// The place at a distance after another; in units of the own parameter there.
    pub(super) fn advanced(&self, from: f64, distance: f64) -> f64 {
        let span = self.span(|span| span.start <= from);
        let to = from + distance;
        if self.scale(to) == span.scale {
            return to;
        }
        self.own(span.at(from) + distance * span.scale).0
    }

    /// Distance from one place to another, in units of the own parameter at the first.
    pub(super) fn distance(&self, from: f64, to: f64) -> f64 {
        let scale = self.scale(from);
        if self.scale(to) == scale {
            to - from
        } else {
            (self.of(to) - self.of(from)) / scale
        }
    }

    /// The middle of the whole range.
    pub(super) fn middle(&self) -> f64 {
        self.own(0.5 * (self.spans[0].place + self.of(self.end))).0
    }
}

impl Span {
    fn at(&self, own: f64) -> f64 {
        self.place + (own - self.start) * self.scale
    }
}
