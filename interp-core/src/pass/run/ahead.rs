//! The move of the next tick, made in the planning of the period before where it takes more than a step of the series within a piece: a long step, or one into the
//! next piece. The tick then evaluates the surface once. A tick that moves by another arc takes the move back.

use super::Run;
use super::travel::{FirstSample, Next};
use crate::fault::{Fault, Result};
use crate::job::program::Job;
use crate::pass::contact;
use crate::pass::route::Piece;

/// What is prepared of the next sample: of the first one of a pass, or of one along it.
#[derive(Clone, Copy, Debug)]
pub(super) enum Prepared {
    Nothing,
    /// The first sample of the pass that is prepared, or that has just begun.
    First(FirstSample),
    /// The move along the pass.
    Move(Ahead),
    /// Its fault, by this part of a period's arc.
    Fault(f32, Fault),
}

/// A move that was made ahead.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead {
    /// Its part of a period's arc.
    feed_factor: f32,
    /// Where the tool is, and the logarithmic speed derivative there.
    fraction: u64,
    piece: Piece,
    log_speed_derivative: f32,
}

impl Run {
    /// Whether [`Self::move_ahead`] is to be called, of a job without axis limits: on a front, where a sample takes longest.
    pub(super) const fn may_move_ahead(&self) -> bool {
        self.is_along() && self.travel.route.front.is_some() && !self.is_ahead()
    }

    pub(super) const fn is_ahead(&self) -> bool {
        matches!(self.prepared, Prepared::Move(_) | Prepared::Fault(..))
    }

    /// Makes the move of the next tick by this part of a period's arc, if that is worth it. The tick reports its fault; the end of a pass is left for it.
    #[inline(never)]
    pub(crate) fn move_ahead(&mut self, job: &Job<'_>, feed_factor: f32) {
        if self.is_ahead() || !self.is_along() || self.buffer.patch().point {
            return;
        }
        let travel = &self.travel;
        let arc = feed_factor * self.buffer.patch().arc;
        let step = contact::step(&travel.path, self.derivative_before(job, feed_factor), arc);
        if step.and_then(|step| travel.beyond(step)).is_some() {
            return;
        }
        self.prepared = Prepared::Move(Ahead {
            feed_factor,
            fraction: travel.fraction,
            piece: travel.piece,
            log_speed_derivative: travel.path.log_speed_derivative,
        });
        let moved = self.move_far(job, step, feed_factor);
        if moved.is_ok() && self.is_along() {
            return;
        }
        let taken_back = self.take_back(job);
        // A straight pass crosses one boundary in a tick: there the tick finds the fault, and where it is.
        if self.travel.route.is_on_front()
            && let Err(fault) = moved.and(taken_back)
        {
            self.prepared = Prepared::Fault(feed_factor, fault);
        }
    }

    /// Moves by a step of the series into the next piece, or by quadrature.
    fn move_far(&mut self, job: &Job<'_>, step: Option<u64>, feed_factor: f32) -> Result<()> {
        if let Some(step) = step
            && self.moves(job, step)?
        {
            return Ok(());
        }
        self.step_far(job, feed_factor)
    }

    /// Whether the move by this part of a period's arc was made ahead; one by another is taken back.
    ///
    /// # Errors
    /// As [`Self::take_back`].
    #[inline(always)]
    pub(super) fn has_moved(&mut self, job: &Job<'_>, feed_factor: f32) -> Result<bool> {
        match &self.prepared {
            Prepared::Move(ahead) if ahead.feed_factor.to_bits() == feed_factor.to_bits() => {
                self.prepared = Prepared::Nothing;
                Ok(true)
            }
            Prepared::Move(_) => self.take_back(job).map(|()| false),
            Prepared::Fault(of, fault) if of.to_bits() == feed_factor.to_bits() => Err(*fault),
            Prepared::Fault(..) => {
                self.prepared = Prepared::Nothing;
                Ok(false)
            }
            Prepared::Nothing | Prepared::First(_) => Ok(false),
        }
    }

    /// Takes back a move that was made ahead.
    ///
    /// # Errors
    /// Those of [`crate::pass::patch::Patch::lay`].
    #[cold]
    #[inline(never)]
    pub(super) fn take_back(&mut self, job: &Job<'_>) -> Result<()> {
        let Self {
            travel,
            buffer,
            prepared,
            ..
        } = self;
        let Prepared::Move(ahead) = prepared else {
            return Ok(());
        };
        travel.next = Next::Along;
        travel.fraction = ahead.fraction;
        travel.path.log_speed_derivative = ahead.log_speed_derivative;
        let is_across = !travel.piece.is_same(&ahead.piece);
        travel.piece = ahead.piece;
        self.prepared = Prepared::Nothing;
        if is_across {
            buffer.go_back(job, &travel.route, &travel.piece)?;
        }
        Ok(())
    }

    /// The first sample of the pass that has begun, where it is evaluated.
    pub(super) const fn take_first(&mut self) -> Option<FirstSample> {
        match core::mem::replace(&mut self.prepared, Prepared::Nothing) {
            Prepared::First(first) => Some(first),
            _ => None,
        }
    }

    /// Evaluates the first sample of the pass that is prepared. A fault is left for the tick that begins it.
    #[inline(never)]
    pub(super) fn evaluate_first(&mut self) {
        let prepared = self.buffer.prepared();
        let first = prepared.and_then(|(patch, piece)| FirstSample::of(patch, piece));
        self.prepared = first.map_or(Prepared::Nothing, Prepared::First);
    }

    /// Piece and fraction of its path span at which the tool is.
    pub(super) const fn here(&self) -> (&Piece, u64) {
        match &self.prepared {
            Prepared::Move(ahead) => (&ahead.piece, ahead.fraction),
            _ => (&self.travel.piece, self.travel.fraction),
        }
    }
}
