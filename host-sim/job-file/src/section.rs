//! Typed values from spanned TOML tables. A value of the wrong type or range becomes an error at its location.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use job::{JobError, Origin, units};

/// Largest edit distance (insert, delete, replace) between an unknown key and a suggested one, as a share of the length: beyond a third
/// a suggestion misleads.
const SUGGESTION_SHARE: usize = 3;

/// The text of a job file.
#[derive(Clone, Copy)]
pub(super) struct Reader<'t> {
    name: &'t str,
    text: &'t str,
}

impl<'t> Reader<'t> {
    pub(super) fn new(name: &'t str, text: &'t str) -> Self {
        Self { name, text }
    }

    /// The whole document as the unnamed top section.
    pub(super) fn document(self) -> Result<Section<'t>, JobError> {
        match DeTable::parse(self.text) {
            Ok(table) => Ok(Section {
                reader: self,
                name: String::new(),
                head: 0..0,
                table: table.into_inner(),
            }),
            Err(cause) => {
                let what = format!("not valid TOML: {}", cause.message());
                let remedy = "write `key = value` under `[section]`; lists in `[ , ]`, texts in quotes";
                Err(self.error(cause.span().unwrap_or(0..0), what, remedy))
            }
        }
    }

    /// Byte range of each section and of each of its keys.
    pub(super) fn origin(self, document: &Section<'_>) -> Origin {
        let mut keys = BTreeMap::new();
        for (section, value) in &document.table {
            keys.insert(section.get_ref().to_string(), section.span());
            if let DeValue::Table(table) = value.get_ref() {
                for (key, value) in table {
                    keys.insert(format!("{}.{}", section.get_ref(), key.get_ref()), value.span());
                }
            }
        }
        Origin::new(self.name, self.text, keys)
    }

    fn error(self, span: Range<usize>, what: impl Into<String>, remedy: impl Into<String>) -> JobError {
        JobError::at(self.name, self.text, span, what.into(), remedy.into())
    }
}

/// One table of the file.
pub(super) struct Section<'t> {
    reader: Reader<'t>,
    name: String,
    head: Range<usize>,
    table: DeTable<'t>,
}

impl<'t> Section<'t> {
    /// Fails on the first key, in the order of the file, that is not in `known`; `elsewhere` gives the message for keys that are valid
    /// in other sections or kinds.
    pub(super) fn only(&self, known: &[&str], elsewhere: &[(&str, &str)]) -> Result<(), JobError> {
        let stranger = self
            .table
            .keys()
            .filter(|key| !known.contains(&key.get_ref().as_ref()))
            .min_by_key(|k| k.span().start);
        let Some(stranger) = stranger else { return Ok(()) };
        let key = stranger.get_ref().as_ref();
        if let Some((_, reason)) = elsewhere.iter().find(|(name, _)| *name == key) {
            let what = format!("`{key}` does not belong here: {reason}");
            return Err(self.reader.error(
                stranger.span(),
                what,
                format!("remove it; the keys here are {}", list(known)),
            ));
        }
        let word = if self.name.is_empty() { "section" } else { "key" };
        let what = match nearest(key, known) {
            Some(near) => format!("unknown {word} `{key}`; did you mean `{near}`?"),
            None => format!("unknown {word} `{key}`"),
        };
        let place = if self.name.is_empty() {
            "this file".to_owned()
        } else {
            format!("[{}]", self.name)
        };
        Err(self.reader.error(
            stranger.span(),
            what,
            format!("the {word}s of {place} are {}", list(known)),
        ))
    }

