//! Checks emitted samples one by one, in the order of their ticks. No allocation per sample.

use super::contact::Oracle;
use super::report::{AccuracyReport, SampleLocation};
use super::smooth::SmoothParameter;
use glam::DVec3;
use job::units::NM_PER_MM;
use job::{Pattern, Spacing};

/// Excess of a last step over that of its feed, as a share of the programmed one, that the rounding of its parameters makes.
const LAST_STEP_ROUNDING: f64 = 1e-5;

/// A sample on a pass as emitted by a machine, in plain numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassSample {
    /// Tick, from 0.
    pub tick: u64,
    /// Pass, from 0.
    pub pass: u32,
    /// Parameter u.
    pub u: f64,
    /// Parameter v.
    pub v: f64,
    /// Cutter contact, nm.
    pub cc_nm: [i32; 3],
    /// Cutter location, nm.
    pub cl_nm: [i32; 3],
    /// Commanded feed along the surface in the period before this sample, mm/s; 0 disables the check of the step.
    pub feed_mm_s: f64,
    /// Candidate of the path interval, in units of the side parameter; infinite where it imposes no limit.
    pub interval: f64,
    /// First sample of its pass.
    pub first_of_pass: bool,
    /// Last sample of its pass.
    pub last_of_pass: bool,
}

/// Errors of one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleCheck {
    /// Arc length of the contact's path since the previous sample of the same pass, mm; `None` at the first one.
    pub arc_mm: Option<f64>,
    /// 100 (arc / (f T) - 1), %, for all samples of a pass except the first and the last.
    pub ripple_pct: Option<f64>,
    /// Distance of the emitted CL from the exact CL, nm; `None` where the surface has no normal.
    pub position_nm: Option<f64>,
}

/// Distance of the first pass from the middle of the side parameter at most, a share of the parameter: its rounding.
pub(super) const START_SHARE: f64 = 1e-6;

/// Accumulates a [`AccuracyReport`] from a stream of samples.
#[derive(Clone, Debug)]
pub struct Verifier {
    oracle: Oracle,
    /// The oracle of the cell of the region that the passes are in, and its number.
    cell: Oracle,
    cell_index: usize,
    breaks: Vec<f64>,
    smooth: [SmoothParameter; 2],
    report: AccuracyReport,
    current: Option<PassState>,
    /// Ends of the passes on the current line of a region.
    on_line: Vec<[f64; 2]>,
    /// Of curved passes in a region, the first and the last line of each cell.
    outer_lines: Vec<Option<[f64; 2]>>,
}

/// State of the current pass.
#[derive(Clone, Copy, Debug)]
struct PassState {
    side: f64,
    /// Path parameter of the last sample.
    path: f64,
    /// The samples of a curved pass before: path and side parameter, the older one first.
    before: [Option<[f64; 2]>; 2],
    least_interval: f64,
    least_at: SampleLocation,
    /// Sum over samples of (1 / interval)^2, and their number: gives the scallop's mean when the next pass is known.
    inverse_squares: f64,
    samples: u64,
    finished: bool,
    /// Number of the line, and path parameters at the ends of the passes on it so far; of the current one at its start.
    line: u32,
    start: f64,
    backwards: bool,
}

/// Longest step of a period, as a multiple of that at the programmed feed: the greatest override.
const STEP_MOST: f64 = 2.0;

impl Verifier {
    /// A verifier of a job's samples.
    #[must_use]
    pub fn new(oracle: &Oracle) -> Self {
        let report = AccuracyReport {
            normal_floor_rad: 3.0_f64.sqrt() / (oracle.radius_mm * NM_PER_MM),
            ..AccuracyReport::default()
        };
        Self {
            breaks: oracle.surface.breaks(oracle.along),
            smooth: [oracle.along, oracle.across()].map(|along| SmoothParameter::new(oracle, along)),
            oracle: oracle.clone(),
            cell: oracle.of_cell(0),
            cell_index: 0,
            report,
            current: None,
            on_line: Vec::new(),
            outer_lines: if oracle.spacing.is_constant() && oracle.region.is_some() {
                oracle.outer_lines_of_cells()
            } else {
                Vec::new()
            },
        }
    }

