//! Random sequences of operator commands on short jobs: each run keeps the limits, ends every pass at its end, and comes to its own end.

use crate::motion::Uses;
use crate::scaled_dome;
use interp_core::{
    AxisLimits, Command, Header, Inputs, Interpolator, Pattern, Sample, Spacing, SpanParameter, State,
    front_words,
};
use job::AxisLimits as JobLimits;
use machine::links::Link;
use machine::prepare::{Prepared, prepare};

/// The core, with a store of the job's size.
pub type Core = Interpolator<Vec<i32>>;

/// Periods between the places of a run from which sequences start.
const EVERY: usize = 23;
/// Last periods of a long job, from which sequences start.
const LAST: usize = 3000;
/// Of these places, how many lie just before the first pass.
const APPROACHES: usize = 4;
/// Periods after the last command within which a run must end.
const ENDS: usize = 60_000;
/// Largest number of equal samples in contact that are no standstill.
const STANDS: u32 = 4;
/// Override below which a tool that moves may seem to stand, %.
const SLOW: u8 = 20;
/// Periods in which the feed follows a lower override.
const FOLLOWS: usize = 500;
/// Share of the feed that is rounding.
const FEED: f32 = 1e-5;

/// A generator of numbers (xorshift).
pub struct Random(u64);

impl Random {
    /// A sequence of its own for each seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        // Finaliser of SplitMix64.
        let mut state = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Self((state ^ (state >> 31)) | 1)
    }

    /// A number below `most`.
    pub fn below(&mut self, most: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from((self.0 >> 11) % most as u64).unwrap_or(0)
    }
}

/// A core with this job loaded.
#[must_use]
pub fn loaded(header: &Header, words: &[i32]) -> Core {
    // Fronts lie after the job.
    let spare = front_words(header).unwrap_or(0);
    let mut core = Interpolator::with_store(vec![0; words.len() + spare]);
    core.load_begin(header, u32::try_from(words.len()).unwrap())
        .unwrap();
    core.load_words(0, words).unwrap();
    for record in 0..core.load_records() {
        core.load_check(record).unwrap();
    }
    core.load_finish().unwrap();
    core
}

/// One period: the tick, then the planning.
pub fn period(core: &mut Core, inputs: impl Into<Inputs>) -> Sample {
    core.tick(inputs);
    core.plan();
    *core.last()
}

/// A place of an undisturbed run.
#[derive(Clone)]
struct Start {
    core: Core,
    uses: Uses,
    sample: Sample,
}

/// A job, and places of its undisturbed run.
pub struct Trajectory {
    /// What it is.
    pub name: String,
    header: Header,
    starts: Vec<Start>,
    /// Where each pass starts and ends, on it and in space.
    sides: Vec<SpanParameter>,
    ends: Vec<[i32; 3]>,
    /// Whether the whole job is short.
    is_short: bool,
}

impl Trajectory {
    fn new(name: &str, header: Header, words: &[i32]) -> Self {
        let mut core = loaded(&header, words);
        let mut uses = Uses::default();
        let mut all = Vec::new();
        let (mut sides, mut ends) = (Vec::new(), Vec::new());
        let mut sample = period(&mut core, Command::Start);
        while sample.state.is_under_way() {
            uses.add(&sample, &header.axes.unwrap(), header.period_s);
            if all.len() * EVERY < core.last().tick as usize {
                let (core, uses) = (core.clone(), uses.clone());
                all.push(Start { core, uses, sample });
            }
            if sample.state == State::Running {
                let pass = sample.pass as usize;
                sides.resize(pass + 1, sample.side);
                ends.resize(pass + 1, sample.cl_nm);
                ends[pass] = sample.cl_nm;
            }
            sample = period(&mut core, None);
        }
        assert_eq!((sample.state, core.fault()), (State::Finished, None), "{name}");
        assert!(sides.len() > 2, "{name}: {} passes", sides.len());
        let is_short = all.len() * EVERY < 2 * LAST;
        let starts = if is_short {
            all
        } else {
            all.split_off(all.len() - LAST / EVERY)
        };
        Self {
            name: name.into(),
            header,
            starts,
            sides,
            ends,
            is_short,
        }
    }

