//! The firmware's image and the set-up that counts its cycles, each built once for all tests.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use cycles::image;
use cycles::measure::MeasurementSetup;
use machine::remote::qemu;

/// The image for QEMU.
pub(crate) fn for_qemu() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| qemu::firmware().unwrap())
}

/// The image for QEMU with the plugin that counts cycles.
pub(crate) fn setup() -> &'static MeasurementSetup {
    static SETUP: OnceLock<MeasurementSetup> = OnceLock::new();
    SETUP.get_or_init(|| {
        let (plan, _) = image::read(for_qemu()).unwrap();
        MeasurementSetup::new(for_qemu(), &plan).unwrap()
    })
}
