//! Fronts against closed forms, against the figures of an independent implementation, and on seeded difficult surfaces.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;
use job::{Along, Job, NurbsSpec, Side, SurfaceSpec};

#[path = "../../../../tests/scallop_limit/shapes.rs"]
mod shapes;

fn sample_job(name: &str) -> Job {
    let text = match name {
        "bell" => include_str!("../../../../jobs/revolved.toml"),
        "bell around" => include_str!("../../../../jobs/revolved_v.toml"),
        "sphere" => include_str!("../../../../jobs/sphere_cap.toml"),
        "groove" => include_str!("../../../../jobs/torus.toml"),
        "mouse" => include_str!("../../../../jobs/freeform.toml"),
        other => panic!("no sample job {other}"),
    };
    job_file::parse(name, text).unwrap()
}

/// A B-spline surface without inner knots, ball 5 mm, scallop 0.005 mm, passes along u.
fn patch(degree: [usize; 2], poles_mm: Vec<Vec<[f64; 4]>>) -> Job {
    let knots = |degree: usize| [vec![0.0; degree + 1], vec![1.0; degree + 1]].concat();
    let mut job = sample_job("sphere");
    job.surface = SurfaceSpec::Nurbs(NurbsSpec {
        degree,
        knots_u: knots(degree[0]),
        knots_v: knots(degree[1]),
        poles_mm,
        rational: true,
    });
    job
}

/// A twisted ruled fan, 80 mm long, 21 mm wide at u = 0 and 81 mm at u = 1.
fn fan() -> Job {
    let pole = |x: f64, y: f64, z: f64| [x, y, z, 1.0];
    let start = vec![pole(0.0, -10.0, 0.0), pole(0.0, 10.0, 6.0)];
    let end = vec![pole(80.0, -40.0, 4.0), pole(80.0, 40.0, -8.0)];
    patch([1, 1], vec![start, end])
}

/// A quarter of a torus of 30 mm and 15 mm, 20 to 160 degrees of its section; passes along the section.
fn torus() -> Job {
    let (half, quarter) = (35.0_f64.to_radians().cos(), 0.5_f64.sqrt());
    let row = |k: u32| {
        let (sin, cos) = (20.0 + 35.0 * f64::from(k)).to_radians().sin_cos();
        let (tube, weight) = if k % 2 == 1 {
            (15.0 / half, half)
        } else {
            (15.0, 1.0)
        };
        let (r, z) = (30.0 + tube * cos, tube * sin);
        vec![
            [r, 0.0, z, weight],
            [r, r, z, weight * quarter],
            [0.0, r, z, weight],
        ]
    };
    let mut job = patch([2, 2], (0..5).map(row).collect());
    if let SurfaceSpec::Nurbs(nurbs) = &mut job.surface {
        nurbs.knots_u = vec![0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0];
    }
    job
}

fn length_mm(fronts: &Fronts<'_>) -> f64 {
    let segments = fronts.segments().unwrap();
    segments.iter().flatten().map(|segment| segment.length_mm).sum()
}

/// Angle between two passes on a convex circle of this radius between which a ball leaves this height: the crest is half way, and
/// (R + r) cos a - sqrt(r^2 - (R + r)^2 sin^2 a) = R + h.
fn convex_step_rad(circle: f64, ball: f64, height: f64) -> f64 {
    let at = |angle: f64| {
        let (sin, cos) = (0.5 * angle).sin_cos();
        let reach = circle + ball;
        reach * cos - (ball * ball - (reach * sin).powi(2)).sqrt() - circle
    };
    let (mut low, mut high) = (0.0, ball / (circle + ball));
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if at(middle) < height {
            low = middle
        } else {
            high = middle
        }
    }
    low
}

/// On a cylinder, passes along its axis are the closed form's angle apart.
#[test]
fn cylinder_steps_by_the_closed_form() {
    let mut job = sample_job("bell");
    job.surface = SurfaceSpec::Revolved {
        radius_mm: [0.0, 0.0, 0.0, 20.0],
        height_mm: [0.0, 0.0, 30.0, 0.0],
        u: [0.0, 1.0],
        v_rad: [0.0, FRAC_PI_2],
    };
    job.side = Side::Minus;
    let oracle = Oracle::new(&job).unwrap();
    let mut side = Side::Minus;
    if oracle.contact(0.5, 0.3).unwrap().curvature_side > 0.0 {
        side = Side::Plus;
    }
    job.side = side;
    let oracle = Oracle::new(&job).unwrap();
    let options = FrontOptions::default();
    let fronts = Fronts::new(&oracle, StartLine::Edge, &options).unwrap();
    let want = convex_step_rad(20.0, job.radius_mm, options.margin * job.scallop_mm) / FRAC_PI_2;
    let passes = &fronts.parts[0].passes;
    assert!(passes.len() > 10);
    for (number, pass) in passes[..passes.len() - 1].iter().enumerate() {
        for value in pass.values() {
            let share = value - number as f64 * want;
            assert!(
                share.abs() < 1e-6 * want * (number as f64 + 1.0),
                "pass {number}: {share}"
            );
        }
    }
}

