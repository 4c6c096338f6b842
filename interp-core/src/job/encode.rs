//! Encodes power-basis coefficients (f64, mm) as the records of a job. For load time: a host, or a board's
//! set-up code. The sample path does not use it.
//!
//! ```
//! use interp_core::{Header, Interpolator, Command, State, encode};
//!
//! // z = 20 - (x^2 + y^2)/100 on 80 mm x 60 mm, a shallow dome: c[axis][i][j] of u^i v^j, u and v from 0 to 1.
//! let mut c = [[[0.0; 4]; 4]; 3];
//! (c[0][0][0], c[0][1][0]) = (-40.0, 80.0);
//! (c[1][0][0], c[1][0][1]) = (-30.0, 60.0);
//! (c[2][0][0], c[2][1][0], c[2][2][0], c[2][0][1], c[2][0][2]) = (-5.0, 64.0, -64.0, 36.0, -36.0);
//! let patch = encode::polynomial(&c.map(|axis| encode::substitute(&axis, [0.0, 1.0], [0.0, 1.0])), Default::default())?;
//!
//! let header = Header {
//!     path_spans: 1,
//!     side_spans: 1,
//!     ball_radius_mm: 5.0,
//!     feed_mm_s: 20.0,
//!     scallop_mm: 0.01,
//!     period_s: 0.001,
//!     ..Header::default()
//! };
//! let one = encode::width(1.0)?;
//! let mut machine = Interpolator::<[i32; 64]>::new();
//! machine.load_begin(&header, 54)?;
//! machine.load_words(0, &[one, one])?; // one span each way, as wide as the parameter's range
//! machine.load_words(2, &patch.to_words())?;
//! machine.load_check(0)?;
//! machine.load_finish()?;
//!
//! let first = *machine.tick(Command::Start);
//! assert_eq!(first.cc_nm, [-40_000_000, -30_000_000, -5_000_000]);
//! let second = machine.tick(None);
//! assert_eq!(second.state, State::Running);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "ranges are checked before each cast"
)]

use crate::job::{WIDTH_MAX, WIDTH_MIN};
use crate::surface::{Edges, PolynomialRecord, RationalRecord, RevolvedRecord, SHIFT_MAX};
use core::fmt;
use libm::round;

/// A cubic in two parameters, `c[i][j]` of `path^i side^j`.
pub type Bicubic = [[f64; 4]; 4];

/// Why coefficients cannot be encoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EncodeError {
    /// A coefficient or range is not a finite number.
    NotFinite,
    /// Positions or derivatives of the patch exceed an i32 of nanometres: curved patches above about 0.5 m, flat ones above 2 m. Split the patch.
    TooLarge,
    /// The origin is outside ±2.147 m.
    TooFar,
    /// The weights vary more than 4 : 1 over the patch, are not positive, or their derivatives exceed the range of the record. Split the patch.
    Weights,
    /// The width of a span is outside [`WIDTH_MIN`] to [`WIDTH_MAX`].
    Width,
    /// A flagged boundary does not collapse into a point, or more boundaries are flagged than a patch may have.
    NotAPole,
    /// The extent of the angle is outside 0 (exclusive) to one turn.
    Extent,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a coefficient is not a finite number",
            Self::TooLarge => "a patch is larger than about 0.5 m",
            Self::TooFar => "a patch is further than 2.147 m from the origin",
            Self::Weights => {
                "the weights of a patch vary by more than 4 : 1, are not positive, or vary too fast"
            }
            Self::Width => "the width of a span is outside 1e-9 to 1e9",
            Self::NotAPole => "a boundary that should be a point is none",
            Self::Extent => "the angle's extent is not above 0 and at most a turn",
        })
    }
}

impl core::error::Error for EncodeError {}

/// Nanometres in a millimetre, exactly.
const NM_PER_MM: f64 = crate::math::number::NM_PER_MM as f64;

