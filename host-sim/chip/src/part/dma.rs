//! DMA2 (RM0090, 10): direct mode, words or less, single or double buffer, circular or not, no interrupts.
//!
//! In direct mode from memory, the next word is read as soon as the last was transferred (10.3.12), so that a word written later is not
//! transferred. Arbitration takes no time: two streams never request the bus within the few cycles of a transfer, which `chip.rs` ensures
//! by the order of events.

use super::gpio::Port;
use crate::{memory::Memory, world::World};

const ENABLE: u32 = 1;
const CIRCULAR: u32 = 1 << 8;
const PERIPHERAL_COUNTS: u32 = 1 << 9;
const MEMORY_COUNTS: u32 = 1 << 10;
const DOUBLE: u32 = 1 << 18;
const SECOND: u32 = 1 << 19;
const INTERRUPTS: u32 = 0x1e;
/// Fields that must not change while a stream is enabled (10.5.5: protected by EN).
const PROTECTED: u32 = 0x0fe7_ffc0 & !SECOND;
const COMPLETE: u32 = 1 << 5;
const FLAGS: u32 = 0x3d;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Stream {
    control: u32,
    left: u32,
    reload: u32,
    peripheral: u32,
    memory: [u32; 2],
    fifo: u32,
    /// The next word to transfer.
    loaded: u32,
}

impl Stream {
    const fn field(&self, low: u32, bits: u32) -> u32 {
        self.control >> low & ((1 << bits) - 1)
    }

    /// Address of the current word.
    fn address(&self) -> u32 {
        let base = self.memory[usize::from(self.control & SECOND != 0)];
        base + 4 * (self.reload - self.left)
    }

    /// Whether it answers requests of this channel in this direction.
    const fn answers(&self, channel: u32, direction: u32) -> bool {
        self.control & ENABLE != 0 && self.field(25, 3) == channel && self.field(6, 2) == direction
    }

    /// The port whose set/reset register is the destination.
    const fn port(&self) -> Option<usize> {
        match self.peripheral.checked_sub(0x4002_0018) {
            Some(offset) if offset % 0x400 == 0 && offset / 0x400 < 9 => Some(offset as usize / 0x400),
            _ => None,
        }
    }
}

/// Destination of a transfer to a peripheral.
pub(crate) struct Write {
    pub(crate) port: usize,
    pub(crate) value: u32,
}

#[derive(Default)]
pub(crate) struct Dma {
    streams: [Stream; 8],
    flags: [u32; 2],
    /// Numbers of transfers to a port and to memory.
    pub(crate) played: u64,
    pub(crate) stored: u64,
}

/// Register and lowest bit of the flags of a stream.
const fn flags_of(stream: usize) -> (usize, u32) {
    (stream / 4, [0, 6, 16, 22][stream % 4])
}

impl Dma {
    fn load(&mut self, number: usize, sram: Memory, world: &mut World) {
        let stream = &mut self.streams[number];
        match sram.word(stream.address()) {
            Some(word) => stream.loaded = word,
            None => {
                world.wrong(format!(
                    "DMA2 stream {number} reads {:#x}, where there is no memory for it",
                    stream.address()
                ));
                stream.control &= !ENABLE;
            }
        }
    }

