//! Stations of a piece: which of them are looked at and kept, their checks, arcs and derivatives.

use super::stretch::HALVED_MIN_MM;
use super::{
    CELL_KEPT_MM, DifferencesOf, Lookahead, PATCHES, PassPlan, Task, check_crease, check_travel, stations_of,
};
use crate::fault::{Fault, FaultKind, Result};
use crate::feed::stations::{
    CELL_MIN_MM, CELLS_FINE, CELLS_MANY, Derivatives, Station, WINDOW, Window, parts_of_cell,
};
use crate::job::program::Job;
use crate::job::{AxisLimits, SurfaceKind};
use crate::math::arith::{fraction_to_f32, sqrt, truncated};
use crate::math::number::{Bounded, MM_PER_NM, nm_to_mm, to_f32};
use crate::math::vec3::Vec3;
use crate::pass::step_over::StepOverEstimator;
use crate::sequence::link::is_elsewhere;
use crate::surface::{Contact, PathSpeed};

/// Cells of a patch at least, where the curvature jumps at its ends.
const CELLS_TO_REST: u16 = 4;

/// Share of the centre's way that counts as length of a patch.
const CENTRE_SHARE: f32 = 0.5;
/// Share of the contact's way below which the centre's is that of a ball which hardly fits.
const HARDLY_FITS: f32 = 0.5;

/// Change of 1 - r k from patch to patch below which it is rounding of single precision.
const NO_JUMP: f32 = 4e-6;

/// Least jump of the path's direction, rad, that counts as a bend at a knot.
const BEND_MIN: f32 = 1e-4;

/// Relative difference of the two-point and the three-point rule of a cell's arc from which on the latter is taken, and up to which: below is rounding, above
/// neither is trusted.
const ARC_NOISE: f32 = 1e-6;
const ARC_APART: f32 = 1.0 / 16.0;

impl Lookahead {
    /// Chooses the cells of a patch: those between kept stations by the number of patches and their length, the same for the whole pass; those
    /// that are looked at by the length of this patch.
    pub(super) fn choose_cells(&mut self, job: &Job<'_>, out: &mut PassPlan) {
        let spans = job.header.path_spans.max(1);
        let whole = |value: f32| u16::try_from(truncated(value)).unwrap_or(u16::MAX);
        let halves = self.patch_lengths();
        let [[first, first_centre], [second, second_centre]] = halves;
        let (length, centre) = (first + second, first_centre + second_centre);
        // Where the ball goes around an edge, its centre moves much farther than the contact, and the path bends by that.
        let by_centre = CENTRE_SHARE * centre;
        if by_centre > length {
            self.centre_mm = self.centre_mm.at_least(by_centre);
        }
        // Where it hardly fits, the centre's path bends as much.
        let hardly_fits = |length: f32, centre: f32| centre < HARDLY_FITS * length;
        self.bends |= by_centre > length || hardly_fits(length, centre);
        let turns =
            |[length, centre]: &[f32; 2]| CENTRE_SHARE * centre > *length || hardly_fits(*length, *centre);
        self.may_turn = halves.iter().any(turns);
        self.adapts = spans == 1;
        self.differences = if self.adapts {
            DifferencesOf::Directions
        } else {
            DifferencesOf::Positions
        };
        let length = length.at_least(by_centre);
        if out.cells == 0 {
            let [start, end] = out.route.ends;
            let is_part = job.header.edges > 0 || self.whole.is_some();
            let spans = if is_part {
                start.span.abs_diff(end.span).saturating_add(1)
            } else {
                spans
            };
            let fit = stations_of(job)
                .checked_div(spans)
                .unwrap_or(1)
                .saturating_sub(1)
                .max(1);
            let mean = if is_part || job.header.spacing.is_constant() {
                // The first patch may be a small part, and the last pass short stretches of a front.
                if spans > 1 {
                    self.patch_mm.at_least(length / self.piece.share())
                } else {
                    length
                }
            } else if self.patch_mm > 0.0 {
                self.patch_mm
            } else {
                length
            };
            out.cells = whole(mean / CELL_KEPT_MM).clamp(1, fit);
            if self.patch_mm == 0.0 || self.has_bend || self.bends {
                // The patches of a first pass are not known yet, and in bends derivatives change within a patch.
                out.cells = out.cells.max(CELLS_MANY.min(fit));
            }
            if self.has_jump {
                // The walk rests at a jump only between two cells and more.
                out.cells = out.cells.max(CELLS_TO_REST.min(fit));
            }
            if spans == 1 {
                // A place between the rests.
                out.cells = out.cells.max(2);
            }
            out.cell_fraction = u64::MAX.checked_div(u64::from(out.cells)).unwrap_or(u64::MAX);
            out.group = spans.div_ceil(PATCHES);
            out.set_cells(out.cells);
        }
        self.kept = out.cells;
        if !self.piece.is_whole() && out.group == 1 {
            // Cells of a short part that are as many as those of a whole patch are so short that their derivatives are rounding.
            let least = CELLS_FINE.min(whole(length / HALVED_MIN_MM).max(2));
            self.kept = whole(length / CELL_MIN_MM).max(least).min(out.cells);
            out.set_cells_of(self.patches, self.kept);
        }
        self.looks = parts_of_cell(length, self.kept);
        if self.may_turn {
            // Two cells have one second derivative and no third, by which a coarse look is known.
            let least = CELLS_FINE.min(whole(length / HALVED_MIN_MM).max(1));
            self.looks = self.looks.max(least.div_ceil(self.kept.max(1)));
        }
        self.first_looks = self.looks;
        out.plan.stations.note_group(out.group);
        self.begun = out.plan.stations.count();
        self.divide_patch();
    }

