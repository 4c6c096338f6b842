//! A machine's profile, between the desk's form, the board's and the text of its file.

use std::fmt::Write as _;

use interp_core::StepConfig;
use job::{
    AXES, AxisLimits, Contact, HeartbeatAction, MachineProfile, PERIOD_DEFAULT_US, Ratio, SpindleDrive,
    StepOutput, units,
};
use protocol::message::{
    AtSpeed, DoorContact, LinkTimeoutAction, Profile, SpindleOrder, SpindleSettings, Turning,
};

use crate::prepare;

const US_PER_MS: f64 = 1e3;

/// The profile in the board's form, by its period.
#[must_use]
pub fn for_board(profile: &MachineProfile) -> Profile {
    let spec = profile.spec();
    #[allow(clippy::cast_possible_truncation, reason = "the board's precision")]
    let [velocity_mm_s, acceleration_mm_s2, jerk_mm_s3] = profile
        .limits
        .by_order()
        .map(|limits| limits.map(|limit| limit as f32));
    Profile {
        steps: prepare::step_config(&spec).unwrap_or(StepConfig::DEFAULT).into(),
        velocity_mm_s,
        acceleration_mm_s2,
        jerk_mm_s3,
        travel_nm: profile.travel_mm.map(|travel| travel.map(|range| range.map(nm))),
        configuration: prepare::configuration(&spec),
        homing: profile.homing.map(|homing| homing_for_board(&homing)),
        probe_inverted: profile.probe_closes,
        spindle: profile.spindle.map(|spindle| SpindleSettings {
            max_rpm: spindle.max_rpm,
            at_speed_ticks: ticks(spindle.at_speed_ms),
            stops_at_pause: spindle.stops_at_pause,
            at_speed: match spindle.at_speed {
                None => AtSpeed::ByTime,
                Some(Contact::NormallyOpen) => AtSpeed::Closes,
                Some(Contact::NormallyClosed) => AtSpeed::Opens,
            },
        }),
        step_inverted: bits(profile.step_inverted),
        enable_inverted: bits(profile.enable_inverted),
        door: match profile.door {
            None => DoorContact::None,
            Some(Contact::NormallyClosed) => DoorContact::NormallyClosed,
            Some(Contact::NormallyOpen) => DoorContact::NormallyOpen,
        },
    }
}

/// One bit an axis.
fn bits([x, y, z]: [bool; 3]) -> u8 {
    u8::from(x) | u8::from(y) << 1 | u8::from(z) << 2
}

/// The profile of a board: limits as the shortest decimal numbers that the board's stand for.
#[must_use]
pub fn of_board(profile: &Profile) -> MachineProfile {
    let Profile {
        steps,
        velocity_mm_s,
        acceleration_mm_s2,
        jerk_mm_s3,
        travel_nm,
        configuration,
        homing,
        probe_inverted,
        spindle,
        step_inverted,
        enable_inverted,
        door,
    } = *profile;
    let axes = |bits: u8| [0, 1, 2].map(|axis| bits >> axis & 1 != 0);
    let slot_us = PERIOD_DEFAULT_US / f64::from(interp_core::steps::SLOTS);
    let config = StepConfig::from(steps);
    MachineProfile {
        limits: AxisLimits {
            velocity_mm_s: decimal(velocity_mm_s),
            acceleration_mm_s2: decimal(acceleration_mm_s2),
            jerk_mm_s3: decimal(jerk_mm_s3),
        },
        travel_mm: travel_nm.map(|travel| travel.map(|range| range.map(units::millimetres))),
        homing_required: configuration.homing_required,
        heartbeat_action: match configuration.on_link_timeout {
            LinkTimeoutAction::Finish => HeartbeatAction::Finish,
            LinkTimeoutAction::Hold => HeartbeatAction::Hold,
        },
        heartbeat_timeout_ms: f64::from(configuration.link_timeout_ticks) * PERIOD_DEFAULT_US / US_PER_MS,
        step_output: StepOutput {
            steps_per_mm: config.axes.map(|axis| Ratio {
                numerator: axis.steps,
                denominator: axis.mm,
            }),
            direction_inverted: config.axes.map(|axis| axis.inverted),
            pulse_us: f64::from(config.pulse_slots) * slot_us,
            direction_setup_us: f64::from(config.setup_slots) * slot_us,
        },
        step_inverted: axes(step_inverted),
        enable_inverted: axes(enable_inverted),
        homing: homing.map(|homing| homing_of_board(&homing)),
        probe_closes: probe_inverted,
        spindle: spindle.map(|spindle| SpindleDrive {
            max_rpm: spindle.max_rpm,
            at_speed_ms: f64::from(spindle.at_speed_ticks) * PERIOD_DEFAULT_US / US_PER_MS,
            stops_at_pause: spindle.stops_at_pause,
            at_speed: match spindle.at_speed {
                AtSpeed::ByTime => None,
                AtSpeed::Closes => Some(Contact::NormallyOpen),
                AtSpeed::Opens => Some(Contact::NormallyClosed),
            },
        }),
        door: match door {
            DoorContact::None => None,
            DoorContact::NormallyClosed => Some(Contact::NormallyClosed),
            DoorContact::NormallyOpen => Some(Contact::NormallyOpen),
        },
    }
}

