//! Instructions of a function that can be reached from its first, and where each of them goes on.

use std::collections::{BTreeMap, BTreeSet};

use cycle_plugin::decode::{Branch, Class, Instruction};

use super::code::{Code, Function};

/// What an instruction calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// The function at this address.
    To(u32),
    /// The function whose address is in a register.
    Indirect,
}

/// An instruction in its function.
#[derive(Clone, Debug)]
pub struct Step {
    /// Its address.
    pub address: u32,
    /// What it is.
    pub instruction: Instruction,
    /// In an `IT` block.
    pub predicated: bool,
    /// Indices of what may come next within the function.
    pub next: Vec<usize>,
    /// What it calls; one without a successor is a tail call.
    pub call: Option<Call>,
    /// A jump that could not be followed.
    pub lost: bool,
}

/// Control flow of a function.
#[derive(Clone, Debug, Default)]
pub struct Flow {
    /// In order of their addresses.
    pub steps: Vec<Step>,
    /// Index of the first instruction.
    pub entry: usize,
}

/// Where an instruction goes: addresses within the function, what it calls, whether it was lost.
#[derive(Default)]
struct Way {
    next: Vec<u32>,
    call: Option<Call>,
    lost: bool,
}

/// Follows a function from its first instruction.
#[must_use]
pub fn flow(code: &Code, function: &Function) -> Flow {
    let inside = |address: u32| (function.start..function.end).contains(&address) && code.is_code(address);
    let mut ways: BTreeMap<u32, Way> = BTreeMap::new();
    let mut predicated = BTreeSet::new();
    let mut waiting = vec![function.start];
    while let Some(address) = waiting.pop() {
        if ways.contains_key(&address) {
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
        let mut way = way(
            code,
            function,
            address,
            &instruction,
            predicated.contains(&address),
        );
        // Behind a call that does not return there may be data or nothing.
        way.next.retain(|address| inside(*address));
        waiting.extend(&way.next);
        ways.insert(address, way);
    }
    let index: BTreeMap<u32, usize> = ways.keys().copied().zip(0..).collect();
    let steps = ways.iter().map(|(address, way)| Step {
        address: *address,
        instruction: code.instruction(*address),
        predicated: predicated.contains(address),
        next: way
            .next
            .iter()
            .filter_map(|address| index.get(address).copied())
            .collect(),
        call: way.call,
        lost: way.lost,
    });
    Flow {
        steps: steps.collect(),
        entry: index.get(&function.start).copied().unwrap_or(0),
    }
}

fn way(code: &Code, function: &Function, address: u32, instruction: &Instruction, predicated: bool) -> Way {
    let behind = address + u32::from(instruction.length);
    let mut way = Way::default();
    let mut goes_on = predicated || code.is_conditional(address);
    match instruction.class {
        Class::Branch(Branch::Direct(to)) if (function.start..function.end).contains(&to) => {
            way.next.push(to);
        }
        Class::Branch(Branch::Direct(to)) => way.call = Some(Call::To(to)),
        Class::Branch(Branch::Call(to)) => {
            way.call = Some(Call::To(to));
            goes_on = true;
        }
        Class::Branch(Branch::CallIndirect) => {
            way.call = Some(Call::Indirect);
            goes_on = true;
        }
        Class::Branch(Branch::Return) => {}
        Class::Branch(Branch::Indirect) => way.call = Some(Call::Indirect),
        Class::Table => way.next = table(code, address),
        Class::Trap => goes_on = !code.is_end(address),
        _ if instruction.is_return() => {}
        _ if instruction.may_branch() => way.lost = true,
        _ => goes_on = true,
    }
    if goes_on {
        way.next.push(behind);
    }
    way
}

/// Targets of `TBB` and `TBH` by the program counter: the table stands behind them, up to the next code.
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
            // The first of the cases stands behind the table.
            if target > at {
                end = end.min(target);
            }
        }
        at += if halfwords { 2 } else { 1 };
    }
    targets
}