    /// Checks the next sample and returns its errors.
    pub fn add(&mut self, sample: &PassSample) -> SampleCheck {
        let spot = SampleLocation {
            tick: sample.tick,
            pass: sample.pass,
            u: sample.u,
            v: sample.v,
        };
        let (path, side) = self.oracle.swapped(sample.u, sample.v);
        self.report.samples += 1;
        let (arc_mm, ripple_pct) = if sample.first_of_pass {
            self.begin_pass(sample, path, side, spot);
            (None, None)
        } else {
            self.check_step(sample, path, side, spot)
        };
        let position_nm = self.check_geometry(sample, spot);
        if sample.last_of_pass {
            let is_off = if self.oracle.spacing.is_constant() {
                self.is_off_curve(path, side)
            } else if self.oracle.region.is_some() {
                let end = self.at_boundary(sample, path, side);
                let ends = [self.current.map_or(end, |pass| pass.start), end];
                self.on_line.push(ends);
                !self.cell.is_interval(ends, side)
            } else {
                let is_one_sample = sample.first_of_pass && self.oracle.is_point(side);
                !is_one_sample && self.is_off(sample, path, side, self.pass_ends(sample.pass)[1])
            };
            if is_off {
                self.report.off_boundary += 1;
            }
            if let Some(pass) = &mut self.current {
                pass.finished = true;
            }
        }
        SampleCheck {
            arc_mm: arc_mm.map(f64::abs),
            ripple_pct,
            position_nm,
        }
    }

    /// The report, after the last sample.
    #[must_use]
    pub fn finish(mut self) -> AccuracyReport {
        if let Some(pass) = self.current {
            self.report.complete = pass.finished;
            let [_, end] = self.oracle.outer_passes();
            self.report.last_on_boundary =
                if self.oracle.spacing.is_constant() && self.oracle.region.is_some() {
                    let lines = self.outer_lines.iter().flatten().last();
                    lines.is_none_or(|lines| self.oracle.is_last_of_cell(pass.side, *lines))
                } else if self.oracle.region.is_some() {
                    self.check_line(pass.side);
                    self.is_cell_done(pass.side) && self.cells_without_pass(self.cell_index + 1)
                } else {
                    pass.side == end
                };
        }
        self.report
    }

    /// Whether a pass does not start or end at this path parameter: exactly, or before a turn within the longest step of a period.
    fn is_off(&self, sample: &PassSample, path: f64, side: f64, end: f64) -> bool {
        if path == end || !self.oracle.overruns {
            return path != end;
        }
        let (u, v) = self.oracle.swapped(end, side);
        let Ok(contact) = self.oracle.contact(u, v) else {
            return true;
        };
        let cc_mm = DVec3::from(sample.cc_nm.map(f64::from)) / NM_PER_MM;
        cc_mm.distance(contact.cc_mm) > STEP_MOST * self.oracle.feed_mm_s * self.oracle.period_s
    }

    /// Whether an end of a curved pass is on no boundary of the surface.
    fn is_off_curve(&self, path: f64, side: f64) -> bool {
        if self.oracle.region.is_some() {
            return !self.oracle.is_end(path, side, &self.outer_lines);
        }
        !self.oracle.path_range().contains(&path) && !self.oracle.side_range().contains(&side)
    }

    /// The surface's boundary for an end of a pass next to a turn, the path parameter for any other.
    fn at_boundary(&self, sample: &PassSample, path: f64, side: f64) -> f64 {
        let [low, high] = self.oracle.path_range();
        let nearer = if path - low < high - path { low } else { high };
        if self.oracle.overruns && !self.is_off(sample, path, side, nearer) {
            nearer
        } else {
            path
        }
    }

    /// Counts a line of a region that leaves out an interval.
    fn check_line(&mut self, side: f64) {
        if !self.cell.is_line_complete(&self.on_line, side) {
            self.report.off_boundary += 1;
        }
        self.on_line.clear();
    }

