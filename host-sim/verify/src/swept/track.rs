//! The tool path of a run in compact form: 28 bytes per sample.

use super::CHORD_SHARE;
use glam::DVec3;
use job::units::{MM_PER_NM, NM_PER_MM};
use job::{Along, Job};
use oracle::PassSample;

/// Least deviation from a chord at which samples are stored, nm: rounding of the centres bends a straight line by less.
const BEND_MIN_NM: f64 = 4.0;
/// Largest number of samples left out in a row: each is held against the chord that takes their place.
const LEFT_OUT_MAX: usize = 64;
/// Least distance of stored samples on straight parts, as a share of the largest step between two samples.
const SPACING_SHARE: f64 = 0.5;

/// One pass as emitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolPathPass {
    /// Side parameter; of a curved pass that of its first sample.
    pub side: f64,
    /// Side parameter of each sample of a curved pass; empty on others.
    pub sides: Vec<f64>,
    /// Tick of the first sample.
    pub first_tick: u64,
    /// Periods from the first sample to each sample; a point interpolated between two samples has the first one's.
    pub periods: Vec<u32>,
    /// Path parameter of each sample: not descending, or not ascending on a pass in the opposite direction.
    pub path: Vec<f64>,
    /// Ball centre of each sample, nm.
    pub cl_nm: Vec<[i32; 3]>,
    /// Largest distance of the samples left out before each sample from the chord to it, nm; may be shorter, 0 beyond its end.
    pub left_out_nm: Vec<f32>,
}

impl ToolPathPass {
    /// Ball centre of a sample, mm.
    #[must_use]
    pub fn centre(&self, index: usize) -> DVec3 {
        DVec3::from(self.cl_nm[index].map(f64::from)) * MM_PER_NM
    }

    /// Side parameter of a sample.
    #[must_use]
    pub fn side_of(&self, index: usize) -> f64 {
        self.sides.get(index).copied().unwrap_or(self.side)
    }

    /// Side parameter at a path parameter, linear between samples.
    pub(super) fn side_at(&self, path: f64) -> f64 {
        if self.sides.is_empty() {
            return self.side;
        }
        let index = self.index_at(path);
        let before = index.saturating_sub(1);
        let [from, to] = [self.path[before], self.path[index]];
        if to == from {
            return self.side_of(index);
        }
        let share = ((path - from) / (to - from)).clamp(0.0, 1.0);
        self.side_of(before) * (1.0 - share) + self.side_of(index) * share
    }

    /// Range of the path parameter.
    pub(super) fn path_range(&self) -> Option<[f64; 2]> {
        let (first, last) = (*self.path.first()?, *self.path.last()?);
        Some([first.min(last), first.max(last)])
    }

    /// Adds a sample; `left_out_nm`: largest distance of those left out before it from the chord to it.
    fn push(&mut self, sample: &LeftOut, left_out_nm: f64) {
        let periods = sample.tick.saturating_sub(self.first_tick);
        self.periods.push(u32::try_from(periods).unwrap_or(u32::MAX));
        self.path.push(sample.path);
        self.cl_nm.push(sample.cl_nm);
        self.left_out_nm.resize(self.cl_nm.len() - 1, 0.0);
        #[allow(clippy::cast_possible_truncation, reason = "a bound of a few digits")]
        self.left_out_nm.push(left_out_nm as f32);
        self.add_side(sample.side);
    }

    /// Largest distance of the samples left out between a sample and the next one from the chord between them, mm.
    pub(super) fn left_out_mm(&self, index: usize) -> f64 {
        let left_out_nm = self.left_out_nm.get(index + 1).copied().unwrap_or(0.0);
        f64::from(left_out_nm) * MM_PER_NM
    }

    /// Adds the side parameter of the sample that was added last.
    fn add_side(&mut self, side: f64) {
        if self.sides.is_empty() && side != self.side {
            self.sides = vec![self.side; self.path.len().saturating_sub(1)];
        }
        if !self.sides.is_empty() || side != self.side {
            self.sides.push(side);
        }
    }

