//! The tool centre's path over one pass as a function of the contact's arc length.

use glam::DVec3;
use oracle::{Oracle, OracleError};

/// Segments of a smooth span with tabulated arc lengths. On each, three Gauss points integrate the contact's speed.
const PIECES: usize = 256;
/// Nodes and weights of the three-point Gauss-Legendre rule on [-1, 1].
const GAUSS: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];
/// Step of the finite differences, as a share of a smooth span: truncation of about 1e-5 for features of a
/// tenth of the span, rounding of 1e-9.
const STEP_SHARE: f64 = 1e-3;
/// Least distance from a span's end at which derivatives are evaluated, as a share of the span; nearer points are extrapolated. Beyond the end
/// the derivatives belong to another span, and near a pole the normal has a precision of 1e-16 only at this distance.
const INSIDE: f64 = 1e-5;

/// A curve at one parameter value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurvePoint {
    /// The tool centre CL, mm.
    pub cl_mm: DVec3,
    /// dCL / d(parameter).
    pub cl_velocity: DVec3,
    /// Speed of the contact, d(arc) / d(parameter).
    pub cc_speed: f64,
}

/// Position and derivatives of the tool centre by the contact's arc length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathPoint {
    /// CL, mm.
    pub cl_mm: DVec3,
    /// dCL/ds.
    pub first: DVec3,
    /// Second derivative, 1/mm.
    pub second: DVec3,
    /// Third derivative, 1/mm^2.
    pub third: DVec3,
}

type Curve<'a> = Box<dyn Fn(f64) -> CurvePoint + Send + Sync + 'a>;

/// Parameters and arc lengths of the segments of a smooth span.
struct SmoothSpan {
    parameters: Vec<f64>,
    arcs: Vec<f64>,
}

/// One pass, smooth between its breaks.
pub struct PassPath<'a> {
    curve: Curve<'a>,
    spans: Vec<SmoothSpan>,
    breaks: Vec<f64>,
}

impl<'a> PassPath<'a> {
    /// A path as a function of a parameter; `parameters`: its ends and the breaks between them, ascending.
    #[must_use]
    pub fn new(parameters: &[f64], curve: impl Fn(f64) -> CurvePoint + Send + Sync + 'a) -> Self {
        let curve: Curve<'a> = Box::new(curve);
        let mut breaks = vec![0.0];
        let mut spans = Vec::new();
        let mut arc = 0.0;
        for ends in parameters.windows(2) {
            let mut span = SmoothSpan {
                parameters: vec![ends[0]],
                arcs: vec![arc],
            };
            #[allow(clippy::cast_precision_loss, reason = "small counts")]
            let place = |k: usize| ends[0] + (ends[1] - ends[0]) * k as f64 / PIECES as f64;
            for k in 0..PIECES {
                arc += gauss(&curve, place(k), place(k + 1));
                span.parameters.push(place(k + 1));
                span.arcs.push(arc);
            }
            spans.push(span);
            breaks.push(arc);
        }
        Self { curve, spans, breaks }
    }

    /// The pass of a job at a side parameter.
    ///
    /// # Errors
    /// [`OracleError::Degenerate`] where the surface has no normal on it.
    pub fn of_pass(oracle: &'a Oracle, side: f64) -> Result<Self, OracleError> {
        Self::between(oracle, side, oracle.path_range())
    }

    /// The part of the pass at a side parameter between two path parameters, in any order.
    ///
    /// # Errors
    /// [`OracleError::Degenerate`] where the surface has no normal on it.
    pub fn between(oracle: &'a Oracle, side: f64, ends: [f64; 2]) -> Result<Self, OracleError> {
        let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let inner = oracle.surface.breaks(oracle.along);
        let inner = inner.iter().copied().filter(|at| *at > low && *at < high);
        let parameters: Vec<f64> = std::iter::once(low).chain(inner).chain([high]).collect();
        for ends in parameters.windows(2) {
            for place in [ends[0], 0.5 * (ends[0] + ends[1]), ends[1]] {
                oracle.offset(place, side)?;
            }
        }
        Ok(Self::new(&parameters, move |path| {
            oracle.offset(path, side).map_or_else(
                |_| CurvePoint::default(),
                |at| CurvePoint {
                    cl_mm: at.contact.cl_mm,
                    cl_velocity: at.cl_velocity,
                    cc_speed: at.contact.path_speed,
                },
            )
        }))
    }

