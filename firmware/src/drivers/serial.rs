//! Serial port of the link: USART1, eight bits, no parity, one stop bit.
//!
//! Receiving is by interrupt, sending by polling: QEMU 7.2 raises no interrupt for an empty transmitter.
//!
//! The port has no FIFO. At 921 600 baud the next byte arrives after 11 us, 1 823 cycles, while a tick takes up to 33 600: so its interrupt
//! has priority over the tick's, and its handler is short. (DMA into a ring buffer needs no interrupt, but QEMU has no DMA, and both images have
//! to receive in the same way.) Lost bytes are counted, and the host repeats the frame.

use core::sync::atomic::{AtomicU32, Ordering};

use stm32f4xx_hal::pac;

/// Bytes from the host that were lost since the start.
static BYTES_LOST: AtomicU32 = AtomicU32::new(0);

/// Bytes from the host that were lost since the start.
pub(crate) fn bytes_lost() -> u32 {
    BYTES_LOST.load(Ordering::Relaxed)
}

/// Counts a lost byte; called only by the receiving task.
pub(crate) fn count_lost() {
    BYTES_LOST.store(bytes_lost().saturating_add(1), Ordering::Relaxed);
}

/// Sets up the port and splits it. The receiver is off before [`Transmitter::listen`].
pub(crate) fn open(usart: pac::USART1, divider: u16) -> (Transmitter, Receiver) {
    usart.brr().write(|w| {
        w.div_mantissa()
            .set(divider >> 4)
            .div_fraction()
            .set((divider & 0xF) as u8)
    });
    usart.cr1().write(|w| w.ue().set_bit().te().set_bit());
    // SAFETY: the port is split into two halves, and the whole is no longer accessible. The transmitter only reads SR, writes DR, and switches the
    // receiver on before that has anything to do; the receiver only reads SR and reads DR, and a read of SR changes nothing by itself.
    #[allow(unsafe_code, reason = "one port, two halves")]
    let second = unsafe { pac::USART1::steal() };
    (Transmitter { usart }, Receiver { usart: second })
}

/// The transmitter.
pub(crate) struct Transmitter {
    usart: pac::USART1,
}

impl Transmitter {
    /// Enables the receiver. To be called once interrupts are on: an earlier byte would be overrun by the next.
    pub(crate) fn listen(&mut self) {
        self.usart
            .cr1()
            .modify(|_, w| w.re().set_bit().rxneie().set_bit());
    }

    /// Sends these bytes; waits until the last one is on its way, at most the transmission time of their number plus one
    /// bytes.
    pub(crate) fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            while self.usart.sr().read().txe().bit_is_clear() {}
            self.usart.dr().write(|w| w.dr().set(u16::from(byte)));
        }
    }
}

/// Result of a receive interrupt.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Received {
    /// The received byte, if any.
    pub(crate) byte: Option<u8>,
    /// Whether an earlier byte was lost or damaged: by an overrun, or because its stop bit was
    /// missing.
    pub(crate) error: bool,
}

/// The receiver.
pub(crate) struct Receiver {
    usart: pac::USART1,
}

impl Receiver {
    /// Reads a received byte. Reading the status and then the data also clears the error flags.
    pub(crate) fn read(&mut self) -> Received {
        let status = self.usart.sr().read();
        let error = status.ore().bit_is_set() || status.fe().bit_is_set() || status.nf().bit_is_set();
        let full = status.rxne().bit_is_set();
        if !full && !error {
            return Received::default();
        }
        let data = self.usart.dr().read().dr().bits();
        Received {
            byte: full.then_some((data & 0xFF) as u8),
            error,
        }
    }
}
