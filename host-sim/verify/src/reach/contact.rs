//! Which half of the ball touches the surface: with a vertical spindle the tool is above the ball's centre, so a contact there cannot be reached.

use glam::DVec3;

use crate::Verdict;

/// Contacts higher than this above the centre are above the equator, mm: positions of contact and centre are known to 10 nm.
const ABOVE_MM: f64 = 20e-6;

/// The contacts of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactSide {
    /// Number of contacts.
    pub contacts: u64,
    /// Of them above the ball's equator.
    pub above_equator: u64,
    /// Largest height of a contact above the ball's centre, mm; below zero: below it, as it should be.
    pub height_max_mm: f64,
    /// Where that is.
    pub at: Option<ContactPlace>,
}

/// A contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPlace {
    /// Sample of the motion, from 0.
    pub sample: usize,
    /// Pass, from 0.
    pub pass: u32,
    /// (u, v).
    pub uv: [f64; 2],
    /// The contact, mm.
    pub place_mm: DVec3,
}

impl ContactSide {
    /// Adds a contact with the ball's centre here.
    pub fn add(&mut self, at: ContactPlace, centre_mm: DVec3) {
        let height = at.place_mm.z - centre_mm.z;
        self.contacts += 1;
        self.above_equator += u64::from(height > ABOVE_MM);
        if self.at.is_none() || height > self.height_max_mm {
            self.height_max_mm = height;
            self.at = Some(at);
        }
    }

    /// Whether every contact is below the equator, or on it.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.contacts == 0 {
            Verdict::Unknown
        } else if self.above_equator > 0 {
            Verdict::Violated
        } else {
            Verdict::Met
        }
    }
}
