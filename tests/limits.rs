//! The axes' limits on surfaces, feeds and limits chosen at random: paths that bend within tenths of a millimetre, around points and where lines bend at a knot. The
//! campaign tells how far they hold (docs/limits.md).

use interp_core::{Command, State};
use job::{Along, AxisLimits, Job, NurbsSpec, Pattern, Spacing, Start, SurfaceSpec};
use machine::prepare::prepare;

use crate::scallop_limit::shapes::{Random, SHAPES, random_job};
use crate::unusual_motion::used;
use integration_tests::motion::{PERMITTED, Uses};
use integration_tests::sequences::{loaded, period};

/// Periods above which a run is not followed.
const PERIODS_MAX: usize = 2_000_000;

const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// A quarter of a circle: out, up, weight.
const QUARTER: [[f64; 3]; 3] = [[1.0, 0.0, 1.0], [1.0, 1.0, HALF], [0.0, 1.0, 1.0]];

/// A plane job, whose surface is still to be set.
pub(crate) fn plane() -> Job {
    job_file::parse(
        "plane",
        "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [0, 0, 1, 1]\nknots_v = [0, 0, 1, 1]\n\
         poles_mm = [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]\n\
         [tool]\nkind = \"ball\"\nradius_mm = 1.5\n\
         [cut]\nfeed_mm_min = 1200\nscallop_mm = 0.02\nalong = \"v\"\nside = \"up\"\n",
    )
    .unwrap()
}

/// A surface of degree 2 both ways in one rational patch.
fn patch(poles_mm: Vec<Vec<[f64; 4]>>) -> SurfaceSpec {
    let knots = || vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
    SurfaceSpec::Nurbs(NurbsSpec {
        degree: [2, 2],
        knots_u: knots(),
        knots_v: knots(),
        poles_mm,
        rational: true,
    })
}

/// A quarter of a dome, a bell or a cone, sheared, with passes around its point, which is the first or the last line.
fn around_a_point(random: &mut Random) -> Job {
    let radius = random.log_within(3.0, 40.0);
    let height = random.one_of(&[1.0, 1.0, 0.2, 0.5]) * radius;
    let bell = [[1.0, 0.0, 1.0], [0.5, 1.0, 1.0], [0.0, 1.0, 1.0]];
    let cone = [[1.0, 0.0, 1.0], [0.5, 0.5, 1.0], [0.0, 1.0, 1.0]];
    let profile = random.one_of(&[QUARTER, bell, cone]);
    let shear = [random.within(-0.3, 0.3), random.within(0.4, 1.0)];
    let is_first = random.one_of(&[true, false]);
    let poles_mm = QUARTER
        .iter()
        .map(|[x, y, around]| {
            let pole = |[out, up, along]: &[f64; 3]| {
                let [x, y] = [radius * out * x, radius * out * y];
                [x + shear[0] * y, shear[1] * y, height * up, around * along]
            };
            let mut row: Vec<[f64; 4]> = profile.iter().map(pole).collect();
            if is_first {
                row.reverse();
            }
            row
        })
        .collect();
    let mut job = plane();
    job.surface = patch(poles_mm);
    job.along = Along::U;
    job.radius_mm = random.one_of(&[1.0, 2.0, 3.0, 5.0]);
    job.scallop_mm = random.log_within(0.005, 0.1);
    job
}

/// Limits, equal for all axes, or each with a share of its own.
fn random_limits(random: &mut Random, are_equal: bool) -> AxisLimits {
    let jerk = random.log_within(4000.0, 50_000.0);
    let acceleration = random.log_within(200.0, 3000.0);
    let mut shares = || {
        [0, 1, 2].map(|_| {
            let share: f64 = random.one_of(&[1.0, 1.0, 0.5, 0.3, 0.2]);
            if are_equal { 1.0 } else { share }
        })
    };
    AxisLimits {
        velocity_mm_s: shares().map(|share| 100.0 * share.max(0.5)),
        acceleration_mm_s2: shares().map(|share| acceleration * share),
        jerk_mm_s3: shares().map(|share| jerk * share),
    }
}

