//! Without a debug probe: the image on a card for the board's boot loader, or by USB for the loader in the chip's ROM (DFU).

use std::path::Path;
use std::process::{Command, Stdio};

use boards::{Board, FLASH_BEGIN};
use programs::{Part, image_remedy};
use protocol::frame::crc32;
use serde_json::json;

use super::super::{Failure, Result, out::say, output_file};
use super::Arguments;
use crate::probe::Image;

/// The program that talks to the chips' loaders in ROM.
const DFU_UTIL: &str = "dfu-util";
/// USB vendor of these loaders.
const DFU_VENDOR: u16 = 0x0483;
/// USB product of these loaders.
const DFU_PRODUCT: u16 = 0xdf11;

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    match &arguments.sd {
        Some(folder) => card(arguments, folder),
        None => dfu(arguments),
    }
}

/// The image as it lies in flash from `begin` on.
fn flat(arguments: &Arguments, part: Part, begin: u32) -> Result<Vec<u8>> {
    let board = arguments.place.board();
    let path = arguments.place.image_of(part)?;
    let refused = |why: String| Failure::input(format!("{}: {why}", path.display()), image_remedy(part));
    let image = Image::load(&path).map_err(refused)?;
    image.check_at(board, begin).map_err(refused)?;
    image
        .flat(begin)
        .ok_or_else(|| refused("a part of it lies before its begin".to_owned()))
}

/// Writes the file that the board's loader looks for.
fn card(arguments: &Arguments, folder: &Path) -> Result<()> {
    let board = arguments.place.board();
    let Some(loader) = board.loader else {
        return Err(Failure::input(
            format!("{} has no boot loader that reads a card", board.name),
            other_ways(board),
        ));
    };
    if !folder.is_dir() {
        return Err(Failure::input(
            format!("there is no folder {}", folder.display()),
            "give the folder where the card is mounted; it is formatted as FAT32",
        ));
    }
    let path = folder.join(loader.file);
    output_file::check(&path, arguments.force)?;
    let bytes = flat(arguments, Part::LoaderImage(board), loader.image_begin)?;
    output_file::write(&path, &bytes, arguments.force)?;
    if arguments.json {
        say!(
            "{}",
            json!({ "board": board.id, "file": path, "bytes": bytes.len(), "begin": loader.image_begin })
        );
        return Ok(());
    }
    say!(
        "{}: {} bytes for {}, whose loader writes them from {:#010x} on",
        path.display(),
        bytes.len(),
        board.name,
        loader.image_begin
    );
    say!(
        "  next: unmount the card, put it into the board, switch the board on; after some seconds the file is called {}",
        loader.done_file
    );
    Ok(())
}

/// What else writes the flash of this board.
fn other_ways(board: &Board) -> String {
    let ways = [
        board.loader.map(|_| "a card: --sd DIR"),
        board.dfu.map(|_| "USB: --dfu"),
        Some("a debug probe: neither option"),
    ];
    let ways: Vec<_> = ways.into_iter().flatten().collect();
    format!("take {}", ways.join("; or "))
}

fn dfu(arguments: &Arguments) -> Result<()> {
    let board = arguments.place.board();
    let Some(enter) = board.dfu else {
        return Err(Failure::input(
            format!("{} does not reach the chip's own loader by USB", board.name),
            other_ways(board),
        ));
    };
    if let Some(path) = &arguments.dfu_file {
        output_file::check(path, arguments.force)?;
    } else if !has_dfu_util() {
        return Err(Failure::input(
            format!("there is no program {DFU_UTIL}"),
            format!(
                "install it (apt-get install {DFU_UTIL}), or write a file for another program: --dfu-file FILE"
            ),
        ));
    }
    let flat = flat(arguments, Part::BoardImage(board), FLASH_BEGIN)?;
    if let Some(path) = &arguments.dfu_file {
        output_file::write(path, &dfuse_file(FLASH_BEGIN, &flat), arguments.force)?;
        if arguments.json {
            say!(
                "{}",
                json!({ "board": board.id, "file": path, "bytes": flat.len(), "begin": FLASH_BEGIN })
            );
            return Ok(());
        }
        say!(
            "{}: {} bytes for {}, from {FLASH_BEGIN:#010x} on",
            path.display(),
            flat.len(),
            board.name
        );
        say!("  next: {enter}; write the file by a program for DfuSe, such as STM32CubeProgrammer");
        return Ok(());
    }
    write_by_usb(board, enter, &flat)?;
    if arguments.json {
        say!(
            "{}",
            json!({ "board": board.id, "bytes": flat.len(), "begin": FLASH_BEGIN, "written": true })
        );
    } else {
        say!("{}: written by USB: {} bytes", board.name, flat.len());
        say!("  next: connect BOOT0 to ground, and switch the board off and on");
    }
    Ok(())
}

