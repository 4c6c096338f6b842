//! Where a pass runs, and which patch of it the tool is on.

use crate::sample::Place;

/// Where a pass runs, and which patch of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) side: Place,
    pub(crate) reversed: bool,
    /// Path span, in the surface's own direction.
    pub(crate) span: u16,
}

impl Line {
    /// The next patch along the pass, if there is one.
    pub(crate) fn next(self, spans: u16) -> Option<Self> {
        let span = if self.reversed {
            self.span.checked_sub(1)
        } else {
            self.span.checked_add(1)
        };
        let span = span.filter(|span| *span < spans)?;
        Some(Self { span, ..self })
    }
}
