//! Loops of a function: the strongly connected components of its control flow, then recursively those within each component without
//! its head.
//!
//! Backward branches would not do, because compilers reorder blocks. Two loops that share their head are one loop. A component with
//! several entries is a loop with its lowest entry as head.

use super::flow::Flow;

/// A loop of a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loop {
    /// Index of the instruction where it is entered.
    pub head: usize,
    /// Indices of its instructions, in order.
    pub instructions: Vec<usize>,
}

/// All loops of a function, outer before inner.
#[must_use]
pub fn loops(flow: &Flow) -> Vec<Loop> {
    let mut found = Vec::new();
    let all: Vec<usize> = (0..flow.instructions.len()).collect();
    let mut waiting = vec![(all, None)];
    while let Some((instructions, without)) = waiting.pop() {
        for part in connected(flow, &instructions, without) {
            let head = head(flow, &part);
            found.push(Loop {
                head,
                instructions: part.clone(),
            });
            waiting.push((part, Some(head)));
        }
    }
    found
}

/// The entry of a component.
fn head(flow: &Flow, part: &[usize]) -> usize {
    let entries = (0..flow.instructions.len())
        .filter(|index| part.binary_search(index).is_err())
        .flat_map(|index| &flow.instructions[index].next)
        .filter(|next| part.binary_search(next).is_ok());
    let first = entries.min().copied();
    if part.binary_search(&flow.entry).is_ok() {
        return flow.entry;
    }
    first.unwrap_or(part[0])
}

/// State of an instruction in Tarjan's algorithm (1972).
#[derive(Clone, Copy, Default)]
struct Mark {
    inside: bool,
    number: usize,
    low: usize,
    open: bool,
}

/// Strongly connected components with a cycle, among these instructions without `without`.
fn connected(flow: &Flow, instructions: &[usize], without: Option<usize>) -> Vec<Vec<usize>> {
    let mut marks = vec![Mark::default(); flow.instructions.len()];
    for step in instructions.iter().filter(|step| Some(**step) != without) {
        marks[*step].inside = true;
    }
    let mut parts = Vec::new();
    let (mut count, mut open) = (0, Vec::new());
    for root in instructions {
        if !marks[*root].inside || marks[*root].number > 0 {
            continue;
        }
        // Explicit stack of instructions, each with the number of its next successor: a recursion would be too deep.
        let mut path = vec![(*root, 0)];
        while let Some((at, turn)) = path.pop() {
            if turn == 0 {
                count += 1;
                marks[at].number = count;
                marks[at].low = count;
                marks[at].open = true;
                open.push(at);
            }
            if let Some(next) = flow.instructions[at].next.get(turn) {
                path.push((at, turn + 1));
                if marks[*next].inside && marks[*next].number == 0 {
                    path.push((*next, 0));
                } else if marks[*next].inside && marks[*next].open {
                    marks[at].low = marks[at].low.min(marks[*next].number);
                }
                continue;
            }
            if let Some((caller, _)) = path.last() {
                marks[*caller].low = marks[*caller].low.min(marks[at].low);
            }
            if marks[at].low == marks[at].number {
                let from = open.iter().rposition(|index| *index == at).unwrap_or(0);
                let mut part = open.split_off(from);
                part.iter().for_each(|index| marks[*index].open = false);
                part.sort_unstable();
                if part.len() > 1 || flow.instructions[at].next.contains(&at) {
                    parts.push(part);
                }
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::flow::FlowInstruction;
    use cycle_plugin::decode::decode;

    fn flow(edges: &[&[usize]]) -> Flow {
        let instructions = edges.iter().map(|next| FlowInstruction {
            address: 0,
            instruction: decode(0, 0xbf00, 0),
            predicated: false,
            next: next.to_vec(),
            call: None,
            unresolved: false,
        });
        Flow {
            instructions: instructions.collect(),
            entry: 0,
        }
    }

    fn instructions(flow: &Flow) -> Vec<Vec<usize>> {
        loops(flow).into_iter().map(|found| found.instructions).collect()
    }

    #[test]
    fn a_branch_backwards_is_no_loop() {
        // 0 -> 2 -> 1 -> 3: a block out of order.
        assert!(instructions(&flow(&[&[2], &[3], &[1], &[]])).is_empty());
    }

    #[test]
    fn nested_and_twofold() {
        // 1..=4 around 2..=3, then 5 by itself.
        let flow = flow(&[&[1], &[2], &[3], &[2, 4], &[1, 5], &[5, 6], &[]]);
        let mut found = instructions(&flow);
        found.sort();
        assert_eq!(found, [vec![1, 2, 3, 4], vec![2, 3], vec![5]]);
    }

    #[test]
    fn two_ways_in() {
        // 0 enters 1 and 2, which go round.
        assert_eq!(instructions(&flow(&[&[1, 2], &[2], &[1, 3], &[]])), [vec![1, 2]]);
    }
}
