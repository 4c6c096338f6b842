//! Small corners of a B-spline are straightened, larger ones stay.

use super::*;
use crate::straight::straightened;

/// Three cubic pieces of 30 mm along x, each with handles of a third of it, that meet at these angles, rad; by three poles of an arc across.
fn strip(corners: [f64; 2]) -> SplineSurface {
    let turns = [0.0, corners[0], corners[0] + corners[1]];
    let mut profile = vec![[0.0, 0.0]];
    for (piece, turn) in turns.into_iter().enumerate() {
        // The handles differ, so that the speed jumps, too.
        for handle in [10.0, 9.0 + piece as f64, 11.0 - piece as f64] {
            let [x, z] = profile[profile.len() - 1];
            profile.push([x + handle * turn.cos(), z - handle * turn.sin()]);
        }
    }
    let across = [[0.0, 0.0, 1.0], [5.0, 2.0, 0.8], [10.0, 0.0, 1.0]];
    let row = |[x, z]: &[f64; 2]| across.map(|[y, up, w]| [w * x, w * y, w * (z + up), w]).to_vec();
    SplineSurface {
        axes: [
            Axis {
                degree: 3,
                knots: vec![
                    0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0,
                ],
            },
            Axis {
                degree: 2,
                knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
            },
        ],
        poles: profile.iter().map(row).collect(),
    }
}

/// The largest angle between the normals below and above a knot of u.
fn corner(spline: &SplineSurface, knot: f64) -> f64 {
    let normal = |u: f64, v: f64| {
        let at = spline.at(u, v);
        at.u.cross(at.v).normalize()
    };
    (0..=8)
        .map(|k| f64::from(k) / 8.0)
        .map(|v| normal(knot - 1e-12, v).distance(normal(knot, v)))
        .fold(0.0, f64::max)
}

#[test]
fn small_corners_are_straightened() {
    let spline = strip([5e-5, 0.02]);
    assert!(corner(&spline, 1.0) > 4e-5);
    let (straight, moved_mm) = straightened(&spline, 5e-4).unwrap();
    assert!(corner(&straight, 1.0) < 1e-9, "{}", corner(&straight, 1.0));
    assert!((corner(&straight, 2.0) - corner(&spline, 2.0)).abs() < 1e-9);
    // Of handles of 10 mm on either side.
    assert!(moved_mm > 2e-4 && moved_mm < 4e-4, "{moved_mm}");
    for (u, v) in (0..=60).flat_map(|i| (0..=4).map(move |j| (f64::from(i) / 20.0, f64::from(j) / 4.0))) {
        let apart = spline.at(u, v).point.distance(straight.at(u, v).point);
        assert!(apart <= moved_mm + 1e-12, "{apart} at {u}, {v}");
    }
}

#[test]
fn other_corners_stay() {
    for corners in [[0.0, 1e-8], [0.01, 0.3]] {
        assert_eq!(straightened(&strip(corners), 5e-4), None, "{corners:?}");
    }
    // It would take too far.
    assert_eq!(straightened(&strip([0.0, 5e-4]), 5e-4), None);
}
