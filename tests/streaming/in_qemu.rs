//! A job of 100 x 100 patches on the firmware in QEMU: 32 times what its store holds.

use std::time::Instant;

use interp_core::{Sample, State};
use machine::Machine;
use machine::links::Link;
use machine::prepare::{Prepared, prepare};
use machine::remote::operate::{Setup, make_ready};
use machine::remote::qemu::Qemu;
use machine::remote::session::Event;
use machine::remote::{Session, drive};
use protocol::digest::Digest;
use protocol::message::{Configuration, Report, Request};

use super::{LIMITS, bumpy, expected, regions};
use crate::images;

/// A board, ready to run.
fn board() -> (Qemu, Session) {
    let (qemu, stream) = Qemu::start(images::for_qemu()).unwrap();
    let mut session = Session::open(stream, 1).unwrap();
    make_ready(&mut session, &Setup::simulated(Configuration::DEFAULT)).unwrap();
    (qemu, session)
}

/// Digest of the run after each of its first passes, and its ticks up to there.
fn first_passes(job: &Prepared, passes: u32) -> (Vec<u64>, u32) {
    let (mut digests, mut digest, mut ticks) = (Vec::new(), Digest::new(), 0);
    let each = |sample: &Sample| {
        if sample.pass as usize > digests.len() {
            digests.push(digest.value());
        }
        digest.sample(sample);
        ticks += 1;
        sample.pass < passes
    };
    Machine::load(job).unwrap().run(each).unwrap();
    (digests, ticks)
}

/// With limits and without: as many passes as cross some rows, so that rows are sent while the tool moves.
#[test]
fn the_first_passes_of_a_hundred_rows() {
    let cut = "scallop_mm = 0.04\npattern = \"zigzag\"";
    // Before QEMU starts, which takes a processor while it waits.
    let jobs = [("", 18), (LIMITS, 12)].map(|(machine, passes)| {
        let job = prepare(&bumpy([100, 100], [0.5, 0.8], cut, machine)).unwrap();
        assert_eq!((job.patches(), job.header.window), (10_000, 3));
        let expected = first_passes(&job, passes);
        (job, passes, expected)
    });
    let (_qemu, mut session) = board();
    for (job, passes, (wanted, ticks)) in jobs {
        drive::upload(&mut session, &job, |_| {}).unwrap();
        session
            .command(&Request::Clock(protocol::message::Clock::Lockstep))
            .unwrap();
        session.command(&Request::Report(Report::Digests)).unwrap();
        session.command(&Request::Start).unwrap();
        session.command(&Request::Run { ticks }).unwrap();
        let start = Instant::now();
        let mut digests = Vec::new();
        let status = loop {
            match session.event().unwrap() {
                Event::Pass(pass) => digests.push(pass.digest),
                Event::Halted(status) => break status,
                _ => {}
            }
        };
        println!(
            "{passes} passes, {ticks} ticks, in {:.1} s: {:?}",
            start.elapsed().as_secs_f64(),
            status.stream
        );
        assert_eq!(digests, wanted);
        assert!(
            matches!(status.state, State::Running | State::Linking),
            "{status:?}"
        );
        assert!(status.side.span > 5, "{:?}", status.side);
        assert!(status.stream.received > 8 * 5202, "{:?}", status.stream);
        assert_eq!((status.deadline_misses, status.samples_lost), (0, 0));
        session.command(&Request::Abort).unwrap();
        session.command(&Request::Run { ticks: 1 }).unwrap();
        while !matches!(session.event().unwrap(), Event::Halted(_)) {}
    }
}

/// A region of 12 x 32 patches, more than the store holds, in cells and with links, without turns and with them: the whole runs.
#[test]
fn regions_of_more_patches_than_the_store() {
    let jobs = [0.0, 2.0].map(|overrun_mm| {
        let mut job = regions::in_cells(4, [12, 32], regions::with_hole(2.0));
        job.overrun_mm = overrun_mm;
        let mut job = prepare(&job).unwrap();
        assert!(job.patches() > 309 && job.header.window >= 3 && job.header.strips > 1);
        let passes = machine::links::passes(&job);
        let links: Vec<Link> = (machine::links::between(&passes).iter().zip(0..))
            .map(|([from, to], index)| match index % 2 {
                0 => Link::Straight,
                _ => Link::Across(from[2].max(to[2]) + 300_000),
            })
            .collect();
        machine::links::add(&mut job, &links);
        let wanted = expected(&job);
        println!(
            "{} passes, {} strips, {} words, window {}, {} rows at once",
            wanted.len(),
            job.header.strips,
            job.words.len(),
            job.header.window,
            job.least_rows
        );
        (job, wanted)
    });
    let (_qemu, mut session) = board();
    for (job, wanted) in jobs {
        drive::upload(&mut session, &job, |_| {}).unwrap();
        let ran = drive::run_digests(&mut session, &wanted, true, None, |_| {}).unwrap();
        assert_eq!(ran.status.state, State::Finished, "{:?}", ran.status);
        assert_eq!(ran.first_bad_index, None, "{ran:?}");
        assert_eq!(Some(ran.status.digest), wanted.last().map(|pass| pass.digest));
        assert_eq!(ran.status.stream.received as usize, job.words.len());
    }
}
