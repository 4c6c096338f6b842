//! The command line: exit codes, streams, files, JSON.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

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

/// Every kind of invalid input ends with code 2, an error and a remedy.
#[test]
fn nonsense_gets_a_remedy() {
    let folder = folder_with("torus", &[("scallop_mm", "scalop_mm")]);
    std::fs::write(folder.path().join("empty.toml"), "").unwrap();
    std::fs::write(folder.path().join("part.step"), "ISO-10303-21;\n").unwrap();
    for (arguments, says) in [
        ("simulate", &["<JOB>", "--help"][..]),
        ("simulat job.toml", &["simulate"]),
        ("simulate job.toml --trase x", &["--trace"]),
        (
            "simulate nope.toml",
            &["nope.toml: there is no such file", "help:"],
        ),
        ("simulate .", &["is a folder", "help:"]),
        ("simulate empty.toml", &["the file is empty", "cargo sim new"]),
        ("simulate part.step", &["is a STEP file", "cargo sim import"]),
        (
            "simulate job.toml",
            &["did you mean `scallop_mm`?", "job.toml:43:1", "help:"],
        ),
        (
            "export job.toml --format linuxcnc --clearance -3 -o x",
            &["--clearance -3 is not above 0", "help:"],
        ),
        ("export job.toml --format heidenhain -o x", &["linuxcnc, grbl"]),
        ("budget --ticks 0", &["0 is not in 1.."]),
        ("explain ball-dos-not-fit", &["ball-does-not-fit"]),
        ("new -o .", &["that is a folder: give a file in it"]),
        ("new -o no/job.toml", &["create the folder first"]),
        ("completions tcsh", &["bash, zsh, fish"]),
        ("run job.toml", &["--qemu|--chip <BOARD>|--port"]),
        ("flash --board arduino", &["stm32f405, skr-pro"]),
        (
            "flash --image nope.elf",
            &["there is no image nope.elf", "cargo fw-chip"],
        ),
        (
            "flash --board skr-pro --image job.toml",
            &["job.toml: it is no ELF file", "cargo fw-skr-pro"],
        ),
        (
            "flash --board stm32f405 --sd .",
            &["no boot loader that reads a card", "--dfu"],
        ),
        ("flash --board skr-pro --dfu", &["by USB", "--sd DIR"]),
        (
            "flash --board skr-pro --sd nowhere",
            &["no folder nowhere", "FAT32"],
        ),
        ("flash --sd . --dfu", &["cannot be used with"]),
        (
            "log --image part.step",
            &["part.step: it is no ELF file", "help:"],
        ),
        ("log --from nope.bin", &["--image"]),
    ] {
        let output = run(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {}", err(&output));
        assert!(output.stdout.is_empty(), "{arguments}");
        for part in says {
            assert!(
                err(&output).contains(part),
                "{arguments}: {part} is not in {}",
                err(&output)
            );
        }
    }
    let help = out(&run(folder.path(), "export --help"));
    assert!(
        help.contains("- curve:") && !help.contains("- surface:"),
        "{help}"
    );
}

#[test]
fn new_jobs_run_and_are_never_lost() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["bicubic", "ruled", "revolved", "nurbs"] {
        let output = run(folder.path(), &format!("new -o {kind}.toml --kind {kind}"));
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let told = json(folder.path(), &format!("simulate {kind}.toml --json"));
        assert!(
            told["fault"].is_null() && told["samples"].as_u64().unwrap() > 10_000,
            "{told}"
        );
        let auto = &told["along_auto"];
        let time = |along: &str| auto[along]["machining_time_s"].as_f64().unwrap();
        let least = time("u").min(time("v"));
        assert_eq!(told["machining_time_s"].as_f64(), Some(least), "{kind}: {auto}");
    }
    let mine = folder.path().join("job.toml");
    std::fs::write(&mine, "# mine").unwrap();
    let output = run(folder.path(), "new");
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("--force"), "{}", err(&output));
    assert_eq!(std::fs::read_to_string(&mine).unwrap(), "# mine");
    assert_eq!(run(folder.path(), "new --force").status.code(), Some(0));
    assert!(
        std::fs::read_to_string(&mine)
            .unwrap()
            .contains("coefficients_mm")
    );
}

