//! Geometry of a surface for the preparation: the sign of its upper side, and the tool centre over the first contact. Evaluated from
//! the pieces that become the core's patches, independently of the oracle, which computes both for itself.

use glam::DVec3;
use job::{Along, Job, JobError, Side, SurfaceSpec};
use patches::pieces::{Piece, Source};

/// Cells per parameter for the average of the surface's normal.
const GRID: u32 = 48;
/// Least |sum of the normal's z|, as a share of the sum of |z|, for a definite upper side.
const BALANCE_MIN: f64 = 0.1;
/// Least sum of |z|, as a share of the area: below it the surface is vertical everywhere.
const UPRIGHT_MIN: f64 = 1e-3;
/// Distance of the first point near a pole, as a share of the range: near enough for a parabola, far enough for a normal.
const POLE_STEP: f64 = 1e-4;
/// Places along a boundary at which it is asked whether it is a point, how far apart they are at most, mm, and how far beside it the surface is looked at, as a share of the
/// range: near enough for a bowl to be flat.
const POINT_PLACES: u32 = 24;
const POINT_MM: f64 = 1e-6;
const POINT_STEP: f64 = 1e-6;
/// Least cosine between a normal at a point and the way from there into the surface at a concave point: what is less sinks the ball by less than 13 nm for each
/// millimetre of its radius.
const CONCAVE_MIN: f64 = 5e-3;
/// Ratio of the derivatives' lengths, each times its range, below which the shorter one counts as zero.
const POLE_SHARE: f64 = 1e-9;

/// A point and its first derivatives.
#[derive(Default)]
pub(crate) struct Frame {
    pub(crate) point: DVec3,
    pub(crate) u: DVec3,
    pub(crate) v: DVec3,
}

/// A surface in a form for evaluation.
#[allow(clippy::large_enum_variant, reason = "one per job")]
pub(crate) enum SurfaceEvaluator {
    Pieces { source: Source, breaks: [Vec<f64>; 2] },
    Profile { radius: [f64; 4], height: [f64; 4] },
}

/// Value and derivative of a cubic, highest power first.
fn cubic([c3, c2, c1, c0]: [f64; 4], t: f64) -> [f64; 2] {
    [
        ((c3 * t + c2) * t + c1) * t + c0,
        (3.0 * c3 * t + 2.0 * c2) * t + c1,
    ]
}

/// Value, derivative along the first and along the second parameter of a bicubic, lowest power first.
fn bicubic(c: &[[f64; 4]; 4], s: f64, t: f64) -> [f64; 3] {
    let rows = c.map(|[c0, c1, c2, c3]| cubic([c3, c2, c1, c0], t));
    let [value, along] = cubic([rows[3][0], rows[2][0], rows[1][0], rows[0][0]], s);
    let [across, _] = cubic([rows[3][1], rows[2][1], rows[1][1], rows[0][1]], s);
    [value, along, across]
}

/// The span that contains a parameter.
fn span(breaks: &[f64], at: f64) -> [f64; 2] {
    let index = breaks
        .partition_point(|start| *start <= at)
        .clamp(1, breaks.len() - 1);
    [breaks[index - 1], breaks[index]]
}

impl SurfaceEvaluator {
    pub(crate) fn new(spec: &SurfaceSpec) -> Self {
        match spec {
            SurfaceSpec::Revolved {
                radius_mm, height_mm, ..
            } => Self::Profile {
                radius: *radius_mm,
                height: *height_mm,
            },
            other => {
                let source = Source::new(other);
                let breaks = source.breaks();
                Self::Pieces { source, breaks }
            }
        }
    }

    pub(crate) fn at(&self, u: f64, v: f64) -> Frame {
        match self {
            Self::Profile { radius, height } => {
                let ([r, dr], [z, dz]) = (cubic(*radius, u), cubic(*height, u));
                let (sin, cos) = v.sin_cos();
                Frame {
                    point: DVec3::new(r * cos, r * sin, z),
                    u: DVec3::new(dr * cos, dr * sin, dz),
                    v: DVec3::new(-r * sin, r * cos, 0.0),
                }
            }
            Self::Pieces { source, breaks } => {
                let (us, vs) = (span(&breaks[0], u), span(&breaks[1], v));
                in_piece(&source.piece(us, vs), us, vs, [u, v])
            }
        }
    }
}

