//! Which part of a surface looks down, and how to turn the part so that none does: what a tool along z can reach from above.

use glam::{DMat3, DVec3};
use job::Along;

use crate::Surface;

/// Cells per span along each parameter with which the search for places that look down begins.
const SPAN_CELLS: usize = 8;
/// Largest number of these cells along each parameter of the whole surface.
const SIDE_CELLS_MAX: usize = 160;
/// Splits of a cell in which some corners look down and others do not.
const SPLITS: u32 = 5;
/// A unit normal whose z is below this looks down; a smaller |z| is rounding.
const DOWN: f64 = -1e-9;
/// z of a unit normal, after a turn, that still counts as a wall: a turn is given to a millionth of a degree.
const WALL: f64 = -1e-7;
/// Steps of the search for a turn.
const STEPS: usize = 400;
/// Largest number of normals in the search for a turn.
const NORMALS_MAX: usize = 1500;
/// A simple turn is preferred if the least z of the turned normals is at most this much below that of the best turn.
const SIMPLE: f64 = 0.1;
/// `|S_u x S_v|` below this share of `|S_u| |S_v|`: no normal.
const SINE_MIN: f64 = 1e-6;

/// How a side of a surface faces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Facing {
    /// Share of the area that looks down, 0 to 1: no tool from above reaches it.
    pub down_share: f64,
    /// Error of the share: half the area of the cells in which the surface turns from up to down, and the quadrature's.
    pub error_share: f64,
    /// Rotation about x, then y, then z, degrees, after which nothing looks down; `None` where there is none, zeros where none is needed.
    pub turn_deg: Option<[f64; 3]>,
    /// Least z of the unit normals after that rotation: how far from a wall.
    pub turned_z_min: f64,
}

/// A part of the surface between two values of each parameter.
type Cell = [[f64; 2]; 2];

/// Sums over the surface.
struct Areas<'a> {
    surface: &'a Surface,
    sign: f64,
    whole: f64,
    down: f64,
    mixed: f64,
    quadrature: f64,
    normals: Vec<DVec3>,
    mean: DVec3,
}

impl Areas<'_> {
    /// Normal times area element on the side of the tool; `None` where there is none.
    fn normal(&self, u: f64, v: f64) -> Option<DVec3> {
        let at = self.surface.at(u, v);
        let normal = at.u.cross(at.v) * self.sign;
        let length = normal.length();
        (length > SINE_MIN * at.u.length() * at.v.length() && length > 0.0).then_some(normal)
    }

    fn add(&mut self, cell: Cell, splits: u32) {
        let [[u0, u1], [v0, v1]] = cell;
        let (u, v) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
        let Some(middle) = self.normal(u, v) else {
            return;
        };
        let down = middle.z < DOWN * middle.length();
        // A wall is neither.
        let differs = |normal: &DVec3| match down {
            true => normal.z > -DOWN * normal.length(),
            false => normal.z < DOWN * normal.length(),
        };
        // A corner at a pole has no normal.
        let corners = [(u0, v0), (u0, v1), (u1, v0), (u1, v1)].map(|(u, v)| self.normal(u, v));
        let mixed = corners.iter().flatten().any(differs);
        if splits == SPLITS {
            let all = corners.iter().flatten().chain([&middle]);
            self.normals.extend(all.map(|normal| normal.normalize()));
        }
        if mixed && splits > 0 {
            for us in [[u0, u], [u, u1]] {
                for vs in [[v0, v], [v, v1]] {
                    self.add([us, vs], splits - 1);
                }
            }
            return;
        }
        let size = (u1 - u0) * (v1 - v0);
        let area = middle.length() * size;
        let ends: f64 = corners
            .iter()
            .map(|corner| corner.map_or(0.0, DVec3::length))
            .sum();
        // The midpoint rule is off by a third of what it differs from the trapezoid rule.
        self.quadrature += (0.25 * ends - middle.length()).abs() * size / 3.0;
        self.mean += middle * size;
        self.whole += area;
        if mixed {
            self.mixed += 0.5 * area;
            self.down += 0.5 * area;
        } else if down {
            self.down += area;
        }
    }
}

