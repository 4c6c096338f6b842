//! USART1 (RM0090, 30.6): 8 bits, one stop bit, 16 samples a bit; bytes take their transmission time in both directions.
//!
//! A byte received before the last one was read is lost, and `ORE` is set (30.3.3). The line itself causes no errors.

use std::collections::VecDeque;

use crate::world::{NEVER, World};

const OVERRUN: u32 = 1 << 3;
const RECEIVED: u32 = 1 << 5;
const COMPLETE: u32 = 1 << 6;
const EMPTY: u32 = 1 << 7;
const ENABLE: u32 = 1 << 13;
const RECEIVE: u32 = 1 << 2;
const RECEIVE_INTERRUPT: u32 = 1 << 5;
/// `CR1`: interrupts other than the receiver's, parity, nine bits, eight samples.
const NOT_MODELLED: u32 = 1 << 4 | 1 << 6 | 1 << 7 | 1 << 8 | 1 << 9 | 1 << 10 | 1 << 12 | 1 << 15;
/// Bits of a byte on the line.
const BITS: u64 = 10;

/// Cycles in which the interrupt reads the byte that came while the flash worked.
const READ_CYCLES: u64 = 200;

pub(crate) struct Usart {
    status: u32,
    divider: u32,
    control: [u32; 3],
    data: u8,
    waiting: Option<u8>,
    shifting: Option<u8>,
    /// Time at which the byte in the transmitter is sent, cycles.
    pub(crate) sent_at: u64,
    /// Time at which the next byte from the host is complete, cycles.
    pub(crate) received_at: u64,
    /// Bytes of the host still to be received.
    pub(crate) from_host: VecDeque<u8>,
    /// Arrival time of the byte in the data register, cycles.
    arrived: u64,
    pub(crate) sent: u64,
    pub(crate) received: u64,
    /// Bytes lost because the program did not read them in time.
    pub(crate) overruns: u64,
    /// Bytes lost while the flash was busy.
    pub(crate) lost_to_flash: u64,
    /// Bytes received while the port was off.
    pub(crate) unheard: u64,
    /// Maximum time from a byte's arrival to its read, apart from operations of the flash, cycles.
    pub(crate) longest_wait: u64,
}

impl Usart {
    pub(crate) const fn new() -> Self {
        Self {
            status: COMPLETE | EMPTY,
            divider: 0,
            control: [0; 3],
            data: 0,
            waiting: None,
            shifting: None,
            sent_at: NEVER,
            received_at: NEVER,
            from_host: VecDeque::new(),
            arrived: 0,
            sent: 0,
            received: 0,
            overruns: 0,
            lost_to_flash: 0,
            unheard: 0,
            longest_wait: 0,
        }
    }

    /// Cycles of a byte on the line; `apb2`: of a clock of APB2.
    const fn byte_cycles(&self, apb2: u64) -> u64 {
        BITS * self.divider as u64 * apb2
    }

    /// Whether the interrupt is requested.
    pub(crate) const fn interrupts(&self) -> bool {
        self.control[0] & RECEIVE_INTERRUPT != 0 && self.status & (RECEIVED | OVERRUN) != 0
    }

    /// Bytes from the host are on their way, from this time on.
    pub(crate) fn begin(&mut self, at: u64, apb2: u64) {
        if self.received_at == NEVER && !self.from_host.is_empty() {
            // Bytes pass on a line without a rate, too.
            self.received_at = at + self.byte_cycles(apb2).max(1_000);
        }
    }

    /// A byte is complete; `program`: where the program is meanwhile.
    pub(crate) fn receive(&mut self, at: u64, apb2: u64, program: u32, world: &mut World) {
        self.received_at = NEVER;
        let Some(byte) = self.from_host.pop_front() else {
            return;
        };
        self.received += 1;
        if self.control[0] & (ENABLE | RECEIVE) != ENABLE | RECEIVE {
            self.unheard += 1;
        } else if self.status & RECEIVED != 0 {
            self.status |= OVERRUN;
            let [begin, end] = world.flash_busy;
            if (begin..=end + READ_CYCLES).contains(&at) {
                self.lost_to_flash += 1;
            } else {
                self.overruns += 1;
            }
            let end = if byte == 0 { ", a frame's end" } else { "" };
            world.note(format!(
                "USART1: a byte is lost{end}; the program is at {program:#x}"
            ));
        } else {
            self.data = byte;
            self.status |= RECEIVED;
            self.arrived = at;
        }
        self.begin(at, apb2);
    }

    /// The byte in the transmitter has gone; it is handed back.
    pub(crate) fn send(&mut self, at: u64, apb2: u64) -> Option<u8> {
        let byte = self.shifting.take();
        self.sent_at = NEVER;
        if let Some(next) = self.waiting.take() {
            self.shifting = Some(next);
            self.status |= EMPTY;
            self.sent_at = at + self.byte_cycles(apb2);
        } else {
            self.status |= COMPLETE;
        }
        self.sent += u64::from(byte.is_some());
        byte
    }

    pub(crate) fn read(&mut self, offset: u32, world: &mut World) -> u32 {
        match offset {
            0x00 => self.status,
            0x04 => {
                if self.status & RECEIVED != 0 {
                    let [_, flash_end] = world.flash_busy;
                    let waits = world.now.saturating_sub(self.arrived.max(flash_end));
                    self.longest_wait = self.longest_wait.max(waits);
                }
                self.status &= !(RECEIVED | OVERRUN);
                self.data.into()
            }
            0x08 => self.divider,
            0x0c..=0x14 => self.control[(offset as usize - 0x0c) / 4],
            _ => {
                world.wrong_once(format!("read of USART1 + {offset:#x}: not modelled"));
                0
            }
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, apb2: u64, world: &mut World) {
        match offset {
            // Writing 0 clears RXNE and TC.
            0x00 => self.status &= value | !(RECEIVED | COMPLETE),
            0x04 => self.transmit(value as u8, apb2, world),
            0x08 => {
                self.divider = value;
                let baud = world.hclk_hz() / apb2 as f64 / f64::from(value.max(1));
                world.note(format!("USART1: {baud:.0} baud"));
            }
            0x0c => {
                if value & NOT_MODELLED != 0 {
                    world.wrong(format!("USART1 CR1 {value:#x}: not modelled"));
                }
                self.control[0] = value;
            }
            0x10 | 0x14 => {
                if value != 0 {
                    world.wrong(format!("USART1 + {offset:#x} = {value:#x}: not modelled"));
                }
                self.control[(offset as usize - 0x0c) / 4] = value;
            }
            _ => world.wrong_once(format!("write of USART1 + {offset:#x}: not modelled")),
        }
    }

    fn transmit(&mut self, byte: u8, apb2: u64, world: &mut World) {
        self.status &= !COMPLETE;
        if self.shifting.is_none() {
            self.shifting = Some(byte);
            self.sent_at = world.now + self.byte_cycles(apb2);
            self.status |= EMPTY;
        } else {
            if self.waiting.is_some() {
                world.wrong("USART1: a byte is written over one that was not sent yet");
            }
            self.waiting = Some(byte);
            self.status &= !EMPTY;
        }
    }

    pub(crate) fn snapshot(&self) -> Vec<(String, u32)> {
        let [cr1, cr2, cr3] = self.control;
        [("BRR", self.divider), ("CR1", cr1), ("CR2", cr2), ("CR3", cr3)]
            .map(|(name, value)| (format!("USART1 {name}"), value))
            .into()
    }
}
