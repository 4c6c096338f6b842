//! Point inversion: parameters of a point of a surface, in closed form for elementary surfaces, by Newton's method for others.

use glam::DVec3;
use std::f64::consts::PI;

use super::curve::Curve;
use super::surface::{Periodic, Surface};

/// Seeds per side of each patch in the search of the nearest point on a B-spline surface.
const SEEDS: usize = 3;
/// Largest number of seeds of the whole surface; with many patches, several share a seed.
const SEEDS_MAX: usize = 96 * 96;
/// Seeds, each nearer than those beside it, from which a point is sought until one leads to it: between the turns of a thread the nearest seed may be
/// on the wrong one.
const TRIED: usize = 8;
/// A point found from a guess is this close to the surface, mm; otherwise the whole surface is searched.
const FOUND_MM: f64 = 1e-4;
/// Edges of files lie this far off their surface, mm: a nearest place within it is the one that was meant.
const MEANT_MM: f64 = 0.01;
/// Newton iterations from the best seed.
const STEPS: usize = 40;
/// A place is the nearest one where the gap along either parameter is below this, mm.
const NEAREST_MM: f64 = 1e-10;
/// Largest number of halvings of a step that does not reduce the distance.
const HALVINGS: i32 = 16;

impl Surface {
    /// As [`Periodic::invert`], for a single point.
    #[must_use]
    pub fn invert(&self, to: DVec3, near: Option<[f64; 2]>) -> ([f64; 2], f64) {
        Periodic::new(self).invert(to, near)
    }

    fn closed_form(&self) -> bool {
        !matches!(self, Self::Spline(_) | Self::Ruled { .. } | Self::Offset { .. })
    }

    /// Parameters of a point of an elementary surface, a revolution or an extrusion; `None` for other surfaces, which have [`Self::seeds`].
    fn seed(&self, to: DVec3) -> Option<[f64; 2]> {
        let share = |from: DVec3, x: DVec3| from.dot(x) / x.length_squared();
        let place = match self {
            Self::Plane { origin, x, y } => {
                let from = to - *origin;
                [share(from, *x), share(from, *y)]
            }
            Self::Cylinder { origin, x, y, z } => {
                let from = to - *origin;
                [share(from, *y).atan2(share(from, *x)), share(from, *z)]
            }
            Self::Cone {
                origin,
                x,
                y,
                z,
                radius,
                slope,
            } => {
                let from = to - *origin;
                let (a, b, v) = (share(from, *x), share(from, *y), share(from, *z));
                // The half of the cone that the point is on.
                let turn = if radius + slope * v < 0.0 { PI } else { 0.0 };
                [b.atan2(a) + turn, v]
            }
            Self::Sphere { center, x, y, z } => {
                let from = to - *center;
                let (a, b, c) = (share(from, *x), share(from, *y), share(from, *z));
                [b.atan2(a), c.atan2(a.hypot(b))]
            }
            Self::Torus {
                center,
                x,
                y,
                z,
                major,
                minor,
            } => {
                let from = to - *center;
                let (a, b, c) = (share(from, *x), share(from, *y), share(from, *z));
                let out = a.hypot(b);
                // A tube that is wider than its ring goes on beyond the axis: the nearer of its two circles in the plane of the point and the axis.
                let off = |out: f64| ((out - major).hypot(c) - minor).abs();
                let (turn, out) = if off(-out) < off(out) {
                    (PI, -out)
                } else {
                    (0.0, out)
                };
                [b.atan2(a) + turn, c.atan2(out - major)]
            }
            Self::Revolution {
                profile,
                range,
                origin,
                axis,
            } => {
                let v = profile.nearest_meridian(*range, to, *origin, *axis);
                let across = |p: DVec3| {
                    let from = p - *origin;
                    from - *axis * from.dot(*axis)
                };
                let (from, here) = (across(profile.at(v)[0]), across(to));
                [from.cross(here).dot(*axis).atan2(from.dot(here)), v]
            }
            Self::Extrusion {
                profile,
                range,
                direction,
            } => {
                let across = |p: DVec3| p - *direction * share(p, *direction);
                let u = match (range, profile) {
                    (None, Curve::Line { origin, direction: d }) => {
                        let d = across(*d);
                        share(across(to - *origin), d)
                    }
                    _ => profile.nearest(range.unwrap_or([-1e3, 1e3]), to, &across),
                };
                [u, share(to - profile.at(u)[0], *direction)]
            }
            Self::Spline(_) | Self::Ruled { .. } | Self::Offset { .. } => return None,
        };
        Some(place)
    }

