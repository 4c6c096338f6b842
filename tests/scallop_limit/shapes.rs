//! Seeded random surfaces with what makes the step to the next pass difficult: skew and bent ends, curvature that jumps, lines that converge, poles, short
//! passes, weights.

use job::{Along, AxisLimits, Job, NurbsSpec, Pattern, Side, Spacing, SurfaceSpec};

/// Seeded numbers (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Between two limits.
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = self.0;
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let share = (word ^ (word >> 31)) as f64 / 2_f64.powi(64);
        low + (high - low) * share
    }

    pub(crate) fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        let index = self.within(0.0, choices.len() as f64) as usize;
        choices[index.min(choices.len() - 1)]
    }

    /// True in this share of the cases.
    fn chance(&mut self, share: f64) -> bool {
        self.within(0.0, 1.0) < share
    }

    /// Between two limits above 0, evenly by the logarithm.
    pub(crate) fn log_within(&mut self, low: f64, high: f64) -> f64 {
        self.within(low.ln(), high.ln()).exp()
    }
}

/// What is difficult about a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    /// Side lines up to 60 degrees from the right angle, other at each end, straight or bent; bulging.
    Skew,
    /// Degree 2 both ways, several spans: the curvature jumps at each knot.
    Jumps,
    /// Side lines or path lines that converge, by up to 1:20.
    Taper,
    /// An edge that is a point, across the passes or along them.
    Pole,
    /// Passes of 1 to 4 mm.
    Short,
    /// Weights between 0.6 and 1.6.
    Rational,
    /// A cap of a sphere or an ellipsoid over a skew quadrilateral.
    Lens,
}

pub(crate) const SHAPES: [Shape; 7] = [
    Shape::Skew,
    Shape::Jumps,
    Shape::Taper,
    Shape::Pole,
    Shape::Short,
    Shape::Rational,
    Shape::Lens,
];

/// Clamped uniform knots of this degree and number of spans.
fn knots(degree: usize, spans: usize) -> Vec<f64> {
    let inner = (1..spans).map(|knot| knot as f64 / spans as f64);
    let [start, end] = [0.0, 1.0].map(|at| vec![at; degree + 1]);
    start.into_iter().chain(inner).chain(end).collect()
}

