//! The independent watchdog (RM0090, 21): on the LSI, whose frequency is an option. Updates of prescaler and reload take five LSI clocks.

use crate::world::{NEVER, World};

const UNLOCK: u32 = 0x5555;
const FEED: u32 = 0xaaaa;
const START: u32 = 0xcccc;
/// LSI clocks of a register update (21.4.4).
const ARRIVE: f64 = 5.0;

pub(crate) struct Watchdog {
    lsi_hz: f64,
    runs: bool,
    unlocked: bool,
    prescaler: u32,
    reload: u32,
    /// The pending update and its time.
    coming: (u32, u32),
    busy: u32,
    arrives: u64,
    fed_at: u64,
    /// Time of the reset, cycles.
    pub(crate) deadline: u64,
    pub(crate) fed: u64,
    /// Maximum time between two feeds, cycles.
    pub(crate) longest_gap: u64,
}

impl Watchdog {
    pub(crate) const fn new(lsi_hz: f64) -> Self {
        Self {
            lsi_hz,
            runs: false,
            unlocked: false,
            prescaler: 0,
            reload: 0xfff,
            coming: (0, 0xfff),
            busy: 0,
            arrives: NEVER,
            fed_at: 0,
            deadline: NEVER,
            fed: 0,
            longest_gap: 0,
        }
    }

    fn arrive(&mut self, now: u64) {
        if self.busy != 0 && now >= self.arrives {
            self.busy = 0;
            (self.prescaler, self.reload) = self.coming;
        }
    }

    fn feed(&mut self, world: &World) {
        if !self.runs {
            return;
        }
        self.arrive(world.now);
        let seconds = f64::from(4_u32 << self.prescaler.min(6)) * f64::from(self.reload + 1) / self.lsi_hz;
        self.deadline = world.now + world.lasting(seconds);
        if self.fed > 0 {
            self.longest_gap = self.longest_gap.max(world.now - self.fed_at);
        }
        self.fed_at = world.now;
        self.fed += 1;
    }

    pub(crate) fn read(&mut self, offset: u32, world: &World) -> u32 {
        self.arrive(world.now);
        match offset {
            0x04 => self.prescaler,
            0x08 => self.reload,
            0x0c => self.busy,
            _ => 0,
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, world: &mut World) {
        match (offset, value & 0xffff) {
            (0x00, UNLOCK) => self.unlocked = true,
            (0x00, key) => {
                self.unlocked = false;
                if key == START {
                    self.runs = true;
                }
                if key == START || key == FEED {
                    self.feed(world);
                }
            }
            (0x04 | 0x08, _) if !self.unlocked => {
                world.wrong("a register of the IWDG is written while it is locked")
            }
            (0x04 | 0x08, value) => {
                let bit = if offset == 4 { 1 } else { 2 };
                if self.busy & bit != 0 {
                    world.wrong("a register of the IWDG is written while its last value is on its way");
                }
                if offset == 4 {
                    self.coming.0 = value & 7
                } else {
                    self.coming.1 = value & 0xfff
                }
                self.busy |= bit;
                // Without the LSI, which starting it switches on, nothing arrives.
                self.arrives = if self.runs {
                    world.now + world.lasting(ARRIVE / self.lsi_hz)
                } else {
                    NEVER
                };
            }
            _ => world.wrong_once(format!("write of IWDG + {offset:#x}")),
        }
    }

    pub(crate) fn snapshot(&self) -> Vec<(String, u32)> {
        vec![
            ("IWDG PR".to_owned(), self.prescaler),
            ("IWDG RLR".to_owned(), self.reload),
        ]
    }
}