    /// Whether no pass is left in the cell behind a line.
    fn is_cell_done(&self, side: f64) -> bool {
        let [_, last] = self.cell.pass_range();
        self.cell.is_empty_between(side, last)
    }

    /// Whether no cell from this one on holds a pass.
    fn cells_without_pass(&self, from: usize) -> bool {
        (from..self.oracle.cells.len()).all(|index| {
            let cell = self.oracle.of_cell(index);
            let [first, last] = cell.pass_range();
            cell.is_empty_between(first, last)
        })
    }

    /// Goes on to the next cell that holds a pass, where the one before is done at its last line and this one is the first there.
    fn enters_cell(&mut self, last: Option<f64>, start: [f64; 2]) -> bool {
        if last.is_some_and(|last| !self.is_cell_done(last)) {
            return false;
        }
        // A cell that holds no pass for certain may touch the next one where that begins: then it is the next one.
        let mut touched = None;
        for index in self.cell_index + 1..self.oracle.cells.len() {
            let cell = self.oracle.of_cell(index);
            let [first, last] = cell.pass_range();
            let (is_first_line, is_empty) = (cell.is_first_line(start), cell.is_empty_between(first, last));
            if is_first_line && (!is_empty || touched.is_none()) {
                touched = Some((cell, index));
            }
            if !is_empty {
                break;
            }
        }
        if let Some((cell, index)) = touched {
            (self.cell, self.cell_index) = (cell, index);
            return true;
        }
        false
    }

    /// Whether the pass that begins is the first one: that of the first cell that holds one.
    fn is_first_pass(&mut self, start: [f64; 2]) -> bool {
        let [first, last] = self.cell.pass_range();
        let is_here = self.cell.is_first_line(start);
        if is_here && !self.cell.is_empty_between(first, last) {
            return true;
        }
        self.enters_cell(None, start) || is_here
    }

    /// Begins a pass of a region: on the line of the one before, or on the next one.
    fn begin_interval(&mut self, sample: &PassSample, start: [f64; 2], spot: SampleLocation) {
        let [_, side] = start;
        let Some(before) = self.current else {
            let is_first = self.is_first_pass(start);
            self.report.first_on_boundary = sample.pass == 0 && is_first;
            return;
        };
        if !before.finished || sample.pass != self.report.passes {
            self.report.off_boundary += 1;
        }
        if side == before.side {
            return;
        }
        self.check_line(before.side);
        if self.enters_cell(Some(before.side), start) {
            return;
        }
        // Where the region ends in between, the lines are not neighbours.
        if side < before.side || self.cell.intervals(0.5 * (before.side + side)).is_empty() {
            return;
        }
        let last = self.cell.last_line();
        let interval = before.least_interval.min(self.across(before.side, last));
        if self.oracle.spacing == Spacing::FirstOrder && last - side > self.oracle.near_side() {
            // The line is rounded down to a place.
            let error = self.across(before.side, side) - interval;
            let error = if error < 0.0 {
                (error + self.oracle.near_side()).min(0.0)
            } else {
                error
            };
            self.report.side_step.add(error / interval, spot);
        }
        self.close_scallop(&before, self.across(before.side, side));
    }

    /// Distance between two lines, in units of the side parameter at the first.
    fn across(&self, from: f64, to: f64) -> f64 {
        let [_, smooth] = &self.smooth;
        smooth.distance(from, to)
    }

    /// Path parameters where a pass starts and ends.
    fn pass_ends(&self, pass: u32) -> [f64; 2] {
        let [low, high] = self.oracle.path_range();
        let backwards = self.oracle.pattern == Pattern::Zigzag && pass % 2 == 1;
        if backwards { [high, low] } else { [low, high] }
    }

