//! An image of the firmware: its segments in flash, and the board that it is for. The debug-probe program
//! (`host-sim/debug-probe`) compiles this file too.

use std::path::Path;

use boards::{Board, FLASH_BEGIN, MARK_BYTES, MARK_SYMBOL};
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Architecture, LittleEndian, Object, ObjectSection, ObjectSymbol};

/// Valid addresses of the initial stack pointer: 128 KiB of RAM (RM0090, 2.3.1).
const RAM: std::ops::RangeInclusive<u32> = 0x2000_0000..=0x2002_0000;
/// Symbol of the control block of the log.
const RTT_SYMBOL: &str = "_SEGGER_RTT";

/// An image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Segments in flash: address and bytes; ascending, not empty, not overlapping.
    pub segments: Vec<(u32, Vec<u8>)>,
    /// The board named in the image; `None` in an image of other firmware.
    pub board: Option<String>,
    /// Address of the control block of the log; `None` in the image for QEMU.
    pub rtt: Option<u32>,
}

type Elf<'a> = ElfFile32<'a, LittleEndian>;

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// The file cannot be read, is no ELF file for ARM, has no segments in flash, or overlapping ones; as text.
    pub fn load(path: &Path) -> Result<Self, String> {
        let bytes = std::fs::read(path).map_err(|error| format!("cannot read it: {error}"))?;
        Self::parse(&bytes)
    }

    /// Parses the bytes of an ELF file.
    ///
    /// # Errors
    /// As [`Image::load`].
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        let elf =
            Elf::parse(bytes).map_err(|error| format!("it is no ELF file of a 32-bit chip: {error}"))?;
        if elf.architecture() != Architecture::Arm {
            return Err("it is for another processor than ARM".to_owned());
        }
        let mut segments = Vec::new();
        for header in elf.elf_program_headers() {
            if header.p_type(LittleEndian) != PT_LOAD || header.p_filesz(LittleEndian) == 0 {
                continue;
            }
            let data = header
                .data(LittleEndian, bytes)
                .map_err(|()| "a segment reaches beyond the file's end".to_owned())?;
            segments.push((header.p_paddr(LittleEndian), data.to_vec()));
        }
        segments.sort_unstable_by_key(|(address, _)| *address);
        let ends = |(address, data): &(u32, Vec<u8>)| u64::from(*address) + data.len() as u64;
        if segments.is_empty() {
            return Err("it has nothing to write to flash".to_owned());
        }
        if segments.windows(2).any(|two| ends(&two[0]) > u64::from(two[1].0)) {
            return Err("its parts overlap".to_owned());
        }
        Ok(Self {
            segments,
            board: mark(&elf),
            rtt: symbol(&elf, RTT_SYMBOL),
        })
    }

    /// Number of bytes to write.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.segments.iter().map(|(_, data)| data.len() as u64).sum()
    }

    /// End of the last segment relative to [`FLASH_BEGIN`], bytes.
    ///
    /// # Errors
    /// A segment begins before flash, or ends beyond the address space; as text.
    pub fn reach_bytes(&self) -> Result<u32, String> {
        let mut reach = 0;
        for (address, data) in &self.segments {
            let end = u32::try_from(data.len()).ok().and_then(|length| {
                let offset = address.checked_sub(FLASH_BEGIN)?;
                offset.checked_add(length)
            });
            let Some(end) = end else {
                return Err(format!(
                    "{} bytes of it belong to {address:#010x}, which is no flash",
                    data.len()
                ));
            };
            reach = reach.max(end);
        }
        Ok(reach)
    }

    /// Checks that the image is for this board, fits its flash, and starts at its begin.
    ///
    /// # Errors
    /// The first check that fails, as text.
    pub fn check_for(&self, board: &Board) -> Result<(), String> {
        self.check_at(board, FLASH_BEGIN)
    }

    /// The same for an image that the board may hold already: it starts at flash's begin, or behind the board's loader.
    ///
    /// # Errors
    /// Those of [`Image::check_for`].
    pub fn check_in_chip(&self, board: &Board) -> Result<(), String> {
        let behind_loader = || {
            board
                .loader
                .map(|loader| self.check_at(board, loader.image_begin))
        };
        self.check_for(board)
            .or_else(|why| behind_loader().unwrap_or(Err(why)))
    }

    /// The same for an image that starts at `begin`, behind a loader.
    ///
    /// # Errors
    /// The first check that fails, as text.
    pub fn check_at(&self, board: &Board, begin: u32) -> Result<(), String> {
        match self.board.as_deref() {
            Some(id) if id == board.id => {}
            Some(id) => return Err(format!("the image is for the board {id}, not for {}", board.id)),
            None => return Err("it is no image of this firmware".to_owned()),
        }
        let (reach, room) = (self.reach_bytes()?, board.chip.flash_bytes);
        if reach > room {
            return Err(format!(
                "it needs {reach} bytes of flash, and the chip has {room}"
            ));
        }
        self.check_start(begin)
    }

    /// The bytes from `begin` to the end of the last segment; between segments those of erased flash. None where a segment lies before `begin`.
    #[must_use]
    pub fn flat(&self, begin: u32) -> Option<Vec<u8>> {
        let mut flat = Vec::new();
        for (address, data) in &self.segments {
            flat.resize(usize::try_from(address.checked_sub(begin)?).ok()?, 0xff);
            flat.extend_from_slice(data);
        }
        Some(flat)
    }

    /// Checks the vector table: stack pointer in RAM, reset vector in flash with the Thumb bit.
    fn check_start(&self, begin: u32) -> Result<(), String> {
        let reach = self.reach_bytes()?;
        let start = match self.segments.first() {
            Some((address, data)) if *address == begin && data.len() >= 8 => data,
            _ if begin == FLASH_BEGIN => {
                return Err(format!(
                    "it has no vector table at {FLASH_BEGIN:#010x}, where the chip begins: is it for a loader?"
                ));
            }
            _ => {
                return Err(format!(
                    "it has no vector table at {begin:#010x}, where it would be started"
                ));
            }
        };
        let word = |at: usize| u32::from_le_bytes([start[at], start[at + 1], start[at + 2], start[at + 3]]);
        let (stack, reset) = (word(0), word(4));
        let in_flash = reset
            .checked_sub(FLASH_BEGIN)
            .is_some_and(|offset| offset < reach && reset >= begin);
        if !RAM.contains(&stack) || !in_flash || reset & 1 == 0 {
            return Err(format!(
                "its vector table is none: stack at {stack:#010x}, start at {reset:#010x}"
            ));
        }
        Ok(())
    }
}

fn symbol(elf: &Elf<'_>, name: &str) -> Option<u32> {
    let found = elf.symbols().find(|symbol| symbol.name() == Ok(name))?;
    u32::try_from(found.address()).ok()
}

/// Name of the board, stored at [`MARK_SYMBOL`].
fn mark(elf: &Elf<'_>) -> Option<String> {
    let address = symbol(elf, MARK_SYMBOL)?;
    let bytes = elf.sections().find_map(|section| {
        let data = section.data_range(u64::from(address), MARK_BYTES as u64);
        data.ok().flatten()
    })?;
    let name = std::str::from_utf8(bytes).ok()?;
    Some(name.trim_end_matches('\0').to_owned())
}
