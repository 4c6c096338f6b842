//! Step output and supervision of a board, from the job's machine.

use interp_core::StepConfig;
use interp_core::steps::{AxisSteps, PULSE_SLOTS_MAX, SETUP_SLOTS_MAX, SLOTS};
use job::{HeartbeatAction, MachineSpec};
use protocol::message::{Configuration, LinkTimeoutAction};

/// Tolerance in slots for the rounding of the period.
const ROUNDING: f64 = 1e-9;

/// A time in slots of the period, rounded up.
fn slots(time_us: f64, period_us: f64, most: u16) -> u16 {
    let slots = (time_us * f64::from(SLOTS) / period_us - ROUNDING).ceil();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the range"
    )]
    let slots = slots.clamp(0.0, f64::from(most)) as u16;
    slots
}

/// The core's step configuration; `None` where the job keeps the board's own.
#[must_use]
pub fn config(machine: &MachineSpec) -> Option<StepConfig> {
    let output = machine.step_output?;
    let pulse_slots = slots(output.pulse_us, machine.period_us, PULSE_SLOTS_MAX.into()).max(1);
    Some(StepConfig {
        axes: std::array::from_fn(|axis| AxisSteps {
            steps: output.steps_per_mm[axis].numerator,
            mm: output.steps_per_mm[axis].denominator,
            inverted: output.direction_inverted[axis],
        }),
        pulse_slots: u8::try_from(pulse_slots).unwrap_or(PULSE_SLOTS_MAX),
        setup_slots: slots(output.direction_setup_us, machine.period_us, SETUP_SLOTS_MAX),
    })
}

/// Homing requirement and heartbeat supervision of a board.
#[must_use]
pub fn configuration(machine: &MachineSpec) -> Configuration {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "1 to 6e6 by the ranges of both"
    )]
    let link_timeout_ticks = (machine.heartbeat_timeout_ms * 1e3 / machine.period_us).ceil() as u32;
    Configuration {
        homing_required: machine.homing_required,
        on_link_timeout: match machine.heartbeat_action {
            HeartbeatAction::Finish => LinkTimeoutAction::Finish,
            HeartbeatAction::Hold => LinkTimeoutAction::Hold,
        },
        link_timeout_ticks,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_heartbeat_timeout_is_whole_periods_and_never_shorter() {
        let machine = MachineSpec {
            period_us: 400.0,
            homing_required: false,
            heartbeat_action: HeartbeatAction::Hold,
            heartbeat_timeout_ms: 500.1,
            ..MachineSpec::default()
        };
        let reported = configuration(&machine);
        assert_eq!(
            (reported.homing_required, reported.on_link_timeout),
            (false, LinkTimeoutAction::Hold)
        );
        assert_eq!(reported.link_timeout_ticks, 1251);
        assert_eq!(configuration(&MachineSpec::default()).link_timeout_ticks, 1000);
    }

    /// The job file limits times by the same shares of a period as the core.
    #[test]
    fn times_are_slots_and_never_shorter() {
        for period_us in [10.0, 500.0, 1000.0, 100_000.0] {
            let [pulse_us, setup_us] = job_file::slots_max_us(period_us);
            assert_eq!(slots(pulse_us, period_us, u16::MAX), u16::from(PULSE_SLOTS_MAX));
            assert_eq!(slots(setup_us, period_us, u16::MAX), SETUP_SLOTS_MAX);
        }
        assert_eq!(slots(2.5, 1000.0, 24), 3);
        assert_eq!(slots(2.5, 500.0, 24), 5);
        assert_eq!(slots(0.0, 500.0, 24), 0);
    }
}