/// The shortest decimal numbers that the board's stand for.
fn decimal(values: [f32; 3]) -> [f64; 3] {
    values.map(|value| value.to_string().parse().unwrap_or(f64::from(value)))
}

/// A time in the board's periods.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates"
)]
fn ticks(ms: f64) -> u32 {
    (ms * US_PER_MS / PERIOD_DEFAULT_US).round() as u32
}

/// The order for a board's spindle.
#[must_use]
pub fn spindle_order(spindle: Option<job::Spindle>) -> SpindleOrder {
    spindle.map_or(SpindleOrder::OFF, |spindle| SpindleOrder {
        turning: match spindle.counterclockwise {
            _ if spindle.rpm == 0 => Turning::Off,
            false => Turning::Clockwise,
            true => Turning::Counterclockwise,
        },
        rpm: spindle.rpm,
        coolant: spindle.coolant,
    })
}

/// A length in nm. The file's reader refuses lengths outside the machine's range, so the ends of the range stand for what no profile has.
fn nm(mm: f64) -> i32 {
    units::nanometres(mm).unwrap_or(if mm < 0.0 { i32::MIN } else { i32::MAX })
}

#[allow(clippy::cast_possible_truncation, reason = "the board's precision")]
fn homing_for_board(homing: &job::Homing) -> protocol::message::Homing {
    protocol::message::Homing {
        order: homing.order,
        at_upper_end: homing.at_upper_end,
        position_nm: homing.position_mm.map(nm),
        seek_mm_s: homing.seek_mm_s.map(|speed| speed as f32),
        approach_mm_s: homing.approach_mm_s.map(|speed| speed as f32),
        back_off_nm: homing.back_off_mm.map(nm),
        survives_off: homing.survives_off,
    }
}

fn homing_of_board(homing: &protocol::message::Homing) -> job::Homing {
    job::Homing {
        order: homing.order,
        at_upper_end: homing.at_upper_end,
        position_mm: homing.position_nm.map(units::millimetres),
        seek_mm_s: decimal(homing.seek_mm_s),
        approach_mm_s: decimal(homing.approach_mm_s),
        back_off_mm: homing.back_off_nm.map(units::millimetres),
        survives_off: homing.survives_off,
    }
}

/// A contact in a profile's file.
const fn name_of(contact: Contact) -> &'static str {
    match contact {
        Contact::NormallyClosed => "normally-closed",
        Contact::NormallyOpen => "normally-open",
    }
}

