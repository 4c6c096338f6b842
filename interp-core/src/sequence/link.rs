//! Links from pass to pass: straight moves off the surface, or a step-over along the boundary on the surface. Each is a path of its own,
//! followed from standstill to standstill by the same profile as the passes.

use crate::fault::{Fault, FaultKind, Result};
use crate::feed::QUANTA_PER_MM;
use crate::feed::demand::{PathLimits, Stencil, squared};
use crate::feed::plan::{CELLS_STANDING, FeedLimits, Plan};
use crate::job::AxisLimits;
use crate::job::program::Job;
use crate::math::arith::sqrt;
use crate::math::number::{Bounded, MM_PER_NM, to_f32};
use crate::pass::offset::Located;
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::schedule;
use crate::sample::SpanParameter;

/// Cells of a step-over along the boundary.
const STEP_OVER_CELLS: u16 = 8;

/// Share of the jerk that a step-over uses: it is some tenths of a millimetre long, at the jerk limit all the way, and a cutter location is good
/// to a nanometre or two, which a third difference multiplies by eight.
const JERK_SHARE: f32 = 0.7;

/// A link shorter than this, nm, is none: the rounding of one position computed twice.
const NOTHING_NM: i64 = 2;

/// A straight move.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StraightMove {
    from: [i32; 3],
    to: [i32; 3],
}

impl StraightMove {
    /// No move.
    pub(crate) const NONE: Self = Self {
        from: [0; 3],
        to: [0; 3],
    };

    /// From point to point, the last `slow_mm` of it no faster than `feed_mm_s`; none where it is too short to be one. The plan is settled, and
    /// still to be worked on.
    pub(crate) fn new(
        from: [i32; 3],
        to: [i32; 3],
        slow_mm: f32,
        feed_mm_s: f32,
        axes: &AxisLimits,
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
        let limits = PathLimits::straight(axes, &cosines);
        let speed = crate::feed::demand::root(limits.max_speed_sqr);
        let top = FeedLimits {
            speed,
            usual: speed,
            period_s,
        };
        plan.begin();
        let slow = slow_mm.at_most(length);
        let fast = length - slow;
        if fast > 0.0 {
            plan.add(fast, &limits, 0, &top);
        }
        if slow > 0.0 {
            let square = limits.max_speed_sqr.at_most(squared(feed_mm_s));
            plan.add(
                slow,
                &PathLimits {
                    max_speed_sqr: square,
                    ..limits
                },
                0,
                &top,
            );
        }
        plan.settle(&top);
        Some((Self { from, to }, speed * period_s * QUANTA_PER_MM))
    }

    /// The position at this progress, quanta.
    pub(crate) fn position(&self, progress: i64, plan: &Plan) -> [i32; 3] {
        if progress >= plan.end {
            return self.to;
        }
        let part = part_q30(progress, plan.end);
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

/// A step-over from the end of a pass to the start of the next, along the boundary.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundaryStepOver {
    from: SpanParameter,
    to: SpanParameter,
    /// Their distance in the side parameter.
    reach: f32,
    /// Path span and direction at the end of the pass.
    line: PassPosition,
    /// Station that is planned next, and the differences over those before.
    station: u16,
    here: Option<Located>,
    stencil: Stencil,
    contact: [i32; 3],
    cell: f32,
    /// Greatest length of the contact's path over the length in the plan.
    contact_ratio: f32,
}

impl BoundaryStepOver {
    /// No move.
    pub(crate) const NONE: Self = Self {
        from: SpanParameter { span: 0, fraction: 0 },
        to: SpanParameter { span: 0, fraction: 0 },
        reach: 0.0,
        line: PassPosition {
            side: SpanParameter { span: 0, fraction: 0 },
            reversed: false,
            span: 0,
        },
        station: 0,
        here: None,
        stencil: Stencil::START,
        contact: [0; 3],
        cell: 0.0,
        contact_ratio: 1.0,
    };

    /// From one pass, which ends on this patch, to another.
    pub(crate) fn new(job: &Job<'_>, line: &PassPosition, to: SpanParameter) -> Self {
        let width = |span| job.side_width(span);
        Self {
            from: line.side,
            to,
            reach: schedule::apart(line.side, to, width),
            line: *line,
            ..Self::NONE
        }
    }

    /// Contact and centre at this part of the step-over, 0 to 1.
    ///
    /// # Errors
    /// The fault of the surface there.
    fn locate(&self, job: &Job<'_>, patch: &mut Patch, part: f32) -> Result<Located> {
        let width = |span| job.side_width(span);
        let side = if part >= 1.0 {
            self.to
        } else {
            let side = schedule::next_side(self.from, self.reach * part, job.header.side_spans, width);
            side.unwrap_or(self.from)
        };
        patch.collapse(job, &PassPosition { side, ..self.line })?;
        let (_, located) = patch.evaluate(u64::MAX)?;
        Ok(located)
    }

    /// Plans in portions, a station's location or its cell's limits; whether the plan is complete, or `None` where the step-over is too short to be
    /// one.
    ///
    /// # Errors
    /// The fault of the surface there.
    pub(crate) fn work(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        patch: &mut Patch,
        top: &FeedLimits,
        plan: &mut Plan,
    ) -> Result<Option<bool>> {
        if self.station > STEP_OVER_CELLS {
            return Ok(Some(plan.work(CELLS_STANDING)));
        }
        let Some(here) = self.here.take() else {
            let part = f32::from(self.station) / f32::from(STEP_OVER_CELLS);
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
            self.cell = length / f32::from(STEP_OVER_CELLS);
            self.stencil.begin(here.cl_nm);
            plan.begin();
        } else {
            self.stencil.add(here.cl_nm, self.cell);
            let limits = self.stencil.limits(axes, top);
            let limits = PathLimits {
                jerk: JERK_SHARE * limits.jerk,
                ..limits
            };
            self.contact_ratio = self
                .contact_ratio
                .at_least(distance(&self.contact, &here.cc_nm) / self.cell);
            plan.add(self.cell, &limits, 2, top);
        }
        self.contact = here.cc_nm;
        if self.station == STEP_OVER_CELLS {
            plan.settle(top);
        }
        self.station += 1;
        Ok(Some(false))
    }

    /// Contact and centre at this progress, quanta.
    ///
    /// # Errors
    /// The fault of the surface there.
    pub(crate) fn position(
        &self,
        job: &Job<'_>,
        patch: &mut Patch,
        progress: i64,
        plan: &Plan,
    ) -> Result<Located> {
        let part = if progress >= plan.end {
            1.0
        } else {
            ratio(progress, plan.end)
        };
        self.locate(job, patch, part)
    }

    /// Speed along the plan per speed of the contact.
    pub(crate) fn per_contact(&self) -> f32 {
        1.0 / self.contact_ratio
    }
}

/// Whether a link off the surface can begin and end here.
///
/// # Errors
/// [`FaultKind::LinkBlocked`] where the surface does not face up.
pub(crate) fn check_faces_up(up: bool) -> Result<()> {
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

/// A step-over is short: 24 bits of it resolve less than a nanometre.
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
