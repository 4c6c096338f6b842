//! Rows of patches of the last passes, for a job that is loaded while it runs: what the planning of a pass may look at, and how far the next pass may be.

use crate::fault::Result;
use crate::job::stream::RowsNeeded;
use crate::job::{Header, Pattern};
use crate::math::number::Bounded;
use crate::pass::schedule;
use crate::sample::SpanParameter;

/// Rows of the last passes: what the planning of a pass may look at, and how far the next pass may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowHistory {
    /// Row of the pass that is planned, of the one before it, and of the one before that.
    rows: [u16; 3],
}

/// The first row that is needed where the planning of a pass begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FirstRow {
    /// That of the pass itself: without limits it is looked at while the tool is on it.
    Own,
    /// That of the pass before it, which the tool is about to begin from above.
    Before,
    /// That of the pass before that one, whose end the tool leaves along the surface's boundary.
    Left,
}

impl FirstRow {
    const fn of(header: &Header) -> Self {
        match (&header.axes, header.pattern) {
            (None, _) => Self::Own,
            (Some(_), Pattern::Zig) => Self::Before,
            (Some(_), Pattern::Zigzag) => Self::Left,
        }
    }
}

impl RowHistory {
    /// Before the first pass.
    pub(crate) const START: Self = Self { rows: [u16::MAX; 3] };

    /// The planning of a pass in this row begins. Behind the first pass of a job, and where the rows are not next to those of the pass before it, the window begins
    /// with it.
    pub(crate) const fn enter(&mut self, header: &Header, row: u16) {
        let [last, before, _] = self.rows;
        self.rows = if self.jumps(header, row) {
            [row; 3]
        } else {
            [row, last, before]
        };
    }

    /// Whether a pass in this row, after the one that was entered, lies outside its window: in another cell of a region, or beyond a gap.
    pub(crate) const fn jumps(&self, header: &Header, row: u16) -> bool {
        let [own, ..] = self.rows;
        row < own || row >= own.saturating_add(header.window)
    }

    /// Side spans that the planning of the pass may look at, from the first one.
    pub(crate) fn spans(&self, header: &Header) -> u16 {
        let [own, before, left] = self.rows;
        Self::from(
            match FirstRow::of(header) {
                FirstRow::Own => own,
                FirstRow::Before => before,
                FirstRow::Left => left,
            },
            header,
        )
    }

    fn from(at: u16, header: &Header) -> u16 {
        if header.window == 0 {
            return header.side_spans;
        }
        header.side_spans.min(at.saturating_add(header.window))
    }

    /// The pass after this one, by a step from it; see [`schedule::next_side`].
    ///
    /// It is where the planning of this pass may look, and no farther than the start of the last row that its own planning may look at, so that it has a row to look at. Where
    /// the first row needed is that of the last pass but one, it leaves a row to the pass after it, so that each pass gets on.
    ///
    /// # Errors
    /// Those of [`schedule::next_side`].
    pub(crate) fn next_side(
        &self,
        header: &Header,
        from: SpanParameter,
        step: f32,
        width: impl Fn(u16) -> f32,
    ) -> Result<SpanParameter> {
        if header.window == 0 {
            return schedule::next_side(from, step, header.side_spans, width);
        }
        let [own, before, _] = self.rows;
        let last = |row: u16| row.saturating_add(header.window).saturating_sub(1);
        let (spans, last) = match FirstRow::of(header) {
            FirstRow::Own => (self.spans(header), u16::MAX),
            FirstRow::Before => (self.spans(header), last(own)),
            FirstRow::Left => (self.spans(header).min(last(own)), last(before)),
        };
        let side = schedule::next_side(from, step, spans, width)?;
        Ok(if side.span >= last && last < header.side_spans {
            SpanParameter {
                span: last,
                fraction: 0,
            }
        } else {
            side
        })
    }

    /// The rows that the planning of the pass after this one needs: at `side`, with lines at `step` beside it, as far as that is known.
    pub(crate) fn needed(
        &self,
        header: &Header,
        side: SpanParameter,
        step: Option<f32>,
        width: impl Fn(u16) -> f32,
    ) -> RowsNeeded {
        let [own, before, _] = self.rows;
        let behind = match FirstRow::of(header) {
            FirstRow::Own => None,
            FirstRow::Before => Some(own),
            FirstRow::Left => Some(before),
        };
        let is_near = !self.jumps(header, side.span);
        let first = behind.filter(|_| is_near).unwrap_or(side.span);
        let spans = Self::from(first, header);
        let step = step.unwrap_or(f32::INFINITY).at_least(0.0);
        let last = if step == f32::INFINITY {
            spans.saturating_sub(1)
        } else {
            // An interval that is too small is reported where it is planned.
            schedule::next_side(side, step, spans, width).map_or(side.span, |line| line.span.max(side.span))
        };
        RowsNeeded {
            behind,
            own: side.span,
            last,
        }
    }
}