/// The examples of `explain` for faults that a sample job can cause: the fault occurs, and refers to its explanation.
#[test]
fn faults_come_as_explained() {
    for (job, edits, code, name) in [
        (
            "torus",
            &[("radius_mm = 5", "radius_mm = 9")][..],
            1,
            "ball-does-not-fit",
        ),
        (
            "sphere_cap",
            &[
                ("along = \"u\"", "along = \"v\""),
                ("feed_mm_min = 600 ", "feed_mm_min = 500000 "),
            ],
            3,
            "parameter-backwards",
        ),
        (
            "freeform",
            &[
                ("feed_mm_min = 1800", "feed_mm_min = 600000"),
                ("[tool]", "[machine]\nperiod_us = 2000\n\n[tool]"),
            ],
            6,
            "patch-too-short",
        ),
    ] {
        let folder = folder_with(job, edits);
        // The line of the error: the ball radius, or the feed.
        let text = std::fs::read_to_string(folder.path().join("job.toml")).unwrap();
        let line = |key: &str| text.lines().position(|line| line.starts_with(key)).unwrap() + 1;
        let lines = [line("radius_mm"), line("feed_mm_min")];
        let output = run(folder.path(), "simulate job.toml --json");
        assert_eq!(output.status.code(), Some(1), "{job}: {}", err(&output));
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(
            (&told["fault"]["code"], &told["fault"]["name"]),
            (&code.into(), &name.into()),
            "{told}"
        );
        let hint = format!("cargo sim explain {code}");
        assert!(err(&output).contains(&hint), "{}", err(&output));
        assert!(
            err(&output).contains(&format!("job.toml:{}: ", lines[usize::from(code != 1)])),
            "{}",
            err(&output)
        );
        let explained = json(folder.path(), &format!("explain {code} --json"));
        assert_eq!(explained["name"], name);
        if code == 1 {
            assert_eq!(told["fault"]["tick"], 0);
            assert!(
                (told["fault"]["value"].as_f64().unwrap() - 1.125).abs() < 1e-4,
                "{told}"
            );
        }
    }
}

/// The examples of `explain` for the job of `cargo sim new`.
#[test]
fn faults_of_a_new_job_come_as_explained() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "new");
    let job = folder.path().join("job.toml");
    let plain = std::fs::read_to_string(&job).unwrap();
    let level = "[placement]\nplace = \"top\"\ntranslate_mm = [0, 0, 2145]\n[tool]";
    for (edits, code) in [
        (&[("\n[tool]", level)][..], 4),
        (
            &[
                ("radius_mm = 5 ", "radius_mm = 0.000001 "),
                ("scallop_mm = 0.01 ", "scallop_mm = 1e-12 "),
            ],
            7,
        ),
    ] {
        let mut text = plain.replace("along = \"auto\"", "along = \"u\"");
        for (from, to) in edits {
            assert!(text.contains(from), "nothing to replace: {from}");
            text = text.replacen(from, to, 1);
        }
        std::fs::write(&job, text).unwrap();
        let output = run(folder.path(), "simulate job.toml --json");
        assert_eq!(output.status.code(), Some(1), "{}", err(&output));
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(told["fault"]["code"], code, "{told}");
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
    let told = out(&output);
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
    assert_eq!(told.lines().collect::<Vec<_>>(), wanted, "{}", err(&output));
}

#[test]
fn a_placed_job_runs_and_its_errors_point_at_the_line() {
    let placed = "[placement]\nscale = 0.5\nrotate_deg = [0, 0, 90]\nplace = \"top\"\ntranslate_mm = [100, 50, -3]\n\n[tool]";
    let folder = folder_with("plate", &[("[tool]", placed)]);
    let told = json(folder.path(), "verify job.toml --json");
    assert_eq!(told["passed"], true, "{told}");
    let far = placed.replace("100,", "2200,");
    let folder = folder_with("plate", &[("[tool]", &far)]);
    let output = run(folder.path(), "simulate job.toml");
    assert_eq!(output.status.code(), Some(2));
    for part in [
        "the placed surface extends",
        "translate_mm = [2200",
        "help: move it nearer",
    ] {
        assert!(err(&output).contains(part), "{}", err(&output));
    }
}

