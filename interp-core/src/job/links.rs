//! The words of links: how the tool goes to a pass that is not joined to the one before it on the surface.
//!
//! | word | way |
//! |---|---|
//! | [`LINK_STRAIGHT`] | straight, at the feed |
//! | below [`LINK_HEIGHT_MIN`] | around the obstacle between the passes: straight to a place beside the middle, and from there straight to the pass, at the feed ([`Detour`]) |
//! | from there on | up to this height of the ball's centre, nm, across and down |

use crate::job::AxisLimits;
use crate::math::arith::{sqrt, truncated};
use crate::math::number::Bounded;

/// The word of a link that goes straight to its pass, at the feed.
pub const LINK_STRAIGHT: i32 = i32::MIN;
/// Unit of a detour, nm: the parts of a word times this are its lengths.
pub const DETOUR_UNIT_NM: i32 = 1 << 14;
/// Greatest part of a detour to a side, units: 33.5 mm.
pub const ASIDE_MAX: i16 = (1 << 11) - 1;
/// Greatest part of a detour upwards, units: 67.1 mm.
pub const RISE_MAX: u16 = (1 << RISE_BITS) - 1;
const RISE_BITS: u32 = 12;
/// Bits of a detour.
const DETOUR_BITS: u32 = 24;
/// Least word that is a height, nm: 16.8 mm above the least coordinate.
pub const LINK_HEIGHT_MIN: i32 = LINK_STRAIGHT + 1 + (1 << DETOUR_BITS);

/// The place of a link that goes around: from the middle between both passes to the left of the way, and up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Detour {
    /// To the left, seen from above, units; at most [`ASIDE_MAX`] either way.
    pub aside: i16,
    /// Upwards, units; at most [`RISE_MAX`].
    pub rise: u16,
}

impl Detour {
    /// The word of this detour; parts that are too large are limited.
    #[must_use]
    pub fn to_word(self) -> i32 {
        let aside = i32::from(self.aside).clamp(-i32::from(ASIDE_MAX), i32::from(ASIDE_MAX)) + (1 << 11);
        let rise = i32::from(self.rise).min(i32::from(RISE_MAX));
        LINK_STRAIGHT + 1 + ((aside << RISE_BITS) | rise)
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "12 bits each"
    )]
    const fn from_word(word: i32) -> Self {
        let bits = word.wrapping_sub(LINK_STRAIGHT + 1);
        Self {
            aside: ((bits >> RISE_BITS) & 0xfff) as i16 - (1 << 11),
            rise: (bits & 0xfff) as u16,
        }
    }

    /// The place on the way between these two.
    #[must_use]
    pub fn place(self, [from, to]: [[i32; 3]; 2]) -> [i32; 3] {
        let middle = |axis: usize| {
            let ends = from.get(axis).zip(to.get(axis));
            let sum = ends.map_or(0, |(from, to)| i64::from(*from) + i64::from(*to));
            i32::try_from(sum >> 1).unwrap_or(0)
        };
        let apart = |axis: usize| {
            let ends = from.get(axis).zip(to.get(axis));
            ends.map_or(0.0, |(from, to)| {
                crate::math::number::nm_to_mm(to.saturating_sub(*from))
            })
        };
        let (x, y) = (apart(0), apart(1));
        let length = sqrt(x * x + y * y).at_least(f32::MIN_POSITIVE);
        #[allow(clippy::cast_precision_loss, reason = "11 and 14 bits: exact")]
        let aside_nm = (i32::from(self.aside) * DETOUR_UNIT_NM) as f32;
        [
            middle(0).saturating_sub(truncated(aside_nm * (y / length))),
            middle(1).saturating_add(truncated(aside_nm * (x / length))),
            middle(2).saturating_add(i32::from(self.rise) * DETOUR_UNIT_NM),
        ]
    }
}

/// The way to a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Link {
    /// Straight, at the feed.
    Straight,
    /// By a place beside, at the feed.
    Around(Detour),
    /// Up to this height of the ball's centre, nm, across and down.
    Across(i32),
}

impl Link {
    /// The way of a word. A height is not above the safe height.
    pub(crate) const fn from_word(word: i32, axes: &AxisLimits) -> Self {
        if word == LINK_STRAIGHT {
            Self::Straight
        } else if word < LINK_HEIGHT_MIN {
            Self::Around(Detour::from_word(word))
        } else if word < axes.safe_z_nm {
            Self::Across(word)
        } else {
            Self::Across(axes.safe_z_nm)
        }
    }

    /// Whether the tool stays low, at the feed.
    pub(crate) const fn is_low(&self) -> bool {
        !matches!(self, Self::Across(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words() {
        let axes = AxisLimits {
            end_nm: None,
            end_height_nm: 0,
            safe_z_nm: 5_000_000,
            ..AxisLimits::default()
        };
        assert_eq!(Link::from_word(LINK_STRAIGHT, &axes), Link::Straight);
        for aside in [-ASIDE_MAX, -1, 0, 7, ASIDE_MAX] {
            for rise in [0, 1, RISE_MAX] {
                let detour = Detour { aside, rise };
                let word = detour.to_word();
                assert!(LINK_STRAIGHT < word && word < LINK_HEIGHT_MIN);
                assert_eq!(Link::from_word(word, &axes), Link::Around(detour));
            }
        }
        assert_eq!(
            Link::from_word(LINK_HEIGHT_MIN, &axes),
            Link::Across(LINK_HEIGHT_MIN)
        );
        assert_eq!(Link::from_word(6_000_000, &axes), Link::Across(5_000_000));
    }

    #[test]
    fn a_place_beside_the_middle() {
        let detour = Detour { aside: 100, rise: 3 };
        let (aside, rise) = (100 << 14, 3 << 14);
        let ends = [[0, 0, 10], [4_000_000, 0, 30]];
        assert_eq!(detour.place(ends), [2_000_000, aside, 20 + rise]);
        // To the left of the way back, and of one of no length.
        let [from, to] = ends;
        assert_eq!(detour.place([to, from]), [2_000_000, -aside, 20 + rise]);
        assert_eq!(detour.place([from, from]), [0, 0, 10 + rise]);
    }
}
