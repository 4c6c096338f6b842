//! The run against the whole part, and what the passes leave of the reachable face, as text and as JSON.

use job::Job;
use part::{Deepest, LEFTOVER_SHARE, PartCheck};
use report::Mark;
use serde_json::{Value, json};

use super::out::say;
use super::region_words;

/// Reasons against the job, and warnings. Faces of the part that are not known are the former unless they are accepted.
pub(super) fn reasons(check: &PartCheck, are_unknown_accepted: bool) -> (Vec<String>, Vec<String>) {
    let (mut failures, mut warnings) = (check.failures.clone(), Vec::new());
    match check.unknown_faces() {
        Some(what) if are_unknown_accepted => warnings.push(what),
        Some(what) => failures.push(format!(
            "{what}; repair them in the CAD system (the header of the job names them), or look at them and give --accept-unknown-faces"
        )),
        None => {}
    }
    warnings.extend(check.warnings.iter().cloned());
    (failures, warnings)
}

/// Where the tool enters the part.
pub(super) fn marks(check: &PartCheck) -> Vec<Mark> {
    // Links are known by their places alone.
    let ticks = [check.tick, None];
    let found = check.deepest.iter().flatten().zip(ticks);
    let found = found.filter_map(|(found, tick)| Some((found.as_ref()?, tick)));
    let deep = found.filter(|(found, _)| check.is_too_deep(found));
    deep.map(|(found, tick)| Mark {
        what: format!(
            "{} {:.4} mm in face {}",
            found.part.name(),
            found.depth_mm,
            found.face
        ),
        place_mm: found.centre_mm,
        tick,
    })
    .collect()
}

/// As text.
pub(super) fn print(job: &Job, check: &PartCheck) {
    if let Some(reach) = job.origin.reach() {
        for line in region_words::lines(reach) {
            say!("       {:<22} {line}", "face: reach");
        }
    }
    for (index, name) in ["part: on passes", "part: between passes"]
        .into_iter()
        .enumerate()
    {
        let Some(found) = check.deepest.map(|deepest| deepest[index]) else {
            continue;
        };
        let mark = if found.is_some_and(|found| check.is_too_deep(&found)) {
            "FAIL"
        } else {
            "ok  "
        };
        match found {
            Some(found) => say!(
                "  {mark} {name:<22} {} {:.4} mm in face {} at [{:.3}, {:.3}, {:.3}] (at most {}); {} centres",
                found.part.name(),
                found.depth_mm,
                found.face,
                found.centre_mm.x,
                found.centre_mm.y,
                found.centre_mm.z,
                check.tolerance_mm,
                check.counts[index]
            ),
            None => say!(
                "  {mark} {name:<22} nowhere deeper than 0.0005 mm; {} centres",
                check.counts[index]
            ),
        }
    }
    let left = &check.leftover;
    say!(
        "       {:<22} {:.3} % of {:.3} mm2 within {} of the scallop limit; {} at u = {:.6}, v = {:.6}",
        "face: left",
        100.0 * check.within_share(),
        left.reachable_mm2,
        1.0 + LEFTOVER_SHARE,
        if left.highest_mm.is_finite() {
            format!("highest {:.5} mm", left.highest_mm)
        } else {
            "not cut".to_owned()
        },
        left.uv[0],
        left.uv[1]
    );
}

/// The key `part`.
pub(super) fn json(job: &Job, check: &PartCheck) -> Value {
    let place = |found: Option<Deepest>| {
        found.map(|found| {
            json!({
                "depth_mm": found.depth_mm, "tool_part": found.part.name(), "face": found.face, "centre_mm": found.centre_mm.to_array(),
            })
        })
    };
    let left = &check.leftover;
    json!({
        "checked": check.deepest.is_some(),
        "tolerance_mm": check.tolerance_mm,
        "centres": check.counts[0],
        "centres_between": check.counts[1],
        "deepest": check.deepest.and_then(|[found, _]| place(found)),
        "deepest_between": check.deepest.and_then(|[_, found]| place(found)),
        "left": {
            "reachable_mm2": left.reachable_mm2, "within_mm2": left.within_mm2, "within_share": check.within_share(),
            "highest_mm": left.highest_mm.is_finite().then_some(left.highest_mm), "uv": left.uv, "place_mm": left.place_mm.to_array(),
        },
        "face": job.origin.reach().map(region_words::json),
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use part::{Leftover, Reason};

    use super::*;

    /// A place between passes does not have the tick of the deepest place on passes, which may be within the tolerance.
    #[test]
    fn a_mark_has_the_tick_of_its_own_place() {
        let deepest = |depth_mm: f64| Deepest {
            depth_mm,
            part: Reason::Ball,
            centre_mm: DVec3::new(depth_mm, 0.0, 0.0),
            index: 0,
            face: 3,
        };
        let ticks = |depths: [f64; 2]| -> Vec<(f64, Option<u64>)> {
            let check = PartCheck {
                deepest: Some(depths.map(|depth| Some(deepest(depth)))),
                counts: [1, 1],
                tolerance_mm: 0.002,
                unknown: 0,
                leftover: Leftover::default(),
                tick: Some(7),
                failures: Vec::new(),
                warnings: Vec::new(),
            };
            marks(&check)
                .iter()
                .map(|mark| (mark.place_mm.x, mark.tick))
                .collect()
        };
        assert_eq!(ticks([0.0006, 0.1]), [(0.1, None)]);
        assert_eq!(ticks([0.1, 0.0006]), [(0.1, Some(7))]);
    }
}
