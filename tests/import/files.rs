//! CAD files that are damaged, unusual or large.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use cad::{Options, Surface, machinable, read};

use super::{cad, workspace};

/// Damaged, truncated, mislabelled and malicious files: each is refused with a message that names the error.
#[test]
fn hostile_files() {
    let folder = workspace().join("tests/hostile_cad");
    let expected: BTreeMap<&str, (&str, Option<usize>)> = [
        ("degree.step", ("#30", None)),
        ("deep.step", ("nested too deep", Some(30))),
        ("empty.step", ("empty", None)),
        ("far.step", ("kilometre", None)),
        ("huge_count.igs", ("entity type 144", None)),
        ("knots_descend.step", ("#30", None)),
        ("missing_entity.step", ("#33", None)),
        ("multiplicity.step", ("#30", None)),
        ("nan.step", ("nan", Some(34))),
        ("no_end.step", ("ends before", Some(47))),
        ("overflow.step", ("1.E999", Some(34))),
        ("picture.3dm", ("its header differs", None)),
        ("text.step", ("its header differs", None)),
        ("text_without_end.step", ("not closed", Some(2))),
        ("truncated.3dm", ("invalid", None)),
        ("truncated.igs", ("terminate section", Some(26))),
        ("truncated.step", ("ends before", Some(40))),
        ("zero_weight.step", ("weight 0", None)),
    ]
    .into();
    // The valid parts of these files are read: an assembly that contains itself is ignored, and its part stays where it is; an
    // offset surface of itself is left out with a warning, and the other surface is read.
    let sound = ["assembly_of_itself.step", "offset_of_itself.step", "sound.step"];
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        // A timeout would be an error without the expected words.
        let result = read(&path);
        if sound.contains(&name.as_str()) {
            let model = result.unwrap();
            assert_eq!(model.faces.len(), 1, "{name}");
            let left_out = model
                .warnings
                .iter()
                .any(|warning| warning.contains("#22 is left out"));
            assert_eq!(
                left_out,
                name.starts_with("offset"),
                "{name}: {:?}",
                model.warnings
            );
            continue;
        }
        let (words, line) = expected[name.as_str()];
        let error = result.expect_err(&name);
        println!("{error}\n  help: {}", error.remedy);
        assert!(error.file.ends_with(&name), "{name}: {error}");
        assert!(error.what.contains(words), "{name}: {error}");
        assert!(line.is_none() || error.line == line, "{name}: {error}");
        assert!(!error.remedy.is_empty());
    }
    let missing = read(Path::new("no/such/file.step")).unwrap_err();
    assert!(missing.what.contains("cannot read"), "{missing}");
}

/// Warnings of an IGES file name the directory entries that were not read, as the list of faces does.
#[test]
fn warnings_name_the_entry() {
    let warnings = read(&cad("swept.igs")).unwrap().warnings;
    for entry in ["D67: IGES entity type 140", "D65: IGES entity type 144"] {
        assert!(
            warnings.iter().any(|warning| warning.starts_with(entry)),
            "{warnings:?}"
        );
    }
}

/// A torus whose tube is wider than its ring has an entity of its own in STEP. The flag that selects a sheet is not used: the boundary tells.
#[test]
fn spindle_tori_are_read() {
    let radii = ["26.261764705882", "2.446397676523"];
    let text = std::fs::read_to_string(cad("lens_mould.step")).unwrap();
    let ring = format!("TOROIDAL_SURFACE('',#130,{},{});", radii[0], radii[1]);
    let spindle = format!(
        "DEGENERATE_TOROIDAL_SURFACE('',#130,{},{},.T.);",
        radii[1], radii[0]
    );
    assert!(text.contains(&ring));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("spindle.step");
    std::fs::write(&path, text.replace(&ring, &spindle)).unwrap();
    let model = read(&path).unwrap();
    let torus = model.faces.iter().find_map(|face| match face.surface {
        Surface::Torus { major, minor, .. } => Some([major, minor].map(|radius| format!("{radius}"))),
        _ => None,
    });
    assert_eq!(torus.unwrap(), [radii[1], radii[0]]);
}

/// A file with the wrong extension is read by its content, with a warning.
#[test]
fn wrong_ending() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mouse.step");
    std::fs::copy(cad("mouse.igs"), &path).unwrap();
    let model = read(&path).unwrap();
    assert_eq!(model.faces.len(), 1);
    assert!(model.warnings[0].contains("IGES"), "{:?}", model.warnings);
}

/// The text with all entity numbers raised by a constant.
fn renumbered(text: &str, by: usize) -> String {
    let mut out = String::with_capacity(text.len() + text.len() / 8);
    let mut parts = text.split('#');
    out.push_str(parts.next().unwrap_or(""));
    for part in parts {
        let digits = part.bytes().take_while(u8::is_ascii_digit).count();
        let number: usize = part[..digits].parse().unwrap();
        out.push_str(&format!("#{}{}", number + by, &part[digits..]));
    }
    out
}

/// Ten megabytes of STEP, copies of the mouse, are read within the reader's time limit; the time is printed.
#[test]
fn ten_megabytes() {
    let text = std::fs::read_to_string(cad("mouse.step")).unwrap();
    let (head, rest) = text.split_once("DATA;\n").unwrap();
    let (data, tail) = rest.split_once("ENDSEC;").unwrap();
    let entities = data.matches("\n#").count() + 2;
    let copies = 10_000_000 / data.len() + 1;
    let mut large = format!("{head}DATA;\n");
    for copy in 0..copies {
        large.push_str(&renumbered(data, copy * entities));
    }
    large.push_str(&format!("ENDSEC;{tail}"));
    assert!(large.len() >= 10_000_000);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.step");
    std::fs::write(&path, &large).unwrap();
    let begun = Instant::now();
    let model = read(&path).unwrap();
    let made = machinable("", &model.faces[copies / 2], &Options::default()).unwrap();
    let taken = begun.elapsed();
    println!(
        "{} bytes, {} faces: {:.2} s",
        large.len(),
        model.faces.len(),
        taken.as_secs_f64()
    );
    assert_eq!(model.faces.len(), copies);
    assert_eq!(made.patches, 64);
}
