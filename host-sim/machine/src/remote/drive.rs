//! Loads a job into a board, runs it there, and compares with the result of the core in this process.

use interp_core::{Sample, State};
use protocol::digest::job_digest;
use protocol::message::{CHUNK_WORDS_MAX, Clock, PassDigest, Report, Request, Status, StepSettings, Words};

use super::feed::Feed;
use super::operate::{self, Following, Operator};
use super::session::{Event, LineLosses, RemoteError, Session};
use crate::prepare::Prepared;

/// A pass as computed in this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Expected {
    /// Tick of its first sample.
    pub first_tick: u32,
    /// Number of samples.
    pub samples: u32,
    /// Digest of the run up to the end of the pass.
    pub digest: u64,
}

/// Result of the comparison.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The board's final status.
    pub status: Status,
    /// Number of samples whose digest (or every bit) was compared.
    pub samples: u64,
    /// Index into the expected passes of the first one that differs or is missing; their count for a surplus pass.
    pub first_bad_index: Option<u32>,
    /// An operator changed the run, so that nothing was compared.
    pub commanded: bool,
    /// Events that the line lost.
    pub losses: LineLosses,
}

/// Uploads a job, then the settings of its drives if it gives any; else the board keeps its own. Of a streamed job it uploads as much as the store holds; the rest is sent while
/// the session waits for events of the run. `progress` is called with the number of words transferred.
///
/// # Errors
/// The line breaks, the board refuses the job, or it reports other settings of the drives than the job's.
pub fn upload(
    session: &mut Session,
    job: &Prepared,
    mut progress: impl FnMut(usize),
) -> Result<(), RemoteError> {
    session.set_feed(None);
    session.set_start(job.start);
    let words = u32::try_from(job.words.len()).unwrap_or(u32::MAX);
    let digest = job_digest(&job.words);
    session.command(&Request::JobBegin {
        header: job.header,
        words,
        digest,
    })?;
    if job.header.window > 0 {
        session.set_feed(Some(Feed::new(job, 0)));
        let status = session.status()?;
        while session.feed_board()? {}
        progress(status.stream.room as usize);
    } else {
        let most = usize::from(session.capabilities().description.chunk_words_max).clamp(1, CHUNK_WORDS_MAX);
        let mut offset = 0_u32;
        for chunk in job.words.chunks(most) {
            let words = Words::new(chunk).unwrap_or_default();
            session.command(&Request::JobChunk { offset, words })?;
            offset += u32::try_from(chunk.len()).unwrap_or(0);
            progress(offset as usize);
        }
    }
    session.command(&Request::JobEnd)?;
    let Some(steps) = job.steps.map(StepSettings::from) else {
        return Ok(());
    };
    session.command(&Request::StepConfig(steps))?;
    if session.status()?.steps == steps.digest() {
        Ok(())
    } else {
        Err(RemoteError::OtherSteps)
    }
}

/// Goes on with the words of a streamed job that the board has loaded, or runs, from where it received the last ones in an earlier session.
///
/// # Errors
/// The line breaks.
pub fn resume_upload(session: &mut Session, job: &Prepared) -> Result<(), RemoteError> {
    let received = session.status()?.stream.received;
    session.set_feed((job.header.window > 0).then(|| Feed::new(job, received)));
    session.status()?;
    Ok(())
}

/// Starts the loaded job: in lockstep for a number of periods, or on the board's own clock.
fn start(session: &mut Session, report: Report, lockstep: Option<u32>) -> Result<(), RemoteError> {
    let clock = if lockstep.is_some() {
        Clock::Lockstep
    } else {
        Clock::Free
    };
    session.command(&Request::Clock(clock))?;
    session.command(&Request::Report(report))?;
    match lockstep {
        None => operate::keep_alive(session)?,
        Some(_) => session.set_keep_alive(None),
    }
    session.begin_run()?;
    let start = session.start();
    session.command(&if start.is_first() {
        Request::Start
    } else {
        Request::StartAt(start)
    })?;
    lockstep.map_or(Ok(()), |ticks| session.command(&Request::Run { ticks }))
}

/// The comparison of passes, in order. A pass's digest covers the run up to its end, so one that agrees proves those before it whose events were lost; so
/// does the final digest.
struct PassCheck<'a> {
    expected: &'a [Expected],
    /// Number of the first one.
    first: u32,
    /// The pass after the last one compared.
    next: usize,
    samples: u64,
    first_bad: Option<u32>,
}

impl<'a> PassCheck<'a> {
    const fn new(expected: &'a [Expected], first: u32) -> Self {
        Self {
            expected,
            first,
            next: 0,
            samples: 0,
            first_bad: None,
        }
    }

    fn note_bad(&mut self, pass: usize) {
        let pass = u32::try_from(pass).unwrap_or(u32::MAX);
        self.first_bad.get_or_insert(pass);
    }

    fn samples_of(&self, passes: std::ops::Range<usize>) -> u64 {
        let passes = self.expected.get(passes).unwrap_or(&[]);
        passes.iter().map(|pass| u64::from(pass.samples)).sum()
    }

