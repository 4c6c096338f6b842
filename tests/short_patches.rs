//! Passes over patches that are shorter than the way of a period, within axis limits: the pass is slow there, and no axis stops at once.

use interp_core::{Command, FaultKind, Inputs};
use job::{AxisLimits, Job, NurbsSpec, SurfaceSpec};
use machine::prepare::prepare;

use crate::limits::plane;
use crate::scallop_limit::shapes::Random;
use integration_tests::motion::{PERMITTED, Uses};
use integration_tests::sequences::{loaded, period};

/// Length of the passes, mm, and the degree along them.
const LENGTH_MM: f64 = 30.0;
const DEGREE: usize = 3;

/// Knots at random, with one cluster of patches of 0.2 to 100 um.
fn random_knots(random: &mut Random) -> Vec<f64> {
    let mut knots = vec![0.0; DEGREE + 1];
    let (mut at_mm, cluster_mm) = (0.0, random.within(3.0, 25.0));
    let mut left = 0;
    while at_mm < LENGTH_MM - 3.0 {
        let gap = if left > 0 {
            left -= 1;
            random.log_within(2e-4, 0.1)
        } else {
            random.within(0.3, 3.0)
        };
        if at_mm < cluster_mm && at_mm + gap >= cluster_mm {
            left = random.one_of(&[1, 3, 8, 30]);
        }
        at_mm += gap;
        knots.push(at_mm / LENGTH_MM);
    }
    knots.extend([1.0; DEGREE + 1]);
    knots
}

/// A sheet that waves along its passes, with the poles above Greville's abscissae.
fn sheet(random: &mut Random) -> Job {
    let knots_v = random_knots(random);
    let turn = random.within(0.0, std::f64::consts::TAU);
    let (height_mm, wave_mm) = (random.within(0.0, 0.1), random.within(8.0, 30.0));
    let row = |across: f64| {
        knots_v
            .windows(DEGREE + 2)
            .map(|knots| {
                let inner = &knots[1..=DEGREE];
                let along = LENGTH_MM * inner.iter().sum::<f64>() / inner.len() as f64;
                let (sin, cos) = turn.sin_cos();
                let z = height_mm * (std::f64::consts::TAU * along / wave_mm).sin();
                [along * cos - across * sin, along * sin + across * cos, z, 1.0]
            })
            .collect()
    };
    let mut job = plane();
    job.surface = SurfaceSpec::Nurbs(NurbsSpec {
        degree: [1, DEGREE],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: vec![row(0.0), row(1.0)],
        knots_v,
        rational: false,
    });
    // Positions of a nanometre tell a tenth of the jerk limit at 1 ms, not at 250 us.
    let (share, period_us) = random.one_of(&[(1.0, 1000.0), (0.1, 1000.0), (3.0, 250.0), (1.0, 4000.0)]);
    let limits = AxisLimits::DEFAULT;
    job.machine.limits = Some(AxisLimits {
        acceleration_mm_s2: limits.acceleration_mm_s2.map(|limit| share * limit),
        jerk_mm_s3: limits.jerk_mm_s3.map(|limit| share * limit),
        ..limits
    });
    job.machine.period_us = period_us;
    job.feed_mm_min = random.log_within(60.0, 6000.0);
    job.scallop_mm = 0.05;
    job
}

/// Runs a job at this override from the first pass on, to its end or to the fault of a look-ahead before it. Returns what it uses of the limits, with that of the fault.
fn run(job: &Job, percent: u8) -> (Uses, Option<FaultKind>) {
    let prepared = prepare(job).unwrap();
    let axes = prepared.header.axes.unwrap();
    let mut core = loaded(&prepared.header, &prepared.words);
    let mut uses = Uses::default();
    let inputs = |command| Inputs {
        command,
        feed_override: percent,
    };
    let mut sample = period(&mut core, inputs(Some(Command::Start)));
    let mut periods_after = 0;
    while periods_after < 3 {
        uses.add(&sample, &axes, prepared.header.period_s);
        sample = period(&mut core, inputs(None));
        periods_after += u32::from(!sample.state.is_under_way());
    }
    (uses, core.fault().map(|fault| fault.kind))
}

/// `SEEDS=600 TEST short_patches -- --nocapture`: the ball fits in 1 608 runs, of which 31 use more jerk.
#[test]
fn passes_are_slow_over_short_patches() {
    let seeds = std::env::var("SEEDS").map_or(40, |seeds| seeds.parse().unwrap());
    let (mut worst, mut above, mut faults) = ([0.0_f64; 3], 0, 0);
    for seed in 0..seeds {
        let mut random = Random(seed * 0x9e37_79b9 + 1);
        let job = sheet(&mut random);
        for percent in [100, 200, 50] {
            let (uses, fault) = run(&job, percent);
            assert!(
                matches!(fault, None | Some(FaultKind::BallDoesNotFit)),
                "{seed} {percent} %: {fault:?}"
            );
            faults += u32::from(fault.is_some());
            if !uses.are_permitted() {
                let (feed, period_us) = (job.feed_mm_min, job.machine.period_us);
                println!("{seed} F{feed:.0} {percent} % {period_us} us: {:?}", uses.worst);
                above += 1;
            }
            for (worst, used) in worst.iter_mut().zip(uses.worst) {
                *worst = worst.max(used);
            }
        }
    }
    println!("{seeds} sheets, {faults} runs refused, {above} above, at most {worst:?}");
    assert!(faults < 3 * seeds as u32 / 4);
    // 3 % of the runs, where 2 % of a campaign are.
    assert!(100 * above <= 9 * seeds, "{above} above");
    assert!(worst[1] <= PERMITTED[1], "acceleration {}", worst[1]);
}
