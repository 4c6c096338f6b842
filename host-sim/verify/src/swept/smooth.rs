//! The curve between two samples.
//!
//! The samples are positions of the ball's centre one period apart. The swept ball follows straight lines between the stored points, so
//! where the centre's path is bent, points are added between the samples: on the cubic through the four samples around them.
//!
//! ```text
//!         k      k + 1              deviation: from the chord's middle to the cubic there
//!     k - 1 ------- k + 2           uncertainty: of the cubic, by the fourth difference of the samples
//! ```

use std::borrow::Cow;

use super::track::{ToolPath, ToolPathPass, across};
use glam::DVec3;
use rayon::prelude::*;

/// Largest number of parts of a chord.
const PARTS_MAX: usize = 64;
/// A neighbouring chord longer or shorter than this factor says nothing about the bend here.
const CHORD_RATIO_MAX: f64 = 2.5;
/// Error of a cubic half-way between two of four equidistant samples: 3/128 of the fourth difference; doubled.
const FOURTH: f64 = 6.0 / 128.0;
/// Samples whose chords differ by at most this share are equidistant.
const EQUIDISTANT: f64 = 0.02;
/// Uncertainty of a parabola at the end of a path, as a share of its deviation from the chord.
const PARABOLA: f64 = 0.25;
/// Positions are rounded to nanometres, which gives deviations of this size, mm.
const ROUNDING_MM: f64 = 2e-6;

/// The curve over one chord.
struct Bend {
    /// Samples of the curve, and their parameters by chord length, 0 at the chord's start.
    points: Vec<(f64, DVec3)>,
    /// The chord's length, mm.
    length: f64,
    /// Distance of the curve's middle from the chord's, mm.
    deviation_mm: f64,
    /// Bound of the curve's own error, mm.
    uncertainty_mm: f64,
}

impl Bend {
    /// The curve at a share of the chord (Lagrange's form).
    fn at(&self, share: f64) -> DVec3 {
        let t = share * self.length;
        let mut sum = DVec3::ZERO;
        for (i, (own, point)) in self.points.iter().enumerate() {
            let others = self.points.iter().enumerate().filter(|(j, _)| *j != i);
            let weight: f64 = others
                .map(|(_, (other, _))| (t - other) / (own - other))
                .product();
            sum += *point * weight;
        }
        sum
    }

    /// The middle of the curve without one of its points.
    fn without(&self, index: usize) -> DVec3 {
        let mut points = self.points.clone();
        points.remove(index);
        let parabola = Self { points, ..*self };
        parabola.at(0.5)
    }

    /// The curve from sample `k` to the next; `None` where the two coincide.
    fn new(pass: &ToolPathPass, k: usize) -> Option<Self> {
        let last = pass.cl_nm.len() - 1;
        let chord = |k: usize| pass.centre(k + 1).distance(pass.centre(k));
        let length = chord(k);
        if length <= 0.0 {
            return None;
        }
        let near = |other: f64| other <= CHORD_RATIO_MAX * length && length <= CHORD_RATIO_MAX * other;
        let mut points = vec![(0.0, pass.centre(k)), (length, pass.centre(k + 1))];
        let before = (k >= 1).then(|| chord(k - 1)).filter(|before| near(*before));
        if let Some(before) = before {
            points.push((-before, pass.centre(k - 1)));
        }
        let after = (k + 2 <= last).then(|| chord(k + 1)).filter(|after| near(*after));
        if let Some(after) = after {
            points.push((length + after, pass.centre(k + 2)));
        }
        let mut bend = Self {
            points,
            length,
            deviation_mm: 0.0,
            uncertainty_mm: 0.0,
        };
        let middle = 0.5 * (pass.centre(k) + pass.centre(k + 1));
        bend.deviation_mm = bend.at(0.5).distance(middle);
        bend.uncertainty_mm = match (before, after) {
            (Some(_), Some(_)) => {
                let fourths = [k, k + 1].map(|centre| fourth_difference(pass, centre));
                // Along the chord a difference changes the spacing of the samples, not the curve.
                let direction = (pass.centre(k + 1) - pass.centre(k)) / length;
                let off = |difference: DVec3| across(difference, direction).length();
                let most = fourths.into_iter().flatten().map(off).fold(0.0, f64::max);
                // The mean of both parabolas is near the cubic, so this is a bound of its error, if a wide one.
                let parabolas = || 0.5 * off(bend.without(3) - bend.without(2));
                if fourths.iter().any(Option::is_some) {
                    FOURTH * most
                } else {
                    parabolas()
                }
            }
            // The bend of a chord alone is that of its left-out samples: a standing or reversing tool has none.
            (None, None) => 0.0,
            _ => PARABOLA * bend.deviation_mm,
        };
        // What the left-out samples bend more than the curve.
        let missing_mm = pass.left_out_mm(k) - bend.deviation_mm - ROUNDING_MM;
        bend.uncertainty_mm = bend.uncertainty_mm.max(missing_mm);
        Some(bend)
    }

