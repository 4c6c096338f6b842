//! The stage of each instruction of the image.
//!
//! The compiler inlines nearly everything into the timer's handler, so symbols do not help. The line tables do: each
//! address has a chain of functions, from the one inlined innermost to the one that has a symbol. The innermost that
//! belongs to a stage decides, unless the chain is part of a change of pass or patch. Helpers (vectors, fixed point,
//! `core`) belong to the function that uses them; where they are called, the plugin charges the caller.
//!
//! Limits: code that the compiler merged from two stages has the line of one; evaluations at the end of a patch, which a change
//! of patch needs, are charged to `step` and `surface`.

use std::collections::HashMap;

use addr2line::{FunctionName, Loader, gimli};
use cycle_plugin::plan::Stage;

/// A module of `interp_core` (a function in it, or all of it) and its stage; the first match applies. A name that occurs nowhere in
/// the image is an error: rename it here together with the core.
const STAGES: [(&str, &str, Stage); 26] = [
    ("pass::contact", "", Stage::Step),
    ("surface::ball", "", Stage::Offset),
    ("surface", "collapse", Stage::PatchChange),
    ("surface", "", Stage::Surface),
    ("pass::offset", "", Stage::Offset),
    ("pass::interval", "", Stage::Interval),
    ("pass::patch", "", Stage::PatchChange),
    ("pass::schedule", "", Stage::PassChange),
    ("pass::step_over", "", Stage::PassChange),
    ("pass::scan", "", Stage::PassChange),
    ("pass::lines", "", Stage::PassChange),
    ("job::region", "", Stage::PassChange),
    ("pass::run", "step_far", Stage::Step),
    ("pass::buffer", "", Stage::PatchChange),
    ("pass::run", "next_piece", Stage::PatchChange),
    ("pass::run", "begin_pass", Stage::PassChange),
    ("pass::run", "step_over", Stage::PassChange),
    ("pass::run", "find_step_over", Stage::PassChange),
    ("pass::run", "end_pass", Stage::PassChange),
    ("pass::run", "", Stage::Rest),
    ("interpolator", "", Stage::Rest),
    ("steps", "", Stage::Pulses),
    ("feed", "", Stage::Feed),
    ("sequence::sequencer", "", Stage::Feed),
    ("sequence::lookahead", "", Stage::Feed),
    ("sequence::link", "", Stage::Feed),
];

/// The function that counts a sample in.
const ADD_SAMPLE: &str = "controller::realtime::run::RunRecord::add";

/// The module that it calls: helpers.
const DIGEST: &str = "protocol::digest";

/// Crates whose other functions are [`Stage::Rest`].
const REST: [&str; 6] = [
    "controller",
    "protocol",
    "firmware",
    "heapless",
    "rtic",
    "stm32f4xx_hal",
];

/// Classification of a function by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Entry {
    /// A line of [`STAGES`].
    Line(usize),
    /// [`ADD_SAMPLE`].
    AddSample,
    /// A crate of [`REST`].
    Rest,
    /// A helper, charged to its caller.
    Helper,
}

impl Entry {
    /// By a function's path.
    fn of(path: &str) -> Self {
        let path = path.trim_start_matches(['<', '&']);
        let mut parts = path
            .split("::")
            .map(|part| part.split('<').next().unwrap_or(part));
        match parts.next() {
            Some("interp_core") => {}
            Some(_) if path == ADD_SAMPLE => return Self::AddSample,
            Some("protocol") if path.starts_with(DIGEST) => return Self::Helper,
            Some(root) if REST.contains(&root) => return Self::Rest,
            _ => return Self::Helper,
        }
        let parts: Vec<&str> = parts.collect();
        let fits = |module: &str, name: &str| {
            let mut names = parts.iter();
            module.split("::").all(|part| names.next() == Some(&part))
                && (name.is_empty() || names.any(|part| is_name(part, name)))
        };
        STAGES
            .iter()
            .position(|(module, name, _)| fits(module, name))
            .map_or(Self::Helper, Self::Line)
    }

    const fn stage(self) -> Option<Stage> {
        match self {
            Self::Line(line) => Some(STAGES[line].2),
            Self::AddSample => Some(Stage::Digest),
            Self::Rest => Some(Stage::Rest),
            Self::Helper => None,
        }
    }
}

/// Whether a part of a path is this function; functions that begin with `collapse` are helpers of it.
fn is_name(part: &str, name: &str) -> bool {
    part == name || (name == "collapse" && part.starts_with("collapse"))
}

/// Stage of a function by its path; `None` for helpers.
#[must_use]
pub fn of_function(path: &str) -> Option<Stage> {
    Entry::of(path).stage()
}

/// Stage of a chain of functions, the innermost first.
fn of_chain(chain: &[Option<Stage>]) -> Option<Stage> {
    [Stage::PassChange, Stage::PatchChange]
        .into_iter()
        .find(|change| chain.contains(&Some(*change)))
        .or_else(|| chain.iter().copied().flatten().next())
}

