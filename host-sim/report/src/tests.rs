//! Tests of the report: bounded memory, well-formed output, correct figures.

use std::path::Path;

use super::furniture::round_below;
use super::record::{DecimatedStream, Record};
use super::svg::{escape, polyline, simplified, tenths};
use super::{Figure, Mark, Remarks, RidgePoint, Scallops, Sketch, measure, number};
use job::Job;
use machine::Machine;
use machine::prepare::prepare;
use oracle::{Oracle, PassSample, SampleCheck};
use verify::survey::{Survey, SurveyResult};

/// A small bell with about 20 passes.
pub(super) const BELL: &str = r#"
[surface]
kind = "revolved"
radius_mm = [60, -90, 90, 20]
height_mm = [60, -90, 0, 50]
u = [0, 1]
v_rad = [-1.2, -0.6]
[tool]
kind = "ball"
radius_mm = 10
[cut]
feed_mm_min = 6000
scallop_mm = 0.05
along = "u"
side = "up"
pattern = "zigzag"
"#;

/// Runs a job as the command does.
pub(super) fn run(text: &str) -> (Job, Sketch, SurveyResult) {
    let job = job_file::parse("bell.toml", text).unwrap();
    let prepared = prepare(&job).unwrap();
    let oracle = Oracle::new(&job).unwrap();
    let passes = oracle.schedule().unwrap().len();
    let mut sketch = Sketch::new(&job, passes);
    let mut draw = |sample: &PassSample, checked: &SampleCheck| sketch.add(sample, checked);
    let mut survey = Survey::new(&oracle, None);
    Machine::load(&prepared)
        .unwrap()
        .run(|sample| survey.add(&inspect::plain(&prepared, sample), &mut draw).is_ok())
        .unwrap();
    let findings = survey.finish(true, &mut draw).unwrap();
    (job, sketch, findings)
}

/// Panics unless all tags are nested and closed, attributes are quoted, and `&` and `<` are escaped in the text.
fn assert_well_formed(text: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = text;
    while let Some(start) = rest.find('<') {
        let (before, from) = rest.split_at(start);
        assert!(
            !before.contains('>') || open.last() == Some(&"style"),
            "stray > in {before:?}"
        );
        for entity in before.split('&').skip(1) {
            assert!(
                entity.split(';').next().is_some_and(|name| name.len() < 6),
                "stray & in {before:?}"
            );
        }
        let end = from.find('>').expect("a tag is closed");
        let tag = &from[1..end];
        assert_eq!(tag.matches('"').count() % 2, 0, "quotes in {tag:?}");
        let name = tag
            .trim_start_matches('/')
            .split([' ', '/', '\n'])
            .next()
            .unwrap();
        match () {
            () if tag.starts_with('!') || tag.ends_with('/') => {}
            // The content of a script is skipped up to its end tag.
            () if name == "script" => {
                let script = &from[end + 1..];
                rest = &script[script.find("</script>").expect("a script ends") + 9..];
                continue;
            }
            () if tag.starts_with('/') => assert_eq!(open.pop(), Some(name)),
            () => open.push(name),
        }
        rest = &from[end + 1..];
    }
    assert!(open.is_empty(), "never closed: {open:?}");
}

/// The raw value of a row of the page.
fn value_of(page: &str, what: &str) -> f64 {
    let row = page
        .split_once(&format!("<th scope=\"row\">{what}</th><td><data value=\""))
        .expect(what)
        .1;
    row.split('"').next().unwrap().parse().unwrap()
}

#[test]
fn thinning_is_bounded_and_keeps_both_ends() {
    for count in [1_u32, 2, 9, 10, 11, 20, 21, 999, 100_000] {
        let mut decimated = DecimatedStream::new(10);
        (0..count).for_each(|item| decimated.push(item));
        let items = decimated.items();
        assert!(
            items.len() <= 11 && items.len() >= count.min(6) as usize,
            "{count}: {items:?}"
        );
        assert_eq!((items.first(), items.last()), (Some(&0), Some(&(count - 1))));
        assert!(items.windows(2).all(|pair| pair[0] < pair[1]));
    }
    assert!(DecimatedStream::<u8>::new(10).items().is_empty());
}

