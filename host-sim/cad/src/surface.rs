//! Surfaces of CAD files, evaluated from their original parameters.

use glam::DVec3;
use oracle::Derivatives;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};

use super::curve::Curve;
use super::placement::Placement;
use super::spline::{SplineCurve, SplineSurface};
use super::sweeps::axis_crossings;

/// Step of a difference quotient, as a share of the range; only for second derivatives of offset surfaces.
const DIFFERENCE: f64 = 1e-5;

/// A surface, its parameters as in STEP (ISO 10303-42). Lengths in mm. The frames' vectors are orthogonal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Surface {
    /// `origin + u x + v y`.
    Plane {
        /// Point at (0, 0).
        origin: DVec3,
        /// S_u.
        x: DVec3,
        /// S_v.
        y: DVec3,
    },
    /// `origin + cos u x + sin u y + v z`; with a slope, both radii grow: `(1 + slope v)`.
    Cylinder {
        /// On the axis.
        origin: DVec3,
        /// Radius vector at u = 0.
        x: DVec3,
        /// Radius vector at u = 90 degrees.
        y: DVec3,
        /// Along the axis.
        z: DVec3,
    },
    /// `origin + (radius + slope v) (cos u x + sin u y) + v z`.
    Cone {
        /// On the axis.
        origin: DVec3,
        /// Direction at u = 0, of length 1 times the placement's scale.
        x: DVec3,
        /// Direction at u = 90 degrees.
        y: DVec3,
        /// Along the axis.
        z: DVec3,
        /// Radius at v = 0.
        radius: f64,
        /// Increase of the radius per unit of v.
        slope: f64,
    },
    /// `center + cos v (cos u x + sin u y) + sin v z`.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius vector at (0, 0).
        x: DVec3,
        /// Radius vector at (90 degrees, 0).
        y: DVec3,
        /// Radius vector to the pole.
        z: DVec3,
    },
    /// `center + (major + minor cos v) (cos u x + sin u y) + minor sin v z`.
    Torus {
        /// Centre.
        center: DVec3,
        /// Direction at u = 0.
        x: DVec3,
        /// Direction at u = 90 degrees.
        y: DVec3,
        /// Along the axis.
        z: DVec3,
        /// Radius of the ring.
        major: f64,
        /// Radius of the tube.
        minor: f64,
    },
    /// Surface of revolution of a curve (parameter v) by the angle u.
    Revolution {
        /// The curve and its range.
        profile: Curve,
        /// Range of its parameter.
        range: [f64; 2],
        /// On the axis.
        origin: DVec3,
        /// Along the axis, of length 1.
        axis: DVec3,
    },
    /// Extrusion of a curve (parameter u) along v times a vector.
    Extrusion {
        /// The curve.
        profile: Curve,
        /// Range of its parameter; `None` for an unbounded curve.
        range: Option<[f64; 2]>,
        /// S_v.
        direction: DVec3,
    },
    /// `(1 - v) first(u) + v second(u)`, both curves on [0, 1].
    Ruled {
        /// At v = 0.
        first: SplineCurve,
        /// At v = 1.
        second: SplineCurve,
    },
    /// A B-spline.
    Spline(SplineSurface),
    /// A surface at a distance along the normal `S_u x S_v` of another.
    Offset {
        /// The base surface.
        base: Box<Surface>,
        /// Distance, mm; its sign is the side.
        distance: f64,
    },
}

