//! The verification of a job: every sample, the swept ball, travel, limits, the optimum.

use std::collections::BTreeMap;

use glam::DVec3;
use interp_core::{Sample, State};
use job::{Job, units};
use machine::prepare::Prepared;
use machine::travel;
use oracle::{AccuracyBounds, PassSample};
use verify::motion::{
    JobTimes, OptimumTimes, PassEnd, PeakMeter, Peaks, RunPass, TimeMeter, limits, optimum_times, times,
};
use verify::reach::{self, ContactPlace, ContactSide, Motion, ReachResult};
use verify::survey::{SampleObserver, Survey, SurveyResult};
use verify::swept::{self, Progress, ToolPath};
use verify::{EmittedSample, Verdict};

use crate::curved::{CurvedFigures, curved_figures};
use crate::run::{PROGRESS_SAMPLES, machine, oracle};
use crate::{InspectError, TimedRun, plain};

/// Bounds of every sample, as in the README.
pub const BOUNDS: AccuracyBounds = AccuracyBounds {
    position_nm: 10.0,
    contact_nm: 10.0,
    normal_rad: 1e-6,
    ripple_pct: 0.001,
    interval: 1e-5,
    side_step: 1e-5,
    fit: 1.0,
};

/// Use of the axis limits, sample by sample. With limits: from standstill to standstill, links included. Without limits: within passes only,
/// because the feed steps between them, and without the last step of a pass, which is shorter than the others.
struct AxesUse {
    gauge: PeakMeter,
    has_limits: bool,
    begun: bool,
}

impl AxesUse {
    fn new(job: &Job) -> Self {
        Self {
            gauge: PeakMeter::new(&job.machine),
            has_limits: job.machine.has_limits(),
            begun: false,
        }
    }

    /// A sample as emitted by the machine.
    fn emitted(&mut self, tick: u32, cl_nm: [i32; 3]) {
        if self.has_limits {
            if !std::mem::replace(&mut self.begun, true) {
                self.gauge.start_at_rest(cl_nm);
            }
            self.gauge.add(tick.into(), cl_nm);
        }
    }

    /// A sample on a pass.
    fn on_pass(&mut self, sample: &PassSample) {
        if self.has_limits || sample.last_of_pass {
            return;
        }
        if sample.first_of_pass {
            self.gauge.discontinuity();
        }
        self.gauge.add(sample.tick, sample.cl_nm);
    }

    fn finish(mut self) -> Peaks {
        if self.has_limits {
            self.gauge.end_at_rest();
        }
        self.gauge.peaks()
    }
}

/// The figures of a verified run.
pub struct RunMeasurements {
    /// Every sample against the oracle.
    pub findings: SurveyResult,
    /// The swept ball against the surface.
    pub swept: swept::SweptResult,
    /// The reach of the tool.
    pub reach: ReachResult,
    /// The ways of the ball's centre between passes, turns along the boundary included, mm.
    pub links_mm: Vec<Vec<DVec3>>,
    /// Use of the axis limits.
    pub axes: Peaks,
    /// The time and its parts.
    pub times: JobTimes,
    /// Passes and the whole job against the optimum; empty if not requested.
    pub optimum: OptimumTimes,
    /// Passes of constant scallop height beside straight ones; `None` for a job of straight passes, and where a warning says why.
    pub curved: Option<CurvedFigures>,
}

/// A verified job.
pub struct Verification {
    /// The figures.
    pub measured: RunMeasurements,
    /// Number of passes by a dense scan of the surface; `None` if the oracle has no result.
    pub scanned: Option<usize>,
    /// Reasons against the job, most severe first. Empty: passed.
    pub failures: Vec<String>,
    /// Conditions to know that are not failures.
    pub warnings: Vec<String>,
}

/// Number of passes by a dense scan of the surface.
#[derive(Clone, Copy, Debug)]
struct ScannedPasses {
    count: usize,
    /// Least and greatest number where each step has the error that it may have.
    within: [usize; 2],
}

