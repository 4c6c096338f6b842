//! Where the runs of the faces of a job of many begin and end: each run ends straight above the start of the next one, as low as the part allows, and the next one begins
//! there.
//!
//! Where an obstacle other than the part is possible, or no part is known, a run begins and ends at the job's home.

use glam::DVec3;
use job::Job;
use job::units::{millimetres, nanometres_up, position_mm};
use job_file::FaceError;
use machine::prepare::Prepared;
use rayon::prelude::*;

use crate::links::{only_part_between, passes};

/// Where the run of a face begins and ends. By default both are its job's home.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stop {
    /// The ball's centre before the run, nm; `None`: the job's home.
    home_nm: Option<[i32; 3]>,
    /// The ball's centre after the run, and the height of the way to that place, nm; `None`: as before the run.
    end_nm: Option<([i32; 3], i32)>,
}

impl Stop {
    /// Makes a job's run begin and end here.
    pub fn apply(self, job: &mut Job, prepared: &mut Prepared) {
        let Some(axes) = &mut prepared.header.axes else {
            return;
        };
        if let Some(home_nm) = self.home_nm {
            axes.home_nm = home_nm;
            job.machine.home_mm = Some(position_mm(home_nm));
        }
        if let Some((end_nm, height_nm)) = self.end_nm {
            (axes.end_nm, axes.end_height_nm) = (Some(end_nm), height_nm);
        }
    }
}

/// A face whose run may begin above the end of the run before, and the places that decide where.
struct Visit {
    job: Job,
    home_nm: [i32; 3],
    safe_nm: i32,
    /// The ball's centre at the start of the first pass and at the end of the last.
    ends_nm: [[i32; 3]; 2],
}

impl Visit {
    /// `None` where the run has to begin and end at home.
    fn new((job, prepared): (Job, Prepared)) -> Option<Self> {
        let axes = prepared.header.axes.filter(|_| only_part_between(&job))?;
        let passes = passes(&job, &prepared);
        let ([start, _], [_, end]) = passes.first().zip(passes.last())?;
        Some(Self {
            home_nm: axes.home_nm,
            safe_nm: axes.safe_z_nm,
            ends_nm: [*start, *end],
            job,
        })
    }

    /// Where the run ends and the next begins: straight above the start of the next.
    fn stop_before(&self, next: &Self) -> Result<[i32; 3], FaceError> {
        let safe_nm = self.safe_nm.max(next.safe_nm);
        let ([_, from], [to, _]) = (self.ends_nm, next.ends_nm);
        let ends_mm = [from, to].map(|nm| DVec3::from(position_mm(nm)));
        let height_mm = part::crossing(&self.job, millimetres(safe_nm), ends_mm)?;
        let [x, y, _] = to;
        Ok([x, y, nanometres_up(height_mm).min(safe_nm)])
    }
}

/// Where the runs of the faces begin and end, in the order of `faces`. `load` reads and prepares the job of a face. Where it returns `None`, the run before that face ends at
/// home, and the run after it begins there.
///
/// # Errors
/// The part's file cannot be read.
pub fn stops<F: Sync>(
    faces: &[F],
    load: impl Fn(&F) -> Option<(Job, Prepared)> + Sync,
) -> Result<Vec<Stop>, FaceError> {
    if faces.len() < 2 {
        return Ok(vec![Stop::default(); faces.len()]);
    }
    let visits: Vec<Option<Visit>> = faces
        .par_iter()
        .map(|face| load(face).and_then(Visit::new))
        .collect();
    let between = visits.par_windows(2).map(|pair| match pair {
        [Some(one), Some(next)] => one.stop_before(next).map(Some),
        _ => Ok(None),
    });
    let between: Vec<Option<[i32; 3]>> = between.collect::<Result<_, _>>()?;
    let before = std::iter::once(&None).chain(&between);
    let after = between.iter().chain([&None]);
    let each = visits.iter().zip(before.zip(after));
    Ok(each
        .map(|(visit, (home_nm, end))| Stop {
            home_nm: *home_nm,
            end_nm: match (visit, end) {
                (_, Some(end)) => Some((*end, end[2])),
                (Some(visit), None) if home_nm.is_some() => Some((visit.home_nm, visit.safe_nm)),
                _ => None,
            },
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::add_links;
    use interp_core::State;
    use machine::{Machine, direction};
    use std::path::{Path, PathBuf};

    fn load(path: &Path) -> Option<(Job, Prepared)> {
        let job = job_file::load_with(path, &part::Faces).ok()?;
        let (job, mut prepared) = direction::choose(job).ok()?;
        add_links(&job, &mut prepared).ok()?;
        Some((job, prepared))
    }

    /// Three faces of the blade: each run begins where the one before ended, below the safe height, the last one comes home. A job that names its safe height has its runs begin
    /// and end at home.
    #[test]
    fn a_run_begins_where_the_one_before_ended() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("blade.toml");
        let blade = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../jobs/cad/blade.step");
        let text = |machine: &str| {
            format!(
                "[part]\npath = {blade:?}\n[tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 3000\nscallop_mm = 0.3\npattern = \"zigzag\"\nalong = \"u\"\n\
                 side = \"up\"\n[machine]\nvelocity_max_mm_s = [100, 100, 50]\nhome_mm = [0, 0, 90]\n{machine}\n[[face]]\nface = 1\n[[face]]\nface = 7\n[[face]]\nface = 11\n"
            )
        };
        let ends = |machine: &str| {
            std::fs::write(&file, text(machine)).unwrap();
            let faces = job_file::jobs_of(&file).unwrap();
            let stops = stops(&faces, |path: &PathBuf| load(path)).unwrap();
            let run = |(face, stop): (&PathBuf, Stop)| {
                let (mut job, mut prepared) = load(face).unwrap();
                stop.apply(&mut job, &mut prepared);
                let safe_nm = prepared.header.axes.unwrap().safe_z_nm;
                let mut machine = Machine::load(&prepared).unwrap();
                let mut samples = Vec::new();
                machine
                    .run(|sample| {
                        samples.push((sample.cl_nm, sample.state));
                        true
                    })
                    .unwrap();
                assert_eq!(machine.state(), State::Finished);
                (samples[0].0, samples.last().unwrap().0, safe_nm)
            };
            faces.iter().zip(stops).map(run).collect::<Vec<_>>()
        };
        let home_nm = [0, 0, 90_000_000];
        let chained = ends("");
        for pair in chained.windows(2) {
            let [end, start] = [pair[0].1, pair[1].0].map(|nm| DVec3::from(position_mm(nm)));
            let distance = end.distance(start);
            assert!(distance < 1e-3, "{distance} mm: {chained:?}");
            assert!(pair[0].1[2] < pair[0].2, "{chained:?}");
        }
        assert_eq!((chained[0].0, chained[2].1), (home_nm, home_nm));
        for (first, last, _) in ends("safe_z_mm = 130") {
            assert_eq!((first, last), (home_nm, home_nm));
        }
    }
}
