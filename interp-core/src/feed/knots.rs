//! The jumps of a path that a plan has to mind.

use super::limits::MotionLimits;
use super::plan::{KNOTS_MAX, Knot, Plan};
use super::stations::between;
use crate::math::arith::truncated;

/// Bisections of a jump's place in its interval.
const KNOT_BISECTIONS: u8 = 16;

/// Intervals on either side of a rest, and the greatest speed of the walk there, mm/s.
const BESIDE_REST: u16 = 2;
const BESIDE_REST_MM_S: f32 = 6.0;
/// Entries above which none is added beside a rest, so that there is room for the jumps.
const BESIDE_RESTS_MAX: u16 = 40;
/// Rounding of a node's place, in units of 2^-16 of its cell.
const PART_ROUNDING: u16 = 4;
/// Middle of an interval, in units of 2^-16.
const MIDDLE: u16 = 1 << 15;

/// Appends the jumps of an interval that matter.
pub(super) fn find_knots(plan: &mut Plan, index: u16, limits: &MotionLimits) {
    let [from, part] = plan.node(index);
    let [to, _] = plan.node(index + 1);
    for station in from..to {
        if usize::from(plan.knot_count) >= KNOTS_MAX || !plan.stations.is_jump(station) {
            continue;
        }
        let feed = limits.feed;
        let jerk = limits.jump_jerk(&plan.stations.jump(station));
        // Where a turn begins, the third derivative jumps, and much happens between two nodes.
        let bends = plan.is_near_turn(plan.stations.get(station).arc_nm);
        let matters = jerk
            .iter()
            .any(|[first, second]| (first + second * feed) * feed > 0.01);
        if !bends && !matters {
            continue;
        }
        let arc_of = |station| plan.stations.get(station).arc_nm;
        let start = f32::from(part) * (1.0 / 65536.0) * plan.stations.cell_mm(from);
        let away = between(arc_of(from), arc_of(station)) - start;
        let interval = plan.interval(index);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..KNOT_BISECTIONS {
            let middle = 0.5 * (low + high);
            if interval.arc(middle) < away {
                low = middle;
            } else {
                high = middle;
            }
        }
        let part = u16::try_from(truncated(low * 65535.0)).unwrap_or(u16::MAX);
        push(plan, index, part, station);
    }
    if plan.knot_count < BESIDE_RESTS_MAX
        && let Some(station) = rest_beside(plan, index)
    {
        push(plan, index, MIDDLE, station);
    }
}

/// For an interval beside a rest at a jump: the first station of the cell on this side of it. The pace changes so much there that the rows of the interval's
/// middle are needed, too.
fn rest_beside(plan: &Plan, index: u16) -> Option<u16> {
    let [speed, _, _] = plan.interval(index).walk_rates(0.5);
    let speed = speed * plan.inverse_step;
    if speed <= 0.0 || speed > BESIDE_REST_MM_S {
        return None;
    }
    let [from, part] = plan.node(index.saturating_sub(BESIDE_REST));
    let from = if part <= PART_ROUNDING {
        from.saturating_sub(1)
    } else {
        from
    };
    let [to, part] = plan.node((index + BESIDE_REST + 1).min(plan.intervals));
    let to = if part >= u16::MAX - PART_ROUNDING {
        to + 1
    } else {
        to
    };
    let jump = (from..=to).find(|station| plan.stations.is_jump(*station))?;
    let [cell, _] = plan.node(index);
    Some(if cell < jump {
        jump.saturating_sub(1)
    } else {
        jump + 1
    })
}

fn push(plan: &mut Plan, interval: u16, part: u16, station: u16) {
    if let Some(knot) = plan.knots.get_mut(usize::from(plan.knot_count)) {
        *knot = Knot {
            interval,
            part,
            station,
        };
        plan.knot_count += 1;
    }
}
