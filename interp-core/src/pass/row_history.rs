//! Rows of patches of the last passes, for a job that is loaded while it runs: what the planning of a pass may look at, and how far the next pass may be.

use crate::fault::Result;
use crate::job::Header;
use crate::math::number::Bounded;
use crate::pass::schedule;
use crate::sample::SpanParameter;

/// Rows of the last passes: what the planning of a pass may look at, and how far the next pass may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowHistory {
    /// Row of the pass that is planned, of the one before it, and of the one before that.
    rows: [u16; 3],
}

impl RowHistory {
    /// Before the first pass.
    pub(crate) const START: Self = Self { rows: [0; 3] };

    /// The planning of a pass in this row begins.
    pub(crate) const fn enter(&mut self, row: u16) {
        let [last, before, _] = self.rows;
        self.rows = [row, last, before];
    }

    /// Side spans that the planning of the pass may look at, from the first one.
    pub(crate) fn spans(&self, header: &Header) -> u16 {
        let [_, _, at] = self.rows;
        Self::from(at, header)
    }

    /// The same for the pass after it.
    pub(crate) fn next_spans(&self, header: &Header) -> u16 {
        let [_, at, _] = self.rows;
        Self::from(at, header)
    }

    fn from(at: u16, header: &Header) -> u16 {
        if header.window == 0 {
            return header.side_spans;
        }
        header.side_spans.min(at.saturating_add(header.window))
    }

    /// The pass after this one, by a step from it; see [`schedule::next_side`].
    ///
    /// A pass stays before the last row of the window at most, at its start, so that the next one has a row to look at; and the one after that can go on.
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
        let [row, before, _] = self.rows;
        let spans = self
            .spans(header)
            .min(row.saturating_add(header.window).saturating_sub(1));
        let side = schedule::next_side(from, step, spans, width)?;
        let last = before.saturating_add(header.window).saturating_sub(1);
        Ok(if side.span >= last && last < header.side_spans {
            SpanParameter {
                span: last,
                fraction: 0,
            }
        } else {
            side
        })
    }

    /// The last row that the planning of the pass after this one needs: at `side`, with lines at `step` beside it, as far as that is known.
    pub(crate) fn last_needed(
        &self,
        header: &Header,
        side: SpanParameter,
        step: Option<f32>,
        width: impl Fn(u16) -> f32,
    ) -> u16 {
        let spans = self.next_spans(header);
        let last = spans.saturating_sub(1);
        let step = step.unwrap_or(f32::INFINITY).at_least(0.0);
        if step == f32::INFINITY {
            return last;
        }
        // An interval that is too small is reported where it is planned.
        schedule::next_side(side, step, spans, width).map_or(side.span, |line| line.span.max(side.span))
    }
}
