//! A patch on a pass: the surface at the pass's side parameter, with ball, feed and scallop limit in the patch's units.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Job;
use crate::job::{SurfaceKind, ToolSide};
use crate::math::arith::{centred, power_of_two};
use crate::math::number::NM_PER_MM_F32;
use crate::pass::front::{FrontLine, FrontPiece};
use crate::pass::interval::Interval;
use crate::pass::offset::{Locator, origin_q30};
use crate::pass::position::PassPosition;
use crate::pass::route::{Piece, Route};
use crate::sample::SpanParameter;
use crate::surface::{
    Ball, CirclePass, Contact, CurvePass, Derivatives, GridPass, IsoLine, OffsetUnits, POLYNOMIAL_WORDS,
    PathSpeed, ProfilePass, RATIONAL_WORDS, REVOLVED_WORDS, RecordKind, Surface, split_patch, split_revolved,
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
    /// The parametrisation at start and end, once [`Self::find_ends`] was called.
    ends: Option<[PathSpeed; 2]>,
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
        ends: None,
    };

    /// Becomes the patch of a piece of a pass.
    ///
    /// # Errors
    /// As [`Self::collapse`].
    pub(crate) fn lay(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) -> Result<()> {
        self.range = piece.range;
        match (&route.front, &piece.front) {
            (Some(line), Some(on)) => self.lay_on_front(job, line, on, &piece.position),
            _ => self.collapse(job, &piece.position),
        }
    }

    /// Becomes the patch of a piece of a pass on a front.
    fn lay_on_front(
        &mut self,
        job: &Job<'_>,
        line: &FrontLine,
        piece: &FrontPiece,
        position: &PassPosition,
    ) -> Result<()> {
        let PassPosition { side, span, reversed } = *position;
        self.take_record(job, [span, side.span])?;
        let range = self.range;
        if let Surface::Curve(pass) = &mut self.surface {
            let (are_on, is_far) = line.boundary_of(piece);
            pass.set_curve(line.side_curve(job, piece));
            pass.set_ends(reversed, range, are_on, is_far);
        }
        Ok(())
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
            pass.take(kind, words, radius);
        }
        self.point = false;
        self.ends = None;
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
        self.ends = None;
        Ok(())
    }

    /// The side parameter at a fraction of the patch, in the direction of travel.
    pub(crate) fn side_at(&self, position: &PassPosition, fraction: u64) -> SpanParameter {
        match &self.surface {
            Surface::Curve(pass) => SpanParameter {
                span: position.side.span,
                fraction: pass.side(fraction).fraction,
            },
            _ => position.side,
        }
    }

    /// Computes the parametrisation at both ends, and stores it for [`Self::start`] and [`Self::end`].
    pub(crate) fn find_ends(&mut self) {
        self.ends = Some([self.start(), self.end()]);
    }

    /// Whether [`Self::find_ends`] was called.
    pub(crate) const fn has_ends(&self) -> bool {
        self.ends.is_some()
    }

    /// The parametrisation at the start of the pass on the patch, in the direction of travel.
    pub(crate) fn start(&self) -> PathSpeed {
        match self.ends {
            Some([start, _]) => start,
            None => {
                let [start, _] = self.range;
                self.surface.path_at(start)
            }
        }
    }

    /// The parametrisation at the end of the pass on the patch, in the direction of travel.
    pub(crate) fn end(&self) -> PathSpeed {
        match self.ends {
            Some([_, end]) => end,
            None => {
                let [_, end] = self.range;
                self.surface.path_at(end)
            }
        }
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
