//! CAD files against the CAD kernel that wrote them: every face of every file, the samples of a job on each face, malformed files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use cad::{
    Axis, Face, Form, JobOptions, MachinableFace, Model, Options, SplineSurface, Surface, machinable,
    outline, read, write_job,
};
use glam::DVec3;
use inspect::BOUNDS;
use job::{Job, NurbsSpec};
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;
use verify::survey::Survey;

/// Maximum distance of an exactly imported surface from the kernel's points, mm. Files have 9 (IGES) and 12 digits (STEP).
const EXACT_MM: f64 = 1e-6;
/// Maximum angle between its normal and the kernel's, rad.
const NORMAL_RAD: f64 = 1e-6;
/// All CAD files with the number of faces read, of kernel faces that cannot be read, and of faces that are not among the kernel's.
const FILES: [(&str, usize, usize, usize); 9] = [
    ("blade.step", 13, 0, 0),
    ("hood.igs", 2, 0, 0),
    ("hood.step", 2, 0, 0),
    ("lens_mould.step", 7, 0, 0),
    ("mouse.3dm", 2, 0, 0),
    ("mouse.igs", 1, 0, 0),
    ("mouse.step", 1, 0, 0),
    // The offset surface: its entity 140 has an offset indicator that is not a unit vector, so it is left out with a warning, and its
    // base surface is read as a face of its own.
    ("swept.igs", 4, 1, 1),
    ("swept.step", 4, 0, 0),
];

fn workspace() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn cad(name: &str) -> PathBuf {
    workspace().join("jobs/cad").join(name)
}

fn whole() -> Options {
    Options {
        untrimmed: true,
        ..Options::default()
    }
}

/// A point and a normal as the kernel evaluates them.
type Reference = (DVec3, DVec3);

/// Reference points of each face of each file, by the kernel's face numbers.
fn references() -> BTreeMap<String, BTreeMap<usize, Vec<Reference>>> {
    let text = std::fs::read_to_string(workspace().join("tests/golden/cad_points.txt")).unwrap();
    let mut files: BTreeMap<String, BTreeMap<usize, Vec<Reference>>> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split(' ').collect();
        let x = |k: usize| words[k].parse::<f64>().unwrap();
        let faces = files.entry(words[0].to_owned()).or_default();
        faces
            .entry(words[1].parse().unwrap())
            .or_default()
            .push((DVec3::new(x(2), x(3), x(4)), DVec3::new(x(5), x(6), x(7))));
    }
    files
}

