//! Result of the measurement, in figures and in sentences.

use super::Requirements;
use super::axes::AxisTravel;
use super::field::FieldPoint;
use super::gouge::GougeSearchResult;
use super::original::OriginalDeviation;
use super::region::RegionHeights;
use super::ridge::{Crest, Gap, GapRidge, MISSED_RADII};
use super::shape::{ConcaveRadius, SurfaceCheck};
use super::track::ToolPath;
use crate::Verdict;
use glam::DVec3;
use job::Job;
use oracle::Oracle;

/// Largest number of points stored for all ridges together.
const RIDGE_POINTS_MAX: usize = 100_000;
/// Bins of the histogram of heights per scallop limit.
const BINS_A_LIMIT: f64 = 10.0;
/// Number of bins; the last one also has all greater heights.
const BINS: usize = 13;
/// Rounding of a centre to whole nanometres, mm: half the diagonal of a 1 nm cube.
const ROUNDING_MM: f64 = 0.866_025_403_784_438_6e-6;
/// Tolerance of the search for a crest, mm: the two heights agree within it.
const CREST_MM: f64 = 1e-8;
/// A new limit is proposed with this margin: heights are proportional to the limit where the step-over is small.
pub(super) const ASKED_SHARE: f64 = 0.995;
/// A tolerance is proposed with this margin, as a share.
const ACCEPTED_MARGIN: f64 = 1e-4;
/// Every gouge deeper than this must be seen, mm, or than [`super::ERROR_SHARE_MAX`] of the scallop limit if that is more: ten times the
/// position tolerance.
const GOUGE_SEEN_MM: f64 = 1e-4;
/// A ball with more than this share of the concave radius hardly fits: no contact is excluded from the search for gouges (see `gouge.rs`).
const TIGHT_SHARE: f64 = 0.98;
/// Rounding in f64, as a share of the coordinates: tens of operations of 1.1e-16 each.
const ARITHMETIC: f64 = 1e-14;

/// The highest ridge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HighestScallop {
    /// Height, mm; four ball radii where no ball reaches the point.
    pub height_mm: f64,
    /// Parameter u.
    pub u: f64,
    /// Parameter v.
    pub v: f64,
    /// The passes on both sides, from 0.
    pub passes: [u32; 2],
    /// Point on the surface, mm.
    pub point_mm: DVec3,
    /// Error bound of this height, mm. Between stations a ridge can only be higher: [`SweptResult::measurement_error_mm`].
    pub error_mm: f64,
}

/// The deepest gouge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gouge {
    /// Ball radius minus the distance of the point from the centre's path, mm.
    pub depth_mm: f64,
    /// Parameter u of the gouged point.
    pub u: f64,
    /// Parameter v of the gouged point.
    pub v: f64,
    /// The point, mm.
    pub point_mm: DVec3,
    /// Tick of the sample that gouges (at the sample, or between it and the next one).
    pub tick: u64,
    /// Pass of that sample.
    pub pass: u32,
    /// (u, v) of that sample's own contact.
    pub contact: [f64; 2],
    /// Whether the concave radius at the point, or at the contact, is smaller than the ball's; otherwise the ball interferes with
    /// another part of the surface than its contact.
    pub local: bool,
}

/// Error bound of the measured scallop heights, mm, by contribution; the sum is [`MeasurementError::total_mm`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeasurementError {
    /// Deviation of the path's chords from the centre's curve between samples.
    pub path_mm: f64,
    /// Rounding of positions to whole nanometres.
    pub rounding_mm: f64,
    /// Spacing of stations along the gaps: possible excess of a ridge between two stations over the highest station (second differences).
    pub stations_mm: f64,
    /// Tolerance of the crest search, and f64 rounding.
    pub search_mm: f64,
}

impl MeasurementError {
    /// The sum.
    #[must_use]
    pub fn total_mm(&self) -> f64 {
        self.path_mm + self.rounding_mm + self.stations_mm + self.search_mm
    }
}

