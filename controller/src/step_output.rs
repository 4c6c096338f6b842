//! Hardware step pulses: a timer requests one DMA transfer per slot into a port's set/reset register.
//!
//! ```text
//!  TIM2 update, every period ──► trigger: starts TIM1, once
//!  TIM1 update, every slot ──► DMA2 stream 5: buffer ──► BSRR of the step pins' port
//!  TIM1 compare, half a slot later ──► DMA2 stream 1: the idle word ──► the slot that was just output
//!
//!  period        k                              k + 1                          k + 2
//!  plays         buffer 0                       buffer 1                       buffer 0
//!  processor     tick k fills buffer 1          tick k + 1 fills buffer 0      ..
//! ```
//!
//! Both streams alternate between two buffers in hardware (double-buffer mode). **A pulse is output once:** the second
//! stream clears each slot half a slot after its output, so that no buffer is output twice. If the
//! processor stops, by a fault or a debugger, the axes complete the pulses already computed, two periods at most, and every
//! step pin stays low. Clearing takes no processor time.
//!
//! **Phase.** TIM1 and TIM2 count the same clock, so [`SLOTS`] slots are a period to the cycle. TIM1 starts by hardware with an
//! update of TIM2, at a count that brings its first slot a quarter of a slot later. Period after period the last slot
//! is output 3/4 slot and cleared 1/4 slot before TIM2's interrupt; when the tick reads the active buffer, the switch is complete.
//!
//! **Directions** are set by the processor at the beginning of the tick ([`StepOutput::begin`]), on any port. The pattern leaves
//! the first [`TURN_SLOTS`] slots and the drive's set-up time without pulses where an axis turns. The stream's counter
//! shows whether the pins were set in time; if not, it is a fault.
//!
//! **Too late.** A tick that has less than [`WRITE_SLOTS`] slots left, or none, writes nothing: the buffer is output without pulses, its
//! steps are carried over to the next.
//!
//! Sources: RM0090 rev 19, 8 (GPIO), 10.3 (DMA; requests in table 43; double buffer in 10.3.10), 17.4 (TIM1), 18.4 (TIM2). Only DMA2
//! reaches the ports, and of the memories only SRAM can be read and written by both of its sides: the buffers and the idle word
//! have to be in SRAM, not in the core-coupled memory. Every register access goes through [`Registers`], so that a test runs the
//! same code on a model of the chip. No function waits: where the registers are missing (QEMU) there is no output.

use interp_core::{
    fault::{Fault, FaultKind},
    steps::{BUFFER_WORDS, SLOTS, TURN_SLOTS},
};

/// Slots allowed for writing the pulses of three axes: 90 at 400 kHz in the pessimistic cycle model, so 112 at 500 kHz.
pub const WRITE_SLOTS: u32 = 200;

/// Register access by address.
pub trait Registers {
    /// Reads a register.
    fn read(&self, address: u32) -> u32;
    /// Writes a register.
    fn write(&mut self, address: u32, value: u32);
}

/// Register addresses (RM0090, 2.3) and values.
pub mod register {
    /// Clock of DMA2, among others.
    pub const RCC_AHB1ENR: u32 = 0x4002_3830;
    /// Clock of TIM1.
    pub const RCC_APB2ENR: u32 = 0x4002_3844;
    /// TIM2, control 2: its trigger output.
    pub const TIM2_CR2: u32 = 0x4000_0004;
    /// TIM1, control 1.
    pub const TIM1_CR1: u32 = 0x4001_0000;
    /// TIM1, control 2.
    pub const TIM1_CR2: u32 = 0x4001_0004;
    /// TIM1, slave mode control.
    pub const TIM1_SMCR: u32 = 0x4001_0008;
    /// TIM1, DMA requests.
    pub const TIM1_DIER: u32 = 0x4001_000c;
    /// TIM1, flags.
    pub const TIM1_SR: u32 = 0x4001_0010;
    /// TIM1, count.
    pub const TIM1_CNT: u32 = 0x4001_0024;
    /// TIM1, auto-reload: last count of a slot.
    pub const TIM1_ARR: u32 = 0x4001_002c;
    /// TIM1, count of the first compare channel.
    pub const TIM1_CCR1: u32 = 0x4001_0034;
    /// DMA2, flags to clear of streams 0 to 3.
    pub const DMA2_LIFCR: u32 = 0x4002_6408;
    /// DMA2, flags to clear of streams 4 to 7.
    pub const DMA2_HIFCR: u32 = 0x4002_640c;
    /// DMA2, the output stream: 5, whose channel 6 is TIM1's update.
    pub const PLAY: u32 = stream(5);
    /// DMA2, the clearing stream: 1, whose channel 6 is TIM1's first compare.
    pub const WIPE: u32 = stream(1);
    /// Of a stream: its control register.
    pub const CR: u32 = 0x0;
    /// Of a stream: words left of the buffer.
    pub const NDTR: u32 = 0x4;
    /// Of a stream: the address on the peripheral's side.
    pub const PAR: u32 = 0x8;
    /// Of a stream: the first buffer.
    pub const M0AR: u32 = 0xc;
    /// Of a stream: the second buffer.
    pub const M1AR: u32 = 0x10;
    /// Of a stream: its FIFO.
    pub const FCR: u32 = 0x14;
    /// Of a port: set and reset bits.
    pub const BSRR: u32 = 0x18;

