//! The look over a pass for the step to the next one, of a job without axis limits.
//!
//! The tool moves at constant feed from the first sample to the last, so nothing is planned ahead: the scan goes over the current pass while the tool is on
//! it, in the planning of each period ([`crate::Interpolator::plan`]). Its stations are even parts of each patch, and do not depend on the samples. It keeps
//! ahead of the end of the pass: a patch has one station for two periods of the tool on it and at least both ends, and costs less than the
//! planning of the one period that the tool is on it at least. So a pass of any length is looked at, whatever the feed.
//!
//! The first pass has no previous step by which the neighbouring lines are placed. It is scanned twice, the first time at few stations and without lines,
//! and once more where the lines turn out to be far from the step.

use crate::job::program::Job;
use crate::math::arith::{sqrt, truncated};
use crate::math::number::{Bounded, MM_PER_NM, to_f32};
use crate::pass::patch::Patch;
use crate::pass::route::{Piece, Route};
use crate::pass::step_over::{PassMaximum, StepOverEstimator};

/// Cycles of the pieces, by the pessimistic model of `cargo sim budget`.
pub(crate) mod cycles {
    pub(crate) const PATCH: u32 = 4_200;
    pub(crate) const STATION: u32 = 1_600;
    pub(crate) const ESTIMATE: u32 = 1_600;
    pub(crate) const NEXT: u32 = 800;
    /// A patch of a scan: also three points of it.
    pub(super) const MEASURED_PATCH: u32 = PATCH + 1_800;
}

/// Cycles for the scan in a period of 1 ms or more; a shorter period has its share, at least one piece.
const PORTION_CYCLES: f32 = 26_500.0;
/// Period to which [`PORTION_CYCLES`] refers, s.
const PORTION_PERIOD_S: f32 = 1e-3;
/// Most pieces of a period: each takes at least [`cycles::NEXT`].
const PIECES_MAX: u8 = 33;

/// Periods of the tool on a cell.
const PERIODS_PER_CELL: f32 = 2.0;
/// Periods of the tool on a patch that is a point.
const POINT_PERIODS: f32 = 16.0;
/// Most cells of a patch: between them the maximum is that of a parabola.
const CELLS_MAX: f32 = 96.0;
/// Cells of the first lap of the first pass, as a share.
const FIRST_LAP: u16 = 4;

/// The next piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Begin a pass.
    Pass,
    /// Collapse the patch of the pass, and choose its cells.
    Patch,
    /// Evaluate the pass at the station.
    Station,
    /// Run the step-over estimator, with this number of evaluations left at the station.
    Estimate(u8),
    /// The pass is scanned.
    Done,
}

/// The scan of one pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PassScan {
    route: Route,
    /// The piece of the pass that is scanned.
    piece: Piece,
    patch: Patch,
    task: Task,
    /// The pass is not the first on its line.
    goes_on: bool,
    /// The first lap of the first pass: without neighbouring lines.
    is_first_lap: bool,
    /// Station within the patch, from 0, cells of the patch, and the fraction of the patch per cell.
    station: u16,
    cells: u16,
    cell_fraction: u64,
    is_first_patch: bool,
    /// Maximum found by the first lap.
    first_lap: f32,
    estimator: StepOverEstimator,
}

impl PassScan {
    /// State before the first pass.
    pub(crate) const START: Self = Self {
        route: Route::NONE,
        piece: Piece::NONE,
        patch: Patch::NONE,
        task: Task::Done,
        goes_on: false,
        is_first_lap: false,
        station: 0,
        cells: 1,
        cell_fraction: u64::MAX,
        is_first_patch: true,
        first_lap: 0.0,
        estimator: StepOverEstimator::START,
    };

    /// Resets to the state before the first pass.
    pub(crate) const fn restart(&mut self) {
        self.estimator.restart();
        self.task = Task::Done;
    }

    /// The estimator of the step to the next pass; a job with limits uses it in its look-ahead.
    pub(crate) const fn estimator(&mut self) -> &mut StepOverEstimator {
        &mut self.estimator
    }

    pub(crate) const fn estimator_ref(&self) -> &StepOverEstimator {
        &self.estimator
    }

    /// Begins the scan of a pass. `goes_on`: it is on the line of the one before.
    pub(crate) const fn begin(&mut self, route: &Route, goes_on: bool) {
        self.route = *route;
        self.goes_on = goes_on;
        self.task = Task::Pass;
    }

    fn begin_pass(&mut self, job: &Job<'_>) {
        if !self.goes_on {
            self.first_lap = 0.0;
        }
        self.is_first_lap = self.estimator.is_first() && !self.goes_on;
        self.begin_lap(job);
    }

    fn begin_lap(&mut self, job: &Job<'_>) {
        self.is_first_patch = true;
        self.piece = self.route.first(job);
        self.task = Task::Patch;
        if self.goes_on {
            self.estimator.go_on(job, &self.route);
        } else {
            self.estimator.begin(job, &self.route);
        }
    }

    /// Whether a piece is left.
    pub(crate) fn has_work(&self) -> bool {
        self.task != Task::Done
    }

