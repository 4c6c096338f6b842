//! The boundary of a face as closed polygons of its surface's parameters (even-odd rule).
//!
//! ```text
//! loops in space ──outline.rs──► points at (u, v) ──between them: interpolated, inverted, halved──► lines
//!   lines that wind around a closed surface ──belts──► closed; moved by periods into the face's rectangle, clipped there
//!   ──crossings.rs──► refused where they cross ──remap.rs──► parameters of the job's surface ──► fewest vertices
//! ```

use super::crossings::crossing;
use super::interpolation::between;
use super::loops::{Path, Winding, complementary, paths, winding};
use super::outline::Outline;
use super::remap::Remap;
use super::surface::{Periodic, Surface};
use super::{Boundary, Edge, Face};
use glam::DVec3;

/// A closed polygon: vertices `[u, v]`, without a repeated last one.
pub type Polygon = Vec<[f64; 2]>;

/// A face narrower than this is none, mm.
const NARROW_MM: f64 = 1e-6;
/// Largest gap between the ends of a loop, mm.
const GAP_MM: f64 = 0.05;
/// Largest distance of a boundary from the face's surface, mm.
const OFF_MM: f64 = 0.05;
/// Loops may cross by this much, mm: edges of files end beside their vertices.
const CROSSING_MM: f64 = 0.02;
/// Share of the tolerance for the chords between inverted points; most of the rest is for leaving vertices out.
const CHORD_SHARE: f64 = 0.1;
/// Largest number of points of a loop from which on its intervals are not halved further: a loop of a file that makes sense has a tenth of it.
const POINTS_MAX: usize = 50_000;
/// Halvings of a side of a surface between two knots.
const SIDE_HALVINGS: u32 = 12;
/// Halvings of an interval between two points of an edge.
const HALVINGS: u32 = 12;

/// A face whose boundary is not the edge of a region.
#[derive(Clone, Debug, PartialEq)]
pub struct TrimError {
    /// The reason.
    pub what: String,
}

impl From<String> for TrimError {
    fn from(what: String) -> Self {
        Self { what }
    }
}

impl From<TrimError> for String {
    fn from(error: TrimError) -> Self {
        error.what
    }
}

/// The trimmed region of a face within its rectangle, in the parameters of its surface, or in those of the exact form over a rectangle. Its polygons are
/// within the tolerance, mm, of the boundary on the surface.
///
/// # Errors
/// The boundary is not known, open, off the surface, or crosses itself.
pub fn trim(
    face: &Face,
    outline: &Outline,
    exact_over: Option<[[f64; 2]; 2]>,
    tolerance_mm: f64,
) -> Result<Vec<Polygon>, TrimError> {
    let surface = &face.surface;
    let remap = exact_over.map(|rectangle| Remap::new(surface, rectangle));
    let whole = || {
        let corners = corners(outline.rectangle);
        match &remap {
            Some(remap) => corners.into_iter().map(|place| remap.at(place)).collect(),
            None => corners,
        }
    };
    let loops = match &face.boundary {
        Boundary::Unknown(why) => return Err(format!("its boundary is unknown: {why}").into()),
        Boundary::Natural => return Ok(vec![whole()]),
        Boundary::Loops(_) if outline.trimmed.is_none() => return Ok(vec![whole()]),
        Boundary::Loops(loops) => loops,
    };
    let on = &Periodic::new(surface);
    let paths = paths(on, loops, face.sense);
    let off_mm = paths.iter().map(|path| path.off_mm).fold(0.0, f64::max);
    if off_mm > OFF_MM {
        return Err(format!("its boundary lies {off_mm:.4} mm off its surface").into());
    }
    let chord_mm = CHORD_SHARE * tolerance_mm;
    let lines: Vec<Polygon> = loops
        .iter()
        .zip(&paths)
        .map(|(edges, path)| line(on, edges, path, chord_mm, false))
        .collect();
    if lines.iter().flatten().flatten().any(|x| !x.is_finite()) {
        return Err("its boundary has no parameters".to_owned().into());
    }
    closed(on, &lines, &paths)?;
    let lines: Vec<Polygon> = lines.into_iter().map(unspiked).collect();
    let polygons = match winding(&paths) {
        Winding::None => {
            let mut polygons: Vec<Polygon> = lines.into_iter().filter(|line| line.len() > 2).collect();
            if polygons.is_empty() || seam_only(&paths) || complementary(on, &paths, face.sense) {
                polygons.push(corners(outline.rectangle));
            }
            polygons
        }
        Winding::Along(k) => belts(on, &lines, &paths, k, face.sense, outline.rectangle)?,
        Winding::Both => {
            return Err("its boundary winds around the surface both ways"
                .to_owned()
                .into());
        }
    };
    let inside = within(on, polygons, outline.rectangle);
    if inside.iter().flatten().flatten().any(|x| !x.is_finite()) {
        return Err("its boundary has no parameters".to_owned().into());
    }
    let rough: Vec<Polygon> = inside
        .iter()
        .map(|polygon| simplified(polygon, metric(on, polygon), CHORD_SHARE * tolerance_mm))
        .collect();
    if let Some(found) = crossing(on, &rough, CROSSING_MM) {
        let [x, y, z] = found.place_mm.to_array();
        return Err(format!(
            "its boundary crosses itself by {:.3} mm at [{x:.3}, {y:.3}, {z:.3}]",
            found.depth_mm
        )
        .into());
    }
    if inside.iter().all(|polygon| is_without_area(on, polygon)) {
        return Err("its boundary encloses no area".to_owned().into());
    }
    let polygons = inside.iter().map(|polygon| {
        let fine = match &remap {
            Some(remap) => remap.polygon(on, polygon, 0.1 * tolerance_mm),
            None => polygon.clone(),
        };
        let metric = metric(on, polygon);
        simplified(&fine, metric, 0.8 * tolerance_mm)
    });
    let polygons: Vec<Polygon> = polygons.filter(|polygon| polygon.len() > 2).collect();
    if polygons.is_empty() {
        return Err("its boundary encloses no area".to_owned().into());
    }
    Ok(polygons)
}

