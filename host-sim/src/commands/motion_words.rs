//! The time of a job: its parts, stands in contact, passes against the optimum within the limits; as text and as JSON.

use serde_json::{Map, Value, json};
use verify::motion::{JobTimes, OptimumTimes, PassEnd, PassTime};

use super::out::say;

/// Stands in contact that are listed.
const STANDS_LISTED: usize = 20;

/// The keys of `verify` on time.
pub(super) fn json(times: &JobTimes, optimum: &OptimumTimes) -> Map<String, Value> {
    let stands: Vec<Value> = longest(times)
        .iter()
        .map(|stand| {
            json!({
                "time_s": stand.time_s, "tick": stand.tick, "pass": stand.pass, "place": stand.place.name(), "cause": stand.place.cause(),
                "centre_mm": stand.centre_mm.to_array(),
            })
        })
        .collect();
    let value = json!({
        "time_s": {
            "whole": times.whole_s, "at_feed": times.at_feed_s, "ramps": times.ramps_s, "turns": times.turns_s, "links": times.links_s,
            "standing": times.standing_s,
        },
        "standing_max_s": times.standing_max_s,
        "stands": stands,
        "optimum_ratio_max": optimum.ratio_max,
        "optimum_ratio_whole": optimum.whole_ratio,
        "motion": motion(optimum),
    });
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// The longest stands in contact, longest first.
fn longest(times: &JobTimes) -> Vec<&verify::motion::Stand> {
    let mut stands: Vec<_> = times.stands.iter().collect();
    stands.sort_by(|a, b| b.time_s.total_cmp(&a.time_s));
    stands.truncate(STANDS_LISTED);
    stands
}

/// Sums over the timed passes, and each pass; null if no pass was timed.
fn motion(optimum: &OptimumTimes) -> Value {
    let times = &optimum.passes;
    if times.is_empty() {
        return Value::Null;
    }
    let sum = |of: &dyn Fn(&PassTime) -> f64| times.iter().map(of).sum::<f64>();
    let ours: Option<f64> = times.iter().map(|judged| judged.ours_s).sum();
    let passes: Vec<Value> = times
        .iter()
        .map(|judged| {
            json!({
                "pass": judged.pass, "length_mm": judged.length_mm, "optimum_s": judged.best.feasible_s,
                "bound_s": judged.best.lower_bound_s, "ours_s": judged.ours_s, "ratio": judged.ratio(),
                "ends": judged.ends.map(end_name),
            })
        })
        .collect();
    json!({
        "optimum_s": sum(&|judged| judged.best.feasible_s), "bound_s": sum(&|judged| judged.best.lower_bound_s),
        "ours_s": ours, "ratio_bound_others": optimum.ratio_bound, "passes": passes,
    })
}

/// The name of an end in JSON.
fn end_name(end: PassEnd) -> &'static str {
    match end {
        PassEnd::Rest => "rest",
        PassEnd::Free => "free",
    }
}

fn row(name: &str, text: &str) {
    say!("       {name:<22} {text}");
}

/// Prints the figures as text.
pub(super) fn print(times: &JobTimes, optimum: &OptimumTimes) {
    let share = |part_s: f64| 100.0 * part_s / times.whole_s.max(f64::MIN_POSITIVE);
    row(
        "time",
        &format!(
            "{:.2} s: at the feed {:.1} %, ramps {:.1} %, turns {:.1} %, links {:.1} %, standing {:.1} %",
            times.whole_s,
            share(times.at_feed_s),
            share(times.ramps_s),
            share(times.turns_s),
            share(times.links_s),
            share(times.standing_s)
        ),
    );
    row(
        "longest stand",
        &format!(
            "{:.0} ms in contact; {} above {:.0} ms",
            1e3 * times.standing_max_s,
            times.stands.len(),
            1e3 * times.stand_max_s
        ),
    );
    for judged in &optimum.passes {
        let (bound, best) = (judged.best.lower_bound_s, judged.best.feasible_s);
        let ours = judged.ours_s.map_or_else(String::new, |ours| {
            format!("; ours {ours:.4} s, {:+.2} %", 100.0 * (ours / best - 1.0))
        });
        row(
            &format!("motion, pass {}", judged.pass),
            &format!(
                "{:.2} mm: at least {bound:.4} s, optimum {best:.4} s{ours}{}",
                judged.length_mm,
                match judged.ends {
                    [PassEnd::Rest, PassEnd::Rest] => "",
                    [PassEnd::Rest, PassEnd::Free] => "; end free",
                    [PassEnd::Free, PassEnd::Rest] => "; beginning free",
                    [PassEnd::Free, PassEnd::Free] => "; both ends free",
                }
            ),
        );
    }
    if let Some(worst) = optimum.ratio_max {
        let others = if optimum.ratio_bound > worst {
            format!(
                "; the passes not solved are at most {:.4} of their optimum",
                optimum.ratio_bound
            )
        } else {
            ", the most of all passes".to_owned()
        };
        let whole = optimum
            .whole_ratio
            .map_or_else(String::new, |ratio| format!("; the whole job at most {ratio:.4}"));
        row("time over optimum", &format!("{worst:.4}{others}{whole}"));
        if optimum.free_ends > 0 {
            row(
                "",
                "free ends: where the tool turns beyond the boundary, the optimum passes it at any speed",
            );
        }
    }
}
