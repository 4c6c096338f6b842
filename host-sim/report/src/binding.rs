//! The speed of a pass as emitted, beside the fastest motion within the limits and what binds it there.

use serde_json::{Value, json};

use super::embed::{column, words};
use verify::motion::{EmittedSpeed, PassTime, SpeedPoint};

/// Largest number of points of a pass.
const POINTS_MAX: usize = 1000;

/// A point of the chart: several periods of the fastest motion, and the samples of the run at the same place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BindingPoint {
    /// Length of the contact's path from the pass's beginning, mm.
    pub(super) arc_mm: f64,
    /// Least speed of the fastest motion's periods, mm/s.
    pub(super) limit_mm_s: f64,
    /// Index of the limit that binds, and the used share of it.
    pub(super) binding: u16,
    pub(super) share: f64,
    /// Share of the fastest motion's time.
    pub(super) time_share: f64,
    /// Least and largest speed as emitted, mm/s.
    pub(super) emitted_mm_s: [f64; 2],
    /// Tick of the sample there.
    pub(super) tick: u64,
}

/// The points of a pass; none without a motion.
pub(super) fn points(time: &PassTime) -> Vec<BindingPoint> {
    let stride = time.profile.len().div_ceil(POINTS_MAX).max(1);
    let groups: Vec<&[SpeedPoint]> = time.profile.chunks(stride).collect();
    let middle = |group: &[SpeedPoint]| group[group.len() / 2].arc_mm;
    let mut left = &time.emitted[..];
    let mut before = left.first();
    let mut points = Vec::with_capacity(groups.len());
    for (index, group) in groups.iter().enumerate() {
        let Some(most) = group.iter().max_by(|a, b| a.share.total_cmp(&b.share)) else {
            continue;
        };
        let arc_mm = middle(group);
        let until = groups
            .get(index + 1)
            .map_or(f64::INFINITY, |next| 0.5 * (arc_mm + middle(next)));
        let (here, later) = left.split_at(left.partition_point(|at| at.arc_mm < until));
        left = later;
        // Without a sample in the group: between the ones beside it.
        let Some(nearest) = here.first().or(before).or(later.first()) else {
            continue;
        };
        let speeds = || here.iter().map(|at| at.speed_mm_s);
        let emitted_mm_s = if here.is_empty() {
            [between(before, later.first(), arc_mm); 2]
        } else {
            [
                speeds().fold(f64::INFINITY, f64::min),
                speeds().fold(f64::NEG_INFINITY, f64::max),
            ]
        };
        before = here.last().or(before);
        points.push(BindingPoint {
            arc_mm,
            limit_mm_s: group.iter().map(|at| at.speed_mm_s).fold(f64::INFINITY, f64::min),
            binding: most.binding.index() as u16,
            share: most.share,
            time_share: group.len() as f64 / time.profile.len() as f64,
            emitted_mm_s,
            tick: nearest.tick,
        });
    }
    points
}

/// The speed at a place between two emitted ones.
fn between(before: Option<&EmittedSpeed>, after: Option<&EmittedSpeed>, arc_mm: f64) -> f64 {
    match (before, after) {
        (Some(a), Some(b)) if b.arc_mm > a.arc_mm => {
            let share = ((arc_mm - a.arc_mm) / (b.arc_mm - a.arc_mm)).clamp(0.0, 1.0);
            a.speed_mm_s + share * (b.speed_mm_s - a.speed_mm_s)
        }
        (Some(one), _) | (None, Some(one)) => one.speed_mm_s,
        (None, None) => f64::NAN,
    }
}

/// JSON of the passes that were solved and ran within limits.
pub(super) fn json(passes: &[PassTime]) -> Value {
    let passes = passes.iter().filter_map(|time| {
        let points = points(time);
        let ours_s = time.ours_s.filter(|_| !points.is_empty())?;
        let column = |of: fn(&BindingPoint) -> f64| column(points.iter().map(of));
        Some(json!({
            "pass": time.pass,
            "ours": ours_s,
            "optimum": time.best.feasible_s,
            "periods": time.profile.len().div_ceil(points.len()),
            "arc": column(|point| point.arc_mm),
            "limit": column(|point| point.limit_mm_s),
            "binds": words(points.iter().map(|point| point.binding)),
            "share": column(|point| point.share),
            "time": column(|point| point.time_share),
            "least": column(|point| point.emitted_mm_s[0]),
            "largest": column(|point| point.emitted_mm_s[1]),
            "ticks": points.iter().map(|point| point.tick).collect::<Vec<_>>(),
        }))
    });
    passes.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use verify::motion::{Binding, Optimum, PassEnd};

    /// 5000 periods of a limit that falls to a dip, where the acceleration of y binds, and samples with a dip of their own.
    fn pass() -> PassTime {
        let profile = (0..5000_u32).map(|k| {
            let dips = k == 3333;
            SpeedPoint {
                arc_mm: f64::from(k) * 0.01,
                speed_mm_s: if dips { 4.0 } else { 10.0 },
                binding: if dips {
                    Binding::Acceleration(1)
                } else {
                    Binding::Feed
                },
                share: if dips { 1.0 } else { 0.999 },
            }
        });
        let emitted = (0..2500_u32).map(|k| EmittedSpeed {
            tick: 100 + u64::from(k),
            arc_mm: f64::from(k) * 0.02,
            speed_mm_s: if k == 1666 { 3.0 } else { 9.9 },
        });
        PassTime {
            pass: 3,
            length_mm: 50.0,
            best: Optimum {
                lower_bound_s: 4.9,
                feasible_s: 5.0,
                uses: [1.0; 3],
            },
            ours_s: Some(5.1),
            ends: [PassEnd::Rest; 2],
            profile: profile.collect(),
            emitted: emitted.collect(),
        }
    }

    #[test]
    fn thinning_keeps_dips_and_what_binds_there() {
        let points = points(&pass());
        assert_eq!(points.len(), POINTS_MAX);
        let dip = points.iter().filter(|point| point.limit_mm_s < 5.0);
        let dip: Vec<_> = dip.collect();
        assert_eq!(dip.len(), 1);
        assert_eq!(usize::from(dip[0].binding), Binding::Acceleration(1).index());
        assert!((dip[0].arc_mm - 33.33).abs() < 0.05);
        let own = points.iter().filter(|point| point.emitted_mm_s[0] < 5.0);
        let own: Vec<_> = own.collect();
        assert_eq!((own.len(), own[0].emitted_mm_s[1]), (1, 9.9));
        assert!((own[0].arc_mm - 33.32).abs() < 0.05 && own[0].tick.abs_diff(1766) < 3);
        let whole: f64 = points.iter().map(|point| point.time_share).sum();
        assert!((whole - 1.0).abs() < 1e-9);
    }

    #[test]
    fn places_without_a_sample_are_interpolated() {
        let mut pass = pass();
        pass.profile.truncate(400);
        pass.emitted = vec![
            EmittedSpeed {
                tick: 0,
                arc_mm: 0.0,
                speed_mm_s: 2.0,
            },
            EmittedSpeed {
                tick: 9,
                arc_mm: 4.0,
                speed_mm_s: 6.0,
            },
        ];
        for point in points(&pass) {
            let exact = 2.0 + point.arc_mm.min(4.0);
            assert!((point.emitted_mm_s[0] - exact).abs() < 0.011, "{point:?}");
        }
        pass.emitted.clear();
        assert!(points(&pass).is_empty() && json(&[pass]).as_array().unwrap().is_empty());
    }
}
