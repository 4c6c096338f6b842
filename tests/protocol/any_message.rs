//! Messages of random content, for property tests.

use interp_core::{
    job::{AxisLimits, Header, Pattern, Spacing, SurfaceKind, ToolSide},
    sample::{Sample, SpanParameter, State},
    steps::{AxisSteps, StepConfig},
};
use proptest::prelude::*;
use protocol::message::{
    CHUNK_WORDS_MAX, Capabilities, Clock, Configuration, Description, DoorContact, FaultReport, InputLines,
    LinkTimeoutAction, PassDigest, PauseCause, Profile, Reason, Reply, Report, Request, ResetCause,
    SAMPLES_MAX, SafetyStatus, SampleRecord, SpindleOrder, Status, StreamStatus, Turning, Words,
};

use super::examples::{reasons, requests};

fn place() -> impl Strategy<Value = SpanParameter> {
    let fraction = prop_oneof![Just(0), Just(u64::MAX), any::<u64>()];
    (any::<u16>(), fraction).prop_map(|(span, fraction)| SpanParameter { span, fraction })
}

fn real() -> impl Strategy<Value = f32> {
    any::<f32>().prop_filter("equal to itself", |value| !value.is_nan())
}

prop_compose! {
    fn any_axes()(reals in prop::array::uniform12(real()), travel_nm in any::<[[i32; 2]; 3]>(), home_nm in any::<[i32; 3]>(),
                  end_nm in any::<Option<[i32; 3]>>(), [safe_z_nm, end_height_nm] in any::<[i32; 2]>()) -> AxisLimits {
        let [vx, vy, vz, ax, ay, az, jx, jy, jz, chord_mm, plunge_mm, overrun_mm] = reals;
        AxisLimits {
            velocity_mm_s: [vx, vy, vz],
            acceleration_mm_s2: [ax, ay, az],
            jerk_mm_s3: [jx, jy, jz],
            chord_mm,
            travel_nm,
            home_nm,
            end_nm,
            end_height_nm,
            plunge_mm,
            safe_z_nm,
            overrun_mm,
        }
    }
}

prop_compose! {
    fn any_header()(codes in (0_u8..4, any::<bool>(), any::<bool>(), any::<bool>()), spans in any::<[u16; 2]>(),
                    values in [real(), real(), real(), real()], axes in prop::option::of(any_axes())) -> Header {
        Header {
            kind: SurfaceKind::from_code(codes.0).unwrap(),
            pattern: if codes.1 { Pattern::Zigzag } else { Pattern::Zig },
            spacing: if codes.3 { Spacing::FirstOrder } else { Spacing::Exact },
            tool_side: if codes.2 { ToolSide::Minus } else { ToolSide::Plus },
            path_spans: spans[0],
            side_spans: spans[1],
            ball_radius_mm: values[0],
            feed_mm_s: values[1],
            scallop_mm: values[2],
            period_s: values[3],
            edges: spans[0],
            links: spans[1],
            window: spans[0] ^ spans[1],
            strips: spans[0].rotate_left(5),
            axes,
        }
    }
}

fn any_clock() -> impl Strategy<Value = Clock> {
    prop_oneof![Just(Clock::Free), Just(Clock::Lockstep)]
}

fn any_report() -> impl Strategy<Value = Report> {
    prop_oneof![Just(Report::Digests), Just(Report::Samples)]
}

prop_compose! {
    fn any_configuration()(homing_required: bool, hold: bool, link_timeout_ticks: u32) -> Configuration {
        let on_link_timeout = if hold { LinkTimeoutAction::Hold } else { LinkTimeoutAction::Finish };
        Configuration { homing_required, on_link_timeout, link_timeout_ticks }
    }
}

fn any_lines() -> impl Strategy<Value = InputLines> {
    any::<u16>().prop_map(InputLines)
}

