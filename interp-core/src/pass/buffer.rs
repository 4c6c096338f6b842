//! Double buffer of patches: the run's current patch, and the next one along the pass.
//!
//! A tick that crosses a boundary needs the next piece of the pass, its patch collapsed, and the parametrisation at the boundary on both sides. None of them
//! depends on the exact end of the previous tick, so all are prepared ahead, in the planning: one [`Task`] per period. A tick that reaches a boundary sooner executes the missing tasks itself.
//!
//! At a station of a front the patch stays the same: the next piece is another curve on it ([`Ahead::Station`]).

use crate::fault::Result;
use crate::job::program::Job;
use crate::pass::patch::{OnFront, Patch};
use crate::pass::route::{Piece, Route};

/// Cycles of a task, by the pessimistic model of `cargo sim budget`.
pub(crate) const CYCLES: u32 = 3_500;

/// The next task, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Find the change of the parametrisation over the first period of the pass.
    First,
    /// Find the next piece of the pass.
    Next,
    /// Collapse its patch, or make its curve.
    Ahead,
    /// Find the jump to its curve, on the same patch.
    Jump,
    /// Find the parametrisation at its start.
    Start,
    /// Find its change over the first period.
    Change,
    /// Find the parametrisation at the end of the current patch.
    End,
    /// All tasks are complete.
    Done,
    /// The next patch is not prepared, because it is faulty, which the tick that reaches it reports.
    Faulty,
}

/// Knowledge of the piece after the current one.
#[derive(Clone, Copy, Debug)]
enum Ahead {
    /// Nothing yet.
    Unknown,
    /// There is none: the pass ends with the current one.
    None,
    /// The next piece is on another patch; the flag: that patch is collapsed.
    Patch(Piece, bool),
    /// The next piece is another curve on the same patch. The number: the jump there of the derivative of the logarithmic speed derivative, once it is known.
    Station(Piece, OnFront, Option<f32>),
}

/// Two patches, one of them current.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PatchBuffer {
    patches: [Patch; 2],
    /// The second patch is current.
    second: bool,
    task: Task,
    ahead: Ahead,
    /// The first piece of a pass for which the other patch is collapsed.
    prepared: Option<(Route, Piece)>,
}

impl PatchBuffer {
    /// No current patch.
    pub(crate) const START: Self = Self {
        patches: [Patch::NONE; 2],
        second: false,
        task: Task::Done,
        ahead: Ahead::Unknown,
        prepared: None,
    };

    /// The current patch.
    #[inline(always)]
    pub(crate) const fn patch(&self) -> &Patch {
        let [first, second] = &self.patches;
        if self.second { second } else { first }
    }

    /// The current patch, and the other.
    const fn both(&mut self) -> (&mut Patch, &mut Patch) {
        let [first, second] = &mut self.patches;
        if self.second {
            (second, first)
        } else {
            (first, second)
        }
    }

    /// Whether a task is left.
    #[inline(always)]
    pub(crate) fn has_work(&self) -> bool {
        !matches!(self.task, Task::Done | Task::Faulty)
    }

    /// Drops the remaining tasks of this patch.
    #[cfg(test)]
    pub(crate) fn disable(&mut self) {
        self.task = Task::Faulty;
        if matches!(self.ahead, Ahead::Station(..)) {
            self.ahead = Ahead::Unknown;
        }
    }

    /// Collapses the first patch of the next pass ahead of [`Self::begin`], while the present pass needs no further patch. A fault is left for that.
    #[inline(never)]
    pub(crate) fn prepare(&mut self, job: &Job<'_>, route: &Route) {
        (self.task, self.ahead) = (Task::Faulty, Ahead::Unknown);
        let piece = route.first(job);
        let is_sound = self.both().1.lay(job, route, &piece).is_ok();
        self.prepared = is_sound.then_some((*route, piece));
    }

    /// The patch that is prepared for the next pass, and its piece.
    pub(crate) const fn prepared(&self) -> Option<(&Patch, &Piece)> {
        let [first, second] = &self.patches;
        match &self.prepared {
            Some((_, piece)) => Some((if self.second { first } else { second }, piece)),
            None => None,
        }
    }

    /// Forgets what is prepared.
    pub(crate) const fn forget(&mut self) {
        self.prepared = None;
    }

    /// The first piece of a pass, and whether its patch is collapsed.
    pub(crate) fn first_piece(&self, job: &Job<'_>, route: &Route) -> (Piece, bool) {
        match &self.prepared {
            Some((prepared, piece)) if prepared == route => (*piece, true),
            _ => (route.first(job), false),
        }
    }

