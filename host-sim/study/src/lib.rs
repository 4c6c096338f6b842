//! The paper (Lo, Computer-Aided Design 30, 1998) reproduced: its examples, tables and figures, the printed figures against
//! ours. The product does not depend on this crate.

pub mod operations;
pub mod paper;
pub mod report;
