//! Figures of the charts by pass, from the record and the oracle.

use super::record::PassInterval;
use oracle::Oracle;

/// Number of points along a pass at which the distance to the next pass is measured.
const PLACES: u32 = 48;

/// Distance between a pass and the next, measured on the surface across the pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gap {
    pub(super) pass: u32,
    pub(super) widest_mm: f64,
    pub(super) narrowest_mm: f64,
}

/// A last step-over shorter than its interval by more than this share was limited by the boundary.
const CUT_SHARE: f64 = 0.02;

/// Distances from every pass to the next, except for a last step-over limited by the boundary.
pub(super) fn gaps(oracle: &Oracle, passes: &[PassInterval]) -> Vec<Gap> {
    let [start, end] = oracle.path_range();
    let gap = |pass: &PassInterval| {
        let lateral = (0..=PLACES).filter_map(|k| {
            let path = start + (end - start) * f64::from(k) / f64::from(PLACES);
            let (u, v) = oracle.swapped(path, pass.side);
            oracle
                .contact(u, v)
                .ok()
                .map(|contact| contact.lateral_speed * pass.step.abs())
        });
        let [narrowest, widest] = lateral.fold([f64::INFINITY, 0.0], |[low, high], gap: f64| {
            [low.min(gap), high.max(gap)]
        });
        Gap {
            pass: pass.pass,
            widest_mm: widest,
            narrowest_mm: narrowest.min(widest),
        }
    };
    let whole = match passes.split_last() {
        Some((last, others)) if last.step < (1.0 - CUT_SHARE) * last.least => others,
        _ => passes,
    };
    // Of a region's passes on one line only the last is beside the next line.
    let is_gap = |pass: &&PassInterval| pass.step != 0.0;
    whole.iter().filter(is_gap).map(gap).collect()
}