prop_compose! {
    fn any_safety()(lines in any_lines(), latched in any_lines(), flags in any::<[bool; 3]>(), feed_override: u8,
                    configuration in any_configuration(),
                    reset in prop::sample::select(&[ResetCause::Unknown, ResetCause::Pin, ResetCause::LowPower]),
                    pause in prop::sample::select(&[PauseCause::None, PauseCause::Door, PauseCause::BelowSpeed]), rpm: u32)
        -> SafetyStatus {
        let [homed, drives_on, link_timed_out] = flags;
        let turning = if homed { Turning::Clockwise } else { Turning::Counterclockwise };
        let spindle = SpindleOrder { turning, rpm, coolant: drives_on };
        SafetyStatus { lines, latched, homed, drives_on, link_timed_out, feed_override, configuration, reset, pause, spindle }
    }
}

prop_compose! {
    fn any_steps()(axes in any::<[(u32, u32, bool); 3]>(), pulse_slots in any::<u8>(), setup_slots in any::<u16>()) -> StepConfig {
        let axes = axes.map(|(steps, mm, inverted)| AxisSteps { steps, mm, inverted });
        StepConfig { axes, pulse_slots, setup_slots }
    }
}

prop_compose! {
    fn any_profile()(axes in any_axes(), steps in any_steps(), has_travel: bool, configuration in any_configuration()) -> Profile {
        Profile {
            steps: steps.into(),
            velocity_mm_s: axes.velocity_mm_s,
            acceleration_mm_s2: axes.acceleration_mm_s2,
            jerk_mm_s3: axes.jerk_mm_s3,
            travel_nm: has_travel.then_some(axes.travel_nm),
            configuration,
            homing: None,
            probe_inverted: has_travel,
            step_inverted: u8::from(has_travel),
            enable_inverted: 7,
            spindle: None,
            door: if has_travel { DoorContact::NormallyOpen } else { DoorContact::None },
        }
    }
}

pub(crate) fn any_request() -> impl Strategy<Value = Request> {
    let words = prop::collection::vec(any::<i32>(), 0..=CHUNK_WORDS_MAX);
    prop_oneof![
        any::<(u16, u32)>().prop_map(|(version, session)| Request::Hello { version, session }),
        (any_header(), any::<u32>(), any::<u64>()).prop_map(|(header, words, digest)| Request::JobBegin {
            header,
            words,
            digest
        }),
        (any::<u32>(), words).prop_map(|(offset, words)| Request::JobChunk {
            offset,
            words: Words::new(&words).unwrap()
        }),
        prop::sample::select(requests()),
        any_clock().prop_map(Request::Clock),
        any::<u32>().prop_map(|ticks| Request::Run { ticks }),
        any_report().prop_map(Request::Report),
        any_configuration().prop_map(Request::Configure),
        any::<bool>().prop_map(|on| Request::Drives { on }),
        any::<[i32; 3]>().prop_map(|home_nm| Request::SetHome { home_nm }),
        any::<u8>().prop_map(|percent| Request::Override { percent }),
        any_lines().prop_map(|lines| Request::Simulate { lines }),
        any::<(u32, u8)>().prop_map(|(event, count)| Request::Repeat { event, count }),
        any_steps().prop_map(|config| Request::StepConfig(config.into())),
        prop::option::of(any_profile()).prop_map(Request::SetProfile),
    ]
}

prop_compose! {
    fn any_sample()(state in prop::sample::select(&State::ALL[..]), places in [place(), place()],
                    counts in any::<[u32; 2]>(), cc_nm in any::<[i32; 3]>(), cl_nm in any::<[i32; 3]>(),
                    feed_mm_s in real(), inv_interval_sq in real()) -> Sample {
        let ([tick, pass], [path, side]) = (counts, places);
        Sample { tick, state, pass, path, side, feed_mm_s, cc_nm, cl_nm, inv_interval_sq }
    }
}

