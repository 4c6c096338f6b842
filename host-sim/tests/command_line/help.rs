//! What `--help` shows works, and the shell completes what it names.

use std::path::Path;
use std::process::Command;

use super::{err, out, run};

/// The examples in `--help` of the commands that need no QEMU and run in less than a minute.
#[test]
fn examples_of_the_help_work() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("jobs")).unwrap();
    let jobs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs");
    for entry in std::fs::read_dir(jobs).unwrap().map(Result::unwrap) {
        if entry.path().is_file() {
            std::fs::copy(entry.path(), folder.path().join("jobs").join(entry.file_name())).unwrap();
        }
    }
    for command in ["simulate", "export", "new", "explain", "completions"] {
        let help = out(&run(folder.path(), &format!("{command} --help")));
        let examples: Vec<_> = help
            .lines()
            .filter_map(|line| line.trim().strip_prefix("Example: cargo sim "))
            .collect();
        assert!(!examples.is_empty(), "{command}");
        for example in examples {
            let arguments = example.split(" > ").next().unwrap();
            let output = run(folder.path(), arguments);
            assert_eq!(output.status.code(), Some(0), "{example}: {}", err(&output));
            assert!(!output.stdout.is_empty(), "{example}");
        }
    }
}

/// In a real bash: the script wraps an existing completion of cargo.
#[test]
fn bash_completes_cargo_sim() {
    let folder = tempfile::tempdir().unwrap();
    let script = run(folder.path(), "completions bash");
    std::fs::write(folder.path().join("isofeed.bash"), script.stdout).unwrap();
    std::fs::write(folder.path().join("part.toml"), "").unwrap();
    let ask = r#"
        _before() { COMPREPLY=("before:$1:$2:$3"); }
        complete -F _before cargo
        source isofeed.bash
        source isofeed.bash
        hook=$(complete -p cargo | sed -n 's/.* -F \([^ ]*\).*/\1/p')
        ask() {
            COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
            "$hook" "$1" "${!#}" "${COMP_WORDS[COMP_CWORD - 1]}" 2>/dev/null
            echo "${COMPREPLY[*]}"
        }
        ask cargo sim ver
        ask cargo +stable sim bud
        ask cargo sim simulate job.toml --app
        ask cargo sim simulate job.toml --approach c
        ask cargo sim simulate job.toml --trace par
        ask cargo sim explain ball
        ask cargo sim new --kind n
        ask cargo sim simulate --tr
        ask cargo sim fla
        ask cargo sim log --board s
        ask cargo si
        ask cargo build --rel
    "#;
    let output = Command::new("bash")
        .args(["--norc", "-c", ask])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let reported = out(&output);
    let wanted = [
        "verify",
        "budget",
        "--approach",
        "constant-cl curve",
        "part.toml",
        "ball-does-not-fit",
        "nurbs",
        "--trace",
        "flash",
        "stm32f405 skr-pro",
        "before:cargo:si:cargo",
        "before:cargo:--rel:build",
    ];
    assert_eq!(reported.lines().collect::<Vec<_>>(), wanted, "{}", err(&output));
}
