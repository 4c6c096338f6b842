//! The records of a STEP file's data sections by their numbers, as text: enough to cross-check what `cadmpeg` made of them.

use std::collections::HashMap;
use std::ops::Range;

/// The records of a file.
pub(crate) struct Records<'b> {
    bytes: &'b [u8],
    /// Byte range of each record after its `=`, without the semicolon.
    ranges: HashMap<u64, Range<usize>>,
    /// Numbers in the order of the file.
    order: Vec<u64>,
}

/// One record.
#[derive(Clone, Copy)]
pub(crate) struct Record<'b> {
    /// The text after `=`.
    pub(crate) text: &'b [u8],
    /// Offset of the text in the file.
    pub(crate) at: usize,
}

/// Offset after the string that begins at `at`.
fn after_string(text: &[u8], at: usize) -> usize {
    let rest = text.get(at + 1..).unwrap_or_default();
    at + 2 + rest.iter().position(|byte| *byte == b'\'').unwrap_or(rest.len())
}

/// Offset after the string or comment that begins at `at`; `None` if none does.
fn skipped(text: &[u8], at: usize) -> Option<usize> {
    match text.get(at..at + 2)? {
        [b'\'', _] => Some(after_string(text, at)),
        b"/*" => {
            let rest = &text[at + 2..];
            let end = rest.windows(2).position(|pair| pair == b"*/");
            Some(end.map_or(text.len(), |end| at + end + 4))
        }
        _ => None,
    }
}

fn name_byte(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

/// The number after a `#`, and the offset after it.
fn number(text: &[u8], at: usize) -> Option<(u64, usize)> {
    let digits = text[at..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let word = std::str::from_utf8(&text[at..at + digits]).ok()?;
    Some((word.parse().ok()?, at + digits))
}

impl<'b> Records<'b> {
    /// Reads the records of a file that the scan of `step.rs` has passed.
    pub(crate) fn new(bytes: &'b [u8]) -> Self {
        let (mut ranges, mut order) = (HashMap::new(), Vec::new());
        let (mut start, mut at) = (0, 0);
        while at < bytes.len() {
            if let Some(after) = skipped(bytes, at) {
                at = after;
                continue;
            }
            if bytes[at] == b';' {
                if let Some((id, range)) = numbered(bytes, start..at) {
                    ranges.insert(id, range);
                    order.push(id);
                }
                start = at + 1;
            }
            at += 1;
        }
        Self { bytes, ranges, order }
    }

    /// A record by its number.
    pub(crate) fn get(&self, id: u64) -> Option<Record<'b>> {
        let range = self.ranges.get(&id)?.clone();
        Some(Record {
            at: range.start,
            text: &self.bytes[range],
        })
    }

    /// All records in the order of the file.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u64, Record<'b>)> + '_ {
        self.order.iter().filter_map(|id| Some((*id, self.get(*id)?)))
    }
}

/// Number and text of the record in a range of bytes, which may begin with comments.
fn numbered(bytes: &[u8], range: Range<usize>) -> Option<(u64, Range<usize>)> {
    let mut at = range.start;
    while at < range.end {
        if let Some(after) = skipped(bytes, at) {
            at = after;
        } else if bytes[at].is_ascii_whitespace() {
            at += 1;
        } else {
            break;
        }
    }
    if bytes.get(at) != Some(&b'#') {
        return None;
    }
    let (id, after) = number(bytes, at + 1)?;
    let equals = bytes[after..range.end].iter().position(|byte| *byte == b'=')?;
    Some((id, after + equals + 1..range.end))
}