/// A point of a ridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RidgePoint {
    /// Parameter u.
    pub u: f64,
    /// Parameter v.
    pub v: f64,
    /// Point on the surface, under the crest, mm.
    pub point_mm: DVec3,
    /// Height of the crest above it, mm.
    pub height_mm: f32,
}

/// The ridge in one gap between passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Ridge {
    /// Gap between passes, from 0.
    pub gap: u32,
    /// Points along the ridge, the highest among them.
    pub points: Vec<RidgePoint>,
}

/// Result of the measurement of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct SweptResult {
    /// The highest ridge. Zero with fewer than two complete passes: `ridges` is empty then.
    pub scallop_max: HighestScallop,
    /// Verdict on the highest ridge. [`Verdict::Unknown`]: the error bound is above [`super::ERROR_SHARE_MAX`] of the limit, or there are
    /// fewer than two whole passes.
    pub scallop_verdict: Verdict,
    /// Verdict on gouges: deeper by more than the error bound than the tolerance of the part whose face this is, or than 0 where there is none. [`Verdict::Unknown`]: the bound of the search is above [`super::ERROR_SHARE_MAX`] of the scallop limit.
    pub gouge_verdict: Verdict,
    /// Mean of the crest's height, weighted by the surface's area (each gap's strip counts with its crest's height), mm.
    pub scallop_mean_mm: f64,
    /// Shares of that area by crest height: 0 to 0.1 h, 0.1 to 0.2 h, ..., 1.1 to 1.2 h, more.
    pub scallop_histogram: [f64; BINS],
    /// Error bound of the heights, mm.
    pub measurement_error_mm: f64,
    /// Contributions to the error bound.
    pub measurement_error: MeasurementError,
    /// The deepest gouge; `None` if none is deeper than `gouge_floor_mm`.
    pub gouge: Option<Gouge>,
    /// Error bound of a gouge's depth, and least depth that counts as one, mm: the position tolerance of `verify`, plus the interpolation error between samples.
    pub gouge_floor_mm: f64,
    /// Upper bound of the depth at every point of the surface, mm; near contacts it assumes that the contacts are correct.
    pub gouge_bound_mm: f64,
    /// Whether the search for gouges ended because the surface has too many cells.
    pub gouge_cells_exhausted: bool,
    /// Heights in a drawn region, place by place; `None` on others, and where the run is not complete.
    pub region: Option<RegionHeights>,
    /// Verdict on those that passes serve, beside that on the ridges; [`Verdict::Unknown`] where there are none.
    pub region_verdict: Verdict,
    /// Whether the run reached its end.
    pub is_complete: bool,
    /// Ridges, one per gap, thinned to 100 000 points in total.
    pub ridges: Vec<Ridge>,
    /// Number of stations measured.
    pub stations: usize,
    /// Number of cells evaluated in the gouge search.
    pub cells: usize,
    /// Axis travel.
    pub axes: AxisTravel,
    /// Concave radius, poles and degenerate points of the surface.
    pub shape: SurfaceCheck,
    /// Deviation of the surface from its original, against which heights are measured; `None` without one.
    pub original: Option<OriginalDeviation>,
    /// One sentence per violated requirement; empty if all are met.
    pub failures: Vec<String>,
    /// One sentence per condition to know before the run, failures included.
    pub warnings: Vec<String>,
}

pub(super) struct Measurements<'a> {
    pub(super) gaps: &'a [Gap<'a>],
    pub(super) ridges: &'a [GapRidge],
    pub(super) search: GougeSearchResult,
    /// Deviation of each pass's chords from the centre's curve, mm.
    pub(super) deviation_mm: &'a [f64],
    pub(super) axes: AxisTravel,
    pub(super) shape: SurfaceCheck,
    pub(super) complete: bool,
    pub(super) requirements: &'a Requirements<'a>,
    pub(super) region: Option<RegionHeights>,
    pub(super) original: Option<OriginalDeviation>,
}

