//! Feed within the axis limits, links, and operator commands, on the core itself.

use integration_tests::{dome, motion::Uses, scaled_dome};
use interp_core::{
    AxisLimits, Command, FaultKind, Header, Inputs, Interpolator, Pattern, Sample, SpanParameter, State,
};
use machine::prepare::prepare;
use std::sync::OnceLock;

fn axes(safe_z_nm: i32) -> AxisLimits {
    AxisLimits {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
        chord_mm: 0.005,
        overrun_mm: 0.0,
        travel_nm: [[i32::MIN, i32::MAX]; 3],
        home_nm: [0, 0, safe_z_nm],
        plunge_mm: 2.0,
        end_nm: None,
        end_height_nm: 0,
        safe_z_nm,
    }
}

fn machine(header: &Header, words: &[i32]) -> Box<Interpolator> {
    let mut core: Box<Interpolator> = Box::new(Interpolator::new());
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
fn period(core: &mut Interpolator, inputs: impl Into<Inputs>) -> Sample {
    core.tick(inputs);
    core.plan();
    *core.last()
}

/// Side parameters of the passes.
fn sides(samples: &[Sample]) -> Vec<SpanParameter> {
    let mut sides: Vec<SpanParameter> = Vec::new();
    for sample in samples.iter().filter(|sample| sample.side != SpanParameter::NONE) {
        if sides.last() != Some(&sample.side) {
            sides.push(sample.side);
        }
    }
    sides
}

/// What tells the passes apart: their side parameters; on curved passes, where each begins.
fn passes(header: &Header, samples: &[Sample]) -> Vec<SpanParameter> {
    if !header.spacing.is_constant() {
        return sides(samples);
    }
    let mut starts = Vec::new();
    let mut pass = None;
    for sample in samples.iter().filter(|sample| sample.side != SpanParameter::NONE) {
        if pass != Some(sample.pass) {
            pass = Some(sample.pass);
            starts.push(sample.side);
        }
    }
    starts
}

/// The highest tool centre of a run at constant feed, nm, and its passes.
fn height(header: &Header, words: &[i32]) -> (i32, u32) {
    let mut core = machine(
        &Header {
            links: 0,
            window: 0,
            strips: 0,
            axes: None,
            ..*header
        },
        words,
    );
    let (mut top, mut passes) = (i32::MIN, 0);
    let mut sample = period(&mut core, Command::Start);
    while sample.state == State::Running {
        top = top.max(sample.cl_nm[2]);
        passes = sample.pass + 1;
        sample = period(&mut core, None);
    }
    assert_eq!(sample.state, State::Finished);
    (top, passes)
}

/// Runs a sample job with these limits, at a multiple of its feed: every sample keeps the limits, links and standstill included, and the
/// number of passes is that at constant feed.
fn check_sample_job(name: &str, times: f32, pattern: Pattern, machine_of: fn(i32) -> AxisLimits) {
    let jobs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs");
    let prepared = prepare(&job_file::load(&jobs.join(format!("{name}.toml"))).unwrap()).unwrap();
    let mut header = prepared.header;
    header.pattern = pattern;
    let (top, passes) = height(&header, &prepared.words);
    header.feed_mm_s *= times;
    header.axes = Some(machine_of(top + 5_000_000));
    let axes = header.axes.as_ref().unwrap();
    let mut core = machine(&header, &prepared.words);
    let mut used = Uses::default();
    let mut sample = period(&mut core, Command::Start);
    let mut last_pass = 0;
    while sample.state.is_under_way() {
        used.add(&sample, axes, 1e-3);
        last_pass = sample.pass;
        sample = period(&mut core, Inputs::default());
    }
    let what = format!("{name} {times} {pattern:?}");
    println!(
        "{what}: velocity, acceleration, jerk {:?} of their limits",
        used.worst
    );
    assert_eq!((sample.state, core.fault()), (State::Finished, None), "{what}");
    assert_eq!(last_pass + 1, passes, "{what}");
    used.check(&what);
    assert_eq!(sample.cl_nm, axes.home_nm, "{what}: back where it began");
}

/// A run that begins straight above its first pass goes down at once, and a run with an end of its own goes there at the given height: neither reaches the safe height. From any other
/// place a run begins at the safe height.
#[test]
fn a_run_between_others_stays_low() {
    let (mut header, words) = dome();
    let (top, _) = height(&header, &words);
    let safe_z_nm = top + 50_000_000;
    header.axes = Some(axes(safe_z_nm));
    let run = |header: &Header| {
        let mut core = machine(header, &words);
        let mut samples = vec![period(&mut core, Command::Start)];
        while samples.last().is_some_and(|sample| sample.state.is_under_way()) {
            samples.push(period(&mut core, None));
        }
        assert_eq!(core.fault(), None);
        samples
    };
    let highest = |samples: &[Sample]| samples.iter().map(|sample| sample.cl_nm[2]).max().unwrap();
    let before = |samples: &[Sample]| {
        let on_pass = |sample: &Sample| sample.state == State::Running;
        highest(&samples[..samples.iter().position(on_pass).unwrap()])
    };
    let at_home = run(&header);
    assert_eq!(before(&at_home), safe_z_nm);
    let on_passes = |samples: &[Sample]| -> Vec<[i32; 3]> {
        let samples = samples.iter().filter(|sample| sample.state == State::Running);
        samples.map(|sample| sample.cl_nm).collect()
    };
    let [x, y, z] = on_passes(&at_home)[0];
    let end_nm = [x + 3_000_000, y - 4_000_000, top + 2_000_000];
    let low = |home_nm: [i32; 3]| {
        let axes = AxisLimits {
            home_nm,
            end_nm: Some(end_nm),
            end_height_nm: top + 6_000_000,
            ..axes(safe_z_nm)
        };
        run(&Header {
            axes: Some(axes),
            ..header
        })
    };
    for beside in [[0, 0], [1_000, -1_000]] {
        let samples = low([x + beside[0], y + beside[1], z + 1_000_000]);
        assert_eq!(samples.last().unwrap().cl_nm, end_nm);
        assert_eq!(before(&samples), z + 1_000_000, "{beside:?}");
        let links = samples
            .iter()
            .rev()
            .take_while(|sample| sample.state != State::Running);
        assert_eq!(links.map(|sample| sample.cl_nm[2]).max(), Some(top + 6_000_000));
        assert_eq!(on_passes(&samples), on_passes(&at_home), "{beside:?}");
    }
    let elsewhere = low([x + 1_001, y, z + 1_000_000]);
    assert_eq!(before(&elsewhere), safe_z_nm);
}

/// Some jobs, at low and high feed, on a machine with lower limits on z.
#[test]
fn sample_jobs_hold_the_limits() {
    for (name, times, pattern) in [
        ("plate", 1.0, Pattern::Zig),
        ("plate", 8.0, Pattern::Zigzag),
        ("plate_v", 3.0, Pattern::Zigzag),
        ("freeform", 1.0, Pattern::Zigzag),
        ("freeform", 4.0, Pattern::Zig),
        ("revolved_v", 5.0, Pattern::Zigzag),
        ("ruled_reconstructed", 5.0, Pattern::Zig),
        ("sphere_cap", 1.0, Pattern::Zig),
        ("sphere_cap", 10.0, Pattern::Zig),
        ("torus", 1.0, Pattern::Zigzag),
        ("torus", 6.0, Pattern::Zig),
    ] {
        check_sample_job(name, times, pattern, axes);
    }
}

/// The machine of the figures in `docs/figures.md`.
fn axes_of_the_readme(safe_z_nm: i32) -> AxisLimits {
    AxisLimits {
        acceleration_mm_s2: [1000.0; 3],
        jerk_mm_s3: [20_000.0; 3],
        ..axes(safe_z_nm)
    }
}

/// The ten sample jobs without limits, `zig` and `zigzag`, at their programmed feed, on the machine of the figures.
mod both_ways {
    use super::{Pattern, axes_of_the_readme, check_sample_job};

    macro_rules! jobs {
        ($($name:ident)*) => {
            $(
                #[test]
                fn $name() {
                    for pattern in [Pattern::Zig, Pattern::Zigzag] {
                        check_sample_job(stringify!($name), 1.0, pattern, axes_of_the_readme);
                    }
                }
            )*
        };
    }

    jobs!(far_plate freeform plate plate_v revolved revolved_v ruled_printed ruled_reconstructed sphere_cap torus);
}

/// The dome in about nine passes, on a machine with limits.
fn dome_within_limits(pattern: Pattern) -> (Header, Vec<i32>) {
    within_limits(dome(), pattern)
}

/// The dome at an eighth of its size, in about five passes, so short that the tool seldom reaches the programmed feed.
fn small_dome_within_limits(pattern: Pattern) -> (Header, Vec<i32>) {
    let (mut header, words) = scaled_dome(0.125);
    (header.ball_radius_mm, header.scallop_mm) = (1.0, 0.3);
    within_limits((header, words), pattern)
}

fn within_limits((mut header, words): (Header, Vec<i32>), pattern: Pattern) -> (Header, Vec<i32>) {
    header.feed_mm_s = 40.0;
    header.pattern = pattern;
    let (top, _) = height(&header, &words);
    header.axes = Some(axes(top + 2_000_000));
    (header, words)
}

/// A wait in periods, a command, and the override from that period on, %.
type Step = (u32, Option<Command>, u8);

/// Runs a job with these commands, the wait of each counted from the one before. Returns all samples, and the core.
fn scripted(header: &Header, words: &[i32], commands: &[Step]) -> (Vec<Sample>, Box<Interpolator>) {
    let mut core = machine(header, words);
    let mut samples = vec![period(&mut core, Command::Start)];
    let mut feed_override = 100;
    for (wait, command, percent) in commands {
        for _ in 0..*wait {
            samples.push(period(
                &mut core,
                Inputs {
                    command: None,
                    feed_override,
                },
            ));
        }
        feed_override = *percent;
        samples.push(period(
            &mut core,
            Inputs {
                command: *command,
                feed_override,
            },
        ));
    }
    // Resume, and run to the end.
    samples.push(period(&mut core, Command::Resume));
    for _ in 0..100_000 {
        let state = core.state();
        if !state.is_under_way() {
            break;
        }
        samples.push(period(
            &mut core,
            (state == State::Held).then_some(Command::Resume),
        ));
    }
    (samples, core)
}

/// Checks that a run with these commands keeps the limits, stays on its path, does not move while held, and has the passes of a run without
/// commands.
fn check_commands(header: &Header, words: &[i32], whole: &[SpanParameter], commands: &[Step]) {
    let (samples, core) = scripted(header, words, commands);
    let axes = header.axes.as_ref().unwrap();
    let mut used = Uses::default();
    let mut before: Option<Sample> = None;
    for sample in &samples {
        used.add(sample, axes, 1e-3);
        if let Some(before) =
            before.filter(|before| before.state == State::Held && sample.state == State::Held)
        {
            assert_eq!((before.cl_nm, before.path), (sample.cl_nm, sample.path));
        }
        before = Some(*sample);
    }
    used.check(&format!("{commands:?}"));
    // The centre is on the path, by an evaluation of the surface.
    for sample in samples
        .iter()
        .filter(|sample| sample.path != SpanParameter::NONE)
        .step_by(97)
    {
        let probe = core.evaluate(sample.path, sample.side).unwrap();
        for (probe, sample) in probe.cl_nm.iter().zip(sample.cl_nm) {
            assert!((probe - sample).abs() <= 3, "{sample} for {probe}");
        }
    }
    // A start begins the job again: the passes of each run are the first ones of the undisturbed run.
    let mut expected = whole.iter();
    for side in passes(header, &samples) {
        if side == whole[0] {
            expected = whole.iter();
        }
        assert_eq!(Some(&side), expected.next(), "{commands:?}");
    }
}

/// A job, and the side parameters of its passes.
type Undisturbed = (Header, Vec<i32>, Vec<SpanParameter>);

fn undisturbed((header, words): (Header, Vec<i32>)) -> Undisturbed {
    let (samples, core) = scripted(&header, &words, &[]);
    assert_eq!((core.state(), core.fault()), (State::Finished, None));
    let whole = passes(&header, &samples);
    assert!(whole.len() > 3, "{}", whole.len());
    (header, words, whole)
}

/// The large or the small dome, `zig` or `zigzag`, each computed once.
fn undisturbed_once(small: bool, zigzag: bool) -> &'static Undisturbed {
    static ALL: OnceLock<[[Undisturbed; 2]; 2]> = OnceLock::new();
    let all = ALL.get_or_init(|| {
        let job = [dome_within_limits, small_dome_within_limits];
        job.map(|job| [Pattern::Zig, Pattern::Zigzag].map(|pattern| undisturbed(job(pattern))))
    });
    &all[usize::from(small)][usize::from(zigzag)]
}

