//! The patch that a run is on, and the next one along the pass.
//!
//! A tick that crosses a boundary needs the next patch collapsed, and the parametrisation at the boundary on both sides. Neither
//! depends on where exactly the tick before ended, so both are made ahead, in ticks that have little else to do: one
//! [`Task`] each. A boundary that is reached sooner has what is missing made in its own tick.

use crate::fault::Result;
use crate::job::program::Job;
use crate::pass::patch::Patch;
use crate::pass::position::Line;

/// What is to be made next. In this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// The parametrisation at the ends of the patch.
    Ends,
    /// The next patch.
    Ahead,
    /// The parametrisation at its ends.
    AheadEnds,
    /// Nothing is left.
    Done,
    /// The next patch is faulty: nothing is made ahead, and the fault is for the tick that gets there.
    Faulty,
}

/// Two patches, of which the run is on one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lane {
    patches: [Patch; 2],
    /// The run is on the second.
    second: bool,
    task: Task,
}

impl Lane {
    /// On no patch yet.
    pub(crate) const START: Self = Self {
        patches: [Patch::NONE; 2],
        second: false,
        task: Task::Done,
    };

    /// The patch that the run is on.
    #[inline(always)]
    pub(crate) const fn patch(&self) -> &Patch {
        let [first, second] = &self.patches;
        if self.second { second } else { first }
    }

    /// The patch that the run is on, and the other.
    const fn both(&mut self) -> (&mut Patch, &mut Patch) {
        let [first, second] = &mut self.patches;
        if self.second {
            (second, first)
        } else {
            (first, second)
        }
    }

    /// Whether there is something to be made ahead.
    #[inline(always)]
    pub(crate) fn has_work(&self) -> bool {
        !matches!(self.task, Task::Done | Task::Faulty)
    }

    /// Makes nothing more ahead on this patch.
    #[cfg(test)]
    pub(crate) fn rest(&mut self) {
        self.task = Task::Faulty;
    }

    /// Goes to the first patch of a pass.
    ///
    /// # Errors
    /// Those of [`Patch::collapse`].
    pub(crate) fn begin(&mut self, job: &Job<'_>, line: &Line) -> Result<()> {
        self.task = Task::Ends;
        self.both().0.collapse(job, line)
    }

    /// Goes to the next patch of the pass, which is this one.
    ///
    /// # Errors
    /// Those of [`Patch::collapse`].
    pub(crate) fn go_on(&mut self, job: &Job<'_>, line: &Line) -> Result<()> {
        if !matches!(self.task, Task::AheadEnds | Task::Done) {
            self.both().1.collapse(job, line)?;
        }
        self.second = !self.second;
        self.task = if self.patch().has_ends() {
            Task::Ahead
        } else {
            Task::Ends
        };
        Ok(())
    }

    /// Makes one thing ahead, for a run on this patch.
    #[inline(never)]
    pub(crate) fn work(&mut self, job: &Job<'_>, line: &Line) {
        let task = self.task;
        let (patch, ahead) = self.both();
        self.task = match task {
            Task::Ends => {
                patch.find_ends();
                Task::Ahead
            }
            Task::Ahead => match line.next(job.header.path_spans) {
                Some(next) if ahead.collapse(job, &next).is_ok() => Task::AheadEnds,
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