impl SweptResult {
    pub(super) fn new(job: &Job, oracle: &Oracle, track: &ToolPath, parts: &Measurements<'_>) -> Self {
        let deviation_mm = parts.deviation_mm.iter().copied().fold(0.0, f64::max);
        let (mut scallop_max, [most_at_stations, most_possible]) = extreme(oracle, parts);
        let (scallop_mean_mm, scallop_histogram) = mean(oracle, parts);
        let sensitivity_of = |height_mm: f64| sensitivity(height_mm, oracle.radius_mm);
        let sensitivity = sensitivity_of(scallop_max.height_mm);
        let coordinates = parts.axes.extent_mm.map_or(0.0, |extent| {
            extent
                .iter()
                .flatten()
                .fold(0.0_f64, |most, at| most.max(at.abs()))
        });
        let measurement_error = MeasurementError {
            path_mm: most_possible - most_at_stations,
            rounding_mm: ROUNDING_MM * sensitivity,
            stations_mm: most_at_stations - scallop_max.height_mm,
            search_mm: CREST_MM + ARITHMETIC * (coordinates + oracle.radius_mm) * sensitivity,
        };
        scallop_max.error_mm += measurement_error.rounding_mm + measurement_error.search_mm;
        let of_places_mm = |region: &RegionHeights| {
            let height_mm = region.highest.map_or(0.0, |highest| highest.height_mm);
            (deviation_mm + ROUNDING_MM) * sensitivity_of(height_mm) + measurement_error.search_mm
        };
        let mut findings = Self {
            scallop_max,
            scallop_verdict: Verdict::Unknown,
            gouge_verdict: Verdict::Unknown,
            scallop_mean_mm,
            scallop_histogram,
            measurement_error_mm: measurement_error.total_mm(),
            measurement_error,
            gouge: gouge(oracle, track, &parts.search),
            gouge_floor_mm: super::POSITION_MM + deviation_mm,
            gouge_bound_mm: parts.search.bound_mm,
            gouge_cells_exhausted: parts.search.exhausted,
            region: parts.region,
            region_verdict: Verdict::Unknown,
            is_complete: parts.complete,
            ridges: thinned(oracle, parts),
            stations: parts.ridges.iter().map(|ridge| ridge.crests.len()).sum(),
            cells: parts.search.cells,
            axes: parts.axes,
            shape: parts.shape.clone(),
            original: parts.original,
            failures: Vec::new(),
            warnings: Vec::new(),
        };
        let by_original_mm = parts.original.map_or(0.0, |original| original.tolerance_mm);
        let limit_mm = job.scallop_mm * (1.0 + parts.requirements.scallop_tolerance) + by_original_mm;
        let over_surface_mm = parts.original.map_or(0.0, |original| original.over_surface_mm);
        let region_failure = parts
            .region
            .as_ref()
            .and_then(|region| region.failure(job, limit_mm - by_original_mm, of_places_mm(region)));
        let surely_above = findings.scallop_max.height_mm - findings.scallop_max.error_mm > limit_mm
            || over_surface_mm - findings.measurement_error_mm > limit_mm - by_original_mm;
        findings.scallop_verdict = findings.judge_scallop(job, limit_mm, surely_above);
        let highest = parts.region.and_then(|region| region.highest);
        findings.region_verdict = match (highest, &region_failure) {
            (None, _) => Verdict::Unknown,
            (Some(_), None) => Verdict::Met,
            (Some(_), Some(_)) => Verdict::Violated,
        };
        findings.gouge_verdict = findings.judge_gouge(job);
        findings.failures = findings.failing(job, region_failure);
        findings.warnings = findings.failures.clone();
        findings.warnings.extend(findings.other_warnings(job, parts));
        findings
    }

