//! Streamed jobs with a region: a first pass beyond the first row, cells that begin below the end of the one before, gaps wider than the ring, links.

use interp_core::job::links::Detour;
use job::{Job, Region};
use machine::direction;
use machine::links::{self, Link};
use machine::prepare::{Prepared, prepare, streamed};

use super::{CUTS, Outcome, Streamed, bumpy, room, whole};

/// Patches of 2 mm.
fn job(cut: usize, patches: [usize; 2], region: Region) -> Job {
    let (cut, machine) = CUTS[cut];
    let mut job = bumpy(patches, [2.0, 2.0], cut, machine);
    job.region = Some(region);
    job
}

/// The job with its region divided into cells.
pub(super) fn in_cells(cut: usize, patches: [usize; 2], region: Region) -> Job {
    let (job, _) = direction::choose(job(cut, patches, region)).unwrap();
    assert!(job.region.as_ref().unwrap().cells.len() > 1);
    job
}

fn rectangle([u0, u1]: [f64; 2], [v0, v1]: [f64; 2]) -> Vec<[f64; 2]> {
    vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1]]
}

/// On 5 patches times `share`: with a hole, so that two cells lie beside each other and begin in the same row; not from the first row on.
pub(super) fn with_hole(share: f64) -> Region {
    let outer = vec![[0.3, 5.6], [5.0, 6.3], [4.6, 19.1], [2.2, 17.7], [0.0, 19.4]];
    let loops = [outer, rectangle([1.3, 3.1], [8.4, 15.2])];
    let scaled = |points: Vec<[f64; 2]>| points.into_iter().map(|[u, v]| [share * u, v]).collect();
    Region::new(loops.into_iter().map(scaled).collect())
}

/// Two parts with a gap of 13 rows between them.
fn with_gap() -> Region {
    Region::new(vec![
        rectangle([0.4, 4.1], [0.7, 3.9]),
        vec![[0.9, 17.2], [4.8, 17.9], [2.1, 21.5]],
    ])
}

/// Two combs side by side, and a long spike that holds no pass.
fn with_spike() -> Region {
    Region::new(vec![
        vec![[0.2, 2.1], [2.2, 2.4], [1.7, 20.9]],
        vec![[2.9, 3.3], [4.9, 1.2], [4.4, 4.0], [4.0005, 18.0], [4.0, 4.4]],
    ])
}

/// Digests equal to those of the job that is no stream, with rings of several sizes and words that come late.
fn check(about: &str, job: &Prepared) {
    assert_eq!(job.header.window, 0);
    let wanted = whole(job);
    let job = streamed(job, 3);
    println!(
        "{about}: {} strips of {} rows, {} at once",
        job.header.strips,
        job.words.len() / interp_core::job::stream::row_words(&job.header),
        job.least_rows
    );
    assert_eq!(whole(&job), wanted, "{about}, all rows");
    for rows in [job.least_rows, job.least_rows + 1] {
        for late in [None, Some(1)] {
            let outcome = Streamed::new(&job, room(&job, rows)).run(late);
            assert!(late.is_none() || outcome.starved > 0);
            let outcome = Outcome {
                starved: 0,
                ..outcome
            };
            assert_eq!(outcome, wanted, "{about}, {rows} rows, late {late:?}");
        }
    }
}

#[test]
fn a_streamed_region_is_the_whole_one() {
    for cut in 0..CUTS.len() {
        for (name, region) in [
            ("hole", with_hole(1.0)),
            ("gap", with_gap()),
            ("spike", with_spike()),
        ] {
            let by_line = job(cut, [5, 24], region);
            check(&format!("{cut}, {name}, by line"), &prepare(&by_line).unwrap());
            let (in_cells, _) = direction::choose(by_line).unwrap();
            if !in_cells.region.as_ref().unwrap().cells.is_empty() {
                check(&format!("{cut}, {name}, in cells"), &prepare(&in_cells).unwrap());
            }
        }
    }
}

/// Rows of half an interval: the window cuts intervals short, in the same way whatever the ring.
#[test]
fn narrow_rows() {
    for (text, machine) in CUTS {
        for window in [3, 4, 7] {
            let mut job = bumpy([3, 40], [5.0, 0.2], text, machine);
            job.region = Some(Region::new(vec![
                rectangle([0.1, 2.9], [3.3, 38.2]),
                rectangle([0.7, 1.4], [11.1, 29.7]),
            ]));
            let (job, _) = direction::choose(job).unwrap();
            let job = streamed(&prepare(&job).unwrap(), window);
            let wanted = whole(&job);
            for rows in [job.least_rows, job.least_rows + 2] {
                for late in [None, Some(3)] {
                    let outcome = Streamed::new(&job, room(&job, rows)).run(late);
                    let outcome = Outcome {
                        starved: 0,
                        ..outcome
                    };
                    assert_eq!(
                        outcome, wanted,
                        "{text}, window {window}, {rows} rows, late {late:?}"
                    );
                }
            }
        }
    }
}

/// Links of every kind.
#[test]
fn links_are_words_before_the_rows() {
    for (cut, region) in [(3, with_hole(1.0)), (4, with_hole(1.0)), (4, with_gap())] {
        let (job, _) = direction::choose(job(cut, [5, 24], region)).unwrap();
        let safe = prepare(&job).unwrap();
        let ways: Vec<Link> = (links::between(&links::passes(&safe)).iter().zip(0_u32..))
            .map(|([from, to], index)| match index % 3 {
                0 => Link::Straight,
                1 => Link::Across(from[2].max(to[2]) + 300_000),
                _ => Link::Around(Detour { aside: 9, rise: 30 }),
            })
            .collect();
        assert!(ways.len() > 10);
        let mut low = safe.clone();
        links::add(&mut low, &ways);
        check(&format!("{cut}, links"), &low);
        // Given to the streamed job, they are the same words.
        let mut given = streamed(&safe, 3);
        links::add(&mut given, &ways);
        assert_eq!(given, streamed(&low, 3));
        links::remove(&mut given);
        assert_eq!(given, streamed(&safe, 3));
    }
}
