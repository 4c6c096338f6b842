//! Anybody's motion against the exact surface: positions of the ball's centre, one a period, and nothing else.
//!
//! ```text
//! positions ──closest.rs──► contact (nearest point), path error, contact feed, side of the ball
//!     ├────────swept──────► heights over the whole surface: scallop, gouge
//!     ├────────reach──────► neck, shank and holder against surface, stock and fixtures
//!     └────────motion─────► use of the axis limits
//! ```
//!
//! The motion need not follow lines of the surface and has no parameters, so ridges are searched over the whole surface instead of pass by pass.

mod closest;
mod failures;
mod stretches;

pub use closest::{NearestPoint, Projector};
pub use failures::SCALLOP_SLACK;

use glam::DVec3;
use job::Job;
use job::units::NM_PER_MM;
use oracle::Oracle;

use crate::motion::{Peak, PeakMeter};
use crate::reach::{self, Motion, ReachResult};
use crate::survey::SampleObserver;
use crate::swept::{AxisTravel, FieldPoint, HeightField, Progress, ToolPath, height_field};

use stretches::Stretches;

/// A centre farther than this from the radius, as a share of the radius, is off the surface.
const CONTACT_SHARE: f64 = 0.1;
/// Least distance from the radius at which a centre is off the surface, mm; for small balls.
const CONTACT_MIN_MM: f64 = 0.05;
/// Share of the programmed feed that a period must reach to count for the ripple.
const AT_FEED: f64 = 0.9;
/// Number of periods on either side that must reach [`AT_FEED`], too: that leaves ramps out.
const RAMP_PERIODS: usize = 50;
/// A step of more than this many programmed steps is a jump: a link that the motion leaves out.
const JUMP_STEPS: f64 = 3.0;

/// Statistics of the contact's feed, mm/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactFeed {
    /// Least and largest, over all periods in contact; `None` without one.
    pub range: Option<[f64; 2]>,
    /// Mean over time in contact; `None` likewise.
    pub mean: Option<f64>,
    /// Root mean square deviation from the programmed feed, %, over periods at 90 % of it or more, 50 periods from slower ones; `None` without one.
    pub ripple_rms_pct: Option<f64>,
    /// Largest such deviation, %.
    pub ripple_max_pct: Option<f64>,
}

/// A place on the motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionPoint {
    /// Index of the sample, from 0.
    pub sample: usize,
    /// Parameters of the contact.
    pub uv: [f64; 2],
    /// Value there.
    pub value: f64,
}

/// The figures of a motion.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Number of samples.
    pub samples: usize,
    /// Of them in contact.
    pub in_contact: usize,
    /// Steps in contact of more than three programmed ones; they do not count as feed.
    pub jumps: usize,
    /// Time of the whole, s.
    pub time_s: f64,
    /// The contact's feed.
    pub feed: ContactFeed,
    /// Largest distance of the centre from the exact offset surface while in contact, mm; below zero towards the surface. Where the tool comes
    /// to the surface or leaves it, the distance does not count: what is then left of the material is in the heights. `None` without contact.
    pub path_error_mm: Option<MotionPoint>,
    /// Root mean square of that distance, mm.
    pub path_error_rms_mm: Option<f64>,
    /// Samples whose contact is on the ball's upper half (spindle along z).
    pub above_equator: usize,
    /// The steepest contact: z of the tool normal; `None` without contact.
    pub steepest: Option<MotionPoint>,
    /// Heights left on the surface.
    pub field: HeightField,
    /// Heights left along lines of the surface, thinned, for a picture.
    pub field_lines: Vec<Vec<FieldPoint>>,
    /// The reach of the tool.
    pub reach: ReachResult,
    /// The ways off the surface, mm.
    pub links_mm: Vec<Vec<DVec3>>,
    /// Length of the contact's way, mm.
    pub contact_length_mm: f64,
    /// Number of stretches in contact.
    pub stretches: u32,
    /// Travel of the axes, over all samples.
    pub travel: AxisTravel,
    /// Use of the limits of velocity, acceleration and jerk; `None`: it is not the motion's own ([`Judged::of_program`]).
    pub axes: [Option<Peak>; 3],
}

