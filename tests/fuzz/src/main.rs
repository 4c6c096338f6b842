//! `fuzz-targets TARGET SECONDS [FIRST]`: cases from number FIRST on (default 0), each from the seeds by its number alone. A case that fails is
//! written to `target/fuzz`, and its number repeats it: `fuzz-targets TARGET 0 NUMBER`.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use fastrand::Rng;
use fuzz_targets::reader::Reader;
use fuzz_targets::{job_file, mutated, protocol};

/// Start of the sequence of cases.
const SEED: u64 = 0x0150_feed;
/// Time that one case may take, also on a busy computer.
const CASE_MAX: Duration = Duration::from_secs(60);

/// What is fuzzed.
type Target<'t> = dyn FnMut(&[u8]) + 't;

/// The files of these folders and these files.
fn seeds(places: &[&str]) -> Vec<Vec<u8>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut files: Vec<PathBuf> = Vec::new();
    for place in places {
        let place = root.join(place);
        match std::fs::read_dir(&place) {
            Ok(entries) => files.extend(
                entries
                    .flatten()
                    .map(|entry| entry.path())
                    .filter(|path| path.is_file()),
            ),
            Err(_) => files.push(place),
        }
    }
    // The order of a folder is not that of every computer.
    files.sort();
    files.iter().filter_map(|path| std::fs::read(path).ok()).collect()
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize| words.get(index).and_then(|word| word.parse::<u64>().ok());
    let (Some(target), Some(seconds)) = (words.first(), number(1)) else {
        eprintln!("usage: fuzz-targets protocol|job_file|cad SECONDS [FIRST]");
        return ExitCode::from(2);
    };
    let mut reader = None;
    let (seeds, mut run): (_, Box<Target<'_>>) = match target.as_str() {
        "protocol" => (seeds(&["tests/fuzz/seeds/protocol"]), Box::new(protocol)),
        "job_file" => (seeds(&["tests/fuzz/seeds/job_file", "jobs"]), Box::new(job_file)),
        "cad" => match Reader::new() {
            Ok(made) => {
                let reader = reader.insert(made);
                let places = [
                    "tests/hostile_cad",
                    "jobs/cad/mouse.igs",
                    "jobs/cad/mouse.3dm",
                    "jobs/cad/lens_mould.step",
                ];
                (seeds(&places), Box::new(|data: &[u8]| reader.read(data)))
            }
            Err(error) => {
                eprintln!("error: {error}");
                return ExitCode::from(2);
            }
        },
        other => {
            eprintln!("error: there is no target {other}");
            return ExitCode::from(2);
        }
    };
    assert!(seeds.len() > 2, "the seeds are there");
    let first = number(2).unwrap_or(0);
    let begun = Instant::now();
    let (mut case, mut slowest) = (first, Duration::ZERO);
    while case == first || begun.elapsed() < Duration::from_secs(seconds) {
        let data = match case.checked_sub(seeds.len() as u64) {
            // The seeds themselves come first.
            None => seeds[usize::try_from(case).unwrap_or(0)].clone(),
            Some(_) => mutated(
                &mut Rng::with_seed(SEED ^ case.wrapping_mul(0x9e37_79b9_7f4a_7c15)),
                &seeds,
            ),
        };
        let started = Instant::now();
        let passed = catch_unwind(AssertUnwindSafe(|| run(&data))).is_ok();
        let took = started.elapsed();
        slowest = slowest.max(took);
        if !passed || took > CASE_MAX {
            let folder = Path::new("target/fuzz");
            let path = folder.join(format!("{target}-{case}"));
            let kept = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, &data));
            eprintln!(
                "case {case} of {target} failed after {:.1} s; {}: fuzz-targets {target} 0 {case}",
                took.as_secs_f64(),
                kept.map_or_else(|error| error.to_string(), |()| path.display().to_string())
            );
            return ExitCode::FAILURE;
        }
        case += 1;
    }
    drop(run);
    let library = reader.map_or(String::new(), |reader| {
        format!(
            ", {} panics of the library, each an error of the tool",
            reader.library_panics
        )
    });
    println!(
        "{target}: {} cases in {:.0} s, the slowest {:.2} s{library}",
        case - first,
        begun.elapsed().as_secs_f64(),
        slowest.as_secs_f64()
    );
    ExitCode::SUCCESS
}
