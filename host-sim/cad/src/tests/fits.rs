//! Fits of B-splines: over a seam, with fewer knots, joints of the surface; what no fit makes smaller is streamed.

use std::f64::consts::PI;

use super::*;
use crate::exact;
use crate::fit::{self, Knots};

fn rough() -> SplineSurface {
    // No smooth surface comes near its poles.
    let knots = (0..3).map(|_| 0.0);
    let inner = (0..=20).map(f64::from);
    let axis = Axis {
        degree: 3,
        knots: knots.chain(inner).chain((0..3).map(|_| 20.0)).collect(),
    };
    let pole = |i: usize, j: usize| {
        let (x, y) = (5.0 * i as f64, 5.0 * j as f64);
        [x, y, 2.0 * (2.1 * x).sin() * (1.7 * y).cos(), 1.0]
    };
    let poles = (0..axis.poles()).map(|i| (0..axis.poles()).map(|j| pole(i, j)).collect());
    SplineSurface {
        poles: poles.collect(),
        axes: [axis.clone(), axis],
    }
}

/// A face of 400 patches that no fit makes fewer: it is taken as it is, and streamed.
#[test]
fn a_face_that_is_larger_than_the_store_is_streamed() {
    let surface = Surface::Spline(rough());
    let boundary = around(&surface, &[[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]]);
    let face = face(surface, vec![boundary], 1.0);
    let made = machinable("rough", &face, &Options::default()).unwrap();
    assert_eq!((made.form.clone(), made.patches), (Form::Exact, 400));
    assert!(patches::records::patch_count(&made.spec()).is_err());
}

/// A closed tube of degree 5 about the z axis: periodic knots, uneven, of a period that is no round number.
pub(crate) fn tube() -> SplineSurface {
    let spans = [0.7, 1.1, 0.9, 1.3, 0.8, 1.0, 1.2, 0.6].map(|width| width * PI / 10.0);
    let period: f64 = spans.iter().sum();
    let knot = |index: i32| {
        let turns = index.div_euclid(8);
        let within = usize::try_from(index.rem_euclid(8)).unwrap();
        f64::from(turns) * period + spans[..within].iter().sum::<f64>()
    };
    let knots: Vec<f64> = (-5..=13).map(knot).collect();
    let pole = |i: usize, z: f64| {
        let angle = TAU * (i % 8) as f64 / 8.0;
        [
            30.0 * angle.cos(),
            22.0 * angle.sin(),
            z + 3.0 * (2.0 * angle).sin(),
            1.0,
        ]
    };
    SplineSurface {
        poles: (0..13).map(|i| vec![pole(i, 0.0), pole(i, 25.0)]).collect(),
        axes: [
            Axis { degree: 5, knots },
            Axis {
                degree: 1,
                knots: vec![0.0, 0.0, 1.0, 1.0],
            },
        ],
    }
}

/// Beyond the seam a closed B-spline goes on at its beginning; its last polynomial does not.
#[test]
fn a_fit_over_the_seam_follows_the_surface() {
    let spline = tube();
    let [[start, end], _] = spline.domain();
    let period = end - start;
    let surface = Surface::Spline(spline.clone());
    assert_eq!(surface.periods()[0], Some(period), "closed");
    let offset = Surface::Offset {
        base: Box::new(surface.clone()),
        distance: 2.0,
    };
    for (surface, widest) in [(&surface, 1.0), (&offset, 0.9)] {
        for first in [0.6, 0.999, 1e-9] {
            let range = [start + first * period, start + (first + widest) * period];
            let (fitted, said) = fit::fit(surface, [range, [0.0, 1.0]], 1e-3, Knots::OfSurface).unwrap();
            assert!(said.max_mm <= 1e-3, "{said:?}");
            for k in 0..=400 {
                let u = range[0] + (range[1] - range[0]) * f64::from(k) / 400.0;
                let within = if u > end { u - period } else { u };
                let gap = fitted.at(u, 0.3).point.distance(surface.at(within, 0.3).point);
                assert!(gap <= 1.1e-3, "{gap} mm off at {u}, from {range:?}");
            }
        }
    }
}

