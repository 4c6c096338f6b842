//! The link half: bytes from the host in, answers and events out.
//!
//! Runs outside the sample timer's priority. One call takes one byte; the byte that ends a frame is answered before the
//! call returns, by one frame. `JobEnd` is the longest: one [`Machine::load_check`] a record of the job.

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

    /// Takes one byte from the host; `out` gets the bytes of the answer, if that ends a frame.
    pub fn receive(&mut self, byte: u8, machine: &mut impl Machine, out: &mut impl FnMut(&[u8])) {
        match self.decoder.push(byte) {
            None => {}
            Some(Ok(frame)) => {
                // What happened before the answer stands before it.
                if !self.batch.is_empty() {
                    send(&Reply::Samples(core::mem::take(&mut self.batch)), out);
                }
                self.session.frame(frame, machine, out);
                if self.is_open() {
                    machine.heard();
                }
            }
            Some(Err(error)) => self.damaged(error, out),
        }
    }

    /// A frame was lost on the line before it came here (the receiver overran, for instance).
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

    /// Whether a host of this version has said `Hello`. Events are dropped before.
    #[must_use]
    pub const fn is_open(&self) -> bool {
        self.session.is_open()
    }

    /// Writes an event. Samples are gathered to fill a frame; everything else sends those first.
    pub fn event(&mut self, event: &Event, out: &mut impl FnMut(&[u8])) {
        match event {
            Event::Sample(sample) => self.sample(sample, out),
            Event::Pass(pass) => self.pass(pass, out),
            Event::Halted(status) => self.halted(status, out),
        }
    }

    /// Writes a sample, as soon as a frame is full of them.
    pub fn sample(&mut self, sample: &Sample, out: &mut impl FnMut(&[u8])) {
        if !self.is_open() {
            return;
        }
        // It fits: a full batch is flushed at once.
        let _ = self.batch.push(SampleRecord(*sample));
        if self.batch.is_full() {
            self.flush(out);
        }
    }

    /// Writes the samples gathered so far; an answer and every other event do so too.
    pub fn flush(&mut self, out: &mut impl FnMut(&[u8])) {
        if !self.batch.is_empty() {
            send(&Reply::Samples(core::mem::take(&mut self.batch)), out);
        }
    }

    /// Writes that a pass is over.
    pub fn pass(&mut self, pass: &PassDigest, out: &mut impl FnMut(&[u8])) {
        self.flush(out);
        if self.is_open() {
            send(&Reply::PassDigest(*pass), out);
        }
    }

    /// Writes that a run is over, or its ticks are used up.
    pub fn halted(&mut self, status: &Status, out: &mut impl FnMut(&[u8])) {
        self.flush(out);
        if self.is_open() {
            send(&Reply::Halted(self.session.complete(*status)), out);
        }
    }
}
