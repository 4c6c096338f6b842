//! B-spline surfaces: a part cut out of one, and its derivatives.

use super::*;

#[test]
fn a_cut_is_the_same_surface() {
    for p in 1..=7 {
        for q in [1, 3, 5] {
            let whole = wavy(p, q);
            let part = whole.cut([[0.31, 2.2], [0.0, 1.0]]);
            assert_eq!(part.domain(), [[0.31, 2.2], [0.0, 1.0]]);
            for axis in &part.axes {
                let ends = [axis.domain()[0], axis.domain()[1]];
                assert!(
                    ends.iter().all(|end| axis.multiplicity(*end) == axis.degree + 1),
                    "clamped"
                );
            }
            for (u, v) in [
                (0.31, 0.0),
                (0.35, 0.34),
                (0.9, 0.3),
                (1.0, 0.7),
                (1.7, 0.99),
                (2.2, 1.0),
            ] {
                near(whole.at(u, v).point, part.at(u, v).point, 1e-11, "cut");
            }
        }
    }
}

#[test]
fn derivatives_are_those_of_the_points() {
    let surface = wavy(5, 4);
    let step = 1e-5;
    for (u, v) in [(0.1, 0.2), (0.5, 0.7), (1.8, 2.1)] {
        let at = surface.at(u, v);
        let slope = |a: DVec3, b: DVec3| (a - b) * (0.5 / step);
        let (right, left) = (surface.at(u + step, v), surface.at(u - step, v));
        let (above, below) = (surface.at(u, v + step), surface.at(u, v - step));
        near(at.u, slope(right.point, left.point), 1e-5, "S_u");
        near(at.v, slope(above.point, below.point), 1e-5, "S_v");
        near(at.uu, slope(right.u, left.u), 1e-4, "S_uu");
        near(at.uv, slope(above.u, below.u), 1e-4, "S_uv");
        near(at.vv, slope(above.v, below.v), 1e-4, "S_vv");
    }
}
