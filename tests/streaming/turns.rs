//! Streamed jobs with turns: the tool rests where the rows do not last, in the same places whatever the ring and however late the words.

use interp_core::{Sample, State};
use job::{Job, Pattern, Region};
use machine::prepare::{Prepared, prepare, streamed};
use machine::{Machine, direction};

use super::{LIMITS, Outcome, Streamed, bumpy, room, whole};

const CUT: &str = "scallop_mm = 0.02\npattern = \"zigzag\"\noverrun_mm = 2";

pub(super) fn job(patches: [usize; 2], size_mm: [f64; 2]) -> Job {
    bumpy(patches, size_mm, CUT, LIMITS)
}

/// Ways from pass to pass on which the tool stands, and all of them.
fn rests(job: &Prepared) -> [usize; 2] {
    let (mut rests, mut ways) = (0, 0);
    let mut last = Sample::default();
    let mut was_still = false;
    let each = |sample: &Sample| {
        if sample.pass != last.pass && sample.state == State::Running {
            ways += 1;
            rests += usize::from(std::mem::take(&mut was_still));
            last = *sample;
        }
        was_still |= sample.feed_mm_s == 0.0 && sample.pass == last.pass;
        true
    };
    Machine::load(job).unwrap().run(each).unwrap();
    [rests, ways]
}

fn check(about: &str, job: &Prepared) {
    let wanted = whole(job);
    let all = job.words.len() / interp_core::job::stream::row_words(&job.header);
    for rows in [job.least_rows, job.least_rows + 1] {
        for late in [None, Some(1), Some(7)] {
            let outcome = Streamed::new(job, room(job, rows)).run(late);
            println!("{about}, {rows} rows, late {late:?}: {} starved", outcome.starved);
            assert!(late.is_none() || outcome.starved > 0 || all <= rows);
            let outcome = Outcome {
                starved: 0,
                ..outcome
            };
            assert_eq!(outcome, wanted, "{about}, {rows} rows, late {late:?}");
        }
    }
}

/// Where all rows are in the window the job is the same as one that is no stream; with a smaller window the tool rests where it has to, and goes on in turns between.
#[test]
fn turns_lead_on_for_as_long_as_the_rows_last() {
    let plain = prepare(&job([4, 18], [8.0, 3.0])).unwrap();
    assert_eq!(plain.header.window, 0);
    let [without, ways] = rests(&plain);
    assert!(without < ways / 4, "{without} of {ways}");
    assert_eq!(whole(&streamed(&plain, 18)), whole(&plain));
    let mut last = ways;
    for window in [3, 5, 9, 18] {
        let job = streamed(&plain, window);
        check(&format!("window {window}"), &job);
        let [rests, of] = rests(&job);
        println!(
            "window {window}: {rests} rests on {of} ways, {without} without; {} periods, {} without",
            whole(&job).samples,
            whole(&plain).samples
        );
        assert!(rests <= last && of == ways);
        last = rests;
    }
    assert_eq!(last, without);
}

/// Rows of half an interval and less: no turn, and the passes get on.
#[test]
fn narrow_rows_with_turns() {
    for (width, window) in [(0.2, 3), (0.2, 5), (0.2, 9), (0.6, 3), (0.6, 5), (0.11, 18)] {
        let job = prepare(&job([3, 40], [5.0, width])).unwrap();
        check(
            &format!("rows of {width}, window {window}"),
            &streamed(&job, window),
        );
    }
}

/// Regions with turns, in cells.
#[test]
fn regions_with_turns() {
    for (width, window) in [(2.0, 5), (0.7, 9), (0.2, 4)] {
        let mut job = job([5, 24], [2.0, width]);
        job.region = Some(Region::new(vec![
            vec![[0.0, 5.6], [5.0, 5.7], [5.0, 21.1], [2.2, 19.7], [0.0, 21.4]],
            vec![[1.3, 8.4], [3.1, 8.4], [3.1, 15.2], [1.3, 15.2]],
        ]));
        assert_eq!(job.pattern, Pattern::Zigzag);
        let (job, _) = direction::choose(job).unwrap();
        let job = streamed(&prepare(&job).unwrap(), window);
        check(&format!("region, rows of {width}, window {window}"), &job);
    }
}
