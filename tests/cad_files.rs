//! CAD files are read right or refused: units, lost boundaries, notations that real files have. Each file is one of the samples, changed in one
//! place, so that the right answer is known.

use std::path::Path;

use cad::{Boundary, CadError, Face, Form, JobOptions, Model, Options, machinable, outline, read, write_job};
use glam::DVec3;
use machine::prepare::prepare;

// Their own tests: as a test, the reader would be built a second time with the libraries that know the formats, for minutes.
#[allow(dead_code, reason = "used by the reader")]
#[path = "../host-sim/cad-reader/src/iges_entries.rs"]
mod iges_entries;
#[allow(dead_code, reason = "used by the reader")]
#[path = "../host-sim/cad-reader/src/step_records.rs"]
mod step_records;

/// A sheet of 30 x 20 in its file's unit, with its corner at the origin.
const SHEET: &str = include_str!("hostile_cad/sound.step");
/// A trimmed face with a hole, and a face that is not trimmed.
const HOOD: &str = include_str!("../jobs/cad/hood.igs");
/// The line of the sheet's unit.
const MILLIMETRE: &str = "#11=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));";
/// The inch, as a conversion of a centimetre.
const INCH: &str = "#11=(CONVERSION_BASED_UNIT('INCH',#14)LENGTH_UNIT()NAMED_UNIT(#15));\n\
    #14=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(2.54),#16);\n\
    #15=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\n\
    #16=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.CENTI.,.METRE.));";
/// A second context, in mm.
const MM_CONTEXT: &str = "#70=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#71,#12,#13))REPRESENTATION_CONTEXT('','3D'));\n\
    #71=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));";

fn read_text(name: &str, text: &str) -> Result<Model, CadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    read(&path)
}

/// The text with one place changed.
fn changed(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "{from}");
    text.replace(from, to)
}

/// Adds records to the sheet.
fn with(text: &str, records: &str) -> String {
    changed(text, "ENDSEC;\nEND-ISO", &format!("{records}\nENDSEC;\nEND-ISO"))
}

/// The far corner of the sheet's boundary, mm.
fn far_corner(model: &Model) -> DVec3 {
    let Boundary::Loops(loops) = &model.faces[0].boundary else {
        panic!("{:?}", model.faces[0].boundary)
    };
    let points = loops.iter().flatten().flatten();
    points.fold(DVec3::NEG_INFINITY, |most, point| most.max(*point))
}

fn is_sheet_of(unit_mm: f64, text: &str) {
    let model = read_text("sheet.step", text).unwrap();
    let gap = far_corner(&model).distance(unit_mm * DVec3::new(30.0, 20.0, 5.0));
    assert!(gap < 1e-9, "{gap} mm off at a unit of {unit_mm} mm");
    let face = &model.faces[0];
    let gap = face
        .surface
        .at(1.0, 1.0)
        .point
        .distance(unit_mm * DVec3::new(30.0, 20.0, 5.0));
    assert!(
        gap < 1e-9,
        "the surface is {gap} mm off at a unit of {unit_mm} mm"
    );
    machinable("", face, &Options::default()).unwrap();
}

/// A shape has the unit of its own context, not that of a context in which it is shown (pythonocc-demos' 11752.stp).
#[test]
fn a_shape_in_inches_shown_in_millimetres() {
    is_sheet_of(1.0, SHEET);
    let inch = changed(SHEET, MILLIMETRE, INCH);
    is_sheet_of(25.4, &inch);
    let styles = "#72=MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(#73),#70);\n\
        #73=STYLED_ITEM('',(#74),#22);\n#74=PRESENTATION_STYLE_ASSIGNMENT((#75));\n#75=NULL_STYLE(.NULL.);";
    let shown = with(&inch, &format!("{MM_CONTEXT}\n{styles}"));
    is_sheet_of(25.4, &shown);
    // The other way round.
    let millimetres = MM_CONTEXT
        .replace("#71=", "#77=")
        .replace("#71,", "#11,")
        .replace("(#11,#12,#13)", "(#78,#12,#13)");
    let metres = millimetres.replace("#77=", "#78=").replace(".MILLI.", "$");
    is_sheet_of(1.0, &with(SHEET, &format!("{metres}\n{styles}")));
    // A second shape in another unit does not change the first.
    let other = "#72=SHAPE_REPRESENTATION('',(#73),#70);\n#73=AXIS2_PLACEMENT_3D('',#74,$,$);\n#74=CARTESIAN_POINT('',(1.,2.,3.));";
    is_sheet_of(25.4, &with(&inch, &format!("{MM_CONTEXT}\n{other}")));
}

