//! A patch on a pass: the surface at the pass's side parameter, with ball, feed and scallop limit in the patch's units.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Job;
use crate::job::{SurfaceKind, ToolSide};
use crate::math::arith::{centred, fraction_from_f32, fraction_to_f32, power_of_two};
use crate::math::number::{Bounded, NM_PER_MM_F32};
use crate::pass::front::{FrontLine, FrontPiece};
use crate::pass::interval::Interval;
use crate::pass::offset::{Locator, origin_q30};
use crate::pass::position::PassPosition;
use crate::pass::route::{Piece, Route};
use crate::sample::SpanParameter;
use crate::surface::{
    Ball, CirclePass, Contact, CurvePass, Derivatives, GridPass, IsoLine, OffsetUnits, POLYNOMIAL_WORDS,
    PathSpeed, ProfilePass, RATIONAL_WORDS, REVOLVED_WORDS, RecordKind, SideCurve, Surface, split_patch,
    split_revolved,
};

/// A patch on a pass. Units are the patch's, 2^-shift nm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    pub(crate) surface: Surface,
    pub(crate) ball: Ball,
    pub(crate) locator: Locator,
    pub(crate) interval: Interval,
    /// Origin, units of 2^-30 nm, see [`origin_q30`].
    pub(crate) origin: [i64; 3],
    /// One period's arc, units.
    pub(crate) arc: f32,
    /// Units per mm.
    pub(crate) per_mm: f32,
    /// The pass degenerates to a point on this patch.
    pub(crate) point: bool,
    /// Start and end of the pass on it, fractions in the direction of travel.
    pub(crate) range: [u64; 2],
    /// The parametrisation at start and end, once [`Self::find_start`] and [`Self::find_end`] were called.
    start: Option<PathSpeed>,
    end: Option<PathSpeed>,
    /// Change of the logarithmic speed derivative over the first period at the programmed feed, once [`Self::find_change`] was called.
    change: Option<f32>,
}

/// Least part of the first period's step over which the change of the parametrisation is taken.
const CHANGE_PART: f32 = 0.25;

/// A piece of a front on a patch: its curve, whether its ends are on the last side boundary, and whether that is the end of the side span.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnFront {
    curve: SideCurve,
    are_on_boundary: [bool; 2],
    is_far: bool,
}

impl OnFront {
    pub(crate) fn new(job: &Job<'_>, line: &FrontLine, on: &FrontPiece) -> Self {
        let (are_on_boundary, is_far) = line.boundary_of(on);
        Self {
            curve: line.side_curve(job, on),
            are_on_boundary,
            is_far,
        }
    }
}

impl Patch {
    /// No patch yet.
    pub(crate) const NONE: Self = Self {
        surface: Surface::Grid(GridPass::NONE),
        ball: Ball::NONE,
        locator: Locator::NONE,
        interval: Interval::NONE,
        origin: [0; 3],
        arc: 0.0,
        per_mm: 1.0,
        point: false,
        range: [0, u64::MAX],
        start: None,
        end: None,
        change: None,
    };

    /// Becomes the patch of a piece of a pass.
    ///
    /// # Errors
    /// As [`Self::collapse`].
    pub(crate) fn lay(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) -> Result<()> {
        self.range = piece.range;
        match (&route.front, &piece.front) {
            (Some(line), Some(on)) => self.lay_on_front(job, line, on, piece),
            _ => self.collapse(job, &piece.position),
        }
    }

    /// Becomes the patch of a piece of a pass on a front.
    fn lay_on_front(
        &mut self,
        job: &Job<'_>,
        line: &FrontLine,
        on: &FrontPiece,
        piece: &Piece,
    ) -> Result<()> {
        let PassPosition { side, span, .. } = piece.position;
        self.take_record(job, [span, side.span])?;
        self.go_on(piece, OnFront::new(job, line, on));
        Ok(())
    }

    /// The jump of the derivative of the logarithmic speed derivative at the end of the piece, where this one follows.
    pub(crate) fn jump_to(&self, on: &OnFront) -> f32 {
        let [_, end] = self.range;
        match &self.surface {
            Surface::Curve(pass) => pass.jump(end, &on.curve),
            _ => 0.0,
        }
    }