impl Judged {
    /// The figures of a program's positions: each move at its feed from its first period to its last. Acceleration and jerk are the machine's that runs the program.
    #[must_use]
    pub fn of_program(mut self) -> Self {
        [_, self.axes[1], self.axes[2]] = [None; 3];
        self
    }

    /// The deepest gouge, mm: a ball below the surface. `None` where no place is measured.
    #[must_use]
    pub fn gouge_mm(&self) -> Option<f64> {
        Some((-self.field.lowest?.height_mm).max(0.0))
    }

    /// Height of the highest place that is left, mm; `None` likewise.
    #[must_use]
    pub fn highest_mm(&self) -> Option<f64> {
        Some(self.field.highest?.height_mm)
    }
}

/// Judges the positions of the ball's centre, mm, one for each of the job's periods. `each` is called for every sample in contact; a stretch in
/// contact takes the place of a pass.
#[must_use]
pub fn judge(
    job: &Job,
    oracle: &Oracle,
    centres_mm: &[DVec3],
    each: Option<&mut SampleObserver<'_>>,
    progress: &dyn Progress,
) -> Judged {
    let period_s = job.machine.period_s();
    let mut meter = PeakMeter::new(&job.machine);
    let mut path = ToolPath::default();
    let projector = Projector::new(oracle);
    let contact_mm = (CONTACT_SHARE * oracle.radius_mm).max(CONTACT_MIN_MM);
    let mut state = Contacts::new(job.feed_mm_s(), period_s);
    let mut last: Option<NearestPoint> = None;
    let mut motion = Ways::default();
    let mut stretches = Stretches::new(each, job, oracle.radius_mm);
    progress.begin("contacts", centres_mm.len() as u64);
    for (index, centre_mm) in centres_mm.iter().enumerate() {
        #[allow(clippy::cast_possible_truncation, reason = "positions are within two metres")]
        let cl_nm = (*centre_mm * NM_PER_MM).round().to_array().map(|nm| nm as i32);
        let near = last.map(|last| projector.nearest_from(*centre_mm, last.uv));
        let fits = |near: &NearestPoint| (near.distance_mm - oracle.radius_mm).abs() <= contact_mm;
        let nearest = near.filter(fits).unwrap_or_else(|| projector.nearest(*centre_mm));
        let touches = fits(&nearest) && on_side(oracle, &nearest, *centre_mm);
        let mut jumps = false;
        if touches {
            let sample = Sample {
                index,
                nearest,
                centre_mm: *centre_mm,
            };
            jumps = state.add(oracle, &sample, last.as_ref());
            let first = last.is_none() || jumps;
            path.add_centre(cl_nm, first);
            stretches.add(&sample, first, state.step_mm);
        } else {
            state.leave();
        }
        // Without limits a motion may leave out its links.
        let is_left_out = jumps && !job.machine.has_limits();
        motion.add(cl_nm, touches, jumps, is_left_out);
        if is_left_out {
            meter.discontinuity();
        }
        meter.add(index as u64, cl_nm);
        last = touches.then_some(nearest);
        progress.done(1);
    }
    let motion = motion.finish();
    let (field, field_lines) = height_field(oracle, &path, progress);
    let stretches = stretches.finish();
    let around = Around {
        field,
        field_lines,
        reach: reach::measure(job, oracle, &motion, &stretches.contact, progress),
        links_mm: motion.links(),
        stretches: stretches.count,
        travel: AxisTravel::new(extent_mm(centres_mm), &job.machine),
    };
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let time_s = centres_mm.len() as f64 * period_s;
    state.finish(centres_mm.len(), time_s, around, meter.peaks().map(Some))
}

/// The motion with its ways off the surface. What is between a sample in contact and one that is not, or one to which the contact jumps, is no pass: such a way begins with the
/// sample in contact.
#[derive(Default)]
struct Ways {
    motion: Motion,
    /// The last sample: position, whether it is in contact, whether nothing is between it and the one before.
    last: Option<([i32; 3], bool, bool)>,
}

impl Ways {
    fn add(&mut self, cl_nm: [i32; 3], touches: bool, jumps: bool, is_left_out: bool) {
        self.flush(touches && (is_left_out || !jumps));
        self.last = Some((cl_nm, touches, is_left_out));
    }

