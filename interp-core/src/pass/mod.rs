//! A pass: from one cutter contact to the next, from contact to cutter location, and from pass to pass.
//!
//! In the order of the computation of a sample:
//!
//! | file | holds |
//! |---|---|
//! | [`position`], [`route`] | a patch on a pass; a pass from place to place |
//! | [`patch`], [`buffer`] | the patch at the pass's side parameter; the current patch and the next one |
//! | [`contact`] | the step along the pass at the commanded feed |
//! | [`offset`], [`evaluation`] | fit of the ball and cutter location; contact, fit and location in one call |
//! | [`interval`], [`step_over`] | candidate of the path interval at a sample; the step-over that a pass allows |
//! | [`edge`] | the crest at an end of the gap to the next pass |
//! | [`schedule`], [`lines`] | the next pass, of the whole surface and of a region |
//! | [`front`] | passes of constant scallop height |
//! | [`scan`] | the look over a pass for the step to the next one, without axis limits |
//! | [`run`] | chains them |

pub(crate) mod buffer;
pub(crate) mod contact;
mod edge;
mod evaluation;
pub(crate) mod front;
pub(crate) mod interval;
pub(crate) mod lines;
pub(crate) mod offset;
pub(crate) mod patch;
pub(crate) mod position;
pub(crate) mod route;
pub(crate) mod row_history;
pub(crate) mod run;
pub(crate) mod scan;
pub(crate) mod schedule;
pub(crate) mod step_over;