    /// Clock bit of DMA2 in [`RCC_AHB1ENR`].
    pub const DMA2EN: u32 = 1 << 22;
    /// Clock bit of TIM1 in [`RCC_APB2ENR`].
    pub const TIM1EN: u32 = 1;
    /// Stream enabled.
    pub const EN: u32 = 1;
    /// Current target is the second buffer.
    pub const CT: u32 = 1 << 19;
    /// Channel 6, double buffer, words on both sides, address in memory counts, circular.
    pub const STREAM: u32 = 6 << 25 | 1 << 18 | 2 << 13 | 2 << 11 | 1 << 10 | 1 << 8;
    /// Very high priority, from memory to peripheral.
    pub const PLAYS: u32 = STREAM | 3 << 16 | 1 << 6;
    /// High priority, from peripheral to memory.
    pub const WIPES: u32 = STREAM | 2 << 16;
    /// All flags of stream 1 in [`DMA2_LIFCR`], and of stream 5 in [`DMA2_HIFCR`].
    pub const FLAGS: u32 = 0x3d << 6;
    /// TIM2's update is its trigger output.
    pub const MMS_UPDATE: u32 = 2 << 4;
    /// The bits of `MMS`.
    pub const MMS: u32 = 7 << 4;
    /// TIM1 is started by TIM2's trigger output (its ITR1, RM0090 table 93).
    pub const STARTS_WITH_TIM2: u32 = 1 << 4 | 6;
    /// DMA requests of TIM1's update and first compare.
    pub const REQUESTS: u32 = 1 << 8 | 1 << 9;

    /// Registers of a stream of DMA2.
    const fn stream(number: u32) -> u32 {
        0x4002_6410 + 0x18 * number
    }
}

use register as r;

/// A port of the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs, reason = "a letter says it")]
pub enum Port {
    A,
    B,
    C,
    D,
    E,
    F,
    G,
    H,
    I,
}

impl Port {
    /// Address of a register of this port.
    #[must_use]
    pub const fn register(self, offset: u32) -> u32 {
        0x4002_0000 + 0x400 * self as u32 + offset
    }
}

/// A pin of the chip: `Pin(Port::E, 9)` is PE9.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin(pub Port, pub u8);

/// Pins of the axes' drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wiring {
    /// Port of all step pins: the one word per slot reaches one port.
    pub step_port: Port,
    /// Number of each axis's step pin, 0 to 15.
    pub step: [u8; 3],
    /// Direction pins, on any port.
    pub direction: [Pin; 3],
}

/// The buffers, in SRAM at fixed addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// Addresses of the buffers of [`BUFFER_WORDS`] words.
    pub buffers: [u32; 2],
    /// Address of the idle word ([`interp_core::Steps::rest`]).
    pub rest: u32,
}

/// Clocks of a slot: of a timer of `timer_hz`, at a period of `period_us`. None where that is not an integer, or
/// does not fit the timer.
#[must_use]
pub const fn slot_counts(timer_hz: u32, period_us: u32) -> Option<u16> {
    let counts = timer_hz as u64 * period_us as u64;
    let slots = 1_000_000 * SLOTS as u64;
    let slot = counts / slots;
    if counts.is_multiple_of(slots) && slot >= 16 && slot <= u16::MAX as u64 {
        Some(slot as u16)
    } else {
        None
    }
}

/// Errors of a period's pulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// A direction pin was changed after this number of slots, when pulses may already have been output.
    DirectionLate(u32),
    /// The DMA has stopped: an error on the bus.
    Stopped,
}

impl From<Failure> for Fault {
    fn from(failure: Failure) -> Self {
        let late = match failure {
            Failure::DirectionLate(slots) => u16::try_from(slots).unwrap_or(u16::MAX),
            Failure::Stopped => 0,
        };
        Self::new(FaultKind::StepOutput, f32::from(late))
    }
}

/// The step output hardware.
#[derive(Debug)]
pub struct StepOutput<R> {
    registers: R,
    wiring: Wiring,
    /// Levels on the direction pins, one bit per axis.
    directions: u8,
    /// The buffer that this tick may fill.
    idle: usize,
    /// Whether the hardware is present.
    present: bool,
}