    /// Goes on with another piece of a front on this patch.
    pub(crate) fn go_on(&mut self, piece: &Piece, on: OnFront) {
        self.range = piece.range;
        self.forget_ends();
        if let Surface::Curve(pass) = &mut self.surface {
            pass.set_curve(on.curve);
            pass.set_ends(
                piece.position.reversed,
                piece.range,
                on.are_on_boundary,
                on.is_far,
            );
        }
    }

    /// Becomes the patch of a path span and a side span, to be evaluated at any place.
    ///
    /// # Errors
    /// As [`Self::collapse`].
    #[inline(never)]
    pub(crate) fn take_record(&mut self, job: &Job<'_>, [span, side_span]: [u16; 2]) -> Result<()> {
        let tool = if job.header.tool_side == ToolSide::Plus {
            1.0
        } else {
            -1.0
        };
        let (kind, words) = match job.header.kind {
            SurfaceKind::Polynomial => {
                let words = job.patch::<POLYNOMIAL_WORDS>(span, side_span)?;
                (RecordKind::Polynomial, words.as_slice())
            }
            SurfaceKind::Rational => {
                let words = job.patch::<RATIONAL_WORDS>(span, side_span)?;
                (RecordKind::Rational, words.as_slice())
            }
            SurfaceKind::RevolvedAlongProfile => {
                let words = job.patch::<REVOLVED_WORDS>(span, side_span)?;
                (RecordKind::Profile, words.as_slice())
            }
            SurfaceKind::RevolvedAroundAxis => {
                let words = job.patch::<REVOLVED_WORDS>(span, side_span)?;
                (RecordKind::Circle, words.as_slice())
            }
        };
        let (origin_nm, shift) = match kind {
            RecordKind::Polynomial | RecordKind::Rational => {
                let (origin_nm, shift, _, _) = split_patch(words);
                (origin_nm, shift)
            }
            RecordKind::Profile | RecordKind::Circle => {
                let (shift, height_nm) = words.first_chunk().map_or((0, 0), split_revolved);
                ([0, 0, height_nm], shift)
            }
        };
        self.origin = origin_q30(origin_nm);
        self.measure(job, shift, side_span, tool);
        let radius = tool * job.header.ball_radius_mm * self.per_mm;
        if !matches!(self.surface, Surface::Curve(_)) {
            self.surface = Surface::Curve(CurvePass::NONE);
        }
        if let Surface::Curve(pass) = &mut self.surface {
            pass.load_record(kind, words, radius);
        }
        self.point = false;
        self.forget_ends();
        Ok(())
    }

    /// Contact and derivatives at any place of a patch of [`Self::take_record`], by fractions of its path span and its side span.
    ///
    /// # Errors
    /// As [`Self::evaluate`].
    pub(crate) fn surface_at(&self, path: u64, side: u64) -> Result<(Contact, Derivatives)> {
        match &self.surface {
            Surface::Curve(pass) => pass.at(path, side, &self.ball),
            _ => Err(Fault::new(FaultKind::DegenerateSurface, 0.0)),
        }
    }

    /// Collapses the patch of a pass.
    ///
    /// # Errors
    /// [`crate::FaultKind::WrongState`] where the job has no such patch; the faults of the surface's kind.
    #[inline(never)]
    pub(crate) fn collapse(&mut self, job: &Job<'_>, position: &PassPosition) -> Result<()> {
        let PassPosition { side, reversed, span } = *position;
        let at = IsoLine {
            fraction: side.fraction,
            side: centred(side.fraction),
            reversed,
        };
        let tool = if job.header.tool_side == ToolSide::Plus {
            1.0
        } else {
            -1.0
        };
        // `path x side` changes its sign with the direction of travel, except on a circle, whose normal is independent of it.
        let sign = if reversed && job.header.kind != SurfaceKind::RevolvedAroundAxis {
            -tool
        } else {
            tool
        };
        match job.header.kind {
            SurfaceKind::Polynomial => {
                let words = job.patch::<POLYNOMIAL_WORDS>(span, side.span)?;
                self.collapse_grid(job, words, side.span, sign, &at);
            }
            SurfaceKind::Rational => {
                let words = job.patch::<RATIONAL_WORDS>(span, side.span)?;
                self.collapse_grid(job, words, side.span, sign, &at);
            }
            kind => {
                let words = job.patch::<REVOLVED_WORDS>(span, side.span)?;
                let (shift, height_nm) = split_revolved(words);
                self.origin = origin_q30([0, 0, height_nm]);
                self.measure(job, shift, side.span, sign);
                let radius = sign * job.header.ball_radius_mm * self.per_mm;
                if kind == SurfaceKind::RevolvedAlongProfile {
                    let mut pass = ProfilePass::default();
                    pass.collapse(words, &at, radius);
                    self.surface = Surface::Profile(pass);
                } else {
                    let mut pass = CirclePass::default();
                    pass.collapse(words, &at, radius)?;
                    self.surface = Surface::Circle(pass);
                }
            }
        }
        self.point = self.surface.is_point();
        self.forget_ends();
        Ok(())
    }

