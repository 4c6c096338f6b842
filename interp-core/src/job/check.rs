//! The checks of a job's header: ranges, and what goes together.

use crate::command::OVERRIDE_MAX;
use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::front_words;
use crate::job::region::REGION_SPANS_MAX;
use crate::job::stream::WINDOW_MIN;
use crate::job::{
    AxisLimits, CELLS_MAX, Header, OVERRUN_MAX_MM, SPANS_MAX, STEP_MAX_MM, Spacing, SurfaceKind,
};
use crate::math::number::nm_to_mm;

pub(crate) fn check_header(header: &Header) -> Result<()> {
    let spans_max = match header.kind {
        SurfaceKind::Polynomial | SurfaceKind::Rational => SPANS_MAX,
        SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => 1,
    };
    for spans in [header.path_spans, header.side_spans] {
        if !(1..=spans_max).contains(&spans) {
            return Err(Fault::new(FaultKind::BadHeader, f32::from(spans)));
        }
    }
    let spans = header.path_spans.max(header.side_spans);
    let begins_elsewhere = header.spacing.is_constant() && header.spacing != Spacing::Constant;
    if header.edges > 0 && (begins_elsewhere || spans > REGION_SPANS_MAX) {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.edges)));
    }
    let of_whole = header.spacing.is_constant() && header.edges == 0;
    if header.links > 0 && (of_whole || header.axes.is_none()) {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.links)));
    }
    if front_words(header).is_none() {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.path_spans)));
    }
    if header.window > 0 {
        check_streamed(header)?;
    } else if header.strips > 0 {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.strips)));
    }
    let ranges = [
        (header.ball_radius_mm, f32::MIN_POSITIVE, 1000.0),
        (header.feed_mm_s, 1e-3, 10_000.0),
        (header.scallop_mm, f32::MIN_POSITIVE, header.ball_radius_mm),
        (header.period_s, 1e-5, 0.1),
    ];
    for (value, least, most) in ranges {
        // Positive comparisons, so that a NaN is rejected.
        if !(value >= least && value <= most) {
            return Err(Fault::new(FaultKind::BadHeader, value));
        }
    }
    header
        .axes
        .as_ref()
        .map_or(Ok(()), |axes| check_axes(header, axes))
}

/// A job that is loaded while it runs: straight passes over a grid. Strips of rows are those of a region.
fn check_streamed(header: &Header) -> Result<()> {
    let is_grid = matches!(header.kind, SurfaceKind::Polynomial | SurfaceKind::Rational);
    let has_strips = header.strips > 0;
    if !is_grid
        || header.spacing.is_constant()
        || header.window < WINDOW_MIN
        || has_strips != (header.edges > 0)
    {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.window)));
    }
    Ok(())
}

/// Ranges of the axis limits, within which the step of a period fits its integer and no product of the planner overflows.
fn check_axes(header: &Header, axes: &AxisLimits) -> Result<()> {
    let bad = |value| Err(Fault::new(FaultKind::BadHeader, value));
    let all = [
        (axes.velocity_mm_s, 1e-3, 1e5),
        (axes.acceleration_mm_s2, 1e-2, 1e7),
        (axes.jerk_mm_s3, 1e-1, 1e9),
        ([axes.chord_mm; 3], 1e-6, 1e3),
    ];
    for (values, least, most) in all {
        for value in values {
            if !(value >= least && value <= most) {
                return bad(value);
            }
        }
    }
    if !(axes.plunge_mm >= 0.0 && axes.plunge_mm <= 1e3) {
        return bad(axes.plunge_mm);
    }
    if !(axes.overrun_mm >= 0.0 && axes.overrun_mm <= OVERRUN_MAX_MM) {
        return bad(axes.overrun_mm);
    }
    // The feed at the maximum override has to fit the step of a period.
    if OVERRIDE_MAX * header.feed_mm_s * header.period_s > STEP_MAX_MM {
        return bad(header.feed_mm_s);
    }
    if usize::from(header.path_spans) > CELLS_MAX {
        return bad(f32::from(header.path_spans));
    }
    let [x, y, _] = axes.home_nm;
    let end_nm = axes.end_nm.unwrap_or(axes.home_nm);
    let end_height_nm = axes.end_nm.map_or(axes.safe_z_nm, |_| axes.end_height_nm);
    for place in [
        axes.home_nm,
        end_nm,
        [x, y, axes.safe_z_nm],
        [x, y, end_height_nm],
    ] {
        for (place, [least, most]) in place.into_iter().zip(axes.travel_nm) {
            if !(least..=most).contains(&place) {
                return bad(nm_to_mm(place));
            }
        }
    }
    Ok(())
}