    /// Begins the stations of a patch, with the cells that are looked at for each of those between kept ones.
    pub(super) fn divide_patch(&mut self) {
        self.cells = self.kept * self.looks;
        let whole = self.piece.end().saturating_sub(self.piece.start());
        self.cell_fraction = whole.checked_div(u64::from(self.cells)).unwrap_or(u64::MAX);
        self.window = Window::EMPTY;
        self.arc_mm = 0.0;
        self.station = 0;
    }

    /// Lengths of the contact's and of the centre's way over each half of the patch, roughly, mm; 0 where its surface is not evaluated.
    fn patch_lengths(&self) -> [[f32; 2]; 2] {
        let at = |fraction| {
            let located = self.patch.evaluate_on_line(fraction);
            located.map(|(_, located)| [located.cc_nm, located.cl_nm])
        };
        let [start, end] = self.piece.range;
        let middle = start + end.saturating_sub(start).div_ceil(2);
        let (Ok(start), Ok(middle), Ok(end)) = (at(start), at(middle), at(end)) else {
            return [[0.0; 2]; 2];
        };
        let apart = |from: &[i32; 3], to: &[i32; 3]| {
            let mut sum = 0.0;
            for (from, to) in from.iter().zip(to) {
                let mm = to_f32(i64::from(*to) - i64::from(*from)) * MM_PER_NM;
                sum += mm * mm;
            }
            sqrt(sum)
        };
        [[&start, &middle], [&middle, &end]]
            .map(|[[from_cc, from_cl], [to_cc, to_cl]]| [apart(from_cc, to_cc), apart(from_cl, to_cl)])
    }

    /// The derivatives that can be taken after a station.
    pub(super) fn after_station(
        &self,
        job: &Job<'_>,
        estimator: Option<&StepOverEstimator>,
        out: &PassPlan,
    ) -> Task {
        if out.point || (self.is_on_front() && self.is_short) {
            return self.estimates(job, estimator, out);
        }
        let is_end = self.is_end();
        let count = self.window.count();
        let last = count.saturating_sub(1);
        let middle = WINDOW / 2;
        // Where the window is full for the first time, also those before its middle; at the patch's end also those after it.
        let from = if usize::from(self.station) + 1 == count {
            0
        } else {
            middle
        };
        let to = if is_end { last } else { middle };
        if count < WINDOW && !is_end {
            return self.estimates(job, estimator, out);
        }
        match (u8::try_from(from), u8::try_from(to)) {
            (Ok(from), Ok(to)) => Task::Derivatives(from, to),
            _ => self.estimates(job, estimator, out),
        }
    }

    /// Stores the derivatives at a place of the window, if its station is kept or belongs to a group.
    pub(super) fn differentiate(&mut self, at: u8, out: &mut PassPlan) {
        let after = self.window.count().saturating_sub(1 + usize::from(at));
        let station = self.station.saturating_sub(u16::try_from(after).unwrap_or(0));
        if out.group > 1 {
            let stations = &mut out.plan.stations;
            let q = self.window.derivatives(usize::from(at));
            let begins = station == 0 && self.patches.is_multiple_of(out.group);
            for back in [1, 2] {
                stations.note_spacing(back, self.window.noise_spacing_mm());
                if let Some(place) = stations.back_mut(back) {
                    widen(&mut place.q, &q, begins || back == 1);
                }
            }
        } else {
            self.keep_derivatives(station, usize::from(at), out);
        }
    }

