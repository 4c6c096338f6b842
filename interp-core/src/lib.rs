//! The surface interpolator (C.-C. Lo, "A new approach to CNC tool path generation", Computer-Aided Design 30, 1998):
//! a parametric surface, a ball-end tool, a feed and a scallop limit in; each period the next cutter location out.
//!
//! # Use
//! Load a job, start it, then call [`Interpolator::tick`] and [`Interpolator::plan`] once a period each:
//!
//! ```
//! use interp_core::{Command, Fault, Header, Interpolator, Sample};
//!
//! /// The job's words: see [`interp_core::job`]. Each sample goes to the axes; a run that ends with a fault is an error.
//! fn machine(header: &Header, words: &[i32], mut axes: impl FnMut(&Sample)) -> Result<(), Fault> {
//!     // 36 KB besides the store: on a board in a `static`, behind a lock.
//!     let mut machine = Interpolator::<[i32; 1024]>::new();
//!     machine.load_begin(header, words.len() as u32)?;
//!     machine.load_words(0, words)?;
//!     for record in 0..machine.load_records() {
//!         machine.load_check(record)?;
//!     }
//!     machine.load_finish()?;
//!     let mut sample = *machine.tick(Command::Start);
//!     while sample.state.is_under_way() {
//!         axes(&sample);
//!         machine.plan();
//!         sample = *machine.tick(None);
//!     }
//!     machine.fault().map_or(Ok(()), Err)
//! }
//! # // A valley of radius 20 mm and a ball of 30 mm: from the start of a pass to where the ball no longer fits.
//! # use interp_core::{FaultKind, encode};
//! # let mut c = [[[0.0; 4]; 4]; 3];
//! # (c[0][1][0], c[1][0][1]) = (40.0, 40.0);
//! # (c[2][1][0], c[2][2][0]) = (-40.0, 40.0);
//! # let centred = c.map(|axis| encode::substitute(&axis, [0.0, 1.0], [0.0, 1.0]));
//! # let mut words = [encode::width(1.0).unwrap(); 54];
//! # words[2..].copy_from_slice(&encode::polynomial(&centred, Default::default()).unwrap().to_words());
//! # let mut header = Header { path_spans: 1, side_spans: 1, ball_radius_mm: 30.0, feed_mm_s: 20.0, scallop_mm: 0.01, period_s: 0.001, ..Header::default() };
//! # let mut samples = 0;
//! # assert_eq!(machine(&header, &words, |_| samples += 1).map_err(|fault| fault.kind), Err(FaultKind::BallDoesNotFit));
//! # assert!(samples > 100);
//! # header.ball_radius_mm = 5.0;
//! # assert_eq!(machine(&header, &words, |_| ()), Ok(()));
//! ```
//!
//! **On a board** the tick runs in the timer's interrupt and the planning in a task of lower priority. Both need the whole machine, so the tick must not preempt the
//! planning: guard it by one lock (an RTIC resource as in the crate's README, or the timer's interrupt masked during [`Interpolator::plan`]). The largest portion found takes 36 000 cycles of a
//! Cortex-M4F by the pessimistic model (28 100 by the nominal one), 214 us at 168 MHz, and delays the tick where it is still under way at the period's end.
//!
//! **Memory**: [`Interpolator`] takes 36 152 bytes besides its store, which holds the job's words and [`front_words`]. [`Interpolator::new`] is a constant, for a `static` behind a
//! lock; it is zeroes but for a few words, whose `static` takes flash for all of it: give a large store as one of its own, by [`Interpolator::with_store`]. The deepest stack of the
//! firmware is 14 KB.
//!
//! **Not checked**: that patches join, that widths fit them ([`job`]), gouges away from the contact, fixtures. The desk tool's `verify` measures these.
//!
//! # Inside
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
//! Nothing here allocates, blocks or panics, and nothing but [`encode`], for load time, uses f64; the same calls give the same bits on every machine. Lengths are mm
//! (f32) or nm (i32), angles turns or radians as named, parameters fractions of a span. Build job data from ordinary
//! coefficients with [`encode`].
//!
//! # Accuracy
//! CL within 5 nm of the exact surface's for a ball of up to 10 mm radius, patches of up to about 100 mm, and first derivatives
//! at more than 30 degrees (the normal's error grows as 1e-7 rad over their sine). Not on very narrow patches, because the unit of a patch is that of its longer
//! side: a ball of 3 mm on patches of 8 mm by 0.025 mm is 15 to 19 nm off. The arc between two samples within
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
