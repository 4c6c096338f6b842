//! A surface as records of the core: pieces in the pass's orientation, split further where a record cannot represent one.

use std::collections::BTreeSet;

use interp_core::STORE_WORDS;
use interp_core::encode::{self, Bicubic, EncodeError};
use interp_core::job::SPANS_MAX;
use interp_core::job::stream::{DIGEST_WORDS, WINDOW_MIN};
use interp_core::surface::{Edges, POLYNOMIAL_WORDS, RATIONAL_WORDS};

use job::{Along, SurfaceSpec};

use crate::pieces::{Piece, Source};

/// Patches of a job at most: their words, and the time in which they are placed and prepared, stay within reason.
pub const PATCHES_MAX: usize = 65_536;

/// Remedy where the machine cannot represent a surface.
pub const REMEDY: &str =
    "place it nearer to the origin (`[placement] place = \"centre\"`), or cut it into smaller surfaces";

/// Distance within which the poles of a boundary count as one point, mm: 1/1000 of the core's resolution.
const POINT_MM: f64 = 1e-9;

/// Largest number of rounds of splitting; each halves every patch that a record cannot represent.
const ROUNDS_MAX: usize = 8;

/// Directions in which a piece has to be split.
struct Split {
    path: bool,
    side: bool,
    why: EncodeError,
}

/// Result of encoding the patches of a grid.
struct RecordGrid {
    /// The records, path index fastest.
    words: Vec<i32>,
    /// Path and side spans that have to be halved.
    halve: [BTreeSet<usize>; 2],
    /// Side spans at which a part of the boundary degenerates to a point, but not all of it.
    mixed: Option<usize>,
}

/// The records of a surface.
pub struct Records {
    /// Words of the records, path index fastest.
    pub words: Vec<i32>,
    /// Ends of the patches in the path parameter, ascending.
    pub path: Vec<f64>,
    /// Ends of the patches in the side parameter, ascending.
    pub side: Vec<f64>,
}

/// Reason for which a surface cannot be encoded as records, as sentences.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoRecords {
    /// What is wrong.
    pub what: String,
    /// The remedy.
    pub remedy: &'static str,
}

/// Splits the surface until a record can represent each piece, with passes along a parameter.
///
/// # Errors
/// Too many patches, or a piece that no record can represent.
pub fn records(source: &Source, along: Along) -> Result<Records, NoRecords> {
    let no = |what: String, remedy: &'static str| NoRecords { what, remedy };
    let [u, v] = source.breaks();
    let (mut path, mut side) = match along {
        Along::U => (u, v),
        Along::V => (v, u),
    };
    for _ in 0..ROUNDS_MAX {
        // Before the patches are made: a job file has room for a hundred thousand.
        let patches = (path.len() - 1) * (side.len() - 1);
        if patches > PATCHES_MAX {
            return Err(no(
                too_many(patches),
                "use fewer knots, or cut the part into several jobs",
            ));
        }
        let grid = grid(source, along, &path, &side).map_err(|why| {
            no(
                format!("the machine cannot represent this surface: {why}"),
                REMEDY,
            )
        })?;
        let [path_spans, side_spans] = &grid.halve;
        if path_spans.is_empty() && side_spans.is_empty() {
            if let Some(span) = grid.mixed {
                return Err(no(
                    format!(
                        "at side span {span} a part of the boundary is a single point, but not all of it"
                    ),
                    "split the surface into two jobs where the boundary becomes a point",
                ));
            }
            return Ok(Records {
                words: grid.words,
                path,
                side,
            });
        }
        halve(&mut path, path_spans);
        halve(&mut side, side_spans);
        if path.len().max(side.len()) > usize::from(SPANS_MAX) {
            break;
        }
    }
    let what = "the surface cannot be split into patches that the machine can represent";
    Err(no(what.to_owned(), REMEDY))
}

/// Number of patches of a surface that is not revolved and fits the board's store at once, with passes along u.
///
/// # Errors
/// A sentence with the reason for which the surface cannot be encoded.
pub fn patch_count(surface: &SurfaceSpec) -> Result<usize, String> {
    let source = Source::new(surface);
    let Records { words, path, side } = records(&source, Along::U).map_err(|no| no.what)?;
    let (path_spans, side_spans) = (path.len() - 1, side.len() - 1);
    let patches = path_spans * side_spans;
    // The width of each span is a word, too.
    if words.len() + path_spans + side_spans > STORE_WORDS {
        return Err(format!(
            "the surface takes {patches} patches, more than the board's store: about {} polynomial or {} rational ones",
            STORE_WORDS / (POLYNOMIAL_WORDS + 1),
            STORE_WORDS / (RATIONAL_WORDS + 1)
        ));
    }
    Ok(patches)
}

