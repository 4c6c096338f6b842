//! The last answered request, with its answer for a retransmission.

use heapless::Vec;
use protocol::{
    frame::{Frame, write_reply},
    message::{NO_NUMBER, Reply},
};

/// Maximum length of an answer stored for a retransmission, bytes: a frame of a `Profile` with every varint at its maximum length. That of a
/// `Status` is shorter.
const ANSWER_MAX: usize = 201;

/// The last answered request, with its answer for a retransmission.
#[derive(Debug)]
pub(super) struct Last {
    /// Number of the request.
    pub(super) number: u16,
    /// Bytes of its payload.
    pub(super) length: usize,
    /// CRC of its frame.
    pub(super) crc: u32,
    /// The frame of its answer; empty before the first request.
    pub(super) answer: Vec<u8, ANSWER_MAX>,
}

impl Last {
    pub(super) const fn new() -> Self {
        Self {
            number: NO_NUMBER,
            length: 0,
            crc: 0,
            answer: Vec::new(),
        }
    }

    pub(super) fn is(&self, number: u16, frame: &Frame<'_>) -> bool {
        !self.answer.is_empty()
            && self.number == number
            && self.length == frame.payload.len()
            && self.crc == frame.crc
    }

    #[inline(never)]
    pub(super) fn set(&mut self, number: u16, frame: &Frame<'_>, answer: &Reply) {
        self.number = number;
        self.length = frame.payload.len();
        self.crc = frame.crc;
        let capacity = self.answer.capacity();
        self.answer.resize_default(capacity).ok();
        let length = write_reply(answer, &mut self.answer).map_or(0, <[u8]>::len);
        self.answer.truncate(length);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use interp_core::{
        sample::{SpanParameter, State},
        steps::StepConfig,
    };
    use protocol::message::{
        Clock, Configuration, FaultReport, InputLines, Profile, Report, SafetyStatus, Status, StreamStatus,
    };

    #[test]
    fn the_longest_answers_are_kept() {
        let place = SpanParameter {
            span: u16::MAX,
            fraction: u64::MAX,
        };
        let status = Status {
            state: State::Faulted,
            fault: Some(FaultReport {
                code: u8::MAX,
                value: f32::MAX,
            }),
            clock: Clock::Lockstep,
            credit: u32::MAX,
            report: Report::Samples,
            tick: u32::MAX,
            pass: u32::MAX,
            path: place,
            side: place,
            samples: u32::MAX,
            digest: u64::MAX,
            interval: f32::MAX,
            deadline_misses: u32::MAX,
            tick_cycles_max: u32::MAX,
            samples_lost: u32::MAX,
            frames_bad: u32::MAX,
            halts: u32::MAX,
            events: u32::MAX,
            steps: u32::MAX,
            profile: u32::MAX,
            stream: StreamStatus {
                received: u32::MAX,
                room: u32::MAX,
                starved: u32::MAX,
            },
            safety: SafetyStatus {
                lines: InputLines(u16::MAX),
                latched: InputLines(u16::MAX),
                configuration: Configuration {
                    link_timeout_ticks: u32::MAX,
                    ..Configuration::DEFAULT
                },
                spindle: protocol::message::SpindleOrder {
                    rpm: u32::MAX,
                    ..protocol::message::SpindleOrder::OFF
                },
                ..SafetyStatus::DEFAULT
            },
        };
        let mut last = Last::new();
        last.set(
            u16::MAX,
            &Frame { payload: &[], crc: 0 },
            &Reply::Status {
                number: u16::MAX,
                status,
            },
        );
        assert!(!last.answer.is_empty() && last.answer.len() < ANSWER_MAX);
        let axis = interp_core::steps::AxisSteps {
            steps: u32::MAX,
            mm: u32::MAX,
            inverted: true,
        };
        let steps = StepConfig {
            axes: [axis; 3],
            pulse_slots: u8::MAX,
            setup_slots: u16::MAX,
        };
        let profile = Profile {
            steps: steps.into(),
            velocity_mm_s: [1.0; 3],
            acceleration_mm_s2: [1.0; 3],
            jerk_mm_s3: [1.0; 3],
            travel_nm: Some([[i32::MIN, i32::MAX]; 3]),
            configuration: status.safety.configuration,
            homing: Some(protocol::message::Homing {
                order: [2, 1, 0],
                at_upper_end: [true; 3],
                position_nm: [i32::MIN; 3],
                seek_mm_s: [1.0; 3],
                approach_mm_s: [1.0; 3],
                back_off_nm: [i32::MAX; 3],
                survives_off: true,
            }),
            probe_inverted: true,
            step_inverted: 0b111,
            enable_inverted: 0b111,
            spindle: Some(protocol::message::SpindleSettings {
                max_rpm: u32::MAX,
                at_speed_ticks: u32::MAX,
                stops_at_pause: true,
                at_speed: protocol::message::AtSpeed::Opens,
            }),
            door: protocol::message::DoorContact::NormallyOpen,
        };
        let longest = Reply::Profile {
            number: u16::MAX,
            profile: Some(profile),
        };
        last.set(u16::MAX, &Frame { payload: &[], crc: 0 }, &longest);
        assert_eq!(last.answer.len(), ANSWER_MAX);
    }
}
