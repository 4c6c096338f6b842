//! A timer (RM0090, 17.4 and 18.4) that counts upwards without preload: TIM1, TIM2, TIM5.
//!
//! Modelled are the slave mode "trigger" (TIM1 by TIM2's update), the first compare channel, and the DMA requests of update and first
//! compare. Other settings are reported as complaints.

use crate::world::{NEVER, World};

pub(crate) const UPDATE: u32 = 1 << 0;
pub(crate) const COMPARE_1: u32 = 1 << 1;
pub(crate) const TRIGGER: u32 = 1 << 6;
const INTERRUPTS: u32 = 0xff;
const UPDATE_REQUEST: u32 = 1 << 8;
const COMPARE_1_REQUEST: u32 = 1 << 9;

#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Timer {
    name: &'static str,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    pub(crate) dier: u32,
    pub(crate) status: u32,
    prescaler: u32,
    reload: u32,
    compare: u32,
    /// The count at a time, cycles.
    count: u64,
    since: u64,
    /// Cycles of a count.
    step: u64,
    /// The next compare, cycles.
    pub(crate) compare_at: u64,
}

impl Timer {
    pub(crate) const fn new(name: &'static str, reload: u32) -> Self {
        Self {
            name,
            cr1: 0,
            cr2: 0,
            smcr: 0,
            dier: 0,
            status: 0,
            prescaler: 0,
            reload,
            compare: 0,
            count: 0,
            since: 0,
            step: 1,
            compare_at: NEVER,
        }
    }

    pub(crate) const fn is_running(&self) -> bool {
        self.cr1 & 1 != 0
    }

    /// Cycles from update to update.
    pub(crate) const fn period(&self) -> u64 {
        (self.reload as u64 + 1) * self.step
    }

    fn now(&self, world: &World) -> u64 {
        if self.is_running() {
            self.count + (world.now - self.since) / self.step
        } else {
            self.count
        }
    }

    /// When the next update comes.
    pub(crate) const fn update_at(&self) -> u64 {
        if self.is_running() && self.reload != 0 {
            self.since + (self.reload as u64 + 1 - self.count) * self.step
        } else {
            NEVER
        }
    }

    /// Schedules the compare of the present timer period, if it is after `from`.
    fn plan_compare(&mut self, from: u64) {
        self.compare_at = NEVER;
        if self.is_running() && u64::from(self.compare) >= self.count && self.compare <= self.reload {
            let at = self.since + (u64::from(self.compare) - self.count) * self.step;
            if at >= from {
                self.compare_at = at;
            }
        }
    }

    /// An update at this time: whether it raises an interrupt, and requests a transfer.
    pub(crate) fn update(&mut self, at: u64) -> (bool, bool) {
        self.since = at;
        self.count = 0;
        self.compare_at = if self.compare <= self.reload {
            at + u64::from(self.compare) * self.step
        } else {
            NEVER
        };
        // UDIS.
        if self.cr1 & 2 == 0 {
            self.status |= UPDATE;
        }
        (
            self.dier & 1 != 0 && self.status & UPDATE != 0,
            self.dier & UPDATE_REQUEST != 0,
        )
    }

    /// A compare: whether it requests a transfer.
    pub(crate) fn compared(&mut self) -> bool {
        self.compare_at = NEVER;
        self.status |= COMPARE_1;
        self.dier & COMPARE_1_REQUEST != 0
    }

    /// Number of rounds until a time: a round is an update and the compare after it, both with requests. 0 where a compare is due first.
    pub(crate) fn rounds(&self, until: u64) -> u64 {
        const REQUESTS: u32 = UPDATE_REQUEST | COMPARE_1_REQUEST;
        let first = self.update_at();
        let is_regular = self.dier & REQUESTS == REQUESTS && self.compare <= self.reload;
        if !is_regular || first == NEVER || self.compare_at != NEVER {
            return 0;
        }
        let over = first + u64::from(self.compare) * self.step;
        until.checked_sub(over).map_or(0, |left| left / self.period() + 1)
    }

