//! A patch along a curve `side = g(path)`: the side parameter is a cubic of the path parameter on a part of the patch.
//!
//! Nothing is collapsed: each coordinate is evaluated in rows across the path, then along it. With A and B the first derivatives, p and q those of g,
//! the path's tangent is `T = A + p B`, and `T' = S_path,path + 2 p S_path,side + p^2 S_side,side + q B`.

use super::lines::{CoordinatePoint, point_by_rows};
use super::pole::PoleAt;
use super::range::Edges;
use super::rational::{WEIGHT_ONE, Weight, quotient};
use super::revolved::{CirclePass, ProfilePass};
use super::side_curve::{SideCurve, SidePoint};
use super::{
    Ball, Contact, Derivatives, Factors, IsoLine, Local, Pass, PathSpeed, REVOLVED_WORDS, split_patch,
};
use crate::fault::Result;
use crate::math::arith::{centred, computed, inverse_sqrt, to_f32};
use crate::math::vec3::Vec3;

/// The kind of a patch's record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RecordKind {
    Polynomial,
    Rational,
    /// Revolved, the path along the profile or around the axis.
    Profile,
    Circle,
}

/// The evaluation routine of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CurveKind {
    Polynomial,
    Rational,
    /// A boundary collapses; with a weight of 1 where the record has none.
    Pole,
    Profile,
    Circle,
}

/// A patch along a curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurvePass {
    curve: SideCurve,
    kind: CurveKind,
    edges: Edges,
    /// Coefficients of the coordinates and of the weight; a revolved record's words.
    blocks: [[i32; 16]; 4],
    /// Ball radius in units, signed by the tool side, for a revolved surface.
    radius: f32,
    reversed: bool,
    /// Start and end in the direction of travel, whether one is on a boundary, which, and whether that is the end of the side span.
    range: [u64; 2],
    is_any_on_boundary: bool,
    are_on_boundary: [bool; 2],
    is_far: bool,
}

impl CurvePass {
    /// Placeholder before the first patch.
    pub(crate) const NONE: Self = Self {
        curve: SideCurve::NONE,
        kind: CurveKind::Polynomial,
        edges: Edges {
            path_start: false,
            path_end: false,
            side_start: false,
            side_end: false,
        },
        blocks: [[0; 16]; 4],
        radius: 0.0,
        reversed: false,
        range: [0, u64::MAX],
        is_any_on_boundary: false,
        are_on_boundary: [false; 2],
        is_far: false,
    };

    /// Becomes the patch with this record. `radius`: the ball's in units, signed by the tool side.
    pub(crate) fn load_record(&mut self, kind: RecordKind, words: &[i32], radius: f32) {
        self.radius = radius;
        match kind {
            RecordKind::Profile | RecordKind::Circle => {
                self.kind = if kind == RecordKind::Profile {
                    CurveKind::Profile
                } else {
                    CurveKind::Circle
                };
                for (slot, word) in self.blocks.as_flattened_mut().iter_mut().zip(words) {
                    *slot = *word;
                }
            }
            RecordKind::Polynomial | RecordKind::Rational => {
                let (_, _, edges, blocks) = split_patch(words);
                for (slot, block) in self.blocks.iter_mut().zip(blocks) {
                    *slot = *block;
                }
                self.edges = edges;
                self.kind = match (edges.count() > 0, kind) {
                    (true, _) => CurveKind::Pole,
                    (false, RecordKind::Rational) => CurveKind::Rational,
                    (false, _) => CurveKind::Polynomial,
                };
                if kind == RecordKind::Polynomial && self.kind == CurveKind::Pole {
                    let [.., weight] = &mut self.blocks;
                    *weight = [0; 16];
                    let [one, ..] = weight;
                    *one = WEIGHT_ONE;
                }
            }
        }
    }

    /// Sets the curve.
    pub(crate) const fn set_curve(&mut self, curve: SideCurve) {
        self.curve = curve;
    }

