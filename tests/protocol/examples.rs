//! One example of each message, with values that show every field.

use integration_tests::HELLO;
use interp_core::{
    RunStart,
    job::{AxisLimits, Header, Pattern, Spacing, SurfaceKind, ToolSide},
    sample::{Sample, SpanParameter, State},
    steps::{AxisSteps, StepConfig},
};
use protocol::{
    frame::FrameError,
    message::{
        Activity, AtSpeed, Batch, Capabilities, Clock, Configuration, Description, DoorContact, Excess,
        FaultReport, Homing, InputLines, JobName, JogWay, Journal, LinkTimeoutAction, MotionEnd,
        MotionStatus, Offsets, PassDigest, PauseCause, Profile, ProfileLimit, Reason, Reply, Report, Request,
        ResetCause, SafetyStatus, SampleRecord, SpindleOrder, SpindleSettings, Status, StoredJobInfo,
        StreamStatus, Turning, Words,
    },
};

fn header() -> Header {
    Header {
        kind: SurfaceKind::Rational,
        pattern: Pattern::Zigzag,
        spacing: Spacing::FirstOrder,
        tool_side: ToolSide::Minus,
        path_spans: 3,
        side_spans: 200,
        ball_radius_mm: 10.0,
        feed_mm_s: 10.0,
        scallop_mm: 0.005,
        period_s: 0.001,
        edges: 0,
        links: 0,
        window: 0,
        strips: 0,
        axes: None,
    }
}

fn steps() -> StepConfig {
    let axis = |steps, mm, inverted| AxisSteps { steps, mm, inverted };
    StepConfig {
        axes: [axis(400, 1, false), axis(3200, 5, true), axis(16_000, 127, false)],
        pulse_slots: 3,
        setup_slots: 480,
    }
}

/// Axis limits of the test jobs.
fn axes() -> AxisLimits {
    AxisLimits {
        velocity_mm_s: [100.0, 80.0, 50.0],
        acceleration_mm_s2: [1000.0, 800.0, 500.0],
        jerk_mm_s3: [20_000.0, 16_000.0, 10_000.0],
        chord_mm: 0.005,
        overrun_mm: 0.0,
        travel_nm: [[-1, 1], [i32::MIN, i32::MAX], [0, 64]],
        home_nm: [1, -2, i32::MAX],
        plunge_mm: 2.0,
        end_nm: Some([-1, 0, 300]),
        end_height_nm: 70_000,
        safe_z_nm: 50_000_000,
    }
}

fn profile() -> Profile {
    Profile {
        steps: steps().into(),
        velocity_mm_s: axes().velocity_mm_s,
        acceleration_mm_s2: axes().acceleration_mm_s2,
        jerk_mm_s3: axes().jerk_mm_s3,
        travel_nm: Some([[-1, 1], [i32::MIN, i32::MAX], [0, 64]]),
        configuration: CONFIGURATION,
        homing: Some(homing()),
        probe_inverted: true,
        step_inverted: 0b010,
        enable_inverted: 0b101,
        spindle: Some(SpindleSettings {
            max_rpm: 24_000,
            at_speed_ticks: 3_000,
            stops_at_pause: true,
            at_speed: AtSpeed::Opens,
        }),
        door: DoorContact::NormallyClosed,
    }
}

const OFFSETS: Offsets = Offsets {
    work_nm: [[1, -2, 300], [4, 5, 6], [0; 3]],
    tool_nm: -7,
};

fn homing() -> Homing {
    Homing {
        order: [2, 0, 1],
        at_upper_end: [false, false, true],
        position_nm: [-2, -3, 64],
        seek_mm_s: [20.0; 3],
        approach_mm_s: [1.0; 3],
        back_off_nm: [300; 3],
        survives_off: true,
    }
}

