//! A bare STM32F405RG (or any F405, F407 in a larger package) with an 8 MHz crystal, and drives and switches wired to its pins.
//!
//! All pins are in the smallest package, and so in every package; the LED is the Olimex STM32-H405's. Reasons for
//! the assignment: step pins on one port, for DMA into one set/reset register; inputs on eight different lines of the
//! interrupt controller; no use of the pins of debugger, crystals, boot and USB, nor of PC13 to PC15, whose output current is limited to 3 mA.

use crate::{
    Axis::{X, Y, Z},
    Board, Chip,
    Level::{High, Low},
    Line, Package,
    Port::{A, B, C},
    Role::{
        AtSpeed, Coolant, Direction, Door, DriveFault, EmergencyStop, Enable, LimitMax, LimitMin, Probe,
        SerialRx, SerialTx, SpindleDirection, SpindleEnable, SpindleSpeed, Start, StatusLed, Step,
    },
};

/// The bare chip.
pub const STM32F405: Board = Board {
    id: "stm32f405",
    name: "bare STM32F405 or F407",
    chip: Chip {
        name: "STM32F405RGTx",
        device_id: 0x413,
        flash_bytes: 1024 * 1024,
        package: Package::Lqfp64,
    },
    crystal_mhz: 8,
    build: ("fw-chip", "chip"),
    loader: None,
    dfu: Some(
        "connect BOOT0 to 3.3 V and BOOT1 (PB2) to ground, PA11 and PA12 to D- and D+ of a USB plug, and switch the board on",
    ),
    lines: &[
        Line::new(Step(X), C, 6, High, "the pin"),
        Line::new(Direction(X), B, 12, High, "the pin"),
        Line::new(Enable(X), B, 5, Low, "the pin"),
        Line::new(Step(Y), C, 7, High, "the pin"),
        Line::new(Direction(Y), B, 13, High, "the pin"),
        Line::new(Enable(Y), B, 6, Low, "the pin"),
        Line::new(Step(Z), C, 8, High, "the pin"),
        Line::new(Direction(Z), B, 14, High, "the pin"),
        Line::new(Enable(Z), B, 7, Low, "the pin"),
        Line::new(LimitMin(X), C, 0, High, "the pin"),
        Line::new(LimitMax(X), C, 1, High, "the pin"),
        Line::new(LimitMin(Y), C, 2, High, "the pin"),
        Line::new(LimitMax(Y), C, 3, High, "the pin"),
        Line::new(LimitMin(Z), B, 8, High, "the pin"),
        Line::new(LimitMax(Z), B, 9, High, "the pin"),
        Line::new(EmergencyStop, B, 10, High, "the pin"),
        Line::new(DriveFault, B, 11, High, "the pin"),
        Line::new(Probe, C, 4, High, "the pin"),
        Line::new(Door, C, 5, High, "the pin"),
        Line::new(AtSpeed, B, 0, Low, "the pin"),
        Line::new(Start, B, 1, Low, "the pin"),
        Line::new(SpindleEnable, C, 9, High, "the pin"),
        Line::new(SpindleDirection, C, 10, High, "the pin"),
        Line::new(SpindleSpeed, B, 15, High, "the pin"),
        Line::new(Coolant, C, 11, High, "the pin"),
        Line::new(StatusLed, C, 12, Low, "LED of the STM32-H405"),
        Line::new(SerialTx, A, 9, High, "the pin"),
        Line::new(SerialRx, A, 10, High, "the pin"),
    ],
};