    /// The first sample, in the order of the pass, whose path parameter reaches this one.
    pub(super) fn index_at(&self, path: f64) -> usize {
        let backwards = self.path.first() > self.path.last();
        let before = |at: &f64| if backwards { *at > path } else { *at < path };
        self.path
            .partition_point(before)
            .min(self.path.len().saturating_sub(1))
    }

    /// Mean distance between samples, mm.
    pub(super) fn spacing_mm(&self) -> f64 {
        let count = self.cl_nm.len().saturating_sub(1);
        let sum: f64 = (0..count)
            .map(|k| self.centre(k + 1).distance(self.centre(k)))
            .sum();
        #[allow(clippy::cast_precision_loss, reason = "far below 2^53")]
        let count = count.max(1) as f64;
        sum / count
    }

    /// Appends a sample of another pass.
    pub(super) fn copy(&mut self, of: &Self, index: usize) {
        self.periods.push(of.periods[index]);
        self.path.push(of.path[index]);
        self.cl_nm.push(of.cl_nm[index]);
        self.add_side(of.side_of(index));
    }

    /// Appends a point between a sample of another pass and its next one.
    pub(super) fn add_between(&mut self, of: &Self, index: usize, share: f64, centre_mm: DVec3) {
        let [from, to] = [of.path[index], of.path[index + 1]];
        self.periods.push(of.periods[index]);
        self.path.push(from + (to - from) * share);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "between positions that are 32 bits"
        )]
        let cl_nm = (centre_mm / MM_PER_NM).round().to_array().map(|nm| nm as i32);
        self.cl_nm.push(cl_nm);
        let [from, to] = [of.side_of(index), of.side_of(index + 1)];
        self.add_side(from + (to - from) * share);
    }

    /// Tick of a sample.
    pub(super) fn tick(&self, index: usize) -> u64 {
        self.first_tick + u64::from(self.periods[index])
    }
}

/// A sample that is not stored, or not yet.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LeftOut {
    tick: u64,
    path: f64,
    side: f64,
    cl_nm: [i32; 3],
}

/// The tool path of a run: written sample by sample, then read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolPath {
    /// The passes, in order.
    pub passes: Vec<ToolPathPass>,
    /// Minimum distance of stored samples, nm: nearer ones are left out where the path is straight, except the last of a pass. At low
    /// feed the samples are denser than needed.
    spacing_nm: f64,
    /// Greatest distance of a sample left out from the chord that takes its place, nm.
    bend_nm: f64,
    /// The samples since the last stored one.
    left_out: Vec<LeftOut>,
    /// The last centre of a turn, and the boundary there: it belongs to the pass that follows.
    lead_in: Option<([i32; 3], f64)>,
    /// The first centre of a turn, likewise: it belongs to the pass before.
    lead_out: Option<([i32; 3], f64)>,
}

impl ToolPath {
    /// An empty path for measuring a job. Without limits it keeps every sample. With limits the feed is low at the ends of passes, and where an axis is slow: on straight
    /// parts it leaves out samples closer than half the step at the feed, or at the largest speed of the axes where that is less.
    #[must_use]
    pub fn of_job(job: &Job) -> Self {
        let spacing_mm = job.machine.limits.map_or(0.0, |limits| {
            let axes_mm_s = DVec3::from(limits.velocity_mm_s).length();
            SPACING_SHARE * job.feed_mm_s().min(axes_mm_s) * job.machine.period_s()
        });
        Self::with_spacing(spacing_mm * NM_PER_MM, job.scallop_mm)
    }

    /// An empty path with this minimum distance of samples on straight parts, nm, for measuring scallops of this height.
    #[must_use]
    pub fn with_spacing(spacing_nm: f64, scallop_mm: f64) -> Self {
        Self {
            spacing_nm,
            bend_nm: (CHORD_SHARE * scallop_mm * NM_PER_MM).max(BEND_MIN_NM),
            ..Self::default()
        }
    }

