//! Regions are cut at creases.

use super::*;

/// A profile straight between poles, each 10 mm along x, at heights that fall by `slopes`.
fn polyline(slopes: &[f64]) -> (Face, oracle::Surface) {
    let mut profile = vec![[0.0, 0.0]];
    for slope in slopes {
        let [x, z] = profile[profile.len() - 1];
        profile.push([x + 10.0, z - 10.0 * slope]);
    }
    let last = slopes.len() as f64;
    let inner = (0..=slopes.len()).map(|k| k as f64);
    let knots: Vec<f64> = [0.0].into_iter().chain(inner).chain([last]).collect();
    extruded(1, &knots, &profile)
}

/// A roof of two planes: each is a polygon of its own, that ends 10 um before the ridge. So it does beside a jump over which the ball's centre moves by
/// 9 nm; one by 3 nm is passed.
#[test]
fn a_region_is_cut_at_a_crease() {
    let tool = Tool::new(3.0, &ToolBody::default());
    let whole = |last: f64| vec![vec![[0.0, 0.0], [last, 0.0], [last, 1.0], [0.0, 1.0]]];
    for (jump, is_cut) in [(0.2, true), (3e-6, true), (1e-6, false)] {
        let (face, surface) = polyline(&[-0.5 * jump, 0.5 * jump]);
        let made = region(&[face], &surface, &whole(2.0), &tool);
        assert_eq!(made.loops.len(), if is_cut { 2 } else { 1 }, "{jump}");
        assert!(made.inside_mm2 > 0.995 * made.area_mm2, "{jump}");
        if !is_cut {
            continue;
        }
        let mut sides = [0, 1];
        for ring in &made.loops {
            let us = ring.iter().map(|[u, _]| *u);
            let [low, high] = us.fold([f64::INFINITY, 0.0], |[low, high], u| [low.min(u), high.max(u)]);
            let end = if high < 1.0 {
                sides[0] += 1;
                assert_eq!(low, 0.0);
                1.0 - high
            } else {
                sides[1] += 1;
                assert_eq!(high, 2.0);
                low - 1.0
            };
            // 10 mm for each unit, along the slope.
            let end_mm = 10.0 * end * (1.0 + 0.25 * jump * jump).sqrt();
            assert!((end_mm - 0.01).abs() < 1e-4, "{jump}: {end_mm} mm");
            let vs = ring.iter().map(|[_, v]| *v);
            assert_eq!(vs.clone().fold(1.0, f64::min), 0.0);
            assert_eq!(vs.fold(0.0, f64::max), 1.0);
        }
        assert_eq!(sides, [1, 2], "{jump}");
    }
}

/// Creases of both parameters part a face into a chessboard; double knots of a circle, at which only the second derivative jumps, and its poles do not.
#[test]
fn only_knots_with_an_edge_are_creases() {
    let pole = |x: f64, y: f64| [x, y, -0.1 * ((x - 1.0).abs() + (y - 1.0).abs()), 1.0];
    let at = [0.0, 1.0, 2.0];
    let pyramid = oracle::Surface::new(&SurfaceSpec::Nurbs(NurbsSpec {
        degree: [1, 1],
        knots_u: vec![0.0, 0.0, 1.0, 2.0, 2.0],
        knots_v: vec![0.0, 0.0, 1.0, 2.0, 2.0],
        poles_mm: at.map(|x| at.map(|y| pole(x, y)).to_vec()).to_vec(),
        rational: false,
    }));
    let strips =
        |surface: &oracle::Surface, along| crate::crease::strips(surface, along, surface.domain(), 3.0);
    for along in [job::Along::U, job::Along::V] {
        let found = strips(&pyramid, along);
        assert_eq!(found.len(), 2);
        let [([low, below], first), ([above, high], second)] = [found[0], found[1]];
        assert_eq!((low, above, high), (0.0, 1.0, 2.0));
        assert!(below < 1.0 && below > 1.0 - 1e-8);
        assert_eq!([first, second], [[false, true], [true, false]]);
    }
    // Half a sphere of four arcs by two: its v ends in the pole.
    let h = std::f64::consts::FRAC_1_SQRT_2;
    let circle = [
        [1.0, 0.0, 1.0],
        [1.0, 1.0, h],
        [0.0, 1.0, 1.0],
        [-1.0, 1.0, h],
        [-1.0, 0.0, 1.0],
        [-1.0, -1.0, h],
        [0.0, -1.0, 1.0],
        [1.0, -1.0, h],
        [1.0, 0.0, 1.0],
    ];
    let arc = [[1.0, 0.0, 1.0], [1.0, 1.0, h], [0.0, 1.0, 1.0]];
    let row = |[x, y, weight]: [f64; 3]| {
        arc.map(|[r, z, w]| [20.0 * r * x, 20.0 * r * y, 20.0 * z, w * weight])
            .to_vec()
    };
    let sphere = oracle::Surface::new(&SurfaceSpec::Nurbs(NurbsSpec {
        degree: [2, 2],
        knots_u: vec![0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0],
        knots_v: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        poles_mm: circle.map(row).to_vec(),
        rational: true,
    }));
    for along in [job::Along::U, job::Along::V] {
        let [of_u, of_v] = sphere.domain();
        let range = if along == job::Along::U { of_u } else { of_v };
        assert_eq!(strips(&sphere, along), [(range, [false; 2])]);
    }
}
