//! Call graph, and the deepest stack that follows from it.

use std::collections::BTreeSet;

use addr2line::Loader;

use super::super::stages;
use super::code::Code;
use super::flow::{self, Call, Flow};
use super::frame::{self, Frame};

/// A call of a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    /// Index of the function called.
    pub to: usize,
    /// Stack of the caller at the call, bytes.
    pub depth: i32,
    /// An indirect call: the target may be any function whose address is taken.
    pub indirect: bool,
}

/// A function with its frame and its calls.
#[derive(Clone, Debug, Default)]
pub struct Node {
    /// Its instructions.
    pub flow: Flow,
    /// Its own stack.
    pub frame: Frame,
    /// Its calls.
    pub calls: Vec<Edge>,
    /// Addresses of jumps with unknown targets.
    pub unresolved: Vec<u32>,
}

/// All functions of an image, by the indices of [`Code::functions`].
#[derive(Clone, Debug, Default)]
pub struct Calls {
    /// The functions.
    pub nodes: Vec<Node>,
}

/// Depth of a stack, and the chain of calls that reaches it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeepestStack {
    /// Bytes.
    pub bytes: i32,
    /// Functions, the caller first.
    pub chain: Vec<usize>,
}

/// Whether a function belongs to `core::fmt` or implements one of its traits: those are called indirectly only from there.
fn formats(name: &str) -> bool {
    name.contains("core::fmt")
}

impl Calls {
    /// Builds the call graph of an image.
    #[must_use]
    pub fn new(code: &Code, lines: &Loader) -> Self {
        let taken = code.address_taken();
        let nodes = code.functions.iter().map(|function| {
            let flow = flow::flow(code, function);
            let frame = frame::frame(code, &flow);
            let mut calls = BTreeSet::new();
            let mut unresolved = frame.unresolved.clone();
            for (step, depth) in flow.instructions.iter().zip(&frame.depth) {
                let mut call = |to, indirect| {
                    calls.insert(Edge {
                        to,
                        depth: *depth,
                        indirect,
                    });
                };
                match step.call {
                    Some(Call::To(address)) => match code.function_at(address) {
                        Some(to) if code.functions[to].start == address => call(to, false),
                        _ => unresolved.push(step.address),
                    },
                    Some(Call::Indirect) => {
                        let formats = stages::chain(lines, step.address)
                            .iter()
                            .any(|name| formats(name));
                        taken
                            .iter()
                            .filter(|to| self::formats(&code.functions[**to].name) == formats)
                            .for_each(|to| call(*to, true));
                    }
                    None if step.unresolved => unresolved.push(step.address),
                    None => {}
                }
            }
            Node {
                flow,
                frame,
                calls: calls.into_iter().collect(),
                unresolved,
            }
        });
        Self {
            nodes: nodes.collect(),
        }
    }

    /// Functions reachable from one, itself included.
    #[must_use]
    pub fn reachable(&self, from: usize) -> BTreeSet<usize> {
        let mut reached = BTreeSet::from([from]);
        let mut waiting = vec![from];
        while let Some(index) = waiting.pop() {
            let calls = self.nodes.get(index).map_or(&[][..], |node| &node.calls);
            waiting.extend(calls.iter().map(|edge| edge.to).filter(|to| reached.insert(*to)));
        }
        reached
    }

    /// The deepest stack of a call of this function, without the calls of `without`.
    ///
    /// # Errors
    /// The functions of a recursion.
    pub fn deepest(&self, from: usize, without: &BTreeSet<usize>) -> Result<DeepestStack, Vec<usize>> {
        let mut known = vec![None; self.nodes.len()];
        for index in without {
            known[*index] = Some(DeepestStack::default());
        }
        self.descend(from, &mut known, &mut Vec::new())
    }

    fn descend(
        &self,
        at: usize,
        known: &mut [Option<DeepestStack>],
        path: &mut Vec<usize>,
    ) -> Result<DeepestStack, Vec<usize>> {
        if let Some(begin) = path.iter().position(|index| *index == at) {
            return Err(path[begin..].to_vec());
        }
        if let Some(deepest) = &known[at] {
            return Ok(deepest.clone());
        }
        path.push(at);
        let node = &self.nodes[at];
        let mut deepest = DeepestStack {
            bytes: node.frame.max,
            chain: vec![at],
        };
        for edge in &node.calls {
            let below = self.descend(edge.to, known, path)?;
            if edge.depth + below.bytes > deepest.bytes {
                deepest.bytes = edge.depth + below.bytes;
                deepest.chain = [&[at], below.chain.as_slice()].concat();
            }
        }
        path.pop();
        known[at] = Some(deepest.clone());
        Ok(deepest)
    }
}
