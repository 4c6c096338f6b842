//! Interrupt controller and system control (ARMv7-M, B3.2 and B3.4): pending, enabled and active interrupts, and their priorities.

use crate::world::World;

/// Interrupts of the STM32F405/407.
const LINES: usize = 82;
/// Implemented bits of a priority.
const PRIORITY: u32 = 0xf0;
/// Priority of a program that no exception has interrupted.
pub(crate) const THREAD: u32 = 256;

/// Interrupts that the models raise.
pub(crate) const PVD: usize = 1;
pub(crate) const TIM2: usize = 28;
pub(crate) const USART1: usize = 37;
/// Interrupt that the program pends for its planning task; its line of EXTI is not modelled.
pub(crate) const EXTI0: usize = 6;

/// An exception in progress.
#[derive(Clone, Copy, Debug)]
struct Active {
    number: u32,
    priority: u32,
    entered: u64,
}

/// Statistics of an interrupt.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Account {
    pub(crate) count: u64,
    /// Maximum latency from request to first instruction, the same from the first step pulse on, and sum, cycles.
    pub(crate) latency_max: u64,
    pub(crate) latency_moving: u64,
    pub(crate) latency_sum: u64,
    /// Maximum duration, cycles.
    pub(crate) duration_max: u64,
}

pub(crate) struct Nvic {
    pending: u128,
    enabled: u128,
    priorities: [u8; 128],
    raised: [u64; LINES],
    accounts: [Account; LINES],
    /// Whether there was a step pulse.
    pub(crate) moves: bool,
    active: Vec<Active>,
    vtor: u32,
    ccr: u32,
    cpacr: u32,
    group: u32,
    handlers: [u32; 3],
    shcsr: u32,
    scr: u32,
    fpccr: u32,
    /// SysTick's control, and whether it is pending. It does not count.
    systick: u32,
    systick_pends: bool,
    /// `SYSRESETREQ` was written.
    pub(crate) reset_wanted: bool,
}

impl Nvic {
    pub(crate) fn new() -> Self {
        Self {
            pending: 0,
            enabled: 0,
            priorities: [0; 128],
            raised: [0; LINES],
            accounts: [Account::default(); LINES],
            moves: false,
            active: Vec::new(),
            vtor: 0,
            ccr: 0x200,
            cpacr: 0,
            group: 0,
            handlers: [0; 3],
            shcsr: 0,
            scr: 0,
            fpccr: 0xc000_0000,
            systick: 0,
            systick_pends: false,
            reset_wanted: false,
        }
    }

    /// As a boot loader leaves it: SysTick at work, its interrupts enabled, some of them pending, the vectors its own.
    pub(crate) fn left_by_loader(&mut self, table: u32, at: u64) {
        const SDIO: usize = 49;
        self.vtor = table;
        (self.systick, self.systick_pends) = (0b111, true);
        self.enabled = 1 << TIM2 | 1 << USART1 | 1 << SDIO;
        self.raise(TIM2, at);
        self.raise(SDIO, at);
    }

    /// Whether SysTick interrupts.
    pub(crate) const fn has_systick(&self) -> bool {
        self.systick_pends || self.systick & 0b11 == 0b11
    }

    pub(crate) fn raise(&mut self, line: usize, at: u64) {
        if self.pending >> line & 1 == 0 {
            self.pending |= 1 << line;
            self.raised[line] = at;
        }
    }

    /// Whether an interrupt may be due: a fast check.
    #[inline]
    pub(crate) const fn has_pending(&self) -> bool {
        self.pending & self.enabled != 0
    }

    /// The pending and enabled interrupt with precedence, with its priority: the lowest priority value, then the lowest number.
    pub(crate) fn first(&self) -> Option<(usize, u32)> {
        let waiting = self.pending & self.enabled;
        let lines = (0..LINES).filter(|line| waiting >> line & 1 != 0);
        lines
            .map(|line| (line, u32::from(self.priorities[line])))
            .min_by_key(|(line, priority)| (*priority, *line))
    }

    /// Execution priority, without masks.
    pub(crate) fn running(&self) -> u32 {
        self.active.last().map_or(THREAD, |active| active.priority)
    }

    /// Number of active exceptions.
    pub(crate) fn depth(&self) -> usize {
        self.active.len()
    }

    /// Number of the active exception, 0 if none.
    pub(crate) fn number(&self) -> u32 {
        self.active.last().map_or(0, |active| active.number)
    }

    pub(crate) fn enter(&mut self, number: u32, priority: u32, now: u64) {
        self.active.push(Active {
            number,
            priority,
            entered: now,
        });
        if let Some(line) = (number as usize).checked_sub(16) {
            self.pending &= !(1 << line);
            let latency = now.saturating_sub(self.raised[line]);
            let account = &mut self.accounts[line];
            account.count += 1;
            account.latency_sum += latency;
            account.latency_max = account.latency_max.max(latency);
            if self.moves {
                account.latency_moving = account.latency_moving.max(latency);
            }
        }
    }

