//! Every kind of bad input yields its line, a message and a remedy; the sample jobs are valid.

use job::{
    AxisLimits, CHORD_DEFAULT_MM, HeartbeatAction, Job, JobError, MachineSpec, NurbsSpec, Pattern, Side,
    SurfaceSpec, units,
};

use super::*;

const REVOLVED: &str = r#"[surface]
kind = "revolved"
radius_mm = [60, -90, 90, 20]
height_mm = [60, -90, 0, 50.0]
u = [0, 1]
v_rad = [-3.141592653589793, -0.6283185307179586]

[tool]
kind = "ball"
radius_mm = 10

[cut]
feed_mm_min = 600
scallop_mm = 0.005
along = "u"
side = "up"
pattern = "zig"
chord_mm = 0.005

[machine]
period_us = 1000
velocity_max_mm_s = [100, 100, 50]
acceleration_max_mm_s2 = [1000, 1000, 500]
jerk_max_mm_s3 = [20000, 20000, 10000]
travel_mm = [[-500, 500], [-500, 500], [-300, 300]]
steps_per_mm = [400, 400, 400]
"#;

const NURBS: &str = r#"[surface]
kind = "nurbs"
degree = [2, 1]
knots_u = [0, 0, 0, 0.5, 1, 1, 1]
knots_v = [0, 0, 1, 1]
poles_mm = [
    [[0, 0, 1], [0, 9, 1]],
    [[5, 0, 2], [5, 9, 2, 0.5]],
    [[9, 0, 2], [9, 9, 2]],
    [[14, 0, 1], [14, 9, 1]],
]

[tool]
kind = "ball"
radius_mm = 4

[cut]
feed_mm_min = 600
scallop_mm = 0.005
along = "v"
side = "-"
"#;

const PROFILE: &str = r#"[machine]
velocity_max_mm_s = [80, 90, 40]
travel_mm = [[-400, 400], [-400, 400], [-200, 200]]
steps_per_mm = [400, 400, 400]
direction_inverted = [true, false, false]
host_gone = "hold"
"#;

/// Reads a job on the machine of [`PROFILE`].
fn on_machine(text: &str) -> Result<Job, JobError> {
    parse_on(
        "job.toml",
        text,
        &file::NoFaces,
        Some(&parse_profile("machine.toml", PROFILE).unwrap()),
    )
}

#[test]
fn a_job_has_the_machine_of_the_profile() {
    let profile = parse_profile("machine.toml", PROFILE).unwrap();
    assert_eq!(profile.limits.jerk_mm_s3, AxisLimits::DEFAULT.jerk_mm_s3);
    let (silent, _) = REVOLVED.split_once("[machine]").unwrap();
    assert_eq!(on_machine(silent).unwrap().machine, profile.spec());
    let lower = format!(
        "{silent}[machine]\nvelocity_max_mm_s = [80, 10, 40]\ntravel_mm = [[0, 100], [0, 100], [0, 200]]\nhost_gone = \"finish\"\n"
    );
    let machine = on_machine(&lower).unwrap().machine;
    let limits = AxisLimits {
        velocity_mm_s: [80.0, 10.0, 40.0],
        ..profile.limits
    };
    assert_eq!(machine.limits, Some(limits));
    assert_eq!(
        machine.travel_mm,
        Some([[0.0, 100.0], [0.0, 100.0], [0.0, 200.0]])
    );
    assert_eq!(machine.heartbeat_action, HeartbeatAction::Finish);
    assert_eq!(machine.step_output, Some(profile.step_output));
}