    /// Executes `rounds` rounds, at least one, as [`Self::rounds`] counts them. Returns the time of the last compare.
    pub(crate) fn pass(&mut self, rounds: u64) -> u64 {
        self.update(self.update_at() + (rounds - 1) * self.period());
        let at = self.compare_at;
        self.compared();
        at
    }

    /// Whether its update is the trigger output.
    pub(crate) const fn tells_update(&self) -> bool {
        self.cr2 >> 4 & 7 == 2
    }

    /// Whether it is stopped and waits for the trigger of ITR1.
    pub(crate) const fn waits(&self) -> bool {
        self.smcr & 7 == 6 && self.smcr >> 4 & 7 == 1 && !self.is_running()
    }

    /// Starts on this trigger.
    pub(crate) fn trigger(&mut self, at: u64, world: &mut World) {
        self.since = at;
        self.cr1 |= 1;
        self.status |= TRIGGER;
        self.plan_compare(at + 1);
        world.note(format!(
            "{} started by TIM2's update at cycle {at}: count {}, reload {}, compare {}",
            self.name, self.count, self.reload, self.compare
        ));
    }

    pub(crate) fn read(&self, offset: u32, world: &mut World) -> u32 {
        match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => self.smcr,
            0x0c => self.dier,
            0x10 => self.status,
            0x24 => self.now(world) as u32,
            0x28 => self.prescaler,
            0x2c => self.reload,
            0x34 => self.compare,
            _ => {
                world.wrong_once(format!("read of {} + {offset:#x}: not modelled", self.name));
                0
            }
        }
    }

    /// `clock`: cycles of the timer's clock.
    pub(crate) fn write(&mut self, offset: u32, value: u32, clock: u64, world: &mut World) {
        self.count = self.now(world);
        self.since = if self.is_running() {
            world.now - (world.now - self.since) % self.step
        } else {
            world.now
        };
        self.step = clock;
        match offset {
            0x00 => {
                // Direction, mode, preload, divider: none is modelled.
                if value & !0b111 != 0 {
                    world.wrong(format!("{} CR1 {value:#x}: not modelled", self.name));
                }
                if value & !self.cr1 & 1 != 0 {
                    self.since = world.now;
                }
                self.cr1 = value;
            }
            0x04 => self.cr2 = value,
            0x08 => {
                if value & 7 != 0 && value & 0x77 != 0x16 {
                    world.wrong(format!("{} SMCR {value:#x}: not modelled", self.name));
                }
                self.smcr = value;
            }
            0x0c => {
                if value & INTERRUPTS & !UPDATE != 0 {
                    world.wrong(format!(
                        "{} DIER {value:#x}: interrupts other than the update's are not modelled",
                        self.name
                    ));
                }
                self.dier = value;
            }
            0x10 => self.status &= value,
            0x24 => (self.count, self.since) = (value.into(), world.now),
            0x28 => {
                // It would take effect with the next update.
                if value != 0 {
                    world.wrong(format!("{} PSC {value}: not modelled", self.name));
                }
                self.prescaler = value;
            }
            0x2c => {
                if self.is_running() && self.count > value.into() {
                    world.wrong(format!("{} ARR {value} below its count", self.name));
                }
                self.reload = value;
                if self.is_running() {
                    let ms = self.period() as f64 / world.hclk_hz() * 1e3;
                    world.note(format!("{}: a period of {ms:.6} ms", self.name));
                }
            }
            0x34 => self.compare = value,
            _ => world.wrong_once(format!("write of {} + {offset:#x}: not modelled", self.name)),
        }
        self.plan_compare(world.now);
    }

    pub(crate) fn snapshot(&self) -> Vec<(String, u32)> {
        let named = [
            ("CR1", self.cr1),
            ("CR2", self.cr2),
            ("SMCR", self.smcr),
            ("DIER", self.dier),
            ("PSC", self.prescaler),
            ("ARR", self.reload),
            ("CCR1", self.compare),
        ];
        named
            .map(|(name, value)| (format!("{} {name}", self.name), value))
            .into()
    }
}
