//! A job's sequence on a machine with limits: approach, passes from standstill to standstill, the links between them, retract.
//!
//! [`course`] is the state machine, [`lookahead`] plans the next pass while the tool is on its way, [`link`] holds the paths between passes.

pub(crate) mod course;
pub(crate) mod link;
pub(crate) mod lookahead;
