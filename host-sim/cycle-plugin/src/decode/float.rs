//! The single-precision floating-point extension (ARMv7-M ARM, A6).

use super::{Class, Instruction, Registers};

const NONE: Registers = Registers::NONE;

const fn float(class: Class, reads: Registers, writes: Registers) -> Instruction {
    Instruction::new(4, class, reads, writes)
}

/// Decodes an instruction of coprocessors 10 and 11.
pub(super) const fn decode(first: u16, second: u16) -> Instruction {
    let coprocessor = (second >> 8) & 15;
    // Encodings that begin with 1111 belong to later units.
    if coprocessor & 14 != 10 || first & 0x1000 != 0 {
        return float(Class::Unknown, NONE, NONE);
    }
    if first & 0x200 == 0 {
        return memory(first, second);
    }
    if second & 0x10 == 0 {
        return processing(first, second);
    }
    transfer(first, second)
}

const fn d(first: u16, second: u16) -> u16 {
    ((second >> 11) & 30) | ((first >> 6) & 1)
}

const fn n(first: u16, second: u16) -> u16 {
    ((first & 15) << 1) | ((second >> 7) & 1)
}

const fn m(second: u16) -> u16 {
    ((second & 15) << 1) | ((second >> 5) & 1)
}

/// `VLDR`, `VSTR`, `VLDM`, `VSTM`, and moves of two registers at once.
const fn memory(first: u16, second: u16) -> Instruction {
    let load = first & 0x10 != 0;
    let double = second & 0x100 != 0;
    if first & 0xffe0 == 0xec40 {
        let core = Registers::core(second >> 12).and(Registers::core(first));
        let singles = Registers::singles(if double { (second & 15) << 1 } else { m(second) }, 2);
        return if load {
            float(Class::FloatMovePair, singles, core)
        } else {
            float(Class::FloatMovePair, core, singles)
        };
    }
    let base = Registers::core(first);
    let one = first & 0x120 == 0x100;
    let count = if !one {
        second & 0xff
    } else if double {
        2
    } else {
        1
    };
    let from = if double {
        (second >> 11) & 30
    } else {
        d(first, second)
    };
    let registers = Registers::singles(from, count);
    let updated = if one || first & 0x20 == 0 { NONE } else { base };
    #[allow(clippy::cast_possible_truncation, reason = "eight bits")]
    let words = count as u8;
    match (load, one && !double) {
        (true, true) => float(Class::FloatLoad, NONE, registers).at(base),
        (false, true) => float(Class::FloatStore, registers, NONE).at(base),
        (true, false) => float(Class::FloatLoadMultiple(words), NONE, registers.and(updated)).at(base),
        (false, false) => float(Class::FloatStoreMultiple(words), registers, updated).at(base),
    }
}

const fn processing(first: u16, second: u16) -> Instruction {
    let to = Registers::single(d(first, second));
    let (left, right) = (Registers::single(n(first, second)), Registers::single(m(second)));
    let both = left.and(right);
    match (first >> 4) & 11 {
        0 | 1 | 9 | 10 => float(Class::FloatMultiplyAdd, both.and(to), to),
        2 => float(Class::FloatMultiply, both, to),
        3 => float(Class::FloatAdd, both, to),
        8 => float(Class::FloatDivide, both, to),
        _ => other(first & 15, (second >> 6) & 3, to, right),
    }
}

/// Instructions with one operand: `kind` and `variant` are the manual's `opc2` and `opc3`.
const fn other(kind: u16, variant: u16, to: Registers, from: Registers) -> Instruction {
    if variant & 1 == 0 {
        return float(Class::FloatMove, NONE, to);
    }
    match (kind, variant) {
        (1, 3) => float(Class::FloatRoot, from, to),
        (0 | 1, _) => float(Class::FloatMove, from, to),
        (4, _) => float(Class::FloatMove, from.and(to), NONE),
        // Compares with zero.
        (5, _) => float(Class::FloatMove, to, NONE),
        (2 | 3 | 8 | 12 | 13, _) => float(Class::FloatConvert, from, to),
        // Fixed point, in place.
        (10 | 11 | 14 | 15, _) => float(Class::FloatConvert, to, to),
        _ => float(Class::Unknown, NONE, NONE),
    }
}

/// Transfers between a core register and the floating-point unit.
const fn transfer(first: u16, second: u16) -> Instruction {
    let to_core = first & 0x10 != 0;
    let t = (second >> 12) & 15;
    let core = Registers::core(t);
    match (first >> 5) & 7 {
        // VMRS to the flags (register 15) and VMSR.
        7 if to_core && t == 15 => float(Class::FloatMove, NONE, NONE),
        7 if to_core => float(Class::FloatMove, NONE, core),
        7 => float(Class::FloatMove, core, NONE),
        _ => {
            let single = Registers::single(n(first, second));
            if to_core {
                float(Class::FloatMove, single, core)
            } else {
                float(Class::FloatMove, core, single)
            }
        }
    }
}
