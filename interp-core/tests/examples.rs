//! The examples, run as a reader would run them; the one for C through the C compiler, where there is one.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail by panic")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The workspace: there Cargo chooses the same features as for `cargo test`, and builds no dependency a second time.
fn workspace() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Runs a program to its end; its output.
fn run(command: &mut Command) -> String {
    let output = command
        .output()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(
        output.status.success(),
        "{command:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// The folder of the build that this test belongs to: `target/debug`, or as it is called.
fn build_folder() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.ancestors().nth(2).unwrap().to_owned()
}

fn example(name: &str) -> String {
    run(Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--example", name, "--target-dir"])
        .arg(build_folder().parent().unwrap())
        .current_dir(workspace()))
}

/// Passes and samples of the dome, as every example that runs it says them.
fn dome() -> String {
    example("job")
}

#[test]
fn a_job_runs_to_its_end() {
    let said = dome();
    assert!(said.ends_with(" samples, finished\n"), "{said}");
    let passes: u32 = said.split(' ').next().unwrap().parse().unwrap();
    // 60 mm at a step-over of 2 sqrt(2 r h) = 0.63 mm and less.
    assert!((95..140).contains(&passes), "{said}");
}

#[test]
fn limits_and_an_override() {
    let said = example("limits");
    assert!(said.starts_with("finished after "), "{said}");
    assert!(said.contains("held for 500 periods"), "{said}");
    let fastest = said.rsplit(' ').nth(1).unwrap().parse::<f64>().unwrap();
    // A tenth more than 20 mm/s.
    assert!((fastest - 22.0).abs() < 0.05, "{said}");
}

#[test]
fn the_core_is_called_from_c() {
    if Command::new("cc").arg("--version").output().is_err() {
        println!("no C compiler here: the C example is not run");
        return;
    }
    run(Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--example", "c_api", "--target-dir"])
        .arg(build_folder().parent().unwrap())
        .current_dir(workspace()));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c_api");
    run(Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&program)
        .arg(source.join("c_api.c"))
        .arg(build_folder().join("examples/libc_api.a"))
        .args(["-lpthread", "-ldl", "-lm"]));
    assert_eq!(run(&mut Command::new(&program)), dome());
}

/// The READMEs show code that compiles: each block of Rust in them is a part of an example, line by line.
#[test]
fn the_readmes_show_examples() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    let trimmed = |text: &str| -> String { text.lines().map(|line| line.trim().to_owned() + "\n").collect() };
    let examples = [
        "examples/job.rs",
        "examples/limits.rs",
        "../firmware/examples/minimal.rs",
    ]
    .map(|path| trimmed(&read(&root.join(path))));
    for (readme, count) in [("../README.md", 1), ("README.md", 2)] {
        let readme = read(&root.join(readme));
        let blocks: Vec<&str> = readme
            .split("```rust\n")
            .skip(1)
            .map(|block| block.split("```").next().unwrap())
            .collect();
        assert_eq!(blocks.len(), count);
        for block in blocks {
            let block = trimmed(block);
            assert!(examples.iter().any(|example| example.contains(&block)), "{block}");
        }
    }
}
