//! The derivative of the ball's centre against differences in f64.

use super::*;
use crate::math::arith::fraction_from_f32;

/// Ball radius, mm, and width of the side span, units of the curve.
const RADIUS_MM: f32 = 3.0;
const WIDTH: i32 = 1 << 28;

/// Coefficients of a patch of about 10 mm, nm.
const PATCH: [[[i32; 4]; 4]; 3] = [
    [
        [0, 400_000, -300_000, 0],
        [9_000_000, 900_000, 0, 0],
        [700_000, 0, 0, 0],
        [-300_000, 0, 0, 0],
    ],
    [
        [0, 7_000_000, 500_000, 0],
        [-600_000, 300_000, 0, 0],
        [200_000, 0, 0, 0],
        [0; 4],
    ],
    [
        [0, 1_000_000, 1_500_000, -400_000],
        [800_000, -1_200_000, 600_000, 0],
        [-1_900_000, 700_000, 0, 0],
        [900_000, 0, 0, 0],
    ],
];

/// A front: its share of the side span at the start, and its cubic over the path span. Along the second one the path is nearly a side line.
const CURVES: [[i32; 4]; 3] = [
    [1 << 27, 0, 0, 0],
    [80_000_000, 60_000_000, -30_000_000, 20_000_000],
    [20_000_000, 200_000_000, -100_000_000, 100_000_000],
];

fn share(curve: &[i32; 4], path: f64) -> f64 {
    let [c0, c1, c2, c3] = curve.map(|c| f64::from(c) / f64::from(WIDTH));
    c0 + path * (c1 + path * (c2 + path * c3))
}

/// Centre of the ball on the curve at a path parameter, nm, and the contact.
fn centre(curve: &[i32; 4], path: f64) -> [[f64; 3]; 2] {
    let (w, s) = (path - 0.5, share(curve, path) - 0.5);
    let at = |c: &[[i32; 4]; 4], of: [usize; 2]| {
        let power = |x: f64, n: usize, derivative: usize| match (n, derivative) {
            (_, 0) => x.powi(n as i32),
            (0, _) => 0.0,
            _ => n as f64 * x.powi(n as i32 - 1),
        };
        let mut sum = 0.0;
        for (i, row) in c.iter().enumerate() {
            for (j, c) in row.iter().enumerate() {
                sum += f64::from(*c) * power(w, i, of[0]) * power(s, j, of[1]);
            }
        }
        sum
    };
    let [place, a, b] = [[0, 0], [1, 0], [0, 1]].map(|of| PATCH.map(|c| at(&c, of)));
    let normal = [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ];
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut moved = place;
    for (x, n) in moved.iter_mut().zip(normal) {
        *x += f64::from(RADIUS_MM) * 1e6 * n / length;
    }
    [moved, place]
}

/// Within 1e-6 on curves and on a line, in both directions of travel.
#[test]
fn directions_of_the_centre() {
    const STEP: f64 = 1e-5;
    let record = PolynomialRecord {
        origin_nm: [0; 3],
        shift: 0,
        edges: Edges::default(),
        coefficients: PATCH,
    };
    let ball = Ball::new(&OffsetUnits::new(RADIUS_MM, 0), 1.0);
    for (curve, reversed) in CURVES.iter().flat_map(|curve| [(curve, false), (curve, true)]) {
        let mut pass = CurvePass::NONE;
        pass.load_record(RecordKind::Polynomial, &record.to_words(), 0.0);
        let [start, coefficients @ ..] = *curve;
        pass.set_curve(SideCurve::new(i64::from(start) << 12, coefficients, 0, 0, WIDTH));
        pass.set_ends(reversed, [0, u64::MAX], [false; 2], false);
        let pass = Surface::Curve(pass);
        for part in 1..20_u8 {
            let path = f32::from(part) * 0.05;
            let travelled = fraction_from_f32(if reversed { 1.0 - path } else { path });
            let (_, direction) = pass.contact_and_direction(travelled, &ball).unwrap();
            let Vec3 { x, y, z } = direction.unwrap();
            let ends = [-STEP, STEP].map(|step| centre(curve, f64::from(path) + step));
            let apart = |which: usize| [0, 1, 2].map(|axis| ends[1][which][axis] - ends[0][which][axis]);
            let arc = apart(1).iter().map(|x| x * x).sum::<f64>().sqrt();
            let turn = if reversed { -1.0 } else { 1.0 };
            for (got, want) in [x, y, z].into_iter().zip(apart(0)) {
                let want = turn * want / arc;
                assert!(
                    (f64::from(got) - want).abs() < 1e-6,
                    "{curve:?} {path}: {got} for {want}"
                );
            }
        }
    }
}

/// On a line of constant side parameter they are those of the constant curve.
#[test]
fn directions_on_a_line() {
    let record = PolynomialRecord {
        origin_nm: [0; 3],
        shift: 0,
        edges: Edges::default(),
        coefficients: PATCH,
    };
    let words = record.to_words();
    let (_, _, edges, blocks) = split_patch(&words);
    let mut line = GridPass::NONE;
    let at = IsoLine {
        fraction: 1 << 63,
        side: 0,
        reversed: false,
    };
    line.collapse(blocks, edges, &at);
    let line = Surface::Grid(line);
    let ball = Ball::new(&OffsetUnits::new(RADIUS_MM, 0), 1.0);
    for part in 1..20_u8 {
        let path = f32::from(part) * 0.05;
        let (_, direction) = line
            .contact_and_direction(fraction_from_f32(path), &ball)
            .unwrap();
        let Vec3 { x, y, z } = direction.unwrap();
        let ends = [-1e-5, 1e-5].map(|step| centre(&CURVES[0], f64::from(path) + step));
        let apart = |which: usize| [0, 1, 2].map(|axis| ends[1][which][axis] - ends[0][which][axis]);
        let arc = apart(1).iter().map(|x| x * x).sum::<f64>().sqrt();
        for (got, want) in [x, y, z].into_iter().zip(apart(0)) {
            let want = want / arc;
            assert!((f64::from(got) - want).abs() < 1e-6, "{path}: {got} for {want}");
        }
    }
}
