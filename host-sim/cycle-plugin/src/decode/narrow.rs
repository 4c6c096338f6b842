//! 16-bit instructions (ARMv7-M ARM, A5.2).

use super::{Branch, Class, Instruction, Registers, target};

const NONE: Registers = Registers::NONE;

/// The low register whose number begins at this bit.
const fn low(code: u16, bit: u16) -> Registers {
    Registers::core((code >> bit) & 7)
}

const fn narrow(class: Class, reads: Registers, writes: Registers) -> Instruction {
    Instruction::new(2, class, reads, writes)
}

const fn words(list: u16) -> u8 {
    #[allow(clippy::cast_possible_truncation, reason = "at most 16")]
    let words = list.count_ones() as u8;
    words
}

/// Decodes a 16-bit instruction.
pub(super) const fn decode(address: u32, code: u16) -> Instruction {
    match code >> 12 {
        0b0000..=0b0011 => immediate(code),
        0b0100 => match (code >> 10) & 3 {
            0 => processing(code),
            1 => high_registers(code),
            _ => narrow(Class::LoadLiteral, NONE, low(code, 8)).at(Registers::PC),
        },
        0b0101..=0b1000 => memory(code),
        0b1001 => access(code & 0x0800 != 0, low(code, 8), Registers::SP),
        0b1010 => {
            let base = if code & 0x0800 == 0 {
                Registers::PC
            } else {
                Registers::SP
            };
            narrow(Class::Simple, base, low(code, 8))
        }
        0b1011 => miscellaneous(address, code),
        0b1100 => multiple(code),
        0b1101 => match (code >> 8) & 15 {
            14 | 15 => narrow(Class::Trap, NONE, NONE),
            _ => branch(target(address, ((code & 0xff) as u32) << 1, 9)),
        },
        _ => branch(target(address, ((code & 0x7ff) as u32) << 1, 12)),
    }
}

const fn branch(to: u32) -> Instruction {
    narrow(Class::Branch(Branch::Direct(to)), NONE, Registers::PC)
}

/// Shifts, additions, moves and comparisons with an immediate.
const fn immediate(code: u16) -> Instruction {
    match code >> 11 {
        0..=2 => narrow(Class::Simple, low(code, 3), low(code, 0)),
        3 => {
            let second = if code & 0x0400 == 0 { low(code, 6) } else { NONE };
            Instruction::add(2, true, low(code, 3).and(second), low(code, 0))
        }
        4 => narrow(Class::Simple, NONE, low(code, 8)),
        5 => narrow(Class::Simple, low(code, 8), NONE),
        _ => Instruction::add(2, true, low(code, 8), low(code, 8)),
    }
}

/// `AND` to `MVN` of two low registers.
const fn processing(code: u16) -> Instruction {
    let (rdn, rm) = (low(code, 0), low(code, 3));
    match (code >> 6) & 15 {
        5 | 6 => narrow(Class::AddWithCarry, rdn.and(rm), rdn),
        8 | 10 | 11 => narrow(Class::Simple, rdn.and(rm), NONE),
        13 => narrow(Class::Multiply, rdn.and(rm), rdn),
        9 | 15 => narrow(Class::Simple, rm, rdn),
        _ => narrow(Class::Simple, rdn.and(rm), rdn),
    }
}

/// `ADD`, `CMP`, `MOV`, `BX`, `BLX` of any register.
const fn high_registers(code: u16) -> Instruction {
    let rdn = Registers::core((code & 7) | ((code >> 4) & 8));
    let number = (code >> 3) & 15;
    let rm = Registers::core(number);
    match (code >> 8) & 3 {
        0 => Instruction::add(2, false, rdn.and(rm), rdn),
        1 => narrow(Class::Simple, rdn.and(rm), NONE),
        2 => Instruction::data(2, rm, rdn),
        _ => {
            let how = if code & 0x80 != 0 {
                Branch::CallIndirect
            } else if number == 14 {
                Branch::Return
            } else {
                Branch::Indirect
            };
            narrow(Class::Branch(how), rm, Registers::PC)
        }
    }
}

/// Single loads and stores by low registers.
const fn memory(code: u16) -> Instruction {
    let (data, base) = (low(code, 0), low(code, 3));
    if code >> 12 != 0b0101 {
        return access(code & 0x0800 != 0, data, base);
    }
    let both = base.and(low(code, 6));
    if (code >> 9) & 7 < 3 {
        narrow(Class::StoreIndexed, data, NONE).at(both)
    } else {
        narrow(Class::Load, NONE, data).at(both)
    }
}

const fn access(load: bool, data: Registers, base: Registers) -> Instruction {
    if load {
        narrow(Class::Load, NONE, data).at(base)
    } else {
        narrow(Class::Store, data, NONE).at(base)
    }
}

const fn multiple(code: u16) -> Instruction {
    let (list, base) = (code & 0xff, low(code, 8));
    let registers = Registers::list(list);
    if code & 0x0800 == 0 {
        narrow(Class::StoreMultiple(words(list)), registers, base).at(base)
    } else {
        narrow(Class::LoadMultiple(words(list)), NONE, registers.and(base)).at(base)
    }
}

const fn miscellaneous(address: u32, code: u16) -> Instruction {
    let sp = Registers::SP;
    match (code >> 8) & 15 {
        0 => narrow(Class::Simple, sp, sp),
        1 | 3 | 9 | 11 => {
            let offset = ((code >> 3) & 0x40) | ((code >> 2) & 0x3e);
            let to = address.wrapping_add(4).wrapping_add(offset as u32);
            narrow(Class::Branch(Branch::Direct(to)), low(code, 0), Registers::PC)
        }
        2 | 10 => narrow(Class::Simple, low(code, 3), low(code, 0)),
        4 | 5 => {
            let list = (code & 0xff) | ((code & 0x100) << 6);
            narrow(Class::StoreMultiple(words(list)), Registers::list(list), sp).at(sp)
        }
        12 | 13 => {
            let list = (code & 0xff) | ((code & 0x100) << 7);
            narrow(
                Class::LoadMultiple(words(list)),
                NONE,
                Registers::list(list).and(sp),
            )
            .at(sp)
        }
        6 => narrow(Class::ChangeState, NONE, NONE),
        14 => narrow(Class::Trap, NONE, NONE),
        15 if code & 15 != 0 => narrow(Class::IfThen, NONE, NONE),
        15 => match (code >> 4) & 15 {
            2 | 3 => narrow(Class::Wait, NONE, NONE),
            _ => narrow(Class::Hint, NONE, NONE),
        },
        _ => narrow(Class::Unknown, NONE, NONE),
    }
}