impl Surface {
    /// Name of the kind in texts.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Plane { .. } => "plane",
            Self::Cylinder { .. } => "cylinder",
            Self::Cone { .. } => "cone",
            Self::Sphere { .. } => "sphere",
            Self::Torus { .. } => "torus",
            Self::Revolution { .. } => "revolution",
            Self::Extrusion { .. } => "extrusion",
            Self::Ruled { .. } => "ruled",
            Self::Spline(spline) if spline.rational() => "rational B-spline",
            Self::Spline(_) => "B-spline",
            Self::Offset { .. } => "offset",
        }
    }

    /// The surface, transformed; `None` if the placement is not a similarity and the kind of surface requires one.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Option<Self> {
        let (p, d) = (|a: &DVec3| by.point(*a), |a: &DVec3| by.vector(*a));
        Some(match self {
            Self::Plane { origin, x, y } => Self::Plane {
                origin: p(origin),
                x: d(x),
                y: d(y),
            },
            Self::Cylinder { origin, x, y, z } => Self::Cylinder {
                origin: p(origin),
                x: d(x),
                y: d(y),
                z: d(z),
            },
            Self::Cone {
                origin,
                x,
                y,
                z,
                radius,
                slope,
            } => Self::Cone {
                origin: p(origin),
                x: d(x),
                y: d(y),
                z: d(z),
                radius: *radius,
                slope: *slope,
            },
            Self::Sphere { center, x, y, z } => Self::Sphere {
                center: p(center),
                x: d(x),
                y: d(y),
                z: d(z),
            },
            Self::Torus {
                center,
                x,
                y,
                z,
                major,
                minor,
            } => Self::Torus {
                center: p(center),
                x: d(x),
                y: d(y),
                z: d(z),
                major: *major,
                minor: *minor,
            },
            Self::Revolution {
                profile,
                range,
                origin,
                axis,
            } => {
                let size = by.similarity()?;
                // A reflection reverses the rotation about the reflected axis.
                let turn = if by.mirrors() { -1.0 } else { 1.0 };
                Self::Revolution {
                    profile: profile.placed(by),
                    range: *range,
                    origin: p(origin),
                    axis: d(axis) * (turn / size),
                }
            }
            Self::Extrusion {
                profile,
                range,
                direction,
            } => Self::Extrusion {
                profile: profile.placed(by),
                range: *range,
                direction: d(direction),
            },
            Self::Ruled { first, second } => Self::Ruled {
                first: first.placed(by),
                second: second.placed(by),
            },
            Self::Spline(spline) => Self::Spline(spline.placed(by)),
            Self::Offset { base, distance } => {
                let turn = if by.mirrors() { -1.0 } else { 1.0 };
                Self::Offset {
                    base: Box::new(base.placed(by)?),
                    distance: distance * by.similarity()? * turn,
                }
            }
        })
    }

    /// Ranges of u and v; `None` if unbounded.
    #[must_use]
    pub fn domain(&self) -> [Option<[f64; 2]>; 2] {
        let turn = Some([0.0, TAU]);
        match self {
            Self::Plane { .. } => [None, None],
            Self::Cylinder { .. } | Self::Cone { .. } => [turn, None],
            Self::Sphere { .. } => [turn, Some([-FRAC_PI_2, FRAC_PI_2])],
            Self::Torus { .. } => [turn, turn],
            Self::Revolution { range, .. } => [turn, Some(*range)],
            Self::Extrusion { range, .. } => [*range, None],
            Self::Ruled { .. } => [Some([0.0, 1.0]); 2],
            Self::Spline(spline) => spline.domain().map(Some),
            Self::Offset { base, .. } => base.domain(),
        }
    }

    /// Periods of u and of v of a closed surface.
    #[must_use]
    pub fn periods(&self) -> [Option<f64>; 2] {
        match self {
            Self::Cylinder { .. } | Self::Cone { .. } | Self::Sphere { .. } => [Some(TAU), None],
            Self::Torus { .. } => [Some(TAU), Some(TAU)],
            Self::Revolution { profile, .. } => [Some(TAU), profile.period()],
            Self::Extrusion { profile, .. } => [profile.period(), None],
            Self::Plane { .. } | Self::Ruled { .. } => [None, None],
            Self::Spline(spline) => closed(spline),
            Self::Offset { base, .. } => base.periods(),
        }
    }

    /// Range of parameter k without a point in which a surface of revolution meets its axis within it, around a place; unbounded where there is none.
    pub(super) fn between_points(&self, k: usize, place: f64) -> [f64; 2] {
        match self {
            Self::Cone { radius, slope, .. } if k == 1 && *slope != 0.0 => {
                let apex = -radius / slope;
                if place < apex {
                    [f64::NEG_INFINITY, apex]
                } else {
                    [apex, f64::INFINITY]
                }
            }
            Self::Torus { major, minor, .. } if k == 1 && *minor > 0.0 && *minor >= major.abs() => {
                // On one side of the axis between -first and first, on the other from first to a turn less.
                let first = (-major / minor).acos();
                let turns = ((place + first) / TAU).floor() * TAU;
                if place - turns < first {
                    [turns - first, turns + first]
                } else {
                    [turns + first, turns + TAU - first]
                }
            }
            Self::Revolution {
                profile,
                range,
                origin,
                axis,
            } if k == 1 => {
                let points = axis_crossings(profile, *range, *origin, *axis);
                // Those of a closed profile are met again a period further.
                let all: Vec<f64> = match profile.period() {
                    Some(period) => [-2.0, -1.0, 0.0, 1.0, 2.0]
                        .iter()
                        .flat_map(|turn| points.iter().map(move |point| point + turn * period))
                        .collect(),
                    None => points,
                };
                all.into_iter()
                    .fold([f64::NEG_INFINITY, f64::INFINITY], |[low, high], point| {
                        if point <= place {
                            [low.max(point), high]
                        } else {
                            [low, high.min(point)]
                        }
                    })
            }
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// Parameters of direction k (0: u, 1: v) inside a range at which the surface or one of its first two derivatives may jump.
    #[must_use]
    pub fn joints(&self, k: usize, range: [f64; 2]) -> Vec<f64> {
        super::exact::joints(self, k, range)
            .into_iter()
            .map(|(t, _)| t)
            .collect()
    }

    /// S and its derivatives, with parameters that may lie one period beyond the seam of a closed B-spline.
    #[must_use]
    pub fn at_periodic(&self, u: f64, v: f64) -> Derivatives {
        let inside =
            |t: f64, range: Option<[f64; 2]>| range.is_none_or(|[start, end]| t >= start && t <= end);
        let [range_u, range_v] = self.domain();
        // Whether a B-spline is closed matters beyond its domain alone.
        if inside(u, range_u) && inside(v, range_v) {
            self.at(u, v)
        } else {
            Periodic::new(self).at(u, v)
        }
    }

    /// S and its derivatives.
    #[must_use]
    pub fn at(&self, u: f64, v: f64) -> Derivatives {
        match self {
            Self::Plane { origin, x, y } => Derivatives {
                point: *origin + (*x * u + *y * v),
                u: *x,
                v: *y,
                ..Derivatives::default()
            },
            Self::Cylinder { origin, x, y, z } => {
                turned(*origin, [*x, *y, *z], u, [1.0, 0.0, 0.0], [v, 1.0, 0.0])
            }
            Self::Cone {
                origin,
                x,
                y,
                z,
                radius,
                slope,
            } => turned(
                *origin,
                [*x, *y, *z],
                u,
                [radius + slope * v, *slope, 0.0],
                [v, 1.0, 0.0],
            ),
            Self::Sphere { center, x, y, z } => {
                let (sin, cos) = v.sin_cos();
                turned(*center, [*x, *y, *z], u, [cos, -sin, -cos], [sin, cos, -sin])
            }
            Self::Torus {
                center,
                x,
                y,
                z,
                major,
                minor,
            } => {
                let (sin, cos) = v.sin_cos();
                let (sin, cos) = (minor * sin, minor * cos);
                turned(
                    *center,
                    [*x, *y, *z],
                    u,
                    [major + cos, -sin, -cos],
                    [sin, cos, -sin],
                )
            }
            Self::Revolution {
                profile,
                origin,
                axis,
                ..
            } => revolved(&profile.at(v), *origin, *axis, u),
            Self::Extrusion {
                profile, direction, ..
            } => {
                let [point, first, second] = profile.at(u);
                Derivatives {
                    point: point + *direction * v,
                    u: first,
                    v: *direction,
                    uu: second,
                    ..Derivatives::default()
                }
            }
            Self::Ruled { first, second } => {
                let (a, b) = (first.at(u), second.at(u));
                let mixed = |k: usize| a[k] * (1.0 - v) + b[k] * v;
                Derivatives {
                    point: mixed(0),
                    u: mixed(1),
                    v: b[0] - a[0],
                    uu: mixed(2),
                    uv: b[1] - a[1],
                    vv: DVec3::ZERO,
                }
            }
            Self::Spline(spline) => spline.at(u, v),
            Self::Offset { base, distance } => self.offset(base, *distance, u, v),
        }
    }

    /// Point and first derivatives of an offset surface from the derivatives of its base; second derivatives by differences.
    fn offset(&self, base: &Surface, distance: f64, u: f64, v: f64) -> Derivatives {
        let moved = |u: f64, v: f64| {
            let at = base.at(u, v);
            let normal = at.u.cross(at.v);
            let area = normal.length();
            let unit = normal * (1.0 / area);
            let slope = |a: DVec3| (a - unit * a.dot(unit)) * (distance / area);
            let along_u = slope(at.uu.cross(at.v) + at.u.cross(at.uv));
            let along_v = slope(at.uv.cross(at.v) + at.u.cross(at.vv));
            [at.point + unit * distance, at.u + along_u, at.v + along_v]
        };
        let [point, first_u, first_v] = moved(u, v);
        let [step_u, step_v] = self
            .domain()
            .map(|range| range.map_or(DIFFERENCE, |r| DIFFERENCE * (r[1] - r[0])));
        let quotient = |a: DVec3, b: DVec3, step: f64| (a - b) * (0.5 / step);
        let (after_u, before_u) = (moved(u + step_u, v), moved(u - step_u, v));
        let (after_v, before_v) = (moved(u, v + step_v), moved(u, v - step_v));
        Derivatives {
            point,
            u: first_u,
            v: first_v,
            uu: quotient(after_u[1], before_u[1], step_u),
            uv: quotient(after_v[1], before_v[1], step_v),
            vv: quotient(after_v[2], before_v[2], step_v),
        }
    }
}

/// A surface for evaluation at many points: domain and periods are computed once, because dozens of points decide whether a B-spline is closed. Parameters may lie up to one
/// period beyond the seam of a closed B-spline, whose polynomials end there.
pub struct Periodic<'s> {
    pub(super) surface: &'s Surface,
    /// Ranges of u and v; `None` if unbounded.
    pub(super) domain: [Option<[f64; 2]>; 2],
    /// Periods of u and of v of a closed surface.
    pub(super) periods: [Option<f64>; 2],
    /// Domain of the parameters that are wrapped.
    wrapped: [Option<[f64; 2]>; 2],
}

