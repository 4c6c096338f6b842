//! Conditions of `import --list --only`.

use std::str::FromStr;

use super::list::Row;

/// Least z of a mean normal that faces up.
const UP: f64 = 0.1;

/// What a face has to be.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Condition {
    /// The side that is machined faces up.
    Up,
    /// It is the whole rectangle of its surface.
    Whole,
    /// Its kind contains this, lower case.
    Kind(String),
    /// Its name contains this, lower case.
    Name(String),
    /// It has this colour.
    Colour([u8; 3]),
    /// Its area is larger, mm².
    Larger(f64),
    /// Its area is smaller, mm².
    Smaller(f64),
}

/// A colour as `#rrggbb`.
pub(super) fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn colour(word: &str) -> Option<[u8; 3]> {
    let digits = word.strip_prefix('#').unwrap_or(word);
    let part = |at: usize| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    (digits.len() == 6).then_some(())?;
    Some([part(0)?, part(2)?, part(4)?])
}

impl FromStr for Condition {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unknown =
            || "give up, whole, kind=WORD, name=WORD, colour=#RRGGBB, area>MM2 or area<MM2".to_owned();
        match text {
            "up" => return Ok(Self::Up),
            "whole" => return Ok(Self::Whole),
            _ => {}
        }
        if let Some((key, word)) = text.split_once('=') {
            return match key {
                "kind" => Ok(Self::Kind(word.to_lowercase())),
                "name" => Ok(Self::Name(word.to_lowercase())),
                "colour" | "color" => colour(word)
                    .map(Self::Colour)
                    .ok_or_else(|| "a colour is six digits, #RRGGBB".to_owned()),
                _ => Err(unknown()),
            };
        }
        let area = |word: &str| {
            let area: f64 = word
                .parse()
                .map_err(|_| "an area is a number of mm²".to_owned())?;
            if area.is_finite() {
                Ok(area)
            } else {
                Err("an area is a finite number of mm²".to_owned())
            }
        };
        match (text.strip_prefix("area>"), text.strip_prefix("area<")) {
            (Some(word), _) => area(word).map(Self::Larger),
            (_, Some(word)) => area(word).map(Self::Smaller),
            _ => Err(unknown()),
        }
    }
}

impl Condition {
    /// Whether a face meets it; one that cannot be imported has no area and no direction.
    pub(super) fn holds(&self, row: &Row<'_>) -> bool {
        let face = row.face;
        let measured = row.becomes.as_ref().ok().map(|(_, measures)| measures);
        match self {
            Self::Up => row.machined_normal().is_some_and(|[_, _, z]| z > UP),
            Self::Whole => row.becomes.is_ok() && row.trimmed.is_none(),
            Self::Kind(word) => face.surface.kind().to_lowercase().contains(word),
            Self::Name(word) => face
                .name
                .as_deref()
                .is_some_and(|name| name.to_lowercase().contains(word)),
            Self::Colour(colour) => face.colour == Some(*colour),
            Self::Larger(area) => measured.is_some_and(|measures| measures.area_mm2 > *area),
            Self::Smaller(area) => measured.is_some_and(|measures| measures.area_mm2 < *area),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_read() {
        for (text, condition) in [
            ("up", Condition::Up),
            ("whole", Condition::Whole),
            ("kind=B-spline", Condition::Kind("b-spline".to_owned())),
            ("name=a=b", Condition::Name("a=b".to_owned())),
            ("colour=#FF8000", Condition::Colour([255, 128, 0])),
            ("area>1.5e3", Condition::Larger(1500.0)),
            ("area<2", Condition::Smaller(2.0)),
        ] {
            assert_eq!(text.parse(), Ok(condition), "{text}");
        }
        for wrong in [
            "",
            "down",
            "colour=red",
            "colour=#12345",
            "colour=#ä234",
            "area>x",
            "area>nan",
            "area=5",
            "size=3",
        ] {
            assert!(wrong.parse::<Condition>().is_err(), "{wrong}");
        }
        assert_eq!(hex([255, 128, 0]), "#ff8000");
    }
}
