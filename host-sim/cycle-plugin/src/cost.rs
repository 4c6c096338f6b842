//! Cycles of an instruction on a Cortex-M4F, in two models (ARM DDI 0439, tables 3-1 and 7-1 and section 3.3.3).
//!
//! | | nominal | pessimistic |
//! |---|---|---|
//! | data processing, multiply, `IT`, hints | 1 | 1 |
//! | `SDIV`, `UDIV` | 12 (2 to 12 by the operands, which are unknown here) | 12 |
//! | load | 2; 1 right after another single load | the same |
//! | store | 1 by base and immediate (write buffer); 2 by base and register, 1 after a load | 2; 1 after a load |
//! | `LDRD`, `LDM`, `POP`, `VLDM` and the stores | 1 + words | 1 + words |
//! | branch not taken | 1 | 1 |
//! | branch taken | 1 + P; P = 1 direct, 2 by register, 3 by a load or table; one more if the target is a 32-bit instruction across two words | 1 + 3 |
//! | a taken branch into another flash line | 0 | 5; 10 if the first instruction reaches into the next line |
//! | `VDIV`, `VSQRT` | 14 | 14 |
//! | `VMLA`, `VFMA` | 3 | 3 |
//! | other floating point | 1; two registers at once 2 | 1; 2 |
//! | result of floating-point arithmetic used by the next instruction | 0 | 1 |
//! | loaded register used by the next instruction | 0 | 1 |
//! | address from the result of the instruction before | 0 | 1 |
//! | literal load (conflict with instruction fetch) | 0 | 1 |
//! | barrier | 4 | 4 |
//! | `MRS`, `MSR` | 2 | 2 |
//! | exception entry, exit | 12, 12 | 12, 12 and 5 for each flash line entered; one line at the exit |
//! | lazy stacking: S0 to S15 and FPSCR | 0 | 17 at the first floating-point instruction, 17 at the exit |
//!
//! A conditional instruction in an `IT` block is charged as if its condition held: an upper bound.
//!
//! Not modelled: flash wait states of a sequence without branches (the prefetcher supplies four words in six cycles) and of
//! literals, bus contention with DMA, wait states of the peripheral buses, unaligned accesses, folded `IT`, tail-chaining and late
//! arrival (each entry and exit is charged in full), accumulator forwarding in a chain of `VMLA`.

use crate::decode::{Branch, Class, Instruction, Registers};

/// Cycles in both models.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cycles {
    /// By the reference manual, without wait states.
    pub nominal: u32,
    /// With stalls and wait states.
    pub pessimistic: u32,
}

impl Cycles {
    /// The same number in both models.
    #[must_use]
    pub const fn both(cycles: u32) -> Self {
        Self {
            nominal: cycles,
            pessimistic: cycles,
        }
    }

    /// Adds in both models; saturates.
    pub const fn add(&mut self, other: Self) {
        self.nominal = self.nominal.saturating_add(other.nominal);
        self.pessimistic = self.pessimistic.saturating_add(other.pessimistic);
    }
}

/// Bytes of a flash line: 128 bits.
const FLASH_LINE: u32 = 16;

/// Wait states of the flash at 168 MHz.
pub const WAIT_STATES: u32 = 5;

/// Greatest number of cycles that refill the pipeline.
const REFILL_MAX: u32 = 3;

/// Cycles of an exception entry, and of an exit.
pub const EXCEPTION: u32 = 12;

/// Cycles that save or restore S0 to S15 and FPSCR.
pub const LAZY_STACKING: u32 = 17;

/// Cycles of a barrier: one, and the accesses that it waits for.
const BARRIER: u32 = 4;

/// An instruction with its address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AddressedInstruction {
    /// Its address.
    pub address: u32,
    /// The decoded instruction.
    pub instruction: Instruction,
}

impl AddressedInstruction {
    /// Address of the instruction that follows in memory.
    #[must_use]
    pub const fn end(&self) -> u32 {
        self.address.wrapping_add(self.instruction.length as u32)
    }
}

