//! Encoding of interp-core's types on the wire: every enumeration as one byte (its stable code), every fraction as eight
//! bytes, low byte first. Each submodule is a serde `with`.

use interp_core::{
    job::{Pattern, Spacing, SurfaceKind, ToolSide},
    sample::State,
};

/// One module per fieldless enumeration: its code as a byte; an unknown code is an error.
macro_rules! code_byte {
    ($module:ident, $kind:ty, $from_code:expr) => {
        pub(crate) mod $module {
            use super::*;
            use serde::{Deserialize, Deserializer, Serializer, de::Error};

            pub(crate) fn serialize<S: Serializer>(value: &$kind, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_u8(*value as u8)
            }

            pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<$kind, D::Error> {
                let from_code: fn(u8) -> Option<$kind> = $from_code;
                from_code(u8::deserialize(deserializer)?).ok_or_else(|| D::Error::custom("unknown code"))
            }
        }
    };
}

code_byte!(state, State, State::from_code);
code_byte!(surface_kind, SurfaceKind, SurfaceKind::from_code);
code_byte!(pattern, Pattern, |code| {
    [Pattern::Zig, Pattern::Zigzag]
        .into_iter()
        .find(|pattern| *pattern as u8 == code)
});
code_byte!(spacing, Spacing, Spacing::from_code);
code_byte!(tool_side, ToolSide, |code| {
    [ToolSide::Plus, ToolSide::Minus]
        .into_iter()
        .find(|side| *side as u8 == code)
});

/// A span parameter: the span as a varint, the fraction as eight bytes.
pub(crate) mod span_parameter {
    use interp_core::sample::SpanParameter;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(place: &SpanParameter, serializer: S) -> Result<S::Ok, S::Error> {
        (place.span, place.fraction.to_le_bytes()).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SpanParameter, D::Error> {
        let (span, fraction) = <(u16, [u8; 8])>::deserialize(deserializer)?;
        Ok(SpanParameter {
            span,
            fraction: u64::from_le_bytes(fraction),
        })
    }
}

/// The place that a run begins at: its pass, then its path parameter.
pub(crate) mod run_start {
    use interp_core::{RunStart, SpanParameter};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Fields(u32, #[serde(with = "super::span_parameter")] SpanParameter);

    pub(crate) fn serialize<S: Serializer>(start: &RunStart, serializer: S) -> Result<S::Ok, S::Error> {
        Fields(start.pass, start.path).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<RunStart, D::Error> {
        let Fields(pass, path) = Fields::deserialize(deserializer)?;
        Ok(RunStart { pass, path })
    }
}
