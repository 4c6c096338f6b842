//! TIM12 as a pulse-width output on channel 2 (RM0090, 19.4): its registers and its duty cycle; edges are not made.

use crate::world::World;

/// Registers that are modelled: CR1, EGR, CCMR1, CCER, PSC, ARR, CCR2.
const REGISTERS: [(u32, &str); 7] = [
    (0x00, "CR1"),
    (0x14, "EGR"),
    (0x18, "CCMR1"),
    (0x20, "CCER"),
    (0x28, "PSC"),
    (0x2c, "ARR"),
    (0x38, "CCR2"),
];

#[derive(Clone, Debug, Default)]
pub(crate) struct Pwm {
    values: [u32; REGISTERS.len()],
    /// The greatest duty cycle so far.
    pub(crate) most: f64,
}

impl Pwm {
    fn index(offset: u32) -> Option<usize> {
        REGISTERS.iter().position(|(register, _)| *register == offset)
    }

    pub(crate) fn read(&self, offset: u32, world: &mut World) -> u32 {
        Self::index(offset).map_or_else(
            || {
                world.wrong_once(format!("read of TIM12 + {offset:#x}: not modelled"));
                0
            },
            |index| self.values[index],
        )
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, world: &mut World) {
        match Self::index(offset) {
            // An update by software clears itself.
            Some(1) => {}
            Some(index) => self.values[index] = value,
            None => world.wrong_once(format!("write of TIM12 + {offset:#x}: not modelled")),
        }
        self.most = self.most.max(self.duty());
    }

    /// The duty cycle of channel 2, 0 where it puts nothing out.
    pub(crate) fn duty(&self) -> f64 {
        let [control, _, mode, enable, _, reload, compare] = self.values;
        let is_on = control & 1 != 0 && mode >> 12 & 0b111 == 0b110 && enable & 1 << 4 != 0;
        if is_on {
            f64::from(compare) / (f64::from(reload) + 1.0)
        } else {
            0.0
        }
    }
}
