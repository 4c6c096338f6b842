//! The command line: exit codes, streams, files, JSON. One module a subject; here is how a test runs the tool.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

mod errors;
mod files;
mod help;
mod import;
mod json_output;
mod judge;
mod streams;
mod verify;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// The program in a folder, with its arguments as typed (without quotes).
fn program(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .stdin(Stdio::null());
    command
}

fn run(folder: &Path, arguments: &str) -> Output {
    program(folder, arguments).output().unwrap()
}

fn out(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn err(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn sample(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    std::fs::read_to_string(path).unwrap()
}

/// A folder with a job file: a sample with these replacements.
fn folder_with(name: &str, edits: &[(&str, &str)]) -> TempDir {
    let mut text = sample(name);
    for (from, to) in edits {
        assert!(text.contains(from), "nothing to replace: {from}");
        text = text.replacen(from, to, 1);
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("job.toml"), text).unwrap();
    folder
}

fn json(folder: &Path, arguments: &str) -> Value {
    let output = run(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments}: {}", err(&output));
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{arguments}: {error}"))
}
