//! Where the tool looks, in folders made for it.

use std::collections::BTreeSet;
use std::path::Path;

use tempfile::TempDir;

use crate::place::find;
use crate::{Part, Place, name};

fn put(folder: &Path, files: &[&str]) {
    for file in files {
        let path = folder.join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }
}

const CHECKOUT: [&str; 3] = ["Cargo.lock", ".cargo/config.toml", "host-sim/programs/Cargo.toml"];

#[test]
fn an_installation_is_found_from_the_executable_even_within_a_checkout() {
    let folder = TempDir::new().unwrap();
    put(folder.path(), &CHECKOUT);
    let prefix = folder.path().join("out/isofeed");
    put(&prefix, &["bin/isofeed", "libexec/isofeed/cad-reader"]);
    let found = find(&prefix.join("bin/isofeed"), None, folder.path());
    assert_eq!(found, Place::Installed(prefix));
}

#[test]
fn a_folder_of_the_name_bin_is_no_installation_yet() {
    let folder = TempDir::new().unwrap();
    put(folder.path(), &["bin/isofeed"]);
    let found = find(&folder.path().join("bin/isofeed"), None, folder.path());
    assert_eq!(found, Place::Nowhere);
}

/// By `cargo run` (wherever its target folder is), beside the executable, and from where one stands.
#[test]
fn a_checkout_is_found_from_the_package_the_executable_or_the_working_directory() {
    let folder = TempDir::new().unwrap();
    let root = folder.path().join("checkout");
    put(&root, &CHECKOUT);
    let nowhere = folder.path().join("nowhere");
    let package = root.join("host-sim");
    let found = Place::Checkout(root.clone());
    assert_eq!(find(&nowhere, Some(&package), &nowhere), found);
    assert_eq!(find(&root.join("target/release/host-sim"), None, &nowhere), found);
    assert_eq!(find(&nowhere, None, &root.join("jobs")), found);
    assert_eq!(find(&nowhere, None, &nowhere), Place::Nowhere);
}

#[test]
fn this_test_runs_in_a_checkout_that_has_what_it_names() {
    let root = crate::checkout().unwrap();
    assert!(root.join("host-sim/programs/src/tests.rs").is_file());
    assert!(crate::sample_job("plate").is_file());
    assert!(crate::golden("cycles.txt").is_file());
    let aliases = std::fs::read_to_string(root.join(".cargo/config.toml")).unwrap();
    for alias in Part::installation(Part::FastCadReader)
        .into_iter()
        .filter_map(Part::alias)
    {
        assert!(aliases.contains(&format!("\n{alias} = ")), "no alias {alias}");
    }
}

#[test]
fn no_two_files_share_a_path() {
    let parts = Part::installation(Part::FastCadReader);
    let built: BTreeSet<_> = parts.iter().map(|part| part.built()).collect();
    let installed: BTreeSet<_> = parts.iter().map(|part| part.installed()).collect();
    assert_eq!((built.len(), installed.len()), (parts.len(), parts.len()));
}

#[test]
fn an_installed_tool_speaks_of_isofeed() {
    let text = "run `cargo sim verify JOB`, then cargo sim explain 1";
    assert_eq!(
        name::named(text, "isofeed"),
        "run `isofeed verify JOB`, then isofeed explain 1"
    );
    assert_eq!(name::named(text, "cargo sim"), text);
}
