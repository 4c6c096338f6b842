//! The point of the surface that is nearest to the ball's centre: its contact, wherever the motion comes from.

use glam::DVec3;
use oracle::Oracle;

/// Points of the grid per parameter from which a search begins.
const GRID: u32 = 96;
/// Largest number of Newton steps.
const STEPS: usize = 30;
/// The search ends at a step below this in both parameters, as a share of their ranges.
const SETTLED: f64 = 1e-13;
/// Starts of a search over the whole surface.
const STARTS: usize = 6;

/// The nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// Parameters.
    pub uv: [f64; 2],
    /// The point, mm.
    pub point_mm: DVec3,
    /// Its distance, mm.
    pub distance_mm: f64,
}

/// Searches nearest points.
pub struct Projector<'a> {
    oracle: &'a Oracle,
    grid: Vec<([f64; 2], DVec3)>,
}

impl<'a> Projector<'a> {
    /// A projector onto a job's surface.
    #[must_use]
    pub fn new(oracle: &'a Oracle) -> Self {
        let [u, v] = oracle.surface.domain();
        let part = |[low, high]: [f64; 2], k: u32| low + (high - low) * f64::from(k) / f64::from(GRID);
        let grid = (0..=GRID)
            .flat_map(|i| (0..=GRID).map(move |j| (i, j)))
            .map(|(i, j)| {
                let uv = [part(u, i), part(v, j)];
                (uv, oracle.surface.at(uv[0], uv[1]).point)
            })
            .collect();
        Self { oracle, grid }
    }

    /// The nearest point of the whole surface.
    #[must_use]
    pub fn nearest(&self, centre_mm: DVec3) -> NearestPoint {
        let mut order: Vec<(f64, [f64; 2])> = self
            .grid
            .iter()
            .map(|(uv, point)| (point.distance_squared(centre_mm), *uv))
            .collect();
        let first = STARTS.min(order.len() - 1);
        order.select_nth_unstable_by(first, |a, b| a.0.total_cmp(&b.0));
        let starts = order[..=first]
            .iter()
            .map(|(_, uv)| self.nearest_from(centre_mm, *uv));
        let nearer = |a: NearestPoint, b: NearestPoint| if b.distance_mm < a.distance_mm { b } else { a };
        starts.reduce(nearer).unwrap_or(NearestPoint {
            uv: [0.0; 2],
            point_mm: DVec3::ZERO,
            distance_mm: f64::INFINITY,
        })
    }

    /// The nearest point around one: Newton's method on the squared distance, with steps that never increase it.
    #[must_use]
    pub fn nearest_from(&self, centre_mm: DVec3, start: [f64; 2]) -> NearestPoint {
        let [[u0, u1], [v0, v1]] = self.oracle.surface.domain();
        let (wide, high) = (u1 - u0, v1 - v0);
        let [mut u, mut v] = start;
        let mut at = self.oracle.surface.at(u, v);
        let mut distance = at.point.distance(centre_mm);
        for _ in 0..STEPS {
            let off = at.point - centre_mm;
            let (mut gu, mut gv) = (off.dot(at.u), off.dot(at.v));
            let mut uu = at.u.length_squared() + off.dot(at.uu);
            let mut vv = at.v.length_squared() + off.dot(at.vv);
            let mut uv = at.u.dot(at.v) + off.dot(at.uv);
            // Not convex here: the Gauss-Newton part alone.
            if uu <= 0.0 || vv <= 0.0 || uu * vv - uv * uv <= 0.0 {
                uu = at.u.length_squared();
                vv = at.v.length_squared();
                uv = at.u.dot(at.v);
            }
            // A parameter at its end that wants to go beyond stays.
            let stays =
                |at: f64, [low, high]: [f64; 2], g: f64| (at <= low && g > 0.0) || (at >= high && g < 0.0);
            let (hold_u, hold_v) = (stays(u, [u0, u1], gu), stays(v, [v0, v1], gv));
            if hold_u {
                (gu, uv) = (0.0, 0.0);
            }
            if hold_v {
                (gv, uv) = (0.0, 0.0);
            }
            let tiny = 1e-12 * (uu * wide * wide + vv * high * high);
            let (a, c) = (uu + tiny / (wide * wide), vv + tiny / (high * high));
            let determinant = a * c - uv * uv;
            let (mut du, mut dv) = ((uv * gv - c * gu) / determinant, (uv * gu - a * gv) / determinant);
            if hold_u {
                du = 0.0;
            }
            if hold_v {
                dv = 0.0;
            }
            let mut moved = false;
            for _ in 0..12 {
                let next = [(u + du).clamp(u0, u1), (v + dv).clamp(v0, v1)];
                let there = self.oracle.surface.at(next[0], next[1]);
                let nearer = there.point.distance(centre_mm);
                if nearer <= distance {
                    moved = (next[0] - u).abs() > SETTLED * wide || (next[1] - v).abs() > SETTLED * high;
                    ([u, v], at, distance) = (next, there, nearer);
                    break;
                }
                (du, dv) = (0.5 * du, 0.5 * dv);
            }
            if !moved {
                break;
            }
        }
        NearestPoint {
            uv: [u, v],
            point_mm: at.point,
            distance_mm: distance,
        }
    }
}
