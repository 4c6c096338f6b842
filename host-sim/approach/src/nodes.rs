//! Dense points of a pass with arc lengths, as the data of curve fits.

use super::PassPath;
use glam::DVec3;
use oracle::{OffsetPoint, OracleError};

/// Points per smooth span of the surface, and least number of points per pass.
const PER_SPAN: usize = 48;
const LEAST: usize = 384;
/// Two-point Gauss-Legendre rule on [0, 1]: 0.5 -+ 1/(2 sqrt 3). At this density the relative error is below 1e-9.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

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
        let mut nodes: Vec<Node> = Vec::with_capacity(steps * breaks.len());
        let mut lengths = [0.0; 2];
        for ends in breaks.windows(2) {
            for step in 0..=steps {
                let share = step as f64 / steps as f64;
                let path = if step == steps {
                    ends[1]
                } else {
                    ends[0] + (ends[1] - ends[0]) * share
                };
                if let Some(last) = nodes.last() {
                    if last.at.path == path {
                        continue;
                    }
                    let from = last.at.path;
                    for share in GAUSS {
                        let between = pass.at(from + (path - from) * share)?;
                        let half = 0.5 * (path - from).abs();
                        lengths[0] += half * between.contact.path_speed;
                        lengths[1] += half * between.cl_velocity.length();
                    }
                }
                let at = pass.at(path)?;
                nodes.push(Node {
                    at,
                    tangent: unit(at.cl_velocity, pass.sense()),
                    cc_length_mm: lengths[0],
                    cl_length_mm: lengths[1],
                });
            }
        }
        Ok(Self(nodes))
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
