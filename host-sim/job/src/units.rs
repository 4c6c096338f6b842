//! Millimetres, the unit of a job, and nanometres, the unit of the machine's positions; minutes of a feed.

/// Nanometres in a millimetre.
pub const NM_PER_MM: f64 = 1e6;
/// Millimetres in a nanometre.
pub const MM_PER_NM: f64 = 1e-6;
/// Seconds in a minute.
pub const S_PER_MIN: f64 = 60.0;
/// Range of the machine's positions in words, for errors: 32 bits of nanometres.
pub const POSITION_RANGE: &str = "the machine's range is ±2147.483 mm";

/// The nearest nanometre; `None` for a length outside the machine's range, or not a number.
#[must_use]
pub fn nanometres(mm: f64) -> Option<i32> {
    let nm = (mm * NM_PER_MM).round();
    #[expect(clippy::cast_possible_truncation, reason = "a whole number within the range")]
    (f64::from(i32::MIN)..=f64::from(i32::MAX))
        .contains(&nm)
        .then_some(nm as i32)
}

/// The least whole nanometres that are not below a height, mm; at most `i32::MAX`.
#[must_use]
#[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
pub fn nanometres_up(mm: f64) -> i32 {
    (mm * NM_PER_MM).ceil() as i32
}

/// The nearest nanometres of a position; `None` where an axis is outside the machine's range.
#[must_use]
pub fn position_nm(mm: [f64; 3]) -> Option<[i32; 3]> {
    let [x, y, z] = mm.map(nanometres);
    Some([x?, y?, z?])
}

/// A length in mm: the f64 nearest to the decimal number.
#[must_use]
pub fn millimetres(nm: i32) -> f64 {
    f64::from(nm) / NM_PER_MM
}

/// A position in mm.
#[must_use]
pub fn position_mm(nm: [i32; 3]) -> [f64; 3] {
    nm.map(millimetres)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_outside_the_range_are_none() {
        for (mm, nm) in [
            (0.123_456_7, Some(123_457)),
            (2_147.483_647, Some(i32::MAX)),
            (-2_147.483_648, Some(i32::MIN)),
            (2_147.483_648, None),
            (-2_147.483_649, None),
            (3000.0, None),
            (f64::NAN, None),
            (f64::INFINITY, None),
        ] {
            assert_eq!(nanometres(mm), nm, "{mm}");
        }
        assert_eq!(
            position_nm([1.0, -2.0, 0.5]),
            Some([1_000_000, -2_000_000, 500_000])
        );
        assert_eq!(position_nm([1.0, 3000.0, 0.5]), None);
        assert_eq!(position_mm([200_000_001, -1, 0]), [200.000_001, -0.000_001, 0.0]);
    }
}
