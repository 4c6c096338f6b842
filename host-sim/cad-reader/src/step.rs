//! STEP (ISO 10303-21): AP203, AP214, AP242.

use std::collections::HashSet;

use crate::format::Reader;
use crate::ir::{self, Stated};
use crate::step_records::{Record, Records, arguments, references};
use crate::step_units::{Units, units};
use cad::CadError;
use cad::Model;
use glam::DVec3;

/// The reader of STEP files.
pub(crate) struct Step;

/// Faces with a surface.
const FACES: [&str; 2] = ["ADVANCED_FACE", "FACE_SURFACE"];
/// Largest nesting depth of parentheses; valid files stay below 10.
const NESTING_MAX: usize = 64;
/// Largest size of an entity, bytes; a B-spline surface with 100000 poles is smaller.
const ENTITY_MAX: usize = 16 << 20;

impl Reader for Step {
    fn format(&self) -> &'static str {
        "STEP"
    }

    fn endings(&self) -> &'static [&'static str] {
        &["step", "stp", "p21"]
    }

    fn recognises(&self, head: &[u8]) -> bool {
        let mut text = head
            .strip_prefix(b"\xef\xbb\xbf")
            .unwrap_or(head)
            .trim_ascii_start();
        // Comments may stand before the first word.
        while let Some(comment) = text.strip_prefix(b"/*") {
            let Some(end) = comment.windows(2).position(|pair| pair == b"*/") else {
                return false;
            };
            text = comment[end + 2..].trim_ascii_start();
        }
        text.starts_with(b"ISO-10303-21;")
    }

    fn check(&self, file: &str, bytes: &[u8]) -> Result<(), CadError> {
        scan(file, bytes)
    }

    fn read(&self, file: &str, bytes: Vec<u8>) -> Result<Model, CadError> {
        let records = Records::new(&bytes);
        let units = units(file, &bytes, &records)?;
        let mut readable = bytes.clone();
        units.only_of_shapes(&mut readable);
        let codec = cadmpeg_codec_step::StepCodec::default();
        ir::decode(file, &codec, &readable, &Text { records, units })
    }
}

/// What the file's text says, for the cross-check.
struct Text<'b> {
    records: Records<'b>,
    units: Units,
}

/// Number of the record with a name such as `#12`.
fn number(entity: &str) -> Option<u64> {
    entity.strip_prefix('#')?.parse().ok()
}

impl Stated for Text<'_> {
    fn point(&self, entity: &str) -> Option<DVec3> {
        self.units.point(&self.records, number(entity)?)
    }

    fn has_unit(&self, entity: &str) -> bool {
        number(entity).is_none_or(|id| self.units.known(id))
    }

    fn boundaries(&self, face: &str) -> Option<usize> {
        let record = self.records.get(number(face)?)?;
        let parts = record.parts();
        let (_, inner) = parts
            .iter()
            .find(|(name, _)| FACES.contains(name) || *name == "FACE")?;
        let words = arguments(inner);
        Some(references(words.iter().find(|word| word.starts_with(b"("))?).len())
    }

    fn faces(&self) -> Vec<String> {
        let is_face = |record: &Record<'_>| {
            let parts = record.parts();
            parts.iter().any(|(name, _)| FACES.contains(name))
        };
        // A face that nothing refers to is of no part.
        let referred: HashSet<u64> = self
            .records
            .iter()
            .flat_map(|(_, record)| record.references())
            .collect();
        let faces = self.records.iter().filter(|(_, record)| is_face(record));
        faces
            .filter(|(id, _)| referred.contains(id))
            .map(|(id, _)| format!("#{id}"))
            .collect()
    }

    fn owner(&self, surface: &str) -> Option<String> {
        let id = number(surface)?;
        let owns = |name: &str| name.ends_with("FACE") || name.ends_with("SURFACE");
        self.records.iter().find_map(|(owner, record)| {
            let parts = record.parts();
            let (name, _) = parts.iter().find(|(name, _)| owns(name))?;
            record
                .references()
                .contains(&id)
                .then(|| format!("#{owner}, {name}"))
        })
    }
}

/// State of the scan.
struct Place {
    /// First byte of the entity.
    entity: usize,
    /// Number of open parentheses.
    open: usize,
    /// Inside of a section.
    section: bool,
}

