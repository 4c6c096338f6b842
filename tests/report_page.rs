//! The report's page in a headless Chromium: drawing, text, mouse actions, and no external requests.

mod browser;

use std::path::{Path, PathBuf};

use browser::Browser;
use glam::DVec3;
use machine::Machine;
use machine::prepare::prepare;
use oracle::{Oracle, PassSample, SampleCheck};
use report::{Mark, Remarks, RidgePoint, Scallops, Sketch};
use verify::motion::Binding;
use verify::survey::{Survey, SurveyResult};

/// WebGL in software, for the same picture on every machine.
const SOFTWARE: [&str; 2] = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const DESK: [u32; 2] = [1280, 900];
const PHONE: [u32; 2] = [390, 800];

/// Runs a job and writes its report. Returns the page, and the oracle's survey of the run.
fn report(name: &str, folder: &Path, remarks: &Remarks) -> (PathBuf, SurveyResult) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs").join(name);
    let job = job_file::load(&path).unwrap();
    let prepared = prepare(&job).unwrap();
    let oracle = Oracle::new(&job).unwrap();
    let mut sketch = Sketch::new(&job, oracle.schedule().unwrap().len());
    let mut draw = |sample: &PassSample, checked: &SampleCheck| sketch.add(sample, checked);
    let mut survey = Survey::new(&oracle, None);
    Machine::load(&prepared)
        .unwrap()
        .run(|sample| survey.add(&inspect::plain(&prepared, sample), &mut draw).is_ok())
        .unwrap();
    let findings = survey.finish(true, &mut draw).unwrap();
    let page = sketch.write(folder, Path::new(name), &findings, remarks).unwrap();
    (page.canonicalize().unwrap(), findings)
}

/// Scallop heights that rise along u, from 0 to a value above the limit at u = 1.
fn rising(domain: [[f64; 2]; 2], ridges: u32) -> Scallops {
    let [[u0, u1], [v0, v1]] = domain;
    let ridge = |gap: u32| {
        let v = v0 + (v1 - v0) * (f64::from(gap) + 0.5) / f64::from(ridges);
        let place = |k: u32| {
            let share = f64::from(k) / 60.0;
            RidgePoint {
                u: u0 + (u1 - u0) * share,
                v,
                height_mm: (0.012 * share) as f32,
            }
        };
        (gap, (0..=60).map(place).collect())
    };
    Scallops {
        limit_mm: 0.01,
        measurement_error_mm: 1e-4,
        ridges: (0..ridges).map(ridge).collect(),
        anywhere: false,
    }
}

/// Draws the view and counts the different colours, the painted fraction of the canvas, and the pixels near a colour.
fn pixels(browser: &mut Browser, near: [u8; 3]) -> [f64; 3] {
    let [r, g, b] = near;
    let value = browser.value(&format!(
        "(() => {{ const {{ view }} = isofeedReport; view.draw(); const c = document.createElement('canvas'); \
         [c.width, c.height] = [view.canvas.width, view.canvas.height]; const x = c.getContext('2d'); \
         x.drawImage(view.canvas, 0, 0); const d = x.getImageData(0, 0, c.width, c.height).data; \
         const colours = new Set(); let [painted, near] = [0, 0]; \
         for (let k = 0; k < d.length; k += 4) {{ if (d[k + 3] < 255) continue; painted++; \
         colours.add((d[k] << 16) | (d[k + 1] << 8) | d[k + 2]); \
         if (Math.hypot(d[k] - {r}, d[k + 1] - {g}, d[k + 2] - {b}) < 40) near++; }} \
         return [colours.size, painted / (d.length / 4), near]; }})()"
    ));
    [0, 1, 2].map(|k| value[k].as_f64().unwrap())
}

fn choose(browser: &mut Browser, select: &str, option: &str) {
    browser.value(&format!(
        "(() => {{ const s = document.getElementById('{select}'); s.value = '{option}'; \
         s.dispatchEvent(new Event('change')); return s.value; }})()"
    ));
}

fn assert_quiet(browser: &mut Browser, page: &Path) {
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
    let own = format!("file://{}", page.display());
    let others: Vec<_> = browser.requests.iter().filter(|url| **url != own).collect();
    assert!(others.is_empty(), "requested: {others:?}");
}

/// Number of different colours in each chart's canvas.
fn chart_colours(browser: &mut Browser) -> Vec<f64> {
    let value = browser.value(
        "[...document.querySelectorAll('.chart.live canvas')].map((c) => { const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
         const s = new Set(); for (let k = 0; k < d.length; k += 4) if (d[k + 3]) s.add((d[k] << 16) | (d[k + 1] << 8) | d[k + 2]); return s.size; })",
    );
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|size| size.as_f64().unwrap())
        .collect()
}