/// JSON keys and types of the contract: `n` number, `n?` number or null (no interval before the first sample), `s` text, `o?` object or null, `o` object, `b` true or false.
fn has(told: &Value, names: &str, of: &str) {
    for name in names.split_whitespace() {
        let (key, kind) = name.split_once(':').unwrap();
        let value = told
            .get(key)
            .unwrap_or_else(|| panic!("{of}: no {key} in {told}"));
        let fits = match kind {
            "n" => value.is_number(),
            "n?" => value.is_number() || value.is_null(),
            "s" => value.is_string(),
            "o" => value.is_object(),
            "o?" => value.is_object() || value.is_null(),
            "b" => value.is_boolean(),
            other => panic!("no kind {other}"),
        };
        assert!(fits, "{of}: {key} is {value}");
    }
}

#[test]
fn json_has_the_names_that_scripts_rely_on() {
    const SIMULATE: &str = "approach:s along:s along_auto:o? passes:n samples:n ticks:n segments:n program_bytes:n cc_length_mm:n \
        cl_length_mm:n machining_time_s:n interval_min:n? ripple_max_pct:n ripple_rms_pct:n digest:s samples_per_second:n fault:o?";
    const FAULT: &str = "code:n name:s message:s tick:n pass:n u:n v:n";
    const VERIFY: &str = "position_error_max_nm:n normal_error_max_rad:n ripple_max_pct:n scallop_max_mm:n? scallop_mean_mm:n? \
        gouge_max_mm:n? limits:o? passed:b";
    const EXPORT: &str = "approach:s along:s along_auto:o? feed_mode:s passes:n segments:n blocks:n program_bytes:n cutting_time_s:n safe_z_mm:n";
    const EXPLAIN: &str = "family:s code:n label:s name:s meaning:s value:s why:s remedy:s example:s";
    let folder = folder_with("torus", &[("along = \"u\"", "along = \"auto\"")]);
    for approach in ["constant-cl", "linear", "curve", "surface"] {
        let told = json(
            folder.path(),
            &format!("simulate job.toml --approach {approach} --json"),
        );
        has(&told, SIMULATE, approach);
        assert_eq!(told["approach"], approach);
        has(
            &told["along_auto"]["u"],
            "ticks:n machining_time_s:n",
            "along_auto",
        );
    }
    has(&json(folder.path(), "verify job.toml --json"), VERIFY, "verify");
    let told = json(folder.path(), "export job.toml --format grbl -o x.nc --json");
    has(&told, EXPORT, "export");
    has(&json(folder.path(), "explain R1 --json"), EXPLAIN, "explain");
    assert_eq!(
        json(folder.path(), "explain --json").as_array().unwrap().len(),
        explain::entries().len()
    );
    has(&json(folder.path(), "new -o n.toml --json"), "job:s", "new");
    let bad = folder_with("torus", &[("radius_mm = 5", "radius_mm = 9")]);
    let output = run(bad.path(), "simulate job.toml --json");
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    has(&told, SIMULATE, "a fault");
    has(&told["fault"], FAULT, "fault");
}

/// Checks a value against the part of JSON Schema that `docs/verify.schema.json` uses. Returns what does not fit.
fn misfits(value: &Value, schema: &Value, at: &str, all: &mut Vec<String>) {
    let name = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let permitted = match &schema["type"] {
        Value::String(one) => one == name,
        Value::Array(several) => several.iter().any(|one| one == name),
        _ => schema["enum"].as_array().unwrap().contains(value),
    };
    if !permitted {
        all.push(format!("{at}: {value}"));
    }
    let (Value::Object(keys), Some(known)) = (value, schema["properties"].as_object()) else {
        return;
    };
    for (key, value) in keys {
        match known.get(key) {
            Some(schema) => misfits(value, schema, &format!("{at}.{key}"), all),
            None => all.push(format!("{at}.{key} is not in the schema")),
        }
    }
    for required in schema["required"].as_array().into_iter().flatten() {
        if !keys.contains_key(required.as_str().unwrap()) {
            all.push(format!("{at} lacks {required}"));
        }
    }
}