impl ScannedPasses {
    /// `None` where the oracle has no result.
    fn new(oracle: &oracle::Oracle) -> Option<Self> {
        let count = |factor: f64| oracle.schedule_scaled(factor).ok().map(|passes| passes.len());
        let exact = count(1.0)?;
        let ends =
            [1.0 + BOUNDS.interval, 1.0 - BOUNDS.interval].map(|factor| count(factor).unwrap_or(exact));
        Some(Self {
            count: exact,
            within: [ends[0].min(exact), ends[1].max(exact)],
        })
    }

    /// The reason against a run of so many passes. Fewer are right where every crest between them is measured and within the limit: the scan takes the closest
    /// step of its rule, which at skew ends of passes is shorter than the height asks for.
    fn failure(&self, passes: usize, crests: Verdict) -> Option<String> {
        let [least, most] = self.within;
        let is_right = (least..=most).contains(&passes) || (passes < least && crests == Verdict::Met);
        let remedy = if passes > most {
            "the job is machined with more passes than its scallop height asks for"
        } else {
            "the scallop height is not shown to keep its limit with fewer"
        };
        (!is_right).then(|| {
            format!(
                "{passes} passes, but a dense scan of the surface needs {}: {remedy}",
                self.count
            )
        })
    }
}

/// What a verification computes and requires besides the bounds of every sample.
#[derive(Clone, Copy, Default)]
pub struct Requirements<'a> {
    /// Computes the optimum of the first, the middle and the last pass; with limits also of those that could be slowest.
    pub with_optimum: bool,
    /// Requirements of the swept ball.
    pub swept: swept::Requirements<'a>,
    /// The same job with straight passes, beside which those of constant scallop height are measured; without it such a job is compared with its own, without the words of
    /// its links.
    pub straight: Option<(&'a Job, &'a Prepared)>,
}

/// Verifies a job after its timed run. `each` is called for every sample on a pass.
///
/// # Errors
/// The core refuses the job, or the oracle has no result for it.
pub fn verify_run(
    job: &Job,
    prepared: &Prepared,
    timed: &TimedRun,
    each: Option<&mut SampleObserver<'_>>,
    requirements: &Requirements<'_>,
    progress: &dyn Progress,
) -> Result<Verification, InspectError> {
    let mut measured = measure(job, prepared, timed, each, requirements, progress)?;
    let without_curved = match curved_figures(job, prepared, requirements.straight) {
        Ok(curved) => {
            measured.curved = curved;
            None
        }
        Err(error) => Some(format!("the passes are not compared with straight ones: {error}")),
    };
    // Curved passes are checked by the scallop height alone; those of a region line by line, because a line more or less may pass by a vertex or meet it.
    let scanned = match job.spacing.is_constant() || job.region.is_some() {
        true => None,
        false => ScannedPasses::new(&oracle(job)?),
    };
    let failures = failures(job, timed, &measured, scanned);
    let scanned = scanned.map(|scanned| scanned.count);
    let own = |warning: &&String| !failures.contains(warning);
    let mut warnings: Vec<String> = measured.swept.warnings.iter().filter(own).cloned().collect();
    warnings.extend(times::warning(&measured.times));
    warnings.extend(without_curved);
    Ok(Verification {
        measured,
        scanned,
        failures,
        warnings,
    })
}

/// The meters of a run, in the order of its samples.
struct Meters<'a> {
    job: &'a Job,
    oracle: &'a oracle::Oracle,
    track: ToolPath,
    turn: TurnEnds<'a>,
    /// By pass, ticks and path parameters of the samples that the tool path leaves out.
    slow: BTreeMap<u32, Vec<(u64, f64)>>,
    running: BTreeMap<u32, PassSamples>,
    last_pass: Option<u32>,
    axes: AxesUse,
    contact: ContactSide,
    motion: Motion,
    time: TimeMeter,
}

