//! One step of a front.
//!
//! A point of the next front at station x is one step away from a contact of the pass, its foot: the distance from any contact bounds the scallop height, so a
//! foot that is not the nearest contact only gives a smaller step. This is the parallel curve by Huygens' construction (Hopf-Lax), stable however far the foot
//! is from the station; a foot beyond the end of the pass is its end.

use super::limits::Limits;
use super::spline::Spline;
use super::strip::{Forms, Strip};
use super::{FrontError, FrontOptions};

/// Steps of a front over fixed stations.
pub(super) struct Stepper<'a> {
    strip: Strip<'a>,
    options: &'a FrontOptions,
    x: Vec<f64>,
    /// Ends of the path share, and the knots between them at which the normal jumps.
    creases: Vec<f64>,
}

/// Distance from a crease at which its sides are evaluated, path share.
const CREASE_GAP: f64 = 1e-9;
/// Least jump of the normal at a crease, rad.
const CREASE_MIN: f64 = 1e-5;

/// Places between stations at which the step is checked, shares of the interval.
const BETWEEN: [f64; 3] = [0.25, 0.5, 0.75];
/// Iterations of the search for a foot.
const FOOT_ROUNDS: usize = 4;
/// Number of feet that are tried.
const FEET: usize = 6;
/// Rounds in which a step is measured.
const MEASUREMENTS: usize = 4;

/// A step from a contact of a pass to a station.
struct Chord {
    /// Path share and side share of the contact.
    foot: [f64; 2],
    /// Path share of the station.
    x: f64,
    /// The step goes from the pass to the middle of the gap, not across all of it.
    is_half: bool,
}

/// Height above a surface point, along its normal, of the ball at a contact, mm.
fn height_above(point: &Forms, contact: &Forms, radius: f64) -> f64 {
    let to = contact.point - point.point;
    let power = to.length_squared() + 2.0 * radius * to.dot(contact.normal);
    let middle = (to + contact.normal * radius).dot(point.normal);
    let root = middle * middle - power;
    if root > 0.0 {
        (power / (middle + root.sqrt())).max(0.0)
    } else {
        f64::INFINITY
    }
}

impl<'a> Stepper<'a> {
    pub(super) fn new(strip: Strip<'a>, options: &'a FrontOptions) -> Result<Self, FrontError> {
        let x = strip.stations(options)?;
        let knots = strip.breaks();
        let mut creases = vec![0.0];
        for at in &knots[1..knots.len() - 1] {
            let mut jump = 0.0_f64;
            for k in 0..=16 {
                let y = f64::from(k) / 16.0;
                let [below, above] = [-CREASE_GAP, CREASE_GAP].map(|by| strip.forms(at + by, y));
                jump = jump.max(below?.normal.cross(above?.normal).length());
            }
            if jump > CREASE_MIN {
                creases.push(*at);
            }
        }
        creases.push(1.0);
        Ok(Self {
            strip,
            options,
            x,
            creases,
        })
    }

    pub(super) fn stations(&self) -> &[f64] {
        &self.x
    }

    fn height(&self) -> f64 {
        self.options.margin * self.strip.oracle.scallop_mm
    }

    fn fitting(&self, x: f64, y: f64) -> Result<Forms, FrontError> {
        let forms = self.strip.forms(x, y)?;
        if forms.fits() {
            Ok(forms)
        } else {
            Err(FrontError::BallDoesNotFit { x, y })
        }
    }

