//! The links of a region: made for a job when it is read, with the core and the part.

use glam::DVec3;
use interp_core::job::links::Detour;
use job::Job;
use machine::links;
use machine::prepare::Prepared;
use part::Way;

use super::{Failure, Result};

const NM_PER_MM: f64 = 1e6;

/// Gives a job with a region and axis limits the words of its links. Where the job names its safe height, a clamp or the stock, every link goes at the safe height: what stands
/// between two intervals is then not the part alone.
///
/// # Errors
/// The part's file cannot be read.
pub(super) fn add(job: &Job, prepared: &mut Prepared) -> Result<()> {
    let Some(axes) = prepared.header.axes else {
        return Ok(());
    };
    let is_alone =
        job.machine.safe_z_mm.is_none() && job.setup.fixtures.is_empty() && job.setup.stock.is_none();
    if job.region.is_none() || !is_alone || prepared.header.links > 0 {
        return Ok(());
    }
    let key = format!("{:?} {:?}", prepared.header, prepared.words);
    let millimetres = |nm: [i32; 3]| DVec3::from(nm.map(f64::from)) / NM_PER_MM;
    let safe_mm = f64::from(axes.safe_z_nm) / NM_PER_MM;
    let ends = || {
        let ends = links::ends(prepared);
        ends.into_iter().map(|ends| ends.map(millimetres)).collect()
    };
    let ways = part::ways(job, key.as_bytes(), safe_mm, ends)
        .map_err(|error| Failure::input(error.what, error.remedy))?;
    #[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
    let links: Vec<links::Link> = ways
        .iter()
        .map(|way| match way {
            Way::Straight => links::Link::Straight,
            Way::Around { aside, rise } => links::Link::Around(Detour {
                aside: *aside,
                rise: *rise,
            }),
            Way::Across(height_mm) => links::Link::Across((height_mm * NM_PER_MM).ceil() as i32),
        })
        .collect();
    links::add(prepared, &links);
    Ok(())
}
