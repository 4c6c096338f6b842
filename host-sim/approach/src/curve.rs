//! Method 2: composite cubic splines for the CL path and, on the same segments, for its speed; the least number of segments
//! within the tolerances, followed at the fitted speed.

use std::fmt::Write;

use super::cubic::{Cubic, Errors, fit};
use super::nodes::Nodes;
use super::{Approach, ApproachError, Each, PassPath, Program};
use job::Job;
use job::units::S_PER_MIN;

/// Tolerance of the fitted speed, as a share of the feed (from the paper).
pub const SPEED_SHARE: f64 = 0.01;
/// Bisections of the share of the tolerance that equalises the errors of the segments.
const EVENING: u32 = 8;
/// Bisections for the part of a period up to the end of a segment.
const ENDING: u32 = 50;

/// The approach for a job.
#[derive(Clone, Copy, Debug)]
pub struct Curve {
    path_mm: f64,
    feed_mm_s: f64,
}

impl Curve {
    /// The approach with a job's feed, and its chord error limit as the tolerance of the path.
    #[must_use]
    pub fn new(job: &Job) -> Self {
        Self {
            path_mm: job.chord_mm,
            feed_mm_s: job.feed_mm_s(),
        }
    }

    /// The cubics of a pass: successively the longest within the tolerances, which gives the least number; then the ends are
    /// moved to equalise the errors.
    ///
    /// # Errors
    /// At some point no segment is within the tolerance.
    pub fn cubics(&self, pass: &PassPath<'_>, nodes: &Nodes) -> Result<Vec<Cubic>, ApproachError> {
        let mut best = self.longest(pass, nodes, 1.0)?;
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..EVENING {
            let share = 0.5 * (low + high);
            match self.longest(pass, nodes, share) {
                Ok(cubics) if cubics.len() <= best.len() => (best, high) = (cubics, share),
                _ => low = share,
            }
        }
        Ok(best)
    }

    /// Successively the longest segments within a share of the tolerances.
    fn longest(&self, pass: &PassPath<'_>, nodes: &Nodes, share: f64) -> Result<Vec<Cubic>, ApproachError> {
        let nodes = &nodes.0;
        let holds = |errors: &Errors| {
            errors.path_mm <= share * self.path_mm
                && errors.speed_mm_s <= share * SPEED_SHARE * self.feed_mm_s
        };
        let good = |first: usize, last: usize| {
            fit(&nodes[first..=last], self.feed_mm_s)
                .filter(|(_, errors)| holds(errors))
                .map(|(cubic, _)| cubic)
        };
        longest(nodes.len(), good).map_err(|first| ApproachError::NoSegment {
            path: nodes[first].at.path,
            side: pass.side_at(nodes[first].at.path),
        })
    }
}

/// Successively the longest intervals of `count` points for which `good(first, last)` is `Some`; or the index from which there is
/// none.
pub(super) fn longest<T>(count: usize, good: impl Fn(usize, usize) -> Option<T>) -> Result<Vec<T>, usize> {
    let mut stretches = Vec::new();
    let mut first = 0;
    while first + 1 < count {
        let (mut reach, mut best) = (first + 1, good(first, first + 1).ok_or(first)?);
        // Exponential search, then bisection, for the longest valid one.
        let mut step = 1;
        let mut growing = true;
        while step > 0 {
            let further = (reach + step).min(count - 1);
            match (further > reach).then(|| good(first, further)).flatten() {
                Some(found) => {
                    (reach, best) = (further, found);
                    step = if growing { 2 * step } else { step / 2 };
                }
                None => (step, growing) = (step / 2, false),
            }
        }
        stretches.push(best);
        first = reach;
    }
    Ok(stretches)
}

impl Approach for Curve {
    fn plan(&self, pass: &PassPath<'_>) -> Result<Box<dyn Program>, ApproachError> {
        let nodes = Nodes::new(pass)?;
        let cubics = self.cubics(pass, &nodes)?;
        Ok(Box::new(Spline { cubics }))
    }
}

/// The cubics of one pass.
struct Spline {
    cubics: Vec<Cubic>,
}

/// t after a time at the fitted speed from t, along one cubic; beyond 1 if the cubic ends before.
fn after(cubic: &Cubic, t: f64, time_s: f64) -> f64 {
    let rate = |t: f64| cubic.speed(t) / cubic.derivative(t).length().max(1e-12);
    let first = rate(t);
    let second = rate(t + 0.5 * time_s * first);
    let third = rate(t + 0.5 * time_s * second);
    let fourth = rate(t + time_s * third);
    t + time_s * (first + 2.0 * (second + third) + fourth) / 6.0
}

/// Time at the fitted speed from t to the end of a cubic; must be less than `time_s`.
fn time_to_end(cubic: &Cubic, t: f64, time_s: f64) -> f64 {
    let (mut low, mut high) = (0.0, time_s);
    for _ in 0..ENDING {
        let middle = 0.5 * (low + high);
        if after(cubic, t, middle) < 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

impl Program for Spline {
    fn segments(&self) -> usize {
        self.cubics.len()
    }

    /// One block per segment in the polynomial format of the Siemens 840D: for each axis and the feed, the end value and the
    /// coefficients of t² and t³.
    fn write(&self, out: &mut String) {
        for cubic in &self.cubics {
            let [_, _, square, cube] = cubic.coefficients();
            out.push_str("POLY");
            for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate() {
                let end = cubic.points_mm[1][axis];
                // Writing to a `String` cannot fail.
                let _ = write!(
                    out,
                    " PO[{name}]=({end:.4},{:.4},{:.4})",
                    square[axis], cube[axis]
                );
            }
            let [_, _, square, cube] = cubic.speed_mm_s.map(|v| v * S_PER_MIN);
            let _ = writeln!(
                out,
                " F=FPO({:.1},{square:.1},{cube:.1})",
                cubic.speed(1.0) * S_PER_MIN
            );
        }
    }

    fn speed_step_mm_s(&self) -> f64 {
        self.cubics.windows(2).fold(0.0, |most: f64, pair| {
            most.max((pair[1].speed(0.0) - pair[0].speed(1.0)).abs())
        })
    }

    fn follow(&self, pass: &PassPath<'_>, period_s: f64, each: &mut Each<'_>) -> Result<(), ApproachError> {
        let Some(mut cubic) = self.cubics.first() else {
            return Ok(());
        };
        let mut rest = self.cubics[1..].iter();
        let (mut t, mut time) = (0.0, period_s);
        let guess = |cubic: &Cubic, t: f64| cubic.path[0] + (cubic.path[1] - cubic.path[0]) * t;
        // Bounded by the duration of the pass over the period, plus the number of segments.
        loop {
            let next = after(cubic, t, time);
            if next < 1.0 {
                (t, time) = (next, period_s);
                each(cubic.at(t), guess(cubic, t))?;
                continue;
            }
            time -= time_to_end(cubic, t, time);
            match rest.next() {
                Some(following) => (cubic, t) = (following, 0.0),
                None => return each(cubic.points_mm[1], pass.ends[1]),
            }
        }
    }
}