#[test]
fn a_doubtful_unit_is_refused() {
    let inch = changed(SHEET, MILLIMETRE, INCH);
    let twice = with(
        &inch,
        &format!("{MM_CONTEXT}\n#72=SHAPE_REPRESENTATION('',(#20),#70);"),
    );
    let two = changed(SHEET, "(#11,#12,#13)", "(#11,#12,#13,#71)");
    for (text, words) in [
        (twice, "(inch and mm)"),
        (changed(SHEET, "(#11,#12,#13)", "(#12,#13)"), "has no length unit"),
        (
            changed(&inch, "LENGTH_MEASURE(2.54)", "LENGTH_MEASURE(2.45)"),
            "named INCH, but is 24.5",
        ),
        (
            with(&two, "#71=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.));"),
            "two different units",
        ),
        (
            with(
                &changed(SHEET, ",(#20),#10)", ",(#20),#72)"),
                &format!(
                    "{}\n#72=GEOMETRIC_REPRESENTATION_CONTEXT(3);\n\
                #73=SHAPE_REPRESENTATION('',(),#10);\n#74=SHAPE_REPRESENTATION('',(),#70);",
                    MM_CONTEXT.replace(".MILLI.", "$")
                ),
            ),
            "has no unit",
        ),
    ] {
        let error = read_text("sheet.step", &text).expect_err(words);
        assert!(error.what.contains(words), "{words}: {error}");
    }
    // IGES: the flag says inches, the name something else, or the flag is none of the standard's.
    for (unit, words) in [
        ("1,4HINCH", None),
        ("2,4HINCH", Some("`INCH`")),
        ("1,2HMM  ", Some("`MM`")),
        ("77,3HXXX", Some("`77`")),
    ] {
        let text = changed(HOOD, "1,4HINCH", unit);
        // A name of two letters leaves two columns, which are blank at the end of a field.
        match (read_text("hood.igs", &text), words) {
            (Ok(model), None) => assert_eq!(model.faces.len(), 2),
            (Err(error), Some(words)) => assert!(error.what.contains(words), "{unit}: {error}"),
            (read, _) => panic!("{unit}: {read:?}"),
        }
    }
}

fn unknown(face: &Face) -> bool {
    matches!(&face.boundary, Boundary::Unknown(_))
}

/// A trimmed surface whose boundary was lost is not a face without a boundary.
#[test]
fn a_lost_boundary_is_not_the_surfaces_own() {
    let whole = read_text("hood.igs", HOOD).unwrap();
    assert!(!whole.faces.iter().any(unknown));
    // The outer boundary is one of its four segments.
    let open = changed(HOOD, "142,0,5,9,19,3;", "142,0,5,9,21,3;");
    // The hole's curve is missing.
    let hole = changed(HOOD, "142,0,5,31,37,3;", "142,0,5,31,99,3;");
    // The trimmed surface is of a kind that does not exist.
    let kind = HOOD.replace("     144       2 ", "     199       2 ").replace(
        "     144       0       0       1       0                               0D0000004",
        "     199       0       0       1       0                               0D0000004",
    );
    assert_ne!(kind, HOOD);
    for (what, text) in [("open", open), ("hole", hole), ("kind", kind)] {
        let model = read_text("hood.igs", &text).unwrap();
        let lost: Vec<&Face> = model.faces.iter().filter(|face| unknown(face)).collect();
        let [face] = lost.as_slice() else {
            panic!(
                "{what}: {} boundaries are unknown: {:?}",
                lost.len(),
                model.warnings
            )
        };
        let error = machinable("", face, &Options::default()).unwrap_err();
        assert!(error.what.contains("boundary is unknown"), "{what}: {error}");
        assert!(outline(face).unwrap().trimmed.is_some());
    }
    // STEP: a face of which one of two boundaries is missing.
    let less = changed(SHEET, "ADVANCED_FACE('',(#23),", "ADVANCED_FACE('',(#23,#99),");
    let model = read_text("sheet.step", &less).unwrap();
    assert!(unknown(&model.faces[0]), "{:?}", model.faces[0].boundary);
    // A closed edge whose curve cannot be read is a hole that was lost, not an edge without length.
    let closed = with(
        &changed(SHEET, "ADVANCED_FACE('',(#23),", "ADVANCED_FACE('',(#23,#80),"),
        "#80=FACE_BOUND('',#81,.T.);\n#81=EDGE_LOOP('',(#82));\n#82=ORIENTED_EDGE('',*,*,#83,.T.);\n#83=EDGE_CURVE('',#84,#84,#86,.T.);\n\
         #84=VERTEX_POINT('',#85);\n#85=CARTESIAN_POINT('',(10.,10.,0.8333333333333334));\n\
         #86=?;\n#87=DIRECTION('',(0.,0.,1.));",
    );
    for curve in [
        "#86=OFFSET_CURVE_3D('',#61,1.,.F.,#87);",
        "#86=CLOTHOID('',#87,1.);",
    ] {
        let model = read_text("sheet.step", &closed.replace("#86=?;", curve)).unwrap();
        assert!(model.faces.iter().all(unknown), "{curve}: {:?}", model.faces);
    }
}

