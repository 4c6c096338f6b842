//! Text of the page.

use std::fmt::Write;

use super::{percent, shown};
use crate::paper::{Comparison, Study};
use approach::Kind;

/// Ripple and bytes of an approach on a job, as text.
fn ripple_and_bytes(comparison: &Comparison, kind: Kind) -> String {
    comparison.row(kind).map_or(String::new(), |row| {
        format!(
            "{} % with {} bytes",
            percent(row.measured.findings.report.ripple_pct.max),
            shown(row.measured.planned.bytes as f64, 0)
        )
    })
}

fn value(study: &Study, part: &str, what: &str) -> f64 {
    study
        .items
        .iter()
        .find(|item| item.part == part && item.what == what)
        .and_then(|item| item.ours)
        .unwrap_or(f64::NAN)
}

/// Title and summary.
pub(super) fn opening(out: &mut String, study: &Study) {
    let of = |part, what| value(study, part, what);
    let _ = writeln!(
        out,
        "<h1>A new approach to CNC tool path generation, reproduced</h1>\n\
         <p>C.-C. Lo, Computer-Aided Design 30 (1998), against the code of this project.</p>\n\
         <p class=\"lead\">The paper's claim holds. A ball-end mill whose centre runs at a constant speed cuts Example 1's bell at \
         {:.1} to {:.1} mm/s instead of 10; an interpolator that receives the surface instead of a path holds 10 mm/s within \
         rounding.",
        of("Example 1", "slowest contact at constant speed of the centre"),
        of("Example 1", "fastest contact at constant speed of the centre"),
    );
    if let Some(freeform) = study.comparisons.iter().find(|of| of.name == "freeform") {
        let _ = writeln!(
            out,
            "On a freeform part that is not in the paper, at the same scallop height, tolerance and feed, the contact's speed \
             deviates by {} with straight segments, {} with cubics, and {} with the surface.",
            ripple_and_bytes(freeform, Kind::Linear),
            ripple_and_bytes(freeform, Kind::Curve),
            ripple_and_bytes(freeform, Kind::Surface)
        );
    }
    let _ = writeln!(
        out,
        "</p>\n<p class=\"lead\">The numbers of Examples 1, 4 and 5 are reproduced to the last digit. Those of \
         Example 2 do not belong to the printed surface, but to a simpler one. The paper's rule for the length of straight \
         segments exceeds its own tolerance {:.0} times where the profile turns from convex to concave.</p>",
        of("Example 3", "chord error that eqn 6 leaves") / study.cases.revolved.job.chord_mm
    );
}

/// Contradictions between the paper's equations and its results.
pub(super) fn disagreements(out: &mut String, study: &Study) {
    let of = |part, what| value(study, part, what);
    let _ = writeln!(
        out,
        "<section><h2>Where the print and the results disagree</h2>\n<ul>\n\
         <li><b>Example 2's surface.</b> As printed, both x and y carry −30u² + 60u. That surface takes {:.2} and {:.2} min \
         ({:.1} % saved) in {:.0} segments a pass, not the paper's 14.2 and 10.7 min (25 %) in 44. With those terms in y alone it takes \
         {:.2} and {:.2} min ({:.1} %) in {:.0}: the paper's results, but for half a per cent of the first. Both are shown; \
         pictures and comparison are of the reconstructed one.</li>\n\
         <li><b>Eqn 6.</b> The chord's length follows from the curvature where it begins. On Example 1 it gives the printed 46 segments; \
         one of them spans the inflection and leaves the surface by {:.3} mm, with a tolerance of 0.005 mm. Within the tolerance, {:.0} \
         segments a pass are needed. Figure 7 shows both.</li>\n\
         <li><b>Which curvature</b> eqn 6 means, of the path as a curve or of the surface along it, the paper does not say. On Example 1 \
         they are equal; on Example 2 the printed 44 follows from that of the curve.</li>\n\
         <li><b>Eqns 10, 11.</b> The paper prints the same product above and below the line of α, and M twice in the normal curvature. \
         We use α = −(A·B)/(A·A) and L, 2M, N; they reproduce the printed numbers of passes.</li>\n</ul></section>",
        of("Example 2", "as printed: time at constant speed of the centre"),
        of("Example 2", "as printed: time at constant speed of the contact"),
        of("Example 2", "as printed: time saved"),
        of("Example 2", "as printed: segments a pass, curvature of the curve"),
        of("Example 2", "reconstructed: time at constant speed of the centre"),
        of(
            "Example 2",
            "reconstructed: time at constant speed of the contact"
        ),
        of("Example 2", "reconstructed: time saved"),
        of(
            "Example 2",
            "reconstructed: segments a pass, curvature of the curve"
        ),
        of("Example 3", "chord error that eqn 6 leaves"),
        of("Example 3", "segments a pass that hold the tolerance"),
    );
}

/// Method of measurement.
pub(super) fn closing(out: &mut String) {
    out.push_str(
        "<section><h2>How this was measured</h2>\n<ul>\n\
         <li>Speeds are lengths over one period: of the contact by quadrature of |S<sub>u</sub>| between two samples, of the centre \
         between the commanded points. Ripple is the deviation of the contact's speed from the programmed feed, in every period but the last \
         of a pass, which is shorter.</li>\n\
         <li>Where an approach commands the centre, the contact is the foot of that centre on the exact offset path.</li>\n\
         <li><code>constant-cl</code> follows the exact offset path, so that it shows the effect of the constant speed alone; its data \
         are the chords of a conventional program.</li>\n\
         <li><code>linear</code> keeps the tolerance by measured errors, except where eqn 6 is named, and divides each segment into equal steps, \
         their number rounded up.</li>\n\
         <li><code>curve</code> receives a cubic for the path and one for the speed in each block, written as polynomial blocks with a feed polynomial.</li>\n\
         <li><code>surface</code> is the core that runs on the board. The others are in f64 and share no code with it.</li>\n\
         <li>Bytes are those of the program: G-code or polynomial blocks with four decimals; for <code>surface</code> the header and the surface.</li>\n\
         <li>The paper's pictures are not available. Figures 3, 4, 5, 7, 8 and 9 are reconstructed from the examples that they belong to.</li>\n</ul></section>\n\
         <footer>Written by <code>cargo sim paper</code>. The figures' data are beside this page, in <code>figures.json</code>.</footer>\n",
    );
}