    /// The step from the pass to the next one; `maximum`: that of the pass's samples.
    pub(crate) fn step(&mut self, job: &Job<'_>, maximum: PassMaximum) -> f32 {
        if self.task == Task::Pass {
            self.begin_pass(job);
        }
        self.task = Task::Done;
        self.estimator.step(job.header, maximum)
    }

    /// The pieces of one period.
    #[inline(never)]
    pub(crate) fn plan(&mut self, job: &Job<'_>) {
        let share = (job.header.period_s / PORTION_PERIOD_S).at_most(1.0);
        let mut left = share * PORTION_CYCLES;
        for pieces in 0..PIECES_MAX {
            let cycles = f32::from(u16::try_from(self.cycles()).unwrap_or(u16::MAX));
            if cycles == 0.0 || (cycles > left && pieces > 0) {
                return;
            }
            left -= cycles;
            self.work(job);
        }
    }

    /// Cycles of the next piece; 0 where none is left.
    fn cycles(&self) -> u32 {
        match self.task {
            Task::Pass => cycles::NEXT,
            Task::Patch => cycles::MEASURED_PATCH,
            Task::Station => cycles::STATION,
            Task::Estimate(0) => cycles::NEXT,
            Task::Estimate(_) if self.estimator.makes_patch(&self.piece.position, self.fraction()) => {
                cycles::PATCH
            }
            Task::Estimate(_) => cycles::ESTIMATE,
            Task::Done => 0,
        }
    }

    fn work(&mut self, job: &Job<'_>) {
        self.task = match self.task {
            Task::Pass => {
                self.begin_pass(job);
                Task::Patch
            }
            Task::Patch => self.begin_patch(job),
            Task::Station => {
                let fraction = self.fraction();
                // A fault is reported by the tick that reaches it.
                if let Ok(contact) = self.patch.surface.contact_on_line(fraction, &self.patch.ball) {
                    self.estimator.see(job, &self.patch, &contact, fraction);
                }
                Task::Estimate(self.estimates(job))
            }
            Task::Estimate(0) => self.next_station(job),
            Task::Estimate(left) => {
                let most = self.estimator.most().at_least(self.first_lap);
                let fraction = self.fraction();
                self.estimator
                    .work(job, &self.piece.position, &self.patch, fraction, most);
                Task::Estimate(left - 1)
            }
            Task::Done => Task::Done,
        };
    }

    fn begin_patch(&mut self, job: &Job<'_>) -> Task {
        if self.patch.lay(job, &self.route, &self.piece).is_err() {
            return Task::Done;
        }
        self.estimator.begin_patch();
        let periods = if self.patch.point {
            POINT_PERIODS
        } else {
            self.length() / self.patch.arc
        };
        let cells = (periods / PERIODS_PER_CELL).at_least(1.0).at_most(CELLS_MAX);
        let cells = u16::try_from(truncated(cells)).unwrap_or(1);
        self.cells = if self.is_first_lap {
            (cells / FIRST_LAP).max(1)
        } else {
            cells
        };
        let [start, end] = self.piece.range;
        let part = end.saturating_sub(start).checked_div(u64::from(self.cells));
        self.cell_fraction = part.unwrap_or(u64::MAX);
        self.station = 0;
        Task::Station
    }

    /// Length of the patch, roughly, units; 0 where its surface is not evaluated.
    fn length(&self) -> f32 {
        let at = |fraction| {
            self.patch
                .evaluate_on_line(fraction)
                .map(|(_, located)| located.cc_nm)
        };
        let [start, end] = self.piece.range;
        let middle = (start + (end.saturating_sub(start) >> 1)).saturating_add(1);
        let (Ok(start), Ok(middle), Ok(end)) = (at(start), at(middle), at(end)) else {
            return 0.0;
        };
        let apart = |from: &[i32; 3], to: &[i32; 3]| {
            let mut sum = 0.0;
            for (from, to) in from.iter().zip(to) {
                let mm = to_f32(i64::from(*to) - i64::from(*from)) * MM_PER_NM;
                sum += mm * mm;
            }
            sqrt(sum)
        };
        (apart(&start, &middle) + apart(&middle, &end)) * self.patch.per_mm
    }

    const fn is_end(&self) -> bool {
        self.station >= self.cells
    }

    fn fraction(&self) -> u64 {
        if self.is_end() {
            self.piece.end()
        } else {
            self.piece.start() + u64::from(self.station) * self.cell_fraction
        }
    }

    fn estimates(&self, job: &Job<'_>) -> u8 {
        if self.is_first_lap {
            return 0;
        }
        let first = self.station == 0;
        let last = self.is_end() && self.route.next(job, &self.piece).is_none();
        self.estimator.evaluations(
            self.piece.position.span,
            first,
            first && self.is_first_patch,
            last,
        )
    }

    /// Advances to the next station, the next patch, the second lap, or the end.
    fn next_station(&mut self, job: &Job<'_>) -> Task {
        if !self.is_end() {
            self.station += 1;
            return Task::Station;
        }
        if let Some(piece) = self.route.next(job, &self.piece) {
            self.piece = piece;
            self.is_first_patch = false;
            return Task::Patch;
        }
        if !self.is_first_lap && (self.goes_on || !self.estimator.looks_again(job.header)) {
            return Task::Done;
        }
        self.is_first_lap = false;
        self.first_lap = self.estimator.most();
        self.begin_lap(job);
        Task::Patch
    }
}
