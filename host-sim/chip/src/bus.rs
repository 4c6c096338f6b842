//! Address decoding: clock gates, the bit-band alias, and checks of the program's accesses.

use crate::{
    chip::Chip,
    code::Block,
    part::{
        flash::{SETTINGS, SETTINGS_BYTES},
        rcc::{Gate, cause},
    },
    unicorn::{Register, Registers, Surroundings},
};

/// A peripheral: base address, size in bytes, clock, name.
type Device = (u32, u32, Gate, &'static str);

const DEVICES: [Device; 17] = [
    (0x4000_0000, 0x400, Gate::Apb1(0), "TIM2"),
    (0x4000_0c00, 0x400, Gate::Apb1(3), "TIM5"),
    (0x4000_1800, 0x400, Gate::Apb1(6), "TIM12"),
    (0x4000_7000, 0x400, Gate::Apb1(28), "PWR"),
    (0x4001_0000, 0x400, Gate::Apb2(0), "TIM1"),
    (0x4001_1000, 0x400, Gate::Apb2(4), "USART1"),
    (0x4001_3800, 0x400, Gate::Apb2(14), "SYSCFG"),
    (0x4002_0000, 0x400, Gate::Ahb1(0), "GPIOA"),
    (0x4002_0400, 0x400, Gate::Ahb1(1), "GPIOB"),
    (0x4002_0800, 0x400, Gate::Ahb1(2), "GPIOC"),
    (0x4002_0c00, 0x400, Gate::Ahb1(3), "GPIOD"),
    (0x4002_1000, 0x400, Gate::Ahb1(4), "GPIOE"),
    (0x4002_1400, 0x400, Gate::Ahb1(5), "GPIOF"),
    (0x4002_1800, 0x400, Gate::Ahb1(6), "GPIOG"),
    (0x4002_1c00, 0x400, Gate::Ahb1(7), "GPIOH"),
    (0x4002_2000, 0x400, Gate::Ahb1(8), "GPIOI"),
    (0x4002_6400, 0x400, Gate::Ahb1(22), "DMA2"),
];

const SETTINGS_END: u32 = SETTINGS + SETTINGS_BYTES;
const BIT_BAND: u32 = 0x4200_0000;
const BIT_BAND_END: u32 = 0x4400_0000;

impl Chip {
    /// Whether the peripheral at this address may be accessed; reports a complaint otherwise.
    fn is_open(&mut self, address: u32, what: &str) -> bool {
        let Some((_, _, gate, name)) = DEVICES
            .iter()
            .find(|(base, bytes, ..)| address.wrapping_sub(*base) < *bytes)
        else {
            return true;
        };
        let at = self.at;
        if !self.rcc.is_on(*gate) {
            self.world.wrong(format!(
                "{what} of {name} ({address:#x}) without its clock, in the block at {at:#x}"
            ));
            return false;
        }
        if self.rcc.is_fresh(*gate, self.world.now) && !self.block.has_barrier {
            self.world.wrong(format!(
                "{what} of {name} ({address:#x}) right after its clock was switched on (ES0182), in the block at {at:#x}"
            ));
        }
        true
    }

    fn read_word(&mut self, address: u32) -> u32 {
        if !self.is_open(address, "read") {
            return 0;
        }
        let world = &mut self.world;
        match address {
            0x4000_0000..0x4000_0400 => self.tim2.read(address & 0x3ff, world),
            0x4000_0c00..0x4000_1000 => self.tim5.read(address & 0x3ff, world),
            0x4000_1800..0x4000_1c00 => self.pwm.read(address & 0x3ff, world),
            0x4000_3000..0x4000_3400 => self.watchdog.read(address & 0x3ff, world),
            0x4000_7000 => self.rcc.pwr_cr,
            0x4000_7004 => self.supply.status(),
            0x4001_3c00..0x4001_4000 => self.supply.read(address & 0x3ff, world),
            0x4001_0000..0x4001_0400 => self.tim1.read(address & 0x3ff, world),
            0x4001_1000..0x4001_1400 => self.usart.read(address & 0x3ff, world),
            0x4002_0000..0x4002_2400 => {
                self.ports[(address as usize - 0x4002_0000) / 0x400].read(address & 0x3ff, world)
            }
            0x4002_3800..0x4002_3900 => self.rcc.read(address & 0xff, world),
            SETTINGS..SETTINGS_END => self.flash.word(address),
            // The size of flash, KB, in the upper half.
            0x1fff_7a20 => 1024 << 16,
            0x4002_3c00 => self.rcc.flash_acr,
            0x4002_3c04..0x4002_4000 => self.flash.read(address & 0x3ff, world),
            0x4002_6400..0x4002_6800 => self.dma.read(address & 0x3ff),
            0xe000_1000..0xe000_2000 | 0xe000_edfc | 0xe004_2000..0xe004_2010 => {
                self.debug.read(address, world)
            }
            0xe000_e000..0xe000_f000 => self.nvic.read(address & 0xfff, world),
            _ => {
                world.wrong_once(format!("read of {address:#x}: not modelled"));
                0
            }
        }
    }

    fn write_word(&mut self, address: u32, bytes: u32, value: u32) {
        if !self.is_open(address, "write") {
            return;
        }
        let apb2 = self.rcc.apb2_cycles();
        let world = &mut self.world;
        match address {
            0x4000_0000..0x4000_0400 => {
                self.tim2
                    .write(address & 0x3ff, value, self.rcc.timer_cycles(1), world)
            }
            0x4000_0c00..0x4000_1000 => {
                self.tim5
                    .write(address & 0x3ff, value, self.rcc.timer_cycles(1), world)
            }
            0x4000_1800..0x4000_1c00 => self.pwm.write(address & 0x3ff, value, world),
            0x4000_3000..0x4000_3400 => self.watchdog.write(address & 0x3ff, value, world),
            0x4000_7000 => {
                self.rcc.pwr_cr = value;
                self.rcc.check_supply(world);
            }
            0x4001_0000..0x4001_0400 => {
                self.tim1
                    .write(address & 0x3ff, value, self.rcc.timer_cycles(2), world)
            }
            0x4001_1000..0x4001_1400 => self.usart.write(address & 0x3ff, value, apb2, world),
            0x4001_3c00..0x4001_4000 => self.supply.write(address & 0x3ff, value, world),
            0x4002_0000..0x4002_2400 => {
                let index = (address as usize - 0x4002_0000) / 0x400;
                if self.ports[index].write(address & 0x3ff, value, world) {
                    let change = self.ports[index].change(self.world.now, false);
                    self.keep(change);
                }
            }
            0x4002_3800..0x4002_3900 => {
                self.rcc.write(address & 0xff, value, world);
                self.reset_parts(address as usize & 0xff, value);
            }
            0x4002_3c00 => {
                self.rcc.flash_acr = value;
                self.rcc.check_supply(world);
            }
            0x4002_3c04..0x4002_4000 => {
                self.flash.write(address & 0x3ff, value, world);
                self.fail_supply();
            }
            0x4002_6400..0x4002_6800 => self.dma.write(address & 0x3ff, value, self.sram, world),
            0xe000_1000..0xe000_2000 | 0xe000_edfc | 0xe004_2000..0xe004_2010 => {
                self.debug.write(address, value, world)
            }
            0xe000_e000..0xe000_f000 => self.nvic.write(address & 0xfff, bytes, value, world),
            _ => world.wrong_once(format!("write of {address:#x}: not modelled")),
        }
    }

    /// The supply has failed in an operation of the flash: it comes back at once.
    const fn fail_supply(&mut self) {
        if self.flash.is_cut && self.reset.is_none() {
            self.reset = Some(cause::POWER_ON | cause::PIN | cause::BROWN_OUT);
        }
    }

    /// The word and bit of a bit-band alias address.
    const fn banded(address: u32) -> (u32, u32) {
        let offset = address - BIT_BAND;
        let byte = 0x4000_0000 + (offset >> 5);
        (byte & !3, 8 * (byte & 3) + (offset >> 2 & 7))
    }
}

impl Surroundings for Chip {
    #[inline]
    fn block(&mut self, registers: &Registers, address: u32, bytes: u32) -> bool {
        let block = self.code.block(address, bytes);
        self.block = block;
        self.at = address;
        self.world.now += u64::from(block.cycles);
        self.catch_up();
        let waits = self.nvic.has_pending() && self.is_deliverable(registers);
        if waits || self.reset.is_some() || self.over || self.hangs || self.fault || self.nvic.reset_wanted {
            // The block is executed after the interruption, and its cycles are counted then. The time does not go back before events that have occurred.
            self.world.now = (self.world.now - u64::from(block.cycles)).max(self.happened);
            return false;
        }
        self.check_float(block)
    }

    fn read(&mut self, address: u32, bytes: u32) -> u32 {
        self.catch_up();
        let value = if (BIT_BAND..BIT_BAND_END).contains(&address) {
            let (word, bit) = Self::banded(address);
            self.read_word(word) >> bit & 1
        } else {
            self.read_word(address & !3) >> (8 * (address & 3))
        };
        self.serial_line();
        self.plan();
        match bytes {
            1 => value & 0xff,
            2 => value & 0xffff,
            _ => value,
        }
    }

    fn write(&mut self, address: u32, bytes: u32, value: u32) {
        self.catch_up();
        if (BIT_BAND..BIT_BAND_END).contains(&address) {
            let (word, bit) = Self::banded(address);
            let old = self.read_word(word);
            self.write_word(word, 4, old & !(1 << bit) | (value & 1) << bit);
        } else if (SETTINGS..SETTINGS_END).contains(&address) {
            self.flash.program(address, bytes, value, &mut self.world);
            self.fail_supply();
        } else {
            // Halfwords where the registers have no more; bytes of priorities.
            let narrow = matches!(address, 0x4000_0000..0x4000_1000 | 0x4000_3000..0x4000_3400 | 0x4001_0000..0x4001_1400);
            if bytes != 4 && !narrow && !(0xe000_e400..0xe000_e480).contains(&address) {
                self.world
                    .wrong(format!("{bytes} bytes are written at {address:#x}: not modelled"));
            }
            self.write_word(address, bytes, value);
        }
        self.serial_line();
        self.plan();
    }
}

/// Bits of the program status register that are not 0 within an IT block.
pub(crate) const IT_STATE: u32 = 0x0600_fc00;

impl Chip {
    /// Whether an interrupt would be taken now. The chip takes one within an IT block, too; here it waits for the block's end, four instructions at
    /// most.
    pub(crate) fn is_deliverable(&self, registers: &Registers) -> bool {
        let Some((_, priority)) = self.nvic.first() else {
            return false;
        };
        let in_block = registers.get(Register::XPSR) & IT_STATE != 0;
        !in_block && registers.get(Register::PRIMASK) & 1 == 0 && priority < self.level(registers)
    }

    /// The priority that an interrupt has to exceed: the execution priority, or `BASEPRI`.
    pub(crate) fn level(&self, registers: &Registers) -> u32 {
        let base = registers.get(Register::BASEPRI) & 0xff;
        let running = self.nvic.running();
        if base == 0 { running } else { running.min(base) }
    }

    /// A floating-point instruction before the unit is enabled is a fault.
    fn check_float(&mut self, block: Block) -> bool {
        if block.has_float && !self.nvic.has_float() {
            let at = self.at;
            self.world.wrong_once(format!(
                "a floating-point instruction in the block at {at:#x}, and the unit is off"
            ));
        }
        true
    }
}