/// The boundary of a face in space, on its surface, as polylines within the tolerance, mm; empty where it cannot be traced. A face without edges ends at the sides of
/// its surface.
#[must_use]
pub fn polylines(face: &Face, tolerance_mm: f64) -> Vec<Vec<DVec3>> {
    let surface = &face.surface;
    let loops = match &face.boundary {
        Boundary::Loops(loops) => loops,
        Boundary::Natural => return sides(surface, tolerance_mm).unwrap_or_default(),
        Boundary::Unknown(_) => return Vec::new(),
    };
    let on = Periodic::new(surface);
    let paths = paths(&on, loops, face.sense);
    loops
        .iter()
        .zip(&paths)
        .map(|(edges, path)| {
            let line = line(&on, edges, path, tolerance_mm, true);
            let mut points: Vec<DVec3> = line.iter().map(|place| on.at(place[0], place[1]).point).collect();
            points.dedup();
            points
        })
        .collect()
}

/// The four sides of a bounded surface in space.
fn sides(surface: &Surface, tolerance_mm: f64) -> Option<Vec<Vec<DVec3>>> {
    let [u, v] = surface.domain();
    let domain = [u?, v?];
    let corners = corners(domain);
    let on = Periodic::new(surface);
    let at = |place: [f64; 2]| on.at(place[0], place[1]).point;
    let side = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % 4]);
        let along = k % 2;
        let mut ends = vec![a];
        let mut joints = surface.joints(along, domain[along]);
        if a[along] > b[along] {
            joints.reverse();
        }
        ends.extend(
            joints
                .into_iter()
                .map(|joint| if along == 0 { [joint, a[1]] } else { [a[0], joint] }),
        );
        ends.push(b);
        let mut points = vec![at(a)];
        for ends in ends.windows(2) {
            halved(&at, [ends[0], ends[1]], tolerance_mm, SIDE_HALVINGS, &mut points);
        }
        points.dedup();
        points
    };
    Some((0..4).map(side).collect())
}

/// Adds points of a line of (u, v) in space after its first end, with chords within the tolerance of it, mm.
fn halved(
    at: &dyn Fn([f64; 2]) -> DVec3,
    [a, b]: [[f64; 2]; 2],
    tolerance_mm: f64,
    left: u32,
    points: &mut Vec<DVec3>,
) {
    let between = |share: f64| [0, 1].map(|k| a[k] + share * (b[k] - a[k]));
    let ends = [at(a), at(b)];
    let chord = ends[1] - ends[0];
    let is_off = |share: f64| {
        let beside = at(between(share)) - ends[0];
        let on = (beside.dot(chord) / chord.length_squared()).clamp(0.0, 1.0);
        // Of a chord without a length `on` is not a number.
        beside.distance(if on.is_nan() { DVec3::ZERO } else { chord * on }) > tolerance_mm
    };
    // Once at least: an S may cross its chord.
    if left == 0 || left < SIDE_HALVINGS && ![0.25, 0.5, 0.75].into_iter().any(is_off) {
        points.push(ends[1]);
        return;
    }
    let middle = between(0.5);
    halved(at, [a, middle], tolerance_mm, left - 1, points);
    halved(at, [middle, b], tolerance_mm, left - 1, points);
}

