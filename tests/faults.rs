//! Faults are states: each kind of fault that a surface can cause, with its code, value and position; the tool stays where it is.

use interp_core::interpolator::STOP_PERIODS;
use interp_core::{Command, Fault, FaultKind, Header, Interpolator, Sample, SpanParameter, State};
use job::{Along, Job, Pattern, Side, Spacing, SurfaceSpec};
use machine::prepare::{Prepared, prepare};

fn job(surface: SurfaceSpec, radius_mm: f64) -> Job {
    Job {
        surface,
        radius_mm,
        body: job::ToolBody::default(),
        setup: job::Setup::default(),
        region: None,
        feed_mm_min: 600.0,
        scallop_mm: 0.05,
        along: Along::U,
        side: Side::Plus,
        pattern: Pattern::Zig,
        spacing: Spacing::Exact,
        chord_mm: 0.005,
        overrun_mm: 0.0,
        machine: Default::default(),
        origin: Default::default(),
    }
}

/// `c[axis][power of u][power of v]`, over the unit square.
fn patch(terms: &[(usize, usize, usize, f64)]) -> SurfaceSpec {
    let mut coefficients_mm = [[[0.0; 4]; 4]; 3];
    for &(axis, i, j, value) in terms {
        coefficients_mm[axis][3 - i][3 - j] += value;
    }
    SurfaceSpec::Bicubic {
        coefficients_mm,
        u: [0.0, 1.0],
        v: [0.0, 1.0],
    }
}

fn load(prepared: &Prepared) -> Box<Interpolator> {
    let mut core = Box::new(<Interpolator>::new());
    core.load_begin(&prepared.header, prepared.words.len() as u32)
        .unwrap();
    core.load_words(0, &prepared.words).unwrap();
    for record in 0..core.load_records() {
        core.load_check(record).unwrap();
    }
    core.load_finish().unwrap();
    core
}

/// Runs a job until it ends. Returns the last sample on the path, and the core.
fn run(prepared: &Prepared) -> (Option<Sample>, Box<Interpolator>) {
    let mut core = load(prepared);
    let mut last = None;
    let mut sample = *core.tick(Command::Start);
    while sample.state == State::Running {
        last = Some(sample);
        sample = *core.tick(None);
    }
    (last, core)
}

#[test]
fn ball_in_a_valley_that_is_too_tight() {
    // A parabola over 20 mm: its curvature rises to 0.3 per mm at the bottom, and exceeds 1/4 at u = 0.44.
    let surface = patch(&[
        (0, 1, 0, 20.0),
        (1, 0, 1, 20.0),
        (2, 2, 0, 60.0),
        (2, 1, 0, -60.0),
    ]);
    let job = job(surface, 4.0);
    let prepared = prepare(&job).unwrap();
    let (last, mut core) = run(&prepared);
    let (last, fault) = (last.unwrap(), core.fault().unwrap());
    assert_eq!(fault.kind, FaultKind::BallDoesNotFit);
    assert!(fault.value > 1.0 - 2e-5 && fault.value < 1.01, "{fault:?}");
    // The oracle agrees: the ball fits at the last sample, and does not fit 0.02 mm further.
    let oracle = oracle::Oracle::new(&job).unwrap();
    let [u, v] = prepared.parameters(last.path, last.side);
    assert!(oracle.contact(u, v).unwrap().fit(4.0) < 1.0);
    assert!(oracle.contact(u + 1e-3, v).unwrap().fit(4.0) > 1.0);

    // The position stays, and every tick reports it; an abort acknowledges the fault, then a start begins a new run.
    for _ in 0..3 {
        let after = core.tick(Command::Resume);
        assert_eq!(
            (after.state, after.cl_nm, after.path),
            (State::Faulted, last.cl_nm, last.path)
        );
    }
    assert_eq!(core.tick(Command::Start).state, State::Faulted);
    assert_eq!(core.tick(Command::Abort).state, State::Ready);
    assert_eq!(core.fault(), None);
    assert_eq!(core.tick(Command::Start).tick, 0);
}

/// A valley along the passes: the other principal direction bounds the ball.
#[test]
fn ball_in_a_valley_along_the_pass() {
    let surface = patch(&[
        (0, 1, 0, 20.0),
        (1, 0, 1, 20.0),
        (2, 0, 2, 60.0),
        (2, 0, 1, -60.0),
    ]);
    let mut job = job(surface, 4.0);
    // Narrow passes: wide ones would step over the bottom of the valley, where the interval tends to infinity.
    job.scallop_mm = 0.001;
    let (last, core) = run(&prepare(&job).unwrap());
    assert_eq!(core.fault().unwrap().kind, FaultKind::BallDoesNotFit);
    let (pass, path, side) = core.surface_position();
    assert_eq!((pass, path), (last.unwrap().pass + 1, SpanParameter::default()));
    assert!((0.44..0.56).contains(&(side.fraction as f64 / 2_f64.powi(64))));
}

