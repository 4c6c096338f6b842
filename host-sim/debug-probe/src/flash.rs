//! Writes an image into flash.

use probe_rs::flashing::{DownloadOptions, FlashProgress, ProgressEvent, ProgressOperation};

use crate::chip::{Reach, chain, compare as same, connect};
use crate::event::{Event, Problem, Target, Work};
use crate::image::Image;
use crate::tell;

/// Writes the image, verifies it, and starts it.
pub(crate) fn write(target: &Target) -> Result<(), Problem> {
    let image = Image::load(&target.image).map_err(Problem::BadImage)?;
    let mut session = connect(target, &image, Reach::ByReset)?;
    let mut loader = session.target().flash_loader();
    for (address, data) in &image.segments {
        loader
            .add_data(u64::from(*address), data)
            .map_err(|error| Problem::BadImage(chain(&error)))?;
    }
    let mut options = DownloadOptions::new();
    options.progress = FlashProgress::new(progress());
    loader
        .commit(&mut session, options)
        .map_err(|error| Problem::NotWritten(chain(&error)))?;
    let gone = |error: probe_rs::Error| Problem::Gone(chain(&error));
    let mut core = session.core(0).map_err(gone)?;
    same(&mut core, &image)?;
    core.reset().map_err(gone)
}

/// Compares the image with the flash while the firmware runs.
pub(crate) fn compare(target: &Target) -> Result<(), Problem> {
    let image = Image::load(&target.image).map_err(Problem::BadImage)?;
    let mut session = connect(target, &image, Reach::Running)?;
    let mut core = session.core(0).map_err(|error| Problem::Gone(chain(&error)))?;
    same(&mut core, &image)
}

/// Total progress from the events of probe-rs.
fn progress() -> impl FnMut(ProgressEvent) {
    let work = |operation| match operation {
        ProgressOperation::Erase => Some(Work::Erase),
        ProgressOperation::Program => Some(Work::Write),
        // Not enabled.
        ProgressOperation::Fill | ProgressOperation::Verify => None,
    };
    // Bytes done and in total, of erasing and of writing.
    let mut counts = [(0, 0); 2];
    move |event| match event {
        ProgressEvent::AddProgressBar { operation, total } => {
            if let Some(work) = work(operation) {
                counts[usize::from(work == Work::Write)].1 += total.unwrap_or(0);
            }
        }
        ProgressEvent::Progress { operation, size, .. } => {
            if let Some(work) = work(operation) {
                let (done, total) = &mut counts[usize::from(work == Work::Write)];
                *done += size;
                let (done, total) = (*done, (*total).max(*done));
                tell(&Event::Progress { work, done, total });
            }
        }
        _ => {}
    }
}