/// The job's surface in a form that can be inverted: parameters of a point.
fn inverse(nurbs: &NurbsSpec) -> Surface {
    let axis = |degree: usize, knots: &[f64]| Axis {
        degree,
        knots: knots.to_vec(),
    };
    let pole = |[x, y, z, w]: &[f64; 4]| [x * w, y * w, z * w, *w];
    Surface::Spline(SplineSurface {
        axes: [
            axis(nurbs.degree[0], &nurbs.knots_u),
            axis(nurbs.degree[1], &nurbs.knots_v),
        ],
        poles: nurbs
            .poles_mm
            .iter()
            .map(|row| row.iter().map(pole).collect())
            .collect(),
    })
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Largest distance of the points from the surface, mm, and largest angle between the normals, rad.
fn compared(surface: &Surface, sense: f64, points: &[Reference]) -> (f64, f64) {
    let mut worst = (0.0_f64, 0.0_f64);
    for (point, normal) in points {
        let ([u, v], distance) = surface.invert(*point, None);
        let at = surface.at(u, v);
        worst.0 = worst.0.max(distance);
        worst.1 = worst.1.max(angle(sense * at.u.cross(at.v), *normal));
    }
    worst
}

/// The whole face, trimmed or not, at a coarser tolerance where a fit at the default tolerance has more patches than the board can store.
fn taken(name: &str, face: &Face) -> MachinableFace {
    machinable(name, face, &whole()).unwrap_or_else(|error| {
        assert!(error.what.contains("more than the board's store"), "{error}");
        let coarser = Options {
            tolerance_mm: 0.02,
            ..whole()
        };
        machinable(name, face, &coarser).unwrap()
    })
}

fn made(name: &str, model: &Model) -> Vec<MachinableFace> {
    model.faces.iter().map(|face| taken(name, face)).collect()
}

/// Each face that the kernel wrote is found exactly once, with its points, normals and sides.
#[test]
fn every_face_of_every_file() {
    let references = references();
    for (name, count, lost, more) in FILES {
        let model = read(&cad(name)).unwrap();
        assert_eq!(model.faces.len(), count, "{name}: {:?}", model.warnings);
        let kernel = &references[name];
        assert_eq!(kernel.len(), count + lost - more, "{name}");
        let surfaces: Vec<_> = made(name, &model)
            .into_iter()
            .map(|made| (inverse(&made.nurbs), made))
            .collect();
        let mut taken = vec![0; count];
        let mut missed = 0;
        for (number, points) in kernel {
            let mut found = false;
            for (index, (surface, made)) in surfaces.iter().enumerate() {
                let near = match &made.form {
                    Form::Exact => EXACT_MM,
                    Form::Fitted { deviation, .. } => deviation.max_mm + EXACT_MM,
                };
                // One point is enough to exclude most faces.
                let first = surface.invert(points[0].0, None).1;
                if first > near {
                    continue;
                }
                let (distance, turned) = compared(surface, model.faces[index].sense, points);
                if distance > near {
                    continue;
                }
                found = true;
                taken[index] += 1;
                let most = match &made.form {
                    Form::Exact => NORMAL_RAD,
                    Form::Fitted { deviation, .. } => deviation.normal_rad + NORMAL_RAD,
                };
                // A surface without a shell in its file has no side.
                let sided = !name.ends_with("3dm") && !name.ends_with("igs");
                let turned = if sided {
                    turned
                } else {
                    turned.min(std::f64::consts::PI - turned)
                };
                assert!(
                    turned <= most,
                    "{name}, face {number}: normals differ by {turned} rad"
                );
                println!(
                    "{name:<16} kernel's face {number:>2} is {:>2} ({}): {distance:.1e} mm, {turned:.1e} rad, {} patches",
                    index + 1,
                    model.faces[index].surface.kind(),
                    made.patches
                );
            }
            if !found {
                let nearest = surfaces
                    .iter()
                    .map(|(surface, made)| (compared(surface, 1.0, points), &made.form));
                println!(
                    "{name}, kernel's face {number} is not found: {:?}",
                    nearest.collect::<Vec<_>>()
                );
            }
            missed += usize::from(!found);
        }
        assert_eq!(missed, lost, "{name}: faces that were not found again");
        assert!(taken.iter().all(|times| *times <= 1), "{name}: {taken:?}");
        let not_taken = taken.iter().filter(|times| **times == 0).count();
        assert_eq!(not_taken, more, "{name}: {taken:?}");
    }
}

/// Surfaces that cannot be converted exactly are fitted within the tolerance, for several tolerances.
#[test]
fn fits_keep_the_tolerance() {
    let degree_5 = &read(&cad("hood.step")).unwrap().faces;
    let swept = read(&cad("swept.step")).unwrap();
    let offset = swept
        .faces
        .iter()
        .find(|face| face.surface.kind() == "offset")
        .unwrap();
    for face in degree_5.iter().chain([offset]) {
        let mut patches = 0;
        for tolerance_mm in [0.3, 0.1, 0.02] {
            let options = Options {
                tolerance_mm,
                ..whole()
            };
            let made = machinable("", face, &options).unwrap();
            let Form::Fitted { deviation, .. } = &made.form else {
                panic!("{} cannot be exact", face.entity)
            };
            assert!(deviation.max_mm <= tolerance_mm, "{deviation:?}");
            // The job's surface against the face's surface, on a grid that does not coincide with that of the fit.
            let [[u0, u1], [v0, v1]] = made.outline.rectangle;
            let surface = inverse(&made.nurbs);
            for i in 0..101 {
                for j in 0..97 {
                    let u = u0 + (u1 - u0) * f64::from(i) / 100.0;
                    let v = v0 + (v1 - v0) * f64::from(j) / 96.0;
                    let (a, b) = (surface.at(u, v).point, face.surface.at(u, v).point);
                    assert!(
                        a.distance(b) <= 1.02 * tolerance_mm,
                        "{} at {u}, {v}",
                        face.entity
                    );
                }
            }
            assert!(
                made.patches >= patches,
                "a tighter tolerance takes no fewer patches"
            );
            patches = made.patches;
        }
    }
}

/// The mouse has the same surface in STEP, IGES and 3DM, in two units, and in `jobs/freeform.toml`.
#[test]
fn formats_units_and_placements_agree() {
    let poles = |name: &str, number: usize| {
        let model = read(&cad(name)).unwrap();
        let made = machinable(name, &model.faces[number], &whole()).unwrap();
        assert_eq!(made.form, Form::Exact, "{name}");
        made.nurbs
    };
    let mouse_3dm = read(&cad("mouse.3dm")).unwrap();
    let in_3dm = mouse_3dm
        .faces
        .iter()
        .position(|face| face.surface.kind() == "B-spline")
        .unwrap();
    let step = poles("mouse.step", 0);
    for other in [poles("mouse.igs", 0), poles("mouse.3dm", in_3dm)] {
        assert_eq!([&step.knots_u, &step.knots_v], [&other.knots_u, &other.knots_v]);
        for (a, b) in step
            .poles_mm
            .iter()
            .flatten()
            .zip(other.poles_mm.iter().flatten())
        {
            for (a, b) in a.iter().zip(b) {
                assert!((a - b).abs() <= 1e-9, "{a} is not {b}");
            }
        }
    }
    let job = job_file::load(&workspace().join("jobs/freeform.toml")).unwrap();
    let job::SurfaceSpec::Nurbs(freeform) = job.surface else {
        panic!("the mouse is a B-spline")
    };
    for (a, b) in step
        .poles_mm
        .iter()
        .flatten()
        .zip(freeform.poles_mm.iter().flatten())
    {
        assert!(
            (0..3).all(|k| (a[k] - b[k]).abs() <= 1e-9),
            "inches: {a:?} is not {b:?}"
        );
    }
}

/// Runs at least a given number of samples of a job, to the end of the pass. Returns the worst position error, nm, and ripple, %, the
/// number of samples, and the fault.
fn worst_nm(job: &Job, most: u64) -> (f64, f64, u64, Option<String>) {
    let oracle = Oracle::new(job).unwrap();
    let prepared = prepare(job).unwrap();
    let mut survey = Survey::new(&oracle, None);
    let mut machine = Machine::load(&prepared).unwrap();
    let (mut samples, mut last, mut cut) = (0, None, false);
    let result = machine.run(|sample| {
        let begins = last != Some(sample.pass);
        last = Some(sample.pass);
        samples += 1;
        cut = samples >= most && begins;
        survey
            .add(&inspect::plain(&prepared, sample), &mut |_, _| ())
            .is_ok()
            && !cut
    });
    let fault = result.as_ref().err().map(|fault| format!("{fault:?}"));
    let report = survey
        .finish(result.is_ok() && !cut, &mut |_, _| ())
        .unwrap()
        .report;
    (
        report.position_nm.max.abs(),
        report.ripple_pct.max.abs(),
        samples,
        fault,
    )
}

/// A job on every face: the ball that `import` chooses fits, and every sample agrees with the oracle.
#[test]
fn samples_on_every_face() {
    for (name, ..) in FILES {
        let model = read(&cad(name)).unwrap();
        for face in &model.faces {
            let made = taken(name, face);
            let written = write_job(name, face, &made, &JobOptions::default()).unwrap();
            let mut job = job_file::parse("job", &written.text)
                .unwrap_or_else(|error| panic!("{name}, face {}: {error}", face.number));
            // High feed and wide passes: a few thousand samples over the whole face.
            job.feed_mm_min = 6000.0;
            job.scallop_mm = 0.1 * job.radius_mm;
            let mut run = worst_nm(&job, 60_000);
            // Spans of the file may be shorter than one period's arc; the feed is then reduced.
            while run
                .3
                .as_ref()
                .is_some_and(|fault| fault.contains("PatchTooShort"))
                && job.feed_mm_min > 100.0
            {
                job.feed_mm_min *= 0.25;
                run = worst_nm(&job, 60_000);
            }
            let (position_nm, ripple_pct, samples, fault) = run;
            println!(
                "{name:<16} {:>2} {:<18} ball {:>5} mm: {position_nm:.2} nm, ripple {ripple_pct:.6} %, {samples} samples {fault:?}",
                face.number,
                face.surface.kind(),
                job.radius_mm
            );
            assert_eq!(fault, None, "{name}, face {}", face.number);
            assert!(
                position_nm <= BOUNDS.position_nm,
                "{name}, face {}: {position_nm} nm",
                face.number
            );
            assert!(samples > 100, "{name}, face {}", face.number);
        }
    }
}

/// A trimmed face becomes a job that names its file, with its region; untrimmed only on request, and the job file then has a note.
#[test]
fn trimmed_faces_are_said() {
    for name in ["hood.step", "hood.igs"] {
        let model = read(&cad(name)).unwrap();
        let trimmed: Vec<&Face> = model
            .faces
            .iter()
            .filter(|face| outline(face).unwrap().trimmed.is_some())
            .collect();
        let [face] = trimmed.as_slice() else {
            panic!("{name}: one of two faces is trimmed, not {}", trimmed.len())
        };
        let coarse = Options {
            tolerance_mm: 0.02,
            ..Options::default()
        };
        let made = machinable(name, face, &coarse).unwrap();
        let hole = made.trimmed.as_ref().unwrap();
        assert_eq!(hole.len(), 2, "{name}: the boundary and the hole");
        let error = write_job(name, face, &made, &JobOptions::default()).unwrap_err();
        assert!(error.remedy.contains("--untrimmed"), "{}", error.remedy);
        let named = JobOptions {
            source: Some((name.to_owned(), 0.02)),
            ..JobOptions::default()
        };
        let written = write_job(name, face, &made, &named).unwrap();
        for words in ["kind = \"file\"", "[part]"] {
            assert!(written.text.contains(words), "{name}: {}", written.text);
        }
        let made = taken(name, face);
        assert_eq!(made.trimmed, None);
        let written = write_job(name, face, &made, &JobOptions::default()).unwrap();
        assert!(
            written.text.contains("# Note: the face is trimmed"),
            "{}",
            &written.text[..400]
        );
        assert!(written.warnings.iter().any(|warning| warning.contains("trimmed")));
    }
    // Faces of an analytic solid: a block with a spherical pocket and a bore, and a ball. The planes are trimmed, the other faces are not.
    let model = read(&cad("blade.step")).unwrap();
    let kinds = |trimmed: bool| {
        let mut kinds: Vec<_> = model
            .faces
            .iter()
            .filter(|face| {
                let made = machinable("", face, &Options::default()).unwrap();
                made.trimmed.is_some() == trimmed
            })
            .map(|face| face.surface.kind())
            .collect();
        kinds.sort_unstable();
        kinds
    };
    assert!(
        kinds(false).contains(&"cylinder"),
        "the bore is whole: {:?}",
        kinds(false)
    );
    assert_eq!(
        kinds(false).iter().filter(|kind| **kind == "sphere").count(),
        2,
        "{:?}",
        kinds(false)
    );
    assert!(
        kinds(true).iter().all(|kind| *kind == "plane"),
        "{:?}",
        kinds(true)
    );
}

/// The sample jobs that name a CAD file load, and their samples agree with the oracle.
#[test]
fn sample_jobs_out_of_files() {
    for (name, patches) in [("blade", 12), ("hood", 247)] {
        let job =
            job_file::load_with(&workspace().join(format!("jobs/cad/{name}.toml")), &part::Faces).unwrap();
        assert_eq!(prepare(&job).unwrap().patches(), patches, "{name}");
        let (position_nm, ripple_pct, samples, fault) = worst_nm(&job, u64::MAX);
        println!("{name}: {position_nm:.2} nm, ripple {ripple_pct:.6} %, {samples} samples");
        assert_eq!(fault, None, "{name}");
        assert!(
            position_nm <= BOUNDS.position_nm && ripple_pct <= BOUNDS.ripple_pct,
            "{name}"
        );
        assert!(
            (200_000..3_000_000).contains(&samples),
            "{name}: {samples} samples"
        );
    }
}

/// A job that names a CAD file equals one that contains the converted face, and its errors name the line.
#[test]
fn jobs_that_name_a_file() {
    let folder = workspace().join("jobs/cad");
    let text = |surface: &str| {
        format!(
            "[surface]\nkind = \"file\"\n{surface}\n[tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 600\n\
             scallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n"
        )
    };
    let name = folder.join("job.toml").display().to_string();
    let job = job_file::parse_with(&name, &text("path = \"mouse.step\"\nface = 1"), &part::Faces).unwrap();
    let model = read(&cad("mouse.step")).unwrap();
    let made = machinable("", &model.faces[0], &Options::default()).unwrap();
    assert_eq!(job.surface, made.spec());
    for (surface, line, words) in [
        ("path = \"missing.step\"", 3, "cannot read"),
        ("path = \"mouse.step\"\nface = 2", 4, "has no face 2"),
        ("path = \"mouse.step\"\nface = 1.5", 4, "whole number"),
        ("path = \"hood.step\"\nface = 1", 4, "the board's store"),
        ("path = \"mouse.step\"\nuntrimmed = 3", 4, "true or false"),
        ("path = \"mouse.step\"\ntolerance_mm = 0", 4, "must be above 0"),
        ("path = 5", 3, "text in quotes"),
        (
            "path = \"mouse.step\"\ndegree = [3, 3]",
            4,
            "does not belong here",
        ),
    ] {
        let error = job_file::parse_with(&name, &text(surface), &part::Faces).unwrap_err();
        assert!(error.what().contains(words), "{surface}: {error}");
        assert_eq!(error.line_and_column().unwrap().0, line, "{surface}: {error}");
    }
}

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

/// Warnings of an IGES file name the directory entries of what was not read, as the list names those of faces.
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

/// A job of an approximated face names the face, and the face is within the tolerance of the job's surface, whatever its placement; an exact
/// one names none.
#[test]
fn approximated_faces_name_their_source() {
    let model = read(&cad("swept.step")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(cad("swept.step"), folder.path().join("part.step")).unwrap();
    for (number, fitted) in [(1, false), (3, true)] {
        let face = &model.faces[number - 1];
        let made = machinable("part.step", face, &whole()).unwrap();
        let options = JobOptions {
            source: Some(("part.step".to_owned(), 0.001)),
            ..JobOptions::default()
        };
        let text = write_job("part.step", face, &made, &options).unwrap().text;
        assert_eq!(text.contains("source = \"part.step\""), fitted);
        let text = format!("{text}\n[placement]\nscale = 2\nrotate_deg = [10, 20, 30]\n");
        let name = folder.path().join("job.toml");
        let job = job_file::parse_with(name.to_str().unwrap(), &text, &part::Faces).unwrap();
        let Some(source) = job.origin.cad() else {
            assert!(!fitted);
            continue;
        };
        assert_eq!(
            (source.face, source.scale, source.tolerance_mm),
            (number, 2.0, 0.001)
        );
        let original = cad::Original::read(source).unwrap().unwrap();
        let surface = oracle::Surface::new(&source.surface);
        let [u, v] = surface.domain();
        let mut most = 0.0_f64;
        for i in 0..=40 {
            for j in 0..=40 {
                let at = |[low, high]: [f64; 2], k: i32| low + (high - low) * f64::from(k) / 40.0;
                let (u, v) = (at(u, i), at(v, j));
                most = most.max(original.from_surface(u, v, surface.at(u, v).point).length());
            }
        }
        assert!(most <= 2.0 * 0.001 * 1.05 && most > 1e-5, "{most}");
    }
}
