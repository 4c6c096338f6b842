//! Debug components: DWT's cycle counter, DEMCR, DBGMCU (RM0090, 38.16).

use crate::world::World;

/// `DBGMCU_IDCODE` of an STM32F405/407, revision Y (38.6.1).
const IDCODE: u32 = 0x100f_6413;

#[derive(Default)]
pub(crate) struct Debug {
    dwt_control: u32,
    demcr: u32,
    /// The cycle at which the counter was 0.
    zero: u64,
    mcu: [u32; 3],
}

impl Debug {
    pub(crate) fn read(&self, address: u32, world: &mut World) -> u32 {
        match address {
            0xe000_1000 => 0x4000_0000 | self.dwt_control,
            0xe000_1004 if self.dwt_control & 1 != 0 && self.demcr >> 24 & 1 != 0 => {
                world.now.wrapping_sub(self.zero) as u32
            }
            0xe000_1004 => 0,
            0xe000_edfc => self.demcr,
            0xe004_2000 => IDCODE,
            0xe004_2004..0xe004_2010 => self.mcu[(address as usize - 0xe004_2004) / 4],
            _ => {
                world.wrong_once(format!("read of {address:#x}: not modelled"));
                0
            }
        }
    }

    pub(crate) fn write(&mut self, address: u32, value: u32, world: &mut World) {
        match address {
            0xe000_1000 => {
                if value & !self.dwt_control & 1 != 0 {
                    self.zero = world.now;
                }
                self.dwt_control = value;
            }
            0xe000_1004 => self.zero = world.now.wrapping_sub(value.into()),
            0xe000_edfc => self.demcr = value,
            0xe004_2004..0xe004_2010 => self.mcu[(address as usize - 0xe004_2004) / 4] = value,
            _ => world.wrong_once(format!("write of {address:#x}: not modelled")),
        }
    }

    pub(crate) fn snapshot(&self) -> Vec<(String, u32)> {
        let [control, apb1, apb2] = self.mcu;
        [
            ("DBGMCU CR", control),
            ("DBGMCU APB1_FZ", apb1),
            ("DBGMCU APB2_FZ", apb2),
            ("DWT CTRL", self.dwt_control),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }
}
