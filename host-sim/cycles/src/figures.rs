//! Least, mean and greatest cycles of each stage, and the histogram of the tick.

use cycle_plugin::cost::Cycles;
use cycle_plugin::plan::Stage;
use cycle_plugin::record::Record;

use super::PERIOD_CYCLES;
use super::measure::Ticks;

/// A cycle model of the plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// By the reference manual, without wait states.
    Nominal,
    /// With stalls, wait states and lazy stacking.
    Pessimistic,
}

impl Model {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Nominal, Self::Pessimistic];

    /// Name in tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nominal => "nominal",
            Self::Pessimistic => "pessimistic",
        }
    }

    const fn of(self, cycles: Cycles) -> u32 {
        match self {
            Self::Nominal => cycles.nominal,
            Self::Pessimistic => cycles.pessimistic,
        }
    }
}

/// Rows of the report: name, and the stages whose cycles are summed.
const ROWS: [(&str, &[Stage]); 13] = [
    ("contact: step", &[Stage::Step]),
    ("contact: surface", &[Stage::Surface]),
    ("contact", &[Stage::Step, Stage::Surface]),
    ("offset", &[Stage::Offset]),
    ("interval", &[Stage::Interval]),
    (STEPS_2_TO_4, &STEPS_2_TO_4_STAGES),
    ("patch change", &[Stage::PatchChange]),
    ("pass change", &[Stage::PassChange]),
    ("feed", &[Stage::Feed]),
    ("digest", &[Stage::Digest]),
    ("everything else", &[Stage::Rest]),
    ("exception entry and exit", &[Stage::Exception]),
    ("pulses", &[Stage::Pulses]),
];

/// The row of the paper's steps 2 to 4.
pub const STEPS_2_TO_4: &str = "steps 2-4";

/// The stages of the paper's steps 2 to 4.
pub(super) const STEPS_2_TO_4_STAGES: [Stage; 4] =
    [Stage::Step, Stage::Surface, Stage::Offset, Stage::Interval];

/// The row of the task without the pulses, which have a budget of their own.
pub const TICK: &str = "tick";

/// The row of the whole task.
pub const TICK_AND_PULSES: &str = "tick and pulses";

/// The row of the planning task: its portions, counted apart from the sample task. Jobs without limits have none.
pub const PLANNING: &str = "planning";

/// Cycles of a stage over the ticks of a job in which they are not zero, or of the planning over its portions.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of the job.
    pub surface: String,
    /// Name of the stage or of a sum of stages.
    pub stage: &'static str,
    /// Model.
    pub model: Model,
    /// Number of those ticks or portions.
    pub ticks: u32,
    /// Least cycles.
    pub min: u32,
    /// Mean cycles.
    pub mean: f64,
    /// Greatest cycles.
    pub max: u32,
    /// High-water mark of the stack over the job, bytes.
    pub stack_bytes: u32,
    /// Distribution of those ticks.
    pub histogram: Histogram,
}

impl Figure {
    /// The greatest number of cycles as a share of the period, %.
    #[must_use]
    pub fn period_share_pct(&self) -> f64 {
        100.0 * f64::from(self.max) / f64::from(PERIOD_CYCLES)
    }

    fn of(
        surface: &str,
        stage: &'static str,
        model: Model,
        ticks: &Ticks,
        cycles: impl Fn(&Record) -> u32,
    ) -> Self {
        let all = ticks.records.iter().map(cycles);
        Self::of_cycles(surface, stage, model, all, ticks.stack_bytes)
    }

    fn of_cycles(
        surface: &str,
        stage: &'static str,
        model: Model,
        cycles: impl Iterator<Item = u32>,
        stack_bytes: u32,
    ) -> Self {
        let (mut count, mut sum, mut min, mut max) = (0_u32, 0_u64, u32::MAX, 0);
        let all: Vec<u32> = cycles.filter(|cycles| *cycles > 0).collect();
        for cycles in all.iter().copied() {
            count += 1;
            sum += u64::from(cycles);
            min = min.min(cycles);
            max = max.max(cycles);
        }
        #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
        let mean = sum as f64 / f64::from(count.max(1));
        Self {
            surface: surface.to_owned(),
            stage,
            model,
            ticks: count,
            min: if count == 0 { 0 } else { min },
            mean,
            max,
            stack_bytes,
            histogram: Histogram::of(all.into_iter(), max.saturating_sub(min) / BINS + 1),
        }
    }

