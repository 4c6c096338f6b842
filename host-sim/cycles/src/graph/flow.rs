//! Control flow of a function: its reachable instructions and their successors.

use std::collections::{BTreeMap, BTreeSet};

use cycle_plugin::decode::{Branch, Class, Instruction};

use super::code::{Code, Function};

/// Target of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// The function at this address.
    To(u32),
    /// The function whose address is in a register.
    Indirect,
}

/// An instruction in its function.
#[derive(Clone, Debug)]
pub struct FlowInstruction {
    /// Its address.
    pub address: u32,
    /// The decoded instruction.
    pub instruction: Instruction,
    /// Whether it is in an `IT` block.
    pub predicated: bool,
    /// Indices of its successors within the function.
    pub next: Vec<usize>,
    /// Its call; without a successor a tail call.
    pub call: Option<Call>,
    /// Whether it is a jump with unknown targets.
    pub unresolved: bool,
}

/// Control flow of a function.
#[derive(Clone, Debug, Default)]
pub struct Flow {
    /// Instructions in order of their addresses.
    pub instructions: Vec<FlowInstruction>,
    /// Index of the first instruction.
    pub entry: usize,
}

/// Successors of an instruction: addresses within the function, its call, whether a target is unknown.
#[derive(Default)]
struct Successors {
    next: Vec<u32>,
    call: Option<Call>,
    unresolved: bool,
}

/// Builds the control flow of a function.
#[must_use]
pub fn flow(code: &Code, function: &Function) -> Flow {
    let inside = |address: u32| (function.start..function.end).contains(&address) && code.is_code(address);
    let mut visited: BTreeMap<u32, Successors> = BTreeMap::new();
    let mut predicated = BTreeSet::new();
    let mut waiting = vec![function.start];
    while let Some(address) = waiting.pop() {
        if visited.contains_key(&address) {
            continue;
        }
        let instruction = code.instruction(address);
        if instruction.class == Class::IfThen {
            let mut at = address + 2;
            for _ in 0..4 - (code.halfword(address) & 15).trailing_zeros() {
                predicated.insert(at);
                at += u32::from(code.instruction(at).length);
            }
        }
        let mut found = successors(
            code,
            function,
            address,
            &instruction,
            predicated.contains(&address),
        );
        // After a call that does not return there may be data or nothing.
        found.next.retain(|address| inside(*address));
        waiting.extend(&found.next);
        visited.insert(address, found);
    }
    let index: BTreeMap<u32, usize> = visited.keys().copied().zip(0..).collect();
    let instructions = visited.iter().map(|(address, successor)| FlowInstruction {
        address: *address,
        instruction: code.instruction(*address),
        predicated: predicated.contains(address),
        next: successor
            .next
            .iter()
            .filter_map(|address| index.get(address).copied())
            .collect(),
        call: successor.call,
        unresolved: successor.unresolved,
    });
    Flow {
        instructions: instructions.collect(),
        entry: index.get(&function.start).copied().unwrap_or(0),
    }
}

fn successors(
    code: &Code,
    function: &Function,
    address: u32,
    instruction: &Instruction,
    predicated: bool,
) -> Successors {
    let following = address + u32::from(instruction.length);
    let mut successor = Successors::default();
    let mut falls_through = predicated || code.is_conditional(address);
    match instruction.class {
        Class::Branch(Branch::Direct(to)) if (function.start..function.end).contains(&to) => {
            successor.next.push(to);
        }
        Class::Branch(Branch::Direct(to)) => successor.call = Some(Call::To(to)),
        Class::Branch(Branch::Call(to)) => {
            successor.call = Some(Call::To(to));
            falls_through = true;
        }
        Class::Branch(Branch::CallIndirect) => {
            successor.call = Some(Call::Indirect);
            falls_through = true;
        }
        Class::Branch(Branch::Return) => {}
        Class::Branch(Branch::Indirect) => successor.call = Some(Call::Indirect),
        Class::Table => successor.next = table(code, address),
        Class::Trap => falls_through = !code.is_end(address),
        _ if instruction.is_return() => {}
        _ if instruction.may_branch() => successor.unresolved = true,
        _ => falls_through = true,
    }
    if falls_through {
        successor.next.push(following);
    }
    successor
}

/// Targets of `TBB` and `TBH` relative to the program counter: the table follows, up to the next code.
fn table(code: &Code, address: u32) -> Vec<u32> {
    let from = address + 4;
    let halfwords = code.halfword(address + 2) & 0x10 != 0;
    let mut end = code.data_end(from);
    let mut targets = Vec::new();
    let mut at = from;
    while at < end {
        let entry = if halfwords {
            u32::from(code.halfword(at))
        } else {
            u32::from(code.halfword(at & !1).to_le_bytes()[(at & 1) as usize])
        };
        let target = from + 2 * entry;
        if code.is_code(target) {
            targets.push(target);
            // The table ends at the latest where the first case begins.
            if target > at {
                end = end.min(target);
            }
        }
        at += if halfwords { 2 } else { 1 };
    }
    targets
}