/// A saddle turned by 45 degrees: its curvature along and across the pass is 0, but the ball does not fit.
#[test]
fn ball_in_a_twisted_valley() {
    let surface = |twist: f64| {
        patch(&[
            (0, 1, 0, 20.0),
            (1, 0, 1, 20.0),
            (2, 1, 1, twist),
            (2, 1, 0, -twist / 2.0),
            (2, 0, 1, -twist / 2.0),
        ])
    };
    let (_, core) = run(&prepare(&job(surface(120.0), 4.0)).unwrap());
    assert_eq!(core.fault().unwrap().kind, FaultKind::BallDoesNotFit);
    let (_, core) = run(&prepare(&job(surface(60.0), 4.0)).unwrap());
    assert_eq!((core.fault(), core.state()), (None, State::Finished));
}

/// y folds back at half the range: along the pass, with samples near the fold or not, and across, where passes step over it.
#[test]
fn surface_that_folds_over() {
    for feed_mm_min in [60.0, 600.0, 6000.0] {
        let along = patch(&[
            (0, 1, 0, 20.0),
            (1, 1, 0, 20.0),
            (1, 2, 0, -20.0),
            (0, 0, 1, 20.0),
        ]);
        let across = patch(&[
            (0, 1, 0, 20.0),
            (0, 0, 1, 20.0),
            (1, 0, 1, 20.0),
            (1, 0, 2, -20.0),
        ]);
        for pattern in [Pattern::Zig, Pattern::Zigzag] {
            for (surface, passes) in [(&along, 0), (&across, 3)] {
                let mut job = job(surface.clone(), 1.0);
                (job.feed_mm_min, job.pattern) = (feed_mm_min, pattern);
                let (last, core) = run(&prepare(&job).unwrap());
                let fault = core.fault().unwrap();
                assert_eq!(fault.kind, FaultKind::DegenerateSurface);
                assert!(fault.value <= interp_core::surface::SINE_MIN, "{fault:?}");
                assert!(last.unwrap().pass >= passes);
            }
        }
    }
}

#[test]
fn parameter_that_would_run_backwards() {
    // x = u^3 has nearly zero speed at its start: |A| increases a thousandfold within a step.
    let surface = patch(&[(0, 3, 0, 20.0), (0, 1, 0, 1e-3), (1, 0, 1, 20.0)]);
    let (_, core) = run(&prepare(&job(surface, 1.0)).unwrap());
    let fault = core.fault().unwrap();
    assert_eq!(fault.kind, FaultKind::ParameterBackwards);
    assert!(fault.value.abs() > 0.5, "{fault:?}");
}

#[test]
fn outside_the_range_of_nanometres() {
    // The patch lies 1 mm below the end of the range; the centre, 4 mm above the patch, is out of range from the start.
    let surface = patch(&[(0, 1, 0, 20.0), (1, 0, 1, 20.0), (2, 0, 0, 2146.0)]);
    let (last, core) = run(&prepare(&job(surface, 4.0)).unwrap());
    let fault = core.fault().unwrap();
    assert_eq!((fault.kind, last), (FaultKind::OutOfRange, None));
    assert!((fault.value - 2.150).abs() < 1e-3, "{fault:?}");
}

#[test]
fn too_many_patches() {
    let flat = |spans: u16| {
        let knots: Vec<f64> = (0..4)
            .map(|_| 0.0)
            .chain((1..spans).map(f64::from))
            .chain((0..4).map(|_| spans.into()))
            .collect();
        let poles = knots.len() - 4;
        let pole = |i: usize, j: usize| [i as f64, j as f64, 0.0, 1.0];
        SurfaceSpec::Nurbs(job::NurbsSpec {
            degree: [3, 3],
            knots_u: knots.clone(),
            knots_v: knots,
            poles_mm: (0..poles)
                .map(|i| (0..poles).map(|j| pole(i, j)).collect())
                .collect(),
            rational: false,
        })
    };
    // 17 x 17 = 289 patches fit, 18 x 18 = 324 are streamed, of 105 in a row no three fit.
    let fits = prepare(&job(flat(17), 1.0)).unwrap();
    assert_eq!(load(&fits).state(), State::Ready);
    assert!(prepare(&job(flat(18), 1.0)).unwrap().header.window > 0);
    assert!(prepare(&job(flat(105), 1.0)).is_err());
    let large = Header {
        path_spans: 18,
        side_spans: 18,
        ..fits.header
    };
    let of_a_patch = (fits.words.len() - 2 * 17) / (17 * 17);
    let words = 18 * 18 * of_a_patch + 2 * 18;
    let mut core = load(&fits);
    let fault = core.load_begin(&large, words as u32).unwrap_err();
    assert_eq!(fault.kind, FaultKind::TooManyPatches);
    assert_eq!(fault.value, words as f32);
    // The job loaded before is still loaded.
    assert_eq!(core.tick(Command::Start).state, State::Running);
}