    /// The figure of a single tick, without the pulses.
    #[must_use]
    pub fn of_tick(surface: &str, model: Model, record: &Record) -> Self {
        let ticks = Ticks {
            records: vec![*record],
            ..Ticks::default()
        };
        Self::of(surface, TICK, model, &ticks, |record| tick_cycles(record, model))
    }
}

/// Bins of a stage's histogram.
const BINS: u32 = 16;

/// Cycles of the task in a tick, without the pulses.
#[must_use]
pub fn tick_cycles(record: &Record, model: Model) -> u32 {
    with_pulses(record, model) - model.of(record.stages[Stage::Pulses as usize])
}

/// Cycles of a portion of the planning task, without the tasks that preempt it.
#[must_use]
pub fn planning_cycles(record: &Record, model: Model) -> u32 {
    with_pulses(record, model)
}

/// Cycles of the task in a tick.
fn with_pulses(record: &Record, model: Model) -> u32 {
    record.stages.iter().map(|cycles| model.of(*cycles)).sum()
}

/// All figures of a job's ticks: each stage, then the tick and the planning, in both models.
#[must_use]
pub fn figures(surface: &str, ticks: &Ticks) -> Vec<Figure> {
    let mut figures = Vec::new();
    for model in Model::ALL {
        for (name, stages) in ROWS {
            figures.push(Figure::of(surface, name, model, ticks, |record| {
                let cycles = stages.iter().map(|stage| record.stages[*stage as usize]);
                cycles.map(|cycles| model.of(cycles)).sum()
            }));
        }
        figures.push(Figure::of(surface, TICK, model, ticks, |record| {
            tick_cycles(record, model)
        }));
        figures.push(Figure::of(surface, TICK_AND_PULSES, model, ticks, |record| {
            with_pulses(record, model)
        }));
        if !ticks.planning.is_empty() {
            let cycles = ticks.planning.iter();
            let cycles = cycles.map(|record| planning_cycles(record, model));
            figures.push(Figure::of_cycles(
                surface,
                PLANNING,
                model,
                cycles,
                ticks.stack_bytes,
            ));
        }
    }
    figures
}

/// A histogram of the cycles of ticks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Histogram {
    /// Width of a bin, cycles.
    pub width: u32,
    /// First cycle and number of ticks of each bin that is not empty, in order.
    pub bins: Vec<(u32, u32)>,
}

impl Histogram {
    fn of(cycles: impl Iterator<Item = u32>, width: u32) -> Self {
        let mut bins = std::collections::BTreeMap::new();
        for cycles in cycles {
            *bins.entry(cycles / width * width).or_insert(0) += 1;
        }
        Self {
            width,
            bins: bins.into_iter().collect(),
        }
    }

    /// The histogram as a line of block characters, one a bin, on a logarithmic scale, on which a single tick shows.
    #[must_use]
    pub fn sparkline(&self) -> String {
        const HEIGHTS: [char; 8] = [
            '\u{2581}', '\u{2582}', '\u{2583}', '\u{2584}', '\u{2585}', '\u{2586}', '\u{2587}', '\u{2588}',
        ];
        let (Some(first), Some(last)) = (self.bins.first(), self.bins.last()) else {
            return String::new();
        };
        let most = self.bins.iter().map(|bin| bin.1).max().unwrap_or(1);
        let height = |count: u32| (7 * (count.ilog2() + 1)).div_ceil(most.ilog2() + 1) as usize;
        (first.0..=last.0)
            .step_by(self.width.max(1) as usize)
            .map(|begin| {
                let bin = self.bins.iter().find(|bin| bin.0 == begin);
                bin.map_or(' ', |bin| HEIGHTS[height(bin.1.max(1)).min(7)])
            })
            .collect()
    }
}

/// The histogram of a job's ticks.
#[must_use]
pub fn histogram(ticks: &Ticks, model: Model, width: u32) -> Histogram {
    Histogram::of(
        ticks.records.iter().map(|record| tick_cycles(record, model)),
        width,
    )
}
