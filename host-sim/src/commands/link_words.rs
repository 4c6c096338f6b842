//! The links of a region: made for a job when it is read, with the core and the part.

use glam::DVec3;
use interp_core::job::links::Detour;
use job::Job;
use machine::links;
use machine::prepare::Prepared;
use part::Way;

use super::{Failure, Result};

const NM_PER_MM: f64 = 1e6;

/// A place in mm.
pub(super) fn millimetres(nm: [i32; 3]) -> DVec3 {
    DVec3::from(nm.map(f64::from)) / NM_PER_MM
}

/// A height in nm, no lower.
#[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
pub(super) fn nanometres_up(mm: f64) -> i32 {
    (mm * NM_PER_MM).ceil() as i32
}

/// The ball's centre at the start and at the end of each pass of a job, nm. The passes are the same wherever the run begins and ends.
///
/// # Errors
/// None: those of the cache.
pub(super) fn passes(job: &Job, prepared: &Prepared) -> Result<Vec<[[i32; 3]; 2]>> {
    let mut bare = prepared.clone();
    if let Some(axes) = &mut bare.header.axes {
        (axes.home_nm, axes.end_nm) = ([0, 0, axes.safe_z_nm], None);
    }
    links::remove(&mut bare);
    let key = format!("{:?} {:?}", bare.header, bare.words);
    part::passes(job, key.as_bytes(), || links::passes(&bare))
        .map_err(|error| Failure::input(error.what, error.remedy))
}

/// Whether the part is all that stands between two places: the job names neither its safe height nor a clamp nor the stock.
pub(super) fn is_alone(job: &Job) -> bool {
    job.machine.safe_z_mm.is_none() && job.setup.fixtures.is_empty() && job.setup.stock.is_none()
}

/// Gives a job with a region and axis limits the words of its links. Where the job names its safe height, a clamp or the stock, every link goes at the safe height: what stands
/// between two intervals is then not the part alone.
///
/// # Errors
/// The part's file cannot be read.
pub(super) fn add(job: &Job, prepared: &mut Prepared) -> Result<()> {
    let Some(axes) = prepared.header.axes else {
        return Ok(());
    };
    if job.region.is_none() || !is_alone(job) || prepared.header.links > 0 {
        return Ok(());
    }
    let safe_mm = f64::from(axes.safe_z_nm) / NM_PER_MM;
    let passes = passes(job, prepared)?;
    let key = format!("{passes:?}");
    let ends = || {
        let ends = links::between(&passes);
        ends.into_iter().map(|ends| ends.map(millimetres)).collect()
    };
    let ways = part::ways(job, key.as_bytes(), safe_mm, ends)
        .map_err(|error| Failure::input(error.what, error.remedy))?;
    let links: Vec<links::Link> = ways
        .iter()
        .map(|way| match way {
            Way::Straight => links::Link::Straight,
            Way::Around { aside, rise } => links::Link::Around(Detour {
                aside: *aside,
                rise: *rise,
            }),
            Way::Across(height_mm) => links::Link::Across(nanometres_up(*height_mm)),
        })
        .collect();
    links::add(prepared, &links);
    Ok(())
}