    /// Depth of the deepest gouge, mm; 0 without one.
    #[must_use]
    pub fn gouge_max_mm(&self) -> f64 {
        self.gouge.map_or(0.0, |gouge| gouge.depth_mm)
    }

    /// The deepest gouge, where it is deeper than allowed.
    #[must_use]
    pub fn violating_gouge(&self) -> Option<&Gouge> {
        self.gouge
            .as_ref()
            .filter(|_| self.gouge_verdict == Verdict::Violated)
    }

    /// The highest place of a drawn region, where it is higher than allowed.
    #[must_use]
    pub fn violating_place(&self) -> Option<&FieldPoint> {
        let is_violated = self.region_verdict == Verdict::Violated;
        self.region.as_ref().filter(|_| is_violated)?.highest.as_ref()
    }

    /// Whether the material at the highest ridge is out of every ball's reach.
    fn uncut(&self, job: &Job) -> bool {
        self.scallop_max.height_mm >= MISSED_RADII * job.radius_mm
    }

    fn judge_scallop(&self, job: &Job, limit_mm: f64, surely_above: bool) -> Verdict {
        let (height_mm, error_mm) = (self.scallop_max.height_mm, self.measurement_error_mm);
        let certain = error_mm <= super::ERROR_SHARE_MAX * job.scallop_mm;
        if self.ridges.is_empty() {
            Verdict::Unknown
        } else if self.uncut(job) || surely_above || (certain && height_mm > limit_mm + error_mm) {
            Verdict::Violated
        } else if certain {
            Verdict::Met
        } else {
            Verdict::Unknown
        }
    }

    /// Whether the run has a sample.
    #[must_use]
    pub fn has_samples(&self) -> bool {
        self.axes.extent_mm.is_some()
    }

    fn judge_gouge(&self, job: &Job) -> Verdict {
        if !self.has_samples() {
            Verdict::Unknown
        } else if self.gouge_max_mm() > gouge_allowed_mm(job) + self.gouge_floor_mm {
            Verdict::Violated
        } else if self.gouge_floor_mm <= self.gouge_seen_mm(job)
            && self.gouge_bound_mm
                <= self
                    .gouge_seen_mm(job)
                    .max(gouge_allowed_mm(job) + self.gouge_floor_mm)
        {
            Verdict::Met
        } else {
            Verdict::Unknown
        }
    }

    /// Depth above which every gouge must be seen, mm.
    fn gouge_seen_mm(&self, job: &Job) -> f64 {
        (super::ERROR_SHARE_MAX * job.scallop_mm)
            .max(GOUGE_SEEN_MM)
            .max(gouge_allowed_mm(job))
    }

    /// Whether the job's region holds no two neighbouring passes, so that there is no ridge to be measured.
    #[must_use]
    pub fn has_no_gap(&self, job: &Job) -> bool {
        job.region.is_some() && self.ridges.is_empty() && self.is_complete
    }

