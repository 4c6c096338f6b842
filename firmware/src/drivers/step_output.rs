//! The step output of this chip: the registers and the memory of [`controller::step_output`], which documents its function.

use controller::step_output::{Buffers, Memory, Registers, StepOutput, Wiring};
use interp_core::{fault::Fault, steps::BUFFER_WORDS};
use stm32f4xx_hal::pac;

/// The chip's own registers.
struct Chip {
    _timer: pac::TIM1,
    _dma: pac::DMA2,
}

impl Registers for Chip {
    #[inline]
    #[allow(
        unsafe_code,
        reason = "registers by address, so that a test runs the same driver"
    )]
    fn read(&self, address: u32) -> u32 {
        // SAFETY: the driver names registers of RM0090 only, aligned words; reading one of them changes nothing.
        unsafe { (address as *const u32).read_volatile() }
    }

    #[inline]
    #[allow(
        unsafe_code,
        reason = "registers by address, so that a test runs the same driver"
    )]
    fn write(&mut self, address: u32, value: u32) {
        // SAFETY: registers of TIM1 and DMA2, which are owned here; set/reset registers, whose writes cannot clash; the others
        // (clocks, kinds of pins, TIM2's trigger) are changed while the board starts, with interrupts off. The DMA is only ever
        // pointed to the memory that `StepDriver` was lent for ever.
        unsafe { (address as *mut u32).write_volatile(value) }
    }
}

/// The output with its memory.
pub(crate) struct StepDriver {
    output: StepOutput<Chip>,
    /// Axes whose direction pin is high towards plus, one bit each.
    plus_is_high: u8,
    buffers: &'static mut Buffers,
}

impl StepDriver {
    /// Starts the output; see [`StepOutput::start`]. `rest`: [`interp_core::Steps::rest`]. `plus_is_high`: axes whose direction pin is high
    /// towards plus, a bit each.
    pub(crate) fn new(
        timer: pac::TIM1,
        dma: pac::DMA2,
        wiring: Wiring,
        plus_is_high: u8,
        slot_counts: u16,
        buffers: &'static mut Buffers,
        rest: &'static mut u32,
    ) -> Self {
        *rest = wiring
            .step
            .iter()
            .fold(0, |word, pin| word | 1 << (16 + (pin & 15)));
        for slot in buffers.iter_mut().flatten() {
            *slot = *rest;
        }
        let memory = Memory {
            buffers: buffers.each_ref().map(|buffer| address(buffer.as_ptr())),
            rest: address(rest),
        };
        // Completes the writes before the DMA reads.
        cortex_m::asm::dmb();
        let chip = Chip {
            _timer: timer,
            _dma: dma,
        };
        Self {
            output: StepOutput::start(chip, wiring, memory, slot_counts),
            plus_is_high,
            buffers,
        }
    }

    /// Whether the hardware is present; false in QEMU.
    pub(crate) const fn is_present(&self) -> bool {
        self.output.is_present()
    }

    /// At the beginning of a tick: sets the direction pins. `directions`: axes that move towards minus, exchanged where the host has inverted
    /// one, a bit each ([`interp_core::Steps::directions`]).
    ///
    /// # Errors
    /// The fault of the run where the pulses are wrong.
    #[inline]
    pub(crate) fn begin(&mut self, directions: u8) -> Result<(), Fault> {
        self.output
            .begin(directions ^ self.plus_is_high)
            .map_err(Fault::from)
    }

    /// At the end of a tick: the slots to fill, if enough are left.
    #[inline]
    pub(crate) fn slots(&mut self) -> Option<&mut [u32; BUFFER_WORDS]> {
        let idle = self.output.free()?;
        // The DMA has cleared these words: they are read again.
        cortex_m::asm::dmb();
        self.buffers.get_mut(idle)
    }
}

/// An address in the form of a DMA register.
fn address(word: *const u32) -> u32 {
    word.addr() as u32
}