/// A leg resumed just before its end, where a small acceleration follows a large one.
#[test]
fn a_leg_resumed_before_its_end_keeps_the_jerk() {
    let (header, words, whole) = undisturbed_once(false, false);
    for first in 740..840 {
        let commands = [
            (first, None, 200),
            (37, Some(Command::Resume), 100),
            (46, None, 0),
            (150, Some(Command::Resume), 100),
            (24, None, 0),
            (1, Some(Command::Resume), 100),
            (8, Some(Command::Hold), 100),
        ];
        check_commands(header, words, whole, &commands);
    }
}

/// A run held, slowed down and accelerated at many points, and resumed each time, has every pass of the undisturbed run and returns home.
#[test]
fn a_job_interrupted_and_resumed_takes_the_same_path() {
    for zigzag in [false, true] {
        let (header, words, whole) = undisturbed_once(false, zigzag);
        let interruptions: Vec<Step> = (0..60)
            .flat_map(|turn| {
                let percent = [100, 0, 200, 35][turn as usize % 4];
                [
                    (97 * (turn % 7), Some(Command::Hold), percent),
                    (turn, Some(Command::Resume), 100),
                ]
            })
            .collect();
        let (samples, core) = scripted(header, words, &interruptions);
        assert_eq!((core.state(), core.fault()), (State::Finished, None));
        assert_eq!(sides(&samples), *whole);
        let home_nm = header.axes.unwrap().home_nm;
        assert_eq!(samples.last().map(|sample| sample.cl_nm), Some(home_nm));
        assert!(samples.iter().any(|sample| sample.state == State::Held));
        check_commands(header, words, whole, &interruptions);
    }
}

