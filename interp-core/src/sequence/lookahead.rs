//! The next pass, looked over while the tool is still on its way: stations in even parts of each patch, in order, give the bounds of the
//! feed ([`Plan`]), the interval to the pass after it, and whether the axes and the ball can go there at all.
//!
//! Stations are the surface's, not the samples': however a run is held up, its passes lie in the same places.

use crate::command::OVERRIDE_MAX;
use crate::fault::{Fault, FaultKind, Result};
use crate::feed::demand::{Jump, Room, Stencil, over_jump, root};
use crate::feed::plan::{CELLS_MOVING, Plan, Top};
use crate::job::program::Job;
use crate::job::{Axes, Pattern, Spacing};
use crate::math::number::{Bounded, nm_to_mm};
use crate::pass::across::{Across, Densities};
use crate::pass::patch::Patch;
use crate::pass::position::Line;
use crate::pass::schedule;
use crate::sample::{Place, interval_of};
use crate::surface::{Contact, PathSpeed};

/// Cells that a pass is cut into, as near as whole parts of its patches come to it; no more than [`crate::job::CELLS_MAX`].
const CELLS_WANTED: u16 = 160;
/// Cells of a patch at most.
const PARTS_MAX: u16 = 64;
/// Change of r times a curvature, and noise of it, below which nothing has jumped: f32 is good to so much.
const NO_JUMP: f32 = 4e-6;
/// Cells before a station that its differences say something about.
const STENCIL_CELLS: usize = 2;

/// One pass: its bounds, its ends, and what follows from it.
#[derive(Clone, Debug)]
pub(crate) struct PassPlan {
    pub(crate) plan: Plan,
    pub(crate) pass: u32,
    pub(crate) side: Place,
    /// Cells of a patch.
    pub(crate) parts: u16,
    /// Fraction of the patch that each of them is.
    pub(crate) part: u64,
    /// The pass is a single point.
    pub(crate) point: bool,
    /// Cutter location at start and end, nm, and whether the surface faces up there.
    pub(crate) ends: [[i32; 3]; 2],
    pub(crate) up: [bool; 2],
    /// Least interval of the pass.
    pub(crate) interval: f32,
    /// The pass after this one.
    pub(crate) next: Option<Place>,
}

impl PassPlan {
    /// Of no pass.
    pub(crate) const NONE: Self = Self {
        plan: Plan::NONE,
        pass: 0,
        side: Place { span: 0, fraction: 0 },
        parts: 1,
        part: u64::MAX,
        point: false,
        ends: [[0; 3]; 2],
        up: [false; 2],
        interval: f32::INFINITY,
        next: None,
    };
}

/// What is to be done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    Patch,
    Station,
    /// The differences that end at the station.
    Cell,
    /// What they leave.
    Room,
    /// The cell that ends there.
    Add,
    /// So many looks across are due at the station.
    Look(u8),
    Close,
    Bound,
    Done,
}

/// Curvatures at the last stations, to tell a jump from a bend.
#[derive(Clone, Copy, Debug)]
struct Trail {
    /// 1 - r k along the path and r times the twist, at the last three stations of the patch, the newest first.
    values: [[f32; 2]; 3],
    /// Lengths between them, mm.
    lengths: [f32; 2],
    /// Slopes at the end of the patch before.
    slopes: Option<[f32; 2]>,
}

impl Trail {
    const START: Self = Self {
        values: [[0.0; 2]; 3],
        lengths: [0.0; 2],
        slopes: None,
    };

    const fn push(&mut self, value: [f32; 2], length: f32) {
        let [newest, middle, _] = self.values;
        self.values = [value, newest, middle];
        self.lengths = [length, self.lengths[0]];
    }

    /// Slopes at the newest (`forwards`) or the oldest of three stations, by their parabola.
    fn slopes(&self, at_newest: bool) -> [f32; 2] {
        let [newest, middle, oldest] = self.values;
        let [h1, h2] = self.lengths.map(|length| length.at_least(1e-9));
        let slope = |c: f32, b: f32, a: f32| {
            let (late, early) = ((c - b) / h1, (b - a) / h2);
            let bend = (late - early) / (h1 + h2);
            if at_newest {
                late + bend * h1
            } else {
                early - bend * h2
            }
        };
        let ([c0, c1], [b0, b1], [a0, a1]) = (newest, middle, oldest);
        [slope(c0, b0, a0), slope(c1, b1, a1)]
    }
}

