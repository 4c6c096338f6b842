//! Passes, lengths and speeds of a job by geometry alone: quadrature on the oracle, without a run.

use approach::{ApproachError, Chords, Nodes, PassPath, chords, passes};
use glam::DVec3;
use oracle::{Oracle, OracleError};

/// Cells along and across the path of the midpoint quadrature over the surface. Relative error about 1e-6.
const CELLS: [u32; 2] = [768, 64];
/// Steps of the ternary search for a speed's extreme.
const EXTREME_STEPS: u32 = 24;
/// Sampling points of a chord's error.
const PROBES: u32 = 40;

/// Geometric figures of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Geometry {
    /// Number of passes.
    pub passes: usize,
    /// Least interval between passes, in the side parameter.
    pub interval_min: f64,
    /// Length of all passes on the surface, mm.
    pub cc_length_mm: f64,
    /// Length of all passes of the tool centre, mm.
    pub cl_length_mm: f64,
    /// Lengths of the longest pass, on the surface and of its tool centre, mm.
    pub pass_mm: [f64; 2],
    /// Least and greatest speed of the centre over that of the contact.
    pub ratio: [f64; 2],
    /// Length of a path of constant scallop height, mm: the integral of the surface's area over the local step-over.
    pub even_scallop_mm: f64,
}

impl Geometry {
    /// Computes the figures of a job.
    ///
    /// # Errors
    /// The surface has no normal somewhere, or the ball does not fit.
    pub fn new(oracle: &Oracle) -> Result<Self, OracleError> {
        let schedule = oracle.schedule()?;
        let mut geometry = Self {
            passes: schedule.len(),
            interval_min: schedule
                .iter()
                .map(|pass| pass.interval)
                .fold(f64::INFINITY, f64::min),
            cc_length_mm: 0.0,
            cl_length_mm: 0.0,
            pass_mm: [0.0; 2],
            ratio: [f64::INFINITY, 0.0],
            even_scallop_mm: even_scallop_mm(oracle)?,
        };
        for pass in passes(oracle)? {
            let nodes = Nodes::new(&pass)?;
            let [cc, cl] = nodes.lengths_mm();
            let [low, high] = extremes(&pass, &nodes)?;
            geometry.cc_length_mm += cc;
            geometry.cl_length_mm += cl;
            if cc > geometry.pass_mm[0] {
                geometry.pass_mm = [cc, cl];
            }
            geometry.ratio = [geometry.ratio[0].min(low), geometry.ratio[1].max(high)];
        }
        Ok(geometry)
    }

    /// Excess length of iso-parametric passes over passes of constant scallop height, as a share of the former, %.
    #[must_use]
    pub fn waste_pct(&self) -> f64 {
        100.0 * (1.0 - self.even_scallop_mm / self.cc_length_mm)
    }
}

/// Least and greatest speed ratio of a pass: those of the nodes, refined between their neighbours.
fn extremes(pass: &PassPath<'_>, nodes: &Nodes) -> Result<[f64; 2], OracleError> {
    let mut found = nodes.ratios();
    for (extreme, sign) in found.iter_mut().zip([-1.0, 1.0]) {
        let place = nodes.0.iter().position(|node| node.at.ratio() == *extreme);
        let Some(k) = place.filter(|k| *k > 0 && k + 1 < nodes.0.len()) else {
            continue;
        };
        let (mut low, mut high) = (nodes.0[k - 1].at.path, nodes.0[k + 1].at.path);
        // A ratio is stationary at its extreme, so a bracket of a thousandth suffices.
        for _ in 0..EXTREME_STEPS {
            let third = (high - low) / 3.0;
            let [left, right] = [pass.at(low + third)?.ratio(), pass.at(high - third)?.ratio()];
            if sign * left < sign * right {
                low += third;
            } else {
                high -= third;
            }
        }
        *extreme = pass.at(0.5 * (low + high))?.ratio();
    }
    Ok(found)
}

/// The integral of |A| / interval over the surface.
fn even_scallop_mm(oracle: &Oracle) -> Result<f64, OracleError> {
    let ([low, high], [first, last]) = (oracle.path_range(), oracle.side_range());
    let [along, across] = CELLS;
    let mut sum = 0.0;
    for i in 0..along {
        let path = low + (high - low) * (f64::from(i) + 0.5) / f64::from(along);
        for j in 0..across {
            let side = first + (last - first) * (f64::from(j) + 0.5) / f64::from(across);
            let (u, v) = oracle.swapped(path, side);
            let contact = oracle.contact(u, v)?;
            sum += contact.path_speed / contact.interval;
        }
    }
    Ok(sum * (high - low) * (last - first) / f64::from(along) / f64::from(across))
}

/// Chords of a pass by a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChordsOfPass {
    /// Number of chords.
    pub count: usize,
    /// Largest error of the contact's path, mm.
    pub error_mm: f64,
    /// Path parameters at the ends of the chord with that error.
    pub worst: [f64; 2],
}

impl ChordsOfPass {
    /// Computes the chords of a pass.
    ///
    /// # Errors
    /// As [`chords`].
    pub fn new(pass: &PassPath<'_>, rule: Chords, chord_mm: f64) -> Result<Self, ApproachError> {
        let chords = chords(pass, rule, chord_mm, 1.0)?;
        let mut found = Self {
            count: chords.len(),
            error_mm: 0.0,
            worst: [pass.ends[0]; 2],
        };
        let mut begin = pass.ends[0];
        for chord in &chords {
            let at = |share: f64| {
                pass.at(begin + (chord.path - begin) * share)
                    .map(|at| at.contact.cc_mm)
            };
            let (from, to) = (at(0.0)?, at(1.0)?);
            for k in 1..PROBES {
                let error_mm = from_line(at(f64::from(k) / f64::from(PROBES))?, from, to);
                if error_mm > found.error_mm {
                    (found.error_mm, found.worst) = (error_mm, [begin, chord.path]);
                }
            }
            begin = chord.path;
        }
        Ok(found)
    }
}

/// Distance of a point from a line, mm.
fn from_line(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let along = to - from;
    (point - from).cross(along).length() / along.length()
}
