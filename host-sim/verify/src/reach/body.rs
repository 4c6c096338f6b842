//! The tool above its ball: solids of revolution about a vertical axis.

use job::{Job, ToolBody};

/// Height of the tool's upper end above the ball's centre, mm: higher than anything in the machine.
const TOP_MM: f64 = 1e5;

/// A part of the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ToolPart {
    /// The ball itself.
    Ball,
    /// The stem of the ball's diameter.
    Neck,
    /// The shank.
    Shank,
    /// A part of the holder, from 1 at its face.
    Holder(usize),
}

impl ToolPart {
    /// Its name.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Ball => "ball".to_owned(),
            Self::Neck => "neck".to_owned(),
            Self::Shank => "shank".to_owned(),
            Self::Holder(1) => "holder".to_owned(),
            Self::Holder(number) => format!("holder part {number}"),
        }
    }
}

/// A cylinder or a frustum around the tool's axis. Heights are from the ball's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// The part that it belongs to.
    pub part: ToolPart,
    /// Heights of its ends, mm, ascending.
    pub z: [f64; 2],
    /// Radii at its ends, mm.
    pub radius: [f64; 2],
}

/// The solids of a job's tool, without the ball, from below. The last one reaches up beyond everything.
#[must_use]
pub fn solids(job: &Job) -> Vec<Solid> {
    let ball = job.radius_mm;
    let ToolBody {
        shank_mm,
        neck_mm,
        length_mm,
        holder,
    } = &job.body;
    let shank = shank_mm.map_or(ball, |diameter| 0.5 * diameter);
    let from = neck_mm.unwrap_or(ball) - ball;
    let face = length_mm.map_or(TOP_MM, |length| length - ball);
    let mut solids = Vec::new();
    if from > 0.0 {
        solids.push(Solid {
            part: ToolPart::Neck,
            z: [0.0, from],
            radius: [ball; 2],
        });
    }
    solids.push(Solid {
        part: ToolPart::Shank,
        z: [from, if holder.is_empty() { TOP_MM } else { face }],
        radius: [shank; 2],
    });
    let mut z = face;
    for (number, part) in (1..).zip(holder) {
        solids.push(Solid {
            part: ToolPart::Holder(number),
            z: [z, z + part.length_mm],
            radius: part.diameter_mm.map(|diameter| 0.5 * diameter),
        });
        z += part.length_mm;
    }
    if let (Some(last), false) = (solids.last().copied(), holder.is_empty()) {
        solids.push(Solid {
            z: [z, TOP_MM],
            radius: [last.radius[1]; 2],
            ..last
        });
    }
    solids
}

impl Solid {
    /// Sine and cosine of the angle between its side and the axis; the sine is above 0 where it widens upwards.
    pub(super) fn slope(&self) -> [f64; 2] {
        let (out, up) = (self.radius[1] - self.radius[0], self.z[1] - self.z[0]);
        let length = out.hypot(up);
        [out / length, up / length]
    }

    /// Radius at a height, which is taken to the nearest within the solid.
    pub(super) fn radius_at(&self, z: f64) -> f64 {
        let share = (z.clamp(self.z[0], self.z[1]) - self.z[0]) / (self.z[1] - self.z[0]);
        self.radius[0] + (self.radius[1] - self.radius[0]) * share
    }

    /// Depth of a vertical line at the distance `rho` from the axis, from height `z[0]` to `z[1]`: the shortest motion that frees it; below
    /// zero its distance from the solid. Exact; changes by at most as much as the line is moved.
    #[must_use]
    pub fn depth(&self, rho: f64, z: [f64; 2]) -> f64 {
        let overlap = [z[0].max(self.z[0]), z[1].min(self.z[1])];
        if overlap[0] <= overlap[1] {
            let [_, cosine] = self.slope();
            let widest = self.radius_at(overlap[0]).max(self.radius_at(overlap[1]));
            let side = (widest - rho) * cosine;
            let depth = side.min(z[1] - self.z[0]).min(self.z[1] - z[0]);
            if depth >= 0.0 {
                return depth;
            }
        }
        // Outside: between the ends of either.
        let corner = |end: usize| {
            let beyond = (z[0] - self.z[end]).max(self.z[end] - z[1]).max(0.0);
            (rho - self.radius[end]).max(0.0).hypot(beyond)
        };
        let line_end = |z: f64| {
            let [bottom, top] =
                [0, 1].map(|end| (rho - self.radius[end]).max(0.0).hypot((z - self.z[end]).abs()));
            bottom.min(top).min(self.side_distance(rho, z))
        };
        -corner(0).min(corner(1)).min(line_end(z[0])).min(line_end(z[1]))
    }

