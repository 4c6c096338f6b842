//! Faces of a CAD file: their list and their page.

use std::path::Path;

use serde_json::Value;

use super::{err, json, out, run};

/// The list of a file's faces: measures against closed forms, conditions and order.
#[test]
fn faces_are_listed_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    let cad = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cad/blade.step");
    std::fs::copy(cad, folder.path().join("blade.step")).unwrap();
    let faces = |more: &str| {
        let list = json(folder.path(), &format!("import blade.step --list --json {more}"));
        list["faces"].as_array().unwrap().clone()
    };
    let whole = faces("");
    assert_eq!(whole.len(), 13);
    let area = |face: &Value| face["area_mm2"].as_f64().unwrap();
    let number = |face: &Value| face["face"].as_u64().unwrap();
    for face in &whole {
        let size: Vec<f64> = face["size_mm"]
            .as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_f64().unwrap())
            .collect();
        let round = &face["least_concave_radius_mm"];
        let radius = round["minus"].as_f64().or(round["plus"].as_f64());
        let height = match face["kind"].as_str().unwrap() {
            // A zone of a sphere is as large as that of the cylinder about it.
            "sphere" | "cylinder" => size[2],
            _ => continue,
        };
        let exact = std::f64::consts::TAU * radius.unwrap() * height;
        assert!((area(face) / exact - 1.0).abs() < 1e-3, "{face}: {exact} mm2");
    }
    let up = faces("--only up --sort area --reverse");
    assert!(!up.is_empty() && up.len() < whole.len());
    assert!(up.windows(2).all(|pair| area(&pair[0]) >= area(&pair[1])));
    let facing_up = |face: &&Value| {
        face["normal"]
            .as_array()
            .is_some_and(|normal| normal[2].as_f64().unwrap() > 0.1)
    };
    assert_eq!(up.len(), whole.iter().filter(facing_up).count());
    let large = faces("--only kind=PLANE --only area>3000 --only whole");
    let expected: Vec<u64> = whole
        .iter()
        .filter(|face| face["kind"] == "plane" && area(face) > 3000.0 && face["trimmed"] == false)
        .map(number)
        .collect();
    assert_eq!(large.iter().map(number).collect::<Vec<_>>(), expected);
    for (wrong, words) in [("--only down", "kind=WORD"), ("--sort size", "patches")] {
        let output = run(folder.path(), &format!("import blade.step --list {wrong}"));
        assert_eq!(output.status.code(), Some(2));
        assert!(err(&output).contains(words), "{}", err(&output));
    }
    let text = out(&run(
        folder.path(),
        "import blade.step --list --only name=nothing",
    ));
    assert!(text.contains("0 of 13 faces"), "{text}");
}