    /// Adds the next sample. Returns whether it was stored: it is not where it is near the last one on a straight part. The one left out before may be stored with it, or instead of it.
    pub fn add(&mut self, sample: &PassSample, along: Along) -> bool {
        let (path, side) = match along {
            Along::U => (sample.u, sample.v),
            Along::V => (sample.v, sample.u),
        };
        if sample.first_of_pass || self.passes.is_empty() {
            self.begin_pass(side, sample.tick);
        }
        let here = LeftOut {
            tick: sample.tick,
            path,
            side,
            cl_nm: sample.cl_nm,
        };
        let Some(pass) = self.passes.last_mut() else {
            return false;
        };
        let mut bend_nm = off_chord_nm(pass, &self.left_out, here.cl_nm);
        if bend_nm > self.bend_nm
            && let Some((before, others)) = self.left_out.split_last()
        {
            // The path is straight up to the sample before.
            pass.push(before, off_chord_nm(pass, others, before.cl_nm));
            self.left_out.clear();
            bend_nm = 0.0;
        }
        let is_near = pass.cl_nm.last().is_some_and(|last| {
            !sample.first_of_pass && place(*last).distance(place(here.cl_nm)) < self.spacing_nm
        });
        if is_near && self.left_out.len() < LEFT_OUT_MAX && !sample.last_of_pass {
            // A standing tool takes one place, however long.
            if self
                .left_out
                .last()
                .is_some_and(|before| before.cl_nm == here.cl_nm)
            {
                self.left_out.pop();
            }
            self.left_out.push(here);
            return false;
        }
        pass.push(&here, bend_nm);
        self.left_out.clear();
        if sample.last_of_pass
            && let Some((cl_nm, boundary)) = self.lead_out.take()
        {
            self.push_turn(cl_nm, boundary);
        }
        true
    }

    /// Begins a pass.
    fn begin_pass(&mut self, side: f64, first_tick: u64) {
        self.left_out.clear();
        // Neighbouring passes have similar lengths.
        let room = self
            .passes
            .last()
            .map_or(0, |pass| pass.path.len() + pass.path.len() / 64);
        self.passes.push(ToolPathPass {
            side,
            sides: Vec::new(),
            first_tick,
            periods: Vec::with_capacity(room),
            path: Vec::with_capacity(room),
            cl_nm: Vec::with_capacity(room),
            left_out_nm: Vec::with_capacity(room),
        });
        if let Some((cl_nm, boundary)) = self.lead_in.take() {
            self.push_turn(cl_nm, boundary);
        }
    }

    /// Adds a centre of a turn next to the pass that it leaves, as its end at the boundary.
    pub fn leave(&mut self, cl_nm: [i32; 3], boundary: f64) {
        self.lead_out = Some((cl_nm, boundary));
    }

    /// Adds a centre of a turn next to the pass that it leads to, as its start at the boundary.
    pub fn enter(&mut self, cl_nm: [i32; 3], boundary: f64) {
        self.lead_in = Some((cl_nm, boundary));
    }

    fn push_turn(&mut self, cl_nm: [i32; 3], boundary: f64) {
        if let Some(pass) = self.passes.last_mut() {
            let periods = pass.periods.last().map_or(0, |last| last.saturating_add(1));
            pass.periods.push(periods);
            pass.path.push(boundary);
            pass.cl_nm.push(cl_nm);
        }
    }

