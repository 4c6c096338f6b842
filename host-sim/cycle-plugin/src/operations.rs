//! Arithmetic operations of the executed instructions, in the terms of an operation count: additions, multiplications, divisions,
//! square roots.
//!
//! | instruction | counted as |
//! |---|---|
//! | `VADD`, `VSUB` | an addition |
//! | `VMUL`, `VNMUL`, `MUL`, `SMULL`, `UMULL`, `SMMUL`, `SMULxy` | a multiplication |
//! | `VMLA`, `VFMA` and variants, `MLA`, `MLS`, `SMLAL`, `UMLAL`, `SMMLA`, `SMLAxy` | a multiplication and an addition |
//! | `VDIV`, `SDIV`, `UDIV` | a division |
//! | `VSQRT` | a square root |
//! | `ADD`, `SUB`, `RSB` of integers | an addition if an operand is an arithmetic result, else none |
//! | `ADDS` and `ADC`, `SUBS` and `SBC` | one addition of 64 bits |
//! | everything else | none |
//!
//! An integer sum of the fixed-point polynomials and the sum of an address are the same instruction. The operands tell them apart:
//! an arithmetic result is a register that holds the result of a counted instruction, or what conversions, moves, shifts and logic
//! made of one. A register loaded from memory is no arithmetic result, so that a sum of two spilled registers is not counted; an
//! index that is multiplied by the size of an element is counted.
//!
//! Not counted: comparisons, negations, absolute values, conversions, shifts, moves. A conditional instruction in an `IT` block is
//! counted whether its condition holds or not. The dual 16-bit multiplications count as one.

use crate::decode::{Class, Instruction, Registers};

/// Numbers of arithmetic operations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Operations {
    /// Additions and subtractions.
    pub add: u32,
    /// Multiplications.
    pub multiply: u32,
    /// Divisions.
    pub divide: u32,
    /// Square roots.
    pub root: u32,
}

impl Operations {
    const ADD: Self = Self::new(1, 0, 0, 0);
    const MULTIPLY: Self = Self::new(0, 1, 0, 0);
    const MULTIPLY_ADD: Self = Self::new(1, 1, 0, 0);
    const DIVIDE: Self = Self::new(0, 0, 1, 0);
    const ROOT: Self = Self::new(0, 0, 0, 1);
    const NONE: Self = Self::new(0, 0, 0, 0);

    /// Numbers of additions, multiplications, divisions and square roots.
    #[must_use]
    pub const fn new(add: u32, multiply: u32, divide: u32, root: u32) -> Self {
        Self {
            add,
            multiply,
            divide,
            root,
        }
    }

    /// The numbers in the order of the fields.
    #[must_use]
    pub const fn to_array(self) -> [u32; 4] {
        [self.add, self.multiply, self.divide, self.root]
    }

    /// The sums of both; saturate.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self {
            add: self.add.saturating_add(other.add),
            multiply: self.multiply.saturating_add(other.multiply),
            divide: self.divide.saturating_add(other.divide),
            root: self.root.saturating_add(other.root),
        }
    }
}

/// Counts the operations of one thread of execution, instruction by instruction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counter {
    /// Registers that hold an arithmetic result.
    results: Registers,
    /// The last addition that set the carry for an `ADC` or `SBC` to come, and whether it was counted.
    carry: Option<bool>,
}

impl Counter {
    /// The operations of the next instruction.
    pub const fn count(&mut self, instruction: &Instruction) -> Operations {
        let from_result = instruction.reads.meets(self.results);
        let operations = match instruction.class {
            Class::FloatAdd => Operations::ADD,
            Class::FloatMultiply | Class::Multiply => Operations::MULTIPLY,
            Class::FloatMultiplyAdd | Class::MultiplyAdd => Operations::MULTIPLY_ADD,
            Class::FloatDivide | Class::Divide => Operations::DIVIDE,
            Class::FloatRoot => Operations::ROOT,
            Class::Add { .. } if from_result => Operations::ADD,
            // The lower half was not counted.
            Class::AddWithCarry if matches!(self.carry, Some(false)) => Operations::ADD,
            _ => Operations::NONE,
        };
        let counted = operations.add + operations.multiply + operations.divide + operations.root > 0;
        self.follow_carry(instruction, counted);
        let passes_on = matches!(
            instruction.class,
            Class::Simple
                | Class::AddWithCarry
                | Class::FloatConvert
                | Class::FloatMove
                | Class::FloatMovePair
        );
        self.results = if counted || passes_on && from_result {
            self.results.and(instruction.writes)
        } else {
            self.results.without(instruction.writes)
        };
        operations
    }