    /// The section of this name; an error if it is missing.
    pub(super) fn section(&self, name: &str) -> Result<Section<'t>, JobError> {
        self.optional_section(name)?.ok_or_else(|| {
            let end = self.reader.text.len();
            let remedy = format!("add the section `[{name}]`; jobs/revolved.toml is a complete job");
            self.reader
                .error(end..end, format!("the section `[{name}]` is missing"), remedy)
        })
    }

    /// The section of this name, if the file has it.
    pub(super) fn optional_section(&self, name: &str) -> Result<Option<Section<'t>>, JobError> {
        let Some((key, value)) = self.table.get_key_value(name) else {
            return Ok(None);
        };
        let DeValue::Table(table) = value.get_ref() else {
            let what = format!("`{name}` must be a section, not {}", kind_of(value.get_ref()));
            return Err(self.reader.error(
                value.span(),
                what,
                format!("write `[{name}]` on a line of its own"),
            ));
        };
        let head = key.span();
        Ok(Some(Section {
            reader: self.reader,
            name: name.to_owned(),
            head,
            table: table.clone(),
        }))
    }

    /// The sections of this name in an array of sections (`[[name]]`), in order; `name` and number are their name in errors.
    pub(super) fn sections(&self, name: &str) -> Result<Vec<Section<'t>>, JobError> {
        let Some((key, value)) = self.table.get_key_value(name) else {
            return Ok(Vec::new());
        };
        let remedy = format!("write `[[{name}]]` on a line of its own, once for each");
        let DeValue::Array(array) = value.get_ref() else {
            let what = format!(
                "`{name}` must be a list of sections, not {}",
                kind_of(value.get_ref())
            );
            return Err(self.reader.error(key.span(), what, remedy));
        };
        let section = |(index, entry): (usize, &Spanned<DeValue<'t>>)| match entry.get_ref() {
            DeValue::Table(table) => Ok(Section {
                reader: self.reader,
                name: format!("{name} {}", index + 1),
                head: entry.span(),
                table: table.clone(),
            }),
            other => Err(self.reader.error(
                entry.span(),
                format!("`{name}` {} must be a section, not {}", index + 1, kind_of(other)),
                remedy.clone(),
            )),
        };
        array.iter().enumerate().map(section).collect()
    }

    /// The tables of a key whose value is a table or a list of tables.
    pub(super) fn tables(&self, key: &str, example: &str) -> Result<Vec<Section<'t>>, JobError> {
        let value = self.value(key)?;
        let entries = match value.get() {
            DeValue::Array(_) => value.list("part")?,
            _ => vec![value],
        };
        let table = |entry: Value<'_, 't>| match entry.get() {
            DeValue::Table(table) => Ok(Section {
                reader: self.reader,
                name: entry.path.replace('`', ""),
                head: entry.value.span(),
                table: table.clone(),
            }),
            other => Err(entry.error(
                &format!("must be a table, not {}", kind_of(other)),
                format!("write {key} = {example}, or a list of those from the face upwards"),
            )),
        };
        entries.into_iter().map(table).collect()
    }

    /// Whether the key is present.
    pub(super) fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// An error at the key's value, or at the section's header if the key is missing.
    pub(super) fn error(&self, key: &str, what: impl Into<String>, remedy: impl Into<String>) -> JobError {
        let span = self
            .table
            .get(key)
            .map_or_else(|| self.head.clone(), Spanned::span);
        self.reader.error(span, what, remedy)
    }

    /// The value of a required key.
    pub(super) fn value(&self, key: &str) -> Result<Value<'_, 't>, JobError> {
        match self.table.get(key) {
            Some(value) => Ok(Value {
                reader: self.reader,
                value,
                path: format!("`{key}`"),
            }),
            None => {
                let what = format!("`{key}` is missing in [{}]", self.name);
                Err(self.reader.error(
                    self.head.clone(),
                    what,
                    format!("add `{key} = ...` below `[{}]`", self.name),
                ))
            }
        }
    }

    /// A finite number.
    pub(super) fn number(&self, key: &str) -> Result<f64, JobError> {
        self.value(key)?.number()
    }

    /// A number above `least` and not above `most`.
    pub(super) fn number_within(
        &self,
        key: &str,
        least: f64,
        most: f64,
        want: &str,
    ) -> Result<f64, JobError> {
        let value = self.number(key)?;
        if value > least && value <= most {
            return Ok(value);
        }
        let what = format!("`{key}` must be above {least} and at most {most}, not {value}");
        Err(self.error(key, what, format!("give {want}")))
    }

    /// One of the listed texts, as the value paired with it.
    pub(super) fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Result<T, JobError> {
        let value = self.value(key)?;
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        let remedy = format!("write {}", list_quoted(&names));
        let DeValue::String(text) = value.value.get_ref() else {
            let what = format!(
                "`{key}` must be a text in quotes, not {}",
                kind_of(value.value.get_ref())
            );
            return Err(self.error(key, what, remedy));
        };
        match choices.iter().find(|(name, _)| *name == text.as_ref()) {
            Some((_, choice)) => Ok(*choice),
            None => {
                let hint =
                    nearest(text, &names).map_or(String::new(), |near| format!("; did you mean \"{near}\"?"));
                Err(self.error(key, format!("`{key}` cannot be \"{text}\"{hint}"), remedy))
            }
        }
    }

    /// The job file's name.
    pub(super) fn file(&self) -> &str {
        self.reader.name
    }

    /// A text value.
    pub(super) fn text(&self, key: &str) -> Result<String, JobError> {
        match self.value(key)?.value.get_ref() {
            DeValue::String(text) => Ok(text.to_string()),
            other => Err(self.error(
                key,
                format!("`{key}` must be a text in quotes, not {}", kind_of(other)),
                format!("write {key} = \"...\""),
            )),
        }
    }

    /// A Boolean, false by default.
    pub(super) fn switch(&self, key: &str) -> Result<bool, JobError> {
        if !self.has(key) {
            return Ok(false);
        }
        match self.value(key)?.value.get_ref() {
            DeValue::Boolean(on) => Ok(*on),
            other => Err(self.error(
                key,
                format!("`{key}` must be true or false, not {}", kind_of(other)),
                format!("write {key} = true, or leave it out"),
            )),
        }
    }

    /// Machine positions, mm.
    pub(super) fn positions<const N: usize>(&self, key: &str) -> Result<[f64; N], JobError> {
        let positions = self.numbers(key)?;
        self.check_positions(key, &positions)?;
        Ok(positions)
    }

    /// Checks that lengths in mm are within the range of the machine's positions.
    pub(super) fn check_positions(&self, key: &str, lengths_mm: &[f64]) -> Result<(), JobError> {
        match lengths_mm.iter().find(|mm| units::nanometres(**mm).is_none()) {
            Some(mm) => Err(self.error(
                key,
                format!("`{key}` reaches {mm} mm; {}", units::POSITION_RANGE),
                "give a length in mm within that range",
            )),
            None => Ok(()),
        }
    }

    /// `N` numbers.
    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], JobError> {
        self.value(key)?.numbers()
    }

    /// `R` rows of `N` numbers.
    pub(super) fn matrix<const R: usize, const N: usize>(
        &self,
        key: &str,
    ) -> Result<[[f64; N]; R], JobError> {
        self.value(key)?.matrix()
    }

    /// Three numbers above 0, if the key is present.
    pub(super) fn positive_axes(&self, key: &str, want: &str) -> Result<Option<[f64; 3]>, JobError> {
        if !self.has(key) {
            return Ok(None);
        }
        let axes: [f64; 3] = self.numbers(key)?;
        match axes.iter().find(|value| **value <= 0.0) {
            Some(value) => Err(self.error(
                key,
                format!("`{key}` must be above 0, not {value}"),
                format!("give {want}"),
            )),
            None => Ok(Some(axes)),
        }
    }
}