impl<R: Registers> StepOutput<R> {
    /// Sets up DMA and TIM1; the first slot is output with TIM2's next update. `slot_counts`: counts of TIM1 per slot; see [`slot_counts`]. The pins have to be
    /// set up and low, and the buffers to hold the idle word. TIM2 is not started here.
    pub fn start(registers: R, wiring: Wiring, memory: Memory, slot_counts: u16) -> Self {
        let mut output = Self {
            registers,
            wiring,
            directions: 0,
            idle: 0,
            present: false,
        };
        output.start_stream(r::PLAY, wiring.step_port.register(r::BSRR), memory, r::PLAYS);
        output.start_stream(r::WIPE, memory.rest, memory, r::WIPES);
        output.start_timer(slot_counts.into());
        let both = output.registers.read(r::PLAY + r::CR) & output.registers.read(r::WIPE + r::CR);
        output.present = both & r::EN != 0;
        output
    }

    /// Whether the registers hold their settings; false in QEMU, which has no such hardware.
    pub const fn is_present(&self) -> bool {
        self.present
    }

    /// Enables clocks. The read afterwards waits until they are active (ES0182, 2.1.13).
    fn enable(&mut self, address: u32, bits: u32) {
        let value = self.registers.read(address);
        self.registers.write(address, value | bits);
        let _ = self.registers.read(address);
    }

    /// Sets up a stream while it is disabled, with its flags cleared before it is enabled (RM0090, 10.3.17).
    fn start_stream(&mut self, stream: u32, peripheral: u32, memory: Memory, control: u32) {
        let [first, second] = memory.buffers;
        self.enable(r::RCC_AHB1ENR, r::DMA2EN);
        let flags = if stream == r::PLAY {
            r::DMA2_HIFCR
        } else {
            r::DMA2_LIFCR
        };
        for (address, value) in [
            (stream + r::CR, 0),
            (flags, r::FLAGS),
            (stream + r::NDTR, SLOTS),
            (stream + r::PAR, peripheral),
            (stream + r::M0AR, first),
            (stream + r::M1AR, second),
            // No FIFO: each request transfers one word.
            (stream + r::FCR, 0),
            (stream + r::CR, control),
            (stream + r::CR, control | r::EN),
        ] {
            self.registers.write(address, value);
        }
    }

    /// Sets up TIM1, which waits for TIM2's trigger. Its registers take effect immediately: no preload, prescaler 1.
    fn start_timer(&mut self, slot: u32) {
        self.enable(r::RCC_APB2ENR, r::TIM1EN);
        for (address, value) in [
            (r::TIM1_CR1, 0),
            (r::TIM1_CR2, 0),
            (r::TIM1_ARR, slot - 1),
            (r::TIM1_CCR1, slot / 2),
            // A quarter of a slot before its end, past the compare: the first event is an update.
            (r::TIM1_CNT, slot - slot / 4),
            (r::TIM1_SR, 0),
            (r::TIM1_DIER, r::REQUESTS),
            (r::TIM1_SMCR, r::STARTS_WITH_TIM2),
        ] {
            self.registers.write(address, value);
        }
        let kept = self.registers.read(r::TIM2_CR2) & !r::MMS;
        self.registers.write(r::TIM2_CR2, kept | r::MMS_UPDATE);
    }

    /// At the beginning of a tick: sets the direction pins for the period that has begun, one bit per axis.
    ///
    /// # Errors
    /// [`Failure`]; the pins are set in any case.
    #[inline]
    pub fn begin(&mut self, directions: u8) -> Result<(), Failure> {
        let turned = core::mem::replace(&mut self.directions, directions) ^ directions;
        if turned != 0 {
            self.turn(turned);
        }
        if !self.present {
            return Ok(());
        }
        let control = self.registers.read(r::PLAY + r::CR);
        let idle = usize::from(control & r::CT == 0);
        // The same buffer twice: a whole period was missed, and its direction change with it.
        let unheard = core::mem::replace(&mut self.idle, idle) == idle;
        if control & r::EN == 0 {
            return Err(Failure::Stopped);
        } else if turned != 0 {
            let left = self.registers.read(r::PLAY + r::NDTR);
            let played = SLOTS.saturating_sub(left) + if unheard { SLOTS } else { 0 };
            if played > TURN_SLOTS {
                return Err(Failure::DirectionLate(played));
            }
        }
        Ok(())
    }

    #[cold]
    #[inline(never)]
    fn turn(&mut self, turned: u8) {
        for (axis, Pin(port, number)) in self.wiring.direction.into_iter().enumerate() {
            if turned >> axis & 1 != 0 {
                let reset = if self.directions >> axis & 1 == 0 { 16 } else { 0 };
                let bit = 1 << (reset + u32::from(number & 15));
                self.registers.write(port.register(r::BSRR), bit);
            }
        }
    }

    /// At the end of a tick: the buffer to fill, if enough slots are left.
    #[inline]
    pub fn free(&mut self) -> Option<usize> {
        if self.present {
            let playing = usize::from(self.registers.read(r::PLAY + r::CR) & r::CT != 0);
            let left = self.registers.read(r::PLAY + r::NDTR);
            if playing == self.idle || left < WRITE_SLOTS {
                return None;
            }
        }
        Some(self.idle)
    }
}

/// Two buffers: what [`Memory::buffers`] points to.
pub type Buffers = [[u32; BUFFER_WORDS]; 2];

#[cfg(test)]
mod tests;
