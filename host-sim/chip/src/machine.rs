//! A machine around the board: carriages that follow the pulses, limit switches and a probe plate, with their possible defects.

use boards::{Axis, Board, Level, Line, Role};

use crate::{
    part::gpio::{Change, Port},
    script::input_of,
};

/// Time between two bounces of a contact, periods.
const BOUNCE_EVERY: u64 = 3;

/// The machine, from its description on the command line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Machine {
    steps_per_mm: [f64; 3],
    /// Where the carriages are, in steps from the machine's zero.
    steps: [i64; 3],
    /// Where the switches trip, mm.
    switches_mm: [[f64; 2]; 3],
    /// Height of the probe plate, mm.
    plate_mm: f64,
    /// The axes turn the other way.
    reversed: [bool; 3],
    /// Inputs that are always open, and always closed.
    stuck: Option<Role>,
    never: Option<Role>,
    /// Plugs that are exchanged.
    swapped: Option<[Role; 2]>,
    /// Periods for which a contact bounces.
    bounce: u64,
    /// Periods that the spindle takes to its speed, since when it is on, and whether something holds it below.
    spin_up: Option<u64>,
    turns_since: Option<u64>,
    stalls: bool,
    /// Switches that a hand presses.
    held: Vec<Role>,
    /// The switches that the carriages press, and since when, in periods.
    pressed: [Option<u64>; 7],
    periods: u64,
    pulses: u64,
}

/// The switches that carriages press, in the order of [`Machine::pressed`].
const SWITCHES: [Role; 7] = [
    Role::LimitMin(Axis::X),
    Role::LimitMax(Axis::X),
    Role::LimitMin(Axis::Y),
    Role::LimitMax(Axis::Y),
    Role::LimitMin(Axis::Z),
    Role::LimitMax(Axis::Z),
    Role::Probe,
];

fn three(text: &str) -> Result<[f64; 3], String> {
    let values: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    values
        .ok()
        .and_then(|values| values.try_into().ok())
        .ok_or_else(|| format!("{text}: three numbers are expected, such as 1,2,3"))
}

fn role(name: &str) -> Result<Role, String> {
    SWITCHES
        .into_iter()
        .find(|role| input_of(*role) == Some(name))
        .ok_or_else(|| format!("{name}: not a switch of a carriage, nor the probe"))
}