/// A hold stops on the path within the braking time, and resumes from there.
#[test]
fn hold_and_resume() {
    let (header, words, _) = undisturbed(dome_within_limits(Pattern::Zig));
    let mut core = machine(&header, &words);
    period(&mut core, Command::Start);
    while core.state() != State::Running {
        period(&mut core, None);
    }
    for _ in 0..500 {
        period(&mut core, None);
    }
    assert_eq!(period(&mut core, Command::Hold).state, State::Holding);
    let mut ticks = 0;
    while period(&mut core, None).state == State::Holding {
        ticks += 1;
    }
    // v/a + a/J: 40 + 50 ms along x, and up to twice as long on slopes where the limits of z decide.
    assert!((50..250).contains(&ticks), "{ticks}");
    let held = *core.last();
    for _ in 0..100 {
        assert_eq!(period(&mut core, None).cl_nm, held.cl_nm);
    }
    assert_eq!(period(&mut core, Command::Resume).state, State::Running);
}

/// A stop retracts from the surface, an abort stays on it; the next start begins from the position reached.
#[test]
fn stop_and_abort() {
    let (header, words, _) = undisturbed(dome_within_limits(Pattern::Zigzag));
    let safe = header.axes.unwrap().safe_z_nm;
    for (request, leaves) in [(Command::Stop, true), (Command::Abort, false)] {
        let mut core = machine(&header, &words);
        period(&mut core, Command::Start);
        for _ in 0..3000 {
            period(&mut core, None);
        }
        period(&mut core, request);
        while period(&mut core, None).state.is_under_way() {}
        assert_eq!(core.state(), State::Ready);
        assert_eq!(core.last().cl_nm[2] == safe, leaves);
        period(&mut core, Command::Start);
        while period(&mut core, None).state.is_under_way() {}
        assert_eq!(core.state(), State::Finished);
    }
}

