//! The grid of records: pieces in the pass's orientation, split further where a record cannot hold one.

use interp_core::encode::{self, Bicubic, EncodeError};
use interp_core::job::SPANS_MAX;
use interp_core::surface::Edges;
use interp_core::{Header, SurfaceKind};

use super::patches::{Piece, Source};
use super::{Axis, Prepared, widths};
use crate::job_file::{Along, JobFile, JobFileError};

pub(super) const REMEDY: &str = "move the part nearer to the origin (±2 m), or cut it into smaller surfaces";

/// Distance within which the poles of a boundary count as one point, mm: 1/1000 of the machine's nanometre.
const POINT_MM: f64 = 1e-9;

/// Rounds of splitting before it is given up: halving a 2 m patch so often makes it 8 mm.
const ROUNDS_MAX: usize = 8;

/// Which way a piece has to be split.
struct Split {
    path: bool,
    side: bool,
    why: EncodeError,
}

/// Prepares a grid of patches.
pub(super) fn prepare(job: &JobFile, header: Header, source: &Source) -> Result<Prepared, JobFileError> {
    let [u, v] = source.breaks();
    let (mut path, mut side) = match job.along {
        Along::U => (u, v),
        Along::V => (v, u),
    };
    for _ in 0..ROUNDS_MAX {
        match records(source, job.along, &path, &side) {
            Ok(records) => return finish(job, header, source.rational(), path, side, records),
            Err((_, split)) if matches!(split.why, EncodeError::NotFinite | EncodeError::TooFar) => {
                let what = format!("the machine cannot hold this surface: {}", split.why);
                return Err(job.origin.error("surface", what, REMEDY));
            }
            Err(([path_span, side_span], split)) => {
                if split.path {
                    halve(&mut path, path_span);
                }
                if split.side {
                    halve(&mut side, side_span);
                }
                if path.len().max(side.len()) > usize::from(SPANS_MAX) {
                    break;
                }
            }
        }
    }
    Err(job.origin.error(
        "surface",
        "the surface does not become patches that the machine can hold",
        REMEDY,
    ))
}

fn halve(breaks: &mut Vec<f64>, span: usize) {
    let middle = 0.5 * (breaks[span] + breaks[span + 1]);
    breaks.insert(span + 1, middle);
}

/// The records of all patches, path index fastest; or the first patch that has to be split.
fn records(
    source: &Source,
    along: Along,
    path: &[f64],
    side: &[f64],
) -> Result<Vec<i32>, ([usize; 2], Split)> {
    let mut words = Vec::new();
    for (j, side) in side.windows(2).enumerate() {
        for (i, path) in path.windows(2).enumerate() {
            let (path, side) = ([path[0], path[1]], [side[0], side[1]]);
            let piece = match along {
                Along::U => source.piece(path, side),
                Along::V => source.piece(side, path).map(|axis| transpose(&axis)),
            };
            record(&piece, source.rational(), &mut words).map_err(|split| ([i, j], split))?;
        }
    }
    Ok(words)
}

fn transpose(c: &Bicubic) -> Bicubic {
    std::array::from_fn(|i| std::array::from_fn(|j| c[j][i]))
}

fn record(piece: &Piece, rational: bool, words: &mut Vec<i32>) -> Result<(), Split> {
    let edges = collapsed(piece);
    let both = |why| Split {
        path: true,
        side: true,
        why,
    };
    let along = edges.path_start && edges.path_end;
    let across = edges.side_start && edges.side_end;
    if along || across {
        return Err(Split {
            path: along,
            side: across,
            why: EncodeError::NotAPole,
        });
    }
    if rational && edges.count() > 1 {
        return Err(both(EncodeError::NotAPole));
    }
    if rational {
        words.extend(encode::rational(piece, edges).map_err(both)?.to_words());
    } else {
        let [x, y, z, _] = *piece;
        words.extend(encode::polynomial(&[x, y, z], edges).map_err(both)?.to_words());
    }
    Ok(())
}

/// Which boundaries of a piece are single points.
fn collapsed(piece: &Piece) -> Edges {
    let cubic = |[c0, c1, c2, c3]: [f64; 4], t: f64| c0 + t * (c1 + t * (c2 + t * c3));
    let point = |path: f64, side: f64| -> [f64; 3] {
        let [x, y, z, w] = piece.map(|c| cubic(c.map(|row| cubic(row, side)), path));
        [x / w, y / w, z / w]
    };
    let one = |at: &dyn Fn(f64) -> [f64; 3]| {
        let first = at(-0.5);
        // Seven more points: a rational cubic cannot return to its start that often.
        (1..8).all(|k| {
            let other = at(f64::from(k) / 7.0 - 0.5);
            first.iter().zip(other).all(|(a, b)| (a - b).abs() < POINT_MM)
        })
    };
    Edges {
        path_start: one(&|t| point(-0.5, t)),
        path_end: one(&|t| point(0.5, t)),
        side_start: one(&|t| point(t, -0.5)),
        side_end: one(&|t| point(t, 0.5)),
    }
}

fn finish(
    job: &JobFile,
    header: Header,
    rational: bool,
    path: Vec<f64>,
    side: Vec<f64>,
    records: Vec<i32>,
) -> Result<Prepared, JobFileError> {
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
    let (path, side) = (Axis { breaks: path }, Axis { breaks: side });
    let mut words = widths(job, &side)?;
    words.extend(widths(job, &path)?);
    words.extend(records);
    Ok(Prepared {
        header,
        words,
        path,
        side,
        along: job.along,
    })
}
