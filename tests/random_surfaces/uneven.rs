//! Uneven parametrisations: a parametric speed that changes by much within a period.

use interp_core::FaultKind;
use job::{Along, Pattern, SurfaceSpec};

use super::{job, justified, run};

/// If the parametric speed changes by a large fraction within a period, the run faults or keeps the feed.
#[test]
fn uneven_parametrisations_keep_the_feed_or_fault() {
    // x = a u + b u^2/2 + c u^3/3, and the arc of one period.
    for (a, b, c, arc) in [
        (0.019_147, 0.221_538_9, 3.513_668_9, 0.020_080_0),
        (0.011_214_9, -0.114_487_4, 1.899_846_6, 0.012_100_8),
    ] {
        let mut coefficients_mm = [[[0.0; 4]; 4]; 3];
        (
            coefficients_mm[0][2][3],
            coefficients_mm[0][1][3],
            coefficients_mm[0][0][3],
        ) = (a, b / 2.0, c / 3.0);
        coefficients_mm[1][3][2] = 1.0;
        let surface = SurfaceSpec::Bicubic {
            coefficients_mm,
            u: [0.0, 1.0],
            v: [0.0, 1.0],
        };
        let mut job = job(surface, Along::U, Pattern::Zig);
        (job.radius_mm, job.scallop_mm, job.feed_mm_min) = (0.5, 0.01, arc * 60_000.0);
        let ran = run(&job, u64::MAX);
        assert!(
            ran.fault
                .is_some_and(|fault| fault.kind == FaultKind::ParameterBackwards)
                || ran.ripple_pct <= 0.001,
            "{}",
            ran.ripple_pct
        );
    }
}

/// A sharp ridge on which the path nearly reverses: |S_u| falls to a few per cent and S_u turns by 180 degrees within some steps, always at
/// right angles to S_v. The surface is regular there, and any ball fits on the convex side.
#[test]
fn ridge_on_which_the_path_all_but_stands() {
    let ridge = |breadth: f64| {
        let mut c = [[[0.0; 4]; 4]; 3];
        (c[0][1][3], c[0][2][3], c[1][3][2], c[2][2][3]) = (20.0, -20.0, 20.0, breadth);
        let surface = SurfaceSpec::Bicubic {
            coefficients_mm: c,
            u: [0.0, 1.0],
            v: [0.0, 1.0],
        };
        job(surface, Along::U, Pattern::Zig)
    };
    for breadth in [0.1, 0.2, 0.3, 0.5] {
        let job = ridge(breadth);
        let ran = run(&job, u64::MAX);
        let kind = ran.fault.map(|fault| fault.kind);
        assert_eq!(kind, Some(FaultKind::ParameterBackwards), "{breadth}");
        assert!((ran.place[0] - 0.5).abs() < 0.03, "{breadth}: {:?}", ran.place);
        justified(&job, &ran).unwrap();
    }
    for breadth in [0.8, 1.5, 2.6, 3.0, 8.0] {
        let ran = run(&ridge(breadth), u64::MAX);
        assert_eq!(ran.fault, None, "{breadth}");
        assert!(ran.ripple_pct <= 0.001, "{breadth}: ripple {} %", ran.ripple_pct);
    }
}

/// Two patches along a straight line, the first with constant parametric speed, the second with 30 + 900 w^2: at the second sample on the
/// second patch the derivative of the speed's slope cannot be estimated from the sample before.
#[test]
fn steps_after_a_boundary_between_speeds() {
    let x = [0.0, 3.333, 6.666, 9.999, 19.999, 29.999, 339.999];
    let nurbs = job::NurbsSpec {
        degree: [3, 1],
        knots_u: vec![0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: x
            .iter()
            .map(|x| vec![[*x, 0.0, 0.0, 1.0], [*x, 5.0, 0.0, 1.0]])
            .collect(),
        rational: false,
    };
    let mut job = job(SurfaceSpec::Nurbs(nurbs), Along::U, Pattern::Zig);
    for feed_mm_s in [99.0, 100.0, 103.0] {
        job.feed_mm_min = 60.0 * feed_mm_s;
        let ran = run(&job, u64::MAX);
        assert_eq!(ran.fault, None);
        assert!(
            ran.ripple_pct <= 0.001,
            "{feed_mm_s}: ripple {} %",
            ran.ripple_pct
        );
    }
}
