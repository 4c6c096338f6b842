//! The jerk-limited feed, a step a period; see [`super`].

use super::plan::Plan;
use super::{QUANTA_BITS, STEP_MAX};
use crate::math::arith::sqrt;
use crate::math::number::Bounded;

/// Longest mean, periods: the ring's length less what the difference of accelerations needs.
pub(crate) const WINDOW_MAX: u8 = 250;

/// Share of the greatest change of the acceleration that is little: by so much a braking at the path's end may be above it.
const CREEP_SHARE: f32 = 1.0 / 20.0;

/// Periods of the greatest acceleration up to which a speed is slow, and that are looked ahead then.
const CREEP_PERIODS: f32 = 2.0;

/// Quanta.
const NANOMETRE: u64 = 1 << QUANTA_BITS;

/// Step that is always taken, quanta: what corrections of a nanometre leave at the end has to be gone, too.
const STEP_LEAST: f32 = 2048.0;

/// Progress along one path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Profile {
    /// Steps of the last periods, quanta, acceleration-limited; the next goes to `at`. Those before the path's start count as 0, whatever
    /// is there: to wipe them all would be half the work of a tick.
    steps: [i32; 256],
    at: u8,
    /// Steps since the path's start, as far as they fit.
    taken: u8,
    /// Periods of the mean.
    window: u8,
    /// Periods until the last acceleration that was not little leaves the mean. Nothing can be braked in the period in which it does.
    until_left: u8,
    /// Cell of the plan that `lead` is in.
    cell: u16,
    /// Sum of the last steps, and the place that they led to, quanta.
    sum: i64,
    lead: i64,
    /// The mean of the last places, and what its division left over.
    place: i64,
    rest: u32,
}

impl Profile {
    /// At the start of nothing.
    pub(crate) const START: Self = Self {
        steps: [0; 256],
        at: 0,
        taken: 0,
        window: 1,
        until_left: 0,
        cell: 0,
        sum: 0,
        lead: 0,
        place: 0,
        rest: 0,
    };

    /// To the start of a path with this mean, from rest.
    pub(crate) fn begin(&mut self, window: u8) {
        self.taken = 0;
        self.window = window.clamp(1, WINDOW_MAX);
        self.until_left = 0;
        self.cell = 0;
        (self.sum, self.lead, self.place, self.rest) = (0, 0, 0, 0);
    }

    /// Arc that the tool has come, quanta.
    pub(crate) const fn place(&self) -> i64 {
        self.place
    }

    /// Whether the tool stands, and will until a speed is wanted.
    pub(crate) const fn is_at_rest(&self) -> bool {
        self.sum == 0
    }

    /// Whether the path's end is reached, and the tool stands there.
    pub(crate) const fn is_done(&self, plan: &Plan) -> bool {
        self.lead >= plan.end && self.is_at_rest()
    }

    /// What is known better now of where the tool is: by so many quanta further along than it was taken to be. Once the last step to the
    /// path's end has been taken, less than a nanometre is left as it is: one more step would take the whole mean.
    pub(crate) const fn shift(&mut self, by: i64, plan: &Plan) {
        self.place += by;
        if self.lead < plan.end || by.unsigned_abs() > NANOMETRE {
            self.lead += by;
        }
    }

    /// One period at this wanted speed, quanta a period; the quanta that the tool moves.
    #[inline(never)]
    pub(crate) fn tick(&mut self, plan: &Plan, wanted: f32) -> i32 {
        let step = self.next(plan, wanted);
        self.push(step)
    }

    /// The next acceleration-limited step.
    fn next(&mut self, plan: &Plan, wanted: f32) -> i32 {
        self.cell = plan.cell_at(self.cell, self.lead);
        let at = |back: u8| as_f32(self.step(back));
        let speed = at(1);
        // The acceleration that leaves the mean with this step.
        let leaves = at(self.window) - at(self.window.wrapping_add(1));
        let accel = plan.accel(self.cell, self.lead);
        let least = (-accel).at_least(leaves - plan.swing);
        let most = accel.at_most(leaves + plan.swing);
        let goal = wanted
            .at_most(plan.ceiling(self.cell, self.lead))
            .at_most(STEP_MAX);
        let mut change = goal - speed;
        if change > 0.0 {
            let faster = speed + change.at_most(most);
            // Braking can begin only once the acceleration has left the mean: until then the speed stays.
            let coast = faster * count(self.window);
            if !plan.is_clear(self.cell, self.lead, coast + faster, faster) {
                change = self.creep(plan, speed, change);
            }
        }
        let change = change.at_most(most).at_least(least);
        self.until_left = if change > plan.swing * CREEP_SHARE {
            self.window
        } else {
            self.until_left.saturating_sub(1)
        };
        let mut step = rounded((speed + change).at_least(0.0));
        if step == 0 && wanted > 0.0 {
            step = rounded(STEP_LEAST.at_most(wanted));
        }
        let room = plan.end - self.lead;
        if i64::from(step) >= room {
            i32::try_from(room).unwrap_or(0).max(0)
        } else {
            step
        }
    }