/// Values of a parameter between the cells.
fn edges(surface: &Surface, along: Along) -> Vec<f64> {
    let breaks = surface.breaks(along);
    let each = (SIDE_CELLS_MAX / (breaks.len() - 1)).clamp(2, 4 * SPAN_CELLS);
    let each = if breaks.len() > 3 {
        each.min(SPAN_CELLS)
    } else {
        each
    };
    let mut edges = vec![breaks[0]];
    for span in breaks.windows(2) {
        #[allow(clippy::cast_precision_loss, reason = "small")]
        edges.extend((1..=each).map(|k| span[0] + (span[1] - span[0]) * k as f64 / each as f64));
    }
    edges
}

/// How the side of a surface faces to which `sign` times `S_u x S_v` points.
#[must_use]
pub fn facing(surface: &Surface, sign: f64) -> Facing {
    let mut areas = Areas {
        surface,
        sign,
        whole: 0.0,
        down: 0.0,
        mixed: 0.0,
        quadrature: 0.0,
        normals: Vec::new(),
        mean: DVec3::ZERO,
    };
    let (us, vs) = (edges(surface, Along::U), edges(surface, Along::V));
    for u in us.windows(2) {
        for v in vs.windows(2) {
            areas.add([[u[0], u[1]], [v[0], v[1]]], SPLITS);
        }
    }
    let share = |part: f64| {
        if areas.whole > 0.0 {
            part / areas.whole
        } else {
            0.0
        }
    };
    let (turn_deg, turned_z_min) = match turn(&areas.normals, areas.mean) {
        Some((turn, least)) => (Some(turn), least),
        None => (None, 0.0),
    };
    Facing {
        down_share: share(areas.down),
        error_share: if areas.down > 0.0 && areas.down < areas.whole {
            share(areas.mixed + areas.quadrature)
        } else {
            0.0
        },
        turn_deg,
        turned_z_min,
    }
}

/// Least scalar product of a direction with the normals.
fn least(normals: &[DVec3], direction: DVec3) -> f64 {
    normals
        .iter()
        .map(|normal| normal.dot(direction))
        .fold(f64::INFINITY, f64::min)
}

/// A turn after which no normal looks down, and the least z then.
fn turn(normals: &[DVec3], mean: DVec3) -> Option<([f64; 3], f64)> {
    if normals.is_empty() {
        return None;
    }
    let here = least(normals, DVec3::Z);
    if here >= WALL {
        return Some(([0.0; 3], here));
    }
    // The direction of the smallest cone around all normals is that of the point of their convex hull nearest to the origin (Gilbert 1966).
    let some: Vec<DVec3> = normals
        .iter()
        .step_by(normals.len().div_ceil(NORMALS_MAX))
        .copied()
        .collect();
    let mut near = mean.normalize_or(some[0]);
    for _ in 0..STEPS {
        let by = |a: &&DVec3, b: &&DVec3| a.dot(near).total_cmp(&b.dot(near));
        let Some(far) = some.iter().min_by(by).copied() else {
            break;
        };
        if near.length_squared() - far.dot(near) <= 1e-9 {
            break;
        }
        let way = far - near;
        near += way * (-near.dot(way) / way.length_squared()).clamp(0.0, 1.0);
    }
    let searched = [near.normalize_or_zero(), mean.normalize_or_zero()].map(degrees_up);
    let simple = [
        [180.0, 0.0, 0.0],
        [90.0, 0.0, 0.0],
        [-90.0, 0.0, 0.0],
        [0.0, 90.0, 0.0],
        [0.0, -90.0, 0.0],
    ];
    let rounded = |by: f64| searched.map(|turn| turn.map(|angle| (angle / by).round() * by));
    let candidates: Vec<[f64; 3]> = simple
        .into_iter()
        .chain(rounded(15.0))
        .chain(rounded(1.0))
        .chain(rounded(1e-6))
        .collect();
    let judged: Vec<([f64; 3], f64)> = candidates
        .into_iter()
        .map(|turn| (turn, least(normals, rotation(turn).transpose() * DVec3::Z)))
        .filter(|(_, least)| *least >= WALL)
        .collect();
    let best = judged.iter().map(|(_, least)| *least).fold(WALL, f64::max);
    judged.into_iter().find(|(_, least)| *least >= best - SIMPLE)
}

