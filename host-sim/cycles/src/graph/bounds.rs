//! The bound of every loop of the sample task and of the planning task; a loop that is not listed fails `tests/cycles.rs`. Listed by function, because lines
//! move: a bound holds for every loop of its function, and is to be reviewed when a loop is added.

/// Function of a loop, greatest number of iterations, reason.
const BOUNDS: &[(&str, u32, &str)] = &[
    ("compiler_builtins::arm::__aeabi_memcpy4", 512, COPIED),
    ("compiler_builtins::arm::__aeabi_memset4", 512, COPIED),
    (
        "compiler_builtins::int::specialized_div_rem::u64_div_rem",
        8,
        "32 bits of the quotient, four an iteration",
    ),
    (
        "compiler_builtins::mem::impls::compare_bytes",
        12,
        "bytes of an axis position",
    ),
    (
        "compiler_builtins::mem::impls::copy_forward::copy_forward_aligned_words",
        512,
        COPIED,
    ),
    (
        "compiler_builtins::mem::impls::copy_forward::copy_forward_bytes",
        15,
        "bytes that do not fill a word copy",
    ),
    (
        "compiler_builtins::mem::impls::copy_forward::copy_forward_misaligned_words",
        512,
        COPIED,
    ),
    (
        "compiler_builtins::mem::impls::set_bytes::set_bytes_bytes",
        15,
        "bytes that do not fill a word",
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
        "cells of a finite-difference stencil before a station: STENCIL_CELLS",
    ),
    (
        "interp_core::feed::plan::Plan::is_clear",
        8,
        "cells scanned ahead: REACH",
    ),
    (
        "interp_core::feed::plan::Plan::merge",
        4,
        "cells merged for each bounded cell: MERGED",
    ),
    (
        "interp_core::feed::plan::Plan::pass_cell",
        2,
        "cells timed for each bounded cell: TIMED",
    ),
    (
        "interp_core::feed::plan::Plan::work",
        3,
        "cells of a tick at standstill: CELLS_STANDING",
    ),
    (
        "interp_core::feed::plan::bounds::bound",
        8,
        "neighbours on each side that a bound depends on: REACH",
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
        "interp_core::sequence::sequencer::Sequencer::plan",
        16,
        "tasks of the look-ahead in a period: TASKS_MAX",
    ),
    (
        "interp_core::surface::lines::CoordinateCubics::collapse",
        4,
        "rows of a block",
    ),
    ("interp_core::surface::pole::Reduced::collapse", 3, "axes"),
];

/// Copies and fills have sizes known at compile time.
const COPIED: &str = "words of the largest value that is copied, below 2 KiB";

/// Listed functions without a loop.
pub fn stale<'a>(places: impl Fn(&str) -> bool + 'a) -> impl Iterator<Item = &'static str> + 'a {
    BOUNDS
        .iter()
        .map(|(place, _, _)| *place)
        .filter(move |place| !places(place))
}

/// Bound of the loops of a function: iterations, reason.
#[must_use]
pub fn of(place: &str) -> Option<(u32, &'static str)> {
    BOUNDS
        .iter()
        .find(|(listed, _, _)| *listed == place)
        .map(|(_, rounds, why)| (*rounds, *why))
}
