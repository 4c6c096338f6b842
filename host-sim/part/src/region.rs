//! The region of a face that a tool finishes: the face and half a step-over around it, without the places that break a rule. The region is cut at creases.

use cad::{Face, Placement, polylines};
use glam::DVec3;
use job::Along;
use oracle::Surface;

use crate::body::Part;
use crate::clear::Clearance;
use crate::contour::{Precision, Set, Span};
use crate::crease::strips;
use crate::inside::Inside;
use crate::tool::{Reason, Tool};
use crate::tree::{Block, Tree};
use crate::triangle::edge_nearest;

/// Distance by which a region is grown beyond the face, in step-overs: half of one, and a margin for the ends of passes.
pub const GROWTH: f64 = 0.51;
/// Greatest ratio of the step-over on a concave place to that on a plane.
pub const STEP_MAX: f64 = 2.0;
/// Least number of places along each parameter of a face at which its step-over and metric are sampled.
const LOOKS: usize = 24;
/// Least number of such places in each span between two knots.
const SPAN_LOOKS: usize = 4;
/// Distance of a span's last place from its knot, where the next span begins, as a share of its length.
const BELOW: f64 = 1e-6;
/// Precision of the face's own boundary, mm.
const EDGE_MM: f64 = 0.002;
/// How far loops are pulled in, mm: gouges of emitted centres lay within 3.3 um of the loop.
const INSET_MM: f64 = 0.01;
/// Distance of chords from the boundary, mm.
const CHORD_MM: f64 = 0.003;
/// Further distance by which loops may be pulled in to save vertices, mm.
const SIMPLIFY_MM: f64 = 0.01;

/// Largest factor by which the grid is refined where the ball's centre moves farther than the contact, as around an edge.
const STRETCH_MAX: f64 = 4.0;
/// A side shorter than this is a point, mm.
const POLE_MM: f64 = 1e-6;
/// Radius around a side that is a point within which no pass lies, in step-overs.
const POLE_STEPS: f64 = 0.35;
/// Places along each parameter at which the reach of a face is measured.
const SIDE: usize = 64;
/// Least ball that is tried, mm.
const RADIUS_MIN_MM: f64 = 0.05;
/// Share of a face that counts as all of it.
const NEARLY_ALL: f64 = 0.99;
/// Bisections of the radius.
const TRIALS: usize = 10;
/// Places of a face at which a radius is tried.
const TRIAL_PLACES: usize = 500;

/// Input for the region of a face.
pub struct Request<'a> {
    /// The surface that is machined, placed.
    pub surface: &'a Surface,
    /// The trimmed region on it.
    pub trimmed: &'a [Vec<[f64; 2]>],
    /// The face as it is in the file.
    pub face: &'a Face,
    /// From the file to the machine.
    pub placement: &'a Placement,
    /// Sign of the tool's side on `S_u x S_v`.
    pub sign: f64,
    /// The tool.
    pub tool: &'a Tool,
    /// Scallop height, mm.
    pub scallop_mm: f64,
    /// Steepest angle of the surface from the horizontal, degrees.
    pub steepest_deg: f64,
    /// How deep the tool may enter the part, mm.
    pub touch_mm: f64,
    /// The part on the machine, and the index of the face in it.
    pub part: Option<(&'a Part, Option<usize>)>,
}

/// A region.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Made {
    /// Polygons of the region.
    pub loops: Vec<Vec<[f64; 2]>>,
    /// The area of the trimmed face, mm2.
    pub area_mm2: f64,
    /// Area that the tool reaches, mm2.
    pub reachable_mm2: f64,
    /// Area that the tool does not reach, mm2, by the first rule that it breaks.
    pub unreachable_mm2: Vec<(Reason, f64)>,
    /// Reachable area within the polygons, mm2.
    pub inside_mm2: f64,
    /// Radius of the largest ball that reaches 99 % of the area that is not too steep, mm; `None` if no ball above 0.05 mm does.
    pub radius_mm: Option<f64>,
}

/// Metric and step-over of a face, from samples.
struct Looks {
    /// Largest derivatives by u and v, mm.
    metric: [f64; 2],
    /// Spans between knots, each with the greatest length along it of the surface or of the ball's centre: that of a centre that moves at most four times as far.
    spans: [Vec<Span>; 2],
    /// The largest step-over, mm.
    step: f64,
}

/// The edges of the face, to grow it by.
struct Border {
    edges: Vec<[DVec3; 2]>,
    tree: Tree,
}

