//! The paper (Lo, Computer-Aided Design 30, 1998) reproduced: its examples, tables and figures, the printed figures against
//! ours. The product does not depend on this crate.
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

pub mod operations;
pub mod paper;
pub mod report;