#[test]
fn a_job_beyond_the_profile_is_refused_at_its_line() {
    let (silent, _) = REVOLVED.split_once("[machine]").unwrap();
    for (key, what) in [
        (
            "velocity_max_mm_s = [80, 91, 40]",
            "`velocity_max_mm_s` exceeds the machine's profile: 91 on y, 90 there",
        ),
        (
            "travel_mm = [[0, 1], [0, 1], [-201, 1]]",
            "`travel_mm` exceeds the machine's profile: -201 to 1 on z, -200 to 200 there",
        ),
        (
            "steps_per_mm = [400, 400, 400]",
            "the steps of the axes are the machine's, and its profile has others",
        ),
        (
            "homing_required = false",
            "the machine has to be homed, as its profile says",
        ),
    ] {
        let error = on_machine(&format!("{silent}[machine]\n{key}\n")).unwrap_err();
        assert_eq!(error.what(), what);
    }
    // Its own steps may be repeated.
    let same = format!(
        "{silent}[machine]\nsteps_per_mm = [400, 400, 400]\ndirection_inverted = [true, false, false]\n"
    );
    on_machine(&same).unwrap();
}

#[test]
fn a_profile_has_the_machines_keys_only() {
    for (text, what) in [
        (
            "[machine]\nhome_mm = [0, 0, 0]\n",
            "`home_mm` does not belong here: it is a job's",
        ),
        (
            "[machine]\nvelocity_max_mm_s = [1, 1, 1]\n",
            "`steps_per_mm` is missing",
        ),
        ("[tool]\n", "unknown section `tool`"),
    ] {
        assert_eq!(parse_profile("machine.toml", text).unwrap_err().what(), what);
    }
}

/// Positions and distances of axes that are not homed, too.
#[test]
fn homing_is_within_the_machines_range() {
    for (key, what) in [
        ("position_mm = [-400, 2200, 200]", "`position_mm` reaches 2200 mm"),
        ("back_off_mm = [1, 2200, 1]", "`back_off_mm` reaches 2200 mm"),
    ] {
        let text = format!("{PROFILE}[home]\norder = \"zx\"\n{key}\n");
        let error = parse_profile("machine.toml", &text).unwrap_err();
        assert_eq!(error.what(), format!("{what}; {}", units::POSITION_RANGE));
        assert_eq!(error.line_and_column().unwrap().0, text.lines().count());
    }
}

/// Reads `text` with its first `from` replaced by `to`.
fn edited(text: &str, from: &str, to: &str) -> Result<Job, JobError> {
    assert!(text.contains(from), "nothing to replace: {from}");
    parse("job.toml", &text.replacen(from, to, 1))
}

#[test]
fn the_documented_job_is_read() {
    let job = parse("job.toml", REVOLVED).unwrap();
    assert_eq!(
        job.surface,
        SurfaceSpec::Revolved {
            radius_mm: [60.0, -90.0, 90.0, 20.0],
            height_mm: [60.0, -90.0, 0.0, 50.0],
            u: [0.0, 1.0],
            v_rad: [-std::f64::consts::PI, -0.628_318_530_717_958_6],
        }
    );
    assert_eq!(
        (job.radius_mm, job.feed_mm_s(), job.scallop_mm, job.chord_mm),
        (10.0, 10.0, 0.005, 0.005)
    );
    assert_eq!(
        (job.along, job.side, job.pattern),
        (Along::U, Side::Up, Pattern::Zig)
    );
    assert_eq!(job.machine.period_s(), 0.001);
    assert_eq!(job.machine.limits, Some(AxisLimits::DEFAULT));
    assert_eq!(
        job.machine.travel_mm,
        Some([[-500.0, 500.0], [-500.0, 500.0], [-300.0, 300.0]])
    );
}

#[test]
fn optional_keys_have_defaults() {
    let job = parse("job.toml", NURBS).unwrap();
    assert_eq!(job.machine, MachineSpec::default());
    assert_eq!(
        (job.pattern, job.chord_mm, job.side),
        (Pattern::Zig, CHORD_DEFAULT_MM, Side::Minus)
    );
    let SurfaceSpec::Nurbs(nurbs) = &job.surface else {
        panic!("not a nurbs surface")
    };
    assert_eq!(nurbs.domain(), [[0.0, 1.0], [0.0, 1.0]]);
    assert!(nurbs.rational);
    assert_eq!(nurbs.poles_mm[1], [[5.0, 0.0, 2.0, 1.0], [5.0, 9.0, 2.0, 0.5]]);
    let job = edited(NURBS, "2, 0.5]", "2, 1]").unwrap();
    assert!(matches!(
        job.surface,
        SurfaceSpec::Nurbs(NurbsSpec { rational: false, .. })
    ));
    let job = edited(REVOLVED, "u = [0, 1]\n", "").unwrap();
    assert_eq!(job.surface.domain()[0], [0.0, 1.0]);
}

