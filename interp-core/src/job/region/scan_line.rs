//! A line of constant side parameter over the cells of a region, and its intervals within them.

use super::{CROSSINGS_MAX, CellWords, Edge};

/// Edges added to the list of a line in one portion of the planning.
const TAKEN: u16 = 32;
/// Edges of that list whose crossings are computed in one portion.
const MET: u8 = 2;
/// Most portions of a line after its edges are listed.
const PORTIONS_MAX: usize = CROSSINGS_MAX / MET as usize + 2;

/// The next task on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Drop the edges that end at the line or below it.
    Drop,
    /// Take in those that begin below it or at it.
    TakeIn,
    /// Find where the line meets the edge with this number in the list.
    Meet(u8),
    /// Keep the intervals that are long enough.
    Keep,
    /// The line is known.
    Done,
}

/// A region has more edges at a line than there is room for, or an odd number of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BadLine;

/// A line of constant side parameter that goes over a cell from its first line to its last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScanLine {
    task: Task,
    side: i32,
    /// The line before.
    before: i32,
    /// Edges that were taken in so far, and those of them that the line meets.
    taken: u16,
    active: [u16; CROSSINGS_MAX],
    count: u8,
    /// Where the line meets them, ascending; then the ends of the intervals.
    crossings: [i32; CROSSINGS_MAX],
    met: u8,
    /// Whether the region reaches from the line before to this one along the boundary at the start of the path parameter, and at its end.
    joins: [bool; 2],
}

impl ScanLine {
    /// Before the first line.
    pub(crate) const START: Self = Self {
        task: Task::Drop,
        side: 0,
        before: i32::MIN,
        taken: 0,
        active: [0; CROSSINGS_MAX],
        count: 0,
        crossings: [0; CROSSINGS_MAX],
        met: 0,
        joins: [false; 2],
    };

    /// Goes back to the first line of the first cell: its edges are known from the checks at load.
    pub(crate) fn restart(&mut self, first: &FirstLine) {
        self.side = first.side;
        self.before = i32::MIN;
        self.taken = first.taken;
        self.active = first.active;
        self.count = first.count;
        self.met = 0;
        self.joins = [false; 2];
        self.task = Task::Meet(0);
    }

    /// Goes to a line of another cell, or to one that does not go on from the last one; the region may reach there from `before`.
    pub(crate) const fn begin(&mut self, side: i32, before: i32) {
        self.taken = 0;
        self.count = 0;
        self.go_on(side, true);
        self.before = before;
    }

    /// Begins with the crossings of a curve, which [`Self::insert`] takes.
    pub(crate) const fn begin_curve(&mut self) {
        self.met = 0;
        self.joins = [false; 2];
        self.task = Task::Done;
    }

    /// The region reaches from the pass before to this one along a boundary of the path parameter: at its start, or at its end.
    pub(crate) const fn join(&mut self, [is_near, is_far]: [bool; 2]) {
        let [near, far] = self.joins;
        self.joins = [near || is_near, far || is_far];
    }

    /// The whole rest of the work on a line whose edges are taken in.
    pub(crate) fn finish(&mut self, cell: &CellWords<'_>, path_end: i32) -> Result<(), BadLine> {
        for _ in 0..PORTIONS_MAX {
            self.work(cell, path_end)?;
        }
        Ok(())
    }

    /// Goes on to a line further up. `skips`: this one is left out, and does not count as the line before.
    pub(crate) const fn go_on(&mut self, side: i32, skips: bool) {
        if !skips {
            self.before = self.side;
        }
        self.side = side;
        self.met = 0;
        self.joins = [false; 2];
        self.task = Task::Drop;
    }

    /// Side of the line.
    pub(crate) const fn side(&self) -> i32 {
        self.side
    }

    /// Whether the line is known.
    pub(crate) fn is_done(&self) -> bool {
        self.task == Task::Done
    }

    /// Whether the region reaches from the line before to this one along the path parameter's boundaries.
    pub(crate) const fn joins(&self) -> [bool; 2] {
        self.joins
    }

    /// Intervals of the line.
    pub(crate) const fn intervals(&self) -> u8 {
        self.met / 2
    }

    /// Ends of an interval, ascending.
    pub(crate) fn interval(&self, index: u8) -> Option<[i32; 2]> {
        if index >= self.intervals() {
            return None;
        }
        let (pairs, _) = self.crossings.as_chunks::<2>();
        pairs.get(usize::from(index)).copied()
    }

    /// The side at which the region begins again, where the line is above one part of it and below the next.
    pub(crate) fn begins_again(&self, cell: &CellWords<'_>) -> Option<i32> {
        if self.count > 0 {
            return None;
        }
        let [from, _] = cell.edge(self.taken)?.side;
        Some(from)
    }