    /// Stores the derivatives at the start of a patch, or of a stretch, in the station so far from the last one.
    pub(super) fn store_start(&mut self, back: u16, q: Derivatives, out: &mut PassPlan) {
        let stations = &mut out.plan.stations;
        stations.note_spacing(back, self.window.noise_spacing_mm());
        let Some(place) = stations.back_mut(back) else {
            return;
        };
        // The direction at the start of a patch is that at the end of the last, where it is known not to jump.
        let before = core::mem::replace(&mut place.q, q);
        if self.is_smooth && self.has_derivatives && (self.may_join || !self.bends_at_knot(&before, &q)) {
            for (q, before) in place.q.iter_mut().zip(&before) {
                q[0] = before[0];
            }
        }
        if !self.has_derivatives {
            // Those before were too short for derivatives of their own.
            self.has_derivatives = true;
            let q = place.q;
            for before in back..=stations.count() {
                if let Some(place) = stations.back_mut(before) {
                    place.q = q;
                }
            }
        }
    }

    /// Whether the direction of the path jumps at a knot by more than the error of its differences: the lines of a smooth surface may bend there.
    fn bends_at_knot(&self, before: &Derivatives, after: &Derivatives) -> bool {
        let cell = self.window.spacing_mm();
        let (mut jump, mut first) = (0.0_f32, 0.0_f32);
        let (mut turn, mut change) = (0.0_f32, 0.0_f32);
        for (before, after) in before.iter().zip(after) {
            jump = jump.at_least((after[0] - before[0]).abs());
            first = first.at_least(before[0].abs()).at_least(after[0].abs());
            turn = turn.at_least(before[1].abs()).at_least(after[1].abs());
            change = change.at_least(before[2].abs()).at_least(after[2].abs());
        }
        let (turn, change) = (turn * cell / first, change * cell * cell / first);
        // A front bends little, but its stretches have few cells.
        let error = if self.is_on_front() {
            2.0 * (turn + change)
        } else {
            16.0 * (turn * turn * turn * turn + change * change)
        };
        let [noise, ..] = self.window.noise();
        jump > BEND_MIN + noise + first * error
    }

    /// Evaluations of the step-over estimator at a station.
    pub(super) fn estimates(
        &self,
        job: &Job<'_>,
        estimator: Option<&StepOverEstimator>,
        out: &PassPlan,
    ) -> Task {
        let first = self.station == 0;
        let begins = first && self.patches == 0;
        let ends = self.is_end() && out.route.next(job, &self.piece).is_none();
        let estimator = estimator.filter(|_| job.header.spacing.is_exact());
        let span = self.piece.position.span;
        Task::Estimate(estimator.map_or(0, |estimator| estimator.evaluations(span, first, begins, ends)))
    }

    /// Evaluates the station: fit of the ball, travel, inverse square interval, arc.
    pub(super) fn visit(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        estimator: Option<&mut StepOverEstimator>,
        out: &mut PassPlan,
    ) -> Result<()> {
        let fraction = self.fraction();
        let (contact, located, direction) = if self.differences == DifferencesOf::Directions {
            self.patch.evaluate_with_direction(fraction)?
        } else {
            let (contact, located) = self.patch.evaluate(fraction)?;
            (contact, located, None)
        };
        check_travel(axes, &located.cl_nm)?;
        check_height(axes, &located.cl_nm)?;
        self.see(job, fraction, &contact);
        if let Some(estimator) = estimator {
            estimator.see(job, &self.patch, &contact, fraction);
        }
        let side = self.patch.side_at(&self.piece.position, fraction);
        let is_up = self.patch.faces_up(contact.offset);
        if self.patches == 0 && self.station == 0 {
            (out.ends, out.faces_up, out.sides) = ([located.cl_nm; 2], [is_up; 2], [side; 2]);
        }
        if out.point {
            out.is_tip |= is_elsewhere(&out.ends[0], &located.cl_nm);
            out.ends[1] = if out.is_tip { out.ends[0] } else { located.cl_nm };
            return Ok(());
        }
        let is_first_look = self.halvings == 0;
        if self.patches > 0 && self.station == 0 && is_first_look {
            check_crease(job, axes, [&out.ends[1], &located.cl_nm])?;
        }
        (out.ends[1], out.faces_up[1], out.sides[1]) = (located.cl_nm, is_up, side);
        let path = self.speed_of(&contact);
        if self.station > 0 {
            self.arc_mm += self.cell_length(job, &path);
        }
        let twist = if contact.lateral_squared > 0.0 {
            sqrt((contact.twist_squared / contact.lateral_squared).at_least(0.0))
        } else {
            0.0
        };
        let across = if self.is_on_front() {
            contact.across / contact.lateral_squared
        } else {
            0.0
        };
        let bend = [contact.along, twist, across];
        if self.station == 0 && (is_first_look || self.is_on_front()) {
            let apart = |(from, to): (&f32, &f32)| (to - from).abs() > NO_JUMP;
            self.is_smooth = self.patches > 0 && (self.may_join || !self.bend.iter().zip(&bend).any(apart));
            self.jumps |= self.patches > 0 && !self.is_smooth;
        }
        self.bend = bend;
        self.speed = path;
        let direction = direction.map(|Vec3 { x, y, z }| [x, y, z]);
        self.window.push(located.cl_nm, self.arc_mm, direction);
        self.note_within();
        self.keep(out);
        Ok(())
    }

