//! Units of a STEP file. Each representation of a shape has a context with its units, and a file may have several contexts; a length is in the
//! unit of the shape that it belongs to. Resolved here from the text, so that what `cadmpeg` scaled can be compared.

use std::collections::{BTreeSet, HashMap};

use cad::CadError;
use glam::DVec3;

use crate::step::line_of;
use crate::step_records::{Record, Records, arguments, real, reference, references};

/// Nesting depth of units that are defined by other units.
const UNITS_MAX: usize = 8;
/// Relative tolerance of two scales: factors have as few as six digits in files.
const SAME: f64 = 1e-5;
/// Units whose name says how long they are, mm.
const NAMED: [(&str, f64); 12] = [
    ("INCH", 25.4),
    ("INCHES", 25.4),
    ("IN", 25.4),
    ("FOOT", 304.8),
    ("FEET", 304.8),
    ("FT", 304.8),
    ("YARD", 914.4),
    ("MILLIMETRE", 1.0),
    ("MILLIMETER", 1.0),
    ("MM", 1.0),
    ("METRE", 1000.0),
    ("METER", 1000.0),
];
/// Prefixes of SI units.
const PREFIXES: [(&[u8], f64); 8] = [
    (b"$", 1.0),
    (b".MICRO.", 1e-6),
    (b".NANO.", 1e-9),
    (b".MILLI.", 1e-3),
    (b".CENTI.", 1e-2),
    (b".DECI.", 1e-1),
    (b".HECTO.", 1e2),
    (b".KILO.", 1e3),
];

/// What a context says of lengths (mm) and plane angles (rad).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Scales {
    length: Option<f64>,
    angle: Option<f64>,
}

/// The length unit of each record, mm.
pub(crate) struct Units {
    /// That of the whole file, if there is one.
    whole: Option<f64>,
    /// Those of the records of each shape, if there are several.
    of: HashMap<u64, f64>,
    /// Context references of representations that only say how a shape is shown, as byte ranges.
    shown_in: Vec<std::ops::Range<usize>>,
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * a.abs().max(b.abs())
}

/// A length unit in words.
fn named(mm: f64) -> String {
    match mm {
        _ if same(mm, 1.0) => "mm".to_owned(),
        _ if same(mm, 25.4) => "inch".to_owned(),
        _ if same(mm, 1000.0) => "m".to_owned(),
        _ => format!("{mm} mm"),
    }
}

fn representation(name: &str) -> bool {
    name == "REPRESENTATION"
        || name.ends_with("_REPRESENTATION")
        || name.contains("_REPRESENTATION_WITH_")
        || name == "DRAUGHTING_MODEL"
}

/// Whether a representation only says how a shape is shown: its items keep the units of their shape.
fn shown(name: &str) -> bool {
    name.replace("REPRESENTATION", "").contains("PRESENTATION") || name.contains("DRAUGHTING")
}

/// Reads units: every error names its record.
struct Reader<'r, 'b> {
    file: &'r str,
    bytes: &'b [u8],
    records: &'r Records<'b>,
}

impl Reader<'_, '_> {
    fn doubt(&self, what: String, at: usize) -> CadError {
        CadError::new(
            self.file,
            what,
            "export the part again with one unit, alone, or in another format",
        )
        .at_line(line_of(self.bytes, at))
    }