impl<'a> Meters<'a> {
    fn new(job: &'a Job, oracle: &'a oracle::Oracle) -> Self {
        let least = |limits: job::AxisLimits| limits.jerk_mm_s3.into_iter().fold(f64::INFINITY, f64::min);
        let jerk_mm_s3 = job.machine.limits.map(least);
        Self {
            job,
            oracle,
            track: ToolPath::of_job(job),
            turn: TurnEnds::new(oracle),
            slow: BTreeMap::new(),
            running: BTreeMap::new(),
            last_pass: None,
            axes: AxesUse::new(job),
            contact: ContactSide::default(),
            motion: Motion::default(),
            time: TimeMeter::new(job.machine.period_s(), job.feed_mm_s(), jerk_mm_s3),
        }
    }

    /// A sample as emitted by the machine, before the survey has it.
    fn on_sample(&mut self, sample: &Sample, emitted: &EmittedSample) {
        self.axes.emitted(sample.tick, sample.cl_nm);
        if let (State::Running, Some([u, v])) = (sample.state, emitted.parameters) {
            let (path, _) = self.oracle.swapped(u, v);
            let pass = self.running.entry(sample.pass).or_insert(PassSamples {
                count: 0,
                path: [path; 2],
                slow: Vec::new(),
            });
            pass.count += 1;
            pass.path[1] = path;
        }
        self.time.add(emitted);
        // Without limits the passes follow each other without links.
        let jumps =
            self.last_pass.replace(sample.pass) != Some(sample.pass) && !self.job.machine.has_limits();
        self.motion.add(sample.cl_nm, emitted.parameters.is_some(), jumps);
        self.turn.enter(emitted, &mut self.track);
    }

    /// A sample on a pass, once the survey has its next one.
    fn on_pass(&mut self, sample: &PassSample) {
        if !self.track.add(sample, self.job.along) {
            let (path, _) = self.oracle.swapped(sample.u, sample.v);
            self.slow
                .entry(sample.pass)
                .or_default()
                .push((sample.tick, path));
        }
        let centre_mm = units::position_mm(sample.cl_nm).into();
        self.contact.add(contact_place(sample), centre_mm);
        self.axes.on_pass(sample);
    }

    /// The same sample as [`Self::on_sample`], after the survey has it.
    fn after_sample(&mut self, emitted: &EmittedSample) {
        self.turn.leave(emitted, &mut self.track);
    }

    /// The samples of each pass, with those that the tool path leaves out.
    fn passes(&mut self) -> BTreeMap<u32, PassSamples> {
        let mut passes = std::mem::take(&mut self.running);
        for (pass, slow) in std::mem::take(&mut self.slow) {
            if let Some(samples) = passes.get_mut(&pass) {
                samples.slow = slow;
            }
        }
        passes
    }
}

/// Runs the core again and measures every sample, then the swept ball against the surface.
fn measure(
    job: &Job,
    prepared: &Prepared,
    timed: &TimedRun,
    mut each: Option<&mut SampleObserver<'_>>,
    requirements: &Requirements<'_>,
    progress: &dyn Progress,
) -> Result<RunMeasurements, InspectError> {
    let oracle = oracle(job)?;
    let mut meters = Meters::new(job, &oracle);
    let mut survey = Survey::new(&oracle, None);
    let mut written = Ok(());
    progress.begin("measuring", timed.samples);
    let ran = machine(job, prepared)?.run(|sample| {
        let emitted = plain(prepared, sample);
        meters.on_sample(sample, &emitted);
        written = survey.add(&emitted, &mut |sample, checked| {
            meters.on_pass(sample);
            if let Some(each) = &mut each {
                each(sample, checked);
            }
        });
        meters.after_sample(&emitted);
        if u64::from(sample.tick) % PROGRESS_SAMPLES == PROGRESS_SAMPLES - 1 {
            progress.done(PROGRESS_SAMPLES);
        }
        written.is_ok()
    });
    written?;
    let findings = survey.finish(ran.is_ok(), &mut |sample, checked| {
        meters.on_pass(sample);
        if let Some(each) = &mut each {
            each(sample, checked);
        }
    })?;
    let passes = meters.passes();
    let Meters {
        track,
        axes,
        contact,
        mut motion,
        time,
        ..
    } = meters;
    let times = time.finish();
    let swept = swept::measure(job, &oracle, &track, ran.is_ok(), &requirements.swept, progress);
    let links_mm = motion.links();
    motion.join(times.links.iter().map(|link| link.turn));
    let reach = reach::measure(job, &oracle, &motion, &contact, progress);
    let optimum = if requirements.with_optimum && !job.spacing.is_constant() {
        progress.begin("the optimum", 1);
        optimum_times(job, &oracle, &run_passes(&oracle, &track, &passes), &times)
    } else {
        OptimumTimes::default()
    };
    Ok(RunMeasurements {
        findings,
        swept,
        reach,
        links_mm,
        axes: axes.finish(),
        times,
        optimum,
        curved: None,
    })
}

