use super::*;
use crate::job::Header;
use crate::job::encode;
use crate::job::program::Program;
use crate::surface::Edges;
use std::vec::Vec;

/// 4 x 3 patches of a wavy surface, of unequal lengths along the pass, 20 mm on a side.
fn wave(pattern: Pattern) -> (Program, Vec<i32>) {
    let along = [0.0, 0.004, 0.3, 0.35, 1.0];
    let across = [0.0, 0.5, 0.55, 1.0];
    let mut c = [[[0.0; 4]; 4]; 3];
    (c[0][1][0], c[1][0][1]) = (20.0, 20.0);
    (c[2][2][0], c[2][3][0]) = (9.0, -7.0);
    // The curvature across the pass is greatest in the middle of a pass, and increases from pass to pass.
    (c[2][1][2], c[2][2][2], c[2][1][3], c[2][2][3]) = (-20.0, 20.0, -40.0, 40.0);
    let widths = |ends: &[f64]| -> Vec<i32> {
        let pairs = ends.windows(2);
        pairs
            .map(|pair| encode::width(pair[1] - pair[0]).unwrap())
            .collect()
    };
    let mut words = [widths(&along), widths(&across)].concat();
    words.rotate_left(along.len() - 1);
    for v in across.windows(2) {
        for u in along.windows(2) {
            let ends = |pair: &[f64]| [pair[0], pair[1]];
            let c = c.map(|axis| encode::substitute(&axis, ends(u), ends(v)));
            let record = encode::polynomial(&c, Edges::default()).unwrap();
            words.extend(record.to_words());
        }
    }
    let header = Header {
        pattern,
        path_spans: 4,
        side_spans: 3,
        ball_radius_mm: 1.0,
        feed_mm_s: 30.0,
        scallop_mm: 0.05,
        period_s: 1e-3,
        ..Header::default()
    };
    let mut program = Program::new();
    let mut store = words.clone();
    program.begin(&header, words.len() as u32, words.len()).unwrap();
    program.write(&mut store, 0, &words).unwrap();
    for record in 0..program.records() {
        program
            .check(&store, record, &mut crate::job::region::ScanLine::START.clone())
            .unwrap();
    }
    program.seal().unwrap();
    (program, store)
}

/// The planning of one period.
fn plan(run: &mut Run, job: &Job<'_>) {
    let spent = run.prepare_piece(job);
    run.plan(job, &mut [], spent);
}

/// Patches prepared ahead and those prepared at a crossing give the same samples, to the difference of series and quadrature; most crossings find the patch prepared.
#[test]
fn patches_made_ahead_are_those_made_at_a_crossing() {
    for pattern in [Pattern::Zig, Pattern::Zigzag] {
        let (program, store) = wave(pattern);
        let job = program.job(&store).unwrap();
        let (mut ahead, mut late) = (Run::START, Run::START);
        let (mut here, mut there) = (Sample::START, Sample::START);
        let mut patches = 0;
        loop {
            late.buffer.disable();
            plan(&mut ahead, &job);
            plan(&mut late, &job);
            let more = ahead.advance(&job, &mut here).unwrap();
            assert_eq!(late.advance(&job, &mut there).unwrap(), more);
            if !more {
                break;
            }
            patches += u32::from(here.path.span != 0);
            assert_eq!(
                (here.tick, here.pass, here.path.span),
                (there.tick, there.pass, there.path.span)
            );
            for (here, there) in here.cl_nm.iter().zip(&there.cl_nm) {
                assert!(here.abs_diff(*there) <= 1, "{here} {there}");
            }
        }
        assert!(here.pass > 10 && patches > 1000, "{here:?}");
    }
}

/// The state left by a run does not affect the next one: a run that was stopped anywhere and restarted repeats the first run.
#[test]
fn a_run_that_is_begun_again_is_the_same() {
    let (program, store) = wave(Pattern::Zig);
    let job = program.job(&store).unwrap();
    // Stops in the first pass before, between and after the evaluation of its neighbouring lines, and in later passes.
    for stopped in [5, 601, 605, 1234, 1238, 4321] {
        let (mut first, mut again) = (Run::START, Run::START);
        let (mut here, mut there) = (Sample::START, Sample::START);
        for _ in 0..stopped {
            assert!(again.advance(&job, &mut there).unwrap());
            plan(&mut again, &job);
        }
        again.restart(&program, &job);
        while first.advance(&job, &mut here).unwrap() && here.pass < 4 {
            assert!(again.advance(&job, &mut there).unwrap());
            assert_eq!(here, there, "after {stopped} samples");
            plan(&mut first, &job);
            plan(&mut again, &job);
        }
        assert_eq!(here.pass, 4);
    }
}
