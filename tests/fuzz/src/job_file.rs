//! Job files: whatever they hold, they are a job that can be prepared and begun, or an error with a place and a remedy that a terminal can show.

use machine::Machine;
use machine::prepare::prepare;

/// Samples that are computed of a job.
const SAMPLES: usize = 50;

/// The text of a job file.
///
/// # Panics
/// A promise is broken.
pub fn job_file(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let refused = |error: &job::JobError| {
        assert!(!error.what().is_empty() && !error.remedy().is_empty(), "{error}");
        let shown = format!("{error}{}", error.remedy());
        assert!(
            !shown.chars().any(|c| c.is_control() && c != '\n' && c != '\t'),
            "{shown:?}"
        );
    };
    let job = match job_file::parse("fuzz.toml", text) {
        Ok(job) => job,
        Err(error) => return refused(&error),
    };
    let numbers = [job.radius_mm, job.feed_mm_min, job.scallop_mm, job.chord_mm];
    assert!(numbers.iter().all(|x| x.is_finite() && *x > 0.0), "{numbers:?}");
    let prepared = match prepare(&job) {
        Ok(prepared) => prepared,
        Err(error) => return refused(&error),
    };
    if let Ok(mut machine) = Machine::load(&prepared) {
        let mut samples = 0;
        // A fault is an answer.
        let _ = machine.run(|_| {
            samples += 1;
            samples < SAMPLES
        });
    }
}