    /// Scale of a unit in mm or rad; `None` for other units.
    fn unit(&self, id: u64, depth: usize) -> Result<Scales, CadError> {
        let none = Scales::default();
        let Some(record) = self.records.get(id).filter(|_| depth < UNITS_MAX) else {
            return Ok(none);
        };
        let parts = record.parts();
        let has = |name: &str| parts.iter().any(|(own, _)| *own == name);
        let of = |scale: Option<f64>| Scales {
            length: scale.filter(|_| has("LENGTH_UNIT")).map(|metres| metres * 1000.0),
            angle: scale.filter(|_| has("PLANE_ANGLE_UNIT")),
        };
        if let Some(si) = record.part("SI_UNIT") {
            let words = arguments(si);
            let prefix = words
                .first()
                .and_then(|word| PREFIXES.iter().find(|(name, _)| name == word));
            let known = words
                .get(1)
                .is_some_and(|unit| matches!(*unit, b".METRE." | b".RADIAN."));
            return Ok(of(prefix.filter(|_| known).map(|(_, scale)| *scale)));
        }
        let Some(made) = record.part("CONVERSION_BASED_UNIT") else {
            return Ok(none);
        };
        let words = arguments(made);
        let factor = words.get(1).and_then(|word| self.records.get(reference(word)?));
        let Some((factor, base)) = factor.and_then(|factor| measure(&factor)) else {
            return Ok(none);
        };
        let base = self.unit(base, depth + 1)?;
        let scales = Scales {
            length: base.length.filter(|_| has("LENGTH_UNIT")).map(|mm| mm * factor),
            angle: base
                .angle
                .filter(|_| has("PLANE_ANGLE_UNIT"))
                .map(|rad| rad * factor),
        };
        let name = words.first().map(|word| {
            String::from_utf8_lossy(word)
                .trim_matches('\'')
                .trim()
                .to_uppercase()
        });
        let meant = NAMED.iter().find(|(known, _)| name.as_deref() == Some(known));
        if let (Some(mm), Some((name, meant))) = (scales.length, meant)
            && !same(mm, *meant)
        {
            let what = format!("its unit is named {name}, but is {mm} mm long");
            return Err(self.doubt(what, record.at));
        }
        Ok(scales)
    }

    /// Units of a context.
    fn context(&self, id: u64) -> Result<Scales, CadError> {
        let mut scales = Scales::default();
        let Some(record) = self.records.get(id) else {
            return Ok(scales);
        };
        for unit in record
            .part("GLOBAL_UNIT_ASSIGNED_CONTEXT")
            .map(references)
            .unwrap_or_default()
        {
            let one = self.unit(unit, 0)?;
            for (known, new) in [(&mut scales.length, one.length), (&mut scales.angle, one.angle)] {
                match (*known, new) {
                    (Some(a), Some(b)) if !same(a, b) => {
                        return Err(self.doubt("one context gives two different units".to_owned(), record.at));
                    }
                    (None, Some(_)) => *known = new,
                    _ => {}
                }
            }
        }
        Ok(scales)
    }

    /// The records that a shape consists of; those of a mapped shape have units of their own.
    fn members(&self, items: Vec<u64>, contexts: &HashMap<u64, Scales>) -> BTreeSet<u64> {
        let (mut members, mut open) = (BTreeSet::new(), items);
        while let Some(id) = open.pop() {
            let Some(record) = self.records.get(id).filter(|_| !contexts.contains_key(&id)) else {
                continue;
            };
            let parts = record.parts();
            if parts.iter().any(|(name, _)| representation(name)) || !members.insert(id) {
                continue;
            }
            match parts
                .iter()
                .find(|(name, _)| matches!(*name, "MAPPED_ITEM" | "PCURVE"))
            {
                Some(("MAPPED_ITEM", inner)) => {
                    open.extend(arguments(inner).last().and_then(|word| reference(word)))
                }
                // A curve in parameters has no lengths.
                Some(_) => {}
                None => open.extend(record.references()),
            }
        }
        members
    }
}

/// Value and unit of a measure with its unit.
fn measure(record: &Record<'_>) -> Option<(f64, u64)> {
    let (_, inner) = record
        .parts()
        .into_iter()
        .find(|(name, _)| name.ends_with("MEASURE_WITH_UNIT"))?;
    let words = arguments(inner);
    Some((real(words.first()?)?, reference(words.get(1)?)?))
}

/// Items and context of a representation: the reference last in its arguments, and where it stands.
fn contents<'b>(record: &Record<'b>, bytes: &'b [u8]) -> Option<(Vec<u64>, u64, std::ops::Range<usize>)> {
    let parts = record.parts();
    let (_, inner) = parts
        .iter()
        .find(|(name, inner)| representation(name) && !inner.trim_ascii().is_empty())?;
    let words = arguments(inner);
    let last = words.iter().rev().find(|word| word.starts_with(b"#"))?;
    let items = words.iter().find(|word| word.starts_with(b"("));
    let start = last.as_ptr() as usize - bytes.as_ptr() as usize;
    Some((
        items.map(|items| references(items)).unwrap_or_default(),
        reference(last)?,
        start..start + last.len(),
    ))
}

