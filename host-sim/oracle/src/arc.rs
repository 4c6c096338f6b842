//! Arc length along a pass: the integral of |A| over the path parameter.

use super::contact::Oracle;

/// Nodes and weights of the three-point Gauss-Legendre rule on [-1, 1]: ±sqrt(3/5) and 0; 5/9 and 8/9.
const NODE: f64 = 0.774_596_669_241_483_4;
const WEIGHT_OUTER: f64 = 5.0 / 9.0;
const WEIGHT_MIDDLE: f64 = 8.0 / 9.0;
/// Largest length of a quadrature interval, as a share of a smooth span. The rule's relative error is `h^6 f'''''' / (2 016 000 f)`:
/// 1e-16 for an |A| whose Taylor series converges over a quarter of the span.
const PIECE_SHARE: f64 = 1.0 / 64.0;
/// Largest number of quadrature intervals of a span: bounds the loop for an arc over a whole pass.
const PIECES_MAX: f64 = 64.0;

impl Oracle {
    /// Arc length of the pass at `side` between two path parameters, mm: positive if `to` is above `from`. Relative
    /// error 1e-12 or the rounding of `to - from`, whichever is larger.
    #[must_use]
    pub fn arc_length(&self, from: f64, to: f64, side: f64) -> f64 {
        self.arc_between(&self.surface.breaks(self.along), from, to, side)
    }

    /// As [`Oracle::arc_length`], for a step `by` given more precisely than the difference of two parameters.
    #[must_use]
    pub fn arc_of_step(&self, from: f64, by: f64, side: f64) -> f64 {
        let to = from + by;
        let rounded = to - from;
        if rounded == 0.0 {
            return by * self.path_speed(from, side);
        }
        self.arc_length(from, to, side) * (by / rounded)
    }

    /// As [`Oracle::arc_length`], with the breaks precomputed.
    pub(super) fn arc_between(&self, breaks: &[f64], from: f64, to: f64, side: f64) -> f64 {
        if from > to {
            return -self.arc_between(breaks, to, from, side);
        }
        let last = breaks.len() - 1;
        let span_of = |t: f64| breaks.partition_point(|knot| *knot <= t).clamp(1, last) - 1;
        let (first, end) = (span_of(from), span_of(to));
        let mut arc = 0.0;
        for span in first..=end {
            let low = if span == first { from } else { breaks[span] };
            let high = if span == end { to } else { breaks[span + 1] };
            arc += self.smooth_arc(low, high, side, breaks[span + 1] - breaks[span]);
        }
        arc
    }

    /// Arc within one span.
    fn smooth_arc(&self, from: f64, to: f64, side: f64, span: f64) -> f64 {
        let pieces = ((to - from) / (PIECE_SHARE * span)).ceil().clamp(1.0, PIECES_MAX);
        let half = 0.5 * (to - from) / pieces;
        let mut sum = 0.0;
        let mut piece = 0.0;
        while piece < pieces {
            let middle = from + (2.0 * piece + 1.0) * half;
            let outer =
                self.path_speed(middle - NODE * half, side) + self.path_speed(middle + NODE * half, side);
            sum += WEIGHT_OUTER * outer + WEIGHT_MIDDLE * self.path_speed(middle, side);
            piece += 1.0;
        }
        sum * half
    }

    /// |A|, mm per unit of the path parameter.
    fn path_speed(&self, path: f64, side: f64) -> f64 {
        let (u, v) = self.swapped(path, side);
        self.surface.tangent(u, v, self.along).length()
    }
}