impl Border {
    fn new(edges: Vec<[DVec3; 2]>) -> Self {
        let blocks: Vec<Block> = edges.iter().map(|ends| Block::around(*ends)).collect();
        Self {
            tree: Tree::new(&blocks),
            edges,
        }
    }

    fn is_near(&self, point: DVec3, within: f64) -> bool {
        let mut bound = within;
        self.tree.nearest(
            &mut bound,
            |block| block.distance_squared(point),
            |index, bound| {
                let (distance, _) = edge_nearest(point, self.edges[index]);
                if distance < *bound {
                    *bound = 0.0;
                }
            },
        );
        bound < within
    }
}

impl Request<'_> {
    /// The rules for a place.
    #[must_use]
    pub fn clearance(&self) -> Clearance<'_> {
        Clearance {
            surface: self.surface,
            sign: self.sign,
            tool: self.tool,
            normal_z_min: (90.0 - self.steepest_deg).to_radians().sin(),
            touch_mm: self.touch_mm,
            part: self.part,
            breaks: [Along::U, Along::V].map(|along| self.surface.breaks(along)),
        }
    }

    /// The edges of the face: those of the part, where it has them.
    fn border(&self) -> Border {
        if let Some((part, Some(own))) = self.part {
            return Border::new(part.edges_of(own));
        }
        let lines = polylines(self.face, EDGE_MM);
        let ends = lines.iter().flat_map(|line| line.windows(2));
        Border::new(
            ends.map(|ends| [0, 1].map(|k| self.placement.point(ends[k])))
                .collect(),
        )
    }

    /// Looks at the face.
    fn looks(&self, rectangle: [[f64; 2]; 2]) -> Looks {
        let r = self.tool.radius;
        let plane = job::plane_step_over_mm(r, self.scallop_mm);
        let (mut metric, mut step) = ([1e-9_f64; 2], plane);
        let clearance = self.clearance();
        let ranges: [Vec<[f64; 2]>; 2] = [0, 1].map(|k| spans(&clearance.breaks[k], rectangle[k]));
        let places = ranges.each_ref().map(|ranges| looks_in(ranges));
        // Of each span: derivative of the contact, and of the ball's centre, mm.
        let mut longest = ranges
            .each_ref()
            .map(|ranges| vec![[1e-9_f64, 0.0]; ranges.len()]);
        for (in_u, u) in &places[0] {
            for (in_v, v) in &places[1] {
                let (spans, u, v) = ([*in_u, *in_v], *u, *v);
                let at = self.surface.at(u, v);
                let lengths = [at.u.length(), at.v.length()];
                for k in 0..2 {
                    metric[k] = metric[k].max(lengths[k]);
                    let of_contact = &mut longest[k][spans[k]][0];
                    *of_contact = of_contact.max(lengths[k]);
                }
                let place = clearance.place([u, v]);
                if place.fault.is_none() {
                    let [_, most] = at.principal_curvatures(place.normal);
                    let share = (1.0 - r * most).max(1.0 / STEP_MAX / STEP_MAX);
                    step = step.max(plane / share.sqrt());
                    let centre = |uv: [f64; 2]| {
                        let place = clearance.place(uv);
                        place.point + place.normal * r
                    };
                    for k in 0..2 {
                        let by = 1e-6 * (rectangle[k][1] - rectangle[k][0]);
                        let [before, after] = [-by, by].map(|by| {
                            let mut uv = [u, v];
                            uv[k] = (uv[k] + by).clamp(rectangle[k][0], rectangle[k][1]);
                            centre(uv)
                        });
                        // At an end the difference is over half of it; `max` leaves out what is not a number.
                        let of_centre = &mut longest[k][spans[k]][1];
                        *of_centre = of_centre.max(0.5 * before.distance(after) / by);
                    }
                }
            }
        }
        let span = |(range, [of_contact, of_centre]): (&[f64; 2], &[f64; 2])| Span {
            range: *range,
            length_mm: (range[1] - range[0]) * of_centre.clamp(*of_contact, STRETCH_MAX * of_contact),
        };
        Looks {
            metric,
            spans: [0, 1].map(|k| ranges[k].iter().zip(&longest[k]).map(span).collect()),
            step,
        }
    }

    /// What can be reached, without a region: by `side` x `side` places around the face.
    #[must_use]
    pub fn reach(&self, side: usize) -> Made {
        let clearance = self.clearance();
        let places = self.places(&Inside::new(self.trimmed), side);
        let checked: Vec<_> = places.iter().map(|(place, _)| clearance.check(*place)).collect();
        shares(&places, &checked)
    }

    /// Makes the region.
    #[must_use]
    pub fn make(&self) -> Made {
        let trimmed = Inside::new(self.trimmed);
        let domain = self.surface.domain();
        let Looks { metric, step, .. } = self.looks(domain);
        // What is beside the face is not known without the part.
        let grow_mm = if self.part.is_some() { GROWTH * step } else { 0.0 };
        let rectangle = self.rectangle(domain, metric, grow_mm);
        let clearance = self.clearance();
        let places = self.places(&trimmed, SIDE);
        let checked: Vec<Result<(), Reason>> =
            places.iter().map(|(place, _)| clearance.check(*place)).collect();
        let mut made = shares(&places, &checked);
        if made.reachable_mm2 == 0.0
            && made.area_mm2 > 0.0
            && made.unreachable_mm2.iter().all(|(why, _)| *why == Reason::Steep)
        {
            return made;
        }
        made.radius_mm = self.largest_ball(&trimmed, &made);
        let border = self.border();
        let poles = self.poles(domain);
        let beside_pole = |point: DVec3| poles.iter().any(|pole| pole.distance(point) < POLE_STEPS * step);
        let is_wanted = |place: [f64; 2]| {
            if !poles.is_empty() && beside_pole(self.surface.at(place[0], place[1]).point) {
                return false;
            }
            trimmed.contains(place)
                || grow_mm > 0.0 && border.is_near(self.surface.at(place[0], place[1]).point, grow_mm)
        };
        let [of_u, of_v] =
            [Along::U, Along::V].map(|along| strips(self.surface, along, rectangle, self.tool.radius));
        for ((u, u_cuts), (v, v_cuts)) in of_u.iter().flat_map(|u| of_v.iter().map(move |v| (*u, *v))) {
            let rectangle = [u, v];
            let Looks { metric, spans, .. } = self.looks(rectangle);
            let set = Set {
                rectangle,
                cuts: [u_cuts, v_cuts],
                metric,
                surface: self.surface,
                spans,
                holds: &|place| is_wanted(place) && clearance.check(place).is_ok(),
                is_sure: &|place| clearance.surely(place),
            };
            made.loops.extend(set.contours(&Precision {
                grid_mm: clearance.spacing_mm(),
                chord_mm: CHORD_MM,
                inset_mm: INSET_MM,
                simplify_mm: SIMPLIFY_MM,
            }));
        }
        let inside = Inside::new(&made.loops);
        let reached = places.iter().zip(&checked).filter(|(_, checked)| checked.is_ok());
        made.inside_mm2 = reached
            .filter(|((place, _), _)| inside.contains(*place))
            .map(|((_, area), _)| area)
            // The sum of none is -0.
            .fold(0.0, |sum, area| sum + area);
        made
    }

    /// Points to which a side of the domain shrinks. A pass on one has no length, and one around it serves it.
    fn poles(&self, [u, v]: [[f64; 2]; 2]) -> Vec<DVec3> {
        let mut poles = Vec::new();
        let share = |[low, high]: [f64; 2], k: usize| low + (high - low) * k as f64 / 4.0;
        for (along, range, ends) in [(0, u, v), (1, v, u)] {
            for end in ends {
                let places: Vec<DVec3> = (0..=4)
                    .map(|k| {
                        if along == 0 {
                            [share(range, k), end]
                        } else {
                            [end, share(range, k)]
                        }
                    })
                    .map(|place| self.surface.at(place[0], place[1]).point)
                    .collect();
                if places.iter().all(|point| point.distance(places[0]) < POLE_MM) {
                    poles.push(places[0]);
                }
            }
        }
        poles
    }

    /// The trimmed region's box, grown.
    fn rectangle(&self, domain: [[f64; 2]; 2], metric: [f64; 2], grow_mm: f64) -> [[f64; 2]; 2] {
        let places = || self.trimmed.iter().flatten();
        std::array::from_fn(|k| {
            let [low, high] = places().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                [low.min(place[k]), high.max(place[k])]
            });
            // The derivative may be shorter where the box ends.
            let by = 2.0 * grow_mm / metric[k];
            [(low - by).max(domain[k][0]), (high + by).min(domain[k][1])]
        })
    }

    /// Places of the trimmed region in a regular pattern, each with its area.
    #[must_use]
    pub fn places(&self, trimmed: &Inside, side: usize) -> Vec<([f64; 2], f64)> {
        let places = || self.trimmed.iter().flatten();
        let range: [[f64; 2]; 2] = std::array::from_fn(|k| {
            places().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                [low.min(place[k]), high.max(place[k])]
            })
        });
        let cell = (range[0][1] - range[0][0]) * (range[1][1] - range[1][0]) / (side * side) as f64;
        let mut out = Vec::new();
        for i in 0..side {
            for j in 0..side {
                // Rank-1 lattice of the golden ratio's kin: no row lines up with an edge (R2 sequence, M. Roberts, 2018).
                let n = (i * side + j) as f64 + 0.5;
                let share = [
                    (n * 0.754_877_666_246_692_8).fract(),
                    (n * 0.569_840_290_998_053_3).fract(),
                ];
                let place: [f64; 2] =
                    std::array::from_fn(|k| range[k][0] + share[k] * (range[k][1] - range[k][0]));
                if trimmed.contains(place) {
                    let at = self.surface.at(place[0], place[1]);
                    out.push((place, at.u.cross(at.v).length() * cell));
                }
            }
        }
        out
    }

    /// The largest ball that reaches nearly all that is not too steep, by bisection.
    fn largest_ball(&self, trimmed: &Inside, made: &Made) -> Option<f64> {
        let steep = |(reason, _): &&(Reason, f64)| *reason == Reason::Steep;
        let too_steep: f64 = made
            .unreachable_mm2
            .iter()
            .filter(steep)
            .map(|(_, area)| area)
            .sum();
        if made.reachable_mm2 >= NEARLY_ALL * (made.area_mm2 - too_steep) {
            return Some(self.tool.radius);
        }
        let places = self.places(trimmed, SIDE);
        let every = places.len().div_ceil(TRIAL_PLACES).max(1);
        let clearance = self.clearance();
        let is_steep = |place: [f64; 2]| clearance.place(place).normal.z < clearance.normal_z_min;
        // What is too steep is so for every ball.
        let places = places.into_iter().step_by(every);
        let places: Vec<_> = places.filter(|(place, _)| !is_steep(*place)).collect();
        let total: f64 = places.iter().map(|(_, area)| area).sum();
        let reaches = |radius: f64| {
            let tool = self.tool.with_radius(radius);
            let clearance = Clearance {
                tool: &tool,
                ..self.clearance()
            };
            let (mut all, mut reached) = (0.0, 0.0);
            for (place, area) in &places {
                all += area;
                if clearance.check(*place).is_ok() {
                    reached += area;
                }
                // With a margin for the rounding of sums: the rest cannot make up for what is lost.
                if all - reached > (1.0 - NEARLY_ALL + 1e-9) * total {
                    return false;
                }
            }
            reached >= NEARLY_ALL * all
        };
        let (mut low, mut high) = (RADIUS_MIN_MM, self.tool.radius);
        if !reaches(low) {
            return None;
        }
        for _ in 0..TRIALS {
            let middle = (low * high).sqrt();
            if reaches(middle) {
                low = middle
            } else {
                high = middle
            }
        }
        Some(low)
    }
}

