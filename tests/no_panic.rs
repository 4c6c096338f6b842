//! No panic can be reached from the sample task: `firmware/no-panic` says how the linker proves it. Here the image is
//! linked, and once more with a panic in the task, which has to fail by the name of the function that is missing.

use std::path::Path;
use std::process::{Command, Output};

/// The linker's message for a reachable panic.
const MISSING: &str = "a_panic_can_be_reached_from_the_sample_task";

/// Builds the image, in the folder of the image for QEMU, whose crates it shares.
fn link(features: &str) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    Command::new(env!("CARGO"))
        .current_dir(root)
        // Flags from outside would replace those that images are linked with.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .args(["build", "--quiet", "--locked", "--release", "-p", "no-panic"])
        .args(["--target", "thumbv7em-none-eabihf", "--target-dir", "target/qemu"])
        .args(["--features", features])
        .output()
        .unwrap()
}

#[test]
fn the_sample_task_links_without_a_panic_and_the_control_does_not() {
    let proof = link("");
    let said = String::from_utf8_lossy(&proof.stderr);
    assert!(proof.status.success(), "{said}");

    let control = link("with-a-panic");
    let said = String::from_utf8_lossy(&control.stderr);
    assert!(!control.status.success(), "the control links");
    assert!(said.contains(MISSING), "it fails otherwise: {said}");
}
