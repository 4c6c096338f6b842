//! The driver on a model of the chip: registers by address, and the behaviour of TIM1, TIM2 and DMA2 (RM0090).
//! The model uses the register bits of the manual, not the driver's constants.

use super::*;
use interp_core::steps::{StepConfig, Steps};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::vec::Vec;

/// BIGTREETECH SKR Pro V1.2.
const WIRING: Wiring = Wiring {
    step_port: Port::E,
    step: [9, 11, 13],
    direction: [Pin(Port::F, 1), Pin(Port::E, 8), Pin(Port::C, 2)],
};

const REST_WORD: u32 = 0x2a00_0000;
const MEMORY: Memory = Memory {
    buffers: [0x2000_1000, 0x2000_2000],
    rest: 0x2000_3000,
};

/// State of an enabled stream.
#[derive(Clone, Copy, Default)]
struct Stream {
    /// Words of the buffer transferred so far.
    done: u32,
}

/// The chip: registers, memory, and a record of every write.
#[derive(Default)]
struct Chip {
    words: BTreeMap<u32, u32>,
    written: Vec<(u32, u32)>,
    play: Stream,
    wipe: Stream,
    /// The words written to the step pins' port, one per slot.
    port: Vec<u32>,
}

impl Chip {
    fn word(&self, address: u32) -> u32 {
        self.words.get(&address).copied().unwrap_or(0)
    }

    /// One request to a stream of DMA2: RM0090, 10.3.
    fn request(&mut self, base: u32, stream: fn(&mut Self) -> &mut Stream) {
        let control = self.word(base);
        if control & 1 == 0 {
            return;
        }
        let (field, length) = (|low: u32, bits: u32| control >> low & ((1 << bits) - 1), 1000);
        assert_eq!(field(25, 3), 6, "channel");
        assert_eq!((field(11, 2), field(13, 2)), (2, 2), "words");
        assert_eq!(
            (field(9, 1), field(10, 1)),
            (0, 1),
            "only the memory's address counts"
        );
        assert_eq!(field(18, 1), 1, "two buffers");
        assert_eq!(self.word(base + 0x14) & 4, 0, "direct mode");
        let current = field(19, 1);
        let done = stream(self).done;
        let memory = self.word(base + 0xc + 4 * current) + 4 * done;
        let peripheral = self.word(base + 8);
        match field(6, 2) {
            0 => {
                let value = self.word(peripheral);
                self.words.insert(memory, value);
            }
            1 => {
                assert_eq!(peripheral, 0x4002_1018, "the set/reset register of port E");
                let value = self.word(memory);
                self.port.push(value);
            }
            other => panic!("direction {other}"),
        }
        let done = (done + 1) % length;
        stream(self).done = done;
        self.words.insert(base + 4, length - done);
        if done == 0 {
            self.words.insert(base, control ^ 1 << 19);
        }
    }

    /// TIM1's slot: its update goes to stream 5, its first compare to stream 1 (table 43), if the requests are enabled.
    fn slot(&mut self) {
        let requests = self.word(0x4001_000c);
        if requests & 1 << 8 != 0 {
            self.request(0x4002_6488, |chip| &mut chip.play);
        }
        if requests & 1 << 9 != 0 {
            self.request(0x4002_6428, |chip| &mut chip.wipe);
        }
    }
}

/// Register access for the driver.
#[derive(Clone, Default)]
struct Hand(Rc<RefCell<Chip>>);

impl Registers for Hand {
    fn read(&self, address: u32) -> u32 {
        self.0.borrow().word(address)
    }

    fn write(&mut self, address: u32, value: u32) {
        let mut chip = self.0.borrow_mut();
        chip.words.insert(address, value);
        chip.written.push((address, value));
    }
}

/// Chip, driver and step generator connected as in the firmware.
struct Board {
    chip: Hand,
    output: StepOutput<Hand>,
    steps: Steps,
}

impl Board {
    fn new() -> Self {
        let chip = Hand::default();
        for slot in 0..BUFFER_WORDS as u32 {
            for buffer in MEMORY.buffers {
                chip.0.borrow_mut().words.insert(buffer + 4 * slot, REST_WORD);
            }
        }
        chip.0.borrow_mut().words.insert(MEMORY.rest, REST_WORD);
        let output = StepOutput::start(chip.clone(), WIRING, MEMORY, 168);
        let steps = Steps::new(StepConfig::DEFAULT.check().unwrap(), WIRING.step);
        assert_eq!(steps.rest(), REST_WORD);
        Self { chip, output, steps }
    }

    fn slots(&self, count: u32) {
        for _ in 0..count {
            self.chip.0.borrow_mut().slot();
        }
    }