    const fn follow_carry(&mut self, instruction: &Instruction, counted: bool) {
        match instruction.class {
            Class::Add { sets_flags: true } => self.carry = Some(counted),
            Class::AddWithCarry => self.carry = None,
            // A comparison.
            Class::Simple if instruction.writes.is_empty() => self.carry = None,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::decode;

    /// Operations of straight code, given as halfwords.
    fn count(code: &[u16]) -> Operations {
        let (mut counter, mut total, mut at) = (Counter::default(), Operations::default(), 0);
        while let Some(first) = code.get(at) {
            let second = code.get(at + 1).copied().unwrap_or(0);
            let instruction = decode(0, *first, second);
            assert_ne!(instruction.class, Class::Unknown);
            total = total.plus(counter.count(&instruction));
            at += usize::from(instruction.length) / 2;
        }
        total
    }

    #[test]
    fn floating_point() {
        // vmul.f32 s0,s1,s2; vadd.f32 s3,s0,s4; vsub.f32 s3,s0,s4
        let sums = [0xee20, 0x0a81, 0xee70, 0x1a02, 0xee70, 0x1a42];
        assert_eq!(count(&sums), Operations::new(2, 1, 0, 0));
        // vmla.f32 s0,s1,s2; vdiv.f32 s0,s1,s2; vsqrt.f32 s1,s1; vneg.f32 s0,s0; vcvt.f32.s32 s0,s0
        let others = [
            0xee00, 0x0a81, 0xeec0, 0x2a81, 0xeef1, 0x0ae0, 0xeeb1, 0x0a40, 0xeeb8, 0x0ac0,
        ];
        assert_eq!(count(&others), Operations::new(1, 1, 1, 1));
    }

    #[test]
    fn multiplications_of_integers() {
        // smmlar r0,r1,r2,r3; smlal r0,r1,r2,r3; mla r0,r1,r2,r3; smlabb r0,r1,r2,r3
        let sums = [0xfb51, 0x3012, 0xfbc2, 0x0103, 0xfb01, 0x3002, 0xfb11, 0x3002];
        assert_eq!(count(&sums), Operations::new(4, 4, 0, 0));
        // smmulr r0,r1,r2; smull r0,r1,r2,r3; mul r0,r1,r2; muls r0,r1; udiv r0,r1,r2
        let products = [
            0xfb51, 0xf012, 0xfb82, 0x0103, 0xfb01, 0xf002, 0x4348, 0xfbb1, 0xf0f2,
        ];
        assert_eq!(count(&products), Operations::new(0, 4, 1, 0));
    }

    #[test]
    fn sums_of_products_are_counted_and_sums_of_addresses_are_not() {
        // adds r0,r1,r2; add.w r0,r1,#16
        assert_eq!(count(&[0x1888, 0xf101, 0x0010]), Operations::default());
        // smmulr r0,r1,r2; adds r0,r0,r3; lsls r0,r0,#1; subs r4,r3,r0; negs r4,r4
        let horner = [0xfb51, 0xf012, 0x18c0, 0x0040, 0x1a1c, 0x4264];
        assert_eq!(count(&horner), Operations::new(2, 1, 0, 0));
        // smmulr r0,r1,r2; ldr r0,[r3]; adds r0,r0,r3: the product is lost
        assert_eq!(
            count(&[0xfb51, 0xf012, 0x6818, 0x18c0]),
            Operations::new(0, 1, 0, 0)
        );
    }

    /// The value of a cubic in Horner form, as the image has it: three `SMMLAR` among loads, stores and an exclusive or.
    #[test]
    fn a_cubic_of_the_image() {
        // ldr r0,[r0,#20]; ldr r4,[r1,#28]; str r0,[sp,#16]; eor.w r5,r0,#0x80000000; ldrd r6,r0,[r1,#20]; str r4,[sp,#84]
        // smmlar r4,r4,r5,r0; ldr r0,[r1,#16]; smmlar r6,r4,r5,r6; str r4,[sp,#80]; str r3,[sp,#20]; str r6,[sp,#76]
        // smmlar r0,r6,r5,r0
        let cubic = [
            0x6940, 0x69cc, 0x9004, 0xf080, 0x4500, 0xe9d1, 0x6005, 0x9415, 0xfb54, 0x0415, 0x6908, 0xfb54,
            0x6615, 0x9414, 0x9305, 0x9613, 0xfb56, 0x0015,
        ];
        assert_eq!(count(&cubic), Operations::new(3, 3, 0, 0));
    }

    #[test]
    fn a_pair_of_words_is_one_addition() {
        // adds r0,r0,r2; adcs r1,r3: no products
        assert_eq!(count(&[0x1880, 0x4159]), Operations::new(1, 0, 0, 0));
        // umull r0,r1,r2,r3; adds r0,r0,r4; adc.w r1,r1,r5
        let product = [0xfba2, 0x0103, 0x1900, 0xeb41, 0x0105];
        assert_eq!(count(&product), Operations::new(1, 1, 0, 0));
        // cmp r0,r1; sbcs r2,r3: a comparison of 64 bits
        assert_eq!(count(&[0x4288, 0x419a]), Operations::default());
    }
}
