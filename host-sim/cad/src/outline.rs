//! The boundary of a face in the parameters of its surface: a rectangle, or a trimmed region with its bounding rectangle.

use super::exact::joints;
use super::surface::Periodic;
use super::{Boundary, Edge, Face};

/// Tolerance of an edge on an iso-parametric line, mm. Edges in files are accurate to 1e-3 to 1e-7 mm.
const FOLLOWS_MM: f64 = 1e-3;
/// Tolerance of an end of the rectangle on a knot, mm: a patch that is narrower is rounding of the file.
const KNOT_MM: f64 = 1e-4;
/// A derivative shorter than this, times its range, is that of a degenerate boundary, mm.
const POLE_MM: f64 = 1e-3;
/// Two parameters are opposite to one another if they are half a period apart within this share of it.
const OPPOSITE: f64 = 1e-6;
/// Two loops around a surface are at the same place within this share of a period.
const SAME: f64 = 1e-9;
/// A loop goes straight back from a pole if it leaves it within this share of the period of where it came from.
const BACK: f64 = 1e-6;
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

/// A boundary loop in parameters.
pub(super) struct Path {
    pub(super) edges: Vec<Vec<[f64; 2]>>,
    /// Winding numbers in u and in v.
    pub(super) winding: [f64; 2],
    /// The loop is the seam of a surface that is closed in this parameter: it encloses all of it.
    pub(super) seam: Option<usize>,
    /// Largest distance of a boundary point from the surface, mm.
    pub(super) off_mm: f64,
}

/// How the loops of a face wind around its surface.
pub(super) enum Winding {
    None,
    /// In this parameter.
    Along(usize),
    Both,
}

pub(super) fn winding(paths: &[Path]) -> Winding {
    match [0, 1].map(|k| paths.iter().any(|path| path.winding[k] != 0.0)) {
        [false, false] => Winding::None,
        [true, false] => Winding::Along(0),
        [false, true] => Winding::Along(1),
        [true, true] => Winding::Both,
    }
}

/// The loops of a face in parameters. Those that do not wind around a closed surface lie in the turn of the largest one.
pub(super) fn paths(on: &Periodic<'_>, loops: &[Vec<Edge>], sense: f64) -> Vec<Path> {
    let mut paths: Vec<Path> = loops.iter().map(|edges| trace(on, edges, sense)).collect();
    let periods = on.periods;
    for path in &mut paths {
        path.seam = (0..2).find(|k| {
            let [low, high] = path.extent(*k);
            let fastest = path
                .edges
                .iter()
                .flatten()
                .map(|place| speed(on, *place, *k))
                .fold(0.0, f64::max);
            periods[*k].is_some() && path.winding == [0.0; 2] && (high - low) * fastest <= FOLLOWS_MM
        });
    }
    let middle = |path: &Path, k: usize| path.extent(k).iter().sum::<f64>() * 0.5;
    let Some(largest) = (0..paths.len()).max_by(|a, b| {
        let size = |path: &Path| {
            if path.seam.is_some() {
                f64::INFINITY
            } else {
                path.area().abs()
            }
        };
        size(&paths[*a]).total_cmp(&size(&paths[*b]))
    }) else {
        return paths;
    };
    for (k, period) in periods.into_iter().enumerate() {
        let Some(period) = period else { continue };
        let home = middle(&paths[largest], k)
            + if paths[largest].seam == Some(k) {
                0.5 * period
            } else {
                0.0
            };
        for (index, path) in paths.iter_mut().enumerate() {
            let turns = ((home - middle(path, k)) / period).round();
            if index != largest && path.winding[k] == 0.0 && turns != 0.0 {
                path.shift(k, turns * period);
            }
        }
    }
    in_order(on, &mut paths, sense);
    paths
}

/// Of two loops around a surface that is closed both ways, the face is between that which has it on its upper side and the next of the other: maybe more than half of the
/// surface. The upper one is moved there by whole periods, and the others into this range.
fn in_order(on: &Periodic<'_>, paths: &mut [Path], sense: f64) {
    for k in 0..2 {
        let across = 1 - k;
        let (Some(_), Some(period)) = (on.periods[k], on.periods[across]) else {
            continue;
        };
        let above = |path: &Path| path.winding[k] * sense * if k == 0 { 1.0 } else { -1.0 };
        let rings: Vec<usize> = (0..paths.len())
            .filter(|index| paths[*index].winding[k] != 0.0 && paths[*index].winding[across] == 0.0)
            .collect();
        let [one, other] = rings[..] else { continue };
        let (lower, upper) = match [one, other].map(|index| above(&paths[index]) > 0.0) {
            [true, false] => (one, other),
            [false, true] => (other, one),
            _ => continue,
        };
        let middle = |path: &Path| path.extent(across).iter().sum::<f64>() * 0.5;
        let from = middle(&paths[lower]);
        for (index, path) in paths.iter_mut().enumerate() {
            let apart = middle(path) - from;
            let mut way = apart.rem_euclid(period);
            if index == upper && way < SAME * period {
                way += period;
            }
            if index != lower && path.winding[across] == 0.0 {
                path.shift(across, way - apart);
            }
        }
    }
}

