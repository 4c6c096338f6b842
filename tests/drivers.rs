//! Drivers of the firmware, from the same source files, against simulated registers.

#[path = "../firmware/src/drivers/drive_enable.rs"]
mod drive_enable;
#[path = "../firmware/src/drivers/reset_cause.rs"]
mod reset_cause;
#[path = "../firmware/src/drivers/safety_inputs.rs"]
mod safety_inputs;
#[allow(unreachable_pub, reason = "in the firmware it is a resource that tasks share")]
#[path = "../firmware/src/drivers/supply.rs"]
mod supply;
#[path = "../firmware/src/drivers/watchdog.rs"]
mod watchdog;

use std::{
    cell::{Cell, RefCell},
    rc::Rc,
};

use boards::{Axis, BOARDS, Level, Pin, Port, Role};
use controller::{
    ram_flash::{OutOfBounds, RamFlash},
    settings::Settings,
    spindle::output,
};
use drive_enable::{DriveEnable, WritePorts};
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use interp_core::SpanParameter;
use protocol::message::{InputLines, Journal, ResetCause};
use safety_inputs::{ReadPorts, SafetyInputs, pins_of};
use supply::FallingRecord;
use watchdog::{Register, Registers, Watchdog, reload};

/// The independent watchdog as RM0090 describes it: keys, write protection, transfer of values to the LSI domain.
#[derive(Default)]
struct Iwdg {
    written: Vec<(Register, u16)>,
    unlocked: bool,
    lsi_on: bool,
    prescaler: u16,
    reload: u16,
    /// Number of status reads until the values have been transferred.
    updating: Cell<u32>,
}

impl Registers for &mut Iwdg {
    fn write(&mut self, register: Register, value: u16) {
        self.written.push((register, value));
        match (register, value) {
            (Register::Key, key) => {
                self.unlocked = key == 0x5555;
                self.lsi_on |= key == 0xcccc;
            }
            (Register::Prescaler, value) if self.unlocked => self.prescaler = value & 7,
            (Register::Reload, value) if self.unlocked => self.reload = value & 0xfff,
            _ => panic!("{register:?} is locked or cannot be written"),
        }
    }

    fn read(&mut self, register: Register) -> u16 {
        assert_eq!(register, Register::Status);
        if !self.lsi_on || self.updating.get() == 0 {
            return if self.lsi_on { 0 } else { 3 };
        }
        self.updating.set(self.updating.get() - 1);
        3
    }
}

#[test]
fn the_watchdog_is_started_set_and_fed_in_the_order_of_the_manual() {
    let mut iwdg = Iwdg {
        updating: Cell::new(20),
        ..Iwdg::default()
    };
    let mut watchdog = Watchdog::start(&mut iwdg, 93);
    assert!(watchdog.is_settled());
    watchdog.feed();
    watchdog.feed();
    let key = |value| (Register::Key, value);
    let expected = [
        key(0xcccc),
        key(0x5555),
        (Register::Prescaler, 0),
        (Register::Reload, 93),
        key(0xaaaa),
        key(0xaaaa),
        key(0xaaaa),
    ];
    assert_eq!(iwdg.written, expected);
    assert_eq!((iwdg.prescaler, iwdg.reload, iwdg.unlocked), (0, 93, false));
}

#[test]
fn a_watchdog_that_takes_nothing_over_hangs_nobody() {
    let mut iwdg = Iwdg {
        updating: Cell::new(u32::MAX),
        ..Iwdg::default()
    };
    assert!(!Watchdog::start(&mut iwdg, 93).is_settled());
}

/// The timeout is a whole number of counts of the LSI divided by 4: at 47 kHz never shorter than requested, and at most one count longer.
#[test]
fn the_watchdogs_time_holds_for_the_fastest_clock() {
    for least_us in [1, 86, 1000, 8000, 300_000] {
        let counts = u64::from(reload(least_us)) + 1;
        let at_47_khz = |counts: u64| counts * 4 * 1000;
        assert!(at_47_khz(counts) >= 47 * u64::from(least_us), "{least_us} us");
        assert!(at_47_khz(counts - 1) < 47 * u64::from(least_us), "{least_us} us");
    }
}

/// Input and output registers of all ports.
#[derive(Clone, Default)]
struct Chip {
    inputs: Rc<RefCell<[u32; 8]>>,
    outputs: Rc<RefCell<[u32; 8]>>,
    writes: Rc<Cell<u32>>,
    duty: Rc<Cell<u32>>,
}