/// A trimmed surface with holes alone ends with its surface: the hole is not its boundary.
#[test]
fn an_implicit_boundary_is_not_another_one() {
    let implicit = changed(HOOD, "144,5,1,1,7,29;", "144,5,0,1,0,29;");
    let model = read_text("hood.igs", &implicit).unwrap();
    let lost: Vec<&Face> = model.faces.iter().filter(|face| unknown(face)).collect();
    let [face] = lost.as_slice() else {
        panic!("{} boundaries are unknown: {:?}", lost.len(), model.warnings)
    };
    let error = machinable("", face, &Options::default()).unwrap_err();
    assert!(error.what.contains("that of its surface"), "{error}");
    assert_eq!(model.left_out, 0);
}

/// A face of which the reader has nothing is counted: of a job of its part it is not known whether the tool cuts it.
#[test]
fn faces_that_are_left_out_are_counted() {
    for (name, whole) in [("sheet.step", SHEET), ("hood.igs", HOOD)] {
        let model = read_text(name, whole).unwrap();
        assert_eq!(model.left_out, 0, "{name}: {:?}", model.warnings);
    }
    // STEP: a face without a surface; beside it one that nothing refers to, which is of no part.
    let second = "ADVANCED_FACE('',(#23),#99,.T.);";
    let shell = changed(SHEET, "(#22)", "(#22,#80)");
    let model = read_text("sheet.step", &with(&shell, &format!("#80={second}"))).unwrap();
    assert_eq!(
        (model.faces.len(), model.left_out),
        (1, 1),
        "{:?}",
        model.warnings
    );
    let model = read_text("sheet.step", &with(SHEET, &format!("#80={second}"))).unwrap();
    assert_eq!(
        (model.faces.len(), model.left_out),
        (1, 0),
        "{:?}",
        model.warnings
    );
    // IGES: a trimmed surface of a surface that does not exist; its own has an unknown boundary then, and counts once.
    let lost = changed(HOOD, "144,5,1,1,7,29; ", "144,99,1,1,7,29;");
    let model = read_text("hood.igs", &lost).unwrap();
    let lost = model.faces.iter().filter(|face| unknown(face)).count();
    assert_eq!((lost, model.left_out), (1, 0), "{:?}", model.warnings);
    assert!(
        model
            .warnings
            .iter()
            .any(|warning| warning.contains("were not read: 1")),
        "{:?}",
        model.warnings
    );
}

/// What has no end, or never begins, is not read.
#[test]
fn devices_and_pipes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.step");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    for path in [pipe.as_path(), Path::new("/dev/zero"), folder.path()] {
        let error = read(path).unwrap_err();
        assert!(error.what.contains("not a regular file"), "{error}");
    }
}

/// The text of a file may begin with a comment (ISO 10303-21, 6.5).
#[test]
fn a_comment_before_the_header() {
    is_sheet_of(
        1.0,
        &format!("/* written by hand;\n second line */ \r\n/**/{SHEET}"),
    );
    let error = read(Path::new("hostile_cad/none.step")).unwrap_err();
    assert!(!error.remedy.is_empty());
}