    /// Adds the last sample; `goes_on`: the contact does.
    fn flush(&mut self, goes_on: bool) {
        if let Some((cl_nm, touches, is_left_out)) = self.last.take() {
            self.motion.add(cl_nm, touches && goes_on, is_left_out);
        }
    }

    fn finish(mut self) -> Motion {
        self.flush(true);
        self.motion
    }
}

/// Whether the centre is on the tool's side of the surface.
fn on_side(oracle: &Oracle, nearest: &NearestPoint, centre_mm: DVec3) -> bool {
    let [u, v] = nearest.uv;
    let normal = oracle.normal(&oracle.surface.at(u, v), u, v);
    normal.is_ok_and(|normal| (centre_mm - nearest.point_mm).dot(normal) > 0.0)
}

/// What is measured besides the samples in contact.
struct Around {
    field: HeightField,
    field_lines: Vec<Vec<FieldPoint>>,
    reach: ReachResult,
    links_mm: Vec<Vec<DVec3>>,
    stretches: u32,
    travel: AxisTravel,
}

/// Least and greatest position of each axis, mm.
fn extent_mm(centres_mm: &[DVec3]) -> Option<[[f64; 2]; 3]> {
    let low = centres_mm.iter().copied().reduce(DVec3::min)?;
    let high = centres_mm.iter().copied().reduce(DVec3::max)?;
    Some(std::array::from_fn(|axis| [low[axis], high[axis]]))
}

/// A sample in contact.
struct Sample {
    /// From 0.
    index: usize,
    /// Its contact.
    nearest: NearestPoint,
    centre_mm: DVec3,
}

/// Sums over the samples in contact.
struct Contacts {
    feed_mm_s: f64,
    period_s: f64,
    /// Length of the last step, mm; `None` after a jump and at the first sample of a stretch.
    step_mm: Option<f64>,
    length_mm: f64,
    count: usize,
    jumps: usize,
    /// Speed of every period in contact, mm/s; `None` between stretches.
    speeds: Vec<Option<f64>>,
    /// Errors of the present stretch.
    stretch: Vec<MotionPoint>,
    error: Option<MotionPoint>,
    error_squares: f64,
    errors: usize,
    above: usize,
    steepest: Option<MotionPoint>,
}

impl Contacts {
    fn new(feed_mm_s: f64, period_s: f64) -> Self {
        Self {
            feed_mm_s,
            period_s,
            step_mm: None,
            length_mm: 0.0,
            count: 0,
            jumps: 0,
            speeds: Vec::new(),
            stretch: Vec::new(),
            error: None,
            error_squares: 0.0,
            errors: 0,
            above: 0,
            steepest: None,
        }
    }

    /// Adds a sample in contact; `before`: the contact of the sample before it. Returns whether the motion jumps to it.
    fn add(&mut self, oracle: &Oracle, sample: &Sample, before: Option<&NearestPoint>) -> bool {
        let Sample {
            index,
            nearest,
            centre_mm,
        } = sample;
        self.count += 1;
        let point = |value| MotionPoint {
            sample: *index,
            uv: nearest.uv,
            value,
        };
        self.stretch.push(point(nearest.distance_mm - oracle.radius_mm));
        let up = (centre_mm - nearest.point_mm).z / nearest.distance_mm.max(f64::MIN_POSITIVE);
        self.above += usize::from(up < 0.0);
        if self.steepest.is_none_or(|steepest| up < steepest.value) {
            self.steepest = Some(point(up));
        }
        self.step_mm = None;
        let Some(before) = before else {
            return false;
        };
        let step_mm = arc_mm(oracle, before, nearest);
        let speed = step_mm / self.period_s;
        let jumps = speed > JUMP_STEPS * self.feed_mm_s;
        if !jumps {
            self.step_mm = Some(step_mm);
            self.length_mm += step_mm;
        }
        self.jumps += usize::from(jumps);
        self.speeds.push((!jumps).then_some(speed));
        jumps
    }

