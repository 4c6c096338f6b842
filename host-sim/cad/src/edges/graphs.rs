//! A face of straight lines side by side (cylinder, cone, extrusion) between two edges that meet each line once, and two lines or all around: ruled between the two edges.
//!
//! An edge at the height v(u) on the lines has the numerator N = v w over the weight w of the lines' exact form, or on a cone, from its apex, the weight Q = w / v. Cubics in these
//! stay on the surface and of degree 3; for a plane section they are exact already.

use glam::DVec3;

use super::sides::{clamped, compatible};
use super::{FOLLOWS_MM, is_regular};
use crate::exact::exact;
use crate::interpolation::between as interpolated;
use crate::loops::{Path, Winding, paths, winding};
use crate::outline::constant;
use crate::remap::Remap;
use crate::spline::{Axis, Pole, SplineCurve, SplineSurface};
use crate::surface::{Periodic, Surface};
use crate::{Edge, Face, Outline};

/// Most spans of an edge for each span of the surface.
const SPANS_MAX: usize = 16;
/// Bisections of a parameter.
const BISECTIONS: usize = 48;
/// Places of each span of the surface at which the distance from the edge is looked at.
const LOOKS: usize = 64;
/// Step of a difference quotient, as a share of the range.
const DIFFERENCE: f64 = 1e-6;

/// The patch; `None` where the surface has no lines, or the edges are others.
pub(super) fn between(face: &Face, loops: &[Vec<Edge>], now: &Outline) -> Option<SplineSurface> {
    let surface = &face.surface;
    if !matches!(
        surface,
        Surface::Cylinder { .. } | Surface::Cone { .. } | Surface::Extrusion { .. }
    ) {
        return None;
    }
    let on = Periodic::new(surface);
    let paths = paths(&on, loops, face.sense);
    let (chains, range) = match winding(&paths) {
        Winding::None => beside(&on, loops, &paths)?,
        Winding::Along(0) => (around(&on, loops, &paths)?, now.rectangle[0]),
        _ => return None,
    };
    let lines = Lines::new(surface, range)?;
    let mut curves = Vec::with_capacity(2);
    for chain in &chains {
        curves.push(lines.curve(chain)?);
    }
    let [one, other]: [(SplineCurve, f64); 2] = curves.try_into().ok()?;
    let (lower, upper) = if one.1 < other.1 {
        (one, other)
    } else {
        (other, one)
    };
    let [lower, upper] = compatible([lower.0, upper.0]);
    let patch = SplineSurface {
        poles: lower
            .poles
            .iter()
            .zip(&upper.poles)
            .map(|(a, b)| vec![*a, *b])
            .collect(),
        axes: [
            lower.axis,
            Axis {
                degree: 1,
                knots: vec![0.0, 0.0, 1.0, 1.0],
            },
        ],
    };
    is_regular(&patch).then_some(patch)
}

/// An edge, or several in a row, that meets each line once.
struct Chain<'a> {
    on: &'a Periodic<'a>,
    pieces: Vec<(&'a Edge, &'a [[f64; 2]])>,
    period: Option<f64>,
}