/// A run that was stopped, on its way up: the tool is a millimetre above the surface or more.
fn on_the_way_up(used: &mut Uses) -> (Box<Interpolator>, AxisLimits) {
    let (header, words, _) = undisturbed(dome_within_limits(Pattern::Zigzag));
    let axes = header.axes.unwrap();
    let mut core = machine(&header, &words);
    let mut step = |inputs: Inputs| {
        let sample = period(&mut core, inputs);
        used.add(&sample, &axes, 1e-3);
        sample
    };
    step(Command::Start.into());
    for _ in 0..3000 {
        step(Inputs::default());
    }
    let low = step(Command::Stop.into()).cl_nm[2];
    while step(Inputs::default()).cl_nm[2] < low + 1_000_000 {}
    assert_eq!(core.state(), State::Linking);
    (core, axes)
}

/// The way up of a stop is a link: it is held, resumed, overridden and aborted like one, within the limits.
#[test]
fn the_way_up_of_a_stop_obeys() {
    for ends in [Command::Resume, Command::Abort, Command::Stop] {
        let mut used = Uses::default();
        let (mut core, axes) = on_the_way_up(&mut used);
        let mut step = |core: &mut Interpolator, inputs: Inputs| {
            let sample = period(core, inputs);
            used.add(&sample, &axes, 1e-3);
            sample
        };
        step(&mut core, Command::Hold.into());
        for _ in 0..600 {
            step(&mut core, Inputs::default());
        }
        let held = step(&mut core, Inputs::default());
        assert_eq!(held.state, State::Held);
        assert!(held.cl_nm[2] < axes.safe_z_nm);
        step(&mut core, ends.into());
        let mut sample = held;
        for _ in 0..3000 {
            sample = step(&mut core, Inputs::default());
        }
        assert_eq!(sample.state, State::Ready, "{ends:?}");
        let at = sample.cl_nm[2];
        assert_eq!(at == axes.safe_z_nm, ends != Command::Abort, "{ends:?}: {at}");
        used.check(&format!("{ends:?}"));
    }
    let (mut core, axes) = on_the_way_up(&mut Uses::default());
    let at = |percent| Inputs {
        command: None,
        feed_override: percent,
    };
    for _ in 0..1000 {
        period(&mut core, at(0));
    }
    let stands = *core.last();
    assert_eq!(period(&mut core, at(0)).cl_nm, stands.cl_nm);
    assert!(stands.state == State::Linking && stands.cl_nm[2] < axes.safe_z_nm);
    for _ in 0..3000 {
        period(&mut core, at(50));
    }
    assert_eq!(
        (core.state(), core.last().cl_nm[2]),
        (State::Ready, axes.safe_z_nm)
    );
}

