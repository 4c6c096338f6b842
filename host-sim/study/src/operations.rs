//! Operations of a sample (steps 2 to 4) in the terms of the paper's Table 1: the core's own source, compiled with a scalar that
//! counts (`counted-core`), runs the job here.
//!
//! Counted is what a sample in the middle of a pass executes, checks included: the ball's fit, folds, the cubics of the surface in
//! fixed point. Comparisons, changes of sign and moves are not counted, nor is what is done once a pass: the patch at its side
//! parameter, the root and quotient that make an interval of the greatest density, and the looks at the gap to the next pass.

use counted_core::scalar::{Tally, tally};
use counted_core::{
    Fault, Header, Interpolator, Pattern, Request, Sample, Spacing, State, SurfaceKind, ToolSide,
};

use cycles::{SURFACES, TICKS};
use machine::prepare::{Prepared, prepare};

/// Operations in the columns of the paper's Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// Additions and subtractions.
    pub add: u32,
    /// Multiplications.
    pub multiply: u32,
    /// Divisions.
    pub divide: u32,
    /// Square roots.
    pub root: u32,
    /// Sines and cosines. Where they are polynomials, their additions and multiplications are among the others too.
    pub sine: u32,
}

/// The paper's Table 1, by the names of [`cycles::SURFACES`]. It has no row for a ruled surface.
pub const PAPER: [(&str, Operations); 3] = [
    (
        "revolved along u",
        Operations {
            add: 39,
            multiply: 52,
            divide: 8,
            root: 4,
            sine: 0,
        },
    ),
    (
        "revolved along v",
        Operations {
            add: 21,
            multiply: 40,
            divide: 8,
            root: 4,
            sine: 2,
        },
    ),
    (
        "bicubic",
        Operations {
            add: 75,
            multiply: 92,
            divide: 9,
            root: 4,
            sine: 0,
        },
    ),
];

/// The paper's row of a kind of surface.
#[must_use]
pub fn of_paper(surface: &str) -> Option<Operations> {
    PAPER
        .iter()
        .find_map(|(name, row)| (*name == surface).then_some(*row))
}

/// What a sample takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// In the paper's terms.
    pub operations: Operations,
    /// Reciprocal square roots by Newton, whose additions and multiplications are among [`Self::operations`]: each is there instead of
    /// a root and a division.
    pub inverse_root: u32,
    /// Conversions between integer and float.
    pub convert: u32,
    /// Shifts by a fixed number of bits; on the Cortex-M4 most are part of another instruction.
    pub shift: u32,
}

impl From<Tally> for Count {
    fn from(tally: Tally) -> Self {
        Self {
            operations: Operations {
                add: tally.add,
                multiply: tally.multiply,
                divide: tally.divide,
                root: tally.square_root,
                sine: tally.sine,
            },
            inverse_root: tally.inverse_root,
            convert: tally.convert,
            shift: tally.shift,
        }
    }
}

/// The counts of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// Of a sample in the middle of a pass: the one that most of them have.
    pub sample: Count,
    /// Samples in the middle of a pass with exactly that count.
    pub samples: u64,
    /// Those with another: long steps, which go by quadrature, and contacts at a pole.
    pub others: u64,
}

/// Samples after a change of pass or patch by which all that is made ahead in them is made, and the step has two samples to look
/// back on.
const SETTLED: u32 = 8;

fn header(header: &interp_core::Header) -> Header {
    Header {
        kind: SurfaceKind::from_code(header.kind as u8).unwrap_or_default(),
        pattern: match header.pattern {
            interp_core::Pattern::Zig => Pattern::Zig,
            interp_core::Pattern::Zigzag => Pattern::Zigzag,
        },
        spacing: match header.spacing {
            interp_core::Spacing::Exact => Spacing::Exact,
            interp_core::Spacing::FirstOrder => Spacing::FirstOrder,
        },
        tool_side: match header.tool_side {
            interp_core::ToolSide::Plus => ToolSide::Plus,
            interp_core::ToolSide::Minus => ToolSide::Minus,
        },
        path_spans: header.path_spans,
        side_spans: header.side_spans,
        ball_radius_mm: header.ball_radius_mm,
        feed_mm_s: header.feed_mm_s,
        scallop_mm: header.scallop_mm,
        period_s: header.period_s,
        axes: None,
    }
}

/// Runs a job in the core that counts, and hands on every sample with the operations of its tick, until the job's end, a fault that
/// stops it, or `false` from `each`.
///
/// # Errors
/// The fault that refused the job.
pub fn run(job: &Prepared, mut each: impl FnMut(&Sample, Count) -> bool) -> Result<(), Fault> {
    let mut core: Box<Interpolator> = Box::default();
    let words = u32::try_from(job.words.len()).unwrap_or(u32::MAX);
    core.load_begin(&header(&job.header), words)?;
    core.load_words(0, &job.words)?;
    for record in 0..core.load_records() {
        core.load_check(record)?;
    }
    core.load_finish()?;
    let mut request = Request::Start;
    loop {
        let before = tally();
        let sample = core.tick(request);
        request = Request::None;
        if sample.state != State::Running || !each(sample, tally().since(before).into()) {
            return Ok(());
        }
    }
}

/// Counts the operations of a job's first ticks.
///
/// # Errors
/// As [`run`].
pub fn count(job: &Prepared, ticks: u32) -> Result<Counted, Fault> {
    // Spaced like this no tick looks across the gap; the samples of a pass are the same.
    let mut job = job.clone();
    job.header.spacing = interp_core::Spacing::FirstOrder;
    let mut counts: Vec<(Count, u64)> = Vec::new();
    let mut place = None;
    let mut settled = 0;
    run(&job, |sample, count| {
        let here = Some((sample.pass, sample.path.span));
        settled = if here == place { settled + 1 } else { 0 };
        place = here;
        // A pass's last sample goes to its end by quadrature.
        let ends = matches!(sample.path.fraction, 0 | u64::MAX);
        if settled >= SETTLED && !ends {
            match counts.iter_mut().find(|(known, _)| *known == count) {
                Some((_, samples)) => *samples += 1,
                None => counts.push((count, 1)),
            }
        }
        sample.tick + 1 < ticks
    })?;
    let all: u64 = counts.iter().map(|(_, samples)| samples).sum();
    let most = counts.into_iter().max_by_key(|(_, samples)| *samples);
    let (sample, samples) = most.unwrap_or_default();
    Ok(Counted {
        sample,
        samples,
        others: all - samples,
    })
}

/// Our rows of the paper's table, in the order of [`PAPER`]: counted on the sample jobs, if they are there.
#[must_use]
pub fn table_1() -> Option<[Operations; 3]> {
    let row = |surface: &str| {
        let (_, job) = SURFACES.iter().find(|(name, _)| *name == surface)?;
        let job = job_file::load(&programs::sample_job(job)).ok()?;
        let counted = count(&prepare(&job).ok()?, TICKS).ok()?;
        (counted.samples > 0).then_some(counted.sample.operations)
    };
    let [u, v, bicubic] = PAPER.map(|(surface, _)| row(surface));
    Some([u?, v?, bicubic?])
}
