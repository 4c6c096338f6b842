//! The crest between two fronts, measured: from a surface point between them, the heights of both passes' balls along the normal.

use core::ops::Deref;

use crate::fault::Result;
use crate::job::program::Job;
use crate::math::arith::{power_of_two, sqrt, to_f32, truncated};
use crate::math::number::Bounded;
use crate::math::vec3::Vec3;
use crate::pass::edge::Seen;
use crate::pass::front::frame::{Frame, FreePatch};
use crate::pass::front::side::{Direction, SideCursor, UNIT};
use crate::pass::front::spline::{Cubic, CurvePoint};
use crate::pass::front::table::{Column, Table};
use crate::pass::step_over::height_limit_mm;

/// Iterations for the foot of the point on a pass.
const FOOT_STEPS: u8 = 3;
/// Intervals between the point and its foot at most.
const INTERVALS_MAX: u8 = 16;
/// Greatest correction of the foot that is taken from one ball, as a share of the distance in the metric.
const CORRECTION_MAX: f32 = 0.3;
/// A crest farther than this from its expected place, as a share of the gap, is measured again, unless it is clearly below the limit ([`CLEAR`]).
const REPEAT_MIN: f32 = 0.03;
/// Largest number of repeated measurements of a crest.
const REPEATS_MAX: u8 = 2;
/// Factor by which the gap could be wider at a crest that need not be measured again.
const CLEAR: f32 = 1.05;
/// Growth of that factor with the distance of the crest from its expected place.
const CLEAR_OFF: f32 = 2.0;
/// Least share of the gap between the crest and a pass.
const SHARE_MIN: f32 = 0.1;
/// 2^31.
const WITHIN: f32 = power_of_two(31);

/// A place on the path: interval, and within it in units of 2^-31.
pub(crate) type Place = (u16, i32);

/// The measurement at one place of the path, an evaluation at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrestSearch {
    pub(crate) place: Place,
    /// Next evaluation.
    pub(crate) next: u8,
    /// Share of the gap at which the crest is expected.
    share: f32,
    point: Frame,
    at: i32,
    gap: i32,
    first: f32,
    /// Interval of the ball of the next front that was measured.
    foot: u16,
    /// Other shares at which the crest was looked for before.
    repeats: u8,
}

/// What the search evaluates with.
pub(crate) struct Tools<'a, 'b> {
    pub(crate) patch: &'a mut FreePatch,
    pub(crate) job: &'a Job<'b>,
    pub(crate) cursor: &'a mut SideCursor,
    pub(crate) direction: &'a Direction,
    /// The boundary ahead is a single point.
    pub(crate) is_point_ahead: bool,
}

impl Tools<'_, '_> {
    pub(crate) fn frame<W: Deref<Target = [i32]>>(
        &mut self,
        table: &Table<W>,
        (interval, within): Place,
        at: i32,
    ) -> Result<Frame> {
        let path = table.stations().place_within(interval, within);
        Frame::at(self.patch, self.job, self.cursor, self.direction, path, at)
    }

    /// A front at a place.
    pub(crate) fn front<W: Deref<Target = [i32]>>(
        &self,
        table: &Table<W>,
        columns: [Column; 2],
        (interval, within): Place,
    ) -> CurvePoint {
        let length = table.stations().length(self.job, interval);
        Cubic::of(table, columns, interval, length).point(within, length)
    }

    /// The pass on a front: along the boundary where the front is beyond it.
    fn curve<W: Deref<Target = [i32]>>(
        &self,
        table: &Table<W>,
        columns: [Column; 2],
        place: Place,
    ) -> CurvePoint {
        let point = self.front(table, columns, place);
        if point.at >= self.direction.end {
            self.on_boundary()
        } else {
            point
        }
    }

    fn on_boundary(&self) -> CurvePoint {
        CurvePoint {
            at: self.direction.end,
            ..CurvePoint::default()
        }
    }
}

pub(crate) const CURRENT: [Column; 2] = [Column::Front, Column::Slope];
pub(crate) const NEXT: [Column; 2] = [Column::Next, Column::NextSlope];

impl CrestSearch {
    pub(crate) const NONE: Self = Self {
        place: (0, 0),
        next: 0,
        share: 0.5,
        point: Frame {
            point: [0; 3],
            offset: Vec3::new(0.0, 0.0, 0.0),
            path: Vec3::new(0.0, 0.0, 0.0),
            side: Vec3::new(0.0, 0.0, 0.0),
            e: 0.0,
            f: 0.0,
            g: 0.0,
            a: 0.0,
            b: 0.0,
            c: 0.0,
        },
        at: 0,
        gap: 0,
        first: 0.0,
        foot: 0,
        repeats: 0,
    };

    /// Interval of the ball of the next front that leaves the crest: where side lines are skew, that is not the interval of the crest.
    pub(crate) const fn foot(&self) -> u16 {
        self.foot
    }

    /// Begins at a place.
    pub(crate) const fn begin(&mut self, place: Place) {
        self.place = place;
        self.next = 0;
        self.share = 0.5;
        self.repeats = 0;
    }

    /// An evaluation. Returns, after the last one, by how much the gap is too wide at the place for `margin` times the limit of the scallop height, units of the fronts; 0 where it is not.
    pub(crate) fn work<W: Deref<Target = [i32]>>(
        &mut self,
        tools: &mut Tools<'_, '_>,
        table: &Table<W>,
        margin: f32,
    ) -> Option<i32> {
        match self.next {
            0 => {
                let low = tools.curve(table, CURRENT, self.place).at;
                let high = tools.curve(table, NEXT, self.place).at;
                self.gap = high.saturating_sub(low);
                self.at = low.saturating_add(truncated(to_f32(self.gap) * self.share));
                if low >= tools.direction.end || self.gap <= 0 {
                    return Some(0);
                }
                match tools.frame(table, self.place, self.at) {
                    Ok(frame) => self.point = frame,
                    Err(_) => return Some(0),
                }
                self.next = 1;
                None
            }
            1 => {
                (self.first, _) = self.height(tools, table, CURRENT);
                self.next = 2;
                None
            }
            _ => {
                let second;
                (second, self.foot) = self.height(tools, table, NEXT);
                self.next = 0;
                self.excess(tools.job, second, margin)
            }
        }
    }

