//! A patch along a curve `side = g(path)`: the side parameter is a cubic of the path parameter on a part of the patch.

use super::grid::GridPass;
use super::revolved::{CirclePass, ProfilePass};
use super::{
    Ball, Contact, Derivatives, IsoLine, Pass, PathSpeed, RATIONAL_WORDS, REVOLVED_WORDS, split_patch,
};
use crate::fault::Result;
use crate::math::arith::{centred, power_of_two, sqrt, to_f32};

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

    /// Becomes the patch with this record along this curve. `radius`: the ball's in units, signed by the tool side.
    pub(crate) fn lay(&mut self, kind: RecordKind, words: &[i32], curve: SideCurve, radius: f32) {
        (self.kind, self.curve, self.radius) = (kind, curve, radius);
        for (slot, word) in self.words.iter_mut().zip(words) {
            *slot = *word;
        }
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

    /// The surface at a place: contact and derivatives on the line of the side parameter.
    #[inline(never)]
    fn at(&self, path: u64, side: u64, ball: Option<&Ball>) -> Result<(Contact, Derivatives)> {
        let line = IsoLine {
            fraction: side,
            side: centred(side),
            reversed: false,
        };
        let revolved = || self.words.first_chunk::<REVOLVED_WORDS>();
        match self.kind {
            RecordKind::Polynomial | RecordKind::Rational => {
                let (_, _, edges, blocks) = split_patch(&self.words);
                let axes = if self.kind == RecordKind::Rational { 4 } else { 3 };
                let blocks = blocks.get(..axes).unwrap_or(blocks);
                let mut pass = GridPass::NONE;
                pass.collapse(blocks, edges, &line);
                let contact = match ball {
                    Some(ball) => pass.contact(path, ball)?,
                    None => Contact::default(),
                };
                Ok((contact, pass.derivatives(path)))
            }
            RecordKind::Profile => {
                let mut pass = ProfilePass::default();
                if let Some(words) = revolved() {
                    pass.collapse(words, &line, self.radius);
                }
                let contact = match ball {
                    Some(ball) => pass.contact(path, ball)?,
                    None => Contact::default(),
                };
                Ok((contact, pass.derivatives(path)))
            }
            RecordKind::Circle => {
                let mut pass = CirclePass::default();
                if let Some(words) = revolved() {
                    pass.collapse(words, &line, self.radius)?;
                }
                let contact = match ball {
                    Some(ball) => pass.contact(path, ball)?,
                    None => Contact::default(),
                };
                Ok((contact, pass.derivatives(path)))
            }
        }
    }

    /// The parametrisation along the curve.
    fn speed(&self, side: &SidePoint, by: &Derivatives) -> PathSpeed {
        let SidePoint { slope, bend, .. } = *side;
        let tangent = by.path + by.side * slope;
        let change = by.path2 + by.mixed * (2.0 * slope) + by.side2 * (slope * slope) + by.side * bend;
        let squared = tangent.dot(tangent);
        let turn = if self.reversed { -1.0 } else { 1.0 };
        PathSpeed {
            inv_speed: 1.0 / sqrt(squared),
            log_speed_derivative: turn * tangent.dot(change) / squared,
        }
    }

    /// The parametrisation at a fraction of the patch, in the direction of travel; still where the surface cannot be evaluated.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        let side = self.side(fraction);
        match self.at(self.own(fraction), side.fraction, None) {
            Ok((_, by)) => self.speed(&side, &by),
            Err(_) => PathSpeed::STILL,
        }
    }

    /// First and second derivatives by path and side parameter.
    pub(crate) fn derivatives(&self, fraction: u64) -> Derivatives {
        let side = self.side(fraction);
        let found = self.at(self.own(fraction), side.fraction, None);
        found.map(|(_, by)| by).unwrap_or_default()
    }
}

impl Pass for CurvePass {
    /// The contact on the line of the side parameter, with the parametrisation along the curve.
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let side = self.side(fraction);
        let (contact, by) = self.at(self.own(fraction), side.fraction, Some(ball))?;
        Ok(Contact {
            path: self.speed(&side, &by),
            ..contact
        })
    }
}
