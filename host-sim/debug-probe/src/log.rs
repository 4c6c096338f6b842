//! The log: defmt frames from the chip's RAM (RTT), or recorded ones, decoded with the image that wrote them.

use std::io::Read;
use std::path::Path;
use std::time::{Duration, Instant};

use defmt_decoder::{DecodeError, Frame, Locations, StreamDecoder, Table};
use probe_rs::Core;
use probe_rs::rtt::Rtt;

use crate::chip::{Reach, chain, compare, connect};
use crate::event::{Event, Line, Problem, Target};
use crate::image::Image;
use crate::tell;

/// Polling interval of an empty log. The buffer holds 512 bytes, about twenty-five lines.
const PAUSE: Duration = Duration::from_millis(10);
/// Time after a reset in which the log must be initialised.
const START: Duration = Duration::from_secs(2);
/// Bytes per read.
const CHUNK: usize = 1024;

/// Decoder of defmt frames.
struct Decoder<'a> {
    stream: Box<dyn StreamDecoder + Send + Sync + 'a>,
    places: &'a Locations,
    can_recover: bool,
}

/// The message table of the image, and the source locations.
fn table(image: &Path) -> Result<(Table, Locations), Problem> {
    let bad = |why: String| Problem::BadImage(why);
    let bytes = std::fs::read(image).map_err(|error| bad(format!("cannot read it: {error}")))?;
    let table = Table::parse(&bytes).map_err(|error| bad(format!("{error:#}")))?;
    let table = table.ok_or_else(|| bad("it has no log messages".to_owned()))?;
    // An image without debug information has no source locations.
    let places = table.get_locations(&bytes).unwrap_or_default();
    Ok((table, places))
}

impl<'a> Decoder<'a> {
    fn new(table: &'a Table, places: &'a Locations) -> Self {
        Self {
            stream: table.new_stream_decoder(),
            places,
            can_recover: table.encoding().can_recover(),
        }
    }

    /// Adds received bytes, and emits each complete line.
    fn take(&mut self, bytes: &[u8]) -> Result<(), Problem> {
        self.stream.received(bytes);
        loop {
            match self.stream.decode() {
                Ok(frame) => tell(&Event::Line(line(&frame, self.places))),
                Err(DecodeError::UnexpectedEof) => return Ok(()),
                Err(DecodeError::Malformed) if self.can_recover => tell(&Event::Lost),
                Err(DecodeError::Malformed) => {
                    return Err(Problem::BadImage("it did not write this log".to_owned()));
                }
            }
        }
    }
}

fn line(frame: &Frame<'_>, places: &Locations) -> Line {
    Line {
        time: frame.display_timestamp().map(|time| time.to_string()),
        level: frame.level().map(|level| level.as_str().to_owned()),
        message: frame.display_message().to_string(),
        place: places
            .get(&frame.index())
            .map(|place| (place.file.display().to_string(), place.line)),
    }
}

/// Decodes a recorded log.
pub(crate) fn decode(image: &Path, mut recorded: impl Read) -> Result<(), Problem> {
    let (table, places) = table(image)?;
    let mut decoder = Decoder::new(&table, &places);
    let mut chunk = [0; CHUNK];
    loop {
        let count = recorded
            .read(&mut chunk)
            .map_err(|error| Problem::Gone(error.to_string()))?;
        if count == 0 {
            return Ok(());
        }
        decoder.take(&chunk[..count])?;
    }
}

/// Follows the log of the running chip, without a reset and without blocking it: lines that do not fit its buffer are lost, which is
/// reported.
pub(crate) fn follow(target: &Target) -> Result<(), Problem> {
    let image = Image::load(&target.image).map_err(Problem::BadImage)?;
    let at = image
        .rtt
        .ok_or_else(|| Problem::BadImage("its log does not go to a debug probe".to_owned()))?;
    let (table, places) = table(&target.image)?;
    let gone = |error: &dyn std::error::Error| Problem::Gone(chain(error));
    let mut session = connect(target, &image, Reach::Running)?;
    let mut core = session.core(0).map_err(|error| gone(&error))?;
    compare(&mut core, &image)?;
    let mut rtt = attach(&mut core, at)?;
    let channel = rtt
        .up_channel(0)
        .ok_or_else(|| Problem::NoLog("its log has no channel".to_owned()))?;
    tell(&Event::Following);
    let mut decoder = Decoder::new(&table, &places);
    let mut chunk = [0; CHUNK];
    loop {
        let count = channel
            .read(&mut core, &mut chunk)
            .map_err(|error| gone(&error))?;
        if count == 0 {
            std::thread::sleep(PAUSE);
        } else {
            decoder.take(&chunk[..count])?;
        }
    }
}

/// Finds the control block of the log at the address in the image; after a reset it may not exist yet.
fn attach(core: &mut Core<'_>, at: u32) -> Result<Rtt, Problem> {
    let begun = Instant::now();
    loop {
        match Rtt::attach_at(core, u64::from(at)) {
            Ok(rtt) => return Ok(rtt),
            Err(error) if begun.elapsed() > START => return Err(Problem::NoLog(chain(&error))),
            Err(_) => std::thread::sleep(PAUSE),
        }
    }
}
