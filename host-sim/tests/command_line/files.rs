//! Files that commands write: new jobs, and nothing that is there is lost, whatever happens to the command.

use std::path::Path;
use std::process::Stdio;

use super::{err, folder_with, json, program, run};

#[test]
fn new_jobs_run_and_are_never_lost() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["bicubic", "ruled", "revolved", "nurbs"] {
        let output = run(folder.path(), &format!("new -o {kind}.toml --kind {kind}"));
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let reported = json(folder.path(), &format!("simulate {kind}.toml --json"));
        assert!(
            reported["fault"].is_null() && reported["samples"].as_u64().unwrap() > 10_000,
            "{reported}"
        );
        let auto = &reported["along_auto"];
        let time = |along: &str| auto[along]["machining_time_s"].as_f64().unwrap();
        let least = time("u").min(time("v"));
        assert_eq!(
            reported["machining_time_s"].as_f64(),
            Some(least),
            "{kind}: {auto}"
        );
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
    std::fs::create_dir(folder.path().join("charts")).unwrap();
    std::fs::write(folder.path().join("charts/budget.svg"), "mine").unwrap();
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
        // Commands of minutes; the firmware is not built before either.
        ("paper --report page", "exists already"),
        ("paper --report there --force", "that is a file"),
        ("budget --report charts", "exists already"),
        ("budget --report /proc/none", "create the folder first"),
        ("budget --search 1 --out there", "exists already"),
        (
            "budget --search 1 --out none/there --force",
            "create the folder first",
        ),
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
    assert_eq!(
        std::fs::read(folder.path().join("charts/budget.svg")).unwrap(),
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

/// The file of a job of many faces, of which `FILE#FACE` is one, is what the command reads.
#[test]
fn the_file_of_many_jobs_stays() {
    let folder = tempfile::tempdir().unwrap();
    let sheet = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/hostile_cad/sound.step");
    std::fs::copy(sheet, folder.path().join("sheet.step")).unwrap();
    let job = "[part]\npath = \"sheet.step\"\n[tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 600\n\
               scallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n[[face]]\nface = 1\n";
    let path = folder.path().join("part.toml");
    std::fs::write(&path, job).unwrap();
    let output = run(folder.path(), "simulate part.toml#1 --trace part.toml --force");
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert!(err(&output).contains("is what the command"), "{}", err(&output));
    assert_eq!(std::fs::read_to_string(path).unwrap(), job);
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