/// A frame within a piece over a rectangle: the piece's parameters are from -1/2 to 1/2.
fn in_piece(piece: &Piece, us: [f64; 2], vs: [f64; 2], [u, v]: [f64; 2]) -> Frame {
    let centred = |[start, end]: [f64; 2], at: f64| (at - start) / (end - start) - 0.5;
    let (s, t) = (centred(us, u), centred(vs, v));
    let [weight, weight_u, weight_v] = bicubic(&piece[3], s, t);
    let mut frame = Frame::default();
    for (axis, numerator) in piece.iter().take(3).enumerate() {
        let [value, along, across] = bicubic(numerator, s, t);
        let point = value / weight;
        frame.point[axis] = point;
        frame.u[axis] = (along - weight_u * point) / weight / (us[1] - us[0]);
        frame.v[axis] = (across - weight_v * point) / weight / (vs[1] - vs[0]);
    }
    frame
}

/// The sign on `S_u x S_v` that points to the tool.
///
/// # Errors
/// `side = "up"` for a surface without a definite upper side, or vertical everywhere.
pub(super) fn tool_sign(job: &Job) -> Result<f64, JobError> {
    match job.side {
        Side::Plus => return Ok(1.0),
        Side::Minus => return Ok(-1.0),
        Side::Up => {}
    }
    let surface = SurfaceEvaluator::new(&job.surface);
    let [us, vs] = job.surface.domain();
    let middle = |[start, end]: [f64; 2], index: u32| {
        start + (end - start) * (f64::from(index) + 0.5) / f64::from(GRID)
    };
    let (mut upright, mut upright_magnitude, mut area) = (0.0, 0.0, 0.0);
    for i in 0..GRID {
        for j in 0..GRID {
            let frame = surface.at(middle(us, i), middle(vs, j));
            let normal = frame.u.cross(frame.v);
            upright += normal.z;
            upright_magnitude += normal.z.abs();
            area += normal.length();
        }
    }
    if upright.abs() > BALANCE_MIN * upright_magnitude && upright_magnitude > UPRIGHT_MIN * area {
        return Ok(upright.signum());
    }
    Err(job.origin.error(
        "cut.side",
        "the surface faces up as much as down, so side = \"up\" is ambiguous; write \"+\" or \"-\"",
        "give side = \"+\" or \"-\": the sign on S_u x S_v",
    ))
}

/// The tool centre over the contact at (u, v), the first of the first pass, mm; `None` where the surface has no normal there.
pub(super) fn centre_mm(job: &Job, sign: f64, [u, v]: [f64; 2]) -> Option<DVec3> {
    let surface = SurfaceEvaluator::new(&job.surface);
    let [us, vs] = job.surface.domain();
    let frame = surface.at(u, v);
    let (reach_u, reach_v) = (
        frame.u.length() * (us[1] - us[0]),
        frame.v.length() * (vs[1] - vs[0]),
    );
    let normal = if reach_u.min(reach_v) > POLE_SHARE * reach_u.max(reach_v) {
        unit(frame.u.cross(frame.v))?
    } else {
        // The normal near the pole, extrapolated to it by a parabola.
        let beside = |k: f64| {
            let step = |at: f64, [start, end]: [f64; 2]| {
                let way = k * POLE_STEP * (end - start);
                if at + way < end { at + way } else { at - way }
            };
            let place = if reach_u < reach_v {
                surface.at(u, step(v, vs))
            } else {
                surface.at(step(u, us), v)
            };
            unit(place.u.cross(place.v))
        };
        let (one, two, three) = (beside(1.0)?, beside(2.0)?, beside(3.0)?);
        unit(3.0 * (one - two) + three)?
    };
    Some(frame.point + sign * job.radius_mm * normal)
}

/// Checks that no boundary is a concave point, like the tip of a countersink: the core checks the fit of the ball along the pass and across it, and at a point only
/// along it.
///
/// # Errors
/// Such a boundary, unless a region says what is machined.
pub(super) fn check_points(job: &Job, sign: f64) -> Result<(), JobError> {
    if job.region.is_some() {
        return Ok(());
    }
    let surface = SurfaceEvaluator::new(&job.surface);
    let [us, vs] = job.surface.domain();
    for along in [Along::U, Along::V] {
        // A boundary of constant `along`.
        let (own, other) = match along {
            Along::U => (us, vs),
            Along::V => (vs, us),
        };
        for [end, from] in [own, [own[1], own[0]]] {
            if is_concave_point(&surface, along, [end, from], other, sign) {
                let name = along.name();
                return Err(job.origin.error(
                    "surface",
                    format!("the boundary {name} = {end} is a concave point, where a ball that touches one side cuts into the other"),
                    format!("end the surface before the point, by its range of {name}, or draw a [region] that leaves it out"),
                ));
            }
        }
    }
    Ok(())
}

