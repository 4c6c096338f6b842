//! Reset and clock control (RM0090, 7), with the flash and supply settings required for a frequency (FLASH_ACR 3.9.1, PWR 5.4).
//!
//! Start-up times are constants: crystal 2 ms, PLL 200 us. A missing crystal never becomes ready.

use crate::world::{NEVER, World};

const HSI_HZ: f64 = 16e6;
const HSE_START_S: f64 = 2e-3;
const PLL_LOCK_S: f64 = 200e-6;

/// Highest frequencies (DS8626, table 14).
const HCLK_MAX_HZ: f64 = 168e6;
const PCLK1_MAX_HZ: f64 = 42e6;
const PCLK2_MAX_HZ: f64 = 84e6;
/// Flash requires one more wait state for each of these beyond the first, at 2.7 to 3.6 V (RM0090, table 10).
const FLASH_HZ: f64 = 30e6;
/// Maximum frequency with the regulator at scale 2 (RM0090, 5.4.1).
const SCALE_2_MAX_HZ: f64 = 144e6;

const CR: usize = 0x00;
const PLLCFGR: usize = 0x04;
const CFGR: usize = 0x08;
pub(crate) const AHB1RSTR: usize = 0x10;
pub(crate) const APB1RSTR: usize = 0x20;
pub(crate) const APB2RSTR: usize = 0x24;
const AHB1ENR: usize = 0x30;
const APB1ENR: usize = 0x40;
const APB2ENR: usize = 0x44;
const CSR: usize = 0x74;

/// Flags of `CSR`.
pub(crate) mod cause {
    pub(crate) const BROWN_OUT: u32 = 1 << 25;
    pub(crate) const PIN: u32 = 1 << 26;
    pub(crate) const POWER_ON: u32 = 1 << 27;
    pub(crate) const SOFTWARE: u32 = 1 << 28;
    pub(crate) const WATCHDOG: u32 = 1 << 29;
}

/// A peripheral's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Gate {
    Ahb1(u8),
    Apb1(u8),
    Apb2(u8),
}

pub(crate) struct Rcc {
    registers: [u32; 0x40],
    hse_hz: f64,
    has_crystal: bool,
    hse_ready: u64,
    pll_ready: u64,
    reset_flags: u32,
    /// `FLASH_ACR`, `PWR_CR`.
    pub(crate) flash_acr: u32,
    pub(crate) pwr_cr: u32,
    dividers: [u32; 3],
    /// Times at which bits of each enable register were last set, and when it was read afterwards.
    enabled: [(u64, u32); 3],
}

impl Rcc {
    /// After a reset with these flags.
    pub(crate) fn new(hse_hz: f64, has_crystal: bool, reset_flags: u32) -> Self {
        let mut registers = [0; 0x40];
        registers[CR / 4] = 0x83;
        registers[PLLCFGR / 4] = 0x2400_3010;
        registers[AHB1ENR / 4] = 0x0010_0000;
        Self {
            registers,
            hse_hz,
            has_crystal,
            hse_ready: NEVER,
            pll_ready: NEVER,
            reset_flags,
            flash_acr: 0,
            pwr_cr: 0x4000,
            dividers: [1; 3],
            enabled: [(0, 0); 3],
        }
    }

    /// As a boot loader leaves it: 168 MHz from the crystal by the PLL, and the clocks of ports, DMA2, TIM2, PWR, USART1 and SDIO on.
    pub(crate) fn left_by_loader(&mut self, world: &mut World) {
        (self.hse_ready, self.pll_ready) = (0, 0);
        (self.flash_acr, self.pwr_cr) = (0x705, 0x4000);
        self.registers[CR / 4] = 0x83 | 1 << 16 | 1 << 24;
        self.registers[PLLCFGR / 4] = 7 << 24 | 1 << 22 | 336 << 6 | 8;
        self.registers[CFGR / 4] = 4 << 13 | 5 << 10 | 2;
        self.registers[AHB1ENR / 4] |= 0x1ff | 1 << 22;
        self.registers[APB1ENR / 4] |= 1 << 28 | 1;
        self.registers[APB2ENR / 4] |= 1 << 11 | 1 << 4;
        self.clocks(world);
    }

    /// Frequency after a reset.
    pub(crate) const RESET_HZ: f64 = HSI_HZ;

    /// HCLK cycles of one clock of the timers on APB1 or APB2 (7.2): twice the bus clock where that is divided.
    pub(crate) const fn timer_cycles(&self, apb: u8) -> u64 {
        let divider = self.dividers[apb as usize];
        if divider == 1 { 1 } else { divider as u64 / 2 }
    }

