//! A patch along a curve `side = g(path)`: the side parameter is a cubic of the path parameter on a part of the patch.

use super::lines::CoordinateCubics;
use super::pole::PoleAt;
use super::rational::{Weight, axis as rational_axis};
use super::revolved::{CirclePass, ProfilePass};
use super::{
    Ball, Contact, Derivatives, Edges, Factors, IsoLine, Local, Pass, PathSpeed, RATIONAL_WORDS,
    REVOLVED_WORDS, split_patch,
};
use crate::fault::Result;
use crate::math::arith::{centred, cubic, inverse_sqrt, jet, power_of_two, tangent, to_f32};

/// 2^-31, the unit of a place on the part.
const WITHIN: f32 = power_of_two(-31);
/// Bits of a side parameter below those of the curve's coefficients.
const FINE_BITS: u32 = 12;

/// The side parameter, a fraction of its span, as a function of the path parameter on one of 2^bits even parts of the path span.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SideCurve {
    /// At the start of the part, from the start of the side span, units of 2^-12 of the coefficients' unit.
    start: i64,
    /// Coefficients by the place on the part, units of 2^-shift.
    coefficients: [i32; 3],
    shift: u8,
    bits: u8,
    /// Width of the side span in units of the coefficients, and to fractions of 2^-32: dropped bits, shift, factor.
    width: i32,
    dropped: u8,
    down: u8,
    factor: u32,
    /// Derivative of the fraction by that of the path, and the second one.
    slope_unit: f32,
    bend_unit: f32,
}

/// A point of the curve: the side parameter as a fraction of its span, and its derivatives by the path's fraction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SidePoint {
    pub(crate) fraction: u64,
    slope: f32,
    bend: f32,
}

impl SideCurve {
    const NONE: Self = Self {
        start: 0,
        coefficients: [0; 3],
        shift: 0,
        bits: 0,
        width: 1,
        dropped: 0,
        down: 0,
        factor: 0,
        slope_unit: 0.0,
        bend_unit: 0.0,
    };

    /// From the value at the start, units of 2^-12; coefficients, units of 2^-shift, shift at most 12; the span's width, units.
    pub(crate) fn new(start: i64, coefficients: [i32; 3], shift: u8, bits: u8, width: i32) -> Self {
        let width = width.max(1);
        let fine = i64::from(width) << FINE_BITS;
        // At most 12 bits.
        let dropped = 32_u32.saturating_sub(fine.leading_zeros());
        let divisor = (fine >> dropped).cast_unsigned();
        let down = 63 - divisor.leading_zeros();
        // Between 2^31 and 2^32.
        let factor = (1_u64 << (32 + down)).checked_div(divisor).unwrap_or(0);
        let byte = |value: u32| u8::try_from(value).unwrap_or(0);
        let unit = power_of_two(i32::from(bits) - i32::from(shift)) / to_f32(width);
        Self {
            start,
            coefficients,
            shift: shift.min(byte(FINE_BITS)),
            bits,
            width,
            dropped: byte(dropped),
            down: byte(down),
            factor: u32::try_from(factor).unwrap_or(u32::MAX),
            slope_unit: unit,
            bend_unit: unit * power_of_two(i32::from(bits)),
        }
    }

    /// The point at a fraction of the path span.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "31 bits")]
    fn point(&self, path: u64) -> SidePoint {
        let at = ((path << self.bits) >> 33) as i32;
        let [first, second, third] = self.coefficients;
        let sum = second.wrapping_add(mul_31(third, at));
        let sum = first.wrapping_add(mul_31(sum, at));
        let rise = i64::from(sum).wrapping_mul(i64::from(at)) >> (31 + u32::from(self.shift) - FINE_BITS);
        let width = i64::from(self.width) << FINE_BITS;
        let within = self.start.wrapping_add(rise).max(0).min(width);
        let high = (within >> self.dropped)
            .cast_unsigned()
            .wrapping_mul(u64::from(self.factor));
        let fraction = (high >> self.down).min(0xffff_ffff);
        let t = to_f32(at) * WITHIN;
        let [first, second, third] = self.coefficients.map(to_f32);
        SidePoint {
            fraction: fraction << 32,
            slope: (first + t * (2.0 * second + 3.0 * third * t)) * self.slope_unit,
            bend: (2.0 * second + 6.0 * third * t) * self.bend_unit,
        }
    }
}

