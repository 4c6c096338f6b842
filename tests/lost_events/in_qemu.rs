//! The firmware in QEMU.

use machine::remote::operate::{Setup, make_ready};
use machine::remote::qemu::Qemu;
use machine::remote::{Session, drive};
use protocol::message::Configuration;

use super::{Bench, Loses, Lossy, dome};
use crate::images;

fn session(bench: &Bench, loses: Loses) -> (Qemu, Session) {
    let (qemu, stream) = Qemu::start(images::for_qemu()).unwrap();
    let mut session = Session::open(Box::new(Lossy::new(stream, loses)), 1).unwrap();
    make_ready(&mut session, &Setup::simulated(Configuration::DEFAULT)).unwrap();
    drive::upload(&mut session, &bench.prepared, |_| {}).unwrap();
    (qemu, session)
}

/// In lockstep and on the board's own clock: the first pass, some passes, the last pass, the end, everything.
#[test]
fn a_run_in_qemu_stays_the_same() {
    let bench = dome();
    let events = u32::try_from(bench.run.passes.len()).unwrap() + 1;
    let losses: [(&str, Loses); 5] = [
        ("the first pass", Box::new(|event, _| event == 1)),
        (
            "every second event, once",
            Box::new(|event, before| event % 2 == 0 && before == 0),
        ),
        (
            "the last pass, once",
            Box::new(move |event, before| event == events - 1 && before == 0),
        ),
        ("the end", Box::new(move |event, _| event == events)),
        ("everything", Box::new(|_, _| true)),
    ];
    for (index, (what, loses)) in losses.into_iter().enumerate() {
        let (_qemu, mut session) = session(&bench, loses);
        let run = bench.by_digest(&mut session, index % 2 == 0);
        bench.assert_same(&run, what);
        assert_eq!(run.compared, bench.run.samples, "{what}");
        assert!(run.losses.repeated + run.losses.lost > 0, "{what}");
    }
}

/// Compared sample by sample: QEMU is faster than the host asks, so some lost events are sent again, and the digest proves the others.
#[test]
fn the_samples_of_a_run_in_qemu_stay_the_same() {
    let bench = dome();
    let samples = bench.samples();
    let losses: [(&str, Loses); 3] = [
        (
            "one frame in ten, once",
            Box::new(|event, before| event % 10 == 0 && before == 0),
        ),
        ("fifty in a row", Box::new(|event, _| (30..80).contains(&event))),
        (
            "the last frames and the end, once",
            Box::new(|event, before| event > 200 && before == 0),
        ),
    ];
    for (what, loses) in losses {
        let (_qemu, mut session) = session(&bench, loses);
        let (run, trace) = bench.by_sample(&mut session, true);
        bench.assert_same(&run, what);
        assert_eq!(drive::first_difference(&samples, &trace), None, "{what}");
        assert!(run.losses.repeated + run.losses.lost > 0, "{what}");
    }
}