    /// Number of parts in which chords deviate by at most `tolerance_mm`.
    fn parts(&self, tolerance_mm: f64) -> usize {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive and clamped"
        )]
        let parts = (self.deviation_mm / tolerance_mm).sqrt().ceil() as usize;
        parts.clamp(1, PARTS_MAX)
    }
}

/// Fourth difference of the samples around one, mm; `None` where they are not equidistant.
fn fourth_difference(pass: &ToolPathPass, centre: usize) -> Option<DVec3> {
    let first = centre.checked_sub(2)?;
    if centre + 2 >= pass.cl_nm.len() {
        return None;
    }
    let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|by| pass.centre(first + by));
    let chords = [a.distance(b), b.distance(c), c.distance(d), d.distance(e)];
    let (least, most) = chords
        .iter()
        .fold((f64::INFINITY, 0.0_f64), |(least, most), chord| {
            (least.min(*chord), most.max(*chord))
        });
    (most <= (1.0 + EQUIDISTANT) * least).then(|| a - 4.0 * b + 6.0 * c - 4.0 * d + e)
}

/// A path fine enough for the measurement.
pub(super) struct SmoothPath<'a> {
    /// The path, with points added where they are needed.
    pub(super) path: Cow<'a, ToolPath>,
    /// Largest distance of the path's chords from the centre's curve, for each pass, mm.
    pub(super) deviation_mm: Vec<f64>,
}

impl<'a> SmoothPath<'a> {
    /// The path with points added where its chords deviate by more than `tolerance_mm` from the curve.
    pub(super) fn new(track: &'a ToolPath, tolerance_mm: f64) -> Self {
        let tolerance_mm = tolerance_mm.max(ROUNDING_MM);
        let passes: Vec<(Option<ToolPathPass>, f64)> = track
            .passes
            .par_iter()
            .map(|pass| refined(pass, tolerance_mm))
            .collect();
        let deviation_mm = passes.iter().map(|(_, deviation_mm)| *deviation_mm).collect();
        if passes.iter().all(|(finer, _)| finer.is_none()) {
            return Self {
                path: Cow::Borrowed(track),
                deviation_mm,
            };
        }
        let mut path = track.clone();
        for (own, (finer, _)) in path.passes.iter_mut().zip(passes) {
            if let Some(finer) = finer {
                *own = finer;
            }
        }
        Self {
            path: Cow::Owned(path),
            deviation_mm,
        }
    }

    /// Largest deviation of all passes, mm.
    pub(super) fn deviation_max_mm(&self) -> f64 {
        self.deviation_mm.iter().copied().fold(0.0, f64::max)
    }
}