/// Whether a polygon goes there and back: of a surface that closes without the reader's knowledge, for example.
fn is_without_area(on: &Periodic<'_>, polygon: &Polygon) -> bool {
    let [su, sv] = metric(on, polygon);
    let next = polygon.iter().cycle().skip(1);
    let (mut area, mut length) = (0.0, 0.0_f64);
    for (a, b) in polygon.iter().zip(next) {
        area += 0.5 * (a[0] * b[1] - b[0] * a[1]) * su * sv;
        length += ((b[0] - a[0]) * su).hypot((b[1] - a[1]) * sv);
    }
    area.abs() <= NARROW_MM * length
}

/// The corners of a rectangle.
fn corners([[u0, u1], [v0, v1]]: [[f64; 2]; 2]) -> Polygon {
    vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1]]
}

/// Whether a loop is the seam of a closed surface alone.
fn seam_only(paths: &[Path]) -> bool {
    paths.iter().any(|path| path.seam.is_some())
}

/// A loop as a line of parameters, its chords within the tolerance of the surface's curve, mm: the chords of (u, v), or those in space if `in_space`.
fn line(on: &Periodic<'_>, edges: &[Edge], path: &Path, chord_mm: f64, in_space: bool) -> Polygon {
    let mut out: Polygon = Vec::new();
    for (points, places) in edges.iter().zip(&path.edges) {
        let halving = Halving {
            on,
            points,
            chord_mm,
            in_space,
        };
        out.extend(places.first());
        for (index, ends) in places.windows(2).enumerate() {
            halving.between(index, [0.0, 1.0], [ends[0], ends[1]], HALVINGS, &mut out);
            out.push(ends[1]);
        }
    }
    out.dedup();
    out
}

/// The intervals of an edge, halved until they follow the surface.
struct Halving<'a> {
    on: &'a Periodic<'a>,
    points: &'a [DVec3],
    chord_mm: f64,
    in_space: bool,
}

impl Halving<'_> {
    /// Adds the points between two places of an interval, at these shares of it.
    fn between(&self, index: usize, shares: [f64; 2], ends: [[f64; 2]; 2], left: u32, out: &mut Polygon) {
        if left == 0 || out.len() >= POINTS_MAX {
            return;
        }
        let chord = |share: f64| -> [f64; 2] {
            std::array::from_fn(|k| ends[0][k] + share * (ends[1][k] - ends[0][k]))
        };
        let share = |of: f64| shares[0] + of * (shares[1] - shares[0]);
        let middle = self.place(index, share(0.5), chord(0.5));
        // The first halving of an interval also looks at its quarters: an S has its middle on the chord.
        let bent = self.off(middle, chord(0.5), ends) > self.chord_mm
            || left == HALVINGS
                && [0.25, 0.75].into_iter().any(|of| {
                    self.off(self.place(index, share(of), chord(of)), chord(of), ends) > self.chord_mm
                });
        if bent {
            self.between(index, [shares[0], share(0.5)], [ends[0], middle], left - 1, out);
            out.push(middle);
            self.between(index, [share(0.5), shares[1]], [middle, ends[1]], left - 1, out);
        }
    }

    fn place(&self, index: usize, share: f64, near: [f64; 2]) -> [f64; 2] {
        self.on.invert(between(self.points, index, share), Some(near)).0
    }

    /// Distance of the surface's point at a place from its point on the chord, across the chord, mm.
    fn off(&self, place: [f64; 2], on_chord: [f64; 2], ends: [[f64; 2]; 2]) -> f64 {
        let point = |[u, v]: [f64; 2]| self.on.at(u, v).point;
        let from = if self.in_space {
            point(ends[0])
        } else {
            point(on_chord)
        };
        let gap = point(place) - from;
        let along = (point(ends[1]) - point(ends[0])).normalize_or_zero();
        (gap - along * gap.dot(along)).length()
    }
}

/// Checks that the loops are closed on the surface.
fn closed(on: &Periodic<'_>, lines: &[Polygon], paths: &[Path]) -> Result<(), TrimError> {
    let periods = on.periods;
    for (line, path) in lines.iter().zip(paths) {
        let (Some(first), Some(last)) = (line.first(), line.last()) else {
            continue;
        };
        let back: [f64; 2] = std::array::from_fn(|k| last[k] - path.winding[k] * periods[k].unwrap_or(0.0));
        let gap_mm = on
            .at(first[0], first[1])
            .point
            .distance(on.at(back[0], back[1]).point);
        if gap_mm.is_nan() || gap_mm > GAP_MM {
            return Err(format!("a loop of its boundary is open by {gap_mm:.3} mm").into());
        }
    }
    Ok(())
}