    /// Sets start and end in the direction of travel, whether they are on a boundary, and whether that is the end of the side span.
    pub(crate) const fn set_ends(
        &mut self,
        reversed: bool,
        range: [u64; 2],
        are_on: [bool; 2],
        is_far: bool,
    ) {
        (self.reversed, self.range) = (reversed, range);
        (self.are_on_boundary, self.is_far) = (are_on, is_far);
        let [start, end] = are_on;
        self.is_any_on_boundary = start || end;
    }

    const fn own(&self, fraction: u64) -> u64 {
        if self.reversed { !fraction } else { fraction }
    }

    /// The side parameter at a fraction of the path span, in the direction of travel.
    #[inline(always)]
    pub(crate) fn side(&self, fraction: u64) -> SidePoint {
        let mut point = self.curve.point(self.own(fraction));
        if self.is_any_on_boundary {
            for (at, is_on) in self.range.iter().zip(self.are_on_boundary) {
                if is_on && fraction == *at {
                    point.side = if self.is_far { u32::MAX } else { 0 };
                }
            }
        }
        point
    }

    /// The side parameter at a path parameter, as a fraction of the side span, 2^-64.
    pub(crate) fn side_fraction(&self, fraction: u64) -> u64 {
        self.own_side(&self.side(fraction))
    }

    /// A point's side parameter as a fraction of the side span: on a boundary exactly its end.
    #[inline(always)]
    pub(crate) const fn own_side(&self, point: &SidePoint) -> u64 {
        if point.side == u32::MAX {
            u64::MAX
        } else {
            (point.side as u64) << 32
        }
    }

    /// Contact and derivatives on the line of the side parameter, at any place of the patch.
    ///
    /// # Errors
    /// As [`Pass::contact`].
    pub(crate) fn at(&self, path: u64, side: u64, ball: &Ball) -> Result<(Contact, Derivatives)> {
        if matches!(self.kind, CurveKind::Profile | CurveKind::Circle) {
            return self.revolved(path, side, Some(ball));
        }
        let point = self.grid(path, side, &SidePoint::ON_LINE);
        let contact = point.local.contact::<true, true>(ball, &point.factors)?;
        Ok((contact, point.derivatives()))
    }

    /// A point of a grid's patch, for callers outside the sample path.
    #[inline(never)]
    fn grid(&self, path: u64, side: u64, point: &SidePoint) -> GridPoint {
        let w = centred(path);
        match self.kind {
            CurveKind::Polynomial => self.polynomial(w, side, point),
            CurveKind::Rational => self.rational(w, side, point),
            _ => self.pole(w, side, point),
        }
    }

    #[inline(always)]
    fn polynomial(&self, w: i32, side: u64, point: &SidePoint) -> GridPoint {
        let [x, y, z, _] = &self.blocks;
        let side = centred(side);
        let ([x0, x1, x2, xs, xm, xx], x) = point.polynomial_axis(x, side, w);
        let ([y0, y1, y2, ys, ym, yy], y) = point.polynomial_axis(y, side, w);
        let ([z0, z1, z2, zs, zm, zz], z) = point.polynomial_axis(z, side, w);
        GridPoint {
            local: Local {
                position: [x0, y0, z0],
                path: [x1, y1, z1],
                side: [xs, ys, zs],
                path2: [x2, y2, z2],
                mixed: [xm, ym, zm],
                side2: [xx, yy, zz],
                g: 1.0,
                inverse_g: 1.0,
                excess: 0.0,
            },
            half_change: Vec3 { x, y, z },
            factors: Factors::ONE,
            log_weight: [0.0; 2],
        }
    }

