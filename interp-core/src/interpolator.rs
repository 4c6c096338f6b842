//! The one file that chains the stages: load, tick, hold, resume, abort.

use crate::arith::{centred, fraction_from_f32, fraction_to_f32};
use crate::contact;
use crate::fault::{Fault, FaultKind, Result};
use crate::interval::Interval;
use crate::job::{Header, Pattern, STORE_WORDS, ToolSide};
use crate::offset::Offset;
use crate::program::{PassSurface, Program};
use crate::sample::{Place, Sample, State};
use crate::schedule;
use crate::surface::{Contact, PassLine, PathSpeed};
use crate::vec3::Vec3;

/// Patch boundaries that one period's arc may cross: each costs the collapse of a patch. Three lets a tick pass two whole
/// patches that are shorter than its arc; shorter ones than that say the feed is not meant for the part.
const CROSSINGS_MAX: u8 = 3;

/// Cosine between the normals of neighbouring samples (120 degrees) below which the surface has folded over in between.
/// A fold turns the normal by 180 degrees less what the surface bends on the way; what bends by 120 degrees without a fold
/// has a radius below the scallop height.
const FOLD_COSINE: f32 = -0.5;

/// Step from place to place on a pole: 16 to a span. Between two the speed of the side lines, a rational cubic of the path
/// parameter, changes by a small part of itself.
const POLE_STEP: u64 = 1 << 60;

/// First-order step, as a fraction of the patch, beyond which the patch's end is looked at before the series.
const LONG_STEP: f32 = 0.25;

/// What the operator or the host wants, taken up with the next tick. A request that the state does not allow is ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Request {
    /// Nothing new.
    #[default]
    None = 0,
    /// Ready or finished: run the job from its beginning.
    Start = 1,
    /// Running: stand on the path.
    Hold = 2,
    /// Held: go on.
    Resume = 3,
    /// Running or held: give the run up; faulted: acknowledge the fault. The position is kept, the job stays loaded (ready).
    Abort = 4,
}

impl Request {
    /// Whether a machine in this state takes the request up.
    #[must_use]
    pub const fn is_allowed(self, state: State) -> bool {
        match self {
            Self::None => true,
            Self::Start => matches!(state, State::Ready | State::Finished),
            Self::Hold => matches!(state, State::Running),
            Self::Resume => matches!(state, State::Held),
            Self::Abort => matches!(state, State::Running | State::Held | State::Faulted),
        }
    }
}

/// What the next tick has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// Begin the pass at the current side place.
    Pass,
    /// One period's arc further.
    Along,
    /// Find the next pass, and begin it.
    Over,
    /// Nothing: the last sample is out.
    End,
}

/// The pass that runs.
#[derive(Clone, Copy, Debug)]
struct Run {
    next: Next,
    /// Samples so far.
    ticks: u32,
    pass: u32,
    side: Place,
    reversed: bool,
    /// Path span, in the surface's own direction.
    span: u16,
    /// Fraction of the span, in the direction of travel.
    fraction: u64,
    surface: Option<PassSurface>,
    /// The pass is a single point.
    point: bool,
    offset: Offset,
    /// The parametrisation at the last sample.
    path: PathSpeed,
    /// Tool normal at the last sample, and at the pass's first.
    normal: Vec3,
    first_normal: Vec3,
    /// Least interval candidate of the pass, fractions of the side span.
    least: f32,
}

impl Run {
    const START: Self = Self {
        next: Next::Pass,
        ticks: 0,
        pass: 0,
        side: Place { span: 0, fraction: 0 },
        reversed: false,
        span: 0,
        fraction: 0,
        surface: None,
        point: false,
        offset: Offset::NONE,
        path: PathSpeed {
            speed: 0.0,
            inverse: 0.0,
            stretch: 0.0,
            stretch_change: 0.0,
        },
        normal: Vec3::ZERO,
        first_normal: Vec3::ZERO,
        least: f32::INFINITY,
    };

    /// Where the tool is on the path parameter, in the surface's own direction.
    const fn place(&self) -> Place {
        let fraction = if self.reversed {
            !self.fraction
        } else {
            self.fraction
        };
        Place {
            span: self.span,
            fraction,
        }
    }
}

/// The loaded surface at one place, outside of any run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Probe {
    /// Cutter contact, nm.
    pub cc_nm: [i32; 3],
    /// Cutter location, nm.
    pub cl_nm: [i32; 3],
    /// Unit normal towards the tool.
    pub normal: [f32; 3],
    /// Candidate of the path interval, in units of the side parameter; infinite where it sets no limit.
    pub interval: f32,
}