/// The contact of a sample.
fn contact_place(sample: &PassSample) -> ContactPlace {
    ContactPlace {
        sample: usize::try_from(sample.tick).unwrap_or(usize::MAX),
        pass: sample.pass,
        uv: [sample.u, sample.v],
        place_mm: units::position_mm(sample.cc_nm).into(),
    }
}

/// Gives the swept ball the centres of turns next to the passes, so that the surface is swept up to its boundary.
struct TurnEnds<'a> {
    oracle: &'a oracle::Oracle,
    last: Option<EmittedSample>,
}

impl<'a> TurnEnds<'a> {
    const fn new(oracle: &'a oracle::Oracle) -> Self {
        Self { oracle, last: None }
    }

    /// The boundary next to a sample on a pass.
    fn boundary(&self, [u, v]: [f64; 2]) -> f64 {
        let (path, _) = self.oracle.swapped(u, v);
        let [low, high] = self.oracle.path_range();
        if path - low < high - path { low } else { high }
    }

    /// A pass begins with this sample: the one before it is in the turn.
    fn enter(&self, sample: &EmittedSample, track: &mut ToolPath) {
        if let (true, Some(before), Some(at)) = (self.oracle.overruns, &self.last, sample.parameters)
            && before.parameters.is_none()
            && self.boundary(at) != self.oracle.swapped(at[0], at[1]).0
        {
            track.enter(before.cl_nm, self.boundary(at));
        }
    }

    /// A pass has ended before this sample, which is in the turn.
    fn leave(&mut self, sample: &EmittedSample, track: &mut ToolPath) {
        if let (true, Some(before)) = (self.oracle.overruns, &self.last)
            && let (Some(at), None) = (before.parameters, sample.parameters)
            && self.boundary(at) != self.oracle.swapped(at[0], at[1]).0
        {
            track.leave(sample.cl_nm, self.boundary(at));
        }
        self.last = Some(*sample);
    }
}

/// The samples on a pass.
#[derive(Clone, Debug)]
struct PassSamples {
    count: u64,
    /// Path parameters of the first and the last one.
    path: [f64; 2],
    /// Ticks and path parameters of those that the tool path leaves out.
    slow: Vec<(u64, f64)>,
}

/// The passes that ran. An end off the boundary is that of a turn beyond it.
fn run_passes<'a>(
    oracle: &oracle::Oracle,
    track: &'a ToolPath,
    samples: &'a BTreeMap<u32, PassSamples>,
) -> Vec<RunPass<'a>> {
    let of_pass = |pass: usize| samples.get(&u32::try_from(pass).ok()?);
    let end = |path: f64| {
        if oracle.overruns && !oracle.path_range().contains(&path) {
            PassEnd::Free
        } else {
            PassEnd::Rest
        }
    };
    let passes = track.passes.iter().enumerate();
    passes
        .filter_map(|(pass, path)| {
            let samples = of_pass(pass)?;
            Some(RunPass {
                pass,
                track: path,
                slow: &samples.slow,
                samples: samples.count,
                path: samples.path,
                ends: samples.path.map(end),
            })
        })
        .collect()
}

