//! The BIGTREETECH SKR Pro V1.2: the pins are in `boards/src/skr_pro.rs`.

/// The board's table.
pub(crate) const BOARD: &boards::Board = &boards::SKR_PRO;
