//! Decoder of Thumb-2 and single-precision VFP instructions: length, class, and the registers that are read, written and used for an
//! address (ARMv7-M Architecture Reference Manual, A5 to A7).
//!
//! Immediates and conditions are not decoded, except for the target of a direct branch.

mod float;
mod narrow;
mod wide;

/// A set of registers: bits 0 to 15 are R0 to R15, bits 16 to 47 are S0 to S31.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Registers(pub u64);

impl Registers {
    /// No register.
    pub const NONE: Self = Self(0);
    /// The stack pointer.
    pub const SP: Self = Self(1 << 13);
    /// The program counter.
    pub const PC: Self = Self(1 << 15);

    /// A core register, by the lowest four bits.
    #[must_use]
    pub const fn core(number: u16) -> Self {
        Self(1 << (number & 15))
    }

    /// A single-precision register, by the lowest five bits.
    #[must_use]
    pub const fn single(number: u16) -> Self {
        Self(1 << (16 + (number & 31)))
    }

    /// `count` single-precision registers from `first` on.
    #[must_use]
    pub const fn singles(first: u16, count: u16) -> Self {
        let count = if count > 32 { 32 } else { count };
        Self((((1_u64 << count) - 1) << (16 + (first & 31))) & 0xffff_ffff_0000)
    }

    /// Registers of a list such as that of `PUSH`.
    #[must_use]
    pub const fn list(list: u16) -> Self {
        Self(list as u64)
    }

    /// The union.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The difference.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether the set is empty.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether the sets intersect.
    #[must_use]
    pub const fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

/// A branch, by the source of its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// `B`, with or without a condition, `CBZ`, `CBNZ`: to this address.
    Direct(u32),
    /// `BL`: to this address.
    Call(u32),
    /// `BLX` to a register.
    CallIndirect,
    /// `BX`, `MOV PC`, `ADD PC` to anything but the link register.
    Indirect,
    /// `BX LR`.
    Return,
}

/// Class of an instruction, by its cycles and its arithmetic operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Data processing, apart from additions.
    Simple,
    /// `ADD`, `SUB`, `RSB` of registers other than the stack pointer and the program counter; a negation is [`Self::Simple`].
    Add {
        /// The carry is set, as the lower half of a 64-bit addition does. A 16-bit instruction in an `IT` block does not.
        sets_flags: bool,
    },
    /// `ADC`, `SBC`.
    AddWithCarry,
    /// `MUL`, `SMMUL`, `SMULL`, `UMULL` and variants.
    Multiply,
    /// `MLA`, `MLS`, `SMMLA`, `SMLAL` and variants.
    MultiplyAdd,
    /// `SDIV`, `UDIV`.
    Divide,
    /// A branch.
    Branch(Branch),
    /// `TBB`, `TBH`.
    Table,
    /// Loads a byte, halfword or word; into PC it is a branch.
    Load,
    /// Loads a word from a literal pool.
    LoadLiteral,
    /// Stores a byte, halfword or word at a base and an immediate.
    Store,
    /// Stores a byte, halfword or word at a base and a register.
    StoreIndexed,
    /// `LDRD`, `LDM`, `POP`: words.
    LoadMultiple(u8),
    /// `STRD`, `STM`, `PUSH`: words.
    StoreMultiple(u8),
    /// `IT`.
    IfThen,
    /// `NOP`, `SEV`, `PLD`.
    Hint,
    /// `WFI`, `WFE`.
    Wait,
    /// `DMB`, `DSB`, `ISB`.
    Barrier,
    /// `MRS`, `MSR`.
    SpecialRegister,
    /// `CPSIE`, `CPSID`.
    ChangeState,
    /// `BKPT`, `SVC`, `UDF`.
    Trap,
    /// VFP: add, subtract.
    FloatAdd,
    /// VFP: multiply, with or without negation.
    FloatMultiply,
    /// VFP: convert.
    FloatConvert,
    /// VFP: move, absolute value, negate, compare, immediate, to and from a core register.
    FloatMove,
    /// VFP: two core registers to or from two single registers.
    FloatMovePair,
    /// VFP: `VMLA`, `VFMA` and their like.
    FloatMultiplyAdd,
    /// VFP: `VDIV`.
    FloatDivide,
    /// VFP: `VSQRT`.
    FloatRoot,
    /// `VLDR` of a single.
    FloatLoad,
    /// `VSTR` of a single.
    FloatStore,
    /// `VLDM`, `VPOP`, `VLDR` of a double: words.
    FloatLoadMultiple(u8),
    /// `VSTM`, `VPUSH`, `VSTR` of a double: words.
    FloatStoreMultiple(u8),
    /// Not an instruction of the Cortex-M4F, or not known to this decoder.
    Unknown,
}

