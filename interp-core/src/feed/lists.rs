//! The lists of numbers that the stages of the planner share, each for what it needs.

use super::plan::NODES_MAX;
use super::stations::STATIONS_MAX;

/// Values of a list of the planner.
pub(crate) const LIST: usize = 170;
const _: () = assert!(LIST >= STATIONS_MAX + 2 && LIST >= NODES_MAX + 3);

/// Lists that the stages of the planner use, each for what it needs.
pub(crate) type Lists = [[f32; LIST]; 6];

/// The pace that is being planned, in the last list: coefficients of a quadratic B-spline.
pub(crate) const fn draft(lists: &Lists) -> &[f32; LIST] {
    let [.., draft] = lists;
    draft
}

/// See [`draft`].
pub(crate) const fn draft_mut(lists: &mut Lists) -> &mut [f32; LIST] {
    let [.., draft] = lists;
    draft
}

/// A value; 0 outside of the lists.
pub(super) fn get(lists: &Lists, list: usize, index: u16) -> f32 {
    lists
        .get(list)
        .and_then(|list| list.get(usize::from(index)))
        .copied()
        .unwrap_or(0.0)
}

/// Sets a value, if it is within the lists.
pub(super) fn put(lists: &mut Lists, list: usize, index: u16, value: f32) {
    if let Some(place) = lists
        .get_mut(list)
        .and_then(|list| list.get_mut(usize::from(index)))
    {
        *place = value;
    }
}