/// Number of patches of a surface that is not revolved and is streamed, with passes along one of u and v at least.
///
/// # Errors
/// A sentence with the reason for which the surface cannot be encoded or streamed.
pub fn streamed_patch_count(surface: &SurfaceSpec) -> Result<usize, String> {
    let source = Source::new(surface);
    let Records { words, path, side } = records(&source, Along::U).map_err(|no| no.what)?;
    let (path_spans, side_spans) = (path.len() - 1, side.len() - 1);
    let patches = path_spans * side_spans;
    let row = path_spans.min(side_spans) * (words.len() / patches) + DIGEST_WORDS;
    let rows = STORE_WORDS.saturating_sub(path_spans + side_spans) / row;
    if rows < usize::from(WINDOW_MIN) {
        return Err(format!(
            "the surface takes {path_spans} x {side_spans} patches, and the board's store holds {rows} rows of them"
        ));
    }
    Ok(patches)
}

fn too_many(patches: usize) -> String {
    format!("the surface takes {patches} patches, more than the {PATCHES_MAX} of a job")
}

fn halve(breaks: &mut Vec<f64>, spans: &BTreeSet<usize>) {
    for &span in spans.iter().rev() {
        breaks.insert(span + 1, 0.5 * (breaks[span] + breaks[span + 1]));
    }
}

/// The records of all patches, or the spans that have to be halved.
fn grid(source: &Source, along: Along, path: &[f64], side: &[f64]) -> Result<RecordGrid, EncodeError> {
    let mut grid = RecordGrid {
        words: Vec::new(),
        halve: [BTreeSet::new(), BTreeSet::new()],
        mixed: None,
    };
    for (j, side) in side.windows(2).enumerate() {
        let mut first = None;
        for (i, path) in path.windows(2).enumerate() {
            let (path, side) = ([path[0], path[1]], [side[0], side[1]]);
            let piece = match along {
                Along::U => source.piece(path, side),
                Along::V => source.piece(side, path).map(|axis| transpose(&axis)),
            };
            let edges = collapsed(&piece);
            let beside = [edges.side_start, edges.side_end];
            if *first.get_or_insert(beside) != beside {
                grid.mixed = Some(j);
            }
            match record(&piece, edges, source.rational(), &mut grid.words) {
                Ok(()) => {}
                Err(split) if matches!(split.why, EncodeError::NotFinite | EncodeError::TooFar) => {
                    return Err(split.why);
                }
                Err(split) => {
                    let [path_spans, side_spans] = &mut grid.halve;
                    path_spans.extend(split.path.then_some(i));
                    side_spans.extend(split.side.then_some(j));
                }
            }
        }
    }
    Ok(grid)
}

fn transpose(c: &Bicubic) -> Bicubic {
    std::array::from_fn(|i| std::array::from_fn(|j| c[j][i]))
}

fn record(piece: &Piece, edges: Edges, rational: bool, words: &mut Vec<i32>) -> Result<(), Split> {
    if edges.count() > 1 {
        // Opposite boundaries are separated by a cut between them.
        let path = edges.path_start && edges.path_end;
        let side = edges.side_start && edges.side_end;
        let neither = !path && !side;
        return Err(Split {
            path: path || neither,
            side: side || neither,
            why: EncodeError::NotAPole,
        });
    }
    let both = |why| Split {
        path: true,
        side: true,
        why,
    };
    let words_of = if rational {
        let one_way = |why| match why {
            EncodeError::Weights => weight_split(piece),
            why => both(why),
        };
        encode::rational(piece, edges)
            .map_err(one_way)?
            .to_words()
            .to_vec()
    } else {
        let [x, y, z, _] = *piece;
        encode::polynomial(&[x, y, z], edges)
            .map_err(both)?
            .to_words()
            .to_vec()
    };
    words.extend(words_of);
    Ok(())
}

/// Splits the direction in which the weights vary more.
fn weight_split(piece: &Piece) -> Split {
    let [.., weight] = piece;
    let cubic = |[c0, c1, c2, c3]: [f64; 4], t: f64| c0 + t * (c1 + t * (c2 + t * c3));
    let ratio = |at: &dyn Fn(f64) -> f64| {
        let values = (0..9).map(|k| at(f64::from(k) / 8.0 - 0.5));
        let (least, most) = values.fold((f64::INFINITY, 0.0_f64), |(a, b), value| {
            (a.min(value), b.max(value))
        });
        most / least
    };
    let along = ratio(&|t| cubic(weight.map(|row| cubic(row, 0.0)), t));
    let across = ratio(&|t| cubic(weight.map(|row| cubic(row, t)), 0.0));
    Split {
        path: along >= across,
        side: across >= along,
        why: EncodeError::Weights,
    }
}

/// The boundaries of a piece that degenerate to points.
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
