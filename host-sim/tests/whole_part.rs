//! A whole part, end to end: from the CAD file to jobs that are verified, each against the whole part.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail by panic")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// A file of `jobs/cad`.
fn cad(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../jobs/cad")
        .join(name)
}

fn run(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(arguments.split_whitespace())
        .current_dir(folder)
        .output()
        .unwrap()
}

/// The object that a command prints, and its exit code.
fn json(folder: &Path, arguments: &str) -> (Value, Option<i32>) {
    let output = run(folder, arguments);
    let value = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!(
            "{arguments}: {error}: {}",
            String::from_utf8_lossy(&output.stderr)
        )
    });
    (value, output.status.code())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The job of all faces that `import --part` writes is verified against the whole part, face by face, on its passes and between them; a face without a job has a reason. One
/// face alone is `FILE#FACE`.
#[test]
fn every_face_of_a_part_is_verified() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::copy(cad("blade.step"), folder.join("blade.step")).unwrap();
    let options = "--tool 3 --scallop-mm 0.2 --feed-mm-min 3000";
    let (summary, code) = json(
        folder,
        &format!("import blade.step --part {options} -o blade.toml --json"),
    );
    assert_eq!(code, Some(0), "{summary}");
    assert_eq!(summary["jobs"].as_array().unwrap().len(), 4, "{summary}");
    for face in summary["faces"].as_array().unwrap() {
        let reached = face["region"]["reachable_mm2"].as_f64().unwrap_or(0.0) > 0.0;
        assert!(face["job"].is_string() || !reached, "{face}");
        assert!(!face["region"].is_null() || face["error"].is_string(), "{face}");
    }
    for written in ["blade.toml", "blade.html", "blade.json"] {
        assert!(folder.join(written).is_file(), "{written}");
    }
    let (found, code) = json(folder, "verify blade.toml --json");
    assert_eq!((code, &found["passed"]), (Some(0), &Value::Bool(true)), "{found}");
    let jobs = found["jobs"].as_array().unwrap();
    assert_eq!(jobs.len(), 4);
    for job in jobs {
        let part = &job["part"];
        assert_eq!(part["checked"], true, "{part}");
        assert!(
            number(&part["centres"]) > 0.0 && number(&part["centres_between"]) > 0.0,
            "{part}"
        );
        for deepest in ["deepest", "deepest_between"] {
            let depth = part[deepest]["depth_mm"].as_f64().unwrap_or(0.0);
            assert!(depth <= number(&part["tolerance_mm"]), "{}: {part}", job["job"]);
        }
        assert!(
            number(&part["left"]["within_share"]) > 0.99,
            "{}: {part}",
            job["job"]
        );
    }
    // One of them, and what no command of one surface takes.
    let output = run(folder, "simulate blade.toml#13 --json");
    assert_eq!(output.status.code(), Some(0));
    for (arguments, words) in [
        ("simulate blade.toml", "4 faces"),
        ("simulate blade.toml#5", "no face 5"),
        ("run blade.toml --qemu --trace t.csv", "name the face"),
    ] {
        let output = run(folder, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}");
        let said = String::from_utf8_lossy(&output.stderr).replace('\n', " ");
        assert!(said.contains(words), "{arguments}: {said}");
    }
}

/// Two faces whose common edge cannot be read: the tool may cut them, so a job of their part does not pass unless that is accepted.
#[test]
fn unknown_faces_are_no_pass() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = std::fs::read_to_string(cad("blade.step")).unwrap();
    let lost = text.replace("#618 = CIRCLE(", "#618 = CLOTHOID(");
    assert_ne!(lost, text);
    std::fs::write(folder.join("part.step"), lost).unwrap();
    let import =
        "import part.step --part --tool 3 --scallop-mm 1 --feed-mm-min 3000 --faces 13 -o part.toml --json";
    let (summary, code) = json(folder, import);
    assert_eq!(code, Some(0), "{summary}");
    let name = "part.toml#13";
    let (found, code) = json(folder, &format!("verify {name} --json"));
    let failures = found["failures"].to_string();
    assert!(
        code == Some(1)
            && failures.contains("2 faces of the part are not known")
            && failures.contains("--accept-unknown-faces"),
        "{found}"
    );
    let (found, code) = json(folder, &format!("verify {name} --accept-unknown-faces --json"));
    assert_eq!((code, &found["passed"]), (Some(0), &Value::Bool(true)), "{found}");
    assert!(
        found["warnings"]
            .to_string()
            .contains("2 faces of the part are not known"),
        "{found}"
    );
}

/// A folder has the jobs of one import: those of an earlier one in another order go with `--force`, and nothing else does.
#[test]
fn jobs_of_an_earlier_import_do_not_stay() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sheet = cad("../../tests/hostile_cad/sound.step");
    std::fs::copy(sheet, folder.join("sheet.step")).unwrap();
    let import = "import sheet.step --part --tool 3 --scallop-mm 1 -o out --json";
    let [stale, mine] = ["out/007-face-2.toml", "out/my-face-2.toml"];
    std::fs::create_dir(folder.join("out")).unwrap();
    for name in [stale, mine] {
        std::fs::write(folder.join(name), "of an earlier import").unwrap();
    }
    let output = run(folder, import);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("exists already") && said.contains("--force"),
        "{said}"
    );
    assert!(folder.join(stale).is_file());
    let (summary, code) = json(folder, &format!("{import} --force"));
    assert_eq!(code, Some(0), "{summary}");
    assert!(folder.join("out/001-face-1.toml").is_file());
    assert!(!folder.join(stale).exists() && folder.join(mine).is_file());
}

