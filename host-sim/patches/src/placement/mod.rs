//! Placement of the surface on the machine: scale, rotation and translation, applied before all other processing.
//!
//! ```text
//! [placement] ─job-file/placement.rs─► Placement ─place─► SurfaceSpec of the placed surface ─► oracle, preparation
//!                                                  extent.rs  its bounding box, for `place` and the range check
//!                                                  arcs.rs    a revolved profile as a rational B-spline
//! ```
//!
//! A placement is a similarity: `p -> scale R p + t` with a proper rotation R: all lengths change by one factor, and the sign of
//! `S_u x S_v` refers to the same side. Polynomial and spline surfaces are placed by their coefficients and poles, exact to f64
//! rounding. A surface of revolution keeps its kind while its axis remains the z axis, upwards.

mod arcs;
mod extent;
mod rotation;

use std::fmt;

use job::units::POSITION_RANGE;
use job::{AXES, NurbsSpec, SurfaceSpec};

pub use extent::{EXTENT_TOLERANCE_MM, extent_mm};
pub use rotation::Rotation;

/// Range of positions of the core, mm in either direction: nanometres in an i32.
pub const POSITION_MAX_MM: f64 = 2_147.483_647;

/// The point of the scaled and rotated surface that is placed at `translate_mm`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Anchor {
    /// The origin of the surface's own coordinates.
    #[default]
    Origin,
    /// The centre of its box along x, y and z.
    Centre,
    /// The corner of its box with the least x, y and z.
    Corner,
    /// The middle of its box in x and y, at the highest z: the usual workpiece zero of stock.
    Top,
}

/// The operations on a surface, in this order: scale, rotate, translate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Scale factor about the origin; above 0.
    pub scale: f64,
    /// Rotations about x, then y, then z (fixed axes), degrees, right-handed.
    pub rotate_deg: [f64; 3],
    /// The point that is placed at `translate_mm`.
    pub anchor: Anchor,
    /// Position of the anchor, mm.
    pub translate_mm: [f64; 3],
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            scale: 1.0,
            rotate_deg: [0.0; 3],
            anchor: Anchor::Origin,
            translate_mm: [0.0; 3],
        }
    }
}

/// The placed surface exceeds the range of positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfMachineRange {
    /// The axis: 0 to 2.
    pub axis: usize,
    /// Extent of the surface along the axis, mm.
    pub reach_mm: [f64; 2],
    /// The surface is larger than the range: no translation helps.
    pub too_large: bool,
}

impl fmt::Display for OutOfMachineRange {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [least, most] = self.reach_mm;
        let axis = AXES.get(self.axis).copied().unwrap_or("?");
        write!(
            out,
            "the placed surface extends from {axis} = {least:.3} to {most:.3} mm; {POSITION_RANGE}"
        )
    }
}

impl std::error::Error for OutOfMachineRange {}

/// `p -> linear p + shift`.
#[derive(Clone, Copy)]
struct Affine {
    linear: [[f64; 3]; 3],
    shift: [f64; 3],
}

impl Affine {
    fn vector(&self, p: [f64; 3]) -> [f64; 3] {
        self.linear
            .map(|row| row.iter().zip(p).map(|(entry, value)| entry * value).sum())
    }

    fn point(&self, p: [f64; 3]) -> [f64; 3] {
        let turned = self.vector(p);
        std::array::from_fn(|k| turned[k] + self.shift[k])
    }
}

impl Placement {
    /// The placed surface.
    ///
    /// # Errors
    /// [`OutOfMachineRange`] where the surface exceeds the range of positions.
    pub fn place(&self, surface: &SurfaceSpec) -> Result<SurfaceSpec, OutOfMachineRange> {
        let rotation = Rotation::of_degrees(self.rotate_deg);
        let turned = self.turned(surface, rotation);
        let extent = extent_mm(&turned);
        let mut shift = self.translate_mm;
        for (axis, [least, most]) in extent.into_iter().enumerate() {
            shift[axis] += match self.anchor {
                Anchor::Origin => 0.0,
                Anchor::Centre => centring(least, most),
                Anchor::Corner => -least,
                Anchor::Top if axis == 2 => -most,
                Anchor::Top => centring(least, most),
            };
            let reach_mm = [least + shift[axis], most + shift[axis]];
            if !(reach_mm[0] >= -POSITION_MAX_MM && reach_mm[1] <= POSITION_MAX_MM) {
                let too_large = most - least > 2.0 * POSITION_MAX_MM;
                return Err(OutOfMachineRange {
                    axis,
                    reach_mm,
                    too_large,
                });
            }
        }
        let linear = Rotation::IDENTITY.0;
        Ok(moved(&turned, &Affine { linear, shift }))
    }

