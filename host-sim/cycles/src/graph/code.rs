//! Functions of the image by its symbols, code and data by its mapping symbols (`$t`, `$d`), and functions whose address is taken:
//! the targets of indirect calls.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::Range;

use cycle_plugin::decode::{Class, Instruction, decode};
use cycle_plugin::plan::Plan;
use object::{File, Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};

/// A function of the image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// Demangled name.
    pub name: String,
    /// Address of its first instruction.
    pub start: u32,
    /// Address after its last instruction.
    pub end: u32,
}

/// Code of the image with its symbols.
#[derive(Clone, Debug)]
pub struct Code {
    plan: Plan,
    /// Functions in order of their addresses.
    pub functions: Vec<Function>,
    /// Addresses from which on there is code (`true`) or data, within [`Self::text`].
    mapping: Vec<(u32, bool)>,
    /// Sections with instructions.
    text: Vec<Range<u32>>,
}

fn demangled(name: &str) -> String {
    addr2line::demangle_auto(Cow::Borrowed(name), None).into_owned()
}

impl Code {
    /// Reads the symbols of an image.
    #[must_use]
    pub fn new(file: &File, plan: Plan) -> Self {
        let address = |address: u64| u32::try_from(address).unwrap_or(u32::MAX);
        let mut functions: Vec<Function> = Vec::new();
        let mut mapping = Vec::new();
        for symbol in file.symbols() {
            let name = symbol.name().unwrap_or_default();
            let at = address(symbol.address());
            match name.get(..2) {
                Some("$t") => mapping.push((at, true)),
                Some("$d") => mapping.push((at, false)),
                _ if symbol.kind() == SymbolKind::Text => functions.push(Function {
                    name: demangled(name),
                    start: at & !1,
                    end: (at & !1) + address(symbol.size()),
                }),
                _ => {}
            }
        }
        mapping.sort_unstable();
        functions.sort_by_key(|function| (function.start, u32::MAX - function.end));
        functions.dedup_by_key(|function| function.start);
        let starts: Vec<u32> = functions.iter().map(|function| function.start).collect();
        for (index, function) in functions.iter_mut().enumerate() {
            let next = starts.get(index + 1).copied().unwrap_or(u32::MAX);
            // A symbol of assembly may have no size.
            if function.end == function.start || function.end > next {
                function.end = next;
            }
        }
        let text = file
            .sections()
            .filter(|section| section.kind() == SectionKind::Text)
            .map(|section| address(section.address())..address(section.address() + section.size()));
        Self {
            plan,
            functions,
            mapping,
            text: text.collect(),
        }
    }

    /// Whether an address is in code.
    #[must_use]
    pub fn is_code(&self, address: u32) -> bool {
        let inside = self.text.iter().any(|section| section.contains(&address));
        let before = self.mapping.partition_point(|(from, _)| *from <= address);
        inside && before > 0 && self.mapping[before - 1].1
    }

    /// The halfword at an address.
    #[must_use]
    pub fn halfword(&self, address: u32) -> u16 {
        self.plan
            .halfword((address.wrapping_sub(self.plan.base) / 2) as usize)
    }

    /// The word at an address.
    #[must_use]
    pub fn word(&self, address: u32) -> u32 {
        u32::from(self.halfword(address)) | u32::from(self.halfword(address + 2)) << 16
    }

    /// End of the data that contain an address.
    #[must_use]
    pub fn data_end(&self, address: u32) -> u32 {
        let after = self.mapping.partition_point(|(from, _)| *from <= address);
        self.mapping
            .get(after)
            .map_or(self.plan.base + self.len(), |(from, _)| *from)
    }

    fn len(&self) -> u32 {
        u32::try_from(self.plan.code.len()).unwrap_or(u32::MAX)
    }

    /// The instruction at an address.
    #[must_use]
    pub fn instruction(&self, address: u32) -> Instruction {
        decode(address, self.halfword(address), self.halfword(address + 2))
    }