/// The rotation about x, then y, then z, degrees, with fixed axes.
fn rotation([x, y, z]: [f64; 3]) -> DMat3 {
    DMat3::from_rotation_z(z.to_radians())
        * DMat3::from_rotation_y(y.to_radians())
        * DMat3::from_rotation_x(x.to_radians())
}

/// The rotation about x and y, degrees, that turns a direction up.
fn degrees_up(direction: DVec3) -> [f64; 3] {
    let DVec3 { x, y, z } = direction;
    // About x into the plane of x and z, then about y.
    let about_x = y.atan2(z);
    let about_y = (-x).atan2(y.hypot(z));
    [about_x.to_degrees(), about_y.to_degrees(), 0.0].map(|angle| if angle == 0.0 { 0.0 } else { angle })
}

/// The rotation of one placement followed by another, as rotations about x, then y, then z, degrees, rounded to a millionth.
#[must_use]
pub fn turned_further(first_deg: [f64; 3], then_deg: [f64; 3]) -> [f64; 3] {
    let whole = rotation(then_deg) * rotation(first_deg);
    let [across, up, out] = [whole.x_axis, whole.y_axis, whole.z_axis];
    let sine = -across.z;
    let angles = if sine.abs() < 1.0 - 1e-12 {
        [
            up.z.atan2(out.z),
            sine.clamp(-1.0, 1.0).asin(),
            across.y.atan2(across.x),
        ]
    } else {
        // About y by a quarter turn: x and z are one axis.
        [
            (sine * up.x).atan2(up.y),
            sine.signum() * std::f64::consts::FRAC_PI_2,
            0.0,
        ]
    };
    angles.map(|angle| {
        let rounded = (angle.to_degrees() * 1e6).round() * 1e-6;
        if rounded == 0.0 { 0.0 } else { rounded }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use job::SurfaceSpec;
    use std::f64::consts::PI;

    /// A cylinder about z of radius 10 and height 30, over these angles, with the tool outside.
    fn cylinder(v_rad: [f64; 2]) -> Surface {
        Surface::new(&SurfaceSpec::Revolved {
            radius_mm: [0.0, 0.0, 0.0, 10.0],
            height_mm: [0.0, 0.0, 30.0, 0.0],
            u: [0.0, 1.0],
            v_rad,
        })
    }

    /// A plane at this slope about the y axis: normal (-sin, 0, cos).
    fn plane(angle_deg: f64) -> Surface {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        let line = |x: f64, y: f64, z: f64| {
            [
                [0.0, 0.0, 10.0 * cos, x],
                [0.0, 0.0, 0.0, y],
                [0.0, 0.0, 10.0 * sin, z],
            ]
        };
        Surface::new(&SurfaceSpec::Ruled {
            rail0_mm: line(0.0, 0.0, 0.0),
            rail1_mm: line(0.0, 10.0, 0.0),
            u: [0.0, 1.0],
            v: [0.0, 1.0],
        })
    }

    /// Half a barrel, R = 10 + 8 u (1 - u): below its equator, at u = 1/2, it looks down.
    fn barrel() -> Surface {
        Surface::new(&SurfaceSpec::Revolved {
            radius_mm: [0.0, -8.0, 8.0, 10.0],
            height_mm: [0.0, 0.0, 20.0, 0.0],
            u: [0.0, 1.0],
            v_rad: [0.0, PI],
        })
    }

    fn outside(surface: &Surface) -> f64 {
        let at = surface.at(0.3, surface.domain()[1][0]);
        at.u.cross(at.v)
            .dot(DVec3::new(at.point.x, at.point.y, 0.0))
            .signum()
    }

    fn looks_up(surface: &Surface, sign: f64, turn: [f64; 3]) -> f64 {
        let [[u0, u1], [v0, v1]] = surface.domain();
        let mut least = f64::INFINITY;
        for i in 0..=50 {
            for j in 0..=50 {
                let part = |[low, high]: [f64; 2], k: i32| low + (high - low) * f64::from(k) / 50.0;
                let at = surface.at(part([u0, u1], i), part([v0, v1], j));
                let normal = at.u.cross(at.v) * sign;
                least = least.min((rotation(turn) * normal.normalize()).z);
            }
        }
        least
    }

    #[test]
    fn shares_of_area_that_look_down() {
        for (surface, sign, exact) in [
            (plane(0.0), 1.0, 0.0),
            (plane(0.0), -1.0, 1.0),
            (plane(80.0), 1.0, 0.0),
            (plane(100.0), 1.0, 1.0),
        ] {
            let found = facing(&surface, sign);
            assert_eq!((found.down_share, found.error_share), (exact, 0.0));
        }
        // The barrel is symmetric about its equator.
        let barrel = barrel();
        let found = facing(&barrel, outside(&barrel));
        assert!((found.down_share - 0.5).abs() <= found.error_share, "{found:?}");
        assert!(found.error_share < 0.01, "{found:?}");
        // Walls do not look down.
        let wall = cylinder([0.0, 1.0]);
        assert_eq!(facing(&wall, outside(&wall)).down_share, 0.0);
    }

    #[test]
    fn a_turn_is_found_where_there_is_one() {
        let half = Surface::new(&SurfaceSpec::Revolved {
            radius_mm: [0.0, 0.0, -8.0, 10.0],
            height_mm: [0.0, 0.0, -20.0, 0.0],
            u: [0.0, 1.0],
            v_rad: [0.3, 0.3 + PI],
        });
        for surface in [plane(100.0), plane(137.0), barrel(), half.clone()] {
            let sign = outside(&surface);
            let found = facing(&surface, sign);
            let turn = found.turn_deg.unwrap();
            let least = looks_up(&surface, sign, turn);
            assert!(least > -2e-7, "{turn:?}: {least}");
            assert!((least - found.turned_z_min).abs() < 2e-3, "{least} {found:?}");
        }
        // A plane lies nearly flat afterwards.
        assert!(facing(&plane(137.0), 1.0).turned_z_min > 0.9);
        // Half a cylinder can just be reached, more than that cannot.
        assert!(
            facing(&cylinder([0.0, PI]), outside(&cylinder([0.0, PI])))
                .turn_deg
                .is_some()
        );
        let wide = Surface::new(&SurfaceSpec::Revolved {
            radius_mm: [0.0, -8.0, 8.0, 10.0],
            height_mm: [0.0, 0.0, 20.0, 0.0],
            u: [0.0, 1.0],
            v_rad: [0.0, 1.2 * PI],
        });
        assert_eq!(facing(&wide, outside(&wide)).turn_deg, None);
    }

    #[test]
    fn turns_are_composed() {
        let near = |a: DMat3, b: DMat3| (a - b).to_cols_array().iter().all(|x| x.abs() < 1e-7);
        for first in [
            [0.0; 3],
            [90.0, 0.0, 0.0],
            [10.0, -75.0, 130.0],
            [0.0, 90.0, 20.0],
        ] {
            for then in [[0.0; 3], [180.0, 0.0, 0.0], [0.0, -90.0, 0.0], [33.0, 12.0, 0.0]] {
                let whole = turned_further(first, then);
                assert!(
                    near(rotation(whole), rotation(then) * rotation(first)),
                    "{first:?} {then:?}: {whole:?}"
                );
            }
        }
    }
}
