//! Rows of patches of the last passes, for a job that is loaded while it runs: which rows the planning of a pass may read, and how far away the next pass may be.

use crate::fault::Result;
use crate::job::stream::RowsNeeded;
use crate::job::{Header, Pattern};
use crate::math::number::Bounded;
use crate::pass::schedule;
use crate::sample::SpanParameter;

/// Rows of the last passes: which rows the planning of a pass may read, and how far away the next pass may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowHistory {
    /// Row of the pass that is planned, of the one before it, and of the one before that.
    rows: [u16; 3],
    /// The last row that is certainly loaded, in a job with turns.
    granted: u16,
    /// The row of the next pass for which rows were requested.
    asked: Option<u16>,
    /// A turn leads to the pass that is planned, so the tool cannot wait for rows before it.
    is_turned: bool,
}

/// Room of a turn, in steps: from the pass that it leads to up to the rows that can be waited for only at the next rest. The planning of the next pass but one takes
/// two, and more where the steps grow.
const STEPS_TURNED: f32 = 4.0;

/// The first row that is needed where the planning of a pass begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FirstRow {
    /// The row of the planned pass itself: without limits a pass is scanned while the tool is on it.
    Own,
    /// The row of the pass before, which the tool is about to begin from above.
    Before,
    /// The row of the pass before that one, whose end the tool leaves along the surface's boundary.
    Left,
    /// As [`Self::Left`] where turns may lead from pass to pass: all rows of the window from there on are requested at a rest, and turns follow for as long as these last.
    Turned,
}

impl FirstRow {
    const fn of(header: &Header) -> Self {
        match (&header.axes, header.pattern) {
            (None, _) => Self::Own,
            (Some(_), Pattern::Zig) => Self::Before,
            (Some(axes), Pattern::Zigzag) if axes.overrun_mm > 0.0 => Self::Turned,
            (Some(_), Pattern::Zigzag) => Self::Left,
        }
    }
}

impl RowHistory {
    /// Before the first pass.
    pub(crate) const START: Self = Self {
        rows: [u16::MAX; 3],
        granted: 0,
        asked: None,
        is_turned: false,
    };

    /// The planning of a pass in this row begins. Behind the first pass of a job, and where the rows are not next to those of the pass before it, the window begins
    /// with it. `is_turned`: a turn leads to it.
    pub(crate) fn enter(&mut self, header: &Header, row: u16, is_turned: bool) {
        let [last, before, _] = self.rows;
        if self.jumps(header, row) {
            self.rows = [row; 3];
            self.granted = Self::last_from(row, header);
        } else {
            self.rows = [row, last, before];
        }
        self.is_turned = is_turned;
        self.asked = None;
    }

    /// The rows that the next pass needs are there.
    pub(crate) const fn grant(&mut self, needed: &RowsNeeded) {
        self.granted = needed.last;
        self.asked = Some(needed.own);
    }

    /// Whether the next pass, in this row, lies outside the window, and its rows were not asked for: after a turn.
    pub(crate) fn lacks(&self, header: &Header, row: u16) -> bool {
        let [own, ..] = self.rows;
        let is_first = own == u16::MAX;
        header.window > 0 && !is_first && self.jumps(header, row) && self.asked != Some(row)
    }

    /// The last row of the window from this one on.
    const fn last_from(row: u16, header: &Header) -> u16 {
        row.saturating_add(header.window).saturating_sub(1)
    }

    /// Whether a pass in this row, after the one that was entered, lies outside its window: in another cell of a region, or beyond a gap. In the last row of a window
    /// that begins with the pass that was entered there would be no place for the pass after it.
    pub(crate) fn jumps(&self, header: &Header, row: u16) -> bool {
        let [own, before, _] = self.rows;
        let end = match FirstRow::of(header) {
            FirstRow::Own | FirstRow::Before => own.saturating_add(header.window),
            FirstRow::Left | FirstRow::Turned => {
                let end = before.saturating_add(header.window);
                end.min(Self::last_from(own, header))
            }
        };
        row < own || row >= end
    }

    /// Side spans that the planning of the pass may look at, from the first one.
    pub(crate) fn spans(&self, header: &Header) -> u16 {
        let [own, before, left] = self.rows;
        match FirstRow::of(header) {
            FirstRow::Own => Self::from(own, header),
            FirstRow::Before => Self::from(before, header),
            FirstRow::Left => Self::from(left, header),
            FirstRow::Turned if header.window == 0 => header.side_spans,
            FirstRow::Turned => header.side_spans.min(self.granted.saturating_add(1)),
        }
    }

