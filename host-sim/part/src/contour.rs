//! The boundary of a set of places that is given by a predicate: marching squares on a grid, vertices bisected to the boundary, chords halved until they follow it, then
//! pulled in and reduced to the fewest vertices that stay inside. Where a grid cell with its corners inside has places outside, a grid twice as fine is taken.

use oracle::Surface;
use rayon::prelude::*;
use std::collections::HashMap;

/// Bisections of a vertex between a place inside and one outside: a grid of 0.2 mm to 0.05 um.
const BISECTIONS: usize = 12;
/// Halvings of a chord.
const HALVINGS: u32 = 7;
/// Bisections of an inset: to a thousandth of it.
const MOVE_BISECTIONS: usize = 10;
/// Largest factor by which a place is moved farther in (u, v) than its derivatives give.
const FARTHER_MAX: f64 = 64.0;
/// Least number of lines of the grid between two sides.
const LINES_MIN: usize = 8;
/// Largest number of places of the grid.
const PLACES_MAX: usize = 4_000_000;

type Place = [f64; 2];

/// Requirements on the contour.
#[derive(Clone, Copy, Debug)]
pub struct Precision {
    /// Spacing of the grid, mm.
    pub grid_mm: f64,
    /// Distance of the contour's chords from the boundary, mm.
    pub chord_mm: f64,
    /// How far the contour is pulled in, mm.
    pub inset_mm: f64,
    /// How much farther in it may be for fewer vertices, mm.
    pub simplify_mm: f64,
}

/// A stretch of a parameter between two knots.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Its ends.
    pub range: [f64; 2],
    /// Length along which the grid has lines, mm: that of the surface or of the ball's centre, at most.
    pub length_mm: f64,
}

/// A set of places within a rectangle of (u, v).
pub struct Set<'a> {
    /// The rectangle.
    pub rectangle: [[f64; 2]; 2],
    /// Which of its sides are cuts: contours are pulled in from them; on the others they stay.
    pub cuts: [[bool; 2]; 2],
    /// Lengths of the derivatives by u and v, mm: at most.
    pub metric: [f64; 2],
    /// Where the places are in space.
    pub surface: &'a Surface,
    /// The rectangle's spans in u and v: the lines of the grid are evenly spaced within each.
    pub spans: [Vec<Span>; 2],
    /// Whether a place is in it.
    pub holds: &'a (dyn Fn(Place) -> bool + Sync),
    /// Whether a place is deep enough inside: a grid cell with four such corners lies inside as a whole.
    pub is_sure: &'a (dyn Fn(Place) -> bool + Sync),
}

/// The grid with its answers; one line of places beyond each side is outside.
struct Grid {
    counts: [usize; 2],
    /// Parameters of its lines.
    lines: [Vec<f64>; 2],
    holds: Vec<bool>,
    surely: Vec<bool>,
}

impl Grid {
    fn index(&self, i: usize, j: usize) -> usize {
        j * (self.counts[0] + 3) + i
    }

    fn at(&self, i: usize, j: usize) -> bool {
        self.holds[self.index(i, j)]
    }

    /// Place of a grid point, whose lines beyond the sides are at the sides.
    fn place(&self, i: usize, j: usize) -> Place {
        let at = |k: usize, index: usize| self.lines[k][index.clamp(1, self.counts[k] + 1) - 1];
        [at(0, i), at(1, j)]
    }
}

/// Lines at most a spacing apart.
fn lines(spans: &[Span], spacing: f64) -> Vec<f64> {
    let least = LINES_MIN.div_ceil(spans.len().max(1));
    let mut lines: Vec<f64> = spans.first().map(|span| span.range[0]).into_iter().collect();
    for Span {
        range: [low, high],
        length_mm,
    } in spans
    {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most a few million"
        )]
        let count = ((length_mm / spacing).ceil() as usize).clamp(least, PLACES_MAX);
        lines.extend((1..count).map(|index| low + (high - low) * index as f64 / count as f64));
        lines.push(*high);
    }
    lines
}

