//! The tool path of a run in compact form: 24 bytes per sample.

use super::CHORD_SHARE;
use glam::DVec3;
use job::Along;
use job::units::{MM_PER_NM, NM_PER_MM};
use oracle::PassSample;

/// A sample farther than this share of the scallop limit from the line through the stored samples is stored: twice the deviation that chords have anyway.
const BEND_SHARE: f64 = 2.0 * CHORD_SHARE;
/// Least deviation from the line at which a sample is stored, nm: rounding of the centres bends a straight line by less.
const BEND_MIN_NM: f64 = 4.0;

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

    fn push(&mut self, tick: u64, path: f64, side: f64, cl_nm: [i32; 3]) {
        self.periods
            .push(u32::try_from(tick.saturating_sub(self.first_tick)).unwrap_or(u32::MAX));
        self.path.push(path);
        self.cl_nm.push(cl_nm);
        self.add_side(side);
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

/// A sample that is not stored.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LeftOut {
    tick: u64,
    path: f64,
    side: f64,
    cl_nm: [i32; 3],
    /// Its distance from the last stored one.
    apart_nm: f64,
}

/// Where a sample is with respect to those stored.
#[derive(Clone, Copy)]
enum Placement {
    /// Nearer to the last one than the minimum distance, nm, in the direction in which that was reached.
    Near(f64),
    /// Farther in that direction.
    Far,
    /// In another direction.
    Beside,
}

/// The tool path of a run: written sample by sample, then read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolPath {
    /// The passes, in order.
    pub passes: Vec<ToolPathPass>,
    /// Minimum distance of stored samples, nm: nearer ones are left out where the path is straight, except the last of a pass. At low
    /// feed the samples are denser than needed.
    spacing_nm: f64,
    /// Greatest distance from the straight line of one left out, nm.
    bend_nm: f64,
    /// The sample before, if it is not stored.
    left_out: Option<LeftOut>,
    /// The last centre of a turn, and the boundary there: it belongs to the pass that follows.
    lead_in: Option<([i32; 3], f64)>,
    /// The first centre of a turn, likewise: it belongs to the pass before.
    lead_out: Option<([i32; 3], f64)>,
}

impl ToolPath {
    /// An empty path with this minimum distance of samples on straight parts, nm, for measuring scallops of this height.
    #[must_use]
    pub fn with_spacing(spacing_nm: f64, scallop_mm: f64) -> Self {
        Self {
            spacing_nm,
            bend_nm: (BEND_SHARE * scallop_mm * NM_PER_MM).max(BEND_MIN_NM),
            ..Self::default()
        }
    }

    /// Where a sample is with respect to those stored.
    fn placement(&self, sample: &PassSample) -> Placement {
        let Some(pass) = self.passes.last().filter(|_| !sample.first_of_pass) else {
            return Placement::Far;
        };
        let Some(last) = pass.cl_nm.len().checked_sub(1) else {
            return Placement::Far;
        };
        let stored = |index: usize| DVec3::from(pass.cl_nm[index].map(f64::from));
        let by = DVec3::from(sample.cl_nm.map(f64::from)) - stored(last);
        let apart = by.length();
        let recedes = self.left_out.is_none_or(|left_out| apart >= left_out.apart_nm);
        let direction = last.checked_sub(1).map_or(DVec3::ZERO, |before| {
            (stored(last) - stored(before)).normalize_or_zero()
        });
        let is_straight = direction == DVec3::ZERO || by.distance(direction * apart) <= self.bend_nm;
        if !is_straight || !recedes {
            Placement::Beside
        } else if apart < self.spacing_nm {
            Placement::Near(apart)
        } else {
            Placement::Far
        }
    }

    /// Adds the next sample. Returns whether it was stored: it is not where it is near the last one on a straight part. The one left out before may be stored with it.
    pub fn add(&mut self, sample: &PassSample, along: Along) -> bool {
        let (path, side) = match along {
            Along::U => (sample.u, sample.v),
            Along::V => (sample.v, sample.u),
        };
        if sample.first_of_pass || self.passes.is_empty() {
            // Neighbouring passes have similar lengths.
            let room = self
                .passes
                .last()
                .map_or(0, |pass| pass.path.len() + pass.path.len() / 64);
            self.passes.push(ToolPathPass {
                side,
                sides: Vec::new(),
                first_tick: sample.tick,
                periods: Vec::with_capacity(room),
                path: Vec::with_capacity(room),
                cl_nm: Vec::with_capacity(room),
            });
            if let Some((cl_nm, boundary)) = self.lead_in.take() {
                self.push_turn(cl_nm, boundary);
            }
        }
        let placement = self.placement(sample);
        if let (Placement::Near(apart_nm), false) = (placement, sample.last_of_pass) {
            self.left_out = Some(LeftOut {
                tick: sample.tick,
                path,
                side,
                cl_nm: sample.cl_nm,
                apart_nm,
            });
            return false;
        }
        let left_out = self.left_out.take();
        if let Some(pass) = self.passes.last_mut() {
            // The path is straight up to the sample before.
            if let (Placement::Beside, Some(before)) = (placement, left_out) {
                pass.push(before.tick, before.path, before.side, before.cl_nm);
            }
            pass.push(sample.tick, path, side, sample.cl_nm);
        }
        if sample.last_of_pass
            && let Some((cl_nm, boundary)) = self.lead_out.take()
        {
            self.push_turn(cl_nm, boundary);
        }
        true
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
            // Up to the first sample behind the corner that is off the line; half a step where the path goes straight back.
            assert!(
                off < if turn_deg < 180.0 { 4e-5 } else { 1e-3 },
                "{off} mm at {turn_deg} degrees"
            );
        }
    }
}