    fn enable(&mut self, number: usize, sram: Memory, world: &mut World) {
        let (register, low) = flags_of(number);
        if self.flags[register] >> low & FLAGS != 0 {
            world.wrong(format!("DMA2 stream {number} is enabled with its flags set"));
        }
        let stream = &mut self.streams[number];
        stream.reload = stream.left;
        let Stream {
            control,
            memory: [first, second],
            peripheral,
            ..
        } = *stream;
        world.note(format!(
            "DMA2 stream {number} on: channel {}, direction {}, {}{}, priority {}, {} items",
            stream.field(25, 3),
            stream.field(6, 2),
            if control & CIRCULAR != 0 { "circular, " } else { "" },
            if control & DOUBLE != 0 {
                "two buffers"
            } else {
                "one buffer"
            },
            stream.field(16, 2),
            stream.left
        ));
        let expected = [
            (stream.left == 0, "nothing to transfer"),
            (
                (first | second | peripheral) & 3 != 0,
                "an address is not that of a word",
            ),
            (
                stream.field(11, 2) != 2 || stream.field(13, 2) != 2,
                "only words are modelled",
            ),
            (stream.fifo & 4 != 0, "only the direct mode is modelled"),
            (
                control & PERIPHERAL_COUNTS != 0 || control & MEMORY_COUNTS == 0,
                "only an address in memory that counts is modelled",
            ),
            (control & INTERRUPTS != 0, "its interrupts are not modelled"),
            (stream.field(6, 2) > 1, "memory to memory is not modelled"),
        ];
        for (_, why) in expected.iter().filter(|(is, _)| *is) {
            world.wrong(format!("DMA2 stream {number}: {why}"));
        }
        if self.streams[number].field(6, 2) == 1 {
            self.load(number, sram, world);
        }
    }

    /// Executes a peripheral's transfer request. Returns the write, if the destination is not memory.
    #[inline]
    pub(crate) fn request(
        &mut self,
        number: usize,
        channel: u32,
        sram: Memory,
        world: &mut World,
    ) -> Option<Write> {
        let stream = &self.streams[number];
        if stream.control & ENABLE == 0 {
            return None;
        }
        if stream.field(25, 3) != channel {
            world.wrong_once(format!(
                "DMA2 stream {number} is asked by channel {channel}, and set to {}",
                stream.field(25, 3)
            ));
            return None;
        }
        let to_peripheral = stream.field(6, 2) == 1;
        let mut write = None;
        if to_peripheral {
            self.played += 1;
            write = Some(Write {
                port: 0,
                value: stream.loaded,
            });
            match (stream.port(), &mut write) {
                (Some(port), Some(write)) => write.port = port,
                _ => world.wrong_once(format!(
                    "DMA2 stream {number} writes {:#x}: not modelled",
                    stream.peripheral
                )),
            }
        } else {
            self.stored += 1;
            let stored = sram
                .word(stream.peripheral)
                .is_some_and(|word| sram.set_word(stream.address(), word));
            if !stored {
                world.wrong_once(format!(
                    "DMA2 stream {number} copies {:#x} to {:#x}: not modelled",
                    stream.peripheral,
                    stream.address()
                ));
            }
        }
        let stream = &mut self.streams[number];
        stream.left -= 1;
        if stream.left == 0 {
            self.complete(number);
        }
        if to_peripheral && self.streams[number].control & ENABLE != 0 {
            self.load(number, sram, world);
        }
        write
    }

    /// Executes up to `rounds` rounds of requests at once, as long as they change no level of a pin. A round is one request to the stream from memory to a port, then one to
    /// the stream that overwrites the transferred word with the idle word. Ends before the first word that is not idle, and before the end of a buffer. Returns the number of
    /// rounds executed.
    pub(crate) fn pass_idle(
        &mut self,
        [to_port, to_memory]: [usize; 2],
        channel: u32,
        rounds: u64,
        sram: Memory,
        ports: &[Port; 9],
    ) -> u64 {
        let (play, copy) = (&self.streams[to_port], &self.streams[to_memory]);
        if !play.answers(channel, 1) || !copy.answers(channel, 0) {
            return 0;
        }
        let idle = play.loaded;
        let is_at_rest = play.port().is_some_and(|port| ports[port].is_at(idle));
        if !is_at_rest || sram.word(copy.peripheral) != Some(idle) {
            return 0;
        }
        let most = play.left.min(copy.left).saturating_sub(1);
        let most = u32::try_from(rounds).map_or(most, |rounds| rounds.min(most));
        // The word after the last one transferred is loaded.
        let rounds = sram.repeats(play.address() + 4, most, idle).unwrap_or(0);
        if !sram.fill_words(copy.address(), rounds, idle) {
            return 0;
        }
        for number in [to_port, to_memory] {
            self.streams[number].left -= rounds;
        }
        self.played += u64::from(rounds);
        self.stored += u64::from(rounds);
        rounds.into()
    }

