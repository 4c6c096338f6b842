//! Dense points of a pass with arc lengths, as the data of curve fits.

use super::PassPath;
use glam::DVec3;
use oracle::{OffsetPoint, OracleError};

/// Points per smooth span of the surface.
const PER_SPAN: usize = 48;
/// Least number of points per pass.
const LEAST: usize = 384;
/// Greatest change of the speed ratio from point to point, as a share; an interval with a larger change is halved.
const RATIO_CHANGE: f64 = 0.01;
/// Cosine of the greatest turn of the centre's path from point to point, 0.05 rad; an interval with a larger turn is halved.
const TURN_COSINE: f64 = 0.998_75;
/// Largest number of successive halvings of an interval.
const HALVINGS: u32 = 6;
/// Two-point Gauss-Legendre rule on [0, 1]: 0.5 -+ 1/(2 sqrt 3). At this density the relative error is below 1e-9.
pub(super) const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// One point of a pass.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Contact and centre.
    pub at: OffsetPoint,
    /// Unit tangent of the centre's path in the direction of the cut.
    pub tangent: DVec3,
    /// Arc length of the CC path from the start, mm.
    pub cc_length_mm: f64,
    /// Arc length of the CL path from the start, mm.
    pub cl_length_mm: f64,
}

impl Node {
    fn new(pass: &PassPath<'_>, at: OffsetPoint, [cc_length_mm, cl_length_mm]: [f64; 2]) -> Self {
        Self {
            at,
            tangent: unit(at.cl_velocity, pass.sense()),
            cc_length_mm,
            cl_length_mm,
        }
    }

    /// Whether the path turns, or its speed changes, too much up to another node.
    fn is_far_from(&self, other: &Self) -> bool {
        let [from, to] = [self.at.ratio(), other.at.ratio()];
        (to - from).abs() > RATIO_CHANGE * from.min(to) || self.tangent.dot(other.tangent) < TURN_COSINE
    }

    /// CL, mm.
    #[must_use]
    pub fn cl_mm(&self) -> DVec3 {
        self.at.contact.cl_mm
    }
}

/// The points of a pass in cutting order; empty for a degenerate pass.
#[derive(Clone, Debug)]
pub struct Nodes(pub Vec<Node>);

impl Nodes {
    /// Computes the points of a pass.
    ///
    /// # Errors
    /// The surface has no normal somewhere on the pass.
    pub fn new(pass: &PassPath<'_>) -> Result<Self, OracleError> {
        if pass.is_point() {
            return Ok(Self(Vec::new()));
        }
        let breaks = pass.breaks();
        let steps = PER_SPAN.max(LEAST.div_ceil(breaks.len() - 1));
        let mut nodes = Self(Vec::with_capacity(steps * breaks.len()));
        nodes.0.push(Node::new(pass, pass.at(pass.ends[0])?, [0.0; 2]));
        for ends in breaks.windows(2) {
            for step in 1..=steps {
                let share = step as f64 / steps as f64;
                nodes.add(
                    pass,
                    match step == steps {
                        true => ends[1],
                        false => ends[0] + (ends[1] - ends[0]) * share,
                    },
                )?;
            }
        }
        Ok(nodes)
    }

    /// Adds the points up to a path parameter.
    fn add(&mut self, pass: &PassPath<'_>, path: f64) -> Result<(), OracleError> {
        // Path parameters, with the number of halvings that they come from.
        let mut ahead = vec![(path, 0)];
        while let (Some((path, halvings)), Some(last)) = (ahead.pop(), self.0.last().copied()) {
            let from = last.at.path;
            let node = Node::new(pass, pass.at(path)?, [0.0; 2]);
            if halvings < HALVINGS && last.is_far_from(&node) {
                ahead.extend([(path, halvings + 1), (0.5 * (from + path), halvings + 1)]);
                continue;
            }
            if path == from {
                continue;
            }
            let mut lengths = [last.cc_length_mm, last.cl_length_mm];
            for share in GAUSS {
                let between = pass.at(from + (path - from) * share)?;
                let half = 0.5 * (path - from).abs();
                lengths[0] += half * between.contact.path_speed;
                lengths[1] += half * between.cl_velocity.length();
            }
            self.0.push(Node {
                cc_length_mm: lengths[0],
                cl_length_mm: lengths[1],
                ..node
            });
        }
        Ok(())
    }

    /// Arc lengths of the CC and the CL path, mm.
    #[must_use]
    pub fn lengths_mm(&self) -> [f64; 2] {
        self.0
            .last()
            .map_or([0.0; 2], |node| [node.cc_length_mm, node.cl_length_mm])
    }

    /// Least and largest ratio of CL speed to CC speed.
    #[must_use]
    pub fn ratios(&self) -> [f64; 2] {
        self.0
            .iter()
            .map(|node| node.at.ratio())
            .fold([f64::INFINITY, 0.0], |[low, high], ratio| {
                [low.min(ratio), high.max(ratio)]
            })
    }
}

fn unit(vector: DVec3, sense: f64) -> DVec3 {
    let length = vector.length();
    if length > 0.0 {
        vector * (sense / length)
    } else {
        vector
    }
}
