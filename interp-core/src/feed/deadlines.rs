//! Deadlines of the planning of a pass.

/// Periods that a planning and its plan may take.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deadlines {
    /// Periods of the planning so far.
    pub(crate) spent: u32,
    /// Least duration of the plan: that of its planning so far, which the planning of the next one will take, too. 0 where the tool may wait for that.
    pub(crate) least: u32,
    /// What is left until the plan is needed. None where the tool may wait for it.
    pub(crate) left: Option<f32>,
    /// The tool waits for this plan off the surface, before the first pass: it has the nodes and steps that it is worth, and lasts as long as the usual
    /// planning of the next one.
    pub(crate) waits: bool,
}
