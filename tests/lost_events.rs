//! Runs over a line that loses events: whichever it loses, a good run is found to be good, and a bad one is not.
//!
//! The loss is put between the host's session and the board, in this process (`local`) or in QEMU (`in_qemu`).

mod in_qemu;
mod local;

use std::collections::{BTreeMap, VecDeque};
use std::io::{self, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use inspect::TimedRun;
use inspect::comparison::{self, BoardRun, Reference};
use interp_core::Sample;
use job::Job;
use machine::Machine;
use machine::prepare::{Prepared, prepare};
use machine::remote::Session;
use machine::remote::session::Stream;
use protocol::frame::{DELIMITER, Decoder};
use protocol::message::{Reply, read_reply};

/// Whether the line loses an event: its number, and how often it was sent before.
type Loses = Box<dyn FnMut(u32, u32) -> bool + Send>;

/// Damage of single bytes, both ways, once it is switched on: one bit of about one byte in this number.
struct Noise {
    is_on: Arc<AtomicBool>,
    one_in: u64,
    /// State of a linear congruential generator.
    random: u64,
}

impl Noise {
    fn damage(&mut self, bytes: &mut [u8]) {
        for byte in bytes {
            self.random = self
                .random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let high = self.random >> 33;
            if self.is_on.load(Ordering::Relaxed) && high.is_multiple_of(self.one_in) {
                *byte ^= 1 << (self.random >> 20 & 7);
            }
        }
    }
}

/// A line that loses events of the board whole, and may damage bytes of any frame.
struct Lossy {
    inner: Box<dyn Stream>,
    loses: Loses,
    decoder: Decoder,
    frame: Vec<u8>,
    ready: VecDeque<u8>,
    /// How often each event was sent.
    sent: BTreeMap<u32, u32>,
    noise: Option<Noise>,
}

impl Lossy {
    fn new(inner: Box<dyn Stream>, loses: Loses) -> Self {
        Self {
            inner,
            loses,
            decoder: Decoder::new(),
            frame: Vec::new(),
            ready: VecDeque::new(),
            sent: BTreeMap::new(),
            noise: None,
        }
    }

    fn with_noise(inner: Box<dyn Stream>, noise: Noise) -> Self {
        Self {
            noise: Some(noise),
            ..Self::new(inner, Box::new(|_, _| false))
        }
    }

    fn push(&mut self, byte: u8) {
        self.frame.push(byte);
        let decoded = self.decoder.push(byte);
        if byte != DELIMITER {
            return;
        }
        let frame = std::mem::take(&mut self.frame);
        let reply = decoded.map(|frame| read_reply(frame.unwrap().payload).unwrap());
        let event = match reply {
            Some(Reply::Samples { event, .. } | Reply::PassDigest { event, .. }) => Some(event),
            Some(Reply::Halted(status)) => Some(status.events),
            _ => None,
        };
        let is_lost = event.is_some_and(|event| {
            let before = self.sent.entry(event).or_default();
            *before += 1;
            (self.loses)(event, *before - 1)
        });
        if !is_lost {
            self.ready.extend(frame);
        }
    }
}

impl Stream for Lossy {
    fn is_process(&self) -> bool {
        self.inner.is_process()
    }
}

impl Read for Lossy {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut buffer = [0; 4096];
        let count = self.inner.read(&mut buffer)?;
        buffer[..count].iter().for_each(|byte| self.push(*byte));
        if self.ready.is_empty() {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        let count = self.ready.read(bytes)?;
        if let Some(noise) = &mut self.noise {
            noise.damage(&mut bytes[..count]);
        }
        Ok(count)
    }
}

impl Write for Lossy {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut bytes = bytes.to_vec();
        if let Some(noise) = &mut self.noise {
            noise.damage(&mut bytes);
        }
        self.inner.write_all(&bytes)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// A dome of 80 mm x 60 mm in about ten coarse passes, some 900 samples.
const DOME: &str = r#"
[surface]
kind = "bicubic"
coefficients_mm = [
    [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 80], [0, 0, 0, -40]],
    [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 60, -30]],
    [[0, 0, 0, 0], [0, 0, 0, -64], [0, 0, 0, 64], [0, -36, 36, -5]],
]
u = [0, 1]
v = [0, 1]
[tool]
kind = "ball"
radius_mm = 5
[cut]
feed_mm_min = 60000
scallop_mm = 1
along = "u"
side = "up"
pattern = "zigzag"
"#;

fn dome() -> Bench {
    Bench::of(job_file::parse("dome.toml", DOME).unwrap())
}

/// The dome with limits, so that the board plans, links passes and slows down.
fn dome_with_limits() -> Bench {
    let limits = "[machine]\nvelocity_max_mm_s = [200, 200, 200]\n";
    let text = DOME.replace("60000", "6000") + limits;
    Bench::of(job_file::parse("dome.toml", &text).unwrap())
}

/// A job with the core's run of it.
struct Bench {
    job: Job,
    prepared: Prepared,
    run: TimedRun,
}

impl Bench {
    fn of(job: Job) -> Self {
        let prepared = prepare(&job).unwrap();
        let run = inspect::time_run(&job, &prepared, &()).unwrap();
        Self { job, prepared, run }
    }

    fn reference(&self) -> Reference<'_> {
        Reference {
            job: &self.job,
            prepared: &self.prepared,
            run: &self.run,
        }
    }

    /// Compares pass by pass. `lockstep`: the board's time waits for the host.
    fn by_digest(&self, session: &mut Session, lockstep: bool) -> BoardRun {
        comparison::by_digest(&self.reference(), session, lockstep, None, |_| {}).unwrap()
    }

    /// Compares sample by sample. Returns the samples of the trace, too.
    fn by_sample(&self, session: &mut Session, lockstep: bool) -> (BoardRun, Vec<Sample>) {
        let mut trace = Vec::new();
        let each = |sample: &Sample| trace.push(*sample);
        let run = comparison::by_sample(&self.reference(), session, lockstep, None, |_| {}, each).unwrap();
        (run, trace)
    }

    /// Every sample as the core makes it in this process.
    fn samples(&self) -> Vec<Sample> {
        let mut samples = Vec::new();
        let each = |sample: &Sample| {
            samples.push(*sample);
            true
        };
        Machine::load(&self.prepared).unwrap().run(each).unwrap();
        samples
    }

    /// The board's run is the core's.
    fn assert_same(&self, run: &BoardRun, what: &str) {
        assert_eq!(run.failure(&self.run, &self.job), None, "{what}: {run:?}");
        assert_eq!(run.first_difference, None, "{what}");
        assert!(!run.commanded && run.is_complete(), "{what}");
        assert_eq!(run.status.digest, self.run.digest, "{what}");
    }
}
