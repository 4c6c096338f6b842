//! Steps 5 and 6: from pass to pass, `v_next = v + min(dv over the pass)`, until the side parameter reaches its other
//! boundary; the last pass lies exactly on it.

use crate::arith::{fraction_32, fraction_from_f32};
use crate::fault::{Fault, FaultKind, Result};
use crate::job::SPANS_MAX;
use crate::sample::Place;

/// The next pass's side parameter, `interval` fractions of this side span further; the end of the last span at most.
/// Fractions are kept to 2^-32, so that the place that is reported is the one that is used. `width` gives the span's
/// width in units of the side parameter: an interval that reaches past a span's end goes on in the next span's measure.
///
/// # Errors
/// [`FaultKind::IntervalTooSmall`] where the interval does not advance the parameter.
pub(crate) fn next_side(from: Place, interval: f32, spans: u16, width: impl Fn(u16) -> f32) -> Result<Place> {
    const SPAN: u64 = 1 << 32;
    let mut at = from.fraction >> 32;
    let mut rest = interval;
    // At most SPANS_MAX rounds: a surface has no more spans.
    for span in from.span..spans.min(SPANS_MAX) {
        let room = SPAN - at;
        let step = fraction_from_f32(rest) >> 32;
        if rest < 1.0 && step < room {
            if step == 0 && span == from.span {
                return Err(Fault::new(FaultKind::IntervalTooSmall, interval));
            }
            return Ok(Place {
                span,
                fraction: (at + step) << 32,
            });
        }
        if span + 1 >= spans {
            break;
        }
        let covered = if at == 0 {
            1.0
        } else {
            fraction_32(u32::try_from(room).unwrap_or(u32::MAX))
        };
        let over = (rest - covered) * width(span) / width(span + 1);
        rest = if over > 0.0 { over } else { 0.0 };
        at = 0;
    }
    Ok(Place {
        span: spans.saturating_sub(1),
        fraction: u64::MAX,
    })
}

/// Whether a pass there is the last.
pub(crate) fn is_last(side: Place, spans: u16) -> bool {
    side.span + 1 >= spans && side.fraction == u64::MAX
}

/// Words of the span widths that head a job's data.
pub(crate) fn width_words(path_spans: u16, side_spans: u16) -> u32 {
    u32::from(path_spans) + u32::from(side_spans)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fraction(place: Place) -> f64 {
        f64::from(place.span) + place.fraction as f64 / 2_f64.powi(64)
    }

    #[test]
    fn goes_on_in_the_next_spans_measure() {
        let widths = [1.0, 0.5, 0.25, 4.0];
        let width = |span: u16| widths[usize::from(span)];
        let at = |span, fraction: f64| Place {
            span,
            fraction: ((fraction * 4_294_967_296.0) as u64) << 32,
        };
        let near = |from, interval, want: f64| {
            let got = fraction(next_side(from, interval, 4, width).unwrap());
            assert!((got - want).abs() < 1e-6, "{got} for {want}");
        };
        near(at(0, 0.25), 0.5, 0.75);
        near(at(0, 0.75), 0.5, 1.5);
        near(at(0, 0.75), 0.25 + 0.5 + 0.125, 2.5);
        near(at(0, 0.0), 1.0, 1.0);
        near(at(0, 0.5), 0.5 + 0.5 + 0.25 + 2.0, 3.5);
        assert_eq!(
            next_side(at(3, 0.5), 0.5, 4, width).unwrap(),
            Place {
                span: 3,
                fraction: u64::MAX
            }
        );
        assert_eq!(
            next_side(at(1, 0.5), f32::INFINITY, 4, width).unwrap(),
            Place {
                span: 3,
                fraction: u64::MAX
            }
        );
        assert_eq!(
            next_side(at(1, 0.5), 1e-12, 4, width).unwrap_err().kind,
            FaultKind::IntervalTooSmall
        );
        assert!(is_last(
            Place {
                span: 3,
                fraction: u64::MAX
            },
            4
        ));
        assert!(!is_last(at(3, 0.999), 4));
    }
}