/// A line without vertices to which it comes straight back: the seam of a closed surface, there and back.
fn unspiked(line: Polygon) -> Polygon {
    let mut out: Polygon = Vec::with_capacity(line.len());
    let same = |a: [f64; 2], b: [f64; 2]| (0..2).all(|k| (a[k] - b[k]).abs() <= 1e-9 * (1.0 + a[k].abs()));
    for place in line {
        if out.last().is_some_and(|last| same(*last, place)) {
            continue;
        }
        if out.len() >= 2 && same(out[out.len() - 2], place) {
            out.pop();
            continue;
        }
        out.push(place);
    }
    while out.len() > 1 && same(out[0], out[out.len() - 1]) {
        out.pop();
    }
    out
}

/// Polygons of a face whose loops wind around the surface in parameter k.
fn belts(
    on: &Periodic<'_>,
    lines: &[Polygon],
    paths: &[Path],
    k: usize,
    sense: f64,
    rectangle: [[f64; 2]; 2],
) -> Result<Vec<Polygon>, TrimError> {
    let Some(period) = on.periods[k] else {
        return Err("its boundary winds around a surface that is not closed"
            .to_owned()
            .into());
    };
    let ([start, end], [low, high]) = (rectangle[k], rectangle[1 - k]);
    let mut polygons = Vec::new();
    let mut around = Vec::new();
    let mut side = 0.0;
    for (line, path) in lines.iter().zip(paths) {
        if path.winding[k] == 0.0 {
            polygons.push(line.clone());
            continue;
        }
        if path.winding[k].abs() != 1.0 {
            return Err("its boundary winds around the surface more than once"
                .to_owned()
                .into());
        }
        side = path.winding[k] * sense * if k == 0 { 1.0 } else { -1.0 };
        around.push(unrolled(line, path.winding[k], k, period, [start, end]));
    }
    let place = |t: f64, across: f64| if k == 0 { [t, across] } else { [across, t] };
    match around.as_slice() {
        [only] => {
            // The rectangle begins within the domain, the line where its points were found.
            let middle = |[low, high]: [f64; 2]| 0.5 * (low + high);
            let turns = on.periods[1 - k].map_or(0.0, |period| {
                let apart = middle(extent(only, 1 - k)) - middle([low, high]);
                period * (apart / period).round()
            });
            let across = turns + if side > 0.0 { high } else { low };
            let mut polygon = only.clone();
            polygon.extend([place(end, across), place(start, across)]);
            polygons.push(polygon);
        }
        [one, other] => {
            let mut polygon = one.clone();
            polygon.extend(other.iter().rev());
            polygons.push(polygon);
        }
        more => return Err(format!("{} loops of its boundary wind around the surface", more.len()).into()),
    }
    polygons.retain(|polygon| polygon.len() > 2);
    Ok(polygons)
}

/// One turn of a line that winds around the surface once, from `start` to `end` of parameter k.
fn unrolled(line: &Polygon, winding: f64, k: usize, period: f64, [start, end]: [f64; 2]) -> Polygon {
    let mut line = line.clone();
    if winding < 0.0 {
        line.reverse();
    }
    let shifted = |turns: f64| {
        line.iter().map(move |place| {
            let mut place = *place;
            place[k] += turns * period;
            place
        })
    };
    let first = ((start - line[0][k]) / period).floor();
    let turns: Polygon = (-1..3)
        .flat_map(|turn| shifted(first + f64::from(turn)))
        .collect();
    // From its last way over the start to its first way over the end after that.
    let crosses = |t: f64| move |pair: &[[f64; 2]]| pair[0][k] < t && pair[1][k] >= t;
    let at = |pair: &[[f64; 2]], t: f64| -> [f64; 2] {
        let share = (t - pair[0][k]) / (pair[1][k] - pair[0][k]);
        let mut place: [f64; 2] = std::array::from_fn(|j| pair[0][j] + share * (pair[1][j] - pair[0][j]));
        place[k] = t;
        place
    };
    let from = turns.windows(2).rposition(crosses(start)).unwrap_or(0);
    let to = turns[from..]
        .windows(2)
        .position(crosses(end))
        .map_or(turns.len() - 2, |to| from + to);
    let mut out = vec![at(&turns[from..from + 2], start)];
    out.extend(
        turns[from + 1..=to]
            .iter()
            .filter(|place| place[k] > start && place[k] < end),
    );
    out.push(at(&turns[to..to + 2], end));
    out
}

