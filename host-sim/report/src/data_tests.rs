//! Tests of the data in the page: bounded size, peaks preserved.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use super::embed::{Scale, words};
use super::mesh::Mesh;
use super::scallops::{RidgePoint, Scallops};
use super::series::{Channel, Series, Spans};
use super::tests::{BELL, BLANK, run};
use super::track::Track;
use job::Along;
use oracle::{Oracle, PassSample, SampleCheck};

/// Decodes numbers as the page does.
fn decoded(low: &Value, step: &Value, data: &Value) -> Vec<f64> {
    let (low, step) = (low.as_f64().unwrap(), step.as_f64().unwrap());
    let bytes = STANDARD.decode(data.as_str().unwrap()).unwrap();
    let words = bytes.chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
    words
        .map(|word| {
            if word == u16::MAX {
                f64::NAN
            } else {
                low + step * f64::from(word)
            }
        })
        .collect()
}

fn column(value: &Value) -> Vec<f64> {
    decoded(&value["low"], &value["step"], &value["data"])
}

/// Minimum and maximum of each span of a channel.
fn channel(spans: &Value, name: &str) -> [Vec<f64>; 2] {
    let channel = &spans["channels"][name];
    ["least", "largest"].map(|end| decoded(&channel["low"], &channel["step"], &channel[end]))
}

fn extent(values: &[f64]) -> [f64; 2] {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
}

#[test]
fn steps_round_outwards_and_keep_what_is_none() {
    let scale = Scale::of([-3.0, 0.1, 7.0, f64::NAN].into_iter());
    for value in [-3.0, -2.999_99, 0.1, 3.333, 6.999_999, 7.0] {
        let at = |step: u16| scale.low + scale.step * f64::from(step);
        let slack = 1e-5 * scale.step;
        assert!(at(scale.below(value)) <= value + slack && at(scale.above(value)) >= value - slack);
        assert!((at(scale.nearest(value)) - value).abs() <= 0.5 * scale.step + slack);
    }
    assert_eq!(scale.nearest(f64::NAN), u16::MAX);
    assert_eq!(scale.above(7.0), u16::MAX - 1);
    let flat = Scale::of([5.0, 5.0].into_iter());
    assert_eq!((flat.low, flat.nearest(5.0)), (5.0, 0));
    assert_eq!(words([0x0201_u16, 0xff00].into_iter()), "AQIA/w==");
}

#[test]
fn spans_are_bounded_and_lose_no_peak() {
    for count in [1_u64, 7, 8, 9, 1000, 123_457] {
        let mut spans = Spans::new(8);
        for tick in 0..count {
            // One peak each way, at any position relative to the spans.
            let value = match tick {
                tick if tick == count / 3 => 40.0,
                tick if tick == count / 2 => -30.0,
                tick => (tick as f64 * 0.1).sin(),
            };
            spans.put(1000 + tick, Channel::ClSpeed as usize, value);
        }
        let mut series = Series::new(0.001, 0);
        series.replace_whole(spans);
        let whole = series.json()["whole"].clone();
        let [least, largest] = channel(&whole, "cl_speed");
        let drawn = least.len() as u64;
        assert!(drawn <= 8 && drawn * whole["ticks"].as_u64().unwrap() >= count);
        assert_eq!(whole["first_tick"], 1000);
        if count > 6 {
            let span = |tick: u64| (tick / whole["ticks"].as_u64().unwrap()) as usize;
            assert!((largest[span(count / 3)] - 40.0).abs() < 1e-3, "{count}");
            assert!((least[span(count / 2)] + 30.0).abs() < 1e-3, "{count}");
        }
        assert!(channel(&whole, "cc_speed")[0].iter().all(|value| value.is_nan()));
    }
}

/// A run of passes with these numbers of samples; `place` gives the CL, nm, by the tick in the pass.
fn series_of(passes: u32, samples: u32, place: impl Fn(u32) -> [f64; 3]) -> Value {
    let mut series = Series::new(0.001, passes / 2);
    let mut tick = 0;
    for pass in 0..passes {
        for step in 0..samples {
            let sample = PassSample {
                tick,
                pass,
                cl_nm: place(step).map(|nm| nm.round() as i32),
                first_of_pass: step == 0,
                last_of_pass: step + 1 == samples,
                ..BLANK
            };
            let checked = SampleCheck {
                arc_mm: (step > 0).then_some(0.01),
                ..SampleCheck::default()
            };
            series.add(&sample, &checked);
            tick += 1;
        }
    }
    series.finished().json()
}

