//! Motion that no sample job asks for: limits from slow to absurd, periods from 100 us to 10 ms, passes of many patches, random surfaces.

use std::fmt::Write as _;

use interp_core::State;
use job::{AxisLimits, Job, Pattern};
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;
use verify::motion::limits::PeakMeter;

use crate::pass_times::{compared, limited, run};
use crate::random_surfaces::bumpy_job;

/// A machine with these limits on x and y, and half of them on z.
fn machine(velocity: f64, acceleration: f64, jerk: f64) -> AxisLimits {
    let of = |limit: f64| [limit, limit, 0.5 * limit];
    AxisLimits {
        velocity_mm_s: of(velocity),
        acceleration_mm_s2: of(acceleration),
        jerk_mm_s3: of(jerk),
    }
}

/// A part of the plate in some passes.
fn plate(feed_mm_min: f64, limits: AxisLimits, period_us: f64) -> Job {
    let text = include_str!("../jobs/plate.toml");
    let mut job = job_file::parse("plate", text).unwrap();
    job.pattern = Pattern::Zigzag;
    job.scallop_mm = 0.5;
    job.feed_mm_min = feed_mm_min;
    job.machine.limits = Some(limits);
    job.machine.period_us = period_us;
    job
}

/// What a run used.
pub(crate) struct Used {
    /// Greatest shares of velocity, acceleration and jerk that were surely reached, each over the base that positions good to 10 nm allow.
    pub(crate) shares: [f64; 3],
    /// Longest stand within the cut, periods.
    pub(crate) stand: u32,
    /// Greatest feed of the contact over the programmed one.
    pub(crate) feed: f64,
}

/// Runs a job to its end.
pub(crate) fn used(job: &Job) -> Used {
    let prepared = prepare(job).unwrap();
    let mut meter = PeakMeter::new(&job.machine);
    let mut machine = Machine::load(&prepared).unwrap();
    let (mut last_nm, mut stands, mut stand, mut feed) = (None, 0, 0, 0.0_f64);
    machine
        .run(|sample| {
            if last_nm.is_none() {
                meter.start_at_rest(sample.cl_nm);
            }
            meter.add(sample.tick.into(), sample.cl_nm);
            let stays = last_nm == Some(sample.cl_nm) && sample.state == State::Running;
            stands = if stays { stands + 1 } else { 0 };
            stand = stand.max(stands);
            if sample.state == State::Running {
                feed = feed.max(f64::from(sample.feed_mm_s) / job.feed_mm_s());
            }
            last_nm = Some(sample.cl_nm);
            true
        })
        .unwrap();
    meter.end_at_rest();
    Used {
        shares: meter.peaks().map(|peak| peak.share.unwrap()),
        stand,
        feed,
    }
}

/// From a machine of a tenth of the usual limits to one without inertia, and a jerk limit that takes seconds to reach the feed.
#[test]
fn any_limits_hold() {
    let mut off = String::new();
    for (name, feed, limits, period_us) in [
        ("a tenth", 3600.0, machine(10.0, 100.0, 2000.0), 1000.0),
        ("slow jerk", 1800.0, machine(50.0, 30.0, 100.0), 1000.0),
        ("slow acceleration", 1800.0, machine(50.0, 10.0, 5000.0), 1000.0),
        ("fast", 30_000.0, machine(1000.0, 20_000.0, 2e6), 1000.0),
        ("no inertia", 6000.0, machine(100.0, 1000.0, 1e9), 1000.0),
        ("100 us", 3600.0, machine(100.0, 1000.0, 20_000.0), 100.0),
        ("250 us", 3600.0, machine(100.0, 1000.0, 20_000.0), 250.0),
        ("5 ms", 3600.0, machine(100.0, 1000.0, 20_000.0), 5000.0),
        ("10 ms", 1800.0, machine(100.0, 1000.0, 20_000.0), 10_000.0),
    ] {
        let used = used(&plate(feed, limits, period_us));
        let Used { shares, stand, feed } = used;
        println!("{name}: {shares:.4?} of the limits, stands for {stand} periods, {feed:.6} of the feed");
        let holds = shares.iter().all(|share| *share <= 1.02);
        // Slow jerk: a rest is a time in which the tool moves by less than a nanometre.
        if !holds || feed > 1.00001 || stand > 20 {
            write!(off, "{name}: {shares:?}, {stand} periods, {feed}; ").unwrap();
        }
    }
    assert!(off.is_empty(), "{off}");
}

