//! The ridge between two neighbouring passes: the highest point across the gap, at stations along the gap.

use std::collections::BTreeMap;

use super::height::{PassHeight, Ray};
use super::tree::PathTree;
use glam::DVec3;
use oracle::{Oracle, OracleError};

/// Points across a gap, and across each part of it between knots, at which the height is evaluated besides the crest.
const ACROSS: usize = 8;
/// [`ACROSS`] where other parts of the path lower the crest.
const ACROSS_WHOLE: usize = 32;
/// Initial number of stations along a gap.
const STATIONS: usize = 96;
/// Least initial number of stations along a short gap.
const STATIONS_MIN: usize = 6;
/// Largest number of bisections of the intervals between stations, and the number after which they go on only where the error bound is
/// above its requirement.
const HALVINGS_MAX: usize = 30;
const HALVINGS: usize = 10;
/// Largest number of stations of a gap.
const STATIONS_MAX: usize = 50_000;
/// Required error bound of a gap's ridge, as a share of the scallop limit: half of [`super::ERROR_SHARE_MAX`].
const REQUIRED_SHARE: f64 = 0.5 * super::ERROR_SHARE_MAX;
/// Heights that differ by at most this share of the gap's largest height are equal.
const EQUAL_SHARE: f64 = 1e-4;
/// Heights that differ by at most this are equal, mm: the rounding of centres to nanometres.
const EQUAL_MM: f64 = 2e-6;
/// Parts of a gap between curved passes; those that lie within the region are measured.
const SERVED_PARTS: u32 = 64;
/// Bisections of the ends of a measured stretch.
const SERVED_HALVINGS: u32 = 12;
/// Places across the gap that must be within the region, as shares of its width.
const SERVED_SHARES: [f64; 3] = [0.1, 0.5, 0.9];

/// A crest lowered by another part of the path to less than this below the surface, mm, is not searched further.
const GOUGED_MM: f64 = 1e-4;
/// Largest number of iterations of the crest search; three or four are usual.
const CREST_STEPS: usize = 60;
/// The two heights at the crest agree within this, mm.
const CREST_MM: f64 = 1e-8;
/// Golden-section steps for a maximum where the two heights differ.
const GOLDEN_STEPS: usize = 40;
const GOLDEN: f64 = 0.618_033_988_749_894_8;
/// Height of a point whose ray misses both swept balls, in radii: above every measured height.
pub const MISSED_RADII: f64 = 4.0;

/// The highest point across a gap at one station.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crest {
    /// Path parameter.
    pub(super) path: f64,
    /// Share of the gap, from the first pass.
    pub(super) share: f64,
    /// Height, mm.
    pub(super) height_mm: f64,
    /// Point on the surface, mm.
    pub(super) point_mm: DVec3,
    /// |S_u x S_v| there.
    pub(super) area: f64,
    /// Whether another part of the path than the gap's two passes lowers the crest.
    pub(super) lowered: bool,
}

/// Result of one gap.
#[derive(Clone, Debug)]
pub(super) struct GapRidge {
    pub(super) crests: Vec<Crest>,
    /// Upper bound of the excess of a crest between stations over the highest one found, mm.
    pub(super) excess_mm: f64,
    /// Stations left out because the surface has no normal there.
    pub(super) skipped: u32,
}

/// The gap between two passes.
pub(super) struct Gap<'a> {
    oracle: &'a Oracle,
    passes: [PassHeight<'a>; 2],
    tree: &'a PathTree<'a>,
    sides: [f64; 2],
    /// Indices of the passes.
    pub(super) indices: [usize; 2],
    /// Range of the path parameter of a gap between curved passes, or between passes of a region.
    range: Option<[f64; 2]>,
    /// Shares of the gap that are evaluated, 0 and 1 among them.
    across: Vec<f64>,
    missed: f64,
}

