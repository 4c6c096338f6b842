//! The greatest inverse square interval of a pass between its stations: the paper's spacing takes it from the pass alone.

use super::Lookahead;
use crate::job::Spacing;
use crate::job::program::Job;
use crate::math::arith::{fraction_from_f32, fraction_to_f32};
use crate::pass::step_over::PassMaximum;
use crate::surface::Contact;

/// Evaluations for a maximum between stations.
pub(super) const EVALUATIONS: u8 = 3;
/// Share by which a maximum is greater that is worth an evaluation: more than rounding.
const WORTH: f32 = 1e-6;

/// A place of a patch: its fraction, 2^-64, and the inverse square interval there.
type Place = (u64, f32);

/// The last places of a patch, in order.
#[derive(Clone, Copy, Debug)]
pub(super) struct LastPlaces {
    places: [Place; 3],
    count: u8,
}

impl LastPlaces {
    pub(super) const NONE: Self = Self {
        places: [(0, 0.0); 3],
        count: 0,
    };

    /// Appends a place; the oldest is dropped. One that is not after the last begins anew, where a patch is looked at again.
    fn push(&mut self, place: Place) {
        let [_, before, last] = self.places;
        self.count = if self.count > 0 && place.0 > last.0 {
            self.count.saturating_add(1)
        } else {
            1
        };
        self.places = [before, last, place];
    }

    /// Fraction of the maximum of the parabola through the places, if that is between them and greater than `most`.
    fn vertex(&self, most: f32) -> Option<u64> {
        let [(start, first), (at, middle), (end, last)] = self.places;
        if self.count < 3 || at <= start || end <= at {
            return None;
        }
        let (before, after) = (fraction_to_f32(at - start), fraction_to_f32(end - at));
        // Slopes of the chords, and the second difference.
        let (rise, fall) = ((middle - first) / before, (middle - last) / after);
        let bend = (rise + fall) / (before + after);
        // Slope at the middle.
        let slope = (rise * after - fall * before) / (before + after);
        let away = 0.5 * slope / bend;
        let is_greater = middle + 0.5 * slope * away > most * (1.0 + WORTH);
        if !(bend > 0.0 && is_greater && -before < away && away < after) {
            return None;
        }
        let fraction = if away < 0.0 {
            at.saturating_sub(fraction_from_f32(-away))
        } else {
            at.saturating_add(fraction_from_f32(away))
        };
        (fraction > start && fraction < end && fraction != at).then_some(fraction)
    }

    /// Puts a place between the others: those around the greatest are kept.
    fn insert(&mut self, place: Place) {
        let [start, middle, end] = self.places;
        let is_after = place.0 > middle.0;
        self.places = match (place.1 > middle.1, is_after) {
            (true, true) => [middle, place, end],
            (true, false) => [start, place, middle],
            (false, true) => [start, middle, place],
            (false, false) => [place, middle, end],
        };
    }
}

impl Lookahead {
    /// Adds a station to the maximum of the pass.
    pub(super) fn see(&mut self, job: &Job<'_>, fraction: u64, contact: &Contact) {
        let inv_interval_sq = self.add_to_maximum(contact);
        if job.header.spacing == Spacing::FirstOrder {
            self.last_places.push((fraction, inv_interval_sq));
        }
    }

    /// Whether the pass may have a greater inverse square interval between its last stations.
    pub(super) fn has_maximum(&self, job: &Job<'_>) -> bool {
        job.header.spacing == Spacing::FirstOrder
            && self.last_places.vertex(self.maximum.inv_interval_sq).is_some()
    }

    /// Evaluates the pass where it is expected; whether there may be a greater one still.
    pub(super) fn see_maximum(&mut self) -> bool {
        let Some(fraction) = self.last_places.vertex(self.maximum.inv_interval_sq) else {
            return false;
        };
        // Where the ball does not fit the stations tell.
        let Ok((contact, _)) = self.patch.evaluate(fraction) else {
            return false;
        };
        let inv_interval_sq = self.add_to_maximum(&contact);
        self.last_places.insert((fraction, inv_interval_sq));
        true
    }

    /// The inverse square interval at a place of the pass.
    fn add_to_maximum(&mut self, contact: &Contact) -> f32 {
        let inv_interval_sq = self.patch.interval.inv_interval_sq(contact);
        if inv_interval_sq > self.maximum.inv_interval_sq {
            self.maximum = PassMaximum {
                inv_interval_sq,
                shape: [contact.across, contact.lateral_squared],
            };
        }
        inv_interval_sq
    }
}