/// The demangled functions at an address, the innermost first; empty without line information.
#[must_use]
pub fn chain(lines: &Loader, address: u32) -> Vec<String> {
    let mut functions = Vec::new();
    if let Ok(mut frames) = lines.find_frames(address.into()) {
        while let Ok(Some(frame)) = frames.next() {
            let name = frame
                .function
                .as_ref()
                .and_then(|function| function.demangle().ok());
            functions.push(name.map(std::borrow::Cow::into_owned).unwrap_or_default());
        }
    }
    functions
}

/// Whether a function belongs to Rust's `core`.
#[must_use]
pub fn is_of_core(path: &str) -> bool {
    let path = path.trim_start_matches(['<', '&', '*', '[']);
    let root = path.split("::").next().unwrap_or(path);
    root == "core" || !path.contains("::") || path.starts_with("const ") || path.starts_with("mut ")
}

/// A function's path without types, closures and instances.
#[must_use]
pub fn plain(path: &str) -> String {
    let mut depth = 0_u32;
    let mut text = String::new();
    let path = path.trim_start_matches(['<', '&']);
    for character in path.chars() {
        match character {
            '<' | '{' => depth += 1,
            '>' | '}' => depth = depth.saturating_sub(1),
            _ if depth == 0 => text.push(character),
            _ => {}
        }
    }
    let parts = text.split("::").filter(|part| !part.is_empty());
    parts.collect::<Vec<_>>().join("::")
}

/// Classification of a function of the image; `known`: by their names there, because demangling them takes longer than everything else.
fn entry<R: gimli::Reader>(known: &mut HashMap<String, Entry>, function: Option<&FunctionName<R>>) -> Entry {
    let name = function
        .and_then(|function| function.raw_name().ok())
        .unwrap_or_default();
    if let Some(entry) = known.get(name.as_ref()) {
        return *entry;
    }
    let path = function
        .and_then(|function| function.demangle().ok())
        .unwrap_or_default();
    let entry = Entry::of(&path);
    known.insert(name.into_owned(), entry);
    entry
}

/// Stage of the instruction at each halfword of the code from `base` on.
///
/// # Errors
/// The lines of the table that match no function of the image.
pub fn map(lines: &Loader, base: u32, code: &[u8]) -> Result<Vec<Option<Stage>>, Vec<String>> {
    let mut known = HashMap::new();
    let map = (0..code.len() / 2)
        .map(|index| {
            let address = base + 2 * u32::try_from(index).unwrap_or(0);
            let mut stages = Vec::new();
            if let Ok(mut frames) = lines.find_frames(address.into()) {
                while let Ok(Some(frame)) = frames.next() {
                    stages.push(entry(&mut known, frame.function.as_ref()).stage());
                }
            }
            of_chain(&stages)
        })
        .collect();
    let found: Vec<Entry> = known.into_values().collect();
    let missing: Vec<String> = (0..STAGES.len())
        .filter(|line| !found.contains(&Entry::Line(*line)))
        .map(|line| format!("{}::{}", STAGES[line].0, STAGES[line].1))
        .chain((!found.contains(&Entry::AddSample)).then(|| ADD_SAMPLE.to_owned()))
        .collect();
    if missing.is_empty() { Ok(map) } else { Err(missing) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_by_path() {
        let stage = |path| of_function(path);
        assert_eq!(stage("interp_core::pass::contact::step"), Some(Stage::Step));
        assert_eq!(
            stage("interp_core::surface::polynomial::PolynomialPass::collapse"),
            Some(Stage::PatchChange)
        );
        assert_eq!(
            stage("interp_core::pass::run::Run::begin_pass"),
            Some(Stage::PassChange)
        );
        assert_eq!(
            stage("<interp_core::math::vec3::Vec3 as core::ops::arith::Add>::add"),
            None
        );
        assert_eq!(stage("core::num::<impl u32>::wrapping_add"), None);
        assert_eq!(
            stage("controller::realtime::run::RunRecord::add"),
            Some(Stage::Digest)
        );
        assert_eq!(
            stage("controller::realtime::run::RunRecord::end_pass"),
            Some(Stage::Rest)
        );
        assert_eq!(stage("protocol::digest::Digest::sample"), None);
    }

    #[test]
    fn a_change_takes_what_is_inlined_into_it() {
        let chain = [
            None,
            Some(Stage::Surface),
            Some(Stage::PassChange),
            Some(Stage::Rest),
        ];
        assert_eq!(of_chain(&chain), Some(Stage::PassChange));
        assert_eq!(of_chain(&chain[..2]), Some(Stage::Surface));
        assert_eq!(of_chain(&[None]), None);
    }

    #[test]
    fn paths_without_types() {
        assert_eq!(
            plain("interp_core::interpolator::Interpolator<_>::step::{{closure}}"),
            "interp_core::interpolator::Interpolator::step"
        );
        assert!(is_of_core(
            "<core::ops::range::Range<u16> as core::iter::Iterator>::next"
        ));
        assert!(is_of_core("<*mut u32>::offset"));
        assert!(!is_of_core("interp_core::pass::offset::Locator::new"));
    }
}