impl<'b> Record<'b> {
    /// The entity names: one, or those of a complex record `( A(...) B(...) )`, each with its arguments in parentheses.
    pub(crate) fn parts(&self) -> Vec<(&'b str, &'b [u8])> {
        let text = self.text;
        // The names of a complex record stand within one parenthesis.
        let complex = text.trim_ascii_start().starts_with(b"(");
        let own = u32::from(complex);
        let (mut parts, mut at, mut open) = (Vec::new(), 0, 0_u32);
        let mut inside = 0;
        let mut name = 0..0;
        while at < text.len() {
            if let Some(after) = skipped(text, at) {
                at = after;
                continue;
            }
            match text[at] {
                b'(' => {
                    if open == own {
                        inside = at + 1;
                    }
                    open += 1;
                }
                b')' => {
                    open = open.saturating_sub(1);
                    if open == own && !name.is_empty() {
                        let word = std::str::from_utf8(&text[name.clone()]).unwrap_or_default();
                        parts.push((word, &text[inside..at]));
                        name = 0..0;
                    }
                }
                byte if open == own && name_byte(byte) => {
                    let length = text[at..].iter().take_while(|byte| name_byte(**byte)).count();
                    name = at..at + length;
                    at += length;
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
        parts
    }

    /// The arguments of one of its names.
    pub(crate) fn part(&self, name: &str) -> Option<&'b [u8]> {
        let parts = self.parts();
        parts
            .into_iter()
            .find(|(own, _)| *own == name)
            .map(|(_, arguments)| arguments)
    }

    /// All records that it refers to.
    pub(crate) fn references(&self) -> Vec<u64> {
        references(self.text)
    }
}

/// The records that a text refers to.
pub(crate) fn references(text: &[u8]) -> Vec<u64> {
    let (mut found, mut at) = (Vec::new(), 0);
    while at < text.len() {
        if let Some(after) = skipped(text, at) {
            at = after;
            continue;
        }
        if let Some((id, after)) = (text[at] == b'#').then(|| number(text, at + 1)).flatten() {
            found.push(id);
            at = after;
            continue;
        }
        at += 1;
    }
    found
}

/// The arguments of a list, separated by commas outside of parentheses.
pub(crate) fn arguments(text: &[u8]) -> Vec<&[u8]> {
    let (mut found, mut at, mut start, mut open) = (Vec::new(), 0, 0, 0_u32);
    while at < text.len() {
        if let Some(after) = skipped(text, at) {
            at = after;
            continue;
        }
        match text[at] {
            b'(' => open += 1,
            b')' => open = open.saturating_sub(1),
            b',' if open == 0 => {
                found.push(text[start..at].trim_ascii());
                start = at + 1;
            }
            _ => {}
        }
        at += 1;
    }
    found.push(text[start..].trim_ascii());
    found
}

/// The one record that an argument refers to.
pub(crate) fn reference(argument: &[u8]) -> Option<u64> {
    match references(argument).as_slice() {
        [one] => Some(*one),
        _ => None,
    }
}

/// The first number in an argument, which may be typed: `LENGTH_MEASURE(2.54)`.
pub(crate) fn real(argument: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(argument).ok()?;
    let text = text.split_once('(').map_or(text, |(_, inner)| inner);
    text.trim_end_matches(')').trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &[u8] = b"DATA;\n/* #1=NO(); */ #1 = A('it''s #9; (',#2,(#3,4.)) ;\n#2=(B(1.)C()D(*,E(2.54),#7));#x=F();\nENDSEC;";

    #[test]
    fn records_are_split_as_the_standard_says() {
        let records = Records::new(TEXT);
        assert_eq!(records.iter().map(|(id, _)| id).collect::<Vec<_>>(), [1, 2]);
        let first = records.get(1).unwrap();
        assert_eq!(first.references(), [2, 3]);
        let [(name, inner)] = first.parts()[..] else {
            panic!("one name")
        };
        assert_eq!(name, "A");
        assert_eq!(arguments(inner), [&b"'it''s #9; ('"[..], b"#2", b"(#3,4.)"]);
        let second = records.get(2).unwrap();
        let names: Vec<_> = second.parts().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["B", "C", "D"]);
        let last = arguments(second.part("D").unwrap());
        assert_eq!(
            (last[0], real(last[1]), reference(last[2])),
            (&b"*"[..], Some(2.54), Some(7))
        );
    }
}
