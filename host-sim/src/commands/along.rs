//! The direction of the passes and how it was chosen, as text and as JSON, for all commands.

use serde_json::{Map, Value, json};

use job::{AlongChoice, DirectionTrial, Job};

/// The keys `along` and `along_auto`: null where the job file names the direction.
pub(super) fn json(job: &Job) -> Map<String, Value> {
    let trial = |trial: &DirectionTrial| {
        #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
        let time_s = trial.ticks as f64 * job.machine.period_s();
        json!({
            "ticks": trial.ticks,
            "machining_time_s": trial.rejection.is_none().then_some(time_s),
            "against": trial.rejection,
        })
    };
    let auto = match job.origin.along_choice() {
        AlongChoice::Chosen([u, v]) => json!({ "u": trial(u), "v": trial(v) }),
        _ => Value::Null,
    };
    let mut keys = Map::new();
    keys.insert("along".to_owned(), json!(job.along.name()));
    keys.insert("along_auto".to_owned(), auto);
    keys
}

/// The direction; if it was chosen automatically, with the machining times of both directions.
pub(super) fn sentence(job: &Job) -> String {
    let chosen = job.along.name();
    let AlongChoice::Chosen(trials) = job.origin.along_choice() else {
        return chosen.to_owned();
    };
    let (mine, other) = match trials {
        [u, v] if u.along == job.along => (u, v),
        [u, v] => (v, u),
    };
    if let Some(rejection) = &other.rejection {
        return format!("{chosen}, chosen; along {}: {rejection}", other.along.name());
    }
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let minutes = |trial: &DirectionTrial| trial.ticks as f64 * job.machine.period_s() / 60.0;
    let (least, most) = (minutes(mine), minutes(other));
    let less = 100.0 * (1.0 - least / most.max(f64::MIN_POSITIVE));
    format!(
        "{chosen}, chosen: {least:.2} min, {less:.1} % less than the {most:.2} min along {}",
        other.along.name()
    )
}
