//! The curve approach for controllers with circular interpolation: biarcs through points of the CL path, tangent to the path and
//! to each other in one of the planes G17, G18, G19, while the third axis moves in proportion; each arc at constant speed. The plane
//! with the longest arcs is chosen.

use super::curve::{SPEED_SHARE, longest};
use super::nodes::{Node, Nodes};
use super::{ApproachError, PassPath};
use crate::gcode::{Cut, Plane, Shape};
use glam::DVec3;
use job::Job;

/// Largest radius of an arc, mm; flatter ones become lines: a controller in f32 has no precision for a longer radius.
const RADIUS_MAX_MM: f64 = 1e4;
/// Least length of the projection of a unit tangent into a plane; a steeper path has no usable direction in that plane.
const STEEP: f64 = 1e-3;

/// Bisections for the joint of two arcs between two nodes.
const BISECTIONS: u32 = 40;
/// Rounding of the place of a node along a piece, mm.
const ROUNDED_MM: f64 = 1e-7;

type Flat = [f64; 2];

fn minus(a: Flat, b: Flat) -> Flat {
    [a[0] - b[0], a[1] - b[1]]
}

/// `a + b t`.
fn along(a: Flat, b: Flat, t: f64) -> Flat {
    [a[0] + t * b[0], a[1] + t * b[1]]
}

fn inner(a: Flat, b: Flat) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn outer(a: Flat, b: Flat) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// One arc, or a line where it is too flat.
#[derive(Clone, Copy, Debug)]
struct Piece {
    from: Flat,
    to: Flat,
    /// Centre and radius; the radius is positive if counterclockwise.
    turn: Option<(Flat, f64)>,
}

impl Piece {
    /// The arc that leaves `from` with the unit tangent and ends at `to`.
    fn new(from: Flat, tangent: Flat, to: Flat) -> Self {
        let chord = minus(to, from);
        let (squared, bend) = (inner(chord, chord), 2.0 * outer(tangent, chord));
        let turn = (bend.abs() * RADIUS_MAX_MM > squared).then(|| {
            let radius = squared / bend;
            (
                [from[0] - radius * tangent[1], from[1] + radius * tangent[0]],
                radius,
            )
        });
        Self { from, to, turn }
    }

    /// Distance of a point from the piece, and the position of its foot along the piece, 0 to 1.
    fn distance(&self, point: Flat) -> (f64, f64) {
        match self.turn {
            Some((centre, radius)) => {
                let [arm, begin, end] = [point, self.from, self.to].map(|at| minus(at, centre));
                let angle = |to: Flat| radius.signum() * outer(begin, to).atan2(inner(begin, to));
                (
                    (arm[0].hypot(arm[1]) - radius.abs()).abs(),
                    angle(arm) / angle(end),
                )
            }
            None => {
                let (chord, arm) = (minus(self.to, self.from), minus(point, self.from));
                let squared = inner(chord, chord);
                (
                    (outer(chord, arm) / squared.sqrt()).abs(),
                    inner(chord, arm) / squared,
                )
            }
        }
    }

    fn length(&self) -> f64 {
        let [x, y] = minus(self.to, self.from);
        let chord = x.hypot(y);
        self.turn.map_or(chord, |(_, radius)| {
            let half = 0.5 * chord / radius.abs();
            2.0 * radius.abs() * half.min(1.0).asin()
        })
    }
}

/// Biarc between two points with given directions, tangent at the joint; of the family, the one with control polygons of equal
/// arms. `None` if the path turns by 90 degrees or more.
fn biarc([from, to]: [Flat; 2], [begin, end]: [Flat; 2]) -> Option<[Piece; 2]> {
    let apart = minus(to, from);
    let (both, squared) = (inner(apart, along(begin, end, 1.0)), inner(apart, apart));
    if inner(begin, end) <= 0.0 || both <= 0.0 {
        return None;
    }
    let arm = squared / (both + (both * both + 2.0 * (1.0 - inner(begin, end)) * squared).sqrt());
    let (first, last) = (along(from, begin, arm), along(to, end, -arm));
    let joint = [0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1])];
    let tangent = minus(last, first);
    let size = tangent[0].hypot(tangent[1]);
    let tangent = [tangent[0] / size, tangent[1] / size];
    Some([Piece::new(from, begin, joint), Piece::new(joint, tangent, to)])
}

