//! The firmware's image: its code, its sizes, and the plan for the plugin.

use std::path::{Path, PathBuf};

use addr2line::Loader;
use boards::STM32F405;
use cycle_plugin::plan::Plan;
use interp_core::STORE_WORDS;
use object::{File, Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, SymbolKind};
use programs::Part;

use super::{BudgetError, stages};
use machine::remote::qemu::QemuError;

/// First address of the flash.
const FLASH: u64 = 0x0800_0000;

/// First address of the RAM.
const RAM: u64 = 0x2000_0000;

/// Exception number of TIM2, whose handler is the sample task.
const TIM2: u32 = 16 + 28;

/// Exception number of EXTI0, whose handler is the planning task.
const EXTI0: u32 = 16 + 6;

/// Sizes of the image, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Code and constants in flash.
    pub flash: u64,
    /// Variables, without the stack and the job store.
    pub ram: u64,
    /// The job store.
    pub store: u64,
    /// RAM left for the stack.
    pub stack_room: u64,
}

fn bad(error: &dyn std::fmt::Display) -> BudgetError {
    BudgetError::Image(error.to_string())
}

/// The firmware for the chip, whose flash and RAM count; in a checkout built first where it has changed.
///
/// # Errors
/// It is not there, or cannot be built: Cargo's own message.
pub fn chip() -> Result<PathBuf, BudgetError> {
    let image = programs::find(Part::BoardImage(&STM32F405));
    image.map_err(|error| BudgetError::Qemu(QemuError::Firmware(error)))
}

/// Whether a section is in the board's memory.
fn is_loaded<'data>(section: &impl ObjectSection<'data>) -> bool {
    let SectionFlags::Elf { sh_flags } = section.flags() else {
        return false;
    };
    sh_flags & u64::from(object::elf::SHF_ALLOC) != 0
}

/// Address where the stack begins; it grows down to the first address of the RAM.
fn stack_start(file: &File) -> Result<u64, BudgetError> {
    file.symbols()
        .find(|symbol| symbol.name() == Ok("_stack_start"))
        .map(|symbol| symbol.address())
        .ok_or_else(|| bad(&"it has no symbol _stack_start"))
}

/// A plan with the code, without stages.
///
/// # Errors
/// The file is not an image of the firmware.
pub fn bare_plan(file: &File) -> Result<Plan, BudgetError> {
    let mut code = Vec::new();
    for section in file.sections().filter(is_loaded) {
        let offset = section.address().wrapping_sub(FLASH);
        if offset < RAM - FLASH && section.kind() != SectionKind::UninitializedData {
            let data = section.data().map_err(|error| bad(&error))?;
            let from = usize::try_from(offset).map_err(|error| bad(&error))?;
            code.resize(code.len().max(from + data.len()), 0);
            code[from..from + data.len()].copy_from_slice(data);
        }
    }
    Ok(Plan {
        base: u32::try_from(FLASH).unwrap_or(0),
        exception: TIM2,
        planning: EXTI0,
        stack_end: u32::try_from(stack_start(file)?).map_err(|error| bad(&error))?,
        stages: Vec::new(),
        starts: Vec::new(),
        code,
    })
}

/// Sizes of an image.
///
/// # Errors
/// The file cannot be read, or is not an image of the firmware.
pub fn sizes(path: &Path) -> Result<Sizes, BudgetError> {
    let bytes = std::fs::read(path).map_err(|error| BudgetError::File(path.into(), error.to_string()))?;
    sizes_of(&File::parse(bytes.as_slice()).map_err(|error| bad(&error))?)
}

fn sizes_of(file: &File) -> Result<Sizes, BudgetError> {
    let variables = file.sections().filter(is_loaded);
    let ram: u64 = variables
        .filter(|section| section.address() >= RAM)
        .map(|section| section.size())
        .sum();
    let store = 4 * STORE_WORDS as u64;
    Ok(Sizes {
        flash: bare_plan(file)?.code.len() as u64,
        ram: ram.saturating_sub(store),
        store,
        stack_room: stack_start(file)?.saturating_sub(RAM),
    })
}

/// Whether a function begins at each halfword of the code.
fn starts(file: &File, plan: &Plan) -> Vec<bool> {
    let mut starts = vec![false; plan.code.len() / 2];
    for symbol in file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text) {
        let offset = (symbol.address() & !1).wrapping_sub(u64::from(plan.base));
        if let Some(place) = usize::try_from(offset / 2)
            .ok()
            .and_then(|index| starts.get_mut(index))
        {
            *place = true;
        }
    }
    starts
}

/// Reads the image: the plan for the plugin, and the sizes.
///
/// # Errors
/// The file cannot be read, is not an image of the firmware, or lacks a function of the table of stages.
pub fn read(path: &Path) -> Result<(Plan, Sizes), BudgetError> {
    let bytes = std::fs::read(path).map_err(|error| BudgetError::File(path.into(), error.to_string()))?;
    let file = File::parse(bytes.as_slice()).map_err(|error| bad(&error))?;
    let mut plan = bare_plan(&file)?;
    let lines = Loader::new(path).map_err(|error| bad(&error))?;
    plan.stages = stages::map(&lines, plan.base, &plan.code).map_err(|missing| {
        bad(&format!(
            "{} in the table of host-sim/cycles/src/stages.rs: no such function in the image; was it renamed?",
            missing.join(", ")
        ))
    })?;
    plan.starts = starts(&file, &plan);
    Ok((plan, sizes_of(&file)?))
}
