//! The picture of a part: which places are finished, and which are not, and why.

use cad::Face;
use job::FaceReach;
use part::{Reason, State};
use part_program::{FacePlan, Sums, percent};

use super::super::page::{LegendEntry, PartRow, part_page};
use super::Planned;

/// Percent of a face from which it counts as finished.
const ALL: f64 = 99.5;

/// The colour of a place.
fn tint(state: State) -> [u8; 3] {
    match state {
        State::Finished => [60, 170, 80],
        State::Left => [220, 150, 110],
        State::Unreachable(Reason::Steep) => [165, 175, 185],
        State::Unreachable(_) => [210, 80, 70],
    }
}

/// The page: what is finished, what is not.
pub(super) fn page(planned: &Planned<'_>) -> String {
    let placed: Vec<(usize, Face)> = planned
        .plans
        .iter()
        .enumerate()
        .filter_map(|(index, plan)| {
            let face = planned.model.faces.get(plan.number - 1)?;
            Some((index, face.placed(&planned.setup.placement)?))
        })
        .collect();
    let rows: Vec<PartRow<'_>> = placed
        .iter()
        .map(|(index, face)| row(planned, *index, face))
        .collect();
    part_page(planned.file, &legend(planned), &rows)
}

/// A face, placed, as the page shows it.
fn row<'f>(planned: &Planned<'_>, index: usize, face: &'f Face) -> PartRow<'f> {
    let plan = &planned.plans[index];
    let reach = plan.reach.as_ref();
    let (state, tint) = state(plan, reach);
    let region = plan.job.as_ref().map_or_else(Vec::new, |job| {
        let surface = oracle::Surface::new(&job.surface);
        let point = |place: &[f64; 2]| surface.at(place[0], place[1]).point.to_array();
        let loops = job.region.loops.iter();
        loops
            .map(|ring| dense(ring).iter().map(point).collect())
            .collect()
    });
    let cells = plan.cells.iter();
    PartRow {
        face,
        area_mm2: reach.map(|reach| reach.area_mm2),
        state,
        job: planned.jobs[index]
            .as_ref()
            .map(|path| path.display().to_string()),
        region,
        cells: cells
            .map(|(state, corners)| (self::tint(*state), *corners))
            .collect(),
        tint,
        run: (planned.order.faces.iter())
            .position(|of| *of == index)
            .map(|place| place + 1),
    }
}

/// What becomes of a face, in words, and its colour.
fn state(plan: &FacePlan, reach: Option<&FaceReach>) -> (String, [u8; 3]) {
    let worst = reach.and_then(|reach| reach.unreachable_mm2.iter().max_by(|a, b| a.1.total_cmp(&b.1)));
    let rest = match worst {
        Some((reason, _)) if reason == "steep" => tint(State::Unreachable(Reason::Steep)),
        Some(_) => tint(State::Unreachable(Reason::Ball)),
        None => tint(State::Left),
    };
    match (&plan.job, reach, &plan.refused) {
        (Some(_), Some(reach), _) => {
            let share = percent(reach.region_mm2, reach.area_mm2);
            let tint = if share > ALL { tint(State::Finished) } else { rest };
            (format!("{share:.2} % finished"), tint)
        }
        (None, _, Some(why)) => (why.to_string(), NOT_IMPORTED),
        (_, Some(_), _) => match worst {
            Some((reason, _)) => (format!("unreachable: {reason}"), rest),
            None => ("empty".to_owned(), rest),
        },
        _ => ("not known".to_owned(), NOT_IMPORTED),
    }
}

/// What the colours stand for, and how much is machined.
fn legend(planned: &Planned<'_>) -> [LegendEntry; 6] {
    let sums = Sums::of(planned.plans);
    let entry = |state: State, words: String| (Some(tint(state)), words);
    let passes_min = planned.plans.iter().map(FacePlan::passes_s).sum::<f64>() / job::units::S_PER_MIN;
    let share = percent(sums.region_mm2, sums.reachable_mm2);
    [
        entry(
            State::Finished,
            format!("finished: {share:.2} % of what the tool reaches"),
        ),
        entry(State::Left, "reached, but left".to_owned()),
        entry(
            State::Unreachable(Reason::Ball),
            "the tool does not reach it".to_owned(),
        ),
        entry(
            State::Unreachable(Reason::Steep),
            "too steep, or looks down".to_owned(),
        ),
        (Some(NOT_IMPORTED), "not imported".to_owned()),
        (
            None,
            format!(
                "{} of {} faces are machined, passes about {passes_min:.1} min, {} up",
                planned.order.faces.len(),
                planned.plans.len(),
                planned.setup.side.name()
            ),
        ),
    ]
}

/// The colour of a face that is not known.
const NOT_IMPORTED: [u8; 3] = [200, 80, 200];

/// A ring with places between its vertices: on a curved surface an edge is no line.
fn dense(ring: &[[f64; 2]]) -> Vec<[f64; 2]> {
    const BETWEEN: usize = 8;
    if ring.len() > 20 * BETWEEN {
        return ring.to_vec();
    }
    let next = ring.iter().cycle().skip(1);
    let ends = ring.iter().zip(next);
    ends.flat_map(|(a, b)| {
        (0..BETWEEN).map(move |k| {
            let share = k as f64 / BETWEEN as f64;
            [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
        })
    })
    .collect()
}