    /// Begins a pass and checks its side parameter against the least interval of the previous pass.
    fn begin_pass(&mut self, sample: &PassSample, path: f64, side: f64, spot: SampleLocation) {
        let [first, last] = self.oracle.side_range();
        let is_curve = self.oracle.spacing.is_constant();
        let is_region = self.oracle.region.is_some();
        let before = self.current;
        match self.current {
            _ if is_region && !is_curve => {
                let start = [self.at_boundary(sample, path, side), side];
                self.begin_interval(sample, start, spot);
            }
            None if is_region => {
                let start = [path, side];
                let is_first = self.is_first_pass(start);
                self.report.first_on_boundary = sample.pass == 0 && is_first;
            }
            None => {
                let [start, _] = self.oracle.outer_passes();
                let is_near = (side - start).abs() <= START_SHARE * (last - first);
                self.report.first_on_boundary = sample.pass == 0 && (side == start || is_curve && is_near);
            }
            Some(before) if is_curve => {
                if !before.finished || sample.pass != self.report.passes {
                    self.report.off_boundary += 1;
                }
            }
            Some(before) => {
                let apart = self.across(before.side, side);
                let interval = before.least_interval.min(self.across(before.side, last));
                if self.oracle.spacing == Spacing::FirstOrder {
                    self.report.side_step.add((apart - interval) / interval, spot);
                }
                self.close_scallop(&before, apart);
                if !before.finished || sample.pass != self.report.passes {
                    self.report.off_boundary += 1;
                }
            }
        }
        let is_off = if is_curve {
            self.is_off_curve(path, side)
        } else if is_region {
            false
        } else {
            self.is_off(sample, path, side, self.pass_ends(sample.pass)[0])
        };
        if is_off {
            self.report.off_boundary += 1;
        }
        self.report.passes += 1;
        let same_line = before.filter(|before| is_region && !is_curve && before.side == side);
        let line = match (before, same_line) {
            (_, Some(before)) => before.line,
            (Some(before), None) => before.line + 1,
            (None, None) => 0,
        };
        self.current = Some(PassState {
            side,
            path,
            before: [None, Some([path, side])],
            // The step to the next line is that of all passes on this one.
            least_interval: same_line.map_or(f64::INFINITY, |before| before.least_interval),
            least_at: same_line.map_or(spot, |before| before.least_at),
            inverse_squares: same_line.map_or(0.0, |before| before.inverse_squares),
            samples: same_line.map_or(0, |before| before.samples),
            finished: false,
            line,
            start: if is_region && !is_curve {
                self.at_boundary(sample, path, side)
            } else {
                path
            },
            backwards: self.oracle.pattern == Pattern::Zigzag && line % 2 == 1,
        });
    }

    /// Scallop left in the gap to the next pass: its largest height is at the least interval.
    fn close_scallop(&mut self, pass: &PassState, gap: f64) {
        let height = |inverse_square: f64| self.oracle.scallop_mm * gap * gap * inverse_square;
        let most = height(1.0 / (pass.least_interval * pass.least_interval));
        self.report.scallop_sum_mm += height(pass.inverse_squares);
        self.report.scallop_mm.add(most, pass.least_at);
        self.report.scallop_samples += pass.samples;
    }

    /// Arc length of the step to this sample, mm, and its deviation from the feed, %.
    fn check_step(
        &mut self,
        sample: &PassSample,
        path: f64,
        side: f64,
        spot: SampleLocation,
    ) -> (Option<f64>, Option<f64>) {
        let Some(pass) = &mut self.current else {
            self.report.off_pass += 1;
            return (None, None);
        };
        if self.oracle.spacing.is_constant() {
            return self.check_curve(sample, [path, side], spot);
        }
        let forwards = if pass.backwards { -1.0 } else { 1.0 };
        let from = pass.path;
        pass.path = path;
        if side != pass.side || (path - from) * forwards < 0.0 || pass.finished {
            self.report.off_pass += 1;
        }
        let arc = forwards * self.oracle.arc_between(&self.breaks, from, path, side);
        self.check_arc(sample, arc, spot)
    }