/// A face far from the origin, as in the coordinates of a car or a ship, is a job: `[placement]` moves it before its range is checked.
#[test]
fn a_face_far_from_the_origin_can_be_placed() {
    let points = [
        ("(0.,0.,0.)", "(5000.,-8000.,0.)"),
        ("(0.,20.,0.)", "(5000.,-7100.,0.)"),
        ("(30.,0.,0.)", "(5900.,-8000.,0.)"),
        ("(30.,20.,5.)", "(5900.,-7100.,50.)"),
    ];
    let mut text = SHEET.to_owned();
    for (from, to) in points {
        text = changed(
            &text,
            &format!("CARTESIAN_POINT('',{from})"),
            &format!("CARTESIAN_POINT('',{to})"),
        );
    }
    let model = read_text("sheet.step", &text).unwrap();
    let made = machinable("", &model.faces[0], &Options::default()).unwrap();
    assert_eq!(made.form, Form::Exact, "and where the file has it");
    assert_eq!(made.nurbs.poles_mm[0][0], [5000.0, -8000.0, 0.0, 1.0]);
    let written = write_job("sheet.step", &model.faces[0], &made, &JobOptions::default()).unwrap();
    assert!(
        written
            .warnings
            .iter()
            .any(|warning| warning.contains("up to 8000 mm")),
        "{:?}",
        written.warnings
    );
    let job = job_file::parse("sheet.toml", &written.text).unwrap();
    prepare(&job).unwrap();
    let extent = patches::placement::extent_mm(&job.surface);
    for ([low, high], half) in extent.into_iter().zip([450.0, 450.0, 25.0]) {
        assert!(
            (low + half).abs() < 1e-6 && (high - half).abs() < 1e-6,
            "{extent:?}"
        );
    }
    // Named in a job, with a placement of its own; without one the refusal names it.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sheet.step"), &text).unwrap();
    let named = |placement: &str| {
        let rest = "[tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 600\nscallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n";
        let text = format!("[surface]\nkind = \"file\"\npath = \"sheet.step\"\n{placement}{rest}");
        let name = folder.path().join("job.toml").display().to_string();
        prepare(&job_file::parse_with(&name, &text, &part::Faces).unwrap())
    };
    assert_eq!(
        named("[placement]\nplace = \"corner\"\n").unwrap().patches(),
        prepare(&job).unwrap().patches()
    );
    let refused = named("").unwrap_err();
    assert!(refused.remedy().contains("[placement]"), "{}", refused.remedy());
}

/// Nothing of a CAD file becomes more than a comment of the job, and options no more than their values.
#[test]
fn names_do_not_write_into_the_job() {
    let model = read_text("sheet.step", SHEET).unwrap();
    let made = machinable("", &model.faces[0], &Options::default()).unwrap();
    let clean = write_job("sheet.step", &model.faces[0], &made, &JobOptions::default()).unwrap();
    let own = job_file::parse("job.toml", &clean.text).unwrap();
    let attack = "\n[cut]\nfeed_mm_min = 9\r[machine]\u{85}\u{1b}[2J\u{2028}# ";
    let mut face = model.faces[0].clone();
    attack.clone_into(&mut face.entity);
    let mut trimmed = made.clone();
    trimmed.outline.trimmed = Some(attack.to_owned());
    let written = write_job(attack, &face, &trimmed, &JobOptions::default()).unwrap();
    let job = job_file::parse("job.toml", &written.text).unwrap();
    assert_eq!((&job.surface, job.feed_mm_min), (&own.surface, own.feed_mm_min));
    assert!(
        !written.text.chars().any(|c| c.is_control() && c != '\n'),
        "{}",
        &written.text[..300]
    );
    let options = JobOptions {
        pattern: Some("zig\"\nspacing = \"first-order".to_owned()),
        ..JobOptions::default()
    };
    let written = write_job("sheet.step", &face, &made, &options).unwrap();
    let error = job_file::parse("job.toml", &written.text).unwrap_err();
    assert!(error.what().contains("`pattern`"), "{error}");
}