/// The look ahead at one pass.
#[derive(Clone, Debug)]
pub(crate) struct Lookahead {
    pub(crate) patch: Patch,
    across: Across,
    task: Task,
    line: Line,
    /// Station within the patch, from 0.
    station: u16,
    speed: PathSpeed,
    stencil: Stencil,
    trail: Trail,
    /// The station whose cell is to be closed: contact, and centre in nm.
    here: Option<(Contact, [i32; 3])>,
    /// Length of that cell, mm.
    length: f32,
    /// What the last station left.
    room: Room,
    densities: Densities,
}

impl Lookahead {
    /// At nothing.
    pub(crate) const START: Self = Self {
        patch: Patch::NONE,
        across: Across::START,
        task: Task::Done,
        line: Line {
            side: Place { span: 0, fraction: 0 },
            reversed: false,
            span: 0,
        },
        station: 0,
        speed: PathSpeed::STILL,
        stencil: Stencil::START,
        trail: Trail::START,
        here: None,
        length: 0.0,
        room: Room::WIDE,
        densities: Densities::NONE,
    };

    /// Back to before the first pass.
    pub(crate) const fn restart(&mut self) {
        self.across.restart();
        self.task = Task::Done;
    }

    /// Whether there is nothing to be done.
    pub(crate) const fn is_done(&self) -> bool {
        matches!(self.task, Task::Done)
    }

    /// Whether the next portion collapses a patch.
    pub(crate) fn makes_patch(&self) -> bool {
        match self.task {
            Task::Patch => true,
            Task::Look(_) => self.across.makes_patch(&self.line),
            _ => false,
        }
    }

    /// Begins with this pass.
    pub(crate) fn begin(&mut self, job: &Job<'_>, pass: u32, side: Place, out: &mut PassPlan) {
        let spans = job.header.path_spans;
        let reversed = job.header.pattern == Pattern::Zigzag && pass % 2 == 1;
        self.line = Line {
            side,
            reversed,
            span: if reversed { spans.saturating_sub(1) } else { 0 },
        };
        self.task = Task::Patch;
        self.station = 0;
        self.trail = Trail::START;
        self.room = Room::WIDE;
        self.densities = Densities::NONE;
        self.across.begin();
        out.plan.begin();
        out.pass = pass;
        out.side = side;
        out.parts = (CELLS_WANTED / spans.max(1)).clamp(1, PARTS_MAX);
        out.part = u64::MAX / u64::from(out.parts);
        out.point = false;
        out.next = None;
    }

    /// One portion.
    ///
    /// # Errors
    /// What is wrong with the surface at the next station; the axes cannot go there ([`FaultKind::SoftLimit`]).
    #[inline(never)]
    pub(crate) fn work(&mut self, job: &Job<'_>, axes: &Axes, out: &mut PassPlan) -> Result<()> {
        self.task = match self.task {
            Task::Patch => {
                self.patch.collapse(job, &self.line)?;
                out.point |= self.patch.point;
                Task::Station
            }
            Task::Station => {
                self.visit(axes, out)?;
                Task::Cell
            }
            Task::Cell => {
                self.differences(out);
                Task::Room
            }
            Task::Room => {
                if self.station > 0 && !out.point {
                    self.room = self.stencil.room(axes, &top(job));
                }
                Task::Add
            }
            Task::Add => {
                self.close_cell(job, axes, out);
                self.looks(job, out)
            }
            Task::Look(looks) => {
                self.look(job, out);
                match looks.checked_sub(1) {
                    Some(looks) if looks > 0 => Task::Look(looks),
                    _ => self.go_on(job, out),
                }
            }
            Task::Close => {
                self.close(job, out)?;
                Task::Bound
            }
            Task::Bound if out.point || out.plan.work(CELLS_MOVING) => Task::Done,
            task => task,
        };
        Ok(())
    }