#[test]
fn supervision_is_read() {
    let read = |keys: &str| edited(REVOLVED, "period_us = 1000", keys).unwrap().machine;
    let strict = read("period_us = 1000");
    assert!(strict.homing_required);
    assert_eq!(
        (strict.heartbeat_action, strict.heartbeat_timeout_ms),
        (HeartbeatAction::Finish, 1000.0)
    );
    let other = read("homing_required = false\nhost_gone = \"hold\"\nhost_gone_ms = 500.1");
    assert!(!other.homing_required);
    assert_eq!(
        (other.heartbeat_action, other.heartbeat_timeout_ms),
        (HeartbeatAction::Hold, 500.1)
    );
}

#[test]
fn unclamped_knots_are_allowed() {
    let job = edited(NURBS, "[0, 0, 0, 0.5, 1, 1, 1]", "[0, 1, 2, 3, 4, 5, 6]").unwrap();
    assert_eq!(job.surface.domain()[0], [2.0, 4.0]);
}

/// Each row: text, old part, new part, line and column of the error, a part of the message.
type BadInput = (
    &'static str,
    &'static str,
    &'static str,
    usize,
    usize,
    &'static str,
);

fn check(rows: &[BadInput]) {
    for (text, from, to, line, column, what) in rows {
        let error = edited(text, from, to).expect_err(&format!("{from} -> {to} was accepted"));
        assert!(error.what().contains(what), "{from} -> {to}: {error}");
        assert_eq!(
            error.line_and_column(),
            Some((*line, *column)),
            "{from} -> {to}: {error}"
        );
        assert!(
            error
                .to_string()
                .starts_with(&format!("job.toml:{line}:{column}: ")),
            "{error}"
        );
        assert!(!error.remedy().is_empty(), "{error}");
    }
}

#[test]
#[rustfmt::skip] // a table: a row a line
fn keys_and_kinds() {
    check(&[
        (REVOLVED, "feed_mm_min", "feed_mm_mn", 13, 1, "unknown key `feed_mm_mn`; did you mean `feed_mm_min`?"),
        (REVOLVED, "feed_mm_min", "feed", 13, 1, "unknown key `feed`; did you mean `feed_mm_min`?"),
        (REVOLVED, "scallop_mm", "SCALLOP_MM", 14, 1, "did you mean `scallop_mm`?"),
        (REVOLVED, "[tool]", "[tol]", 8, 2, "unknown section `tol`; did you mean `tool`?"),
        (REVOLVED, "[tool]", "[router]", 8, 2, "unknown section `router`"),
        (REVOLVED, "feed_mm_min = 600\n", "", 12, 2, "`feed_mm_min` is missing in [cut]"),
        (REVOLVED, "u = [0, 1]", "v = [0, 1]", 5, 1, "the range of a revolved surface is `v_rad`"),
        (REVOLVED, "height_mm", "knots_u", 4, 1, "only a nurbs surface has it"),
        (NURBS, "degree = [2, 1]", "u = [0, 1]", 3, 1, "the range of a nurbs surface is that of its knots"),
        (REVOLVED, "\"revolved\"", "\"file\"", 3, 1, "only a revolved surface has it"),
        (REVOLVED, "\"revolved\"", "\"revolve\"", 2, 8, "did you mean \"revolved\"?"),
        (REVOLVED, "\"ball\"", "\"flat\"", 9, 8, "`kind` cannot be \"flat\""),
        (REVOLVED, "\"u\"", "u", 15, 9, "not valid TOML"),
        (REVOLVED, "feed_mm_min = 600", "feed_mm_min = ", 13, 15, "not valid TOML"),
        (REVOLVED, "scallop_mm = 0.005", "feed_mm_min = 1", 14, 1, "duplicate key"),
        ("surface = 3", "3", "4", 1, 11, "`surface` must be a section, not a number"),
        ("", "", "[cut]", 1, 6, "the section `[surface]` is missing"),
    ]);
}

