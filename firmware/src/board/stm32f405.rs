//! A bare STM32F405 or F407: the pins are in `boards/src/stm32f405.rs`.

/// The board's table.
pub(crate) const BOARD: &boards::Board = &boards::STM32F405;
