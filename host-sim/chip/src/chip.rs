//! The chip without its processor: the peripherals, and the order of their events.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::time::{Duration, Instant};

use boards::{Axis, Board, FLASH_BEGIN, Level};

use crate::{
    SRAM_FILL,
    code::{Block, Code},
    line::Line,
    machine::{self, Machine},
    memory::Memory,
    options::Options,
    part::{
        debug::Debug,
        dma::{self, Dma},
        flash::Flash,
        gpio::{Change, Port},
        nvic::{self, Nvic},
        pwm::Pwm,
        rcc::{Rcc, cause},
        supply::Supply,
        timer::{self, Timer},
        usart::Usart,
        watchdog::Watchdog,
    },
    script::{self, Entry, Event, When},
    world::{NEVER, World},
};

/// DMA2 channel of TIM1's requests (RM0090, table 43).
const TIM1_CHANNEL: u32 = 6;
/// DMA2 stream of TIM1's update request (RM0090, table 43).
const TIM1_UPDATE_STREAM: usize = 5;
/// DMA2 stream of TIM1's compare request (RM0090, table 43).
const TIM1_COMPARE_STREAM: usize = 1;

/// Interval between polls for bytes of the host, seconds: random, so that bytes arrive in any phase of a period.
const LOOK_S: (f64, f64) = (0.1e-3, 0.3e-3);

/// Lag behind real time, seconds, beyond which the pace restarts from the present.
const LAG_S: f64 = 0.05;

/// Longest step pulse, seconds.
const PULSE_MAX_S: f64 = 25e-6;

pub(crate) struct Chip {
    pub(crate) world: World,
    pub(crate) board: &'static Board,
    options: Options,
    pub(crate) code: Code,
    /// The current block and its start address.
    pub(crate) block: Block,
    pub(crate) at: u32,
    pub(crate) sram: Memory,
    /// First address of the image; beyond the begin of flash where a boot loader starts it.
    pub(crate) image_begin: u32,
    pub(crate) rcc: Rcc,
    pub(crate) nvic: Nvic,
    pub(crate) ports: [Port; 9],
    pub(crate) tim1: Timer,
    pub(crate) tim2: Timer,
    pub(crate) tim5: Timer,
    pub(crate) pwm: Pwm,
    pub(crate) dma: Dma,
    pub(crate) usart: Usart,
    pub(crate) watchdog: Watchdog,
    pub(crate) debug: Debug,
    pub(crate) flash: Flash,
    pub(crate) supply: Supply,
    line: Option<Line>,
    /// The machine around the board, and the last levels of the step pins.
    pub(crate) machine: Option<Machine>,
    step_levels: u32,
    /// The step pins that changed last, and when.
    step_edge: (u32, u64),
    /// USART1's interrupt request.
    serial_asks: bool,
    script: Vec<Entry>,
    record: Option<BufWriter<File>>,
    track: Option<BufWriter<File>>,
    random: fastrand::Rng,
    next_look: u64,
    /// Times of the next event, without and with those of TIM1.
    pub(crate) next: u64,
    next_slot: u64,
    /// Time of the last event.
    pub(crate) happened: u64,
    /// The first step pulse, seconds.
    pub(crate) moved: Option<f64>,
    step_port: usize,
    step_pins: u32,
    /// Flags of the pending reset.
    pub(crate) reset: Option<u32>,
    pub(crate) hangs: bool,
    pub(crate) fault: bool,
    pub(crate) over: bool,
    /// Updates of TIM2, and the cycle at which TIM1 was started.
    pub(crate) periods: u64,
    pub(crate) slots_from: Option<u64>,
    /// Bytes that were lost before the last reset.
    pub(crate) overruns: u64,
    pub(crate) lost_to_flash: u64,
    pub(crate) resets: u32,
    wall: Instant,
    wall_offset: f64,
}

