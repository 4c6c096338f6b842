//! Arc length along a pass: the integral of |A| over the path parameter.

use job::Along;

use super::contact::Oracle;
use super::smooth::SmoothParameter;

/// Outer node of the three-point Gauss-Legendre rule on [-1, 1]: sqrt(3/5); the nodes are -`NODE`, 0 and `NODE`.
const NODE: f64 = 0.774_596_669_241_483_4;
/// Weight of the two outer nodes.
const WEIGHT_OUTER: f64 = 5.0 / 9.0;
/// Weight of the middle node.
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

    /// Arc of the curve whose side parameter is the parabola through three points (path, side), from the second to the third, mm, in parameters in which the curve is smooth.
    pub(super) fn arc_of_curve(
        &self,
        breaks: &[f64],
        [path, side]: &[SmoothParameter; 2],
        points: [[f64; 2]; 3],
    ) -> f64 {
        let [before, from, to] = points.map(|[x, y]| [path.of(x), side.of(y)]);
        let first = (to[1] - from[1]) / (to[0] - from[0]);
        let last = (from[1] - before[1]) / (from[0] - before[0]);
        let second = (first - last) / (to[0] - before[0]);
        let side_at = |x: f64| from[1] + (x - from[0]) * (first + second * (x - to[0]));
        let slope = |x: f64| first + second * (2.0 * x - from[0] - to[0]);
        let speed = |x: f64| {
            let ((path, along_scale), (side, across_scale)) = (path.own(x), side.own(side_at(x)));
            let (u, v) = self.swapped(path, side);
            let at = self.surface.at(u, v);
            let (along, across) = match self.along {
                Along::U => (at.u, at.v),
                Along::V => (at.v, at.u),
            };
            (along / along_scale + across * (slope(x) / across_scale)).length()
        };
        let (low, high) = (from[0].min(to[0]), from[0].max(to[0]));
        let inner = breaks
            .iter()
            .map(|knot| path.of(*knot))
            .filter(|knot| low < *knot && *knot < high);
        let ends: Vec<f64> = [low].into_iter().chain(inner).chain([high]).collect();
        let mut sum = 0.0;
        for part in ends.windows(2) {
            let (middle, half) = (0.5 * (part[0] + part[1]), 0.5 * (part[1] - part[0]));
            let outer = speed(middle - NODE * half) + speed(middle + NODE * half);
            sum += half * (WEIGHT_OUTER * outer + WEIGHT_MIDDLE * speed(middle));
        }
        sum
    }

    /// |A|, mm per unit of the path parameter.
    fn path_speed(&self, path: f64, side: f64) -> f64 {
        let (u, v) = self.swapped(path, side);
        self.surface.tangent(u, v, self.along).length()
    }
}