    /// Appends the station to the plan's if it is kept before its derivatives are known: the first one of a patch, with the last one's derivatives until its own are taken; of a
    /// stretch that has none, the end.
    fn keep(&self, out: &mut PassPlan) {
        let arc_nm = self.arc_nm(self.arc_mm);
        let q = out.plan.stations.back_mut(1).map_or([[0.0; 3]; 3], |last| last.q);
        if out.group > 1 {
            let station = Station {
                arc_nm,
                q: [[0.0; 3]; 3],
            };
            if self.station == 0 && self.patches.is_multiple_of(out.group) {
                self.note_even(0, out);
                out.plan.stations.push(station);
                out.plan.stations.push(station);
            } else if let Some(last) = out.plan.stations.back_mut(1) {
                last.arc_nm = arc_nm;
            }
        } else if self.station == 0 || (self.is_on_front() && self.is_short) {
            self.note_even(self.station, out);
            out.plan.stations.push(Station { arc_nm, q });
        }
    }

    /// Notes a station of a straight pass at the start of one of the even cells of its patch, which is appended next.
    pub(super) fn note_even(&self, station: u16, out: &mut PassPlan) {
        if !self.is_on_front() {
            let within = station.checked_div(self.looks).unwrap_or(0);
            let number = out.even_station(self.patches.checked_div(out.group).unwrap_or(0), within);
            out.note_first(number, 0);
        }
    }

    /// Arc from the last station, mm: Hermite's two-point rule.
    pub(super) fn cell_length(&self, job: &Job<'_>, path: &PathSpeed) -> f32 {
        let [start, end] = self.range;
        let length = fraction_to_f32(end.saturating_sub(start)) / f32::from(self.cells);
        let (first, last) = (1.0 / self.speed.inv_speed, 1.0 / path.inv_speed);
        let bow = first * self.speed.log_speed_derivative - last * path.log_speed_derivative;
        let two = 0.5 * (first + last) + bow * length * (1.0 / 12.0);
        let units = if job.header.kind == SurfaceKind::Rational {
            length * self.three_point(path, two, length)
        } else {
            length * two
        };
        if self.is_on_front() {
            units
        } else {
            units / self.patch.per_mm
        }
    }

    /// Mean speed of a cell of a rational patch, by Hermite's three-point rule where the two-point one is not enough. The reciprocal of the speed of an arc is a
    /// polynomial, so the middle follows from the ends: half of a quarter arc within 5e-6 of its radius, where two points leave 8e-4.
    fn three_point(&self, path: &PathSpeed, two: f32, length: f32) -> f32 {
        let (from, to) = (self.speed.inv_speed, path.inv_speed);
        let bow = to * path.log_speed_derivative - from * self.speed.log_speed_derivative;
        let inverse = 0.5 * (from + to) + bow * length * (1.0 / 8.0);
        let (first, last) = (1.0 / from, 1.0 / to);
        let rise = first * self.speed.log_speed_derivative - last * path.log_speed_derivative;
        let three = (first + last) * (7.0 / 30.0) + rise * length * (1.0 / 60.0) + 16.0 / 30.0 / inverse;
        // A NaN is rejected too.
        if (three - two).abs() > ARC_NOISE * two && (three - two).abs() < ARC_APART * two {
            three
        } else {
            two
        }
    }

    /// The parametrisation at a station; on a front, where the next station may be on another patch, per mm.
    fn speed_of(&self, contact: &Contact) -> PathSpeed {
        let PathSpeed {
            inv_speed,
            log_speed_derivative,
        } = contact.path;
        PathSpeed {
            inv_speed: if self.is_on_front() {
                inv_speed * self.patch.per_mm
            } else {
                inv_speed
            },
            log_speed_derivative,
        }
    }
}

/// The direction at the station, and of each higher derivative the one that is greater.
pub(super) fn widen(most: &mut Derivatives, q: &Derivatives, is_here: bool) {
    for ([direction, bends @ ..], [first, higher @ ..]) in most.iter_mut().zip(q) {
        if is_here {
            *direction = *first;
        }
        for (most, q) in bends.iter_mut().zip(higher) {
            if q.abs() > most.abs() {
                *most = *q;
            }
        }
    }
}

/// # Errors
/// [`FaultKind::LinkBlocked`] with the distance above the safe height, mm.
pub(super) fn check_height(axes: &AxisLimits, [_, _, z]: &[i32; 3]) -> Result<()> {
    if *z > axes.safe_z_nm {
        return Err(Fault::new(
            FaultKind::LinkBlocked,
            nm_to_mm(z.saturating_sub(axes.safe_z_nm)),
        ));
    }
    Ok(())
}