    /// The reason against the ridges.
    fn ridges_failure(&self, job: &Job) -> Option<String> {
        let (most, limit) = (&self.scallop_max, job.scallop_mm);
        let place = format!(
            "between passes {} and {} at u = {:.6}, v = {:.6}",
            most.passes[0], most.passes[1], most.u, most.v
        );
        match self.scallop_verdict {
            Verdict::Met => None,
            Verdict::Violated if self.uncut(job) => Some(format!("no ball reaches the material {place}")),
            Verdict::Violated if self.original.is_some() => Some(format!(
                "the scallop is {:.6} mm high from the CAD face, {place}, and {:.6} mm from the job's surface, where the limit is {limit} mm \
                 (measured within {:.1e} mm)",
                most.height_mm,
                self.original.map_or(0.0, |original| original.over_surface_mm),
                most.error_mm
            )),
            Verdict::Violated => Some(format!(
                "the scallop is {:.6} mm high, {:.2} % above the limit of {limit} mm, {place} (measured within {:.1e} mm): ask for scallop_mm = {:.3e}, or \
                 accept it with --scallop-tolerance {:.2}%",
                most.height_mm,
                100.0 * (most.height_mm / limit - 1.0),
                most.error_mm,
                ASKED_SHARE * limit * limit / most.height_mm,
                100.0 * ((most.height_mm / limit - 1.0).max(0.0) + ACCEPTED_MARGIN)
            )),
            // Of a small region no pass may have a neighbour; what is left beside one pass is the region's own.
            Verdict::Unknown if self.has_no_gap(job) => None,
            Verdict::Unknown if self.ridges.is_empty() => {
                Some("the scallop height is not measured: fewer than two whole passes".to_owned())
            }
            Verdict::Unknown => Some(format!(
                "the scallop height is not measured: {:.6} mm within {:.1e} mm, which is more than {} % of the limit of {limit} mm, {place}: {}",
                most.height_mm,
                self.measurement_error_mm,
                100.0 * super::ERROR_SHARE_MAX,
                self.measuring_remedy()
            )),
        }
    }

    /// What makes a height measurable that is not.
    fn measuring_remedy(&self) -> &'static str {
        let error = &self.measurement_error;
        if error.path_mm >= error.stations_mm {
            "the samples are too far apart for the path's bends: lower the feed, or shorten period_us"
        } else {
            "the height changes too fast along the gap: choose along = the other parameter, or cut the surface where it folds"
        }
    }

    /// Why gouges are not measured, and what makes them measurable.
    pub(super) fn searching_remedy(&self, job: &Job) -> String {
        let tight = |concave: &ConcaveRadius| job.radius_mm > TIGHT_SHARE * concave.radius_mm;
        if self.gouge_floor_mm > self.gouge_seen_mm(job) {
            "the samples are too far apart for the path's bends: lower the feed, or shorten period_us"
                .to_owned()
        } else if let Some(concave) = self
            .shape
            .concave_radius
            .as_ref()
            .filter(|concave| tight(concave))
        {
            format!(
                "the ball hardly fits, with a concave radius of {:.4} mm at u = {:.6}, v = {:.6}: take a smaller ball",
                concave.radius_mm, concave.u, concave.v
            )
        } else if self.gouge_cells_exhausted {
            format!(
                "the surface is too large for a ball of {} mm radius, after {} cells: divide it into jobs of smaller surfaces (ranges of u and v), or \
                 take a larger ball",
                job.radius_mm, self.cells
            )
        } else {
            "a sharp fold of the surface: divide the job there".to_owned()
        }
    }

    fn failing(&self, job: &Job, region_failure: Option<String>) -> Vec<String> {
        if !self.has_samples() {
            return vec!["nothing is measured: the run has no sample".to_owned()];
        }
        let mut failures: Vec<String> = self.ridges_failure(job).into_iter().collect();
        failures.extend(region_failure);
        if self.gouge_verdict == Verdict::Unknown {
            failures.push(format!(
                "gouges are not measured: searched only down to {:.6} mm, but all deeper than {:.6} mm must be seen; {}",
                self.gouge_bound_mm.max(self.gouge_floor_mm),
                self.gouge_seen_mm(job),
                self.searching_remedy(job)
            ));
        }
        if let Some(gouge) = self.violating_gouge() {
            let what = if gouge.local {
                "the ball's radius exceeds the concave radius there"
            } else {
                "the ball's contact is on another part of the surface"
            };
            failures.push(format!(
                "the ball cuts {:.6} mm below the surface (measured within {:.1e} mm) at u = {:.6}, v = {:.6} (x = {:.3}, y = {:.3}, z = {:.3} mm): \
                 at tick {}, pass {}, with its contact at u = {:.6}, v = {:.6}; {what}: take a smaller ball, or exclude this region",
                gouge.depth_mm,
                self.gouge_floor_mm,
                gouge.u,
                gouge.v,
                gouge.point_mm[0],
                gouge.point_mm[1],
                gouge.point_mm[2],
                gouge.tick,
                gouge.pass,
                gouge.contact[0],
                gouge.contact[1]
            ));
        }
        failures.extend(self.original.and_then(|original| original.failure()));
        failures.extend(self.axes.failures(&job.machine));
        failures
    }

    fn other_warnings(&self, job: &Job, parts: &Measurements<'_>) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(concave) = self
            .shape
            .concave_radius
            .filter(|concave| concave.radius_mm < job.radius_mm)
        {
            warnings.push(format!(
                "the surface has a concave radius of {:.4} mm at u = {:.6}, v = {:.6}, where a ball of radius {} mm does not fit",
                concave.radius_mm, concave.u, concave.v, job.radius_mm
            ));
        }
        if let Some((count, [u, v])) = self.shape.degenerate {
            warnings.push(format!(
                "the surface has no normal at {count} of the points evaluated, the first at u = {u:.6}, v = {v:.6}"
            ));
        }
        let skipped: u32 = parts.ridges.iter().map(|ridge| ridge.skipped).sum();
        if skipped > 0 {
            warnings.push(format!(
                "{skipped} stations without a normal were left out of the scallop measurement"
            ));
        }
        warnings.extend(self.region.iter().flat_map(|region| region.warnings(job)));
        if self.has_no_gap(job) {
            warnings.push(
                "the region holds no two passes beside each other: there is no scallop between passes to be measured"
                    .to_owned(),
            );
        }
        if !parts.complete {
            warnings.push(
                "the run is not complete: the part after its last complete pass is not measured".to_owned(),
            );
        }
        warnings
    }
}

