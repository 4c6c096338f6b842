//! The plan of one pass: what the look-ahead finds, and the feed that is planned from it.

use crate::feed::Q10_BITS;
use crate::feed::limits::MotionLimits;
use crate::feed::plan::Plan;
use crate::feed::stations::STATIONS_MAX;
use crate::feed::turn::Turn;
use crate::job::program::Job;
use crate::math::number::{MM_PER_NM, to_f32};
use crate::pass::route::Route;
use crate::sample::SpanParameter;
use crate::sequence::link::{Along, BoundaryEnd};

/// Words of a bit for each piece of a pass on a front: intervals between stations, and as many crossings of knots; a stretch beyond begins without its arc noted.
pub(super) const PIECE_WORDS: usize = 20;

/// Greatest distance of two passes between which the tool stays on the boundary, mm, in a job of constant scallop height.
const BESIDE_MM: f32 = 6.0;

/// The plan of one pass: its feed, its ends, and the pass after it.
#[derive(Clone, Debug)]
pub(crate) struct PassPlan {
    pub(crate) plan: Plan,
    pub(crate) pass: u32,
    pub(crate) route: Route,
    /// Cells of a patch (on a front: of a stretch) between kept stations, 0 before the first patch, and the fraction of the patch per cell.
    pub(super) cells: u16,
    /// Those of the first patch, and of the last one and its number, where only a part of it is machined.
    first_cells: u16,
    last_cells: u16,
    last_patch: u16,
    pub(super) cell_fraction: u64,
    /// Patches of a group: where a pass has more than `PATCHES`, the ends of groups are kept, with the greatest derivatives within them.
    pub(super) group: u16,
    /// The pass is a single point; and the normals at it differ, so that the tool stands at its first place alone.
    pub(crate) point: bool,
    pub(crate) is_tip: bool,
    /// The pace at the programmed feed.
    pub(super) full_pace: f32,
    /// Cutter location at start and end, nm, and whether the surface faces up there.
    pub(crate) ends: [[i32; 3]; 2],
    pub(crate) faces_up: [bool; 2],
    /// Side parameter at start and end.
    pub(crate) sides: [SpanParameter; 2],
    /// Of a pass on a front, a bit for each piece with which a stretch begins.
    pub(super) starts: [u32; PIECE_WORDS],
    /// The first station of each stretch; of a straight pass the station at each end of an even cell.
    firsts: [u8; STATIONS_MAX],
    /// Minimum interval of the pass.
    pub(crate) interval: f32,
    /// The pass after this one, where that is known from the pass alone, and whether a step-over on the surface leads there: along the boundary where both end.
    pub(crate) next: Option<Route>,
    pub(crate) steps_over: bool,
    /// There is no pass after this one.
    pub(crate) is_last: bool,
    /// Stations of half the turn before the pass, and its length, units of 2^-10 nm.
    pub(super) head: u16,
    pub(crate) head_q10: i64,
    /// The turn to the next pass, if there is one, and the arc at which it begins, units of 2^-10 nm.
    pub(crate) tail: Turn,
    pub(crate) tail_q10: i64,
}

impl PassPlan {
    /// No plan.
    pub(crate) const NONE: Self = Self {
        plan: Plan::NONE,
        pass: 0,
        route: Route::NONE,
        cells: 0,
        first_cells: 0,
        last_cells: 0,
        last_patch: u16::MAX,
        cell_fraction: 0,
        group: 1,
        point: false,
        is_tip: false,
        full_pace: 1.0,
        ends: [[0; 3]; 2],
        faces_up: [false; 2],
        sides: [SpanParameter { span: 0, fraction: 0 }; 2],
        starts: [0; PIECE_WORDS],
        firsts: [0; STATIONS_MAX],
        interval: 0.0,
        next: None,
        steps_over: false,
        is_last: false,
        head: 0,
        head_q10: 0,
        tail: Turn::NONE,
        tail_q10: 0,
    };

    /// Cells of a patch between kept stations, by its number from the start of the pass.
    pub(crate) const fn cells_of(&self, patch: u16) -> u16 {
        if patch == 0 {
            self.first_cells
        } else if patch == self.last_patch {
            self.last_cells
        } else {
            self.cells
        }
    }

    /// Sets the cells of every patch; 0 before the first.
    pub(super) const fn set_cells(&mut self, cells: u16) {
        (self.cells, self.first_cells) = (cells, cells);
        self.last_patch = u16::MAX;
    }

