//! The processor's exceptions, sleep and resets around Unicorn's instructions (ARMv7-M, B1.5).
//!
//! Frames are stacked at once: lazy stacking of floating-point registers is not modelled, nor tail-chaining and late arrival.

use crate::{
    bus::IT_STATE,
    chip::Chip,
    memory::Memory,
    part::rcc::cause,
    unicorn::{Engine, Halt, Register, Registers},
};

/// Cycles of an entry and of an exit.
const EXCEPTION_CYCLES: u64 = 12;
/// Bytes of an exception frame without floating-point registers.
const FRAME: u32 = 0x20;
/// Bytes of an exception frame with floating-point registers.
const FLOAT_FRAME: u32 = 0x68;
const EXC_RETURN: u32 = 0xffff_ff00;
const WFI: u16 = 0xbf30;
const HARD_FAULT: u32 = 3;
/// Stack pointer of a boot loader that does not set the image's.
const LOADER_STACK: u32 = 0x2000_4ff8;
/// QEMU's number of an exception's exit.
const EXIT: u32 = 8;

/// Statistics of the processor.
#[derive(Default)]
pub(crate) struct Account {
    pub(crate) frames: u64,
    pub(crate) float_frames: u64,
    pub(crate) hard_faults: u64,
    pub(crate) slept: u64,
    pub(crate) least_sp: u32,
}

pub(crate) struct Processor {
    engine: Engine<Chip>,
    flash: Memory,
    sram: Memory,
    sleeps: bool,
    pub(crate) account: Account,
}

impl Processor {
    /// A processor after its reset, or as a boot loader calls the image: with the loader's stack.
    pub(crate) fn new(chip: Chip, flash: Memory, sram: Memory, account: Account) -> Result<Self, String> {
        let begin = chip.image_begin;
        let engine = Engine::new(chip, flash, sram)?;
        let registers = engine.registers();
        let stack = if begin == flash.base() {
            flash.word(begin).unwrap_or(0)
        } else {
            LOADER_STACK
        };
        registers.set(Register::SP, stack);
        // A loader holds interrupts off where it leaves some pending: it could not take them any more.
        registers.set(Register::PRIMASK, u32::from(begin != flash.base()));
        registers.set(Register::LR, u32::MAX);
        registers.set(Register::PC, flash.word(begin + 4).unwrap_or(0) & !1);
        Ok(Self {
            engine,
            flash,
            sram,
            sleeps: false,
            account,
        })
    }

    /// Runs until the end (`None`), or a reset with these flags.
    pub(crate) fn run(mut self) -> (Chip, Account, Option<u32>) {
        let flags = loop {
            let registers = self.engine.registers();
            let chip = self.engine.surroundings();
            chip.catch_up();
            if chip.over {
                break None;
            }
            if chip.nvic.reset_wanted {
                break Some(cause::SOFTWARE | cause::PIN);
            }
            if let Some(flags) = chip.reset {
                break Some(flags);
            }
            if chip.hangs {
                chip.world.now = chip.next;
                continue;
            }
            if std::mem::take(&mut chip.fault) {
                self.enter(HARD_FAULT, 0);
                continue;
            }
            if let Some((line, priority)) = chip.nvic.first().filter(|_| chip.is_deliverable(&registers)) {
                self.enter(16 + line as u32, priority);
                continue;
            }
            if self.sleeps && !self.wakes(&registers) {
                continue;
            }
            let halt = self.engine.run();
            self.stopped(&halt);
        };
        (self.engine.into_surroundings(), self.account, flags)
    }

    /// Sleeps until the next event, unless an interrupt is due: `PRIMASK` does not keep it from waking (B1.5.19).
    fn wakes(&mut self, registers: &Registers) -> bool {
        let chip = self.engine.surroundings();
        let level = chip.level(registers);
        if chip.nvic.first().is_some_and(|(_, priority)| priority < level) {
            self.sleeps = false;
            return true;
        }
        // TIM1 and its transfers do not wake the processor.
        let next = chip.next.max(chip.world.now);
        self.account.slept += next - chip.world.now;
        chip.world.now = next;
        false
    }

    /// Determines why Unicorn has stopped.
    fn stopped(&mut self, halt: &Halt) {
        let pc = self.engine.registers().get(Register::PC);
        let chip = self.engine.surroundings();
        if halt.asked && halt.error.is_none() && halt.interrupt.is_none() {
            return;
        }
        let returned = halt
            .invalid
            .filter(|access| access.is_fetch && access.address >= EXC_RETURN)
            .map(|access| access.address);
        if let Some(value) = returned.or((pc >= EXC_RETURN || halt.interrupt == Some(EXIT)).then_some(pc)) {
            self.leave(value | 1);
        } else if chip.code.half(pc.wrapping_sub(2)) == WFI && halt.error.is_none() {
            self.sleeps = true;
        } else if halt.error.is_some() || halt.interrupt.is_some() {
            let at = chip.at;
            chip.world.wrong(format!(
                "the processor faults at {pc:#x}, in the block at {at:#x}: {halt:?}"
            ));
            if chip.nvic.depth() > 1 && chip.nvic.number() == HARD_FAULT {
                chip.over = true;
            } else {
                self.enter(HARD_FAULT, 0);
            }
        }
    }

