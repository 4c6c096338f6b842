//! IGES (5.3, fixed ASCII), entity 128, and those that are converted to it (118, 120, 122, 190 to 198), trimmed by 143 and 144.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::format::Reader;
use crate::iges_entries::{COLUMNS, Entries, Lines, SECTION, globals};
use crate::iges_spline::converted;
use crate::ir::{self, Stated};
use cad::CadError;
use cad::Model;

/// The reader of IGES files.
pub(crate) struct Iges;

/// Bounded surface, trimmed surface, face.
const FACES: [usize; 3] = [143, 144, 510];
/// The columns of a directory entry's "entity use" in its status, from 0.
const USE: Range<usize> = 68..70;
/// Largest number of curves of a composite curve.
const CURVES_MAX: usize = 100_000;

/// Names of the units flags (5.3, 2.2.4.3.14), as other programs write them too.
const UNITS: [(&str, &[&str]); 10] = [
    ("1", &["IN", "INCH", "INCHES"]),
    (
        "2",
        &["MM", "MILLIMETER", "MILLIMETERS", "MILLIMETRE", "MILLIMETRES"],
    ),
    ("4", &["FT", "FEET", "FOOT"]),
    ("5", &["MI", "MILE", "MILES"]),
    ("6", &["M", "METER", "METERS", "METRE", "METRES"]),
    ("7", &["KM", "KILOMETER", "KILOMETERS"]),
    ("8", &["MIL", "MILS"]),
    ("9", &["UM", "MICRON", "MICRONS"]),
    ("10", &["CM", "CENTIMETER", "CENTIMETERS"]),
    ("11", &["UIN", "MICROINCH", "MICROINCHES"]),
];
/// Index of the units flag in the global section; the unit's name follows.
const UNITS_FLAG: usize = 13;

/// What the file's text says, for the cross-check.
struct Text(Entries);

/// Sequence number of the entry with a name such as `D12`.
fn sequence(entity: &str) -> Option<usize> {
    let digits: String = entity.chars().filter(char::is_ascii_digit).collect();
    digits.parse().ok()
}

impl Stated for Text {
    fn boundaries(&self, face: &str) -> Option<usize> {
        self.0.boundaries(sequence(face)?)
    }

    fn faces(&self) -> Vec<String> {
        let faces = self.0.iter().filter(|(_, entry)| FACES.contains(&entry.kind));
        faces.map(|(sequence, _)| format!("D{sequence}")).collect()
    }

    fn owner(&self, surface: &str) -> Option<String> {
        self.0.owner(sequence(surface)?)
    }
}

/// Checks that the units flag and the unit's name are of one unit.
fn check_unit(file: &str, lines: &Lines<'_>) -> Result<(), CadError> {
    let fields = globals(lines);
    let of = |index: usize| fields.get(index).map_or("", String::as_str);
    let doubt = |what: String| {
        let line = lines.ranges.iter().position(|line| lines.section(line) == b'G');
        Err(
            CadError::new(file, what, "export the part again with its unit (mm or inch)")
                .at_line(line.unwrap_or(0) + 1),
        )
    };
    let (flag, name) = (of(UNITS_FLAG), of(UNITS_FLAG + 1).to_uppercase());
    if !flag.is_empty() && flag != "3" && !UNITS.iter().any(|(known, _)| *known == flag) {
        return doubt(format!(
            "the file's unit is in doubt: there is no units flag `{flag}`"
        ));
    }
    let meant = UNITS.iter().find(|(_, names)| names.contains(&name.as_str()));
    match meant {
        // Without a flag the unit is the inch.
        Some((known, _)) if *known != if flag.is_empty() { "1" } else { flag } && flag != "3" => doubt(
            format!("the file's unit is in doubt: its units flag is `{flag}`, but the unit's name `{name}`"),
        ),
        _ => Ok(()),
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
        check_unit(file, &lines)
    }

    fn read(&self, file: &str, mut bytes: Vec<u8>) -> Result<Model, CadError> {
        let entries = Entries::new(&Lines::new(&bytes));
        mark_parameter_curves(&mut bytes, &entries);
        let bytes = converted(&bytes, &entries).unwrap_or(bytes);
        ir::decode(file, &cadmpeg_codec_iges::IgesCodec, &bytes, &Text(entries))
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
fn mark_parameter_curves(bytes: &mut [u8], entries: &Entries) {
    let mut marked = BTreeSet::new();
    for (_, entry) in entries.iter().filter(|(_, entry)| entry.kind == 142) {
        let Some(curve) = entry.whole(3) else {
            continue;
        };
        let mut wanted = vec![curve];
        while let Some(curve) = wanted.pop() {
            if curve == 0 || marked.len() > CURVES_MAX || !marked.insert(curve) {
                continue;
            }
            if let Some(composite) = entries.get(curve).filter(|entry| entry.kind == 102) {
                let count = composite.whole(1).unwrap_or(0).min(composite.words.len());
                wanted.extend((2..2 + count).filter_map(|index| composite.whole(index)));
            }
        }
    }
    for entry in marked.into_iter().filter_map(|sequence| entries.get(sequence)) {
        let place = entry.line.start + USE.start..entry.line.start + USE.end;
        if place.end <= entry.line.end {
            bytes[place].copy_from_slice(b"05");
        }
    }
}
