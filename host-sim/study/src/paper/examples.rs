//! Examples 1 to 6 as items.

use super::geometry::{ChordsOfPass, Geometry};
use super::{Case, Cases, Comparison, Item};
use approach::{ApproachError, Chords, Kind, Linear, Measured, PassPath, measure_run, passes, planned};
use job::units::{MM_PER_NM, S_PER_MIN};

/// Seconds in a minute.
const PAPER_PERIOD_US: f64 = 5000.0;

/// Builds items of one part.
struct Part {
    part: &'static str,
    items: Vec<Item>,
}

impl Part {
    fn new(part: &'static str) -> Self {
        Self {
            part,
            items: Vec::new(),
        }
    }

    fn add(
        &mut self,
        what: impl Into<String>,
        (unit, decimals): (&'static str, usize),
        printed: Option<f64>,
        ours: f64,
        note: impl Into<String>,
    ) {
        self.items.push(Item {
            part: self.part,
            what: what.into(),
            unit,
            decimals,
            printed,
            ours: Some(ours),
            note: note.into(),
        });
    }
}

const COUNT: (&str, usize) = ("", 0);
const MM: (&str, usize) = ("mm", 4);
const MM_LONG: (&str, usize) = ("mm", 1);
const SPEED: (&str, usize) = ("mm/s", 3);
const MINUTES: (&str, usize) = ("min", 2);
const PERCENT: (&str, usize) = ("%", 1);
const RIPPLE: (&str, usize) = ("%", 2);

/// The items of all examples.
pub(super) fn items(cases: &Cases, comparisons: &[Comparison]) -> Result<Vec<Item>, ApproachError> {
    let bell = Geometry::new(&cases.revolved.oracle)?;
    let around = Geometry::new(&cases.revolved_v.oracle)?;
    let compared = |name: &str, kind| {
        let found = comparisons.iter().find(|comparison| comparison.name == name);
        found
            .and_then(|comparison| comparison.row(kind))
            .map(|row| &row.measured)
    };
    let name = cases.revolved.name;
    let mut items = example_1(&cases.revolved, &bell, &around);
    items.extend(example_2(cases)?);
    items.extend(example_3(&cases.revolved, compared(name, Kind::Linear))?);
    items.extend(example_4(compared(name, Kind::Curve)));
    items.extend(example_5(compared(name, Kind::Surface)));
    Ok(items)
}

/// The revolved surface: speed of the contact at constant speed of the tool centre.
fn example_1(case: &Case, u: &Geometry, v: &Geometry) -> Vec<Item> {
    let feed = case.job.feed_mm_s();
    let [low, high] = u.ratio;
    let mut part = Part::new("Example 1");
    part.add(
        "passes along u",
        COUNT,
        Some(319.0),
        u.passes as f64,
        format!(
            "{:.3} intervals; the first and the last pass lie on the boundaries",
            intervals(case, u)
        ),
    );
    part.add(
        "least interval",
        ("rad", 10),
        None,
        u.interval_min,
        "at u = 1, the same on every pass",
    );
    part.add("length of a pass on the surface", MM, None, u.pass_mm[0], "");
    part.add(
        "length of a pass of the tool centre",
        MM,
        None,
        u.pass_mm[1],
        "equal to the former, because the profile's tangent turns by zero in total",
    );
    part.add("time of a pass", ("s", 3), None, u.pass_mm[0] / feed, "");
    part.add(
        "slowest contact at constant speed of the centre",
        SPEED,
        None,
        feed / high,
        "",
    );
    part.add(
        "fastest contact at constant speed of the centre",
        SPEED,
        None,
        feed / low,
        format!(
            "programmed feed {feed}: the surface is cut at {:.0} % to {:.0} % of it",
            100.0 / high,
            100.0 / low
        ),
    );
    part.add(
        "slowest centre at constant speed of the contact",
        SPEED,
        None,
        feed * low,
        "",
    );
    part.add(
        "fastest centre at constant speed of the contact",
        SPEED,
        None,
        feed * high,
        "",
    );
    part.add("length of all passes", MM_LONG, None, u.cc_length_mm, "");
    part.add(
        "machining time",
        MINUTES,
        None,
        u.cc_length_mm / feed / S_PER_MIN,
        "without links between passes",
    );
    part.add("passes along v", COUNT, None, v.passes as f64, "");
    part.add("length of all passes along v", MM_LONG, None, v.cc_length_mm, "");
    part.add(
        "length at constant scallop height",
        MM_LONG,
        None,
        u.even_scallop_mm,
        "integral of the surface's area over the local step-over: a lower bound for this scallop height",
    );
    part.add(
        "passes along u waste",
        PERCENT,
        None,
        u.waste_pct(),
        "iso-parametric passes are closest at the neck",
    );
    part.items
}

/// Range of the side parameter in least intervals.
fn intervals(case: &Case, geometry: &Geometry) -> f64 {
    let [first, last] = case.oracle.side_range();
    (last - first) / geometry.interval_min
}

/// The ruled surface, as printed and as reconstructed.
fn example_2(cases: &Cases) -> Result<Vec<Item>, ApproachError> {
    let mut part = Part::new("Example 2");
    for (case, which) in [
        (&cases.printed, "as printed"),
        (&cases.reconstructed, "reconstructed"),
    ] {
        let geometry = Geometry::new(&case.oracle)?;
        let all = passes(&case.oracle)?;
        let Some(pass) = all.get(all.len() / 2) else {
            continue;
        };
        let count = |rule| ChordsOfPass::new(pass, rule, case.job.chord_mm).map(|chords| chords.count as f64);
        let (curve, normal) = (count(Chords::Equation)?, count(Chords::EquationNormal)?);
        let minutes = |length_mm: f64| length_mm / case.job.feed_mm_s() / S_PER_MIN;
        let (cl, cc) = (minutes(geometry.cl_length_mm), minutes(geometry.cc_length_mm));
        let passes = geometry.passes as f64;
        let what = |what: &str| format!("{which}: {what}");
        let differs = which == "as printed";
        let note = if differs {
            "the printed equation does not give the printed figure"
        } else {
            "the paper's figure, with the u terms in y alone"
        };
        part.add(what("passes"), COUNT, Some(132.0), passes, "");
        part.add(
            what("segments a pass, curvature of the curve"),
            COUNT,
            Some(44.0),
            curve,
            note,
        );
        part.add(
            what("segments a pass, normal curvature"),
            COUNT,
            Some(44.0),
            normal,
            "eqn 6 does not define which curvature it uses",
        );
        part.add(what("segments"), COUNT, Some(5808.0), passes * curve, note);
        let rounding = if differs {
            note
        } else {
            "the only figure of the paper that differs by more than rounding"
        };
        part.add(
            what("time at constant speed of the centre"),
            MINUTES,
            Some(14.2),
            cl,
            rounding,
        );
        part.add(
            what("time at constant speed of the contact"),
            MINUTES,
            Some(10.7),
            cc,
            note,
        );
        part.add(
            what("time saved"),
            PERCENT,
            Some(25.0),
            100.0 * (1.0 - cc / cl),
            if differs {
                note
            } else {
                "of the rounded times the paper's is 24.6"
            },
        );
    }
    Ok(part.items)
}

/// Runs the linear interpolator over one pass with eqn 6 as printed.
fn by_equation(case: &Case, pass: &PassPath<'_>) -> Result<Measured, ApproachError> {
    let linear = Linear::new(&case.job, Chords::Equation);
    measure_run(&case.job, &mut |_, _, _| {}, |each| {
        planned(&linear, &case.job, &[*pass], each)
    })
}

/// Method 1 on the revolved surface.
fn example_3(case: &Case, held: Option<&Measured>) -> Result<Vec<Item>, ApproachError> {
    let mut part = Part::new("Example 3");
    let all = passes(&case.oracle)?;
    let Some(pass) = all.first() else {
        return Ok(Vec::new());
    };
    let chords = ChordsOfPass::new(pass, Chords::Equation, case.job.chord_mm)?;
    let total = (chords.count * all.len()) as f64;
    let slow = case.with_period_us(PAPER_PERIOD_US);
    let run = by_equation(&slow, pass)?;
    part.add(
        "segments a pass by eqn 6",
        COUNT,
        Some(46.0),
        chords.count as f64,
        "",
    );
    part.add("segments by eqn 6", COUNT, Some(14674.0), total, "");
    part.add(
        "chord error that eqn 6 leaves",
        MM,
        Some(case.job.chord_mm),
        chords.error_mm,
        format!(
            "eqn 6 uses the curvature at the start of a chord; one chord from {:.3} to {:.3} spans the inflection at u = 0.5",
            chords.worst[0], chords.worst[1]
        ),
    );
    part.add(
        "ripple of the contact at 5 ms, at most",
        RIPPLE,
        None,
        run.findings.report.ripple_pct.max,
        "each segment in whole periods, rounded up; the worst is that one chord",
    );
    part.add(
        "ripple of the contact at 5 ms, rms",
        RIPPLE,
        None,
        run.findings.report.ripple_pct.rms(),
        "",
    );
    part.add(
        "step of the centre's speed",
        SPEED,
        None,
        run.findings.speeds.cl_step_mm_s,
        "",
    );
    if let Some(held) = held {
        let per_pass = held.planned.segments as f64 / held.planned.passes as f64;
        part.add(
            "segments a pass that hold the tolerance",
            COUNT,
            None,
            per_pass,
            "longest chords whose measured error, on the surface and of the centre's path, is 0.005 mm",
        );
        part.add(
            "their ripple at 1 ms, at most",
            RIPPLE,
            None,
            held.findings.report.ripple_pct.max,
            "the centre's speed is constant on a chord, the speed that keeps the feed is not",
        );
        part.add(
            "their step of the centre's speed",
            SPEED,
            None,
            held.findings.speeds.cl_step_mm_s,
            "",
        );
    }
    Ok(part.items)
}

/// Method 2 on the revolved surface.
fn example_4(curve: Option<&Measured>) -> Vec<Item> {
    let mut part = Part::new("Example 4");
    if let Some(curve) = curve {
        let segments = curve.planned.segments as f64;
        part.add(
            "cubic segments a pass",
            COUNT,
            Some(4.0),
            segments / curve.planned.passes as f64,
            "path within 0.005 mm, speed within 1 % of the feed, no step in direction or speed",
        );
        part.add("cubic segments", COUNT, Some(1276.0), segments, "");
        part.add(
            "error of the centre's path",
            MM,
            None,
            curve.findings.report.position_nm.max * MM_PER_NM,
            "",
        );
        part.add(
            "ripple of the contact, at most",
            RIPPLE,
            None,
            curve.findings.report.ripple_pct.max,
            "",
        );
    }
    part.items
}

/// Method 3 on the revolved surface.
fn example_5(surface: Option<&Measured>) -> Vec<Item> {
    let mut part = Part::new("Example 5");
    if let Some(surface) = surface {
        part.add(
            "passes that the core makes",
            COUNT,
            Some(319.0),
            surface.planned.passes as f64,
            "counted in a run of the core",
        );
        part.add(
            "bytes of the job",
            COUNT,
            None,
            surface.planned.bytes as f64,
            "header and surface, as the machine stores them",
        );
        part.add(
            "error of the centre's path",
            ("nm", 1),
            None,
            surface.findings.report.position_nm.max,
            "",
        );
        part.add(
            "ripple of the contact, at most",
            ("%", 6),
            None,
            surface.findings.report.ripple_pct.max,
            "",
        );
    }
    part.items
}
