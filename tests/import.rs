//! CAD files against the CAD kernel that wrote them: every face of every file, the samples of a job on each face, malformed files.

mod files;
mod jobs;

use std::collections::BTreeMap;
use std::path::PathBuf;

use cad::{Axis, Face, Form, MachinableFace, Model, Options, SplineSurface, Surface, machinable, read};
use glam::DVec3;
use job::NurbsSpec;

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
