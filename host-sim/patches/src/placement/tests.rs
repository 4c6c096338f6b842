//! Placed surfaces against their originals under plain matrices, through the oracle's evaluation.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::*;
use oracle::Surface;

/// The placement as documented for the job file, one rotation after the other, by sine and cosine.
fn by_hand(placement: &Placement, p: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = p.map(|c| c * placement.scale);
    let [a, b, c] = placement.rotate_deg.map(|degrees| degrees * PI / 180.0);
    let [x, y, z] = [x, y * a.cos() - z * a.sin(), y * a.sin() + z * a.cos()];
    let [x, y, z] = [x * b.cos() + z * b.sin(), y, z * b.cos() - x * b.sin()];
    let [x, y, z] = [x * c.cos() - y * c.sin(), x * c.sin() + y * c.cos(), z];
    let [tx, ty, tz] = placement.translate_mm;
    [x + tx, y + ty, z + tz]
}

fn bicubic() -> SurfaceSpec {
    let mut random = fastrand::Rng::with_seed(7);
    SurfaceSpec::Bicubic {
        coefficients_mm: std::array::from_fn(|_| {
            std::array::from_fn(|_| std::array::from_fn(|_| 40.0 * random.f64() - 20.0))
        }),
        u: [-0.5, 1.0],
        v: [0.25, 2.0],
    }
}

fn ruled() -> SurfaceSpec {
    let mut random = fastrand::Rng::with_seed(8);
    let mut rail = || std::array::from_fn(|_| std::array::from_fn(|_| 90.0 * random.f64() - 30.0));
    SurfaceSpec::Ruled {
        rail0_mm: rail(),
        rail1_mm: rail(),
        u: [0.0, 1.0],
        v: [-1.0, 1.0],
    }
}

fn nurbs() -> SurfaceSpec {
    let mut random = fastrand::Rng::with_seed(9);
    let pole = |i: usize, j: usize, w: f64| [17.0 * i as f64, 11.0 * j as f64, 30.0 * w, 0.5 + w];
    let poles_mm = (0..5).map(|i| (0..4).map(|j| pole(i, j, random.f64())).collect());
    SurfaceSpec::Nurbs(NurbsSpec {
        degree: [2, 3],
        knots_u: vec![0.0, 0.0, 0.0, 0.3, 0.6, 1.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 2.0],
        poles_mm: poles_mm.collect(),
        rational: true,
    })
}

/// The bell of Lo's Example 1, over this angle.
fn bell(v_rad: [f64; 2]) -> SurfaceSpec {
    SurfaceSpec::Revolved {
        radius_mm: [60.0, -90.0, 90.0, 20.0],
        height_mm: [60.0, -90.0, 0.0, 50.0],
        u: [0.0, 1.0],
        v_rad,
    }
}