    #[inline(always)]
    fn rational(&self, w: i32, side: u64, point: &SidePoint) -> GridPoint {
        let [x, y, z, weight] = &self.blocks;
        let side = centred(side);
        let (weight, _) = computed(point_by_rows(weight, side, w), 0.0);
        let weight = Weight::new(weight);
        // Not by a closure, which LLVM may not inline.
        let (x, half_x) = point.rational_axis(x, side, w, &weight);
        let (y, half_y) = point.rational_axis(y, side, w, &weight);
        let (z, half_z) = point.rational_axis(z, side, w, &weight);
        GridPoint {
            local: weight.local(x, y, z),
            half_change: Vec3 {
                x: half_x,
                y: half_y,
                z: half_z,
            },
            factors: Factors::ONE,
            log_weight: weight.log_derivatives(),
        }
    }

    #[inline(always)]
    fn pole(&self, w: i32, side: u64, point: &SidePoint) -> GridPoint {
        let [x, y, z, weight] = &self.blocks;
        let line = iso_line(side);
        let weight = Weight::new(point_by_rows(weight, line.side, w));
        let pole = PoleAt::new(self.edges, &line);
        let factors = pole.factors(w);
        let axis = |block: &[i32; 16]| point.in_order(pole.axis(block, &line, &weight, w), &factors);
        let (x, half_x) = axis(x);
        let (y, half_y) = axis(y);
        let (z, half_z) = axis(z);
        GridPoint {
            local: weight.local(x, y, z),
            half_change: Vec3 {
                x: half_x,
                y: half_y,
                z: half_z,
            },
            factors,
            log_weight: weight.log_derivatives(),
        }
    }

    #[inline(never)]
    fn revolved(&self, path: u64, side: u64, ball: Option<&Ball>) -> Result<(Contact, Derivatives)> {
        let line = iso_line(side);
        let Some(words) = self.blocks.as_flattened().first_chunk::<REVOLVED_WORDS>() else {
            return Ok(Default::default());
        };
        if self.kind == CurveKind::Profile {
            let mut pass = ProfilePass::default();
            pass.collapse(words, &line, self.radius);
            let contact = ball.map_or(Ok(Contact::default()), |ball| pass.contact(path, ball));
            Ok((contact?, pass.derivatives(path)))
        } else {
            let mut pass = CirclePass::default();
            pass.collapse(words, &line, self.radius)?;
            let contact = ball.map_or(Ok(Contact::default()), |ball| pass.contact(path, ball));
            Ok((contact?, pass.derivatives(path)))
        }
    }

    /// The parametrisation at a fraction of the patch, in the direction of travel; still where the surface cannot be evaluated.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        let point = self.side(fraction);
        let (path, side) = (self.own(fraction), self.own_side(&point));
        let along = match self.kind {
            CurveKind::Profile | CurveKind::Circle => {
                let found = self.revolved(path, side, None);
                found.map(|(_, by)| by.speed(&point)).unwrap_or(PathSpeed::STILL)
            }
            _ => self.grid(path, side, &point).speed(&point),
        };
        self.turned(along)
    }

    /// The jump of the derivative of the logarithmic speed derivative where another curve goes on at a fraction of the patch, in the direction of travel: only the third
    /// derivative differs.
    pub(crate) fn jump(&self, fraction: u64, next: &SideCurve) -> f32 {
        let point = self.side(fraction);
        let (path, side) = (self.own(fraction), self.own_side(&point));
        let [tangent, beside] = match self.kind {
            CurveKind::Profile | CurveKind::Circle => {
                let by = self
                    .revolved(path, side, None)
                    .map(|(_, by)| by)
                    .unwrap_or_default();
                [by.path + by.side * point.slope, by.side]
            }
            _ => self.grid(path, side, &point).tangent(&point),
        };
        (next.third() - self.curve.third()) * (tangent.dot(beside) / tangent.dot(tangent))
    }

    /// In the direction of travel.
    #[inline(always)]
    fn turned(&self, speed: PathSpeed) -> PathSpeed {
        let turn = if self.reversed { -1.0 } else { 1.0 };
        PathSpeed {
            log_speed_derivative: turn * speed.log_speed_derivative,
            ..speed
        }
    }

    /// The patch at a point of the curve.
    #[inline(always)]
    pub(crate) fn on(&self, point: SidePoint) -> AnyCurve<'_> {
        let at = OnCurve { pass: self, point };
        match self.kind {
            CurveKind::Polynomial => AnyCurve::Polynomial(PolynomialCurve(at)),
            CurveKind::Rational => AnyCurve::Rational(RationalCurve(at)),
            CurveKind::Pole => AnyCurve::Pole(PoleCurve(at)),
            CurveKind::Profile | CurveKind::Circle => AnyCurve::Revolved(RevolvedCurve(at)),
        }
    }
}