impl Class {
    /// Whether it uses the floating-point unit, and so triggers lazy stacking.
    #[must_use]
    pub const fn is_float(self) -> bool {
        matches!(
            self,
            Self::FloatAdd
                | Self::FloatMultiply
                | Self::FloatConvert
                | Self::FloatMove
                | Self::FloatMovePair
                | Self::FloatMultiplyAdd
                | Self::FloatDivide
                | Self::FloatRoot
                | Self::FloatLoad
                | Self::FloatStore
                | Self::FloatLoadMultiple(_)
                | Self::FloatStoreMultiple(_)
        )
    }

    /// Whether it reads memory into registers.
    #[must_use]
    pub const fn is_load(self) -> bool {
        matches!(
            self,
            Self::Load
                | Self::LoadLiteral
                | Self::LoadMultiple(_)
                | Self::FloatLoad
                | Self::FloatLoadMultiple(_)
        )
    }

    /// Whether it writes memory.
    #[must_use]
    pub const fn is_store(self) -> bool {
        matches!(
            self,
            Self::Store
                | Self::StoreIndexed
                | Self::StoreMultiple(_)
                | Self::FloatStore
                | Self::FloatStoreMultiple(_)
        )
    }
}

/// A decoded instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// Bytes: 2 or 4.
    pub length: u8,
    /// Class.
    pub class: Class,
    /// Registers that it reads, those of an address included.
    pub reads: Registers,
    /// Registers that it writes.
    pub writes: Registers,
    /// Registers that an address is computed from.
    pub address: Registers,
}

impl Instruction {
    const fn new(length: u8, class: Class, reads: Registers, writes: Registers) -> Self {
        Self {
            length,
            class,
            reads,
            writes,
            address: Registers::NONE,
        }
    }

    const fn at(mut self, address: Registers) -> Self {
        self.address = address;
        self.reads = self.reads.and(address);
        self
    }

    /// Data processing; a branch if the result is the program counter.
    const fn data(length: u8, reads: Registers, writes: Registers) -> Self {
        let class = if writes.meets(Registers::PC) {
            Class::Branch(Branch::Indirect)
        } else {
            Class::Simple
        };
        Self::new(length, class, reads, writes)
    }

    /// An addition; data processing if it computes an address on the stack or in the code.
    const fn add(length: u8, sets_flags: bool, reads: Registers, writes: Registers) -> Self {
        if reads.and(writes).meets(Registers::SP.and(Registers::PC)) {
            return Self::data(length, reads, writes);
        }
        Self::new(length, Class::Add { sets_flags }, reads, writes)
    }

    /// Whether the next instruction executed may be another than the next in memory.
    #[must_use]
    pub const fn may_branch(&self) -> bool {
        matches!(self.class, Class::Branch(_) | Class::Table) || self.writes.meets(Registers::PC)
    }

    /// Whether it is a call.
    #[must_use]
    pub const fn is_call(&self) -> bool {
        matches!(self.class, Class::Branch(Branch::Call(_) | Branch::CallIndirect))
    }

    /// Whether it is a return from a function or an exception: `BX LR`, or a load of PC from the stack.
    #[must_use]
    pub const fn is_return(&self) -> bool {
        let popped =
            self.class.is_load() && self.writes.meets(Registers::PC) && self.address.meets(Registers::SP);
        popped || matches!(self.class, Class::Branch(Branch::Return))
    }
}

/// Whether an instruction that begins with this halfword has 32 bits.
#[must_use]
pub const fn is_wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// Decodes the instruction at an address; `second` is ignored for a 16-bit instruction.
#[must_use]
pub const fn decode(address: u32, first: u16, second: u16) -> Instruction {
    if is_wide(first) {
        wide::decode(address, first, second)
    } else {
        narrow::decode(address, first)
    }
}

/// Target of a branch with an offset in bytes, of `bits` bits.
const fn target(address: u32, offset: u32, bits: u32) -> u32 {
    let shift = 32 - bits;
    #[allow(
        clippy::cast_sign_loss,
        clippy::cast_possible_wrap,
        reason = "extends the sign"
    )]
    let extended = (((offset << shift) as i32) >> shift) as u32;
    address.wrapping_add(4).wrapping_add(extended)
}
