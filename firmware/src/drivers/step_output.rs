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
    /// The idle word, which the DMA reads.
    rest: &'static mut u32,
    /// Set and reset bit of each axis's step pin.
    bits: [u32; 3],
    /// Ticks in which no buffer may be filled, because the idle word has changed.
    settles: u8,
}

/// Ticks after a change of the idle word until both buffers hold the new word: the buffer that is output at the change is cleared completely only when it is output again.
const SETTLE_TICKS: u8 = 2;

/// The pins of a board and the clock of its slots.
pub(crate) struct StepSetup {
    /// Step and direction pins.
    pub(crate) wiring: Wiring,
    /// Axes whose direction pin is high towards plus, one bit each.
    pub(crate) plus_is_high: u8,
    /// Counts of TIM1 per slot; see [`controller::step_output::slot_counts`].
    pub(crate) slot_counts: u16,
}

impl StepDriver {
    /// Starts the output with step pins that are low at rest; see [`StepOutput::start`]. `rest`: the idle word ([`interp_core::Steps::rest`]).
    pub(crate) fn new(
        timer: pac::TIM1,
        dma: pac::DMA2,
        setup: StepSetup,
        (buffers, rest): (&'static mut Buffers, &'static mut u32),
    ) -> Self {
        let StepSetup {
            wiring,
            plus_is_high,
            slot_counts,
        } = setup;
        let bits = wiring.step.map(|pin| 0x1_0001 << (pin & 15));
        *rest = idle_word(bits, 0);
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
            rest,
            bits,
            settles: 0,
        }
    }

    /// Sets the idle level of the step pins: high for axes whose pulses are inverted, one bit each ([`interp_core::Steps::set_low_pulses`]). Pins follow within three periods; to
    /// be called at rest.
    #[cold]
    #[inline(never)]
    pub(crate) fn set_levels(&mut self, inverted: u8) {
        let rest = idle_word(self.bits, inverted);
        if *self.rest != rest {
            *self.rest = rest;
            self.settles = SETTLE_TICKS;
            // Completes the write before the DMA reads.
            cortex_m::asm::dmb();
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
        if self.settles != 0 {
            self.settles -= 1;
            return None;
        }
        let idle = self.output.free()?;
        // The DMA has cleared these words: they are read again.
        cortex_m::asm::dmb();
        self.buffers.get_mut(idle)
    }
}

/// The word of a slot without a pulse: pins whose pulses are inverted are high.
fn idle_word([x, y, z]: [u32; 3], inverted: u8) -> u32 {
    let idle = |axis: u8, bits: u32| {
        let is_high = inverted >> axis & 1 != 0;
        bits & if is_high { 0x0000_ffff } else { 0xffff_0000 }
    };
    idle(0, x) | idle(1, y) | idle(2, z)
}

/// An address in the form of a DMA register.
fn address(word: *const u32) -> u32 {
    word.addr() as u32
}