/// A patch at a point of its curve, by its evaluation routine. The contact is that on the line of the side parameter, with the parametrisation along the curve.
pub(crate) enum AnyCurve<'a> {
    Polynomial(PolynomialCurve<'a>),
    Rational(RationalCurve<'a>),
    Pole(PoleCurve<'a>),
    Revolved(RevolvedCurve<'a>),
}

struct OnCurve<'a> {
    pass: &'a CurvePass,
    point: SidePoint,
}

impl OnCurve<'_> {
    /// The centred path parameter, and the side parameter.
    #[inline(always)]
    fn place(&self, fraction: u64) -> (i32, u64) {
        (centred(self.pass.own(fraction)), self.pass.own_side(&self.point))
    }

    #[inline(always)]
    fn contact(&self, point: &GridPoint, ball: &Ball) -> Result<Contact> {
        let contact = point.local.contact::<true, true>(ball, &point.factors)?;
        Ok(Contact {
            path: self.pass.turned(point.speed(&self.point)),
            ..contact
        })
    }
}

pub(crate) struct PolynomialCurve<'a>(OnCurve<'a>);

impl Pass for PolynomialCurve<'_> {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let (w, side) = self.0.place(fraction);
        self.0
            .contact(&self.0.pass.polynomial(w, side, &self.0.point), ball)
    }
}

pub(crate) struct RationalCurve<'a>(OnCurve<'a>);

impl Pass for RationalCurve<'_> {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let (w, side) = self.0.place(fraction);
        self.0
            .contact(&self.0.pass.rational(w, side, &self.0.point), ball)
    }
}

pub(crate) struct PoleCurve<'a>(OnCurve<'a>);

impl Pass for PoleCurve<'_> {
    #[inline(never)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let (w, side) = self.0.place(fraction);
        self.0.contact(&self.0.pass.pole(w, side, &self.0.point), ball)
    }
}

pub(crate) struct RevolvedCurve<'a>(OnCurve<'a>);

impl Pass for RevolvedCurve<'_> {
    #[inline(never)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let OnCurve { pass, point } = &self.0;
        let (contact, by) = pass.revolved(pass.own(fraction), pass.own_side(point), Some(ball))?;
        Ok(Contact {
            path: pass.turned(by.speed(point)),
            ..contact
        })
    }
}

impl CurvePass {
    /// See [`super::Surface::contact_and_direction`].
    #[inline(never)]
    pub(super) fn contact_and_direction(
        &self,
        fraction: u64,
        ball: &Ball,
    ) -> Result<(Contact, Option<Vec3>)> {
        let point = self.side(fraction);
        let (path, side) = (self.own(fraction), self.own_side(&point));
        let (contact, by, speed) = if matches!(self.kind, CurveKind::Profile | CurveKind::Circle) {
            let (contact, by) = self.revolved(path, side, Some(ball))?;
            (contact, by, by.speed(&point))
        } else {
            let at = self.grid(path, side, &point);
            let contact = at.local.contact::<true, true>(ball, &at.factors)?;
            (contact, at.local.bends(&at.factors), at.speed(&point))
        };
        let direction = by.centre_direction(point.slope, ball.in_patch_units(contact.offset));
        let turn = if self.reversed { -1.0 } else { 1.0 };
        let path = self.turned(speed);
        Ok((
            Contact { path, ..contact },
            direction.map(|direction| direction * turn),
        ))
    }
}

