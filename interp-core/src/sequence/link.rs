//! Links from pass to pass: straight moves off the surface, or a step-over along the boundary on the surface. Each is a separate path,
//! traversed from standstill to standstill with the same speed profile as the passes.

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

/// Look-ahead cells of a step-over along the boundary.
const STEP_OVER_CELLS: u16 = 8;

/// Fraction of the jerk limit that a step-over uses: it is some tenths of a millimetre long and at the jerk limit throughout, and a cutter location is rounded
/// to 1 to 2 nm, which a third difference multiplies by up to eight.
const JERK_SHARE: f32 = 0.7;

/// Links up to this length, nm, are omitted: the rounding difference of one position computed twice.
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

    /// A move from point to point whose last `slow_mm` does not exceed `feed_mm_s`; none where its length is negligible. The filter of the plan is chosen;
    /// its speeds are still to be computed.
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

    /// The position at this progress, units of 2^-10 nm.
    pub(crate) fn position(&self, progress: i64, plan: &Plan) -> [i32; 3] {
        if progress >= plan.end {
            return self.to;
        }
        let part = part_q30(progress, plan.end);
        let mut at = self.from;
        for (at, to) in at.iter_mut().zip(&self.to) {
            // 32 bits times 30 bits fits 64.
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
    /// Distance of the two passes in the side parameter.
    reach: f32,
    /// Path span and direction at the end of the pass.
    line: PassPosition,
    /// Next station to plan, and the differences over the previous stations.
    station: u16,
    here: Option<Located>,
    stencil: Stencil,
    contact: [i32; 3],
    cell: f32,
    /// Maximum ratio of the length of the contact's path to the length in the plan.
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

    /// A step-over from the pass that ends on this patch to another.
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

    /// Contact and ball centre at this fraction of the step-over, 0 to 1.
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

    /// Plans one portion: a station's location or its cell's limits. Returns whether the plan is complete, or `None` where the length of the step-over is
    /// negligible.
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

    /// Contact and ball centre at this progress, units of 2^-10 nm.
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

    /// Ratio of the speed along the plan to the contact's speed.
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

/// A step-over is short, so that 24 bits resolve it to less than 1 nm.
fn ratio(part: i64, whole: i64) -> f32 {
    to_f32(part) / to_f32(whole)
}

/// A fraction in units of 2^-30, with an error of at most 2^-30: 0.1 nm in 100 mm.
fn part_q30(part: i64, whole: i64) -> i64 {
    // To 31 bits.
    let shift = 33_u32.saturating_sub(whole.leading_zeros());
    let (part, whole) = (part >> shift, whole >> shift);
    (part << 30).checked_div(whole).unwrap_or(0)
}