/// Between two zig passes the tool goes up, across and down as one motion: across only at the safe height or above, and no axis waits for another.
#[test]
fn a_hop_is_above_the_safe_height_while_it_goes_across() {
    let (header, words) = dome_within_limits(Pattern::Zig);
    let axes = header.axes.as_ref().unwrap();
    let mut core = machine(&header, &words);
    let mut last = period(&mut core, Command::Start);
    let (mut both, mut hops) = (0, 0);
    while last.state.is_under_way() {
        let sample = period(&mut core, None);
        let [x, y, z] = [0, 1, 2].map(|axis| sample.cl_nm[axis] - last.cl_nm[axis]);
        if sample.state == State::Linking && last.state == State::Linking && sample.pass > 0 {
            // The safe height may be passed within a period: across begins after, and ends before.
            let higher = sample.cl_nm[2].max(last.cl_nm[2]);
            if x.abs().max(y.abs()) > 2 {
                assert!(higher >= axes.safe_z_nm - 2, "{sample:?}");
                both += u32::from(z != 0);
            }
        }
        hops += u32::from(last.state == State::Running && sample.state == State::Linking);
        last = sample;
    }
    assert_eq!(last.state, State::Finished);
    // On each hop but the last way home, across overlaps with up and with down.
    assert!(
        hops > 4 && both > 20 * (hops - 1),
        "{both} periods of {hops} hops"
    );
}

/// A point outside the travel is detected before the tool moves to it.
#[test]
fn soft_limits_stop_before_the_pass() {
    let (mut header, words) = dome_within_limits(Pattern::Zig);
    let axes = header.axes.as_mut().unwrap();
    axes.travel_nm[1][1] = 10_000_000;
    let mut core = machine(&header, &words);
    let mut sample = period(&mut core, Command::Start);
    while sample.state.is_under_way() {
        assert!(sample.cl_nm[1] <= 10_000_000);
        sample = period(&mut core, None);
    }
    assert_eq!(core.fault().unwrap().kind, FaultKind::SoftLimit);
}

/// If the surface faces down, the tool does not leave home.
#[test]
fn a_surface_that_faces_down_is_refused() {
    let (mut header, words) = dome_within_limits(Pattern::Zig);
    header.tool_side = match header.tool_side {
        interp_core::ToolSide::Plus => interp_core::ToolSide::Minus,
        interp_core::ToolSide::Minus => interp_core::ToolSide::Plus,
    };
    let mut core = machine(&header, &words);
    let mut sample = period(&mut core, Command::Start);
    while sample.state.is_under_way() {
        sample = period(&mut core, None);
    }
    assert_eq!(core.fault().unwrap().kind, FaultKind::LinkBlocked);
    assert_eq!(sample.cl_nm, header.axes.unwrap().home_nm);
}