#[test]
#[rustfmt::skip] // a table: a row a line
fn types_and_shapes() {
    check(&[
        (REVOLVED, "600", "\"600\"", 13, 15, "`feed_mm_min` must be a number, not a text"),
        (REVOLVED, "\"up\"", "1", 16, 8, "`side` must be a text in quotes, not a number"),
        (REVOLVED, "90, 20]", "90]", 3, 13, "`radius_mm` must have 4 numbers, not 3"),
        (REVOLVED, "90, 20]", "90, [20]]", 3, 27, "`radius_mm`, number 4 must be a number, not a list"),
        (REVOLVED, "[-300, 300]]", "[-300]]", 25, 40, "`travel_mm`, row 3 must have 2 numbers, not 1"),
        (NURBS, "    [[9, 0, 2], [9, 9, 2]],", "    [[9, 0, 2]],", 9, 5, "`poles_mm`, row 3 has 1 poles, but row 1 has 2"),
        (NURBS, "[5, 9, 2, 0.5]", "[5, 9]", 8, 17, "`poles_mm`, row 2, pole 2 must have 3 or 4 numbers, not 2"),
        (NURBS, "0.5, 1, 1, 1]", "1, 1, 1]", 4, 11, "6 knots, but 4 rows of degree 2 take 4 + 2 + 1 = 7"),
        (NURBS, "[0, 0, 1, 1]", "[0, 0, 1]", 5, 11, "3 knots, but 2 poles a row of degree 1 take 2 + 1 + 1 = 4"),
        (NURBS, "degree = [2, 1]", "degree = [2, 3]", 6, 12, "has 2 poles a row, too few for degree 3"),
    ]);
}

