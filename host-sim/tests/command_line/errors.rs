//! Errors: exit codes, the place in the job file, the remedy; faults of a run are as `explain` describes them.

use serde_json::Value;

use super::{err, folder_with, json, out, run};

/// Checks that each of these arguments ends with code 2, and an error that has these parts.
fn gets_a_remedy(cases: &[(&str, &[&str])]) {
    let folder = folder_with("torus", &[("scallop_mm", "scalop_mm")]);
    std::fs::write(folder.path().join("empty.toml"), "").unwrap();
    std::fs::write(folder.path().join("part.step"), "ISO-10303-21;\n").unwrap();
    for (arguments, says) in cases {
        let output = run(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {}", err(&output));
        assert!(output.stdout.is_empty(), "{arguments}");
        for part in *says {
            assert!(
                err(&output).contains(part),
                "{arguments}: {part} is not in {}",
                err(&output)
            );
        }
    }
}

/// Commands, options and files that there are not.
#[test]
fn unknown_words_and_files_get_a_remedy() {
    gets_a_remedy(&[
        ("simulate", &["<JOB>", "--help"]),
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
        ("export job.toml --format heidenhain -o x", &["linuxcnc, grbl"]),
        ("explain ball-dos-not-fit", &["ball-does-not-fit"]),
        ("new -o .", &["that is a folder: give a file in it"]),
        ("new -o no/job.toml", &["create the folder first"]),
        ("completions tcsh", &["bash, zsh, fish"]),
    ]);
}

/// Numbers out of their range.
#[test]
fn numbers_out_of_range_get_a_remedy() {
    gets_a_remedy(&[
        (
            "export job.toml --format linuxcnc --clearance -3 -o x",
            &["'-3' for '--clearance <MM>'", "a height in mm from 0 to 1000"],
        ),
        (
            "export job.toml --format linuxcnc --spindle inf -o x",
            &["'inf' for '--spindle <RPM>'", "turns a minute above 0"],
        ),
        (
            "judge job.toml motion.csv --path-tolerance nan",
            &["'nan' for '--path-tolerance <MM>'", "a length in mm above 0"],
        ),
        (
            "judge job.toml motion.csv --path-tolerance 0",
            &["'0' for '--path-tolerance <MM>'"],
        ),
        (
            "verify job.toml --scallop-tolerance nan",
            &["'nan' for '--scallop-tolerance <SHARE>'", "0 to 100 %"],
        ),
        (
            "operate --port nowhere jog x+1 --speed nan",
            &["'nan' for '--speed <SPEED>'", "a speed in mm/s above 0"],
        ),
        (
            "operate --port nowhere probe z-1 --speed -1",
            &["'-1' for '--speed <SPEED>'"],
        ),
        (
            "operate --port nowhere goto 0,0,0 --speed inf",
            &["'inf' for '--speed <SPEED>'"],
        ),
        (
            "operate --port nowhere touch z-1 --work 1 --speed 0",
            &["'0' for '--speed <SPEED>'"],
        ),
        (
            "operate --port nowhere touch z-1 --work 1 --plate -1",
            &["'-1' for '--plate <PLATE>'", "from 0 to 2147"],
        ),
        (
            "operate --port nowhere touch z-1 --work 1 --radius nan",
            &["'nan' for '--radius <RADIUS>'"],
        ),
        (
            "operate --port nowhere zero x --work 1 --at nan",
            &["'nan' for '--at <AT>'"],
        ),
        (
            "operate --port nowhere tool z-1 --speed nan",
            &["'nan' for '--speed <SPEED>'"],
        ),
        (
            "operate --port nowhere tool z-1 --setter 9999",
            &["'9999' for '--setter <SETTER>'", "within 2147 of 0"],
        ),
        (
            "operate --port nowhere spindle 9000 --for 1e20",
            &["'1e20' for '--for <SECONDS>'", "at most 86400"],
        ),
        ("budget --ticks 0", &["0 is not in 1.."]),
    ]);
}

/// Boards and images that there are not, or that do not fit together.
#[test]
fn unknown_boards_and_images_get_a_remedy() {
    gets_a_remedy(&[
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
    ]);
}

/// What needs a whole surface says what the job has instead, where, and the remedy.
#[test]
fn jobs_of_a_region_are_not_exported() {
    let folder = folder_with("torus", &[]);
    let cad = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cad/blade.step");
    std::fs::copy(cad, folder.path().join("blade.step")).unwrap();
    let region = "\n[region]\nloops = [[[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]]]\n";
    let job = std::fs::read_to_string(folder.path().join("job.toml")).unwrap();
    std::fs::write(folder.path().join("region.toml"), job + region).unwrap();
    let import = run(
        folder.path(),
        "import blade.step --part --tool 3 --scallop-mm 0.2 --faces 2 --up auto -o part.toml",
    );
    assert_eq!(import.status.code(), Some(0), "{}", err(&import));
    for (name, quoted, words) in [
        ("region.toml", "[region]", "a section [region]"),
        ("part.toml", "[part]", "a face of a part"),
    ] {
        for (command, who) in [
            (format!("export {name} --format grbl -o x.nc"), "export works"),
            (format!("simulate {name} --approach linear"), "--approach works"),
        ] {
            let output = run(folder.path(), &command);
            let said = err(&output).replace("\n  │", "");
            assert_eq!(output.status.code(), Some(2), "{said}");
            for part in [who, words, "help:", &format!("│ {quoted}")] {
                assert!(said.contains(part), "{command}: {part} is not in {said}");
            }
            assert_eq!(
                said.contains("remove the section [region]"),
                name == "region.toml",
                "{said}"
            );
        }
    }
}

/// The approaches that export can use are those in its help.
/// A speed of the command line is within the machine's profile, as one of the job is.
#[test]
fn export_refuses_a_spindle_beyond_the_profile() {
    let folder = folder_with("torus", &[("scallop_mm = ", "scallop_mm = 0.5 #")]);
    let machine = "[machine]\nsteps_per_mm = [400, 400, 400]\n";
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("bare.toml", machine);
    write("mill.toml", &format!("{machine}[spindle]\nmax_rpm = 12000\n"));
    let export = "export job.toml --format grbl --force -o a.nc --spindle";
    for (arguments, says) in [
        (
            "24000 --machine mill.toml",
            "--spindle 24000 exceeds the machine's profile: 12000 there",
        ),
        ("9000 --machine bare.toml", "the machine's profile has no spindle"),
        ("1e12", "at most 1e6"),
    ] {
        let output = run(folder.path(), &format!("{export} {arguments}"));
        assert_eq!(output.status.code(), Some(2), "{arguments}: {}", out(&output));
        assert!(err(&output).contains(says), "{arguments}: {}", err(&output));
    }
    let output = run(folder.path(), &format!("{export} 12000 --machine mill.toml"));
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
}

#[test]
fn the_help_of_export_names_its_approaches() {
    let folder = folder_with("torus", &[]);
    let help = out(&run(folder.path(), "export --help"));
    assert!(
        help.contains("- curve:") && !help.contains("- surface:"),
        "{help}"
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
        let reported: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(
            (&reported["fault"]["code"], &reported["fault"]["name"]),
            (&code.into(), &name.into()),
            "{reported}"
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
            assert_eq!(reported["fault"]["tick"], 0);
            assert!(
                (reported["fault"]["value"].as_f64().unwrap() - 1.125).abs() < 1e-4,
                "{reported}"
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
        let reported: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(reported["fault"]["code"], code, "{reported}");
    }
}

#[test]
fn a_placed_job_runs_and_its_errors_point_at_the_line() {
    let placed = "[placement]\nscale = 0.5\nrotate_deg = [0, 0, 90]\nplace = \"top\"\ntranslate_mm = [100, 50, -3]\n\n[tool]";
    let folder = folder_with("plate", &[("[tool]", placed)]);
    let reported = json(folder.path(), "verify job.toml --json");
    assert_eq!(reported["passed"], true, "{reported}");
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