    /// HCLK cycles of one clock of APB2.
    pub(crate) const fn apb2_cycles(&self) -> u64 {
        self.dividers[2] as u64
    }

    fn enable_register(gate: Gate) -> (usize, u32) {
        match gate {
            Gate::Ahb1(bit) => (0, 1 << bit),
            Gate::Apb1(bit) => (1, 1 << bit),
            Gate::Apb2(bit) => (2, 1 << bit),
        }
    }

    /// Whether a peripheral has its clock, and is not held in reset.
    pub(crate) fn is_on(&self, gate: Gate) -> bool {
        let (index, bit) = Self::enable_register(gate);
        let is_reset = self.registers[[AHB1RSTR, APB1RSTR, APB2RSTR][index] / 4] & bit != 0;
        self.registers[[AHB1ENR, APB1ENR, APB2ENR][index] / 4] & bit != 0 && !is_reset
    }

    /// Whether its clock was enabled at the present time without the required delay (ES0182, 2.1.13).
    pub(crate) fn is_fresh(&self, gate: Gate, now: u64) -> bool {
        let (index, bit) = Self::enable_register(gate);
        let (at, bits) = self.enabled[index];
        // Two cycles of AHB, one and the divider of an APB.
        let wait = if index == 0 {
            2
        } else {
            1 + u64::from(self.dividers[index])
        };
        bits & bit != 0 && now < at + wait
    }