    fn complete(&mut self, number: usize) {
        let (register, low) = flags_of(number);
        self.flags[register] |= COMPLETE << low;
        let stream = &mut self.streams[number];
        stream.left = stream.reload;
        if stream.control & DOUBLE != 0 {
            stream.control ^= SECOND;
        } else if stream.control & CIRCULAR == 0 {
            stream.control &= !ENABLE;
        }
    }

    pub(crate) fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 | 0x04 => self.flags[offset as usize / 4],
            0x10..0xd0 => {
                let stream = &self.streams[(offset as usize - 0x10) / 0x18];
                match (offset - 0x10) % 0x18 {
                    0x00 => stream.control,
                    0x04 => stream.left,
                    0x08 => stream.peripheral,
                    0x0c => stream.memory[0],
                    0x10 => stream.memory[1],
                    _ => stream.fifo,
                }
            }
            _ => 0,
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, sram: Memory, world: &mut World) {
        match offset {
            0x08 | 0x0c => self.flags[offset as usize / 4 - 2] &= !value,
            0x10..0xd0 => self.write_stream(
                (offset as usize - 0x10) / 0x18,
                (offset - 0x10) % 0x18,
                value,
                sram,
                world,
            ),
            _ => world.wrong_once(format!("write of DMA2 + {offset:#x}")),
        }
    }

    fn write_stream(&mut self, number: usize, register: u32, value: u32, sram: Memory, world: &mut World) {
        let stream = &mut self.streams[number];
        let runs = stream.control & ENABLE != 0;
        // The inactive buffer may be changed (10.3.10).
        let idle_buffer = if stream.control & SECOND != 0 { 0x0c } else { 0x10 };
        if runs && register != 0 && !(stream.control & DOUBLE != 0 && register == idle_buffer) {
            world.wrong(format!(
                "register {register:#x} of DMA2 stream {number} is written while it runs"
            ));
        }
        match register {
            0x00 => {
                if runs && value & ENABLE != 0 && (stream.control ^ value) & PROTECTED != 0 {
                    world.wrong(format!("DMA2 stream {number} is changed while it runs"));
                }
                stream.control = value;
                if !runs && value & ENABLE != 0 {
                    self.enable(number, sram, world);
                }
            }
            0x04 => stream.left = value & 0xffff,
            0x08 => stream.peripheral = value,
            0x0c => stream.memory[0] = value,
            0x10 => stream.memory[1] = value,
            _ => stream.fifo = value,
        }
    }

    /// Omits addresses in memory, which change with the image.
    pub(crate) fn snapshot(&self) -> Vec<(String, u32)> {
        let mut lines = Vec::new();
        for (number, stream) in self
            .streams
            .iter()
            .enumerate()
            .filter(|(_, stream)| stream.control != 0)
        {
            lines.push((format!("DMA2 S{number}CR without CT"), stream.control & !SECOND));
            lines.push((format!("DMA2 S{number}NDTR at start"), stream.reload));
            lines.push((format!("DMA2 S{number}FCR"), stream.fifo));
            if stream.peripheral >= 0x4000_0000 {
                lines.push((format!("DMA2 S{number}PAR"), stream.peripheral));
            }
        }
        lines
    }
}

