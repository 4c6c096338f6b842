//! No panic is reachable from the sample task, the planning task and the task of a failing supply; `firmware/no-panic` describes how the linker proves it. The test
//! links the image, and as controls links it with a panic in each of them, which must fail with the name of the missing function.

use std::path::Path;
use std::process::{Command, Output};

/// The linker's message for a reachable panic.
const MISSING: &str = "a_panic_can_be_reached_from_a_real_time_task";

/// Builds the image in the target folder of the image for QEMU, to share its crates.
fn link(features: &str) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    Command::new(env!("CARGO"))
        .current_dir(root)
        // Flags of the environment would replace the linker flags of the images.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .args(["build", "--quiet", "--locked", "--release", "-p", "no-panic"])
        .args(["--target", "thumbv7em-none-eabihf", "--target-dir", "target/qemu"])
        .args(["--features", features])
        .output()
        .unwrap()
}

#[test]
fn the_real_time_tasks_link_without_a_panic_and_the_controls_do_not() {
    let proof = link("");
    let said = String::from_utf8_lossy(&proof.stderr);
    assert!(proof.status.success(), "{said}");

    for feature in [
        "with-a-panic",
        "with-a-panic-in-planning",
        "with-a-panic-in-supply",
    ] {
        let control = link(feature);
        let said = String::from_utf8_lossy(&control.stderr);
        assert!(!control.status.success(), "the control {feature} links");
        assert!(said.contains(MISSING), "{feature} fails otherwise: {said}");
    }
}