/// `value at / 2^31`.
#[allow(clippy::cast_possible_truncation, reason = "at is below 2^31")]
const fn mul_31(value: i32, at: i32) -> i32 {
    ((value as i64 * at as i64) >> 31) as i32
}

/// The kind of a patch's record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RecordKind {
    Polynomial,
    Rational,
    /// Revolved, the path along the profile or around the axis.
    Profile,
    Circle,
}

/// A patch along a curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurvePass {
    curve: SideCurve,
    kind: RecordKind,
    /// The record's words.
    words: [i32; RATIONAL_WORDS],
    /// Ball radius in units, signed by the tool side, for a revolved surface.
    radius: f32,
    reversed: bool,
    /// Start and end in the direction of travel, whether they are on a boundary, and whether that is the end of the side span.
    range: [u64; 2],
    are_on_boundary: [bool; 2],
    is_far: bool,
}

impl CurvePass {
    /// Placeholder before the first patch.
    pub(crate) const NONE: Self = Self {
        curve: SideCurve::NONE,
        kind: RecordKind::Polynomial,
        words: [0; RATIONAL_WORDS],
        radius: 0.0,
        reversed: false,
        range: [0, u64::MAX],
        are_on_boundary: [false; 2],
        is_far: false,
    };

    /// Becomes the patch with this record. `radius`: the ball's in units, signed by the tool side.
    pub(crate) fn take(&mut self, kind: RecordKind, words: &[i32], radius: f32) {
        (self.kind, self.radius) = (kind, radius);
        for (slot, word) in self.words.iter_mut().zip(words) {
            *slot = *word;
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
    }

    const fn own(&self, fraction: u64) -> u64 {
        if self.reversed { !fraction } else { fraction }
    }

    /// The side parameter at a fraction of the path span, in the direction of travel.
    pub(crate) fn side(&self, fraction: u64) -> SidePoint {
        let mut point = self.curve.point(self.own(fraction));
        for (at, is_on) in self.range.iter().zip(self.are_on_boundary) {
            if is_on && fraction == *at {
                point.fraction = if self.is_far { u64::MAX } else { 0 };
            }
        }
        point
    }

    /// Contact and derivatives on the line of the side parameter, at any place of the patch.
    ///
    /// # Errors
    /// As [`Pass::contact`].
    #[inline(always)]
    pub(crate) fn at(&self, path: u64, side: u64, ball: &Ball) -> Result<(Contact, Derivatives)> {
        match self.kind {
            RecordKind::Polynomial | RecordKind::Rational => self.grid(path, side, ball),
            RecordKind::Profile | RecordKind::Circle => self.revolved(path, side, Some(ball)),
        }
    }

    /// The derivatives of [`Self::at`]; zero where the surface cannot be evaluated.
    #[inline(never)]
    fn derivatives_at(&self, path: u64, side: u64) -> Derivatives {
        match self.kind {
            RecordKind::Polynomial | RecordKind::Rational => {
                let (edges, blocks) = self.record();
                grid_at(blocks, edges, path, side).derivatives()
            }
            RecordKind::Profile | RecordKind::Circle => {
                let found = self.revolved(path, side, None);
                found.map(|(_, by)| by).unwrap_or_default()
            }
        }
    }

    /// The record's collapsed boundaries and blocks.
    fn record(&self) -> (Edges, &[[i32; 16]]) {
        let (_, _, edges, blocks) = split_patch(&self.words);
        let axes = if self.kind == RecordKind::Rational { 4 } else { 3 };
        (edges, blocks.get(..axes).unwrap_or(blocks))
    }

    #[inline(never)]
    fn grid(&self, path: u64, side: u64, ball: &Ball) -> Result<(Contact, Derivatives)> {
        let (edges, blocks) = self.record();
        let point = grid_at(blocks, edges, path, side);
        let contact = point.local.contact::<true, true>(ball, &point.factors)?;
        Ok((contact, point.derivatives()))
    }

    #[inline(never)]
    fn revolved(&self, path: u64, side: u64, ball: Option<&Ball>) -> Result<(Contact, Derivatives)> {
        let line = IsoLine {
            fraction: side,
            side: centred(side),
            reversed: false,
        };
        let Some(words) = self.words.first_chunk::<REVOLVED_WORDS>() else {
            return Ok(Default::default());
        };
        if self.kind == RecordKind::Profile {
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

    /// The parametrisation along the curve.
    fn speed(&self, side: &SidePoint, by: &Derivatives) -> PathSpeed {
        let SidePoint { slope, bend, .. } = *side;
        let tangent = by.path + by.side * slope;
        let change = by.path2 + by.mixed * (2.0 * slope) + by.side2 * (slope * slope) + by.side * bend;
        let squared = tangent.dot(tangent);
        let turn = if self.reversed { -1.0 } else { 1.0 };
        let inverse = inverse_sqrt(squared);
        PathSpeed {
            inv_speed: inverse,
            log_speed_derivative: turn * tangent.dot(change) * (inverse * inverse),
        }
    }

    /// The parametrisation at a fraction of the patch, in the direction of travel; still where the surface cannot be evaluated.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        let side = self.side(fraction);
        self.speed(&side, &self.derivatives_at(self.own(fraction), side.fraction))
    }
}

impl Pass for CurvePass {
    /// The contact on the line of the side parameter, with the parametrisation along the curve.
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let side = self.side(fraction);
        let (contact, by) = self.at(self.own(fraction), side.fraction, ball)?;
        Ok(Contact {
            path: self.speed(&side, &by),
            ..contact
        })
    }
}

/// A point of a grid's patch, evaluated in rows across the path, then along it.
struct GridPoint {
    local: Local,
    factors: Factors,
    /// Relative change of the weight along the path and across it.
    log_weight: [f32; 2],
}

impl GridPoint {
    #[inline(always)]
    fn derivatives(&self) -> Derivatives {
        self.local.derivatives(&self.factors, self.log_weight)
    }
}

#[inline(never)]
fn grid_at(blocks: &[[i32; 16]], edges: Edges, path: u64, side: u64) -> GridPoint {
    match blocks {
        [x, y, z] if edges.count() == 0 => {
            let w = centred(path);
            let line = iso_line(side);
            let axis = |block: &[i32; 16]| polynomial_axis(block, &line, w);
            let ([x0, x1, x2, xs, xm, xx], [y0, y1, y2, ys, ym, yy], [z0, z1, z2, zs, zm, zz]) =
                (axis(x), axis(y), axis(z));
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
                factors: Factors::ONE,
                log_weight: [0.0; 2],
            }
        }
        _ => weighted_at(blocks, edges, path, side),
    }
}