/// Cycles of an instruction after the preceding one (`None` at the start of a handler), without those of a taken branch.
#[must_use]
pub const fn straight(before: Option<&Instruction>, instruction: &Instruction) -> Cycles {
    let pipelined = match before {
        Some(before) => follows_load(before, instruction),
        None => false,
    };
    let saved = if pipelined { 1 } else { 0 };
    let mut cycles = match instruction.class {
        Class::Divide => Cycles::both(12),
        Class::Load | Class::LoadLiteral | Class::FloatLoad => Cycles::both(2 - saved),
        Class::StoreIndexed | Class::FloatStore => Cycles::both(2 - saved),
        Class::Store => Cycles {
            nominal: 1,
            pessimistic: 2 - saved,
        },
        Class::LoadMultiple(words)
        | Class::StoreMultiple(words)
        | Class::FloatLoadMultiple(words)
        | Class::FloatStoreMultiple(words) => Cycles::both(1 + words as u32),
        // The load of the table; the branch is always taken.
        Class::Table => Cycles::both(3),
        Class::FloatMultiplyAdd => Cycles::both(3),
        Class::FloatDivide | Class::FloatRoot => Cycles::both(14),
        Class::FloatMovePair | Class::SpecialRegister => Cycles::both(2),
        Class::Barrier => Cycles::both(BARRIER),
        Class::Simple
        | Class::Add { .. }
        | Class::AddWithCarry
        | Class::Multiply
        | Class::MultiplyAdd
        | Class::Branch(_)
        | Class::IfThen
        | Class::Hint
        | Class::Wait
        | Class::ChangeState
        | Class::Trap
        | Class::FloatAdd
        | Class::FloatMultiply
        | Class::FloatConvert
        | Class::FloatMove
        | Class::Unknown => Cycles::both(1),
    };
    cycles.pessimistic += stalls(before, instruction);
    cycles
}

/// Whether a single access is pipelined with the single load that precedes it.
const fn follows_load(before: &Instruction, instruction: &Instruction) -> bool {
    let load = matches!(before.class, Class::Load | Class::LoadLiteral | Class::FloatLoad);
    let single = matches!(
        instruction.class,
        Class::Load
            | Class::LoadLiteral
            | Class::FloatLoad
            | Class::Store
            | Class::StoreIndexed
            | Class::FloatStore
    );
    load && single && !before.writes.meets(instruction.address) && !instruction.may_branch()
}

/// Stall cycles of the pessimistic model.
const fn stalls(before: Option<&Instruction>, instruction: &Instruction) -> u32 {
    let mut stalls = 0;
    if matches!(instruction.class, Class::LoadLiteral) {
        stalls += 1;
    }
    let Some(before) = before else {
        return stalls;
    };
    let slow_result = before.class.is_load()
        || matches!(
            before.class,
            Class::FloatAdd
                | Class::FloatMultiply
                | Class::FloatConvert
                | Class::FloatMultiplyAdd
                | Class::FloatDivide
                | Class::FloatRoot
        );
    // A store takes its data a cycle after its address.
    let needed_now = if instruction.class.is_store() && before.class.is_load() {
        instruction.address
    } else {
        instruction.reads
    };
    // A base register that an access updates is available like a result of data processing.
    let results = before.writes.without(Registers::PC);
    if (slow_result && results.meets(needed_now)) || results.meets(instruction.address) {
        stalls += 1;
    }
    stalls
}

/// Cycles that a taken branch to this instruction adds.
#[must_use]
pub const fn taken(from: &AddressedInstruction, to: &AddressedInstruction) -> Cycles {
    let straddles = to.instruction.length == 4 && to.address & 2 != 0;
    let refill = match from.instruction.class {
        Class::Branch(Branch::Direct(_) | Branch::Call(_)) => 1 + straddles as u32,
        Class::Branch(_) => {
            let refill = 2 + straddles as u32;
            if refill > REFILL_MAX { REFILL_MAX } else { refill }
        }
        _ => REFILL_MAX,
    };
    Cycles {
        nominal: refill,
        pessimistic: REFILL_MAX + lines_entered(Some(from.address), to),
    }
}