#[test]
#[rustfmt::skip] // a table: a row a line
fn ranges() {
    check(&[
        (NURBS, "0.5, 1, 1, 1]", "0.5, 1e15, 1e15, 1e15]", 4, 26, "is 1000000000000000, beyond 1e9"),
        (REVOLVED, "600", "0", 13, 15, "must be above 0.06 and at most 600000, not 0"),
        (REVOLVED, "600", "nan", 13, 15, "must be a finite number"),
        (REVOLVED, "600", "1e999", 13, 15, "must be a finite number"),
        (REVOLVED, "radius_mm = 10", "radius_mm = -inf", 10, 13, "must be a finite number"),
        (REVOLVED, "radius_mm = 10", "radius_mm = -1", 10, 13, "`radius_mm` must be above 0"),
        (REVOLVED, "scallop_mm = 0.005", "scallop_mm = 10", 14, 14, "below the ball radius of 10 mm, not 10"),
        (REVOLVED, "scallop_mm = 0.005", "scallop_mm = 1e-300", 14, 14, "`scallop_mm` must be at least 1e-12 mm"),
        (REVOLVED, "chord_mm = 0.005", "chord_mm = 0", 18, 12, "`chord_mm` must be above 0"),
        (REVOLVED, "chord_mm = 0.005", "spacing = \"constant\"\noverrun_mm = 2", 19, 14, "no turns beyond the boundary"),
        (REVOLVED, "chord_mm = 0.005", "overrun_mm = 2", 18, 14, "passes in one direction have no turns"),
        (NURBS, "side = \"-\"", "side = \"-\"\npattern = \"zigzag\"\noverrun_mm = 2", 23, 14, "without axis limits there are no turns"),
        (REVOLVED, "u = [0, 1]", "u = [1, 0]", 5, 5, "`u` must ascend, not run from 1 to 0"),
        (REVOLVED, "-3.141592653589793", "-9", 6, 9, "more than a full turn"),
        (REVOLVED, "90, 20]", "90, -20]", 3, 13, "the profile's radius is negative: -20 mm at u = 0"),
        (REVOLVED, "1000", "1", 21, 13, "`period_us` must be 10 to 100000, not 1"),
        (REVOLVED, "[100, 100, 50]", "[100, 0, 50]", 22, 21, "`velocity_max_mm_s` must be above 0, not 0"),
        (REVOLVED, "[100, 100, 50]", "[100, 1e9, 50]", 22, 21, "`velocity_max_mm_s` must be 0.001 to 100000, not 1000000000"),
        (REVOLVED, "[-500, 500]", "[500, -500]", 25, 13, "the travel of x must ascend"),
        (REVOLVED, "[-500, 500]", "[-500, 5000]", 25, 13, "`travel_mm` reaches 5000 mm; the machine's range is ±2147.483 mm"),
        (REVOLVED, "period_us = 1000", "home_mm = [3000, 0, 10]", 21, 11, "`home_mm` reaches 3000 mm; the machine's range is ±2147.483 mm"),
        (REVOLVED, "period_us = 1000", "safe_z_mm = -2147.484", 21, 13, "`safe_z_mm` reaches -2147.484 mm; the machine's range is ±2147.483 mm"),
        (REVOLVED, "period_us = 1000", "host_gone = \"stop\"", 21, 13, "`host_gone` cannot be \"stop\""),
        (REVOLVED, "feed_mm_min = 600", "feed_mm_min = 60001", 13, 15, "`feed_mm_min` must be at most 60000 on a machine with limits and a period of 1000 us, not 60001"),
        (REVOLVED, "period_us = 1000", "host_gone_ms = 99", 21, 16, "`host_gone_ms` must be 100 to 60000, not 99"),
        (REVOLVED, "period_us = 1000", "homing_required = 0", 21, 19, "`homing_required` must be true or false, not a number"),
        (NURBS, "degree = [2, 1]", "degree = [4, 1]", 3, 11, "`degree`, number 1 must be a whole number from 1 to 3"),
        (NURBS, "degree = [2, 1]", "degree = [2, 1.5]", 3, 14, "must be a whole number from 1 to 3, not 1.5"),
        (NURBS, "[0, 0, 0, 0.5,", "[0, 0, 0, -0.5,", 4, 21, "`knots_u`, knot 4 is -0.5, below the previous one (0)"),
        (NURBS, "[0, 0, 0, 0.5,", "[0, 0, 0, 0,", 4, 21, "gives 0 a multiplicity of 4; at an end"),
        (NURBS, "[0, 0, 0, 0.5, 1, 1, 1]", "[0, 1, 1, 1, 1, 1, 3]", 4, 11, "leaves an empty range"),
        (NURBS, "2, 0.5]", "2, 0]", 8, 17, "has the weight 0, which must be above 0"),
    ]);
}

#[test]
#[rustfmt::skip] // a table: a row a line
fn placements() {
    const TOOL: &str = "[tool]";
    check(&[
        (REVOLVED, TOOL, "[placment]\n[tool]", 8, 2, "unknown section `placment`; did you mean `placement`?"),
        (REVOLVED, TOOL, "[placement]\nrotate = [0, 0, 1]\n[tool]", 9, 1, "unknown key `rotate`; did you mean `rotate_deg`?"),
        (REVOLVED, TOOL, "[placement]\nscale = 0\n[tool]", 9, 9, "`scale` must be above 0 and at most 1000000, not 0"),
        (REVOLVED, TOOL, "[placement]\nscale = nan\n[tool]", 9, 9, "must be a finite number"),
        (REVOLVED, TOOL, "[placement]\nscale = [1, 1, 1]\n[tool]", 9, 9, "`scale` must be a number, not a list"),
        (REVOLVED, TOOL, "[placement]\nrotate_deg = 90\n[tool]", 9, 14, "`rotate_deg` must be a list, not a number"),
        (REVOLVED, TOOL, "[placement]\nrotate_deg = [0, 361, 0]\n[tool]", 9, 14, "must be -360 to 360, not 361"),
        (REVOLVED, TOOL, "[placement]\nplace = \"center\"\n[tool]", 9, 9, "did you mean \"centre\"?"),
        (REVOLVED, TOOL, "[placement]\ntranslate_mm = [0, 2200, 0]\n[tool]", 9, 16, "the placed surface extends from y = 2120.000 to 2200.000 mm"),
        (REVOLVED, TOOL, "[placement]\ntranslate_mm = [0, 1, 0]\nscale = 100\n[tool]", 10, 9, "the machine's range is ±2147.483 mm"),
    ]);
}

