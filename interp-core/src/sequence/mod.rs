//! A job's sequence on a machine with limits: approach, passes from standstill to standstill, the links between them, retract.
//!
//! [`sequencer`] is the state machine, [`lookahead`] plans the next pass while the tool moves on the current one, `legs`, [`link`] and [`hop`] hold the paths between passes, `pause` that
//! off the surface and back.

pub(crate) mod hop;
mod legs;
pub(crate) mod link;
pub(crate) mod lookahead;
mod pause;
pub(crate) mod sequencer;
mod turning;