/// No ball is offered that is not sold: a job for one of 2 um would be refused later, or never end.
#[test]
fn a_ball_of_micrometres_is_not_offered() {
    let text = changed(SHEET, MILLIMETRE, &MILLIMETRE.replace(".MILLI.", ".MICRO."));
    let model = read_text("sheet.step", &text).unwrap();
    let made = machinable("", &model.faces[0], &Options::default()).unwrap();
    let error = write_job("sheet.step", &model.faces[0], &made, &JobOptions::default()).unwrap_err();
    assert!(
        error.what.contains("no standard ball") && error.remedy.contains("--radius-mm"),
        "{error}"
    );
    let options = JobOptions {
        radius_mm: Some(0.002),
        ..JobOptions::default()
    };
    assert_eq!(
        write_job("sheet.step", &model.faces[0], &made, &options)
            .unwrap()
            .radius_mm,
        0.002
    );
}

/// Edges that are parts of hyperbolas and parabolas, as where planes cut cones.
#[test]
fn conic_edges_are_read() {
    // A plane between the branch x²/9 - y²/4 = 1, or the parabola x = y²/8 + 3, and a line.
    for (curve, end, holds) in [
        (
            "HYPERBOLA('',#66,3.,2.)",
            (3.0 * 2.0_f64.sqrt(), 2.0),
            (|p: DVec3| p.x * p.x / 9.0 - p.y * p.y / 4.0 - 1.0) as fn(DVec3) -> f64,
        ),
        ("PARABOLA('',#67,2.)", (3.5, 2.0), |p: DVec3| {
            p.x - p.y * p.y / 8.0 - 3.0
        }),
    ] {
        let (x, y) = end;
        let mut text = SHEET.to_owned();
        for (from, to) in [
            ("#24=EDGE_LOOP('',(#25,#26,#27,#28));".to_owned(), "#24=EDGE_LOOP('',(#25,#26));".to_owned()),
            ("CARTESIAN_POINT('',(0.,0.,0.))".to_owned(), format!("CARTESIAN_POINT('',({x:?},{:?},0.))", -y)),
            ("CARTESIAN_POINT('',(30.,0.,0.))".to_owned(), format!("CARTESIAN_POINT('',({x:?},{y:?},0.))")),
            ("#51=EDGE_CURVE('',#41,#42,#61,.T.);".to_owned(), "#51=EDGE_CURVE('',#41,#42,#65,.T.);".to_owned()),
            ("#52=EDGE_CURVE('',#42,#43,#62,.T.);".to_owned(), "#52=EDGE_CURVE('',#42,#41,#62,.T.);".to_owned()),
            ("#62=B_SPLINE_CURVE_WITH_KNOTS('',1,(#33,#34)".to_owned(), "#62=B_SPLINE_CURVE_WITH_KNOTS('',1,(#33,#31)".to_owned()),
            ("ADVANCED_FACE('',(#23),#30,.T.)".to_owned(), "ADVANCED_FACE('',(#23),#64,.T.)".to_owned()),
            ("#64=B_SPLINE_CURVE_WITH_KNOTS('',1,(#32,#31),.UNSPECIFIED.,.F.,.F.,(2,2),(0.,1.),.UNSPECIFIED.);".to_owned(), "#64=PLANE('',#66);".to_owned()),
        ] {
            text = changed(&text, &from, &to);
        }
        let text = with(
            &text,
            &format!(
                "#65={curve};\n#66=AXIS2_PLACEMENT_3D('',#68,#69,#79);\n#67=AXIS2_PLACEMENT_3D('',#78,#69,#79);\n\
             #68=CARTESIAN_POINT('',(0.,0.,0.));\n#78=CARTESIAN_POINT('',(3.,0.,0.));\n\
             #69=DIRECTION('',(0.,0.,1.));\n#79=DIRECTION('',(1.,0.,0.));"
            ),
        );
        let model = read_text("sheet.step", &text).unwrap();
        let face = model
            .faces
            .iter()
            .find(|face| face.surface.kind() == "plane")
            .expect("a face");
        let Boundary::Loops(loops) = &face.boundary else {
            panic!("{curve}: {:?}", face.boundary)
        };
        let edge = &loops[0][0];
        assert_eq!(edge.len(), 17);
        for point in edge {
            assert!(holds(*point).abs() < 1e-9, "{curve}: {point}");
        }
        let made = machinable("", face, &Options::default()).unwrap();
        let why = made.outline.trimmed.unwrap();
        assert!(why.contains("not an iso-parametric line"), "{why}");
        // The vertices of its region are on the conic.
        let trimmed = made.trimmed.unwrap();
        let form = oracle::Surface::new(&job::SurfaceSpec::Nurbs(made.nurbs));
        let on = trimmed
            .iter()
            .flatten()
            .filter(|place| holds(form.at(place[0], place[1]).point).abs() < 1e-6);
        assert!(on.count() > 8, "{curve}: {trimmed:?}");
    }
}