#[test]
fn record_is_bounded_whatever_the_job() {
    let job = job_file::parse("bell.toml", BELL).unwrap();
    // More passes than expected, each longer than its capacity.
    for (expected, passes, samples) in [(5000, 6000, 3), (3, 500, 700), (0, 2, 5000)] {
        let mut record = Record::new(&job, expected);
        for pass in 0..passes {
            for step in 0..samples {
                record.add(&PassSample {
                    tick: 0,
                    pass,
                    u: f64::from(step),
                    v: f64::from(pass),
                    cc_nm: [0; 3],
                    cl_nm: [step, 0, 0],
                    feed_mm_s: 1.0,
                    interval: 1.0 + f64::from(step),
                    first_of_pass: step == 0,
                    last_of_pass: step + 1 == samples,
                });
            }
        }
        assert!(record.drawn.len() <= 61, "{} passes drawn", record.drawn.len());
        assert!(record.drawn.iter().all(|drawn| drawn.places.items().len() <= 301));
        assert!(record.intervals.items().len() <= 2049);
        assert!(
            record
                .intervals
                .items()
                .iter()
                .all(|pass| pass.least == 1.0 && pass.step == 1.0)
        );
    }
}

#[test]
fn zigzag_passes_are_drawn_to_and_fro() {
    let job = job_file::parse("bell.toml", BELL).unwrap();
    let (sketch, mut drawn) = (Sketch::new(&job, 164), Vec::new());
    let mut record = sketch.record;
    for pass in 0..164 {
        let sample = PassSample {
            pass,
            first_of_pass: true,
            last_of_pass: true,
            ..BLANK
        };
        record.add(&sample);
    }
    drawn.extend(record.drawn.iter().map(|drawn| drawn.pass));
    assert_eq!(drawn[..3], [0, 3, 6]);
    assert_eq!(drawn.last(), Some(&163));
    assert!(drawn.contains(&record.middle_pass));
}

pub(super) const BLANK: PassSample = PassSample {
    tick: 0,
    pass: 0,
    u: 0.0,
    v: 0.0,
    cc_nm: [0; 3],
    cl_nm: [0; 3],
    feed_mm_s: 0.0,
    interval: f64::INFINITY,
    first_of_pass: false,
    last_of_pass: false,
};

#[test]
fn report_is_well_formed_small_and_says_what_was_found() {
    let (job, sketch, findings) = run(BELL);
    let folder = tempfile::tempdir().unwrap();
    let directory = folder.path().join("a/b");
    let name = Path::new("/somewhere/private/bell <1> & \"2\".toml");
    let remarks = Remarks {
        failures: vec!["gouge <3> at u = 0.5\n  help: a smaller ball".to_owned()],
        warnings: vec!["velocity_max_mm_s not held".to_owned()],
        figures: vec![Figure {
            what: "Gouge".to_owned(),
            value: "0.2 mm".to_owned(),
        }],
        ..Remarks::default()
    };
    let path = sketch.write(&directory, name, &findings, &remarks).unwrap();
    assert_eq!(path, directory.join("index.html"));
    let page = std::fs::read_to_string(path).unwrap();
    let picture = std::fs::read_to_string(directory.join("path.svg")).unwrap();
    for text in [&page, &picture] {
        assert_well_formed(text);
        assert!(text.contains("bell &lt;1&gt; &amp; &quot;2&quot;"));
        let said = text.split("<script").next().unwrap();
        assert!(!text.contains("somewhere") && !said.contains("NaN") && !said.contains("inf "));
    }
    assert!(picture.len() < 400_000, "{} bytes", picture.len());
    // Namespace names and addresses in licences are not requests; the content security policy forbids requests.
    assert!(!picture.replace("http://www.w3.org/2000/svg", "").contains("://"));
    assert!(page.contains("content=\"default-src 'none';"));
    for text in [
        "gouge &lt;3&gt; at u = 0.5",
        "help: a smaller ball",
        "velocity_max_mm_s not held",
        "<td>0.2 mm</td>",
    ] {
        assert!(page.contains(text), "{text}");
    }
    let report = &findings.report;
    for (what, value) in [
        ("Passes", f64::from(findings.passes)),
        ("Samples", findings.samples as f64),
        ("Machining time", findings.samples as f64 * job.machine.period_s()),
        ("CC path", report.cc_length_mm),
        ("CL path", findings.speeds.cl_length_mm),
        ("Least path interval", findings.interval_min),
        ("Feed ripple", report.ripple_pct.max),
        ("Feed ripple, rms", report.ripple_pct.rms()),
        ("CL error", report.position_nm.max),
        ("Scallop height, by formula", report.scallop_mm.max),
    ] {
        assert_eq!(value_of(&page, what), value, "{what}");
    }
}