    /// Where the pass that is looked over is.
    pub(crate) fn place(&self, out: &PassPlan) -> (u32, Place, Place) {
        let fraction = self.fraction(out);
        let own = if self.line.reversed { !fraction } else { fraction };
        let path = Place {
            span: self.line.span,
            fraction: own,
        };
        (out.pass, path, out.side)
    }

    fn fraction(&self, out: &PassPlan) -> u64 {
        if self.station >= out.parts {
            return u64::MAX;
        }
        u64::from(self.station) * out.part
    }

    /// How often to look across from a station: once at each line, twice where their patches have to be made, and more where the lines
    /// begin and end.
    fn looks(&mut self, job: &Job<'_>, out: &PassPlan) -> Task {
        if job.header.spacing == Spacing::FirstOrder || out.point {
            return self.go_on(job, out);
        }
        let first = self.station == 0;
        let begins = first && out.plan.count() == 0;
        let ends = self.station >= out.parts && self.line.next(job.header.path_spans).is_none();
        Task::Look(2 + 2 * u8::from(first) + 6 * u8::from(begins) + 6 * u8::from(ends))
    }

    fn look(&mut self, job: &Job<'_>, out: &PassPlan) {
        let fraction = self.fraction(out);
        let most = self.densities.most;
        self.across.work(job, &self.line, &self.patch, fraction, most);
    }

    /// To the next station, the next patch, or the end.
    fn go_on(&mut self, job: &Job<'_>, out: &PassPlan) -> Task {
        if self.station < out.parts {
            self.station += 1;
            return Task::Station;
        }
        match self.line.next(job.header.path_spans) {
            Some(line) => {
                self.line = line;
                self.station = 0;
                Task::Patch
            }
            None => Task::Close,
        }
    }

    /// The station: whether the ball fits and the axes can go there, its density, and the cell that it ends.
    fn visit(&mut self, axes: &Axes, out: &mut PassPlan) -> Result<()> {
        let fraction = self.fraction(out);
        let patch = &self.patch;
        let (contact, located) = patch.evaluate(fraction)?;
        check_travel(axes, &located.cl_nm)?;
        check_height(axes, &located.cl_nm)?;
        let density = patch.interval.density(&contact);
        if density > self.densities.most {
            self.densities = Densities {
                most: density,
                shape: [contact.across, contact.lateral_squared],
            };
        }
        let is_up = patch.ball.faces_up(contact.offset);
        let begins = out.plan.count() == 0 && self.station == 0;
        if begins || out.point {
            (out.ends, out.up) = ([located.cl_nm; 2], [is_up; 2]);
        }
        (out.ends[1], out.up[1]) = (located.cl_nm, is_up);
        self.here = Some((contact, located.cl_nm));
        Ok(())
    }

    /// The differences up to the station.
    fn differences(&mut self, out: &PassPlan) {
        let Some((contact, centre_nm)) = self.here.filter(|_| !out.point) else {
            return;
        };
        self.length = self.cell_length(out, &contact);
        self.speed = contact.path;
        if self.station > 0 {
            self.stencil.add(centre_nm, self.length);
        } else if out.plan.count() == 0 {
            self.stencil.begin(centre_nm);
        }
    }

    /// The cell up to the station.
    fn close_cell(&mut self, job: &Job<'_>, axes: &Axes, out: &mut PassPlan) {
        let Some((contact, _)) = self.here.take().filter(|_| !out.point) else {
            return;
        };
        let top = top(job);
        if self.station > 0 {
            out.plan.add(self.length, &self.room, STENCIL_CELLS, &top);
        }
        self.watch_jumps(axes, &contact, self.length, &top, out);
    }

    /// Arc from the last station, mm: Hermite's rule of two points.
    fn cell_length(&self, out: &PassPlan, contact: &Contact) -> f32 {
        let length = 1.0 / f32::from(out.parts);
        let (first, last) = (1.0 / self.speed.inverse, 1.0 / contact.path.inverse);
        let bow = first * self.speed.stretch - last * contact.path.stretch;
        length * (0.5 * (first + last) + bow * length * (1.0 / 12.0)) / self.patch.per_mm
    }

