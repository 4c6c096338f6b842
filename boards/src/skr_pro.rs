//! BIGTREETECH SKR Pro V1.2: STM32F407ZGT6, 8 MHz crystal, six sockets for step drivers.
//!
//! Sources: the manufacturer's schematic (`SKR-PRO-V1.2/Schematic/SKR-PRO-V1.2.PDF`) and pin diagram
//! (`SKR-PRO-V1.2/manual/SKR-PRO-V1.2PIN.PDF`, both in the repository bigtreetech/BIGTREETECH-SKR-PRO-V1.1), compared
//! with Marlin's `pins_BTT_SKR_PRO_common.h` and Klipper's `generic-bigtreetech-skr-pro.cfg`, which agree.
//!
//! Reasons for the assignment:
//! - Step pins of X, Y and Z (and E0) are all on port E, as required by DMA into one set/reset register.
//! - Each endstop socket has 4.7 kOhm to 3.3 V, 100 nF to ground (0.5 ms) and a red LED that is lit while the pin is high:
//!   with normally closed switches, it is lit when the limit is reached. The sockets E0, E1, E2 take the upper ends.
//! - Emergency stop and drive fault are on the header EXTENSION-1, which nothing else uses: PC9 is next to ground, so that a
//!   two-pole plug fits. The header has no filter; the chip's pull-up (40 kOhm) holds the line.
//! - Probe, safety door and the spindle's contact are on EXP1, whose pin 2 is ground: their port is one that each tick reads anyway.
//! - The start button is on EXP2, whose pin 2 is ground, on the same port.
//! - The spindle is on EXP1 and EXP2, 3.3 V: enable and direction, and PB15 as the only free output of a timer that nothing else uses. FAN0 switches the coolant.
//! - USART1 is on the TFT socket, at 3.3 V. USB goes to the OTG port, which this firmware does not use.
//! - The LED D13 is connected to PA7 through 1 kOhm and is lit while the pin is high.
//! - The maker's boot loader is in sectors 0 and 1, 32 KB: Marlin's environment `BIGTREE_SKR_PRO` and Klipper's configuration link behind it, too. The chip's own loader
//!   cannot be reached by USB on this board (Klipper's `Bootloaders.md`), but by USART1 on the TFT socket.
//! - Heaters and fans are switched by MOSFETs whose inputs are active high, the enable inputs of the other three drivers are active low: all are
//!   kept off.

use crate::{
    Axis::{X, Y, Z},
    Board, Chip,
    Level::{High, Low},
    Line, Loader, Package,
    Port::{A, B, C, D, E, F, G},
    Role::{
        AtSpeed, Coolant, Direction, Door, DriveFault, EmergencyStop, Enable, LimitMax, LimitMin, Parked,
        Probe, SerialRx, SerialTx, SpindleDirection, SpindleEnable, SpindleSpeed, Start, StatusLed, Step,
    },
};

/// BIGTREETECH SKR Pro V1.2.
pub const SKR_PRO: Board = Board {
    id: "skr-pro",
    name: "BIGTREETECH SKR Pro V1.2",
    chip: Chip {
        name: "STM32F407ZGTx",
        device_id: 0x413,
        flash_bytes: 1024 * 1024,
        package: Package::Lqfp144,
    },
    crystal_mhz: 8,
    build: ("fw-skr-pro", "skr-pro"),
    loader: Some(Loader {
        build: ("fw-skr-pro-card", "skr-pro-card"),
        image_begin: 0x0800_8000,
        file: "firmware.bin",
        done_file: "FIRMWARE.CUR",
    }),
    dfu: None,
    lines: &[
        Line::new(Step(X), E, 9, High, "driver socket X"),
        Line::new(Direction(X), F, 1, High, "driver socket X"),
        Line::new(Enable(X), F, 2, Low, "driver socket X"),
        Line::new(Step(Y), E, 11, High, "driver socket Y"),
        Line::new(Direction(Y), E, 8, High, "driver socket Y"),
        Line::new(Enable(Y), D, 7, Low, "driver socket Y"),
        Line::new(Step(Z), E, 13, High, "driver socket Z"),
        Line::new(Direction(Z), C, 2, High, "driver socket Z"),
        Line::new(Enable(Z), C, 0, Low, "driver socket Z"),
        Line::new(LimitMin(X), B, 10, High, "endstop socket X-"),
        Line::new(LimitMax(X), E, 15, High, "endstop socket E0"),
        Line::new(LimitMin(Y), E, 12, High, "endstop socket Y-"),
        Line::new(LimitMax(Y), E, 10, High, "endstop socket E1"),
        Line::new(LimitMin(Z), G, 8, High, "endstop socket Z-"),
        Line::new(LimitMax(Z), G, 5, High, "endstop socket E2"),
        Line::new(EmergencyStop, C, 9, High, "EXTENSION-1, beside GND"),
        Line::new(DriveFault, C, 4, High, "EXTENSION-1, fourth of GND's row"),
        Line::new(Probe, G, 2, High, "EXP1, pin 6"),
        Line::new(Door, G, 7, High, "EXP1, pin 3"),
        Line::new(AtSpeed, G, 4, Low, "EXP1, pin 10"),
        Line::new(Start, G, 10, Low, "EXP2, pin 8"),
        Line::new(SpindleEnable, G, 3, High, "EXP1, pin 5"),
        Line::new(SpindleDirection, G, 6, High, "EXP1, pin 4"),
        Line::new(SpindleSpeed, B, 15, High, "EXP2, pin 5"),
        Line::new(Coolant, C, 8, High, "FAN0"),
        Line::new(StatusLed, A, 7, High, "LED D13 on the board"),
        Line::new(SerialTx, A, 9, High, "TFT socket, TX1"),
        Line::new(SerialRx, A, 10, High, "TFT socket, RX1"),
        Line::new(Parked, B, 1, High, "HEAT0"),
        Line::new(Parked, D, 14, High, "HEAT1"),
        Line::new(Parked, B, 0, High, "HEAT2"),
        Line::new(Parked, D, 12, High, "BED"),
        Line::new(Parked, E, 5, High, "FAN1"),
        Line::new(Parked, E, 6, High, "FAN2"),
        Line::new(Parked, C, 3, Low, "driver socket E0, enable"),
        Line::new(Parked, A, 3, Low, "driver socket E1, enable"),
        Line::new(Parked, F, 0, Low, "driver socket E2, enable"),
    ],
};
