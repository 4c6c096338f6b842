//! Direction and spacing of the passes, and how they were chosen, as text and as JSON, for all commands.

use inspect::{CurvedFigures, PathFigures};
use serde_json::{Map, Value, json};

use job::units::S_PER_MIN;
use job::{AlongChoice, DirectionTrial, Job, SpacingTrial, Start, StartChoice};

/// The keys `along` and `along_auto`: null where the job file names the direction.
pub(super) fn json(job: &Job) -> Map<String, Value> {
    let trial = |trial: &DirectionTrial| {
        let time_s = job.machine.time_s(trial.ticks);
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
    let started = |trial: &SpacingTrial| {
        json!({
            "ticks": trial.ticks,
            "machining_time_s": trial.rejection.is_none().then_some(job.machine.time_s(trial.ticks)),
            "against": trial.rejection,
        })
    };
    let start_auto = match job.origin.start_choice() {
        StartChoice::Chosen([edge, middle]) => json!({ "edge": started(edge), "middle": started(middle) }),
        _ => Value::Null,
    };
    let mut keys = Map::new();
    keys.insert("spacing".to_owned(), json!(job.spacing.name()));
    keys.insert("start".to_owned(), json!(job.spacing.start().map(Start::name)));
    keys.insert("start_auto".to_owned(), start_auto);
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
    let minutes = |trial: &DirectionTrial| job.machine.time_s(trial.ticks) / S_PER_MIN;
    let (least, most) = (minutes(mine), minutes(other));
    let less = 100.0 * (1.0 - least / most.max(f64::MIN_POSITIVE));
    format!(
        "{chosen}, chosen: {least:.2} min, {less:.1} % less than the {most:.2} min along {}",
        other.along.name()
    )
}

/// The start of passes of constant scallop height; if it was chosen automatically, with the machining times of both. `None` for straight passes.
pub(super) fn start_sentence(job: &Job) -> Option<String> {
    let start = job.spacing.start()?;
    let chosen = match start {
        Start::Edge => "from the edge",
        Start::Middle => "from the middle",
    };
    let StartChoice::Chosen([edge, middle]) = job.origin.start_choice() else {
        return Some(chosen.to_owned());
    };
    let (mine, other, from) = match start {
        Start::Edge => (edge, middle, "from the middle"),
        Start::Middle => (middle, edge, "from the edge"),
    };
    if let Some(rejection) = &other.rejection {
        return Some(format!("{chosen}, chosen; {from}: {rejection}"));
    }
    let [least, most] = [mine, other].map(|trial| job.machine.time_s(trial.ticks) / S_PER_MIN);
    let less = 100.0 * (1.0 - least / most.max(f64::MIN_POSITIVE));
    Some(format!(
        "{chosen}, chosen: {least:.2} min, {less:.1} % less than the {most:.2} min {from}"
    ))
}

/// The key `curved`: passes of constant scallop height beside straight ones.
pub(super) fn curved_json(figures: &CurvedFigures) -> Value {
    let saved = figures.saved();
    let path = |path: &PathFigures| {
        json!({
            "passes": path.passes, "partial_passes": path.partial, "cc_length_mm": path.length_mm, "machining_time_s": path.time_s,
        })
    };
    json!({
        "passes": figures.own.passes,
        "partial_passes": figures.own.partial,
        "cc_length_mm": figures.own.length_mm,
        "straight": figures.straight.as_ref().map(path),
        "length_saved_pct": saved.map(|[length, _]| 100.0 * length),
        "time_saved_pct": saved.map(|[_, time]| 100.0 * time),
    })
}

/// Names and values of the same.
pub(super) fn curved_words(figures: &CurvedFigures) -> Vec<(&'static str, String)> {
    let own = &figures.own;
    let mut words = vec![(
        "Curved passes",
        format!("{}, {} of them partial", own.passes, own.partial),
    )];
    let Some((straight, [length, time])) = figures.straight.as_ref().zip(figures.saved()) else {
        words.push((
            "Straight passes",
            "the core does not machine the job with them".to_owned(),
        ));
        return words;
    };
    let share = |saved: f64| {
        let word = if saved < 0.0 { "more" } else { "less" };
        format!("{:.1} % {word}", 100.0 * saved.abs())
    };
    words.push((
        "Length against straight passes",
        format!(
            "{:.1} mm, {} than {:.1} mm of {} passes",
            own.length_mm,
            share(length),
            straight.length_mm,
            straight.passes
        ),
    ));
    words.push((
        "Time against straight passes",
        format!(
            "{:.1} s, {} than {:.1} s",
            own.time_s,
            share(time),
            straight.time_s
        ),
    ));
    words
}