/// The curve approach in arcs, for a job.
#[derive(Clone, Copy, Debug)]
pub struct Arcs {
    path_mm: f64,
    feed_mm_s: f64,
}

impl Arcs {
    /// The approach with a job's feed, and its chord error limit as the tolerance of the path.
    #[must_use]
    pub fn new(job: &Job) -> Self {
        Self {
            path_mm: job.chord_mm,
            feed_mm_s: job.feed_mm_s(),
        }
    }

    /// The cuts of a pass: successively the longest within the tolerances of path and speed.
    ///
    /// # Errors
    /// At some point no cut is within the tolerances.
    pub fn cuts(&self, pass: &PassPath<'_>) -> Result<Vec<Cut>, ApproachError> {
        let nodes = Nodes::new(pass)?.0;
        let fit = |first: usize, last: usize| {
            let nodes = &nodes[first..=last];
            Plane::ALL.into_iter().find_map(|plane| self.fit(plane, nodes))
        };
        let pairs = longest(nodes.len(), fit).map_err(|first| ApproachError::NoSegment {
            path: nodes[first].at.path,
            side: pass.side_at(nodes[first].at.path),
        })?;
        Ok(pairs.concat())
    }

    /// The two arcs in this plane over consecutive points, if they are within the tolerances.
    fn fit(&self, plane: Plane, nodes: &[Node]) -> Option<[Cut; 2]> {
        let [x, y, across] = plane.axes();
        let place = |node: &Node| [node.cl_mm()[x], node.cl_mm()[y]];
        let (first, last) = (nodes.first()?, nodes.last()?);
        let tangents = [tangent(first, plane)?, tangent(last, plane)?];
        let pieces = biarc([place(first), place(last)], tangents)?;
        let flat = pieces.map(|piece| piece.length());
        // The joint is within the tolerance of the path: its foot is searched.
        let ahead = |node: &Node| {
            inner(
                [node.tangent[x], node.tangent[y]],
                minus(place(node), pieces[0].to),
            )
        };
        let split = nodes
            .partition_point(|node| ahead(node) <= 0.0)
            .clamp(1, nodes.len() - 1);
        let (before, after) = (&nodes[split - 1], &nodes[split]);
        let between = |values: [f64; 2], rates: [f64; 2], t: f64| {
            let span = after.cl_length_mm - before.cl_length_mm;
            hermite(values, rates.map(|rate| rate * span), t)
        };
        let t = root(|t| {
            let places = [x, y].map(|axis| {
                let values = [before.cl_mm()[axis], after.cl_mm()[axis]];
                between(values, [before.tangent[axis], after.tangent[axis]], t)
            });
            let [off_x, off_y] = [0, 1].map(|axis| places[axis][0] - pieces[0].to[axis]);
            off_x * places[0][1] + off_y * places[1][1]
        });
        let at_joint = |value: &dyn Fn(&Node) -> f64, rate: &dyn Fn(&Node) -> f64| {
            between([value(before), value(after)], [rate(before), rate(after)], t)[0]
        };
        let heights = [
            first.cl_mm()[across],
            at_joint(&|node| node.cl_mm()[across], &|node| node.tangent[across]),
            last.cl_mm()[across],
        ];
        let contact = at_joint(&|node| node.cc_length_mm, &|node| 1.0 / node.at.ratio()) - first.cc_length_mm;
        let contacts = [contact, last.cc_length_mm - first.cc_length_mm - contact];
        let lift = |[at_x, at_y]: Flat, height: f64| {
            let mut point = DVec3::splat(height);
            (point[x], point[y]) = (at_x, at_y);
            point
        };
        let cuts = [0, 1].map(|k| {
            let length_mm = flat[k].hypot(heights[k + 1] - heights[k]);
            Cut {
                to_mm: lift(pieces[k].to, heights[k + 1]),
                length_mm,
                speed_mm_s: self.feed_mm_s * length_mm / contacts[k],
                shape: pieces[k].turn.map_or(Shape::Line, |(centre, radius)| Shape::Arc {
                    plane,
                    centre_mm: lift(centre, heights[k]),
                    clockwise: radius < 0.0,
                }),
            }
        });
        let holds = |k: usize, nodes: &[Node]| {
            // Between the nodes the deviation may exceed that at the nodes: on a parabola by the share 1/n^2, on a path with a sharper bend in its middle by up to twice
            // that share.
            let intervals = nodes.len().max(2) as f64;
            let path_mm = self.path_mm * (1.0 - 2.0 / (intervals * intervals));
            let begin = if k == 0 { 0.0 } else { contact };
            let rate = cuts[k].length_mm / cuts[k].speed_mm_s * self.feed_mm_s;
            let mut last = [0.0; 2];
            let mut holds_feed = |share: f64, contact: f64| {
                // Beside the path the contact is faster or slower, where that bends: its way since the last node, against that at the feed.
                let (way, wanted) = (contact - last[1], rate * (share - last[0]));
                last = [share, contact];
                (way - wanted).abs() <= SPEED_SHARE * wanted + ROUNDED_MM
            };
            nodes.iter().all(|node| {
                let (off, share) = pieces[k].distance(place(node));
                let beside = heights[k] + share * (heights[k + 1] - heights[k]) - node.cl_mm()[across];
                // On the path itself the relative feed error of the contact equals that of the centre's speed.
                let wanted = self.feed_mm_s * node.at.ratio();
                let slow = cuts[k].speed_mm_s - wanted;
                off.hypot(beside) <= path_mm
                    && slow.abs() <= SPEED_SHARE * wanted
                    && holds_feed(share, node.cc_length_mm - first.cc_length_mm - begin)
            }) && holds_feed(1.0, contacts[k])
        };
        (holds(0, &nodes[..split]) && holds(1, &nodes[split..])).then_some(cuts)
    }
}

