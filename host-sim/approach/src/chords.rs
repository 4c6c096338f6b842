//! Chords of a pass: straight segments between CL points, as long as a limit of the chord error allows (Lo eqns 6, 7).

use super::nodes::GAUSS;
use super::pass::from_segment;
use super::{ApproachError, PassPath};
use crate::gcode::{Blocks, Cut, FeedMode};
use glam::DVec3;
use job::Along;
use oracle::{OffsetPoint, OracleError};

/// Parts of a chord at whose ends its error is evaluated.
const PROBES: u32 = 12;
/// [`PROBES`] of a chord of a curved pass, which may bend within a short part of the chord.
const PROBES_CURVED: u32 = 32;
/// Largest number of halvings of a step.
const HALVINGS: u32 = 40;
/// Bisections of the length of a chord: the length is within 2^-9, the error within 2^-8, relative.
const BISECTIONS: u32 = 9;
/// Bisections of the share of the limit that equalises the errors of the chords.
const EVENING: u32 = 8;
/// A step that leaves less than this share of itself before the end is extended to the end.
const END_SHARE: f64 = 1e-9;

/// Rule for the chords.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chords {
    /// Lo's eqn 6 as printed, with the radius of curvature of the path: the error is estimated where the chord begins.
    Equation,
    /// Eqn 6 with the radius of the normal curvature of the surface along the path.
    EquationNormal,
    /// The longest chord whose error, measured on the CC and on the CL path, is within the limit; its speed by the arc of the CC path.
    Held,
}

/// A straight segment of the CL path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chord {
    /// Path parameter of the end.
    pub path: f64,
    /// CL at the start, mm.
    pub from_mm: DVec3,
    /// CL at the end, mm.
    pub to_mm: DVec3,
    /// CL speed, mm/s.
    pub speed_mm_s: f64,
}

impl Chord {
    /// The chord as a cut.
    #[must_use]
    pub fn cut(&self) -> Cut {
        Cut::line(self.from_mm, self.to_mm, self.speed_mm_s)
    }
}

/// Chords of a pass by a rule; `chord_mm` is the limit of their error.
///
/// # Errors
/// As [`Approach::plan`](super::Approach::plan).
pub fn chords(
    pass: &PassPath<'_>,
    rule: Chords,
    chord_mm: f64,
    feed_mm_s: f64,
) -> Result<Vec<Chord>, ApproachError> {
    between(pass, rule, &ends(pass, rule, chord_mm)?, feed_mm_s)
}

/// The points between which the chords are, by a rule: none on a pass that is a single point.
fn ends(pass: &PassPath<'_>, rule: Chords, chord_mm: f64) -> Result<Vec<OffsetPoint>, ApproachError> {
    let mut points = Vec::new();
    if pass.is_point() {
        return Ok(points);
    }
    let mut at = pass.at(pass.ends[0])?;
    points.push(at);
    // Bounded: every step is above the range times 2^-HALVINGS, and in practice by the length over sqrt(8 rho delta).
    while pass.left(at.path) > 0.0 {
        let step = match rule {
            Chords::Equation => equation_step(pass, &at, chord_mm, path_curvature(pass, at.path)),
            Chords::EquationNormal => equation_step(pass, &at, chord_mm, at.contact.curvature_path.abs()),
            Chords::Held => held_step(pass, &at, chord_mm)?,
        };
        let left = pass.left(at.path);
        let path = if step >= left * (1.0 - END_SHARE) {
            pass.ends[1]
        } else {
            at.path + step * pass.sense()
        };
        at = pass.at(path)?;
        points.push(at);
    }
    Ok(points)
}

/// The chords between these points, with their speeds.
fn between(
    pass: &PassPath<'_>,
    rule: Chords,
    points: &[OffsetPoint],
    feed_mm_s: f64,
) -> Result<Vec<Chord>, ApproachError> {
    let chord = |pair: &[OffsetPoint]| {
        let [at, next] = [&pair[0], &pair[1]];
        let cc = match rule {
            Chords::Held => arc_mm(pass, at.path, next.path)?,
            Chords::Equation | Chords::EquationNormal => next.contact.cc_mm.distance(at.contact.cc_mm),
        };
        let cl = next.contact.cl_mm.distance(at.contact.cl_mm);
        Ok(Chord {
            path: next.path,
            from_mm: at.contact.cl_mm,
            to_mm: next.contact.cl_mm,
            speed_mm_s: feed_mm_s * if cc > 0.0 { cl / cc } else { 1.0 },
        })
    };
    points.windows(2).map(chord).collect()
}