/// Scans the text once: checks that strings, comments and entities end, parentheses match, and the file is complete.
fn scan(file: &str, bytes: &[u8]) -> Result<(), CadError> {
    let fault = |at: usize, what: &str, remedy: &str| {
        Err(CadError::new(file, what, remedy).at_line(line_of(bytes, at)))
    };
    let again = "the file is truncated or was edited; export it again";
    let mut place = Place {
        entity: 0,
        open: 0,
        section: false,
    };
    let mut at = 0;
    while at < bytes.len() {
        match bytes[at] {
            b'\'' => {
                let Some(end) = bytes[at + 1..].iter().position(|byte| *byte == b'\'') else {
                    return fault(at, "a string has no end", again);
                };
                at += end + 1;
            }
            b'/' if bytes.get(at + 1) == Some(&b'*') => {
                let Some(end) = bytes[at + 2..].windows(2).position(|pair| pair == b"*/") else {
                    return fault(at, "a comment has no end", again);
                };
                at += end + 3;
            }
            b'(' => {
                place.open += 1;
                if place.open > NESTING_MAX {
                    return fault(at, "parentheses are nested too deep", again);
                }
            }
            b')' => {
                if place.open == 0 {
                    return fault(at, "a closing parenthesis has no opening one", again);
                }
                place.open -= 1;
            }
            b';' => {
                if place.open > 0 {
                    return fault(place.entity, "an entity's parentheses are not closed", again);
                }
                let entity = bytes[place.entity..at].trim_ascii();
                if entity == b"DATA" || entity == b"HEADER" {
                    place.section = true;
                } else if entity == b"ENDSEC" {
                    place.section = false;
                } else if entity == b"END-ISO-10303-21" {
                    return Ok(());
                } else if place.section && entity.starts_with(b"#") {
                    entity_numbers(file, bytes, place.entity, at)?;
                }
                place.entity = at + 1;
            }
            _ => {}
        }
        if at.saturating_sub(place.entity) > ENTITY_MAX {
            return fault(place.entity, "an entity is too long", again);
        }
        at += 1;
    }
    fault(bytes.len(), "the file ends before its END-ISO-10303-21", again)
}

/// Checks the numbers of an entity: valid and finite.
fn entity_numbers(file: &str, bytes: &[u8], start: usize, end: usize) -> Result<(), CadError> {
    let text = &bytes[start..end];
    let mut at = 0;
    while at < text.len() {
        let byte = text[at];
        if byte == b'\'' {
            at += text[at + 1..]
                .iter()
                .position(|byte| *byte == b'\'')
                .map_or(text.len(), |end| end + 2);
            continue;
        }
        let begins = byte.is_ascii_digit() || byte == b'-' || byte == b'+';
        let before = at.checked_sub(1).map_or(b',', |before| text[before]);
        if begins && matches!(before, b'(' | b',' | b' ' | b'\n' | b'\r' | b'\t' | b'=') {
            let length = text[at..]
                .iter()
                .position(|byte| matches!(byte, b',' | b')' | b' ' | b'\n' | b'\r' | b'\t' | b'('))
                .unwrap_or(text.len() - at);
            let word = std::str::from_utf8(&text[at..at + length]).unwrap_or("?");
            let value: Result<f64, _> = word.parse();
            if !value.as_ref().is_ok_and(|value| value.is_finite()) {
                let what = format!(
                    "`{}` is not a finite number",
                    word.chars().take(40).collect::<String>()
                );
                let error = CadError::new(file, what, "export the part again, or mend this entity");
                return Err(error.at_line(line_of(bytes, start + at)));
            }
            at += length;
            continue;
        }
        // NaN and infinity, which some programs write instead of numbers.
        if byte.is_ascii_alphabetic() && matches!(before, b'(' | b',' | b' ' | b'\n') {
            let length = text[at..]
                .iter()
                .position(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_');
            let length = length.unwrap_or(text.len() - at);
            let word = text[at..at + length].to_ascii_lowercase();
            if matches!(word.as_slice(), b"nan" | b"inf" | b"infinity" | b"ind") {
                let what = format!("`{}` is not a number", String::from_utf8_lossy(&word));
                let error = CadError::new(file, what, "export the part again, or mend this entity");
                return Err(error.at_line(line_of(bytes, start + at)));
            }
            at += length;
            continue;
        }
        at += 1;
    }
    Ok(())
}

/// Line of a byte, from 1.
pub(crate) fn line_of(bytes: &[u8], at: usize) -> usize {
    bytes[..at.min(bytes.len())]
        .iter()
        .filter(|byte| **byte == b'\n')
        .count()
        + 1
}