    /// One portion of the work on a line.
    ///
    /// # Errors
    /// The line meets too many edges, or an odd number of them.
    #[inline(never)]
    pub(crate) fn work(&mut self, cell: &CellWords<'_>, path_end: i32) -> Result<(), BadLine> {
        self.task = match self.task {
            Task::Drop => {
                self.drop_passed(cell);
                Task::TakeIn
            }
            Task::TakeIn => {
                if self.take_in(cell)? {
                    Task::TakeIn
                } else {
                    Task::Meet(0)
                }
            }
            Task::Meet(index) => {
                let end = index.saturating_add(MET).min(self.count);
                for index in index..end {
                    let number = self.active.get(usize::from(index)).copied().unwrap_or(0);
                    if let Some(edge) = cell.edge(number) {
                        self.meet(&edge, path_end)?;
                    }
                }
                if end < self.count {
                    Task::Meet(end)
                } else {
                    Task::Keep
                }
            }
            Task::Keep => {
                self.keep(cell.least())?;
                Task::Done
            }
            Task::Done => Task::Done,
        };
        Ok(())
    }

    /// Drops the edges that the line does not meet any more.
    fn drop_passed(&mut self, cell: &CellWords<'_>) {
        let mut kept = 0_u8;
        for index in 0..self.count {
            let number = self.active.get(usize::from(index)).copied().unwrap_or(0);
            let is_met = cell.edge(number).is_some_and(|edge| edge.meets(self.side));
            if is_met && let Some(place) = self.active.get_mut(usize::from(kept)) {
                *place = number;
                kept += 1;
            }
        }
        self.count = kept;
    }

    /// Takes in a portion of edges; returns whether more of them may be due.
    fn take_in(&mut self, cell: &CellWords<'_>) -> Result<bool, BadLine> {
        for _ in 0..TAKEN {
            let Some(edge) = cell.edge(self.taken) else {
                return Ok(false);
            };
            let [from, _] = edge.side;
            if from > self.side {
                return Ok(false);
            }
            self.add_edge(&edge)?;
        }
        Ok(true)
    }

    /// Takes in the next edge, which begins below the line or at it.
    fn add_edge(&mut self, edge: &Edge) -> Result<(), BadLine> {
        if edge.meets(self.side) {
            let place = self.active.get_mut(usize::from(self.count)).ok_or(BadLine)?;
            *place = self.taken;
            self.count += 1;
        }
        self.taken += 1;
        Ok(())
    }

    /// Inserts the crossing with an edge.
    fn meet(&mut self, edge: &Edge, path_end: i32) -> Result<(), BadLine> {
        let at = edge.crossing(self.side);
        let ([from, to], [path_from, path_to]) = (edge.side, edge.path);
        if path_from == path_to && from <= self.before && self.before <= to {
            self.join([at == 0, at == path_end]);
        }
        self.insert(at)
    }

    /// Inserts a crossing.
    ///
    /// # Errors
    /// There is no room for it.
    pub(crate) fn insert(&mut self, at: i32) -> Result<(), BadLine> {
        let mut place = usize::from(self.met);
        if place >= CROSSINGS_MAX {
            return Err(BadLine);
        }
        while place > 0 {
            let before = self.crossings.get(place - 1).copied().unwrap_or(i32::MIN);
            if before <= at {
                break;
            }
            if let Some(to) = self.crossings.get_mut(place) {
                *to = before;
            }
            place -= 1;
        }
        if let Some(to) = self.crossings.get_mut(place) {
            *to = at;
        }
        self.met += 1;
        Ok(())
    }

    /// Joins intervals that meet, and keeps those that are at least this long.
    ///
    /// # Errors
    /// Their number is odd.
    pub(crate) fn keep(&mut self, least: i32) -> Result<(), BadLine> {
        if self.met % 2 == 1 {
            return Err(BadLine);
        }
        let mut kept = 0_u8;
        let mut open: Option<[i32; 2]> = None;
        for index in 0..=self.intervals() {
            let next = self.interval(index);
            open = match (open, next) {
                (Some([from, to]), Some([begins, ends])) if begins == to => Some([from, ends]),
                (Some([from, to]), _) => {
                    let (pairs, _) = self.crossings.as_chunks_mut::<2>();
                    if to - from >= least
                        && let Some(pair) = pairs.get_mut(usize::from(kept))
                    {
                        *pair = [from, to];
                        kept += 1;
                    }
                    next
                }
                (None, _) => next,
            };
        }
        self.met = 2 * kept;
        Ok(())
    }
}

/// The first line of the first cell: its side, the edges up to there, and those that it meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstLine {
    pub(super) side: i32,
    pub(super) taken: u16,
    pub(super) count: u8,
    pub(super) active: [u16; CROSSINGS_MAX],
}
