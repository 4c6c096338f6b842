//! A straight move of one or more axes: a [`Move`] of the axis with the longest way, the others in proportion to it.
//!
//! The leading axis keeps its limits exactly; its limits are lowered to those that the others leave. A follower is off the line by its rounding to nanometres and by
//! 2^-30 of the way: 0.3 nm in 300 mm.

use super::{Move, MoveLimits};
use crate::math::arith::sqrt;
use crate::math::number::{Bounded, to_f32};

/// Binary places of a follower's share of the way.
const SHARE_PLACES: u32 = 30;

/// What a follower's limits are multiplied with: more than the error of the shares in f32, and of their rounding.
const MARGIN: f32 = 1.0 - 1e-6;

/// Greatest velocity, mm/s, acceleration, mm/s^2, and jerk, mm/s^3, of each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineLimits {
    /// Velocity, mm/s.
    pub velocity_mm_s: [f32; 3],
    /// Acceleration, mm/s^2.
    pub acceleration_mm_s2: [f32; 3],
    /// Jerk, mm/s^3.
    pub jerk_mm_s3: [f32; 3],
    /// Sampling period, s.
    pub period_s: f32,
}

/// A straight move, and its state. [`Self::tick`] gives the positions of each period.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    lead: Move,
    /// The leading axis, and where it began.
    axis: u8,
    lead_from_nm: i32,
    from_nm: [i32; 3],
    to_nm: [i32; 3],
    /// Ways of the axes for each nanometre of the leading one's, with [`SHARE_PLACES`].
    shares: [i64; 3],
    at_nm: [i32; 3],
}

impl Line {
    /// No motion, at this position, nm.
    #[must_use]
    pub const fn rest(at_nm: [i32; 3]) -> Self {
        Self {
            lead: Move::rest(at_nm[0]),
            axis: 0,
            lead_from_nm: at_nm[0],
            from_nm: at_nm,
            to_nm: at_nm,
            shares: [0; 3],
            at_nm,
        }
    }

    /// The shortest straight move between two positions, nm, within the limits and at most at this speed along the line, mm/s.
    #[must_use]
    pub fn new(from_nm: [i32; 3], to_nm: [i32; 3], limits: &LineLimits, speed_mm_s: f32) -> Self {
        let [x, y, z] = to_nm;
        let [x0, y0, z0] = from_nm;
        let ways = [(x, x0), (y, y0), (z, z0)].map(|(to, from)| i64::from(to) - i64::from(from));
        let mut longest = (0_u8, 0_i64);
        for (axis, way) in (0..).zip(ways) {
            if way.abs() > longest.1 {
                longest = (axis, way.abs());
            }
        }
        let (axis, length) = longest;
        let of_lead = |values: [i32; 3]| values.get(usize::from(axis)).copied().unwrap_or(0);
        let (lead_from_nm, lead_to_nm) = (of_lead(from_nm), of_lead(to_nm));
        let limits = limits_of_lead(ways, axis, limits, speed_mm_s);
        Self {
            lead: Move::new(lead_from_nm, lead_to_nm, &limits),
            axis,
            lead_from_nm,
            from_nm,
            to_nm,
            // Below 2^62.
            shares: ways.map(|way| (way << SHARE_PLACES).checked_div(length).unwrap_or(0)),
            at_nm: from_nm,
        }
    }

    /// The axis with the longest way, from 0.
    #[must_use]
    pub const fn leading_axis(&self) -> u8 {
        self.axis
    }

    /// The axes that move, one bit each.
    #[must_use]
    pub fn axes(&self) -> u8 {
        let [x, y, z] = self.shares.map(|share| u8::from(share != 0));
        x | y << 1 | z << 2
    }

    /// Whether the axes stand at the end.
    #[must_use]
    pub const fn is_over(&self) -> bool {
        self.lead.is_over()
    }

    /// The positions of the last period, nm.
    #[must_use]
    pub const fn at_nm(&self) -> [i32; 3] {
        self.at_nm
    }

    /// The positions of the next period, nm; the end once the move is over.
    pub fn tick(&mut self) -> [i32; 3] {
        let lead_nm = self.lead.tick();
        let way = (i64::from(lead_nm) - i64::from(self.lead_from_nm)).abs();
        let is_there = self.is_over() && self.to_nm.get(usize::from(self.axis)) == Some(&lead_nm);
        if is_there {
            self.at_nm = self.to_nm;
            return self.at_nm;
        }
        let followers = self.at_nm.iter_mut().zip(self.from_nm).zip(self.shares);
        for (axis, ((at, from), share)) in (0..).zip(followers) {
            // Below 2^62, as the way is at most 2^32 and a share at most 1.
            let by = (way * share + (1 << (SHARE_PLACES - 1))) >> SHARE_PLACES;
            *at = if axis == self.axis {
                lead_nm
            } else {
                i32::try_from(i64::from(from) + by).unwrap_or(*at)
            };
        }
        self.at_nm
    }

    /// Stops within the limits, as soon as possible: the next periods brake. No effect where they do already.
    pub fn stop(&mut self) {
        self.lead.stop();
    }

    /// Ends the move at once, where the axes are: for drives that are off.
    pub const fn abandon(&mut self) {
        *self = Self::rest(self.at_nm);
    }
}