/// A surface with waves of some millimetres, of this many spans along each pass.
fn waves(spans: u16) -> Job {
    let poles = spans + 3;
    let mut text = String::from("[surface]\nkind = \"nurbs\"\ndegree = [3, 3]\nknots_u = [0, 0, 0, 0");
    for knot in 1..spans {
        write!(text, ", {:.8}", f64::from(knot) / f64::from(spans)).unwrap();
    }
    text += ", 1, 1, 1, 1]\nknots_v = [0, 0, 0, 0, 1, 1, 1, 1]\npoles_mm = [\n";
    for i in 0..poles {
        let x = 80.0 * f64::from(i) / f64::from(poles - 1);
        let row: Vec<String> = (0..4)
            .map(|j| {
                let j = f64::from(j);
                let z = 4.0 * (x / 9.0).sin() + 1.5 * (j + x / 30.0).sin();
                format!("[{x:.5}, {:.5}, {z:.5}]", 5.0 * j)
            })
            .collect();
        writeln!(text, "[{}],", row.join(", ")).unwrap();
    }
    text += "]\n[tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 3600\nscallop_mm = 0.3\nalong = \"u\"\nside = \"up\"\n\
             pattern = \"zigzag\"\n";
    let mut job = job_file::parse("waves", &text).unwrap();
    job.machine.limits = Some(machine(100.0, 1000.0, 20_000.0));
    job
}

/// Passes of many patches keep the limits, and take little longer than the best motion known as long as a plan has stations for each patch.
#[test]
fn passes_of_many_patches() {
    for (spans, above) in [(20, 1.05), (60, 1.1), (120, 1.3)] {
        let job = waves(spans);
        let Used { shares, stand, .. } = used(&job);
        let oracle = Oracle::new(&job).unwrap();
        let over = compared(&job, &oracle, &run(&job, 0)[&0])[0];
        println!("{spans} spans: {over:.4} of the best, {shares:.4?} of the limits");
        assert!(over <= above, "{spans} spans: {over}");
        assert!(
            shares.iter().all(|share| *share <= 1.02),
            "{spans} spans: {shares:?}"
        );
        assert!(stand <= 4, "{spans} spans: {stand} periods");
    }
}

/// First, middle and last pass of `SURFACES` random surfaces at 20 to 100 mm/s against the best motion known; prints the worst.
/// `SURFACES=300 cargo test --release -p integration-tests unusual_motion -- --ignored --nocapture`
#[test]
#[ignore = "a campaign of minutes"]
fn random_surfaces_against_the_best() {
    let surfaces = std::env::var("SURFACES").map_or(40, |count| count.parse().unwrap());
    let (mut worst, mut sum, mut passes, mut refused) = ((0.0_f64, 0, 0.0), 0.0, 0_u32, 0);
    for seed in 0..surfaces {
        let feed_mm_s = [20.0, 40.0, 60.0, 100.0][seed % 4];
        let job = limited(bumpy_job(seed), feed_mm_s);
        let Ok(oracle) = Oracle::new(&job) else { continue };
        let prepared = prepare(&job).unwrap();
        if Machine::load(&prepared).unwrap().run(|_| true).is_err() {
            refused += 1;
            continue;
        }
        let ran = run(&job, u32::MAX);
        let last = u32::try_from(ran.len() - 1).unwrap();
        for pass in [0, last / 2, last] {
            let over = compared(&job, &oracle, &ran[&pass])[0];
            sum += over;
            passes += 1;
            if over > worst.0 {
                worst = (over, seed, feed_mm_s);
                println!("surface {seed}, pass {pass} of {last}, {feed_mm_s} mm/s: {over:.4}");
            }
        }
    }
    println!(
        "{passes} passes, {refused} surfaces refused: mean {:.4}, worst {:.4} (surface {}, {} mm/s)",
        sum / f64::from(passes),
        worst.0,
        worst.1,
        worst.2
    );
    assert!(worst.0 <= 1.1, "{worst:?}");
}

/// A parabola, z = -x^2 / 60, whose first patches are 0.8 mm long and whose last one is 64 mm: its stations are 9 mm apart.
#[test]
fn a_patch_that_is_much_longer_than_the_others() {
    const SHORT: u32 = 20;
    let inner = (1..=SHORT).map(|knot| 0.01 * f64::from(knot));
    let knots: Vec<f64> = [0.0; 3].into_iter().chain(inner).chain([1.0; 3]).collect();
    let x = |t: f64| 80.0 * t - 40.0;
    let mut rows = String::new();
    for pair in knots[1..knots.len() - 1].windows(2) {
        // The pole of a polynomial is its polar form at the knots.
        let (from, to) = (x(pair[0]), x(pair[1]));
        let [x, z] = [0.5 * (from + to), -from * to / 60.0];
        writeln!(rows, "[[{x:.9}, 0, {z:.9}], [{x:.9}, 3, {z:.9}]],").unwrap();
    }
    let text = format!(
        "[surface]\nkind = \"nurbs\"\ndegree = [2, 1]\nknots_u = {knots:?}\nknots_v = [0, 0, 1, 1]\npoles_mm = [\n{rows}]\n\
        [tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 6000\nscallop_mm = 0.05\nalong = \"u\"\nside = \"up\"\npattern = \"zigzag\"\n"
    );
    let mut job = job_file::parse("parabola", &text).unwrap();
    job.machine.limits = Some(machine(100.0, 1000.0, 20_000.0));
    let Used { shares, .. } = used(&job);
    println!("{shares:.4?} of the limits");
    let [velocity, acceleration, jerk] = shares;
    assert!(
        velocity <= 1.0005 && acceleration <= 1.0 && jerk <= 1.02,
        "{shares:?}"
    );
}
