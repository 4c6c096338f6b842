//! Steps 5 and 6: from pass to pass, `v_next = v + min(dv over the pass)`, until the side parameter reaches its other
//! boundary; the last pass lies exactly on it.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::{Header, Spacing};
use crate::math::arith::{fraction_32, fraction_from_f32, fraction_to_f32};
use crate::sample::SpanParameter;

/// Maximum side span boundaries that an interval crosses, which bounds the loop. A longer interval
/// ends on the last of them, closer than the scallop limit requires.
pub(crate) const WALK_MAX: u16 = 16;

/// The next pass's side parameter, `interval` (in units of the side parameter) beyond `from`, at most the end of the last span.
/// Fractions are truncated to 2^-32, so that the reported parameter is the one that is used. `width` returns a span's
/// width in units of the side parameter.
///
/// # Errors
/// [`FaultKind::IntervalTooSmall`] where the interval does not advance the parameter.
pub(crate) fn next_side(
    from: SpanParameter,
    interval: f32,
    spans: u16,
    width: impl Fn(u16) -> f32,
) -> Result<SpanParameter> {
    const SPAN: u64 = 1 << 32;
    let mut at = from.fraction >> 32;
    let mut rest = interval;
    let end = spans.min(from.span.saturating_add(WALK_MAX));
    for span in from.span..end {
        let room = if at == 0 {
            width(span)
        } else {
            width(span) * fraction_32(u32::try_from(SPAN - at).unwrap_or(u32::MAX))
        };
        if rest < room {
            let step = fraction_from_f32(rest / width(span)) >> 32;
            if step == 0 && span == from.span {
                return Err(Fault::new(FaultKind::IntervalTooSmall, interval / width(span)));
            }
            let fraction = (at + step).min(SPAN - 1) << 32;
            return Ok(SpanParameter { span, fraction });
        }
        rest -= room;
        at = 0;
    }
    Ok(if end < spans {
        SpanParameter {
            span: end,
            fraction: 0,
        }
    } else {
        SpanParameter {
            span: spans.saturating_sub(1),
            fraction: u64::MAX,
        }
    })
}

/// Distance from one side parameter to a later one, in units of the side parameter.
pub(crate) fn apart(from: SpanParameter, to: SpanParameter, width: impl Fn(u16) -> f32) -> f32 {
    let fraction =
        |place: SpanParameter| fraction_32(u32::try_from(place.fraction >> 32).unwrap_or(u32::MAX));
    if from.span == to.span {
        let between = to.fraction.saturating_sub(from.fraction);
        return width(from.span) * fraction_to_f32(between);
    }
    let mut sum = width(from.span) * (1.0 - fraction(from)) + width(to.span) * fraction(to);
    let between = from.span.saturating_add(1)..to.span.min(from.span.saturating_add(WALK_MAX + 1));
    for span in between {
        sum += width(span);
    }
    sum
}

/// Part of a step-over from a pass that its own balls leave within the scallop limit.
const ONE_SIDED: f32 = 0.49;

/// The step from a pass that is a single point, which is cut with one normal.
pub(crate) fn from_point(step: f32) -> f32 {
    ONE_SIDED * step
}

/// A step that may lead to the last boundary where that is a single point: only from a part of a step-over, so that another pass lies in between.
pub(crate) fn to_point(header: &Header, step: f32, from: SpanParameter, width: impl Fn(u16) -> f32) -> f32 {
    if header.spacing != Spacing::ExactToPoint {
        return step;
    }
    let end = SpanParameter {
        span: header.side_spans.saturating_sub(1),
        fraction: u64::MAX,
    };
    let room = apart(from, end, width);
    if step >= room && room > 0.5 * step {
        room - ONE_SIDED * step
    } else {
        step
    }
}

/// Whether a pass at this side parameter is the last.
pub(crate) fn is_last(side: SpanParameter, spans: u16) -> bool {
    side.span + 1 >= spans && side.fraction == u64::MAX
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fraction(place: SpanParameter) -> f64 {
        f64::from(place.span) + place.fraction as f64 / 2_f64.powi(64)
    }

    #[test]
    fn goes_on_in_the_next_spans_measure() {
        let widths = [1.0, 0.5, 0.25, 4.0];
        let width = |span: u16| widths[usize::from(span)];
        let at = |span, fraction: f64| SpanParameter {
            span,
            fraction: ((fraction * 4_294_967_296.0) as u64) << 32,
        };
        let near = |from, interval, want: f64| {
            let got = fraction(next_side(from, interval, 4, width).unwrap());
            assert!((got - want).abs() < 1e-6, "{got} for {want}");
        };
        near(at(0, 0.25), 0.5, 0.75);
        near(at(0, 0.75), 0.5, 1.5);
        near(at(1, 0.75), 0.125 + 0.125, 2.5);
        near(at(0, 0.75), 0.25 + 0.5 + 0.125, 2.5);
        near(at(0, 0.0), 1.0, 1.0);
        near(at(0, 0.5), 0.5 + 0.5 + 0.25 + 2.0, 3.5);
        assert_eq!(
            next_side(at(3, 0.5), 2.0, 4, width).unwrap(),
            SpanParameter {
                span: 3,
                fraction: u64::MAX
            }
        );
        assert_eq!(
            next_side(at(1, 0.5), f32::INFINITY, 4, width).unwrap(),
            SpanParameter {
                span: 3,
                fraction: u64::MAX
            }
        );
        assert_eq!(
            next_side(at(1, 0.5), 1e-12, 4, width).unwrap_err().kind,
            FaultKind::IntervalTooSmall
        );
        // At most WALK_MAX boundaries per step, and the last pass still lies at the end.
        let even = |_| 1.0;
        let near = next_side(at(2, 0.5), f32::INFINITY, 40, even).unwrap();
        assert_eq!(near, at(2 + WALK_MAX, 0.0));
        let last = next_side(at(30, 0.5), f32::INFINITY, 40, even).unwrap();
        assert!(is_last(last, 40));
        assert!(is_last(
            SpanParameter {
                span: 3,
                fraction: u64::MAX
            },
            4
        ));
        assert!(!is_last(at(3, 0.999), 4));
    }
}
