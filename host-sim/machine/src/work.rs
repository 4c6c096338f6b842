//! Work offsets: a job's coordinates placed in the machine's.

use job::Job;
use patches::placement::{OutOfMachineRange, Placement};

/// Moves a job's origin to this position of the machine, mm: surface, stock, fixtures, home and safe height. Its travel is the machine's already.
///
/// # Errors
/// The surface is out of the range of positions there.
pub fn place(job: &mut Job, origin_mm: [f64; 3]) -> Result<(), OutOfMachineRange> {
    let placement = Placement {
        translate_mm: origin_mm,
        ..Placement::default()
    };
    job.surface = placement.place(&job.surface)?;
    let add = |point: &mut [f64; 3]| {
        for (value, by) in point.iter_mut().zip(origin_mm) {
            *value += by;
        }
    };
    let blocks = job.setup.stock.iter_mut();
    for block in blocks.chain(job.setup.fixtures.iter_mut().map(|fixture| &mut fixture.block)) {
        add(&mut block.low_mm);
        add(&mut block.high_mm);
    }
    if let Some(home_mm) = &mut job.machine.home_mm {
        add(home_mm);
    }
    let heights = [&mut job.machine.safe_z_mm, &mut job.machine.part_top_mm];
    for height_mm in heights.into_iter().flatten() {
        *height_mm += origin_mm[2];
    }
    Ok(())
}