/// Polygons moved by whole periods into the rectangle, and clipped to it.
fn within(on: &Periodic<'_>, polygons: Vec<Polygon>, rectangle: [[f64; 2]; 2]) -> Vec<Polygon> {
    let mut all = polygons;
    for (k, period) in on.periods.into_iter().enumerate() {
        let Some(period) = period else { continue };
        let [low, high] = rectangle[k];
        let slack = 1e-9 * period;
        let mut moved = Vec::new();
        for polygon in all {
            let [least, most] = extent(&polygon, k);
            let turns = ((0.5 * (low + high) - 0.5 * (least + most)) / period).round();
            for more in [0.0, -1.0, 1.0] {
                let by = (turns + more) * period;
                if most + by <= low + slack || least + by >= high - slack {
                    continue;
                }
                moved.push(
                    polygon
                        .iter()
                        .map(|place| {
                            let mut place = *place;
                            place[k] += by;
                            place
                        })
                        .collect(),
                );
            }
        }
        all = moved;
    }
    for (k, [low, high]) in rectangle.into_iter().enumerate() {
        for (end, sign) in [(low, 1.0), (high, -1.0)] {
            all = all.iter().map(|polygon| clipped(polygon, k, end, sign)).collect();
        }
    }
    all.retain(|polygon| polygon.len() > 2);
    all
}

fn extent(polygon: &Polygon, k: usize) -> [f64; 2] {
    let values = polygon.iter().map(|place| place[k]);
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

/// The part of a polygon on one side of a line of constant parameter k (Sutherland and Hodgman, 1974): pieces remain joined along the line, where
/// their edges cancel in the even-odd rule.
pub(super) fn clipped(polygon: &Polygon, k: usize, end: f64, sign: f64) -> Polygon {
    let is_in = |place: &[f64; 2]| sign * (place[k] - end) >= 0.0;
    if polygon.iter().all(is_in) {
        return polygon.clone();
    }
    let mut out = Vec::with_capacity(polygon.len() + 2);
    for (index, place) in polygon.iter().enumerate() {
        let next = &polygon[(index + 1) % polygon.len()];
        if is_in(place) {
            out.push(*place);
        }
        if is_in(place) != is_in(next) {
            let share = (end - place[k]) / (next[k] - place[k]);
            let mut cut: [f64; 2] = std::array::from_fn(|j| place[j] + share * (next[j] - place[j]));
            cut[k] = end;
            out.push(cut);
        }
    }
    out.dedup();
    out
}

/// Largest lengths of the derivatives by u and v along a polygon, mm per unit.
fn metric(on: &Periodic<'_>, polygon: &Polygon) -> [f64; 2] {
    let next = polygon.iter().cycle().skip(1);
    // Middles of edges, too: all corners may be poles.
    let places = polygon
        .iter()
        .zip(next)
        .flat_map(|(a, b)| [*a, [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]]);
    places.fold([f64::MIN_POSITIVE; 2], |[a, b], place| {
        let at = on.at(place[0], place[1]);
        [a.max(at.u.length()), b.max(at.v.length())]
    })
}

/// A polygon with the fewest vertices within the tolerance, mm (Ramer, 1972; Douglas and Peucker, 1973).
pub(super) fn simplified(polygon: &Polygon, metric: [f64; 2], tolerance_mm: f64) -> Polygon {
    let count = polygon.len();
    if count < 4 {
        return polygon.clone();
    }
    let place = |index: usize| -> [f64; 2] {
        let [u, v] = polygon[index % count];
        [u * metric[0], v * metric[1]]
    };
    let square = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    let far = (0..count)
        .max_by(|a, b| square(place(0), place(*a)).total_cmp(&square(place(0), place(*b))))
        .unwrap_or(0);
    let mut kept = vec![false; count];
    (kept[0], kept[far]) = (true, true);
    let mut open = vec![(0, far), (far, count)];
    while let Some((from, to)) = open.pop() {
        let (a, b) = (place(from), place(to));
        let d = [b[0] - a[0], b[1] - a[1]];
        let length = d[0] * d[0] + d[1] * d[1];
        let mut worst = (tolerance_mm * tolerance_mm, None);
        for index in from + 1..to {
            let p = place(index);
            let share = if length > 0.0 {
                (((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / length).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let off = square(p, [a[0] + share * d[0], a[1] + share * d[1]]);
            if off > worst.0 {
                worst = (off, Some(index));
            }
        }
        if let Some(index) = worst.1 {
            kept[index] = true;
            open.extend([(from, index), (index, to)]);
        }
    }
    let kept = polygon.iter().zip(kept).filter(|(_, kept)| *kept);
    kept.map(|(place, _)| *place).collect()
}