/// The same of a rational patch, or of one with a pole.
#[inline(never)]
fn weighted_at(blocks: &[[i32; 16]], edges: Edges, path: u64, side: u64) -> GridPoint {
    const NONE: [i32; 16] = [0; 16];
    let w = centred(path);
    let line = iso_line(side);
    let (axes, weight) = match blocks {
        [x, y, z, weight] => ([x, y, z], CoordinateCubics::at(weight, &line)),
        [x, y, z] => ([x, y, z], CoordinateCubics::ONE),
        _ => ([&NONE; 3], CoordinateCubics::ONE),
    };
    let weight = Weight::at(&weight, w);
    let pole = PoleAt::new(edges, &line);
    let [x, y, z] = axes.map(|block| {
        let cubics = CoordinateCubics::at(block, &line);
        match &pole {
            Some(pole) => pole.axis(&cubics, block, &line, &weight, w),
            None => rational_axis(&cubics, &weight, w),
        }
    });
    GridPoint {
        local: weight.local(x, y, z),
        factors: pole.map_or(Factors::ONE, |pole| pole.factors(w)),
        log_weight: weight.log_derivatives(),
    }
}

const fn iso_line(side: u64) -> IsoLine {
    IsoLine {
        fraction: side,
        side: centred(side),
        reversed: false,
    }
}

/// One coordinate of a [`Local`]: position, path, path2, side, mixed, side2.
#[inline(always)]
fn polynomial_axis(block: &[i32; 16], line: &IsoLine, w: i32) -> [i32; 6] {
    let cubics = CoordinateCubics::at(block, line);
    let [value, path, path2] = jet(&cubics.value, w);
    let [side, mixed] = tangent(&cubics.side, w);
    [value, path, path2, side, mixed, cubic(&cubics.side2, w)]
}