impl Pass for CurvePass {
    #[inline(never)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let point = self.side(fraction);
        if matches!(self.kind, CurveKind::Profile | CurveKind::Circle) {
            return RevolvedCurve(OnCurve { pass: self, point }).contact(fraction, ball);
        }
        let at = self.grid(self.own(fraction), self.own_side(&point), &point);
        OnCurve { pass: self, point }.contact(&at, ball)
    }
}

/// A point of a grid's patch, evaluated in rows across the path, then along it.
struct GridPoint {
    local: Local,
    /// Half of T' in units of g, without the terms of the weight's change.
    half_change: Vec3,
    factors: Factors,
    /// Relative change of the weight along the path and across it.
    log_weight: [f32; 2],
}

impl GridPoint {
    /// T and B in units of g.
    #[inline(always)]
    fn tangent(&self, point: &SidePoint) -> [Vec3; 2] {
        let Factors { path: a, side: b, .. } = self.factors;
        let beside = Vec3::of(self.local.side) * b;
        [Vec3::of(self.local.path) * a + beside * point.slope, beside]
    }

    fn derivatives(&self) -> Derivatives {
        self.local.derivatives(&self.factors, self.log_weight)
    }

    /// The parametrisation along the curve, from derivatives in units of g. Those of second order, of which only half is taken, lack the terms of the
    /// weight's change, which add up to its relative change along the curve times T.
    #[inline(always)]
    fn speed(&self, point: &SidePoint) -> PathSpeed {
        let [along, across] = self.log_weight;
        let SidePoint { slope, .. } = *point;
        let [tangent, _] = self.tangent(point);
        let inverse = inverse_sqrt(tangent.dot(tangent));
        let change = tangent.dot(self.half_change) * (inverse * inverse);
        PathSpeed {
            inv_speed: inverse * self.local.g,
            log_speed_derivative: 2.0 * (change - (along + across * slope)),
        }
    }
}

impl Derivatives {
    /// The parametrisation along a curve.
    fn speed(&self, point: &SidePoint) -> PathSpeed {
        let SidePoint { slope, half_bend, .. } = *point;
        let tangent = self.path + self.side * slope;
        let change = self.path2
            + self.mixed * (2.0 * slope)
            + self.side2 * (slope * slope)
            + self.side * (2.0 * half_bend);
        let inverse = inverse_sqrt(tangent.dot(tangent));
        PathSpeed {
            inv_speed: inverse,
            log_speed_derivative: tangent.dot(change) * (inverse * inverse),
        }
    }
}

const fn iso_line(side: u64) -> IsoLine {
    IsoLine {
        fraction: side,
        side: centred(side),
        reversed: false,
    }
}

impl SidePoint {
    /// A coordinate of a polynomial patch; see [`Self::in_order`].
    #[inline(always)]
    fn polynomial_axis(&self, block: &[i32; 16], side: i32, w: i32) -> (CoordinatePoint, f32) {
        self.in_order(point_by_rows(block, side, w), &Factors::ONE)
    }

    /// A coordinate of a rational patch; see [`Self::in_order`].
    #[inline(always)]
    fn rational_axis(&self, block: &[i32; 16], side: i32, w: i32, weight: &Weight) -> (CoordinatePoint, f32) {
        let (numerator, _) = computed(point_by_rows(block, side, w), 0.0);
        self.in_order(quotient(numerator, weight), &Factors::ONE)
    }

    /// A coordinate of a point, and of half of T' without the terms of the weight's change, both complete before the next is begun.
    #[inline(always)]
    fn in_order(&self, point: CoordinatePoint, factors: &Factors) -> (CoordinatePoint, f32) {
        let Factors { path: a, side: b, .. } = *factors;
        let [_, _, path2, side, mixed, side2] = point;
        let half_change = to_f32(path2) * a
            + to_f32(mixed) * self.slope
            + to_f32(side2) * (self.slope * self.slope * b)
            + to_f32(side) * b * self.half_bend;
        computed(point, half_change)
    }
}