/// An IGES file of fixed columns: global section, and one entity with these parameters.
fn iges(global: &str, kind: usize, words: &[String]) -> String {
    let mut lines = vec![format!("{:<72}S{:>7}", "made for a test", 1)];
    for (index, part) in global.as_bytes().chunks(72).enumerate() {
        lines.push(format!("{:<72}G{:>7}", String::from_utf8_lossy(part), index + 1));
    }
    let globals = lines.len() - 1;
    let mut data: Vec<String> = vec![String::new()];
    for (index, word) in words.iter().enumerate() {
        let word = format!("{word}{}", if index + 1 < words.len() { ',' } else { ';' });
        if data[data.len() - 1].len() + word.len() > 64 {
            data.push(String::new());
        }
        data.last_mut().unwrap().push_str(&word);
    }
    let field = |value: usize| format!("{value:>8}");
    lines.push(format!(
        "{}{}{}00000000D{:>7}",
        field(kind),
        field(1),
        "       0".repeat(6),
        1
    ));
    lines.push(format!(
        "{}{}{}{}{}{}D{:>7}",
        field(kind),
        "       0".repeat(2),
        field(data.len()),
        field(0),
        " ".repeat(24),
        "       0",
        2
    ));
    for (index, text) in data.iter().enumerate() {
        lines.push(format!("{text:<64} {:>7}P{:>7}", 1, index + 1));
    }
    lines.push(format!(
        "{:<72}T{:>7}",
        format!("S{:>7}G{globals:>7}D{:>7}P{:>7}", 1, 2, data.len()),
        1
    ));
    lines.join("\n") + "\n"
}

/// A parametric spline surface (114) is the surface of its polynomials, in patches that meet within the file's resolution.
#[test]
fn an_iges_spline_surface_of_entity_114() {
    let (breaks_u, breaks_v) = ([0.0, 1.5, 2.0], [-1.0, 1.0]);
    // One bicubic over the whole, as the coefficients of each patch about its corner.
    let whole = |u: f64, v: f64| {
        DVec3::new(
            10.0 * u + v * v * v,
            8.0 * v + 0.3 * u * u,
            0.5 * u * u * u - 0.7 * u * v * v,
        )
    };
    let scaled = |off: f64| {
        let mut words: Vec<String> = ["114", "3", "1", "2", "1"].map(str::to_owned).to_vec();
        words.extend(breaks_u.iter().chain(&breaks_v).map(|t| format!("{t:?}")));
        for (i, &a) in breaks_u.iter().enumerate() {
            for (j, &b) in breaks_v.iter().enumerate() {
                if i == 2 || j == 1 {
                    words.extend((0..48).map(|_| "9.5".to_owned()));
                    continue;
                }
                // Taylor coefficients of the polynomials above, [power of v][power of u].
                let x = [
                    [10.0 * a + b * b * b, 10.0, 0.0, 0.0],
                    [3.0 * b * b, 0.0, 0.0, 0.0],
                    [3.0 * b, 0.0, 0.0, 0.0],
                    [1.0, 0.0, 0.0, 0.0],
                ];
                let y = [
                    [8.0 * b + 0.3 * a * a, 0.6 * a, 0.3, 0.0],
                    [8.0, 0.0, 0.0, 0.0],
                    [0.0; 4],
                    [0.0; 4],
                ];
                let z = [
                    [
                        0.5 * a * a * a - 0.7 * a * b * b + off * i as f64,
                        1.5 * a * a - 0.7 * b * b,
                        1.5 * a,
                        0.5,
                    ],
                    [-1.4 * a * b, -1.4 * b, 0.0, 0.0],
                    [-0.7 * a, -0.7, 0.0, 0.0],
                    [0.0; 4],
                ];
                words.extend(
                    [x, y, z]
                        .iter()
                        .flatten()
                        .flatten()
                        .map(|c: &f64| format!("{c:.12E}").replace('E', "D")),
                );
            }
        }
        words
    };
    let global = "1H,,1H;,4Htest,4Htest,4Htest,4Htest,32,38,6,308,15,4Htest,1.,1,4HINCH,1,0.01,15H20260101.000000,0.0001,100.,4Htest,4Htest,11,0,15H20260101.000000;";
    // The one bicubic needs no knot. A gap that is closed leaves a corner, which is straightened.
    for (off, most_mm, patches) in [(0.0, 1e-9, 1), (5e-5, 1.5e-3, 2)] {
        let model = read_text("spline.igs", &iges(global, 114, &scaled(off))).unwrap();
        assert_eq!(model.faces.len(), 1);
        let made = machinable("", &model.faces[0], &Options::default()).unwrap();
        assert_eq!(
            (made.form == Form::Exact, made.patches),
            (off == 0.0, patches),
            "{off}"
        );
        for k in 0..=60 {
            let (u, v) = (2.0 * f64::from(k) / 60.0, (0.9 * f64::from(k)).sin());
            let gap = model.faces[0].surface.at(u, v).point.distance(25.4 * whole(u, v));
            assert!(gap <= most_mm, "{gap} mm off at {u}, {v}");
        }
    }
    let error = read_text("spline.igs", &iges(global, 114, &scaled(5e-3))).unwrap_err();
    assert!(error.what.contains("continuity"), "{error}");
}

