//! The figures of `verify`, as text and as JSON.

use super::out::say;
use interp_core::STORE_WORDS;
use serde_json::{Map, Value, json};

use job::Job;
use job::units::S_PER_MIN;
use machine::prepare::Prepared;
use oracle::{AccuracyReport, ErrorStatistics};
use verify::motion::limits::{ORDERS, Peak, Peaks};
use verify::swept::{ConcaveRadius, FieldPoint, MISSED_RADII, SweptResult};
use verify::{Verdict, survey};

/// Capacity of the board for surface data, bytes.
const STORE_BYTES: usize = STORE_WORDS * size_of::<i32>();

/// The keys of `verify`.
pub(super) fn json(
    job: &Job,
    prepared: &Prepared,
    survey: &survey::SurveyResult,
    found: &SweptResult,
    axes: &Peaks,
) -> Map<String, Value> {
    let report = &survey.report;
    let measured = found.scallop_verdict != Verdict::Unknown;
    let null_unless = |known: bool, value: Value| if known { value } else { Value::Null };
    let (most, error) = (&found.scallop_max, &found.measurement_error);
    let gouge = found.gouge.map(|gouge| {
        json!({
            "depth_mm": gouge.depth_mm, "u": gouge.u, "v": gouge.v, "place_mm": gouge.point_mm.to_array(), "tick": gouge.tick,
            "pass": gouge.pass, "contact_u": gouge.contact[0], "contact_v": gouge.contact[1],
            "kind": if gouge.local { "local" } else { "global" },
        })
    });
    let concave = found.shape.concave_radius.map(|concave| {
        json!({ "radius_mm": concave.radius_mm, "u": concave.u, "v": concave.v, "place_mm": concave.point_mm.to_array() })
    });
    let value = json!({
        "position_error_max_nm": report.position_nm.largest(),
        "position_error_rms_nm": report.position_nm.measured().map(ErrorStatistics::rms),
        "normal_error_max_rad": report.normal_rad.largest(),
        "ripple_max_pct": report.ripple_pct.largest(),
        "interval_error_max": report.interval.largest(),
        "passes": survey.passes,
        "samples": survey.samples,
        "fit_max": report.fit.largest(),
        "scallop_limit_mm": job.scallop_mm,
        "scallop_max_mm": null_unless(measured, json!(most.height_mm)),
        "scallop_mean_mm": null_unless(measured, json!(found.scallop_mean_mm)),
        "scallop_error_mm": found.measurement_error_mm,
        "scallop_error": {
            "path_mm": error.path_mm, "rounding_mm": error.rounding_mm, "stations_mm": error.stations_mm, "search_mm": error.search_mm,
        },
        "scallop_at": null_unless(measured, json!({ "u": most.u, "v": most.v, "gap": most.passes[0], "passes": most.passes, "place_mm": most.point_mm.to_array() })),
        "scallop_area_by_tenth": found.scallop_histogram,
        "region_heights": found.region.map(|region| json!({
            "area_mm2": region.area_mm2, "served_share": region.served_share, "ridges_share": region.ridges_share, "places": region.places,
            "places_a_step_over": region.places_a_step_over,
            "highest_mm": region.highest.map(|at| at.height_mm),
            "highest_at": region.highest.map(|at| json!({ "u": at.uv[0], "v": at.uv[1], "place_mm": at.point_mm.to_array() })),
            "highest_beside_mm": region.highest_beside.map(|at| at.height_mm), "above_beside_share": region.above_share,
        })),
        "gouge_max_mm": null_unless(found.gouge_verdict != Verdict::Unknown, json!(found.gouge_max_mm())),
        "gouge_floor_mm": found.gouge_floor_mm,
        "gouge_bound_mm": found.gouge_bound_mm,
        "gouge": gouge,
        "limits": limits(job, axes),
        "axes": {
            "extent_mm": found.axes.extent_mm, "travel_mm": job.machine.travel_mm, "beyond_mm": found.axes.beyond_mm,
            "velocity_mm_s": axes[0].axes, "acceleration_mm_s2": axes[1].axes, "jerk_mm_s3": axes[2].axes,
        },
        "cad_face": found.original.map(|original| json!({
            "above_max_mm": original.above_mm, "below_max_mm": original.below_mm, "tolerance_mm": original.tolerance_mm,
            "scallop_over_surface_max_mm": original.over_surface_mm,
        })),
        "least_concave_radius": concave,
        "poles": found.shape.poles,
        "degenerate_places": found.shape.degenerate.map_or(0, |(count, _)| count),
        "machining_time_s": job.machine.time_s(survey.samples),
        "patches": prepared.patches(),
        "data_bytes": prepared.data_bytes(),
        "data_bytes_max": STORE_BYTES,
        "stations": found.stations,
        "not_measured": not_measured(job, report, found, axes),
    });
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// The keys of the figures that could not be measured.
fn not_measured(
    job: &Job,
    report: &AccuracyReport,
    found: &SweptResult,
    [velocity, acceleration, jerk]: &Peaks,
) -> Vec<&'static str> {
    // Where nothing counts for an interval, none has an error.
    let of_samples = [
        ("position_error_max_nm", &report.position_nm),
        ("position_error_rms_nm", &report.position_nm),
        ("normal_error_max_rad", &report.normal_rad),
        ("ripple_max_pct", &report.ripple_pct),
        ("fit_max", &report.fit),
    ];
    let missing = of_samples
        .into_iter()
        .filter(|(_, errors)| errors.measured().is_none());
    let figures = [
        ("scallop_max_mm", found.scallop_verdict),
        ("gouge_max_mm", found.gouge_verdict),
        ("limits.velocity", velocity.verdict),
        ("limits.acceleration", acceleration.verdict),
        ("limits.jerk", jerk.verdict),
    ];
    let unknown = figures.into_iter().filter(|(key, verdict)| {
        *verdict == Verdict::Unknown && !(*key == "scallop_max_mm" && found.has_no_gap(job))
    });
    let missing = missing.map(|(key, _)| key);
    missing.chain(unknown.map(|(key, _)| key)).collect()
}