#[test]
fn view_and_charts_are_drawn_in_every_colouring() {
    let folder = tempfile::tempdir().unwrap();
    let remarks = Remarks {
        failures: vec!["gouge of 0.2 mm at u = 0.5".to_owned()],
        warnings: vec!["the velocity is <not> held".to_owned()],
        scallops: Some(rising([[0.0, 1.0]; 2], 40)),
        ..Remarks::default()
    };
    let (page, _) = report("freeform.toml", folder.path(), &remarks);
    let mut browser = Browser::start(DESK, "light", &SOFTWARE);
    browser.open(&page);
    let said = browser.text("document.querySelector('main').innerText");
    for text in [
        "gouge of 0.2 mm at u = 0.5",
        "the velocity is <not> held",
        "135 passes",
        "387\u{202f}908",
        "one stands for 8 samples",
        "6.5 min",
    ] {
        assert!(said.contains(text), "{text} in {said}");
    }
    // The scallop height is shown first: from dark violet to yellow, and red above the limit.
    assert_eq!(browser.text("document.getElementById('colour').value"), "scallop");
    assert!(
        browser
            .text("document.getElementById('legend').innerText")
            .contains("Scallop height, mm")
    );
    let [colours, painted, over] = pixels(&mut browser, [230, 0, 90]);
    assert!(
        colours > 500.0 && painted > 0.15,
        "{colours} colours on {painted}"
    );
    assert!(over > 300.0, "{over} pixels above the limit");
    // A constant feed has the colour of the middle of the scale, and lines are not shaded.
    for (option, unit, near, least) in [
        ("feed", "mm/s", [35, 144, 139], 20_000.0),
        ("centre", "mm/s", [35, 144, 139], 500.0),
        ("error", "nm", [35, 144, 139], 500.0),
        ("feed-error", "%", [35, 144, 139], 500.0),
    ] {
        choose(&mut browser, "colour", option);
        let legend = browser.text("document.getElementById('legend').innerText");
        assert!(legend.contains(&format!(", {unit}")), "{option}: {legend}");
        let [colours, painted, found] = pixels(&mut browser, near);
        assert!(
            colours > 50.0 && painted > 0.15 && found > least,
            "{option}: {colours} colours, {painted} painted, {found} near"
        );
    }
    let charts = chart_colours(&mut browser);
    assert_eq!(charts.len(), 8, "five over time, three from pass to pass");
    assert!(charts.iter().all(|colours| *colours > 20.0), "{charts:?}");
    assert_quiet(&mut browser, &page);
}

