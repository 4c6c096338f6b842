//! Structure of the workspace: permitted dependencies between crates, and no import cycles between the folders of a crate.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Crates of the workspace that a crate depends on, directly or indirectly, when it is built with these flags.
fn dependencies(of: &str, flags: &[&str]) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--offline",
            "--locked",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--format",
            "{p}",
            "-p",
            of,
        ])
        .args(flags)
        .current_dir(root())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let lines = String::from_utf8(output.stdout).unwrap();
    lines
        .lines()
        // `cargo tree` prints the folder of a workspace crate after its version.
        .filter(|line| line.contains("(/"))
        .filter_map(|line| line.split(' ').next())
        .filter(|name| *name != of)
        .map(str::to_owned)
        .collect()
}

/// Each of these crates depends on the listed crates and no others.
#[test]
fn crates_see_what_they_may_see() {
    for (of, may) in [
        ("job", &[][..]),
        ("oracle", &["job"]),
        ("verify", &["job", "oracle"]),
        ("interp-core", &[]),
        ("patches", &["interp-core", "job"]),
        ("job-file", &["interp-core", "job", "patches"]),
    ] {
        let may: BTreeSet<String> = may.iter().map(|name| (*name).to_owned()).collect();
        assert_eq!(dependencies(of, &[]), may, "{of}");
    }
}

/// The preparation does not depend on the oracle, and the product depends neither on the study of the paper nor on the cycle tools.
#[test]
fn crates_do_not_see_what_they_may_not_see() {
    let without = |of: &str, flags: &[&str], hidden: &[&str]| {
        let seen = dependencies(of, flags);
        for name in hidden {
            assert!(!seen.contains(*name), "{of} depends on {name}");
        }
        seen
    };
    without("machine", &[], &["oracle", "verify", "inspect"]);
    without("part-program", &[], &["verify", "inspect", "report"]);
    for of in ["inspect", "report", "approach", "cad", "part-program"] {
        without(of, &[], &["study", "cycles", "cycle-plugin"]);
    }
    let developers = ["study", "cycles", "cycle-plugin"];
    let product = without("host-sim", &["--no-default-features"], &developers);
    assert!(product.contains("interp-core"));
    // Control: with default features the developers' crates are dependencies.
    let whole = dependencies("host-sim", &[]);
    assert!(developers.iter().all(|name| whole.contains(*name)), "{whole:?}");
}

/// The folders and files directly below a crate's `src`, each with the others that it imports.
fn imports(source: &Path) -> BTreeMap<String, BTreeSet<String>> {
    let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut open = vec![source.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
                continue;
            }
            let within = path.strip_prefix(source).unwrap().to_string_lossy().into_owned();
            let is_test = within.contains("tests") || within.ends_with("_tests.rs");
            if !within.ends_with(".rs") || within == "lib.rs" || within == "main.rs" || is_test {
                continue;
            }
            let part = within
                .split('/')
                .next()
                .unwrap()
                .trim_end_matches(".rs")
                .to_owned();
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
            let code: Vec<&str> = code
                .lines()
                .filter(|line| !line.trim_start().starts_with("//"))
                .collect();
            // In a file beside `lib.rs`, and in a folder's `mod.rs`, `super` is the crate.
            let depth = within.matches('/').count();
            let code = match (depth, within.ends_with("/mod.rs")) {
                (0, _) | (1, true) => code.join("\n").replace("super::", "crate::"),
                (1, false) => code.join("\n").replace("super::super::", "crate::"),
                _ => code.join("\n"),
            };
            let seen = all.entry(part.clone()).or_default();
            for after in code.split("crate::").skip(1) {
                let names: Vec<&str> = match after.strip_prefix('{') {
                    Some(list) => list.split('}').next().unwrap().split(',').collect(),
                    None => vec![after],
                };
                for name in names {
                    let name: String = name
                        .trim_start()
                        .chars()
                        .take_while(|c| c.is_alphanumeric() || *c == '_')
                        .collect();
                    if name != part {
                        seen.insert(name);
                    }
                }
            }
        }
    }
    let parts: BTreeSet<String> = all.keys().cloned().collect();
    for seen in all.values_mut() {
        seen.retain(|name| parts.contains(name));
    }
    all
}

/// The parts that a part imports, directly or indirectly.
fn reach<'a>(imports: &'a BTreeMap<String, BTreeSet<String>>, from: &str) -> BTreeSet<&'a str> {
    let mut seen = BTreeSet::new();
    let mut open: Vec<&str> = imports[from].iter().map(String::as_str).collect();
    while let Some(part) = open.pop() {
        if seen.insert(part) {
            open.extend(imports[part].iter().map(String::as_str));
        }
    }
    seen
}

#[test]
fn no_folder_imports_itself_by_way_of_others() {
    let mut folders = 0;
    let mut found = Vec::new();
    for source in [
        "interp-core/src",
        "controller/src",
        "host-sim/src",
        "host-sim/approach/src",
        "host-sim/cycles/src",
        "host-sim/machine/src",
        "host-sim/patches/src",
        "host-sim/report/src",
        "host-sim/study/src",
        "host-sim/verify/src",
    ] {
        let folder = root().join(source);
        let imports = imports(&folder);
        for part in imports.keys().filter(|part| folder.join(part).is_dir()) {
            folders += 1;
            if reach(&imports, part).contains(part.as_str()) {
                found.push(format!("{source}/{part}"));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
    assert!(folders >= 20, "only {folders} folders were looked at");
    let part = |name: &str, seen: &str| (name.to_owned(), BTreeSet::from([seen.to_owned()]));
    assert!(reach(&BTreeMap::from([part("a", "b"), part("b", "a")]), "a").contains("a"));
}
