//! The link half: bytes from the host in, answers and events out.
//!
//! Runs below the sample timer's priority. One call takes one byte; the byte that ends a frame is answered before the
//! call returns, by one frame. `JobEnd` takes longest: one [`Machine::load_check`] per record of the job.

use heapless::Vec;
use protocol::{
    frame::{DELIMITER, Decoder, FrameError},
    message::{Batch, NO_NUMBER, PassDigest, Reason, Reply, SampleRecord, Status},
};

use interp_core::sample::Sample;

use crate::{
    machine::{Event, Machine},
    session::{Session, send},
};

/// The link half of the board: one session with one host at a time.
#[derive(Debug)]
pub struct Link {
    decoder: Decoder,
    session: Session,
    batch: Batch,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

impl Link {
    /// A link without a session.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            decoder: Decoder::new(),
            session: Session::new(),
            batch: Vec::new(),
        }
    }

    /// Puts the profile that the board keeps in force. To be called once, before the first byte.
    #[inline(never)]
    pub fn power_up(&mut self, machine: &mut impl Machine) {
        // Nothing is under way yet, which alone could refuse it.
        let _ = self.session.enforce_profile(machine);
    }

    /// Takes one byte from the host; `out` receives the bytes of the answer, if the byte ends a frame.
    #[inline(never)]
    pub fn receive(&mut self, byte: u8, machine: &mut impl Machine, out: &mut impl FnMut(&[u8])) {
        match self.decoder.push(byte) {
            None => {}
            Some(Ok(frame)) => {
                // Earlier events are sent before the answer.
                flush(&mut self.batch, &mut self.session, out);
                if self.session.frame(frame, machine, out) {
                    machine.heard();
                }
            }
            Some(Err(error)) => self.damaged(error, out),
        }
    }

    /// Reports a frame lost before it reached the link (by a receiver overrun, for instance).
    #[inline(never)]
    pub fn damaged(&mut self, error: FrameError, out: &mut impl FnMut(&[u8])) {
        self.session.count_bad_frame();
        out(&[DELIMITER]);
        send(
            &Reply::Nak {
                number: NO_NUMBER,
                reason: Reason::BadFrame { error },
            },
            out,
        );
    }

    /// Whether a session with a host of this version is open. Without a session, events are dropped.
    #[must_use]
    pub const fn is_open(&self) -> bool {
        self.session.is_open()
    }

    /// Writes an event. Samples are collected until a frame is full; every other event sends them first.
    #[inline(never)]
    pub fn event(&mut self, event: &Event, out: &mut impl FnMut(&[u8])) {
        match event {
            Event::Sample(sample) => self.sample(sample, out),
            Event::Pass(pass) => {
                self.session.note_pass(pass);
                self.pass(pass, out);
            }
            Event::Room(room) => self.room(*room, out),
            Event::Halted(status) => {
                self.session.note_halt(status);
                self.halted(status, out);
            }
        }
    }

    /// Writes the records of the journal that are due, and looks at the start button. To be called once a period or more often; `now`: periods since power-up.
    pub fn keep_journal(&mut self, now: u32, machine: &mut impl Machine) {
        self.session.keep_journal(now, machine);
        self.session.watch_button(now, machine);
    }

    /// Adds a sample, and writes the frame once it is full.
    #[inline(never)]
    pub fn sample(&mut self, sample: &Sample, out: &mut impl FnMut(&[u8])) {
        if !self.is_open() {
            return;
        }
        // Always fits, because a full batch is flushed immediately.
        let _ = self.batch.push(SampleRecord(*sample));
        if self.batch.is_full() {
            self.flush(out);
        }
    }

    /// Writes the samples collected so far, as an answer and every other event do.
    pub fn flush(&mut self, out: &mut impl FnMut(&[u8])) {
        flush(&mut self.batch, &mut self.session, out);
    }

    /// Writes the end of a pass.
    pub fn pass(&mut self, pass: &PassDigest, out: &mut impl FnMut(&[u8])) {
        self.flush(out);
        let pass = *pass;
        self.session.event(|event| Reply::PassDigest { event, pass }, out);
    }

    /// Writes that there is room for words of a streamed job.
    pub fn room(&mut self, room: u32, out: &mut impl FnMut(&[u8])) {
        self.flush(out);
        self.session.event(|event| Reply::Room { event, room }, out);
    }

    /// Writes the end of a run, or that its ticks are used up.
    pub fn halted(&mut self, status: &Status, out: &mut impl FnMut(&[u8])) {
        self.flush(out);
        self.session.halted(status, out);
    }
}

/// Writes the samples collected so far, if there are any. Not a method, because a frame of the decoder is borrowed where it is called.
#[inline(never)]
fn flush(batch: &mut Batch, session: &mut Session, out: &mut impl FnMut(&[u8])) {
    if !batch.is_empty() {
        let samples = core::mem::take(batch);
        session.event(|event| Reply::Samples { event, samples }, out);
    }
}
