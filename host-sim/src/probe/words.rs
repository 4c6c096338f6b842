//! What people are told about a problem, and what they can do.

use super::Problem;

/// What is wrong, as a sentence.
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
        Problem::UnknownChip(chip) => format!("probe-rs knows no chip of the name {chip}"),
        Problem::NoChip(why) => format!("the probe is there, but no chip answers: {why}"),
        Problem::OtherChip(id) => {
            format!("another chip answers: its DEV_ID is {id:#05x}, that of an STM32F405 or F407 is 0x413")
        }
        Problem::TooLarge {
            flash_bytes,
            image_bytes,
        } => format!("the image needs {image_bytes} bytes of flash, and the chip has {flash_bytes}"),
        Problem::NotWritten(why) => format!("flash could not be written: {why}"),
        Problem::Differs(address) => {
            format!("what is in the chip is not this image: flash differs from it, first at {address:#010x}")
        }
        Problem::BadImage(why) => format!("the image is of no use: {why}"),
        Problem::NoLog(why) => format!("the chip has this image, but there is no log: {why}"),
        Problem::Gone(why) => format!("the chip or the probe went away: {why}"),
    }
}

/// What can be done about it.
#[must_use]
pub fn remedy(problem: &Problem) -> &'static str {
    match problem {
        Problem::BadSelector(_) => "name it as VID:PID or VID:PID:SERIAL, hexadecimal, such as 0483:3748",
        Problem::NoProbe => {
            "connect an ST-Link, J-Link or CMSIS-DAP v2 probe by a USB cable that carries data, and look for it with lsusb; in a virtual \
             machine or container, pass the device through; with --probe, look at what is named there"
        }
        Problem::SeveralProbes(_) => "say which with --probe VID:PID:SERIAL",
        Problem::NotAllowed(_) => {
            "give users access: put probe-rs's udev rules (69-probe-rs.rules, probe.rs/docs/getting-started/probe-setup) into \
             /etc/udev/rules.d, run `sudo udevadm control --reload && sudo udevadm trigger`, and plug the probe in anew"
        }
        Problem::NotOpened(_) => {
            "close what else uses it (a debugger, another `cargo sim log`), or plug it in anew; old ST-Links want new firmware"
        }
        Problem::UnknownChip(_) => "leave --chip out, or name it as in `STM32F407VETx`",
        Problem::NoChip(_) => {
            "check SWDIO, SWCLK, ground and 3.3 V against docs/bring-up.md, that the board has power, and that the wires are short; NRST \
             connected lets the probe reach a chip whose program has gone astray"
        }
        Problem::OtherChip(_) => {
            "this firmware is for the STM32F405 and F407 only; check which board is connected"
        }
        Problem::TooLarge { .. } => "take a chip with more flash",
        Problem::NotWritten(_) => {
            "try again; a chip that is write-protected has to be freed first (STM32CubeProgrammer, option bytes)"
        }
        Problem::Differs(_) => {
            "write it with `cargo sim flash`, or name the image that is in the chip with --image"
        }
        Problem::BadImage(_) => "name an image of the firmware, or leave --image out",
        Problem::NoLog(_) => {
            "reset the board; if it stays silent, the crystal may not run, and the firmware waits for it"
        }
        Problem::Gone(_) => "check the cables and the board's power, and start again",
    }
}
