//! The sums of a part, as text and as JSON.

use std::path::Path;

use serde_json::{Value, json};

use super::super::super::out::say;
use super::super::super::region_words;
use super::super::Arguments;
use super::face::Outcome;
use super::setup::Setup;

/// Sums over all faces, mm2.
#[derive(Default)]
pub(super) struct Sums {
    pub(super) area: f64,
    pub(super) reachable: f64,
    pub(super) region: f64,
    pub(super) unreachable: Vec<(String, f64)>,
    pub(super) unknown: usize,
}

impl Sums {
    pub(super) fn of(outcomes: &[Outcome]) -> Self {
        let mut sums = Self::default();
        for outcome in outcomes {
            let Some(reach) = &outcome.reach else {
                sums.unknown += 1;
                continue;
            };
            sums.area += reach.area_mm2;
            sums.reachable += reach.reachable_mm2;
            sums.region += if outcome.job.is_some() {
                reach.region_mm2
            } else {
                0.0
            };
            for (reason, area) in &reach.unreachable_mm2 {
                match sums.unreachable.iter_mut().find(|(name, _)| name == reason) {
                    Some((_, sum)) => *sum += area,
                    None => sums.unreachable.push((reason.clone(), *area)),
                }
            }
        }
        sums
    }

    pub(super) fn share(part: f64, of: f64) -> f64 {
        if of > 0.0 { 100.0 * part / of } else { 0.0 }
    }
}

pub(super) fn summary(
    arguments: &Arguments,
    file: &str,
    setup: &Setup,
    (order, links_s): (&[usize], f64),
    outcomes: &[Outcome],
    sums: &Sums,
    page: &Path,
) -> Value {
    let face = |outcome: &Outcome| {
        json!({
            "face": outcome.number,
            "job": outcome.job.as_ref().map(|path| path.display().to_string()),
            "region": outcome.reach.as_ref().map(region_words::json),
            "error": outcome.refused,
        })
    };
    json!({
        "file": file,
        "up": setup.up.name(),
        "rotate_deg": setup.up.rotate_deg(),
        "translate_mm": setup.translate_mm,
        "radius_mm": arguments.radius_mm,
        "jobs": order.iter().filter_map(|index| outcomes[*index].job.as_ref()).map(|path| path.display().to_string()).collect::<Vec<_>>(),
        "page": page.display().to_string(),
        "area_mm2": sums.area,
        "reachable_mm2": sums.reachable,
        "region_mm2": sums.region,
        "unreachable": sums.unreachable.iter().map(|(reason, area)| json!({ "reason": reason, "area_mm2": area })).collect::<Vec<_>>(),
        "links_between_faces_s": links_s,
        "faces_not_known": sums.unknown,
        "faces": outcomes.iter().map(face).collect::<Vec<_>>(),
    })
}

pub(super) fn print(
    file: &str,
    page: &Path,
    setup: &Setup,
    (order, links_s): (&[usize], f64),
    outcomes: &[Outcome],
    sums: &Sums,
) {
    say!("{file}, {} up", setup.up.name());
    for index in order {
        let outcome = &outcomes[*index];
        let (Some(job), Some(reach)) = (&outcome.job, &outcome.reach) else {
            continue;
        };
        let name = job.file_name().unwrap_or_default().to_string_lossy();
        say!(
            "  {name:<24} {:>11.2} of {:>11.2} mm2 ({:>6.2} %)",
            reach.region_mm2,
            reach.area_mm2,
            Sums::share(reach.region_mm2, reach.area_mm2)
        );
    }
    for outcome in outcomes {
        if let Some(why) = &outcome.refused {
            say!("  face {} has no job: {why}", outcome.number);
        }
    }
    say!(
        "  reachable    {:.2} of {:.2} mm2 ({:.2} %) of {} faces; {:.3} % of it in {} jobs",
        sums.reachable,
        sums.area,
        Sums::share(sums.reachable, sums.area),
        outcomes.len(),
        Sums::share(sums.region, sums.reachable),
        order.len()
    );
    for (reason, area) in &sums.unreachable {
        say!("  unreachable  {area:.2} mm2: {}", region_words::reason(reason));
    }
    if sums.unknown > 0 {
        say!("  {} faces are not known", sums.unknown);
    }
    // A sum of nothing is -0.
    let passes_s = 0.0 + order.iter().map(|index| outcomes[*index].passes_s()).sum::<f64>();
    say!(
        "  passes       about {:.1} min; `verify` tells the time",
        passes_s / 60.0
    );
    say!("  links        between faces about {links_s:.1} s");
    say!("  page         {}", page.display());
}
