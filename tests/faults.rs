//! Faults are states: each kind that a surface can cause, with its code, value and place; the position is kept.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

use host_sim::job_file::{Along, JobFile, Pattern, Side, SurfaceSpec};
use host_sim::prepare::{Prepared, prepare};
use interp_core::{FaultKind, Interpolator, Place, Request, Sample, State};

fn job(surface: SurfaceSpec, radius_mm: f64) -> JobFile {
    JobFile {
        surface,
        radius_mm,
        feed_mm_min: 600.0,
        scallop_mm: 0.05,
        along: Along::U,
        side: Side::Plus,
        pattern: Pattern::Zig,
        chord_mm: 0.005,
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

/// Runs until nothing moves; the last sample on the path and the machine.
fn run(prepared: &Prepared) -> (Option<Sample>, Box<Interpolator>) {
    let mut core = load(prepared);
    let mut last = None;
    let mut sample = *core.tick(Request::Start);
    while sample.state == State::Running {
        last = Some(sample);
        sample = *core.tick(Request::None);
    }
    (last, core)
}

#[test]
fn ball_in_a_valley_that_is_too_tight() {
    // A parabola on 20 mm: its curvature grows towards 0.3 per mm at the bottom, and passes 1/4 at u = 0.44.
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
    // The oracle agrees: it just fits at the last sample, and no more 5 um further.
    let oracle = host_sim::oracle::Oracle::new(&job).unwrap();
    let [u, v] = prepared.parameters(last.path, last.side);
    assert!(oracle.contact(u, v).unwrap().fit(4.0) < 1.0);
    assert!(oracle.contact(u + 1e-3, v).unwrap().fit(4.0) > 1.0);

    // The position is kept, and said again at every tick; an abort acknowledges, a start begins anew.
    for _ in 0..3 {
        let after = core.tick(Request::Resume);
        assert_eq!(
            (after.state, after.cl_nm, after.path),
            (State::Faulted, last.cl_nm, last.path)
        );
    }
    assert_eq!(core.tick(Request::Start).state, State::Faulted);
    assert_eq!(core.tick(Request::Abort).state, State::Ready);
    assert_eq!(core.fault(), None);
    assert_eq!(core.tick(Request::Start).tick, 0);
}

/// The same valley across the passes: the other principal direction.
#[test]
fn ball_in_a_valley_along_the_pass() {
    let surface = patch(&[
        (0, 1, 0, 20.0),
        (1, 0, 1, 20.0),
        (2, 0, 2, 60.0),
        (2, 0, 1, -60.0),
    ]);
    let mut job = job(surface, 4.0);
    // Fine passes: coarse ones step over the bottom of the valley, where the interval grows without bound.
    job.scallop_mm = 0.001;
    let (last, core) = run(&prepare(&job).unwrap());
    assert_eq!(core.fault().unwrap().kind, FaultKind::BallDoesNotFit);
    let (pass, path, side) = core.place();
    assert_eq!((pass, path), (last.unwrap().pass + 1, Place::default()));
    assert!((0.44..0.56).contains(&(side.fraction as f64 / 2_f64.powi(64))));
}

/// A saddle turned by 45 degrees: along and across the pass it is straight, and yet the ball does not fit.
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

/// y folds back half-way: along the pass, where a sample may fall near the fold or not, and across, where passes step over it.
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
    // x = u^3 all but stands still at its start: |A| grows a thousandfold within a step.
    let surface = patch(&[(0, 3, 0, 20.0), (0, 1, 0, 1e-3), (1, 0, 1, 20.0)]);
    let (_, core) = run(&prepare(&job(surface, 1.0)).unwrap());
    let fault = core.fault().unwrap();
    assert_eq!(fault.kind, FaultKind::ParameterBackwards);
    assert!(fault.value.abs() > 0.5, "{fault:?}");
}

#[test]
fn outside_the_range_of_nanometres() {
    // The patch ends 1 mm before the range does; the ball, 4 mm on its side, is outside from the start on.
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
        SurfaceSpec::Nurbs(host_sim::job_file::NurbsSpec {
            degree: [3, 3],
            knots_u: knots.clone(),
            knots_v: knots,
            poles_mm: (0..poles)
                .map(|i| (0..poles).map(|j| pole(i, j)).collect())
                .collect(),
            rational: false,
        })
    };
    // 17 x 17 = 289 patches fit, 18 x 18 = 324 do not.
    let fits = prepare(&job(flat(17), 1.0)).unwrap();
    assert_eq!(load(&fits).state(), State::Ready);
    let large = prepare(&job(flat(18), 1.0)).unwrap();
    let mut core = load(&fits);
    let fault = core
        .load_begin(&large.header, large.words.len() as u32)
        .unwrap_err();
    assert_eq!(fault.kind, FaultKind::TooManyPatches);
    assert_eq!(fault.value, large.words.len() as f32);
    // The job that was there still is.
    assert_eq!(core.tick(Request::Start).state, State::Running);
}

#[test]
fn loading_while_a_job_runs() {
    let prepared = prepare(&job(patch(&[(0, 1, 0, 20.0), (1, 0, 1, 20.0)]), 1.0)).unwrap();
    let mut core = load(&prepared);
    core.tick(Request::Start);
    let before = *core.tick(Request::Hold);
    assert_eq!(before.state, State::Held);
    let fault = core
        .load_begin(&prepared.header, prepared.words.len() as u32)
        .unwrap_err();
    assert_eq!(fault.kind, FaultKind::WrongState);
    assert_eq!(core.load_words(0, &[0]).unwrap_err().kind, FaultKind::WrongState);
    assert_eq!(core.unload().unwrap_err().kind, FaultKind::WrongState);
    assert_eq!(core.tick(Request::Resume).tick, before.tick + 1);
}

/// Hold and resume at every tick of a job give the same samples as the job without.
#[test]
fn hold_and_resume_change_nothing() {
    let mut job = job(patch(&[(0, 1, 0, 2.0), (1, 0, 1, 2.0), (2, 1, 1, 1.0)]), 1.0);
    job.scallop_mm = 0.5;
    let prepared = prepare(&job).unwrap();
    let mut plain = load(&prepared);
    let mut held = load(&prepared);
    let mut expected = *plain.tick(Request::Start);
    let mut sample = *held.tick(Request::Start);
    while expected.state == State::Running {
        assert_eq!(sample, expected);
        for _ in 0..3 {
            let standing = held.tick(Request::Hold);
            assert_eq!(
                (standing.state, standing.cl_nm, standing.tick),
                (State::Held, sample.cl_nm, sample.tick)
            );
        }
        sample = *held.tick(Request::Resume);
        expected = *plain.tick(Request::None);
    }
    assert_eq!(sample, expected);
}