/// What a run uses of the limits; none where the job is refused, or ends in a fault.
fn uses(job: &Job) -> Option<[f64; 3]> {
    let prepared = prepare(job).ok()?;
    let axes = prepared.header.axes.unwrap();
    let mut core = loaded(&prepared.header, &prepared.words);
    let mut uses = Uses::default();
    let mut sample = period(&mut core, Command::Start);
    for _ in 0..PERIODS_MAX {
        if !sample.state.is_under_way() {
            break;
        }
        uses.add(&sample, &axes, prepared.header.period_s);
        sample = period(&mut core, None);
    }
    (sample.state == State::Finished).then_some(uses.worst)
}

/// A job by its number: a surface around a point, or one of the random shapes, without creases.
fn random_case(number: u64, are_equal: bool) -> Option<Job> {
    let mut random = Random(number.wrapping_mul(0x1234_5678_9abc_def1) | 1);
    let mut job = if number.is_multiple_of(2) {
        around_a_point(&mut random)
    } else {
        random_job(SHAPES[(number / 2) as usize % SHAPES.len()], &mut random)
    };
    job.machine.limits = Some(random_limits(&mut random, are_equal));
    job.along = random.one_of(&[Along::U, Along::U, Along::U, Along::V]);
    job.pattern = random.one_of(&[Pattern::Zig, Pattern::Zigzag]);
    job.feed_mm_min = random.log_within(300.0, 6000.0);
    let has_creases = matches!(&job.surface, SurfaceSpec::Nurbs(spec) if spec.degree.contains(&1));
    (!has_creases).then_some(job)
}

/// Greatest uses over jobs of these numbers. Prints them, and those of each run that is above what is permitted.
fn campaign(numbers: std::ops::Range<u64>, are_equal: bool, spacings: &[Spacing]) -> [f64; 3] {
    let numbers_tried = numbers.clone().count();
    let (mut worst, mut above, mut count) = ([0.0_f64; 3], 0, 0);
    for number in numbers {
        let Some(mut job) = random_case(number, are_equal) else {
            continue;
        };
        for spacing in spacings {
            job.spacing = *spacing;
            let Some(used) = uses(&job) else { continue };
            let is_above = used.iter().zip(PERMITTED).any(|(used, most)| *used > most + 1e-9);
            if is_above {
                println!(
                    "{number} {spacing:?} {:?} F{:.0}: {used:?}",
                    job.pattern, job.feed_mm_min
                );
            }
            count += 1;
            above += usize::from(is_above);
            for (worst, used) in worst.iter_mut().zip(used) {
                *worst = worst.max(used);
            }
        }
    }
    println!("{count} runs, {above} above, at most {worst:?}");
    assert!(count > numbers_tried / 2, "{count} of {numbers_tried} run");
    worst
}

const STRAIGHT: [Spacing; 1] = [Spacing::Exact];
const CURVED: [Spacing; 2] = [Spacing::Constant(Start::Edge), Spacing::Constant(Start::Middle)];

/// Checks what the first runs of the campaign use. 1.00 of an acceleration is wanted.
fn hold(spacings: &[Spacing]) {
    let [velocity, acceleration, jerk] = campaign(0..40, true, spacings);
    assert!(
        velocity <= PERMITTED[0] && acceleration <= 1.05 && jerk <= PERMITTED[2],
        "{velocity} {acceleration} {jerk}"
    );
}

/// Passes over several patches use more of an acceleration: their derivatives are differences of rounded positions.
#[test]
fn straight_passes_hold_their_limits() {
    hold(&STRAIGHT);
}

/// Curved passes beside points use more: fronts wave there from piece to piece.
#[test]
fn curved_passes_hold_their_limits() {
    hold(&CURVED);
}

/// What a plan that had no time for its last steps may use of a jerk above what is permitted.
const JERK_LEFT: f64 = 0.01;

/// Runs of the campaign that used 1.2 to 30 of a limit: stations too far apart, bends at knots, corrections in one move.
#[test]
fn runs_of_the_campaign_that_broke_limits() {
    let straight: &[u64] = &[8, 32, 52, 140, 148, 176, 186, 188];
    let curved: &[u64] = &[41, 73, 101, 107, 129, 171, 181, 199];
    for (numbers, spacings) in [(straight, &STRAIGHT[..]), (curved, &CURVED)] {
        for number in numbers {
            let mut job = random_case(*number, true).unwrap();
            for spacing in spacings {
                job.spacing = *spacing;
                let used = uses(&job).unwrap();
                let holds = used
                    .iter()
                    .zip(PERMITTED)
                    .all(|(used, most)| *used <= most + JERK_LEFT);
                assert!(holds, "{number} {spacing:?}: {used:?}");
            }
        }
    }
}