impl<'a> Gap<'a> {
    pub(super) fn new(
        oracle: &'a Oracle,
        passes: [PassHeight<'a>; 2],
        indices: [usize; 2],
        range: Option<[f64; 2]>,
        tree: &'a PathTree<'a>,
    ) -> Self {
        let sides = passes.map(|pass| pass.pass().side);
        let width = sides[1] - sides[0];
        let mut ends = vec![0.0];
        for at in oracle.surface.breaks(oracle.across()) {
            let share = (at - sides[0]) / width;
            if !oracle.spacing.is_constant() && share > 1e-9 && share < 1.0 - 1e-9 {
                ends.push(share);
            }
        }
        ends.push(1.0);
        let mut across = vec![0.0];
        #[allow(clippy::cast_precision_loss, reason = "small")]
        for part in ends.windows(2) {
            across.extend((1..=ACROSS).map(|k| part[0] + (part[1] - part[0]) * k as f64 / ACROSS as f64));
        }
        Self {
            oracle,
            passes,
            tree,
            sides,
            indices,
            range,
            across,
            missed: MISSED_RADII * oracle.radius_mm,
        }
    }

    /// The ray from a point of the gap, and |S_u x S_v| there.
    fn ray(&self, path: f64, share: f64) -> Result<(Ray, f64), OracleError> {
        let (u, v) = self.oracle.swapped(path, self.side(path, share));
        let at = self.oracle.surface.at(u, v);
        let ray = Ray {
            from: at.point,
            along: self.oracle.normal(&at, u, v)?,
        };
        Ok((ray, at.u.cross(at.v).length()))
    }

    pub(super) fn side(&self, path: f64, share: f64) -> f64 {
        let [from, to] = match self.range {
            Some(_) => self.passes.map(|pass| pass.pass().side_at(path)),
            None => self.sides,
        };
        // Exact at both ends.
        from * (1.0 - share) + to * share
    }

    /// All gaps between passes: each pass and the next one, or of curved passes that which is next to it at each path parameter.
    pub(super) fn all(oracle: &'a Oracle, heights: &[PassHeight<'a>], tree: &'a PathTree<'a>) -> Vec<Self> {
        if oracle.region.is_some() && !oracle.spacing.is_constant() {
            return Self::within_region(oracle, heights, tree);
        }
        if !oracle.spacing.is_constant() {
            let pairs = heights.windows(2).enumerate();
            return pairs
                .map(|(k, pair)| Self::new(oracle, [pair[0], pair[1]], [k, k + 1], None, tree))
                .collect();
        }
        let ranges: Vec<Option<[f64; 2]>> = heights.iter().map(|height| height.pass().path_range()).collect();
        let mut ends: Vec<f64> = ranges.iter().flatten().flatten().copied().collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        let mut open: BTreeMap<[usize; 2], [f64; 2]> = BTreeMap::new();
        let mut found: Vec<([usize; 2], [f64; 2])> = Vec::new();
        for part in ends.windows(2) {
            let middle = 0.5 * (part[0] + part[1]);
            let covers =
                |range: &Option<[f64; 2]>| range.is_some_and(|[low, high]| low < middle && middle < high);
            let mut here: Vec<usize> = (0..heights.len()).filter(|k| covers(&ranges[*k])).collect();
            let side = |k: &usize| heights[*k].pass().side_at(middle);
            here.sort_by(|a, b| side(a).total_cmp(&side(b)));
            let pairs: Vec<[usize; 2]> = here.windows(2).map(|pair| [pair[0], pair[1]]).collect();
            open.retain(|pair, range| {
                let goes_on = pairs.contains(pair);
                if !goes_on {
                    found.push((*pair, *range));
                }
                goes_on
            });
            for pair in pairs {
                open.entry(pair).or_insert([part[0], part[1]])[1] = part[1];
            }
        }
        found.extend(open);
        found.sort_by(|a, b| a.0.cmp(&b.0).then(a.1[0].total_cmp(&b.1[0])));
        found
            .into_iter()
            .flat_map(|(pair, range)| {
                let whole = Self::new(oracle, pair.map(|k| heights[k]), pair, Some(range), tree);
                let ranges = if oracle.region.is_some() {
                    whole.served(range)
                } else {
                    vec![range]
                };
                ranges
                    .into_iter()
                    .map(move |range| Self::new(oracle, pair.map(|k| heights[k]), pair, Some(range), tree))
            })
            .collect()
    }