    pub(crate) fn read(&mut self, offset: u32, world: &World) -> u32 {
        let offset = offset as usize;
        if let Some(index) = [AHB1ENR, APB1ENR, APB2ENR]
            .iter()
            .position(|register| *register == offset)
        {
            // The read takes as long as the peripheral needs.
            self.enabled[index].1 = 0;
        }
        let value = self.registers[offset / 4];
        match offset {
            CR => {
                let ready = |on: u32, flag: u32, at: u64| {
                    if value & on != 0 && world.now >= at {
                        flag
                    } else {
                        0
                    }
                };
                value & !(1 << 1 | 1 << 17 | 1 << 25)
                    | ready(1, 1 << 1, 0)
                    | ready(1 << 16, 1 << 17, self.hse_ready)
                    | ready(1 << 24, 1 << 25, self.pll_ready)
            }
            CFGR => value & !0b1100 | (value & 0b11) << 2,
            CSR => value & 1 | (value & 1) << 1 | self.reset_flags,
            _ => value,
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, world: &mut World) {
        let offset = offset as usize;
        let old = self.registers[offset / 4];
        self.registers[offset / 4] = value;
        match offset {
            CR => self.write_control(old, value, world),
            PLLCFGR if self.registers[CR / 4] >> 24 & 1 != 0 => {
                world.wrong("RCC_PLLCFGR written while the PLL runs")
            }
            CFGR => {
                let ready = self.read(CR as u32, world);
                match value & 0b11 {
                    1 if ready >> 17 & 1 == 0 => world.wrong("switched to HSE, which is not ready"),
                    2 if ready >> 25 & 1 == 0 => world.wrong("switched to the PLL, which is not ready"),
                    _ => {}
                }
                self.clocks(world);
            }
            AHB1ENR | APB1ENR | APB2ENR => {
                let index = [AHB1ENR, APB1ENR, APB2ENR]
                    .iter()
                    .position(|register| *register == offset)
                    .unwrap_or(0);
                if value & !old != 0 {
                    self.enabled[index] = (world.now, value & !old);
                }
            }
            CSR => {
                self.registers[CSR / 4] = value & 1;
                if value >> 24 & 1 != 0 {
                    self.reset_flags = 0;
                }
            }
            _ => {}
        }
    }

    fn write_control(&mut self, old: u32, value: u32, world: &mut World) {
        let risen = value & !old;
        if risen & 1 << 16 != 0 {
            let ready = world.now + world.lasting(HSE_START_S);
            self.hse_ready = if self.has_crystal { ready } else { NEVER };
        }
        if risen & 1 << 24 != 0 {
            self.pll_ready = world.now + world.lasting(PLL_LOCK_S);
            let source_is_hse = self.registers[PLLCFGR / 4] >> 22 & 1 != 0;
            if source_is_hse && world.now < self.hse_ready {
                world.wrong("the PLL is switched on before HSE is ready");
            }
        }
    }

    /// Computes the frequencies, and checks their limits.
    fn clocks(&mut self, world: &mut World) {
        let pll = self.registers[PLLCFGR / 4];
        let field = |low: u32, bits: u32| f64::from(pll >> low & ((1 << bits) - 1));
        let source_hz = if pll >> 22 & 1 != 0 { self.hse_hz } else { HSI_HZ };
        let input_hz = source_hz / field(0, 6).max(1.0);
        let vco_hz = input_hz * field(6, 9);
        let pll_hz = vco_hz / ((field(16, 2) + 1.0) * 2.0);
        let cfgr = self.registers[CFGR / 4];
        let (source, sysclk_hz) = match cfgr & 0b11 {
            0 => ("HSI", HSI_HZ),
            1 => ("HSE", self.hse_hz),
            _ => ("PLL", pll_hz),
        };
        let ahb = match cfgr >> 4 & 0xf {
            code @ 8..=11 => 2 << (code - 8),
            // 32 is left out.
            code @ 12.. => 64 << (code - 12),
            _ => 1,
        };
        let apb = |code: u32| if code < 4 { 1 } else { 2 << (code - 4) };
        let dividers = [ahb, apb(cfgr >> 10 & 7), apb(cfgr >> 13 & 7)];
        let hclk_hz = sysclk_hz / f64::from(ahb);
        if (hclk_hz - world.hclk_hz()).abs() < 1.0 && dividers == self.dividers {
            return;
        }
        world.set_hclk(hclk_hz);
        self.dividers = dividers;
        let [pclk1_hz, pclk2_hz] = [1, 2].map(|bus| hclk_hz / f64::from(dividers[bus]));
        let mhz = |hz: f64| hz / 1e6;
        world.note(format!(
            "clocks: {source}, PLL input {} MHz, VCO {} MHz; HCLK {}, PCLK1 {}, PCLK2 {} MHz; flash wait states {}, VOS {}",
            mhz(input_hz),
            mhz(vco_hz),
            mhz(hclk_hz),
            mhz(pclk1_hz),
            mhz(pclk2_hz),
            self.flash_acr & 7,
            self.pwr_cr >> 14 & 1
        ));
        if source == "PLL" && !((0.95e6..=2.1e6).contains(&input_hz) && (100e6..=432e6).contains(&vco_hz)) {
            world.wrong(format!(
                "PLL input {} MHz, VCO {} MHz: outside 0.95 to 2.1 and 100 to 432",
                mhz(input_hz),
                mhz(vco_hz)
            ));
        }
        if hclk_hz > HCLK_MAX_HZ || pclk1_hz > PCLK1_MAX_HZ || pclk2_hz > PCLK2_MAX_HZ {
            world.wrong(format!(
                "a bus is too fast: HCLK {}, PCLK1 {}, PCLK2 {} MHz",
                mhz(hclk_hz),
                mhz(pclk1_hz),
                mhz(pclk2_hz)
            ));
        }
        self.check_supply(world);
    }

    /// Whether flash and regulator are set for the present frequency.
    pub(crate) fn check_supply(&self, world: &mut World) {
        let hclk_hz = world.hclk_hz();
        let wanted = (hclk_hz / FLASH_HZ).ceil() - 1.0;
        if f64::from(self.flash_acr & 7) < wanted {
            world.wrong(format!(
                "{} wait states of the flash at {} MHz, which wants {wanted}",
                self.flash_acr & 7,
                hclk_hz / 1e6
            ));
        }
        if hclk_hz > SCALE_2_MAX_HZ && self.pwr_cr >> 14 & 1 == 0 {
            world.wrong("the regulator is at scale 2 above 144 MHz");
        }
    }

    /// The registers that a program sets, by name.
    pub(crate) fn snapshot(&self) -> Vec<(String, u32)> {
        let named = [
            ("RCC CR", CR),
            ("RCC PLLCFGR", PLLCFGR),
            ("RCC CFGR", CFGR),
            ("RCC AHB1ENR", AHB1ENR),
            ("RCC APB1ENR", APB1ENR),
            ("RCC APB2ENR", APB2ENR),
            ("RCC CSR", CSR),
        ];
        let mut lines: Vec<_> = named
            .map(|(name, at)| (name.to_owned(), self.registers[at / 4]))
            .into();
        lines.push(("FLASH ACR".to_owned(), self.flash_acr));
        lines.push(("PWR CR".to_owned(), self.pwr_cr));
        lines
    }
}
