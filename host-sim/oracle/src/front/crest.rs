//! Scallop heights that the passes leave, by the ball swept along them.

use super::super::contact::OracleError;
use super::path::inside;
use super::spline::Spline;
use super::strip::Strip;
use super::{FrontPart, Fronts};
use glam::DVec3;

/// Distance of the balls, as a share of the step-over on a plane.
const SPACING: f64 = 1.0 / 24.0;
/// Balls between those of the coarse search.
const STRIDE: usize = 6;
/// Places a station interval at which the crest is measured.
const PLACES: usize = 4;
/// Distance of the balls beside a knot, path share.
const KNOT_GAP: f64 = 1e-9;
/// Iterations for the place of the crest.
const CREST_STEPS: usize = 14;

/// Crests between neighbouring passes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CrestHeights {
    /// Greatest height, mm.
    pub max_mm: f64,
    /// Mean over the length of the passes, mm.
    pub mean_mm: f64,
    /// Part, pass before the gap, path share and side share of the greatest.
    pub place: (usize, usize, f64, f64),
}

/// Ball centres of a segment, ascending in path share.
struct Balls {
    x: Vec<f64>,
    centres: Vec<DVec3>,
}

struct Ray {
    from: DVec3,
    along: DVec3,
}

impl Ray {
    /// Height at which the ray enters the ball; infinite where it misses.
    fn entry(&self, centre: DVec3, radius: f64) -> f64 {
        let m = centre - self.from;
        let along = m.dot(self.along);
        let off = m - self.along * along;
        let inside = radius * radius - off.length_squared();
        if inside < 0.0 {
            f64::INFINITY
        } else {
            along - inside.sqrt()
        }
    }
}

impl Balls {
    fn new(
        strip: &Strip<'_>,
        pass: &Spline,
        [from, to]: [f64; 2],
        spacing: f64,
    ) -> Result<Self, OracleError> {
        let mut x = strip.even_places(pass, [from, to], spacing)?;
        let mut centres = Vec::with_capacity(x.len());
        for at in &x {
            let forms = strip.forms(*at, pass.at(*at)[0].min(1.0))?;
            centres.push(forms.point + forms.normal * strip.oracle.radius_mm);
        }
        // Both sides of the knots: the normal may jump.
        for knot in strip.breaks() {
            for at in [knot - KNOT_GAP, knot + KNOT_GAP] {
                if at > from && at < to {
                    let forms = strip.forms(at, pass.at(at)[0].min(1.0))?;
                    let index = x.partition_point(|x| *x < at);
                    x.insert(index, at);
                    centres.insert(index, forms.point + forms.normal * strip.oracle.radius_mm);
                }
            }
        }
        Ok(Self { x, centres })
    }

    /// Height over the ray; between balls by the parabola through three of them.
    fn height(&self, ray: &Ray, radius: f64, top: f64) -> f64 {
        let target = ray.from + ray.along * top;
        let squared = |k: usize| self.centres[k].distance_squared(target);
        let last = self.centres.len() - 1;
        let mut best = (0..=last)
            .step_by(STRIDE)
            .min_by(|a, b| squared(*a).total_cmp(&squared(*b)))
            .unwrap_or(0);
        for k in best.saturating_sub(STRIDE)..=(best + STRIDE).min(last) {
            if squared(k) < squared(best) {
                best = k;
            }
        }
        let entry = |k: usize| ray.entry(self.centres[k], radius);
        let middle = best.clamp(1, last - 1);
        let [before, here, after] = [middle - 1, middle, middle + 1].map(entry);
        let least = before.min(here).min(after);
        let bend = before - 2.0 * here + after;
        if !bend.is_finite() || bend <= 0.0 {
            return least;
        }
        let apart = [middle - 1, middle].map(|k| self.centres[k + 1].distance(self.centres[k]));
        if apart[0] > 1.5 * apart[1] || apart[1] > 1.5 * apart[0] {
            return least;
        }
        let t = (before - after) / (2.0 * bend);
        if t.abs() <= 1.0 {
            least.min(here + 0.5 * t * (after - before) + 0.5 * t * t * bend)
        } else {
            least
        }
    }
}

/// Least height over the segments of a pass.
fn height(pass: &[Balls], ray: &Ray, radius: f64, top: f64) -> f64 {
    pass.iter()
        .map(|balls| balls.height(ray, radius, top))
        .fold(f64::INFINITY, f64::min)
}

struct Gap<'a> {
    strip: Strip<'a>,
    radius: f64,
    limit: f64,
    balls: &'a [Vec<Balls>],
    pass: usize,
}

