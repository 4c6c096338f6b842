//! Position and progress of a run, and the sample there.

use crate::fault::{Fault, FaultKind, Result};
use crate::math::arith::{advanced, dot_hi};
use crate::pass::offset::Located;
use crate::pass::patch::Patch;
use crate::pass::route::{Piece, Route};
use crate::sample::{Sample, SpanParameter};
use crate::surface::{Contact, Pass, PathSpeed};

/// The task of the next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// Begin the first pass.
    Pass,
    /// Emit the first sample of the first pass, which was begun at load.
    Begun,
    /// Advance by one period's arc.
    Along,
    /// Find the next pass, and begin it.
    Over,
    /// None: the last sample was emitted.
    End,
}

/// Position and progress of the run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Travel {
    pub(super) next: Next,
    pub(super) route: Route,
    pub(super) piece: Piece,
    /// Fraction of the span, in the direction of travel.
    pub(super) fraction: u64,
    /// The parametrisation at the last sample, and the logarithmic speed derivative at the sample before; NaN where that is on another patch.
    pub(super) path: PathSpeed,
    pub(super) log_speed_derivative_before: f32,
    /// r N at the last sample, in the ball's units.
    pub(super) offset: [i32; 3],
    /// Maximum inverse square interval of the pass, with the surface's curvature at that sample; see [`PassMaximum`](crate::pass::step_over::PassMaximum).
    pub(super) max_inv_interval_sq: f32,
    pub(super) shape: [f32; 2],
    /// Samples so far.
    pub(super) ticks: u32,
    pub(super) pass: u32,
    /// Side parameter at the last sample.
    pub(super) side: SpanParameter,
}

impl Travel {
    pub(super) const START: Self = Self {
        next: Next::Pass,
        route: Route::NONE,
        piece: Piece::NONE,
        fraction: 0,
        path: PathSpeed {
            inv_speed: 0.0,
            log_speed_derivative: 0.0,
        },
        log_speed_derivative_before: f32::NAN,
        offset: [0; 3],
        max_inv_interval_sq: 0.0,
        shape: [0.0; 2],
        ticks: 0,
        pass: 0,
        side: SpanParameter { span: 0, fraction: 0 },
    };

    /// Fraction of the span, in the surface's own direction.
    pub(super) const fn own_fraction(&self) -> u64 {
        self.route.turned(self.fraction)
    }

    /// Path span, in the surface's own direction.
    pub(super) const fn span(&self) -> u16 {
        self.piece.position.span
    }

    /// Whether the last sample was the first one of the pass.
    pub(super) fn is_at_start(&self) -> bool {
        self.fraction == self.piece.start() && self.log_speed_derivative_before.is_nan()
    }

    /// The place a step beyond, if it is on the piece.
    #[inline(always)]
    pub(super) fn beyond(&self, step: u64) -> Option<u64> {
        advanced(self.fraction, step).filter(|fraction| *fraction <= self.piece.end())
    }

    /// Steps 2 to 4 at the run's position. A fault leaves `last` unchanged. Not inlined: a separate function for
    /// each kind of surface saves only the registers that the kind uses.
    #[inline(never)]
    pub(super) fn sample<P: Pass>(&mut self, pass: &P, patch: &Patch, last: &mut Sample) -> Result<()> {
        let evaluated = patch.evaluate_on(pass, self.fraction)?;
        let (contact, _) = &evaluated;
        self.check_fold(patch, &contact.offset)?;
        self.emit(&Evaluated::of(patch, &evaluated), last);
        Ok(())
    }

    #[inline(always)]
    fn check_fold(&self, patch: &Patch, offset: &[i32; 3]) -> Result<()> {
        if patch.locator.folds(dot_hi(&self.offset, offset)) {
            return Err(folded());
        }
        Ok(())
    }

    /// The sample of what was evaluated at the run's position.
    #[inline(always)]
    fn emit(&mut self, at: &Evaluated, last: &mut Sample) {
        if at.inv_interval_sq > self.max_inv_interval_sq {
            self.max_inv_interval_sq = at.inv_interval_sq;
            self.shape = at.shape;
        }
        self.offset = at.offset;
        self.log_speed_derivative_before = self.path.log_speed_derivative;
        self.path = at.path;
        last.tick = self.ticks;
        last.path.fraction = self.own_fraction();
        last.cc_nm = at.located.cc_nm;
        last.cl_nm = at.located.cl_nm;
        last.inv_interval_sq = at.inv_interval_sq;
        self.ticks = self.ticks.wrapping_add(1);
    }

    /// The first sample of a pass, evaluated ahead; see [`Self::sample`].
    #[inline(never)]
    pub(super) fn first_sample(
        &mut self,
        first: &FirstSample,
        patch: &Patch,
        last: &mut Sample,
    ) -> Result<()> {
        self.check_fold(patch, &first.at.offset)?;
        self.emit(&first.at, last);
        self.side = first.side;
        last.side = first.side;
        Ok(())
    }
}

/// What is computed of a sample.
#[derive(Clone, Copy, Debug)]
struct Evaluated {
    path: PathSpeed,
    offset: [i32; 3],
    located: Located,
    inv_interval_sq: f32,
    /// See [`Travel::shape`].
    shape: [f32; 2],
}

impl Evaluated {
    #[inline(always)]
    fn of(patch: &Patch, (contact, located): &(Contact, Located)) -> Self {
        Self {
            path: contact.path,
            offset: contact.offset,
            located: *located,
            inv_interval_sq: patch.interval.inv_interval_sq(contact),
            shape: [contact.across, contact.lateral_squared],
        }
    }
}

/// The first sample of a pass, evaluated in the planning before the tick that emits it.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstSample {
    at: Evaluated,
    side: SpanParameter,
}

impl FirstSample {
    /// At the start of a piece of a pass on its patch; none where that faults.
    pub(super) fn of(patch: &Patch, piece: &Piece) -> Option<Self> {
        let evaluated = patch.evaluate(piece.start()).ok()?;
        Some(Self {
            at: Evaluated::of(patch, &evaluated),
            side: patch.side_at(&piece.position, piece.start()),
        })
    }
}

#[cold]
#[inline(never)]
fn folded() -> Fault {
    Fault::new(FaultKind::DegenerateSurface, 0.0)
}
