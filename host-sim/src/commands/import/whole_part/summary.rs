//! The sums of a part, as text and as JSON.

use part_program::{FacePlan, Sums, percent};
use serde_json::{Value, json};

use super::super::super::out::say;
use super::super::super::region_words;
use super::Planned;

/// The summary as JSON.
pub(super) fn summary(planned: &Planned<'_>) -> Value {
    let setup = planned.setup;
    let sums = Sums::of(planned.plans);
    let faces = planned.plans.iter().zip(&planned.jobs).map(|(plan, job)| {
        json!({
            "face": plan.number,
            "job": job.as_ref().map(|path| path.display().to_string()),
            "region": plan.reach.as_ref().map(region_words::json),
            "error": plan.refused.as_ref().map(ToString::to_string),
        })
    });
    json!({
        "file": planned.file,
        "up": setup.side.name(),
        "rotate_deg": setup.side.rotate_deg(),
        "translate_mm": setup.translate_mm,
        "radius_mm": setup.tool.radius,
        "jobs": planned.machined().map(|(_, path)| path.display().to_string()).collect::<Vec<_>>(),
        "page": planned.page.display().to_string(),
        "area_mm2": sums.area_mm2,
        "reachable_mm2": sums.reachable_mm2,
        "region_mm2": sums.region_mm2,
        "unreachable": sums.unreachable_mm2.iter().map(|(reason, area)| json!({ "reason": reason, "area_mm2": area })).collect::<Vec<_>>(),
        "links_between_faces_s": planned.order.links_s,
        "faces_not_known": sums.unknown,
        "faces": faces.collect::<Vec<_>>(),
    })
}

/// Prints the summary as text.
pub(super) fn print(planned: &Planned<'_>) {
    let sums = Sums::of(planned.plans);
    say!("{}, {} up", planned.file, planned.setup.side.name());
    for (plan, job) in planned.machined() {
        let Some(reach) = &plan.reach else {
            continue;
        };
        let name = job.file_name().unwrap_or_default().to_string_lossy();
        say!(
            "  {name:<24} {:>11.2} of {:>11.2} mm2 ({:>6.2} %)",
            reach.region_mm2,
            reach.area_mm2,
            percent(reach.region_mm2, reach.area_mm2)
        );
    }
    for plan in planned.plans {
        if let Some(why) = &plan.refused {
            say!("  face {} has no job: {why}", plan.number);
        }
    }
    say!(
        "  reachable    {:.2} of {:.2} mm2 ({:.2} %) of {} faces; {:.3} % of it in {} jobs",
        sums.reachable_mm2,
        sums.area_mm2,
        percent(sums.reachable_mm2, sums.area_mm2),
        planned.plans.len(),
        percent(sums.region_mm2, sums.reachable_mm2),
        planned.order.faces.len()
    );
    for (reason, area) in &sums.unreachable_mm2 {
        say!("  unreachable  {area:.2} mm2: {}", region_words::reason(reason));
    }
    if sums.unknown > 0 {
        say!("  {} faces are not known", sums.unknown);
    }
    // A sum of nothing is -0.
    let passes_s = 0.0
        + planned
            .machined()
            .map(|(plan, _)| FacePlan::passes_s(plan))
            .sum::<f64>();
    say!(
        "  passes       about {:.1} min; `verify` tells the time",
        passes_s / job::units::S_PER_MIN
    );
    say!(
        "  links        between faces about {:.1} s",
        planned.order.links_s
    );
    say!("  page         {}", planned.page.display());
}
