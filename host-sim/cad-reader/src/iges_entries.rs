//! The directory and the parameters of an IGES file as text (5.3, 2.2.4.4 and 2.2.4.5): enough to cross-check what `cadmpeg` made of them.

use std::collections::HashMap;
use std::ops::Range;

/// Columns per line, without the line end.
pub(crate) const COLUMNS: usize = 80;
/// Column of the section letter, from 0.
pub(crate) const SECTION: usize = 72;
/// Width of a field of the directory.
const FIELD: usize = 8;
/// The columns of a line of parameters that hold data.
const DATA: usize = 64;
/// The columns of a directory entry's "subordinate entity switch" in its status, from 0.
const SUBORDINATE: Range<usize> = 66..68;

/// The lines of a file, without line ends.
pub(crate) struct Lines<'b> {
    pub(crate) bytes: &'b [u8],
    /// Byte range of each line.
    pub(crate) ranges: Vec<Range<usize>>,
}

impl<'b> Lines<'b> {
    pub(crate) fn new(bytes: &'b [u8]) -> Self {
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

    pub(crate) fn section(&self, line: &Range<usize>) -> u8 {
        self.bytes[line.clone()].get(SECTION).copied().unwrap_or(b' ')
    }

    pub(crate) fn of(&self, letter: u8) -> Vec<&Range<usize>> {
        self.ranges
            .iter()
            .filter(|line| self.section(line) == letter)
            .collect()
    }

    /// The data columns of a section's lines, one after another.
    fn text(&self, letter: u8, columns: usize) -> Vec<u8> {
        let lines = self.of(letter).into_iter();
        lines
            .flat_map(|line| self.bytes[line.clone()].iter().take(columns).copied())
            .collect()
    }
}

/// Fields of the global section (5.3, 2.2.4.3), without delimiters; strings without their `nH`.
pub(crate) fn globals(lines: &Lines<'_>) -> Vec<String> {
    let text = lines.text(b'G', SECTION);
    // The first two fields are the delimiters, which may be left out.
    let given = |at: usize| match text.get(at..at + 3) {
        Some([b'1', b'H', byte]) => Some(*byte),
        _ => None,
    };
    let field = given(0).unwrap_or(b',');
    let record = given(if given(0).is_some() { 4 } else { 1 }).unwrap_or(b';');
    let (mut fields, mut at) = (Vec::new(), 0);
    while at < text.len() {
        let rest = &text[at..];
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let length: Option<usize> = std::str::from_utf8(&rest[..digits])
            .ok()
            .and_then(|word| word.parse().ok());
        let (value, end) = match length {
            Some(length) if rest.get(digits) == Some(&b'H') => {
                let start = digits + 1;
                let end = start.saturating_add(length).min(rest.len());
                (&rest[start..end], end)
            }
            _ => {
                let end = rest.iter().position(|byte| *byte == field || *byte == record);
                let end = end.unwrap_or(rest.len());
                (&rest[..end], end)
            }
        };
        fields.push(String::from_utf8_lossy(value).trim().to_owned());
        let after = rest[end..]
            .iter()
            .position(|byte| *byte == field || *byte == record);
        match after.and_then(|after| rest.get(end + after)) {
            Some(byte) if *byte == field => at += end + after.unwrap_or(0) + 1,
            _ => break,
        }
    }
    fields
}

/// One entry of the directory.
pub(crate) struct Entry {
    /// Entity type number.
    pub(crate) kind: usize,
    /// Physically dependent on another entity.
    pub(crate) dependent: bool,
    /// Byte range of its first line.
    pub(crate) line: Range<usize>,
    /// Its parameters; the first is the type number.
    pub(crate) words: Vec<String>,
}

impl Entry {
    /// A parameter that is a whole number: a pointer, a count.
    pub(crate) fn whole(&self, index: usize) -> Option<usize> {
        self.words.get(index)?.parse().ok()
    }
}

/// The directory, by the sequence numbers of the entries' first lines.
pub(crate) struct Entries {
    all: HashMap<usize, Entry>,
    order: Vec<usize>,
}

impl Entries {
    /// Reads the directory; entries that do not fit the format are left out.
    pub(crate) fn new(lines: &Lines<'_>) -> Self {
        let directory = lines.of(b'D');
        let data = lines.of(b'P');
        let delimiters = match globals(lines).first() {
            Some(first) if first.len() == 1 => first.clone(),
            _ => ",".to_owned(),
        };
        let field = |line: &Range<usize>, column: usize| -> Option<usize> {
            let text = lines.bytes.get(line.clone())?;
            let text = text.get(FIELD * column..FIELD * column + FIELD)?;
            std::str::from_utf8(text).ok()?.trim().parse().ok()
        };
        let words = |first: usize, count: usize| -> Option<Vec<String>> {
            let start = first.checked_sub(1)?;
            let mut text = String::new();
            for line in data.get(start..start.checked_add(count)?)? {
                let columns = lines.bytes.get(line.start..(line.start + DATA).min(line.end))?;
                text.push_str(&String::from_utf8_lossy(columns));
            }
            let separator = |c: char| delimiters.contains(c) || c == ';';
            Some(text.split(separator).map(|word| word.trim().to_owned()).collect())
        };
        let (mut all, mut order) = (HashMap::new(), Vec::new());
        for (index, pair) in directory.chunks_exact(2).enumerate() {
            let sequence = 2 * index + 1;
            let entry = || {
                let status = lines.bytes.get(pair[0].clone())?.get(SUBORDINATE)?;
                Some(Entry {
                    kind: field(pair[0], 0)?,
                    dependent: matches!(status, b"01" | b" 1" | b"03" | b" 3"),
                    line: pair[0].clone(),
                    words: words(field(pair[0], 1)?, field(pair[1], 3)?)?,
                })
            };
            if let Some(entry) = entry() {
                all.insert(sequence, entry);
                order.push(sequence);
            }
        }
        Self { all, order }
    }