/// On a sphere the passes are small circles parallel to the first meridian, until the boundary of its end is in the way.
#[test]
fn sphere_steps_by_the_closed_form() {
    let job = sample_job("sphere");
    let oracle = Oracle::new(&job).unwrap();
    let options = FrontOptions::default();
    let fronts = Fronts::new(&oracle, StartLine::Edge, &options).unwrap();
    let want = convex_step_rad(25.0, job.radius_mm, options.margin * job.scallop_mm);
    // The first meridian is in the plane y = 0.
    for (number, pass) in fronts.parts[0].passes.iter().enumerate().take(12) {
        for x in [0.5, 0.6, 0.7] {
            let (u, v) = oracle.swapped(x, pass.at(x)[0]);
            let point = oracle.surface.at(u, v).point;
            let angle = (point.y / 25.0).asin();
            assert!(
                (angle - number as f64 * want).abs() < 1e-3 * want * (number as f64 + 1.0),
                "pass {number} at {x}: {} of {}",
                angle / want,
                number
            );
        }
    }
}

/// Against lengths of an independent implementation (section 7 of the design), which slows the front at the ends and limits its bends by more than needed:
/// not longer, at the same margin, and shorter by 4 % at most.
#[test]
fn lengths_of_the_prototype() {
    let mut along_v = sample_job("mouse");
    along_v.along = Along::V;
    let (edge, middle) = (StartLine::Edge, StartLine::Middle);
    for (name, job, start, want) in [
        ("bell", sample_job("bell"), edge, 14370.0),
        ("bell", sample_job("bell"), middle, 14465.0),
        ("sphere", sample_job("sphere"), edge, 1278.0),
        ("sphere", sample_job("sphere"), middle, 1272.0),
        ("torus", torus(), edge, 4217.0),
        ("torus", torus(), middle, 4056.0),
        ("fan", fan(), edge, 9342.0),
        ("fan", fan(), middle, 9294.0),
        ("mouse", sample_job("mouse"), edge, 10468.0),
        ("mouse", sample_job("mouse"), middle, 10220.0),
        ("mouse along v", along_v, edge, 9732.0),
    ] {
        let oracle = Oracle::new(&job).unwrap();
        let options = FrontOptions {
            margin: 0.98,
            ..FrontOptions::default()
        };
        let fronts = Fronts::new(&oracle, start, &options).unwrap();
        let length = length_mm(&fronts);
        let share = length / want;
        println!("{name} {start:?}: {length:.1} mm, {share:.4} of the prototype's");
        assert!(
            share > 0.96 && share < 1.001,
            "{name} {start:?}: {length} mm of {want}"
        );
    }
}

/// Where straight passes are the best, as many of them as straight passes have.
#[test]
fn no_longer_than_straight_where_straight_is_best() {
    for (name, passes) in [("groove", 24), ("bell around", 110)] {
        let job = sample_job(name);
        let oracle = Oracle::new(&job).unwrap();
        let fronts = Fronts::new(&oracle, StartLine::Edge, &FrontOptions::default()).unwrap();
        assert_eq!(fronts.parts[0].passes.len(), passes, "{name}");
        let [low, high] = oracle.path_range();
        let schedule = oracle.schedule().unwrap();
        let straight: f64 = schedule
            .iter()
            .map(|pass| oracle.arc_length(low, high, pass.side))
            .sum();
        assert!(length_mm(&fronts) <= straight * 1.0001, "{name}");
    }
}

/// Crests by the swept ball are within the limit, and near it on the mean.
#[test]
fn crests_hold_the_limit() {
    for (name, job, start, mean) in [
        ("sphere", sample_job("sphere"), StartLine::Middle, 0.95),
        ("groove", sample_job("groove"), StartLine::Edge, 0.97),
        ("fan", fan(), StartLine::Middle, 0.97),
    ] {
        let oracle = Oracle::new(&job).unwrap();
        let fronts = Fronts::new(&oracle, start, &FrontOptions::default()).unwrap();
        let crests = fronts.crests().unwrap();
        let [most, average] = [crests.max_mm, crests.mean_mm].map(|height| height / job.scallop_mm);
        println!("{name} {start:?}: {most:.4} of the limit, mean {average:.4}");
        assert!(most <= 1.0 && average >= mean, "{name} {start:?}: {crests:?}");
    }
}

/// Skew ends, jumps of curvature, tapers, short passes, weights, lenses: smooth along the passes and without poles.
#[test]
fn difficult_surfaces() {
    let mut measured = 0;
    for seed in 0..42_u64 {
        let shape = shapes::SHAPES[usize::try_from(seed).unwrap() % shapes::SHAPES.len()];
        let job = shapes::random_job(
            shape,
            &mut shapes::Random(seed.wrapping_mul(0x1234_5678_9abc_def1)),
        );
        let is_smooth = matches!(&job.surface, SurfaceSpec::Nurbs(nurbs) if nurbs.degree[0] > 1);
        if shape == shapes::Shape::Pole || !is_smooth {
            continue;
        }
        let oracle = Oracle::new(&job).unwrap();
        let Ok(fronts) = Fronts::new(&oracle, StartLine::Edge, &FrontOptions::default()) else {
            continue;
        };
        let crests = fronts.crests().unwrap();
        assert!(crests.max_mm <= job.scallop_mm, "{shape:?} {seed}: {crests:?}");
        let bends = fronts.bends().unwrap();
        let sample_mm = job.feed_mm_s() * job.machine.period_s();
        assert!(
            bends.stretch_per_mm * sample_mm < 0.125,
            "{shape:?} {seed}: {bends:?}"
        );
        assert!(bends.angle_rad < 0.5 * PI);
        for part in &fronts.parts {
            for pair in part.passes.windows(2) {
                let rises = pair[0]
                    .values()
                    .iter()
                    .zip(pair[1].values())
                    .all(|(a, b)| b >= a || *b == 1.0);
                assert!(rises, "{shape:?} {seed}");
            }
        }
        measured += 1;
    }
    assert!(measured >= 15, "{measured}");
}
