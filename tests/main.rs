//! Tests across crates, one module a subject: `cargo test -p integration-tests MODULE` runs those of one.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

mod board;
mod cad_files;
mod chip;
mod cycles;
mod debug_probe;
mod drivers;
mod export;
mod faults;
mod feed;
mod golden_points;
mod home;
mod house;
mod images;
mod import;
mod lost_events;
mod no_panic;
mod operations;
mod oracle_golden;
mod overrun;
mod paper;
mod pass_times;
mod protocol;
mod qemu;
mod random_passes;
mod random_surfaces;
mod report_page;
mod safety;
mod sample_jobs;
mod scallop_limit;
mod script;
mod session;
mod settings;
mod streaming;
mod swept;
mod unusual_motion;
