//! The machine profile that a board keeps: through power cuts, and against jobs that exceed it.

use controller::in_process::Board;
use integration_tests::{HELLO, Host, LIMITS, PROFILE, dome, upload};
use interp_core::{
    AxisLimits, Header,
    steps::{AxisSteps, StepConfig},
};
use protocol::message::{
    Clock, Configuration, Excess, LinkTimeoutAction, Offsets, Profile, ProfileLimit, Reason, Reply, Request,
    SpindleOrder, Status, StepSettings,
};

const WORDS: usize = 64;

const VELOCITY_MM_S: [f32; 3] = [100.0, 100.0, 50.0];
const TRAVEL_NM: [[i32; 2]; 3] = [[-100_000_000, 100_000_000]; 3];

const CONFIGURATION: Configuration = Configuration {
    homing_required: true,
    on_link_timeout: LinkTimeoutAction::Hold,
    link_timeout_ticks: 700,
};

fn profile() -> Profile {
    let axis = |steps, inverted| AxisSteps {
        steps,
        mm: 1,
        inverted,
    };
    let steps = StepConfig {
        axes: [axis(200, true), axis(400, false), axis(1600, false)],
        pulse_slots: 3,
        setup_slots: 20,
    };
    Profile {
        steps: steps.into(),
        velocity_mm_s: VELOCITY_MM_S,
        travel_nm: Some(TRAVEL_NM),
        configuration: CONFIGURATION,
        ..PROFILE
    }
}

/// The dome within the profile's limits.
fn limited() -> (Header, Vec<i32>) {
    let (mut header, words) = dome();
    header.axes = Some(AxisLimits {
        velocity_mm_s: VELOCITY_MM_S,
        travel_nm: TRAVEL_NM,
        ..LIMITS
    });
    (header, words)
}

/// Host and board.
struct Desk {
    host: Host,
    board: Board<WORDS>,
}

impl Desk {
    fn new(board: Board<WORDS>) -> Self {
        let mut desk = Self {
            host: Host::default(),
            board,
        };
        desk.board.receive(&desk.host.next(&HELLO));
        desk.board.take_sent();
        desk
    }

    /// A new board with the profile, at home with a job that may start.
    fn ready() -> Self {
        let mut desk = Self::new(Board::new());
        desk.ask(&Request::SetProfile(Some(profile()))).unwrap();
        desk.load(limited()).unwrap();
        desk.at_home();
        desk
    }

    /// Switches the drives on, and declares the job's home.
    fn at_home(&mut self) {
        self.ask(&Request::Drives { on: true }).unwrap();
        let home_nm = LIMITS.home_nm;
        self.ask(&Request::SetHome { home_nm }).unwrap();
    }

    fn answer(&mut self, request: &Request) -> Reply {
        self.board.receive(&self.host.next(request));
        self.board.tick();
        let mut replies = self.host.read(&self.board.take_sent());
        assert_eq!(replies.len(), 1);
        replies.remove(0)
    }

    fn ask(&mut self, request: &Request) -> Result<(), Reason> {
        match self.answer(request) {
            Reply::Ack { .. } => Ok(()),
            Reply::Nak { reason, .. } => Err(reason),
            other => panic!("{other:?}"),
        }
    }

    fn status(&mut self) -> Status {
        match self.answer(&Request::Status) {
            Reply::Status { status, .. } => status,
            other => panic!("{other:?}"),
        }
    }

    fn kept(&mut self) -> Option<Profile> {
        match self.answer(&Request::Profile) {
            Reply::Profile { profile, .. } => profile,
            other => panic!("{other:?}"),
        }
    }

    fn load(&mut self, (header, words): (Header, Vec<i32>)) -> Result<(), Reason> {
        upload(header, &words)
            .iter()
            .try_for_each(|request| self.ask(request))
    }

    fn power_cycle(self) -> Self {
        Self::new(self.board.power_cycle())
    }
}