    /// Index of the function that contains an address.
    #[must_use]
    pub fn function_at(&self, address: u32) -> Option<usize> {
        let after = self
            .functions
            .partition_point(|function| function.start <= address);
        let index = after.checked_sub(1)?;
        (address < self.functions[index].end).then_some(index)
    }

    /// Index of the function with this symbol's name.
    #[must_use]
    pub fn function_named(&self, name: &str) -> Option<usize> {
        self.functions.iter().position(|function| function.name == name)
    }

    /// Exceptions with a handler of their own: number, index of the function.
    #[must_use]
    pub fn handlers(&self) -> Vec<(u32, usize)> {
        let default = self.function_named("DefaultHandler_");
        (2..VECTORS)
            .filter_map(|exception| Some((exception, self.function_at(self.plan.vector(exception))?)))
            .filter(|(_, function)| Some(*function) != default)
            .collect()
    }

    /// Indices of the handlers of the sample task and of the planning task.
    #[must_use]
    pub fn tasks(&self) -> Option<[usize; 2]> {
        let handler = |exception| self.function_at(self.plan.vector(exception));
        let default = self.function_named("DefaultHandler_");
        let [sample, planning] = [handler(self.plan.exception)?, handler(self.plan.planning)?];
        (![sample, planning].map(Some).contains(&default)).then_some([sample, planning])
    }

    /// Functions whose address is among the image's data, or loaded by `MOVW` and `MOVT`.
    #[must_use]
    pub fn address_taken(&self) -> BTreeSet<usize> {
        let mut taken = BTreeSet::new();
        let mut note = |word: u32| {
            let start = word & !1;
            if word & 1 == 1
                && let Some(index) = self.function_at(start)
                && self.functions[index].start == start
            {
                taken.insert(index);
            }
        };
        let end = self.plan.base + self.len();
        // The handlers of the vector table are not called.
        for address in (self.plan.base + 4 * VECTORS..end).step_by(4) {
            if !self.is_code(address) {
                note(self.word(address));
            }
        }
        let mut halves = [0_u32; 16];
        let mut address = self.plan.base;
        while address < end {
            if !self.is_code(address) {
                address += 2;
                continue;
            }
            let (first, second) = (self.halfword(address), self.halfword(address + 2));
            let instruction = self.instruction(address);
            let register = usize::from((second >> 8) & 15);
            if instruction.length == 4 && second & 0x8000 == 0 {
                match first & 0xfbf0 {
                    0xf240 => halves[register] = immediate_16(first, second),
                    0xf2c0 => note(immediate_16(first, second) << 16 | halves[register]),
                    _ => {}
                }
            }
            address += u32::from(instruction.length);
        }
        taken
    }

    /// Whether the branch at an address is conditional by its own encoding.
    #[must_use]
    pub fn is_conditional(&self, address: u32) -> bool {
        let (first, second) = (self.halfword(address), self.halfword(address + 2));
        let narrow = first >> 12 == 0b1101 && (first >> 8) & 15 < 14;
        let zero = first & 0xf500 == 0xb100;
        let wide = first >> 11 == 0b11110 && second & 0xd000 == 0x8000;
        narrow || zero || wide
    }

    /// Whether the instruction ends the program: `UDF`.
    #[must_use]
    pub fn is_end(&self, address: u32) -> bool {
        let first = self.halfword(address);
        let narrow = first >> 8 == 0xde;
        let wide = first & 0xfff0 == 0xf7f0 && self.halfword(address + 2) >> 12 == 10;
        self.instruction(address).class == Class::Trap && (narrow || wide)
    }
}

/// Words of the vector table.
const VECTORS: u32 = 98;

/// Immediate of `MOVW` and `MOVT`.
const fn immediate_16(first: u16, second: u16) -> u32 {
    let (i, four) = ((first >> 10) & 1, first & 15);
    let (three, eight) = ((second >> 12) & 7, second & 0xff);
    ((four << 12) | (i << 11) | (three << 8) | eight) as u32
}
