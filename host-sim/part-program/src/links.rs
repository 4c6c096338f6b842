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
    let mut bare = prepared.clone();
    if let Some(axes) = &mut bare.header.axes {
        (axes.home_nm, axes.end_nm) = ([0, 0, axes.safe_z_nm], None);
    }
    links::remove(&mut bare);
    let key = format!("{:?} {:?}", bare.header, bare.words);
    part::passes(job, key.as_bytes(), || links::passes(&bare))
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