fn has_dfu_util() -> bool {
    Command::new(DFU_UTIL)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Has dfu-util write the image; its own words say what went wrong.
fn write_by_usb(board: &Board, enter: &str, flat: &[u8]) -> Result<()> {
    let failed = |why: String| Failure::Failed(Some(why));
    let mut file = tempfile::NamedTempFile::new().map_err(|error| failed(error.to_string()))?;
    std::io::Write::write_all(&mut file, flat).map_err(|error| failed(error.to_string()))?;
    let ran = Command::new(DFU_UTIL)
        .args(["--device", &format!("{DFU_VENDOR:04x}:{DFU_PRODUCT:04x}")])
        .args(["--alt", "0", "--dfuse-address", &format!("{FLASH_BEGIN:#010x}")])
        .arg("--download")
        .arg(file.path())
        .output()
        .map_err(|error| failed(format!("{DFU_UTIL} does not start: {error}")))?;
    if ran.status.success() {
        return Ok(());
    }
    let words = String::from_utf8_lossy(&ran.stderr);
    let words = words.lines().rfind(|line| !line.trim().is_empty());
    Err(failed(format!(
        "{DFU_UTIL} has not written {}: {}\n  help: {enter}; `lsusb` then lists {DFU_VENDOR:04x}:{DFU_PRODUCT:04x}. Without permission: run it as root, or install a udev rule",
        board.name,
        words.unwrap_or("it says nothing"),
    )))
}

/// A DfuSe file of one element (ST's UM0391): prefix, one target with one element, suffix.
fn dfuse_file(begin: u32, data: &[u8]) -> Vec<u8> {
    const PREFIX: usize = 11;
    const TARGET: usize = 274;
    const ELEMENT: usize = 8;
    let length = |bytes: usize| u32::try_from(bytes).unwrap_or(u32::MAX).to_le_bytes();
    let mut file = Vec::new();
    file.extend_from_slice(b"DfuSe\x01");
    file.extend_from_slice(&length(PREFIX + TARGET + ELEMENT + data.len()));
    file.push(1);
    // Target: alternate setting 0, with a name of 255 bytes.
    let name = b"Isofeed";
    file.extend_from_slice(b"Target\0");
    file.extend_from_slice(&1_u32.to_le_bytes());
    file.extend_from_slice(name);
    file.resize(file.len() + 255 - name.len(), 0);
    file.extend_from_slice(&length(ELEMENT + data.len()));
    file.extend_from_slice(&1_u32.to_le_bytes());
    file.extend_from_slice(&begin.to_le_bytes());
    file.extend_from_slice(&length(data.len()));
    file.extend_from_slice(data);
    // Suffix: any release of the device, its identity, DfuSe's version, its own length; then the check of everything before, which is not inverted.
    file.extend_from_slice(&[0xff, 0xff]);
    file.extend_from_slice(&DFU_PRODUCT.to_le_bytes());
    file.extend_from_slice(&DFU_VENDOR.to_le_bytes());
    file.extend_from_slice(&0x011a_u16.to_le_bytes());
    file.extend_from_slice(b"UFD");
    file.push(16);
    let check = !crc32(&file);
    file.extend_from_slice(&check.to_le_bytes());
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the offsets of UM0391, not by the code above.
    #[test]
    fn a_dfuse_file_has_its_fields_in_their_places() {
        let data: Vec<u8> = (0..=250).collect();
        let file = dfuse_file(FLASH_BEGIN, &data);
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
        assert_eq!((&file[..6], file[10]), (&b"DfuSe\x01"[..], 1));
        assert_eq!(word(6) as usize, file.len() - 16);
        assert_eq!((&file[11..17], file[17], word(18)), (&b"Target"[..], 0, 1));
        assert_eq!((word(277) as usize, word(281)), (8 + data.len(), 1));
        assert_eq!((word(285), word(289) as usize), (FLASH_BEGIN, data.len()));
        assert_eq!(file[293..293 + data.len()], data);
        let suffix = &file[293 + data.len()..];
        assert_eq!(
            suffix[..12],
            [
                0xff, 0xff, 0x11, 0xdf, 0x83, 0x04, 0x1a, 0x01, b'U', b'F', b'D', 16
            ]
        );
        // The residue of CRC-32: of a file with its check, in the register.
        let residue = file.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
                crc >> 1 ^ if crc & 1 != 0 { 0xedb8_8320 } else { 0 }
            })
        });
        assert_eq!(residue, 0);
    }
}