    /// What jumps from the patch before to this one holds the feed back at the boundary: curvatures at once, their slopes when there are
    /// three stations on this side, too.
    fn watch_jumps(&mut self, axes: &Axes, contact: &Contact, length: f32, top: &Top, out: &mut PassPlan) {
        let twist = if contact.lateral_squared > 0.0 {
            root(contact.twist_squared / contact.lateral_squared)
        } else {
            0.0
        };
        let value = [contact.along, twist];
        let before = self.trail.values[0];
        if self.station == 0 {
            let first = changed(&before, &value, NO_JUMP);
            self.trail.slopes = (out.parts >= 2).then(|| self.trail.slopes(true));
            self.trail.values = [value; 3];
            if out.plan.count() > 0 {
                let jump = Jump {
                    first,
                    second: [0.0; 2],
                };
                self.hold(1, &jump, axes, top, out);
            }
            return;
        }
        self.trail.push(value, length);
        if self.station == 2
            && out.plan.count() > out.parts
            && let Some(slopes) = self.trail.slopes
        {
            let here = self.trail.slopes(false);
            let shortest = self.trail.lengths[0]
                .at_most(self.trail.lengths[1])
                .at_least(1e-9);
            let second = changed(&slopes, &here, 4.0 * NO_JUMP / shortest);
            let jump = Jump {
                first: [0.0; 2],
                second,
            };
            self.hold(3, &jump, axes, top, out);
        }
    }

    /// Holds the feed back at the end of a cell, so many back, where the path jumps.
    fn hold(&self, back: u16, jump: &Jump, axes: &Axes, top: &Top, out: &mut PassPlan) {
        let square = over_jump(jump, &self.stencil.cosines(), self.room.taken, axes, top.period_s);
        out.plan.gate(out.plan.count().saturating_sub(back), square, top);
    }

    /// The pass is complete: the mean of its feed, its interval, and the next pass.
    fn close(&mut self, job: &Job<'_>, out: &mut PassPlan) -> Result<()> {
        out.plan.settle(&top(job));
        let header = job.header;
        out.interval = interval_of(self.densities.most);
        let step = match header.spacing {
            Spacing::Exact if !out.point => self.across.step(header, self.densities),
            _ => out.interval,
        };
        let width = |span| job.side_width(span);
        out.next = if schedule::is_last(out.side, header.side_spans) {
            None
        } else {
            Some(schedule::next_side(out.side, step, header.side_spans, width)?)
        };
        Ok(())
    }
}

/// The speeds that a pass is planned for.
pub(crate) fn top(job: &Job<'_>) -> Top {
    Top {
        speed: OVERRIDE_MAX * job.header.feed_mm_s,
        usual: job.header.feed_mm_s,
        period_s: job.header.period_s,
    }
}

/// # Errors
/// [`FaultKind::SoftLimit`] with how far outside a place is, mm.
pub(crate) fn check_travel(axes: &Axes, place_nm: &[i32; 3]) -> Result<()> {
    for (place, [least, most]) in place_nm.iter().zip(&axes.travel_nm) {
        let outside = (i64::from(*least) - i64::from(*place)).max(i64::from(*place) - i64::from(*most));
        if outside > 0 {
            let outside = i32::try_from(outside).unwrap_or(i32::MAX);
            return Err(Fault::new(FaultKind::SoftLimit, nm_to_mm(outside)));
        }
    }
    Ok(())
}

/// # Errors
/// [`FaultKind::LinkBlocked`] with how far a place is above the safe height, mm.
fn check_height(axes: &Axes, [_, _, z]: &[i32; 3]) -> Result<()> {
    if *z > axes.safe_z_nm {
        return Err(Fault::new(
            FaultKind::LinkBlocked,
            nm_to_mm(z.saturating_sub(axes.safe_z_nm)),
        ));
    }
    Ok(())
}

/// How far the parts of two pairs are apart, beyond the noise of each.
fn changed(from: &[f32; 2], to: &[f32; 2], noise: f32) -> [f32; 2] {
    let ([from0, from1], [to0, to1]) = (from, to);
    let apart = |from: &f32, to: &f32| ((to - from).abs() - noise).at_least(0.0);
    [apart(from0, to0), apart(from1, to1)]
}