    /// Makes the first patch of a pass current; `piece`: that of [`Self::first_piece`].
    ///
    /// # Errors
    /// Those of [`Patch::collapse`].
    pub(crate) fn begin(
        &mut self,
        job: &Job<'_>,
        route: &Route,
        (piece, is_prepared): (&Piece, bool),
    ) -> Result<()> {
        self.prepared = None;
        (self.task, self.ahead) = (Task::First, Ahead::Unknown);
        if is_prepared {
            self.second = !self.second;
            return Ok(());
        }
        self.both().0.lay(job, route, piece)
    }

    /// Makes this piece current again, after [`Self::advance`].
    ///
    /// # Errors
    /// Those of [`Patch::lay`].
    pub(crate) fn go_back(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) -> Result<()> {
        self.restart_tasks();
        self.both().0.lay(job, route, piece)
    }

    const fn restart_tasks(&mut self) {
        (self.task, self.ahead) = (Task::Next, Ahead::Unknown);
    }

    /// The piece after this one; none at the end of the pass.
    pub(crate) fn next(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) -> Option<&Piece> {
        if matches!(self.ahead, Ahead::Unknown) {
            self.find_next(job, route, piece);
        }
        match &self.ahead {
            Ahead::Patch(next, _) | Ahead::Station(next, ..) => Some(next),
            Ahead::Unknown | Ahead::None => None,
        }
    }

    /// Whether the pass ends with the current piece, as far as it is known.
    pub(crate) const fn is_last(&self) -> bool {
        matches!(self.ahead, Ahead::None)
    }

    fn find_next(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) {
        self.ahead = match route.next(job, piece) {
            Some(next) => Ahead::Patch(next, false),
            None => Ahead::None,
        };
    }

    /// The piece after the current one, where that is on the same patch and prepared, and the jump of the derivative of the logarithmic speed derivative.
    pub(crate) const fn station(&self) -> Option<(&Piece, f32)> {
        match &self.ahead {
            Ahead::Station(piece, _, Some(jump)) => Some((piece, *jump)),
            _ => None,
        }
    }

    /// Makes the next piece of the pass current, that of [`Self::next`].
    ///
    /// # Errors
    /// Those of [`Patch::collapse`].
    pub(crate) fn advance(&mut self, job: &Job<'_>, route: &Route) -> Result<()> {
        self.prepared = None;
        match self.ahead {
            Ahead::Station(piece, curve, _) => self.both().0.go_on(&piece, curve),
            Ahead::Patch(_, true) => self.second = !self.second,
            Ahead::Patch(piece, false) => {
                self.both().1.lay(job, route, &piece)?;
                self.second = !self.second;
            }
            Ahead::Unknown | Ahead::None => {}
        }
        self.restart_tasks();
        Ok(())
    }

    /// Executes one task, for a run on this piece.
    #[inline(never)]
    pub(crate) fn work(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) {
        self.task = match self.task {
            Task::First => {
                self.both().0.find_change();
                Task::Next
            }
            Task::Next => {
                self.find_next(job, route, piece);
                match self.ahead {
                    // On a line that takes a few cycles.
                    Ahead::Patch(..) if !route.is_on_front() => self.prepare_next(job, route, piece),
                    Ahead::Patch(..) => Task::Ahead,
                    _ => Task::End,
                }
            }
            Task::Ahead => self.prepare_next(job, route, piece),
            Task::Jump => {
                let patch = self.patch();
                let jump = match &self.ahead {
                    Ahead::Station(_, curve, _) => Some(patch.jump_to(curve)),
                    _ => None,
                };
                if let Ahead::Station(_, _, known) = &mut self.ahead {
                    *known = jump;
                }
                Task::Done
            }
            Task::Start => {
                self.both().1.find_start();
                Task::Change
            }
            Task::Change => {
                self.both().1.find_change();
                Task::End
            }
            Task::End => {
                self.both().0.find_end();
                Task::Done
            }
            Task::Done | Task::Faulty => self.task,
        };
    }

    /// Collapses the next patch, or makes the next curve on this one. Returns the task after it.
    fn prepare_next(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) -> Task {
        let Ahead::Patch(next, _) = self.ahead else {
            return Task::End;
        };
        if let Some(curve) = route.curve_on_same_patch(job, piece, &next) {
            self.ahead = Ahead::Station(next, curve, None);
            return Task::Jump;
        }
        if self.both().1.lay(job, route, &next).is_err() {
            return Task::Faulty;
        }
        self.ahead = Ahead::Patch(next, true);
        Task::Start
    }
}