/// Shares of the axis limits; null without limits, and where the positions do not tell. `base_s`: over which they are judged;
/// `uncertainty`: error over that base, as a share of the limit.
fn limits(job: &Job, [velocity, acceleration, jerk]: &Peaks) -> Value {
    if !job.machine.has_limits() {
        return Value::Null;
    }
    let known = |peak: &Peak| peak.share.filter(|_| peak.verdict != Verdict::Unknown);
    json!({
        "velocity": known(velocity), "acceleration": known(acceleration), "jerk": known(jerk),
        "base_s": {
            "velocity": velocity.base_s, "acceleration": acceleration.base_s, "jerk": jerk.base_s,
        },
        "uncertainty": {
            "velocity": velocity.uncertainty, "acceleration": acceleration.uncertainty, "jerk": jerk.uncertainty,
        },
    })
}

/// The verdict before a figure.
pub(super) fn mark(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Met => "ok  ",
        Verdict::Violated => "FAIL",
        Verdict::Unknown => "?   ",
    }
}

fn row(name: &str, text: &str) {
    say!("       {name:<22} {text}");
}

fn um(mm: f64) -> f64 {
    1e3 * mm
}

/// A length that was given, um, without the rounding of the conversion in its last digits.
fn given_um(mm: f64) -> f64 {
    (1e9 * mm).round() / 1e6
}