/// A face has the name and the colour of its file, also where they stand in a context of another unit.
#[test]
fn names_and_colours() {
    let styles = "#72=MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(#90),#70);\n#90=STYLED_ITEM('color',(#91),#22);\n\
        #91=PRESENTATION_STYLE_ASSIGNMENT((#92));\n#92=SURFACE_STYLE_USAGE(.BOTH.,#93);\n#93=SURFACE_SIDE_STYLE('',(#94));\n\
        #94=SURFACE_STYLE_FILL_AREA(#95);\n#95=FILL_AREA_STYLE('',(#96));\n#96=FILL_AREA_STYLE_COLOUR('',#97);\n\
        #97=COLOUR_RGB('',1.,0.50196078,0.);";
    let named = changed(SHEET, "#22=ADVANCED_FACE('',", "#22=ADVANCED_FACE('lid',");
    for (text, unit_mm) in [(named.clone(), 1.0), (changed(&named, MILLIMETRE, INCH), 25.4)] {
        let text = with(&text, &format!("{MM_CONTEXT}\n{styles}"));
        let model = read_text("sheet.step", &text).unwrap();
        assert_eq!(model.faces[0].name.as_deref(), Some("lid"));
        assert_eq!(model.faces[0].colour, Some([255, 128, 0]));
        is_sheet_of(unit_mm, &text);
    }
    // Of the part, where the face has none.
    let model = read_text("sheet.step", SHEET).unwrap();
    assert_eq!(
        (model.faces[0].name.as_deref(), model.faces[0].colour),
        (Some("sheet"), None)
    );
}

/// A file whose solids are inside out, their normals inwards and their loops the other way round, reads as the same faces.
#[test]
fn solids_inside_out_are_turned() {
    let text = include_str!("../jobs/cad/lens_mould.step");
    let flipped = |line: &str| {
        if !line.contains("ADVANCED_FACE(") && !line.contains("FACE_BOUND(") {
            return line.to_owned();
        }
        let (other, flag) = if line.ends_with(".T.);") {
            (".T.);", ".F.);")
        } else {
            (".F.);", ".T.);")
        };
        line.replace(other, flag)
    };
    let inside_out: Vec<String> = text.lines().map(flipped).collect();
    let inside_out = inside_out.join("\n");
    assert_ne!(inside_out, text);
    let [right, turned] = [text, &inside_out].map(|text| read_text("mould.step", text).unwrap());
    assert_eq!(right.faces.len(), turned.faces.len());
    for (right, turned) in right.faces.iter().zip(&turned.faces) {
        assert!(right.solid);
        assert_eq!(right.sense, turned.sense, "face {}", right.number);
        assert_eq!(outline(right), outline(turned), "face {}", right.number);
    }
}