    /// The end of a tick: fills the free buffer.
    fn fill(&mut self, cl_nm: [i32; 3]) -> bool {
        let Some(idle) = self.output.free() else {
            return false;
        };
        let base = MEMORY.buffers[idle];
        let mut slots = [0; BUFFER_WORDS];
        let mut chip = self.chip.0.borrow_mut();
        for (slot, at) in slots.iter_mut().zip((base..).step_by(4)) {
            *slot = chip.word(at);
        }
        self.steps.step(cl_nm, &mut slots).unwrap();
        for (slot, at) in slots.iter().zip((base..).step_by(4)) {
            chip.words.insert(at, *slot);
        }
        true
    }

    /// A period: the interrupt after `late` slots, the tick's end after 90 more.
    fn period(&mut self, late: u32, cl_nm: [i32; 3]) -> Result<(), Failure> {
        self.slots(late);
        let begun = self.output.begin(self.steps.directions());
        self.slots(90);
        assert!(self.fill(cl_nm));
        self.slots(SLOTS - 90 - late);
        begun
    }

    /// Rising edges of each axis so far.
    fn rises(&self) -> [i32; 3] {
        let chip = self.chip.0.borrow();
        WIRING.step.map(|pin| {
            let mut high = false;
            let rises = chip.port.iter().filter(|word| {
                // Set has priority over reset (8.4.7).
                let now = **word >> pin & 1 == 1 || high && **word >> (16 + pin) & 1 == 0;
                let rises = now && !high;
                high = now;
                rises
            });
            rises.count() as i32
        })
    }
}

/// The writes of the set-up, by the addresses and bits of the manual.
#[test]
fn the_set_up_is_that_of_the_manual() {
    let board = Board::new();
    let chip = board.chip.0.borrow();
    let expected = [
        // Stream 5: stopped, flags cleared, 1000 words, GPIOE_BSRR, both buffers, direct; then everything, then the enable bit.
        (0x4002_6488, 0),
        (0x4002_640c, 0x0000_0f40),
        (0x4002_648c, 1000),
        (0x4002_6490, 0x4002_1018),
        (0x4002_6494, 0x2000_1000),
        (0x4002_6498, 0x2000_2000),
        (0x4002_649c, 0),
        (0x4002_6488, 0x0c07_5540),
        (0x4002_6488, 0x0c07_5541),
    ];
    let at = chip
        .written
        .iter()
        .position(|write| *write == expected[0])
        .unwrap();
    assert_eq!(chip.written[at..at + expected.len()], expected);
    // Stream 1: from one word into both buffers.
    let expected = [
        (0x4002_6428, 0),
        (0x4002_6408, 0x0000_0f40),
        (0x4002_642c, 1000),
        (0x4002_6430, 0x2000_3000),
        (0x4002_6434, 0x2000_1000),
        (0x4002_6438, 0x2000_2000),
        (0x4002_643c, 0),
        (0x4002_6428, 0x0c06_5500),
        (0x4002_6428, 0x0c06_5501),
    ];
    let at = chip
        .written
        .iter()
        .position(|write| *write == expected[0])
        .unwrap();
    assert_eq!(chip.written[at..at + expected.len()], expected);
    // TIM1: 168 counts a slot, compare in the middle, a quarter before the end, requests, trigger ITR1; TIM2's update as trigger output. All
    // of it after the streams.
    let expected = [
        (0x4002_3844, 1),
        (0x4001_0000, 0),
        (0x4001_0004, 0),
        (0x4001_002c, 167),
        (0x4001_0034, 84),
        (0x4001_0024, 126),
        (0x4001_0010, 0),
        (0x4001_000c, 0x0300),
        (0x4001_0008, 0x0016),
        (0x4000_0004, 0x0020),
    ];
    assert_eq!(chip.written[chip.written.len() - expected.len()..], expected);
    // The clock of DMA2; pins and their ports are the board's.
    assert_eq!(chip.word(0x4002_3830), 1 << 22);
    assert!(
        chip.written
            .iter()
            .all(|(address, _)| !(0x4002_0000..0x4002_3000).contains(address))
    );
    // Settings of other drivers are preserved.
    let kept = Hand::default();
    kept.0
        .borrow_mut()
        .words
        .extend([(0x4002_3830, 1), (0x4002_1000, 3), (0x4000_0004, 8)]);
    StepOutput::start(kept.clone(), WIRING, MEMORY, 168);
    assert_eq!(kept.read(0x4002_3830) & 1, 1);
    assert_eq!(kept.read(0x4002_1000) & 3, 3);
    assert_eq!(kept.read(0x4000_0004), 0x28);
}