/// Upper bound of the change of a height per shift of the centre: the reciprocal of the cosine between ray and ball, which is
/// `1 - height / r` on a plane, with a margin for curved surfaces.
fn sensitivity(height_mm: f64, radius_mm: f64) -> f64 {
    1.0 / (1.0 - 2.0 * height_mm / radius_mm).max(0.1)
}

/// The highest crest, with its error by the deviation of the path's chords; and the upper bounds of a crest, mm: between stations, and with
/// that deviation.
fn extreme(oracle: &Oracle, parts: &Measurements<'_>) -> (HighestScallop, [f64; 2]) {
    let mut most: Option<(f64, &Crest, usize)> = None;
    let (mut possible, mut own_error_mm) = ([0.0_f64; 2], 0.0);
    let path_mm = parts.deviation_mm.iter().copied().fold(0.0, f64::max);
    for (gap, ridge) in parts.ridges.iter().enumerate() {
        let mut own = 0.0_f64;
        for crest in &ridge.crests {
            own = own.max(crest.height_mm);
            if most.is_none_or(|(height, ..)| crest.height_mm > height) {
                most = Some((crest.height_mm, crest, gap));
            }
        }
        let highest = most.is_some_and(|(.., of)| of == gap);
        // The chords of a gap's own two passes count, and those of all passes where another one lowers the crest.
        let deviation_mm = if ridge.crests.iter().any(|crest| crest.lowered) {
            path_mm
        } else {
            let [from, to] = parts.gaps[gap].indices;
            parts.deviation_mm[from].max(parts.deviation_mm[to])
        };
        let between = own + ridge.excess_mm;
        let by_path = deviation_mm * sensitivity(own, oracle.radius_mm);
        if highest {
            own_error_mm = by_path;
        }
        let all = between + by_path;
        possible = [possible[0].max(between), possible[1].max(all)];
    }
    let Some((height_mm, crest, index)) = most else {
        return (HighestScallop::default(), [0.0; 2]);
    };
    let (u, v) = oracle.swapped(crest.path, parts.gaps[index].side(crest.path, crest.share));
    let extreme = HighestScallop {
        height_mm,
        u,
        v,
        passes: parts.gaps[index].indices.map(number),
        point_mm: crest.point_mm,
        error_mm: own_error_mm,
    };
    (extreme, possible)
}

