//! Jobs encoded as a vector of numbers (genes) for the search.

use fastrand::Rng;

use job::{
    Along, AxisLimits, Job, MachineSpec, NurbsSpec, Pattern, Region, Side, Spacing, Start, SurfaceSpec,
};

/// Number of genes.
const GENES: usize = 21;

/// Greatest number of patches that fit the board's store: rational, non-rational.
const PATCHES_MAX: [usize; 2] = [230, 300];

/// A parameter of a job; its value is the gene's index.
#[derive(Clone, Copy)]
enum Gene {
    Kind,
    PathSpans,
    SideSpans,
    DegreeU,
    DegreeV,
    LengthPath,
    LengthSide,
    Arc,
    Radius,
    Scallop,
    Bump,
    Weights,
    Uneven,
    Pole,
    Along,
    Pattern,
    Stretch,
    Origin,
    Velocity,
    Acceleration,
    Jerk,
}

/// What the jobs of a search have in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JobClass {
    /// Axis limits.
    pub limits: bool,
    /// Passes of constant scallop height.
    pub constant: bool,
    /// A region with a hole.
    pub region: bool,
}

/// The region of [`JobClass::region`], in shares of the surface's parameters: slanted ends, a notch, a hole.
const OUTLINE: [[f64; 2]; 7] = [
    [0.05, 0.0],
    [1.0, 0.0],
    [1.0, 0.4],
    [0.8, 0.5],
    [1.0, 0.6],
    [0.95, 1.0],
    [0.2, 1.0],
];
const HOLE: [[f64; 2]; 6] = [
    [0.45, 0.35],
    [0.55, 0.3],
    [0.65, 0.35],
    [0.65, 0.5],
    [0.55, 0.6],
    [0.45, 0.5],
];

/// A job as numbers from 0 to 1, and the seed of its random details.
#[derive(Clone, Debug, PartialEq)]
pub struct Genes {
    numbers: [f64; GENES],
    seed: u64,
}

impl Genes {
    /// A uniformly random job.
    pub fn random(random: &mut Rng) -> Self {
        Self {
            numbers: std::array::from_fn(|_| random.f64()),
            seed: random.u64(..),
        }
    }

    /// A random job with one adversarial property.
    pub fn adversarial(random: &mut Rng) -> Self {
        let mut genes = Self::random(random);
        let property = random.u8(..5);
        let mut set = |gene: Gene, from: f64, to: f64| {
            genes.numbers[gene as usize] = from + (to - from) * random.f64();
        };
        set(Gene::Kind, 0.2, 0.75);
        // Few patches, because loading many takes seconds.
        set(Gene::PathSpans, 0.0, 0.5);
        set(Gene::SideSpans, 0.0, 0.3);
        match property {
            // Hundreds of side spans within one path interval: the schedule walks over them.
            0 => {
                set(Gene::SideSpans, 0.9, 1.0);
                set(Gene::PathSpans, 0.0, 0.05);
                set(Gene::LengthPath, 0.2, 0.4);
                set(Gene::LengthSide, 0.0, 0.4);
                set(Gene::Arc, 0.2, 0.6);
                set(Gene::Radius, 0.5, 0.8);
                set(Gene::Scallop, 0.7, 1.0);
                set(Gene::Bump, 0.0, 0.1);
                set(Gene::Pole, 0.0, 0.3);
                set(Gene::Uneven, 0.0, 0.3);
                set(Gene::Stretch, 0.0, 0.5);
            }
            // Patches shorter than a period's arc.
            1 => {
                set(Gene::PathSpans, 0.3, 0.7);
                set(Gene::SideSpans, 0.0, 0.1);
                set(Gene::Arc, 0.5, 1.0);
                set(Gene::Bump, 0.0, 0.3);
            }
            // Short passes, weights at their limit, an uneven parametrisation.
            2 => {
                set(Gene::Weights, 0.9, 1.0);
                set(Gene::Stretch, 0.5, 1.0);
                set(Gene::LengthPath, 0.0, 0.4);
            }
            // Poles.
            3 => {
                set(Gene::Pole, 0.4, 1.0);
                set(Gene::Bump, 0.0, 0.3);
            }
            _ => set(Gene::Kind, 0.0, 1.0),
        }
        genes
    }

    /// A copy with up to three genes changed, slightly or completely.
    #[must_use]
    pub fn mutated(&self, random: &mut Rng) -> Self {
        let mut genes = self.clone();
        for _ in 0..random.u8(1..4) {
            let number = &mut genes.numbers[random.usize(..GENES)];
            *number = if random.u8(..4) == 0 {
                random.f64()
            } else {
                // About normal, standard deviation 0.06.
                let sum: f64 = (0..4).map(|_| random.f64() - 0.5).sum();
                (*number + 0.1 * sum).clamp(0.0, 1.0)
            };
        }
        if random.u8(..5) == 0 {
            genes.seed = random.u64(..);
        }
        genes
    }