/// Applies a transfer to the ports; the port whose level changed.
pub(crate) fn apply(write: &Write, ports: &mut [Port; 9]) -> Option<usize> {
    ports[write.port].set_reset(write.value).then_some(write.port)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::timer::Timer;

    const SRAM: u32 = 0x2000_0000;
    const BUFFER_WORDS: u32 = 50;
    const IDLE: u32 = 0x0007_0000;
    const STREAMS: [usize; 2] = [5, 1];
    const UNTIL: u64 = 40_000;

    /// What plays step pulses: a timer, two streams, a port.
    struct Output {
        timer: Timer,
        dma: Dma,
        sram: Memory,
        ports: [Port; 9],
        world: World,
        changes: Vec<(u64, u32)>,
        idle_rounds: u64,
    }

    impl Output {
        fn new(words: &[u32]) -> Self {
            let mut world = World::new(168e6, false);
            let sram = Memory::new(SRAM, 0x1000, 0);
            for (place, word) in (0..).zip(words) {
                sram.set_word(SRAM + 4 * place, *word);
            }
            let idle = SRAM + 0x800;
            sram.set_word(idle, IDLE);
            let mut dma = Dma::default();
            for (stream, peripheral, direction) in [(5, 0x4002_0018, 1), (1, idle, 0)] {
                let mut set = |register: u32, value: u32| {
                    dma.write(0x10 + 0x18 * stream + register, value, sram, &mut world);
                };
                set(0x04, BUFFER_WORDS);
                set(0x08, peripheral);
                set(0x0c, SRAM);
                set(0x10, SRAM + 4 * BUFFER_WORDS);
                // Channel 6, double buffer, words, an address in memory that counts.
                set(
                    0x00,
                    6 << 25 | DOUBLE | 2 << 13 | 2 << 11 | MEMORY_COUNTS | CIRCULAR | direction << 6 | ENABLE,
                );
            }
            let mut timer = Timer::new("TIM1", 0xffff);
            for (register, value) in [(0x2c, 167), (0x34, 80), (0x0c, 0x300), (0x00, 1)] {
                timer.write(register, value, 1, &mut world);
            }
            assert_eq!(world.complained, 0, "{:?}", world.complaints);
            Self {
                timer,
                dma,
                sram,
                ports: [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|index| Port::new(index, 0, 0)),
                world,
                changes: Vec::new(),
                idle_rounds: 0,
            }
        }

        fn event(&mut self) {
            let at = self.timer.update_at().min(self.timer.compare_at);
            let (stream, asks) = if self.timer.compare_at <= at {
                (STREAMS[1], self.timer.compared())
            } else {
                (STREAMS[0], self.timer.update(at).1)
            };
            assert!(asks);
            let write = self.dma.request(stream, 6, self.sram, &mut self.world);
            if let Some(port) = write.and_then(|write| apply(&write, &mut self.ports)) {
                self.changes
                    .push((at, self.ports[port].read(0x14, &mut self.world)));
            }
        }

        fn play(mut self, at_once: bool) -> Self {
            while self.timer.update_at().min(self.timer.compare_at) <= UNTIL {
                let rounds = if at_once { self.timer.rounds(UNTIL) } else { 0 };
                let rounds = self.dma.pass_idle(STREAMS, 6, rounds, self.sram, &self.ports);
                if rounds > 0 {
                    self.timer.pass(rounds);
                    self.idle_rounds += rounds;
                } else {
                    self.event();
                }
            }
            self
        }
    }

    /// Idle rounds at once leave the streams, the timer, the memory and the port as one after the other does, whatever is in the buffers.
    #[test]
    fn idle_rounds_at_once_are_those_one_by_one() {
        let mut random = fastrand::Rng::with_seed(1);
        for pulses in [0, 1, 2, 5, 30, 100] {
            let mut words = vec![IDLE; 2 * BUFFER_WORDS as usize];
            for _ in 0..pulses {
                words[random.usize(..2 * BUFFER_WORDS as usize)] = random.u32(..8) | random.u32(..8) << 16;
            }
            let [one_by_one, at_once] = [false, true].map(|at_once| Output::new(&words).play(at_once));
            assert!(pulses > 5 || at_once.idle_rounds > 100, "{}", at_once.idle_rounds);
            assert!(pulses == 0 || !at_once.changes.is_empty());
            assert_eq!(one_by_one.changes, at_once.changes);
            assert_eq!(one_by_one.dma.streams, at_once.dma.streams);
            assert_eq!(one_by_one.dma.flags, at_once.dma.flags);
            assert_eq!(one_by_one.dma.played, at_once.dma.played);
            assert_eq!(one_by_one.dma.stored, at_once.dma.stored);
            assert_eq!(one_by_one.timer, at_once.timer);
            let memory = |output: &Output| {
                (0..0x400)
                    .map(|place| output.sram.word(SRAM + 4 * place))
                    .collect::<Vec<_>>()
            };
            assert_eq!(memory(&one_by_one), memory(&at_once));
        }
    }
}
