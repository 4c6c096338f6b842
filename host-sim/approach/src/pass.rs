//! A pass in its cutting direction.

use crate::SideCurve;
use glam::DVec3;
use oracle::{OffsetPoint, Oracle, OracleError, foot_on};

/// One pass of a job.
#[derive(Clone, Copy, Debug)]
pub struct PassPath<'a> {
    /// Geometry of the job.
    pub oracle: &'a Oracle,
    /// Number of the pass, from 0.
    pub pass: u32,
    /// Its side parameter; at the start of a curve.
    pub side: f64,
    /// Path parameters of start and end.
    pub ends: [f64; 2],
    /// Its curve, if it is not a line of constant side parameter.
    pub curve: Option<&'a SideCurve>,
}

impl PassPath<'_> {
    /// 1, or -1 on a reversed pass.
    #[must_use]
    pub fn sense(&self) -> f64 {
        (self.ends[1] - self.ends[0]).signum()
    }

    /// Contact and centre at a path parameter.
    ///
    /// # Errors
    /// As [`Oracle::offset`].
    pub fn at(&self, path: f64) -> Result<OffsetPoint, OracleError> {
        match self.curve {
            Some(curve) => {
                let [side, slope] = curve.at(path);
                self.oracle.offset_on_curve(path, side, slope)
            }
            None => self.oracle.offset(path, self.side),
        }
    }

    /// Side parameter at a path parameter.
    #[must_use]
    pub fn side_at(&self, path: f64) -> f64 {
        self.curve.map_or(self.side, |curve| curve.at(path)[0])
    }

    /// The point of the pass nearest to a commanded centre close to it; `guess`: a path parameter near it.
    ///
    /// # Errors
    /// As [`Oracle::offset`].
    pub fn foot(&self, cl_mm: DVec3, guess: f64) -> Result<OffsetPoint, OracleError> {
        foot_on(cl_mm, guess, self.range(), |path| self.at(path))
    }

    /// Path parameters between which it is smooth, in the order of travel.
    #[must_use]
    pub fn breaks(&self) -> Vec<f64> {
        let [start, end] = self.ends;
        let [low, high] = [start.min(end), start.max(end)];
        let all = self.oracle.surface.breaks(self.oracle.along);
        let mut breaks = vec![low];
        breaks.extend(all.into_iter().filter(|at| *at > low && *at < high));
        breaks.push(high);
        if self.sense() < 0.0 {
            breaks.reverse();
        }
        breaks
    }

    /// Remaining parameter range up to the end; 0 beyond the end.
    #[must_use]
    pub fn left(&self, path: f64) -> f64 {
        ((self.ends[1] - path) * self.sense()).max(0.0)
    }

    /// The parameter, clamped to the pass.
    #[must_use]
    pub fn kept(&self, path: f64) -> f64 {
        let [low, high] = self.range();
        path.clamp(low, high)
    }

    /// Path parameters for which the pass is defined, ascending.
    fn range(&self) -> [f64; 2] {
        match self.curve {
            Some(_) => [self.ends[0].min(self.ends[1]), self.ends[0].max(self.ends[1])],
            None => self.oracle.path_range(),
        }
    }

    /// Whether the pass is degenerate (one point).
    #[must_use]
    pub fn is_point(&self) -> bool {
        const PLACES: u32 = 8;
        let at = |k: u32| {
            let path = self.ends[0] + (self.ends[1] - self.ends[0]) * f64::from(k) / f64::from(PLACES);
            let (u, v) = self.oracle.swapped(path, self.side_at(path));
            self.oracle.surface.at(u, v).point
        };
        let first = at(0);
        (1..=PLACES).all(|k| at(k).distance(first) < 1e-9)
    }

    /// Whether the pass, whose centre begins here, is a point with more than one normal.
    ///
    /// # Errors
    /// As [`Oracle::offset`].
    pub fn is_tip(&self, begin_mm: DVec3) -> Result<bool, OracleError> {
        if !self.is_point() {
            return Ok(false);
        }
        let [start, end] = self.ends;
        for share in [0.25, 0.5, 0.75, 1.0] {
            let at = self.at(start + (end - start) * share)?;
            if at.contact.cl_mm.distance(begin_mm) > TIP_MM {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Distance of two centres above one contact from which on their normals differ, mm.
const TIP_MM: f64 = 2e-5;

/// Distance of a point from a segment, mm.
pub(crate) fn from_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let (along, away) = (to - from, point - from);
    let squared = along.length_squared();
    let share = if squared > 0.0 {
        (away.dot(along) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    point.distance(from + along * share)
}