    /// The step so many periods back.
    fn step(&self, back: u8) -> i32 {
        if back > self.taken {
            return 0;
        }
        let index = usize::from(self.at.wrapping_sub(back));
        // Each index of 8 bits is there.
        self.steps.get(index).copied().unwrap_or(0)
    }

    /// A small acceleration where a whole one would have to be waited for, so that the tool never stands before a narrow place: what it
    /// takes of the braking is small, too. Where a whole one still has to leave the mean, there is to be room until then at this speed.
    fn creep(&self, plan: &Plan, speed: f32, change: f32) -> f32 {
        let little = change.at_most(plan.swing * CREEP_SHARE);
        let faster = speed + little;
        let is_slow = speed <= CREEP_PERIODS * plan.accel(self.cell, self.lead);
        let periods = (count(self.until_left) + 1.0).at_least(CREEP_PERIODS);
        if is_slow && plan.is_clear(self.cell, self.lead, periods * faster, faster) {
            little
        } else {
            0.0
        }
    }

    /// Takes a step into the mean.
    fn push(&mut self, step: i32) -> i32 {
        let oldest = self.step(self.window);
        if let Some(newest) = self.steps.get_mut(usize::from(self.at)) {
            *newest = step;
        }
        self.at = self.at.wrapping_add(1);
        self.taken = self.taken.saturating_add(1);
        self.lead += i64::from(step);
        self.sum += i64::from(step) - i64::from(oldest);
        let moved = self.divide();
        self.place += i64::from(moved);
        moved
    }

    /// The sum over the window, with what the last division left over. In two halves, because the chip divides 32 bits.
    fn divide(&mut self) -> i32 {
        let window = u32::from(self.window).max(1);
        let sum = u64::try_from(self.sum).unwrap_or(0) + u64::from(self.rest);
        let high = u32::try_from(sum >> 16).unwrap_or(u32::MAX);
        let low = u32::try_from(sum & 0xffff).unwrap_or(0);
        let (top, left) = (high / window, high % window);
        let bottom = left << 16 | low;
        self.rest = bottom % window;
        i32::try_from(u64::from(top) << 16 | u64::from(bottom / window)).unwrap_or(0)
    }
}

/// Greatest speed a period before a place where it has to have this square, at this many quanta from it: braking by `accel` each
/// period, `v (v + accel) = square + 2 accel distance`.
pub(crate) fn braked(square: f32, accel: f32, distance: f32) -> f32 {
    let reach = square + 2.0 * accel * distance.at_least(0.0);
    let half = 0.5 * accel;
    let root = half + sqrt(half * half + reach);
    if root > 0.0 { reach / root } else { 0.0 }
}

/// Greatest step at this many quanta from a standstill, so that a whole number of periods follows, each slower by the same: N with
/// `distance <= accel N (N + 1)/2`, and the first of steps that fall evenly to nothing in the period after the last.
pub(crate) fn landing(accel: f32, distance: f32) -> f32 {
    let distance = distance.at_least(0.0);
    let periods = 0.5 * (sqrt(1.0 + 8.0 * distance / accel) - 1.0);
    2.0 * distance / (ceil(periods).at_least(1.0) + 1.0)
}

/// The next whole number; of a number that is whole within its last places, that one.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "the cast saturates, a NaN becomes 0, and beyond 2^24 every number is whole"
)]
fn ceil(value: f32) -> f32 {
    let whole = value as i32 as f32;
    if value > whole + 1e-3 { whole + 1.0 } else { whole }
}

#[allow(
    clippy::cast_precision_loss,
    reason = "a step beyond 2^24 quanta, 16 um, needs no last digit"
)]
const fn as_f32(step: i32) -> f32 {
    step as f32
}

fn count(number: u8) -> f32 {
    f32::from(number)
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "the cast saturates, and a NaN becomes 0"
)]
const fn rounded(step: f32) -> i32 {
    (step + 0.5) as i32
}

#[cfg(test)]
mod tests;