#[test]
fn loading_while_a_job_runs() {
    let prepared = prepare(&job(patch(&[(0, 1, 0, 20.0), (1, 0, 1, 20.0)]), 1.0)).unwrap();
    let mut core = load(&prepared);
    core.tick(Command::Start);
    let before = *core.tick(Command::Hold);
    assert_eq!(before.state, State::Held);
    let fault = core
        .load_begin(&prepared.header, prepared.words.len() as u32)
        .unwrap_err();
    assert_eq!(fault.kind, FaultKind::WrongState);
    assert_eq!(core.load_words(0, &[0]).unwrap_err().kind, FaultKind::WrongState);
    assert_eq!(core.unload().unwrap_err().kind, FaultKind::WrongState);
    assert_eq!(core.tick(Command::Resume).tick, before.tick + 1);
}

/// A job with hold and resume at every tick gives the same samples as an undisturbed job.
#[test]
fn hold_and_resume_change_nothing() {
    let mut job = job(patch(&[(0, 1, 0, 2.0), (1, 0, 1, 2.0), (2, 1, 1, 1.0)]), 1.0);
    job.scallop_mm = 0.5;
    let prepared = prepare(&job).unwrap();
    let mut plain = load(&prepared);
    let mut held = load(&prepared);
    let mut expected = *plain.tick(Command::Start);
    let mut sample = *held.tick(Command::Start);
    while expected.state == State::Running {
        assert_eq!(sample, expected);
        for _ in 0..3 {
            let standing = held.tick(Command::Hold);
            assert_eq!(
                (standing.state, standing.cl_nm, standing.tick),
                (State::Held, sample.cl_nm, sample.tick)
            );
        }
        sample = *held.tick(Command::Resume);
        expected = *plain.tick(None);
    }
    assert_eq!(sample, expected);
}

