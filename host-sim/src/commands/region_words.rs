//! What the tool reaches of a trimmed face, as text and as JSON.

use job::FaceReach;
use serde_json::{Value, json};

/// What a rule is about, for each of its names.
const REASONS: [(&str, &str); 6] = [
    ("steep", "steeper than allowed, or looks down"),
    (
        "degenerate",
        "a derivative nearly vanishes, or the two are nearly parallel",
    ),
    ("fit", "more concave than the ball"),
    ("ball", "the ball would cut another place of the part"),
    ("shank", "the shank would touch the part"),
    ("holder", "the holder would touch the part"),
];

/// The figures as JSON.
pub(super) fn json(reach: &FaceReach) -> Value {
    let unreachable = reach
        .unreachable_mm2
        .iter()
        .map(|(reason, area)| json!({ "reason": reason, "area_mm2": area }));
    json!({
        "area_mm2": reach.area_mm2,
        "reachable_mm2": reach.reachable_mm2,
        "region_mm2": reach.region_mm2,
        "unreachable": unreachable.collect::<Vec<_>>(),
        "radius_mm": reach.radius_mm,
        "unknown_faces": reach.unknown,
    })
}

/// A reason in words.
pub(super) fn reason(name: &str) -> &'static str {
    REASONS
        .iter()
        .find(|(other, _)| *other == name)
        .map_or("", |(_, words)| words)
}

/// The figures as text.
pub(super) fn lines(reach: &FaceReach) -> Vec<String> {
    let share = |part: f64, of: f64| if of > 0.0 { 100.0 * part / of } else { 0.0 };
    let mut lines = vec![format!(
        "{:.3} of {:.3} mm2 ({:.2} %), {:.2} % of it in the region",
        reach.reachable_mm2,
        reach.area_mm2,
        share(reach.reachable_mm2, reach.area_mm2),
        share(reach.region_mm2, reach.reachable_mm2),
    )];
    for (reason, area) in &reach.unreachable_mm2 {
        lines.push(format!("{area:.3} mm2 not: {}", self::reason(reason)));
    }
    let short = reach.unreachable_mm2.iter().any(|(reason, _)| reason != "steep");
    match reach.radius_mm {
        Some(radius_mm) if short => lines.push(format!(
            "a ball of radius {radius_mm:.3} mm would reach 99 % of what is not too steep"
        )),
        None if short => lines.push("no ball would reach 99 % of what is not too steep".to_owned()),
        _ => {}
    }
    if !reach.unknown.is_empty() {
        lines.push(format!(
            "faces {:?} of the part are not known: whether the tool cuts them is not checked",
            reach.unknown
        ));
    }
    lines
}