/// A pass with points added, `None` if none is needed; and the largest deviation that is left, mm.
fn refined(pass: &ToolPathPass, tolerance_mm: f64) -> (Option<ToolPathPass>, f64) {
    let mut left_mm = 0.0_f64;
    let mut finer: Option<ToolPathPass> = None;
    for k in 0..pass.cl_nm.len().saturating_sub(1) {
        let bend = Bend::new(pass, k);
        let parts = bend.as_ref().map_or(1, |bend| bend.parts(tolerance_mm));
        if let Some(bend) = &bend {
            #[allow(clippy::cast_precision_loss, reason = "small")]
            let squared = (parts * parts) as f64;
            left_mm = left_mm.max(bend.deviation_mm / squared + bend.uncertainty_mm);
        }
        if parts > 1 && finer.is_none() {
            finer = Some(ToolPathPass {
                periods: pass.periods[..k].to_vec(),
                path: pass.path[..k].to_vec(),
                cl_nm: pass.cl_nm[..k].to_vec(),
                left_out_nm: Vec::new(),
                sides: pass.sides.iter().take(k).copied().collect(),
                side: pass.side,
                first_tick: pass.first_tick,
            });
        }
        if let Some(finer) = &mut finer {
            finer.copy(pass, k);
            for part in 1..parts {
                #[allow(clippy::cast_precision_loss, reason = "small")]
                let share = part as f64 / parts as f64;
                if let Some(bend) = &bend {
                    finer.add_between(pass, k, share, bend.at(share));
                }
            }
        }
    }
    if let (Some(finer), Some(last)) = (&mut finer, pass.cl_nm.len().checked_sub(1)) {
        finer.copy(pass, last);
    }
    (finer, left_mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 0.09;

    /// A circle with this angle between samples.
    fn circle(step: f64) -> ToolPath {
        let mut pass = ToolPathPass::default();
        for k in 0..40_u32 {
            let (sin, cos) = (f64::from(k) * step).sin_cos();
            pass.periods.push(k);
            pass.path.push(f64::from(k));
            pass.cl_nm
                .push([RADIUS * cos, RADIUS * sin, 1.0].map(|mm| (mm * 1e6).round() as i32));
        }
        let mut track = ToolPath::default();
        track.passes.push(pass);
        track
    }

    /// Distance of the middles of a path's chords from the circle: what the polyline leaves out.
    fn off_circle(path: &ToolPath) -> f64 {
        let pass = &path.passes[0];
        (2..pass.cl_nm.len() - 2)
            .map(|k| 0.5 * (pass.centre(k) + pass.centre(k + 1)))
            .map(|middle| (middle.truncate().length() - RADIUS).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn points_are_added_until_chords_follow_a_circle() {
        for step in [0.05, 0.2, 0.5] {
            let track = circle(step);
            let sagitta = RADIUS * (1.0 - (0.5 * step).cos());
            let coarse = SmoothPath::new(&track, 1.0);
            assert!(matches!(coarse.path, Cow::Borrowed(_)));
            let stated = coarse.deviation_max_mm();
            assert!(
                stated >= 0.99 * sagitta && stated < 1.6 * sagitta + 2e-6,
                "{stated}"
            );
            let fine = SmoothPath::new(&track, 0.02 * sagitta);
            // Never more than what it states, and what it states is far below the sagitta.
            let (off, stated) = (off_circle(&fine.path), fine.deviation_max_mm());
            assert!(off <= stated + ROUNDING_MM, "{step}: {off} but {stated}");
            assert!(
                stated < 0.3 * sagitta + 2.0 * ROUNDING_MM,
                "{step}: {stated} of {sagitta}"
            );
        }
    }

    #[test]
    fn samples_stay_and_ticks_are_those_of_the_samples() {
        let track = circle(0.5);
        let fine = SmoothPath::new(&track, 1e-5);
        let (before, after) = (&track.passes[0], &fine.path.passes[0]);
        assert!(after.cl_nm.len() > 3 * before.cl_nm.len());
        let mut at = 0;
        for (cl_nm, periods) in before.cl_nm.iter().zip(&before.periods) {
            at += after.cl_nm[at..].iter().position(|own| own == cl_nm).unwrap();
            assert_eq!(after.periods[at], *periods);
        }
        assert!(after.periods.is_sorted() && after.path.is_sorted());
        assert_eq!(after.periods.len(), after.path.len());
    }
}
