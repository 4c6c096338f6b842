//! Depth of the stack at each instruction of a function, from the changes of the stack pointer.

use cycle_plugin::decode::Registers;

use super::code::Code;
use super::flow::Flow;

/// Effect of an instruction on the stack pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effect {
    /// The stack grows by these bytes; negative where it shrinks.
    Grows(i32),
    /// R7 is set to these bytes above the stack pointer.
    Frame(i32),
    /// The stack pointer is set to these bytes below R7.
    BelowFrame(i32),
}

/// Value of a modified immediate (`ThumbExpandImm`).
fn expanded(first: u16, second: u16) -> i32 {
    let (i, three, eight) = ((first >> 10) & 1, (second >> 12) & 7, u32::from(second & 0xff));
    let how = (i << 4) | (three << 1) | u16::try_from(eight >> 7).unwrap_or(0);
    let number = match how >> 1 {
        0 | 1 if how < 2 => eight,
        1 => eight | eight << 16,
        2 => eight << 8 | eight << 24,
        3 => eight | eight << 8 | eight << 16 | eight << 24,
        _ => (0x80 | (eight & 0x7f)).rotate_right(u32::from(how)),
    };
    i32::try_from(number).unwrap_or(i32::MAX)
}

/// A 12-bit immediate.
fn plain(first: u16, second: u16) -> i32 {
    i32::from(((first >> 10) & 1) << 11 | ((second >> 12) & 7) << 8 | (second & 0xff))
}

fn words(list: u16) -> i32 {
    4 * i32::try_from(list.count_ones()).unwrap_or(0)
}

/// Effect of a 16-bit instruction.
fn narrow(code: u16) -> Option<Effect> {
    let low = i32::from(code & 0xff);
    Some(match code >> 8 {
        0xb4 | 0xb5 => Effect::Grows(words(code & 0x1ff)),
        0xbc | 0xbd => Effect::Grows(-words(code & 0x1ff)),
        0xb0 if code & 0x80 == 0 => Effect::Grows(-4 * low),
        0xb0 => Effect::Grows(4 * (low & 0x7f)),
        0xaf => Effect::Frame(4 * low),
        _ if code == 0x466f => Effect::Frame(0),
        _ if code == 0x46bd => Effect::BelowFrame(0),
        _ => return None,
    })
}

/// Effect of a 32-bit instruction.
fn wide(first: u16, second: u16) -> Option<Effect> {
    let to_sp = (second >> 8) & 15 == 13 && second & 0x8000 == 0;
    let low = i32::from(second & 0xff);
    Some(match (first, first & !0x0400) {
        (0xe92d, _) => Effect::Grows(words(second)),
        (0xe8bd, _) => Effect::Grows(-words(second)),
        (0xed2d | 0xed6d, _) => Effect::Grows(4 * low),
        (0xecbd | 0xecfd, _) => Effect::Grows(-4 * low),
        (0xf84d, _) if second & 0xf00 == 0xd00 => Effect::Grows(low),
        (0xf85d, _) if second & 0xf00 == 0xb00 => Effect::Grows(-low),
        (0xe96d, _) => Effect::Grows(4 * low),
        (0xe8fd, _) => Effect::Grows(-4 * low),
        (_, 0xf1ad) if to_sp => Effect::Grows(expanded(first, second)),
        (_, 0xf10d) if to_sp => Effect::Grows(-expanded(first, second)),
        (_, 0xf2ad) if to_sp => Effect::Grows(plain(first, second)),
        (_, 0xf20d) if to_sp => Effect::Grows(-plain(first, second)),
        (_, 0xf1a7) if to_sp => Effect::BelowFrame(expanded(first, second)),
        (_, 0xf2a7) if to_sp => Effect::BelowFrame(plain(first, second)),
        _ => return None,
    })
}

/// Stack depth of a function.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Depth before each instruction of the flow, bytes.
    pub depth: Vec<i32>,
    /// The greatest depth, bytes.
    pub max: i32,
    /// Addresses of instructions with an unknown effect, or where two paths join at different depths.
    pub unresolved: Vec<u32>,
}

/// Computes the stack depth along the control flow of a function.
#[must_use]
pub fn frame(code: &Code, flow: &Flow) -> Frame {
    let mut seen: Vec<Option<(i32, i32)>> = vec![None; flow.instructions.len()];
    let mut found = Frame::default();
    let mut waiting = vec![(flow.entry, (0_i32, 0_i32))];
    while let Some((index, state)) = waiting.pop() {
        let Some(step) = flow.instructions.get(index) else {
            continue;
        };
        if let Some(before) = seen[index] {
            if before.0 != state.0 {
                found.unresolved.push(step.address);
            }
            continue;
        }
        seen[index] = Some(state);
        let (first, second) = (code.halfword(step.address), code.halfword(step.address + 2));
        let effect = if step.instruction.length == 2 {
            narrow(first)
        } else {
            wide(first, second)
        };
        let (mut depth, mut base) = state;
        match effect {
            Some(Effect::Grows(bytes)) => depth += bytes,
            Some(Effect::Frame(above)) => base = depth - above,
            Some(Effect::BelowFrame(below)) => depth = base + below,
            None if step.instruction.writes.meets(Registers::SP) => found.unresolved.push(step.address),
            None => {}
        }
        found.max = found.max.max(depth);
        if step.predicated && step.instruction.is_return() {
            // The successor runs if the return does not.
            (depth, base) = state;
        }
        waiting.extend(step.next.iter().map(|next| (*next, (depth, base))));
    }
    found.depth = seen
        .iter()
        .map(|state| state.map_or(0, |state| state.0))
        .collect();
    found
}