    /// Scale and rotation, without the translation.
    fn turned(&self, surface: &SurfaceSpec, rotation: Rotation) -> SurfaceSpec {
        let linear = rotation.0.map(|row| row.map(|entry| self.scale * entry));
        let affine = Affine {
            linear,
            shift: [0.0; 3],
        };
        match (surface, rotation.about_z_rad()) {
            (
                SurfaceSpec::Revolved {
                    radius_mm,
                    height_mm,
                    u,
                    v_rad,
                },
                Some(angle),
            ) => SurfaceSpec::Revolved {
                radius_mm: radius_mm.map(|c| self.scale * c),
                height_mm: height_mm.map(|c| self.scale * c),
                u: *u,
                v_rad: v_rad.map(|v| v + angle),
            },
            _ => moved(surface, &affine),
        }
    }
}

/// The shift that centres a range at 0; 0 where the range is centred within the tolerance, so that a surface of revolution stays on
/// its axis.
fn centring(least: f64, most: f64) -> f64 {
    let middle = 0.5 * (least + most);
    if middle.abs() <= EXTENT_TOLERANCE_MM {
        0.0
    } else {
        -middle
    }
}

/// A surface under an affine map; a surface of revolution keeps its kind under a translation along z alone.
fn moved(surface: &SurfaceSpec, map: &Affine) -> SurfaceSpec {
    match surface {
        SurfaceSpec::Revolved {
            radius_mm,
            height_mm,
            u,
            v_rad,
        } => {
            let [x, y, z] = map.shift;
            if map.linear == Rotation::IDENTITY.0 && x == 0.0 && y == 0.0 {
                let [c3, c2, c1, c0] = *height_mm;
                return SurfaceSpec::Revolved {
                    radius_mm: *radius_mm,
                    height_mm: [c3, c2, c1, c0 + z],
                    u: *u,
                    v_rad: *v_rad,
                };
            }
            SurfaceSpec::Nurbs(moved_nurbs(arcs::revolved(radius_mm, height_mm, *u, *v_rad), map))
        }
        SurfaceSpec::Ruled {
            rail0_mm,
            rail1_mm,
            u,
            v,
        } => SurfaceSpec::Ruled {
            rail0_mm: moved_cubic(rail0_mm, map),
            rail1_mm: moved_cubic(rail1_mm, map),
            u: *u,
            v: *v,
        },
        SurfaceSpec::Bicubic {
            coefficients_mm,
            u,
            v,
        } => {
            let mut placed = *coefficients_mm;
            for i in 0..4 {
                let row = moved_cubic(
                    &coefficients_mm.map(|axis| axis[i]),
                    &Affine {
                        linear: map.linear,
                        shift: if i == 3 { map.shift } else { [0.0; 3] },
                    },
                );
                for (axis, cubic) in placed.iter_mut().zip(row) {
                    axis[i] = cubic;
                }
            }
            SurfaceSpec::Bicubic {
                coefficients_mm: placed,
                u: *u,
                v: *v,
            }
        }
        SurfaceSpec::Nurbs(nurbs) => SurfaceSpec::Nurbs(moved_nurbs(nurbs.clone(), map)),
    }
}

/// A space cubic, `[k]` highest power first: the constant term is mapped as a point, the others as vectors.
fn moved_cubic(cubic: &[[f64; 4]; 3], map: &Affine) -> [[f64; 4]; 3] {
    let [x, y, z] = cubic;
    let mut placed = *cubic;
    for power in 0..4 {
        let coefficient = [x[power], y[power], z[power]];
        let turned = if power == 3 {
            map.point(coefficient)
        } else {
            map.vector(coefficient)
        };
        for (axis, value) in placed.iter_mut().zip(turned) {
            axis[power] = value;
        }
    }
    placed
}

fn moved_nurbs(mut nurbs: NurbsSpec, map: &Affine) -> NurbsSpec {
    for pole in nurbs.poles_mm.iter_mut().flatten() {
        let [x, y, z, w] = *pole;
        let [x, y, z] = map.point([x, y, z]);
        *pole = [x, y, z, w];
    }
    nurbs
}

#[cfg(test)]
mod tests;
