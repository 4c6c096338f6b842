//! Checks of every board table, and register values compared with the reference manual's fields, pin by pin.

extern crate std;

use std::collections::BTreeSet;
use std::vec::Vec;

use crate::setup::{PortSetup, ports, writes, writes_count};
use crate::{Axis, BOARDS, Board, Level, Line, Pin, Port, Role, SKR_PRO, STM32F405};

/// Reserved pins: SWD, the crystal, BOOT1, the RTC crystal's and PC13 (limited to 3 mA), USB.
const RESERVED: [Pin; 10] = [
    Pin::new(Port::A, 13),
    Pin::new(Port::A, 14),
    Pin::new(Port::H, 0),
    Pin::new(Port::H, 1),
    Pin::new(Port::B, 2),
    Pin::new(Port::C, 13),
    Pin::new(Port::C, 14),
    Pin::new(Port::C, 15),
    Pin::new(Port::A, 11),
    Pin::new(Port::A, 12),
];

fn roles() -> Vec<Role> {
    let of_axis = |axis| {
        [
            Role::Step(axis),
            Role::Direction(axis),
            Role::Enable(axis),
            Role::LimitMin(axis),
            Role::LimitMax(axis),
        ]
    };
    let mut roles: Vec<_> = Axis::ALL.into_iter().flat_map(of_axis).collect();
    roles.extend([
        Role::EmergencyStop,
        Role::DriveFault,
        Role::Probe,
        Role::Door,
        Role::AtSpeed,
        Role::Start,
        Role::SpindleEnable,
        Role::SpindleDirection,
        Role::SpindleSpeed,
        Role::Coolant,
        Role::StatusLed,
        Role::SerialTx,
        Role::SerialRx,
    ]);
    roles
}

fn inputs(board: &Board) -> impl Iterator<Item = &'static Line> {
    board
        .lines
        .iter()
        .filter(|line| line.role.is_input() && line.role != Role::SerialRx)
}

/// Each role occurs once, no pin twice, and each pin is on the package and not reserved.
#[test]
fn tables_are_whole_and_pins_are_free() {
    for board in BOARDS {
        for role in roles() {
            let lines = board.lines.iter().filter(|line| line.role == role).count();
            assert_eq!(lines, 1, "{}: {role}", board.id);
            assert_eq!(board.line(role).role, role);
        }
        let named = roles().len()
            + board
                .lines
                .iter()
                .filter(|line| line.role == Role::Parked)
                .count();
        assert_eq!(board.lines.len(), named, "{}", board.id);
        let pins: BTreeSet<_> = board.lines.iter().map(|line| line.pin).collect();
        assert_eq!(pins.len(), board.lines.len(), "{}: a pin is used twice", board.id);
        for line in board.lines {
            let (pin, id) = (line.pin, board.id);
            assert!(board.chip.package.has(pin), "{id}: {pin} is not on the package");
            assert!(!RESERVED.contains(&pin), "{id}: {pin} is not free");
            assert!(!line.place.is_empty());
        }
    }
}

/// One transfer steps all axes, each by a separate bit.
#[test]
fn steps_are_on_one_port() {
    for board in BOARDS {
        let bits = Axis::ALL.map(|axis| board.axis(axis).step.pin.bit());
        assert_eq!((bits[0] | bits[1] | bits[2]).count_ones(), 3, "{}", board.id);
        for axis in Axis::ALL {
            assert_eq!(board.axis(axis).step.pin.port, board.step_port());
        }
    }
    assert_eq!((SKR_PRO.step_port(), STM32F405.step_port()), (Port::E, Port::C));
}

/// A broken wire asserts the input; the emergency stop could have a separate interrupt (one EXTI line per pin number).
#[test]
fn inputs_fail_to_the_safe_side() {
    for board in BOARDS {
        assert_eq!(inputs(board).count(), 12);
        for line in inputs(board) {
            // An open circuit pulls the pin up: a stop, an open door, a touch, no speed, and no start.
            let is_safe = !matches!(line.role, Role::AtSpeed | Role::Start);
            assert_eq!(line.active == Level::High, is_safe, "{}: {}", board.id, line.role);
            assert_eq!(line.is_active(line.pin.bit()), is_safe);
            assert_eq!(line.is_active(!line.pin.bit()), !is_safe);
        }
        let number = board.line(Role::EmergencyStop).pin.number;
        let sharing = inputs(board).filter(|line| line.pin.number == number).count();
        assert_eq!(sharing, 1, "{}", board.id);
    }
}

/// Packages, by the data sheet's pin counts: 51 and 114 pins for general use (DS8626, table 2).
#[test]
fn packages_have_as_many_pins_as_the_data_sheet_says() {
    for (board, count) in [(&STM32F405, 51), (&SKR_PRO, 114)] {
        let pins = Port::ALL
            .into_iter()
            .flat_map(|port| (0..16).map(move |number| Pin::new(port, number)));
        let there = pins.filter(|pin| board.chip.package.has(*pin)).count();
        assert_eq!(there, count, "{}", board.id);
    }
}

