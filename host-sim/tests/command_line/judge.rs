//! Motion from elsewhere, judged on a job: tables of samples and programs.

use serde_json::Value;

use super::{err, folder_with, json, out, run, sample};

/// The core's own samples, judged as anybody's: as `verify` finds them. Moved by 4 um they fail, with that path error.
#[test]
fn judge_takes_samples_and_agrees_with_verify() {
    let folder = folder_with("torus", &[("scallop_mm = 0.005", "scallop_mm = 0.02")]);
    assert!(
        run(folder.path(), "simulate job.toml --trace own.csv")
            .status
            .success()
    );
    let reported = json(folder.path(), "judge job.toml own.csv --json --report page");
    let page = std::fs::read_to_string(folder.path().join("page/index.html")).unwrap();
    assert!(page.contains("Judged: given, and this core") && page.contains("own.csv on the job"));
    assert_eq!(reported["given"]["reach"]["verdict"], "met");
    assert_eq!(reported["given"]["reach"]["contact"]["above_equator"], 0);
    let verified = json(folder.path(), "verify job.toml --json");
    let number = |value: &Value| value.as_f64().unwrap();
    assert_eq!(reported["passed"], true, "{reported}");
    assert_eq!(reported["given"], reported["core"], "the same motion");
    assert_eq!(reported["core_fault"], Value::Null);
    let [theirs, ours] = [&reported["given"], &verified].map(|of| number(&of["scallop_max_mm"]));
    assert!((theirs / ours - 1.0).abs() < 2e-3, "{theirs} and {ours}");
    assert!(
        number(&reported["given"]["path_error_max_mm"]) < 10e-6,
        "{reported}"
    );
    assert!(number(&reported["given"]["ripple_rms_pct"]) < 0.02, "{reported}");
    let trace = std::fs::read_to_string(folder.path().join("own.csv")).unwrap();
    let mut table = "t_s,x_mm,y_mm,z_mm\n".to_owned();
    for line in trace.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let mm = |index: usize| fields[index].parse::<f64>().unwrap() * 1e-6;
        table += &format!("{},{},{},{}\n", fields[1], mm(10), mm(11), mm(12) - 5.0 + 0.004);
    }
    std::fs::write(folder.path().join("tip.csv"), &table).unwrap();
    let output = run(folder.path(), "judge job.toml tip.csv --tip --alone --json");
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    let reported: Value = serde_json::from_slice(&output.stdout).unwrap();
    // The ball sits in the groove, so a lift moves it off the bottom by all of it, and nearer to neither flank.
    assert!(
        (number(&reported["given"]["path_error_max_mm"]) - 0.004).abs() < 5e-5,
        "{reported}"
    );
    assert!(reported["core"].is_null() && reported["core_fault"].is_null());
    for (text, wanted) in [
        ("t_s,x,y,z\n0,1,2,3\n", ":1: the columns"),
        (
            "t_s,x_mm,y_mm,z_mm\n0,1,2,3\n0.001,1,2,x\n",
            ":3: `x` is no number",
        ),
        (
            "t_s,x_mm,y_mm,z_mm\n0,1,2,3\n0.001,1,2,3\n0.005,1,2,3\n",
            "not evenly spaced",
        ),
        ("t_s,x_mm,y_mm,z_mm\n0,1,2,3\n", "do not ascend"),
        ("t_s,x_mm,y_mm,z_mm\n0,1,2,3\n1,1,2,9000\n", "not within 2147"),
    ] {
        std::fs::write(folder.path().join("bad.csv"), text).unwrap();
        let output = run(folder.path(), "judge job.toml bad.csv --json");
        assert_eq!(output.status.code(), Some(2), "{text}");
        let reported: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(
            reported["error"]["message"].as_str().unwrap().contains(wanted),
            "{reported}"
        );
    }
}

