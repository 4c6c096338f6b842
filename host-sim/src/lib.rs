//! The tool on the desk: its commands parse and print; what they do is in the crates beside this one.
//!
//! ```text
//! job file ──job-file──► job ──machine──► Prepared ──► samples ──inspect──► figures ──report──► page
//!    ▲                    │                  │                     ▲
//!   cad, part-program     │                  └──► a board, QEMU    │
//!                         └──oracle──► verify ─────────────────────┘
//! ```

pub mod commands;
mod motion;
pub mod probe;
pub mod template;