/// The registers from their reset values (RM0090, 8.4.1 to 8.4.4), set up, and read back pin by pin.
#[test]
fn registers_say_what_the_table_says() {
    for board in BOARDS {
        let setups = ports(board.lines);
        for port in Port::ALL {
            let setup = setups[port.index()];
            let (moder, speed, pull) = match port {
                Port::A => (0xA800_0000, 0x0C00_0000, 0x6400_0000),
                Port::B => (0x0000_0280, 0x0000_00C0, 0x0000_0100),
                _ => (0, 0, 0),
            };
            let mode = setup.mode.apply(moder);
            for number in 0..16 {
                let two = |register: u32| (register >> (2 * number)) & 0b11;
                let pin = Pin::new(port, number);
                let Some(line) = board.lines.iter().find(|line| line.pin == pin) else {
                    assert_eq!(two(mode), two(moder), "{pin} is not ours");
                    assert_eq!(two(setup.pull.apply(pull)), two(pull), "{pin} is not ours");
                    assert_eq!(setup.set_reset & (pin.bit() | pin.bit() << 16), 0);
                    continue;
                };
                let serial = matches!(line.role, Role::SerialTx | Role::SerialRx | Role::SpindleSpeed);
                let wanted = match line.role {
                    _ if serial => 0b10,
                    role if role.is_input() => 0b00,
                    _ => 0b01,
                };
                assert_eq!(two(mode), wanted, "{pin}: mode");
                let wanted = if line.role.is_input() { 0b01 } else { 0b00 };
                assert_eq!(two(setup.pull.apply(pull)), wanted, "{pin}: pull");
                let fast = matches!(line.role, Role::Step(_) | Role::Direction(_));
                let wanted = if fast { 0b01 } else { two(speed) };
                assert_eq!(two(setup.speed.apply(speed)), wanted, "{pin}: speed");
                let set = setup.set_reset & pin.bit() != 0;
                let reset = setup.set_reset & pin.bit() << 16 != 0;
                let output = !line.role.is_input() && !serial;
                let wanted = match line.active {
                    _ if !output => (false, false),
                    Level::High => (false, true),
                    Level::Low => (true, false),
                };
                assert_eq!((set, reset), wanted, "{pin}: level before it drives");
            }
        }
        let a = setups[Port::A.index()];
        // PA9 and PA10 are USART1's with alternate function 7: AFRH, fields 1 and 2.
        assert_eq!(
            (a.alternate[1].apply(0), a.alternate[0].apply(0)),
            (0x770, 0),
            "{}",
            board.id
        );
        assert!(!setups[Port::H.index()].is_used());
    }
}

/// Values of one port computed by hand from the manual's figures: PE9, PE11, PE13 step and PE8 direction, outputs of medium speed, low;
/// PE5, PE6 low; PE10, PE12, PE15 inputs with pull-ups.
#[test]
fn port_e_of_the_skr_pro_is_as_worked_out_by_hand() {
    let e = ports(SKR_PRO.lines)[Port::E.index()];
    let expected = PortSetup {
        set_reset: (1 << 5 | 1 << 6 | 1 << 8 | 1 << 9 | 1 << 11 | 1 << 13) << 16,
        ..e
    };
    assert_eq!(e, expected);
    // Two bits per pin, from 15 down:  15 14 13 12  11 10  9  8   7  6  5  4   3 2 1 0
    assert_eq!(e.mode.value, 0b00_00_01_00_01_00_01_01_00_01_01_00_00_00_00_00);
    assert_eq!(e.mode.mask, 0b11_00_11_11_11_11_11_11_00_11_11_00_00_00_00_00);
    assert_eq!(e.speed.value, 0b00_00_01_00_01_00_01_01_00_00_00_00_00_00_00_00);
    assert_eq!(e.pull.value, 0b01_00_00_01_00_01_00_00_00_00_00_00_00_00_00_00);
}

/// The writes, applied in order to the reset values, produce the required fields, and no pin becomes an output before its level is set.
#[test]
fn the_writes_of_a_reset_are_the_fields() {
    fn check<const N: usize>(board: &Board) {
        let mut registers =
            std::collections::BTreeMap::from([(0x4002_0000, 0xA800_0000_u32), (0x4002_0400, 0x280)]);
        let order: Vec<_> = writes::<N>(board.lines).into_iter().collect();
        for write in &order {
            let register = registers.entry(write.address).or_default();
            *register = *register & !write.clear | write.set;
        }
        assert_eq!(order[0], order[1], "read back");
        for (port, setup) in Port::ALL.into_iter().zip(ports(board.lines)) {
            let base = 0x4002_0000 + 0x400 * port as u32;
            let clock = registers[&0x4002_3830] >> port.index() & 1;
            assert_eq!(clock == 1, setup.is_used());
            if setup.is_used() {
                assert_eq!(registers[&(base + 0x18)], setup.set_reset);
                assert_eq!(registers[&(base + 0x08)], setup.speed.value);
                assert_eq!(registers[&(base + 0x0c)], setup.pull.value);
                assert_eq!(
                    [0x20, 0x24].map(|at| registers[&(base + at)]),
                    setup.alternate.map(|field| field.value)
                );
                let reset = [0xA800_0000, 0x280].get(port.index()).copied().unwrap_or(0);
                assert_eq!(registers[&base], setup.mode.apply(reset));
                let place = |address| order.iter().position(|write| write.address == address);
                assert!(place(base + 0x18) < place(base));
            }
        }
    }
    check::<{ writes_count(STM32F405.lines) }>(&STM32F405);
    check::<{ writes_count(SKR_PRO.lines) }>(&SKR_PRO);
}

/// The words that the drivers write for active and inactive, for both active levels.
#[test]
fn outputs_are_active_at_their_level() {
    let enable = SKR_PRO.axis(Axis::X).enable;
    assert_eq!(
        (enable.set_reset(true), enable.set_reset(false)),
        (1 << 18, 1 << 2)
    );
    let step = SKR_PRO.axis(Axis::X).step;
    assert_eq!((step.set_reset(true), step.set_reset(false)), (1 << 9, 1 << 25));
}