/// Whether the boundary of constant `along` at `end` is a point from which the surface rises towards the tool on a side.
fn is_concave_point(
    surface: &SurfaceEvaluator,
    along: Along,
    [end, from]: [f64; 2],
    [low, high]: [f64; 2],
    sign: f64,
) -> bool {
    let at = |own: f64, place: u32| {
        let other = low + (high - low) * f64::from(place) / f64::from(POINT_PLACES);
        match along {
            Along::U => surface.at(own, other),
            Along::V => surface.at(other, own),
        }
    };
    let tip = at(end, 0).point;
    if (0..=POINT_PLACES).any(|place| at(end, place).point.distance(tip) > POINT_MM) {
        return false;
    }
    let beside = end + POINT_STEP * (from - end);
    let sides: Vec<(DVec3, DVec3)> = (0..=POINT_PLACES)
        .filter_map(|place| {
            let frame = at(beside, place);
            Some((sign * unit(frame.u.cross(frame.v))?, unit(frame.point - tip)?))
        })
        .collect();
    let rises = |normal: &DVec3| sides.iter().any(|(_, way)| normal.dot(*way) > CONCAVE_MIN);
    sides.iter().any(|(normal, _)| rises(normal))
}

fn unit(a: DVec3) -> Option<DVec3> {
    let size = a.length();
    (size > 0.0 && size.is_finite()).then(|| a / size)
}

/// The sign on `S_path x S_side`.
pub(super) const fn along_path(sign: f64, along: Along) -> f64 {
    match along {
        Along::U => sign,
        Along::V => -sign,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oracle::Oracle;

    const JOBS: [(&str, &str); 6] = [
        ("revolved", include_str!("../../../../jobs/revolved.toml")),
        ("revolved_v", include_str!("../../../../jobs/revolved_v.toml")),
        (
            "ruled_printed",
            include_str!("../../../../jobs/ruled_printed.toml"),
        ),
        ("plate_v", include_str!("../../../../jobs/plate_v.toml")),
        ("freeform", include_str!("../../../../jobs/freeform.toml")),
        // Rational, with a pole at the start.
        ("sphere_cap", include_str!("../../../../jobs/sphere_cap.toml")),
    ];

    /// The oracle decides the tool's side and the first contact for itself: both must come to the same.
    #[test]
    fn side_and_first_centre_are_the_oracles() {
        for (name, text) in JOBS {
            for side in [Side::Up, Side::Plus, Side::Minus] {
                let mut job = job_file::parse(name, text).unwrap();
                job.side = side;
                let oracle = Oracle::new(&job).unwrap();
                let sign = tool_sign(&job).unwrap();
                assert_eq!(sign, oracle.normal_sign, "{name} {side:?}");
                let [us, vs] = job.surface.domain();
                let exact = oracle.contact(us[0], vs[0]).unwrap().cl_mm;
                let ours = centre_mm(&job, sign, [us[0], vs[0]]).unwrap();
                // A nanometre: the machine's own resolution.
                assert!(ours.distance(exact) < 1e-6, "{name} {side:?}: {ours} for {exact}");
            }
        }
    }

    /// A cone's tip, and the same with a bowl instead.
    fn tip(rise: [f64; 2], along: &str) -> Job {
        let [bowl, cone] = rise;
        let text = format!(
            "[surface]\nkind = \"revolved\"\nradius_mm = [0, 0, 200, 0]\nheight_mm = [0, {bowl}, {cone}, 0]\nu = [0, 1]\nv_rad = [0, 6.28]\n\
             [tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 1200\nscallop_mm = 0.05\nalong = \"{along}\"\nside = \"up\"\n"
        );
        job_file::parse("tip", &text).unwrap()
    }

    #[test]
    fn concave_points_are_refused() {
        for along in ["u", "v"] {
            for rise in [[0.0, 200.0], [0.0, 10.0], [100.0, 2.0]] {
                let error = super::super::prepare(&tip(rise, along)).unwrap_err();
                assert!(
                    error.what().contains("u = 0 is a concave point"),
                    "{along} {rise:?}: {error}"
                );
            }
            // A bowl, a flat, a tip.
            for rise in [[300.0, 0.0], [0.0, 0.0], [0.0, -200.0], [0.0, -10.0]] {
                super::super::prepare(&tip(rise, along)).unwrap();
            }
        }
    }
}