    /// Places of a grid that are nearer to a point than those beside them, the nearest first: at least one, at most [`TRIED`].
    fn seeds(&self, to: DVec3) -> Vec<[f64; 2]> {
        let breaks = [0, 1].map(|k| {
            let range = self.domain()[k].unwrap_or([0.0, 1.0]);
            match self {
                Self::Spline(spline) => spline.axes[k].breaks(),
                _ => (0..=8)
                    .map(|i| range[0] + (range[1] - range[0]) * f64::from(i) / 8.0)
                    .collect(),
            }
        });
        let [us, vs] = grid(&breaks);
        let distance: Vec<Vec<f64>> = us
            .iter()
            .map(|u| {
                vs.iter()
                    .map(|v| self.at(*u, *v).point.distance_squared(to))
                    .collect()
            })
            .collect();
        let mut least: Vec<(f64, [f64; 2])> = Vec::new();
        for (i, u) in us.iter().enumerate() {
            for (j, v) in vs.iter().enumerate() {
                let here = distance[i][j];
                let beside = distance[i.saturating_sub(1)..us.len().min(i + 2)]
                    .iter()
                    .flat_map(|row| &row[j.saturating_sub(1)..vs.len().min(j + 2)]);
                if beside.copied().all(|other| here <= other) {
                    least.push((here, [*u, *v]));
                }
            }
        }
        least.sort_by(|a, b| a.0.total_cmp(&b.0));
        least.truncate(TRIED);
        if least.is_empty() {
            // Not a number somewhere: no place is nearest.
            least.push((f64::NAN, [us[0], vs[0]]));
        }
        least.into_iter().map(|(_, place)| place).collect()
    }
}

impl Periodic<'_> {
    /// Parameters of the point of the surface nearest to `to`, and its distance, mm. `near`: initial guess; on a periodic
    /// surface the result is the one nearest to the guess.
    #[must_use]
    pub fn invert(&self, to: DVec3, near: Option<[f64; 2]>) -> ([f64; 2], f64) {
        let mut found = match near {
            Some(near) if !self.surface.closed_form() => self.refined(near, to),
            _ => self.sought(to),
        };
        if near.is_some() && !self.surface.closed_form() && !found.is_meant() {
            // Points on the surface are found from the guess; if that fails, the whole surface is searched.
            let afresh = self.sought(to);
            if afresh.off_mm < 0.5 * found.off_mm {
                found = afresh;
            }
        }
        let mut found = (found.place, found.off_mm);
        if let Some(near) = near {
            for (k, period) in self.periods.into_iter().enumerate() {
                if let Some(period) = period {
                    found.0[k] += period * ((near[k] - found.0[k]) / period).round();
                }
            }
        }
        found
    }

    /// The place nearest to a point, sought on the whole surface.
    fn sought(&self, to: DVec3) -> Found {
        if let Some(seed) = self.surface.seed(to) {
            return self.refined(seed, to);
        }
        let [first, others @ ..] = &self.surface.seeds(to)[..] else {
            unreachable!("a grid has a nearest seed")
        };
        let mut best = self.refined(*first, to);
        for seed in others {
            if best.is_meant() {
                break;
            }
            let found = self.refined(*seed, to);
            if found.off_mm < best.off_mm {
                best = found;
            }
        }
        best
    }

    /// Newton's method on the distance, within the domain; no step increases the distance.
    fn refined(&self, start: [f64; 2], to: DVec3) -> Found {
        let (surface, domain, periods) = (self.surface, self.domain, self.periods);
        let held = |place: [f64; 2]| -> [f64; 2] {
            std::array::from_fn(|k| match (domain[k], periods[k]) {
                (Some(range), None) => place[k].clamp(range[0], range[1]),
                // The parameters of a closed B-spline wrap at its seam.
                (Some(range), Some(period)) if matches!(surface, Surface::Spline(_)) => {
                    range[0] + (place[k] - range[0]).rem_euclid(period)
                }
                _ => place[k],
            })
        };
        let mut place = held(start);
        let mut gap = surface.at(place[0], place[1]).point - to;
        let mut is_nearest = false;
        for _ in 0..STEPS {
            let at = surface.at(place[0], place[1]);
            gap = at.point - to;
            let slope = [gap.dot(at.u), gap.dot(at.v)];
            let near = [at.u.length_squared(), at.u.dot(at.v), at.v.length_squared()];
            // The gap has no part along the parameter, or the domain ends there.
            let ends = |k: usize| {
                let at_end = |[low, high]: [f64; 2]| {
                    place[k] <= low && slope[k] > 0.0 || place[k] >= high && slope[k] < 0.0
                };
                slope[k].abs() <= NEAREST_MM * near[2 * k].sqrt()
                    || periods[k].is_none() && domain[k].is_some_and(at_end)
            };
            is_nearest = ends(0) && ends(1);
            if is_nearest {
                break;
            }
            let bent = [gap.dot(at.uu), gap.dot(at.uv), gap.dot(at.vv)];
            let exact = std::array::from_fn(|k| near[k] + bent[k]);
            // Newton, Gauss-Newton, then each parameter alone (at a degenerate point): the first that reduces the distance.
            let steps = [
                solved(exact, slope),
                solved(near, slope),
                Some(apart(near, slope)),
            ];
            let moved = steps.into_iter().flatten().find_map(|step| {
                (0..HALVINGS).find_map(|k| {
                    let share = 0.5_f64.powi(k);
                    let next = held([place[0] + share * step[0], place[1] + share * step[1]]);
                    let new = surface.at(next[0], next[1]).point - to;
                    (new.length_squared() < gap.length_squared()).then_some((next, new))
                })
            });
            let Some((next, new)) = moved else { break };
            (place, gap) = (next, new);
        }
        Found {
            place,
            off_mm: gap.length(),
            is_nearest,
        }
    }
}