    fn push(&mut self, address: u32, value: u32) {
        if !self.sram.set_word(address, value) {
            let chip = self.engine.surroundings();
            chip.world
                .wrong(format!("an exception's frame at {address:#x}, outside SRAM"));
            chip.over = true;
        }
    }

    /// Takes an exception.
    fn enter(&mut self, number: u32, priority: u32) {
        let registers = self.engine.registers();
        let control = registers.get(Register::CONTROL);
        let xpsr = registers.get(Register::XPSR);
        let has_float = control & 4 != 0;
        let chip = self.engine.surroundings();
        let (running, depth) = (chip.nvic.number(), chip.nvic.depth());
        if xpsr & IT_STATE != 0 {
            chip.world.wrong("an exception within an IT block: not modelled");
        }
        if control & 2 != 0 {
            chip.world.wrong("the process stack is in use: not modelled");
        }
        let mut sp = registers.get(Register::SP) - if has_float { FLOAT_FRAME } else { FRAME };
        let aligned = sp & 4 != 0;
        sp &= !7;
        self.account.least_sp = self.account.least_sp.min(sp);
        for (place, register) in (0..).zip(Register::SAVED) {
            self.push(sp + 4 * place, registers.get(register));
        }
        self.push(sp + 24, registers.get(Register::PC) & !1);
        self.push(
            sp + 28,
            xpsr & !0x3ff | running | 1 << 24 | u32::from(aligned) << 9,
        );
        if has_float {
            for number in 0..16 {
                self.push(
                    sp + 32 + 4 * u32::from(number),
                    registers.get(Register::single(number)),
                );
            }
            self.push(sp + 96, registers.get(Register::FPSCR));
            registers.set(Register::CONTROL, control & !4);
            self.account.float_frames += 1;
        } else {
            self.account.frames += 1;
        }
        self.account.hard_faults += u64::from(number == HARD_FAULT);
        let back = if depth > 0 { 0xffff_fff1 } else { 0xffff_fff9 };
        registers.set(Register::SP, sp);
        registers.set(Register::LR, if has_float { back & !0x10 } else { back });
        self.sleeps = false;
        let flash = self.flash;
        let chip = self.engine.surroundings();
        let table = chip.nvic.table().max(flash.base());
        if chip.nvic.has_systick() {
            chip.world
                .wrong_once("SysTick, which the boot loader left on, interrupts the program".to_owned());
        }
        let vector = flash.word(table + 4 * number).unwrap_or(0);
        if vector & 1 == 0 {
            chip.world.wrong(format!("vector {number} is {vector:#x}"));
        }
        chip.world.now += EXCEPTION_CYCLES;
        chip.nvic.enter(number, priority, chip.world.now);
        registers.set(Register::PC, vector & !1);
    }

    fn pull(&self, address: u32) -> u32 {
        self.sram.word(address).unwrap_or(0)
    }

    /// Returns from an exception.
    fn leave(&mut self, value: u32) {
        let registers = self.engine.registers();
        let chip = self.engine.surroundings();
        if chip.nvic.depth() == 0 {
            chip.world
                .wrong(format!("EXC_RETURN {value:#x} without an exception"));
            chip.over = true;
            return;
        }
        let now = chip.world.now;
        let line = chip.nvic.leave(now);
        let to_thread = chip.nvic.depth() == 0;
        if value & 0xf != if to_thread { 9 } else { 1 } {
            chip.world
                .wrong(format!("EXC_RETURN {value:#x} to the wrong mode"));
        }
        let has_float = value & 0x10 == 0;
        let sp = registers.get(Register::SP);
        for (place, register) in (0..).zip(Register::SAVED) {
            registers.set(register, self.pull(sp + 4 * place));
        }
        let (pc, xpsr) = (self.pull(sp + 24), self.pull(sp + 28));
        if has_float {
            for number in 0..16 {
                registers.set(
                    Register::single(number),
                    self.pull(sp + 32 + 4 * u32::from(number)),
                );
            }
            registers.set(Register::FPSCR, self.pull(sp + 96));
        }
        let control = registers.get(Register::CONTROL) & !4;
        registers.set(Register::CONTROL, control | if has_float { 4 } else { 0 });
        let frame = if has_float { FLOAT_FRAME } else { FRAME };
        registers.set(Register::SP, sp + frame + if xpsr >> 9 & 1 != 0 { 4 } else { 0 });
        registers.set(Register::XPSR, xpsr & 0xf800_0000);
        registers.set(Register::FLAGS, xpsr & 0xf80f_0000);
        registers.set(Register::PC, pc & !1);
        let chip = self.engine.surroundings();
        chip.world.now += EXCEPTION_CYCLES;
        chip.returned(line);
    }
}