impl Machine {
    /// `key=value;..`: start, lower, upper (mm, three numbers each), steps (per mm), plate (mm); stuck, never (an input), swap (two inputs), bounce (periods),
    /// reverse (axes, such as `xz`), spindle (ms to its speed).
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let mut machine = Self {
            steps_per_mm: [400.0; 3],
            steps: [0; 3],
            switches_mm: [[-1.0, 101.0]; 3],
            plate_mm: f64::NEG_INFINITY,
            reversed: [false; 3],
            stuck: None,
            never: None,
            swapped: None,
            bounce: 0,
            spin_up: None,
            turns_since: None,
            stalls: false,
            held: Vec::new(),
            pressed: [None; 7],
            periods: 0,
            pulses: 0,
        };
        let mut start = [0.0; 3];
        for entry in text.split(';').filter(|entry| !entry.is_empty()) {
            let (key, value) = entry
                .split_once('=')
                .ok_or_else(|| format!("{entry}: key=value is expected"))?;
            match key {
                "start" => start = three(value)?,
                "steps" => machine.steps_per_mm = three(value)?,
                "lower" | "upper" => {
                    for (ends, mm) in machine.switches_mm.iter_mut().zip(three(value)?) {
                        ends[usize::from(key == "upper")] = mm;
                    }
                }
                "plate" => machine.plate_mm = value.parse().map_err(|_| format!("{value}: not a height"))?,
                "bounce" => machine.bounce = value.parse().map_err(|_| format!("{value}: not a number"))?,
                "spindle" => {
                    machine.spin_up = Some(value.parse().map_err(|_| format!("{value}: not a number"))?);
                }
                "stuck" => machine.stuck = Some(role(value)?),
                "never" => machine.never = Some(role(value)?),
                "swap" => {
                    let (one, other) = value
                        .split_once(',')
                        .ok_or_else(|| format!("{value}: two inputs are expected"))?;
                    machine.swapped = Some([role(one)?, role(other)?]);
                }
                "reverse" => machine.reversed = ["x", "y", "z"].map(|axis| value.contains(axis)),
                _ => return Err(format!("{key}: unknown")),
            }
        }
        for ((steps, start), scale) in machine.steps.iter_mut().zip(start).zip(machine.steps_per_mm) {
            *steps = (start * scale).round() as i64;
        }
        Ok(machine)
    }

    /// Step pulses that have moved a carriage.
    pub(crate) const fn pulses(&self) -> u64 {
        self.pulses
    }

    /// Where the carriages are, steps.
    pub(crate) fn at_steps(&self) -> [i32; 3] {
        self.steps.map(|steps| i32::try_from(steps).unwrap_or(i32::MAX))
    }

    /// Where the carriages are, mm.
    pub(crate) fn at_mm(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.steps[axis] as f64 / self.steps_per_mm[axis])
    }

    /// A change of a port's levels: a rising step pin moves its carriage if its drive is enabled.
    pub(crate) fn follow(&mut self, board: &Board, change: &Change, before: u32, ports: &[Port; 9]) {
        if usize::from(change.port) != board.step_port().index() {
            return;
        }
        let risen = u32::from(change.levels) & !before;
        for (index, axis) in Axis::ALL.into_iter().enumerate() {
            let lines = board.axis(axis);
            let is = |line: Line| line.is_active(ports[line.pin.port.index()].odr);
            if risen & lines.step.pin.bit() != 0 && is(lines.enable) {
                self.pulses += 1;
                self.steps[index] += if is(lines.direction) != self.reversed[index] {
                    1
                } else {
                    -1
                };
            }
        }
    }

    /// Whether an input is one that carriages press.
    pub(crate) fn presses(role: Role) -> bool {
        SWITCHES.contains(&role)
    }

    /// A hand presses a switch, or lets it go.
    pub(crate) fn hold(&mut self, role: Role, is_pressed: bool) {
        self.held.retain(|held| *held != role);
        if is_pressed {
            self.held.push(role);
        }
    }

    /// Something holds the spindle below its speed, or lets it go.
    pub(crate) fn stall(&mut self, is_stalled: bool) {
        self.stalls = is_stalled;
    }

    /// The contact of the spindle's drive closes when it is at speed.
    fn spin(&mut self, board: &Board, ports: &mut [Port; 9]) {
        let Some(spin_up) = self.spin_up else { return };
        let enable = board.line(Role::SpindleEnable);
        let is_on = enable.is_active(ports[enable.pin.port.index()].odr);
        self.turns_since = is_on.then(|| self.turns_since.unwrap_or(self.periods));
        let is_at_speed = self
            .turns_since
            .is_some_and(|since| self.periods - since >= spin_up);
        set(&board.line(Role::AtSpeed), is_at_speed && !self.stalls, ports);
    }

    /// Sets the levels of the inputs, once a period.
    pub(crate) fn press(&mut self, board: &Board, ports: &mut [Port; 9]) {
        self.periods += 1;
        self.spin(board, ports);
        let at = self.at_mm();
        for (index, role) in SWITCHES.into_iter().enumerate() {
            let axis = (index / 2).min(2);
            let [lower, upper] = self.switches_mm[axis];
            let is_pressed = match role {
                Role::LimitMin(_) => at[axis] <= lower,
                Role::LimitMax(_) => at[axis] >= upper,
                _ => at[2] <= self.plate_mm,
            };
            let since = &mut self.pressed[index];
            *since = is_pressed.then(|| since.unwrap_or(self.periods));
        }
        for (index, role) in SWITCHES.into_iter().enumerate() {
            let wired = match self.swapped {
                Some([one, other]) if role == one => other,
                Some([one, other]) if role == other => one,
                _ => role,
            };
            let is_open = match self.pressed[index] {
                _ if self.stuck == Some(role) || self.held.contains(&role) => true,
                _ if self.never == Some(role) => false,
                None => false,
                Some(since) => {
                    let age = self.periods - since;
                    age >= self.bounce || age % BOUNCE_EVERY != 1
                }
            };
            set(&board.line(wired), is_open, ports);
        }
    }
}

/// Makes an input active or inactive.
pub(crate) fn set(line: &Line, is_active: bool, ports: &mut [Port; 9]) {
    let port = &mut ports[line.pin.port.index()];
    let bit = line.pin.bit();
    let is_high = is_active == (line.active == Level::High);
    port.outside = port.outside & !bit | if is_high { bit } else { 0 };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_is_read() {
        let machine = Machine::parse("start=1,2,-3;steps=400,80,400;lower=-1,-1,-40;upper=60,50,1;plate=-20;swap=x-min,x-max;reverse=z").unwrap();
        assert_eq!(machine.at_mm(), [1.0, 2.0, -3.0]);
        assert_eq!(machine.switches_mm[2], [-40.0, 1.0]);
        assert_eq!(machine.reversed, [false, false, true]);
        for wrong in ["start=1,2", "stuck=emergency-stop", "plate=x", "what=1", "start"] {
            assert!(Machine::parse(wrong).is_err(), "{wrong}");
        }
    }
}
