//! Linker settings: an image for a boot loader begins after it.

/// Flash that the SKR Pro's loader occupies, bytes: its sectors 0 and 1.
const LOADER_BYTES: u32 = 32 * 1024;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_BEHIND_LOADER").is_some() {
        println!("cargo:rustc-link-arg-bins=--defsym=_loader_bytes={LOADER_BYTES:#x}");
    }
}