/// The least number of chords within the limit, with equalised errors. Otherwise the last chord is the remainder, and a chord of
/// half a period runs at half the speed.
///
/// # Errors
/// As [`chords`].
pub fn even_chords(pass: &PassPath<'_>, chord_mm: f64, feed_mm_s: f64) -> Result<Vec<Chord>, ApproachError> {
    let mut best = ends(pass, Chords::Held, chord_mm)?;
    let (mut low, mut high) = (0.5, 1.0);
    for _ in 0..EVENING {
        let share = 0.5 * (low + high);
        match ends(pass, Chords::Held, share * chord_mm) {
            Ok(found) if found.len() <= best.len() => (best, high) = (found, share),
            _ => low = share,
        }
    }
    between(pass, Chords::Held, &best, feed_mm_s)
}

/// Length of the contact's path over a chord, mm: where that bends within a tenth of a millimetre, it is 1 % above the chord of eqn 7.
fn arc_mm(pass: &PassPath<'_>, from: f64, to: f64) -> Result<f64, OracleError> {
    const PARTS: u32 = 16;
    let half = 0.5 * (to - from) / f64::from(PARTS);
    let mut sum = 0.0;
    for part in 0..PARTS {
        let middle = from + half * f64::from(2 * part + 1);
        for place in GAUSS {
            sum += pass.at(middle + half * (2.0 * place - 1.0))?.contact.path_speed;
        }
    }
    Ok((sum * half).abs())
}

/// Curvature of the CC path as a space curve, 1/mm.
fn path_curvature(pass: &PassPath<'_>, path: f64) -> f64 {
    let (u, v) = pass.oracle.swapped(path, pass.side_at(path));
    let at = pass.oracle.surface.at(u, v);
    let (a, aa) = match pass.oracle.along {
        Along::U => (at.u, at.uu),
        Along::V => (at.v, at.vv),
    };
    a.cross(aa).length() / a.length_squared().powf(1.5)
}

/// Eqn 6: `sqrt(8 rho delta) / |A|`, as far as the pass goes.
fn equation_step(pass: &PassPath<'_>, at: &OffsetPoint, chord_mm: f64, curvature: f64) -> f64 {
    let step = (8.0 * chord_mm / curvature).sqrt() / at.contact.path_speed;
    if step.is_finite() {
        step.min(pass.left(at.path))
    } else {
        pass.left(at.path)
    }
}

/// The longest step whose chord holds the limit.
fn held_step(pass: &PassPath<'_>, at: &OffsetPoint, chord_mm: f64) -> Result<f64, ApproachError> {
    let left = pass.left(at.path);
    let holds = |step: f64| chord_holds(pass, at, step, chord_mm);
    // Starts with eqn 6; doubled while within the limit, then halved until within it.
    let mut good = equation_step(pass, at, chord_mm, path_curvature(pass, at.path));
    let mut bad = None;
    for halving in 0.. {
        if holds(good)? {
            break;
        }
        if halving == HALVINGS {
            return Err(ApproachError::NoSegment {
                path: at.path,
                side: pass.side_at(at.path),
            });
        }
        bad = Some(good);
        good *= 0.5;
    }
    while bad.is_none() && good < left {
        let further = (2.0 * good).min(left);
        if holds(further)? {
            good = further;
        } else {
            bad = Some(further);
        }
    }
    let Some(mut bad) = bad else {
        return Ok(good);
    };
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (good + bad);
        if holds(middle)? {
            good = middle;
        } else {
            bad = middle;
        }
    }
    Ok(good)
}

/// Whether the contact's and the centre's path stay within the limit of their chords.
fn chord_holds(pass: &PassPath<'_>, at: &OffsetPoint, step: f64, chord_mm: f64) -> Result<bool, OracleError> {
    let place = |share: f64| pass.at(pass.kept(at.path + share * step * pass.sense()));
    let end = place(1.0)?;
    let probes = if pass.curve.is_some() {
        PROBES_CURVED
    } else {
        PROBES
    };
    // For a parabola, the largest error at these points is at least this share of the peak.
    let most = chord_mm * (1.0 - 1.0 / f64::from(probes * probes));
    // From the middle outwards: the error is usually largest there.
    let outwards = (1..probes / 2).rev().flat_map(|k| [k, probes - k]);
    for k in std::iter::once(probes / 2).chain(outwards) {
        let between = place(f64::from(k) / f64::from(probes))?;
        let contact = from_segment(between.contact.cc_mm, at.contact.cc_mm, end.contact.cc_mm);
        let centre = from_segment(between.contact.cl_mm, at.contact.cl_mm, end.contact.cl_mm);
        if contact.max(centre) > most {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Writes chords as a program, each at its speed.
pub(super) fn write(chords: &[Chord], out: &mut String) {
    let mut blocks = Blocks::new(out, FeedMode::G94);
    for chord in chords {
        blocks.cut(&chord.cut());
    }
}

/// Largest step of the commanded speed between two chords, mm/s.
pub(super) fn speed_step_mm_s(chords: &[Chord]) -> f64 {
    chords.windows(2).fold(0.0, |most: f64, pair| {
        most.max((pair[1].speed_mm_s - pair[0].speed_mm_s).abs())
    })
}
