//! Jobs of faces of CAD files: the samples on each face, jobs that name a file.

use cad::{Face, JobOptions, Options, machinable, outline, read, write_job};
use inspect::BOUNDS;
use job::Job;
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;
use verify::survey::Survey;

use super::{FILES, cad, taken, whole, workspace};

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