impl<'s> Periodic<'s> {
    /// Of a surface.
    #[must_use]
    pub fn new(surface: &'s Surface) -> Self {
        let (domain, periods) = (surface.domain(), surface.periods());
        let mut base = surface;
        while let Surface::Offset { base: inner, .. } = base {
            base = inner;
        }
        let wrapped = match base {
            Surface::Spline(_) => std::array::from_fn(|k| periods[k].and(domain[k])),
            _ => [None, None],
        };
        Self {
            surface,
            domain,
            periods,
            wrapped,
        }
    }

    /// S and its derivatives.
    #[must_use]
    pub fn at(&self, u: f64, v: f64) -> Derivatives {
        let inside = |t: f64, range: Option<[f64; 2]>| match range {
            Some([start, end]) if t < start || t > end => start + (t - start).rem_euclid(end - start),
            _ => t,
        };
        self.surface
            .at(inside(u, self.wrapped[0]), inside(v, self.wrapped[1]))
    }
}

/// Surface of revolution of a profile `(radius, height)` with derivatives in v, by the angle u in a frame.
fn turned(origin: DVec3, [x, y, z]: [DVec3; 3], u: f64, radius: [f64; 3], height: [f64; 3]) -> Derivatives {
    let (sin, cos) = u.sin_cos();
    let out = x * cos + y * sin;
    let along = x * -sin + y * cos;
    let profile = |k: usize| out * radius[k] + z * height[k];
    Derivatives {
        point: origin + profile(0),
        u: along * radius[0],
        v: profile(1),
        uu: out * -radius[0],
        uv: along * radius[1],
        vv: profile(2),
    }
}