    /// The parts of a range of the path in which the gap between two curved passes is in the region, away from its boundary.
    fn served(&self, [low, high]: [f64; 2]) -> Vec<[f64; 2]> {
        let is_served = |path: f64| {
            let at = |share: f64| self.oracle.swapped(path, self.side(path, share));
            SERVED_SHARES
                .iter()
                .all(|share| self.oracle.is_served(at(*share).0, at(*share).1))
        };
        let place = |k: u32| low + (high - low) * f64::from(k) / f64::from(SERVED_PARTS);
        let edge = |mut outside: f64, mut inside: f64| {
            for _ in 0..SERVED_HALVINGS {
                let middle = 0.5 * (outside + inside);
                if is_served(middle) {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            inside
        };
        let mut ranges: Vec<[f64; 2]> = Vec::new();
        let mut start = is_served(low).then_some(low);
        for k in 1..=SERVED_PARTS {
            let (before, at) = (place(k - 1), place(k));
            match (start, is_served(at)) {
                (None, true) => start = Some(edge(before, at)),
                (Some(from), false) => {
                    ranges.push([from, edge(at, before)]);
                    start = None;
                }
                _ => {}
            }
        }
        ranges.extend(start.map(|from| [from, high]));
        ranges.retain(|[from, to]| from < to);
        ranges
    }

    /// The gaps of a region: between the passes of neighbouring lines, where they are beside each other. Beside the region's boundary the last ball stands at the end
    /// of a pass, so half a step-over of it is left out.
    fn within_region(oracle: &'a Oracle, heights: &[PassHeight<'a>], tree: &'a PathTree<'a>) -> Vec<Self> {
        let lines: Vec<&[PassHeight<'a>]> = heights.chunk_by(|a, b| a.pass().side == b.pass().side).collect();
        let mut gaps = Vec::new();
        let mut first = 0;
        for pair in lines.windows(2) {
            let second = first + pair[0].len();
            // The next cell begins below where the last one ended.
            if pair[1][0].pass().side < pair[0][0].pass().side {
                first = second;
                continue;
            }
            for (i, near) in pair[0].iter().enumerate() {
                for (j, far) in pair[1].iter().enumerate() {
                    if let Some(range) = beside(oracle, [near, far]) {
                        gaps.push(Self::new(
                            oracle,
                            [*near, *far],
                            [first + i, second + j],
                            Some(range),
                            tree,
                        ));
                    }
                }
            }
            first = second;
        }
        gaps
    }

    /// Heights of both passes at a point.
    fn both(&self, path: f64, share: f64, near: &mut [usize; 2]) -> Result<[f64; 2], OracleError> {
        let (ray, _) = self.ray(path, share)?;
        let mut heights = [0.0; 2];
        for (k, pass) in self.passes.iter().enumerate() {
            let (height, index) = pass.of(&ray, near[k]);
            near[k] = index;
            heights[k] = height.min(self.missed);
        }
        Ok(heights)
    }

    /// Height at a point: of the two passes, or of the whole path.
    fn least(&self, path: f64, share: f64, near: &mut [usize; 2], whole: bool) -> Result<f64, OracleError> {
        let [one, other] = self.both(path, share, near)?;
        let least = one.min(other);
        if !whole {
            return Ok(least);
        }
        Ok(self.tree.entry(&self.ray(path, share)?.0, least))
    }

    /// The crest at a station; `guess`: its share of the gap at a neighbouring station.
    pub(super) fn crest(&self, path: f64, guess: f64) -> Result<Crest, OracleError> {
        let mut near = self.passes.map(|pass| pass.pass().index_at(path));
        let met = self.meeting(path, guess, &mut near)?;
        let (mut share, mut height) = self.highest(path, met, &mut near)?;
        let whole = self.tree.entry(&self.ray(path, share)?.0, height);
        let lowered = whole < height - EQUAL_MM;
        if whole < -GOUGED_MM {
            // The crest is below the surface: reported by the gouge search.
            height = whole;
        } else if lowered {
            // Another part of the path lowers this crest: the maximum is elsewhere.
            (share, height) = self.highest_of_whole(path, (share, whole), &mut near)?;
        }
        let (ray, area) = self.ray(path, share)?;
        Ok(Crest {
            path,
            share,
            height_mm: height,
            point_mm: ray.from,
            area,
            lowered,
        })
    }

    /// The highest point across the gap under its two passes, if it is above the one found already.
    fn highest(
        &self,
        path: f64,
        found: (f64, f64),
        near: &mut [usize; 2],
    ) -> Result<(f64, f64), OracleError> {
        let mut highest = (0, f64::NEG_INFINITY);
        for (k, at) in self.across.iter().enumerate() {
            let (ray, _) = self.ray(path, *at)?;
            let mut least = self.missed;
            for (pass, near) in self.passes.iter().zip(near.iter_mut()) {
                let (height, index) = pass.about(&ray, *near);
                *near = index;
                least = least.min(height);
            }
            // A close search only where it can raise the maximum.
            if least > found.1.max(highest.1) {
                least = self.least(path, *at, near, false)?;
            }
            if least > highest.1 {
                highest = (k, least);
            }
        }
        if highest.1 <= found.1 {
            return Ok(found);
        }
        let low = self.across[highest.0.saturating_sub(1)];
        let high = self.across[(highest.0 + 1).min(self.across.len() - 1)];
        self.golden_maximum(
            path,
            [low, high],
            (self.across[highest.0], highest.1),
            near,
            false,
        )
    }

    /// The highest point across the gap under the whole path: the best of the local maxima, each of which is one between two parts of the path.
    fn highest_of_whole(
        &self,
        path: f64,
        found: (f64, f64),
        near: &mut [usize; 2],
    ) -> Result<(f64, f64), OracleError> {
        let share = |k: usize| {
            #[allow(clippy::cast_precision_loss, reason = "small")]
            let share = k as f64 / ACROSS_WHOLE as f64;
            share
        };
        let heights: Vec<f64> = (0..=ACROSS_WHOLE)
            .map(|k| self.least(path, share(k), near, true))
            .collect::<Result<_, _>>()?;
        let at = |k: Option<usize>| {
            k.and_then(|k| heights.get(k))
                .copied()
                .unwrap_or(f64::NEG_INFINITY)
        };
        let mut best = found;
        for (k, height) in heights.iter().enumerate() {
            if *height < at(k.checked_sub(1)) || *height < at(Some(k + 1)) {
                continue;
            }
            let bracket = [share(k.saturating_sub(1)), share((k + 1).min(ACROSS_WHOLE))];
            let top = self.golden_maximum(path, bracket, (share(k), *height), near, true)?;
            if top.1 > best.1 {
                best = top;
            }
        }
        Ok(best)
    }

    /// The point where both heights agree (regula falsi, Illinois variant; bisection where a ray misses).
    fn meeting(&self, path: f64, guess: f64, near: &mut [usize; 2]) -> Result<(f64, f64), OracleError> {
        let mut ends = [0.0, 1.0];
        let mut values = [0.0; 2];
        let mut best = (0.0, f64::NEG_INFINITY);
        for k in 0..2 {
            let [one, other] = self.both(path, ends[k], near)?;
            values[k] = one - other;
            if one.min(other) > best.1 {
                best = (ends[k], one.min(other));
            }
        }
        if values[0] >= 0.0 || values[1] <= 0.0 {
            return Ok(best);
        }
        let mut share = guess.clamp(0.01, 0.99);
        for _ in 0..CREST_STEPS {
            let [one, other] = self.both(path, share, near)?;
            let apart = one - other;
            if one.min(other) > best.1 {
                best = (share, one.min(other));
            }
            if apart.abs() <= CREST_MM {
                break;
            }
            let k = usize::from(apart > 0.0);
            (ends[k], values[k]) = (share, apart);
            let missed = values.iter().any(|value| value.abs() >= 0.5 * self.missed);
            let width = ends[1] - ends[0];
            if width < 1e-14 {
                break;
            }
            share = if missed {
                0.5 * (ends[0] + ends[1])
            } else {
                ends[0] - values[0] * width / (values[1] - values[0])
            };
            // Illinois: the retained end counts half in the next step.
            values[1 - k] *= 0.5;
        }
        Ok(best)
    }

    /// The highest point in a bracket, by golden section.
    fn golden_maximum(
        &self,
        path: f64,
        [mut low, mut high]: [f64; 2],
        found: (f64, f64),
        near: &mut [usize; 2],
        whole: bool,
    ) -> Result<(f64, f64), OracleError> {
        let mut best = found;
        let mut value = |share: f64| self.least(path, share, near, whole);
        let (mut left, mut right) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        let (mut at_left, mut at_right) = (value(left)?, value(right)?);
        for _ in 0..GOLDEN_STEPS {
            for (share, height) in [(left, at_left), (right, at_right)] {
                if height > best.1 {
                    best = (share, height);
                }
            }
            if at_left > at_right {
                (high, right, at_right) = (right, left, at_left);
                left = high - GOLDEN * (high - low);
                at_left = value(left)?;
            } else {
                (low, left, at_left) = (left, right, at_right);
                right = low + GOLDEN * (high - low);
                at_right = value(right)?;
            }
            if (at_left - at_right).abs() <= CREST_MM && high - low < 1e-3 {
                break;
            }
        }
        Ok(best)
    }

    /// The initial stations: knots, and equal shares of the parameter and of the second pass's length.
    fn stations(&self) -> Vec<f64> {
        let whole = self.oracle.path_range();
        let [low, high] = self.range.unwrap_or(whole);
        let mut stations = self.oracle.surface.breaks(self.oracle.along);
        let samples = &self.passes[1].pass().path;
        #[allow(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small"
        )]
        let count = ((high - low) / (whole[1] - whole[0]) * STATIONS as f64).ceil() as usize;
        let count = count.clamp(STATIONS_MIN, STATIONS);
        #[allow(clippy::cast_precision_loss, reason = "small")]
        for k in 0..=count {
            stations.push(low + (high - low) * k as f64 / count as f64);
            stations.push(samples[k * (samples.len() - 1) / count]);
        }
        stations.retain(|at| (low..=high).contains(at));
        stations.sort_by(f64::total_cmp);
        let nearest = 1e-5 * (high - low);
        stations.dedup_by(|b, a| *b - *a < nearest && (*b < high || *a == high));
        stations
    }