    /// A job with limits of three passes or more.
    #[must_use]
    pub fn of(name: &str, prepared: &Prepared) -> Self {
        Self::new(name, prepared.header, &prepared.words)
    }

    /// A sample job at a feed, mm/min, with limits.
    fn of_job(name: &str, feed_mm_min: f64, pattern: job::Pattern, overrun_mm: f64) -> Self {
        let jobs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs");
        let mut job = job_file::load(&jobs.join(format!("{name}.toml"))).unwrap();
        job.feed_mm_min = feed_mm_min;
        job.pattern = pattern;
        job.overrun_mm = overrun_mm;
        job.machine.limits = Some(JobLimits {
            velocity_mm_s: [100.0, 100.0, 50.0],
            acceleration_mm_s2: [1000.0, 1000.0, 500.0],
            jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
        });
        let prepared = prepare(&job).unwrap();
        let what = format!("{name} {feed_mm_min} {pattern:?} {overrun_mm}");
        Self::of(&what, &prepared)
    }

    /// A dome of 10 mm x 7.5 mm, at this feed, mm/s.
    fn of_dome(feed_mm_s: f32, pattern: Pattern, overrun_mm: f32, spacing: Spacing) -> Self {
        let (mut header, words) = scaled_dome(0.125);
        (header.ball_radius_mm, header.scallop_mm) = (1.0, 0.3);
        (header.feed_mm_s, header.pattern, header.spacing) = (feed_mm_s, pattern, spacing);
        // The dome is 4.5 mm high at most.
        let safe_z_nm = 8_000_000;
        header.axes = Some(AxisLimits {
            velocity_mm_s: [100.0, 100.0, 50.0],
            acceleration_mm_s2: [1000.0, 1000.0, 500.0],
            jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
            chord_mm: 0.005,
            overrun_mm,
            travel_nm: [[i32::MIN, i32::MAX]; 3],
            home_nm: [0, 0, safe_z_nm],
            plunge_mm: 2.0,
            end_nm: None,
            end_height_nm: 0,
            safe_z_nm,
        });
        let name = format!("dome {feed_mm_s} {pattern:?} {overrun_mm} {spacing:?}");
        Self::new(&name, header, &words)
    }

    /// Curved passes in a region of a twisted surface with `patches` patches along a pass; links go straight.
    #[must_use]
    pub fn of_region(patches: u32, region: &str) -> Self {
        let inner: Vec<f64> = (0..=patches)
            .map(|knot| f64::from(knot) / f64::from(patches))
            .collect();
        let knots = [&[0.0], &inner[..], &[1.0]].concat();
        let poles: Vec<[[f64; 3]; 2]> = inner
            .iter()
            .map(|u| [[14.0 * u, 0.0, *u], [14.0 * u, 8.0, 1.0 - u]])
            .collect();
        let text = format!(
            "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = {knots:?}\nknots_v = [0, 0, 1, 1]\n\
            poles_mm = {poles:?}\n\
            [region]\nloops = [{region}]\n\
            [tool]\nkind = \"ball\"\nradius_mm = 2\n\
            [cut]\nfeed_mm_min = 2400\nscallop_mm = 0.05\nalong = \"u\"\nside = \"up\"\npattern = \"zigzag\"\n\
            spacing = \"constant\"\nstart = \"edge\"\n\
            [machine]\nvelocity_max_mm_s = [100, 100, 50]\nacceleration_max_mm_s2 = [1000, 1000, 500]\n\
            jerk_max_mm_s3 = [20000, 20000, 10000]\n"
        );
        let mut prepared = prepare(&job_file::parse("region.toml", &text).unwrap()).unwrap();
        machine::links::add(&mut prepared, &[Link::Straight; 100]);
        let name = format!("region of {patches} patches");
        Self::of(&name, &prepared)
    }

    /// After slivers comes a pass that takes longer to plan, for which the tool waits above the end of the last of them.
    fn of_slivers() -> Self {
        let course = Self::of_region(
            24,
            "[[0.1, 0.1], [0.12, 0.1], [0.12, 0.3], [0.9, 0.3], [0.9, 0.8], [0.1, 0.8]]",
        );
        let (_, passes) = course.ends.split_last().unwrap();
        let waits = |start: &Start| {
            let [at_x, at_y, at_z] = start.sample.cl_nm;
            let is_above = |[x, y, z]: &[i32; 3]| [at_x, at_y] == [*x, *y] && at_z > z + 200_000;
            passes.iter().any(is_above) && start.sample.feed_mm_s < 1.0
        };
        assert!(
            course
                .starts
                .iter()
                .skip_while(|start| start.sample.state != State::Running)
                .any(waits),
            "the tool rises"
        );
        course
    }

