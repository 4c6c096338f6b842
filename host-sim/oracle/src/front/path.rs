//! Segments of a pass, its length and its bends.

use super::super::contact::OracleError;
use super::spline::Spline;
use super::strip::Strip;
use super::{FrontPart, Fronts};

/// Places a station interval at which the end line is looked for and bends are measured.
const PLACES: usize = 8;
/// Halvings for the place at which a pass meets the end line.
const HALVINGS: usize = 50;
/// Nodes and weights of Gauss' rule of three points on [-1, 1].
const GAUSS: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];
/// Quadrature intervals of a station interval.
const PIECES: usize = 4;
/// Fewest pieces between even places of a segment.
const PLACES_MIN: usize = 8;
/// Most pieces between even places of a segment.
const PLACES_MAX: usize = 20_000;
/// A segment shorter than this is none, path share.
const SEGMENT_MIN: f64 = 1e-9;
/// A pass this close to the end line lies on it, side share.
const ON_END_LINE: f64 = 1e-12;

/// A part of a pass on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Path shares of its ends.
    pub ends: [f64; 2],
    /// Arc length, mm.
    pub length_mm: f64,
}

/// How sharply passes bend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bends {
    /// Greatest angle to the lines of constant side parameter, rad.
    pub angle_rad: f64,
    /// Least radius in the tangent plane, mm.
    pub radius_mm: f64,
    /// Greatest |d ln(ds/dx)/ds|, 1/mm: relative change of the speed of the parametrisation over the path.
    pub stretch_per_mm: f64,
    /// Part, pass and path share of the greatest stretch.
    pub place: (usize, usize, f64),
}

/// Places in each interval of the stations.
fn places(spline: &Spline, count: usize) -> impl Iterator<Item = f64> + '_ {
    let x = spline.stations();
    x.windows(2)
        .flat_map(move |pair| {
            (0..count).map(move |k| pair[0] + (pair[1] - pair[0]) * k as f64 / count as f64)
        })
        .chain(x.last().copied())
}

/// Intervals of the path share in which the pass is on the surface.
pub(super) fn inside(pass: &Spline) -> Vec<[f64; 2]> {
    let is_inside = |x: f64| pass.at(x)[0] <= 1.0 + ON_END_LINE;
    let mut found = Vec::new();
    let mut start = None;
    let mut before = 0.0;
    for x in places(pass, PLACES) {
        match (start, is_inside(x)) {
            (None, true) => {
                start = Some(if x == 0.0 {
                    0.0
                } else {
                    crossing(&is_inside, x, before)
                })
            }
            (Some(from), false) => {
                found.push([from, crossing(&is_inside, before, x)]);
                start = None;
            }
            _ => {}
        }
        before = x;
    }
    if let Some(from) = start {
        found.push([from, 1.0]);
    }
    found.retain(|[from, to]| to - from > SEGMENT_MIN);
    found
}

/// The last place inside between one inside and one outside.
fn crossing(is_inside: &impl Fn(f64) -> bool, mut inside: f64, mut outside: f64) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inside + outside);
        if is_inside(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}

impl Strip<'_> {
    /// ds/dx of a pass, mm.
    fn speed(&self, pass: &Spline, x: f64) -> Result<f64, OracleError> {
        let [y, p, _] = pass.at(x);
        Ok(self.forms(x, y)?.speed_squared(p).sqrt())
    }

    /// Arc length of a pass, mm: Gauss' rule on quarters of the station intervals.
    pub(super) fn length(&self, pass: &Spline, [from, to]: [f64; 2]) -> Result<f64, OracleError> {
        let mut ends: Vec<f64> = vec![from];
        ends.extend(places(pass, PIECES).filter(|x| *x > from && *x < to));
        ends.push(to);
        let mut sum = 0.0;
        for pair in ends.windows(2) {
            let (middle, half) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
            for (node, weight) in GAUSS {
                sum += half * weight * self.speed(pass, middle + half * node)?;
            }
        }
        Ok(sum)
    }

    /// Path shares evenly apart in arc length, ends included, at most `spacing` mm: the inverse of a table of chords.
    pub(super) fn even_places(
        &self,
        pass: &Spline,
        [from, to]: [f64; 2],
        spacing: f64,
    ) -> Result<Vec<f64>, OracleError> {
        let length = self.length(pass, [from, to])?;
        let count = ((length / spacing).ceil() as usize).clamp(PLACES_MIN, PLACES_MAX);
        let table = 4 * count;
        let mut arc = vec![0.0];
        let mut before = None;
        for k in 0..=table {
            let x = from + (to - from) * k as f64 / table as f64;
            let point = self.forms(x, pass.at(x)[0])?.point;
            if let Some(before) = before {
                arc.push(arc[arc.len() - 1] + point.distance(before));
            }
            before = Some(point);
        }
        let mut places = Vec::with_capacity(count + 1);
        let mut k = 0;
        for i in 0..=count {
            let want = arc[table] * i as f64 / count as f64;
            while k + 1 < table && arc[k + 1] < want {
                k += 1;
            }
            let step = arc[k + 1] - arc[k];
            let share = if step > 0.0 { (want - arc[k]) / step } else { 0.0 };
            places.push(from + (to - from) * (k as f64 + share.clamp(0.0, 1.0)) / table as f64);
        }
        // The first and the last one exactly.
        places[0] = from;
        places[count] = to;
        Ok(places)
    }
}