impl Set<'_> {
    fn grid(&self, spacing: f64) -> Grid {
        let count = |k: usize| -> f64 {
            let spans = self.spans[k].iter();
            spans.map(|span| (span.length_mm / spacing).ceil()).sum()
        };
        let spacing = spacing * (count(0) * count(1) / PLACES_MAX as f64).max(1.0).sqrt();
        let lines = [0, 1].map(|k| lines(&self.spans[k], spacing));
        let counts = [0, 1].map(|k| lines[k].len() - 1);
        let mut grid = Grid {
            counts,
            lines,
            holds: vec![false; (counts[0] + 3) * (counts[1] + 3)],
            surely: vec![false; (counts[0] + 3) * (counts[1] + 3)],
        };
        let width = counts[0] + 3;
        let mut holds = std::mem::take(&mut grid.holds);
        let mut surely = std::mem::take(&mut grid.surely);
        let rows = holds.par_chunks_mut(width).zip(surely.par_chunks_mut(width));
        rows.enumerate().for_each(|(j, (holds, surely))| {
            if j == 0 || j == counts[1] + 2 {
                return;
            }
            for i in 1..counts[0] + 2 {
                let place = grid.place(i, j);
                holds[i] = (self.holds)(place);
                surely[i] = holds[i] && (self.is_sure)(place);
            }
        });
        (grid.holds, grid.surely) = (holds, surely);
        grid
    }

    /// Whether a cell whose corners are in the set has a place outside: its middle, or that of a side.
    fn misses(&self, grid: &Grid) -> bool {
        let [nu, nv] = grid.counts;
        (1..=nv).into_par_iter().any(|j| {
            (1..=nu).any(|i| {
                let corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)];
                if !corners.iter().all(|(i, j)| grid.at(*i, *j))
                    || corners.iter().all(|(i, j)| grid.surely[grid.index(*i, *j)])
                {
                    return false;
                }
                let ([u0, v0], [u1, v1]) = (grid.place(i, j), grid.place(i + 1, j + 1));
                let [u, v] = [0.5 * (u0 + u1), 0.5 * (v0 + v1)];
                let middles = [[u, v], [u, v0], [u, v1], [u0, v], [u1, v]];
                middles.into_iter().any(|place| !(self.holds)(place))
            })
        })
    }

    /// The place nearest to the boundary on the inner side.
    fn bisected(&self, mut inner: Place, mut outer: Place) -> Place {
        if inner == outer {
            return inner;
        }
        for _ in 0..BISECTIONS {
            let middle = [0.5 * (inner[0] + outer[0]), 0.5 * (inner[1] + outer[1])];
            if (self.holds)(middle) {
                inner = middle;
            } else {
                outer = middle;
            }
        }
        inner
    }

    fn length(&self, a: Place, b: Place) -> f64 {
        ((b[0] - a[0]) * self.metric[0]).hypot((b[1] - a[1]) * self.metric[1])
    }

    /// The metric at a place: a short span has another one than a long one.
    fn metric_at(&self, [u, v]: Place) -> [f64; 2] {
        let at = self.surface.at(u, v);
        let lengths = [at.u.length(), at.v.length()];
        std::array::from_fn(|k| lengths[k].clamp(self.metric[k] / FARTHER_MAX, self.metric[k]))
    }

    /// A place moved to the left of the direction from a to b, mm.
    fn beside(&self, from: Place, a: Place, b: Place, by: f64) -> Place {
        let metric = self.metric_at(from);
        let (du, dv) = ((b[0] - a[0]) * metric[0], (b[1] - a[1]) * metric[1]);
        let length = du.hypot(dv).max(f64::MIN_POSITIVE);
        let moved = [
            from[0] - by * dv / length / metric[0],
            from[1] + by * du / length / metric[1],
        ];
        std::array::from_fn(|k| moved[k].clamp(self.rectangle[k][0], self.rectangle[k][1]))
    }

    /// Closed polygons around the set, inside of it; the set is on their left.
    #[must_use]
    pub fn contours(&self, precision: &Precision) -> Vec<Vec<Place>> {
        let mut step = precision.grid_mm;
        let mut grid = self.grid(step);
        // Once is enough: a quarter of what is between places at the whole spacing is between those at half of it.
        if self.misses(&grid) {
            step *= 0.5;
            grid = self.grid(step);
        }
        let loops = self.marched(&grid);
        loops
            .into_par_iter()
            .filter_map(|rough| {
                let mut fine = Vec::new();
                for (index, a) in rough.iter().enumerate() {
                    fine.push(*a);
                    self.chord(
                        *a,
                        rough[(index + 1) % rough.len()],
                        step,
                        precision.chord_mm,
                        HALVINGS,
                        &mut fine,
                    );
                }
                fine.dedup();
                let around_set = self.area(&fine) > 0.0;
                let mut pulled = self.pulled_in(&fine, precision.inset_mm);
                if around_set {
                    // Where the set is narrower than two insets, they went through it and beyond its other side.
                    pulled.retain(|place| (self.holds)(*place));
                }
                let simple = without_spikes(self.simplified(&pulled, precision));
                let area = self.area(&simple);
                let is_left =
                    (area > 0.0) == around_set && area.abs() > precision.inset_mm * precision.grid_mm;
                (simple.len() > 2 && is_left).then_some(simple)
            })
            .collect()
    }

    /// Area, mm2 by the metric, positive for a polygon with the set inside of it.
    fn area(&self, polygon: &[Place]) -> f64 {
        let next = polygon.iter().cycle().skip(1);
        let sum: f64 = polygon
            .iter()
            .zip(next)
            .map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1]))
            .sum();
        sum * self.metric[0] * self.metric[1]
    }

    /// The loops through the bisected edges of the grid, the set on their left.
    fn marched(&self, grid: &Grid) -> Vec<Vec<Place>> {
        let [nu, nv] = grid.counts;
        let width = nu + 3;
        // Edges of the grid by their first place: 2 index along u, 2 index + 1 along v.
        let mut next: HashMap<usize, usize> = HashMap::new();
        let mut starts = Vec::new();
        for j in 0..nv + 2 {
            for i in 0..nu + 2 {
                let corners = [
                    grid.at(i, j),
                    grid.at(i + 1, j),
                    grid.at(i + 1, j + 1),
                    grid.at(i, j + 1),
                ];
                if corners == [true; 4] || corners == [false; 4] {
                    continue;
                }
                let base = grid.index(i, j);
                let edges = [2 * base, 2 * (base + 1) + 1, 2 * (base + width), 2 * base + 1];
                // Counter-clockwise around the cell: the set begins on an edge from outside to inside, and ends on one from inside to outside.
                let enters: Vec<usize> = (0..4).filter(|k| !corners[*k] && corners[(k + 1) % 4]).collect();
                let leaves: Vec<usize> = (0..4).filter(|k| corners[*k] && !corners[(k + 1) % 4]).collect();
                let is_joined = enters.len() == 2 && {
                    let (a, b) = (grid.place(i, j), grid.place(i + 1, j + 1));
                    (self.holds)([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])])
                };
                for leave in &leaves {
                    // With the set on the left, the line enters the cell where the set ends, counter-clockwise, and leaves it where the set begins: after it, or,
                    // if the two corners of the set are apart, before it.
                    let turn = |k: &&usize| {
                        if is_joined {
                            (**k + 4 - leave) % 4
                        } else {
                            (leave + 4 - **k) % 4
                        }
                    };
                    if let Some(enter) = enters.iter().min_by_key(turn) {
                        next.insert(edges[*leave], edges[*enter]);
                        starts.push(edges[*leave]);
                    }
                }
            }
        }
        let vertex = |edge: usize| {
            let (index, along_v) = (edge / 2, edge % 2);
            let (i, j) = (index % width, index / width);
            let ends = [(i, j), (i + 1 - along_v, j + along_v)];
            let [a, b] = ends.map(|(i, j)| grid.place(i, j));
            if grid.at(ends[0].0, ends[0].1) {
                self.bisected(a, b)
            } else {
                self.bisected(b, a)
            }
        };
        let mut loops = Vec::new();
        for start in starts {
            let mut edges = Vec::new();
            let mut at = start;
            while let Some(to) = next.remove(&at) {
                edges.push(at);
                at = to;
            }
            if edges.len() > 2 {
                loops.push(edges.par_iter().map(|edge| vertex(*edge)).collect());
            }
        }
        loops
    }

    /// Adds the vertices between two of a loop, at which its chord follows the boundary.
    fn chord(&self, a: Place, b: Place, step: f64, chord_mm: f64, left: u32, out: &mut Vec<Place>) {
        let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let metric = self.metric_at(middle);
        let between = |a: Place, b: Place| ((b[0] - a[0]) * metric[0]).hypot((b[1] - a[1]) * metric[1]);
        let length = between(a, b);
        if left == 0 || length < 2.0 * chord_mm {
            return;
        }
        let reach = (0.75 * length).min(step);
        let is_in = (self.holds)(middle);
        let side = if is_in { -1.0 } else { 1.0 };
        let near = self.beside(middle, a, b, side * chord_mm);
        if (self.holds)(near) != is_in && is_in {
            return;
        }
        let far = self.beside(middle, a, b, side * reach);
        if (self.holds)(far) == is_in {
            return;
        }
        let found = if is_in {
            self.bisected(middle, far)
        } else {
            self.bisected(far, middle)
        };
        if between(found, middle) <= chord_mm && is_in {
            return;
        }
        self.chord(a, found, step, chord_mm, left - 1, out);
        out.push(found);
        self.chord(found, b, step, chord_mm, left - 1, out);
    }

    /// `from` moved by `by` in (u, v), scaled so that it moves by `length_mm` in space: by more where the derivatives nearly vanish, by less where they grow. Not beyond the
    /// rectangle.
    fn moved(&self, from: Place, by: Place, length_mm: f64) -> Place {
        let to = |share: f64| -> Place {
            std::array::from_fn(|k| {
                let [low, high] = self.rectangle[k];
                (from[k] + share * by[k]).clamp(low, high)
            })
        };
        let point = |place: Place| self.surface.at(place[0], place[1]).point;
        let start = point(from);
        let is_short = |share: f64| point(to(share)).distance(start) < length_mm;
        let (mut short, mut long) = (0.0, 1.0);
        while is_short(long) {
            (short, long) = (long, 2.0 * long);
            if long > FARTHER_MAX {
                return to(1.0);
            }
        }
        for _ in 0..MOVE_BISECTIONS {
            let middle = 0.5 * (short + long);
            if is_short(middle) {
                short = middle;
            } else {
                long = middle;
            }
        }
        to(long)
    }

    /// Each vertex moved in, to the left of its edges; those on a side of the rectangle stay on it, unless it is a cut.
    fn pulled_in(&self, polygon: &[Place], by: f64) -> Vec<Place> {
        let count = polygon.len();
        (0..count)
            .map(|index| {
                let (before, here, after) = (
                    polygon[(index + count - 1) % count],
                    polygon[index],
                    polygon[(index + 1) % count],
                );
                let at = self.surface.at(here[0], here[1]);
                let metric = [at.u.length(), at.v.length()].map(|length| length.max(f64::MIN_POSITIVE));
                let unit = |a: Place, b: Place| {
                    let [du, dv] = [0, 1].map(|k| (b[k] - a[k]) * metric[k]);
                    let length = du.hypot(dv).max(f64::MIN_POSITIVE);
                    [-dv / length, du / length]
                };
                let (m, n) = (unit(before, here), unit(here, after));
                let sum = [m[0] + n[0], m[1] + n[1]];
                let share = (by / (0.5 * (sum[0] * sum[0] + sum[1] * sum[1])).max(0.25)).min(2.0 * by);
                let on_side =
                    [0, 1].map(|k| (0..2).any(|end| self.rectangle[k][end] == here[k] && !self.cuts[k][end]));
                let inwards = [0, 1].map(|k| if on_side[k] { 0.0 } else { share * sum[k] });
                let by = [0, 1].map(|k| inwards[k] / metric[k]);
                self.moved(here, by, inwards[0].hypot(inwards[1]))
            })
            .collect()
    }

    /// The fewest vertices whose chords stay inside of the polygon, or leave it by a fifth of the inset at most.
    fn simplified(&self, polygon: &[Place], precision: &Precision) -> Vec<Place> {
        let count = polygon.len();
        if count < 4 {
            return polygon.to_vec();
        }
        let fits = |from: usize, to: usize| {
            let (a, b) = (polygon[from % count], polygon[to % count]);
            let length = self.length(a, b);
            let (du, dv) = ((b[0] - a[0]) * self.metric[0], (b[1] - a[1]) * self.metric[1]);
            (from + 1..to).all(|index| {
                let p = polygon[index % count];
                let (eu, ev) = ((p[0] - a[0]) * self.metric[0], (p[1] - a[1]) * self.metric[1]);
                let (off, along) = ((du * ev - dv * eu) / length, (du * eu + dv * ev) / length);
                // The set is on the left: where a vertex is there, the chord leaves the set.
                length > 0.0
                    && off <= 0.2 * precision.inset_mm
                    && off >= -precision.simplify_mm
                    && (0.0..=length).contains(&along)
            })
        };
        let mut kept = vec![polygon[0]];
        let mut from = 0;
        while from < count {
            let mut to = from + 1;
            let mut step = 1;
            while to + step <= count && fits(from, to + step) {
                to += step;
                step *= 2;
            }
            while step > 0 {
                if to + step <= count && fits(from, to + step) {
                    to += step;
                }
                step /= 2;
            }
            from = to;
            if from < count {
                kept.push(polygon[from]);
            }
        }
        kept
    }
}