impl Gap<'_> {
    /// Heights of the pass before the gap and of what is beyond it.
    fn both(&self, x: f64, y: f64, top: f64) -> Result<(f64, f64, f64), OracleError> {
        let forms = self.strip.forms(x, y)?;
        let ray = Ray {
            from: forms.point,
            along: forms.normal,
        };
        let of = |pass: usize| height(&self.balls[pass], &ray, self.radius, top);
        let near = of(self.pass);
        let last = self.balls.len() - 1;
        let mut far = of(self.pass + 1);
        if self.pass + 1 < last {
            far = far.min(of(last));
        }
        let mut all = near.min(far);
        if self.pass > 0 {
            all = all.min(of(self.pass - 1));
        }
        if self.pass + 2 < last {
            all = all.min(of(self.pass + 2));
        }
        Ok((near, far, all))
    }

    /// The crest over a line of constant x: its side share and its height.
    fn crest(&self, x: f64, [mut low, mut high]: [f64; 2]) -> Result<(f64, f64), OracleError> {
        let mut top = 0.6 * self.limit;
        let mut best = (low, 0.0);
        let (mut at_low, mut at_high) = (-self.limit, self.limit);
        for step in 0..CREST_STEPS {
            let width = high - low;
            let secant = low - at_low * width / (at_high - at_low);
            let y = if step < 2 || step % 3 == 2 || !secant.is_finite() {
                0.5 * (low + high)
            } else {
                secant.clamp(low + 0.02 * width, high - 0.02 * width)
            };
            let (near, far, all) = self.both(x, y, top)?;
            let all = all.min(4.0 * self.radius);
            if all > best.1 {
                best = (y, all);
            }
            top = all.clamp(0.0, 3.0 * self.limit);
            let difference = (near.min(1e3) - far.min(1e3)).clamp(-1e3, 1e3);
            if difference < 0.0 {
                (low, at_low) = (y, difference);
            } else {
                (high, at_high) = (y, difference);
            }
            if difference.abs() < 1e-9 {
                break;
            }
        }
        Ok(best)
    }
}

impl Fronts<'_> {
    /// Heights of the crests between neighbouring passes, along lines of constant path parameter.
    ///
    /// # Errors
    /// Where the surface has no contact geometry.
    pub fn crests(&self) -> Result<CrestHeights, OracleError> {
        let mut found = CrestHeights::default();
        let mut sums = (0.0, 0.0);
        for (number, part) in self.parts.iter().enumerate() {
            self.part_crests(number, part, &mut found, &mut sums)?;
        }
        found.mean_mm = sums.0 / sums.1;
        Ok(found)
    }

    fn part_crests(
        &self,
        number: usize,
        part: &FrontPart,
        found: &mut CrestHeights,
        sums: &mut (f64, f64),
    ) -> Result<(), OracleError> {
        let strip = self.strip(part);
        let (radius, limit) = (self.oracle.radius_mm, self.oracle.scallop_mm);
        let spacing = SPACING * (8.0 * radius * limit).sqrt();
        let intervals: Vec<Vec<[f64; 2]>> = part.passes.iter().map(inside).collect();
        let mut balls = Vec::new();
        for (pass, intervals) in part.passes.iter().zip(&intervals) {
            let all: Result<Vec<Balls>, OracleError> = intervals
                .iter()
                .map(|ends| Balls::new(&strip, pass, *ends, spacing))
                .collect();
            balls.push(all?);
        }
        for k in 0..part.passes.len() - 1 {
            let gap = Gap {
                strip,
                radius,
                limit,
                balls: &balls,
                pass: k,
            };
            for (ends, own) in intervals[k].iter().zip(&balls[k]) {
                let mut places: Vec<f64> = own.x.iter().step_by(3).copied().collect();
                places.extend(part.passes[k].stations().windows(2).flat_map(|pair| {
                    (0..PLACES).map(move |i| pair[0] + (pair[1] - pair[0]) * i as f64 / PLACES as f64)
                }));
                places.extend(ends);
                places.retain(|x| *x >= ends[0] && *x <= ends[1]);
                places.sort_by(f64::total_cmp);
                places.dedup_by(|b, a| *b - *a < 1e-7);
                let mut before: Option<(DVec3, f64)> = None;
                for x in places {
                    let low = part.passes[k].at(x)[0].clamp(0.0, 1.0);
                    let high = part.passes[k + 1].at(x)[0].clamp(0.0, 1.0);
                    if high - low < 1e-9 {
                        continue;
                    }
                    let (y, height) = gap.crest(x, [low, high])?;
                    if height > found.max_mm {
                        found.max_mm = height;
                        found.place = (number, k, x, y);
                    }
                    let point = strip.forms(x, y)?.point;
                    if let Some((from, last)) = before {
                        let length = point.distance(from);
                        sums.0 += 0.5 * (last + height) * length;
                        sums.1 += length;
                    }
                    before = Some((point, height));
                }
            }
        }
        Ok(())
    }
}