#[test]
fn every_step_comes_to_the_port_once() {
    let mut board = Board::new();
    let mut at = [0_i32; 3];
    let (mut low, mut way) = ([0_i64; 3], 0);
    for period in 0..400_i32 {
        // Forwards, then backwards with a reversal of all axes.
        let speed = [1_000_000, 300_001, 777].map(|most| if period % 100 < 50 { most } else { -most });
        let before = board.steps.position();
        for (at, speed) in at.iter_mut().zip(speed) {
            *at += speed;
        }
        board.period(u32::from(period % 3 == 0), at).unwrap();
        let after = board.steps.position();
        for (low, (before, after)) in low.iter_mut().zip(before.into_iter().zip(after)) {
            *low += i64::from(after.abs_diff(before));
        }
        way += 1;
    }
    assert_eq!(way, 400);
    // The last fill is output in the following period.
    board.period(0, at).unwrap();
    assert_eq!(board.rises().map(i64::from), low);
    // The core's tests check the direction of each pulse; this checks the pins.
    let chip = board.chip.0.borrow();
    let turns = chip
        .written
        .iter()
        .filter(|(address, _)| *address == 0x4002_1418)
        .count();
    assert_eq!(turns, 7, "a turn each 50 periods");
    // Both buffers are cleared except for the next output.
    let pins = REST_WORD >> 16;
    assert!(chip.port.iter().all(|word| (word | word >> 16) & 0xffff == pins));
}

#[test]
fn without_the_processor_no_pulse_comes_twice() {
    let mut board = Board::new();
    for period in 1..10 {
        board.period(0, [period * 500_000, 0, 0]).unwrap();
    }
    let [sent, ..] = board.steps.position();
    // The processor has stopped: the filled buffers are output, and no pulse afterwards.
    board.slots(10 * SLOTS);
    assert_eq!(board.rises(), [sent, 0, 0]);
    let chip = board.chip.0.borrow();
    assert!(
        chip.port[chip.port.len() - 9 * SLOTS as usize..]
            .iter()
            .all(|word| *word == REST_WORD)
    );
}

#[test]
fn a_late_tick_writes_nothing_and_loses_nothing() {
    let mut board = Board::new();
    board.period(0, [100_000, 0, 0]).unwrap();
    // This one ends too near the period's end, and the next after it.
    board.output.begin(board.steps.directions()).unwrap();
    board.slots(SLOTS - WRITE_SLOTS + 1);
    assert!(!board.fill([200_000, 0, 0]));
    board.slots(WRITE_SLOTS - 1);
    board.output.begin(board.steps.directions()).unwrap();
    board.slots(SLOTS + 5);
    assert!(!board.fill([300_000, 0, 0]));
    board.slots(SLOTS - 5);
    board.period(0, [400_000, 0, 0]).unwrap();
    board.period(0, [400_000, 0, 0]).unwrap();
    assert_eq!(board.rises(), [160, 0, 0]);
}

#[test]
fn a_direction_set_too_late_is_told() {
    let mut board = Board::new();
    board.period(0, [-100_000, 0, 0]).unwrap();
    assert_eq!(board.period(TURN_SLOTS, [-200_000, 0, 0]), Ok(()));
    board.period(40, [100_000, 0, 0]).unwrap();
    assert_eq!(
        board.period(TURN_SLOTS + 1, [100_000, 0, 0]),
        Err(Failure::DirectionLate(TURN_SLOTS + 1))
    );
    // A missed period counts as late by one period.
    board.period(0, [-100_000, 0, 0]).unwrap();
    board.slots(SLOTS);
    assert_eq!(
        board.period(2, [-100_000, 0, 0]),
        Err(Failure::DirectionLate(SLOTS + 2))
    );
    let fault = Fault::from(Failure::DirectionLate(17));
    assert_eq!((fault.kind, fault.value), (FaultKind::StepOutput, 17.0));
}

#[test]
fn a_stream_that_stops_is_told() {
    let mut board = Board::new();
    board.period(0, [0; 3]).unwrap();
    let control = board.chip.read(0x4002_6488);
    board.chip.write(0x4002_6488, control & !1);
    assert_eq!(board.output.begin(0), Err(Failure::Stopped));
}

/// As in QEMU, where every register reads as zero: no wait, no fault, and the slots are still computed.
#[test]
fn missing_hardware_holds_nothing_up() {
    struct Nothing;
    impl Registers for Nothing {
        fn read(&self, _: u32) -> u32 {
            0
        }
        fn write(&mut self, _: u32, _: u32) {}
    }
    let mut output = StepOutput::start(Nothing, WIRING, MEMORY, 168);
    assert!(!output.is_present());
    for directions in [0, 7, 0] {
        assert_eq!((output.begin(directions), output.free()), (Ok(()), Some(0)));
    }
}

#[test]
fn a_slot_is_a_whole_number_of_clocks() {
    assert_eq!(slot_counts(168_000_000, 1000), Some(168));
    assert_eq!(slot_counts(168_000_000, 500), Some(84));
    assert_eq!(slot_counts(100_000_000, 1000), Some(100));
    for (timer_hz, period_us) in [(168_000_000, 999), (1_000_000, 1000), (168_000_000, 400_000)] {
        assert_eq!(slot_counts(timer_hz, period_us), None, "{timer_hz} {period_us}");
    }
}