/// A value with its location and its name (`` `poles_mm` row 2, column 3 ``).
#[derive(Clone)]
pub(super) struct Value<'v, 't> {
    reader: Reader<'t>,
    value: &'v Spanned<DeValue<'t>>,
    path: String,
}

impl<'v, 't> Value<'v, 't> {
    /// An error at this value; `what` follows the value's name in the message.
    pub(super) fn error(&self, what: &str, remedy: impl Into<String>) -> JobError {
        self.reader
            .error(self.value.span(), format!("{} {what}", self.path), remedy)
    }

    /// The value as written in the file.
    pub(super) fn get(&self) -> &DeValue<'t> {
        self.value.get_ref()
    }

    /// A finite number, written as an integer or with a point.
    pub(super) fn number(&self) -> Result<f64, JobError> {
        let number = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
            DeValue::Integer(integer) =>
            {
                #[expect(
                    clippy::cast_precision_loss,
                    reason = "a number is wanted as f64, exact up to 2^53"
                )]
                i64::from_str_radix(integer.as_str(), integer.radix())
                    .ok()
                    .map(|whole| whole as f64)
            }
            other => {
                return Err(self.error(
                    &format!("must be a number, not {}", kind_of(other)),
                    "write a number, e.g. 2.5",
                ));
            }
        };
        match number.filter(|number| number.is_finite()) {
            Some(number) => Ok(number),
            None => Err(self.error(
                "must be a finite number",
                "write a number without `inf`, `nan` or a huge exponent",
            )),
        }
    }

    /// The entries of a list; `entry` is their name in errors.
    pub(super) fn list(&self, entry: &str) -> Result<Vec<Self>, JobError> {
        let DeValue::Array(array) = self.value.get_ref() else {
            let what = format!("must be a list, not {}", kind_of(self.value.get_ref()));
            return Err(self.error(&what, "write a list in square brackets"));
        };
        let named = |(index, value)| {
            let path = format!("{}, {entry} {}", self.path, index + 1);
            Value {
                reader: self.reader,
                value,
                path,
            }
        };
        Ok(array.iter().enumerate().map(named).collect())
    }

    /// Exactly `count` entries.
    pub(super) fn list_of(&self, count: usize, entry: &str) -> Result<Vec<Self>, JobError> {
        let entries = self.list(entry)?;
        if entries.len() == count {
            return Ok(entries);
        }
        let what = format!("must have {count} {entry}s, not {}", entries.len());
        Err(self.error(&what, format!("give {count} {entry}s")))
    }

    /// `N` numbers.
    pub(super) fn numbers<const N: usize>(&self) -> Result<[f64; N], JobError> {
        let entries = self.list_of(N, "number")?;
        let mut numbers = [0.0; N];
        for (number, entry) in numbers.iter_mut().zip(&entries) {
            *number = entry.number()?;
        }
        Ok(numbers)
    }

    /// `R` rows of `N` numbers.
    pub(super) fn matrix<const R: usize, const N: usize>(&self) -> Result<[[f64; N]; R], JobError> {
        let entries = self.list_of(R, "row")?;
        let mut rows = [[0.0; N]; R];
        for (row, entry) in rows.iter_mut().zip(&entries) {
            *row = entry.numbers()?;
        }
        Ok(rows)
    }
}

