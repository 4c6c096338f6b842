//! Duration of the first, the middle and the last pass against the optimum within the limits, as text and as JSON.

use inspect::PassTime;
use serde_json::{Value, json};

use super::out::say;

/// Sums over the timed passes, and each pass; null if no pass was timed.
pub(super) fn json(times: &[PassTime]) -> Value {
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
                "bound_s": judged.best.lower_bound_s, "ours_s": judged.ours_s,
            })
        })
        .collect();
    json!({
        "optimum_s": sum(&|judged| judged.best.feasible_s), "bound_s": sum(&|judged| judged.best.lower_bound_s),
        "ours_s": ours, "passes": passes,
    })
}

/// Prints the figures as text.
pub(super) fn print(times: &[PassTime]) {
    for PassTime {
        pass,
        length_mm,
        best,
        ours_s,
    } in times
    {
        let (bound, optimum) = (best.lower_bound_s, best.feasible_s);
        let ours = ours_s.map_or_else(String::new, |ours| {
            format!("; ours {ours:.4} s, {:+.2} %", 100.0 * (ours / optimum - 1.0))
        });
        say!(
            "       {:<22} {length_mm:.2} mm: at least {bound:.4} s, optimum {optimum:.4} s{ours}",
            format!("motion, pass {pass}")
        );
    }
}
