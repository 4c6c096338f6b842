//! Side parameter and direction of a pass, and the current patch on the pass.

use crate::sample::SpanParameter;

/// Side parameter and direction of a pass, and a patch on the pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PassPosition {
    pub(crate) side: SpanParameter,
    pub(crate) reversed: bool,
    /// Path span, in the surface's own direction.
    pub(crate) span: u16,
}

impl PassPosition {
    /// The position of the next patch along the pass, if there is one.
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
