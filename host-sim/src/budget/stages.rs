//! Which stage an instruction of the image belongs to.
//!
//! The compiler inlines nearly everything into the timer's handler, so symbols do not help. The line tables do: each
//! address has a chain of functions, from the one inlined innermost to the one that has a symbol. The innermost that
//! belongs to a stage decides, unless the chain is part of a change of pass or patch. Helpers (vectors, fixed point,
//! `core`) belong to whoever uses them; where they are called, the plugin charges the caller.
//!
//! Limits: what the compiler merged or moved out of two stages carries the place of one; evaluations at the end of
//! a patch, which a change of patch needs, count to `step` and `surface`.

use addr2line::Loader;
use cycle_plugin::plan::Stage;

/// Functions of `interp_core::run` that work for a stage; the others are everything else.
const RUN: [(&str, Stage); 8] = [
    ("step_far", Stage::Step),
    ("enter_patch", Stage::PatchChange),
    ("next_span", Stage::PatchChange),
    ("begin_pass", Stage::PassChange),
    ("step_over", Stage::PassChange),
    ("step_on_pole", Stage::PassChange),
    ("note_interval", Stage::PassChange),
    ("end_pass", Stage::PassChange),
];

/// Crates of which every function is everything else.
const REST: [&str; 6] = [
    "controller",
    "protocol",
    "firmware",
    "heapless",
    "rtic",
    "stm32f4xx_hal",
];

/// Stage of a function by its path; none for helpers.
#[must_use]
pub fn of_function(path: &str) -> Option<Stage> {
    let path = path.trim_start_matches(['<', '&']);
    let mut parts = path.split("::");
    let root = parts.next()?;
    if root != "interp_core" {
        return REST.contains(&root).then_some(Stage::Rest);
    }
    let module = parts.next()?;
    let name = path
        .rsplit("::")
        .find(|part| !part.starts_with('{') && !part.starts_with('h'))
        .unwrap_or(path);
    match module {
        "contact" => Some(Stage::Step),
        "surface" if path.contains("::collapse") => Some(Stage::PatchChange),
        "surface" => Some(Stage::Surface),
        "offset" => Some(Stage::Offset),
        "interval" => Some(Stage::Interval),
        "patch" => Some(Stage::PatchChange),
        "program" => None,
        "interpolator" => Some(Stage::Rest),
        "schedule" => Some(Stage::PassChange),
        "run" => Some(
            RUN.iter()
                .find(|(function, _)| path.contains(&format!("::{function}::")) || name == *function)
                .map_or(Stage::Rest, |(_, stage)| *stage),
        ),
        _ => None,
    }
}

/// Stage of a chain of functions, the innermost first.
fn of_chain(chain: &[Option<Stage>]) -> Option<Stage> {
    [Stage::PassChange, Stage::PatchChange]
        .into_iter()
        .find(|change| chain.contains(&Some(*change)))
        .or_else(|| chain.iter().copied().flatten().next())
}

/// The functions at an address, the innermost first, demangled; none where the image says nothing.
fn chain(loader: &Loader, address: u32) -> Vec<String> {
    let mut functions = Vec::new();
    if let Ok(mut frames) = loader.find_frames(address.into()) {
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

/// Stage of the instruction at each halfword of the code from `base` on.
#[must_use]
pub fn map(loader: &Loader, base: u32, code: &[u8]) -> Vec<Option<Stage>> {
    (0..code.len() / 2)
        .map(|index| {
            let address = base + 2 * u32::try_from(index).unwrap_or(0);
            let stages: Vec<_> = chain(loader, address)
                .iter()
                .map(|path| of_function(path))
                .collect();
            of_chain(&stages)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_by_path() {
        let stage = |path| of_function(path);
        assert_eq!(stage("interp_core::contact::step"), Some(Stage::Step));
        assert_eq!(
            stage("interp_core::surface::polynomial::PolynomialPass::collapse"),
            Some(Stage::PatchChange)
        );
        assert_eq!(
            stage("interp_core::run::Run::begin_pass"),
            Some(Stage::PassChange)
        );
        assert_eq!(
            stage("<interp_core::vec3::Vec3 as core::ops::arith::Add>::add"),
            None
        );
        assert_eq!(stage("core::num::<impl u32>::wrapping_add"), None);
        assert_eq!(stage("controller::realtime::Run::add"), Some(Stage::Rest));
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
}