/// Wait states for the flash lines that a jump to this instruction enters.
#[must_use]
pub const fn lines_entered(from: Option<u32>, to: &AddressedInstruction) -> u32 {
    let first = to.address / FLASH_LINE;
    let last = (to.end() - 1) / FLASH_LINE;
    let here = match from {
        Some(from) => from / FLASH_LINE == first,
        None => false,
    };
    let entered = (last - first) + !here as u32;
    WAIT_STATES * entered
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::decode;

    /// Code without branches as halfwords; the manual's cycles, summed by hand, in both models.
    fn check(what: &str, code: &[u16], nominal: u32, pessimistic: u32) {
        let mut total = Cycles::default();
        let mut before = None;
        let mut at = 0;
        while let Some(first) = code.get(at) {
            let second = code.get(at + 1).copied().unwrap_or(0);
            let instruction = decode(0, *first, second);
            assert_ne!(instruction.class, Class::Unknown, "{what}");
            total.add(straight(before.as_ref(), &instruction));
            at += usize::from(instruction.length) / 2;
            before = Some(instruction);
        }
        assert_eq!(
            (total.nominal, total.pessimistic),
            (nominal, pessimistic),
            "{what}"
        );
    }

    #[test]
    fn the_manuals_examples_of_pipelined_accesses() {
        // ldr r0,[r1,r5]; ldr r1,[r2]; ldr r2,[r3,#4]: "normally four cycles total"
        check("three loads", &[0x5948, 0x6811, 0x685a], 4, 4);
        // ldr r0,[r1,r2]; str r0,[r3,#20]: "normally three cycles total", the store in the write buffer
        check("load, store", &[0x5888, 0x6158], 3, 3);
        // ldr r0,[r1,r2]; str r1,[r3,r2]: "normally three cycles total"
        check("load, indexed store", &[0x5888, 0x5099], 3, 3);
        // ldr r0,[r1]; ldr r2,[r0]: the address is what was loaded, so nothing overlaps
        check("pointer to pointer", &[0x6808, 0x6802], 4, 5);
    }

    #[test]
    fn straight_code_counted_by_hand() {
        // movs r0,#1; adds r0,r0,#1; muls r0,r1: 3
        check("data", &[0x2001, 0x1c40, 0x4348], 3, 3);
        // ldr r0,[r1]; adds r0,r0,#1: 2 + 1, and a load-use stall
        check("load, use", &[0x6808, 0x1c40], 3, 4);
        // adds r1,r1,#4; ldr r0,[r1]: 1 + 2, and a wait for the address
        check("address", &[0x1d09, 0x6808], 3, 4);
        // push {r4-r7,lr}: 1 + 5; ldrd r0,r1,[r2]: 1 + 2; ldr r0,[pc,#4]: 2 and the fetch unit in the way
        check(
            "several words",
            &[0xb5f0, 0xe9d2, 0x0100, 0x4801],
            6 + 3 + 2,
            6 + 3 + 3,
        );
        // udiv r0,r1,r2: at most 12; dmb: 4; mrs r0,basepri: 2
        check(
            "slow ones",
            &[0xfbb1, 0xf0f2, 0xf3bf, 0x8f5f, 0xf3ef, 0x8011],
            18,
            18,
        );
        // smmlar r0,r1,r2,r3: 1
        check("smmlar", &[0xfb51, 0x3012], 1, 1);
    }

    #[test]
    fn floating_point_counted_by_hand() {
        // vmul.f32 s0,s1,s2; vadd.f32 s3,s0,s4: 2, and a wait for the product
        check("multiply, add", &[0xee20, 0x0a81, 0xee70, 0x1a02], 2, 3);
        // vmul.f32 s0,s1,s2; vmul.f32 s3,s1,s2; vadd.f32 s4,s0,s1: 3, nothing waits
        check(
            "two products",
            &[0xee20, 0x0a81, 0xee60, 0x1a81, 0xee30, 0x2a20],
            3,
            3,
        );
        // vmla.f32 s0,s1,s2: 3; vdiv.f32 s0,s1,s2: 14; vsqrt.f32 s1,s1: 14
        check(
            "slow ones",
            &[0xee00, 0x0a81, 0xeec0, 0x2a81, 0xeef1, 0x0ae0],
            31,
            31,
        );
        // vldr s0,[r0]; vldr s1,[r0,#4]: 2 + 1; vpush {s16-s19}: 1 + 4; vmov r0,r1,s2,s3: 2
        check(
            "memory and moves",
            &[0xed90, 0x0a00, 0xedd0, 0x0a01, 0xed2d, 0x8a04, 0xec51, 0x0a11],
            10,
            10,
        );
    }

    fn placed(address: u32, code: [u16; 2]) -> AddressedInstruction {
        AddressedInstruction {
            address,
            instruction: decode(address, code[0], code[1]),
        }
    }

    #[test]
    fn taken_branches() {
        let branch = placed(0x0800_0100, [0xe7fe, 0]);
        let back = placed(0x0800_0200, [0x4770, 0]);
        let pop = placed(0x0800_0200, [0xbd10, 0]);
        let narrow = placed(0x0800_010e, [0x2001, 0]);
        let straddling = placed(0x0800_010e, [0xfb51, 0x3012]);
        let cycles = |nominal, pessimistic| Cycles { nominal, pessimistic };
        // Within a line, the refill alone; into another, five wait states; across its end, ten.
        assert_eq!(taken(&branch, &narrow), cycles(1, 3));
        assert_eq!(taken(&branch, &straddling), cycles(2, 8));
        assert_eq!(taken(&back, &narrow), cycles(2, 8));
        assert_eq!(taken(&pop, &straddling), cycles(3, 13));
    }
}