prop_compose! {
    fn any_status()(at in any_sample(), fault in prop::option::of((any::<u8>(), real())), clock in any_clock(),
                    report in any_report(), counts in any::<[u32; 10]>(), digest in any::<u64>(),
                    stream in any::<[u32; 3]>(), safety in any_safety()) -> Status {
        let [credit, samples, deadline_misses, tick_cycles_max, samples_lost, frames_bad, halts, events, steps, profile] = counts;
        let [received, room, starved] = stream;
        Status {
            state: at.state,
            fault: fault.map(|(code, value)| FaultReport { code, value }),
            clock,
            credit,
            report,
            tick: at.tick,
            pass: at.pass,
            path: at.path,
            side: at.side,
            samples,
            digest,
            interval: at.inv_interval_sq,
            deadline_misses,
            tick_cycles_max,
            samples_lost,
            frames_bad,
            halts,
            events,
            steps,
            profile,
            stream: StreamStatus { received, room, starved },
            safety,
        }
    }
}

prop_compose! {
    fn any_capabilities()(name in "[ -~]{0,24}", numbers in any::<[u16; 6]>(), counts in any::<[u32; 5]>())
        -> Capabilities {
        let [number, version, major, minor, patch, chunk_words_max] = numbers;
        let [session, store_words, patches_max_polynomial, patches_max_rational, period_us] = counts;
        let description = Description {
            firmware: [major, minor, patch],
            board: name.as_str().try_into().unwrap(),
            store_words,
            patches_max_polynomial,
            patches_max_rational,
            chunk_words_max,
            period_us,
        };
        Capabilities { number, version, session, description }
    }
}

fn any_reason() -> impl Strategy<Value = Reason> {
    prop_oneof![
        prop::sample::select(reasons()),
        any::<(u16, u16)>().prop_map(|(host, board)| Reason::Version { host, board }),
        any::<u16>().prop_map(|expected| Reason::OutOfOrder { expected }),
        prop::sample::select(&State::ALL[..]).prop_map(|state| Reason::WrongState { state }),
        (any::<u8>(), real()).prop_map(|(code, value)| Reason::Unsafe {
            fault: FaultReport { code, value }
        }),
        (any::<u32>(), any::<u32>()).prop_map(|(most, wanted)| Reason::OutOfRange { most, wanted }),
        (any::<[i32; 3]>(), any::<Option<[i32; 3]>>())
            .prop_map(|(home_nm, stands_nm)| Reason::NotAtHome { home_nm, stands_nm }),
        (any::<u8>(), real(), any::<Option<u32>>()).prop_map(|(code, value, record)| Reason::Job {
            fault: FaultReport { code, value },
            record
        }),
        any::<(u32, u32)>().prop_map(|(limit, wanted)| Reason::TooLong { limit, wanted }),
        any::<(u32, u32)>().prop_map(|(wanted, received)| Reason::Incomplete { wanted, received }),
        any::<(u64, u64)>().prop_map(|(wanted, received)| Reason::WrongDigest { wanted, received }),
        any::<u32>().prop_map(|expected| Reason::WrongOffset { expected }),
        any::<u32>().prop_map(|first| Reason::EventGone { first }),
    ]
}

pub(crate) fn any_reply() -> impl Strategy<Value = Reply> {
    let samples = prop::collection::vec(any_sample().prop_map(SampleRecord), 0..=SAMPLES_MAX);
    prop_oneof![
        any_capabilities().prop_map(Reply::Capabilities),
        any::<u16>().prop_map(|number| Reply::Ack { number }),
        (any::<u16>(), any_reason()).prop_map(|(number, reason)| Reply::Nak { number, reason }),
        (any::<u16>(), any_status()).prop_map(|(number, status)| Reply::Status { number, status }),
        (any::<u32>(), samples).prop_map(|(event, samples)| Reply::Samples {
            event,
            samples: samples.into_iter().collect()
        }),
        (any::<[u32; 4]>(), any::<u64>(), real()).prop_map(
            |([event, pass, first_tick, samples], digest, interval)| {
                let pass = PassDigest {
                    pass,
                    first_tick,
                    samples,
                    digest,
                    interval,
                };
                Reply::PassDigest { event, pass }
            }
        ),
        any_status().prop_map(Reply::Halted),
        any::<[u32; 2]>().prop_map(|[event, room]| Reply::Room { event, room }),
        (any::<u16>(), prop::option::of(any_profile()))
            .prop_map(|(number, profile)| Reply::Profile { number, profile }),
    ]
}