    /// From the point to a distance of a front, as a share of the whole side parameter.
    fn rise(&self, at: i32) -> f32 {
        to_f32(at.wrapping_sub(self.at)) * UNIT
    }

    /// Height of the ball of a pass above the point, mm, and the interval that the ball is in.
    fn height<W: Deref<Target = [i32]>>(
        &self,
        tools: &mut Tools<'_, '_>,
        table: &Table<W>,
        columns: [Column; 2],
    ) -> (f32, u16) {
        let point = &self.point;
        // The foot in the metric of the point, on the front as if it went on beyond the boundary.
        let mut foot = self.place;
        let mut moved = 0.0;
        let mut curve = tools.front(table, columns, foot);
        let mut clamped = false;
        for _ in 0..FOOT_STEPS {
            let rise = self.rise(curve.at);
            let gradient =
                moved * point.a + rise * point.b + curve.slope * (moved * point.b + rise * point.c);
            let by = -gradient / point.stretch(curve.slope);
            if !by.is_finite() {
                break;
            }
            (foot, clamped) = shifted(table, tools.job, foot, by);
            moved = offset(table, foot) - offset(table, self.place);
            curve = tools.front(table, columns, foot);
        }
        let mut interval = foot.0;
        if curve.at >= tools.direction.end {
            // The pass along the boundary, which lowering the front would not move.
            interval = self.place.0;
            curve = tools.on_boundary();
            let by = -self.rise(curve.at) * point.b / point.a;
            (foot, clamped) = shifted(
                table,
                tools.job,
                self.place,
                if by.is_finite() { by } else { 0.0 },
            );
            moved = offset(table, foot) - offset(table, self.place);
        }
        let Ok(ball) = tools.frame(table, foot, curve.at) else {
            return (f32::INFINITY, interval);
        };
        let chord = Vec3::between_q30(&point.point, &ball.point);
        let radius = sqrt(point.offset.dot(point.offset));
        let seen = Seen {
            chord_mm: 0.0,
            power: chord.dot(chord) + 2.0 * chord.dot(ball.offset),
            middle: point.offset.dot(chord + ball.offset) / radius,
        };
        // A Newton step to the deepest ball: gradient of the power along the pass, and its second derivative.
        let rise = self.rise(curve.at);
        let tangent = ball.path + ball.side * curve.slope;
        let bent = (ball.e - ball.a) * moved
            + (ball.f - ball.b) * (rise + curve.slope * moved)
            + (ball.g - ball.c) * (curve.slope * rise);
        let gradient = chord.dot(tangent) - bent;
        let stretch = ball.stretch(curve.slope);
        let less = gradient * gradient / stretch;
        let is_small = less <= CORRECTION_MAX * CORRECTION_MAX * seen.power;
        let power = if !clamped && is_small {
            seen.power - less
        } else {
            seen.power
        };
        (seen.height(power), interval)
    }

    /// The crest from the heights of both balls at the point: their roots are linear in the distance.
    fn excess(&mut self, job: &Job<'_>, second: f32, margin: f32) -> Option<i32> {
        let share = self.share;
        let (near, far) = (sqrt(self.first) / share, sqrt(second) / (1.0 - share));
        let root = if near.is_finite() && far.is_finite() {
            near * far / (near + far)
        } else {
            near.at_most(far)
        };
        let ratio = sqrt(margin * height_limit_mm(job.header)) / root;
        let at = far / (near + far);
        let off = (at - share).abs();
        if self.repeats < REPEATS_MAX && off > REPEAT_MIN && ratio < CLEAR + CLEAR_OFF * off {
            self.repeats += 1;
            self.share = at.at_least(SHARE_MIN).at_most(1.0 - SHARE_MIN);
            return None;
        }
        Some(if ratio < 1.0 {
            truncated(to_f32(self.gap) * (1.0 - ratio)).max(1)
        } else {
            0
        })
    }
}

/// Path parameter of a place, roughly.
pub(crate) fn offset<W: Deref<Target = [i32]>>(table: &Table<W>, (interval, within): Place) -> f32 {
    let [start, end] = [interval, interval.saturating_add(1)].map(|at| table.real(Column::Abscissa, at));
    start + (end - start) * (to_f32(within) / WITHIN)
}

/// A place moved along the path parameter, and whether it would be beyond an end.
pub(crate) fn shifted<W: Deref<Target = [i32]>>(
    table: &Table<W>,
    job: &Job<'_>,
    (interval, within): Place,
    by: f32,
) -> (Place, bool) {
    let stations = table.stations();
    let last = stations.count().saturating_sub(2);
    let mut interval = interval;
    let mut length = stations.length(job, interval);
    let mut at = to_f32(within) / WITHIN * length + by;
    for _ in 0..INTERVALS_MAX {
        if at < 0.0 {
            if interval == 0 {
                return ((0, 0), true);
            }
            interval -= 1;
            length = stations.length(job, interval);
            at += length;
        } else if at > length {
            if interval >= last {
                return ((last, i32::MAX), true);
            }
            at -= length;
            interval += 1;
            length = stations.length(job, interval);
        } else {
            break;
        }
    }
    let share = (at / length).at_most(1.0).at_least(0.0);
    ((interval, truncated(share * WITHIN)), false)
}
