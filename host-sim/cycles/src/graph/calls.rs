//! Who calls whom, and the deepest stack that follows.

use std::collections::BTreeSet;

use addr2line::Loader;

use super::super::stages;
use super::code::Code;
use super::flow::{self, Call, Flow};
use super::frame::{self, Frame};

/// A call: the function, and the caller's stack at that place, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    /// Index of the function called.
    pub to: usize,
    /// Bytes.
    pub depth: i32,
    /// The address of the function is not in the code: any whose address is kept somewhere may be meant.
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
    /// Addresses of jumps that could not be followed.
    pub lost: Vec<u32>,
}

/// All functions of an image, by the indices of [`Code::functions`].
#[derive(Clone, Debug, Default)]
pub struct Calls {
    /// The functions.
    pub nodes: Vec<Node>,
}

/// A stack's depth, and the chain of calls that makes it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Deepest {
    /// Bytes.
    pub bytes: i32,
    /// Functions, the caller first.
    pub chain: Vec<usize>,
}

/// Whether a function belongs to `core::fmt` or implements one of its traits: those are called by pointer from there alone.
fn formats(name: &str) -> bool {
    name.contains("core::fmt")
}

impl Calls {
    /// Follows every function of an image.
    #[must_use]
    pub fn new(code: &Code, lines: &Loader) -> Self {
        let taken = code.address_taken();
        let nodes = code.functions.iter().map(|function| {
            let flow = flow::flow(code, function);
            let frame = frame::frame(code, &flow);
            let mut calls = BTreeSet::new();
            let mut lost = frame.lost.clone();
            for (step, depth) in flow.steps.iter().zip(&frame.depth) {
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
                        _ => lost.push(step.address),
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
                    None if step.lost => lost.push(step.address),
                    None => {}
                }
            }
            Node {
                flow,
                frame,
                calls: calls.into_iter().collect(),
                lost,
            }
        });
        Self {
            nodes: nodes.collect(),
        }
    }

    /// Functions that can be reached from one, itself included.
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

    /// The deepest stack of a call of this function; calls of `without` are left out.
    ///
    /// # Errors
    /// The functions that call one another in a circle.
    pub fn deepest(&self, from: usize, without: &BTreeSet<usize>) -> Result<Deepest, Vec<usize>> {
        let mut known = vec![None; self.nodes.len()];
        for index in without {
            known[*index] = Some(Deepest::default());
        }
        self.descend(from, &mut known, &mut Vec::new())
    }

    fn descend(
        &self,
        at: usize,
        known: &mut [Option<Deepest>],
        path: &mut Vec<usize>,
    ) -> Result<Deepest, Vec<usize>> {
        if let Some(begin) = path.iter().position(|index| *index == at) {
            return Err(path[begin..].to_vec());
        }
        if let Some(deepest) = &known[at] {
            return Ok(deepest.clone());
        }
        path.push(at);
        let node = &self.nodes[at];
        let mut deepest = Deepest {
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