/// Point and derivatives of a curve, rotated about an axis by u.
fn revolved(profile: &[DVec3; 3], origin: DVec3, axis: DVec3, u: f64) -> Derivatives {
    let (sin, cos) = u.sin_cos();
    // The rotated vector and its first and second derivative by u.
    let turn = |p: DVec3| {
        let along = axis * p.dot(axis);
        let (out, side) = (p - along, axis.cross(p));
        [
            along + (out * cos + side * sin),
            out * -sin + side * cos,
            out * -cos + side * -sin,
        ]
    };
    let [point, u1, u2] = turn(profile[0] - origin);
    let [v1, uv, _] = turn(profile[1]);
    let [v2, _, _] = turn(profile[2]);
    Derivatives {
        point: origin + point,
        u: u1,
        v: v1,
        uu: u2,
        uv,
        vv: v2,
    }
}

/// Periods of a B-spline surface whose opposite boundaries coincide.
fn closed(spline: &SplineSurface) -> [Option<f64>; 2] {
    let [[u0, u1], [v0, v1]] = spline.domain();
    let size = {
        let (a, b) = (
            spline.at(u0, v0).point,
            spline.at(0.5 * (u0 + u1), 0.5 * (v0 + v1)).point,
        );
        a.distance(b).max(1.0)
    };
    let same = |a: DVec3, b: DVec3| a.distance(b) <= 1e-9 * size;
    let share = |k: usize, range: [f64; 2]| range[0] + (range[1] - range[0]) * k as f64 / 8.0;
    let in_u = (0..=8).all(|k| {
        let v = share(k, [v0, v1]);
        same(spline.at(u0, v).point, spline.at(u1, v).point)
    });
    let in_v = (0..=8).all(|k| {
        let u = share(k, [u0, u1]);
        same(spline.at(u, v0).point, spline.at(u, v1).point)
    });
    [in_u.then_some(u1 - u0), in_v.then_some(v1 - v0)]
}