/// Whether the loops of a face on a closed surface are its holes alone: the face is on the outer side of the largest.
pub(super) fn complementary(on: &Periodic<'_>, paths: &[Path], sense: f64) -> bool {
    let (periods, domain) = (on.periods, on.domain);
    let closed = (0..2).any(|k| periods[k].is_some()) && domain.iter().all(Option::is_some);
    let largest = paths
        .iter()
        .map(Path::area)
        .max_by(|a, b| a.abs().total_cmp(&b.abs()));
    closed && paths.iter().all(|path| path.seam.is_none()) && largest.is_some_and(|area| area * sense < 0.0)
}

impl Path {
    fn shift(&mut self, k: usize, by: f64) {
        let places = self.edges.iter_mut().flatten();
        places.for_each(|place| place[k] += by);
    }

    fn extent(&self, k: usize) -> [f64; 2] {
        let values = self.edges.iter().flatten().map(|place| place[k]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    }

    /// Bound on the distance of a curved edge from its points: twice the sagitta of an arc through three of them.
    fn sag(&self, k: usize) -> f64 {
        let triples = self.edges.iter().flat_map(|edge| edge.windows(3));
        let bend = triples.map(|t| (t[0][k] - 2.0 * t[1][k] + t[2][k]).abs());
        0.25 * bend.fold(0.0, f64::max)
    }

    /// Enclosed area in parameters, by the trapezoid rule.
    fn area(&self) -> f64 {
        let places: Vec<[f64; 2]> = self.edges.iter().flatten().copied().collect();
        let next = places.iter().cycle().skip(1);
        let pieces = places.iter().zip(next);
        pieces.map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum()
    }
}

/// Length of the derivative by parameter k, mm per unit.
fn speed(on: &Periodic<'_>, place: [f64; 2], k: usize) -> f64 {
    let at = on.at(place[0], place[1]);
    if k == 0 { at.u } else { at.v }.length()
}

/// Scale of the parameter: its period, its range, or 1.
fn reach(on: &Periodic<'_>, k: usize) -> f64 {
    let range = on.domain[k].map_or(1.0, |[low, high]| high - low);
    on.periods[k].unwrap_or(range)
}

/// Whether the line of the parameter k through a place is one point: not where the parameter is only slow there.
fn is_pole(on: &Periodic<'_>, place: [f64; 2], k: usize) -> bool {
    if speed(on, place, k) * reach(on, k) >= POLE_MM {
        return false;
    }
    let [low, high] = on.domain[k].unwrap_or([place[k] - 1.0, place[k] + 1.0]);
    let point = |at: f64| {
        let mut line = place;
        line[k] = at;
        on.at(line[0], line[1]).point
    };
    let here = point(place[k]);
    (0..=4).all(|part| here.distance(point(low + (high - low) * f64::from(part) / 4.0)) < POLE_MM)
}

/// A loop in parameters. `sense`: 1 if the face's normal is along S_u x S_v, -1 against it; the face is to the left of its loops.
fn trace(on: &Periodic<'_>, edges: &[Edge], sense: f64) -> Path {
    let (path, is_turned) = traced(on, edges, sense);
    if !is_turned || path.winding == [0.0; 2] {
        return path;
    }
    // A loop that is the wrong way round: it does not wind around the surface if it leaves its pole the other way.
    let (other, _) = traced(on, edges, -sense);
    if other.winding == [0.0; 2] { other } else { path }
}

/// A parameter of a closed surface along a loop. At a pole it is undefined: there the loop goes on along the degenerate line, so that the face is to its left.
#[derive(Clone, Copy, Default)]
struct Turning {
    /// The parameter at the last place off the pole, and at the one before; the other parameter there.
    last: Option<[f64; 2]>,
    before: Option<f64>,
    /// The other parameter at the pole, where the loop is at one.
    pole: Option<f64>,
}

impl Turning {
    /// The parameter at a place off the pole. `direction`: of the degenerate line at the upper end of the other parameter.
    fn follow(&mut self, raw: f64, across: f64, period: Option<f64>, direction: f64) -> f64 {
        let value = match (self.last, period) {
            (Some([last, beside]), Some(period)) => {
                let apart = raw - last;
                // From one side to the opposite one the line leads through the pole.
                let is_opposite = (apart.abs() - 0.5 * period).abs() < OPPOSITE * period;
                let toward = match (self.pole, self.before) {
                    (Some(pole), _) => pole - beside,
                    (None, Some(before)) if is_opposite => beside - before,
                    _ => 0.0,
                };
                if toward == 0.0 {
                    raw
                } else {
                    last + along_pole(apart, period, direction * toward.signum())
                }
            }
            _ => raw,
        };
        self.before = self.last.map(|[_, beside]| beside);
        self.last = Some([value, across]);
        self.pole = None;
        value
    }
}

/// The way along a degenerate line in this direction by a difference of parameters; 0 where the loop goes straight back.
fn along_pole(apart: f64, period: f64, direction: f64) -> f64 {
    let way = (direction * apart).rem_euclid(period);
    let slack = BACK * period;
    if way < slack || period - way < slack {
        let turns = (apart / period).round();
        apart - turns * period
    } else {
        direction * way
    }
}

/// A loop in parameters, and whether it is on a pole somewhere.
fn traced(on: &Periodic<'_>, edges: &[Edge], sense: f64) -> (Path, bool) {
    let periods = on.periods;
    let mut path = Path {
        edges: Vec::new(),
        winding: [0.0; 2],
        seam: None,
        off_mm: 0.0,
    };
    // At the upper end of v the face is to the left of -u, at that of u to the left of v.
    let directions = [-sense, sense];
    let mut turnings = [Turning::default(); 2];
    let mut near: Option<[f64; 2]> = None;
    // The first place off the pole, and whether the loop begins on it.
    let mut firsts: [Option<[f64; 2]>; 2] = [None; 2];
    let mut begins_on_pole = [None; 2];
    let mut is_polar = false;
    for edge in edges {
        let mut places: Vec<[f64; 2]> = Vec::with_capacity(edge.len());
        let mut polar = Vec::with_capacity(edge.len());
        for point in edge {
            let (mut place, off_mm) = on.invert(*point, near);
            path.off_mm = path.off_mm.max(off_mm);
            let on_pole = [0, 1].map(|k| is_pole(on, place, k));
            let raw = place;
            for k in 0..2 {
                let turning = &mut turnings[k];
                if on_pole[k] {
                    is_polar = true;
                    if turning.last.is_none() {
                        begins_on_pole[k] = Some(raw[1 - k]);
                    } else {
                        turning.pole = Some(raw[1 - k]);
                    }
                    place[k] = near.map_or(raw[k], |near| near[k]);
                } else {
                    place[k] = turning.follow(raw[k], raw[1 - k], periods[k], directions[k]);
                    firsts[k].get_or_insert([place[k], raw[1 - k]]);
                }
            }
            near = Some(place);
            polar.push(on_pole);
            places.push(place);
        }
        for k in 0..2 {
            off_the_pole(&mut places, &polar, k);
        }
        near = places.last().copied().or(near);
        path.edges.push(places);
    }
    let first = path.edges.iter().flatten().next().copied();
    if let (Some(first), Some(last)) = (first, near) {
        path.winding = std::array::from_fn(|k| {
            let Some(period) = periods[k] else {
                return 0.0;
            };
            // Where the loop ends on a pole it goes on to its first place off it.
            let pole = begins_on_pole[k].or(turnings[k].pole);
            let (start, end) = match (pole, firsts[k]) {
                (Some(_), Some([start, beside])) => {
                    turnings[k].pole = pole;
                    (
                        start,
                        turnings[k].follow(start, beside, Some(period), directions[k]),
                    )
                }
                _ => (first[k], last[k]),
            };
            ((end - start) / period).round()
        });
    }
    (path, is_polar)
}

/// At a degenerate point the parameter k is undefined; takes that of the nearest other point of the edge.
fn off_the_pole(places: &mut [[f64; 2]], polar: &[[bool; 2]], k: usize) {
    let beside: Vec<usize> = (0..places.len()).filter(|index| !polar[*index][k]).collect();
    for index in (0..places.len()).filter(|index| polar[*index][k]) {
        if let Some(nearest) = beside.iter().min_by_key(|other| other.abs_diff(index)) {
            places[index][k] = places[*nearest][k];
        }
    }
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
