//! The tool on the desk: reads a job, runs the surface interpolator on it here or on a board, and checks what comes out.
//!
//! ```text
//! job file ──job_file──► JobFile ──prepare──► Prepared ──machine──► samples ──survey──► trace, figures, report
//!                           │                    │                                ▲
//!                           │                    └──remote──► the same from a board or QEMU, compared
//!                           └──oracle──► independent f64 geometry ────────────────┘
//! ```
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

pub mod approach;
pub mod budget;
pub mod cad;
pub mod commands;
pub mod direction;
pub mod explain;
pub mod export;
pub mod gcode;
pub mod job_file;
pub mod machine;
pub mod motion;
pub mod operations;
pub mod oracle;
pub mod paper;
pub mod placement;
pub mod prepare;
pub mod probe;
pub mod remote;
pub mod report;
pub mod script;
pub mod speeds;
pub mod survey;
pub mod swept;
pub mod template;
pub mod trace;
pub mod travel;