/// The picture also shows the failures: marks with numbers and words, and the ridges above the limit in their length.
#[test]
fn marks_and_high_ridges_are_in_the_picture() {
    let (_, sketch, findings) = run(BELL);
    let folder = tempfile::tempdir().unwrap();
    let oracle = Oracle::new(&sketch.job).unwrap();
    let [[u0, u1], [v0, v1]] = oracle.surface.domain();
    let at = |share: f64, height_mm: f32| RidgePoint {
        u: u0 + (u1 - u0) * share,
        v: 0.5 * (v0 + v1),
        height_mm,
    };
    // Above the limit of 0.05 mm and the error from 0.25 to 0.5 of the way.
    let ridge = (0..=100).map(|k| {
        at(
            f64::from(k) / 100.0,
            if (25..=50).contains(&k) { 0.06 } else { 0.0505 },
        )
    });
    let mark = |what: &str, share: f64| Mark {
        what: what.to_owned(),
        place_mm: oracle.surface.at(u0 + (u1 - u0) * share, 0.5 * (v0 + v1)).point,
        tick: None,
    };
    let mut marks: Vec<Mark> = (0..9)
        .map(|k| mark(&format!("touch {k} in <jaw>"), 0.1 * f64::from(k)))
        .collect();
    marks.push(Mark {
        place_mm: oracle.surface.at(0.5 * (u0 + u1), 0.5 * (v0 + v1)).point - glam::DVec3::Z * 30.0,
        ..mark("gouge far below", 0.0)
    });
    let picture = |remarks: &Remarks| {
        let page = sketch
            .write(folder.path(), Path::new("bell.toml"), &findings, remarks)
            .unwrap();
        let page = std::fs::read_to_string(page).unwrap();
        let svg = std::fs::read_to_string(folder.path().join("path.svg")).unwrap();
        assert!(page.contains(&svg));
        assert_well_formed(&svg);
        svg
    };
    let bare = picture(&Remarks::default());
    assert!(!bare.contains("class=\"iso-mark") && !bare.contains("iso-line iso-over"));
    let mut scallops = Scallops {
        limit_mm: 0.05,
        measurement_error_mm: 0.001,
        ridges: vec![(0, ridge.collect())],
        anywhere: false,
    };
    let svg = picture(&Remarks {
        marks: marks.clone(),
        scallops: Some(scallops.clone()),
        ..Remarks::default()
    });
    for text in [
        "1 touch 0 in &lt;jaw&gt;",
        "8 touch 7 in &lt;jaw&gt;",
        "and 2 more",
        "above the scallop limit",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    assert_eq!(svg.matches("class=\"iso-mark").count(), 10);
    // The mark behind the surface is drawn as an outline, and lies within the picture.
    let hidden = svg
        .lines()
        .rfind(|line| line.contains("class=\"iso-mark-hidden"))
        .unwrap();
    let centre = |name: &str| {
        let from = hidden.find(name).unwrap() + name.len();
        hidden[from..].split('"').next().unwrap().parse::<f64>().unwrap()
    };
    assert!(
        (0.0..960.0).contains(&centre("cx=\"")) && (0.0..620.0).contains(&centre("cy=\"")),
        "{hidden}"
    );
    assert!(svg.contains("iso-line iso-over"));
    // One point is drawn, none is not.
    scallops.ridges[0].1.truncate(26);
    let only = |scallops: &Scallops| {
        picture(&Remarks {
            scallops: Some(scallops.clone()),
            ..Remarks::default()
        })
        .contains("iso-line iso-over")
    };
    assert!(only(&scallops));
    scallops.ridges[0].1.truncate(25);
    assert!(!only(&scallops));
}

#[test]
fn gaps_are_the_step_over_at_the_widest_place() {
    let (job, sketch, _) = run(BELL);
    let oracle = Oracle::new(&job).unwrap();
    let gaps = measure::gaps(&oracle, &sketch.record.intervals.items());
    // The rim is flat: l = 2 sqrt(h (2 r - h)), which is 1.9975 mm, less a few parts in 10^5 for the error of the location. At the neck the passes are
    // four times closer.
    const LESS: std::ops::Range<f64> = 0.0..1e-4;
    assert!(!gaps.is_empty());
    for gap in gaps {
        assert!(
            LESS.contains(&(1.997_499 - gap.widest_mm))
                && LESS.contains(&(0.25 * 1.997_499 - gap.narrowest_mm)),
            "{gap:?}"
        );
    }
}

/// Of curves the distance to the next pass is not that of two lines of the surface: the page has no chart of it.
#[test]
fn curved_passes_have_words_of_their_own() {
    let (_, sketch, findings) = run(&format!("{BELL}spacing = \"constant\"\n"));
    let folder = tempfile::tempdir().unwrap();
    let path = sketch
        .write(
            folder.path(),
            Path::new("bell.toml"),
            &findings,
            &Remarks::default(),
        )
        .unwrap();
    let page = std::fs::read_to_string(path).unwrap();
    assert_well_formed(&page);
    assert!(page.contains("Each pass is a curve") && !page.contains("passes of constant v crowd"));
    assert!(page.contains("\"gaps\":{\"narrowest\":[],\"pass\":[],\"widest\":[]}"));
}

#[test]
fn a_run_that_ended_at_once_is_reported_all_the_same() {
    let (job, _, findings) = run(BELL);
    let folder = tempfile::tempdir().unwrap();
    let nothing = SurveyResult {
        samples: 0,
        passes: 0,
        report: oracle::AccuracyReport::default(),
        ..findings
    };
    let path = Sketch::new(&job, 0)
        .write(
            folder.path(),
            Path::new("bell.toml"),
            &nothing,
            &Remarks::default(),
        )
        .unwrap();
    let page = std::fs::read_to_string(path).unwrap();
    assert_well_formed(&page);
    assert!(page.contains("ended before its last pass was complete"));
    let mut sketch = Sketch::new(&job, 9);
    let sample = PassSample {
        first_of_pass: true,
        u: 0.5,
        v: -0.9,
        ..BLANK
    };
    sketch.add(&sample, &SampleCheck::default());
    let path = sketch
        .write(folder.path(), Path::new(""), &nothing, &Remarks::default())
        .unwrap();
    assert_well_formed(&std::fs::read_to_string(path).unwrap());
}

#[test]
fn numbers_are_written_short() {
    assert_eq!(
        [0.04, -0.05, 12.0, -3.25, 0.3].map(tenths),
        ["0", "-.1", "12", "-3.3", ".3"]
    );
    assert_eq!(
        polyline(&[[1.0, 2.0], [1.5, 1.96], [0.96, 3.0]]),
        "M1 2l.5 0-.5 1"
    );
    assert_eq!(escape("a<b>&'\"\u{1}"), "a&lt;b&gt;&amp;&#39;&quot;\u{fffd}");
    assert_eq!(
        [0.03, 1.0, 4.99, 7.0, 150.0].map(round_below),
        [0.02, 1.0, 2.0, 5.0, 100.0]
    );
    let shown = [0.0, 3.14e-5, 0.001_234_567, 100.0, 123_456.7, f64::INFINITY].map(number::significant);
    assert_eq!(shown, ["0", "3.1·10⁻⁵", "0.0012346", "100", "123457", "none"]);
    assert_eq!(number::fixed(22_116.549, 1), "22\u{202f}116.5");
}

#[test]
fn simplified_lines_stay_close() {
    let wave: Vec<_> = (0..400)
        .map(f64::from)
        .map(|x| [x, 20.0 * (x / 40.0).sin()])
        .collect();
    let short = simplified(&wave, 0.1);
    assert!(short.len() < 80 && short.first() == wave.first() && short.last() == wave.last());
    for [x, y] in wave {
        let pair = short
            .windows(2)
            .find(|pair| pair[0][0] <= x && x <= pair[1][0])
            .unwrap();
        let share = (x - pair[0][0]) / (pair[1][0] - pair[0][0]);
        assert!((pair[0][1] + share * (pair[1][1] - pair[0][1]) - y).abs() < 0.15);
    }
}