    /// The step on a curve: its direction, and its arc on the parabola through three samples.
    fn check_curve(
        &mut self,
        sample: &PassSample,
        at: [f64; 2],
        spot: SampleLocation,
    ) -> (Option<f64>, Option<f64>) {
        let Some(pass) = &mut self.current else {
            return (None, None);
        };
        let [older, last] = pass.before;
        pass.before = [last, Some(at)];
        let Some(last) = last else {
            return (None, None);
        };
        pass.path = at[0];
        let backwards = older.is_some_and(|older| (at[0] - last[0]) * (last[0] - older[0]) <= 0.0);
        let is_outside = !self.oracle.is_on_pass(at[0], at[1]);
        if backwards || at[0] == last[0] || pass.finished || is_outside {
            self.report.off_pass += 1;
            return (None, None);
        }
        let Some(older) = older else {
            // The curve's bend is not known yet.
            let straight = [0, 1].map(|k| 2.0 * last[k] - at[k]);
            let arc = self
                .oracle
                .arc_of_curve(&self.breaks, &self.smooth, [straight, last, at]);
            self.report.cc_length_mm += arc;
            return (Some(arc), None);
        };
        let arc = self
            .oracle
            .arc_of_curve(&self.breaks, &self.smooth, [older, last, at]);
        self.check_arc(sample, arc, spot)
    }

    /// The arc of a step against the feed.
    fn check_arc(
        &mut self,
        sample: &PassSample,
        arc: f64,
        spot: SampleLocation,
    ) -> (Option<f64>, Option<f64>) {
        self.report.cc_length_mm += arc;
        let wanted = sample.feed_mm_s * self.oracle.period_s;
        // The deviation refers to the larger of the commanded and the programmed step.
        let whole = wanted.max(self.oracle.feed_mm_s * self.oracle.period_s);
        if sample.last_of_pass {
            let is_rounding = (0.0..LAST_STEP_ROUNDING).contains(&((arc - wanted) / whole));
            self.report.last_step.add(
                match wanted > 0.0 {
                    true if is_rounding => 1.0,
                    true => arc / wanted,
                    false => 0.0,
                },
                spot,
            );
            return (Some(arc), None);
        }
        let ripple_pct = (wanted > 0.0).then(|| 100.0 * (arc - wanted) / whole);
        if let Some(ripple_pct) = ripple_pct {
            self.report.ripple_pct.add(ripple_pct, spot);
        }
        (Some(arc), ripple_pct)
    }

    /// Checks positions, normal, curvature and interval of one sample; returns the centre's error, nm.
    fn check_geometry(&mut self, sample: &PassSample, spot: SampleLocation) -> Option<f64> {
        let Ok(contact) = self.oracle.contact(sample.u, sample.v) else {
            self.report.degenerate += 1;
            return None;
        };
        let [cc_nm, cl_nm] = [sample.cc_nm, sample.cl_nm].map(|nm| DVec3::from(nm.map(f64::from)));
        let report = &mut self.report;
        let position_nm = cl_nm.distance(contact.cl_mm * NM_PER_MM);
        report.position_nm.add(position_nm, spot);
        report
            .contact_nm
            .add(cc_nm.distance(contact.cc_mm * NM_PER_MM), spot);
        let emitted = cl_nm - cc_nm;
        // By the sine and the cosine: the arc cosine alone loses half of the digits of a small angle.
        let tilt_rad = emitted
            .cross(contact.normal)
            .length()
            .atan2(emitted.dot(contact.normal));
        report.normal_rad.add(tilt_rad, spot);
        report.fit.add(contact.fit(self.oracle.radius_mm).max(0.0), spot);
        let [first, last] = self.oracle.side_range();
        let interval = contact.interval;
        if sample.interval < last - first || interval < last - first {
            report.interval.add(sample.interval / interval - 1.0, spot);
        }
        if let Some(pass) = &mut self.current {
            pass.inverse_squares += 1.0 / (interval * interval);
            pass.samples += 1;
            if interval < pass.least_interval {
                pass.least_interval = interval;
                pass.least_at = spot;
            }
        }
        Some(position_nm)
    }
}
