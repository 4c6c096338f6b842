//! The core for C: `cargo build -p interp-core --example c_api` makes `libc_api.a`; `c_api.h` declares its functions, `c_api.c` uses them.
//!
//! Every function takes the pointer that `isofeed_new` returned; none is thread-safe. A result of 0 is success, a positive one the code of a
//! [`interp_core::FaultKind`], a negative one a wrong argument.
#![allow(
    unsafe_code,
    reason = "pointers of a C caller; each function says what they have to be"
)]

use std::slice;

use interp_core::{Command, Fault, Header, Inputs, Interpolator, encode};

/// Data words that a job may have.
const STORE_WORDS: usize = 4096;
/// Result for a null pointer, an unknown command, or coefficients that make no record.
const BAD_ARGUMENT: i32 = -1;

/// `isofeed`: a machine.
pub struct Machine(Interpolator<[i32; STORE_WORDS]>);

/// `isofeed_header`: the job's header, a grid of polynomial patches in the pattern zig.
#[repr(C)]
pub struct CHeader {
    path_spans: u16,
    side_spans: u16,
    ball_radius_mm: f32,
    feed_mm_s: f32,
    scallop_mm: f32,
    period_s: f32,
}

/// `isofeed_sample`: one period's result.
#[repr(C)]
pub struct CSample {
    tick: u32,
    pass: u32,
    state: u32,
    feed_mm_s: f32,
    cc_nm: [i32; 3],
    cl_nm: [i32; 3],
}

fn code(result: Result<(), Fault>) -> i32 {
    result.map_or_else(|fault| i32::from(fault.kind.code()), |()| 0)
}

/// An idle machine; to be given back to [`isofeed_free`].
#[unsafe(no_mangle)]
pub extern "C" fn isofeed_new() -> *mut Machine {
    Box::into_raw(Box::new(Machine(Interpolator::new())))
}

/// Frees a machine.
///
/// # Safety
/// `machine` is null, or came from [`isofeed_new`] and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isofeed_free(machine: *mut Machine) {
    if !machine.is_null() {
        // SAFETY: by the function's contract it is a box that nobody else has.
        drop(unsafe { Box::from_raw(machine) });
    }
}

/// Encodes a patch: `c[axis][i][j]` of `u^i v^j`, mm, `u` and `v` from 0 to 1, into the 52 words of a record.
///
/// # Safety
/// `coefficients` points to 48 doubles, `words` to 52 `int32_t`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isofeed_patch(
    coefficients: *const [[[f64; 4]; 4]; 3],
    words: *mut [i32; 52],
) -> i32 {
    // SAFETY: by the function's contract; null is turned away.
    let (Some(c), Some(words)) = (unsafe { coefficients.as_ref() }, unsafe { words.as_mut() }) else {
        return BAD_ARGUMENT;
    };
    let centred = c.map(|axis| encode::substitute(&axis, [0.0, 1.0], [0.0, 1.0]));
    match encode::polynomial(&centred, Default::default()) {
        Ok(record) => {
            *words = record.to_words();
            0
        }
        Err(_) => BAD_ARGUMENT,
    }
}

/// Loads a job: the widths of the side spans and the path spans, then the patches' records, all of them words.
///
/// # Safety
/// `machine` came from [`isofeed_new`], `header` points to a header, `words` to `count` `int32_t`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isofeed_load(
    machine: *mut Machine,
    header: *const CHeader,
    words: *const i32,
    count: usize,
) -> i32 {
    // SAFETY: by the function's contract; null is turned away.
    let (Some(machine), Some(header)) = (unsafe { machine.as_mut() }, unsafe { header.as_ref() }) else {
        return BAD_ARGUMENT;
    };
    let Ok(length) = u32::try_from(count) else {
        return BAD_ARGUMENT;
    };
    if words.is_null() {
        return BAD_ARGUMENT;
    }
    // SAFETY: not null, and by the function's contract so long.
    let words = unsafe { slice::from_raw_parts(words, count) };
    let header = Header {
        path_spans: header.path_spans,
        side_spans: header.side_spans,
        ball_radius_mm: header.ball_radius_mm,
        feed_mm_s: header.feed_mm_s,
        scallop_mm: header.scallop_mm,
        period_s: header.period_s,
        ..Header::default()
    };
    let core = &mut machine.0;
    let mut load = || {
        core.load_begin(&header, length)?;
        core.load_words(0, words)?;
        for record in 0..core.load_records() {
            core.load_check(record)?;
        }
        core.load_finish()
    };
    code(load())
}

/// One period: executes a command (0 none, 1 start, 2 hold, 3 resume, 4 abort, 5 stop, 6 pause) and writes the sample; the code of the fault where
/// the machine stands with one.
///
/// # Safety
/// `machine` came from [`isofeed_new`], `sample` points to a sample.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isofeed_tick(
    machine: *mut Machine,
    command: u8,
    override_percent: u8,
    sample: *mut CSample,
) -> i32 {
    // SAFETY: by the function's contract; null is turned away.
    let (Some(machine), Some(out)) = (unsafe { machine.as_mut() }, unsafe { sample.as_mut() }) else {
        return BAD_ARGUMENT;
    };
    let known = Command::ALL.into_iter().find(|known| *known as u8 == command);
    if command != 0 && known.is_none() {
        return BAD_ARGUMENT;
    }
    let inputs = Inputs {
        command: known,
        feed_override: override_percent,
    };
    let sample = *machine.0.tick(inputs);
    *out = CSample {
        tick: sample.tick,
        pass: sample.pass,
        state: sample.state as u32,
        feed_mm_s: sample.feed_mm_s,
        cc_nm: sample.cc_nm,
        cl_nm: sample.cl_nm,
    };
    code(machine.0.fault().map_or(Ok(()), Err))
}

/// The planning of the period, once after each tick and before the next, in a task of lower priority. 1 where there was something to plan, else 0.
///
/// # Safety
/// `machine` came from [`isofeed_new`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isofeed_plan(machine: *mut Machine) -> i32 {
    // SAFETY: by the function's contract; null is turned away.
    let Some(machine) = (unsafe { machine.as_mut() }) else {
        return BAD_ARGUMENT;
    };
    let has_to_plan = machine.0.has_to_plan();
    machine.0.plan();
    i32::from(has_to_plan)
}