/// The spans between knots within a range.
fn spans(breaks: &[f64], [low, high]: [f64; 2]) -> Vec<[f64; 2]> {
    let inner = breaks.iter().copied().filter(|knot| *knot > low && *knot < high);
    let ends: Vec<f64> = std::iter::once(low).chain(inner).chain([high]).collect();
    ends.windows(2).map(|ends| [ends[0], ends[1]]).collect()
}

/// Places in each span, with its index.
fn looks_in(spans: &[[f64; 2]]) -> Vec<(usize, f64)> {
    let count = LOOKS.div_ceil(spans.len()).max(SPAN_LOOKS);
    let of_span = |(index, [low, high]): (usize, &[f64; 2])| {
        let last = if index + 1 == spans.len() {
            1.0
        } else {
            1.0 - BELOW
        };
        let (low, length) = (*low, high - low);
        (0..=count).map(move |place| (index, low + length * (place as f64 / count as f64).min(last)))
    };
    spans.iter().enumerate().flat_map(of_span).collect()
}

/// What can be reached of places, and why not.
fn shares(places: &[([f64; 2], f64)], checked: &[Result<(), Reason>]) -> Made {
    let mut made = Made::default();
    let mut lost = [0.0; Reason::ALL.len()];
    for ((_, area), checked) in places.iter().zip(checked) {
        made.area_mm2 += area;
        match checked {
            Ok(()) => made.reachable_mm2 += area,
            Err(why) => lost[Reason::ALL.iter().position(|reason| reason == why).unwrap_or(0)] += area,
        }
    }
    made.unreachable_mm2 = Reason::ALL
        .into_iter()
        .zip(lost)
        .filter(|(_, area)| *area > 0.0)
        .collect();
    made
}