/// The two chains of a face between two lines, and where those are.
fn beside<'a>(
    on: &'a Periodic<'a>,
    loops: &'a [Vec<Edge>],
    paths: &'a [Path],
) -> Option<([Chain<'a>; 2], [f64; 2])> {
    let ([edges], [path]) = (loops, paths) else {
        return None;
    };
    let is_line: Vec<bool> = path.edges.iter().map(|places| constant(on, places, 0)).collect();
    // From the first edge after a line on.
    let count = edges.len();
    let start = (0..count).find(|k| !is_line[*k] && is_line[(k + count - 1) % count])?;
    let mut chains: Vec<Chain<'a>> = Vec::new();
    let mut was_line = true;
    for k in (start..start + count).map(|k| k % count) {
        if !is_line[k] {
            if was_line {
                chains.push(Chain {
                    on,
                    pieces: Vec::new(),
                    period: None,
                });
            }
            chains
                .last_mut()?
                .pieces
                .push((&edges[k], path.edges[k].as_slice()));
        }
        was_line = is_line[k];
    }
    let chains: [Chain<'a>; 2] = chains.try_into().ok()?;
    let range = chains.each_ref().map(Chain::range);
    let low = 0.5 * (range[0][0] + range[1][0]);
    let high = 0.5 * (range[0][1] + range[1][1]);
    let speed = on.at(0.5 * (low + high), path.edges[start][0][1]).u.length();
    let is_met = |k: usize| (range[0][k] - range[1][k]).abs() * speed <= FOLLOWS_MM;
    let fits = is_met(0) && is_met(1) && chains.iter().all(Chain::is_once);
    fits.then_some((chains, [low, high]))
}

/// The two chains of a face all around.
fn around<'a>(on: &'a Periodic<'a>, loops: &'a [Vec<Edge>], paths: &'a [Path]) -> Option<[Chain<'a>; 2]> {
    if paths.iter().any(|path| path.winding[0].abs() != 1.0) {
        return None;
    }
    let chains = loops.iter().zip(paths).map(|(edges, path)| Chain {
        on,
        pieces: edges.iter().zip(path.edges.iter().map(Vec::as_slice)).collect(),
        period: on.periods[0],
    });
    let chains: [Chain<'a>; 2] = chains.collect::<Vec<_>>().try_into().ok()?;
    chains.iter().all(Chain::is_once).then_some(chains)
}

impl Chain<'_> {
    /// Least and greatest u.
    fn range(&self) -> [f64; 2] {
        let us = self
            .pieces
            .iter()
            .flat_map(|(_, places)| places.iter().map(|place| place[0]));
        us.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], u| {
            [low.min(u), high.max(u)]
        })
    }

    /// Whether u goes one way.
    fn is_once(&self) -> bool {
        let steps = self
            .pieces
            .iter()
            .flat_map(|(_, places)| places.windows(2).map(|ends| ends[1][0] - ends[0][0]));
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for step in steps {
            (least, most) = (least.min(step), most.max(step));
        }
        least > 0.0 || most < 0.0
    }

    /// v at u, and its derivative; beyond an end, those of the curve that goes on.
    fn at(&self, u: f64) -> Option<[f64; 2]> {
        // The interval that holds u, or the nearest one.
        let mut least = f64::INFINITY;
        let mut best = None;
        for (points, places) in &self.pieces {
            let middle = 0.5 * (places.first()?[0] + places.last()?[0]);
            let u = self
                .period
                .map_or(u, |period| u + period * ((middle - u) / period).round());
            for (index, ends) in places.windows(2).enumerate() {
                let (low, high) = (ends[0][0].min(ends[1][0]), ends[0][0].max(ends[1][0]));
                let off = (low - u).max(u - high).max(0.0);
                if off < least {
                    least = off;
                    best = Some((points, places, index, u));
                }
            }
        }
        let (points, places, index, u) = best?;
        let near = places[index];
        let place = |share: f64| self.on.invert(interpolated(points, index, share), Some(near)).0;
        let is_rising = places[index + 1][0] > places[index][0];
        let (mut low, mut high) = (-0.1, 1.1);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if (place(middle)[0] < u) == is_rising {
                low = middle;
            } else {
                high = middle;
            }
        }
        let share = 0.5 * (low + high);
        let [before, after] = [share - 1e-3, share + 1e-3].map(place);
        Some([place(share)[1], (after[1] - before[1]) / (after[0] - before[0])])
    }
}

/// The lines of a surface in their exact form.
struct Lines<'a> {
    base: SplineCurve,
    /// Of a surface of parallel lines: one step of v. Of a cone: its apex and where that is in v.
    kind: Kind,
    remap: Remap<'a>,
    range: [f64; 2],
}

enum Kind {
    Parallel(DVec3),
    Apex(DVec3, f64),
}

impl<'a> Lines<'a> {
    fn new(surface: &'a Surface, u: [f64; 2]) -> Option<Self> {
        let kind = match surface {
            Surface::Cylinder { z, .. } => Kind::Parallel(*z),
            Surface::Extrusion { direction, .. } => Kind::Parallel(*direction),
            Surface::Cone {
                origin,
                z,
                radius,
                slope,
                ..
            } if *slope != 0.0 => {
                let v = -radius / slope;
                Kind::Apex(*origin + *z * v, v)
            }
            _ => return None,
        };
        // The curve at v = 0, of a cone one step of v beyond the apex.
        let v = match kind {
            Kind::Parallel(_) => 0.0,
            Kind::Apex(_, v) => v + 1.0,
        };
        let whole = exact(surface, [u, [v, v + 1.0]])?;
        (whole.axes[0].degree <= 3).then(|| Self {
            base: SplineCurve {
                axis: whole.axes[0].clone(),
                poles: whole.poles.iter().map(|row| row[0]).collect(),
            },
            kind,
            remap: Remap::new(surface, [u, [v, v + 1.0]]),
            range: u,
        })
    }

    /// The parameter of the exact form at u, and back.
    fn exact_at(&self, u: f64) -> f64 {
        self.remap.at([u, 0.0])[0]
    }