    /// The jobs of the campaign: hops, step-overs, turns and curves, on a dome and on sample jobs with knots.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let dome = |feed, pattern, overrun| Self::of_dome(feed, pattern, overrun, Spacing::Exact);
        let curved = |feed, pattern| Self::of_dome(feed, pattern, 0.0, Spacing::Constant);
        vec![
            dome(40.0, Pattern::Zig, 0.0),
            dome(40.0, Pattern::Zigzag, 0.0),
            dome(15.0, Pattern::Zigzag, 0.0),
            dome(40.0, Pattern::Zigzag, 2.0),
            dome(15.0, Pattern::Zigzag, 1.0),
            curved(25.0, Pattern::Zig),
            curved(25.0, Pattern::Zigzag),
            Self::of_job("torus", 6000.0, job::Pattern::Zigzag, 2.0),
            Self::of_job("freeform", 3600.0, job::Pattern::Zigzag, 0.0),
            Self::of_job("plate_v", 3600.0, job::Pattern::Zigzag, 2.0),
            Self::of_job("sphere_cap", 3000.0, job::Pattern::Zig, 0.0),
            Self::of_slivers(),
        ]
    }
}

/// Commands of a sequence: a wait in periods, a command, and the override from that period on, %.
pub type Step = (usize, Option<Command>, u8);

/// The steps of a sequence.
fn steps(random: &mut Random, may_start: bool) -> Vec<Step> {
    let count = 1 + random.below(12);
    let most = [4, 60, 400];
    let mut percent = 100;
    (0..count)
        .map(|_| {
            let kind = random.below(3);
            let wait = random.below(most[kind]);
            let command = match random.below(14) {
                0..=2 => None,
                3..=6 => Some(Command::Hold),
                7..=10 => Some(Command::Resume),
                11 if may_start => Some(Command::Start),
                12 => Some(Command::Stop),
                13 => Some(Command::Abort),
                _ => None,
            };
            if random.below(2) == 0 {
                percent = [100, 0, 200, u8::try_from(random.below(201)).unwrap_or(0)][random.below(4)];
            }
            (wait, command, percent)
        })
        .collect()
}

/// What came of a sequence, or of some.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Sequences, and their periods.
    pub count: usize,
    /// Periods of all.
    pub periods: usize,
    /// Greatest uses of velocity, acceleration and jerk.
    pub worst: [f64; 3],
    /// Longest time from a hold to rest, periods, and the seed.
    pub hold: (usize, u64),
    /// Longest stand in contact while a feed was commanded, periods, and the seed of the sequence.
    pub stand: (u32, u64),
    /// Sequences with a stand that is too long: the seed, and its periods.
    pub stands: Vec<(u64, u32)>,
}

impl Outcome {
    /// Adds another.
    pub fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.periods += other.periods;
        for (worst, other) in self.worst.iter_mut().zip(other.worst) {
            *worst = worst.max(other);
        }
        self.hold = self.hold.max(other.hold);
        self.stand = self.stand.max(other.stand);
        self.stands.extend_from_slice(&other.stands);
    }
}

/// A run under commands, with the state of its checks.
struct Run<'a> {
    course: &'a Trajectory,
    core: Core,
    uses: Uses,
    last: Sample,
    /// Overrides of the last periods, the greatest since it was set lower, and periods until it counts no more.
    percent: u8,
    greatest: u8,
    follows: usize,
    /// Periods since a hold, and of the stand.
    holding: usize,
    standing: u32,
    /// A stop was commanded; a hold since the tool last moved.
    stops: bool,
    held: bool,
    outcome: Outcome,
}

