//! The job of a grid of records.

use interp_core::{Header, RunStart, SurfaceKind};
use job::{Job, JobError};
use patches::pieces::Source;
use patches::records::{Records, records};

use super::{ParameterSpans, Prepared, steps, widths};

/// Prepares a grid of patches.
pub(super) fn prepare(job: &Job, header: Header, source: &Source) -> Result<Prepared, JobError> {
    let Records { words, path, side } =
        records(source, job.along).map_err(|no| job.origin.error("surface", no.what, no.remedy))?;
    finish(job, header, source.rational(), path, side, words)
}

fn finish(
    job: &Job,
    header: Header,
    rational: bool,
    path: Vec<f64>,
    side: Vec<f64>,
    records: Vec<i32>,
) -> Result<Prepared, JobError> {
    let spans = |breaks: &[f64]| u16::try_from(breaks.len() - 1).unwrap_or(u16::MAX);
    let header = Header {
        kind: if rational {
            SurfaceKind::Rational
        } else {
            SurfaceKind::Polynomial
        },
        path_spans: spans(&path),
        side_spans: spans(&side),
        ..header
    };
    let (path, side) = (ParameterSpans { breaks: path }, ParameterSpans { breaks: side });
    let mut words = widths(job, &side)?;
    words.extend(widths(job, &path)?);
    words.extend(records);
    Ok(Prepared {
        least_rows: 0,
        start: RunStart::FIRST,
        header,
        words,
        path,
        side,
        along: job.along,
        steps: steps::config(&job.machine),
    })
}