    /// Ends the active exception; returns its interrupt, if it is one.
    pub(crate) fn leave(&mut self, now: u64) -> Option<usize> {
        let active = self.active.pop()?;
        let line = (active.number as usize).checked_sub(16)?;
        let account = &mut self.accounts[line];
        account.duration_max = account.duration_max.max(now - active.entered);
        Some(line)
    }

    pub(crate) fn account(&self, line: usize) -> Account {
        self.accounts[line]
    }

    /// The vector table.
    pub(crate) const fn table(&self) -> u32 {
        self.vtor
    }

    /// Whether floating-point instructions are allowed.
    pub(crate) const fn has_float(&self) -> bool {
        self.cpacr >> 20 & 0xf == 0xf
    }

    /// A register of the system control space, from 0xe000e000 on.
    pub(crate) fn read(&self, offset: u32, world: &mut World) -> u32 {
        let words = |bits: u128| (bits >> (8 * (offset & 0x7f))) as u32;
        match offset {
            0x010 => self.systick,
            0x100..0x110 | 0x180..0x190 => words(self.enabled),
            0x200..0x210 | 0x280..0x290 => words(self.pending),
            0x400..0x480 => {
                let at = offset as usize - 0x400;
                u32::from_le_bytes([0, 1, 2, 3].map(|byte| self.priorities[(at + byte) & 127]))
            }
            0xd00 => 0x410f_c241,
            0xd04 => self.number() | u32::from(self.has_pending()) << 22,
            0xd08 => self.vtor,
            0xd0c => 0xfa05_0000 | self.group,
            0xd10 => self.scr,
            0xd14 => self.ccr,
            0xd18..0xd24 => self.handlers[(offset as usize - 0xd18) / 4],
            0xd24 => self.shcsr,
            // Fault status is not modelled.
            0xd28..0xd3c => 0,
            0xd88 => self.cpacr,
            // DHCSR: no debugger.
            0xdf0 => 0,
            0xf34 => self.fpccr,
            _ => {
                world.wrong_once(format!("read of 0xe000e000 + {offset:#x}: not modelled"));
                0
            }
        }
    }

    pub(crate) fn write(&mut self, offset: u32, bytes: u32, value: u32, world: &mut World) {
        let bits = u128::from(value) << (8 * (offset & 0x7f)).min(96);
        match offset {
            0x010 => {
                if value & 0b11 == 0b11 {
                    world.wrong("SysTick is switched on: not modelled");
                }
                self.systick = value & 0b111;
            }
            0x100..0x110 => self.enabled |= bits,
            0x180..0x190 => self.enabled &= !bits,
            0x200..0x210 => (0..LINES)
                .filter(|line| bits >> line & 1 != 0)
                .for_each(|line| self.raise(line, world.now)),
            0x280..0x290 => self.pending &= !bits,
            0x400..0x480 => {
                for byte in 0..bytes as usize {
                    self.priorities[(offset as usize - 0x400 + byte) & 127] =
                        (value >> (8 * byte) & PRIORITY) as u8;
                }
            }
            // `PENDSTCLR`; `PENDSVCLR` has nothing to clear.
            0xd04 if value & !(1 << 25 | 1 << 27) == 0 => self.systick_pends &= value >> 25 & 1 == 0,
            0xd08 => self.vtor = value,
            0xd0c if value >> 16 == 0x05fa => {
                self.reset_wanted |= value & 4 != 0;
                self.group = value & 0x700;
            }
            0xd10 => {
                // Sleep on exit, deep sleep, wake by any event.
                if value != 0 {
                    world.wrong(format!("SCR {value:#x}: not modelled"));
                }
                self.scr = value;
            }
            0xd14 => self.ccr = value,
            0xd18..0xd24 => self.handlers[(offset as usize - 0xd18) / 4] = value,
            0xd24 => self.shcsr = value,
            0xd88 => self.cpacr = value,
            0xf34 => self.fpccr = value,
            _ => world.wrong_once(format!("write of 0xe000e000 + {offset:#x}: not modelled")),
        }
    }

    /// Pending and active interrupts, as text.
    pub(crate) fn words(&self) -> String {
        let lines: Vec<_> = (0..LINES).filter(|line| self.pending >> line & 1 != 0).collect();
        let active: Vec<_> = self.active.iter().map(|active| active.number).collect();
        format!("interrupts pending {lines:?}, exceptions in progress {active:?}")
    }

    pub(crate) fn snapshot(&self) -> Vec<(String, u32)> {
        let mut lines = vec![
            ("SCB VTOR".to_owned(), self.vtor),
            ("SCB CPACR".to_owned(), self.cpacr),
        ];
        for line in (0..LINES).filter(|line| self.enabled >> line & 1 != 0) {
            lines.push((
                format!("NVIC interrupt {line} enabled, priority"),
                self.priorities[line].into(),
            ));
        }
        lines
    }
}