    /// The tool leaves the surface: the errors of the stretch count, except those of coming and leaving.
    fn leave(&mut self) {
        let errors = std::mem::take(&mut self.stretch);
        let falls = |pair: &[MotionPoint]| pair[0].value > 0.0 && pair[1].value < pair[0].value;
        let coming = errors.windows(2).take_while(|pair| falls(pair)).count();
        let rises = |pair: &[MotionPoint]| pair[1].value > 0.0 && pair[1].value > pair[0].value;
        let leaving = errors.windows(2).rev().take_while(|pair| rises(pair)).count();
        let counted = errors.get(coming..errors.len() - leaving).unwrap_or_default();
        for error in counted {
            self.errors += 1;
            self.error_squares += error.value * error.value;
            if self.error.is_none_or(|most| error.value.abs() > most.value.abs()) {
                self.error = Some(*error);
            }
        }
        self.speeds.push(None);
    }

    /// Largest and mean square deviation from the feed, %, away from ramps; `None` where all is a ramp.
    fn ripple_pct(&self) -> Option<[f64; 2]> {
        let slow = |speed: &Option<f64>| speed.is_none_or(|speed| speed < AT_FEED * self.feed_mm_s);
        // Periods since the last slow one, in both directions.
        let mut since = vec![0_usize; self.speeds.len()];
        let mut last = 0;
        for (since, speed) in since.iter_mut().zip(&self.speeds) {
            last = if slow(speed) { 0 } else { last + 1 };
            *since = last;
        }
        let (mut next, mut most, mut squares, mut count) = (0_usize, 0.0_f64, 0.0, 0_usize);
        for (since, speed) in since.iter().zip(&self.speeds).rev() {
            next = if slow(speed) { 0 } else { next + 1 };
            if let (Some(speed), true) = (speed, next.min(*since) > RAMP_PERIODS) {
                let off = 100.0 * (speed / self.feed_mm_s - 1.0);
                most = most.max(off.abs());
                squares += off * off;
                count += 1;
            }
        }
        Some([most, per(squares, count)?])
    }

    fn finish(mut self, samples: usize, time_s: f64, around: Around, axes: [Option<Peak>; 3]) -> Judged {
        self.leave();
        let speeds = || self.speeds.iter().flatten().copied();
        let ripple = self.ripple_pct();
        let mean = per(speeds().sum(), speeds().count());
        let range = [
            speeds().fold(f64::INFINITY, f64::min),
            speeds().fold(0.0, f64::max),
        ];
        Judged {
            samples,
            in_contact: self.count,
            jumps: self.jumps,
            time_s,
            feed: ContactFeed {
                range: mean.map(|_| range),
                mean,
                ripple_rms_pct: ripple.map(|[_, mean_square]| mean_square.sqrt()),
                ripple_max_pct: ripple.map(|[most, _]| most),
            },
            path_error_mm: self.error,
            path_error_rms_mm: per(self.error_squares, self.errors).map(f64::sqrt),
            above_equator: self.above,
            steepest: self.steepest,
            field: around.field,
            field_lines: around.field_lines,
            reach: around.reach,
            links_mm: around.links_mm,
            contact_length_mm: self.length_mm,
            stretches: around.stretches,
            travel: around.travel,
            axes,
        }
    }
}

#[allow(clippy::cast_precision_loss, reason = "below 2^53")]
fn per(sum: f64, count: usize) -> Option<f64> {
    (count > 0).then(|| sum / count as f64)
}