#[test]
fn acceleration_of_a_circle_is_its_speed_squared_over_its_radius() {
    // 10 mm/s on a radius of 10 mm: 10 mm/s²; from single periods, rounding to nanometres would give 10 ± 2.
    let circle = |step: u32| {
        let angle = f64::from(step) * 0.001;
        [1e7 * angle.cos(), 1e7 * angle.sin(), 0.0]
    };
    let whole = series_of(3, 7000, circle)["whole"].clone();
    let [_, largest] = channel(&whole, "acceleration_x");
    let [least, _] = channel(&whole, "acceleration_y");
    let [x, y] = [extent(&largest)[1], extent(&least)[0]];
    assert!((x - 10.0).abs() < 0.1 && (y + 10.0).abs() < 0.1, "{x} {y}");
    let [_, speed] = channel(&whole, "cl_speed");
    assert!((extent(&speed)[1] - 10.0).abs() < 2e-3);
    // The return to the first point and the last step are not included.
    assert!(extent(&channel(&whole, "velocity_x")[0])[0] > -10.01);
}

#[test]
fn a_jolt_of_one_period_is_shown_as_emitted() {
    // Straight at 10 mm/s, except for one position that is off by 500 nm, anywhere in a pass.
    for at in [1, 2, 9, 40, 70, 77] {
        let place = |step: u32| [f64::from(step) * 1e4, if step == at { 500.0 } else { 0.0 }, 0.0];
        let whole = series_of(1, 80, place)["whole"].clone();
        let [least, _] = channel(&whole, "acceleration_y");
        // 1000 nm per (1 ms)² are 1000 mm/s².
        assert!(
            (extent(&least)[0] + 1000.0).abs() < 1.0,
            "{at}: {:?}",
            extent(&least)
        );
    }
}

#[test]
fn passes_are_drawn_within_bounds_and_with_their_worst() {
    for (passes, samples) in [(1_u32, 30_000_u32), (319, 6934), (3, 1), (4000, 60), (7, 8193)] {
        let mut track = Track::new(10.0, 0.001, passes as usize);
        let (bad_pass, bad_step) = (passes / 2 / track.every * track.every, samples * 2 / 3);
        for pass in 0..passes {
            for step in 0..samples {
                let sample = PassSample {
                    tick: u64::from(pass * samples + step),
                    pass,
                    cc_nm: [step as i32, 0, 0],
                    cl_nm: [step as i32, 0, 9],
                    first_of_pass: step == 0,
                    last_of_pass: step + 1 == samples,
                    ..BLANK
                };
                let is_bad = pass == bad_pass && step == bad_step;
                let checked = SampleCheck {
                    arc_mm: (step > 0).then_some(0.01),
                    ripple_pct: Some(if is_bad { -2.0 } else { 1e-3 }),
                    position_nm: Some(if is_bad { 8.0 } else { 1.0 }),
                };
                track.add(&sample, &checked);
            }
        }
        assert!(
            track.points() <= 61_000 + 2 * passes as usize,
            "{}",
            track.points()
        );
        let value = track.json(|nm| nm.map(|x| x as u16));
        let [errors, feeds] = ["cl_error", "feed_error"].map(|name| column(&value["values"][name]));
        assert!((extent(&errors)[1] - 8.0).abs() < 1e-3 && (extent(&feeds)[1] - 2.0).abs() < 1e-3);
        assert_eq!(errors.len(), track.points());
        for pass in value["passes"].as_array().unwrap() {
            let [first, last, stride, count] = [1, 2, 3, 4].map(|k| pass[k].as_u64().unwrap());
            // Both ends of the pass are points.
            assert_eq!(last - first, u64::from(samples - 1));
            assert_eq!(count, (last - first).div_ceil(stride) + 1);
        }
        let drawn = value["passes"].as_array().unwrap();
        assert_eq!(drawn.last().unwrap()[0], passes - 1);
    }
}