#[allow(clippy::cast_possible_truncation, reason = "passes are 32 bits")]
fn number(gap: usize) -> u32 {
    gap as u32
}

/// Mean crest height by area, and the histogram (trapezoidal rule along each gap).
fn mean(oracle: &Oracle, parts: &Measurements<'_>) -> (f64, [f64; BINS]) {
    let (mut sum, mut area, mut histogram) = (0.0, 0.0, [0.0; BINS]);
    for (gap, ridge) in parts.gaps.iter().zip(parts.ridges) {
        for pair in ridge.crests.windows(2) {
            let step = 0.5 * (pair[1].path - pair[0].path);
            for crest in pair {
                let width = gap.side(crest.path, 1.0) - gap.side(crest.path, 0.0);
                let part = crest.area * (width * step);
                // Where a ball has gouged, no scallop remains.
                sum += crest.height_mm.max(0.0) * part;
                area += part;
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
                let bin = (BINS_A_LIMIT * crest.height_mm / oracle.scallop_mm).max(0.0) as usize;
                histogram[bin.min(BINS - 1)] += part;
            }
        }
    }
    if area <= 0.0 {
        return (0.0, histogram);
    }
    (sum / area, histogram.map(|part| part / area))
}

/// How deep the ball may enter the surface, mm: as deep as the tool may enter the part whose face it is.
fn gouge_allowed_mm(job: &Job) -> f64 {
    job.origin.part().map_or(0.0, |part| part.tolerance_mm)
}

fn gouge(oracle: &Oracle, track: &ToolPath, search: &GougeSearchResult) -> Option<Gouge> {
    let deepest = search.deepest?;
    let (pass, index) = deepest.by;
    let samples = &track.passes[pass as usize];
    let (u, v) = oracle.swapped(samples.path[index as usize], samples.side_of(index as usize));
    let tight = |u: f64, v: f64| {
        super::grid::local_curvature(&oracle.surface.at(u, v), oracle)
            .is_some_and(|(_, curvature)| curvature.principal[1] * oracle.radius_mm >= 1.0)
    };
    Some(Gouge {
        depth_mm: deepest.depth_mm,
        u: deepest.u,
        v: deepest.v,
        point_mm: deepest.point_mm,
        tick: samples.tick(index as usize),
        pass,
        contact: [u, v],
        local: tight(u, v) || tight(deepest.u, deepest.v),
    })
}

/// The ridges with a limited number of points.
fn thinned(oracle: &Oracle, parts: &Measurements<'_>) -> Vec<Ridge> {
    let each = (RIDGE_POINTS_MAX / parts.ridges.len().max(1)).max(3);
    let mut ridges = Vec::with_capacity(parts.ridges.len());
    for (index, (gap, ridge)) in parts.gaps.iter().zip(parts.ridges).enumerate() {
        let crests = &ridge.crests;
        let highest = (0..crests.len()).reduce(|most, k| {
            if crests[k].height_mm > crests[most].height_mm {
                k
            } else {
                most
            }
        });
        let stride = crests.len().div_ceil(each - 2).max(1);
        let kept =
            (0..crests.len()).filter(|k| k % stride == 0 || Some(*k) == highest || k + 1 == crests.len());
        let points = kept
            .map(|k| {
                let crest = &crests[k];
                let (u, v) = oracle.swapped(crest.path, gap.side(crest.path, crest.share));
                #[allow(clippy::cast_possible_truncation, reason = "for drawing")]
                let height_mm = crest.height_mm as f32;
                RidgePoint {
                    u,
                    v,
                    point_mm: crest.point_mm,
                    height_mm,
                }
            })
            .collect();
        ridges.push(Ridge {
            gap: number(index),
            points,
        });
    }
    ridges
}
