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

/// Every job that `import --part` writes is verified against the whole part, on its passes and between them; a face without a job has a reason.
#[test]
fn every_job_of_a_part_is_verified() {
    for (file, options, jobs) in [
        ("blade.step", "--tool 3 --scallop-mm 0.2 --feed-mm-min 3000", 4),
        ("hood.step", "--tool 3", 0),
    ] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::copy(cad(file), folder.path().join(file)).unwrap();
        let (summary, code) = json(
            folder.path(),
            &format!("import {file} --part {options} -o part --json"),
        );
        assert_eq!(code, Some(0), "{summary}");
        let written = summary["jobs"].as_array().unwrap();
        assert_eq!(written.len(), jobs, "{summary}");
        for face in summary["faces"].as_array().unwrap() {
            let reached = face["region"]["reachable_mm2"].as_f64().unwrap_or(0.0) > 0.0;
            let known = !face["region"].is_null();
            assert!(face["job"].is_string() || !reached, "{face}");
            assert!(known || face["error"].is_string(), "{face}");
        }
        for job in written {
            let (found, code) = json(folder.path(), &format!("verify {} --json", job.as_str().unwrap()));
            assert_eq!(code, Some(0), "{job}: {}", found["failures"]);
            let part = &found["part"];
            assert_eq!(part["checked"], true, "{part}");
            assert!(
                number(&part["centres"]) > 0.0 && number(&part["centres_between"]) > 0.0,
                "{part}"
            );
            for deepest in ["deepest", "deepest_between"] {
                let depth = part[deepest]["depth_mm"].as_f64().unwrap_or(0.0);
                assert!(depth <= number(&part["tolerance_mm"]), "{job}: {part}");
            }
            assert!(number(&part["left"]["within_share"]) > 0.99, "{job}: {part}");
        }
    }
}