impl Chip {
    pub(crate) fn new(
        board: &'static Board,
        options: Options,
        flash: Memory,
        sram: Memory,
        line: Option<Line>,
    ) -> Result<Self, String> {
        let script = options
            .at
            .iter()
            .map(|text| script::entry(text, board))
            .collect::<Result<_, _>>()?;
        let record = options
            .edges
            .as_ref()
            .map(File::create)
            .transpose()
            .map_err(|error| format!("the record: {error}"))?;
        let track = options
            .track
            .as_ref()
            .map(File::create)
            .transpose()
            .map_err(|error| format!("the track: {error}"))?;
        let mut ports = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|index| Port::new(index, 0, 0));
        for input in script::inputs(board) {
            let port = &mut ports[input.pin.port.index()];
            port.driven |= input.pin.bit();
            // Switches are closed: the inactive level.
            if input.active == Level::Low {
                port.outside |= input.pin.bit();
            }
        }
        let steps = Axis::ALL.map(|axis| board.axis(axis).step.pin.bit());
        Ok(Self {
            world: World::new(Rcc::RESET_HZ, options.verbose),
            board,
            code: Code::new(flash),
            block: Block::default(),
            at: 0,
            sram,
            image_begin: FLASH_BEGIN,
            rcc: Rcc::new(
                options.hse_mhz * 1e6,
                !options.no_crystal,
                cause::POWER_ON | cause::PIN | cause::BROWN_OUT,
            ),
            nvic: Nvic::new(),
            ports,
            tim1: Timer::new("TIM1", 0xffff),
            tim2: Timer::new("TIM2", u32::MAX),
            tim5: Timer::new("TIM5", u32::MAX),
            pwm: Pwm::default(),
            dma: Dma::default(),
            usart: Usart::new(),
            watchdog: Watchdog::new(options.lsi_hz),
            debug: Debug::default(),
            flash: Flash::new([options.cut_flash_every, options.cut_erase_every]),
            supply: Supply::GOOD,
            line,
            machine: options.machine.clone(),
            step_levels: 0,
            step_edge: (0, 0),
            serial_asks: false,
            script,
            record: record.map(BufWriter::new),
            track: track.map(BufWriter::new),
            random: fastrand::Rng::with_seed(options.seed),
            next_look: 0,
            next: 0,
            next_slot: NEVER,
            happened: 0,
            moved: None,
            step_port: board.step_port().index(),
            step_pins: steps.iter().fold(0, |bits, bit| bits | bit),
            reset: None,
            hangs: false,
            fault: false,
            over: false,
            periods: 0,
            slots_from: None,
            overruns: 0,
            lost_to_flash: 0,
            resets: 0,
            wall: Instant::now(),
            wall_offset: 0.0,
            options,
        })
    }

    /// A reset: all peripherals as after power-on; memory and external levels are unchanged.
    pub(crate) fn restart(&mut self, flags: u32) {
        self.world.event(self.world.now, "reset");
        self.world.set_hclk(Rcc::RESET_HZ);
        self.overruns += self.usart.overruns;
        self.lost_to_flash += self.usart.lost_to_flash;
        self.resets += 1;
        let from_host = std::mem::take(&mut self.usart.from_host);
        self.rcc = Rcc::new(self.options.hse_mhz * 1e6, !self.options.no_crystal, flags);
        self.nvic = Nvic::new();
        self.nvic.moves = self.moved.is_some();
        (self.tim1, self.tim2, self.tim5) = (
            Timer::new("TIM1", 0xffff),
            Timer::new("TIM2", u32::MAX),
            Timer::new("TIM5", u32::MAX),
        );
        self.pwm = Pwm::default();
        self.dma = Dma::default();
        self.usart = Usart::new();
        self.usart.from_host = from_host;
        self.watchdog = Watchdog::new(self.options.lsi_hz);
        self.debug = Debug::default();
        self.flash.restart();
        if flags & cause::POWER_ON != 0 {
            self.supply = Supply::GOOD;
        } else {
            let Supply {
                drives_off,
                low_at,
                fails_at,
                ..
            } = self.supply;
            self.supply = Supply::GOOD;
            if drives_off {
                self.supply.fall(low_at, fails_at);
            }
        }
        self.flash.fails_at = self.supply.fails_at;
        if flags & cause::POWER_ON != 0 {
            self.sram.fill(SRAM_FILL);
        }
        for index in 0..self.ports.len() {
            let Port { driven, outside, .. } = self.ports[index];
            self.ports[index] = Port::new(index as u8, driven, outside);
            let change = self.ports[index].change(self.world.now, false);
            self.keep(change);
        }
        (self.hangs, self.fault, self.reset, self.serial_asks) = (false, false, None, false);
        self.usart.begin(self.world.now, 1);
        self.leave_loader();
        self.plan();
    }

    /// Writes a change of a port to the record.
    pub(crate) fn keep(&mut self, change: Change) {
        let changed = self.step_levels ^ u32::from(change.levels);
        if usize::from(change.port) == self.step_port {
            if let Some(machine) = self.machine.as_mut().filter(|_| !self.supply.drives_off) {
                let before = machine.pulses();
                machine.follow(self.board, &change, self.step_levels, &self.ports);
                if let Some(track) = self.track.as_mut().filter(|_| machine.pulses() != before) {
                    let [x, y, z] = machine.at_steps().map(i32::to_le_bytes);
                    // A failed write is detected by the reader of the record.
                    let _ = track.write_all(&[&change.at.to_le_bytes()[..], &x, &y, &z].concat());
                }
            }
            self.step_levels = change.levels.into();
        }
        if self.moved.is_none() && usize::from(change.port) == self.step_port {
            self.look_for_pulse(change.at, changed & self.step_pins);
        }
        if let Some(record) = &mut self.record {
            let mut bytes = [0; 16];
            bytes[..8].copy_from_slice(&change.at.to_le_bytes());
            bytes[8] = change.port;
            bytes[9] = change.by_dma.into();
            bytes[10..12].copy_from_slice(&change.levels.to_le_bytes());
            bytes[12..14].copy_from_slice(&change.outputs.to_le_bytes());
            // A failed write is detected by the reader of the record.
            let _ = record.write_all(&bytes);
        }
    }

    /// Finds the first pulse: a step pin that returns to its level within [`PULSE_MAX_S`]. A change of the idle level is no pulse.
    fn look_for_pulse(&mut self, at: u64, pins: u32) {
        if pins == 0 {
            return;
        }
        let (before, since) = std::mem::replace(&mut self.step_edge, (pins, at));
        if before & pins != 0 && at - since <= self.world.lasting(PULSE_MAX_S) {
            self.moved = Some(self.world.seconds(since));
            self.nvic.moves = true;
            self.world.note("the first step pulse");
            self.plan();
        }
    }

    pub(crate) fn finish_record(&mut self) {
        for record in [&mut self.record, &mut self.track].into_iter().flatten() {
            let _ = record.flush();
        }
    }

    fn time_of(&self, when: When) -> u64 {
        match when {
            When::Start(seconds) => self.world.cycles(seconds),
            When::Motion(after) => self.moved.map_or(NEVER, |moved| self.world.cycles(moved + after)),
            When::Pulses(count) => {
                let pulses = self.machine.as_ref().map_or(0, Machine::pulses);
                if pulses >= count { self.world.now } else { NEVER }
            }
        }
    }

    /// Computes the time of the next event.
    pub(crate) fn plan(&mut self) {
        let scripted = self
            .script
            .iter()
            .map(|entry| self.time_of(entry.when))
            .min()
            .unwrap_or(NEVER);
        self.next = [
            self.tim2.update_at(),
            self.tim5.update_at(),
            self.usart.sent_at,
            self.usart.received_at,
            self.watchdog.deadline,
            self.next_look,
            self.supply.low_at,
            self.supply.fails_at,
            scripted,
        ]
        .into_iter()
        .fold(NEVER, u64::min);
        self.plan_slot();
    }

    fn plan_slot(&mut self) {
        self.next_slot = self.tim1.update_at().min(self.tim1.compare_at);
    }

    /// Processes all events up to now.
    #[inline]
    pub(crate) fn catch_up(&mut self) {
        if self.world.now >= self.next.min(self.next_slot) {
            self.catch_up_slowly();
        }
    }

    fn catch_up_slowly(&mut self) {
        loop {
            // At equal times TIM2 precedes TIM1, which it starts.
            self.play(self.world.now.min(self.next.saturating_sub(1)));
            if self.next > self.world.now {
                return;
            }
            self.happen(self.next);
            self.plan();
        }
    }

    /// TIM1's events up to a time, and the transfers that they request.
    fn play(&mut self, until: u64) {
        while self.next_slot <= until {
            if self.pass_slots(until) {
                continue;
            }
            let at = self.next_slot;
            self.happened = at;
            let (stream, asks) = if self.tim1.compare_at <= at {
                (TIM1_COMPARE_STREAM, self.tim1.compared())
            } else {
                (TIM1_UPDATE_STREAM, self.tim1.update(at).1)
            };
            self.plan_slot();
            if !asks {
                continue;
            }
            let write = self.dma.request(stream, TIM1_CHANNEL, self.sram, &mut self.world);
            if let Some(port) = write.and_then(|write| dma::apply(&write, &mut self.ports)) {
                let change = self.ports[port].change(at, true);
                self.keep(change);
            }
        }
    }

    /// Slots in which no pin changes, most of all, are over at once.
    fn pass_slots(&mut self, until: u64) -> bool {
        let rounds = self.tim1.rounds(until);
        if rounds == 0 {
            return false;
        }
        let streams = [TIM1_UPDATE_STREAM, TIM1_COMPARE_STREAM];
        let rounds = self
            .dma
            .pass_idle(streams, TIM1_CHANNEL, rounds, self.sram, &self.ports);
        if rounds > 0 {
            self.happened = self.tim1.pass(rounds);
            self.plan_slot();
        }
        rounds > 0
    }

    fn happen(&mut self, at: u64) {
        self.happened = at;
        let apb2 = self.rcc.apb2_cycles();
        if self.tim2.update_at() == at {
            self.periods += 1;
            if let Some(machine) = &mut self.machine {
                machine.press(self.board, &mut self.ports);
            }
            let (interrupts, _) = self.tim2.update(at);
            if interrupts {
                self.nvic.raise(nvic::TIM2, at);
            }
            if self.tim2.tells_update() && self.tim1.waits() {
                self.tim1.trigger(at, &mut self.world);
                self.slots_from = Some(at);
            }
        } else if self.tim5.update_at() == at {
            self.tim5.update(at);
        } else if self.usart.sent_at == at {
            if let (Some(byte), Some(line)) = (self.usart.send(at, apb2), &self.line) {
                line.write(byte);
            }
        } else if self.usart.received_at == at {
            self.usart.receive(at, apb2, self.at, &mut self.world);
            self.serial_line();
        } else if self.watchdog.deadline == at {
            let (at, words) = (self.at, self.nvic.words());
            self.world
                .note(format!("not fed: the last block was at {at:#x}; {words}"));
            self.world.event(self.happened, "watchdog");
            self.watchdog.deadline = NEVER;
            self.reset = Some(cause::WATCHDOG | cause::PIN);
        } else if self.supply.low_at == at {
            if self.supply.becomes_low(self.rcc.pwr_cr, &mut self.world) {
                self.nvic.raise(nvic::PVD, at);
            }
        } else if self.supply.fails_at == at {
            self.world.event(at, "power cut");
            self.supply.fails_at = NEVER;
            self.reset = Some(cause::POWER_ON | cause::PIN | cause::BROWN_OUT);
        } else if self.next_look == at {
            self.look(at);
        } else if let Some(index) = self
            .script
            .iter()
            .position(|entry| self.time_of(entry.when) == at)
        {
            let entry = self.script.remove(index);
            self.world.event(at, &entry.name);
            self.scripted(entry.what);
        }
    }

    /// Updates USART1's interrupt request: the interrupt is raised on a rising edge.
    pub(crate) fn serial_line(&mut self) {
        let asks = self.usart.interrupts();
        if asks && !self.serial_asks {
            self.nvic.raise(nvic::USART1, self.world.now);
        }
        self.serial_asks = asks;
    }

    /// An interrupt is over; if its cause is still there it is pending again.
    pub(crate) fn returned(&mut self, line: Option<usize>) {
        let asks = match line {
            Some(nvic::USART1) => self.usart.interrupts(),
            Some(nvic::PVD) => self.supply.interrupts(),
            Some(nvic::TIM2) => self.tim2.status & self.tim2.dier & timer::UPDATE != 0,
            _ => false,
        };
        if let Some(line) = line.filter(|_| asks) {
            self.nvic.raise(line, self.world.now);
        }
    }

    fn scripted(&mut self, event: Event) {
        match event {
            Event::Input { role, is_active } => {
                if let Some(machine) = self.machine.as_mut().filter(|_| Machine::presses(role)) {
                    machine.hold(role, is_active);
                } else {
                    machine::set(&self.board.line(role), is_active, &mut self.ports);
                }
            }
            Event::Stall(is_stalled) => {
                if let Some(machine) = &mut self.machine {
                    machine.stall(is_stalled);
                }
            }
            Event::Hang => self.hangs = true,
            Event::Fault => self.fault = true,
            Event::Power { lag_s, holds_s } => {
                let low_at = self.world.now + self.world.lasting(lag_s);
                let fails_at = low_at + self.world.lasting(holds_s);
                self.supply.fall(low_at, fails_at);
                self.flash.fails_at = fails_at;
            }
            Event::BrownOut => self.reset = Some(cause::BROWN_OUT | cause::PIN),
        }
    }

    /// An event by standard input.
    fn typed(&self, line: &str) -> Result<Entry, String> {
        if !line.contains(':') {
            return Ok(Entry {
                name: line.to_owned(),
                when: When::Start(self.world.seconds(self.happened)),
                what: script::event(line, self.board)?,
            });
        }
        let mut entry = script::entry(line, self.board)?;
        if let When::Pulses(count) = &mut entry.when {
            *count += self.machine.as_ref().map_or(0, Machine::pulses);
        }
        Ok(entry)
    }

    /// Polls for bytes of the host, and keeps pace with real time.
    fn look(&mut self, at: u64) {
        let wait = LOOK_S.0 + (LOOK_S.1 - LOOK_S.0) * self.random.f64();
        self.next_look = at + self.world.lasting(wait).max(1);
        if let Some(line) = &self.line {
            line.read(&mut self.usart.from_host);
            self.usart.begin(at, self.rcc.apb2_cycles());
        }
        for line in self.options.typed() {
            match self.typed(&line) {
                Ok(entry) => {
                    self.script.push(entry);
                    self.plan();
                }
                Err(why) => self.world.wrong(why),
            }
        }
        let seconds = self.world.seconds(at);
        self.over |= self.options.is_over() || self.options.ms.is_some_and(|ms| seconds * 1e3 >= ms);
        if !self.options.fast {
            let ahead = seconds - self.wall_offset - self.wall.elapsed().as_secs_f64();
            if ahead > 1e-3 {
                std::thread::sleep(Duration::from_secs_f64(ahead));
            } else if ahead < -LAG_S {
                self.wall_offset += ahead;
            }
        }
    }
}