    /// Side share at x that is `distance` steps away from the pass; `side`: the side on which x is counted where it is on a crease.
    fn reach(&self, pass: &Spline, x: f64, distance: f64, side: f64) -> Result<f64, FrontError> {
        let (radius, height) = (self.strip.oracle.radius_mm, self.height());
        let cap = 1.0 + self.options.beyond;
        let scale = distance * distance;
        // Between creases.
        let region = self
            .creases
            .partition_point(|at| *at < x + side * CREASE_GAP)
            .clamp(1, self.creases.len() - 1);
        let (low, high) = (self.creases[region - 1], self.creases[region]);
        let inside = |x: f64| {
            let gap = |is_end: bool| if is_end { 0.0 } else { CREASE_GAP };
            x.clamp(low + gap(low == 0.0), high - gap(high == 1.0))
        };
        let here = self.fitting(inside(x), pass.at(x)[0])?;
        // The foot: the contact from which the step reaches furthest.
        let mut best = (f64::NEG_INFINITY, x);
        let mut foot = x;
        for _ in 0..=FOOT_ROUNDS {
            let [from, p, _] = pass.at(foot);
            if let Some(step) = here.side_step(x - foot, scale, radius, height)
                && from + step > best.0
            {
                best = (from + step, foot);
            }
            let next = (x - here.shift(p, scale, radius, height)).clamp(low, high);
            if !next.is_finite() {
                break;
            }
            foot = next;
        }
        let (top, mut foot) = best;
        if top >= cap {
            return Ok(cap);
        }
        for _ in 0..FEET {
            let chord = Chord {
                foot: [foot, pass.at(foot)[0]],
                x,
                is_half: distance < 1.0,
            };
            if let Some(y) = self.measured_step(&chord, &inside)? {
                return Ok(y.min(cap));
            }
            // Too far aside for the curvature over the step.
            foot = 0.5 * (foot + x);
        }
        Ok(pass.at(x)[0])
    }

    /// Side share at the chord's end at which the crest over it has the design height (of half a chord: at which the ball at the foot leaves the design height
    /// there); `None` where the foot is farther than that.
    fn measured_step(&self, chord: &Chord, inside: &impl Fn(f64) -> f64) -> Result<Option<f64>, FrontError> {
        let (radius, height) = (self.strip.oracle.radius_mm, self.height());
        let scale = if chord.is_half { 0.25 } else { 1.0 };
        let [foot, from] = chord.foot;
        let dx = chord.x - foot;
        let forms = |x: f64, y: f64| self.fitting(inside(x), y);
        let start = forms(foot, from)?;
        let Some(step) = start.side_step(dx, scale, radius, height) else {
            return Ok(None);
        };
        let middle = forms(foot + 0.5 * dx, from + 0.5 * step)?;
        let Some(mut dy) = middle.side_step(dx, scale, radius, height) else {
            return Ok(None);
        };
        let mut share = 0.5;
        for _ in 0..MEASUREMENTS {
            // Beyond the end line there is no surface: measured as far as that line.
            let measured = dy.min(1.0 - from);
            if measured <= 0.0 {
                break;
            }
            let end = forms(chord.x, from + measured)?;
            let excess = if chord.is_half {
                height_above(&end, &start, radius) / height
            } else {
                // The roots of both heights are nearly linear in the distance.
                let point = forms(foot + share * dx, from + share * measured)?;
                let [near, far] = [&start, &end].map(|contact| height_above(&point, contact, radius).sqrt());
                let (near, far) = (near / share, far / (1.0 - share));
                share = (far / (near + far)).clamp(0.2, 0.8);
                (near * far / (near + far)).powi(2) / height
            };
            // Square of the distance on the form's scale, and where it makes the design height.
            let square = middle.density(dx, measured, radius, height) / excess;
            match middle.side_step(dx, square, radius, height) {
                Some(next) if next.is_finite() => dy = next,
                _ => return Ok(None),
            }
        }
        Ok(Some(from + dy))
    }

    /// The furthest place of the next pass at an end: from half of the way on, along the boundary.
    fn reach_at_end(&self, pass: &Spline, x: f64, side: f64) -> Result<f64, FrontError> {
        let cap = 1.0 + self.options.beyond;
        let (radius, height) = (self.strip.oracle.radius_mm, self.height());
        let half = self.reach(pass, x, 0.5, side)?;
        if half >= cap {
            return Ok(cap);
        }
        let at = if x > 0.0 && x < 1.0 {
            x + side * CREASE_GAP
        } else {
            x
        };
        let start = self.fitting(at, half)?;
        let Some(mut dy) = start.side_step(0.0, 0.25, radius, height) else {
            return Ok(half);
        };
        for _ in 0..MEASUREMENTS {
            let measured = dy.min(1.0 - half);
            if measured <= 0.0 {
                break;
            }
            let end = self.fitting(at, half + measured)?;
            let excess = height_above(&start, &end, radius) / height;
            let square = start.density(0.0, measured, radius, height) / excess;
            match start.side_step(0.0, square, radius, height) {
                Some(next) if next.is_finite() => dy = next,
                _ => break,
            }
        }
        Ok((half + dy).min(cap))
    }

