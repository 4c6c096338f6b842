//! Patches of a straight pass that are shorter than the way of a period, which may cross one boundary: the pass is planned to be slow there.

use super::{Lookahead, PassPlan};
use crate::command::OVERRIDE_MAX;
use crate::fault::{Fault, FaultKind, Result};
use crate::feed::stations::Derivatives;
use crate::job::program::Job;
use crate::math::arith::truncated;
use crate::math::number::{Bounded, MM_PER_NM};

/// Share of a patch that a period takes at most, and the least length of one between two others, mm.
const PATCH_SHARE: f32 = 0.95;
const PATCH_MIN_MM: f32 = 1e-4;
/// How far before and after a patch the pass is as slow, in its lengths: the nodes of a plan are some periods apart.
const REACH: f32 = 10.0;
/// Most stations that one patch slows down.
const STATIONS_SLOW: u16 = 24;

/// The latest short patch: its length, mm, and the arc up to which the pass is slow for it, nm.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShortPatch {
    length_mm: f32,
    until_nm: u32,
}

impl ShortPatch {
    pub(super) const NONE: Self = Self {
        length_mm: f32::MAX,
        until_nm: 0,
    };
}

impl Lookahead {
    /// Whether the patch that is looked at is between two others and shorter than the way of a period at the greatest override.
    fn is_short_patch(&self, job: &Job<'_>, out: &PassPlan) -> bool {
        let most = OVERRIDE_MAX * job.header.feed_mm_s * job.header.period_s;
        self.patches > 0 && self.arc_mm < most && out.route.next(job, &self.piece).is_some()
    }

    /// Whether the pass is slowed down at stations of the patch that is looked at: it is short, or near a short one before it.
    pub(super) fn slows_down(&self, job: &Job<'_>, out: &PassPlan) -> bool {
        let is_near = self.arc_nm(0.0) < self.short.until_nm;
        !self.is_on_front() && !out.point && (is_near || self.is_short_patch(job, out))
    }

    /// Slows the pass down at the stations of the patch, and at those before it that are near.
    ///
    /// # Errors
    /// [`FaultKind::PatchTooShort`] with its length, mm, where the pass would creep over the patch.
    pub(super) fn slow_down(&mut self, job: &Job<'_>, out: &mut PassPlan) -> Result<()> {
        let [start_nm, end_nm] = [0.0, self.arc_mm].map(|arc| self.arc_nm(arc));
        let (mut length_mm, mut reach_nm) = (f32::MAX, 0);
        if self.is_short_patch(job, out) {
            length_mm = self.arc_mm;
            if length_mm < PATCH_MIN_MM {
                return Err(Fault::new(FaultKind::PatchTooShort, length_mm));
            }
            reach_nm = u32::try_from(truncated(REACH / MM_PER_NM * length_mm)).unwrap_or(u32::MAX);
        }
        let is_group = out.group > 1;
        let own = if is_group {
            2
        } else {
            out.plan.stations.count().saturating_sub(self.begun)
        };
        for back in 1..=STATIONS_SLOW {
            let Some(station) = out.plan.stations.back_mut(back) else {
                break;
            };
            let mut least_mm = f32::MAX;
            if back <= own || station.arc_nm.saturating_add(reach_nm) >= start_nm {
                least_mm = length_mm;
            }
            if back <= own && (is_group || station.arc_nm <= self.short.until_nm) {
                least_mm = least_mm.at_most(self.short.length_mm);
            }
            if least_mm < f32::MAX {
                let inverse = 1.0 / (PATCH_SHARE * least_mm);
                slow(&mut station.q, job.header.period_s * inverse, &self.per_limit);
            }
        }
        if length_mm <= self.short.length_mm || end_nm >= self.short.until_nm {
            self.short = ShortPatch {
                length_mm,
                until_nm: end_nm.saturating_add(reach_nm),
            };
        }
        Ok(())
    }
}

/// Gives two axes third derivatives that leave no jerk at a speed, by its inverse, s/mm. One has the sign of the direction and one the other, so that no change of the speed
/// makes up for both; the third axis is the one that limits changes of the speed.
fn slow(q: &mut Derivatives, slowness: f32, per_limit: &[[f32; 2]; 3]) {
    let share = |([first, ..], [_, jerk]): (&[f32; 3], &[f32; 2])| first.abs() * jerk;
    let mut shares = q.iter().zip(per_limit).map(share);
    let greatest = shares.clone().fold(0.0, Bounded::at_least);
    let limiting = shares.position(|share| share >= greatest);
    let mut sign = 1.0;
    for (axis, ([first, _, third], [_, jerk])) in q.iter_mut().zip(per_limit).enumerate() {
        if Some(axis) == limiting {
            continue;
        }
        let least = slowness * slowness * slowness / jerk;
        if third.abs() < least {
            *third = if *first < 0.0 { -sign * least } else { sign * least };
        }
        sign = -sign;
    }
}