    fn u_at(&self, exact: f64) -> f64 {
        let [mut low, mut high] = self.range;
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if self.exact_at(middle) < exact {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// The curve along a chain, and its mean height.
    fn curve(&self, chain: &Chain<'_>) -> Option<(SplineCurve, f64)> {
        let breaks = self.base.axis.breaks();
        let mut curve: Option<SplineCurve> = None;
        let mut sum = 0.0;
        for ends in breaks.windows(2) {
            let span = self.span(chain, [ends[0], ends[1]])?;
            sum += chain.at(self.u_at(0.5 * (ends[0] + ends[1])))?[0];
            curve = Some(match curve {
                None => span,
                Some(before) => joined(before, &span),
            });
        }
        // Weights near 1, so that between two edges of a cone the parameter is nearly even.
        let mut curve = curve?;
        let mean = curve.poles.iter().map(|pole| pole[3]).sum::<f64>() / curve.poles.len() as f64;
        curve.poles.iter_mut().flatten().for_each(|x| *x /= mean);
        curve
            .poles
            .iter()
            .all(|pole| pole[3] > 0.0)
            .then_some((curve, sum / (breaks.len() - 1) as f64))
    }

    /// The curve over one span of the exact form, with as few spans as follow the chain.
    fn span(&self, chain: &Chain<'_>, [low, high]: [f64; 2]) -> Option<SplineCurve> {
        let base = self.base.cut([low, high]).raised(3);
        let weights = SplineCurve {
            poles: base.poles.iter().map(|pole| [pole[3], 0.0, 0.0, 1.0]).collect(),
            axis: base.axis.clone(),
        };
        // What is a cubic: the numerator, or the weight, with its derivative.
        let cubic = |exact: f64| -> Option<[f64; 2]> {
            let u = self.u_at(exact);
            let step = DIFFERENCE * (self.range[1] - self.range[0]);
            // Within the span on both sides.
            let (before, after) = ((u - step).max(self.u_at(low)), (u + step).min(self.u_at(high)));
            let speed = (after - before) / (self.exact_at(after) - self.exact_at(before));
            let [v, slope] = chain.at(u)?;
            let slope = slope * speed;
            let [w, w_slope, _] = weights.at(exact).map(|at| at.x);
            Some(match self.kind {
                Kind::Parallel(_) => [v * w, slope * w + v * w_slope],
                Kind::Apex(_, apex) => {
                    let v = v - apex;
                    [w / v, (w_slope - w * slope / v) / v]
                }
            })
        };
        let (first, last) = (cubic(low)?, cubic(high)?);
        let looks: Vec<(f64, f64)> = (0..=LOOKS)
            .map(|k| {
                let exact = low + (high - low) * k as f64 / LOOKS as f64;
                Some((exact, chain.at(self.u_at(exact))?[0]))
            })
            .collect::<Option<_>>()?;
        let mut spans = 1;
        while spans <= SPANS_MAX {
            let place = |k: usize| -> Option<DVec3> {
                let exact = low + (high - low) * k as f64 / spans as f64;
                let value = match k {
                    0 => first[0],
                    k if k == spans => last[0],
                    _ => cubic(exact)?[0],
                };
                Some(DVec3::X * value)
            };
            let places: Vec<DVec3> = (0..=spans).map(place).collect::<Option<_>>()?;
            let slopes = [first[1], last[1]].map(|slope| DVec3::X * slope);
            let fitted = clamped(&places, slopes, [low, high]);
            let curve = self.on_surface(&base, &fitted);
            let follows = |(exact, v): &(f64, f64)| {
                let on_lines = base.at(*exact)[0];
                let wanted = match self.kind {
                    Kind::Parallel(step) => on_lines + step * *v,
                    Kind::Apex(apex, at) => apex + (on_lines - apex) * (v - at),
                };
                curve.at(*exact)[0].distance(wanted) <= FOLLOWS_MM
            };
            if looks.iter().all(follows) {
                return Some(curve);
            }
            spans *= 2;
        }
        None
    }

    /// The curve on the surface with this numerator, or weight.
    fn on_surface(&self, base: &SplineCurve, cubic: &SplineCurve) -> SplineCurve {
        let mut base = base.clone();
        base.take_knots(&cubic.axis);
        let poles = base.poles.iter().zip(&cubic.poles).map(|(pole, value)| -> Pole {
            let ([x, y, z, w], value) = (*pole, value[0]);
            let point = DVec3::new(x, y, z);
            match self.kind {
                Kind::Parallel(step) => (point + step * value).extend(w).to_array(),
                Kind::Apex(apex, _) => (point - apex * w + apex * value).extend(value).to_array(),
            }
        });
        SplineCurve {
            poles: poles.collect(),
            axis: base.axis,
        }
    }
}

/// Two cubics, the second from where the first one ends.
fn joined(before: SplineCurve, after: &SplineCurve) -> SplineCurve {
    let degree = before.axis.degree;
    let mut knots = before.axis.knots;
    knots.pop();
    knots.extend_from_slice(&after.axis.knots[degree + 1..]);
    let mut poles = before.poles;
    poles.extend_from_slice(&after.poles[1..]);
    SplineCurve {
        axis: Axis { degree, knots },
        poles,
    }
}
