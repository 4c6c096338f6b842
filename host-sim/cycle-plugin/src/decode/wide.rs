//! 32-bit instructions (ARMv7-M ARM, A5.3) except those of the floating-point unit.

use super::{Branch, Class, Instruction, Registers, float, target};

const NONE: Registers = Registers::NONE;

/// The register fields of most encodings; 15 means none in some of them.
#[derive(Clone, Copy)]
struct Fields {
    n: u16,
    t: u16,
    d: u16,
    m: u16,
}

/// A register, or none for number 15.
const fn unless_15(number: u16) -> Registers {
    if number == 15 {
        NONE
    } else {
        Registers::core(number)
    }
}

const fn wide(class: Class, reads: Registers, writes: Registers) -> Instruction {
    Instruction::new(4, class, reads, writes)
}

const UNKNOWN: Instruction = wide(Class::Unknown, NONE, NONE);

/// Decodes a 32-bit instruction.
pub(super) const fn decode(address: u32, first: u16, second: u16) -> Instruction {
    let fields = Fields {
        n: first & 15,
        t: second >> 12,
        d: (second >> 8) & 15,
        m: second & 15,
    };
    match (first >> 9) & 15 {
        // 1110 100
        0b0100 if first & 0x40 == 0 => multiple(first, second, fields),
        0b0100 => dual_or_table(first, second, fields),
        // 1110 101
        0b0101 => shifted_register(first, fields),
        // 1110 11, 1111 11
        0b0110 | 0b0111 => float::decode(first, second),
        // 1111 0
        0b1000..=0b1011 if second & 0x8000 == 0 => immediate(first, second, fields),
        0b1000..=0b1011 => control(address, first, second),
        // 1111 100
        0b1100 => memory(first, second, fields),
        // 1111 101
        0b1101 if first & 0x100 == 0 => register(second, fields),
        0b1101 => multiply(first, fields),
        _ => UNKNOWN,
    }
}

const fn multiple(first: u16, list: u16, fields: Fields) -> Instruction {
    #[allow(clippy::cast_possible_truncation, reason = "at most 16")]
    let words = list.count_ones() as u8;
    let base = Registers::core(fields.n);
    let updated = if first & 0x20 == 0 { NONE } else { base };
    let registers = Registers::list(list);
    if first & 0x10 == 0 {
        wide(Class::StoreMultiple(words), registers, updated).at(base)
    } else {
        wide(Class::LoadMultiple(words), NONE, registers.and(updated)).at(base)
    }
}

/// `LDRD`, `STRD`, exclusive accesses and table branches.
const fn dual_or_table(first: u16, second: u16, fields: Fields) -> Instruction {
    let base = Registers::core(fields.n);
    let load = first & 0x10 != 0;
    let data = Registers::core(fields.t);
    if first & 0x120 != 0 {
        let both = data.and(Registers::core(fields.d));
        let updated = if first & 0x20 == 0 { NONE } else { base };
        return if load {
            wide(Class::LoadMultiple(2), NONE, both.and(updated)).at(base)
        } else {
            wide(Class::StoreMultiple(2), both, updated).at(base)
        };
    }
    let byte_or_table = first & 0x80 != 0;
    if byte_or_table && load && (second >> 4) & 15 < 2 {
        return wide(Class::Table, NONE, Registers::PC).at(base.and(Registers::core(fields.m)));
    }
    if load {
        return wide(Class::Load, NONE, data).at(base);
    }
    // `STREX` and `STREXB` have the result's register in different fields.
    let result = if byte_or_table { fields.m } else { fields.d };
    wide(Class::Store, data, Registers::core(result)).at(base)
}

/// Data processing, by the operation in its first halfword. Without a result (a comparison) or a first operand it is no addition.
const fn processing(first: u16, reads: Registers, fields: Fields) -> Instruction {
    let d = unless_15(fields.d);
    if fields.d == 15 || fields.n == 15 {
        return wide(Class::Simple, reads, d);
    }
    match (first >> 5) & 15 {
        8 | 13 | 14 => Instruction::add(4, first & 0x10 != 0, reads, d),
        10 | 11 => wide(Class::AddWithCarry, reads, d),
        _ => wide(Class::Simple, reads, d),
    }
}

/// Data processing with a shifted register.
const fn shifted_register(first: u16, fields: Fields) -> Instruction {
    let reads = unless_15(fields.n).and(Registers::core(fields.m));
    processing(first, reads, fields)
}