/// Prints the figures as text.
pub(super) fn print(
    job: &Job,
    prepared: &Prepared,
    survey: &survey::SurveyResult,
    found: &SweptResult,
    axes: &Peaks,
) {
    scallop(job, found);
    match &found.gouge {
        None if !found.has_samples() => {
            say!("  ?    {:<22} not measured: the run has no sample", "gouge");
        }
        None => say!(
            "  {} {:<22} none deeper than {:.4} um ({} cells)",
            mark(found.gouge_verdict),
            "gouge",
            um(found.gouge_bound_mm),
            found.cells
        ),
        Some(gouge) => say!(
            "  {} {:<22} {:.4} um +- {:.4} at u = {:.6}, v = {:.6}, by tick {}, pass {}{}",
            mark(found.gouge_verdict),
            "gouge",
            um(gouge.depth_mm),
            um(found.gouge_floor_mm),
            gouge.u,
            gouge.v,
            gouge.tick,
            gouge.pass,
            job.origin.part().map_or_else(String::new, |part| {
                format!(" (at most {}: the part's tolerance)", given_um(part.tolerance_mm))
            })
        ),
    }
    if let Some(original) = &found.original {
        row(
            "CAD face",
            &format!(
                "up to {:.4} um above the job's surface, {:.4} below, tolerance {}; heights are those above the face: limit {}, and {:.4} um \
                 above the job's surface: limit {}",
                um(original.above_mm),
                um(original.below_mm),
                given_um(original.tolerance_mm),
                given_um(job.scallop_mm + original.tolerance_mm),
                um(original.over_surface_mm),
                given_um(job.scallop_mm)
            ),
        );
    }
    travel(job, found);
    peaks(axes);
    let shape = &found.shape;
    let concave = shape.concave_radius.map_or_else(
        || "none: nowhere concave".to_owned(),
        |concave| {
            let ConcaveRadius { radius_mm, u, v, .. } = concave;
            format!("{radius_mm:.4} mm at u = {u:.6}, v = {v:.6}")
        },
    );
    row("least concave radius", &concave);
    if !shape.poles.is_empty() {
        row(
            "poles",
            &format!("boundary {} is degenerate (one point)", shape.poles.join(", ")),
        );
    }
    if job.overrun_mm > 0.0 {
        row(
            "turns",
            &format!("up to {} mm beyond the boundary: {}", job.overrun_mm, beside(job)),
        );
    }
    row(
        "machining time",
        &format!("{:.2} min", job.machine.time_s(survey.samples) / S_PER_MIN),
    );
    let bytes = prepared.data_bytes();
    row(
        "surface data",
        &format!(
            "{} patches, {bytes} of the board's {STORE_BYTES} bytes ({:.1} %)",
            prepared.patches(),
            100.0 * ratio(bytes, STORE_BYTES)
        ),
    );
}

/// What of that which stands beside the surface is checked.
fn beside(job: &Job) -> String {
    let setup = &job.setup;
    let named: Vec<&str> = [
        (job.origin.part().is_some(), "[part]"),
        (setup.stock.is_some(), "[stock]"),
        (!setup.fixtures.is_empty(), "[[fixture]]"),
    ]
    .into_iter()
    .filter_map(|(is_named, name)| is_named.then_some(name))
    .collect();
    if named.is_empty() {
        "what stands there is not known to the job, and not checked".to_owned()
    } else {
        format!(
            "of what stands there {} is checked, nothing else",
            named.join(", ")
        )
    }
}

fn scallop(job: &Job, found: &SweptResult) {
    if found.has_no_gap(job) && found.scallop_verdict == Verdict::Unknown {
        row("scallop height", "no two passes beside each other: no ridge");
        region(job, found);
        return;
    }
    if found.ridges.is_empty() {
        say!(
            "  {} {:<22} not measured: fewer than two whole passes",
            mark(Verdict::Unknown),
            "scallop height"
        );
        region(job, found);
        return;
    }
    let (most, error) = (&found.scallop_max, &found.measurement_error);
    say!(
        "  {} {:<22} {:.4} um +- {:.4}, limit {} (max / limit {:.4}), between passes {} and {}, u = {:.6}, v = {:.6}",
        mark(found.scallop_verdict),
        "scallop height",
        um(most.height_mm),
        um(found.measurement_error_mm),
        given_um(job.scallop_mm),
        most.height_mm / job.scallop_mm,
        most.passes[0],
        most.passes[1],
        most.u,
        most.v
    );
    let mean = format!(
        "mean crest {:.4} um by area, {:.1} % of the limit; {} stations",
        um(found.scallop_mean_mm),
        100.0 * found.scallop_mean_mm / job.scallop_mm,
        found.stations
    );
    row("", &mean);
    let parts = format!(
        "terms of the +-, um: path between samples {:.4}, rounding {:.4}, stations {:.4}, search {:.4}",
        um(error.path_mm),
        um(error.rounding_mm),
        um(error.stations_mm),
        um(error.search_mm)
    );
    row("", &parts);
    if job.region.is_none() {
        row("", "first and last pass lie on the boundaries: no uncut margin");
    }
    region(job, found);
}

