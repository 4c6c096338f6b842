//! The boundary of a face in the parameters of its surface: a rectangle, or a trimmed region with its bounding rectangle.

use super::exact::joints;
use super::loops::{Path, Winding, complementary, paths, speed, winding};
use super::surface::Periodic;
use super::{Boundary, Face};

/// Tolerance of an edge on an iso-parametric line, mm. Edges in files are accurate to 1e-3 to 1e-7 mm.
pub(super) const FOLLOWS_MM: f64 = 1e-3;
/// Tolerance of an end of the rectangle on a knot, mm: a patch that is narrower is rounding of the file.
const KNOT_MM: f64 = 1e-4;
/// Largest difference between the area of a loop of iso-parametric lines and that of its bounding rectangle, as a share: an
/// L shape differs by much more.
const AREA_SLACK: f64 = 1e-3;

/// The part of a surface that a face uses.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Ranges of u and v. Those of a closed surface may cross the seam.
    pub rectangle: [[f64; 2]; 2],
    /// Reason why the face is trimmed; `None` if it is the whole rectangle.
    pub trimmed: Option<String>,
    /// Whether the boundary is unknown, so that the rectangle is that of the whole surface.
    pub unknown: bool,
}

/// Whether the edge lies on a line of constant parameter k.
pub(super) fn constant(on: &Periodic<'_>, edge: &[[f64; 2]], k: usize) -> bool {
    let [low, high] = edge
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
            [low.min(place[k]), high.max(place[k])]
        });
    let fastest = edge.iter().map(|place| speed(on, *place, k)).fold(0.0, f64::max);
    0.5 * (high - low) * fastest <= FOLLOWS_MM
}

/// The bounding rectangle of a face in parameters, and whether the face is that rectangle.
///
/// # Errors
/// The face is unbounded, or its boundary is not on its surface; as text.
pub fn outline(face: &Face) -> Result<Outline, String> {
    let surface = &face.surface;
    let natural = || {
        let [u, v] = surface.domain();
        match (u, v) {
            (Some(u), Some(v)) => Ok([u, v]),
            _ => Err(format!("the {} has no boundary: it is unbounded", surface.kind())),
        }
    };
    let loops = match &face.boundary {
        Boundary::Natural => {
            return Ok(Outline {
                rectangle: natural()?,
                trimmed: None,
                unknown: false,
            });
        }
        Boundary::Unknown(why) => {
            return Ok(Outline {
                rectangle: natural()?,
                trimmed: Some(format!("its boundary is unknown: {why}")),
                unknown: true,
            });
        }
        Boundary::Loops(loops) => loops,
    };
    let on = Periodic::new(surface);
    let paths = paths(&on, loops, face.sense);
    let off_mm = paths.iter().map(|path| path.off_mm).fold(0.0, f64::max);
    let mut rectangle = around(&paths);
    let holes_alone = complementary(&on, &paths, face.sense);
    let trimmed = match winding(&paths) {
        Winding::None if holes_alone => {
            let whole = natural()?;
            rectangle = std::array::from_fn(|k| {
                let middle = 0.5 * (rectangle[k][0] + rectangle[k][1]);
                let points = surface.between_points(k, middle);
                if points.iter().all(|end| end.is_finite()) {
                    points
                } else {
                    whole[k]
                }
            });
            Some(format!("it has {} holes", paths.len()))
        }
        Winding::None => single(&on, &paths, &mut rectangle),
        Winding::Along(k) => belt(&on, &paths, k, face.sense, &mut rectangle)?,
        Winding::Both => Some("its boundary winds around the surface both ways".to_owned()),
    };
    if trimmed.is_some() && !holes_alone {
        for (k, range) in rectangle.iter_mut().enumerate() {
            let sag = paths.iter().map(|path| path.sag(k)).fold(0.0, f64::max);
            *range = [range[0] - sag, range[1] + sag];
        }
    }
    let rectangle = settled(&on, rectangle);
    let trimmed = trimmed.or_else(|| {
        (off_mm > 10.0 * FOLLOWS_MM).then(|| format!("its boundary lies {off_mm:.4} mm off its surface"))
    });
    if rectangle.iter().flatten().any(|x| !x.is_finite()) || rectangle.iter().any(|r| r[0] >= r[1]) {
        return Err("its boundary encloses no area".to_owned());
    }
    Ok(Outline {
        rectangle,
        trimmed,
        unknown: false,
    })
}

/// The rectangle around all loops.
fn around(paths: &[Path]) -> [[f64; 2]; 2] {
    std::array::from_fn(|k| {
        paths
            .iter()
            .map(|path| path.extent(k))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [a, b]| {
                [low.min(a), high.max(b)]
            })
    })
}