/// The cubic with these values and derivatives at 0 and 1, and its derivative.
fn hermite([from, to]: [f64; 2], [begin, end]: [f64; 2], t: f64) -> [f64; 2] {
    let rise = to - from;
    let (square, cube) = (3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise);
    [
        from + t * (begin + t * (square + t * cube)),
        begin + t * (2.0 * square + t * 3.0 * cube),
    ]
}

/// The place between 0 and 1 at which a rising function is 0.
fn root(of: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if of(middle) < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Unit tangent in a plane; `None` if the path is too steep to it.
fn tangent(node: &Node, plane: Plane) -> Option<Flat> {
    let [x, y, _] = plane.axes();
    let tangent = [node.tangent[x], node.tangent[y]];
    let size = tangent[0].hypot(tangent[1]);
    (size > STEEP).then(|| tangent.map(|x| x / size))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn biarcs_are_tangent_where_they_begin_meet_and_end() {
        let unit = |angle: f64| [angle.cos(), angle.sin()];
        for (end, angles) in [
            ([3.0, 1.0], [0.1, 0.9]),
            ([3.0, -1.0], [-0.7, 0.2]),
            ([1.0, 1e-9], [0.3, -0.3]),
        ] {
            let tangents = angles.map(unit);
            let [first, last] = biarc([[0.0; 2], end], tangents).unwrap();
            let leaves = |piece: &Piece, at: Flat, tangent: Flat| {
                let (centre, radius) = piece.turn.unwrap();
                let arm = minus(at, centre);
                assert!((arm[0].hypot(arm[1]) - radius.abs()).abs() < 1e-12);
                // Counterclockwise, the tangent is the arm turned left.
                assert!((outer(arm, tangent) - radius).abs() < 1e-12, "{piece:?}");
            };
            leaves(&first, [0.0; 2], tangents[0]);
            leaves(&last, end, tangents[1]);
            let (centre, radius) = first.turn.unwrap();
            let arm = minus(first.to, centre);
            leaves(&last, last.from, [-arm[1] / radius, arm[0] / radius]);
        }
        assert!(biarc([[0.0; 2], [1.0, 0.0]], [unit(0.0), unit(1.6)]).is_none());
    }

    #[test]
    fn a_straight_path_is_cut_straight() {
        let [first, last] = biarc([[0.0; 2], [4.0, 3.0]], [[0.8, 0.6]; 2]).unwrap();
        assert!(first.turn.is_none() && last.turn.is_none());
        assert!((first.length() + last.length() - 5.0).abs() < 1e-12);
    }
}
