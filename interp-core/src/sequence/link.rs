//! From pass to pass: straight legs in the open, or a step along the boundary on the surface. Each is a path of its own, followed from
//! standstill to standstill by the same profile as the passes.

use crate::fault::{Fault, FaultKind, Result};
use crate::feed::QUANTA_PER_MM;
use crate::feed::demand::{Room, Stencil, squared};
use crate::feed::plan::{CELLS_STANDING, Plan, Top};
use crate::job::Axes;
use crate::job::program::Job;
use crate::math::arith::sqrt;
use crate::math::number::{Bounded, MM_PER_NM, to_f32};
use crate::pass::offset::Located;
use crate::pass::patch::Patch;
use crate::pass::position::Line;
use crate::pass::schedule;
use crate::sample::Place;

/// Cells of a step along the boundary.
const STEP_CELLS: u16 = 8;

/// Share of the jerk that is used on them: a step is some tenths of a millimetre, jerk all the way, and a cutter location is good to a
/// nanometre or two, which a third difference makes eight times.
const JERK_SHARE: f32 = 0.7;

/// A link shorter than this, nm, is none: a place and itself, rounded twice.
const NOTHING_NM: i64 = 2;

/// A straight leg.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Leg {
    from: [i32; 3],
    to: [i32; 3],
}

impl Leg {
    /// None.
    pub(crate) const NONE: Self = Self {
        from: [0; 3],
        to: [0; 3],
    };

    /// From place to place, the last `slow_mm` of it no faster than `feed_mm_s`; none where it is too short to be one. The plan is settled, and
    /// still to be worked on.
    pub(crate) fn new(
        from: [i32; 3],
        to: [i32; 3],
        slow_mm: f32,
        feed_mm_s: f32,
        axes: &Axes,
        period_s: f32,
        plan: &mut Plan,
    ) -> Option<(Self, f32)> {
        let mut apart = [0_i64; 3];
        for ((apart, from), to) in apart.iter_mut().zip(&from).zip(&to) {
            *apart = i64::from(*to) - i64::from(*from);
        }
        if apart.iter().all(|apart| apart.abs() <= NOTHING_NM) {
            return None;
        }
        let mm = apart.map(to_mm);
        let [x, y, z] = mm;
        let length = sqrt(x * x + y * y + z * z);
        let cosines = mm.map(|mm| mm / length);
        let room = Room::straight(axes, &cosines);
        let speed = crate::feed::demand::root(room.square);
        let top = Top {
            speed,
            usual: speed,
            period_s,
        };
        plan.begin();
        let slow = slow_mm.at_most(length);
        let fast = length - slow;
        if fast > 0.0 {
            plan.add(fast, &room, 0, &top);
        }
        if slow > 0.0 {
            let square = room.square.at_most(squared(feed_mm_s));
            plan.add(slow, &Room { square, ..room }, 0, &top);
        }
        plan.settle(&top);
        Some((Self { from, to }, speed * period_s * QUANTA_PER_MM))
    }

    /// The place so many quanta along.
    pub(crate) fn at(&self, place: i64, plan: &Plan) -> [i32; 3] {
        if place >= plan.end {
            return self.to;
        }
        let part = part_q30(place, plan.end);
        let mut at = self.from;
        for (at, to) in at.iter_mut().zip(&self.to) {
            // 32 bits times 30.
            let apart = i64::from(*to) - i64::from(*at);
            let nm = (apart * part + (1 << 29)) >> 30;
            *at = i32::try_from(i64::from(*at) + nm).unwrap_or(*at);
        }
        at
    }
}

/// A step from the end of a pass to the start of the next, along the boundary.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    from: Place,
    to: Place,
    /// How far apart they are in the side parameter.
    reach: f32,
    /// Path span and direction at the end of the pass.
    line: Line,
    /// Station that is planned next, and what is known of those before.
    station: u16,
    here: Option<Located>,
    stencil: Stencil,
    contact: [i32; 3],
    cell: f32,
    /// Greatest length of the contact's path over the length that the plan counts.
    stretch: f32,
}

impl Step {
    /// None.
    pub(crate) const NONE: Self = Self {
        from: Place { span: 0, fraction: 0 },
        to: Place { span: 0, fraction: 0 },
        reach: 0.0,
        line: Line {
            side: Place { span: 0, fraction: 0 },
            reversed: false,
            span: 0,
        },
        station: 0,
        here: None,
        stencil: Stencil::START,
        contact: [0; 3],
        cell: 0.0,
        stretch: 1.0,
    };