#[test]
fn mouse_keys_and_buttons_do_what_they_say() {
    let folder = tempfile::tempdir().unwrap();
    let (page, _) = report("torus.toml", folder.path(), &Remarks::default());
    let mut browser = Browser::start(DESK, "dark", &SOFTWARE);
    browser.open(&page);
    let options = browser.text("[...document.getElementById('colour').options].map((o) => o.value).join()");
    assert_eq!(
        options, "plain,feed,centre,error,feed-error",
        "no scallops, no such colouring"
    );
    let limits = browser.number("document.getElementById('by-limit').hidden ? 1 : 0");
    assert_eq!(limits, 1.0, "no limits, no such chart");
    let place =
        "JSON.stringify(isofeedReport.view.camera.position.toArray().map((x) => Math.round(x * 100)))";
    let home = browser.text(place);
    browser.drag("#view", [0.3, 0.8], [0.6, 0.7]);
    let turned = browser.text(place);
    assert_ne!(home, turned, "dragging turns");
    browser.wheel("#view", -300.0);
    assert!(
        browser.number("isofeedReport.view.camera.zoom") > 1.1,
        "the wheel zooms"
    );
    browser.value("document.getElementById('view').focus()");
    browser.key("ArrowLeft");
    assert_ne!(browser.text(place), turned, "arrows turn");
    browser.key("Home");
    assert_eq!(browser.text(place), home, "Home resets");
    assert_eq!(browser.number("isofeedReport.view.camera.zoom"), 1.0);
    // Top view: x to the right, y up.
    browser.value("document.querySelector('[data-view=top]').click()");
    let axes =
        "isofeedReport.view.axes().map((a) => a.map((x) => Math.round(x * 100) / 100 + 0).join(' ')).join()";
    assert_eq!(browser.text(axes), "1 0 0,0 1 0,0 0 1");
    // Time: the ball is at the position of the core's sample at 100 s.
    browser.value("(() => { const t = document.getElementById('time'); t.value = 100000; t.dispatchEvent(new Event('input')); })()");
    let read = browser.text("document.getElementById('readout').innerText");
    assert!(
        read.contains("100.000 s") && read.contains("10.000 mm/s"),
        "{read}"
    );
    let radius = browser.number(
        "(() => { const { cc, cl } = isofeedReport.panel.at; return Math.hypot(cc[0] - cl[0], cc[1] - cl[1], cc[2] - cl[2]); })()",
    );
    assert!(
        (radius - 5.0).abs() < 0.01,
        "contact and centre are {radius} mm apart"
    );
    // Charts: a dragged range becomes the window; in a pass stored in detail, zooming in shows every sample.
    let window = "isofeedReport.charts[0].window[1] - isofeedReport.charts[0].window[0]";
    let whole = browser.number(window);
    browser.drag("#charts .u-over", [0.25, 0.5], [0.5, 0.5]);
    let part = browser.number(window) / whole;
    assert!((part - 0.25).abs() < 0.01, "a quarter is {part}");
    browser.point("#charts .u-over", [0.5, 0.5]);
    let read = browser.text("document.querySelector('#charts .values').innerText");
    assert!(
        read.contains("at ") && read.contains("cutter contact (CC) "),
        "{read}"
    );
    browser.value("document.querySelector('#windows button:last-child').click()");
    for _ in 0..4 {
        browser.value("document.querySelector('[data-window=in]').click()");
    }
    assert!(
        browser
            .text("document.getElementById('window').innerText")
            .contains("every sample is drawn")
    );
    assert!(chart_colours(&mut browser).iter().all(|colours| *colours > 20.0));
    browser.value("document.querySelector('[data-window=whole]').click()");
    assert_eq!(browser.number(window), whole);
    assert!(
        browser
            .text("document.getElementById('window').innerText")
            .contains("least and the largest")
    );
    assert_quiet(&mut browser, &page);
}