/// A face whose loops do not wind around the surface: a rectangle if it has one loop of four iso-parametric lines. Returns the
/// reason if not.
fn single(on: &Periodic<'_>, paths: &[Path], rectangle: &mut [[f64; 2]; 2]) -> Option<String> {
    let mut whole_turn = false;
    for path in paths {
        if let Some(k) = path.seam
            && let Some(period) = on.periods[k]
        {
            // The loop consists of the seam alone: the face covers a whole period.
            let low = path.extent(k)[0];
            rectangle[k] = [low, low + period];
            whole_turn = true;
        }
    }
    let [path] = paths else {
        return Some(format!("it has {} holes", paths.len().saturating_sub(1)));
    };
    for (number, edge) in path.edges.iter().enumerate() {
        if !(0..2).any(|k| constant(on, edge, k)) {
            return Some(format!(
                "its boundary's edge {} is not an iso-parametric line",
                number + 1
            ));
        }
    }
    let [u, v] = *rectangle;
    let whole = (u[1] - u[0]) * (v[1] - v[0]);
    // A notch may be smaller than any share of the area.
    let is_at_side = |edge: &Vec<[f64; 2]>| {
        (0..2).any(|k| {
            let fastest = edge.iter().map(|place| speed(on, *place, k)).fold(0.0, f64::max);
            constant(on, edge, k)
                && rectangle[k].iter().any(|side| {
                    edge.iter()
                        .all(|place| (place[k] - side).abs() * fastest <= 2.0 * FOLLOWS_MM)
                })
        })
    };
    let is_rectangle = path.edges.iter().all(is_at_side);
    if !whole_turn && (!is_rectangle || (path.area().abs() - whole).abs() > AREA_SLACK * whole) {
        return Some("its boundary is no rectangle in the surface's parameters".to_owned());
    }
    None
}

/// A face whose loops wind around the surface in parameter k: a belt between two lines, or between a line and a degenerate
/// boundary.
fn belt(
    on: &Periodic<'_>,
    paths: &[Path],
    k: usize,
    sense: f64,
    rectangle: &mut [[f64; 2]; 2],
) -> Result<Option<String>, String> {
    let across = 1 - k;
    let Some(period) = on.periods[k] else {
        return Err("its boundary winds around a surface that is not closed".to_owned());
    };
    let start = paths
        .iter()
        .find(|path| path.winding[k] != 0.0)
        .and_then(|path| path.edges.first()?.first())
        .map_or(rectangle[k][0], |place| place[k]);
    rectangle[k] = [start, start + period];
    let mut bounds = Vec::new();
    let mut trimmed = None;
    for path in paths {
        if path.winding[k] == 0.0 {
            trimmed = Some("it has holes".to_owned());
            continue;
        }
        for edge in &path.edges {
            if constant(on, edge, across) {
                bounds.push(edge[0][across]);
            } else if !constant(on, edge, k) {
                trimmed = Some("its boundary is not an iso-parametric line".to_owned());
            }
        }
    }
    let turning: Vec<_> = paths.iter().filter(|path| path.winding[k] != 0.0).collect();
    let [low, high] = rectangle[across];
    if turning.len() == 1 {
        // A single line: the face is to its left, seen against the normal of the face.
        let left = turning[0].winding[k] * sense * if k == 0 { 1.0 } else { -1.0 };
        let toward = usize::from(left > 0.0);
        // The point in which it meets its axis there, or at all, or else its last line.
        let points = on.surface.between_points(across, 0.5 * (low + high));
        let end = [points[toward], points[1 - toward]]
            .into_iter()
            .find(|end| end.is_finite())
            .or(on.domain[across].map(|range| range[toward]));
        let Some(end) = end else {
            return Err("its boundary leaves it unbounded".to_owned());
        };
        rectangle[across] = [low.min(end), high.max(end)];
    }
    if trimmed.is_none() && turning.len() > 2 {
        trimmed = Some(format!("it has {} boundaries", turning.len()));
    }
    // Further loops inside of the belt.
    let [low, high] = rectangle[across];
    let ends = |bound: &f64| {
        let slack = FOLLOWS_MM / speed(on, [start, *bound], across).max(f64::MIN_POSITIVE);
        (bound - low).abs() <= slack || (bound - high).abs() <= slack
    };
    if trimmed.is_none() && !bounds.iter().all(ends) {
        trimmed = Some("its boundary is no rectangle in the surface's parameters".to_owned());
    }
    Ok(trimmed)
}

/// The rectangle within the domain of the surface; ends that differ from those of the domain by rounding are set to them.
fn settled(on: &Periodic<'_>, rectangle: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let middle = rectangle.map(|[low, high]| 0.5 * (low + high));
    std::array::from_fn(|k| {
        let [mut low, mut high] = rectangle[k];
        let slack = FOLLOWS_MM / speed(on, middle, k).max(f64::MIN_POSITIVE);
        let (domain, period) = (on.domain[k], on.periods[k]);
        if let (Some(range), Some(period)) = (domain, period) {
            // Shifted by whole periods, so that it begins within the domain.
            let turns = ((low - range[0] + slack.min(0.25 * period)) / period).floor();
            (low, high) = (low - turns * period, high - turns * period);
            if (high - low - period).abs() <= slack || high - low > period {
                high = low + period;
            }
        }
        let snap = |x: f64, range: [f64; 2]| {
            let mut ends = range.into_iter();
            ends.find(|end| (x - end).abs() <= slack).unwrap_or(x)
        };
        if let Some(range) = domain {
            (low, high) = (snap(low, range), snap(high, range));
            if period.is_none() {
                (low, high) = (low.max(range[0]), high.min(range[1]));
            }
        }
        // Not over a point in which it meets its axis.
        let points = on.surface.between_points(k, 0.5 * (low + high));
        (low, high) = (
            snap(low, points).max(points[0]),
            snap(high, points).min(points[1]),
        );
        let near = 0.1 * (high - low);
        for end in [&mut low, &mut high] {
            let slack = KNOT_MM / FOLLOWS_MM * slack;
            let knots = joints(on.surface, k, [*end - near, *end + near]);
            let nearest = knots
                .iter()
                .map(|(knot, _)| *knot)
                .min_by(|a, b| (a - *end).abs().total_cmp(&(b - *end).abs()));
            *end = nearest
                .filter(|knot| (knot - *end).abs() <= slack)
                .unwrap_or(*end);
        }
        [low, high]
    })
}