    /// An entry by its sequence number.
    pub(crate) fn get(&self, sequence: usize) -> Option<&Entry> {
        self.all.get(&sequence)
    }

    /// All entries in the order of the file.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, &Entry)> + '_ {
        self.order
            .iter()
            .filter_map(|sequence| Some((*sequence, self.get(*sequence)?)))
    }

    /// Number of boundaries of a trimmed surface or face.
    pub(crate) fn boundaries(&self, sequence: usize) -> Option<usize> {
        let entry = self.get(sequence)?;
        match entry.kind {
            // Outer boundary given or that of the surface; then the inner ones.
            144 => Some(entry.whole(2)?.min(1) + entry.whole(3)?),
            143 => entry.whole(3),
            510 => entry.whole(2),
            _ => None,
        }
    }

    /// The entity that trims a surface or derives from it, in words.
    pub(crate) fn owner(&self, sequence: usize) -> Option<String> {
        let points_at = |entry: &Entry| match entry.kind {
            144 | 510 => entry.whole(1) == Some(sequence),
            143 => entry.whole(2) == Some(sequence),
            140 => entry.whole(5) == Some(sequence),
            _ => false,
        };
        let by_pointer = self.iter().find(|(_, entry)| points_at(entry));
        match by_pointer {
            Some((owner, entry)) => Some(format!("D{owner}, entity type {}", entry.kind)),
            None => self
                .get(sequence)?
                .dependent
                .then(|| "another entity, on which it depends".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn global_fields() {
        for (text, unit, name) in [
            (
                "1H,,1H;,4Ha,b;,1Hx,,,32,38,6,308,15,,1.,2,2HMM,1,0.01;",
                "2",
                "MM",
            ),
            (
                ",,8HStudio 5,1Hx,1Hy,1H5,32,38,6,38,15,1Hz,1.,1,2HIN,,0.016;",
                "1",
                "IN",
            ),
            (
                "1H//1H!/1Hx/1Hy/1Hz/1Hw/32/38/6/38/15/1Hz/1./10/2HCM//0.016!",
                "10",
                "CM",
            ),
        ] {
            let lines: String = text
                .as_bytes()
                .chunks(SECTION)
                .map(|part| format!("{:<72}G0000001\n", String::from_utf8_lossy(part)))
                .collect();
            let fields = globals(&Lines::new(lines.as_bytes()));
            assert_eq!(
                (fields[13].as_str(), fields[14].as_str()),
                (unit, name),
                "{fields:?}"
            );
        }
    }
}