/// Reasons against the job, most severe first.
fn failures(
    job: &Job,
    timed: &TimedRun,
    measured: &RunMeasurements,
    scanned: Option<ScannedPasses>,
) -> Vec<String> {
    let findings = &measured.findings;
    let mut failures: Vec<String> = timed.fault.iter().map(|fault| fault.sentence()).collect();
    failures.extend(findings.report.failures(&BOUNDS));
    if let Some(scanned) = scanned.filter(|_| timed.fault.is_none()) {
        failures.extend(scanned.failure(findings.passes as usize, measured.swept.scallop_verdict));
    }
    failures.extend(measured.swept.failures.iter().cloned());
    failures.extend(measured.reach.failures.iter().cloned());
    if let Err(error) = travel::check(job) {
        failures.push(format!("{}: {}", error.what(), error.remedy()));
    }
    failures.extend(limits::failures(&measured.axes));
    failures
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time_run;
    use job::AxisLimits;
    use machine::prepare::prepare;

    /// With turns beyond the boundary the ends of passes between them are free, and no pass is faster than its optimum.
    #[test]
    fn passes_between_turns_are_compared_with_free_ends() {
        let plate = include_str!("../../../jobs/plate_machine.toml");
        for feed_mm_min in [1800.0, 6000.0] {
            let mut job = job_file::parse("job.toml", plate).unwrap();
            (job.overrun_mm, job.feed_mm_min) = (2.0, feed_mm_min);
            let prepared = prepare(&job).unwrap();
            let timed = time_run(&job, &prepared, &()).unwrap();
            let requirements = Requirements {
                with_optimum: true,
                ..Requirements::default()
            };
            let found = verify_run(&job, &prepared, &timed, None, &requirements, &()).unwrap();
            let optimum = &found.measured.optimum;
            assert!(optimum.free_ends > timed.passes.len(), "{}", optimum.free_ends);
            let last = timed.passes.len() - 1;
            for time in &optimum.passes {
                // The run begins and ends at rest.
                assert!(time.pass != 0 || time.ends[0] == PassEnd::Rest);
                assert!(time.pass != last || time.ends[1] == PassEnd::Rest);
                let ratio = time.ratio().unwrap();
                assert!((1.0 - 1e-4..1.3).contains(&ratio), "pass {}: {ratio}", time.pass);
                assert!(time.best.lower_bound_s <= time.ours_s.unwrap(), "{}", time.pass);
                // The motion as emitted: the sum of its steps is its length.
                let ends = [time.emitted.first().unwrap(), time.emitted.last().unwrap()];
                assert!(ends[0].arc_mm < 0.2 && ends[1].arc_mm > time.length_mm - 0.2);
            }
            let whole = optimum.whole_ratio.unwrap();
            assert!((1.0..1.3).contains(&whole), "{whole}");
        }
    }

    /// On a plane triangle the steps at the skew ends of passes, all exact, make one pass less than the scan asks for; every crest is within the limit.
    #[test]
    fn fewer_passes_within_the_limit_are_right() {
        let text = "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [0, 0, 1, 1]\nknots_v = [0, 0, 1, 1]\n\
            poles_mm = [[[0, 0, 0], [0, 0, 0]], [[20, 0, 0], [20, 16, 0]]]\n[tool]\nkind = \"ball\"\nradius_mm = 3\n\
            [cut]\nfeed_mm_min = 1800\nscallop_mm = 0.05\nalong = \"u\"\nside = \"up\"\npattern = \"zigzag\"\n\
            [machine]\nvelocity_max_mm_s = [100, 100, 50]\n";
        let job = job_file::parse("job.toml", text).unwrap();
        let prepared = prepare(&job).unwrap();
        let timed = time_run(&job, &prepared, &()).unwrap();
        let found = verify_run(&job, &prepared, &timed, None, &Requirements::default(), &()).unwrap();
        assert_eq!(found.failures, Vec::<String>::new());
        assert_eq!((found.measured.findings.passes, found.scanned), (15, Some(16)));
    }

    #[test]
    fn counts_of_passes_are_judged_within_the_error_of_a_step() {
        let scanned = ScannedPasses {
            count: 16,
            within: [15, 16],
        };
        for (passes, crests, is_right) in [
            (16, Verdict::Unknown, true),
            (15, Verdict::Unknown, true),
            (14, Verdict::Met, true),
            (14, Verdict::Unknown, false),
            (14, Verdict::Violated, false),
            (17, Verdict::Met, false),
        ] {
            assert_eq!(
                scanned.failure(passes, crests).is_none(),
                is_right,
                "{passes} {crests:?}"
            );
        }
    }

    /// The comparison of curved passes with straight ones runs the job once more: where a fault ends that run, a warning says so.
    #[test]
    fn a_warning_says_why_curved_passes_are_not_compared() {
        // 10 mm per period on circles around the pole.
        let cap = include_str!("../../../jobs/sphere_cap.toml");
        let mut job = job_file::parse("job.toml", cap).unwrap();
        job.spacing = job::Spacing::Constant(job::Start::Edge);
        (job.along, job.machine.limits) = (job::Along::V, None);
        (job.scallop_mm, job.feed_mm_min) = (0.5, job::FEED_MAX_MM_MIN);
        let prepared = prepare(&job).unwrap();
        let timed = time_run(&job, &prepared, &()).unwrap();
        assert!(timed.fault.is_some());
        let found = verify_run(&job, &prepared, &timed, None, &Requirements::default(), &()).unwrap();
        assert_eq!(found.measured.curved, None);
        let why = "the passes are not compared with straight ones: ";
        assert!(
            found.warnings.iter().any(|warning| warning.starts_with(why)),
            "{:?}",
            found.warnings
        );
    }

    /// A job that names one limit runs within the defaults of the others, and is judged by them: of velocity, acceleration and jerk each
    /// has a share of its limit, and the passes are timed by all three.
    #[test]
    fn a_job_with_one_limit_is_judged_by_all() {
        let torus = include_str!("../../../jobs/torus.toml");
        let text = format!("{torus}\n[machine]\nvelocity_max_mm_s = [60, 60, 30]\n");
        let mut job = job_file::parse("job.toml", &text).unwrap();
        // Coarse, so that the test is short.
        job.scallop_mm = 0.1;
        let prepared = prepare(&job).unwrap();
        let timed = time_run(&job, &prepared, &()).unwrap();
        let requirements = Requirements {
            with_optimum: true,
            ..Requirements::default()
        };
        let found = verify_run(&job, &prepared, &timed, None, &requirements, &()).unwrap();
        assert_eq!(found.failures, Vec::<String>::new());
        for peak in &found.measured.axes {
            let share = peak.share.unwrap();
            assert!(share > 0.1 && share < 1.06, "{share}");
        }
        let optimum = &found.measured.optimum;
        assert!(optimum.passes.len() >= 3 && optimum.passes.iter().all(|time| time.ours_s.is_some()));
        // No pass is worse than the worst one solved, or than the reported bound.
        let worst = optimum.ratio_max.unwrap();
        assert!((0.999..1.3).contains(&worst), "{worst}");
        assert!(
            optimum.ratio_bound < 1.3 && optimum.whole_ratio.unwrap() > 1.0 - 1e-3,
            "{optimum:?}"
        );
        let times = &found.measured.times;
        let period_s = job.machine.period_s();
        assert!((times.whole_s - timed.samples as f64 * period_s).abs() < 0.5 * period_s);
        assert!(times.at_feed_s > 0.5 * times.whole_s && times.turns_s > 0.0 && times.links_s > 0.0);
        // The same motion against a default that it does not hold.
        let limits = job.machine.limits.unwrap();
        job.machine.limits = Some(AxisLimits {
            jerk_mm_s3: limits.jerk_mm_s3.map(|jerk| 0.5 * jerk),
            ..limits
        });
        let judged = verify_run(&job, &prepared, &timed, None, &Requirements::default(), &()).unwrap();
        assert!(
            judged
                .failures
                .iter()
                .any(|failure| failure.contains("jerk limit")),
            "{:?}",
            judged.failures
        );
    }
}