#[test]
fn an_inner_knot_of_full_multiplicity_is_refused() {
    let text = NURBS.replace("[0, 0, 0, 0.5, 1, 1, 1]", "[0, 0, 0, 0.5, 0.5, 0.5, 1, 1, 1]");
    let rows = "    [[14, 0, 1], [14, 9, 1]],\n";
    let error = edited(&text, rows, &rows.repeat(3)).unwrap_err();
    assert_eq!(error.line_and_column(), Some((4, 31)), "{error}");
    assert!(
        error
            .what()
            .contains("gives 0.5 a multiplicity of 3; inside the range it may be at most 2"),
        "{error}"
    );
}

#[test]
fn a_profile_may_touch_the_axis() {
    // R(u) = 20 u (2 - u) is 0 at u = 0; R(u) = (u - 0.5)^2 touches 0 inside.
    assert!(edited(REVOLVED, "[60, -90, 90, 20]", "[0, -20, 40, 0]").is_ok());
    assert!(edited(REVOLVED, "[60, -90, 90, 20]", "[0, 1, -1, 0.25]").is_ok());
    assert!(edited(REVOLVED, "[60, -90, 90, 20]", "[0, 1, -1, 0.24]").is_err());
}

#[test]
fn a_later_stage_can_point_at_a_line() {
    let job = parse("job.toml", REVOLVED).unwrap();
    let error = job
        .origin
        .error("tool.radius_mm", "the ball does not fit", "take a smaller one");
    assert_eq!(error.to_string(), "job.toml:10:13: the ball does not fit");
    let error = job.origin.error("cut.nothing", "no such key", "none");
    assert_eq!(error.line_and_column(), Some((12, 2)));
}

#[test]
fn the_error_shows_the_line_with_a_caret() {
    let error = edited(REVOLVED, "feed_mm_min", "feed_mm_mn").unwrap_err();
    let mut shown = String::new();
    let handler = miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::none());
    handler.render_report(&mut shown, &error).unwrap();
    for part in [
        "did you mean `feed_mm_min`?",
        "job.toml:13:1",
        "feed_mm_mn = 600",
        "^^^^",
        "help: the keys of [cut] are",
    ] {
        assert!(shown.contains(part), "{part} is not in\n{shown}");
    }
}

#[test]
fn a_missing_file() {
    let error = load(Path::new("no/such/job.toml")).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("no/such/job.toml: there is no such file"),
        "{error}"
    );
    assert_eq!(error.line_and_column(), None);
}

#[test]
fn every_sample_job_is_valid() {
    let jobs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../jobs");
    let mut read = 0;
    for entry in std::fs::read_dir(jobs).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            load(&path).unwrap();
            read += 1;
        }
    }
    assert!(read >= 10, "only {read} jobs found");
}

/// A job that gives one limit is a job with limits: the others take their defaults, for every reader of the job.
#[test]
fn one_limit_brings_the_defaults_of_the_others() {
    let bare = REVOLVED.split("velocity_max_mm_s").next().unwrap();
    assert_eq!(parse("job.toml", bare).unwrap().machine.limits, None);
    let default = AxisLimits::DEFAULT;
    for (key, limits) in [
        (
            "velocity_max_mm_s = [7, 8, 9]",
            AxisLimits {
                velocity_mm_s: [7.0, 8.0, 9.0],
                ..default
            },
        ),
        (
            "acceleration_max_mm_s2 = [70, 80, 90]",
            AxisLimits {
                acceleration_mm_s2: [70.0, 80.0, 90.0],
                ..default
            },
        ),
        (
            "jerk_max_mm_s3 = [700, 800, 900]",
            AxisLimits {
                jerk_mm_s3: [700.0, 800.0, 900.0],
                ..default
            },
        ),
    ] {
        let job = parse("job.toml", &format!("{bare}{key}\n")).unwrap();
        assert_eq!(job.machine.limits, Some(limits), "{key}");
        assert!(job.machine.has_limits());
    }
}

