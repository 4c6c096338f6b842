//! The step output of this chip: the registers and the memory behind [`controller::step_output`], which says how it works.

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
    /// Axes whose direction pin is high towards plus, a bit each.
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
        // What was written is there before the DMA looks.
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

    /// Whether the chip has the hardware; QEMU has not.
    pub(crate) const fn is_present(&self) -> bool {
        self.output.is_present()
    }

    /// At the beginning of a tick: sets the direction pins. `directions`: axes that move towards minus, exchanged where the host has inverted
    /// one, a bit each ([`interp_core::Steps::directions`]).
    ///
    /// # Errors
    /// The fault that it is to a run where pulses are not as they should be.
    #[inline]
    pub(crate) fn begin(&mut self, directions: u8) -> Result<(), Fault> {
        self.output
            .begin(directions ^ self.plus_is_high)
            .map_err(Fault::from)
    }

    /// At the end of a tick: the slots to be filled, if there is time for it.
    #[inline]
    pub(crate) fn slots(&mut self) -> Option<&mut [u32; BUFFER_WORDS]> {
        let idle = self.output.free()?;
        // What the DMA has wiped is read anew.
        cortex_m::asm::dmb();
        self.buffers.get_mut(idle)
    }
}

/// An address as the DMA takes it.
fn address(word: *const u32) -> u32 {
    word.addr() as u32
}