    fn gene(&self, gene: Gene) -> f64 {
        self.numbers[gene as usize]
    }

    /// The gene mapped to a range of positive numbers, logarithmically.
    fn log(&self, gene: Gene, from: f64, to: f64) -> f64 {
        from * (to / from).powf(self.gene(gene))
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small and positive"
    )]
    fn count(&self, gene: Gene, most: f64) -> usize {
        self.log(gene, 1.0, most).round() as usize
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 3")]
    fn degree(&self, gene: Gene) -> usize {
        1 + (2.999 * self.gene(gene)) as usize
    }

    /// Decodes the job of a class.
    #[must_use]
    pub fn job(&self, class: JobClass) -> Job {
        let limits = class.limits;
        let mut random = Rng::with_seed(self.seed);
        let surface = match self.gene(Gene::Kind) {
            kind if kind < 0.1 => self.revolved(&mut random),
            kind if kind < 0.2 => self.bicubic(&mut random),
            kind if kind < 0.45 => self.nurbs(&mut random, false),
            kind if kind < 0.9 => self.nurbs(&mut random, true),
            _ => self.ruled(&mut random),
        };
        let radius_mm = self.log(Gene::Radius, 0.05, 500.0);
        let region = class.region.then(|| region_of(&surface));
        Job {
            surface,
            radius_mm,
            body: job::ToolBody::default(),
            setup: job::Setup::default(),
            region,
            // Up to 10 mm in a period of a millisecond, which is the limit.
            feed_mm_min: self.log(Gene::Arc, 60.0, 600_000.0),
            scallop_mm: radius_mm * self.log(Gene::Scallop, 1e-4, 0.95),
            along: self.along(),
            side: match random.bool() {
                // With limits the tool retracts upwards between the passes.
                _ if limits => Side::Up,
                true => Side::Plus,
                false => Side::Minus,
            },
            pattern: if self.gene(Gene::Pattern) < 0.5 {
                Pattern::Zig
            } else {
                Pattern::Zigzag
            },
            spacing: if class.constant {
                Spacing::Constant(Start::Edge)
            } else {
                Spacing::Exact
            },
            chord_mm: 0.5 * radius_mm,
            overrun_mm: 0.0,
            machine: if limits {
                self.machine()
            } else {
                MachineSpec::default()
            },
            origin: job::Origin::default(),
        }
    }

    /// A machine with limits, from those that reach the velocity limit within some periods to those that never do.
    fn machine(&self) -> MachineSpec {
        let axes = |most: f64| [most, most, 0.5 * most];
        MachineSpec {
            limits: Some(AxisLimits {
                velocity_mm_s: axes(self.log(Gene::Velocity, 10.0, 1000.0)),
                acceleration_mm_s2: axes(self.log(Gene::Acceleration, 100.0, 20_000.0)),
                jerk_mm_s3: axes(self.log(Gene::Jerk, 1e3, 1e6)),
            }),
            ..MachineSpec::default()
        }
    }

    fn along(&self) -> Along {
        if self.gene(Gene::Along) < 0.5 {
            Along::U
        } else {
            Along::V
        }
    }

    /// A pair for the path and the side parameter in the order u, v.
    fn by_parameter<T>(&self, path: T, side: T) -> [T; 2] {
        match self.along() {
            Along::U => [path, side],
            Along::V => [side, path],
        }
    }

    /// Lengths of the part along u and v, mm.
    fn lengths(&self) -> [f64; 2] {
        self.by_parameter(
            self.log(Gene::LengthPath, 0.05, 200.0),
            self.log(Gene::LengthSide, 0.05, 200.0),
        )
    }

    fn bump(&self) -> f64 {
        let [u, v] = self.lengths();
        u.min(v) * self.log(Gene::Bump, 1e-4, 1.0)
    }

    /// Offset from the origin, mm: far from it the unit of the fixed-point format is coarser.
    fn origin(&self) -> f64 {
        1000.0 * (self.gene(Gene::Origin) - 0.5).max(0.0)
    }

    fn revolved(&self, random: &mut Rng) -> SurfaceSpec {
        let [u, v] = self.lengths();
        let bump = self.bump();
        let mut cubic =
            |last: f64, constant: f64| [bump * random.f64(), -bump * random.f64(), last, constant];
        SurfaceSpec::Revolved {
            radius_mm: cubic(0.3 * u, 2.0 * bump + v),
            height_mm: cubic(u, 0.0),
            u: [0.0, 1.0],
            v_rad: [0.0, 0.1 + 6.0 * self.gene(Gene::Uneven)],
        }
    }

    fn bicubic(&self, random: &mut Rng) -> SurfaceSpec {
        let bump = self.bump();
        let [u, v] = self.lengths();
        let mut coefficients_mm = [[[0.0; 4]; 4]; 3];
        for value in coefficients_mm.iter_mut().flatten().flatten() {
            *value = bump * (random.f64() - 0.5);
        }
        coefficients_mm[0][2][3] += u;
        coefficients_mm[1][3][2] += v;
        coefficients_mm[0][3][3] += self.origin();
        SurfaceSpec::Bicubic {
            coefficients_mm,
            u: [0.0, 1.0],
            v: [0.0, 1.0],
        }
    }

    fn ruled(&self, random: &mut Rng) -> SurfaceSpec {
        let bump = self.bump();
        let [u, v] = self.lengths();
        let mut rail = |y: f64| {
            let mut cubics = [[0.0; 4]; 3];
            for value in cubics.iter_mut().flatten() {
                *value = bump * (random.f64() - 0.5);
            }
            cubics[0][2] += u;
            cubics[1][3] += y;
            cubics
        };
        SurfaceSpec::Ruled {
            rail0_mm: rail(0.0),
            rail1_mm: rail(v),
            u: [0.0, 1.0],
            v: [0.0, 1.0],
        }
    }

    /// Clamped knots of `spans` spans with random widths.
    fn knots(&self, random: &mut Rng, spans: usize, degree: usize) -> Vec<f64> {
        let factor = 1000_f64.powf(self.gene(Gene::Uneven));
        let mut at = 0.0;
        let mut knots = vec![0.0; degree + 1];
        for _ in 0..spans {
            at += factor.powf(random.f64() - 0.5);
            knots.push(at);
        }
        knots.extend(std::iter::repeat_n(at, degree));
        knots
    }

    fn nurbs(&self, random: &mut Rng, rational: bool) -> SurfaceSpec {
        let path = self.count(Gene::PathSpans, 150.0);
        let most = PATCHES_MAX[usize::from(!rational)];
        let side = self.count(Gene::SideSpans, 300.0).min(most / path).max(1);
        let spans = self.by_parameter(path, side);
        let degree = [self.degree(Gene::DegreeU), self.degree(Gene::DegreeV)];
        let [knots_u, knots_v] = [0, 1].map(|k| self.knots(random, spans[k], degree[k]));
        let abscissae = |knots: &[f64], degree: usize| -> Vec<f64> {
            let end = knots[knots.len() - 1];
            // Greville abscissae, which make the parametrisation uniform, raised to a power to make it non-uniform.
            let even = knots[1..knots.len() - 1].windows(degree);
            #[allow(clippy::cast_precision_loss, reason = "at most 3")]
            let even = even.map(|window| window.iter().sum::<f64>() / degree as f64 / end);
            let power = 4_f64.powf(2.0 * (self.gene(Gene::Stretch) - 0.5).max(0.0));
            even.map(|abscissa| abscissa.powf(power)).collect()
        };
        let [u, v] = [abscissae(&knots_u, degree[0]), abscissae(&knots_v, degree[1])];
        let [length_u, length_v] = self.lengths();
        let ratio = 4_f64.powf(self.gene(Gene::Weights));
        let bump = self.bump();
        let mut poles_mm: Vec<Vec<[f64; 4]>> = Vec::new();
        for x in &u {
            let row = v.iter().map(|y| {
                let weight = if rational { ratio.powf(random.f64()) } else { 1.0 };
                let z = bump * (random.f64() - 0.5);
                [length_u * x + self.origin(), length_v * y, z, weight]
            });
            poles_mm.push(row.collect());
        }
        self.collapse(&mut poles_mm);
        let first = poles_mm[0][0][3];
        let rational = poles_mm
            .iter()
            .flatten()
            .any(|pole| pole[3].to_bits() != first.to_bits());
        if !rational {
            poles_mm.iter_mut().flatten().for_each(|pole| pole[3] = 1.0);
        }
        SurfaceSpec::Nurbs(NurbsSpec {
            degree,
            knots_u,
            knots_v,
            poles_mm,
            rational,
        })
    }

    /// Collapses a boundary into a point, depending on the gene.
    fn collapse(&self, poles_mm: &mut [Vec<[f64; 4]>]) {
        let pole = self.gene(Gene::Pole);
        let last = poles_mm.len() - 1;
        if (0.4..0.55).contains(&pole) || pole >= 0.85 {
            let row = if pole < 0.5 { 0 } else { last };
            let point = poles_mm[row][0];
            for other in &mut poles_mm[row] {
                other[..3].copy_from_slice(&point[..3]);
            }
        } else if (0.55..0.85).contains(&pole) {
            let column = if pole < 0.7 { 0 } else { poles_mm[0].len() - 1 };
            let point = poles_mm[0][column];
            for row in poles_mm {
                row[column][..3].copy_from_slice(&point[..3]);
            }
        }
    }
}

/// The region on a surface.
fn region_of(surface: &SurfaceSpec) -> Region {
    let [u, v] = surface.domain();
    let place = |[from, to]: [f64; 2], share: f64| from + share * (to - from);
    let on = |points: &[[f64; 2]]| {
        let points = points.iter();
        points.map(|[x, y]| [place(u, *x), place(v, *y)]).collect()
    };
    Region::new(vec![on(&OUTLINE), on(&HOLE)])
}