/// Removes spikes: vertices at which the polygon turns back along its own edge, as on a side of the rectangle. A spike has no area.
fn without_spikes(mut polygon: Vec<Place>) -> Vec<Place> {
    let is_spike = |[a, b, c]: [Place; 3]| {
        let [to, on] = [[b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]];
        to[0] * on[1] == to[1] * on[0] && to[0] * on[0] + to[1] * on[1] <= 0.0
    };
    let mut index = 0;
    while polygon.len() > 2 && index < polygon.len() {
        let count = polygon.len();
        let around = [count - 1, 0, 1].map(|k| polygon[(index + k) % count]);
        if is_spike(around) {
            polygon.remove(index);
            // The one before it may be one now.
            index = index.saturating_sub(1);
        } else {
            index += 1;
        }
    }
    polygon
}

#[cfg(test)]
mod tests {
    use super::without_spikes;

    #[test]
    fn a_way_there_and_back_is_left_out() {
        let square = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let mut spiked = square.clone();
        spiked.insert(1, [1.0, -0.25]);
        // (0, 0), (1, -0.25), (1, 0): no spike; one from (1, 1) upwards is.
        assert_eq!(without_spikes(spiked.clone()), spiked);
        let mut spiked = square.clone();
        spiked.insert(3, [1.0, 1.5]);
        spiked.insert(4, [1.0, 1.0]);
        assert_eq!(without_spikes(spiked), square);
        assert_eq!(without_spikes(vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]).len(), 2);
    }
}
