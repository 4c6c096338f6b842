//! The state in which a boot loader that has read a card leaves the chip when it starts the image. The loader itself is not executed.
//!
//! The watchdog is not running: no image could stop it.

use boards::FLASH_BEGIN;

use crate::{
    chip::Chip,
    part::{
        dma::Dma,
        gpio::Port,
        rcc::{AHB1RSTR, APB1RSTR, APB2RSTR},
        timer::Timer,
        usart::Usart,
    },
};

impl Chip {
    /// The state in which a boot loader leaves the peripherals; nothing where the chip starts the image itself.
    pub(crate) fn leave_loader(&mut self) {
        if self.image_begin == FLASH_BEGIN {
            return;
        }
        let at = self.world.now;
        self.rcc.left_by_loader(&mut self.world);
        self.nvic.left_by_loader(FLASH_BEGIN, at);
        let (clock, apb2) = (self.rcc.timer_cycles(1), self.rcc.apb2_cycles());
        let world = &mut self.world;
        // TIM2 counts milliseconds and interrupts: reload, interrupt, start.
        for (offset, value) in [(0x2c, 83_999), (0x0c, 1), (0x00, 1)] {
            self.tim2.write(offset, value, clock, world);
        }
        // USART1 listens at 115 200 baud and interrupts.
        for (offset, value) in [(0x08, 0x2d9), (0x0c, 1 << 13 | 1 << 5 | 1 << 3 | 1 << 2)] {
            self.usart.write(offset, value, apb2, world);
        }
        // The LED is lit, and the heaters' pins of port B are pulled up.
        for (port, offset, value) in [(0, 0x18, 1 << 7), (0, 0x00, 0xa800_4000), (1, 0x0c, 0x5555_5555)] {
            self.ports[port].write(offset, value, &mut self.world);
            let change = self.ports[port].change(at, false);
            self.keep(change);
        }
    }

    /// A write of a register that resets peripherals (RM0090, 7.3.5 to 7.3.9): those of the models.
    pub(crate) fn reset_parts(&mut self, register: usize, bits: u32) {
        let has = |bit: u32| bits >> bit & 1 != 0;
        match register {
            AHB1RSTR => {
                for index in (0..self.ports.len()).filter(|index| has(*index as u32)) {
                    let Port { driven, outside, .. } = self.ports[index];
                    self.ports[index] = Port::new(index as u8, driven, outside);
                    let change = self.ports[index].change(self.world.now, false);
                    self.keep(change);
                }
                if has(22) {
                    self.dma = Dma::default();
                }
            }
            APB1RSTR => {
                if has(0) {
                    self.tim2 = Timer::new("TIM2", u32::MAX);
                }
                if has(3) {
                    self.tim5 = Timer::new("TIM5", u32::MAX);
                }
            }
            APB2RSTR => {
                if has(0) {
                    self.tim1 = Timer::new("TIM1", 0xffff);
                }
                if has(4) {
                    let from_host = std::mem::take(&mut self.usart.from_host);
                    self.usart = Usart::new();
                    self.usart.from_host = from_host;
                }
            }
            _ => {}
        }
    }
}