    fn from(at: u16, header: &Header) -> u16 {
        if header.window == 0 {
            return header.side_spans;
        }
        header.side_spans.min(at.saturating_add(header.window))
    }

    /// The pass after this one, by a step from it; see [`schedule::next_side`].
    ///
    /// That pass lies in a row that the planning of this pass may read, and no farther than the start of the last row that its own planning may read, so that there is one.
    /// Where the first row needed is that of the last pass but one, it leaves a row to the pass after it, so that each pass advances.
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
        let last = |row: u16| Self::last_from(row, header);
        let (spans, last) = match FirstRow::of(header) {
            FirstRow::Own => (self.spans(header), u16::MAX),
            FirstRow::Before => (self.spans(header), last(own)),
            FirstRow::Left | FirstRow::Turned => (self.spans(header).min(last(own)), last(before)),
        };
        // Behind a turn the next pass is planned with the rows that are there: it is left a row of its own.
        let last = if self.is_turned && !self.has_all(header, self.granted) {
            last.min(self.granted.saturating_sub(1))
        } else {
            last
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

    /// Whether rows up to this one are all that the passes may need.
    const fn has_all(&self, header: &Header, row: u16) -> bool {
        row.saturating_add(1) >= header.side_spans
    }

    /// Whether a turn may lead from the pass that is planned to the next one: whether the loaded rows suffice for all passes planned before the tool can rest again.
    pub(crate) fn may_turn(
        &self,
        header: &Header,
        [from, to]: [SpanParameter; 2],
        width: impl Fn(u16) -> f32,
    ) -> bool {
        if header.window == 0 {
            return true;
        }
        let [_, before, _] = self.rows;
        let granted = if self.is_turned {
            self.granted
        } else {
            self.granted.max(Self::last_from(before, header))
        };
        let room = STEPS_TURNED * schedule::apart(from, to, &width);
        let end = schedule::next_side(to, room, header.side_spans, &width);
        self.has_all(header, granted) || end.is_ok_and(|end| end.span.saturating_add(1) < granted)
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
        let after = match FirstRow::of(header) {
            FirstRow::Own => None,
            FirstRow::Before => Some(own),
            FirstRow::Left | FirstRow::Turned => Some(before),
        };
        let step = step.filter(|_| FirstRow::of(header) != FirstRow::Turned);
        let is_near = !self.jumps(header, side.span);
        let first = after.filter(|_| is_near).unwrap_or(side.span);
        let spans = Self::from(first, header);
        let step = step.unwrap_or(f32::INFINITY).at_least(0.0);
        let last = if step == f32::INFINITY {
            spans.saturating_sub(1)
        } else {
            // An interval that is too small is reported where it is planned.
            schedule::next_side(side, step, spans, width).map_or(side.span, |line| line.span.max(side.span))
        };
        RowsNeeded {
            after,
            before: own,
            own: side.span,
            last,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Header, Pattern, RowHistory};
    use crate::job::AxisLimits;
    use crate::sample::SpanParameter;

    const ROWS: u16 = 400;

    /// Passes by steps of up to two rows, and beginnings of other cells up to 60 rows away, in windows of 6 to 40 rows: each pass advances, and what is needed fits the window.
    #[test]
    fn passes_advance_in_any_row() {
        let mut state = 1_u64;
        let mut below = |end: u64| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state % end
        };
        for pattern in [Pattern::Zig, Pattern::Zigzag] {
            for _ in 0..20_000 {
                let header = Header {
                    pattern,
                    side_spans: ROWS,
                    window: 6 + below(35) as u16,
                    axes: Some(AxisLimits::default()),
                    ..Header::default()
                };
                let mut rows = RowHistory::START;
                let mut side = SpanParameter { span: 0, fraction: 0 };
                for _ in 0..12 {
                    rows.enter(&header, side.span, false);
                    let step = below(2000) as f32 * 1e-3 + 0.01;
                    let next = rows.next_side(&header, side, step, |_| 1.0).unwrap();
                    assert!(next > side, "{rows:?} {header:?}: from {side:?} to {next:?}");
                    side = if below(4) == 0 {
                        SpanParameter {
                            span: (side.span + below(60) as u16).min(ROWS - 1),
                            fraction: below(u64::MAX) >> 32 << 32,
                        }
                    } else {
                        next
                    };
                    let needed = rows.needed(&header, side, None, |_| 1.0);
                    let from = needed.after.unwrap_or(needed.own);
                    let first = if rows.jumps(&header, side.span) {
                        needed.own
                    } else {
                        from
                    };
                    assert!(needed.last < first + header.window, "{rows:?} {needed:?}");
                    if side.span + 1 == ROWS {
                        break;
                    }
                }
            }
        }
    }
}