fn grid(spec: &SurfaceSpec, steps: u32) -> Vec<(f64, f64)> {
    let [[u0, u1], [v0, v1]] = spec.domain();
    let at = |low: f64, high: f64, k: u32| low + (high - low) * f64::from(k) / f64::from(steps);
    (0..=steps)
        .flat_map(|i| (0..=steps).map(move |j| (at(u0, u1, i), at(v0, v1, j))))
        .collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

const TILTED: Placement = Placement {
    scale: 2.54,
    rotate_deg: [33.0, -71.0, 128.0],
    anchor: Anchor::Origin,
    translate_mm: [120.0, -45.5, 9.25],
};

#[test]
fn polynomials_and_splines_keep_their_parameters() {
    for spec in [bicubic(), ruled(), nurbs()] {
        for rotate_deg in [[0.0; 3], [90.0, 0.0, 0.0], [0.0, 270.0, -90.0], TILTED.rotate_deg] {
            let placement = Placement { rotate_deg, ..TILTED };
            let placed = placement.place(&spec).unwrap();
            assert_eq!(placed.kind(), spec.kind());
            let (before, after) = (Surface::new(&spec), Surface::new(&placed));
            for (u, v) in grid(&spec, 9) {
                let want = by_hand(&placement, before.at(u, v).point.to_array());
                let off = distance(after.at(u, v).point.to_array(), want);
                assert!(off < 1e-11, "{}: off by {off:e} mm at {u}, {v}", spec.kind());
            }
        }
    }
}

#[test]
fn a_revolved_profile_keeps_its_kind_about_its_axis() {
    let spec = bell([-3.0, -0.6]);
    for (rotate_deg, turned_rad) in [
        ([0.0, 0.0, 90.0], FRAC_PI_2),
        ([180.0, 180.0, 0.0], PI),
        ([0.0, 0.0, -34.0], -34.0_f64.to_radians()),
    ] {
        let placement = Placement {
            rotate_deg,
            translate_mm: [0.0, 0.0, 12.5],
            ..TILTED
        };
        let placed = placement.place(&spec).unwrap();
        assert_eq!(placed.kind(), "revolved");
        let (before, after) = (Surface::new(&spec), Surface::new(&placed));
        for (u, v) in grid(&spec, 9) {
            let want = by_hand(&placement, before.at(u, v).point.to_array());
            let off = distance(after.at(u, v + turned_rad).point.to_array(), want);
            assert!(off < 1e-11, "off by {off:e} mm at {u}, {v}");
        }
    }
}

/// After the inverse rotation, a point of the placed bell has the bell's radius and height at the same u; at the ends and middles of the
/// arcs it also has the bell's angle, elsewhere within the documented 0.0161 rad.
#[test]
fn a_tilted_profile_is_the_same_surface() {
    for v_rad in [[-3.0, -0.6], [0.2, 0.2 + TAU], [-0.7, 0.9]] {
        let spec = bell(v_rad);
        let placed = TILTED.place(&spec).unwrap();
        assert_eq!(placed.kind(), "nurbs");
        let domain = placed.domain();
        assert_eq!(domain, spec.domain());
        let (before, after) = (Surface::new(&spec), Surface::new(&placed));
        let arcs = ((v_rad[1] - v_rad[0]) / FRAC_PI_2 - 1e-9).ceil() as u32;
        let half = (v_rad[1] - v_rad[0]) / f64::from(2 * arcs);
        let mut widest = 0.0_f64;
        for (u, v) in grid(&spec, 40 * arcs) {
            let point = after.at(u, v).point.to_array();
            let [x, y, z] = by_hand(&TILTED, before.at(u, v).point.to_array());
            let apart = distance(point, [x, y, z]);
            let radius = 2.54 * (before.at(u, 0.0).point[0]);
            widest = widest.max(apart / radius);
            let halves = (v - v_rad[0]) / half;
            if (halves - halves.round()).abs() < 1e-9 {
                assert!(apart < 1e-10, "off by {apart:e} mm at {u}, {v}");
            }
            // Inverse rotation: the transposed rotations in reverse order.
            let moved: [f64; 3] = std::array::from_fn(|k| (point[k] - TILTED.translate_mm[k]) / 2.54);
            let back = |degrees: [f64; 3], p| {
                by_hand(
                    &Placement {
                        rotate_deg: degrees,
                        ..Placement::default()
                    },
                    p,
                )
            };
            let [a, b, c] = TILTED.rotate_deg;
            let [x, y, z] = back([-a, 0.0, 0.0], back([0.0, -b, 0.0], back([0.0, 0.0, -c], moved)));
            let want = before.at(u, 0.0).point.to_array();
            assert!(
                (x.hypot(y) - want[0]).abs() < 1e-11 && (z - want[2]).abs() < 1e-11,
                "{u}, {v}"
            );
        }
        assert!(widest < 0.0161, "the angle is off by {widest} rad");
    }
}

/// The box touches the extremes of a dense grid of points and encloses the surface.
#[test]
fn the_box_encloses_the_surface() {
    for spec in [bicubic(), ruled(), nurbs(), bell([0.0, TAU]), bell([-0.5, 2.0])] {
        let extent = extent_mm(&spec);
        let surface = Surface::new(&spec);
        let mut seen = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        for (u, v) in grid(&spec, 400) {
            for (range, c) in seen.iter_mut().zip(surface.at(u, v).point.to_array()) {
                *range = [range[0].min(c), range[1].max(c)];
            }
        }
        for (range, seen) in extent.iter().zip(seen) {
            let size = seen[1] - seen[0];
            for (gap, side) in [(seen[0] - range[0], "least"), (range[1] - seen[1], "most")] {
                assert!(
                    gap > -EXTENT_TOLERANCE_MM && gap < 1e-4 * size,
                    "{}: the {side} is {gap:e} mm beyond a grid",
                    spec.kind()
                );
            }
        }
    }
    // Closed form: the rim of the whole bell, radius 80, heights 50 to 20.
    let extent = extent_mm(&bell([0.0, TAU]));
    for (ours, exact) in extent
        .iter()
        .flatten()
        .zip([-80.0, 80.0, -80.0, 80.0, 20.0, 50.0])
    {
        assert!(
            (ours - exact).abs() <= 1.1 * EXTENT_TOLERANCE_MM,
            "{ours} for {exact}"
        );
    }
}

#[test]
fn the_anchor_is_at_the_translation() {
    let at = [12.0, -7.0, 30.0];
    for spec in [bicubic(), nurbs(), bell([-0.5, 2.0])] {
        for (anchor, shares) in [
            (Anchor::Centre, [0.5, 0.5, 0.5]),
            (Anchor::Corner, [0.0, 0.0, 0.0]),
            (Anchor::Top, [0.5, 0.5, 1.0]),
        ] {
            let placement = Placement {
                anchor,
                translate_mm: at,
                ..TILTED
            };
            let placed = placement.place(&spec).unwrap();
            for ((range, share), want) in extent_mm(&placed).iter().zip(shares).zip(at) {
                let anchor = range[0] + share * (range[1] - range[0]);
                assert!(
                    (anchor - want).abs() < 4.0 * EXTENT_TOLERANCE_MM,
                    "{anchor} for {want}"
                );
            }
        }
    }
    // A full bell is centred on its axis already: it remains a revolved surface.
    let placement = Placement {
        anchor: Anchor::Top,
        ..Placement::default()
    };
    let SurfaceSpec::Revolved { height_mm, .. } = placement.place(&bell([0.0, TAU])).unwrap() else {
        panic!("no longer revolved")
    };
    assert!((height_mm[3] - 0.0).abs() < 2.0 * EXTENT_TOLERANCE_MM);
}

#[test]
fn a_surface_outside_the_range_is_refused() {
    let far = Placement {
        translate_mm: [0.0, 2147.0, 0.0],
        ..Placement::default()
    };
    let outside = far.place(&bell([0.0, 1.0])).unwrap_err();
    assert!(outside.axis == 1 && !outside.too_large, "{outside}");
    let huge = Placement {
        scale: 100.0,
        ..Placement::default()
    };
    let outside = huge.place(&bell([0.0, 1.0])).unwrap_err();
    assert!(outside.axis == 0 && outside.too_large, "{outside}");
    // A surface far from the origin can be translated into the range.
    let away = Placement {
        anchor: Anchor::Centre,
        ..Placement::default()
    };
    let mut spec = bell([0.0, 1.0]);
    if let SurfaceSpec::Revolved { height_mm, .. } = &mut spec {
        height_mm[3] = 1e6;
    }
    assert!(away.place(&spec).is_ok());
}