    /// Length of the contact's path, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.breaks[self.breaks.len() - 1]
    }

    /// Arc lengths between which the path is smooth, from 0 to its length.
    #[must_use]
    pub fn breaks(&self) -> &[f64] {
        &self.breaks
    }

    /// The span that contains an arc length; at a break, the one after it.
    #[must_use]
    pub fn span_of(&self, arc_mm: f64) -> usize {
        let last = self.spans.len();
        self.breaks.partition_point(|at| *at <= arc_mm).clamp(1, last) - 1
    }

    /// Position only, mm.
    #[must_use]
    pub fn position(&self, arc_mm: f64) -> DVec3 {
        let span = self.span_of(arc_mm);
        (self.curve)(self.parameter(span, arc_mm)).cl_mm
    }

    /// Position and derivatives within this span, ends included.
    #[must_use]
    pub fn at(&self, span: usize, arc_mm: f64) -> PathPoint {
        let parameters = &self.spans[span].parameters;
        let (low, high) = (parameters[0], parameters[PIECES]);
        let (inside, step) = (INSIDE * (high - low), STEP_SHARE * (high - low));
        let exact = self.parameter(span, arc_mm);
        let here = exact.clamp(low + inside, high - inside);
        let middle = here.clamp(low + inside + step, high - inside - step);
        let first = |parameter: f64| {
            let at = (self.curve)(parameter);
            at.cl_velocity / at.cc_speed
        };
        let arc = |from: f64, to: f64| gauss(&self.curve, from, to);
        let [before, at, after] = [middle - step, middle, middle + step].map(first);
        let (left, right) = (arc(middle - step, middle), arc(middle, middle + step));
        let off = arc(middle, here);
        let [rising, falling] = [(after - at) / right, (at - before) / left];
        let third = 2.0 * (rising - falling) / (left + right);
        // Newton's interpolation through the three points, differentiated.
        let second = falling + 0.5 * third * (left + 2.0 * off);
        PathPoint {
            cl_mm: (self.curve)(exact).cl_mm,
            first: first(here) + arc(here, exact) * second,
            second,
            third,
        }
    }

    /// Arc length at a parameter, mm.
    #[must_use]
    pub fn arc_of(&self, parameter: f64) -> f64 {
        let before = |span: &SmoothSpan| span.parameters[PIECES] < parameter;
        let span = &self.spans[self.spans.partition_point(before).min(self.spans.len() - 1)];
        let piece = span
            .parameters
            .partition_point(|at| *at <= parameter)
            .clamp(1, PIECES)
            - 1;
        span.arcs[piece] + gauss(&self.curve, span.parameters[piece], parameter)
    }

    /// Parameter at an arc length: linear in its segment, then two Newton steps.
    fn parameter(&self, span: usize, arc_mm: f64) -> f64 {
        let SmoothSpan { parameters, arcs } = &self.spans[span];
        let piece = arcs.partition_point(|at| *at <= arc_mm).clamp(1, PIECES) - 1;
        let (low, high) = (parameters[piece], parameters[piece + 1]);
        let whole = arcs[piece + 1] - arcs[piece];
        if whole <= 0.0 {
            return low;
        }
        let mut parameter = low + (high - low) * ((arc_mm - arcs[piece]) / whole).clamp(0.0, 1.0);
        for _ in 0..2 {
            let missing = arc_mm - arcs[piece] - gauss(&self.curve, low, parameter);
            let speed = (self.curve)(parameter).cc_speed;
            if speed > 0.0 {
                parameter = (parameter + missing / speed).clamp(low, high);
            }
        }
        parameter
    }
}

/// Arc length of the contact between two parameters of a segment.
fn gauss(curve: &Curve<'_>, from: f64, to: f64) -> f64 {
    let half = 0.5 * (to - from);
    GAUSS
        .iter()
        .map(|(node, weight)| weight * curve(from + half * (1.0 + node)).cc_speed)
        .sum::<f64>()
        * half
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of radius 8 for the centre, the contact at 3/4 of it, with a non-uniform parameter.
    fn circle() -> PassPath<'static> {
        let (centre, contact) = (8.0, 6.0);
        PassPath::new(&[0.0, 0.4, 1.0], move |t| {
            let (angle, rate) = (t + 0.5 * t * t, 1.0 + t);
            let (sin, cos) = angle.sin_cos();
            CurvePoint {
                cl_mm: DVec3::new(centre * cos, centre * sin, 0.0),
                cl_velocity: DVec3::new(-centre * rate * sin, centre * rate * cos, 0.0),
                cc_speed: contact * rate,
            }
        })
    }

    #[test]
    fn derivatives_are_those_of_a_circle() {
        let path = circle();
        assert!((path.length_mm() - 9.0).abs() < 1e-12);
        for (k, span) in (0..=100).map(|k| (k, None)).chain([(0, Some(0)), (32, Some(1))]) {
            let arc = if span == Some(1) {
                path.breaks()[1]
            } else {
                9.0 * f64::from(k) / 100.0
            };
            let at = path.at(span.unwrap_or_else(|| path.span_of(arc)), arc);
            let (sin, cos) = (arc / 6.0).sin_cos();
            let exact = [
                [8.0 * cos, 8.0 * sin],
                [-8.0 / 6.0 * sin, 8.0 / 6.0 * cos],
                [-8.0 / 36.0 * cos, -8.0 / 36.0 * sin],
                [8.0 / 216.0 * sin, -8.0 / 216.0 * cos],
            ];
            for ((ours, exact), by) in [at.cl_mm, at.first, at.second, at.third]
                .into_iter()
                .zip(exact)
                .zip([1e-8, 1e-7, 1e-5, 1e-4])
            {
                assert!((ours[0] - exact[0]).abs() < by, "{arc}: {ours:?} for {exact:?}");
                assert!((ours[1] - exact[1]).abs() < by, "{arc}: {ours:?} for {exact:?}");
            }
            let position = path.position(arc);
            assert!((path.arc_of(path.parameter(path.span_of(arc), arc)) - arc).abs() < 1e-9);
            assert!((position[0] - 8.0 * cos).abs() < 1e-10);
        }
    }
}
