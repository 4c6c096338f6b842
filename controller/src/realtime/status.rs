//! The state of the board that the link reports.

use interp_core::sample::Sample;
use protocol::message::{Activity, FaultReport, MotionStatus, SafetyStatus, Status, StreamStatus};

use super::RealTime;

impl<S: AsRef<[i32]> + AsMut<[i32]>> RealTime<S> {
    /// The status; the link fills in `frames_bad`, `events`, `steps` and `profile`.
    #[must_use]
    #[inline(never)]
    pub fn status(&self) -> Status {
        self.status_now()
    }

    /// The status, inlined into its callers.
    #[inline(always)]
    pub(super) fn status_now(&self) -> Status {
        let run = &self.control.run;
        let last = self.interpolator.last();
        let fault = self.interpolator.fault();
        let (pass, path, side) = if fault.is_some() {
            self.interpolator.surface_position()
        } else {
            (last.pass, last.path, last.side)
        };
        let [received, room] = self.interpolator.load_room();
        Status {
            state: self.interpolator.state(),
            fault: fault.map(FaultReport::from),
            clock: self.control.clock,
            credit: self.control.credit,
            report: self.control.report,
            tick: last.tick,
            pass,
            path,
            side,
            samples: run.samples,
            digest: run.digest.value(),
            interval: self.interpolator.last_interval(),
            deadline_misses: run.deadline_misses,
            tick_cycles_max: run.tick_cycles_max,
            samples_lost: run.events_lost,
            frames_bad: 0,
            halts: self.control.halts,
            events: 0,
            steps: 0,
            profile: 0,
            stream: StreamStatus {
                received,
                room,
                starved: run.starved,
            },
            safety: SafetyStatus {
                spindle: self.control.spindle.now(),
                ..self.control.safety.status()
            },
        }
    }

    /// The axes outside a job.
    #[must_use]
    pub fn motion(&self) -> MotionStatus {
        let motion = self.control.manual.status();
        let stands_nm = self.interpolator.stands_nm();
        MotionStatus {
            activity: if self.control.spindle.is_awaited() {
                Activity::SpinUp
            } else {
                motion.activity
            },
            // After a run, or a declaration, its position.
            at_nm: stands_nm
                .filter(|_| !self.control.manual.is_active())
                .unwrap_or(motion.at_nm),
            ..motion
        }
    }

    /// The position that the host declared as home, nm; none where the machine is not homed.
    #[must_use]
    pub const fn home_nm(&self) -> Option<[i32; 3]> {
        self.control.safety.home_nm()
    }

    /// The last sample.
    #[must_use]
    pub const fn last(&self) -> &Sample {
        self.interpolator.last()
    }
}
