//! Parametric spline surfaces of IGES (entity 114; 5.3, 4.24) as B-splines (entity 128), exactly: the same cubic patches by their Bézier poles.
//!
//! `cadmpeg` refuses an entity 114 whose patches differ at their common boundaries by the rounding of the file's digits. Here they may differ by
//! the file's own resolution, and meet in the middle.

use std::fmt::Write;

use crate::iges_entries::{Entries, Entry, Lines, SECTION, globals};

/// Index of the minimum user-intended resolution in the global section (5.3, 2.2.4.3.19).
const RESOLUTION: usize = 18;
/// Largest number of patches of a surface.
const PATCHES_MAX: usize = 100_000;
/// Coefficients of one patch: 16 for each coordinate.
const PATCH_WORDS: usize = 48;
/// The columns of a line of parameters that hold data.
const DATA: usize = 64;

/// The power basis over a width `h` in the Bernstein basis: poles `b_i = sum_j C(i,j) / C(3,j) a_j h^j`.
fn bezier(a: [f64; 4], h: f64) -> [f64; 4] {
    let [a, b, c, d] = [a[0], a[1] * h, a[2] * h * h, a[3] * h * h * h];
    [a, a + b / 3.0, a + (2.0 * b + c) / 3.0, a + b + c + d]
}

/// A number of a file, with `D` for the exponent as Fortran writes it.
fn real(word: &str) -> Option<f64> {
    let value: f64 = word.replace(['D', 'd'], "E").parse().ok()?;
    value.is_finite().then_some(value)
}

/// A surface as its poles, `[i][j]`, i along u, and the ends of its patches.
struct Poles {
    breaks: [Vec<f64>; 2],
    rows: Vec<Vec<[f64; 3]>>,
}

/// The poles of an entity 114; `None` if it is invalid or its patches are further apart than `resolution`.
fn poles(entry: &Entry, resolution: f64) -> Option<Poles> {
    let [m, n] = [entry.whole(3)?, entry.whole(4)?];
    if m == 0 || n == 0 || m.checked_mul(n)? > PATCHES_MAX {
        return None;
    }
    let numbers = |from: usize, count: usize| -> Option<Vec<f64>> {
        entry
            .words
            .get(from..from + count)?
            .iter()
            .map(|word| real(word))
            .collect()
    };
    let breaks = [numbers(5, m + 1)?, numbers(6 + m, n + 1)?];
    if breaks
        .iter()
        .any(|breaks| breaks.windows(2).any(|pair| pair[0] >= pair[1]))
    {
        return None;
    }
    // Sum and number of the poles that neighbouring patches give for one place.
    let mut sums = vec![vec![([0.0; 3], 0.0); 3 * n + 1]; 3 * m + 1];
    let mut all = Vec::with_capacity(16 * m * n);
    for i in 0..m {
        for j in 0..n {
            // There is one row and one column of arbitrary values more.
            let words = numbers(7 + m + n + PATCH_WORDS * (i * (n + 1) + j), PATCH_WORDS)?;
            let [width_u, width_v] = [&breaks[0][i..], &breaks[1][j..]].map(|ends| ends[1] - ends[0]);
            for (axis, c) in words.chunks_exact(16).enumerate() {
                // Coefficients of u in each power of v.
                let in_u: [[f64; 4]; 4] =
                    std::array::from_fn(|power| bezier(std::array::from_fn(|k| c[4 * power + k]), width_u));
                for (a, row) in sums[3 * i..=3 * i + 3].iter_mut().enumerate() {
                    let column = bezier(in_u.map(|poles| poles[a]), width_v);
                    for (b, value) in column.into_iter().enumerate() {
                        let (sum, count) = &mut row[3 * j + b];
                        sum[axis] += value;
                        *count += if axis == 0 { 1.0 } else { 0.0 };
                        all.push((3 * i + a, 3 * j + b, axis, value));
                    }
                }
            }
        }
    }
    let rows: Vec<Vec<[f64; 3]>> = sums
        .iter()
        .map(|row| row.iter().map(|(sum, count)| sum.map(|x| x / count)).collect())
        .collect();
    let apart =
        |(i, j, axis, value): &(usize, usize, usize, f64)| (rows[*i][*j][*axis] - value).abs() > resolution;
    (!all.iter().any(apart)).then_some(Poles { breaks, rows })
}