/// One request of each kind in order of the codes, and a job with axis limits.
pub(super) fn requests() -> Vec<Request> {
    vec![
        HELLO,
        Request::JobBegin {
            header: header(),
            words: 300,
            digest: 0x0123_4567_89ab_cdef,
        },
        Request::JobChunk {
            offset: 128,
            words: Words::new(&[0, 1, -1, i32::MAX, i32::MIN]).unwrap(),
        },
        Request::JobEnd,
        Request::Start,
        Request::Hold,
        Request::Resume,
        Request::Abort,
        Request::Status,
        Request::Clock(Clock::Lockstep),
        Request::Run { ticks: 1000 },
        Request::Report(Report::Samples),
        Request::StepConfig(steps().into()),
        Request::Configure(CONFIGURATION),
        Request::Drives { on: true },
        Request::SetHome {
            home_nm: [1, -2, i32::MAX],
        },
        Request::Acknowledge,
        Request::Override { percent: 150 },
        Request::Stop,
        Request::Simulate {
            lines: InputLines(0x102),
        },
        Request::Repeat { event: 300, count: 4 },
        Request::Profile,
        Request::SetProfile(Some(profile())),
        Request::SetProfile(None),
        Request::Jog {
            way: JogWay::By { nm: [0, 64, -300] },
            speed_mm_s: 12.5,
        },
        Request::Jog {
            way: JogWay::Towards { signs: [-1, 0, 1] },
            speed_mm_s: 12.5,
        },
        Request::Home { axes: 5 },
        Request::Probe {
            axis: 2,
            nm: -300,
            speed_mm_s: 1.5,
        },
        Request::Motion,
        Request::Offsets,
        Request::SetOffsets(OFFSETS),
        Request::Spindle(SpindleOrder {
            turning: Turning::Counterclockwise,
            rpm: 12_000,
            coolant: true,
        }),
        Request::Pause,
        Request::StartAt(RunStart {
            pass: 300,
            path: SpanParameter {
                span: 7,
                fraction: 1 << 63,
            },
        }),
        Request::Journal,
        Request::Turn {
            turning: Turning::Clockwise,
            rpm: 300,
        },
        Request::Coolant { on: true },
        Request::StoreJob {
            name: JobName::try_from("left").unwrap(),
            begins_anywhere: true,
        },
        Request::DeleteJob {
            name: JobName::try_from("left").unwrap(),
        },
        Request::StoredJob { index: 7 },
        Request::StartJob {
            name: JobName::try_from("left").unwrap(),
            resumes: true,
        },
        Request::JobBegin {
            header: Header {
                axes: Some(axes()),
                ..header()
            },
            words: 1,
            digest: u64::MAX,
        },
    ]
}

const CONFIGURATION: Configuration = Configuration {
    homing_required: false,
    on_link_timeout: LinkTimeoutAction::Hold,
    link_timeout_ticks: 500,
};

const PATH: SpanParameter = SpanParameter {
    span: 1,
    fraction: 1 << 63,
};
const SIDE: SpanParameter = SpanParameter {
    span: 130,
    fraction: u64::MAX,
};

fn sample() -> Sample {
    Sample {
        tick: 1000,
        state: State::Running,
        pass: 2,
        path: PATH,
        side: SIDE,
        feed_mm_s: 10.0,
        cc_nm: [1, -2, 3_000_000],
        cl_nm: [i32::MAX, i32::MIN, 0],
        inv_interval_sq: f32::INFINITY,
    }
}

fn status() -> Status {
    Status {
        state: State::Faulted,
        fault: Some(FaultReport { code: 12, value: 1.0 }),
        clock: Clock::Lockstep,
        credit: 5,
        report: Report::Samples,
        tick: 1000,
        pass: 2,
        path: PATH,
        side: SIDE,
        samples: 1001,
        digest: 0x0123_4567_89ab_cdef,
        interval: 0.25,
        deadline_misses: 1,
        tick_cycles_max: 20_000,
        samples_lost: 2,
        frames_bad: 3,
        halts: 4,
        events: 302,
        steps: 0x1234_5678,
        profile: 0x9abc_def0,
        stream: StreamStatus {
            received: 300,
            room: 20_000,
            starved: 7,
        },
        safety: SafetyStatus {
            lines: InputLines(1),
            latched: InputLines(0x201),
            homed: false,
            drives_on: true,
            link_timed_out: true,
            feed_override: 150,
            configuration: CONFIGURATION,
            reset: ResetCause::Watchdog,
            pause: PauseCause::Door,
            spindle: SpindleOrder {
                turning: Turning::Clockwise,
                rpm: 300,
                coolant: true,
            },
        },
    }
}