    /// The side parameter at a fraction of the patch, in the direction of travel.
    pub(crate) fn side_at(&self, position: &PassPosition, fraction: u64) -> SpanParameter {
        match &self.surface {
            Surface::Curve(pass) => SpanParameter {
                span: position.side.span,
                fraction: pass.side_fraction(fraction),
            },
            _ => position.side,
        }
    }

    /// Computes the parametrisation at the start, and stores it for [`Self::start`].
    pub(crate) fn find_start(&mut self) {
        self.start = Some(self.start());
    }

    /// Computes the change of the parametrisation over the first period, and stores it for [`Self::change`].
    pub(crate) fn find_change(&mut self) {
        if self.point {
            return;
        }
        let ([start, end], speed) = (self.range, self.start());
        let step = self.arc * speed.inv_speed;
        // The curve ends with the piece.
        let room = fraction_to_f32(end.saturating_sub(start));
        let length = step.at_most(room);
        if length >= CHANGE_PART * step {
            let then = self
                .surface
                .path_at(start.saturating_add(fraction_from_f32(length)).min(end));
            let change = then.log_speed_derivative - speed.log_speed_derivative;
            self.change = Some(change * (step / length));
        }
    }

    /// Change of the logarithmic speed derivative over the first period, where it is known.
    pub(crate) const fn change(&self) -> Option<f32> {
        self.change
    }

    fn forget_ends(&mut self) {
        (self.start, self.end, self.change) = (None, None, None);
    }

    /// Computes the parametrisation at the end, and stores it for [`Self::end`].
    pub(crate) fn find_end(&mut self) {
        self.end = Some(self.end());
    }

    /// Whether [`Self::find_end`] was called.
    pub(crate) const fn has_end(&self) -> bool {
        self.end.is_some()
    }

    /// The parametrisation at the start of the pass on the patch, in the direction of travel.
    pub(crate) fn start(&self) -> PathSpeed {
        let [start, _] = self.range;
        self.start.unwrap_or_else(|| self.surface.path_at(start))
    }

    /// The parametrisation at the end of the pass on the patch, in the direction of travel.
    pub(crate) fn end(&self) -> PathSpeed {
        let [_, end] = self.range;
        self.end.unwrap_or_else(|| self.surface.path_at(end))
    }

    /// A patch of a grid, with one block per coordinate.
    fn collapse_grid(&mut self, job: &Job<'_>, words: &[i32], side_span: u16, sign: f32, at: &IsoLine) {
        let (origin_nm, shift, edges, blocks) = split_patch(words);
        self.origin = origin_q30(origin_nm);
        self.measure(job, shift, side_span, sign);
        if !matches!(self.surface, Surface::Grid(_)) {
            self.surface = Surface::Grid(GridPass::NONE);
        }
        if let Surface::Grid(pass) = &mut self.surface {
            pass.collapse(blocks, edges, at);
        }
    }

    /// Ball, feed and scallop limit in the patch's units.
    fn measure(&mut self, job: &Job<'_>, shift: u8, side_span: u16, sign: f32) {
        let header = job.header;
        self.per_mm = NM_PER_MM_F32 * power_of_two(shift.into());
        let units = OffsetUnits::new(header.ball_radius_mm, shift);
        self.ball = Ball::new(&units, sign);
        self.locator = Locator::new(&units);
        self.arc = header.feed_mm_s * header.period_s * self.per_mm;
        let width = job.side_width(side_span);
        self.interval = Interval::new(header.ball_radius_mm, header.scallop_mm, self.per_mm, width);
    }
}