/// The leading axis's limits, by which no axis exceeds its own, nor the speed along the line the greatest.
fn limits_of_lead(ways: [i64; 3], axis: u8, limits: &LineLimits, speed_mm_s: f32) -> MoveLimits {
    let ways = ways.map(|way| to_f32(way.abs()));
    let lead = ways.get(usize::from(axis)).copied().unwrap_or(0.0);
    let of = |values: [f32; 3]| {
        let mut least = f32::MAX;
        for (other, (value, way)) in (0..).zip(values.into_iter().zip(ways)) {
            if other == axis {
                least = least.at_most(value);
            } else if way > 0.0 {
                least = least.at_most(value * (lead / way) * MARGIN);
            }
        }
        least
    };
    let [x, y, z] = ways.map(|way| if lead > 0.0 { way / lead } else { 0.0 });
    // The way along the line for each millimetre of the leading axis.
    let stretch = sqrt(x * x + y * y + z * z).at_least(1.0);
    let limits_of_axis = MoveLimits::new(
        of(limits.velocity_mm_s),
        of(limits.acceleration_mm_s2),
        of(limits.jerk_mm_s3),
        limits.period_s,
    );
    limits_of_axis.at_speed(speed_mm_s / stretch, limits.period_s)
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    const LIMITS: LineLimits = LineLimits {
        velocity_mm_s: [100.0, 70.0, 20.0],
        acceleration_mm_s2: [1000.0, 1500.0, 300.0],
        jerk_mm_s3: [20_000.0, 10_000.0, 9_000.0],
        period_s: 0.001,
    };

    /// Positions from rest to rest.
    fn positions(mut line: Line, stop_after: Option<usize>) -> Vec<[i64; 3]> {
        let mut all = std::vec![line.at_nm().map(i64::from); 4];
        while !line.is_over() {
            if stop_after.is_some_and(|after| all.len() >= after) {
                line.stop();
                if line.is_over() {
                    break;
                }
            }
            all.push(line.tick().map(i64::from));
            assert!(all.len() < 3_000_000);
        }
        let end = *all.last().unwrap();
        all.extend([end; 4]);
        all
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// Straight, at the goal, each axis within its limits, the speed along the line below the greatest; stopped anywhere likewise.
        #[test]
        fn a_line_is_straight_and_within_every_axis_limits(
            from in prop::array::uniform3(-200_000_000_i32..200_000_000), exponents in prop::array::uniform3(2.0_f64..8.3),
            signs in prop::array::uniform3(-1_i32..=1), speed in 1.0_f32..200.0, stop_share in 0.0_f64..2.0
        ) {
            let to: [i32; 3] = std::array::from_fn(|axis| from[axis] + signs[axis] * 10_f64.powf(exponents[axis]) as i32);
            let line = Line::new(from, to, &LIMITS, speed);
            let whole = positions(line, None);
            prop_assert_eq!(*whole.last().unwrap(), to.map(i64::from));
            let stopped = positions(line, Some((stop_share * whole.len() as f64) as usize));
            let ways: [f64; 3] = std::array::from_fn(|axis| f64::from(to[axis]) - f64::from(from[axis]));
            let length = ways.iter().map(|way| way * way).sum::<f64>().sqrt();
            for all in [&whole, &stopped] {
                for axis in 0..3 {
                    let limits = [LIMITS.velocity_mm_s[axis], LIMITS.acceleration_mm_s2[axis], LIMITS.jerk_mm_s3[axis]];
                    let mut differences: Vec<i64> = all.iter().map(|at| at[axis]).collect();
                    for (order, limit) in (1..).zip(limits) {
                        differences = differences.windows(2).map(|two| two[1] - two[0]).collect();
                        let most = differences.iter().map(|nm| nm.abs()).max().unwrap();
                        // Rounding of positions, twice: the leading axis's and the follower's; at the end a follower is set to its goal.
                        let rounding = 3_i64 << (order - 1);
                        let share = (most - rounding).max(0) as f64 / (f64::from(limit) * 1e6 * 0.001_f64.powi(order));
                        prop_assert!(share <= 1.0 + 2e-6, "axis {axis}, order {order}: {share}");
                    }
                }
                for two in all.windows(2) {
                    let step: f64 = (0..3).map(|axis| ((two[1][axis] - two[0][axis]) as f64).powi(2)).sum::<f64>().sqrt();
                    prop_assert!(step <= f64::from(speed) * 1e3 * (1.0 + 2e-6) + 5.0, "{step}");
                }
                for at in all.iter().filter(|_| length > 0.0) {
                    let off: Vec<f64> = (0..3).map(|axis| at[axis] as f64 - f64::from(from[axis])).collect();
                    let along: f64 = (0..3).map(|axis| off[axis] * ways[axis] / length).sum();
                    for axis in 0..3 {
                        let apart = (off[axis] - along * ways[axis] / length).abs();
                        prop_assert!(apart <= 2.0, "axis {axis} is {apart} nm off the line");
                    }
                }
            }
        }
    }

    #[test]
    fn one_axis_alone_moves_as_a_move() {
        let mut line = Line::new([7, 1_000, -3], [7, 51_000_000, -3], &LIMITS, 30.0);
        let limits = MoveLimits::new(70.0, 1500.0, 10_000.0, 0.001).at_speed(30.0, 0.001);
        let mut moving = Move::new(1_000, 51_000_000, &limits);
        assert_eq!((line.leading_axis(), line.axes()), (1, 0b010));
        while !moving.is_over() {
            assert_eq!(line.tick(), [7, moving.tick(), -3]);
        }
        assert!(line.is_over());
    }
}