fn misfits_of(value: &Value, definition: &str) -> Vec<String> {
    let schema: Value = serde_json::from_str(include_str!("../../docs/verify.schema.json")).unwrap();
    let mut all = Vec::new();
    misfits(value, &schema["$defs"][definition], definition, &mut all);
    all
}

/// Whatever happens, `verify --json` prints one object of the schema, with the exit code of old.
#[test]
fn verify_prints_an_object_of_the_schema_for_every_outcome() {
    let folder = folder_with("torus", &[]);
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let torus = std::fs::read_to_string(folder.path().join("job.toml")).unwrap();
    write(
        "limits.toml",
        &format!(
            "{}\n[machine]\njerk_max_mm_s3 = [2000, 2000, 2000]\n",
            torus.replace("scallop_mm = 0.005", "scallop_mm = 0.2")
        ),
    );
    write("fault.toml", &torus.replace("radius_mm = 5", "radius_mm = 9"));
    let curved = "spacing = \"constant\"\nstart = \"auto\"\npattern =";
    write(
        "curved.toml",
        &torus
            .replace("pattern =", curved)
            .replace("scallop_mm = 0.005", "scallop_mm = 0.1"),
    );
    write(
        "line.toml",
        &torus.replace("feed_mm_min = 600", "feed_mm_min = -1"),
    );
    for (arguments, code, definition) in [
        ("verify job.toml --json", 0, "verification"),
        ("verify limits.toml --json", 0, "verification"),
        ("verify fault.toml --json", 1, "verification"),
        ("verify curved.toml --json", 0, "verification"),
        ("verify line.toml --json", 2, "error"),
        ("verify nothing.toml --json", 2, "error"),
        ("verify --json", 2, "error"),
        ("verify job.toml --json --scallop-tolerance x", 2, "error"),
        ("verify job.toml limits.toml --json", 0, "several"),
        ("verify job.toml fault.toml --json", 1, "several"),
        ("verify fault.toml line.toml job.toml --json", 2, "several"),
    ] {
        let output = run(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {}", err(&output));
        let told: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{arguments}: {error}"));
        assert_eq!(misfits_of(&told, definition), Vec::<String>::new(), "{arguments}");
        for job in told["jobs"].as_array().into_iter().flatten() {
            let definition = if job.get("error").is_some() {
                "error"
            } else {
                "verification"
            };
            let mut off = misfits_of(job, definition);
            // In a list an error names its job too.
            off.retain(|line| {
                definition == "verification" || !(line.contains(".job") || line.contains(".passed"))
            });
            assert_eq!(off, Vec::<String>::new(), "{arguments}");
        }
        assert_eq!(
            told["passed"].as_bool().unwrap_or(false),
            code == 0,
            "{arguments}"
        );
    }
    let told: Value = serde_json::from_slice(&run(folder.path(), "verify line.toml --json").stdout).unwrap();
    let line = torus
        .lines()
        .position(|line| line.starts_with("feed_mm_min"))
        .unwrap()
        + 1;
    assert_eq!(told["error"]["line"], line, "{told}");
    assert!(told["error"]["help"].as_str().unwrap().contains("600"));
}

/// The message of a scallop above its limit names two remedies, and both help.
#[test]
fn remedies_for_a_scallop_help() {
    // The paper's spacing exceeds the height on this job.
    let first_order = (
        "pattern = \"zigzag\"",
        "pattern = \"zigzag\"\nspacing = \"first-order\"",
    );
    let folder = folder_with("torus", &[first_order]);
    let output = run(folder.path(), "verify job.toml");
    let told = out(&output);
    assert_eq!(output.status.code(), Some(1), "{told}");
    let after = |what: &str| {
        let rest = told
            .split(what)
            .nth(1)
            .unwrap_or_else(|| panic!("no {what} in {told}"));
        rest.split([',', '\n']).next().unwrap().trim().to_owned()
    };
    let tolerance = after("--scallop-tolerance ");
    let accepted = run(
        folder.path(),
        &format!("verify job.toml --scallop-tolerance {tolerance}"),
    );
    assert_eq!(accepted.status.code(), Some(0), "{}", out(&accepted));
    let asked = format!("scallop_mm = {}", after("ask for scallop_mm = "));
    let lower = folder_with("torus", &[first_order, ("scallop_mm = 0.005", &asked)]);
    let found = json(lower.path(), "verify job.toml --json --scallop-tolerance 100%");
    assert!(found["scallop_max_mm"].as_f64().unwrap() <= 0.005, "{found}");
}

/// A plane that leans over the tool by 10 degrees: the contact is above the ball's equator, the shank in the plane. The reported turn helps,
/// and a holder that touches a fixture is reported with its place.
#[test]
fn verify_tells_what_the_tool_does_not_reach() {
    let folder = tempfile::tempdir().unwrap();
    let job = |rotate: &str, tool: &str, rest: &str| {
        format!(
            "[surface]\nkind = \"ruled\"\nrail0_mm = [[0, 0, 20, 0], [0, 0, 0, 0], [0, 0, 0, 0]]\nrail1_mm = [[0, 0, 20, 0], [0, 0, 0, 12], \
             [0, 0, 0, 0]]\n[placement]\nrotate_deg = {rotate}\n[tool]\nkind = \"ball\"\nradius_mm = 3\n{tool}\n[cut]\nfeed_mm_min = 1200\n\
             scallop_mm = 0.05\nalong = \"u\"\nside = \"+\"\npattern = \"zigzag\"\n{rest}"
        )
    };
    let write = |text: &str| std::fs::write(folder.path().join("job.toml"), text).unwrap();
    let verify = |code: i32| -> Value {
        let output = run(folder.path(), "verify job.toml --json");
        assert_eq!(output.status.code(), Some(code), "{}", err(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    write(&job("[100, 0, 20]", "", ""));
    let told = verify(1);
    let (contact, parts) = (&told["reach"]["contact"], &told["reach"]["parts"]);
    assert_eq!(contact["verdict"], "violated");
    let height = contact["height_max_mm"].as_f64().unwrap();
    assert!(
        (height - 3.0 * 10.0_f64.to_radians().sin()).abs() < 1e-5,
        "{height}"
    );
    assert_eq!(told["reach"]["undercut_share"], 1.0);
    assert_eq!(
        (&parts[0]["part"], &parts[0]["verdict"]),
        (&"shank".into(), &"violated".into())
    );
    let failures = told["failures"].to_string();
    assert!(
        failures.contains("above its equator") && failures.contains("rotate_deg"),
        "{failures}"
    );
    write(&job(&told["reach"]["rotate_deg"].to_string(), "", ""));
    let told = verify(0);
    assert_eq!(told["reach"]["verdict"], "met");
    assert_eq!(told["reach"]["undercut_share"], 0.0);
    assert!(told["reach"]["contact"]["height_max_mm"].as_f64().unwrap() < -2.5);
    // Flat: the holder's face is 30 mm above the tip, 20 mm wide, beside a fixture that is 31 mm high: 5 mm from the outermost axis.
    let tool = "length_mm = 30\nholder = { diameter_mm = 20, length_mm = 40 }";
    let fixture = "[[fixture]]\nname = \"jaw\"\nbox_mm = [[25, 40], [0, 12], [-5, 31]]\n[stock]\nbox_mm = [[-5, 25], [-5, 17], [-5, 2]]\n";
    write(&job("[0, 0, 0]", tool, fixture));
    let told = verify(1);
    let hit = told["reach"]["parts"]
        .as_array()
        .unwrap()
        .iter()
        .find(|part| part["verdict"] == "violated")
        .unwrap();
    assert_eq!(
        (&hit["part"], &hit["obstacle"]),
        (&"holder".into(), &"fixture jaw".into())
    );
    let depth = hit["depth_mm"].as_f64().unwrap();
    assert!((depth - 1.0).abs() < 1e-3, "{depth}");
    assert_eq!(misfits_of(&told, "verification"), Vec::<String>::new());
    let text = run(folder.path(), "verify job.toml --report out");
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(
        text.contains("FAIL reach: holder") && text.contains("deep in fixture jaw"),
        "{text}"
    );
    let page = std::fs::read_to_string(folder.path().join("out/index.html")).unwrap();
    assert!(page.contains("holder 1.000 mm in fixture jaw"));
}

/// The core's own samples, judged as anybody's: as `verify` finds them. Moved by 4 um they fail, with that path error.
#[test]
fn judge_takes_samples_and_agrees_with_verify() {
    let folder = folder_with("torus", &[("scallop_mm = 0.005", "scallop_mm = 0.02")]);
    assert!(
        run(folder.path(), "simulate job.toml --trace own.csv")
            .status
            .success()
    );
    let told = json(folder.path(), "judge job.toml own.csv --json --report page");
    let page = std::fs::read_to_string(folder.path().join("page/index.html")).unwrap();
    assert!(page.contains("Judged: given, and this core") && page.contains("own.csv on the job"));
    assert_eq!(told["given"]["reach"]["verdict"], "met");
    assert_eq!(told["given"]["reach"]["contact"]["above_equator"], 0);
    let verified = json(folder.path(), "verify job.toml --json");
    let number = |value: &Value| value.as_f64().unwrap();
    assert_eq!(told["passed"], true, "{told}");
    assert_eq!(told["given"], told["core"], "the same motion");
    let [theirs, ours] = [&told["given"], &verified].map(|of| number(&of["scallop_max_mm"]));
    assert!((theirs / ours - 1.0).abs() < 2e-3, "{theirs} and {ours}");
    assert!(number(&told["given"]["path_error_max_mm"]) < 10e-6, "{told}");
    assert!(number(&told["given"]["ripple_rms_pct"]) < 0.02, "{told}");
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
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    // The ball sits in the groove, so a lift moves it off the bottom by all of it, and nearer to neither flank.
    assert!(
        (number(&told["given"]["path_error_max_mm"]) - 0.004).abs() < 5e-5,
        "{told}"
    );
    assert!(told["core"].is_null());
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
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(
            told["error"]["message"].as_str().unwrap().contains(wanted),
            "{told}"
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
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(
        told.get("given").is_some(),
        "LinuxCNC's rs274 is needed, as scripts/setup.sh brings it: {told}"
    );
    let error = told["given"]["path_error_max_mm"].as_f64().unwrap();
    assert!(error > 0.002 && error <= 0.0052, "{error}");
    let [least, mean] = ["min", "mean"].map(|key| told["given"]["feed_mm_s"][key].as_f64().unwrap());
    assert!(least < mean && (mean - 10.0).abs() < 0.1, "{mean}");
    std::fs::write(folder.path().join("bad.ngc"), "G1 X1 Y2 F0 Q\n").unwrap();
    let refused = run(folder.path(), "judge job.toml bad.ngc --json");
    assert_eq!(refused.status.code(), Some(2), "{}", out(&refused));
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

/// The names in a folder, ascending.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Nothing that is there is overwritten without `--force`, and what a command reads not even then; the work is not begun.
#[test]
fn outputs_are_not_overwritten() {
    let folder = folder_with("plate", &[]);
    let job = std::fs::read(folder.path().join("job.toml")).unwrap();
    std::fs::write(folder.path().join("there"), "there").unwrap();
    std::fs::create_dir(folder.path().join("page")).unwrap();
    std::fs::write(folder.path().join("page/index.html"), "mine").unwrap();
    let cad = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cad/mouse.step");
    std::fs::copy(cad, folder.path().join("mouse.step")).unwrap();
    std::fs::write(
        folder.path().join("of_file.toml"),
        "[surface]\nkind = \"file\"\npath = \"mouse.step\"\n[tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 600\n\
         scallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n",
    )
    .unwrap();
    let before = names(folder.path());
    for (arguments, words) in [
        ("simulate job.toml --trace there", "exists already"),
        (
            "simulate job.toml --trace job.toml --force",
            "is what the command reads",
        ),
        ("simulate job.toml --report page", "exists already"),
        ("simulate job.toml --report there", "that is a file"),
        (
            "simulate job.toml --approach linear --trace there",
            "exists already",
        ),
        ("verify job.toml --report page", "exists already"),
        ("export job.toml --format grbl -o there", "exists already"),
        (
            "export job.toml --format grbl -o job.toml --force",
            "is what the command reads",
        ),
        (
            "export of_file.toml --format grbl -o mouse.step --force",
            "is what the command reads",
        ),
        ("import mouse.step -o there", "exists already"),
        (
            "import mouse.step -o mouse.step --force",
            "is what the command reads",
        ),
        ("new -o there", "exists already"),
    ] {
        let begun = std::time::Instant::now();
        let output = run(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {}", err(&output));
        let said = err(&output);
        // Messages are broken into lines.
        let said: Vec<_> = said.split_whitespace().collect();
        assert!(said.join(" ").contains(words), "{arguments}: {}", err(&output));
        assert!(begun.elapsed().as_secs() < 20, "{arguments}");
    }
    assert_eq!(std::fs::read(folder.path().join("job.toml")).unwrap(), job);
    assert_eq!(std::fs::read(folder.path().join("there")).unwrap(), b"there");
    assert_eq!(
        std::fs::read(folder.path().join("page/index.html")).unwrap(),
        b"mine"
    );
    assert_eq!(names(folder.path()), before);
    for arguments in [
        "export job.toml --format grbl -o there --force",
        "simulate job.toml --report page --trace there --force",
    ] {
        let output = run(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", err(&output));
    }
    assert!(
        std::fs::read_to_string(folder.path().join("there"))
            .unwrap()
            .starts_with("tick,")
    );
    assert_eq!(names(&folder.path().join("page")), ["index.html", "path.svg"]);
    assert_eq!(names(folder.path()), before);
}

/// A command that is killed while it writes leaves what was there, and nothing else.
#[test]
fn a_killed_command_leaves_no_file() {
    let folder = folder_with("plate", &[]);
    std::fs::write(folder.path().join("t.csv"), "old").unwrap();
    let mut killed = 0;
    for wait_ms in [300, 600, 1200] {
        let mut child = program(folder.path(), "simulate job.toml --trace t.csv --force")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(wait_ms));
        child.kill().unwrap();
        killed += usize::from(child.wait().unwrap().code().is_none());
        let text = std::fs::read_to_string(folder.path().join("t.csv")).unwrap();
        assert!(text == "old" || text.ends_with('\n'), "{} bytes", text.len());
        assert_eq!(names(folder.path()), ["job.toml", "t.csv"]);
    }
    assert!(killed > 0, "no run was long enough to be killed");
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

/// The list of a file's faces: measures against closed forms, conditions and order.
#[test]
fn faces_are_listed_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    let cad = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cad/blade.step");
    std::fs::copy(cad, folder.path().join("blade.step")).unwrap();
    let faces = |more: &str| {
        let list = json(folder.path(), &format!("import blade.step --list --json {more}"));
        list["faces"].as_array().unwrap().clone()
    };
    let whole = faces("");
    assert_eq!(whole.len(), 13);
    let area = |face: &Value| face["area_mm2"].as_f64().unwrap();
    let number = |face: &Value| face["face"].as_u64().unwrap();
    for face in &whole {
        let size: Vec<f64> = face["size_mm"]
            .as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_f64().unwrap())
            .collect();
        let round = &face["least_concave_radius_mm"];
        let radius = round["minus"].as_f64().or(round["plus"].as_f64());
        let height = match face["kind"].as_str().unwrap() {
            // A zone of a sphere is as large as that of the cylinder about it.
            "sphere" | "cylinder" => size[2],
            _ => continue,
        };
        let exact = std::f64::consts::TAU * radius.unwrap() * height;
        assert!((area(face) / exact - 1.0).abs() < 1e-3, "{face}: {exact} mm2");
    }
    let up = faces("--only up --sort area --reverse");
    assert!(!up.is_empty() && up.len() < whole.len());
    assert!(up.windows(2).all(|pair| area(&pair[0]) >= area(&pair[1])));
    let facing_up = |face: &&Value| {
        face["normal"]
            .as_array()
            .is_some_and(|normal| normal[2].as_f64().unwrap() > 0.1)
    };
    assert_eq!(up.len(), whole.iter().filter(facing_up).count());
    let large = faces("--only kind=PLANE --only area>3000 --only whole");
    let expected: Vec<u64> = whole
        .iter()
        .filter(|face| face["kind"] == "plane" && area(face) > 3000.0 && face["trimmed"] == false)
        .map(number)
        .collect();
    assert_eq!(large.iter().map(number).collect::<Vec<_>>(), expected);
    for (wrong, words) in [("--only down", "kind=WORD"), ("--sort size", "patches")] {
        let output = run(folder.path(), &format!("import blade.step --list {wrong}"));
        assert_eq!(output.status.code(), Some(2));
        assert!(err(&output).contains(words), "{}", err(&output));
    }
    let text = out(&run(
        folder.path(),
        "import blade.step --list --only name=nothing",
    ));
    assert!(text.contains("0 of 13 faces"), "{text}");
}

/// The page of a file's faces has them all, where they are, and no name in the file is more than text on it.
#[test]
fn a_page_shows_the_part() {
    let folder = tempfile::tempdir().unwrap();
    let cad = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cad");
    std::fs::copy(cad.join("blade.step"), folder.path().join("blade.step")).unwrap();
    let sheet = std::fs::read_to_string(cad.join("../../tests/hostile_cad/sound.step")).unwrap();
    let attack = "</script><img src=x onerror=alert(1)>";
    let named = sheet.replacen("ADVANCED_FACE('',", &format!("ADVANCED_FACE('{attack}',"), 1);
    assert_ne!(named, sheet);
    std::fs::write(folder.path().join("sheet.step"), named).unwrap();
    let page = |file: &str| -> (String, Value) {
        let output = run(
            folder.path(),
            &format!("import {file}.step --list --page {file}.html"),
        );
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let text = std::fs::read_to_string(folder.path().join(format!("{file}.html"))).unwrap();
        let data = text
            .split_once("id=\"data\">")
            .unwrap()
            .1
            .split_once("</script>")
            .unwrap()
            .0;
        let data = serde_json::from_str(data).unwrap();
        (text, data)
    };
    let (text, data) = page("sheet");
    assert_eq!(data["faces"][0]["name"], attack);
    assert!(!text.contains("<img"));
    assert_eq!(text.matches("</script>").count(), 2);
    let (_, data) = page("blade");
    let faces = data["faces"].as_array().unwrap();
    assert_eq!(faces.len(), 13);
    let listed = json(folder.path(), "import blade.step --list --json");
    for (face, listed) in faces.iter().zip(listed["faces"].as_array().unwrap()) {
        assert_eq!(face["number"], listed["face"]);
        let points: Vec<Vec<f64>> = face["polygons"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|rings| rings.as_array().unwrap())
            .flat_map(|ring| ring.as_array().unwrap())
            .map(|point| {
                point
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|x| x.as_f64().unwrap())
                    .collect()
            })
            .collect();
        assert!(points.len() >= 4, "face {}", face["number"]);
        // Within the box of the list, which is that of the rectangle around a trimmed face.
        let [low, high] = [0, 1].map(|k| listed["corners_mm"][k].as_array().unwrap().clone());
        for point in &points {
            for axis in 0..3 {
                let (low, high) = (low[axis].as_f64().unwrap(), high[axis].as_f64().unwrap());
                let slack = 0.01 + 0.01 * (high - low);
                assert!(
                    (low - slack..=high + slack).contains(&point[axis]),
                    "face {}: {point:?}",
                    face["number"]
                );
            }
        }
        assert!(
            face["command"]
                .as_str()
                .unwrap()
                .contains(&format!("import blade.step --face {}", face["number"]))
        );
    }
    let again = run(folder.path(), "import blade.step --list --page blade.html");
    assert_eq!(again.status.code(), Some(2), "{}", err(&again));
}