/// Substitutes parameters from -1/2 to 1/2 for `u[0]..u[1]`, `v[0]..v[1]`: the coefficients in the new parameters.
#[must_use]
pub fn substitute(c: &Bicubic, u: [f64; 2], v: [f64; 2]) -> Bicubic {
    let rows = c.map(|row| substitute_cubic(&row, v));
    transpose(&transpose(&rows).map(|column| substitute_cubic(&column, u)))
}

/// A cubic over `range` (lowest power first) as a cubic of a parameter from -1/2 to 1/2.
#[must_use]
pub fn substitute_cubic(c: &[f64; 4], [start, end]: [f64; 2]) -> [f64; 4] {
    let [c0, c1, c2, c3] = *c;
    let (m, d) = ((start + end) / 2.0, end - start);
    [
        c0 + m * (c1 + m * (c2 + m * c3)),
        d * (c1 + m * (2.0 * c2 + m * 3.0 * c3)),
        d * d * (c2 + 3.0 * m * c3),
        d * d * d * c3,
    ]
}

fn transpose(c: &Bicubic) -> Bicubic {
    let mut t = [[0.0; 4]; 4];
    for (j, row) in t.iter_mut().enumerate() {
        for (slot, source) in row.iter_mut().zip(c) {
            *slot = source.get(j).copied().unwrap_or(0.0);
        }
    }
    t
}

/// The word that encodes a span's width, in units of the surface's parameter.
///
/// # Errors
/// [`EncodeError::Width`] where the width as an f32 is outside [`WIDTH_MIN`] to [`WIDTH_MAX`].
pub fn width(width: f64) -> Result<i32, EncodeError> {
    let width = width as f32;
    if (WIDTH_MIN..=WIDTH_MAX).contains(&width) {
        Ok(width.to_bits().cast_signed())
    } else {
        Err(EncodeError::Width)
    }
}

fn quantise(value: f64, unit: f64) -> Option<i32> {
    let rounded = round(value / unit);
    (rounded.abs() < 2_147_483_647.0).then_some(rounded as i32)
}

fn origin(point: [f64; 3]) -> Result<[i32; 3], EncodeError> {
    let mut origin_nm = [0; 3];
    for (slot, mm) in origin_nm.iter_mut().zip(point) {
        *slot = quantise(mm, 1.0 / NM_PER_MM).ok_or(EncodeError::TooFar)?;
    }
    Ok(origin_nm)
}

fn check_finite<'a>(values: impl IntoIterator<Item = &'a f64>) -> Result<(), EncodeError> {
    if values.into_iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(EncodeError::NotFinite)
    }
}

fn quantise_patch<const N: usize>(c: &[Bicubic; N], units: [f64; N]) -> Option<[[[i32; 4]; 4]; N]> {
    let mut out = [[[0; 4]; 4]; N];
    for ((target, source), unit) in out.iter_mut().zip(c).zip(units) {
        for (slot, value) in target.iter_mut().flatten().zip(source.iter().flatten()) {
            *slot = quantise(*value, unit)?;
        }
    }
    Some(out)
}

fn unit_mm(shift: u8) -> f64 {
    1.0 / (NM_PER_MM * f64::from(1_u32 << shift))
}

/// The valid record with the finest unit, 2^-shift nm. `quantised` returns None where a coefficient overflows.
///
/// # Errors
/// [`EncodeError::NotAPole`] if a record would be valid without collapsed boundaries, else `otherwise`.
fn finest<R>(
    quantised: impl Fn(u8) -> Option<R>,
    is_valid: impl Fn(&R, Edges) -> bool,
    edges: Edges,
    otherwise: EncodeError,
) -> Result<R, EncodeError> {
    let mut failure = otherwise;
    for shift in (0..=SHIFT_MAX).rev() {
        let Some(record) = quantised(shift) else {
            continue;
        };
        if is_valid(&record, edges) {
            return Ok(record);
        }
        if is_valid(&record, Edges::default()) {
            failure = EncodeError::NotAPole;
        }
    }
    Err(failure)
}

