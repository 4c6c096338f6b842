//! Random sequences of requests, noise and missed ticks, against the runs that the core alone makes.

use integration_tests::{HELLO, MAKE_READY, PROFILE, dome, upload};
use interp_core::{
    fault::FaultKind,
    sample::{Sample, State},
};
use proptest::prelude::*;
use protocol::message::{Clock, Profile, Reply, Report, Request, Status};

use super::{Desk, digest, reference, samples_of_dome};

/// An action of the host, or a disturbance of the line.
#[derive(Clone, Debug)]
enum Deed {
    Noise(Vec<u8>),
    Upload,
    /// Drives on, and home declared.
    Ready,
    Ask(Request),
    /// A request with a wrong sequence number.
    Stray(u16, Request),
    Damage(Request, usize),
    Ticks(u8),
    /// A number of missed ticks of the sample timer.
    Miss(u8),
}

fn any_deed() -> impl Strategy<Value = Deed> {
    let (header, words) = dome();
    let mut requests = upload(header, &words);
    requests.extend([
        Request::Start,
        Request::Start,
        Request::Hold,
        Request::Resume,
        Request::Abort,
    ]);
    requests.extend([
        Request::Status,
        Request::Clock(Clock::Free),
        Request::Clock(Clock::Lockstep),
        HELLO,
    ]);
    requests.extend([Request::Report(Report::Samples), Request::Report(Report::Digests)]);
    requests.extend([Request::Run { ticks: 40 }, Request::Run { ticks: 0 }]);
    // After a change of the profile the job has to be loaded again, and home may be lost.
    let fast = Profile {
        velocity_mm_s: [200.0; 3],
        ..PROFILE
    };
    requests.extend([None, Some(PROFILE), Some(fast)].map(Request::SetProfile));
    let request = prop::sample::select(requests);
    prop_oneof![
        2 => prop::collection::vec(any::<u8>(), 0..400).prop_map(Deed::Noise),
        2 => Just(Deed::Upload),
        2 => Just(Deed::Ready),
        12 => request.clone().prop_map(Deed::Ask),
        2 => (any::<u16>(), request.clone()).prop_map(|(number, request)| Deed::Stray(number, request)),
        2 => (request, any::<usize>()).prop_map(|(request, bit)| Deed::Damage(request, bit)),
        6 => any::<u8>().prop_map(Deed::Ticks),
        1 => any::<u8>().prop_map(Deed::Miss),
    ]
}

/// Sends bytes that are not the next request, and checks that the board's status does not change.
fn give_without_effect(desk: &mut Desk, bytes: &[u8]) {
    let before = desk.board.status();
    desk.board.receive(&[0]);
    desk.board.receive(bytes);
    desk.board.receive(&[0]);
    for answer in desk.collect() {
        assert!(matches!(answer, Reply::Nak { .. }), "{answer:?}");
    }
    assert_eq!(desk.board.status(), before);
}

fn act(desk: &mut Desk, deed: Deed) {
    match deed {
        Deed::Noise(bytes) => give_without_effect(desk, &bytes),
        Deed::Upload => {
            let (header, words) = dome();
            for request in upload(header, &words) {
                desk.ask(&request);
            }
        }
        Deed::Ready => {
            for request in MAKE_READY {
                desk.ask(&request);
            }
        }
        Deed::Ask(HELLO) => {
            let before = desk.board.status();
            desk.board.receive(&integration_tests::frame(1, &HELLO));
            assert!(matches!(desk.collect()[..], [Reply::Capabilities(_)]));
            assert_eq!(desk.board.status(), before);
        }
        Deed::Ask(request) => {
            desk.ask(&request);
        }
        Deed::Stray(number, request) => {
            // Differs from the last number and from the next.
            let number = desk.host.number.wrapping_add(2 + number % 60_000);
            if !matches!(request, Request::Hello { .. }) {
                give_without_effect(desk, &integration_tests::frame(number, &request));
            }
        }
        Deed::Damage(request, bit) => {
            let mut frame = integration_tests::frame(desk.host.number.wrapping_add(1), &request);
            let bit = bit % (8 * (frame.len() - 1));
            frame[bit / 8] ^= 1 << (bit % 8);
            give_without_effect(desk, &frame);
        }
        Deed::Ticks(ticks) => desk.ticks(usize::from(ticks)),
        Deed::Miss(missed) => {
            desk.board.tick_with(u32::from(missed), 0);
            assert_eq!(desk.collect(), []);
        }
    }
}

/// The expected state of the run, from the actions so far.
struct Model {
    whole: Vec<Sample>,
    before: Status,
    /// The samples of the latest run if a missed tick stopped it, and the number of missed ticks.
    stopped: Option<(Vec<Sample>, f32)>,
}

impl Model {
    fn new(before: Status) -> Self {
        Self {
            whole: reference(),
            before,
            stopped: None,
        }
    }

    /// Checks one action: the status after it, and the samples reported during it.
    fn follow(&mut self, deed: &Deed, status: Status, reported: &[Sample]) -> Result<(), TestCaseError> {
        if let (None, Some(fault)) = (self.before.fault, status.fault) {
            // Only a missed tick causes a fault here, in the single tick of that action: it stops the run that was under way.
            let Deed::Miss(missed @ 1..) = *deed else {
                return Err(TestCaseError::fail(format!("{fault:?} by {deed:?}")));
            };
            prop_assert_eq!(self.before.state, State::Running);
            prop_assert_eq!(status.clock, Clock::Free);
            let after = usize::try_from(self.before.samples).unwrap();
            self.stopped = Some((samples_of_dome(Some(after)), missed.into()));
        }
        let count = usize::try_from(status.samples).unwrap();
        let is_of = |run: &[Sample]| run.get(..count).is_some_and(|run| status.digest == digest(run));
        match &self.stopped {
            Some((run, missed)) if status.fault.is_some() => {
                let fault = status.fault.unwrap();
                prop_assert_eq!(
                    (fault.kind(), fault.value),
                    (Some(FaultKind::DeadlineMissed), *missed)
                );
                prop_assert!(is_of(run));
                let over = count == run.len();
                prop_assert!(
                    matches!(
                        (status.state, over),
                        (State::Stopping, _) | (State::Faulted, true)
                    ),
                    "{:?} after {} of {}",
                    status.state,
                    count,
                    run.len()
                );
            }
            // The fault was acknowledged at standstill; the counters remain until the next run begins.
            Some((run, _)) if count == run.len() && is_of(run) => {}
            _ => {
                self.stopped = None;
                prop_assert!(is_of(&self.whole), "{count} samples");
                prop_assert!(status.state != State::Finished || count == self.whole.len());
            }
        }
        for sample in reported {
            let run = match &self.stopped {
                Some((run, _)) if sample.state == State::Stopping => run,
                _ => &self.whole,
            };
            prop_assert_eq!(Some(sample), run.get(usize::try_from(sample.tick).unwrap()));
        }
        self.before = status;
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// No panic, one answer for each request, no effect of damaged frames, and every sample equal to that of the core,
    /// also while a missed tick stops the run.
    #[test]
    fn any_order_of_anything_is_survived(
        clock in prop::sample::select(&[Clock::Free, Clock::Lockstep]),
        deeds in prop::collection::vec(any_deed(), 0..60),
    ) {
        let mut desk = Desk::loaded(clock, Report::Samples);
        let mut model = Model::new(desk.board.status());
        for deed in deeds {
            act(&mut desk, deed.clone());
            let reported = core::mem::take(&mut desk.samples);
            let status = desk.board.status();
            model.follow(&deed, status, &reported)?;
        }
    }
}
