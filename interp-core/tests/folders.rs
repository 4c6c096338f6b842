//! The folders of the source import in one direction, so that there is no circle between them.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::path::{Path, PathBuf};

/// Each uses those before it; files beside the folders count as shown.
const ORDER: [&str; 11] = [
    "fault",
    "math",
    "sample",
    "command",
    "surface",
    "job",
    "pass",
    "feed",
    "sequence",
    "positioning",
    "interpolator",
];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let files = entries.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] });
    files.collect()
}

#[test]
fn folders_import_in_one_direction() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let rank = |name: &str| ORDER.iter().position(|known| *known == name);
    let mut imports = 0;
    for path in sources(&root) {
        let inside = path.strip_prefix(&root).unwrap().to_str().unwrap();
        let module = inside.split(['/', '.']).next().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        // Doc links point anywhere.
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        for line in code {
            for used in line.split("crate::").skip(1) {
                let used = used
                    .split(|c: char| !c.is_alphanumeric() && c != '_')
                    .next()
                    .unwrap();
                let Some(used_rank) = rank(used) else { continue };
                imports += 1;
                let own = if module == "steps" {
                    rank("sample")
                } else {
                    rank(module)
                };
                assert!(used_rank <= own.unwrap_or(usize::MAX), "{inside}: {line}");
            }
        }
    }
    assert!(imports > 100, "{imports} imports read");
}
