//! What the budget needs to know of the firmware's image: its code, its sizes, and the plan for the plugin.

use std::path::Path;

use addr2line::Loader;
use cycle_plugin::plan::Plan;
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind};

use super::{BudgetError, stages};

/// Flash begins here.
const FLASH: u64 = 0x0800_0000;

/// And RAM here.
const RAM: u64 = 0x2000_0000;

/// Exception number of TIM2, whose handler is the sample task.
const TIM2: u32 = 16 + 28;

/// Sizes of the image, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Code and constants in flash.
    pub flash: u64,
    /// Variables, the job store included, without the stack.
    pub ram: u64,
    /// Room for the stack: what of the RAM is left.
    pub stack_room: u64,
}

/// Reads the image.
///
/// # Errors
/// It cannot be read, or is no image of the firmware.
pub fn read(path: &Path) -> Result<(Plan, Sizes), BudgetError> {
    let bytes = std::fs::read(path).map_err(|error| BudgetError::File(path.into(), error.to_string()))?;
    let bad = |error: &dyn std::fmt::Display| BudgetError::Image(error.to_string());
    let file = object::File::parse(bytes.as_slice()).map_err(|error| bad(&error))?;
    let stack_start = file
        .symbols()
        .find(|symbol| symbol.name() == Ok("_stack_start"))
        .ok_or(bad(&"it has no symbol _stack_start"))?
        .address();
    let mut sizes = Sizes {
        stack_room: stack_start.saturating_sub(RAM),
        ..Sizes::default()
    };
    let mut code = Vec::new();
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else {
            continue;
        };
        if sh_flags & u64::from(object::elf::SHF_ALLOC) == 0 {
            continue;
        }
        let offset = section.address().wrapping_sub(FLASH);
        if offset < RAM - FLASH && section.kind() != SectionKind::UninitializedData {
            let data = section.data().map_err(|error| bad(&error))?;
            let from = usize::try_from(offset).map_err(|error| bad(&error))?;
            code.resize(code.len().max(from + data.len()), 0);
            code[from..from + data.len()].copy_from_slice(data);
        } else if section.address() >= RAM {
            sizes.ram += section.size();
        }
    }
    sizes.flash = code.len() as u64;
    let loader = Loader::new(path).map_err(|error| bad(&error))?;
    let base = u32::try_from(FLASH).unwrap_or(0);
    let plan = Plan {
        base,
        exception: TIM2,
        stack_end: u32::try_from(stack_start).map_err(|error| bad(&error))?,
        stages: stages::map(&loader, base, &code),
        code,
    };
    Ok((plan, sizes))
}
