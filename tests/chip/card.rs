//! The image for the SKR Pro's boot loader: the file that `cargo sim flash --sd` writes, started as a loader leaves the chip.

use boards::SKR_PRO;

use super::emulated::{Emulated, Job, RESET_CYCLES_US, REST_US, sim, workspace};

/// The card's file.
fn card() -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (done, said) = sim([
        "flash",
        "--board",
        "skr-pro",
        "--sd",
        folder.path().to_str().unwrap(),
    ]);
    assert!(done && said.contains("firmware.bin: "), "{said}");
    let file = folder.path().join("firmware.bin");
    (folder, file)
}

/// Clocks, interrupts and peripherals that the loader has left on make no difference: all registers are those of the image that the chip starts itself, but for
/// the place of the vectors. The outputs are at rest as soon.
#[test]
fn the_cards_image_boots_into_the_same_registers() {
    let (_folder, file) = card();
    let ended = Emulated::of_image(&SKR_PRO, &file, &["--ms", "80"]).wait();
    ended.no_complaint();
    assert!(ended.number("periods") > 50);
    ended.rest_after(0, REST_US * RESET_CYCLES_US);
    let golden = std::fs::read_to_string(workspace().join("tests/golden/chip_skr-pro.txt")).unwrap();
    let expected = golden.replace("SCB VTOR = 0x00000000", "SCB VTOR = 0x08008000");
    assert_ne!(expected, golden);
    let lines = ended.report["registers"].as_array().unwrap();
    let text: String = lines
        .iter()
        .map(|line| format!("{}\n", line.as_str().unwrap()))
        .collect();
    assert_eq!(text, expected);
}

/// A whole job, coarser than the sample, every sample the host's; then the watchdog resets a chip that hangs, the loader starts the image again, and the reset's cause is known.
#[test]
fn the_cards_image_runs_a_whole_job() {
    let (_folder, file) = card();
    let emulated = Emulated::of_image(&SKR_PRO, &file, &[]);
    let job = Job::sample(
        "plate_machine.toml",
        &[("scallop_mm = 0.05 ", "scallop_mm = 0.8 ")],
    );
    let (done, said) = emulated.run(&job.path, "40,30,40");
    let ended = emulated.end();
    assert!(done && said.contains("bit for bit the same"), "{said}");
    ended.no_complaint();
    ended.no_byte_lost();
    assert_eq!(ended.number("resets"), 0);
    assert!(ended.last_pulse(u64::MAX) > 0);
}

#[test]
fn after_a_hang_the_loader_starts_the_cards_image_again() {
    let (_folder, file) = card();
    let ended = Emulated::of_image(&SKR_PRO, &file, &["--at", "50:hang", "--ms", "150"]).wait();
    ended.no_complaint();
    assert_eq!(ended.number("resets"), 1);
    let reset = ended.event("reset");
    ended.rest_after(reset, reset + REST_US * RESET_CYCLES_US);
    assert!(ended.number("periods") > 80);
}