#[test]
fn a_profile_is_in_force_at_once_and_after_a_power_cut() {
    let mut desk = Desk::new(Board::new());
    assert_eq!((desk.kept(), desk.status().profile), (None, 0));
    desk.ask(&Request::SetProfile(Some(profile()))).unwrap();
    for _ in 0..2 {
        assert_eq!(desk.kept(), Some(profile()));
        let status = desk.status();
        assert_eq!(status.profile, profile().digest());
        assert_eq!(status.steps, profile().steps.digest());
        assert_eq!(status.safety.configuration, CONFIGURATION);
        desk = desk.power_cycle();
    }
    desk.ask(&Request::SetProfile(None)).unwrap();
    for _ in 0..2 {
        assert_eq!((desk.kept(), desk.status().profile), (None, 0));
        let own = StepSettings::from(StepConfig::DEFAULT);
        assert_eq!(desk.status().steps, own.digest());
        assert_eq!(desk.status().safety.configuration, Configuration::DEFAULT);
        desk = desk.power_cycle();
    }
}

#[test]
fn another_scale_loses_the_position_and_other_limits_keep_it() {
    let mut desk = Desk::new(Board::new());
    let mut changed = profile();
    desk.ask(&Request::SetProfile(Some(changed))).unwrap();
    desk.ask(&Request::Drives { on: true }).unwrap();
    desk.ask(&Request::SetHome { home_nm: [0; 3] }).unwrap();
    changed.velocity_mm_s[0] *= 0.5;
    desk.ask(&Request::SetProfile(Some(changed))).unwrap();
    assert!(desk.status().safety.homed);
    let mut steps = StepConfig::from(changed.steps);
    steps.axes[2].inverted ^= true;
    changed.steps = steps.into();
    desk.ask(&Request::SetProfile(Some(changed))).unwrap();
    assert!(!desk.status().safety.homed && desk.status().safety.drives_on);
}

/// More changes than both sectors hold, with a power cut now and then.
#[test]
fn a_profile_can_be_changed_for_ever() {
    let mut desk = Desk::new(Board::new());
    for change in 1..100_u16 {
        let mut changed = profile();
        changed.velocity_mm_s[0] = change.into();
        desk.ask(&Request::SetProfile(Some(changed))).unwrap();
        if change % 7 == 0 {
            desk = desk.power_cycle();
        }
        assert_eq!(desk.kept(), Some(changed));
    }
}

#[test]
fn no_job_exceeds_the_profile() {
    let mut desk = Desk::new(Board::new());
    desk.ask(&Request::SetProfile(Some(profile()))).unwrap();
    desk.load(limited()).unwrap();
    let (mut fast, words) = limited();
    if let Some(axes) = &mut fast.axes {
        axes.jerk_mm_s3[2] = 30_000.0;
    }
    let excess = Excess {
        limit: ProfileLimit::Jerk,
        axis: 2,
        most: 20_000.0,
        wanted: 30_000.0,
    };
    assert_eq!(desk.load((fast, words)), Err(Reason::BeyondProfile { excess }));
    // The job before is still loaded.
    desk.at_home();
    assert_eq!(desk.ask(&Request::Start), Ok(()));
    // Neither are settings changed under a run.
    let refused = desk.ask(&Request::SetProfile(None)).unwrap_err();
    assert!(matches!(refused, Reason::WrongState { .. }), "{refused}");
    assert_eq!(desk.kept(), Some(profile()));
}

#[test]
fn steps_and_homing_are_the_machines() {
    let mut desk = Desk::new(Board::new());
    desk.ask(&Request::SetProfile(Some(profile()))).unwrap();
    let beyond = |limit| {
        Err(Reason::BeyondProfile {
            excess: Excess::of(limit),
        })
    };
    let other = StepSettings::from(StepConfig::DEFAULT);
    assert_eq!(desk.ask(&Request::StepConfig(other)), beyond(ProfileLimit::Steps));
    assert_eq!(desk.ask(&Request::StepConfig(profile().steps)), Ok(()));
    let free = Configuration {
        homing_required: false,
        ..CONFIGURATION
    };
    assert_eq!(desk.ask(&Request::Configure(free)), beyond(ProfileLimit::Homing));
    let finish = Configuration {
        on_link_timeout: LinkTimeoutAction::Finish,
        ..CONFIGURATION
    };
    assert_eq!(desk.ask(&Request::Configure(finish)), Ok(()));
    assert_eq!(desk.status().steps, profile().steps.digest());
}