/// Parameters of a grid of at most [`SEEDS_MAX`] places between these breaks.
fn grid(breaks: &[Vec<f64>; 2]) -> [Vec<f64>; 2] {
    let wanted = breaks.each_ref().map(|breaks| SEEDS * (breaks.len() - 1));
    let share = (SEEDS_MAX as f64 / (wanted[0] * wanted[1]) as f64)
        .sqrt()
        .min(1.0);
    std::array::from_fn(|k| {
        let spans = breaks[k].len() - 1;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the number wanted, above 0"
        )]
        let wanted = ((share * wanted[k] as f64) as usize).max(SEEDS);
        // Centres of cells: at a degenerate point the gradient vanishes.
        (0..wanted)
            .map(|i| {
                let place = (i as f64 + 0.5) * spans as f64 / wanted as f64;
                #[allow(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a small index"
                )]
                let span = (place as usize).min(spans - 1);
                breaks[k][span] + (breaks[k][span + 1] - breaks[k][span]) * (place - span as f64)
            })
            .collect()
    })
}

/// A place by Newton's method.
struct Found {
    place: [f64; 2],
    /// Distance from the point, mm.
    off_mm: f64,
    /// No place beside it is nearer.
    is_nearest: bool,
}

impl Found {
    /// Whether it is a place that the point was meant to have.
    fn is_meant(&self) -> bool {
        self.off_mm <= if self.is_nearest { MEANT_MM } else { FOUND_MM }
    }
}

/// Solution of a symmetric system of two equations `h x = -slope`, if it is positive definite.
fn solved(h: [f64; 3], slope: [f64; 2]) -> Option<[f64; 2]> {
    let det = h[0] * h[2] - h[1] * h[1];
    (h[0] > 0.0 && det > 1e-12 * h[0] * h[2]).then(|| {
        [
            (h[1] * slope[1] - h[2] * slope[0]) / det,
            (h[1] * slope[0] - h[0] * slope[1]) / det,
        ]
    })
}

/// Solution of the two equations without their coupling.
fn apart(h: [f64; 3], slope: [f64; 2]) -> [f64; 2] {
    let alone = |slope: f64, square: f64| if square > 0.0 { -slope / square } else { 0.0 };
    [alone(slope[0], h[0]), alone(slope[1], h[2])]
}