/// Everything that decides where the tool goes, behind one [`Interpolator::tick`] a period.
///
/// `WORDS` is the capacity of the job store, in 32-bit words.
#[derive(Debug)]
pub struct Interpolator<const WORDS: usize = STORE_WORDS> {
    program: Program<WORDS>,
    state: State,
    run: Run,
    last: Sample,
    fault: Option<Fault>,
    interval: Interval,
    arc_mm: f32,
    last_interval: f32,
}

impl<const WORDS: usize> Default for Interpolator<WORDS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const WORDS: usize> Interpolator<WORDS> {
    /// An idle machine without a job.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            program: Program::new(),
            state: State::Idle,
            run: Run::START,
            last: Sample::START,
            fault: None,
            interval: Interval::NONE,
            arc_mm: 0.0,
            last_interval: f32::INFINITY,
        }
    }

    fn may_load(&self) -> Result<()> {
        if self.state.is_under_way() {
            return Err(Fault::new(FaultKind::WrongState, f32::from(self.state as u8)));
        }
        Ok(())
    }

    /// Begins to load a job of so many data words; what was loaded before is gone, and the machine is idle.
    ///
    /// # Errors
    /// Refused, and nothing changes: [`FaultKind::WrongState`] while a job runs or is held, [`FaultKind::BadHeader`],
    /// [`FaultKind::TooManyPatches`] with the words that the header implies, [`FaultKind::BadLength`] where `words` are not
    /// as many.
    pub fn load_begin(&mut self, header: &Header, words: u32) -> Result<()> {
        self.may_load()?;
        self.program.begin(header, words)?;
        self.state = State::Idle;
        self.fault = None;
        Ok(())
    }

    /// Writes data words at this offset: in order, or again over what was written.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`]; [`FaultKind::BadLength`] where no load has begun, the words leave a gap or reach past the
    /// job's end. Nothing is written then.
    pub fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<()> {
        self.may_load()?;
        self.program.write(offset, words)
    }

    /// Records that [`Self::load_check`] has to be called for.
    #[must_use]
    pub fn load_records(&self) -> u32 {
        self.program.records()
    }

    /// Checks one record: some thousand cycles, so that a board can do it between ticks. In order from 0.
    ///
    /// # Errors
    /// [`FaultKind::BadPatch`] with the record's index, [`FaultKind::BadHeader`] for a span width,
    /// [`FaultKind::BadLength`] where words are missing or the order is not kept.
    pub fn load_check(&mut self, record: u32) -> Result<()> {
        self.may_load()?;
        self.program.check(record)
    }

    /// Seals the job: the machine is ready.
    ///
    /// # Errors
    /// [`FaultKind::BadLength`] where words or checks are missing; the machine stays idle.
    pub fn load_finish(&mut self) -> Result<()> {
        self.may_load()?;
        self.program.seal()?;
        let header = self.program.header();
        self.interval = Interval::new(header.ball_radius_mm, header.scallop_mm);
        self.arc_mm = header.feed_mm_s * header.period_s;
        self.state = State::Ready;
        self.reset_run();
        Ok(())
    }

    /// Gives up what was loaded: the machine is idle. Refused like [`Self::load_begin`].
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] while a job runs or is held.
    pub fn unload(&mut self) -> Result<()> {
        self.may_load()?;
        self.program.clear();
        self.state = State::Idle;
        self.fault = None;
        Ok(())
    }

    /// State after the last tick or load call.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// The fault, while the state is [`State::Faulted`].
    #[must_use]
    pub const fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Where the run is: pass, path and side place. After a fault, where that is, which is past the last sample.
    #[must_use]
    pub const fn place(&self) -> (u32, Place, Place) {
        (self.run.pass, self.run.place(), self.run.side)
    }

    /// The last sample: its position is kept after a fault.
    #[must_use]
    pub const fn last(&self) -> &Sample {
        &self.last
    }

    /// Least path interval of the pass that was finished last, in units of the side parameter.
    #[must_use]
    pub const fn last_interval(&self) -> f32 {
        self.last_interval
    }

    /// The loaded surface at a place: what a sample there would say, whatever the machine is doing. Not for the sample path:
    /// it collapses a patch each time. The side fraction counts in steps of 2^-32.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] without a loaded job or for a span that it does not have; what is wrong with the surface
    /// there.
    pub fn probe(&self, path: Place, side: Place) -> Result<Probe> {
        let header = self.program.header();
        if path.span >= header.path_spans || side.span >= header.side_spans {
            return Err(Fault::new(FaultKind::WrongState, f32::from(self.state as u8)));
        }
        let mut run = Run {
            side,
            span: path.span,
            fraction: path.fraction,
            ..Run::START
        };
        collapse(&self.program, &mut run)?;
        let (contact, origin_nm) = contact_here(&run)?;
        run.offset.check_fit(&contact)?;
        let located = run.offset.locate(&contact, &origin_nm)?;
        let normal = contact.normal;
        Ok(Probe {
            cc_nm: located.cc_nm,
            cl_nm: located.cl_nm,
            normal: [normal.x, normal.y, normal.z],
            interval: self.interval.candidate(&contact) * self.program.side_width(side.span),
        })
    }

    /// Stops a run with a fault from outside, such as a missed deadline. Ignored where nothing runs or is held.
    pub fn trip(&mut self, fault: Fault) {
        if self.state.is_under_way() {
            self.fail(fault);
        }
    }

    fn fail(&mut self, fault: Fault) {
        self.state = State::Faulted;
        self.fault = Some(fault);
    }

    fn reset_run(&mut self) {
        self.run = Run::START;
        self.fault = None;
        self.last_interval = f32::INFINITY;
    }

    /// One period. Never blocks, never panics; bounded by the collapse and evaluation of four patches, and at
    /// the start of a pass by a walk over the side spans.
    ///
    /// While the job runs, each call yields a sample with [`State::Running`], counted by its `tick` from 0; the one after
    /// the last has [`State::Finished`]. In every state that does not move, the sample repeats the last position.
    #[inline(never)]
    pub fn tick(&mut self, request: Request) -> &Sample {
        self.take_up(request);
        if self.state == State::Running {
            match self.advance() {
                Ok(Some(sample)) => self.last = sample,
                Ok(None) => self.state = State::Finished,
                Err(fault) => self.fail(fault),
            }
        }
        self.last.state = self.state;
        &self.last
    }

    fn take_up(&mut self, request: Request) {
        if !request.is_allowed(self.state) {
            return;
        }
        self.state = match request {
            Request::None => return,
            Request::Start => {
                self.reset_run();
                State::Running
            }
            Request::Hold => State::Held,
            Request::Resume => State::Running,
            Request::Abort => {
                self.fault = None;
                State::Ready
            }
        };
    }

    /// The next sample of the run; none when the last is out.
    #[inline]
    fn advance(&mut self) -> Result<Option<Sample>> {
        let begins = self.run.next != Next::Along;
        match self.run.next {
            Next::Along => self.step()?,
            Next::Pass => self.begin_pass()?,
            Next::Over => {
                self.step_over()?;
                self.begin_pass()?;
            }
            Next::End => {
                self.note_interval();
                return Ok(None);
            }
        }
        let run = &mut self.run;
        let (contact, origin_nm) = contact_here(run)?;
        run.offset.check_fit(&contact)?;
        let located = run.offset.locate(&contact, &origin_nm)?;
        if run.normal.dot(contact.normal) < FOLD_COSINE {
            return Err(Fault::new(FaultKind::DegenerateSurface, 0.0));
        }
        if begins {
            run.first_normal = contact.normal;
        }
        run.normal = contact.normal;
        let candidate = self.interval.candidate(&contact);
        if candidate < run.least {
            run.least = candidate;
        }
        run.path = contact.path;
        let tick = run.ticks;
        run.ticks = tick.wrapping_add(1);
        Ok(Some(Sample {
            tick,
            state: State::Running,
            pass: run.pass,
            path: run.place(),
            side: run.side,
            feed_mm_s: if run.point {
                0.0
            } else {
                self.program.header().feed_mm_s
            },
            cc_nm: located.cc_nm,
            cl_nm: located.cl_nm,
            interval: candidate * self.program.side_width(run.side.span),
        }))
    }

    /// One period's arc along the pass: within the patch, or over its boundary with the arc that is left.
    #[inline]
    fn step(&mut self) -> Result<()> {
        if self.run.point {
            return self.step_on_pole();
        }
        let mut rest = self.arc_mm;
        for _ in 0..=CROSSINGS_MAX {
            if let Some(fraction) = self.within(rest)? {
                self.run.fraction = fraction;
                return Ok(());
            }
            let covered = self.arc_to_end()?;
            rest = if rest > covered { rest - covered } else { 0.0 };
            if !self.next_span()? {
                self.run.fraction = u64::MAX;
                self.end_pass();
                return Ok(());
            }
            self.run.path = contact_here(&self.run)?.0.path;
        }
        Err(Fault::new(FaultKind::PatchTooShort, rest))
    }

    /// On a pole, the next of its places: the tool stands, but the interval that the pass allows differs from place to place.
    #[inline(never)]
    fn step_on_pole(&mut self) -> Result<()> {
        if let Some(fraction) = self.run.fraction.checked_add(POLE_STEP) {
            self.run.fraction = fraction;
        } else if !self.next_span()? {
            self.run.fraction = u64::MAX;
            self.end_pass();
        }
        Ok(())
    }

    /// The fraction after an arc, if that lies within the patch.
    #[inline]
    fn within(&self, arc_mm: f32) -> Result<Option<u64>> {
        let run = &self.run;
        // The series is about a small part of the patch: where the arc may be all of it, the end is looked at first.
        if arc_mm * run.path.inverse > LONG_STEP && self.arc_to_end()? <= arc_mm {
            return Ok(None);
        }
        let step = contact::step(&run.path, arc_mm)?;
        let mut fraction = step.fraction;
        if step.coarse {
            let half = fraction_from_f32(0.5 * fraction);
            let Some(middle) = run.fraction.checked_add(half) else {
                return Ok(None);
            };
            fraction = contact::corrected(fraction, arc_mm, &speed_at(run, middle)?)?;
        }
        if fraction >= 1.0 {
            return Ok(None);
        }
        Ok(run.fraction.checked_add(fraction_from_f32(fraction)))
    }

    /// Arc from here to the end of the patch, mm.
    #[inline(never)]
    fn arc_to_end(&self) -> Result<f32> {
        let room = !self.run.fraction;
        let middle = speed_at(&self.run, self.run.fraction + room / 2)?;
        Ok(contact::arc_about(&middle, fraction_to_f32(room)))
    }

    /// Goes to the start of the next patch along the pass; false at the pass's end.
    #[inline(never)]
    fn next_span(&mut self) -> Result<bool> {
        let spans = self.program.header().path_spans;
        let next = if self.run.reversed {
            self.run.span.checked_sub(1)
        } else {
            self.run.span.checked_add(1)
        };
        let Some(span) = next.filter(|span| *span < spans) else {
            return Ok(false);
        };
        self.run.span = span;
        self.run.fraction = 0;
        collapse(&self.program, &mut self.run)?;
        Ok(true)
    }

    /// Begins the pass at the current side place.
    #[inline(never)]
    fn begin_pass(&mut self) -> Result<()> {
        let header = self.program.header();
        self.run.reversed = header.pattern == Pattern::Zigzag && self.run.pass % 2 == 1;
        self.run.span = if self.run.reversed {
            header.path_spans.saturating_sub(1)
        } else {
            0
        };
        self.run.fraction = 0;
        self.run.least = f32::INFINITY;
        self.run.next = Next::Along;
        collapse(&self.program, &mut self.run)
    }

    /// Least interval of the pass that is over, in units of the side parameter.
    fn note_interval(&mut self) {
        self.last_interval = self.run.least * self.program.side_width(self.run.side.span);
    }

    /// The side place of the next pass; its first sample is a neighbour of the last pass's first, or of its last where the
    /// passes run to and fro.
    fn step_over(&mut self) -> Result<()> {
        self.note_interval();
        let program = &self.program;
        let spans = program.header().side_spans;
        let width = |span| program.side_width(span);
        self.run.side = schedule::next_side(self.run.side, self.run.least, spans, width)?;
        self.run.pass = self.run.pass.wrapping_add(1);
        if program.header().pattern == Pattern::Zig {
            self.run.normal = self.run.first_normal;
        }
        Ok(())
    }

    fn end_pass(&mut self) {
        let last = schedule::is_last(self.run.side, self.program.header().side_spans);
        self.run.next = if last { Next::End } else { Next::Over };
    }
}