pub(super) fn reasons() -> Vec<Reason> {
    vec![
        Reason::BadFrame {
            error: FrameError::Checksum,
        },
        Reason::Unreadable,
        Reason::SayHello,
        Reason::Version { host: 2, board: 1 },
        Reason::OutOfOrder { expected: 300 },
        Reason::WrongState {
            state: State::Running,
        },
        Reason::WrongClock { clock: Clock::Free },
        Reason::Busy,
        Reason::Job {
            fault: FaultReport { code: 9, value: 1.5 },
            record: Some(7),
        },
        Reason::TooLong {
            limit: 16_384,
            wanted: 20_000,
        },
        Reason::NoUpload,
        Reason::WrongOffset { expected: 64 },
        Reason::Incomplete {
            wanted: 300,
            received: 128,
        },
        Reason::WrongDigest {
            wanted: 1,
            received: 2,
        },
        Reason::Unsafe {
            fault: FaultReport {
                code: 17,
                value: 10.0,
            },
        },
        Reason::DrivesOff,
        Reason::OutOfRange {
            most: 200,
            wanted: 201,
        },
        Reason::Unsupported,
        Reason::NotAtHome {
            home_nm: [1, -2, i32::MIN],
            stands_nm: Some([i32::MAX, 0, -64]),
        },
        Reason::NotAtHome {
            home_nm: [0; 3],
            stands_nm: None,
        },
        Reason::EventGone { first: 290 },
        Reason::BeyondProfile {
            excess: Excess {
                limit: ProfileLimit::Jerk,
                axis: 2,
                most: 10_000.0,
                wanted: 10_001.0,
            },
        },
        Reason::BadProfile,
        Reason::Storage,
        Reason::OtherProfile,
        Reason::NoLimits,
        Reason::Moving,
        Reason::NoProfile,
        Reason::BeyondTravel {
            axis: 1,
            travel_nm: [-1, 1_500_000],
            wanted_nm: 1_500_001,
        },
        Reason::NoHoming,
        Reason::ProbeTripped,
        Reason::NoSpindle,
        Reason::RowsGone,
        Reason::WholeOnly,
        Reason::SpindleTurns,
        Reason::NoFeed,
        Reason::NoStoredJob,
        Reason::NoRoom { words: 300 },
        Reason::NothingToResume,
        Reason::BadSpeed { mm_s: -0.5 },
    ]
}

/// One reply of each kind in order of the codes, `Nak` with every reason.
pub(super) fn replies() -> Vec<Reply> {
    let description = Description {
        firmware: [0, 1, 0],
        board: "netduinoplus2".try_into().unwrap(),
        store_words: 16_384,
        patches_max_polynomial: 315,
        patches_max_rational: 240,
        chunk_words_max: 64,
        period_us: 1000,
    };
    let mut replies = vec![
        Reply::Capabilities(Capabilities {
            number: 1,
            version: 1,
            session: 1,
            description,
        }),
        Reply::Ack { number: 300 },
    ];
    replies.extend(
        reasons()
            .into_iter()
            .map(|reason| Reply::Nak { number: 2, reason }),
    );
    let pass = PassDigest {
        pass: 2,
        first_tick: 900,
        samples: 101,
        digest: 0x0123_4567_89ab_cdef,
        interval: 0.25,
    };
    replies.extend([
        Reply::Status {
            number: 3,
            status: status(),
        },
        Reply::Samples {
            event: 300,
            samples: Batch::from_slice(&[SampleRecord(sample()); 2]).unwrap(),
        },
        Reply::PassDigest { event: 301, pass },
        Reply::Halted(status()),
        Reply::Profile {
            number: 4,
            profile: Some(profile()),
        },
        Reply::Profile {
            number: 5,
            profile: None,
        },
        Reply::Motion {
            number: 6,
            motion: MotionStatus {
                activity: Activity::Approach,
                axes: 0b101,
                at_nm: [1, -2, 300],
                homed_axes: 3,
                end: MotionEnd::WrongSwitch,
                lines: InputLines(0x800),
                tripped_nm: Some(-64),
                periods: 300,
                digest: 0x0123_4567_89ab_cdef,
            },
        },
        Reply::Offsets {
            number: 7,
            offsets: OFFSETS,
        },
        Reply::Room {
            event: 303,
            room: 20_000,
        },
        Reply::Journal {
            number: 8,
            journal: Some(Journal {
                job: 0x0123_4567_89ab_cdef,
                profile: 0x9abc_def0,
                pass: 300,
                is_finished: true,
                path: SpanParameter {
                    span: 300,
                    fraction: 0x0123_4567_89ab_cdef,
                },
            }),
        },
        Reply::StoredJob {
            number: 9,
            job: Some(StoredJobInfo {
                name: JobName::try_from("left").unwrap(),
                words: 300,
                mark: 0x0123_4567_89ab_cdef,
            }),
            room: 20_000,
        },
    ]);
    replies
}