/// The page of a file's faces has them all, where they are, and no name in the file is more than text on it.
#[test]
fn a_page_shows_the_part() {
    let folder = tempfile::tempdir().unwrap();
    let cad = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cad");
    std::fs::copy(cad.join("blade.step"), folder.path().join("blade.step")).unwrap();
    let sheet = std::fs::read_to_string(cad.join("../../tests/hostile_cad/sound.step")).unwrap();
    let attack = "</script><img src=x onerror=alert(1)>";
    let named = sheet.replacen("ADVANCED_FACE('',", &format!("ADVANCED_FACE('{attack}',"), 1);
    assert_ne!(named, sheet);
    std::fs::write(folder.path().join("sheet.step"), named).unwrap();
    let page = |file: &str| -> (String, Value) {
        let output = run(
            folder.path(),
            &format!("import {file}.step --list --page {file}.html"),
        );
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let text = std::fs::read_to_string(folder.path().join(format!("{file}.html"))).unwrap();
        let data = text
            .split_once("id=\"data\">")
            .unwrap()
            .1
            .split_once("</script>")
            .unwrap()
            .0;
        let data = serde_json::from_str(data).unwrap();
        (text, data)
    };
    let (text, data) = page("sheet");
    assert_eq!(data["faces"][0]["name"], attack);
    assert!(!text.contains("<img"));
    assert_eq!(text.matches("</script>").count(), 2);
    let (_, data) = page("blade");
    let faces = data["faces"].as_array().unwrap();
    assert_eq!(faces.len(), 13);
    let listed = json(folder.path(), "import blade.step --list --json");
    for (face, listed) in faces.iter().zip(listed["faces"].as_array().unwrap()) {
        assert_eq!(face["number"], listed["face"]);
        let points: Vec<Vec<f64>> = face["polygons"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|rings| rings.as_array().unwrap())
            .flat_map(|ring| ring.as_array().unwrap())
            .map(|point| {
                point
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|x| x.as_f64().unwrap())
                    .collect()
            })
            .collect();
        assert!(points.len() >= 4, "face {}", face["number"]);
        // Within the box of the list, which is that of the rectangle around a trimmed face.
        let [low, high] = [0, 1].map(|k| listed["corners_mm"][k].as_array().unwrap().clone());
        for point in &points {
            for axis in 0..3 {
                let (low, high) = (low[axis].as_f64().unwrap(), high[axis].as_f64().unwrap());
                let slack = 0.01 + 0.01 * (high - low);
                assert!(
                    (low - slack..=high + slack).contains(&point[axis]),
                    "face {}: {point:?}",
                    face["number"]
                );
            }
        }
        assert!(
            face["command"]
                .as_str()
                .unwrap()
                .contains(&format!("import blade.step --face {}", face["number"]))
        );
    }
    let again = run(folder.path(), "import blade.step --list --page blade.html");
    assert_eq!(again.status.code(), Some(2), "{}", err(&again));
}

/// The command of the page machines a trimmed face as it is; the whole rectangle only where the boundary is not known, and then the page tells.
#[test]
fn the_page_leaves_trimmed_faces_trimmed() {
    let folder = tempfile::tempdir().unwrap();
    let cad = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/cad/blade.step");
    let text = std::fs::read_to_string(cad).unwrap();
    let lost = text.replace("#618 = CIRCLE(", "#618 = CLOTHOID(");
    assert_ne!(lost, text);
    std::fs::write(folder.path().join("part.step"), lost).unwrap();
    let listed = json(folder.path(), "import part.step --list --page part.html --json");
    let page = std::fs::read_to_string(folder.path().join("part.html")).unwrap();
    let (_, data) = page.split_once("id=\"data\">").unwrap();
    let data: Value = serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap();
    let mut trimmed = 0;
    for (face, listed) in data["faces"]
        .as_array()
        .unwrap()
        .iter()
        .zip(listed["faces"].as_array().unwrap())
    {
        let unknown = listed["boundary_known"] == false;
        trimmed += usize::from(!unknown && listed["trimmed"] == true);
        let [command, state] = ["command", "state"].map(|key| face[key].as_str().unwrap());
        assert_eq!(command.contains("--untrimmed"), unknown, "{face}");
        assert_eq!(state.contains("the whole rectangle"), unknown, "{face}");
    }
    assert!(trimmed > 0);
}

/// A face that bounds no solid is machined from above, whichever way its normal points: `--only up` lists it.
#[test]
fn a_face_that_is_machined_from_above_is_listed_as_up() {
    let folder = tempfile::tempdir().unwrap();
    let sheet = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/hostile_cad/sound.step");
    let sheet = std::fs::read_to_string(sheet).unwrap();
    let turned = sheet.replace("(#23),#30,.T.)", "(#23),#30,.F.)");
    assert_ne!(turned, sheet);
    for (name, text) in [("sheet", sheet), ("turned", turned)] {
        std::fs::write(folder.path().join(format!("{name}.step")), text).unwrap();
        let list = json(
            folder.path(),
            &format!("import {name}.step --list --only up --json"),
        );
        assert_eq!(list["faces"].as_array().unwrap().len(), 1, "{name}");
    }
}