/// A polynomial patch from coefficients in mm of parameters from -1/2 to 1/2, with the finest unit 2^-shift nm that does not overflow.
///
/// # Errors
/// See [`EncodeError`].
pub fn polynomial(c: &[Bicubic; 3], edges: Edges) -> Result<PolynomialRecord, EncodeError> {
    check_finite(c.iter().flatten().flatten())?;
    let origin_nm = origin(c.map(|[[c00, ..], ..]| c00))?;
    let mut local = *c;
    for ([[c00, ..], ..], nm) in local.iter_mut().zip(origin_nm) {
        *c00 -= f64::from(nm) / NM_PER_MM;
    }
    let quantised = |shift| {
        Some(PolynomialRecord {
            origin_nm,
            shift,
            edges,
            coefficients: quantise_patch(&local, [unit_mm(shift); 3])?,
        })
    };
    let is_valid = |record: &PolynomialRecord, edges| {
        PolynomialRecord::check(&PolynomialRecord { edges, ..*record }.to_words()).is_ok()
    };
    finest(quantised, is_valid, edges, EncodeError::TooLarge)
}

/// A rational patch from homogeneous coefficients (w x, w y, w z in mm, then w) of parameters from -1/2 to 1/2.
/// The weight is scaled so that the geometric mean of its extremes over a 9 x 9 grid of the patch is 1.
///
/// # Errors
/// See [`EncodeError`].
pub fn rational(c: &[Bicubic; 4], edges: Edges) -> Result<RationalRecord, EncodeError> {
    check_finite(c.iter().flatten().flatten())?;
    let [x, y, z, weight] = c;
    let (least, most) = extremes(weight);
    if !(least > 0.0 && most < 4.0 * least) {
        return Err(EncodeError::Weights);
    }
    let scale = 1.0 / libm::sqrt(least * most);
    let end = |start: bool, end: bool| {
        if start {
            -0.5
        } else if end {
            0.5
        } else {
            0.0
        }
    };
    let (u, v) = (
        end(edges.path_start, edges.path_end),
        end(edges.side_start, edges.side_end),
    );
    let w = evaluate(weight, u, v);
    let point = [x, y, z].map(|c| evaluate(c, u, v) / w);
    let origin_nm = origin(point)?;
    let mut local = *c;
    let [.., weight] = local.each_mut();
    for value in weight.iter_mut().flatten() {
        *value *= scale;
    }
    let weight = *weight;
    for ((axis, nm), mm) in local.iter_mut().zip(origin_nm).zip(point) {
        // A pole becomes the origin exactly, half a nanometre off at most: otherwise only a coarse unit makes the numerators vanish there, and the normal is off by that unit.
        let origin_mm = if edges.count() > 0 {
            mm
        } else {
            f64::from(nm) / NM_PER_MM
        };
        for (value, w) in axis.iter_mut().flatten().zip(weight.iter().flatten()) {
            *value = *value * scale - origin_mm * w;
        }
    }
    let quantised = |shift| {
        let unit = unit_mm(shift);
        let units = [unit, unit, unit, 1.0 / 1_073_741_824.0];
        Some(RationalRecord {
            origin_nm,
            shift,
            edges,
            coefficients: quantise_patch(&local, units)?,
        })
    };
    let is_valid = |record: &RationalRecord, edges| {
        RationalRecord::check(&RationalRecord { edges, ..*record }.to_words()).is_ok()
    };
    // The weights' Bernstein coefficients and derivatives may leave the range although their values do not.
    let of_weights = |record: &RationalRecord| {
        let mut record = *record;
        let [numerators @ .., _] = &mut record.coefficients;
        *numerators = [[[0; 4]; 4]; 3];
        is_valid(&record, Edges::default())
    };
    let otherwise = match quantised(0) {
        Some(record) if !of_weights(&record) => EncodeError::Weights,
        _ => EncodeError::TooLarge,
    };
    finest(quantised, is_valid, edges, otherwise)
}