impl Run<'_> {
    fn period(&mut self, command: Option<Command>, percent: u8) -> Result<(), String> {
        if percent < self.percent {
            let before = if self.follows > 0 { self.greatest } else { 0 };
            (self.greatest, self.follows) = (self.percent.max(before), FOLLOWS);
        }
        self.follows = self.follows.saturating_sub(1);
        self.percent = percent;
        // The first pass of a run is planned at rest.
        self.held |= command == Some(Command::Start);
        self.stops |= matches!(command, Some(Command::Stop | Command::Abort));
        let inputs = Inputs {
            command,
            feed_override: percent,
        };
        let sample = period(&mut self.core, inputs);
        let before = std::mem::replace(&mut self.last, sample);
        let header = &self.course.header;
        self.uses
            .add(&sample, &header.axes.unwrap_or_default(), header.period_s);
        self.outcome.periods += 1;
        if before.state == State::Held
            && sample.state == State::Held
            && (before.cl_nm, before.path) != (sample.cl_nm, sample.path)
        {
            return Err("moves while held".into());
        }
        self.holding = if sample.state == State::Holding {
            self.holding + 1
        } else {
            0
        };
        self.outcome.hold.0 = self.outcome.hold.0.max(self.holding);
        self.check_feed(&sample)?;
        self.check_pass(&before, &sample)?;
        self.count_stand(&before, &sample);
        Ok(())
    }

    /// The feed in contact is at most the programmed one times the override.
    fn check_feed(&mut self, sample: &Sample) -> Result<(), String> {
        let greatest = if self.follows > 0 {
            self.greatest.max(self.percent)
        } else {
            self.percent
        };
        let most = self.course.header.feed_mm_s * 0.01 * f32::from(greatest);
        if sample.state == State::Running && sample.feed_mm_s > most * (1.0 + FEED) {
            return Err(format!("feed {} above {most}", sample.feed_mm_s));
        }
        Ok(())
    }

    /// Passes are where they are without commands, and each ends at its end.
    fn check_pass(&self, before: &Sample, sample: &Sample) -> Result<(), String> {
        let pass = sample.pass as usize;
        let is_curved = self.course.header.spacing.is_constant();
        if sample.state == State::Running && !is_curved && self.course.sides.get(pass) != Some(&sample.side) {
            return Err(format!("pass {pass} at {:?}", sample.side));
        }
        let ends = before.state == State::Running && sample.state == State::Linking;
        let turns = self.course.header.axes.is_some_and(|axes| axes.overrun_mm > 0.0);
        let is_last = before.pass as usize + 1 == self.course.ends.len();
        if ends
            && !self.stops
            && (!turns || is_last)
            && self.course.ends.get(before.pass as usize) != Some(&before.cl_nm)
        {
            let end = self.course.ends.get(before.pass as usize);
            return Err(format!(
                "pass {} ends at {:?} for {end:?}",
                before.pass, before.cl_nm
            ));
        }
        Ok(())
    }

    /// A stand at an end of a pass while a feed is commanded, that no hold has begun.
    fn count_stand(&mut self, before: &Sample, sample: &Sample) {
        self.held |= self.percent < SLOW || matches!(sample.state, State::Holding | State::Held);
        // In the first and the last periods of a slow motion the place is the same to the nanometre.
        let stands = sample.cl_nm == before.cl_nm
            && sample.feed_mm_s <= 0.0
            && matches!(sample.state, State::Running | State::Linking)
            && !self.held
            && self.course.ends.contains(&sample.cl_nm);
        self.held &= sample.cl_nm == before.cl_nm;
        self.standing = if stands { self.standing + 1 } else { 0 };
        self.outcome.stand.0 = self.outcome.stand.0.max(self.standing);
    }
}

impl Trajectory {
    /// Runs steps from one of the places.
    fn run(&self, start: &Start, steps: &[Step]) -> Result<Outcome, String> {
        let mut run = Run {
            course: self,
            core: start.core.clone(),
            uses: start.uses.clone(),
            last: start.sample,
            percent: 100,
            greatest: 100,
            follows: 0,
            holding: 0,
            standing: 0,
            stops: false,
            held: false,
            outcome: Outcome {
                count: 1,
                ..Outcome::default()
            },
        };
        let end = run.follow(steps);
        let (name, tick) = (&self.name, run.last.tick);
        let located = |what| {
            format!(
                "{name} from tick {}, {steps:?}: {what}, tick {tick}",
                start.sample.tick
            )
        };
        end.map_err(located)?;
        run.outcome.worst = run.uses.worst;
        if !run.uses.are_permitted() {
            return Err(located(format!("{:?} of the limits", run.uses.worst)));
        }
        Ok(run.outcome)
    }