impl Fronts<'_> {
    /// Places (u, v) on each segment of each pass that is machined, evenly apart in arc length, at most `spacing` mm.
    ///
    /// # Errors
    /// Where the surface has no contact geometry.
    pub fn places(&self, spacing_mm: f64) -> Result<Vec<Vec<(f64, f64)>>, OracleError> {
        let mut all = Vec::new();
        for (number, part) in self.parts.iter().enumerate() {
            let strip = self.strip(part);
            for pass in part.passes.iter().skip(usize::from(number > 0)) {
                for [from, to] in inside(pass) {
                    let places = strip.even_places(pass, [from, to], spacing_mm)?;
                    let on_end_line = |x: f64| x > 0.0 && x < 1.0 && (x == from || x == to);
                    let place = |x: &f64| {
                        let y = pass.at(*x)[0];
                        strip.parameters(*x, if on_end_line(*x) { 1.0 } else { y.clamp(0.0, 1.0) })
                    };
                    all.push(places.iter().map(place).collect());
                }
            }
        }
        Ok(all)
    }

    /// Segments of each pass that is machined, part by part.
    ///
    /// # Errors
    /// Where the surface has no contact geometry.
    pub fn segments(&self) -> Result<Vec<Vec<Segment>>, OracleError> {
        let mut all = Vec::new();
        for (number, part) in self.parts.iter().enumerate() {
            let strip = self.strip(part);
            for pass in part.passes.iter().skip(usize::from(number > 0)) {
                let segments = inside(pass)
                    .into_iter()
                    .map(|ends| {
                        Ok(Segment {
                            ends,
                            length_mm: strip.length(pass, ends)?,
                        })
                    })
                    .collect::<Result<_, OracleError>>()?;
                all.push(segments);
            }
        }
        Ok(all)
    }

    /// How sharply the passes bend, inside the surface.
    ///
    /// # Errors
    /// Where the surface has no contact geometry.
    pub fn bends(&self) -> Result<Bends, OracleError> {
        let mut most = Bends {
            angle_rad: 0.0,
            radius_mm: f64::INFINITY,
            stretch_per_mm: 0.0,
            place: (0, 0, 0.0),
        };
        for (number, part) in self.parts.iter().enumerate() {
            self.part_bends(number, part, &mut most)?;
        }
        Ok(most)
    }

    fn part_bends(&self, number: usize, part: &FrontPart, most: &mut Bends) -> Result<(), OracleError> {
        let strip = self.strip(part);
        let last = part.passes.len() - 1;
        for (index, pass) in part.passes.iter().enumerate().take(last).skip(1) {
            for x in places(pass, PLACES) {
                let [y, p, bend] = pass.at(x);
                if y > 1.0 {
                    continue;
                }
                let at = strip.forms(x, y)?;
                let tangent = at.x + p * at.y;
                let change = at.second[0] + 2.0 * p * at.second[1] + p * p * at.second[2] + bend * at.y;
                let speed = tangent.length();
                let curvature = tangent.cross(change).dot(at.normal).abs() / speed.powi(3);
                let stretch = tangent.dot(change).abs() / speed.powi(3);
                most.angle_rad = most.angle_rad.max((p.abs() * at.area).atan2(at.e + at.f * p));
                most.radius_mm = most.radius_mm.min(1.0 / curvature.max(1e-9));
                if stretch > most.stretch_per_mm {
                    most.stretch_per_mm = stretch;
                    most.place = (number, index, x);
                }
            }
        }
        Ok(())
    }
}
