//! How long the passes of a face take along each parameter, about.

use job::{Along, Region};

/// Most lines that are looked at for the direction of the passes, parts of an interval, and the time that each interval costs beside its length, s.
const LINES_MAX: usize = 4000;
const PARTS: u32 = 8;
const INTERVAL_S: f64 = 0.15;

/// Time of the passes along a parameter about, s: their length at the feed, and some time for each.
pub(super) fn effort_s(
    surface: &oracle::Surface,
    region: &Region,
    along: Along,
    step_over_mm: f64,
    feed_mm_s: f64,
) -> f64 {
    let swapped = |[u, v]: [f64; 2]| match along {
        Along::U => [u, v],
        Along::V => [v, u],
    };
    // Lengths of the derivatives along the pass and across it.
    let speeds = |path: f64, side: f64| {
        let [u, v] = swapped([path, side]);
        let at = surface.at(u, v);
        swapped([at.u.length(), at.v.length()])
    };
    let edges: Vec<[[f64; 2]; 2]> = region.edges().map(|ends| ends.map(swapped)).collect();
    let sides = || edges.iter().flatten().map(|end| end[1]);
    let (low, high) = (
        sides().fold(f64::INFINITY, f64::min),
        sides().fold(f64::NEG_INFINITY, f64::max),
    );
    let (mut side, mut sum) = (low, 0.0);
    for _ in 0..LINES_MAX {
        let met = |ends: &&[[f64; 2]; 2]| (ends[0][1] <= side) != (ends[1][1] <= side);
        let mut crossings: Vec<f64> = edges
            .iter()
            .filter(met)
            .map(|[a, b]| a[0] + (side - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
            .collect();
        crossings.sort_by(f64::total_cmp);
        let mut widest = 0.0_f64;
        for [from, to] in crossings.as_chunks::<2>().0 {
            for part in 0..PARTS {
                let share = (f64::from(part) + 0.5) / f64::from(PARTS);
                let [speed, across] = speeds(from + share * (to - from), side);
                sum += speed * (to - from) / f64::from(PARTS) / feed_mm_s;
                widest = widest.max(across);
            }
            sum += INTERVAL_S;
        }
        let step = if widest > 0.0 {
            step_over_mm / widest
        } else {
            (high - low) / 100.0
        };
        side += step.max((high - low) / LINES_MAX as f64);
        if side >= high {
            break;
        }
    }
    sum
}
