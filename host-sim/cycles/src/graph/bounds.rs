//! The bound of every loop of the sample task: a loop that is not listed fails `tests/cycles.rs`, until its bound is
//! written down here. By function, because lines move: who adds a loop to a function of this table looks at its bound too.

/// Place of a loop, the rounds that it makes at most, and why.
const BOUNDS: &[(&str, u32, &str)] = &[
    ("compiler_builtins::arm::__aeabi_memcpy4", 512, COPIED),
    ("compiler_builtins::arm::__aeabi_memset4", 512, COPIED),
    (
        "compiler_builtins::int::specialized_div_rem::u64_div_rem",
        8,
        "the quotient's 32 bits that the chip's own division leaves, four a round",
    ),
    (
        "compiler_builtins::mem::impls::compare_bytes",
        12,
        "bytes of a place of the axes",
    ),
    (
        "compiler_builtins::mem::impls::copy_forward::copy_forward_aligned_words",
        512,
        COPIED,
    ),
    (
        "compiler_builtins::mem::impls::copy_forward::copy_forward_bytes",
        15,
        "less than is copied by words",
    ),
    (
        "compiler_builtins::mem::impls::copy_forward::copy_forward_misaligned_words",
        512,
        COPIED,
    ),
    (
        "compiler_builtins::mem::impls::set_bytes::set_bytes_bytes",
        15,
        "less than is filled by words",
    ),
    ("firmware::drivers::drive_enable::DriveEnable::switch", 3, "axes"),
    (
        "firmware::drivers::safety_inputs::SafetyInputs::gather",
        40,
        "lines of a board's table, and for each of them PORTS_MAX ports",
    ),
    ("controller::step_output::StepOutput::turn", 3, "axes"),
    (
        "interp_core::pass::run::Run::step_far",
        2,
        "patches of an arc: CROSSINGS_MAX + 1",
    ),
    (
        "interp_core::feed::plan::Plan::add",
        2,
        "cells before a station that its differences say something about: STENCIL_CELLS",
    ),
    (
        "interp_core::feed::plan::Plan::is_clear",
        8,
        "cells that are looked through ahead: REACH",
    ),
    (
        "interp_core::feed::plan::Plan::merge",
        4,
        "cells that are merged for one that is bounded: MERGED",
    ),
    (
        "interp_core::feed::plan::Plan::pass_cell",
        2,
        "cells whose time is taken for one that is bounded: TIMED",
    ),
    (
        "interp_core::feed::plan::Plan::work",
        3,
        "cells of a portion: CELLS_STANDING",
    ),
    (
        "interp_core::feed::plan::bounds::bound",
        8,
        "neighbours to a side that a bound may come from: REACH",
    ),
    (
        "interp_core::pass::schedule::apart",
        16,
        "spans between two passes: WALK_MAX",
    ),
    (
        "interp_core::pass::schedule::next_side",
        16,
        "boundaries between side spans: WALK_MAX",
    ),
    (
        "interp_core::steps::axis::Axis::step",
        24,
        "slots of a pulse: PULSE_SLOTS_MAX",
    ),
    (
        "interp_core::steps::axis::add",
        500,
        "pulses of a period: SLOTS over the shortest spacing, 2",
    ),
    (
        "interp_core::surface::lines::Line::collapse",
        4,
        "rows of a block",
    ),
    ("interp_core::surface::pole::Reduced::collapse", 3, "axes"),
];

/// Copies and fills are of values whose size the compiler knows.
const COPIED: &str = "words of the largest value that is copied, below 2 KiB";

/// Listed places that are none of these.
pub fn stale<'a>(places: impl Fn(&str) -> bool + 'a) -> impl Iterator<Item = &'static str> + 'a {
    BOUNDS
        .iter()
        .map(|(place, _, _)| *place)
        .filter(move |place| !places(place))
}

/// Bound of the loops at a place: rounds at most, and why.
#[must_use]
pub fn of(place: &str) -> Option<(u32, &'static str)> {
    BOUNDS
        .iter()
        .find(|(listed, _, _)| *listed == place)
        .map(|(_, rounds, why)| (*rounds, *why))
}
