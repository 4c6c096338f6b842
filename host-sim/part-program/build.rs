//! `CORE_DIGEST`: a digest of the core's sources, so that what its runs gave is not taken for what those of another version give.

#[path = "src/sources.rs"]
mod sources;

use std::path::Path;

fn main() -> std::io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src/sources.rs");
    for place in sources::CORE {
        println!("cargo:rerun-if-changed={}", root.join(place).display());
    }
    println!(
        "cargo:rustc-env=CORE_DIGEST={}",
        sources::digest(root, &sources::CORE)?
    );
    Ok(())
}
