//! Edges of polygons that cross.

use std::collections::HashSet;

use super::surface::Periodic;
use super::trim::Polygon;
use glam::DVec3;

/// Two edges that cross.
pub(super) struct Crossing {
    /// Least distance of an end of one edge from the other, mm.
    pub(super) depth_mm: f64,
    /// Where.
    pub(super) place_mm: DVec3,
}

type Segment = [[f64; 2]; 2];

/// The first crossing that is deeper than this, mm.
pub(super) fn crossing(on: &Periodic<'_>, polygons: &[Polygon], deeper_mm: f64) -> Option<Crossing> {
    let edges: Vec<Segment> = polygons
        .iter()
        .flat_map(|polygon| {
            let next = polygon.iter().cycle().skip(1);
            polygon.iter().zip(next).map(|(a, b)| [*a, *b])
        })
        .collect();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for place in edges.iter().flatten() {
        for k in 0..2 {
            low[k] = low[k].min(place[k]);
            high[k] = high[k].max(place[k]);
        }
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few hundred"
    )]
    let cells = ((edges.len() as f64).sqrt().ceil() as usize).clamp(1, 128);
    let cell = |place: f64, k: usize| {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the cells"
        )]
        let index = ((place - low[k]) / (high[k] - low[k]).max(f64::MIN_POSITIVE) * cells as f64) as usize;
        index.min(cells - 1)
    };
    let mut buckets: Vec<Vec<usize>> = vec![Vec::new(); cells * cells];
    for (index, [a, b]) in edges.iter().enumerate() {
        let range = |k: usize| cell(a[k].min(b[k]), k)..=cell(a[k].max(b[k]), k);
        for i in range(0) {
            for j in range(1) {
                buckets[i * cells + j].push(index);
            }
        }
    }
    let mut seen = HashSet::new();
    for bucket in &buckets {
        for (at, first) in bucket.iter().enumerate() {
            for second in &bucket[at + 1..] {
                if let Some([u, v]) = meet(&edges[*first], &edges[*second])
                    && seen.insert((*first, *second))
                {
                    let here = on.at(u, v);
                    let scale = [here.u.length(), here.v.length()];
                    let depth_mm = depth(&edges[*first], &edges[*second], scale);
                    if depth_mm > deeper_mm {
                        return Some(Crossing {
                            depth_mm,
                            place_mm: here.point,
                        });
                    }
                }
            }
        }
    }
    None
}

/// The place where two edges cross inside of both.
fn meet([a, b]: &Segment, [c, d]: &Segment) -> Option<[f64; 2]> {
    let (p, q) = ([b[0] - a[0], b[1] - a[1]], [d[0] - c[0], d[1] - c[1]]);
    let det = p[0] * q[1] - p[1] * q[0];
    let from = [c[0] - a[0], c[1] - a[1]];
    let (s, t) = (
        (from[0] * q[1] - from[1] * q[0]) / det,
        (from[0] * p[1] - from[1] * p[0]) / det,
    );
    let inside = |share: f64| share > 0.0 && share < 1.0;
    (det != 0.0 && inside(s) && inside(t)).then(|| [a[0] + s * p[0], a[1] + s * p[1]])
}

/// Least distance of an end of one edge from the other, mm.
fn depth(first: &Segment, second: &Segment, scale: [f64; 2]) -> f64 {
    let from = |p: [f64; 2], [a, b]: &Segment| {
        let d = [(b[0] - a[0]) * scale[0], (b[1] - a[1]) * scale[1]];
        let e = [(p[0] - a[0]) * scale[0], (p[1] - a[1]) * scale[1]];
        let share = ((e[0] * d[0] + e[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
        (e[0] - share * d[0]).hypot(e[1] - share * d[1])
    };
    let of =
        |edge: &Segment, other: &Segment| edge.iter().map(|p| from(*p, other)).fold(f64::INFINITY, f64::min);
    of(first, second).min(of(second, first))
}
