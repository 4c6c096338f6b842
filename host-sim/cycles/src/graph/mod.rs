//! Static analysis of the image: deepest stack, functions of the sample task and of the planning task, their loops.
//!
//! ```text
//!  image ─code─► functions ─flow─► instructions and successors ─┬─frame─► stack depth ─┐
//!                                                              ├─calls─► call graph ──┴─► deepest stack
//!                                                              └─loops─► loops, each with its function
//! ```
//!
//! The figures are upper bounds: an indirect call reaches every function whose address is taken (those of `core::fmt`'s traits from
//! `core::fmt` alone), and each interrupt preempts the one below at its deepest stack. Left out: the reports of a panic and of a
//! hard fault, which end the program.

pub mod bounds;
pub mod calls;
pub mod code;
pub mod flow;
pub mod frame;
pub mod loops;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use addr2line::Loader;
use object::File;

use self::calls::Calls;
use self::code::Code;
use super::{BudgetError, image, stages};

/// Greatest stack of an exception entry: 8 words, S0 to S15, FPSCR, a reserved word, and a word that aligns the frame; bytes.
pub const EXCEPTION_BYTES: i32 = 4 * (8 + 16 + 1 + 1) + 4;

/// The first exception number of an interrupt.
const INTERRUPTS: u32 = 16;

/// The function that a panic ends in.
const PANIC: &str = "rust_begin_unwind";

/// Stack of the thread or of an interrupt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StackContext {
    /// Name of its first function.
    pub name: String,
    /// DeepestStack stack, bytes, without the exception's frame.
    pub bytes: i32,
    /// The chain of calls, the caller first.
    pub chain: Vec<String>,
}

/// Result of the static analysis.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Analysis {
    /// The thread first, then the interrupts.
    pub contexts: Vec<StackContext>,
    /// Functions reachable from the sample task or the planning task.
    pub task: Vec<String>,
    /// Functions with loops in these tasks, and the number of loops in the image.
    pub loops: BTreeMap<String, u32>,
    /// Instructions that could not be analysed; if there are any, the figures are no bounds.
    pub unresolved: Vec<String>,
}

impl Analysis {
    /// The deepest stack: the thread with all interrupts nested.
    #[must_use]
    pub fn stack_bytes(&self) -> u32 {
        let interrupts = self.contexts.iter().skip(1);
        let bytes: i32 = interrupts.map(|context| context.bytes + EXCEPTION_BYTES).sum();
        let thread = self.contexts.first().map_or(0, |context| context.bytes);
        u32::try_from(bytes + thread).unwrap_or(0)
    }

    /// Functions of these tasks that can panic.
    #[must_use]
    pub fn panics(&self) -> Vec<&str> {
        let panics = |name: &&str| {
            name.contains("panicking") || name.contains(PANIC) || name.contains("unwrap_failed")
        };
        self.task.iter().map(String::as_str).filter(panics).collect()
    }

    /// Loops of these tasks without a listed bound.
    #[must_use]
    pub fn unbounded(&self) -> Vec<&str> {
        let places = self.loops.keys().map(String::as_str);
        places.filter(|place| bounds::of(place).is_none()).collect()
    }

    /// Listed bounds without a loop.
    #[must_use]
    pub fn stale(&self) -> Vec<&str> {
        bounds::stale(|place| self.loops.contains_key(place)).collect()
    }
}

/// Analyses an image.
///
/// # Errors
/// The image cannot be read, lacks one of the tasks, or has a recursion.
pub fn analyse(path: &Path) -> Result<Analysis, BudgetError> {
    let bad = |error: &dyn std::fmt::Display| BudgetError::Image(error.to_string());
    let bytes = std::fs::read(path).map_err(|error| BudgetError::File(path.into(), error.to_string()))?;
    let file = File::parse(bytes.as_slice()).map_err(|error| bad(&error))?;
    let lines = Loader::new(path).map_err(|error| bad(&error))?;
    let code = Code::new(&file, image::bare_plan(&file)?);
    let calls = Calls::new(&code, &lines);
    let thread = code
        .function_named("Reset")
        .ok_or_else(|| bad(&"it has no function Reset"))?;
    let tasks = code
        .tasks()
        .ok_or_else(|| bad(&"it lacks the sample task or the planning task"))?;
    let panics = |index: &usize| code.functions[*index].name.contains(PANIC);
    let without: BTreeSet<usize> = (0..code.functions.len()).filter(panics).collect();
    let name = |index: usize| code.functions[index].name.clone();
    let mut analysis = Analysis::default();
    let handlers = code.handlers();
    let interrupts = handlers.iter().filter(|(exception, _)| *exception >= INTERRUPTS);
    for begin in [thread]
        .into_iter()
        .chain(interrupts.map(|(_, function)| *function))
    {
        let deepest = calls.deepest(begin, &without).map_err(|circle| {
            let names: Vec<_> = circle.into_iter().map(name).collect();
            bad(&format!("recursion: {}", names.join(", ")))
        })?;
        analysis.contexts.push(StackContext {
            name: name(begin),
            bytes: deepest.bytes,
            chain: deepest.chain.into_iter().map(name).collect(),
        });
        for index in calls.reachable(begin) {
            let unresolved = calls.nodes[index].unresolved.iter();
            analysis
                .unresolved
                .extend(unresolved.map(|address| format!("{address:#x} in {}", name(index))));
        }
    }
    let reachable: BTreeSet<usize> = tasks.iter().flat_map(|task| calls.reachable(*task)).collect();
    for index in reachable {
        analysis.task.push(name(index));
        let flow = &calls.nodes[index].flow;
        for found in loops::loops(flow) {
            let addresses = found
                .instructions
                .iter()
                .map(|step| flow.instructions[*step].address);
            let place = place(&lines, addresses).unwrap_or_else(|| name(index));
            *analysis.loops.entry(place).or_insert(0) += 1;
        }
    }
    Ok(analysis)
}

/// Least share of a loop's instructions that belong to the function of the loop; the compiler shares or moves the others.
const SHARE: f64 = 0.8;

/// The function of a loop: the innermost that contains [`SHARE`] of its instructions, without functions of `core`.
fn place(lines: &Loader, addresses: impl Iterator<Item = u32>) -> Option<String> {
    let chains: Vec<Vec<String>> = addresses
        .map(|address| {
            let chain = stages::chain(lines, address);
            let own = chain.iter().filter(|name| !stages::is_of_core(name));
            own.rev().map(|name| stages::plain(name)).collect()
        })
        .collect();
    let mut place: Vec<String> = Vec::new();
    loop {
        let mut counts: BTreeMap<&str, u32> = BTreeMap::new();
        let inside = chains.iter().filter(|chain| chain.starts_with(&place));
        for next in inside.filter_map(|chain| chain.get(place.len())) {
            *counts.entry(next).or_insert(0) += 1;
        }
        let most = counts.into_iter().max_by_key(|(_, count)| *count);
        #[allow(
            clippy::cast_precision_loss,
            reason = "a function has not that many instructions"
        )]
        let all = chains.len() as f64;
        match most {
            Some((next, count)) if f64::from(count) >= SHARE * all => place.push(next.to_owned()),
            _ => return place.pop(),
        }
    }
}