    fn add(&mut self, pass: &PassDigest) {
        let here = Expected {
            first_tick: pass.first_tick,
            samples: pass.samples,
            digest: pass.digest,
        };
        let number = pass.pass.wrapping_sub(self.first) as usize;
        let agrees = self.expected.get(number) == Some(&here);
        if agrees && number >= self.next {
            self.samples += self.samples_of(self.next..number);
        } else {
            self.note_bad(number.min(self.next));
        }
        self.samples += u64::from(pass.samples);
        self.next = number + 1;
    }

    /// The end of the run.
    fn end(&mut self, status: &Status) {
        let Some(last) = self.expected.last() else {
            return;
        };
        let all = self.samples_of(0..self.expected.len());
        if (status.digest, u64::from(status.samples)) == (last.digest, all) {
            self.samples += self.samples_of(self.next..self.expected.len());
        } else if self.next != self.expected.len() {
            self.note_bad(self.next);
        }
    }
}

/// Runs the loaded job to its end, and compares the digest of every pass. `progress` is called with the number of samples so far. With an
/// operator, on the board's own clock. Lost events do not change the result.
///
/// # Errors
/// The line breaks, or the board refuses to start.
pub fn run_digests(
    session: &mut Session,
    expected: &[Expected],
    lockstep: bool,
    operator: Option<&mut dyn Operator>,
    mut progress: impl FnMut(u64),
) -> Result<Compared, RemoteError> {
    start(session, Report::Digests, lockstep.then_some(u32::MAX))?;
    let mut following = Following::new(session, operator)?;
    let mut passes = PassCheck::new(expected, session.start().pass);
    loop {
        match following.event(session)? {
            Event::Pass(pass) => {
                passes.add(&pass);
                progress(passes.samples);
            }
            Event::Halted(status) => {
                passes.end(&status);
                return Ok(Compared {
                    status,
                    samples: passes.samples,
                    first_bad_index: passes.first_bad.filter(|_| !following.commanded),
                    commanded: following.commanded,
                    losses: session.losses(),
                });
            }
            Event::Sample(_) | Event::Lost(_) => {}
        }
    }
}

/// Runs the loaded job to its end, and passes on every sample that came, in order. Returns the board's final status, and whether an operator changed the run.
///
/// # Errors
/// The line breaks, or the board refuses to start.
pub fn run_samples(
    session: &mut Session,
    lockstep: bool,
    operator: Option<&mut dyn Operator>,
    mut each: impl FnMut(&Sample),
) -> Result<(Status, bool), RemoteError> {
    start(session, Report::Samples, lockstep.then_some(u32::MAX))?;
    let mut following = Following::new(session, operator)?;
    loop {
        match following.event(session)? {
            Event::Sample(sample) => each(&sample),
            Event::Halted(status) => return Ok((status, following.commanded)),
            Event::Pass(_) | Event::Lost(_) => {}
        }
    }
}

/// The board's samples of ticks `from..from + count`, by another run of the loaded job in lockstep. Only for a board
/// without a machine: the axes move.
///
/// # Errors
/// The line breaks, or the board refuses.
pub fn samples_between(session: &mut Session, from: u32, count: u32) -> Result<Vec<Sample>, RemoteError> {
    if !matches!(session.status()?.state, State::Ready | State::Finished) {
        session.command(&Request::Abort)?;
        session.command(&Request::Run { ticks: 1 })?;
        wait_halted(session, &mut Vec::new())?;
    }
    if let Some(job) = session.streamed().cloned() {
        // Its first rows are gone.
        upload(session, &job, |_| {})?;
    }
    let mut samples = Vec::new();
    if from > 0 {
        start(session, Report::Digests, Some(from))?;
        wait_halted(session, &mut samples)?;
        session.command(&Request::Report(Report::Samples))?;
        session.command(&Request::Run { ticks: count })?;
    } else {
        start(session, Report::Samples, Some(count))?;
    }
    wait_halted(session, &mut samples)?;
    samples.retain(|sample| sample.tick >= from);
    Ok(samples)
}

fn wait_halted(session: &mut Session, samples: &mut Vec<Sample>) -> Result<Status, RemoteError> {
    loop {
        match session.event()? {
            Event::Sample(sample) => samples.push(sample),
            Event::Halted(status) => return Ok(status),
            Event::Pass(_) | Event::Lost(_) => {}
        }
    }
}

/// Tick of the first sample that differs in any bit, or is missing on one side.
#[must_use]
pub fn first_difference(here: &[Sample], there: &[Sample]) -> Option<u32> {
    let same = |a: &Sample, b: &Sample| {
        let bits = |s: &Sample| {
            (
                s.tick,
                s.state,
                s.pass,
                s.path,
                s.side,
                s.cc_nm,
                s.cl_nm,
                s.feed_mm_s.to_bits(),
                s.inv_interval_sq.to_bits(),
            )
        };
        bits(a) == bits(b)
    };
    let differing = here
        .iter()
        .zip(there)
        .find(|(a, b)| !same(a, b))
        .map(|(a, _)| a.tick);
    differing.or_else(|| {
        let shorter = here.len().min(there.len());
        here.get(shorter)
            .or_else(|| there.get(shorter))
            .map(|sample| sample.tick)
    })
}