/// The parameters of an entity 128.
fn parameters(poles: &Poles, separator: char) -> Vec<String> {
    let counts = [poles.rows.len(), poles.rows[0].len()].map(|count| count - 1);
    let mut words: Vec<String> = vec!["128".to_owned()];
    words.extend(counts.map(|count| count.to_string()));
    // Degrees; not closed, polynomial, not periodic.
    words.extend(["3", "3", "0", "0", "1", "0", "0"].map(str::to_owned));
    let number = |x: f64| format!("{x:.16E}");
    for breaks in &poles.breaks {
        let last = breaks.len() - 1;
        for (index, knot) in breaks.iter().enumerate() {
            let times = if index == 0 || index == last { 4 } else { 3 };
            words.extend(std::iter::repeat_n(number(*knot), times));
        }
    }
    words.extend(std::iter::repeat_n(
        "1.".to_owned(),
        poles.rows.len() * poles.rows[0].len(),
    ));
    for j in 0..poles.rows[0].len() {
        words.extend(poles.rows.iter().flat_map(|row| row[j].map(number)));
    }
    for breaks in &poles.breaks {
        words.extend([breaks[0], breaks[breaks.len() - 1]].map(number));
    }
    let count = words.len();
    for (index, word) in words.iter_mut().enumerate() {
        word.push(if index + 1 < count { separator } else { ';' });
    }
    words
}

/// Puts a number into a field of a line of the directory.
fn set_field(line: &mut [u8], column: usize, value: usize) {
    let text = format!("{value:>8}");
    if let (Some(field), 8) = (line.get_mut(8 * column..8 * column + 8), text.len()) {
        field.copy_from_slice(text.as_bytes());
    }
}

/// The file with its entities 114 as entities 128; `None` if it has none that can be converted.
pub(crate) fn converted(bytes: &[u8], entries: &Entries) -> Option<Vec<u8>> {
    let lines = Lines::new(bytes);
    let fields = globals(&lines);
    let delimiter = |index: usize, default: char| {
        fields
            .get(index)
            .and_then(|field| field.chars().next())
            .filter(|_| fields[index].len() == 1)
            .unwrap_or(default)
    };
    // The record delimiter is written as `;`: of another one nothing is converted.
    let separator = Some(delimiter(0, ',')).filter(|_| delimiter(1, ';') == ';')?;
    let resolution = fields
        .get(RESOLUTION)
        .and_then(|field| real(field))
        .unwrap_or(0.0);
    let mut out: Vec<Vec<u8>> = Vec::new();
    let mut sections: Vec<u8> = Vec::new();
    for range in &lines.ranges {
        out.push(bytes[range.clone()].to_vec());
        sections.push(lines.section(range));
    }
    let of = |letter: u8| sections.iter().filter(move |section| **section == letter).count();
    let first = sections.iter().position(|section| *section == b'D')?;
    let mut added: Vec<Vec<u8>> = Vec::new();
    for (sequence, entry) in entries.iter().filter(|(_, entry)| entry.kind == 114) {
        let Some(poles) = poles(entry, resolution) else {
            continue;
        };
        let start = of(b'P') + added.len() + 1;
        let mut text = String::new();
        let mut write = |text: &mut String| {
            let mut line = String::new();
            let _ = write!(
                line,
                "{text:<DATA$} {sequence:>7}P{:>7}",
                of(b'P') + added.len() + 1
            );
            text.clear();
            added.push(line.into_bytes());
        };
        for word in parameters(&poles, separator) {
            if text.len() + word.len() > DATA {
                write(&mut text);
            }
            text.push_str(&word);
        }
        write(&mut text);
        let count = of(b'P') + added.len() + 1 - start;
        for (line, fields) in [
            (sequence - 1, [(0, 128), (1, start)]),
            (sequence, [(0, 128), (3, count)]),
        ] {
            for (column, value) in fields {
                set_field(&mut out[first + line], column, value);
            }
        }
    }
    if added.is_empty() {
        return None;
    }
    let end = sections.iter().position(|section| *section == b'T')?;
    let count = of(b'P') + added.len();
    // The number of lines of parameters, after those of the other sections.
    if let Some(field) = out[end].get_mut(24..32) {
        field.copy_from_slice(format!("P{count:>7}").get(..8)?.as_bytes());
    }
    out.splice(end..end, added);
    debug_assert!(out.iter().all(|line| line.len() > SECTION));
    Some(out.join(&b'\n'))
}
