//! Passes of constant scallop height as curves `side(path)`, as the core makes them.

use crate::ApproachError;
use inspect::plain;
use job::Job;
use job::units::{MM_PER_NM, S_PER_MIN};
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;

/// Least distance of two points of a curve, mm, and the greatest step of a sample. The curve is within a nanometre of the core's where that bends with a
/// radius of 0.5 mm.
const SPACING_MM: f64 = 0.02;

/// The curve of one pass: a cubic through points with their slopes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SideCurve {
    /// Path parameters, in the order of travel.
    paths: Vec<f64>,
    sides: Vec<f64>,
    slopes: Vec<f64>,
}

impl SideCurve {
    /// The curve through these points, with the slopes of parabolas through three of them.
    #[must_use]
    pub fn new(points: &[[f64; 2]]) -> Self {
        let count = points.len();
        let slope = |from: usize, to: usize| {
            let apart = points[to][0] - points[from][0];
            if apart == 0.0 {
                0.0
            } else {
                (points[to][1] - points[from][1]) / apart
            }
        };
        let slopes = (0..count).map(|at| match (at, count) {
            (_, 0 | 1) => 0.0,
            (_, 2) => slope(0, 1),
            (0, _) => 2.0 * slope(0, 1) - parabola(points, 1),
            (at, _) if at + 1 == count => 2.0 * slope(at - 1, at) - parabola(points, at - 1),
            (at, _) => parabola(points, at),
        });
        Self {
            paths: points.iter().map(|point| point[0]).collect(),
            sides: points.iter().map(|point| point[1]).collect(),
            slopes: slopes.collect(),
        }
    }

    /// Path parameters of start and end.
    #[must_use]
    pub fn ends(&self) -> [f64; 2] {
        [self.paths.first(), self.paths.last()].map(|end| end.copied().unwrap_or_default())
    }

    /// Side parameter and slope at a path parameter; beyond the ends those of the end.
    #[must_use]
    pub fn at(&self, path: f64) -> [f64; 2] {
        let count = self.paths.len();
        if count < 2 {
            return [self.sides.first().copied().unwrap_or_default(), 0.0];
        }
        let [start, end] = self.ends();
        let sense = (end - start).signum();
        let path = path.clamp(start.min(end), start.max(end));
        let after = self.paths.partition_point(|at| sense * at <= sense * path);
        let from = after.clamp(1, count - 1) - 1;
        let width = self.paths[from + 1] - self.paths[from];
        let t = (path - self.paths[from]) / width;
        let [low, high] = [self.sides[from], self.sides[from + 1]];
        let [first, last] = [self.slopes[from] * width, self.slopes[from + 1] * width];
        let rise = high - low;
        // low + first t + square t^2 + cube t^3
        let (square, cube) = (3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise);
        [
            low + t * (first + t * (square + t * cube)),
            (first + t * (2.0 * square + t * 3.0 * cube)) / width,
        ]
    }
}

/// Slope at a point of the parabola through it and its neighbours.
fn parabola(points: &[[f64; 2]], at: usize) -> f64 {
    let [[x0, y0], [x1, y1], [x2, y2]] = [points[at - 1], points[at], points[at + 1]];
    let (near, far) = ((y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1));
    (near * (x2 - x1) + far * (x1 - x0)) / (x2 - x0)
}

/// The passes of a job of constant scallop height, by a run of the core at constant feed; none of other jobs.
///
/// # Errors
/// The core refuses the job or stops with a fault.
pub fn side_curves(job: &Job) -> Result<Vec<SideCurve>, ApproachError> {
    if !job.spacing.is_constant() {
        return Ok(Vec::new());
    }
    let mut job = job.clone();
    // At a lower feed a front may turn more sharply; without axis limits its stations are the same.
    let densest_mm_min = S_PER_MIN * SPACING_MM / job.machine.period_s();
    job.feed_mm_min = job.feed_mm_min.min(densest_mm_min);
    job.machine.limits = None;
    let prepared = prepare(&job).map_err(|error| ApproachError::Fault(error.to_string()))?;
    let sentence = |fault| {
        let (what, remedy) = explain::fault(fault);
        ApproachError::Fault(format!("{what}\n  help: {remedy}"))
    };
    let oracle = Oracle::new(&job)?;
    let mut machine = Machine::load(&prepared).map_err(sentence)?;
    let mut curves: Vec<Vec<[f64; 2]>> = Vec::new();
    // The last sample of a pass stands for its end, also where it is near the one before.
    let (mut pass, mut last, mut kept_nm) = (None, [0.0; 2], [0_i32; 3]);
    let end = |curves: &mut Vec<Vec<[f64; 2]>>, last: [f64; 2]| {
        if let Some(points) = curves.last_mut() {
            let moved = points.last().is_none_or(|point| point[0] != last[0]);
            if moved {
                if points.len() > 2 {
                    points.pop();
                }
                points.push(last);
            }
        }
    };
    machine
        .run(|sample| {
            let Some([u, v]) = plain(&prepared, sample).parameters else {
                return true;
            };
            let (path, side) = oracle.swapped(u, v);
            if pass != Some(sample.pass) {
                end(&mut curves, last);
                curves.push(vec![[path, side]]);
                (pass, kept_nm) = (Some(sample.pass), sample.cc_nm);
            } else if distance_mm(kept_nm, sample.cc_nm) >= SPACING_MM && path != last[0] {
                if let Some(points) = curves.last_mut() {
                    points.push([path, side]);
                }
                kept_nm = sample.cc_nm;
            }
            last = [path, side];
            true
        })
        .map_err(sentence)?;
    end(&mut curves, last);
    Ok(curves.iter().map(|points| SideCurve::new(points)).collect())
}

fn distance_mm(from: [i32; 3], to: [i32; 3]) -> f64 {
    let square = from
        .iter()
        .zip(&to)
        .map(|(from, to)| (f64::from(to - from) * MM_PER_NM).powi(2));
    square.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic through points of a parabola is that parabola, either way of travel.
    #[test]
    fn curve_through_a_parabola() {
        for sense in [1.0, -1.0] {
            let points: Vec<[f64; 2]> = (0..9)
                .map(|k| sense * (f64::from(k) - 4.0) * 0.1)
                .map(|x| [x, 1.0 + 2.0 * x + 3.0 * x * x])
                .collect();
            let curve = SideCurve::new(&points);
            for x in [-0.4, -0.33, 0.0, 0.07, 0.4] {
                let [side, slope] = curve.at(x);
                assert!(
                    (side - (1.0 + 2.0 * x + 3.0 * x * x)).abs() < 1e-12,
                    "{x}: {side}"
                );
                assert!((slope - (2.0 + 6.0 * x)).abs() < 1e-10, "{x}: {slope}");
            }
        }
    }
}
