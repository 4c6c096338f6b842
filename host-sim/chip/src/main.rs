//! Executes the image that would be flashed to an STM32F405/407, unchanged, without a chip: instructions by Unicorn's Cortex-M4F
//! (`libunicorn2`, loaded at run time), peripherals by the models of this crate.
//!
//! ```text
//!  main.rs ── processor.rs   exceptions, sleep, resets        ── unicorn.rs   instructions (libunicorn2)
//!                 │                                            ── memory.rs    flash and SRAM
//!             chip.rs        the peripherals, and the order of their events
//!                 │          ── machine.rs  carriages, switches, a probe plate
//!                 │          ── script.rs   inputs, hang, fault, brown-out      ── line.rs   the host's pseudo-terminal
//!             bus.rs         address decoding; clocks of peripherals; bit-band      ── loader.rs   what a boot loader leaves behind
//!                 │
//!             part/          rcc (with FLASH, PWR), nvic (with SCB), gpio, timer, dma, usart, watchdog, debug (DWT, DBGMCU)
//! ```
//!
//! Time is counted in cycles of HCLK: each block of instructions by the cost model of `cycle-plugin` (pessimistic, without the flash's wait
//! states), each event of a part to the cycle. The models report complaints about incorrect accesses: a peripheral used without its clock
//! or directly after its clock was enabled, clocks, flash or supply out of their limits, streams changed while enabled, registers that are not modelled.
//!
//! Not modelled: the flash's wait states and its cache, contention on the buses, synchronisers' delays of a few cycles, lazy stacking,
//! tail-chaining and late arrival, `IPSR` (it reads 0 in a handler), analogue behaviour (start-up times are constants, levels are ideal), noise on the line, the debug unit, DMA
//! requests of USART1, and every peripheral that the firmware does not use. Accesses to these are reported as complaints.

mod bus;
mod chip;
mod code;
mod line;
mod loader;
mod machine;
mod memory;
mod options;
mod part;
mod processor;
mod report;
mod script;
mod unicorn;
mod world;

use std::process::ExitCode;
use std::time::Instant;

use boards::{BOARDS, Board, FLASH_BEGIN, MARK_BYTES, MARK_SYMBOL};
use clap::Parser;
use object::{Object, ObjectSegment, ObjectSymbol};

use crate::{
    chip::Chip,
    line::Line,
    memory::Memory,
    options::Options,
    part::flash::SETTINGS,
    processor::{Account, Processor},
};

const SRAM_BEGIN: u32 = 0x2000_0000;
const SRAM_BYTES: u32 = 128 * 1024;
/// SRAM contents after power-on: an arbitrary pattern.
const SRAM_FILL: u8 = 0xa5;
/// Contents of erased flash.
const FLASH_FILL: u8 = 0xff;

/// Fill byte of the flash of a boot loader: an exception that took a vector from there would fail.
const LOADER_FILL: u8 = 0xde;

/// Writes an image to flash: an ELF file, or the flat file that a board's boot loader takes from a card. Returns its board and its first address.
fn load(data: &[u8], flash: Memory) -> Result<(&'static Board, u32), String> {
    if !data.starts_with(&object::elf::ELFMAG) {
        return load_flat(data, flash);
    }
    let file =
        object::read::elf::ElfFile32::<object::Endianness>::parse(data).map_err(|error| error.to_string())?;
    let mut begin = u32::MAX;
    for header in file.elf_program_headers() {
        use object::read::elf::ProgramHeader;
        let endian = object::Endianness::Little;
        let bytes = header.data(endian, data).map_err(|()| "a segment is cut off")?;
        let is_loaded = header.p_type(endian) == object::elf::PT_LOAD && !bytes.is_empty();
        let at = header.p_paddr(endian);
        if is_loaded && !flash.load(at, bytes) {
            return Err(format!("a segment at {at:#x} is outside flash"));
        }
        begin = begin.min(if is_loaded { at } else { begin });
    }
    let mark = file
        .symbols()
        .find(|symbol| symbol.name() == Ok(MARK_SYMBOL))
        .ok_or("the image does not say which board it is for")?;
    let bytes = file
        .segments()
        .find_map(|segment| {
            segment
                .data_range(mark.address(), MARK_BYTES as u64)
                .ok()
                .flatten()
        })
        .ok_or("the board's name is not in the image")?;
    let board = BOARDS
        .into_iter()
        .find(|board| board.mark() == bytes)
        .ok_or("an image for a board that is not known")?;
    Ok((board, begin))
}

/// Writes a flat file to flash, at the address at which its board's loader starts it. Returns its board and that address.
fn load_flat(data: &[u8], flash: Memory) -> Result<(&'static Board, u32), String> {
    let is_in_it = |board: &&Board| data.windows(MARK_BYTES).any(|bytes| bytes == board.mark());
    let board = BOARDS
        .into_iter()
        .find(is_in_it)
        .ok_or("it is neither an ELF file nor a card's image for a known board")?;
    let loader = board
        .loader
        .ok_or_else(|| format!("{} has no boot loader that takes a card's image", board.id))?;
    if !flash.load(loader.image_begin, data) {
        return Err(format!("{} bytes do not fit into flash", data.len()));
    }
    Ok((board, loader.image_begin))
}

fn run(options: Options) -> Result<bool, String> {
    let begun = Instant::now();
    let data =
        std::fs::read(&options.image).map_err(|error| format!("{}: {error}", options.image.display()))?;
    let flash = Memory::new(FLASH_BEGIN, SETTINGS - FLASH_BEGIN, FLASH_FILL);
    let sram = Memory::new(SRAM_BEGIN, SRAM_BYTES, SRAM_FILL);
    let (board, begin) =
        load(&data, flash).map_err(|error| format!("{}: {error}", options.image.display()))?;
    flash.load(FLASH_BEGIN, &vec![LOADER_FILL; (begin - FLASH_BEGIN) as usize]);
    let line = options
        .pty
        .as_ref()
        .map(|link| Line::open(link))
        .transpose()
        .map_err(|error| format!("the serial line: {error}"))?;
    options.watch_input();
    let report = options.report.clone();
    let mut chip = Chip::new(board, options, flash, sram, line)?;
    chip.image_begin = begin;
    chip.leave_loader();
    chip.plan();
    let mut account = Account {
        least_sp: u32::MAX,
        ..Account::default()
    };
    loop {
        let processor = Processor::new(chip, flash, sram, account)?;
        let flags;
        (chip, account, flags) = processor.run();
        match flags {
            Some(flags) => chip.restart(flags),
            None => break,
        }
    }
    chip.finish_record();
    let said = report::of(&chip, &account, begun.elapsed().as_secs_f64());
    match report {
        Some(path) => std::fs::write(&path, format!("{said:#}\n"))
            .map_err(|error| format!("{}: {error}", path.display()))?,
        None => println!("{said:#}"),
    }
    Ok(chip.world.complained == 0)
}

fn main() -> ExitCode {
    match run(Options::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