/// The type of a value, with its article.
fn kind_of(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "a boolean",
        DeValue::Datetime(_) => "a date or time",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

/// The known key that consists of `key` and a unit (`feed` for `feed_mm_min`); otherwise the one with the least edit distance, if that
/// is within the limit.
fn nearest<'k>(key: &str, known: &[&'k str]) -> Option<&'k str> {
    let lower = key.to_lowercase();
    let with_unit = |name: &str| {
        name.strip_prefix(&lower)
            .is_some_and(|rest| rest.starts_with('_'))
    };
    let few = |edits: usize, name: &str| edits * SUGGESTION_SHARE <= lower.chars().count().max(name.len());
    known.iter().copied().find(|name| with_unit(name)).or_else(|| {
        let edits = known.iter().map(|name| (edit_distance(&lower, name), *name));
        edits
            .filter(|(edits, name)| few(*edits, name))
            .min()
            .map(|(_, name)| name)
    })
}

/// Levenshtein distance: least number of characters inserted, deleted or replaced that turn one text into the other.
fn edit_distance(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (i, a) in from.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, b) in to.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[to.len()]
}

fn list(names: &[&str]) -> String {
    names
        .iter()
        .map(|name| format!("`{name}`"))
        .collect::<Vec<_>>()
        .join(", ")
}

fn list_quoted(names: &[&str]) -> String {
    names
        .iter()
        .map(|name| format!("\"{name}\""))
        .collect::<Vec<_>>()
        .join(" or ")
}