/// A trough of two patches that meet at u = 0.4: x = 20 u, y = 20 v, z = 8 u^2.
fn trough(pattern: Pattern) -> Job {
    const KNOT: f64 = 0.4;
    // Poles of a quadratic by its polar form: u -> (a + b)/2, u^2 -> a b.
    let pole = |a: f64, b: f64, y: f64| [10.0 * (a + b), y, 8.0 * a * b, 1.0];
    let row = |(a, b)| vec![pole(a, b, 0.0), pole(a, b, 20.0)];
    let surface = SurfaceSpec::Nurbs(job::NurbsSpec {
        degree: [2, 1],
        knots_u: vec![0.0, 0.0, 0.0, KNOT, 1.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: [(0.0, 0.0), (0.0, KNOT), (KNOT, 1.0), (1.0, 1.0)].map(row).into(),
        rational: false,
    });
    let mut job = job(surface, 1.0);
    job.pattern = pattern;
    job
}

/// Length of the trough's path from 0 to u, mm: |A| = 20 sqrt(1 + t^2) with t = 0.8 u.
fn trough_arc_mm(u: f64) -> f64 {
    let t = 0.8 * u;
    12.5 * (t * t.hypot(1.0) + t.asinh())
}

const MISSED: Fault = Fault::new(FaultKind::DeadlineMissed, 2.0);
const OVER_BUDGET: Fault = Fault::new(FaultKind::TickOverBudget, 20_000.0);

/// Runs until a sample fulfils a condition.
fn run_until(core: &mut Interpolator, reached: impl Fn(&Sample) -> bool) -> Sample {
    let mut sample = *core.tick(Command::Start);
    while !reached(&sample) {
        assert_eq!(sample.state, State::Running);
        sample = *core.tick(None);
    }
    sample
}

/// The samples of a controlled stop, and the first sample at standstill.
fn stop(core: &mut Interpolator, command: Option<Command>) -> (Vec<Sample>, Sample) {
    let mut samples = Vec::new();
    loop {
        let sample = *core.tick(command);
        if sample.state != State::Stopping {
            return (samples, sample);
        }
        assert_eq!(core.fault(), Some(MISSED));
        samples.push(sample);
    }
}

/// The tool decelerates along its path, by 1/32 of the feed each period, also across a patch boundary and on reversed passes. The
/// samples are on the surface within nanometres.
#[test]
fn a_fault_from_outside_stops_along_the_path() {
    for (pattern, pass) in [(Pattern::Zig, 0), (Pattern::Zig, 2), (Pattern::Zigzag, 1)] {
        // Near the start, within a patch, and 0.07 mm before the next patch; the stopping distance is 0.155 mm.
        for from in [0.0_f64, 0.05, 0.7, 0.3965, 0.4035] {
            let prepared = prepare(&trough(pattern)).unwrap();
            let mut core = load(&prepared);
            let u = |sample: &Sample| prepared.parameters(sample.path, sample.side)[0];
            let backwards = pattern == Pattern::Zigzag;
            let begun = |sample: &Sample| {
                let travelled = if backwards { 1.0 - u(sample) } else { u(sample) };
                let from = if backwards { 1.0 - from } else { from };
                sample.pass == pass && travelled >= from.min(0.95)
            };
            let before = run_until(&mut core, begun);
            core.controlled_stop(MISSED);
            assert_eq!((core.state(), core.fault()), (State::Stopping, Some(MISSED)));
            // No command interrupts the stop.
            let (samples, standing) = stop(&mut core, Some(Command::Hold));
            assert_eq!(samples.len(), usize::from(STOP_PERIODS) - 1);

            let mut last = before;
            for (sample, k) in samples.iter().zip((1..STOP_PERIODS).rev()) {
                let share = f32::from(k) / f32::from(STOP_PERIODS);
                assert_eq!(sample.feed_mm_s, 10.0 * share);
                assert_eq!((sample.tick, sample.pass), (last.tick + 1, before.pass));
                assert_eq!(sample.side, before.side);
                // The contact and the centre are on the path.
                let [u, v] = prepared.parameters(sample.path, sample.side);
                for (nm, mm) in sample.cc_nm.into_iter().zip([20.0 * u, 20.0 * v, 8.0 * u * u]) {
                    assert!((f64::from(nm) - mm * 1e6).abs() < 2.0, "{nm} nm for {mm} mm");
                }
                let slope = 0.8 * u;
                let normal = [-slope / slope.hypot(1.0), 0.0, 1.0 / slope.hypot(1.0)];
                for ((cl, cc), n) in sample.cl_nm.into_iter().zip(sample.cc_nm).zip(normal) {
                    assert!((f64::from(cl - cc) - n * 1e6).abs() < 3.0, "{} for {n}", cl - cc);
                }
                // The arc length of each period follows from the reported feed.
                let [from, _] = prepared.parameters(last.path, last.side);
                let arc_mm = (trough_arc_mm(u) - trough_arc_mm(from)).abs();
                let want_mm = 0.01 * f64::from(share);
                assert!(
                    (arc_mm / want_mm - 1.0).abs() < 1e-5,
                    "{k}: {arc_mm} for {want_mm}"
                );
                assert_eq!(u < from, backwards);
                last = *sample;
            }
            if from == 0.3965 || from == 0.4035 {
                assert_eq!((before.path.span != last.path.span), backwards == (from > 0.4));
            }

            // The tool stays where it stopped; the status reports fault and position.
            assert_eq!(core.fault(), Some(MISSED));
            assert_eq!(
                standing,
                Sample {
                    state: State::Faulted,
                    ..last
                }
            );
            assert_eq!(core.surface_position(), (last.pass, last.path, last.side));
            assert_eq!(*core.tick(Command::Resume), standing);
        }
    }
}

/// Closer to the end of the pass than the stopping distance, the tool stops at the end, and no further pass begins.
#[test]
fn a_fault_from_outside_stops_at_the_end_of_the_pass() {
    let prepared = prepare(&trough(Pattern::Zig)).unwrap();
    let length_mm = trough_arc_mm(1.0);
    for left_mm in [0.15, 0.1, 0.05, 0.015, 0.005] {
        let mut core = load(&prepared);
        let u = |sample: &Sample| prepared.parameters(sample.path, sample.side)[0];
        let before = run_until(&mut core, |sample| {
            sample.pass == 1 && length_mm - trough_arc_mm(u(sample)) < left_mm
        });
        core.controlled_stop(MISSED);
        let (samples, standing) = stop(&mut core, None);
        let last = *samples.last().unwrap();
        assert!(samples.len() < usize::from(STOP_PERIODS), "{left_mm}");
        assert_eq!((last.pass, last.side, u(&last)), (1, before.side, 1.0));
        assert_eq!(last.path.fraction, u64::MAX);
        // As many samples as the remaining length takes, the last one shorter.
        let left_mm = length_mm - trough_arc_mm(u(&before));
        let spent = |count: usize| (1..=count).map(|k| 0.01 * (32 - k) as f64 / 32.0).sum::<f64>();
        assert!(spent(samples.len()) >= left_mm && spent(samples.len() - 1) < left_mm);
        assert_eq!(
            standing,
            Sample {
                state: State::Faulted,
                ..last
            }
        );
        assert_eq!(core.fault(), Some(MISSED));
    }
    // At the last sample of a pass the remaining length is 0.
    let mut core = load(&prepared);
    let before = run_until(&mut core, |sample| {
        sample.path.span == 1 && sample.path.fraction == u64::MAX
    });
    core.controlled_stop(MISSED);
    let (samples, standing) = stop(&mut core, None);
    assert_eq!(
        (samples, standing),
        (
            vec![],
            Sample {
                state: State::Faulted,
                ..before
            }
        )
    );
}

/// While held, the tool is already at standstill; without a run there is nothing to stop. The first fault is reported, also if
/// the surface causes another during the stop, and an abort acknowledges it.
#[test]
fn a_fault_from_outside_in_every_state() {
    let prepared = prepare(&trough(Pattern::Zig)).unwrap();
    let mut idle = <Interpolator>::new();
    idle.controlled_stop(MISSED);
    assert_eq!((idle.state(), idle.fault()), (State::Idle, None));

    let mut core = load(&prepared);
    core.controlled_stop(MISSED);
    assert_eq!((core.state(), core.fault()), (State::Ready, None));
    let first = *core.tick(Command::Start);
    core.tick(Command::Hold);
    let held = *core.tick(None);
    assert_eq!(held.state, State::Held);
    core.controlled_stop(MISSED);
    assert_eq!((core.state(), core.fault()), (State::Faulted, Some(MISSED)));
    assert_eq!(
        *core.tick(Command::Resume),
        Sample {
            state: State::Faulted,
            ..held
        }
    );
    core.controlled_stop(OVER_BUDGET);
    assert_eq!((core.state(), core.fault()), (State::Faulted, Some(MISSED)));
    assert_eq!(core.tick(Command::Abort).state, State::Ready);
    assert_eq!(core.fault(), None);

    // The next run is complete; a second fault during a stop neither restarts the stop nor replaces the first fault.
    assert_eq!(*core.tick(Command::Start), first);
    core.controlled_stop(MISSED);
    let mut stopping = 0;
    while core.tick(Command::Abort).state == State::Stopping {
        core.controlled_stop(OVER_BUDGET);
        stopping += 1;
    }
    assert_eq!(
        (stopping, core.state(), core.fault()),
        (31, State::Faulted, Some(MISSED))
    );
    assert_eq!(core.tick(Command::Abort).state, State::Ready);
    assert_eq!((core.fault(), *core.tick(Command::Start)), (None, first));
    let mut sample = first;
    while sample.state == State::Running {
        assert_eq!(sample.feed_mm_s, 10.0);
        sample = *core.tick(None);
    }
    assert_eq!(sample.state, State::Finished);
    core.controlled_stop(MISSED);
    assert_eq!((core.state(), core.fault()), (State::Finished, None));

    // The path reaches a valley that is too tight during the stop.
    let valley = patch(&[
        (0, 1, 0, 20.0),
        (1, 0, 1, 20.0),
        (2, 2, 0, 60.0),
        (2, 1, 0, -60.0),
    ]);
    let prepared = prepare(&job(valley, 4.0)).unwrap();
    let (last, _) = run(&prepared);
    let mut core = load(&prepared);
    run_until(&mut core, |sample| sample.tick + 5 == last.unwrap().tick);
    core.controlled_stop(MISSED);
    let (samples, standing) = stop(&mut core, None);
    assert!((1..10).contains(&samples.len()), "{}", samples.len());
    assert_eq!((standing.state, core.fault()), (State::Faulted, Some(MISSED)));
    assert_eq!(standing.cl_nm, samples.last().unwrap().cl_nm);
}
