//! The data of the page's view and charts, as one JSON object.

use serde_json::{Value, json};

use super::binding;
use super::content::Content;
use super::embed::{Scale, words};
use super::measure::{self, Gap};
use super::record::PassInterval;
use super::setting::setting;
use glam::DVec3;
use job::units::MM_PER_NM;
use job::{Along, Spacing};

/// Bounding box of surface and path, quantised with the same step on all axes.
struct Box3 {
    scales: [Scale; 3],
}

impl Box3 {
    fn around(points: impl Iterator<Item = DVec3>) -> Self {
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] = points.fold(none, |[low, high], point| [low.min(point), high.max(point)]);
        let longest = (high - low).max_element().max(0.0);
        let whole = Scale::of([0.0, longest].into_iter());
        Self {
            scales: low.to_array().map(|low| Scale { low, ..whole }),
        }
    }

    fn place(&self, mm: DVec3) -> [u16; 3] {
        std::array::from_fn(|k| self.scales[k].nearest(mm[k]))
    }
}

fn millimetres(nm: [i32; 3]) -> DVec3 {
    DVec3::from(nm.map(f64::from)) * MM_PER_NM
}

/// The data that the scripts of the page read.
pub(super) fn payload(content: &Content<'_>) -> Value {
    let (job, mesh) = (content.job, content.mesh);
    let places = content.track.places().map(millimetres);
    let around = Box3::around(mesh.points().iter().copied().chain(places));
    let side = match job.along {
        Along::U => "v",
        Along::V => "u",
    };
    let scallops = content
        .remarks
        .scallops
        .as_ref()
        .filter(|scallops| scallops.largest_mm().is_finite())
        .map(|scallops| scallops.json(mesh, content.oracle.surface.domain(), job.along));
    json!({
        "radius": job.radius_mm,
        "feed": job.feed_mm_s(),
        "period": job.machine.period_s(),
        "samples": content.findings.samples,
        "side": side,
        "toward": content.picture.toward.to_array(),
        "limits": {
            "velocity": job.machine.limits.map(|limits| limits.velocity_mm_s),
            "acceleration": job.machine.limits.map(|limits| limits.acceleration_mm_s2),
        },
        "box": {
            "low": around.scales.map(|scale| scale.low),
            "step": around.scales[0].step,
        },
        "mesh": {
            "cells": mesh.cells(),
            "sign": mesh.sign(),
            "points": words(mesh.points().iter().flat_map(|point| around.place(*point))),
        },
        "track": content.track.json(|nm| around.place(millimetres(nm))),
        "series": content.series.json(),
        "intervals": intervals(content),
        "binding": binding::json(&content.remarks.passes),
        "scallops": scallops,
        "setting": setting(content),
    })
}

/// Path intervals and distances by pass.
fn intervals(content: &Content<'_>) -> Value {
    let passes = content.record.intervals.items();
    // Between curves the distance is not that of two lines of the surface.
    let gaps = match content.job.spacing {
        Spacing::Constant(_) => Vec::new(),
        Spacing::Exact | Spacing::FirstOrder => measure::gaps(content.oracle, &passes),
    };
    let column = |of: fn(&Gap) -> f64| gaps.iter().map(of).collect::<Vec<_>>();
    let passes: Vec<&PassInterval> = passes.iter().filter(|pass| pass.least.is_finite()).collect();
    json!({
        "every": content.record.intervals.stride(),
        "least": {
            "pass": passes.iter().map(|pass| pass.pass).collect::<Vec<_>>(),
            "interval": passes.iter().map(|pass| pass.least).collect::<Vec<_>>(),
        },
        "gaps": {
            "pass": gaps.iter().map(|gap| gap.pass).collect::<Vec<_>>(),
            "widest": column(|gap| gap.widest_mm),
            "narrowest": column(|gap| gap.narrowest_mm),
        },
    })
}
