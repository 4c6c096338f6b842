//! IGES (5.3, fixed ASCII), entity 128, and those that are converted to it (118, 120, 122, 190 to 198), trimmed by 143 and 144.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::format::Reader;
use crate::ir;
use cad::CadError;
use cad::Model;

/// The reader of IGES files.
pub(crate) struct Iges;

/// Columns per line, without the line end.
const COLUMNS: usize = 80;
/// Column of the section letter, from 0.
const SECTION: usize = 72;
/// The columns of a directory entry's "entity use" in its status, from 0.
const USE: Range<usize> = 68..70;
/// Largest number of curves of a composite curve.
const CURVES_MAX: usize = 100_000;

/// The lines of a file, without line ends.
struct Lines<'b> {
    bytes: &'b [u8],
    /// Byte range of each line.
    ranges: Vec<Range<usize>>,
}

impl<'b> Lines<'b> {
    fn new(bytes: &'b [u8]) -> Self {
        let mut ranges = Vec::new();
        let mut start = 0;
        for line in bytes.split_inclusive(|byte| *byte == b'\n') {
            let text = line.strip_suffix(b"\n").unwrap_or(line);
            let text = text.strip_suffix(b"\r").unwrap_or(text);
            if !text.trim_ascii().is_empty() {
                ranges.push(start..start + text.len());
            }
            start += line.len();
        }
        Self { bytes, ranges }
    }

    fn section(&self, line: &Range<usize>) -> u8 {
        self.bytes[line.clone()].get(SECTION).copied().unwrap_or(b' ')
    }

    fn of(&self, letter: u8) -> Vec<&Range<usize>> {
        self.ranges
            .iter()
            .filter(|line| self.section(line) == letter)
            .collect()
    }
}

impl Reader for Iges {
    fn format(&self) -> &'static str {
        "IGES"
    }

    fn endings(&self) -> &'static [&'static str] {
        &["igs", "iges"]
    }

    fn recognises(&self, head: &[u8]) -> bool {
        // The first line is of the start section, or of the flag section of a compressed file.
        let line = head.split(|byte| *byte == b'\n').next().unwrap_or_default();
        matches!(line.get(SECTION), Some(b'S' | b'C')) && line.len() <= COLUMNS + 1
    }

    fn check(&self, file: &str, bytes: &[u8]) -> Result<(), CadError> {
        let lines = Lines::new(bytes);
        let again = "the file is truncated or was edited; export it again";
        let fault = |line: usize, what: String| Err(CadError::new(file, what, again).at_line(line));
        let mut last = b'S';
        for (number, line) in lines.ranges.iter().enumerate() {
            let letter = lines.section(line);
            let rank = |letter: u8| b"CSGDPT".iter().position(|known| *known == letter);
            let (Some(now), Some(before)) = (rank(letter), rank(last)) else {
                return fault(
                    number + 1,
                    "column 73 names no section of an IGES file".to_owned(),
                );
            };
            if now < before {
                return fault(
                    number + 1,
                    format!(
                        "section {} comes after section {}",
                        char::from(letter),
                        char::from(last)
                    ),
                );
            }
            last = letter;
            if letter == b'P' {
                check_numbers(file, &bytes[line.clone()], number + 1)?;
            }
        }
        if last != b'T' {
            return fault(
                lines.ranges.len(),
                "the file ends before its terminate section".to_owned(),
            );
        }
        if !lines.of(b'D').len().is_multiple_of(2) {
            return fault(1, "a directory entry has one line instead of two".to_owned());
        }
        Ok(())
    }

    fn read(&self, file: &str, mut bytes: Vec<u8>) -> Result<Model, CadError> {
        mark_parameter_curves(&mut bytes);
        ir::decode(file, &cadmpeg_codec_iges::IgesCodec, bytes)
    }
}

/// Words that some programs write instead of numbers.
fn check_numbers(file: &str, line: &[u8], number: usize) -> Result<(), CadError> {
    let data = &line[..line.len().min(64)];
    for word in data.split(|byte| matches!(byte, b',' | b';')) {
        let word = word.trim_ascii().to_ascii_lowercase();
        let word = word.strip_prefix(b"-").unwrap_or(&word);
        if matches!(
            word,
            b"nan" | b"inf" | b"infinity" | b"1.#ind" | b"1.#qnan" | b"1.#inf"
        ) {
            let what = format!("`{}` is not a number", String::from_utf8_lossy(word));
            let error = CadError::new(file, what, "export the part again, or mend this entity");
            return Err(error.at_line(number));
        }
    }
    Ok(())
}

/// Sets the entity use of parameter curves. The standard (5.3, 2.2.4.4.9.3) requires 05 on the parameter curve of an entity 142;
/// OpenCASCADE and others write 00, and `cadmpeg` then drops the whole trimmed surface.
fn mark_parameter_curves(bytes: &mut [u8]) {
    let lines = Lines::new(bytes);
    let directory: Vec<Range<usize>> = lines.of(b'D').into_iter().cloned().collect();
    let data: Vec<Range<usize>> = lines.of(b'P').into_iter().cloned().collect();
    let field = |line: &Range<usize>, column: usize| -> Option<usize> {
        let text = bytes.get(line.clone())?.get(8 * column..8 * column + 8)?;
        std::str::from_utf8(text).ok()?.trim().parse().ok()
    };
    let kind = |entry: usize| field(directory.get(entry.checked_sub(1)?)?, 0);
    let parameters = |entry: usize| -> Option<Vec<usize>> {
        let first = field(directory.get(entry.checked_sub(1)?)?, 1)?;
        let count = field(directory.get(entry)?, 3)?;
        let mut words = Vec::new();
        for line in data.get(first.checked_sub(1)?..first.checked_sub(1)?.checked_add(count)?)? {
            let text = bytes.get(line.start..line.start + 64)?;
            let text = std::str::from_utf8(text).ok()?;
            words.extend(
                text.split([',', ';'])
                    .map(|word| word.trim().parse().unwrap_or(0)),
            );
        }
        Some(words)
    };
    let mut marked = BTreeSet::new();
    for entry in (1..=directory.len())
        .step_by(2)
        .filter(|entry| kind(*entry) == Some(142))
    {
        let Some(curve) = parameters(entry).and_then(|words| words.get(3).copied()) else {
            continue;
        };
        let mut wanted = vec![curve];
        while let Some(curve) = wanted.pop() {
            if curve == 0 || marked.len() > CURVES_MAX || !marked.insert(curve) {
                continue;
            }
            if kind(curve) == Some(102) {
                let members = parameters(curve).unwrap_or_default();
                let count = members.get(1).copied().unwrap_or(0);
                wanted.extend(members.iter().skip(2).take(count));
            }
        }
    }
    for entry in marked {
        let Some(line) = entry.checked_sub(1).and_then(|index| directory.get(index)) else {
            continue;
        };
        let place = line.start + USE.start..line.start + USE.end;
        if entry % 2 == 1 && place.end <= line.end {
            bytes[place].copy_from_slice(b"05");
        }
    }
}
