//! What a block of the program takes, in cycles of the processor: the cost model of `cycle-plugin`, whose pessimistic figures hold stalls but here
//! no wait states of the flash. A block's cost counts when it begins: that is the grain of time.

use cycle_plugin::{
    cost::straight,
    decode::{Class, decode, is_wide},
};

use crate::memory::Memory;

/// Refill of the pipeline after a branch, at worst.
const REFILL: u32 = 3;

/// A stretch of instructions without a branch but at its end.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Block {
    bytes: u32,
    pub(crate) cycles: u32,
    pub(crate) has_float: bool,
    pub(crate) has_barrier: bool,
}

/// Blocks, by the halfword of flash that they begin with.
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
            // Code in SRAM: there is none.
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