/// Length of the contact's way between two points, mm: the chord, and by how much a circle through both with the tangents of the surface
/// is longer. The turn of the normal gives the circle.
fn arc_mm(oracle: &Oracle, from: &NearestPoint, to: &NearestPoint) -> f64 {
    let chord = to.point_mm - from.point_mm;
    let length = chord.length();
    let normal =
        |at: &NearestPoint| oracle.normal(&oracle.surface.at(at.uv[0], at.uv[1]), at.uv[0], at.uv[1]);
    let (Ok(one), Ok(other)) = (normal(from), normal(to)) else {
        return length;
    };
    let turn = (other - one).dot(chord) / length.max(f64::MIN_POSITIVE);
    length * (1.0 + turn * turn / 24.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sample job's groove, a torus, with passes around it: contact at the angle `a` around the axis and `b` across the groove.
    fn centre(radius: f64, a: f64, b: f64) -> DVec3 {
        let (sin, cos) = b.sin_cos();
        let across = 40.0 + (8.0 - radius) * sin;
        DVec3::new(across * a.cos(), across * a.sin(), -(8.0 - radius) * cos)
    }

    fn torus(scallop_mm: f64) -> (Job, Oracle) {
        let mut job = job_file::parse("torus.toml", include_str!("../../../../jobs/torus.toml")).unwrap();
        job.scallop_mm = scallop_mm;
        let oracle = Oracle::new(&job).unwrap();
        (job, oracle)
    }

    /// Passes at even angles across the groove, at a feed with a ripple of 2 %, with the centre `high` above where it should be.
    fn passes(count: u32, high: f64, ripple: f64) -> Vec<DVec3> {
        let mut centres = Vec::new();
        for pass in 0..=count {
            let b = (f64::from(pass) / f64::from(count) * 2.0 - 1.0) * 60.0_f64.to_radians();
            let mut a = 0.0;
            let mut k = 0_u32;
            while a < std::f64::consts::FRAC_PI_2 {
                centres.push(centre(5.0 + high, a, b));
                let step = 0.01 * (1.0 + ripple * (f64::from(k) * 0.05).sin());
                a += step / (40.0 + 8.0 * b.sin());
                k += 1;
            }
            centres.push(centre(5.0 + high, std::f64::consts::FRAC_PI_2, b));
        }
        centres
    }

    fn error_mm(judged: &Judged) -> f64 {
        judged.path_error_mm.unwrap().value
    }

    /// What no sample tells is no figure of 0: a motion that never touches, one below the feed.
    #[test]
    fn what_is_not_measured_has_no_figure() {
        let (job, oracle) = torus(0.05);
        let away = judge(&job, &oracle, &[DVec3::Z * 100.0; 3], None, &());
        assert_eq!((away.feed, away.path_error_mm), (ContactFeed::default(), None));
        assert_eq!((away.path_error_rms_mm, away.steepest), (None, None));
        let slow: Vec<DVec3> = (0..300).map(|k| centre(5.0, 1e-5 * f64::from(k), 0.0)).collect();
        let slow = judge(&job, &oracle, &slow, None, &());
        assert!(
            slow.feed.mean.is_some() && slow.feed.ripple_max_pct.is_none(),
            "{:?}",
            slow.feed
        );
    }

    #[test]
    fn a_known_motion_has_its_figures() {
        let (job, oracle) = torus(0.05);
        let judged = judge(&job, &oracle, &passes(12, 0.0, 0.02), None, &());
        assert_eq!((judged.in_contact, judged.jumps), (judged.samples, 12));
        assert!(error_mm(&judged).abs() < 2e-6, "{:?}", judged.path_error_mm);
        let feed = judged.feed;
        assert!((feed.ripple_max_pct.unwrap() - 2.0).abs() < 0.01, "{feed:?}");
        assert!((feed.ripple_rms_pct.unwrap() - 2.0_f64 / 2.0_f64.sqrt()).abs() < 0.02);
        assert!((feed.mean.unwrap() - 10.0).abs() < 0.02);
        // Balls on a circle of 8 - 5 mm inside one of 8 mm: the crest is half-way, 5 degrees from both.
        let (sin, cos) = 5.0_f64.to_radians().sin_cos();
        let crest = 3.0 * cos + (25.0 - (3.0 * sin).powi(2)).sqrt();
        let exact = 8.0 - crest;
        assert!(
            (judged.highest_mm().unwrap() - exact).abs() < 2e-3 * exact,
            "{:?} for {exact}",
            judged.highest_mm()
        );
        assert!(judged.gouge_mm().unwrap() < 5e-6 && judged.field.uncut_share == Some(0.0));
        assert_eq!(judged.above_equator, 0);
    }

    #[test]
    fn a_motion_too_deep_or_too_high_is_seen() {
        let (job, oracle) = torus(0.05);
        let deep = judge(&job, &oracle, &passes(12, -0.004, 0.0), None, &());
        assert!((error_mm(&deep) + 0.004).abs() < 5e-6, "{:?}", deep.path_error_mm);
        let gouge_mm = deep.gouge_mm().unwrap();
        assert!((gouge_mm - 0.004).abs() < 5e-6, "{gouge_mm}");
        let high = judge(&job, &oracle, &passes(12, 0.003, 0.0), None, &());
        assert!((error_mm(&high) - 0.003).abs() < 5e-6);
        assert!(high.gouge_mm() == Some(0.0) && high.field.mean_mm > Some(0.003));
        // Half of the groove is left out.
        let half: Vec<DVec3> = passes(12, 0.0, 0.0)
            .into_iter()
            .filter(|centre| centre.y > centre.x)
            .collect();
        let uncut = judge(&job, &oracle, &half, None, &()).field.uncut_share.unwrap();
        assert!(uncut > 0.3 && uncut < 0.5, "{uncut}");
    }

    /// Sentence and place of a failure come from one decision. The height of places that no ball reaches is no failure besides that of the uncut surface.
    #[test]
    fn failures_are_decided_once() {
        let (job, oracle) = torus(0.05);
        let deep = judge(&job, &oracle, &passes(12, -0.004, 0.0), None, &());
        let says = |judged: &Judged, tolerance_mm, words: &str| {
            let failures = judged.failures(&job, tolerance_mm);
            failures.iter().any(|failure| failure.contains(words))
        };
        for (tolerance_mm, fails) in [(0.0035, true), (0.0045, false)] {
            assert_eq!(says(&deep, tolerance_mm, "below the surface"), fails);
            assert_eq!(says(&deep, tolerance_mm, "off the exact offset surface"), fails);
            assert_eq!(deep.violating_gouge(tolerance_mm).is_some(), fails);
        }
        // Five passes leave more than the limit of 0.05 mm.
        let coarse = judge(&job, &oracle, &passes(5, 0.0, 0.0), None, &());
        assert!(says(&coarse, 0.01, "the scallop is") && coarse.violating_scallop(&job).is_some());
        let half: Vec<DVec3> = passes(12, 0.0, 0.0)
            .into_iter()
            .filter(|centre| centre.y > centre.x)
            .collect();
        let uncut = judge(&job, &oracle, &half, None, &());
        assert!(says(&uncut, 0.01, "no ball reaches") && !says(&uncut, 0.01, "the scallop is"));
        assert_eq!(uncut.violating_scallop(&job), None);
        let away = judge(&job, &oracle, &[DVec3::Z * 100.0; 3], None, &());
        assert!(says(&away, 0.01, "never touches the surface"));
    }

    /// A program has no acceleration of its own: every corner of it is above any limit. Its velocity is judged.
    #[test]
    fn a_program_is_judged_by_its_velocity() {
        let (mut job, oracle) = torus(0.05);
        let mut limits = job::AxisLimits::DEFAULT;
        job.machine.limits = Some(limits);
        let centres = passes(12, 0.0, 0.0);
        let of = |job: &Job| judge(job, &oracle, &centres, None, &());
        let failures = |judged: Judged, job: &Job| judged.failures(job, 0.01).join("; ");
        let samples = failures(of(&job), &job);
        assert!(
            samples.contains("acceleration") && samples.contains("jerk"),
            "{samples}"
        );
        let program = of(&job).of_program();
        assert!(program.axes[0].is_some() && program.axes[1..] == [None; 2]);
        let program = failures(program, &job);
        assert!(
            !program.contains("acceleration") && !program.contains("jerk"),
            "{program}"
        );
        limits.velocity_mm_s = [5.0; 3];
        job.machine.limits = Some(limits);
        let slow = failures(of(&job).of_program(), &job);
        assert!(slow.contains("of its velocity limit"), "{slow}");
    }

    /// The step from the last contact to the first sample off the surface is a way between passes: here from one end of the groove through its flank to the other.
    #[test]
    fn a_way_off_the_surface_begins_in_contact() {
        let (job, oracle) = torus(0.05);
        let mut centres: Vec<DVec3> = (0..50)
            .rev()
            .map(|k| centre(5.0, 2.5e-4 * f64::from(k), 0.0))
            .collect();
        let reach = |centres: &[DVec3]| judge(&job, &oracle, centres, None, &()).reach.failures.join("; ");
        assert_eq!(reach(&centres), "");
        centres.push(DVec3::new(0.0, 40.0, -2.0));
        let failures = reach(&centres);
        assert!(failures.contains("the surface between passes"), "{failures}");
    }

    /// A region's scallops are those that its passes serve; a gouge counts wherever it is.
    #[test]
    fn gouges_beside_a_region_are_seen() {
        let (mut job, _) = torus(0.05);
        let [[u0, u1], [v0, v1]] = job.surface.domain();
        let half = vec![[u0, v0], [u1, v0], [u1, 0.5 * (v0 + v1)], [u0, 0.5 * (v0 + v1)]];
        job.region = Some(job::Region::new(vec![half]));
        let oracle = Oracle::new(&job).unwrap();
        let projector = Projector::new(&oracle);
        let lowered = |centre: DVec3| {
            let at = projector.nearest(centre);
            let [u, v] = at.uv;
            let depth_mm = if oracle.is_in_region(u, v) { 0.0 } else { 0.004 };
            centre + (at.point_mm - centre).normalize() * depth_mm
        };
        let centres: Vec<DVec3> = passes(12, 0.0, 0.0)
            .into_iter()
            .step_by(20)
            .map(lowered)
            .collect();
        let gouge_mm = judge(&job, &oracle, &centres, None, &()).gouge_mm().unwrap();
        assert!(gouge_mm > 0.0035, "{gouge_mm}");
    }

    /// The travel counts for every sample, those off the surface too.
    #[test]
    fn a_motion_beyond_the_travel_is_no_pass() {
        let (mut job, oracle) = torus(0.05);
        job.machine.travel_mm = Some([[-100.0, 100.0], [-100.0, 100.0], [-100.0, 20.0]]);
        let mut centres = passes(12, 0.0, 0.0);
        let says = |centres: &[DVec3]| {
            let failures = judge(&job, &oracle, centres, None, &()).failures(&job, 0.01);
            failures
                .iter()
                .any(|failure| failure.contains("machine.travel_mm"))
        };
        assert!(!says(&centres));
        centres.push(DVec3::new(0.0, 0.0, 21.0));
        assert!(says(&centres));
    }

    /// A plunge, a way along the groove and a retract: the way alone has an error.
    #[test]
    fn coming_and_leaving_are_no_errors() {
        let (job, oracle) = torus(0.05);
        let mut centres: Vec<DVec3> = (0..300)
            .map(|k| centre(5.0, 0.3, 0.0) + DVec3::Z * (6.0 - 0.02 * f64::from(k)))
            .collect();
        centres.extend((0..1000).map(|k| centre(5.001, 0.3 + 0.00025 * f64::from(k), 0.0)));
        let end = *centres.last().unwrap();
        centres.extend((1..300).map(|k| end + DVec3::Z * 0.02 * f64::from(k)));
        let judged = judge(&job, &oracle, &centres, None, &());
        assert!(
            (error_mm(&judged) - 0.001).abs() < 5e-6,
            "{:?}",
            judged.path_error_mm
        );
        assert!(judged.in_contact >= 1000 && judged.in_contact < 1100);
    }

    /// Nearest points from afar, and where the nearest is on the boundary.
    #[test]
    fn nearest_points_are_nearest() {
        let (_, oracle) = torus(0.05);
        let projector = Projector::new(&oracle);
        for (a, b, off) in [
            (0.2, 0.5, 3.0),
            (1.5, -1.0, 5.0),
            (0.0, 0.0, 7.0),
            (0.7, 1.0, 4.99),
        ] {
            let at = centre(off, a, b);
            let nearest = projector.nearest(at);
            assert!((nearest.distance_mm - off).abs() < 1e-9, "{nearest:?}");
        }
        // Beyond the groove's end, at the angle 0: the end's own point.
        let nearest = projector.nearest(DVec3::new(40.0, -10.0, -3.0));
        let (to_circle, back) = (5.0_f64, 10.0_f64);
        assert!(
            (nearest.distance_mm - to_circle.hypot(back)).abs() < 1e-9,
            "{nearest:?}"
        );
    }
}