/// Data processing with an immediate.
const fn immediate(first: u16, second: u16, fields: Fields) -> Instruction {
    let d = unless_15(fields.d);
    let mut reads = unless_15(fields.n);
    if first & 0x200 == 0 {
        // RSB from 0 is a negation.
        let negates = (first >> 5) & 15 == 14 && first & 0x400 == 0 && second & 0x70ff == 0;
        if !negates {
            return processing(first, reads, fields);
        }
    } else {
        match (first >> 4) & 0x1f {
            // ADDW, SUBW
            0b00000 | 0b01010 if fields.n != 15 => return Instruction::add(4, false, reads, d),
            // MOVW
            0b00100 => reads = NONE,
            // MOVT keeps the lower half, BFI and BFC the bits outside the field.
            0b01100 => reads = d,
            0b10110 => reads = reads.and(d),
            _ => {}
        }
    }
    wide(Class::Simple, reads, d)
}

/// Branches, special registers, hints and barriers.
const fn control(address: u32, first: u16, second: u16) -> Instruction {
    let offset = ((second & 0x7ff) as u32) << 1;
    let sign = ((first as u32) >> 10) & 1;
    let (j1, j2) = (((second as u32) >> 13) & 1, ((second as u32) >> 11) & 1);
    if second & 0x1000 != 0 {
        let (i1, i2) = ((j1 ^ sign) ^ 1, (j2 ^ sign) ^ 1);
        let offset = (sign << 24) | (i1 << 23) | (i2 << 22) | (((first & 0x3ff) as u32) << 12) | offset;
        let to = target(address, offset, 25);
        return if second & 0x4000 == 0 {
            wide(Class::Branch(Branch::Direct(to)), NONE, Registers::PC)
        } else {
            wide(
                Class::Branch(Branch::Call(to)),
                NONE,
                Registers::PC.and(Registers::core(14)),
            )
        };
    }
    if second & 0x4000 != 0 {
        return UNKNOWN;
    }
    if (first >> 7) & 7 != 7 {
        let offset = (sign << 20) | (j2 << 19) | (j1 << 18) | (((first & 0x3f) as u32) << 12) | offset;
        return wide(
            Class::Branch(Branch::Direct(target(address, offset, 21))),
            NONE,
            Registers::PC,
        );
    }
    match (first >> 4) & 0x7f {
        0b011_1000 | 0b011_1001 => wide(Class::SpecialRegister, Registers::core(first), NONE),
        0b011_1110 | 0b011_1111 => wide(Class::SpecialRegister, NONE, Registers::core(second >> 8)),
        0b011_1010 if second & 0xff == 2 || second & 0xff == 3 => wide(Class::Wait, NONE, NONE),
        0b011_1010 => wide(Class::Hint, NONE, NONE),
        0b011_1011 if (second >> 4) & 15 >= 4 => wide(Class::Barrier, NONE, NONE),
        // CLREX
        0b011_1011 => wide(Class::Hint, NONE, NONE),
        0b111_1111 => wide(Class::Trap, NONE, NONE),
        _ => UNKNOWN,
    }
}

/// Single loads and stores.
const fn memory(first: u16, second: u16, fields: Fields) -> Instruction {
    let load = first & 0x10 != 0;
    let size = (first >> 5) & 3;
    if size == 3 {
        return UNKNOWN;
    }
    if load && fields.t == 15 && size < 2 {
        return wide(Class::Hint, NONE, NONE);
    }
    let data = Registers::core(fields.t);
    let base = Registers::core(fields.n);
    if fields.n == 15 {
        return wide(Class::LoadLiteral, NONE, data).at(base);
    }
    let long_offset = first & 0x80 != 0;
    let indexed = !long_offset && second & 0x800 == 0;
    let updated = if !long_offset && second & 0x900 == 0x900 {
        base
    } else {
        NONE
    };
    let address = if indexed {
        base.and(Registers::core(fields.m))
    } else {
        base
    };
    match (load, indexed) {
        (true, _) => wide(Class::Load, NONE, data.and(updated)).at(address),
        (false, true) => wide(Class::StoreIndexed, data, updated).at(address),
        (false, false) => wide(Class::Store, data, updated).at(address),
    }
}

/// Shifts by a register, extensions, parallel additions, reversals, `CLZ`, `SEL`.
const fn register(second: u16, fields: Fields) -> Instruction {
    if second & 0xf000 != 0xf000 {
        return UNKNOWN;
    }
    let reads = unless_15(fields.n).and(Registers::core(fields.m));
    wide(Class::Simple, reads, Registers::core(fields.d))
}

const fn multiply(first: u16, fields: Fields) -> Instruction {
    let factors = Registers::core(fields.n).and(Registers::core(fields.m));
    let d = Registers::core(fields.d);
    if first & 0x80 == 0 {
        let class = if fields.t == 15 {
            Class::Multiply
        } else {
            Class::MultiplyAdd
        };
        return wide(class, factors.and(unless_15(fields.t)), d);
    }
    let both = d.and(Registers::core(fields.t));
    match (first >> 4) & 7 {
        1 | 3 => wide(Class::Divide, factors, d),
        0 | 2 => wide(Class::Multiply, factors, both),
        4..=6 => wide(Class::MultiplyAdd, factors.and(both), both),
        _ => UNKNOWN,
    }
}