/// A circle of four rational arcs has double knots, and a seam, at which it has no corner: nor has its fit.
#[test]
fn a_fit_has_no_corner_where_the_surface_has_none() {
    let side = std::f64::consts::FRAC_1_SQRT_2;
    let around = [
        [1.0, 0.0],
        [1.0, 1.0],
        [0.0, 1.0],
        [-1.0, 1.0],
        [-1.0, 0.0],
        [-1.0, -1.0],
        [0.0, -1.0],
        [1.0, -1.0],
        [1.0, 0.0],
    ];
    // A crown of degree 5: no exact form.
    let profile = [9.0, 9.6, 10.1, 10.2, 9.9, 9.4];
    let pole = |row: usize, radius: f64, column: usize| {
        let weight = if column.is_multiple_of(2) { 1.0 } else { side };
        let [x, y] = around[column].map(|share| weight * share * radius);
        [x, y, weight * row as f64, weight]
    };
    let spline = SplineSurface {
        axes: [
            Axis {
                degree: 5,
                knots: [[0.0; 6], [1.0; 6]].concat(),
            },
            Axis {
                degree: 2,
                knots: [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4].map(f64::from).to_vec(),
            },
        ],
        poles: profile
            .iter()
            .enumerate()
            .map(|(row, radius)| (0..9).map(|column| pole(row, *radius, column)).collect())
            .collect(),
    };
    let surface = Surface::Spline(spline);
    for knots in [Knots::OfSurface, Knots::Fewest] {
        let (fitted, said) = fit::fit(&surface, [[0.0, 1.0], [3.3, 4.7]], 1e-3, knots).unwrap();
        assert!(said.max_mm <= 1e-3, "{said:?}");
        for knot in fitted.axes[1].breaks() {
            if knot <= 3.3 || knot >= 4.7 {
                continue;
            }
            let [before, after] = [-1e-9, 1e-9].map(|by| fitted.at(0.4, knot + by).v);
            let corner = before.angle_between(after);
            assert!(corner < 1e-7, "{corner} rad at {knot}, {knots:?}");
        }
    }
}

/// A surface of more pieces than the store holds, smooth but for the jumps of its second derivative, takes few patches.
#[test]
fn knots_that_the_tolerance_does_not_need_are_left_out() {
    const PIECES: u32 = 400;
    let step = 60.0 / f64::from(PIECES);
    let wave = |k: u32| {
        let x = f64::from(k) * step;
        ([x, 2.0 * (1.5 * x).sin()], [1.0, 3.0 * (1.5 * x).cos()])
    };
    let mut profile: Vec<[f64; 2]> = Vec::new();
    for k in 0..=PIECES {
        let (at, slope) = wave(k);
        // Cubic pieces through points of the wave with its slopes: C1.
        let beside = |by: f64| [0, 1].map(|axis| at[axis] + by * step / 3.0 * slope[axis]);
        let poles = match k {
            0 => vec![at, beside(1.0)],
            PIECES => vec![beside(-1.0), at],
            _ => vec![beside(-1.0), beside(1.0)],
        };
        profile.extend(poles);
    }
    let mut knots = vec![0.0; 4];
    knots.extend((1..PIECES).flat_map(|k| [f64::from(k); 2]));
    knots.extend(vec![f64::from(PIECES); 4]);
    let surface = Surface::Spline(SplineSurface {
        axes: [
            Axis { degree: 3, knots },
            Axis {
                degree: 1,
                knots: vec![0.0, 0.0, 1.0, 1.0],
            },
        ],
        poles: profile
            .iter()
            .map(|[x, z]| [0.0, 20.0].map(|y| [*x, y, *z, 1.0]).to_vec())
            .collect(),
    });
    let ranges = [[0.0, f64::from(PIECES)], [0.0, 1.0]];
    assert!(fit::fit(&surface, ranges, 1e-3, Knots::OfSurface).is_err());
    let (fitted, said) = fit::fit(&surface, ranges, 1e-3, Knots::Fewest).unwrap();
    assert!(
        fitted.patches() < 250 && said.max_mm <= 1e-3,
        "{} {said:?}",
        fitted.patches()
    );
    let corners = [
        [ranges[0][0], 0.0],
        [ranges[0][1], 0.0],
        [ranges[0][1], 1.0],
        [ranges[0][0], 1.0],
    ];
    let face = face(surface.clone(), vec![around(&surface, &corners)], 1.0);
    let made = machinable("wave", &face, &Options::default()).unwrap();
    assert_eq!(made.patches, fitted.patches());
}

