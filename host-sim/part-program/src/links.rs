//! The links between the passes of a job's region: made when the job is read, with the core and the part.

use glam::DVec3;
use interp_core::job::links::Detour;
use job::Job;
use job::units::{millimetres, nanometres_up, position_mm};
use job_file::FaceError;
use machine::links::{self, Link};
use machine::prepare::Prepared;
use part::Way;

/// The ball's centre at the start and at the end of each pass of a job, nm. They depend neither on the links nor on where the run begins and ends.
pub(crate) fn passes(job: &Job, prepared: &Prepared) -> Vec<[[i32; 3]; 2]> {
    let bare = bare(prepared);
    part::passes(job, key(&bare).as_bytes(), || links::passes(&bare))
}

/// A job without its links and its home.
fn bare(prepared: &Prepared) -> Prepared {
    let mut bare = prepared.clone();
    if let Some(axes) = &mut bare.header.axes {
        (axes.home_nm, axes.end_nm) = ([0, 0, axes.safe_z_nm], None);
    }
    links::remove(&mut bare);
    bare
}

/// All that the passes of a bare job depend on; the core among it.
fn key(bare: &Prepared) -> String {
    let core = env!("CORE_DIGEST");
    format!("{core} {:?} {:?}", bare.header, bare.words)
}

/// Whether the part is the only known obstacle between two places: the job names neither its safe height nor a clamp nor the stock.
pub(crate) fn only_part_between(job: &Job) -> bool {
    job.machine.safe_z_mm.is_none() && job.setup.fixtures.is_empty() && job.setup.stock.is_none()
}

/// A way as a link of the core: heights in nm, rounded up.
fn link_of(way: Way) -> Link {
    match way {
        Way::Straight => Link::Straight,
        Way::Around { aside, rise } => Link::Around(Detour { aside, rise }),
        Way::Across(height_mm) => Link::Across(nanometres_up(height_mm)),
    }
}

/// The links of a job, the one from the first pass to the second first; none without axis limits.
///
/// # Errors
/// The part's file cannot be read.
fn links_of(job: &Job, prepared: &Prepared) -> Result<Vec<Link>, FaceError> {
    let Some(axes) = prepared.header.axes else {
        return Ok(Vec::new());
    };
    let passes = passes(job, prepared);
    let key = format!("{passes:?}");
    let ends = || {
        let ends = links::between(&passes);
        let place = |nm| DVec3::from(position_mm(nm));
        ends.into_iter().map(|ends| ends.map(place)).collect()
    };
    let ways = part::ways(job, key.as_bytes(), millimetres(axes.safe_z_nm), ends)?;
    Ok(ways.into_iter().map(link_of).collect())
}

/// Gives a job with a region and axis limits the words of its links. A job that names its safe height, a clamp or the stock gets none, so that every link goes at the safe
/// height: the part is then not the only obstacle. Words that the job already has stay.
///
/// # Errors
/// The part's file cannot be read.
pub fn add_links(job: &Job, prepared: &mut Prepared) -> Result<(), FaceError> {
    let has_links = prepared.header.links > 0;
    if prepared.header.axes.is_none() || job.region.is_none() || !only_part_between(job) || has_links {
        return Ok(());
    }
    let links = links_of(job, prepared)?;
    links::add(prepared, &links);
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::sources::{CORE, digest};

    const JOB: &str = "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [0, 0, 1, 1]\nknots_v = [0, 0, 1, 1]\n\
        poles_mm = [[[0, 0, 0], [0, 40, 0]], [[20, 0, 10], [20, 40, 10]]]\n[tool]\nkind = \"ball\"\nradius_mm = 3\n\
        [cut]\nfeed_mm_min = 1200\nscallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n";

    /// Passes kept by another core are not used: their key has the digest of the core's sources as they are.
    #[test]
    fn passes_are_kept_for_one_core() {
        let job = job_file::parse("slope.toml", JOB).unwrap();
        let bare = bare(&machine::prepare::prepare(&job).unwrap());
        let core = digest(Path::new(env!("CARGO_MANIFEST_DIR")), &CORE).unwrap();
        assert!(key(&bare).contains(&core), "{core}");
    }

    #[test]
    fn a_digest_changes_with_names_and_bytes_of_files() {
        let of = |files: &[(&str, &str)]| {
            let folder = tempfile::tempdir().unwrap();
            for (name, text) in files {
                let file = folder.path().join(name);
                fs::create_dir_all(file.parent().unwrap()).unwrap();
                fs::write(file, text).unwrap();
            }
            digest(folder.path(), &["src"]).unwrap()
        };
        let first = of(&[("src/a.rs", "1"), ("src/b/c.rs", "2")]);
        assert_eq!(
            first,
            of(&[("src/b/c.rs", "2"), ("src/a.rs", "1"), ("other.rs", "")])
        );
        assert_ne!(first, of(&[("src/a.rs", "1"), ("src/b/c.rs", "3")]));
        assert_ne!(first, of(&[("src/a.rs", "1"), ("src/b/d.rs", "2")]));
    }
}