#[test]
fn speeds_are_those_of_the_paper() {
    let (_, sketch, findings) = run(BELL);
    let whole = sketch.series.finished().json()["whole"].clone();
    let [slow, _] = channel(&whole, "cc_speed");
    let [_, fast] = channel(&whole, "cc_speed");
    assert!(
        extent(&slow)[0] > 99.99 && extent(&fast)[1] < 100.01,
        "feed held at the contact"
    );
    let [slow, fast] = channel(&whole, "cl_speed");
    let [slowest, fastest] = [extent(&slow)[0], extent(&fast)[1]];
    // Lo's Example 1, at ten times his feed: 6.802 to 13.198 mm/s.
    assert!(
        (slowest - 68.02).abs() < 0.05 && (fastest - 131.98).abs() < 0.05,
        "{slowest} {fastest}"
    );
    let [_, errors] = channel(&whole, "cl_error");
    assert!((extent(&errors)[1] - findings.report.position_nm.max).abs() < 1e-3);
}

#[test]
fn scallops_lie_over_the_surface_where_they_were_measured() {
    let job = job_file::parse("bell.toml", BELL).unwrap();
    let oracle = Oracle::new(&job).unwrap();
    let mesh = Mesh::new(&oracle);
    let domain = oracle.surface.domain();
    let [[u0, u1], [v0, v1]] = domain;
    let height = |u: f64, v: f64| 0.01 + 0.02 * (u - u0) / (u1 - u0) + 0.01 * (v - v0) / (v1 - v0);
    // Passes along u; the ridges end in the middle of the surface, as in a run that faulted there.
    let ridge = |gap: u32| {
        let v = v0 + (v1 - v0) * (f64::from(gap) + 0.5) / 20.0;
        let place = |k: u32| {
            let u = u0 + (u1 - u0) * f64::from(k) / 50.0;
            RidgePoint {
                u,
                v,
                height_mm: height(u, v) as f32,
            }
        };
        (gap, (0..=50).map(place).collect::<Vec<_>>())
    };
    let scallops = Scallops {
        limit_mm: 0.05,
        measurement_error_mm: 1e-4,
        ridges: (0..10).map(ridge).collect(),
        anywhere: false,
    };
    let value = scallops.json(&mesh, domain, Along::U);
    let heights = column(&value["mesh"]);
    let [rows, columns] = mesh.cells();
    assert_eq!(heights.len(), (rows + 1) * (columns + 1));
    for (index, shown) in heights.iter().enumerate() {
        let (i, j) = (index / (columns + 1), index % (columns + 1));
        let [s, t] = [i as f64 / rows as f64, j as f64 / columns as f64];
        if t > 0.6 {
            assert!(shown.is_nan(), "{s} {t}: {shown}");
        } else if t < 0.49 {
            // The nearest ridge is at most half a gap away, the nearest point on it less.
            let wanted = height(u0 + s * (u1 - u0), v0 + t * (v1 - v0));
            assert!(
                (shown - wanted).abs() < 0.02 / 50.0 + 0.01 / 20.0 + 2e-4,
                "{s} {t}: {shown} {wanted}"
            );
        }
    }
    let largest = column(&value["largest"]);
    assert_eq!(largest.len(), 10);
    // A height in a region that the ball cannot reach must not scale the others.
    let mut missed = scallops.clone();
    missed.ridges[3].1[20].height_mm = 40.0;
    let value = missed.json(&mesh, domain, Along::U);
    let shown = column(&value["mesh"]);
    assert!((extent(&shown)[1] - 4.0 * 0.05).abs() < 1e-5 && value["highest"] == 40.0);
    let near = |(a, b): (&f64, &f64)| a.is_nan() || *b > 0.19 || (a - b).abs() < 1e-5;
    assert!(heights.iter().zip(&shown).all(near));
    assert!((largest[9] - (0.03 + 0.01 * 9.5 / 20.0)).abs() < 1e-5);
    assert!((f64::from(scallops.largest_mm()) - largest[9]).abs() < 1e-5);
}
