//! What is fuzzed: one function for each input that comes from outside. Each takes any bytes, and panics where the code breaks a promise.
//!
//! Seeded on the stable toolchain, 10 s each in `./check`: `cargo run -p fuzz-targets -- TARGET SECONDS` (see `main.rs`). Campaigns:
//! `cargo +nightly fuzz run TARGET fuzz/corpus/TARGET tests/fuzz/seeds/TARGET`, with the targets of `fuzz/`, which call the same functions.

mod job_file;
mod mutation;
mod protocol;
pub mod reader;

pub use job_file::job_file;
pub use mutation::mutated;
pub use protocol::protocol;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

    use super::*;
    use std::path::Path;

    /// Every seed passes through all of the fuzzed code: mutations of an input that is refused at once would find nothing.
    #[test]
    fn seeds_go_all_the_way() {
        let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds");
        let text = std::fs::read_to_string(seeds.join("job_file/nurbs.toml")).unwrap();
        let job = ::job_file::parse("nurbs.toml", &text).unwrap();
        let prepared = machine::prepare::prepare(&job).unwrap();
        assert!(prepared.steps.is_some() && prepared.patches() > 1);
        let requests = std::fs::read(seeds.join("protocol/requests")).unwrap();
        let (kind, mut rest) = requests.split_first().unwrap();
        assert_eq!(kind % 2, 1, "payloads");
        let mut read = 0;
        while let Some((length, more)) = rest.split_first() {
            let (payload, after) = more.split_at(usize::from(*length));
            ::protocol::message::read_request(payload).unwrap();
            read += 1;
            rest = after;
        }
        assert!(read > 15, "{read} requests");
    }

    /// A case is what its number says, wherever it runs, and cases differ.
    #[test]
    fn cases_repeat() {
        let seeds = vec![include_bytes!("../seeds/job_file/nurbs.toml").to_vec()];
        let case = |seed: u64| mutated(&mut fastrand::Rng::with_seed(seed), &seeds);
        let all: std::collections::BTreeSet<Vec<u8>> = (0..500).map(case).collect();
        assert!(all.len() > 450, "{} of 500 differ", all.len());
        // Without a seed there is still an input.
        let _ = mutated(&mut fastrand::Rng::with_seed(1), &[]);
        assert!((0..500).all(|seed| case(seed) == case(seed)));
    }
}