#[test]
fn a_job_is_loaded_again_after_a_change_of_the_profile() {
    let mut desk = Desk::ready();
    let mut slow = profile();
    slow.velocity_mm_s = [10.0; 3];
    desk.ask(&Request::SetProfile(Some(slow))).unwrap();
    assert_eq!(desk.ask(&Request::Start), Err(Reason::OtherProfile));
    let too_fast = desk.load(limited()).unwrap_err();
    assert!(matches!(too_fast, Reason::BeyondProfile { .. }), "{too_fast}");
    desk.ask(&Request::SetProfile(Some(profile()))).unwrap();
    desk.load(limited()).unwrap();
    assert_eq!(desk.ask(&Request::Start), Ok(()));
}

/// A start was checked against profile, offsets, spindle and step settings: none of them changes before it is executed, queued or waiting for credit; nor does the clock of
/// one that is queued.
#[test]
fn nothing_that_a_start_was_checked_by_changes_before_its_period() {
    let mut narrow = profile();
    narrow.travel_nm = Some([[-1, 1]; 3]);
    for clock in [Clock::Free, Clock::Lockstep] {
        for request in [
            Request::SetProfile(Some(narrow)),
            Request::SetProfile(None),
            Request::SetOffsets(Offsets::NONE),
            Request::Spindle(SpindleOrder::OFF),
            Request::StepConfig(profile().steps),
            Request::Clock(Clock::Lockstep),
            Request::Clock(Clock::Free),
        ] {
            if clock == Clock::Lockstep && matches!(request, Request::Clock(_)) {
                continue;
            }
            let mut desk = Desk::ready();
            desk.ask(&Request::Clock(clock)).unwrap();
            // On a free clock within the tick of the start.
            desk.board.receive(&desk.host.next(&Request::Start));
            if clock == Clock::Lockstep {
                desk.board.tick();
            }
            desk.board.receive(&desk.host.next(&request));
            let replies = desk.host.read(&desk.board.take_sent());
            let refused = |reply: &&Reply| {
                matches!(
                    reply,
                    Reply::Nak {
                        reason: Reason::Busy,
                        ..
                    }
                )
            };
            assert!(
                replies.last().is_some_and(|reply| refused(&reply)),
                "{clock:?}, {request:?}: {replies:?}"
            );
            assert_eq!(desk.kept(), Some(profile()));
            if clock == Clock::Lockstep {
                desk.board.receive(&desk.host.next(&Request::Run { ticks: 1 }));
            }
            (0..3).for_each(|_| desk.board.tick());
            desk.board.take_sent();
            assert!(desk.status().state.is_under_way());
        }
    }
}

#[test]
fn a_profile_with_more_steps_than_a_period_holds_is_refused() {
    let mut desk = Desk::new(Board::new());
    // Pulses of 3 slots, as long a pause after each: 166 steps in a period of 1 ms, and half a step for whole nanometres.
    let with = |steps_per_mm: u32| {
        let mut profile = profile();
        let mut steps = StepConfig::from(profile.steps);
        steps.axes[1].steps = steps_per_mm;
        profile.steps = steps.into();
        profile
    };
    assert_eq!(desk.ask(&Request::SetProfile(Some(with(1_650)))), Ok(()));
    for steps_per_mm in [1_656, 1_700, 500_000] {
        let refused = desk.ask(&Request::SetProfile(Some(with(steps_per_mm))));
        assert_eq!(refused, Err(Reason::BadProfile), "{steps_per_mm}");
        assert_eq!(desk.kept(), Some(with(1_650)));
    }
}

#[test]
fn a_profile_with_a_bad_value_is_refused() {
    let mut desk = Desk::new(Board::new());
    desk.ask(&Request::SetProfile(Some(profile()))).unwrap();
    for change in [
        (|profile: &mut Profile| profile.jerk_mm_s3[0] = 0.0) as fn(&mut Profile),
        |profile| profile.velocity_mm_s[1] = f32::NAN,
        |profile| profile.travel_nm = Some([[1, 0]; 3]),
    ] {
        let mut bad = profile();
        change(&mut bad);
        assert_eq!(desk.ask(&Request::SetProfile(Some(bad))), Err(Reason::BadProfile));
        assert_eq!(desk.kept(), Some(profile()));
    }
}