impl ReadPorts for Chip {
    fn input(&self, port: Port) -> u32 {
        self.inputs.borrow()[port.index()]
    }
}

impl WritePorts for Chip {
    fn invert(&mut self, _: Pin, _: bool) {}

    fn set_reset(&mut self, port: Port, bits: u32) {
        self.writes.set(self.writes.get() + 1);
        let output = &mut self.outputs.borrow_mut()[port.index()];
        *output = *output & !(bits >> 16) | bits & 0xffff;
    }

    fn duty(&mut self, steps: u32) {
        self.duty.set(steps);
    }
}

/// Each input is detected by its pin's level, on every board, whatever the other pins of its ports are.
#[test]
fn every_input_is_found_on_its_pin() {
    for board in BOARDS {
        let chip = Chip::default();
        let mut inputs = SafetyInputs::new(chip.clone(), board.lines);
        let expected = |role| match role {
            Role::EmergencyStop => Some("emergency stop"),
            Role::LimitMin(Axis::X) => Some("limit switch x-"),
            Role::LimitMax(Axis::X) => Some("limit switch x+"),
            Role::LimitMin(Axis::Y) => Some("limit switch y-"),
            Role::LimitMax(Axis::Y) => Some("limit switch y+"),
            Role::LimitMin(Axis::Z) => Some("limit switch z-"),
            Role::LimitMax(Axis::Z) => Some("limit switch z+"),
            Role::DriveFault => Some("drive fault"),
            Role::Probe => Some("probe"),
            Role::Door => Some("safety door"),
            Role::AtSpeed => Some("spindle at speed"),
            Role::Start => Some("start button"),
            _ => None,
        };
        let quiet = |port: Port| {
            let low = |line: &&boards::Line| line.pin.port == port && line.active == Level::Low;
            let pins = board.lines.iter().filter(low);
            pins.fold(0, |pins, line| pins | line.pin.bit())
        };
        let mut found = 0;
        for line in board.lines {
            for other_pins in [0, 0xffff] {
                let safety = |port: Port| {
                    let own = |line: &&boards::Line| line.pin.port == port && expected(line.role).is_some();
                    let pins = board.lines.iter().filter(own);
                    pins.fold(0, |pins, line| pins | line.pin.bit())
                };
                for port in Port::ALL {
                    chip.inputs.borrow_mut()[port.index()] =
                        quiet(port) & safety(port) | other_pins & !safety(port);
                }
                assert!(inputs.read().is_none(), "{} {:?}", board.id, line.role);
                chip.inputs.borrow_mut()[line.pin.port.index()] ^= line.pin.bit();
                let names: Vec<_> = inputs.read().names().collect();
                let expected: Vec<_> = expected(line.role).into_iter().collect();
                assert_eq!(names, expected, "{}", board.id);
                found += names.len();
            }
        }
        assert_eq!(found, 2 * 12, "{}", board.id);
    }
}

/// Simulated pin levels are decoded as the inputs that they simulate.
#[test]
fn simulated_pins_are_read_as_the_inputs_they_stand_for() {
    for board in BOARDS {
        let chip = Chip::default();
        let mut inputs = SafetyInputs::new(chip.clone(), board.lines);
        // Both boards have one drive fault input for all axes.
        for bits in (0..0x80).chain(0x400..0x480) {
            let lines = InputLines(bits);
            for port in Port::ALL {
                chip.inputs.borrow_mut()[port.index()] = pins_of(board.lines, port, lines);
            }
            assert_eq!(inputs.read(), lines, "{}", board.id);
            assert_eq!(inputs.read(), lines, "{}", board.id);
        }
    }
}

