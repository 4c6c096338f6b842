//! The firmware's image, the set-up that counts its cycles, and the ticks of the sample jobs that it counted, made once for all tests.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use cycles::graph::{self, Analysis};
use cycles::measure::{MeasurementSetup, Ticks};
use cycles::{SURFACES, TICKS, image};
use machine::prepare::prepare;
use machine::remote::qemu;

/// The image for QEMU.
pub(crate) fn for_qemu() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| qemu::firmware().unwrap())
}

/// What its code says of stack and loops.
pub(crate) fn analysis() -> &'static Analysis {
    static ANALYSIS: OnceLock<Analysis> = OnceLock::new();
    ANALYSIS.get_or_init(|| graph::analyse(for_qemu()).unwrap())
}

/// The image for QEMU with the plugin that counts cycles.
pub(crate) fn setup() -> &'static MeasurementSetup {
    static SETUP: OnceLock<MeasurementSetup> = OnceLock::new();
    SETUP.get_or_init(|| {
        let (plan, _) = image::read(for_qemu()).unwrap();
        MeasurementSetup::new(for_qemu(), &plan).unwrap()
    })
}

/// Counted ticks of the sample job of a surface: the first [`TICKS`] of it.
pub(crate) fn ticks_of(surface: &str) -> &'static Ticks {
    static COUNTED: [OnceLock<Ticks>; SURFACES.len()] = [const { OnceLock::new() }; SURFACES.len()];
    let index = SURFACES.iter().position(|(name, _)| *name == surface).unwrap();
    COUNTED[index].get_or_init(|| {
        let file = programs::sample_job(SURFACES[index].1);
        let prepared = prepare(&job_file::load(&file).unwrap()).unwrap();
        setup().run(&prepared, TICKS).unwrap()
    })
}
