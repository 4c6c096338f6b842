//! The reach of the tool, as text and as JSON.

use serde_json::{Value, json};

use job::Job;
use report::Mark;
use verify::Verdict;
use verify::reach::{Obstacle, ReachFinding, ReachResult, ToolPart};

use super::out::say;
use super::swept_words::mark;

/// The word for a verdict.
fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Met => "met",
        Verdict::Violated => "violated",
        Verdict::Unknown => "not measured",
    }
}

/// The key `reach`.
pub(super) fn json(job: &Job, reach: &ReachResult) -> Value {
    let (contact, facing) = (&reach.contact, &reach.facing);
    let at = contact.at.map(|at| {
        json!({
            "sample": at.sample, "pass": at.pass, "u": at.uv[0], "v": at.uv[1], "place_mm": at.place_mm.to_array(),
        })
    });
    json!({
        "verdict": word(reach.verdict()),
        "contact": {
            "verdict": word(contact.verdict()), "contacts": contact.contacts, "above_equator": contact.above_equator,
            "height_max_mm": contact.at.map(|_| contact.height_max_mm), "at": at,
        },
        "undercut_share": facing.down_share,
        "undercut_error_share": facing.error_share,
        "rotate_deg": reach.rotate_deg,
        "parts": reach.findings.iter().map(|finding| part(job, finding)).collect::<Vec<_>>(),
    })
}

fn part(job: &Job, finding: &ReachFinding) -> Value {
    let measured = finding.depth_mm.is_finite();
    let known = finding.verdict() != Verdict::Unknown;
    json!({
        "part": finding.part.name(),
        "obstacle": finding.obstacle.name(job),
        "verdict": word(finding.verdict()),
        "depth_mm": known.then(|| finding.touch_mm()),
        "error_mm": (measured && finding.bound_mm > finding.depth_mm).then_some(finding.bound_mm - finding.depth_mm),
        "clearance_mm": finding.clearance_mm().filter(|_| measured),
        "place_mm": measured.then(|| finding.place_mm.to_array()),
        "centre_mm": measured.then(|| finding.centre_mm.to_array()),
        "sample": measured.then_some(finding.sample),
        "uv": finding.uv.filter(|_| measured),
    })
}

/// The keys that could not be measured.
pub(super) fn not_measured(reach: &ReachResult) -> Option<&'static str> {
    (reach.verdict() == Verdict::Unknown).then_some("reach")
}

/// Places at which the tool does not reach the surface, or touches what it must not.
pub(super) fn marks(job: &Job, reach: &ReachResult) -> Vec<Mark> {
    let contact = reach
        .contact
        .at
        .filter(|_| reach.contact.verdict() == Verdict::Violated);
    let contact = contact.map(|at| Mark {
        what: format!("contact {:.3} mm above the equator", reach.contact.height_max_mm),
        place_mm: at.place_mm,
        tick: Some(at.sample as u64),
    });
    let touching = reach
        .findings
        .iter()
        .filter(|finding| finding.verdict() == Verdict::Violated);
    let touching = touching.map(|finding| Mark {
        what: format!(
            "{} {:.3} mm in {}",
            finding.part.name(),
            finding.depth_mm,
            finding.describe(job)
        ),
        place_mm: finding.place_mm,
        tick: Some(finding.sample as u64),
    });
    contact.into_iter().chain(touching).collect()
}

/// Prints the rows.
pub(super) fn print(job: &Job, reach: &ReachResult) {
    let contact = &reach.contact;
    if let Some(at) = contact.at {
        let side = if contact.height_max_mm > 0.0 {
            "above"
        } else {
            "below"
        };
        say!(
            "  {} {:<22} highest {:.4} mm {side} the ball's equator at u = {:.6}, v = {:.6}, pass {}; {} of {} contacts above it",
            mark(contact.verdict()),
            "reach: contact",
            contact.height_max_mm.abs(),
            at.uv[0],
            at.uv[1],
            at.pass,
            contact.above_equator,
            contact.contacts
        );
    }
    let facing = &reach.facing;
    if facing.down_share > 0.0 {
        let turn = match reach.rotate_deg {
            Some(turn) => format!("rotate_deg = {turn:?} turns it up"),
            None => "no turn makes all of it look up".to_owned(),
        };
        say!(
            "       {:<22} {:.3} % +- {:.3} of the surface looks down; {turn}",
            "",
            100.0 * facing.down_share,
            100.0 * facing.error_share
        );
    }
    for finding in &reach.findings {
        let name = format!("reach: {}", finding.part.name());
        let obstacle = finding.describe(job);
        let [x, y, z] = finding.place_mm.to_array();
        let place = format!("x = {x:.3}, y = {y:.3}, z = {z:.3}, tick {}", finding.sample);
        let error = finding.bound_mm - finding.depth_mm;
        let text = match (finding.verdict(), finding.clearance_mm()) {
            (Verdict::Violated, _) => format!(
                "{:.4} mm +- {error:.4} deep in {obstacle} at {place}",
                finding.depth_mm
            ),
            (Verdict::Unknown, _) => format!(
                "not measured: up to {:.4} mm in {obstacle} near {place}",
                finding.bound_mm
            ),
            (Verdict::Met, Some(clearance)) if finding.depth_mm.is_finite() => {
                format!("off {obstacle}, by {clearance:.3} mm at least; nearest at {place}")
            }
            (Verdict::Met, _) if (finding.part, finding.obstacle) == (ToolPart::Ball, Obstacle::Surface) => {
                format!("is not below {obstacle}")
            }
            (Verdict::Met, _) => format!("does not touch {obstacle}"),
        };
        say!("  {} {name:<22} {text}", mark(finding.verdict()));
    }
}