/// Heights in a drawn region, place by place.
fn region(job: &Job, found: &SweptResult) {
    let Some(region) = &found.region else {
        return;
    };
    let height = |at: &FieldPoint| {
        if at.height_mm >= MISSED_RADII * job.radius_mm {
            "uncut".to_owned()
        } else {
            format!("{:.4} um", um(at.height_mm))
        }
    };
    let percent = |share: f64| 100.0 * share;
    let verdict = match region.highest {
        Some(_) => mark(found.region_verdict),
        None => "    ",
    };
    let highest = region.highest.as_ref().map_or_else(String::new, |highest| {
        let [u, v] = highest.uv;
        format!(": highest {} at u = {u:.6}, v = {v:.6}", height(highest))
    });
    say!(
        "  {verdict} {:<22} {:.1} % of its {:.1} mm2 are half a step-over or more from its boundary{highest}; ridges with the +- above are in {:.1} %",
        "region",
        percent(region.served_share),
        region.area_mm2,
        percent(region.ridges_share)
    );
    let beside = region.highest_beside.as_ref();
    row(
        "",
        &format!(
            "nearer to the boundary {:.1} % of the region are above the limit, up to {}; {} places",
            percent(region.above_share),
            beside.map_or_else(|| "-".to_owned(), height),
            region.places
        ),
    );
}

#[allow(clippy::cast_precision_loss, reason = "sizes of memories")]
fn ratio(part: usize, whole: usize) -> f64 {
    part as f64 / whole as f64
}

fn travel(job: &Job, found: &SweptResult) {
    let axes = &found.axes;
    if let Some([x, y, z]) = axes.extent_mm {
        let given = match (job.machine.travel_mm, axes.within_travel()) {
            (None, _) => "     ",
            (Some(_), true) => "ok   ",
            (Some(_), false) => "FAIL ",
        };
        say!(
            "  {given}{:<22} x {:.3} to {:.3}, y {:.3} to {:.3}, z {:.3} to {:.3} mm",
            "axis travel",
            x[0],
            x[1],
            y[0],
            y[1],
            z[0],
            z[1]
        );
    }
}

/// Over which time a figure is reached, and judged within an error, %.
fn bases(peak: &Peak, error: f64) -> String {
    let judged = format!("over {:.3} ms within {error:.2} %", 1e3 * peak.base_s);
    if peak.reached_s == peak.base_s {
        return format!(", {judged}");
    }
    format!(" at least, over {:.3} ms; judged {judged}", 1e3 * peak.reached_s)
}

fn peaks(axes: &Peaks) {
    for (peak, (name, unit)) in axes.iter().zip(ORDERS) {
        let [x, y, z] = peak.axes;
        let (verdict, share) = match peak.share {
            None => ("    ", "within passes; no limit given".to_owned()),
            Some(share) => {
                let figure = format!("{:.1} % of its limit", 100.0 * share);
                let error = 100.0 * peak.uncertainty;
                let reported = if peak.verdict == Verdict::Unknown {
                    format!(
                        "cannot tell: at least {figure}, but over {:.3} ms",
                        1e3 * peak.base_s
                    )
                } else {
                    format!("{figure}{}", bases(peak, error))
                };
                (mark(peak.verdict), reported)
            }
        };
        say!(
            "  {verdict} {:<22} {x:.1}, {y:.1}, {z:.1} {unit}; {share}",
            format!("axis {name}")
        );
    }
    if axes.iter().all(|peak| peak.share.is_none()) {
        row(
            "axis limits",
            "none: a job for studying the geometry; for a machine, give them in [machine] or a profile by --machine",
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_checked_against_what_the_job_names() {
        let plate = include_str!("../../../jobs/plate_machine.toml");
        let of = |rest: &str| beside(&job_file::parse("plate.toml", &format!("{plate}\n{rest}")).unwrap());
        assert!(of("").contains("not checked"));
        let named = of(
            "[stock]\nbox_mm = [[0, 1], [0, 1], [0, 1]]\n[[fixture]]\nbox_mm = [[0, 1], [0, 1], [0, 1]]\n",
        );
        assert_eq!(
            named,
            "of what stands there [stock], [[fixture]] is checked, nothing else"
        );
    }

    #[test]
    fn given_lengths_have_the_digits_that_were_given() {
        assert_eq!(um(0.00185865).to_string(), "1.8586500000000001");
        assert_eq!(given_um(0.00185865).to_string(), "1.85865");
        assert_eq!(given_um(0.005).to_string(), "5");
    }

    /// A figure over another base than the judged one says so.
    #[test]
    fn a_figure_names_the_base_over_which_it_is_reached() {
        let mut peak = Peak {
            reached_s: 2e-3,
            base_s: 6e-3,
            ..Peak::default()
        };
        assert_eq!(
            bases(&peak, 1.85),
            " at least, over 2.000 ms; judged over 6.000 ms within 1.85 %"
        );
        peak.reached_s = peak.base_s;
        assert_eq!(bases(&peak, 1.85), ", over 6.000 ms within 1.85 %");
    }
}