    /// From one pass, which ends on this patch, to another.
    pub(crate) fn new(job: &Job<'_>, line: &Line, to: Place) -> Self {
        let width = |span| job.side_width(span);
        Self {
            from: line.side,
            to,
            reach: schedule::apart(line.side, to, width),
            line: *line,
            ..Self::NONE
        }
    }

    /// Contact and centre at this part of the step, 0 to 1.
    ///
    /// # Errors
    /// What is wrong with the surface there.
    fn locate(&self, job: &Job<'_>, patch: &mut Patch, part: f32) -> Result<Located> {
        let width = |span| job.side_width(span);
        let side = if part >= 1.0 {
            self.to
        } else {
            let side = schedule::next_side(self.from, self.reach * part, job.header.side_spans, width);
            side.unwrap_or(self.from)
        };
        patch.collapse(job, &Line { side, ..self.line })?;
        let (_, located) = patch.evaluate(u64::MAX)?;
        Ok(located)
    }

    /// Plans, in portions: where a station is, or what its cell leaves; whether the step can be gone, or is too short to be one (`None`).
    ///
    /// # Errors
    /// What is wrong with the surface there.
    pub(crate) fn work(
        &mut self,
        job: &Job<'_>,
        axes: &Axes,
        patch: &mut Patch,
        top: &Top,
        plan: &mut Plan,
    ) -> Result<Option<bool>> {
        if self.station > STEP_CELLS {
            return Ok(Some(plan.work(CELLS_STANDING)));
        }
        let Some(here) = self.here.take() else {
            let part = f32::from(self.station) / f32::from(STEP_CELLS);
            let here = self.locate(job, patch, part)?;
            crate::sequence::lookahead::check_travel(axes, &here.cl_nm)?;
            self.here = Some(here);
            return Ok(Some(false));
        };
        if self.station == 0 {
            let there = self.locate(job, patch, 1.0)?;
            let length = distance(&here.cc_nm, &there.cc_nm).at_least(distance(&here.cl_nm, &there.cl_nm));
            if !(length > to_mm(NOTHING_NM)) {
                return Ok(None);
            }
            self.cell = length / f32::from(STEP_CELLS);
            self.stencil.begin(here.cl_nm);
            plan.begin();
        } else {
            self.stencil.add(here.cl_nm, self.cell);
            let room = self.stencil.room(axes, top);
            let room = Room {
                jerk: JERK_SHARE * room.jerk,
                ..room
            };
            self.stretch = self
                .stretch
                .at_least(distance(&self.contact, &here.cc_nm) / self.cell);
            plan.add(self.cell, &room, 2, top);
        }
        self.contact = here.cc_nm;
        if self.station == STEP_CELLS {
            plan.settle(top);
        }
        self.station += 1;
        Ok(Some(false))
    }

    /// Contact and centre so many quanta along.
    ///
    /// # Errors
    /// What is wrong with the surface there.
    pub(crate) fn at(&self, job: &Job<'_>, patch: &mut Patch, place: i64, plan: &Plan) -> Result<Located> {
        let part = if place >= plan.end {
            1.0
        } else {
            ratio(place, plan.end)
        };
        self.locate(job, patch, part)
    }

    /// What a speed of the contact is of the plan's.
    pub(crate) fn per_contact(&self) -> f32 {
        1.0 / self.stretch
    }
}

/// Whether a link in the open can begin and end here.
///
/// # Errors
/// [`FaultKind::LinkBlocked`] where the surface does not face up.
pub(crate) fn check_up(up: bool) -> Result<()> {
    if up {
        Ok(())
    } else {
        Err(Fault::new(FaultKind::LinkBlocked, 0.0))
    }
}

fn distance(from: &[i32; 3], to: &[i32; 3]) -> f32 {
    let mut sum = 0.0;
    for (from, to) in from.iter().zip(to) {
        sum += squared(to_mm(i64::from(*to) - i64::from(*from)));
    }
    sqrt(sum)
}

fn to_mm(nm: i64) -> f32 {
    to_f32(nm) * MM_PER_NM
}

/// A step is short: 24 bits of it are below a nanometre.
fn ratio(part: i64, whole: i64) -> f32 {
    to_f32(part) / to_f32(whole)
}

/// A part of a whole, units of 2^-30: good to 2^-30 of it, a tenth of a nanometre in 100 mm.
fn part_q30(part: i64, whole: i64) -> i64 {
    // To 31 bits.
    let shift = 33_u32.saturating_sub(whole.leading_zeros());
    let (part, whole) = (part >> shift, whole >> shift);
    (part << 30).checked_div(whole).unwrap_or(0)
}