#[test]
fn drives_are_switched_once_and_touch_no_other_pin() {
    for board in BOARDS {
        let chip = Chip::default();
        *chip.outputs.borrow_mut() = [0x5a5a; 8];
        let mut drives = DriveEnable::new(chip.clone(), board, true);
        drives.set(0);
        assert_eq!(chip.writes.get(), 0);
        for on in [true, false, true] {
            let before = (*chip.outputs.borrow(), chip.writes.get());
            drives.set(on.into());
            drives.set(on.into());
            assert_eq!(chip.writes.get(), before.1 + 3);
            let mut own = [0; 8];
            for axis in Axis::ALL {
                let enable = board.axis(axis).enable;
                own[enable.pin.port.index()] |= enable.pin.bit();
                let pins = chip.outputs.borrow()[enable.pin.port.index()];
                assert_eq!(enable.is_active(pins), on, "{} {axis:?}", board.id);
            }
            for (port, own) in own.into_iter().enumerate() {
                let changed = chip.outputs.borrow()[port] ^ before.0[port];
                assert_eq!(changed & !own, 0);
            }
        }
        // Spindle and coolant have lines of their own; with the drives everything goes off.
        let spindle = output::DRIVES | output::SPINDLE | output::COUNTERCLOCKWISE | output::COOLANT;
        let roles = [Role::SpindleEnable, Role::SpindleDirection, Role::Coolant];
        for (word, duty) in [(spindle | 1234 << output::DUTY_SHIFT, 1234), (0, 0)] {
            drives.set(word);
            assert_eq!(chip.duty.get(), duty);
            for line in roles.map(|role| board.line(role)) {
                let pins = chip.outputs.borrow()[line.pin.port.index()];
                assert_eq!(line.is_active(pins), word != 0, "{} {}", board.id, line.role);
            }
        }
    }
}

/// The flags as RM0090 defines them: an internal reset also pulls the reset pin, and a power-on reset sets three flags.
#[test]
fn the_most_particular_cause_of_a_reset_counts() {
    let table = [
        (0, ResetCause::Unknown),
        (1 << 26, ResetCause::Pin),
        (0b111 << 25, ResetCause::PowerOn),
        (1 << 25 | 1 << 26, ResetCause::Brownout),
        (1 << 28 | 1 << 26, ResetCause::Software),
        (1 << 29 | 1 << 26, ResetCause::Watchdog),
        (1 << 30 | 1 << 26, ResetCause::Watchdog),
        (1 << 31 | 1 << 26, ResetCause::LowPower),
    ];
    for (flags, expected) in table {
        for rest in [0, 0b11] {
            assert_eq!(reset_cause::cause(flags | rest), expected, "{flags:#x}");
            assert_eq!(reset_cause::cause(flags | reset_cause::TAKE_BACK), expected);
        }
    }
}

const SECTOR: usize = 4096;

/// The sectors of the settings, which two drivers write; a byte that is not blank is not written again.
#[derive(Clone, Default)]
struct Sectors(Rc<RefCell<RamFlash<SECTOR>>>);

impl ErrorType for Sectors {
    type Error = OutOfBounds;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
        self.0.borrow_mut().read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        2 * SECTOR
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
        self.0.borrow_mut().erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
        let mut before = vec![0; bytes.len()];
        self.read(offset, &mut before)?;
        assert!(before.iter().all(|byte| *byte == 0xff), "{offset} is not blank");
        self.0.borrow_mut().write(offset, bytes)
    }
}

/// The supply falls and comes back between any two steps in which the board prepares the journal's record, and again later.
#[test]
fn the_record_of_a_falling_supply_goes_to_a_blank_slot() {
    const STEPS: u32 = 4;
    let journal = |pass| Journal {
        job: 1,
        profile: 2,
        pass,
        is_finished: false,
        path: SpanParameter::NONE,
    };
    for first in 0..3 * STEPS {
        for second in first..3 * STEPS {
            let sectors = Sectors::default();
            let mut settings = Settings::open(sectors.clone());
            let mut falling = FallingRecord::new(sectors.clone());
            let (mut step, mut noted) = (0, 0);
            for pass in 1..4 {
                let mut dips = |falling: &mut FallingRecord<Sectors>| {
                    if step == first || step == second {
                        falling.changed(true);
                        assert!(supply::lines() == InputLines::SUPPLY);
                        falling.changed(false);
                    }
                    step += 1;
                };
                dips(&mut falling);
                settings.keep_journal(&journal(pass)).unwrap();
                noted = pass;
                dips(&mut falling);
                // As `GuardedMachine::prepare_journal` does.
                let was_written = falling.withdraw();
                dips(&mut falling);
                let prepared = settings.prepare_journal(Some(&journal(10 + pass)), was_written);
                falling.set(prepared);
                dips(&mut falling);
            }
            // At the next power-up it is a record of that pass or later.
            let found = Settings::open(sectors).journal().unwrap().pass;
            assert!(found % 10 >= noted - 1, "{first}, {second}: {found}");
        }
    }
}
