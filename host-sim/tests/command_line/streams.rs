//! Standard output and standard error: pipes that close, a full disk, terminals and control characters.

use std::path::Path;
use std::process::Stdio;

use super::{err, folder_with, out, program, run, sample};

/// `| head`: the reader closes the pipe. No panic, and the exit code is that of the command.
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let good = folder_with("torus", &[]);
    let bad = folder_with("torus", &[("radius_mm = 5", "radius_mm = 9")]);
    for (folder, arguments, code) in [
        (&good, "simulate job.toml", 0),
        (&good, "simulate job.toml --json", 0),
        (&good, "explain", 0),
        (&good, "completions bash", 0),
        (&bad, "simulate job.toml", 1),
    ] {
        let mut child = program(folder.path(), arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments}: {}", err(&output));
        assert!(
            !err(&output).contains("panicked"),
            "{arguments}: {}",
            err(&output)
        );
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let folder = folder_with("torus", &[]);
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = program(folder.path(), "explain").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        err(&output).contains("cannot write to standard output"),
        "{}",
        err(&output)
    );
}

/// No progress bar, and nothing else on stderr, if that is not a terminal.
#[test]
fn no_bars_without_a_terminal() {
    let folder = folder_with("torus", &[("along = \"u\"", "along = \"auto\"")]);
    for arguments in [
        "simulate job.toml",
        "simulate job.toml --json",
        "export job.toml --format grbl -o x.nc",
    ] {
        let output = run(folder.path(), arguments);
        assert_eq!(err(&output), "", "{arguments}");
    }
}

/// Nothing in a file that a command reads becomes an order to the terminal.
#[test]
fn no_control_character_is_printed() {
    let folder = folder_with("plate", &[("[tool]", "[tool]\n\"\u{9b}2J\" = 1\n")]);
    std::fs::write(folder.path().join("esc.toml"), "[sur\u{1b}[2Jface]\n\u{7}x = 1\n").unwrap();
    std::fs::write(folder.path().join("script"), "tick 1: \u{1b}]0;title\u{7}\n").unwrap();
    std::fs::write(folder.path().join("good.toml"), sample("plate_machine")).unwrap();
    let cad = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/hostile_cad/sound.step"),
    )
    .unwrap();
    std::fs::write(
        folder.path().join("bad.step"),
        cad.replace("(30.,20.,5.)", "(30.,\u{1b}[2J.,5.)"),
    )
    .unwrap();
    let named = "a\u{1b}[31mb.toml";
    std::fs::write(folder.path().join(named), "x").unwrap();
    for arguments in [
        "simulate job.toml".to_owned(),
        "simulate esc.toml".to_owned(),
        "simulate good.toml --script script".to_owned(),
        "import bad.step --list".to_owned(),
        format!("simulate {named}"),
        format!("simulate job.toml --trace none/{named}"),
    ] {
        let output = run(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {}", err(&output));
        let printed = out(&output) + &err(&output);
        assert!(
            !printed.chars().any(|c| c.is_control() && c != '\n'),
            "{arguments}: {printed:?}"
        );
    }
}