    /// Distance of a point outside from the side of the solid.
    fn side_distance(&self, rho: f64, z: f64) -> f64 {
        let (out, up) = (self.radius[1] - self.radius[0], self.z[1] - self.z[0]);
        let (to_out, to_up) = (rho - self.radius[0], z - self.z[0]);
        let share = ((to_out * out + to_up * up) / (out * out + up * up)).clamp(0.0, 1.0);
        (to_out - share * out).hypot(to_up - share * up)
    }
}

/// Depth of a vertical line in a ball around the origin, as [`Solid::depth`].
pub(super) fn ball_depth(radius: f64, rho: f64, z: [f64; 2]) -> f64 {
    radius - rho.hypot(z[0].max(-z[1]).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance to the solid by dense sampling of its section, and of the line.
    fn sampled(solid: &Solid, rho: f64, z: [f64; 2]) -> f64 {
        let mut least = f64::INFINITY;
        for i in 0..=400 {
            let height = solid.z[0] + (solid.z[1] - solid.z[0]) * f64::from(i) / 400.0;
            let radius = solid.radius_at(height);
            for j in 0..=40 {
                let at = z[0] + (z[1] - z[0]) * f64::from(j) / 40.0;
                least = least.min((rho - radius).max(0.0).hypot(at - height));
            }
        }
        least
    }

    #[test]
    fn depths_are_those_of_cylinders_and_cones() {
        let solid = |z, radius| Solid {
            part: ToolPart::Shank,
            z,
            radius,
        };
        let cylinder = solid([0.0, 10.0], [3.0, 3.0]);
        for (rho, z, depth) in [
            (2.0, 5.0, 1.0),
            (0.0, 9.5, 0.5),
            (2.9, 0.05, 0.05),
            (4.0, 5.0, -1.0),
            (1.0, -2.0, -2.0),
            (6.0, 14.0, -5.0),
            (3.0, 5.0, 0.0),
        ] {
            let found = cylinder.depth(rho, [z; 2]);
            assert!((found - depth).abs() < 1e-12, "{rho} {z}: {found}");
        }
        // A wall beside the shank, from below to above.
        assert!((cylinder.depth(2.5, [-5.0, 50.0]) - 0.5).abs() < 1e-12);
        assert!((cylinder.depth(3.5, [-5.0, 50.0]) + 0.5).abs() < 1e-12);
        // A cone of 45 degrees: half-way up its radius is 4.
        let cone = solid([0.0, 4.0], [2.0, 6.0]);
        let found = cone.depth(3.0, [2.0; 2]);
        assert!((found - 0.5_f64.sqrt()).abs() < 1e-12, "{found}");
        let found = cone.depth(5.0, [2.0; 2]);
        assert!((found + 0.5_f64.sqrt()).abs() < 1e-12, "{found}");
        let mut random = 1_u64;
        let mut next = |low: f64, high: f64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            low + (high - low) * (random >> 11) as f64 / (1_u64 << 53) as f64
        };
        for solid in [
            cylinder,
            cone,
            solid([1.0, 3.0], [5.0, 0.5]),
            solid([-1.0, 0.5], [0.1, 4.0]),
        ] {
            for _ in 0..300 {
                let low = next(-6.0, 14.0);
                let z = [low, low + next(0.0, 4.0).max(0.5) - 0.5];
                let (rho, depth) = (next(0.0, 9.0), 0.0_f64);
                let found = solid.depth(rho, z);
                let exact = sampled(&solid, rho, z);
                if found < 0.0 {
                    assert!(
                        (found + exact).abs() < 0.05,
                        "{solid:?} {rho} {z:?}: {found} {exact}"
                    );
                } else {
                    assert!(exact < 0.05, "{solid:?} {rho} {z:?}: {found} {exact} {depth}");
                }
            }
        }
    }

    #[test]
    fn a_tool_is_its_solids() {
        let text = include_str!("../../../../jobs/torus.toml").replace(
            "[tool]",
            "[tool]\nshank_mm = 4\nneck_mm = 8\nlength_mm = 30\nholder = { diameter_mm = [20, 40], length_mm = 10 }",
        );
        let solids = solids(&job_file::parse("a", &text).unwrap());
        let shown: Vec<_> = solids.iter().map(|s| (s.part, s.z, s.radius)).collect();
        assert_eq!(
            shown,
            [
                (ToolPart::Neck, [0.0, 3.0], [5.0; 2]),
                (ToolPart::Shank, [3.0, 25.0], [2.0; 2]),
                (ToolPart::Holder(1), [25.0, 35.0], [10.0, 20.0]),
                (ToolPart::Holder(1), [35.0, TOP_MM], [20.0; 2]),
            ]
        );
    }
}
