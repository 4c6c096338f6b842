//! Double buffer of patches: the run's current patch, and the next one along the pass.
//!
//! A tick that crosses a boundary needs the next patch collapsed, and the parametrisation at the boundary on both sides. Neither
//! depends on the exact end of the previous tick, so both are prepared ahead, in ticks with little other work: one
//! [`Task`] per tick. A tick that reaches a boundary sooner executes the missing tasks itself.

use crate::fault::Result;
use crate::job::program::Job;
use crate::pass::patch::Patch;
use crate::pass::route::{Piece, Route};

/// The next task, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Find the parametrisation at the ends of the current patch.
    Ends,
    /// Collapse the next patch.
    Ahead,
    /// Find the parametrisation at the next patch's ends.
    AheadEnds,
    /// All tasks are complete.
    Done,
    /// The next patch is not prepared, because it is faulty, which the tick that reaches it reports, or because there is none.
    Faulty,
}

/// Two patches, one of them current.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PatchBuffer {
    patches: [Patch; 2],
    /// The second patch is current.
    second: bool,
    task: Task,
    /// The first patch of a pass for which the other patch is collapsed.
    prepared: Option<(Route, Piece)>,
}

impl PatchBuffer {
    /// No current patch.
    pub(crate) const START: Self = Self {
        patches: [Patch::NONE; 2],
        second: false,
        task: Task::Done,
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
    }

    /// Collapses the first patch of the next pass ahead of [`Self::begin`], while the present pass needs no further patch. A fault is left for that.
    #[inline(never)]
    pub(crate) fn prepare(&mut self, job: &Job<'_>, route: &Route) {
        self.task = Task::Faulty;
        let piece = route.first(job);
        let is_sound = self.both().1.lay(job, route, &piece).is_ok();
        self.prepared = is_sound.then_some((*route, piece));
    }

    /// Forgets what is prepared.
    pub(crate) const fn forget(&mut self) {
        self.prepared = None;
    }

    /// Makes the first patch of a pass current.
    ///
    /// # Errors
    /// Those of [`Patch::collapse`].
    pub(crate) fn begin(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) -> Result<()> {
        self.task = Task::Ends;
        if self.prepared.take() == Some((*route, *piece)) {
            self.second = !self.second;
            return Ok(());
        }
        self.both().0.lay(job, route, piece)
    }

    /// Makes the next piece of the pass current.
    ///
    /// # Errors
    /// Those of [`Patch::collapse`].
    pub(crate) fn advance(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) -> Result<()> {
        self.prepared = None;
        if !matches!(self.task, Task::AheadEnds | Task::Done) {
            self.both().1.lay(job, route, piece)?;
        }
        self.second = !self.second;
        self.task = if self.patch().has_ends() {
            Task::Ahead
        } else {
            Task::Ends
        };
        Ok(())
    }

    /// Executes one task, for a run on this piece.
    #[inline(never)]
    pub(crate) fn work(&mut self, job: &Job<'_>, route: &Route, piece: &Piece) {
        let task = self.task;
        let (patch, ahead) = self.both();
        self.task = match task {
            Task::Ends => {
                patch.find_ends();
                Task::Ahead
            }
            Task::Ahead => match route.next(job, piece) {
                Some(next) if ahead.lay(job, route, &next).is_ok() => Task::AheadEnds,
                Some(_) => Task::Faulty,
                None => Task::Done,
            },
            Task::AheadEnds => {
                ahead.find_ends();
                Task::Done
            }
            Task::Done | Task::Faulty => task,
        };
    }
}