/// A program of chords within 5 um, read by LinuxCNC's interpreter: its path error is at most that, and it shows.
#[test]
fn judge_takes_programs() {
    let folder = folder_with("torus", &[("scallop_mm = 0.005", "scallop_mm = 0.02")]);
    let exported = run(folder.path(), "export job.toml --format linuxcnc -o part.ngc");
    assert!(exported.status.success(), "{}", err(&exported));
    let output = run(
        folder.path(),
        "judge job.toml part.ngc --alone --json --path-tolerance 0.0052",
    );
    let reported: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(
        reported.get("given").is_some(),
        "LinuxCNC's rs274 is needed, as scripts/setup.sh brings it: {reported}"
    );
    let error = reported["given"]["path_error_max_mm"].as_f64().unwrap();
    assert!(error > 0.002 && error <= 0.0052, "{error}");
    let [least, mean] = ["min", "mean"].map(|key| reported["given"]["feed_mm_s"][key].as_f64().unwrap());
    assert!(least < mean && (mean - 10.0).abs() < 0.1, "{mean}");
    // The program of a job with axis limits: its corners are the machine's to round, so velocity alone is judged, and it passes.
    // Its chords are within 3 um above the surface, which the passes leave room for.
    let machine = folder_with(
        "plate_machine",
        &[
            ("scallop_mm = 0.05", "scallop_mm = 0.045"),
            ("chord_mm = 0.005", "chord_mm = 0.003"),
        ],
    );
    let exported = run(machine.path(), "export job.toml --format linuxcnc -o posted.ngc");
    assert!(exported.status.success(), "{}", err(&exported));
    std::fs::write(machine.path().join("job.toml"), sample("plate_machine")).unwrap();
    let reported = json(machine.path(), "judge job.toml posted.ngc --alone --json");
    let (given, null) = (&reported["given"], Value::Null);
    assert!(given["limits"]["velocity"].as_f64().unwrap() <= 1.01, "{given}");
    assert_eq!(
        (&given["limits"]["acceleration"], &given["axes"]["jerk_mm_s3"]),
        (&null, &null)
    );
    let missing = given["not_measured"].to_string();
    assert!(
        missing.contains("limits.acceleration") && missing.contains("axes.jerk_mm_s3"),
        "{missing}"
    );
    let text = out(&run(machine.path(), "judge job.toml posted.ngc --alone"));
    assert!(text.contains("not judged"), "{text}");
    std::fs::write(folder.path().join("bad.ngc"), "G1 X1 Y2 F0 Q\n").unwrap();
    let refused = run(folder.path(), "judge job.toml bad.ngc --json");
    assert_eq!(refused.status.code(), Some(2), "{}", out(&refused));
}

/// A program in coordinates that are not the job's is refused, by the call and with the remedy; and so is one with a feed per revolution.
#[test]
fn judge_refuses_programs_with_offsets() {
    let folder = folder_with("torus", &[]);
    for (text, call, remedy) in [
        (
            "G21G94\nG10 L2 P1 X0 Y0 Z5\nG0X1Y1Z1\nG1X2F100\nM2\n",
            "SET_G5X_OFFSET(1, 0.0000, 0.0000, 5.0000",
            "G10 L2",
        ),
        ("G21G94\nG0X1Y1Z1\nN20 G92 X7\nG1X2F100\nM2\n", "block N20", "G92"),
        (
            "G21G94\nG43.1 Z5\nG0X1Y1Z1\nG1X2F100\nM2\n",
            "USE_TOOL_LENGTH_OFFSET(0.0000 0.0000 5.0000",
            "--tip",
        ),
        (
            "G21G95S100M3\nG0X1Y1Z1\nG1X2F0.1\nM2\n",
            "SET_FEED_MODE(0, 1)",
            "G94",
        ),
        (
            "G21G94F100\nG5.1 X10 Y10 I5 J1\nM2\n",
            "NURBS_FEED(3, ...)",
            "G1, G2, G3",
        ),
    ] {
        std::fs::write(folder.path().join("posted.ngc"), text).unwrap();
        let output = run(folder.path(), "judge job.toml posted.ngc --json");
        assert_eq!(output.status.code(), Some(2), "{text}: {}", out(&output));
        let reported: Value = serde_json::from_slice(&output.stdout).unwrap();
        let [message, help] = ["message", "help"].map(|key| reported["error"][key].as_str().unwrap());
        assert!(
            message.contains(call) && help.contains(remedy),
            "LinuxCNC's rs274 is needed, as scripts/setup.sh brings it: {reported}"
        );
    }
}

/// The core's run ends with a fault: its column is that of a part of the job, and says so.
#[test]
fn judge_tells_of_a_fault_of_the_core() {
    let folder = folder_with("torus", &[]);
    std::fs::write(
        folder.path().join("own.csv"),
        "t_s,x_mm,y_mm,z_mm\n0,40,0,-3\n0.001,40,0.01,-3\n0.002,40,0.02,-3\n",
    )
    .unwrap();
    let job = std::fs::read_to_string(folder.path().join("job.toml")).unwrap();
    std::fs::write(
        folder.path().join("job.toml"),
        job.replacen("radius_mm = 5", "radius_mm = 9", 1),
    )
    .unwrap();
    let output = run(folder.path(), "judge job.toml own.csv --json");
    let reported: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(reported["core_fault"]["name"], "ball-does-not-fit", "{reported}");
    let text = out(&run(folder.path(), "judge job.toml own.csv"));
    assert!(
        text.contains("this core stopped before the end of the job: "),
        "{text}"
    );
}
