//! A pass: from one cutter contact to the next, from contact to cutter location, and from pass to pass.
//!
//! In the order of a sample's way: [`position`] names a patch on a pass, [`patch`] collapses it and evaluates it, [`buffer`] holds the current and
//! the next one, [`contact`] steps along it, [`offset`] checks that the ball fits and locates its centre, [`evaluation`] chains these two behind the contact, [`interval`] gives the candidate of the path interval,
//! [`across`] the step-over that follows from a pass, [`schedule`] the next pass, and [`run`] chains them.

pub(crate) mod across;
pub(crate) mod buffer;
pub(crate) mod contact;
mod evaluation;
pub(crate) mod interval;
pub(crate) mod offset;
pub(crate) mod patch;
pub(crate) mod position;
pub(crate) mod run;
pub(crate) mod schedule;