/// More patches than the board stores are refused before anything is made of them.
#[test]
fn too_many_patches_are_refused_at_once() {
    let job = |n: usize| {
        let knots: Vec<String> = (0..=n + 1).map(|k| k.clamp(1, n).to_string()).collect();
        let row = format!(
            "[{}]",
            (0..n)
                .map(|j| format!("[0, {j}, 0]"))
                .collect::<Vec<_>>()
                .join(",")
        );
        let rows = vec![row; n].join(",");
        let knots = knots.join(",");
        format!(
            "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [{knots}]\nknots_v = [{knots}]\npoles_mm = [{rows}]\n\
             [placement]\nplace = \"centre\"\n[tool]\nkind = \"ball\"\nradius_mm = 1\n[cut]\nfeed_mm_min = 600\n\
             scallop_mm = 0.01\nalong = \"u\"\nside = \"+\"\n"
        )
    };
    parse("x", &job(18)).unwrap();
    let begun = std::time::Instant::now();
    let error = parse("x", &job(400)).unwrap_err();
    assert!(error.what().contains("make 159201 patches"), "{error}");
    assert_eq!(error.line_and_column().unwrap().0, 6);
    assert!(begun.elapsed().as_secs() < 20, "{:?}", begun.elapsed());
}

/// The region of (u, v), with the place of each mistake in it.
#[test]
fn regions_are_checked_where_they_are_written() {
    let job = |region: &str| parse("job.toml", &format!("{NURBS}\n[region]\n{region}\n"));
    assert_eq!(parse("job.toml", NURBS).unwrap().region, None);
    let read = job("loops = [[[0, 0], [1, 0], [1, 1.0000000000001], [0, 0]], [[0.6, 0.1], [0.8, 0.1], [0.8, 0.1], [0.8, 0.3]]]")
        .unwrap()
        .region
        .unwrap();
    assert_eq!(
        read.loops,
        [
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
            [[0.6, 0.1], [0.8, 0.1], [0.8, 0.3]]
        ]
    );
    let line = NURBS.lines().count() + 3;
    for (region, place, what) in [
        ("", None, "`loops` is missing in [region]"),
        ("holes = []", None, "unknown key `holes`"),
        ("loops = []", Some(9), "must have at least one loop"),
        (
            "loops = [[[0, 0], [1, 1], [0, 0]]]",
            Some(10),
            "must have at least 3 different vertices, not 2",
        ),
        (
            "loops = [[[0, 0], [1, 1], [1, 2.5]]]",
            Some(27),
            "lies outside the surface: v = 2.5, but its range is 0 to 1",
        ),
        (
            "loops = [[[0, 0], [1, 1], [1]]]",
            Some(27),
            "must have 2 numbers, not 1",
        ),
        (
            "loops = [[[0, 0], [1, 1], [1, 0], [0, 1]]]",
            Some(11),
            "crosses itself: its edge from here meets the one from vertex 3 at u = 0.500000, v = 0.500000",
        ),
        (
            "loops = [[[0, 0], [1, 0], [0, 1]], [[0.1, 0.1], [0.9, 0.2], [0.1, 0.2]]]",
            Some(19),
            "crosses another loop: its edge from here meets loop 2",
        ),
    ] {
        let error = job(region).unwrap_err();
        assert!(error.what().contains(what), "{region}: {error}");
        assert!(!error.remedy().is_empty());
        if let Some(column) = place {
            assert_eq!(error.line_and_column(), Some((line, column)), "{region}: {error}");
        }
    }
    // A corner on an edge, and edges that share one line, only touch.
    job("loops = [[[0, 0], [1, 0], [1, 1], [0, 1]], [[0.5, 0], [0.7, 0.5], [0.3, 0.5]], [[0, 0.2], [0, 0.4], [0.1, 0.3]]]").unwrap();
}
