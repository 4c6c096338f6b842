//! The loops of a face in the parameters of its surface: along seams, over whole periods and through points where a line of parameters is one point.

use super::Edge;
use super::outline::FOLLOWS_MM;
use super::surface::Periodic;

/// A derivative shorter than this, times its range, is that of a degenerate boundary, mm.
const POLE_MM: f64 = 1e-3;
/// Two parameters are opposite to one another if they are half a period apart within this share of it.
const OPPOSITE: f64 = 1e-6;
/// Two loops around a surface are at the same place within this share of a period.
const SAME: f64 = 1e-9;
/// A loop goes straight back from a pole if it leaves it within this share of the period of where it came from.
const BACK: f64 = 1e-6;

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

    pub(super) fn extent(&self, k: usize) -> [f64; 2] {
        let values = self.edges.iter().flatten().map(|place| place[k]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    }

    /// Bound on the distance of a curved edge from its points: twice the sagitta of an arc through three of them.
    pub(super) fn sag(&self, k: usize) -> f64 {
        let triples = self.edges.iter().flat_map(|edge| edge.windows(3));
        let bend = triples.map(|t| (t[0][k] - 2.0 * t[1][k] + t[2][k]).abs());
        0.25 * bend.fold(0.0, f64::max)
    }

    /// Enclosed area in parameters, by the trapezoid rule.
    pub(super) fn area(&self) -> f64 {
        let places: Vec<[f64; 2]> = self.edges.iter().flatten().copied().collect();
        let next = places.iter().cycle().skip(1);
        let pieces = places.iter().zip(next);
        pieces.map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum()
    }
}

/// Length of the derivative by parameter k, mm per unit.
pub(super) fn speed(on: &Periodic<'_>, place: [f64; 2], k: usize) -> f64 {
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