    /// Outcome of some steps from the place of the undisturbed run at this tick.
    ///
    /// # Errors
    /// The broken rule; or sequences do not start at that place.
    pub fn run_from(&self, tick: u32, steps: &[Step]) -> Result<Outcome, String> {
        let start = self.starts.iter().find(|start| start.sample.tick == tick);
        self.run(start.ok_or("no such place")?, steps)
    }

    /// Outcome of three commands: a stop at an override of 0 in the approach to the first pass, at whose start the tool rests where the way is too short to stop on; an abort in
    /// the retract from there; a new start.
    ///
    /// # Errors
    /// The first broken rule.
    pub fn start_again_from_the_first_pass(&self) -> Result<Outcome, String> {
        let mut all = Outcome::default();
        let places = self.starts.iter();
        let approach: Vec<_> = places
            .take_while(|start| start.sample.state == State::Linking)
            .collect();
        for start in approach.iter().rev().take(APPROACHES) {
            for wait in 0..EVERY {
                let steps = [
                    (wait, Some(Command::Stop), 0),
                    (200, Some(Command::Abort), 100),
                    (2, Some(Command::Start), 100),
                ];
                all.add(&self.run(start, &steps)?);
            }
        }
        Ok(all)
    }

    /// What comes of an override of 0 for 100 periods at each of the places.
    ///
    /// # Errors
    /// What the first that breaks something breaks.
    pub fn pause_at_each_place(&self) -> Result<Outcome, String> {
        let mut all = Outcome::default();
        for start in &self.starts {
            all.add(&self.run(start, &[(1, None, 0), (100, None, 100)])?);
        }
        Ok(all)
    }
}

/// Runs the sequence of a seed.
///
/// # Errors
/// What it breaks.
pub fn run(courses: &[Trajectory], seed: u64) -> Result<Outcome, String> {
    let mut random = Random::new(seed);
    let course = &courses[random.below(courses.len())];
    let start = &course.starts[random.below(course.starts.len())];
    let steps = steps(&mut random, course.is_short);
    let mut outcome = course
        .run(start, &steps)
        .map_err(|what| format!("seed {seed}: {what}"))?;
    (outcome.stand.1, outcome.hold.1) = (seed, seed);
    if outcome.stand.0 > STANDS {
        outcome.stands.push((seed, outcome.stand.0));
    }
    Ok(outcome)
}

impl Run<'_> {
    fn follow(&mut self, steps: &[Step]) -> Result<(), String> {
        let mut percent = 100;
        for (wait, command, next) in steps {
            for _ in 0..*wait {
                self.period(None, percent)?;
            }
            percent = *next;
            self.period(*command, percent)?;
        }
        let mut command = Some(Command::Resume);
        for _ in 0..ENDS {
            self.period(command, 100)?;
            let state = self.core.state();
            command = (state == State::Held).then_some(Command::Resume);
            if !state.is_under_way() {
                return self.check_end();
            }
        }
        Err(format!("does not end: {:?}", self.core.state()))
    }

    fn check_end(&self) -> Result<(), String> {
        let home_nm = self.course.header.axes.map(|axes| axes.home_nm);
        match (self.core.state(), self.core.fault()) {
            (State::Ready, None) => Ok(()),
            (State::Finished, None) if Some(self.last.cl_nm) == home_nm => Ok(()),
            (state, fault) => Err(format!("ends as {state:?} at {:?}: {fault:?}", self.last.cl_nm)),
        }
    }
}

/// Runs the sequences of some seeds on all cores. Returns their outcome, and the broken rules in words.
#[must_use]
pub fn run_all(courses: &[Trajectory], seeds: std::ops::Range<u64>) -> (Outcome, Vec<String>) {
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicU64, Ordering};
    let next = AtomicU64::new(seeds.start);
    let all = Mutex::new((Outcome::default(), Vec::new()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= seeds.end {
                        break;
                    }
                    let result = run(courses, seed);
                    let mut all = all.lock().unwrap();
                    match result {
                        Ok(outcome) => all.0.add(&outcome),
                        Err(what) => all.1.push(what),
                    }
                }
            });
        }
    });
    all.into_inner().unwrap()
}