/// The units of all records.
///
/// # Errors
/// The file has no length unit, a unit whose name and length differ, or a record that belongs to shapes of different units.
pub(crate) fn units(file: &str, bytes: &[u8], records: &Records<'_>) -> Result<Units, CadError> {
    let reader = Reader { file, bytes, records };
    let mut contexts = HashMap::new();
    let mut shapes = Vec::new();
    let mut shown_in = Vec::new();
    for (id, record) in records.iter() {
        let Some((items, context, place)) = contents(&record, bytes) else {
            continue;
        };
        if let std::collections::hash_map::Entry::Vacant(free) = contexts.entry(context) {
            free.insert(reader.context(context)?);
        }
        if record.parts().iter().any(|(name, _)| shown(name)) {
            shown_in.push(place);
        } else {
            shapes.push((id, record.at, items, context));
        }
    }
    let lengths: Vec<f64> = contexts.values().filter_map(|scales| scales.length).collect();
    let angles: Vec<f64> = contexts.values().filter_map(|scales| scales.angle).collect();
    let one = |all: &[f64]| all.iter().all(|scale| same(*scale, all[0]));
    if lengths.is_empty() {
        return Err(CadError::new(
            file,
            "the file has no length unit",
            "export the part again with a unit (mm or inch)",
        ));
    }
    if one(&lengths) && one(&angles) {
        return Ok(Units {
            whole: Some(lengths[0]),
            of: HashMap::new(),
            shown_in: Vec::new(),
        });
    }
    let mut of: HashMap<u64, Scales> = HashMap::new();
    for (id, at, items, context) in shapes {
        let own = contexts.get(&context).copied().unwrap_or_default();
        for member in reader.members(items, &contexts).into_iter().chain([id]) {
            let known = of.entry(member).or_default();
            for (known, own, word) in [
                (&mut known.length, own.length, "length"),
                (&mut known.angle, own.angle, "angle"),
            ] {
                match (*known, own) {
                    (Some(a), Some(b)) if !same(a, b) => {
                        let units = if word == "length" {
                            format!(" ({} and {})", named(a), named(b))
                        } else {
                            String::new()
                        };
                        let what = format!(
                            "record #{member} belongs to shapes with different units of {word}{units}"
                        );
                        return Err(reader.doubt(what, at));
                    }
                    (None, Some(_)) => *known = own,
                    _ => {}
                }
            }
        }
    }
    Ok(Units {
        whole: one(&lengths).then_some(lengths[0]),
        of: of
            .into_iter()
            .filter_map(|(id, scales)| Some((id, scales.length?)))
            .collect(),
        shown_in,
    })
}

impl Units {
    /// The unit of a record, mm.
    fn length(&self, id: u64) -> Option<f64> {
        self.whole.or_else(|| self.of.get(&id).copied())
    }

    /// Removes the contexts of representations that only say how shapes are shown: `cadmpeg` takes the units of a shape that stands in two
    /// contexts for unknown.
    pub(crate) fn only_of_shapes(&self, bytes: &mut [u8]) {
        for place in &self.shown_in {
            if let [first, rest @ ..] = &mut bytes[place.clone()] {
                *first = b'$';
                rest.fill(b' ');
            }
        }
    }

    /// Position of a point as its record says, mm; `None` if it has no unit or is no point of space.
    pub(crate) fn point(&self, records: &Records<'_>, id: u64) -> Option<DVec3> {
        let record = records.get(id)?;
        let words = arguments(record.part("CARTESIAN_POINT")?);
        let list = words.iter().find(|word| word.starts_with(b"("))?;
        let [x, y, z] = arguments(list.strip_prefix(b"(")?.strip_suffix(b")")?)[..] else {
            return None;
        };
        Some(DVec3::new(real(x)?, real(y)?, real(z)?) * self.length(id)?)
    }

    /// Whether a record belongs to a shape with a unit.
    pub(crate) fn known(&self, id: u64) -> bool {
        self.length(id).is_some()
    }
}