fn evaluate(c: &Bicubic, u: f64, v: f64) -> f64 {
    let cubic = |[c0, c1, c2, c3]: [f64; 4], t: f64| c0 + t * (c1 + t * (c2 + t * c3));
    cubic(c.map(|row| cubic(row, v)), u)
}

/// Minimum and maximum over a 9 x 9 grid of the patch.
fn extremes(c: &Bicubic) -> (f64, f64) {
    let at = |i: i32| f64::from(i) / 8.0 - 0.5;
    let values = (0..9)
        .flat_map(|i| (0..9).map(move |j| (i, j)))
        .map(|(i, j)| evaluate(c, at(i), at(j)));
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
        (least.min(value), most.max(value))
    })
}

/// A revolved surface from profile coefficients in mm (lowest power first) of a parameter from -1/2 to 1/2, and the range
/// of its angle in rad.
///
/// # Errors
/// See [`EncodeError`].
pub fn revolved(
    radius: &[f64; 4],
    height: &[f64; 4],
    [start, end]: [f64; 2],
) -> Result<RevolvedRecord, EncodeError> {
    check_finite(radius.iter().chain(height).chain(&[start, end]))?;
    let turns = |rad: f64| rad / core::f64::consts::TAU;
    let extent = round(turns(end - start) * 2_147_483_648.0);
    if !(1.0..=2_147_483_648.0).contains(&extent) {
        return Err(EncodeError::Extent);
    }
    let start = turns(start);
    let start = round((start - libm::floor(start)) * 4_294_967_296.0);
    let [h0, ..] = *height;
    let height_origin_nm = quantise(h0, 1.0 / NM_PER_MM).ok_or(EncodeError::TooFar)?;
    let mut local = *height;
    let [h0, ..] = &mut local;
    *h0 -= f64::from(height_origin_nm) / NM_PER_MM;
    for shift in (0..=SHIFT_MAX).rev() {
        let row = |c: &[f64; 4]| -> Option<[i32; 4]> {
            let mut out = [0; 4];
            for (slot, value) in out.iter_mut().zip(c) {
                *slot = quantise(*value, unit_mm(shift))?;
            }
            Some(out)
        };
        let (Some(radius), Some(height)) = (row(radius), row(&local)) else {
            continue;
        };
        let record = RevolvedRecord {
            shift,
            radius,
            height,
            height_origin_nm,
            start: start as u64 as u32,
            extent: extent as u32,
        };
        if RevolvedRecord::check(&record.to_words()).is_ok() {
            return Ok(record);
        }
    }
    Err(EncodeError::TooLarge)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat square of this size, mm, with these weights along the path at -1/2 and 1/2.
    fn flat(size: f64, [from, to]: [f64; 2]) -> [Bicubic; 4] {
        let mut patch = [[[0.0; 4]; 4]; 4];
        let (mean, slope) = (0.5 * (from + to), to - from);
        // Numerators: the coordinate times the weight.
        patch[3][0][0] = mean;
        patch[3][1][0] = slope;
        patch[0][1][0] = size * mean;
        patch[0][2][0] = size * slope;
        patch[1][0][1] = size * mean;
        patch[1][1][1] = size * slope;
        patch
    }

    #[test]
    fn a_refused_patch_names_its_cause() {
        let edges = Edges::default();
        assert!(rational(&flat(10.0, [1.0, 1.0]), edges).is_ok());
        assert!(rational(&flat(10.0, [1.0, 3.0]), edges).is_ok());
        for (size, weights, error) in [
            (10_000.0, [1.0, 1.0], EncodeError::TooLarge),
            (10_000.0, [1.0, 1.2], EncodeError::TooLarge),
            (10.0, [1.0, 6.0], EncodeError::Weights),
        ] {
            assert_eq!(
                rational(&flat(size, weights), edges),
                Err(error),
                "{size} {weights:?}"
            );
        }
        assert_eq!(width(1e-20), Err(EncodeError::Width));
        assert!(width(1e-9).is_ok() && width(1e9).is_ok());
    }
}