    /// The next front.
    pub(super) fn advance(&self, pass: &Spline) -> Result<Vec<f64>, FrontError> {
        let o = self.options;
        let cap = 1.0 + o.beyond;
        let n = self.x.len();
        let g = pass.values();
        let mut new = Vec::with_capacity(n);
        for x in &self.x {
            new.push(self.reach(pass, *x, 1.0, 1.0)?);
        }
        for (x, new) in self.x.iter().zip(&mut new) {
            if !self.creases.iter().any(|at| (at - x).abs() < CREASE_GAP) {
                continue;
            }
            for side in [1.0, -1.0] {
                let beside = x + side * CREASE_GAP;
                if beside > 0.0 && beside < 1.0 {
                    *new = new
                        .min(self.reach(pass, *x, 1.0, side)?)
                        .min(self.reach_at_end(pass, *x, side)?);
                }
            }
        }
        let half: Vec<f64> = g
            .iter()
            .zip(&new)
            .map(|(g, new)| (0.5 * (g + new)).min(cap))
            .collect();
        let forms: Vec<Forms> = self
            .x
            .iter()
            .zip(&half)
            .map(|(x, y)| self.fitting(*x, *y))
            .collect::<Result<_, _>>()?;
        let own = Spline::new(&self.x, half);
        let oracle = self.strip.oracle;
        let limits = Limits::new(
            &self.x,
            &forms,
            own.slopes(),
            oracle.feed_mm_s * oracle.period_s,
            o,
        );
        let settle = |new: &mut Vec<f64>| {
            limits.lower(new);
            for (new, g) in new.iter_mut().zip(g) {
                *new = new.max(*g).min(cap);
            }
        };
        settle(&mut new);
        // Between the stations.
        let place = |i: usize, k: usize| self.x[i] + (self.x[i + 1] - self.x[i]) * BETWEEN[k];
        let mut tops = Vec::with_capacity(n);
        for i in 0..n - 1 {
            let mut top = [0.0; BETWEEN.len()];
            for (k, top) in top.iter_mut().enumerate() {
                *top = self.reach(pass, place(i, k), 1.0, 1.0)?;
            }
            tops.push(top);
        }
        for _ in 0..o.repairs {
            let next = Spline::new(&self.x, new.clone());
            let mut cut = vec![0.0_f64; n];
            let mut any = false;
            for i in 0..n - 1 {
                for (k, top) in tops[i].iter().enumerate() {
                    let x = place(i, k);
                    let (y, from) = (next.at(x)[0], pass.at(x)[0]);
                    let excess = y - top - o.slack * (top - from);
                    if excess > 0.0 && y < 1.05 + (top - from) {
                        any = true;
                        cut[i] = cut[i].max(excess);
                        cut[i + 1] = cut[i + 1].max(excess);
                    }
                }
            }
            if !any {
                break;
            }
            for (new, cut) in new.iter_mut().zip(&cut) {
                *new -= 1.1 * cut;
            }
            settle(&mut new);
        }
        Ok(new)
    }
}

impl Strip<'_> {
    /// Even parts of each span.
    fn stations(&self, options: &FrontOptions) -> Result<Vec<f64>, FrontError> {
        let breaks = self.breaks();
        let spans = breaks.len() - 1;
        // Longest line of constant side parameter.
        let mut length = 0.0_f64;
        for y in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let mut sum = 0.0;
            for k in 0..64 {
                sum += self.forms((f64::from(k) + 0.5) / 64.0, y)?.e.sqrt() / 64.0;
            }
            length = length.max(sum);
        }
        let step = (8.0 * self.oracle.radius_mm * self.oracle.scallop_mm).sqrt();
        let most = (length / (options.station_spacing * step)).ceil().max(8.0) as usize;
        let parts = options
            .stations_per_span
            .max((options.stations_min - 1).div_ceil(spans));
        let parts = parts.min(most.div_ceil(spans)).max(4);
        let mut x = vec![0.0];
        for span in breaks.windows(2) {
            x.extend((1..=parts).map(|k| span[0] + (span[1] - span[0]) * k as f64 / parts as f64));
        }
        Ok(x)
    }
}