/// A motion that cuts the face as it should, and then goes down through the part: `judge` looks at the whole part, too, beside the job's face.
#[test]
fn a_motion_through_the_part_is_no_pass() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::copy(cad("blade.step"), folder.join("blade.step")).unwrap();
    let import =
        "import blade.step --part --tool 3 --scallop-mm 1 --feed-mm-min 3000 --faces 13 -o part.toml --json";
    let (summary, code) = json(folder, import);
    assert_eq!(code, Some(0), "{summary}");
    assert_eq!(
        run(folder, "simulate part.toml#13 --trace own.csv").status.code(),
        Some(0)
    );
    let (found, code) = json(folder, "judge part.toml#13 own.csv --alone --json");
    assert_eq!(
        (code, &found["part"]["checked"]),
        (Some(0), &Value::Bool(true)),
        "{found}"
    );
    let trace = std::fs::read_to_string(folder.join("own.csv")).unwrap();
    let fields = |line: &str| -> Vec<f64> {
        line.split(',')
            .map(|field| field.parse().unwrap_or(0.0))
            .collect()
    };
    let mut table = "t_s,x_mm,y_mm,z_mm\n".to_owned();
    for at in trace.lines().skip(1).map(fields) {
        table += &format!(
            "{},{},{},{}\n",
            at[1],
            at[10] * 1e-6,
            at[11] * 1e-6,
            at[12] * 1e-6
        );
    }
    // From the end of the run, above the part, to below the last place on a pass.
    let end_s = fields(trace.lines().last().unwrap())[1];
    let at = fields(trace.lines().rfind(|line| line.contains(",running,")).unwrap());
    for step in [1.0, 2.0] {
        table += &format!(
            "{},{},{},{}\n",
            end_s + step * 1e-3,
            at[10] * 1e-6,
            at[11] * 1e-6,
            at[12] * 1e-6 - step
        );
    }
    std::fs::write(folder.join("through.csv"), table).unwrap();
    let (found, code) = json(folder, "judge part.toml#13 through.csv --alone --json");
    // So fast a way down exceeds the limits, too.
    let failures = found["failures"].to_string();
    assert!(
        code == Some(1) && failures.contains("enters face") && failures.contains("between passes"),
        "{found}"
    );
    assert!(
        number(&found["part"]["deepest_between"]["depth_mm"]) > 0.5,
        "{found}"
    );
}

/// A face that looks down is turned up; the file's +z reaches nothing of it.
#[test]
fn the_best_side_is_turned_up() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(cad("blade.step"), folder.path().join("blade.step")).unwrap();
    let import = |up: &str, name: &str| {
        let command = format!(
            "import blade.step --part --tool 3 --scallop-mm 0.2 --faces 2 --up {up} -o {name} --json"
        );
        let (summary, code) = json(folder.path(), &command);
        assert_eq!(code, Some(0), "{summary}");
        summary
    };
    let best = import("auto", "best");
    assert_eq!(best["up"], "-z", "{best}");
    assert!(
        number(&best["region_mm2"]) > 0.9 * number(&best["area_mm2"]),
        "{best}"
    );
    assert_eq!(import("+z", "other")["reachable_mm2"], 0.0);
}

/// A part of which nothing can be imported has no job, and says why.
#[test]
fn a_part_without_a_job_tells_why() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(cad("hood.step"), folder.path().join("hood.step")).unwrap();
    let (summary, code) = json(folder.path(), "import hood.step --part --tool 3 -o hood --json");
    assert_eq!(code, Some(0), "{summary}");
    for face in summary["faces"].as_array().unwrap() {
        assert!(face["job"].is_null() && face["error"].is_string(), "{face}");
    }
    for (options, words) in [
        (
            "--tool 3",
            "no face of hood.step has a job: face 1 (#39, B-spline): its degree is 5",
        ),
        ("--tool nan", "--tool must be above 0 and at most 1000, not NaN"),
        (
            "--tool 1 --scallop-mm 1",
            "--scallop-mm must be below the ball's radius of 1 mm",
        ),
        ("--tool 1 --scallop-mm inf", "--scallop-mm must be above 0"),
        (
            "--tool 1 --feed-mm-min 60001",
            "--feed-mm-min must be above 0.06 and at most 60000",
        ),
        ("--tool 1 --tolerance 0", "--tolerance must be above 0"),
        ("--tool 1 --faces 1,99", "there is no face 99"),
    ] {
        let output = run(
            folder.path(),
            &format!("import hood.step --part -o hood.toml {options}"),
        );
        let said = String::from_utf8_lossy(&output.stderr).replace("\n  │", "");
        assert_eq!(output.status.code(), Some(2), "{options}: {said}");
        assert!(said.contains(words), "{options}: {said}");
    }
}

/// What stands alone bounds no solid, and the file does not tell which side is machined: that which looks up, either way round.
#[test]
fn a_surface_alone_is_machined_from_either_side() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(cad("swept.igs"), folder.path().join("swept.igs")).unwrap();
    for up in ["+z", "-z"] {
        let command = format!(
            "import swept.igs --part --tool 2 --scallop-mm 0.2 --faces 1 --up {up} -o side{up} --json"
        );
        let (summary, code) = json(folder.path(), &command);
        assert_eq!(code, Some(0), "{summary}");
        assert!(number(&summary["reachable_mm2"]) > 0.0, "{up}: {summary}");
    }
}
