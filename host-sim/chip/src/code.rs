//! Processor cycles of a block of the program: the cost model of `cycle-plugin`, whose pessimistic figures include stalls, but here
//! no wait states of the flash. A block's cost is added when it begins, which is the time resolution.

use cycle_plugin::{
    cost::straight,
    decode::{Class, decode, is_wide},
};

use crate::memory::Memory;

/// Pipeline refill after a branch, worst case.
const REFILL: u32 = 3;

/// A basic block: instructions with a branch only at the end.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Block {
    bytes: u32,
    pub(crate) cycles: u32,
    pub(crate) has_float: bool,
    pub(crate) has_barrier: bool,
}

/// Blocks, by the halfword index of their start in flash.
pub(crate) struct Code {
    flash: Memory,
    blocks: Vec<Block>,
}

impl Code {
    pub(crate) fn new(flash: Memory) -> Self {
        Self {
            flash,
            blocks: vec![Block::default(); flash.bytes() / 2],
        }
    }

    /// Flash also lies at address 0.
    fn in_flash(&self, address: u32) -> u32 {
        if address < self.flash.base() {
            address + self.flash.base()
        } else {
            address
        }
    }

    /// The halfword at this address.
    pub(crate) fn half(&self, address: u32) -> u16 {
        self.flash.half(self.in_flash(address)).unwrap_or(0)
    }

    #[inline]
    pub(crate) fn block(&mut self, address: u32, bytes: u32) -> Block {
        let place = (self.in_flash(address) - self.flash.base()) as usize / 2;
        match self.blocks.get(place) {
            Some(block) if block.bytes == bytes => *block,
            Some(_) => {
                let block = self.account(address, bytes);
                self.blocks[place] = block;
                block
            }
            // Code in SRAM does not occur.
            None => Block {
                bytes,
                cycles: bytes,
                ..Block::default()
            },
        }
    }

    fn account(&self, address: u32, bytes: u32) -> Block {
        let mut block = Block {
            bytes,
            ..Block::default()
        };
        let mut before = None;
        let mut at = address;
        while at < address + bytes {
            let first = self.half(at);
            let second = if is_wide(first) { self.half(at + 2) } else { 0 };
            let instruction = decode(at, first, second);
            block.cycles += straight(before.as_ref(), &instruction).pessimistic;
            block.has_float |= instruction.class.is_float();
            block.has_barrier |= instruction.class == Class::Barrier;
            if instruction.may_branch() {
                block.cycles += REFILL;
            }
            at += u32::from(instruction.length);
            before = Some(instruction);
        }
        block
    }
}
