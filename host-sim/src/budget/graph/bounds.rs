//! The bound of every loop of the sample task: a loop that is not listed fails `tests/cycles.rs`, until its bound is
//! written down here. By function, because lines move: who adds a loop to a function of this table looks at its bound too.

/// Place of a loop, the rounds that it makes at most, and why.
const BOUNDS: &[(&str, u32, &str)] = &[
    ("compiler_builtins::arm::__aeabi_memcpy4", 512, COPIED),
    ("compiler_builtins::arm::__aeabi_memset4", 512, COPIED),
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
    (
        "firmware::app::sample",
        3,
        "events of a tick: TickOutput::EVENTS_MAX",
    ),
    (
        "interp_core::interpolator::Interpolator::step",
        4,
        "patches crossed in a tick: CROSSINGS_MAX + 1",
    ),
    (
        "interp_core::offset::Offset::new",
        24,
        "halvings of the unit: SHIFT_MAX",
    ),
    ("interp_core::schedule::next_side", 1024, "side spans: SPANS_MAX"),
    (
        "interp_core::surface::polynomial::PolynomialRecord::from_words",
        48,
        "coefficients of a record",
    ),
    ("interp_core::surface::polynomial::collapse_axis", 3, "axes"),
    (
        "interp_core::surface::rational::RationalRecord::from_words",
        64,
        "coefficients of a record",
    ),
    ("interp_core::surface::rational::collapse_axis", 3, "axes"),
];

/// Copies and fills are of values whose size the compiler knows.
const COPIED: &str = "words of the largest value that is copied, below 2 KiB";

/// Bound of the loops at a place: rounds at most, and why.
#[must_use]
pub fn of(place: &str) -> Option<(u32, &'static str)> {
    BOUNDS
        .iter()
        .find(|(listed, _, _)| *listed == place)
        .map(|(_, rounds, why)| (*rounds, *why))
}