    /// The whole ridge.
    pub(super) fn ridge(&self) -> GapRidge {
        let mut crests: Vec<Crest> = Vec::new();
        let mut skipped = 0;
        for path in self.stations() {
            let guess = crests.last().map_or(0.5, |crest| crest.share);
            match self.crest(path, guess) {
                Ok(crest) => crests.push(crest),
                Err(_) => skipped += 1,
            }
        }
        let intervals = |crests: &[Crest]| crests.len().saturating_sub(1);
        for round in 0..HALVINGS_MAX {
            let best = highest(&crests);
            let required = if round < HALVINGS {
                EQUAL_SHARE * best
            } else {
                REQUIRED_SHARE * self.oracle.scallop_mm
            };
            let enough = best + required.max(EQUAL_MM);
            let mut refined = Vec::with_capacity(crests.len() + 16);
            for k in 0..intervals(&crests) {
                refined.push(crests[k]);
                if bound(&crests, k) > enough {
                    let path = 0.5 * (crests[k].path + crests[k + 1].path);
                    refined.extend(self.crest(path, crests[k].share));
                }
            }
            refined.extend(crests.last());
            let done = refined.len() == crests.len() || refined.len() > STATIONS_MAX;
            crests = refined;
            if done {
                break;
            }
        }
        let best = highest(&crests);
        let most = (0..intervals(&crests))
            .map(|k| bound(&crests, k))
            .fold(best, f64::max);
        GapRidge {
            excess_mm: if crests.is_empty() { 0.0 } else { most - best },
            crests,
            skipped,
        }
    }
}