/// A surface of this shape in passes along u, side by side along v.
pub(crate) fn random_job(shape: Shape, random: &mut Random) -> Job {
    let radius = random.one_of(&[1.0, 2.0, 3.0, 5.0, 8.0]);
    let scallop = random.log_within(0.002, 0.05);
    let step = (8.0 * radius * scallop).sqrt();
    let degree = match shape {
        Shape::Jumps => [2, 2],
        _ => [random.one_of(&[1, 2, 3, 3]), random.one_of(&[2, 3, 3])],
    };
    let most = if shape == Shape::Jumps { 5.0 } else { 3.0 };
    let spans = [0, 1].map(|_| random.within(1.0, most + 1.0) as usize);
    let length = match shape {
        Shape::Short => random.within(1.0, 4.0),
        _ => random.within(3.0, 20.0),
    };
    let width = (step * random.within(6.0, 30.0)).min(40.0);

    // Corners at (u, v) = (0, 0), (1, 0), (0, 1), (1, 1).
    let mut corners = [[0.0, 0.0], [length, 0.0], [0.0, width], [length, width]];
    let mut bent = [0.0; 2];
    match shape {
        Shape::Skew | Shape::Short | Shape::Lens | Shape::Jumps | Shape::Rational => {
            let most: f64 = if shape == Shape::Skew { 60.0 } else { 40.0 };
            let slant = random.within(-most, most);
            let other = if random.chance(0.5) {
                slant
            } else {
                random.within(-most, most)
            };
            let mut tangents = [slant, other].map(|angle| angle.to_radians().tan());
            // The ends of the last pass stay apart.
            let apart = length + width * (tangents[1] - tangents[0]);
            if apart < 0.3 * length {
                tangents = [tangents[0]; 2];
            }
            corners[2][0] += width * tangents[0];
            corners[3][0] += width * tangents[1];
            if random.chance(0.5) {
                bent = [0, 1].map(|_| random.within(-0.1, 0.1) * width.min(length));
            }
        }
        Shape::Taper | Shape::Pole => {
            let end = if shape == Shape::Pole {
                0.0
            } else {
                random.log_within(0.05, 0.8)
            };
            let to = random.within(0.0, 1.0);
            let narrow = |from: [f64; 2], by: [f64; 2]| {
                [0, 1].map(|k| {
                    let middle = from[k] + to * (by[k] - from[k]);
                    (
                        end * from[k] + (1.0 - end) * middle,
                        end * by[k] + (1.0 - end) * middle,
                    )
                })
            };
            let [a, b, c, d] = corners;
            // Converging in the direction of the pass (its end is narrow), or from pass to pass (the last pass is short, or the first).
            let pairs = match random.one_of(&[0, 1, 2]) {
                0 => [1, 3],
                1 => [2, 3],
                _ => [0, 1],
            };
            let all = [a, b, c, d];
            let moved = narrow(all[pairs[0]], all[pairs[1]]);
            corners[pairs[0]] = moved.map(|(from, _)| from);
            corners[pairs[1]] = moved.map(|(_, by)| by);
        }
    }

    let (knots_u, knots_v) = (knots(degree[0], spans[0]), knots(degree[1], spans[1]));
    let greville = |knots: &[f64], degree: usize, index: usize| {
        knots[index + 1..=index + degree].iter().sum::<f64>() / degree as f64
    };
    // Curvatures of the whole and of the waves on it, at most half of the ball's towards it.
    let curvature = |random: &mut Random| random.within(-0.6, 0.15) / radius;
    let whole = match shape {
        Shape::Lens => {
            let first = random.within(-0.6, -0.05) / radius;
            [first, first * random.one_of(&[1.0, 0.5]), 0.0]
        }
        _ => [
            curvature(random) * random.one_of(&[0.0, 0.3, 1.0]),
            curvature(random) * random.one_of(&[0.0, 0.3, 1.0]),
            0.3 * curvature(random),
        ],
    };
    // No surface turns by more than a radian.
    let size = length.max(width);
    let whole = whole.map(|bend: f64| bend.clamp(-1.0 / size, 1.0 / size));
    let pitch = (length / (spans[0] + degree[0]) as f64).min(width / (spans[1] + degree[1]) as f64);
    let waves = match shape {
        Shape::Lens => 0.0,
        Shape::Jumps => random.within(0.02, 0.1),
        _ => random.one_of(&[0.0, 0.02, 0.05]),
    } * pitch
        * pitch
        / radius;
    let rational = shape == Shape::Rational;
    let poles_mm = (0..spans[0] + degree[0])
        .map(|i| {
            (0..spans[1] + degree[1])
                .map(|j| {
                    let u = greville(&knots_u, degree[0], i);
                    let v = greville(&knots_v, degree[1], j);
                    let [mut x, y] = [0, 1].map(|k| {
                        (1.0 - v) * ((1.0 - u) * corners[0][k] + u * corners[1][k])
                            + v * ((1.0 - u) * corners[2][k] + u * corners[3][k])
                    });
                    x += 4.0 * v * (1.0 - v) * ((1.0 - u) * bent[0] + u * bent[1]);
                    let (cx, cy) = (x - 0.5 * length, y - 0.5 * width);
                    let mut z = 0.5 * (whole[0] * cx * cx + whole[1] * cy * cy) + whole[2] * cx * cy;
                    let is_edge = |index: usize, count: usize| index == 0 || index + 1 == count;
                    let pointed = shape == Shape::Pole
                        && (is_edge(i, spans[0] + degree[0]) || is_edge(j, spans[1] + degree[1]));
                    if !pointed {
                        z += waves * random.within(-1.0, 1.0);
                    }
                    let weight = if rational { random.within(0.6, 1.6) } else { 1.0 };
                    [x, y, z, weight]
                })
                .collect()
        })
        .collect();
    let mut machine = job::MachineSpec::default();
    if random.chance(0.3) {
        machine.limits = Some(AxisLimits::DEFAULT);
    }
    Job {
        surface: SurfaceSpec::Nurbs(NurbsSpec {
            degree,
            knots_u,
            knots_v,
            poles_mm,
            rational,
        }),
        radius_mm: radius,
        body: job::ToolBody::default(),
        setup: job::Setup::default(),
        region: None,
        overrun_mm: 0.0,
        feed_mm_min: random.one_of(&[600.0, 1200.0, 3000.0]),
        scallop_mm: scallop,
        along: Along::U,
        side: Side::Up,
        pattern: random.one_of(&[Pattern::Zig, Pattern::Zigzag]),
        spacing: Spacing::Exact,
        chord_mm: 0.005,
        machine,
        origin: Default::default(),
    }
}