/// The speed of a pass against the limit that binds: the reading at the cursor is that of the verifier, whichever pass is chosen.
#[test]
fn speeds_are_drawn_against_the_limit_that_binds() {
    let folder = tempfile::tempdir().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/plate_machine.toml");
    let mut job = job_file::load(&path).unwrap();
    (job.scallop_mm, job.feed_mm_min) = (1.0, 6000.0);
    let prepared = prepare(&job).unwrap();
    let timed = inspect::time_run(&job, &prepared, &()).unwrap();
    let mut sketch = Sketch::new(&job, timed.passes.len());
    let mut feeds = std::collections::BTreeMap::new();
    let mut draw = |sample: &PassSample, checked: &SampleCheck| {
        feeds.insert(sample.tick, sample.feed_mm_s);
        sketch.add(sample, checked);
    };
    let requirements = inspect::Requirements {
        with_optimum: true,
        ..inspect::Requirements::default()
    };
    let found = inspect::verify_run(&job, &prepared, &timed, Some(&mut draw), &requirements, &()).unwrap();
    let measured = &found.measured;
    let passes = measured.optimum.passes.clone();
    let remarks = Remarks {
        passes: passes.clone(),
        ..Remarks::default()
    };
    let page = sketch
        .write(folder.path(), &path, &measured.findings, &remarks)
        .unwrap()
        .canonicalize()
        .unwrap();
    let mut browser = Browser::start(DESK, "light", &SOFTWARE);
    browser.open(&page);
    assert_eq!(
        browser.number("document.getElementById('by-limit').hidden ? 1 : 0"),
        0.0
    );
    let options = browser.number("document.getElementById('binding-pass').options.length");
    assert_eq!(options, passes.len() as f64);
    let chart = "isofeedReport.charts.at(-1)";
    let mut seen = std::collections::BTreeSet::new();
    for (index, time) in passes.iter().enumerate() {
        choose(&mut browser, "binding-pass", &index.to_string());
        let head = browser.text("document.querySelector('#binding-chart .values').innerText");
        assert!(head.contains(&format!("pass {}: ", time.pass)), "{head}");
        let count = browser.number(&format!("{chart}.pass.arc.length")) as usize;
        assert_eq!(count, time.profile.len(), "a point for each period");
        for k in (0..count).step_by(count / 40) {
            let at = |row: &str| format!("{chart}.pass.{row}[{k}]");
            let [arc, least, largest, tick] =
                ["arc", "least", "largest", "ticks"].map(|row| browser.number(&at(row)));
            // The speed as emitted is the commanded one, within what it changes by in two periods.
            let feed = feeds[&(tick as u64)];
            assert!(
                least < feed + 2.5 && largest > feed - 2.5,
                "pass {}, {arc} mm: {least} to {largest}, commanded {feed}",
                time.pass
            );
            let point = time.profile[k];
            let words = browser.text(&format!("{chart}.words({k})"));
            let name = match point.binding {
                Binding::Feed => "the programmed feed".to_owned(),
                Binding::Velocity(axis) => format!("velocity of {}", ["x", "y", "z"][axis]),
                Binding::Acceleration(axis) => format!("acceleration of {}", ["x", "y", "z"][axis]),
                Binding::Jerk(axis) => format!("jerk of {}", ["x", "y", "z"][axis]),
            };
            assert!(
                words.contains(&name),
                "pass {}, {arc} mm: {words}, not {name}",
                time.pass
            );
            let limit = browser.number(&at("limit"));
            assert!((limit - point.speed_mm_s).abs() < 0.1, "{limit} for {point:?}");
            seen.insert(name);
        }
    }
    assert!(seen.len() >= 4, "{seen:?}");
    // The fastest motion is coloured by what binds: the feed's blue, the orange of x.
    let painted = "(() => { const c = document.querySelector('#binding-chart canvas'); const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
         const near = (rgb) => { let n = 0; for (let k = 0; k < d.length; k += 4) if (d[k + 3] > 200 && Math.hypot(...rgb.map((v, i) => v - d[k + i])) < 30) n++; return n; }; \
         return [near([10, 79, 148]), near([194, 65, 12])]; })()";
    let painted = browser.value(painted);
    assert!((0..2).all(|k| painted[k].as_f64().unwrap() > 100.0), "{painted}");
    // Pointing reads, clicking brings the tool there.
    browser.point("#binding-chart .u-over", [0.5, 0.5]);
    let read = browser.text("document.querySelector('#binding-chart .values').innerText");
    assert!(
        read.contains(" binds: ") && read.contains("emitted ") && read.contains(" mm"),
        "{read}"
    );
    browser.drag("#binding-chart .u-over", [0.5, 0.5], [0.5, 0.5]);
    let [tick, pass] =
        ["tick", "at.pass.pass"].map(|what| browser.number(&format!("isofeedReport.panel.{what}")));
    let last = passes.last().unwrap();
    let ticks = [last.emitted.first().unwrap(), last.emitted.last().unwrap()].map(|at| at.tick as f64);
    assert_eq!(pass, last.pass as f64);
    assert!(tick > ticks[0] && tick < ticks[1], "{tick} of {ticks:?}");
    assert_quiet(&mut browser, &page);
}

#[test]
fn a_run_of_two_million_samples_opens_on_a_phone() {
    let folder = tempfile::tempdir().unwrap();
    let (page, findings) = report("revolved.toml", folder.path(), &Remarks::default());
    let bytes = std::fs::metadata(&page).unwrap().len();
    assert!(bytes < 6_000_000, "{bytes} bytes");
    let mut browser = Browser::start(PHONE, "dark", &SOFTWARE);
    browser.open(&page);
    let said = browser.text("document.querySelector('main').innerText");
    for text in [
        "all 319 passes",
        "2\u{202f}212\u{202f}265 samples",
        "spans of 128 samples",
    ] {
        assert!(said.contains(text), "{text} in {said}");
    }
    assert_eq!(
        browser.number("document.documentElement.scrollWidth"),
        390.0,
        "nothing sticks out"
    );
    // The drawn points together stand for every sample.
    let behind = browser
        .number("isofeedReport.view.track.passes.reduce((sum, pass) => sum + pass.last - pass.first + 1, 0)");
    assert_eq!(behind, 2_212_265.0);
    // The worst sample of the run appears in the charts and in the view.
    let worst = findings.report.position_nm.max;
    for values in [
        "charts[0].series.whole.channel('cl_error')[1]",
        "view.track.values.cl_error",
    ] {
        let shown = browser.number(&format!(
            "isofeedReport.{values}.reduce((a, b) => b > a ? b : a, 0)"
        ));
        assert!(
            (shown - worst).abs() < 1e-3,
            "{values}: {shown}, the oracle {worst}"
        );
    }
    let [colours, painted, _] = pixels(&mut browser, [0, 0, 0]);
    assert!(colours > 100.0 && painted > 0.1, "{colours} colours on {painted}");
    assert_quiet(&mut browser, &page);
}