/// Range of the path parameter in which two passes of a region lie beside each other. Ends that are not on the surface's boundary are left out, because there one pass may be
/// ahead of the other at the same parameter.
fn beside(oracle: &Oracle, passes: [&PassHeight<'_>; 2]) -> Option<[f64; 2]> {
    let ends = [passes[0].pass().path_range()?, passes[1].pass().path_range()?];
    let sides = passes.map(|pass| pass.pass().side);
    let side = 0.5 * (sides[0] + sides[1]);
    let boundaries = oracle.path_range();
    // `of`: which pass ends there; `sign`: 1 where it ends, -1 where it starts.
    let inwards = |of: usize, sign: f64| {
        let at = ends[of][usize::from(sign > 0.0)];
        if boundaries.contains(&at) {
            return at;
        }
        let (u, v) = oracle.swapped(at, side);
        let by = oracle.contact(u, v).ok().map(|contact| {
            let surface = oracle.surface.at(u, v);
            let ahead = surface.u.dot(surface.v) / contact.path_speed * (sides[1 - of] - sides[of]);
            (0.5 * contact.step_over_mm + (sign * ahead).max(0.0)) / contact.path_speed
        });
        at - sign * by.filter(|by| by.is_finite()).unwrap_or(0.0)
    };
    let range = [
        inwards(0, -1.0).max(inwards(1, -1.0)),
        inwards(0, 1.0).min(inwards(1, 1.0)),
    ];
    // Where the region, or the cell, ends between them, the lines are not neighbours.
    let of_passes = [(sides[0], ends[0]), (sides[1], ends[1])];
    (range[0] < range[1] && oracle.are_in_one_cell(of_passes, range)).then_some(range)
}

fn highest(crests: &[Crest]) -> f64 {
    crests
        .iter()
        .map(|crest| crest.height_mm)
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Upper bound of the crest between a station and the next: a function with a second derivative of at most `b` exceeds its
/// values at the ends of an interval `d` by at most `b d^2 / 8`. `b` is taken as twice the larger of the two adjacent second
/// differences.
fn bound(crests: &[Crest], k: usize) -> f64 {
    let (a, b) = (&crests[k], &crests[k + 1]);
    let second = |k: usize| {
        let (a, b, c) = (&crests[k - 1], &crests[k], &crests[k + 1]);
        let slope = |a: &Crest, b: &Crest| (b.height_mm - a.height_mm) / (b.path - a.path);
        (2.0 * (slope(b, c) - slope(a, b)) / (c.path - a.path)).abs()
    };
    let before = if k >= 1 { second(k) } else { 0.0 };
    let after = if k + 2 < crests.len() { second(k + 1) } else { 0.0 };
    let width = b.path - a.path;
    a.height_mm.max(b.height_mm) + 2.0 * before.max(after) * width * width / 8.0
}