/// Collapses the patch where the run is.
fn collapse<const WORDS: usize>(program: &Program<WORDS>, run: &mut Run) -> Result<()> {
    let header = program.header();
    let at = PassLine {
        side: centred(run.side.fraction),
        reversed: run.reversed,
        tool_sign: if header.tool_side == ToolSide::Plus {
            1.0
        } else {
            -1.0
        },
    };
    let surface = program.collapse(run.span, run.side, &at)?;
    run.point = surface.is_point();
    run.offset = Offset::new(header.ball_radius_mm, surface.shift());
    run.surface = Some(surface);
    Ok(())
}

/// The parametrisation at another fraction of the patch.
#[inline(never)]
fn speed_at(run: &Run, fraction: u64) -> Result<PathSpeed> {
    Ok(contact_at(run, fraction)?.0.path)
}

/// The contact where the run is, and the origin it is relative to.
#[inline(always)]
fn contact_here(run: &Run) -> Result<(Contact, [i32; 3])> {
    contact_at(run, run.fraction)
}

/// The contact at a fraction of the patch, in the direction of travel.
#[inline(always)]
fn contact_at(run: &Run, fraction: u64) -> Result<(Contact, [i32; 3])> {
    match &run.surface {
        Some(surface) => surface.contact(fraction),
        None => Err(Fault::new(FaultKind::WrongState, 0.0)),
    }
}
