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
        "interp_core::job::region::scan_line::ScanLine::drop_passed",
        32,
        "edges that a line meets: CROSSINGS_MAX",
    ),
    (
        "interp_core::job::region::scan_line::ScanLine::keep",
        17,
        "intervals of a line, and one more: CROSSINGS_MAX / 2 + 1",
    ),
    (
        "interp_core::job::region::scan_line::ScanLine::insert",
        32,
        "crossings of a curve: CROSSINGS_MAX",
    ),
    (
        "interp_core::job::region::scan_line::ScanLine::meet",
        32,
        "crossings of a line: CROSSINGS_MAX",
    ),
    (
        "interp_core::job::region::scan_line::ScanLine::take_in",
        32,
        "edges of a portion: TAKEN",
    ),
    (
        "interp_core::pass::contact::solve",
        32,
        "arcs of a period: ARCS_MAX",
    ),
    (
        "interp_core::positioning::Periods::shortest",
        3,
        "whole numbers beside the best real one",
    ),
    (
        "interp_core::feed::curve::Curve as interp_core::feed::pace::Trajectory::advance",
        3,
        "pieces of a curve, and phases of a ramp",
    ),
    (
        "interp_core::feed::curve::Curve::new",
        12,
        "halvings of a speed: BISECTIONS",
    ),
    (
        "interp_core::feed::newton::rows::Place::factor",
        32,
        "steps of a factor for each of three axes: FACTOR_STEPS",
    ),
    (
        "interp_core::feed::newton::sweep::at_jumps",
        84,
        "jumps of a pass: KNOTS_MAX",
    ),
    (
        "interp_core::feed::newton::extend",
        2,
        "coefficients of the last node",
    ),
    (
        "interp_core::feed::newton::system::solve",
        162,
        "coefficients of a pace: COEFFICIENTS",
    ),
    (
        "interp_core::feed::newton::apply_step",
        162,
        "coefficients of a pace: COEFFICIENTS",
    ),
    (
        "interp_core::feed::pace::Pace::ahead",
        24,
        "steps to the place where a change begins: STEPS_AHEAD",
    ),
    ("interp_core::feed::plan::motion::span_of", 3, "axes"),
    (
        "compiler_builtins::mem::impls::copy_backward::copy_backward_aligned_words",
        512,
        COPIED,
    ),
    (
        "compiler_builtins::mem::impls::copy_backward::copy_backward_bytes",
        15,
        "bytes that do not fill a word copy",
    ),
    (
        "compiler_builtins::mem::impls::copy_backward::copy_backward_misaligned_words",
        512,
        COPIED,
    ),
    (
        "interp_core::feed::planner::scale",
        162,
        "coefficients of a pace: COEFFICIENTS",
    ),
    (
        "interp_core::feed::road::GateSearch::place",
        160,
        "nodes of a plan: NODES_MAX",
    ),
    ("interp_core::feed::turn::Turn::bound_speed", 3, "axes"),
    (
        "interp_core::feed::turn::Turn::overrun",
        11,
        "stations of half a turn: STATIONS",
    ),
    (
        "interp_core::feed::walk::means::begin_means_at_speed",
        160,
        "nodes of a mean: NODES_MAX",
    ),
    (
        "interp_core::feed::walk::speeds::rest_at_jumps",
        167,
        "cells of a pass: STATIONS_MAX - 1",
    ),
    (
        "interp_core::feed::walk::speeds::flatten",
        168,
        "stations of a pass: STATIONS_MAX",
    ),
    (
        "interp_core::sequence::lookahead::turn_search::find_turn",
        11,
        "stations of half a turn: STATIONS",
    ),
    (
        "interp_core::pass::scan::PassScan::plan",
        33,
        "pieces of a portion: PIECES_MAX",
    ),
    (
        "interp_core::sequence::link::step_over::BoundaryStepOver::left_at",
        3,
        "axes; rounds of the search for a speed: ROUNDS",
    ),
    (
        "interp_core::sequence::hop::time_at",
        20,
        "bisections of a time: BISECTIONS",
    ),
    (
        "interp_core::feed::plan::Plan::step_at",
        4,
        "intervals that a step may pass: INTERVALS_A_STEP",
    ),
    (
        "interp_core::feed::plan::Plan::place_node",
        8,
        "halvings of the stations: CELL_BISECTIONS",
    ),
    (
        "interp_core::feed::plan::motion::speed_over",
        8,
        "halvings of the jumps, and those near a place",
    ),
    (
        "interp_core::feed::planner::effort::lasts",
        162,
        "coefficients of a plan",
    ),
    (
        "interp_core::feed::planner::Planner::begin_method",
        162,
        "coefficients of a pace: COEFFICIENTS",
    ),
    (
        "interp_core::feed::planner::Planner::slow",
        162,
        "coefficients of a pace: COEFFICIENTS",
    ),
    (
        "interp_core::feed::planner::Planner::scale_start",
        162,
        "coefficients of a pace: COEFFICIENTS",
    ),
    (
        "interp_core::feed::stations::Stations::cell_between",
        8,
        "halvings of the stations: CELL_BISECTIONS",
    ),
    (
        "interp_core::feed::stations::Stations::is_jump",
        168,
        "stations that are looked through: STATIONS_MAX",
    ),
    (
        "interp_core::sequence::lookahead::stations::differentiate",
        2,
        "both stations of a group",
    ),
    (
        "interp_core::feed::stations::Window::derivatives",
        5,
        "positions of a derivative: WINDOW",
    ),
    (
        "interp_core::feed::stations::divide",
        5,
        "positions of a derivative: WINDOW",
    ),
    (
        "interp_core::feed::stations::taylor",
        5,
        "positions of a derivative: WINDOW",
    ),
    (
        "interp_core::feed::knots::rest_beside",
        168,
        "stations of a few intervals: STATIONS_MAX",
    ),
    (
        "interp_core::feed::node_times::rest_from",
        170,
        "busy places, once a list of nodes: LIST",
    ),
    (
        "interp_core::feed::node_times::NodeTimes::spacing_at",
        170,
        "busy places: LIST",
    ),
    (
        "interp_core::feed::walk::speeds::backwards",
        168,
        "stations: STATIONS_MAX",
    ),
    ("interp_core::feed::walk::speeds::cap", 3, "axes"),
    (
        "interp_core::feed::walk::nodes::begin_busy",
        168,
        "stations: STATIONS_MAX",
    ),
    (
        "interp_core::feed::newton::sweep::Sweep::jumps",
        84,
        "jumps of a plan: KNOTS_MAX",
    ),
    (
        "interp_core::feed::walk::nodes::find_busy",
        168,
        "stations: STATIONS_MAX",
    ),
    (
        "interp_core::feed::walk::speeds::forwards",
        168,
        "stations: STATIONS_MAX",
    ),
    (
        "interp_core::feed::walk::means::increment",
        168,
        "stations: STATIONS_MAX",
    ),
    (
        "interp_core::feed::walk::speeds::slow_at_jump",
        20,
        "stations around a jump, twice JUMP_STATIONS",
    ),
    (
        "interp_core::feed::knots::find_knots",
        168,
        "stations of an interval, and halvings for each: STATIONS_MAX",
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
        "interp_core::job::stations::Stations::for_intervals",
        10,
        "powers of two of a span's parts",
    ),
    (
        "interp_core::job::stations::Stations::most",
        10,
        "powers of two of a span's parts",
    ),
    (
        "interp_core::pass::front::advance::stepping::is_near",
        18,
        "stations beside one: 2 REACH + 1",
    ),
    (
        "interp_core::pass::front::advance::stepping::pass_over",
        16,
        "places that are passed over: CHUNK",
    ),
    (
        "interp_core::pass::front::clip::FrontClip::cross_edges",
        64,
        "edges of a portion: PORTION",
    ),
    (
        "interp_core::pass::front::clip::FrontClip::cross_piece",
        3,
        "parts of a piece of an edge, between its ends and two extrema",
    ),
    (
        "interp_core::pass::front::clip::FrontClip::extend",
        64,
        "edges of a portion: EXTENT_EDGES",
    ),
    (
        "interp_core::pass::front::clip::FrontClip::widen",
        24,
        "stations of a portion: WINDOW_STATIONS",
    ),
    (
        "interp_core::pass::front::clip::crossing",
        21,
        "halvings of an interval: PLACE_BITS",
    ),
    (
        "interp_core::pass::front::part::PartSearch::look",
        1_024,
        "side spans: SPANS_MAX; bisections of an interval",
    ),
    (
        "interp_core::pass::front::sequence::FrontSequence::plan",
        8,
        "portions of a period: PORTIONS_MAX; stations of one: CHUNK",
    ),
    (
        "interp_core::pass::front::advance::Advance::sweep",
        8,
        "members that leave the hull: MEMBERS_MAX; columns of a station",
    ),
    (
        "interp_core::pass::front::crest::shifted",
        16,
        "intervals to a foot: INTERVALS_MAX",
    ),
    (
        "interp_core::pass::front::foot::FootStep::find",
        4,
        "iterations for the foot: ROUNDS",
    ),
    (
        "interp_core::pass::front::limits::Limiter::is_convex",
        8,
        "members that leave the hull: MEMBERS_MAX",
    ),
    (
        "interp_core::pass::front::side::SideCursor::new",
        1_024,
        "side spans: SPANS_MAX",
    ),
    (
        "interp_core::pass::front::side::SideCursor::seek",
        1_024,
        "side spans: SPANS_MAX",
    ),
    (
        "interp_core::pass::front::spline::Cubic::crossing",
        31,
        "bisections of an interval",
    ),
    (
        "interp_core::pass::front::table::Table::lower",
        4,
        "intervals beside a station",
    ),
    (
        "interp_core::pass::front::line::FrontLine::leaves",
        31,
        "bisections of a place: BISECTIONS; extrema of a cubic",
    ),
    (
        "interp_core::sequence::lookahead::stations::store_start",
        168,
        "stations of a pass: STATIONS",
    ),
    (
        "interp_core::sequence::lookahead::stretch::finish_short",
        168,
        "stations of a pass: STATIONS",
    ),
    (
        "interp_core::sequence::lookahead::pass_plan::PassPlan::arc_at_piece_q10",
        20,
        "words of the pieces: PIECE_WORDS",
    ),
    (
        "interp_core::pass::run::Run::step_far",
        32,
        "arcs of a period: ARCS_MAX",
    ),
    (
        "interp_core::surface::curve::CurvePass::load_record",
        64,
        "words of a record",
    ),
    (
        "interp_core::surface::grid::GridPass::collapse",
        4,
        "rows of a block; coordinates",
    ),
    (
        "interp_core::sequence::sequencer::planning::plan_ahead",
        36,
        "pieces of the planning of a period: PIECES_MAX",
    ),
    (
        "interp_core::sequence::lookahead::short_patch::slow_down",
        24,
        "stations that a short patch slows down: STATIONS_SLOW",
    ),
    ("interp_core::sequence::lookahead::short_patch::slow", 3, "axes"),
    (
        "interp_core::pass::front::advance::measuring::has_crest",
        16,
        "places that are passed over: CHUNK",
    ),
    ("interp_core::feed::newton::rows::Place::rows", 3, "axes"),
    ("interp_core::feed::plan::motion::MotionAt::each_axis", 3, "axes"),
    (
        "interp_core::feed::profile::ProfilePlace::advance",
        8,
        "slots of a profile that a period may pass: SLOTS_A_STEP",
    ),
    (
        "interp_core::feed::turn::Turn::derivatives",
        8,
        "coefficients of a turn; axes",
    ),
    (
        "interp_core::feed::walk::Walker::means",
        60,
        "nodes of a portion: NODES_A_PORTION",
    ),
    (
        "interp_core::pass::front::crest::CrestSearch::height",
        3,
        "steps to the foot of a crest: FOOT_STEPS",
    ),
    (
        "interp_core::pass::step_over::StepOverEstimator::allowed",
        2,
        "ends of the gap",
    ),
    (
        "interp_core::sequence::hop::Curves as interp_core::feed::pace::Trajectory::use_at",
        3,
        "curves of a hop",
    ),
    (
        "interp_core::sequence::hop::Curves as interp_core::feed::pace::Trajectory::span_at",
        3,
        "curves of a hop",
    ),
    ("interp_core::sequence::hop::Hop::plan", 3, "curves of a hop"),
    ("interp_core::sequence::hop::Hop::speed", 3, "curves of a hop"),
    (
        "interp_core::sequence::lookahead::stations::patch_lengths",
        3,
        "halves of the patch; axes",
    ),
    (
        "interp_core::sequence::lookahead::stations::widen",
        3,
        "axes; derivatives",
    ),
    (
        "interp_core::surface::pole::ReducedCubics::reduce",
        4,
        "rows of a block",
    ),
    (
        "interp_core::surface::lines::CoordinateCubics::collapse",
        4,
        "rows of a block",
    ),
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