    /// Adds the next centre of a motion without parameters; `first`: the tool was off the surface before.
    pub fn add_centre(&mut self, cl_nm: [i32; 3], first: bool) {
        if first || self.passes.is_empty() {
            self.passes.push(ToolPathPass::default());
        }
        if let Some(pass) = self.passes.last_mut() {
            pass.periods
                .push(u32::try_from(pass.periods.len()).unwrap_or(u32::MAX));
            pass.path.push(0.0);
            pass.cl_nm.push(cl_nm);
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.passes.iter().map(|pass| pass.path.len()).sum()
    }

    /// Least and largest position of each axis, mm; `None` without samples.
    #[must_use]
    pub fn extent_mm(&self) -> Option<[[f64; 2]; 3]> {
        let mut extent: Option<[[i32; 2]; 3]> = None;
        for centre in self.passes.iter().flat_map(|pass| &pass.cl_nm) {
            let extent = extent.get_or_insert(centre.map(|nm| [nm; 2]));
            for (range, nm) in extent.iter_mut().zip(centre) {
                *range = [range[0].min(*nm), range[1].max(*nm)];
            }
        }
        extent.map(|extent| extent.map(|range| range.map(|nm| f64::from(nm) * MM_PER_NM)))
    }
}

/// A centre, nm.
fn place(cl_nm: [i32; 3]) -> DVec3 {
    DVec3::from(cl_nm.map(f64::from))
}

/// Largest distance of samples from the chord from the last one of a pass to a centre, nm.
fn off_chord_nm(pass: &ToolPathPass, samples: &[LeftOut], to_nm: [i32; 3]) -> f64 {
    let Some(from) = pass.cl_nm.last().map(|last| place(*last)) else {
        return 0.0;
    };
    let way = place(to_nm) - from;
    let squared = way.length_squared().max(f64::MIN_POSITIVE);
    let off = |sample: &LeftOut| {
        let at = place(sample.cl_nm) - from;
        at.distance_squared(way * (at.dot(way) / squared).clamp(0.0, 1.0))
    };
    samples.iter().map(off).fold(0.0, f64::max).sqrt()
}

/// The component of a vector normal to a unit direction.
pub(super) fn across(m: DVec3, direction: DVec3) -> DVec3 {
    m - direction * m.dot(direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The path that is stored of centres, mm, and the largest distance of one of them from it, mm.
    fn stored(centres: &[DVec3]) -> (usize, f64) {
        let mut track = ToolPath::with_spacing(10_000.0, 0.01);
        for (tick, centre) in (0_u32..).zip(centres) {
            let cl_nm = (*centre * NM_PER_MM).to_array().map(|nm| nm.round() as i32);
            let sample = PassSample {
                tick: u64::from(tick),
                pass: 0,
                u: f64::from(tick),
                v: 0.0,
                cc_nm: cl_nm,
                cl_nm,
                feed_mm_s: 1.0,
                interval: 0.0,
                first_of_pass: tick == 0,
                last_of_pass: tick as usize + 1 == centres.len(),
            };
            track.add(&sample, Along::U);
        }
        let pass = &track.passes[0];
        let chords: Vec<[DVec3; 2]> = (1..pass.cl_nm.len())
            .map(|k| [pass.centre(k - 1), pass.centre(k)])
            .collect();
        let off = |centre: &DVec3| {
            let distance = |[from, to]: &[DVec3; 2]| {
                let way = *to - *from;
                let share = ((*centre - *from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
                centre.distance(*from + way * share)
            };
            chords.iter().map(distance).fold(f64::INFINITY, f64::min)
        };
        (pass.cl_nm.len(), centres.iter().map(off).fold(0.0, f64::max))
    }

    /// A ball that hardly fits creeps around the bends of its centre's path: the samples there are the path, however close they are.
    #[test]
    fn samples_are_left_out_on_straight_parts_alone() {
        let leg = |from: DVec3, turn_deg: f64| {
            let direction = DVec3::new(turn_deg.to_radians().cos(), turn_deg.to_radians().sin(), 0.0);
            (1..=97).map(move |k| from + direction * (0.001 * f64::from(k)))
        };
        for turn_deg in [0.0, 3.0, 30.0, 80.0, 180.0] {
            let mut centres: Vec<DVec3> = leg(DVec3::ZERO, 0.0).collect();
            centres.extend(leg(centres[96], turn_deg));
            let (count, off) = stored(&centres);
            assert!(count < 45, "{count} samples at {turn_deg} degrees");
            // Up to the first sample after the corner that is off the line; half a step where the path goes straight back.
            assert!(
                off < if turn_deg < 180.0 { 4e-5 } else { 1e-3 },
                "{off} mm at {turn_deg} degrees"
            );
        }
    }
}
