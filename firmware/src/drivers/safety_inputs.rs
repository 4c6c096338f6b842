//! The inputs: emergency stop, limit switches, drive fault, probe, safety door, the spindle's speed, by the board's table.
//!
//! A tick reads the input register of each port with a safety input, and compares; the inputs are decoded only
//! when a pin has changed. No interrupt is used, because inputs are evaluated only in ticks.

use boards::{Axis, Level, Line, Port, Role};
use protocol::message::InputLines;

/// Maximum number of ports with safety inputs.
const PORTS_MAX: usize = 4;

/// The input registers of the chip's ports.
pub(crate) trait ReadPorts {
    /// `IDR` of this port.
    fn input(&self, port: Port) -> u32;
}

/// The monitored pins of one port.
#[derive(Clone, Copy)]
struct Watched {
    port: Port,
    mask: u32,
    /// Last levels of these pins.
    seen: u32,
}

impl Watched {
    /// Present levels of these pins.
    #[inline(always)]
    fn pins(&self, ports: &impl ReadPorts) -> u32 {
        ports.input(self.port) & self.mask
    }
}

/// The board's safety inputs.
pub(crate) struct SafetyInputs<P> {
    ports: P,
    board: &'static [Line],
    watched: [Watched; PORTS_MAX],
    lines: InputLines,
}

/// The safety input of a line of the board.
const fn input_of(role: Role) -> InputLines {
    let number = match role {
        Role::EmergencyStop => 0,
        Role::LimitMin(axis) => 1 + 2 * axis as u8,
        Role::LimitMax(axis) => 2 + 2 * axis as u8,
        Role::DriveFault => 10,
        Role::Probe => 11,
        Role::Door => 12,
        Role::AtSpeed => 13,
        Role::Start => 14,
        _ => return InputLines::NONE,
    };
    InputLines(1 << number)
}

const _: () = assert!(
    input_of(Role::LimitMax(Axis::Z)).0 == 1 << 6
        && input_of(Role::Start).0 == InputLines::START.0
        && InputLines::ALL.0 == u16::MAX,
    "the inputs' bits are those of the protocol"
);

impl<P: ReadPorts> SafetyInputs<P> {
    /// The safety inputs among these lines, whose pins have been set up.
    ///
    /// # Panics
    /// The inputs are on more ports than the maximum. For use in constants and at start-up.
    pub(crate) const fn new(ports: P, board: &'static [Line]) -> Self {
        let nothing = Watched {
            port: Port::A,
            mask: 0,
            // No port has these levels, so the first tick decodes the pins.
            seen: u32::MAX,
        };
        let mut watched = [nothing; PORTS_MAX];
        let mut index = 0;
        while index < board.len() {
            let line = &board[index];
            if !input_of(line.role).is_none() {
                let place = place_of(&watched, line.pin.port);
                watched[place].port = line.pin.port;
                watched[place].mask |= line.pin.bit();
            }
            index += 1;
        }
        Self {
            ports,
            board,
            watched,
            lines: InputLines::NONE,
        }
    }

    /// The inputs that are asserted now.
    #[inline]
    pub(crate) fn read(&mut self) -> InputLines {
        let [first, second, third, fourth] = &self.watched;
        // Unrolled by hand: this runs in every tick, and a crate compiled for size does not unroll loops.
        let ports = &self.ports;
        let (a, b) = (first.pins(ports), second.pins(ports));
        let (c, d) = (third.pins(ports), fourth.pins(ports));
        let changed = (a ^ first.seen) | (b ^ second.seen) | (c ^ third.seen) | (d ^ fourth.seen);
        if changed != 0 {
            self.gather([a, b, c, d]);
        }
        self.lines
    }

    /// Decodes the pins.
    #[cold]
    #[inline(never)]
    fn gather(&mut self, pins: [u32; PORTS_MAX]) {
        for (watched, pins) in self.watched.iter_mut().zip(pins) {
            watched.seen = pins;
        }
        let mut lines = InputLines::NONE;
        for line in self.board {
            let of_port = |watched: &&Watched| watched.port as u8 == line.pin.port as u8;
            if let Some(watched) = self.watched.iter().find(of_port)
                && line.is_active(watched.seen)
            {
                lines = lines.or(input_of(line.role));
            }
        }
        self.lines = lines;
    }
}

/// The pin levels of a port for these inputs, for a board without pins.
#[allow(dead_code, reason = "boards with pins need it not")]
pub(crate) fn pins_of(board: &[Line], port: Port, lines: InputLines) -> u32 {
    let own = board.iter().filter(|line| line.pin.port as u8 == port as u8);
    own.filter(|line| {
        let input = input_of(line.role);
        !input.is_none() && lines.has(input) == matches!(line.active, Level::High)
    })
    .fold(0, |pins, line| pins | line.pin.bit())
}

/// The index of a port among the monitored ones, or the first free index.
const fn place_of(watched: &[Watched; PORTS_MAX], port: Port) -> usize {
    let mut place = 0;
    while watched[place].mask != 0 && watched[place].port as u8 != port as u8 {
        place += 1;
    }
    place
}
