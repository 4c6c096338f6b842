//! The core against the golden table, which was computed independently with 40 digits: points, normals, intervals, schedules.

use integration_tests::golden::{Case, cases};
use interp_core::SpanParameter;
use job::{Along, Job};
use machine::Machine;
use machine::prepare::{ParameterSpans, Prepared, prepare};

/// The job file of a golden case, with the path parameter, tool side, ball radius and scallop height limit of the case.
fn job(case: &Case) -> Job {
    let name = match case.surface.as_str() {
        "revolved" => "revolved",
        "ruled_as_printed" => "ruled_printed",
        "ruled_reconstructed" => "ruled_reconstructed",
        "plate" => "plate",
        other => panic!("no job for {other}"),
    };
    let path = format!("{}/../jobs/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let mut job = job_file::load(path.as_ref()).unwrap();
    job.along = if case.along == "u" { Along::U } else { Along::V };
    job.radius_mm = case.radius_mm;
    job.scallop_mm = case.scallop_mm;
    // The table's schedules use the paper's first-order interval.
    job.spacing = job::Spacing::FirstOrder;
    job.side = if case.tool_side > 0.0 {
        job::Side::Plus
    } else {
        job::Side::Minus
    };
    job
}

/// A parameter as span and fraction, to 2^-53 of the span.
fn place(axis: &ParameterSpans, parameter: f64) -> SpanParameter {
    let span = axis.breaks[1..axis.breaks.len() - 1].partition_point(|end| *end <= parameter);
    let (start, end) = (axis.breaks[span], axis.breaks[span + 1]);
    let fraction = (parameter - start) / (end - start);
    let fraction = if fraction >= 1.0 {
        u64::MAX
    } else {
        (fraction * 2_f64.powi(64)) as u64
    };
    SpanParameter {
        span: u16::try_from(span).unwrap(),
        fraction,
    }
}

fn places(prepared: &Prepared, u: f64, v: f64) -> (SpanParameter, SpanParameter) {
    match prepared.along {
        Along::U => (place(&prepared.path, u), place(&prepared.side, v)),
        Along::V => (place(&prepared.path, v), place(&prepared.side, u)),
    }
}

#[test]
fn every_golden_point() {
    let (mut worst_nm, mut worst_rad, mut worst_interval) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut points = 0;
    for case in cases() {
        let prepared = prepare(&job(&case)).unwrap();
        let machine = Machine::load(&prepared).unwrap();
        for point in &case.points {
            let (path, side) = places(&prepared, point.u, point.v);
            let probe = machine.evaluate(path, side).unwrap();
            let distance = |nm: [i32; 3], mm: [f64; 3]| {
                nm.iter()
                    .zip(mm)
                    .map(|(nm, mm)| (f64::from(*nm) - mm * 1e6).powi(2))
                    .sum::<f64>()
                    .sqrt()
            };
            worst_nm = worst_nm
                .max(distance(probe.cl_nm, point.cl))
                .max(distance(probe.cc_nm, point.cc));
            let normal = probe
                .normal
                .iter()
                .zip(point.normal)
                .map(|(a, b)| (f64::from(*a) - b).powi(2));
            worst_rad = worst_rad.max(normal.sum::<f64>().sqrt());
            worst_interval = worst_interval.max((f64::from(probe.interval) / point.interval - 1.0).abs());
            points += 1;
        }
    }
    println!(
        "{points} points: CC and CL {worst_nm:.2} nm, normal {worst_rad:.2e} rad, interval {worst_interval:.2e}"
    );
    assert_eq!(points, 240);
    assert!(worst_nm <= 10.0, "CL or CC off by {worst_nm} nm");
    assert!(worst_rad <= 1e-6, "normal off by {worst_rad} rad");
    assert!(worst_interval <= 1e-5, "interval off by {worst_interval}");
}

/// Number of passes, and for each pass side parameter and least interval; the length by the number of samples. A side parameter is
/// the sum of the intervals before it, so its error is relative to the whole range.
#[test]
fn every_golden_schedule() {
    for case in cases() {
        let job = job(&case);
        let prepared = prepare(&job).unwrap();
        let mut machine = Machine::load(&prepared).unwrap();
        let mut passes: Vec<[f64; 2]> = Vec::new();
        let mut samples = 0_u32;
        machine
            .run(|sample| {
                if passes.len() <= sample.pass as usize {
                    passes.push([prepared.side.parameter(sample.side), f64::INFINITY]);
                }
                let last = passes.last_mut().unwrap();
                last[1] = last[1].min(sample.interval().into());
                samples += 1;
                true
            })
            .unwrap();
        let name = format!("{} along {}", case.surface, case.along);
        assert_eq!(passes.len(), case.pass_count, "{name}");
        let [[u0, u1], [v0, v1]] = case.range;
        let range = if case.along == "u" { v1 - v0 } else { u1 - u0 };
        for (index, (ours, golden)) in passes.iter().zip(&case.passes).enumerate() {
            assert!(
                (ours[0] - golden[0]).abs() <= 1e-6 * range,
                "{name}, pass {index}: side {} for {}",
                ours[0],
                golden[0]
            );
            assert!(
                (ours[1] / golden[1] - 1.0).abs() <= 1e-5,
                "{name}, pass {index}: interval {} for {}",
                ours[1],
                golden[1]
            );
        }
        // One sample per period, and for each pass one or two samples more than its whole periods.
        let periods = case.cc_length_mm / (job.feed_mm_s() * job.machine.period_s());
        let extra = f64::from(samples) - periods;
        let passes = passes.len() as f64;
        assert!(
            extra >= passes && extra <= 2.0 * passes + 1e-6 * periods,
            "{name}: {samples} samples for {periods} periods"
        );
    }
}
