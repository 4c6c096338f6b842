//! Links from pass to pass, each from rest to rest in closed form ([`Curve`]): straight moves off the surface, or a step-over along the boundary on
//! the surface.

mod step_over;
mod straight;

use crate::fault::{Fault, FaultKind, Result};
use crate::feed::curve::{Curve, CurveCursor};
use crate::feed::pace::{Pace, Trajectory as _};
use crate::feed::profile::Profiles;
use crate::feed::to_q10;
use crate::math::arith::sqrt;
use crate::math::number::{MM_PER_NM, to_f32};
pub(crate) use step_over::{Along, BoundaryEnd, BoundaryStepOver};
pub(crate) use straight::{StraightMove, StraightPath};

/// Links up to this length, nm, are omitted: the rounding difference of one position computed twice.
const NOTHING_NM: i64 = 2;
/// Places of the centre above one contact that are farther apart, nm, differ by more than the rounding of their normals.
const ELSEWHERE_NM: i64 = 20;

/// Progress along a link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Progress {
    curve: Curve,
    cursor: CurveCursor,
    length_q10: i64,
    pace: Pace<CurveCursor>,
}

/// A length of which parts are taken: the shift that scales it to 31 bits, and the inverse of that, units of 2^-61. A division of 64 bits takes some hundred cycles.
#[derive(Clone, Copy, Debug)]
struct Whole {
    up: u32,
    down: u32,
    inverse: i64,
}

impl Whole {
    const NONE: Self = Self {
        up: 0,
        down: 0,
        inverse: 0,
    };

    fn new(whole: i64) -> Self {
        let zeros = whole.leading_zeros();
        let (up, down) = (zeros.saturating_sub(33).min(30), 33_u32.saturating_sub(zeros));
        Self {
            up,
            down,
            inverse: (1_i64 << 61).checked_div((whole << up) >> down).unwrap_or(0),
        }
    }

    /// A part below the whole as a fraction in units of 2^-30, with an error of at most 2^-29: 0.2 nm in 100 mm.
    fn part_q30(&self, part: i64) -> i64 {
        (((part << self.up) >> self.down) * self.inverse) >> 31
    }
}

impl Progress {
    const NONE: Self = Self {
        curve: Curve::NONE,
        cursor: CurveCursor::START,
        length_q10: 0,
        pace: Pace::REST,
    };

    fn lead(&mut self, length: f32, curve: Curve) {
        self.cursor = curve.start();
        self.curve = curve;
        self.length_q10 = to_q10(length);
        self.pace = Pace::REST;
    }

    /// Becomes one without length, which is over.
    fn end(&mut self) {
        self.curve.clear();
        self.cursor = self.curve.start();
        self.length_q10 = 0;
        self.pace = Pace::REST;
    }

    /// Begins at this pace.
    pub(crate) fn begin(&mut self, pace: f32, period: f32) {
        self.pace.begin(pace, period);
    }

    /// One period; returns whether the end is reached.
    pub(crate) fn tick(&mut self, pace: f32, is_fault: bool, period: f32, profiles: &mut Profiles) -> bool {
        self.pace.want(pace, is_fault);
        let pace = self.pace.tick(profiles);
        self.curve.advance(&mut self.cursor, pace * period);
        self.is_over()
    }

    pub(crate) fn is_over(&self) -> bool {
        self.curve.is_over(&self.cursor)
    }

    pub(crate) fn is_at_rest(&self) -> bool {
        self.pace.is_at_rest()
    }

    /// Where the next period ends, if nothing else is wanted until then.
    fn next(&self, pace: f32, period: f32) -> CurveCursor {
        let mut cursor = self.cursor;
        self.curve.advance(&mut cursor, pace * period);
        cursor
    }

    /// Whether a change of the pace is sought.
    pub(crate) fn has_work(&self) -> bool {
        self.pace.has_work()
    }

    /// One place of the search for a change of the pace.
    pub(crate) fn work(&mut self, profiles: &mut Profiles) {
        self.pace.work(&self.curve, &self.cursor, profiles);
    }

    /// Speed along the link, mm/s.
    pub(crate) fn speed(&self) -> f32 {
        self.pace.now() * self.curve.speed(&self.cursor)
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

/// Whether two places of the centre above one contact differ by more than rounding.
pub(crate) fn is_elsewhere(from: &[i32; 3], to: &[i32; 3]) -> bool {
    let mut pairs = from.iter().zip(to);
    pairs.any(|(from, to)| (i64::from(*to) - i64::from(*from)).abs() > ELSEWHERE_NM)
}

fn distance(from: &[i32; 3], to: &[i32; 3]) -> f32 {
    let mut sum = 0.0;
    for (from, to) in from.iter().zip(to) {
        let mm = to_mm(i64::from(*to) - i64::from(*from));
        sum += mm * mm;
    }
    sqrt(sum)
}

fn to_mm(nm: i64) -> f32 {
    to_f32(nm) * MM_PER_NM
}