/// A front whose curve would reach beyond the last boundary between two stations used 3.3 of an acceleration. Another cause leaves 1.06.
#[test]
fn no_corner_at_the_last_boundary() {
    let mut job = random_case(40, true).unwrap();
    for spacing in CURVED {
        job.spacing = spacing;
        let [_, acceleration, _] = uses(&job).unwrap();
        println!("{spacing:?}: {acceleration}");
        assert!(acceleration <= 1.1, "{spacing:?}: acceleration {acceleration}");
    }
}

/// A random spline of degree 2 or 3 each way with inner knots, some close together, whose curvature jumps there or changes steeply.
fn over_knots(number: u64) -> Job {
    let mut random = Random(number.wrapping_mul(0x1234_5678_9abc_def1) | 1);
    let degree = [0, 1].map(|_| random.one_of(&[2_usize, 2, 3]));
    let mut knots = degree.map(|degree| {
        let mut inner: Vec<f64> = (0..random.one_of(&[1, 2, 2, 3]))
            .map(|_| random.within(0.1, 0.9))
            .collect();
        if let [first, second, ..] = &mut inner[..] {
            *second = (*first + random.within(0.01, 0.2)).min(0.95);
        }
        inner.sort_by(f64::total_cmp);
        [vec![0.0; degree + 1], inner, vec![1.0; degree + 1]].concat()
    });
    let [along, across] = [0, 1].map(|way| knots[way].len() - degree[way] - 1);
    let size = random.within(8.0, 25.0);
    #[allow(clippy::cast_precision_loss, reason = "a few poles")]
    let share = |index: usize, count: usize| index as f64 / (count - 1) as f64;
    let narrow = random.within(0.5, 0.9);
    let rise = random.within(0.5, 3.0);
    let poles_mm = (0..along)
        .map(|i| {
            (0..across)
                .map(|j| {
                    let (a, b) = (share(i, along), share(j, across));
                    let mut off = || random.within(-0.02, 0.02) * size;
                    let x = size * a + off();
                    let y = 0.8 * size * b * (1.0 - narrow * (1.0 - a)) + off();
                    [x, y, rise * (3.0 * a + 1.0).sin() * (2.0 * b).cos(), 1.0]
                })
                .collect()
        })
        .collect();
    let [knots_u, knots_v] = std::mem::take(&mut knots);
    let mut job = plane();
    job.surface = SurfaceSpec::Nurbs(NurbsSpec {
        degree,
        knots_u,
        knots_v,
        poles_mm,
        rational: false,
    });
    (job.radius_mm, job.scallop_mm) = (2.0, 0.1);
    job.machine.limits = Some(AxisLimits::DEFAULT);
    job.along = random.one_of(&[Along::U, Along::V]);
    job.pattern = random.one_of(&[Pattern::Zig, Pattern::Zigzag]);
    job.spacing = random.one_of(&CURVED);
    job.feed_mm_min = random.one_of(&[300.0, 1200.0, 3600.0, 9000.0]);
    job
}

/// Curved passes bend where they cross a knot at which the curvature jumps, also close to the next knot: there they used up to 7 of an acceleration and 29 of a jerk. `SEEDS=300` for more.
#[test]
fn curved_passes_over_knots() {
    let seeds = std::env::var("SEEDS").map_or(100, |seeds| seeds.parse().unwrap());
    let (mut worst, mut above, mut count) = ([0.0_f64; 3], 0, 0);
    for number in 0..seeds {
        let Some(used) = uses(&over_knots(number)) else {
            continue;
        };
        count += 1;
        if used[1] > PERMITTED[1] || used[2] > PERMITTED[2] {
            println!("{number}: {used:.3?}");
            above += 1;
        }
        for (worst, used) in worst.iter_mut().zip(used) {
            *worst = worst.max(used);
        }
    }
    println!("{count} runs, {above} above, at most {worst:.3?}");
    assert!(count > seeds / 2, "{count} of {seeds} run");
    assert!(worst[1] <= PERMITTED[1] && worst[2] <= 2.0, "{worst:?}");
}

