//! Texts of a problem and its remedy.

use super::Problem;

/// The problem as a sentence.
#[must_use]
pub fn sentence(problem: &Problem) -> String {
    match problem {
        Problem::BadSelector(text) => format!("--probe {text} names no probe"),
        Problem::NoProbe => "no debug probe was found".to_owned(),
        Problem::SeveralProbes(probes) => {
            format!("there are {} debug probes: {}", probes.len(), probes.join("; "))
        }
        Problem::NotAllowed(probe) => {
            format!("there is a debug probe ({probe}), but this user may not open it")
        }
        Problem::NotOpened(why) => format!("the debug probe cannot be opened: {why}"),
        Problem::UnknownChip(chip) => format!("probe-rs does not support a chip named {chip}"),
        Problem::NoChip(why) => format!("the probe is connected, but no chip answers: {why}"),
        Problem::OtherChip(id) => {
            format!("another chip answers: its DEV_ID is {id:#05x}, that of an STM32F405 or F407 is 0x413")
        }
        Problem::TooLarge {
            flash_bytes,
            image_bytes,
        } => format!("the image needs {image_bytes} bytes of flash, the chip has {flash_bytes}"),
        Problem::NotWritten(why) => format!("flash could not be written: {why}"),
        Problem::Differs(address) => {
            format!("the chip contains another image: flash differs, first at {address:#010x}")
        }
        Problem::BadImage(why) => format!("the image cannot be used: {why}"),
        Problem::NoLog(why) => format!("the chip contains this image, but has no log: {why}"),
        Problem::Gone(why) => format!("the connection to the chip or the probe was lost: {why}"),
    }
}

/// The remedy.
#[must_use]
pub fn remedy(problem: &Problem) -> &'static str {
    match problem {
        Problem::BadSelector(_) => "give it as VID:PID or VID:PID:SERIAL, hexadecimal, such as 0483:3748",
        Problem::NoProbe => {
            "connect an ST-Link, J-Link or CMSIS-DAP v2 probe by a USB cable with data lines, and check it with lsusb; in a virtual \
             machine or container, pass the device through; check the selector of --probe"
        }
        Problem::SeveralProbes(_) => "choose one with --probe VID:PID:SERIAL",
        Problem::NotAllowed(_) => {
            "give users access: put probe-rs's udev rules (69-probe-rs.rules, probe.rs/docs/getting-started/probe-setup) into \
             /etc/udev/rules.d, run `sudo udevadm control --reload && sudo udevadm trigger`, and reconnect the probe"
        }
        Problem::NotOpened(_) => {
            "close other programs that use it (a debugger, another `cargo sim log`), or reconnect it; old ST-Links need a firmware update"
        }
        Problem::UnknownChip(_) => "leave --chip out, or give a name such as `STM32F407VETx`",
        Problem::NoChip(_) => {
            "check SWDIO, SWCLK, ground and 3.3 V against docs/bring-up.md, that the board has power, and that the wires are short; with \
             NRST connected, the probe can reach a chip whose firmware disables the debug port"
        }
        Problem::OtherChip(_) => {
            "this firmware is for the STM32F405 and F407 only; check which board is connected"
        }
        Problem::TooLarge { .. } => "use a chip with more flash",
        Problem::NotWritten(_) => {
            "try again; remove the write protection of a protected chip first (STM32CubeProgrammer, option bytes)"
        }
        Problem::Differs(_) => {
            "give the image that is in the chip with --image, or write this one as the board was written before: by a card (`cargo sim flash --sd \
             DIR`) where its own loader did it, which a probe would replace, else by the probe (`cargo sim flash`)"
        }
        Problem::BadImage(_) => "name an image of the firmware, or leave --image out",
        Problem::NoLog(_) => {
            "reset the board; if there is still no log, the crystal may not oscillate, and the firmware waits for it"
        }
        Problem::Gone(_) => "check the cables and the board's power, and start again",
    }
}
