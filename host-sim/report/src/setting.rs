//! What the view shows around the path: marks, links, the tool above the ball, stock, fixtures, home, safe height, travel.

use serde_json::{Value, json};

use super::content::Content;
use glam::DVec3;
use job::units::MM_PER_NM;
use job::{Block, Job};

/// Number of stored points of all links together.
const LINK_POINTS: usize = 20_000;
/// Least number of stored points of one link.
const LINK_POINTS_MIN: usize = 8;

/// A coordinate to the tenth of a micrometre.
fn short(mm: f64) -> f64 {
    (mm * 1e4).round() * 1e-4
}

fn place(mm: DVec3) -> [f64; 3] {
    mm.to_array().map(short)
}

/// Points of a link, evenly thinned, with both ends.
fn thinned(link: &[DVec3], most: usize) -> Vec<[f64; 3]> {
    let stride = link.len().div_ceil(most).max(1);
    let kept = link.iter().step_by(stride).copied();
    let last = link.last().filter(|_| !(link.len() - 1).is_multiple_of(stride));
    kept.chain(last.copied()).map(place).collect()
}

/// Profile of the tool above the ball's centre: radius and height, mm. The last part has no upper end; it is drawn up to `top_mm`.
fn profile(job: &Job, top_mm: f64) -> Vec<[f64; 2]> {
    let ball = job.radius_mm;
    let body = &job.body;
    let shank = 0.5 * body.shank_mm.unwrap_or(2.0 * ball);
    let from = body.neck_mm.unwrap_or(ball) - ball;
    let face = body.length_mm.map(|length| length - ball);
    let mut profile = vec![[ball, 0.0], [ball, from], [shank, from]];
    profile.push([shank, face.unwrap_or(top_mm.max(from))]);
    let mut z = face.unwrap_or_default();
    for part in &body.holder {
        profile.push([0.5 * part.diameter_mm[0], z]);
        z += part.length_mm;
        profile.push([0.5 * part.diameter_mm[1], z]);
    }
    profile
}

/// The key `setting` of the page's data.
pub(super) fn setting(content: &Content<'_>) -> Value {
    let (job, remarks) = (content.job, content.remarks);
    let most = (LINK_POINTS / remarks.links_mm.len().max(1)).max(LINK_POINTS_MIN);
    let block = |block: &Block| json!([block.low_mm, block.high_mm]);
    let tops = content.track.places().map(|nm| f64::from(nm[2]) * MM_PER_NM);
    let [low, high] = tops.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| {
        [low.min(z), high.max(z)]
    });
    let top_mm = (4.0 * job.radius_mm).max(if low < high { high - low } else { 0.0 });
    let machine = &job.machine;
    let links = &remarks.links_mm;
    let link_ends = links.first().and_then(|link| link.first()).copied();
    let home = machine
        .home_mm
        .map(DVec3::from)
        .or(link_ends.filter(|_| machine.has_limits()));
    let highest = content
        .mesh
        .points()
        .iter()
        .map(|point| point.z)
        .fold(f64::NEG_INFINITY, f64::max);
    // Without a number of its own it is that of the clearance between the ball and the highest point.
    let safe_z = machine.safe_z_mm.or_else(|| {
        machine
            .has_limits()
            .then_some(highest + job.radius_mm + machine.clearance_mm)
    });
    json!({
        "marks": remarks.marks.iter().map(|mark| json!({
            "what": mark.what, "place": place(mark.place_mm), "tick": mark.tick,
        })).collect::<Vec<_>>(),
        "links": links.iter().map(|link| thinned(link, most)).collect::<Vec<_>>(),
        "home": home.map(place),
        "safe_z": safe_z.map(short),
        "travel": machine.travel_mm.map(|[x, y, z]| [[x[0], y[0], z[0]], [x[1], y[1], z[1]]]),
        "stock": job.setup.stock.as_ref().map(block),
        "fixtures": job.setup.fixtures.iter().map(|fixture| json!({
            "name": fixture.name, "block": block(&fixture.block),
        })).collect::<Vec<_>>(),
        "tool": profile(job, top_mm),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_keep_their_ends() {
        let link: Vec<DVec3> = (0..1001).map(|k| DVec3::splat(f64::from(k))).collect();
        for most in [8, 9, 100, 1000, 5000] {
            let thin = thinned(&link, most);
            assert!(thin.len() <= most + 1, "{most}: {}", thin.len());
            assert_eq!((thin[0], thin[thin.len() - 1]), ([0.0; 3], [1000.0; 3]));
        }
        assert!(thinned(&[], 8).is_empty());
    }

    #[test]
    fn the_tool_is_drawn_from_its_centre() {
        let text = include_str!("../../../jobs/torus.toml").replace(
            "[tool]",
            "[tool]\nshank_mm = 4\nneck_mm = 8\nlength_mm = 30\nholder = { diameter_mm = [20, 40], length_mm = 10 }",
        );
        let job = job_file::parse("a", &text).unwrap();
        let exact = [
            [5.0, 0.0],
            [5.0, 3.0],
            [2.0, 3.0],
            [2.0, 25.0],
            [10.0, 25.0],
            [20.0, 35.0],
        ];
        assert_eq!(profile(&job, 50.0), exact);
    }
}
