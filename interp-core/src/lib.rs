//! The surface interpolator (C.-C. Lo, "A new approach to CNC tool path generation", Computer-Aided Design 30, 1998):
//! a parametric surface, a ball-end tool, a feed and a scallop limit in; each period the next cutter location out.
//!
//! ```text
//!  Header + words ── job::program ──► sealed job
//!                                        │ pass::patch: collapse, once a pass and patch
//!                                        ▼
//!                 ┌────────────────► surface ──► Contact (point, normal, speed, curvatures)
//!                 │                                 │ pass::evaluation
//!   pass::contact: next parameter          ┌────────┴────────┐
//!     at one period's arc                  ▼                 ▼
//!                 ▲                   pass::offset      pass::interval
//!                 │                   CL = CC + rN      candidate of the pass
//!             pass::run                    │                 │
//!                 ▲                        ▼                 ▼
//!   with limits: sequence, feed         Sample      pass::step_over, schedule: next pass
//!                 ▲                        │
//!         Interpolator::tick, then plan    ▼
//!                 ▲                     steps: pulses
//!         one call of each a period
//! ```
//!
//! | folder | holds |
//! |---|---|
//! | `math` | fixed-point and f32 arithmetic |
//! | `surface` | the kinds of surface and their differential geometry |
//! | `job` | the job and its checks; [`encode`] for load time |
//! | `pass` | along a pass, and from pass to pass |
//! | `feed` | the feed within the limits of the axes |
//! | `sequence` | approach, passes, links and retract on a machine with limits |
//! | `positioning` | moves of one axis, or of several along a line, outside a job |
//! | `steps` | from positions to step pulses |
//!
//! A folder uses those above it only, beside faults and samples, and `steps` none but `math`; `tests/folders.rs` holds it.
//!
//! Nothing here allocates, blocks, panics or uses f64; the same calls give the same bits on every machine. Lengths are mm
//! (f32) or nm (i32), angles turns or radians as named, parameters fractions of a span. Build job data from ordinary
//! coefficients with [`encode`].
//!
//! # Accuracy
//! CL within 5 nm of the exact surface's for a ball of up to 10 mm radius, patches of up to about 100 mm, and first derivatives
//! at more than 30 degrees (the normal's error grows as 1e-7 rad over their sine); the arc between two samples within
//! 0.001 % of feed times period where the parametrisation's speed changes by less than a tenth in a period, and a fault before
//! it could be off by much more than that.
#![no_std]
#![warn(clippy::indexing_slicing, clippy::panic, clippy::expect_used)]
#![warn(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss
)]
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "written so that a NaN fails the test"
)]
#![cfg_attr(
    test,
    allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_possible_wrap,
        clippy::cast_precision_loss,
        reason = "tests convert freely"
    )
)]

#[cfg(test)]
extern crate std;

pub mod command;
pub mod fault;
mod feed;
pub mod interpolator;
pub mod job;
mod math;
mod pass;
pub mod positioning;
pub mod sample;
mod sequence;
pub mod steps;
pub mod surface;

pub use command::{Command, Inputs};
pub use fault::{Fault, FaultKind};
pub use interpolator::{Interpolator, SurfacePoint};
pub use job::encode;
pub use job::program::{front_words, region_checks};
pub use job::{AxisLimits, Header, Pattern, STORE_WORDS, Spacing, SurfaceKind, ToolSide};
pub use math::number::NM_PER_MM;
pub use sample::{RunStart, Sample, SpanParameter, State};
pub use steps::{AxisSteps, StepConfig, Steps};