/// A straight pass that bends within hundredths of a millimetre, between the look-ahead's coarsest stations: 1.79 and 3.55 of the jerk limit where these alone were kept.
#[test]
fn straight_passes_that_bend_within_a_cell() {
    for are_equal in [true, false] {
        let mut job = random_case(134, are_equal).unwrap();
        job.spacing = Spacing::Exact;
        let [_, acceleration, jerk] = uses(&job).unwrap();
        println!("{are_equal}: acceleration {acceleration:.3}, jerk {jerk:.3}");
        assert!(
            acceleration <= PERMITTED[1] && jerk <= PERMITTED[2],
            "{are_equal}: acceleration {acceleration}, jerk {jerk}"
        );
    }
}

/// `RUNS=200 TEST campaign_of_limits -- --ignored --nocapture`
#[test]
#[ignore = "minutes"]
fn campaign_of_limits() {
    let runs = std::env::var("RUNS").map_or(200, |runs| runs.parse().unwrap());
    for are_equal in [true, false] {
        campaign(0..runs, are_equal, &STRAIGHT);
        campaign(0..runs, are_equal, &CURVED);
    }
}

/// What a run uses of accelerations and jerks, as `verify` measures it, is within what it permits.
fn holds(job: &Job, what: &str) {
    let [_, acceleration, jerk] = used(job).shares;
    println!("{what}: acceleration {acceleration:.3}, jerk {jerk:.3}");
    assert!(
        acceleration <= PERMITTED[1] && jerk <= PERMITTED[2],
        "{what}: acceleration {acceleration}, jerk {jerk}"
    );
}

#[test]
fn lines_that_bend_at_a_knot() {
    for degrees in [0.01, 0.05, 0.2, 0.5, 1.0, 5.0, 20.0] {
        holds(
            &bent_lines(degrees),
            &format!("lines that bend by {degrees} degrees"),
        );
    }
}

#[test]
fn circles_of_tenths_of_a_millimetre() {
    for (radius_mm, feed_mm_min) in [(0.15, 600.0), (0.3, 1200.0), (0.5, 6000.0), (0.8, 6000.0)] {
        holds(
            &ring(radius_mm, feed_mm_min),
            &format!("circles of {radius_mm} mm"),
        );
    }
}

/// The next pass begins where the last one is on a boundary with two knots at which its curvature jumps: along it a step-over crept at 0.01 mm/s, for minutes.
#[test]
fn no_link_creeps() {
    let mut job = random_case(17, true).unwrap();
    job.spacing = CURVED[1];
    let prepared = prepare(&job).unwrap();
    let mut core = loaded(&prepared.header, &prepared.words);
    let mut sample = period(&mut core, Command::Start);
    let (mut linking, mut longest) = (0, 0);
    while sample.state.is_under_way() {
        linking = if sample.state == State::Linking {
            linking + 1
        } else {
            0
        };
        longest = longest.max(linking);
        assert!(
            longest < 5000,
            "a link of pass {} takes more than 5 s",
            sample.pass
        );
        sample = period(&mut core, None);
    }
    assert_eq!(sample.state, State::Finished);
    println!("the longest link takes {longest} ms");
}

/// Lines of a plane that bend at a knot, by about this angle: the tangent plane is continuous, the direction of the passes is not.
fn bent_lines(degrees: f64) -> Job {
    let aside = 10.0 * (0.5 * degrees).to_radians().tan();
    let row = |x: f64| {
        vec![
            [x, -10.0, 0.0, 1.0],
            [x + aside, 0.0, 0.0, 1.0],
            [x, 10.0, 0.0, 1.0],
        ]
    };
    let mut job = plane();
    job.surface = SurfaceSpec::Nurbs(NurbsSpec {
        degree: [1, 1],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 0.5, 1.0, 1.0],
        poles_mm: vec![row(0.0), row(5.0)],
        rational: false,
    });
    job.machine.limits = Some(AxisLimits::DEFAULT);
    job
}

/// A flat ring in one patch, whose passes are circles from this radius on.
fn ring(radius_mm: f64, feed_mm_min: f64) -> Job {
    let mut job = plane();
    job.surface = SurfaceSpec::Revolved {
        radius_mm: [0.0, 0.0, 0.1, radius_mm],
        height_mm: [0.0; 4],
        u: [0.0, 1.0],
        v_rad: [0.0, 6.25],
    };
    (job.feed_mm_min, job.scallop_mm) = (feed_mm_min, 0.001);
    job.machine.limits = Some(AxisLimits::DEFAULT);
    job
}