/// A plane of many spans with one pole lifted: the fit has the bump, wherever it is.
#[test]
fn a_bump_within_few_spans_is_not_missed() {
    const SPANS: u32 = 120;
    const COUNT: usize = SPANS as usize + 3;
    let axis = || {
        let mut knots = vec![0.0; 3];
        knots.extend((0..=SPANS).map(f64::from));
        knots.extend([f64::from(SPANS); 3]);
        Axis { degree: 3, knots }
    };
    // Poles at the Greville abscissae: the parameters are the coordinates.
    let knots = axis().knots;
    let place = |pole: usize| knots[pole + 1..pole + 4].iter().sum::<f64>() / 3.0;
    for [i, k] in [[5, 5], [19, 44], [61, 62], [100, 9]] {
        let lift = |row: usize, column: usize| if [row, column] == [i, k] { 0.02 } else { 0.0 };
        let poles = (0..COUNT).map(|row| {
            (0..COUNT)
                .map(|column| [place(row), place(column), lift(row, column), 1.0])
                .collect()
        });
        let surface = Surface::Spline(SplineSurface {
            axes: [axis(), axis()],
            poles: poles.collect(),
        });
        let ranges = [[0.0, f64::from(SPANS)]; 2];
        let made = fit::fit(&surface, ranges, 1e-3, Knots::Fewest);
        let Ok((fitted, said)) = made else {
            panic!("[{i}, {k}] has no fit")
        };
        assert!(said.max_mm <= 1e-3);
        // Over the pole, and around it.
        for by in [-1.3, -0.4, 0.0, 0.7, 1.1] {
            let [u, v] = [place(i) + by, place(k) - 0.5 * by];
            let off_mm = surface.at(u, v).point.distance(fitted.at(u, v).point);
            assert!(off_mm <= 1.5e-3, "[{i}, {k}]: {off_mm} mm at {u}, {v}");
        }
    }
}

/// Ends of a range that differ from a knot by rounding make no joint.
#[test]
fn knots_at_the_ends_are_no_joints() {
    let surface = Surface::Spline(tube());
    let knots: Vec<f64> = exact::joints(&surface, 0, [-10.0, 10.0])
        .iter()
        .map(|(knot, _)| *knot)
        .collect();
    let next = |t: f64, ulps: i64| f64::from_bits(t.to_bits().wrapping_add_signed(ulps));
    let inner: Vec<f64> = knots.into_iter().filter(|knot| *knot > 0.1).take(7).collect();
    for pair in inner.windows(3) {
        for (before, after) in [(0, 0), (-1, 1), (1, -1), (-3, 2), (5, -4)] {
            let range = [next(pair[0], before), next(pair[2], after)];
            let joints = exact::joints(&surface, 0, range);
            assert_eq!(joints.len(), 1, "{range:?}: {joints:?}");
            assert_eq!(joints[0].1, 4);
            let (fitted, said) = fit::fit(&surface, [range, [0.0, 1.0]], 1e-3, Knots::OfSurface).unwrap();
            assert!(
                said.max_mm <= 1e-3 && fitted.patches() < 40,
                "{} patches",
                fitted.patches()
            );
        }
    }
}
