//! CAD files that are damaged, unusual or large.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use cad::{Boundary, CadError, Model, Options, Surface, machinable, read};

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

/// A document of Rhino with a coloured extrusion, a box, a hidden extrusion, a mesh, and a block with a text dot, which the reader's library does not read.
/// `change` damages it.
fn rhino_objects(change: impl FnOnce(&mut Vec<u8>)) -> Result<Model, CadError> {
    let mut bytes = std::fs::read(workspace().join("tests/import/objects.3dm")).unwrap();
    change(&mut bytes);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("objects.3dm");
    std::fs::write(&path, bytes).unwrap();
    read(&path)
}

/// The place of these bytes in a file.
fn place(bytes: &[u8], of: &[u8]) -> usize {
    bytes.windows(of.len()).position(|window| window == of).unwrap()
}

/// Identifiers of classes, as they are written.
const BREP: [u8; 8] = [0xc5, 0xdb, 0xb5, 0x60, 0x60, 0xe6, 0xd3, 0x11];
const EXTRUSION: [u8; 8] = [0x75, 0x31, 0xf5, 0x36, 0xb8, 0x72, 0x47, 0x4d];

/// Whether one of the warnings has these words.
fn warns(model: &Model, words: &str) -> bool {
    model.warnings.iter().any(|warning| warning.contains(words))
}

/// Meshes and blocks that are not read are told, and count as faces that are not known; dots and points do not. Hidden objects are left out.
#[test]
fn rhino_objects_without_a_surface_count() {
    let model = rhino_objects(|_| ()).unwrap();
    assert_eq!(
        (model.faces.len(), model.left_out),
        (9, 2),
        "{:?}",
        model.warnings
    );
    assert!(
        warns(&model, "nothing was read: 1 mesh, 1 block"),
        "{:?}",
        model.warnings
    );
    assert!(warns(&model, "block: instance retained"), "{:?}", model.warnings);
    assert!(
        warns(&model, "hidden objects, which are left out: 3"),
        "{:?}",
        model.warnings
    );
    // The sides of an extrusion are a surface on its own, its ends are a sheet: both have the name and the colour of the object.
    let named = |name| {
        let faces = model.faces.iter();
        faces.filter(move |face| face.name.as_deref() == Some(name))
    };
    assert_eq!((named("pad").count(), named("block").count()), (3, 6));
    assert!(named("pad").all(|face| face.colour == Some([255, 128, 0])));
}

/// The surfaces of a polysurface whose edges are lost end nobody knows where; they were taken for whole faces.
#[test]
fn rhino_polysurfaces_that_fall_apart_have_no_known_boundary() {
    let model = rhino_objects(|bytes| {
        // The surface of the first face.
        let at = place(bytes, &BREP) + 11_851;
        assert_eq!(bytes[at..at + 4], [0; 4]);
        bytes[at] = 0x7f;
    })
    .unwrap();
    let unknown = |face: &&cad::Face| matches!(face.boundary, Boundary::Unknown(_));
    assert_eq!(
        (model.faces.len(), model.faces.iter().filter(unknown).count()),
        (9, 6)
    );
    assert!(
        warns(&model, "the edges of a polysurface were not read"),
        "{:?}",
        model.warnings
    );
}

/// An extrusion that is not read counts as a face that is not known.
#[test]
fn rhino_extrusions_that_are_not_read_count() {
    let model = rhino_objects(|bytes| {
        // The vector along its profile.
        let at = place(bytes, &EXTRUSION) + 531;
        bytes[at] ^= 0x7f;
    })
    .unwrap();
    assert_eq!(
        (model.faces.len(), model.left_out),
        (6, 3),
        "{:?}",
        model.warnings
    );
}

/// A document without a unit of length, and one of meshes alone, are refused for what they are.
#[test]
fn rhino_files_of_which_nothing_is_read_tell_why() {
    let error = rhino_objects(|bytes| {
        let at = place(bytes, &[0x31, 0x80, 0, 0x20]) + 16;
        assert_eq!(bytes[at], 2);
        bytes[at] = 0;
    })
    .unwrap_err();
    assert!(error.what.contains("no unit of length"), "{error}");
    assert!(
        error.remedy.contains("set the document's units"),
        "{}",
        error.remedy
    );
    let error = read(&workspace().join("tests/import/mesh.3dm")).unwrap_err();
    assert!(error.what.contains("it has 1 mesh"), "{error}");
    assert!(error.remedy.contains("ToNURBS"), "{}", error.remedy);
}