    /// Sets those of a patch of which only a part is machined: the first one or the last one.
    pub(super) const fn set_cells_of(&mut self, patch: u16, cells: u16) {
        if patch == 0 {
            self.first_cells = cells;
        } else {
            (self.last_patch, self.last_cells) = (patch, cells);
        }
    }

    /// Fraction of a whole patch in one of its cells.
    pub(crate) const fn cell_fraction(&self) -> u64 {
        self.cell_fraction
    }

    /// The pace at a feed factor: above 1 where it was planned for less.
    pub(crate) fn pace(&self, feed_factor: f32) -> f32 {
        // A plan with a turn may use more than the feed at its own pace.
        feed_factor * self.full_pace / self.plan.over
    }

    /// Sets the limits that it is planned for.
    pub(crate) fn set_limits(&mut self, job: &Job<'_>, limits: MotionLimits) {
        self.full_pace = job.header.feed_mm_s / limits.feed;
        self.plan.limits = limits;
    }

    /// Arc at the start of a cell between kept stations, units of 2^-10 nm, by the number of the patch from the start of the pass and of the cell
    /// within the patch.
    pub(crate) fn arc_q10(&self, [patch, within]: [u16; 2]) -> Option<i64> {
        let group = patch.checked_div(self.group)?;
        if group * self.group != patch {
            return None;
        }
        let station = *self.firsts.get(usize::from(self.even_station(group, within)))?;
        Some(i64::from(self.plan.stations.get(u16::from(station)).arc_nm) << Q10_BITS)
    }

    /// Number of a station of a straight pass among those at the ends of even cells, by its group of patches and the cell within the patch.
    pub(super) const fn even_station(&self, group: u16, within: u16) -> u16 {
        let before = match group {
            0 => 0,
            _ => self.first_cells + 1 + (group - 1) * (self.cells + 1),
        };
        before + within
    }
}

impl PassPlan {
    /// Arc at the start of a piece of a pass on a front, units of 2^-10 nm, if a stretch begins with it.
    pub(crate) fn arc_at_piece_q10(&self, number: u16) -> Option<i64> {
        let (word, bit) = (usize::from(number >> 5), number & 31);
        let starts = *self.starts.get(word)?;
        if starts >> bit & 1 == 0 {
            return None;
        }
        let mut index = (starts & ((1 << bit) - 1)).count_ones();
        for starts in self.starts.iter().take(word) {
            index += starts.count_ones();
        }
        let station = *self.firsts.get(usize::try_from(index).ok()?)?;
        Some(i64::from(self.plan.stations.get(u16::from(station)).arc_nm) << Q10_BITS)
    }

    /// The start of the pass.
    pub(crate) const fn start(&self) -> BoundaryEnd {
        let ([path, _], [side, _]) = (self.route.ends, self.sides);
        BoundaryEnd { path, side }
    }

    /// The end of the pass.
    pub(crate) const fn end(&self) -> BoundaryEnd {
        let ([_, path], [_, side]) = (self.route.ends, self.sides);
        BoundaryEnd { path, side }
    }

    /// The parameter that changes along the boundary that the pass ends on.
    pub(crate) fn end_boundary(&self) -> Along {
        match self.route.front {
            Some(front) if front.are_on_boundary[1] => Along::Path,
            _ => Along::Side,
        }
    }

    /// Whether the next pass begins on the boundary that this one ends on, near that end.
    pub(crate) fn is_beside(&self, next: &Self) -> bool {
        let (end, start) = (self.end(), next.start());
        let is_on_it = match self.end_boundary() {
            Along::Path => start.side == end.side,
            Along::Side => start.path == end.path,
        };
        let mut square = 0.0;
        for (from, to) in self.ends[1].iter().zip(&next.ends[0]) {
            let mm = to_f32(i64::from(*to) - i64::from(*from)) * MM_PER_NM;
            square += mm * mm;
        }
        is_on_it && square <= BESIDE_MM * BESIDE_MM
    }

    /// Notes the piece with which a stretch begins.
    pub(super) fn note_stretch(&mut self, number: u16) {
        if let Some(starts) = self.starts.get_mut(usize::from(number >> 5)) {
            *starts |= 1 << (number & 31);
        }
    }

    /// Notes the first station of a stretch, or of an even cell, by its number: the next one, or one before that.
    pub(super) fn note_first(&mut self, stretch: u16, back: u16) {
        let station = self.plan.stations.count().saturating_sub(back);
        if let (Some(first), Ok(station)) = (self.firsts.get_mut(usize::from(stretch)), u8::try_from(station))
        {
            *first = station;
        }
    }
}
