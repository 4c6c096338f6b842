//! The picture of a part: what is finished, what is not.

use std::sync::Arc;

use cad::{Face, MachinableFace, Model};
use part::{Reason, State};

use super::super::page::{PartRow, part_page};
use super::face::{Asked, Outcome};
use super::setup::Setup;
use super::summary::Sums;

/// Cells of a picture a side of a face as large as the part, and the least and the most of a face: of a part of few faces, and of many.
const CELLS: f64 = 80.0;
const CELLS_OF_FACE: [[f64; 2]; 2] = [[24.0, 48.0], [6.0, 32.0]];
/// Faces from which they are many.
const MANY: usize = 100;
/// Share of a face, percent, from which it counts as finished.
const ALL: f64 = 99.5;

/// A face in cells, each with its colour: smaller ones on larger faces.
pub(super) fn cells(
    asked: &Asked<'_>,
    face: &Face,
    made: &MachinableFace,
    found: &Outcome,
) -> Vec<([u8; 3], [[f64; 3]; 4])> {
    let block = asked.part.block();
    let share = cad::measure(&made.spec())
        .size_mm()
        .into_iter()
        .fold(0.0, f64::max)
        / (block.high - block.low).max_element();
    let [least, most] = CELLS_OF_FACE[usize::from(asked.part.faces.len() > MANY)];
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let side = (CELLS * share).clamp(least, most) as usize;
    let loops = found
        .region
        .as_ref()
        .map_or([].as_slice(), |(region, _)| region.loops.as_slice());
    let sign = if found.side == "-" { -1.0 } else { 1.0 };
    let cells = asked.of(face, sign, made, |request| request.picture(loops, side));
    cells
        .into_iter()
        .map(|(state, corners)| (tint(state), corners.map(|corner| corner.to_array())))
        .collect()
}

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
pub(super) fn page(
    file: &str,
    model: &Arc<Model>,
    setup: &Setup,
    order: &[usize],
    outcomes: &[Outcome],
) -> String {
    let placed: Vec<(usize, Face)> = outcomes
        .iter()
        .enumerate()
        .filter_map(|(index, outcome)| {
            let face = model.faces.get(outcome.number - 1)?;
            Some((index, face.placed(&setup.placement)?))
        })
        .collect();
    let rows: Vec<PartRow<'_>> = placed
        .iter()
        .map(|(index, face)| {
            let outcome = &outcomes[*index];
            let reach = outcome.reach.as_ref();
            let worst =
                reach.and_then(|reach| reach.unreachable_mm2.iter().max_by(|a, b| a.1.total_cmp(&b.1)));
            let rest = match worst {
                Some((reason, _)) if reason == "steep" => tint(State::Unreachable(Reason::Steep)),
                Some(_) => tint(State::Unreachable(Reason::Ball)),
                None => tint(State::Left),
            };
            let (state, tint) = match (&outcome.job, reach, &outcome.refused) {
                (Some(_), Some(reach), _) => {
                    let share = Sums::share(reach.region_mm2, reach.area_mm2);
                    let tint = if share > ALL { tint(State::Finished) } else { rest };
                    (format!("{share:.2} % finished"), tint)
                }
                (None, _, Some(why)) => (why.clone(), NOT_IMPORTED),
                (_, Some(_), _) => match worst {
                    Some((reason, _)) => (format!("unreachable: {reason}"), rest),
                    None => ("empty".to_owned(), rest),
                },
                _ => ("not known".to_owned(), NOT_IMPORTED),
            };
            let region = outcome.region.as_ref().map_or_else(Vec::new, |(region, spec)| {
                let surface = oracle::Surface::new(spec);
                let point = |place: &[f64; 2]| surface.at(place[0], place[1]).point.to_array();
                region
                    .loops
                    .iter()
                    .map(|ring| dense(ring).iter().map(point).collect())
                    .collect()
            });
            PartRow {
                face,
                area_mm2: reach.map(|reach| reach.area_mm2),
                state,
                job: outcome.job.as_ref().map(|path| path.display().to_string()),
                region,
                cells: &outcome.cells,
                tint,
                run: order.iter().position(|of| of == index).map(|place| place + 1),
            }
        })
        .collect();
    let sums = Sums::of(outcomes);
    let entry = |state: State, words: String| (Some(tint(state)), words);
    let passes_min = outcomes.iter().map(Outcome::passes_s).sum::<f64>() / 60.0;
    let share = Sums::share(sums.region, sums.reachable);
    let legend = [
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
                order.len(),
                outcomes.len(),
                setup.up.name()
            ),
        ),
    ];
    part_page(file, &legend, &rows)
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