/// The text of the profile's file.
#[must_use]
pub fn text(profile: &MachineProfile) -> String {
    let MachineProfile {
        limits,
        travel_mm,
        homing_required,
        heartbeat_action,
        heartbeat_timeout_ms,
        step_output,
        step_inverted,
        enable_inverted,
        homing,
        probe_closes,
        spindle,
        door,
    } = profile;
    let ratio = |ratio: Ratio| match ratio.denominator {
        1 => ratio.numerator.to_string(),
        mm => format!("\"{}/{mm}\"", ratio.numerator),
    };
    let steps = step_output.steps_per_mm.map(ratio).join(", ");
    let mut text = String::from("[machine]\n");
    let mut line = |line: std::fmt::Arguments<'_>| {
        // A text takes every line.
        let _ = writeln!(text, "{line}");
    };
    line(format_args!("velocity_max_mm_s = {:?}", limits.velocity_mm_s));
    line(format_args!(
        "acceleration_max_mm_s2 = {:?}",
        limits.acceleration_mm_s2
    ));
    line(format_args!("jerk_max_mm_s3 = {:?}", limits.jerk_mm_s3));
    if let Some(travel) = travel_mm {
        line(format_args!("travel_mm = {travel:?}"));
    }
    line(format_args!("steps_per_mm = [{steps}]"));
    line(format_args!("pulse_us = {:?}", step_output.pulse_us));
    line(format_args!(
        "direction_setup_us = {:?}",
        step_output.direction_setup_us
    ));
    line(format_args!(
        "direction_inverted = {:?}",
        step_output.direction_inverted
    ));
    for (key, inverted) in [
        ("step_inverted", step_inverted),
        ("enable_inverted", enable_inverted),
    ] {
        if *inverted != [false; 3] {
            line(format_args!("{key} = {inverted:?}"));
        }
    }
    line(format_args!("homing_required = {homing_required}"));
    let action = match heartbeat_action {
        HeartbeatAction::Finish => "finish",
        HeartbeatAction::Hold => "hold",
    };
    line(format_args!("host_gone = \"{action}\""));
    line(format_args!("host_gone_ms = {heartbeat_timeout_ms:?}"));
    if let Some(homing) = homing {
        let order = homing
            .order
            .map(|axis| AXES.get(usize::from(axis)).copied().unwrap_or_default());
        line(format_args!("\n[home]"));
        line(format_args!("order = \"{}\"", order.concat()));
        line(format_args!("at_upper_end = {:?}", homing.at_upper_end));
        line(format_args!("position_mm = {:?}", homing.position_mm));
        line(format_args!("seek_mm_s = {:?}", homing.seek_mm_s));
        line(format_args!("approach_mm_s = {:?}", homing.approach_mm_s));
        line(format_args!("back_off_mm = {:?}", homing.back_off_mm));
        line(format_args!("survives_off = {}", homing.survives_off));
    }
    if *probe_closes {
        line(format_args!("\n[probe]\ncontact = \"normally-open\""));
    }
    if let Some(contact) = door {
        line(format_args!("\n[door]\ncontact = \"{}\"", name_of(*contact)));
    }
    if let Some(spindle) = spindle {
        line(format_args!("\n[spindle]\nmax_rpm = {}", spindle.max_rpm));
        line(format_args!("at_speed_ms = {:?}", spindle.at_speed_ms));
        line(format_args!("stops_at_pause = {}", spindle.stops_at_pause));
        if let Some(contact) = spindle.at_speed {
            line(format_args!("at_speed_contact = \"{}\"", name_of(contact)));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r#"
[machine]
velocity_max_mm_s = [120, 80.7, 33.3]
acceleration_max_mm_s2 = [1000, 0.7, 500]
jerk_max_mm_s3 = [20000, 19999.9, 1e6]
travel_mm = [[-0.5, 300], [0, 200.000001], [-80, 0]]
steps_per_mm = [400, 78.74, "3200/7"]
pulse_us = 2.5
direction_setup_us = 20
direction_inverted = [true, false, true]
step_inverted = [false, true, false]
enable_inverted = [true, true, false]
host_gone = "hold"
host_gone_ms = 750

[home]
order = "yx"
at_upper_end = [false, false, true]
position_mm = [-2, -2.5, 1.000001]
seek_mm_s = [40, 40.7, 20]
back_off_mm = [3, 3, 3]

[probe]
contact = "normally-open"

[door]
contact = "normally-closed"

[spindle]
max_rpm = 24000
at_speed_ms = 2500
stops_at_pause = false
at_speed_contact = "normally-open"
"#;

    /// What is kept by a board is what its text says, and the text again.
    #[test]
    fn a_profile_survives_board_and_text() {
        let given = job_file::parse_profile("machine.toml", FILE).unwrap();
        let on_board = for_board(&given);
        assert!(on_board.is_valid());
        let back = of_board(&on_board);
        // A pulse takes whole slots of a microsecond, and is never shorter.
        let mut kept = given;
        kept.step_output.pulse_us = 3.0;
        assert_eq!(back, kept);
        let read = job_file::parse_profile("again", &text(&back)).unwrap();
        assert_eq!(read, back);
        assert_eq!(for_board(&read).digest(), on_board.digest());
    }
}