#[test]
fn without_webgl_the_picture_stands_in() {
    let folder = tempfile::tempdir().unwrap();
    let (page, _) = report("torus.toml", folder.path(), &Remarks::default());
    let mut browser = Browser::start(DESK, "light", &["--disable-3d-apis"]);
    browser.open(&page);
    let shown = "['stage', 'picture', 'no-view'].map((id) => document.getElementById(id).getBoundingClientRect().height > 10).join()";
    assert_eq!(browser.text(shown), "false,true,true");
    assert!(chart_colours(&mut browser).iter().all(|colours| *colours > 20.0));
    assert_quiet(&mut browser, &page);
}

/// Marks, links, home, safe height, travel, stock and fixtures are drawn, each with its switch; a mark's button brings the tool there.
#[test]
fn marks_links_and_the_machine_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs/plate_machine.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let text = text.replace("scallop_mm = 0.05", "scallop_mm = 1").replace(
        "radius_mm = 4\n",
        "radius_mm = 4\nshank_mm = 6\nlength_mm = 20\nholder = { diameter_mm = 20, length_mm = 15 }\n",
    ) + "\n[stock]\nbox_mm = [[-10, 90], [-10, 70], [-10, 12]]\n[[fixture]]\nname = \"<jaw>\"\nbox_mm = [[90, 99], [0, 40], [-10, 25]]\n";
    let job_path = folder.path().join("set.toml");
    std::fs::write(&job_path, text).unwrap();
    let mark = |what: &str, x: f64, tick: Option<u64>| Mark {
        what: what.to_owned(),
        place_mm: DVec3::new(x, 30.0, 14.0),
        tick,
    };
    let remarks = Remarks {
        failures: vec!["reach: the holder is 2 mm deep".to_owned()],
        marks: vec![
            mark("holder 2 mm in <jaw>", 60.0, Some(9000)),
            mark("gouge", 20.0, None),
        ],
        links_mm: vec![vec![
            DVec3::new(40.0, 30.0, 40.0),
            DVec3::new(40.0, 30.0, 20.0),
            DVec3::new(0.0, 0.0, 20.0),
        ]],
        scallops: Some(rising([[0.0, 1.0]; 2], 40)),
        ..Remarks::default()
    };
    let (page, _) = report(job_path.to_str().unwrap(), folder.path(), &remarks);
    let mut browser = Browser::start(DESK, "light", &SOFTWARE);
    browser.open(&page);
    let click = |browser: &mut Browser, id: &str| {
        browser.value(&format!("document.getElementById('{id}').click()"));
    };
    let bad = [192, 16, 72];
    let marks = browser.text("document.getElementById('marks').innerText");
    assert!(
        marks.contains("1 holder 2 mm in <jaw>") && marks.contains("2 gouge"),
        "{marks}"
    );
    for tag in ["home", "safe height"] {
        assert!(
            browser
                .text("document.querySelector('.canvas').innerText")
                .contains(tag)
        );
    }
    browser.value("document.querySelector('#marks button').click()");
    let tick = browser.value("isofeedReport.panel.tick");
    assert_eq!(tick.as_f64(), Some(9000.0));
    // With the marks switched off, fewer pixels are red.
    let with = pixels(&mut browser, bad)[2];
    click(&mut browser, "show-marks");
    let without = pixels(&mut browser, bad)[2];
    assert!(with > without + 60.0, "{with} and {without} red pixels");
    let mut before = pixels(&mut browser, [0, 0, 0]);
    // The tool is transparent: where it was there are fewer colours, not fewer pixels.
    for (id, figure) in [
        ("show-setup", 1),
        ("show-machine", 1),
        ("show-links", 1),
        ("show-ball", 0),
    ] {
        click(&mut browser, id);
        let after = pixels(&mut browser, [0, 0, 0]);
        assert!(after[figure] < before[figure], "{id}: {before:?} and {after:?}");
        before = after;
    }
    // Everything is in the view of everything: home is within the canvas, above the part.
    for id in ["show-setup", "show-machine", "show-links", "show-marks"] {
        click(&mut browser, id);
    }
    browser.value("document.querySelector('[data-view=all]').click()");
    let corners = browser.value(
        "(() => { const { view } = isofeedReport; view.draw(); const places = view.setting.everything(); \
         const out = []; for (let k = 0; k < places.length; k += 3) out.push(...view.pixel(places.slice(k, k + 3))); \
         return [Math.min(...out), Math.max(...out), view.width]; })()",
    );
    let [least, most, width] = [0, 1, 2].map(|k| corners[k].as_f64().unwrap());
    assert!(least > 0.0 && most < width, "{least} to {most} of {width}");
    assert_quiet(&mut browser, &page);
}
