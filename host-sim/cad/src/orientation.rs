//! Orientation of solids: the normals of a closed shell point out of it if the volume that they enclose, by the divergence theorem, is positive.
//! A file may hold them the other way round.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::surface::{Periodic, Surface};
use super::{Boundary, Face, Polygon, outline, trim};

/// Precision of the trimmed regions, as a share of the size of the solid: the sign of the volume needs no more.
const TRIM_SHARE: f64 = 1e-3;
/// Largest integral of the unit normal over a closed shell, as a share of its area: 0, but for the precision of the integrals. A shell that lacks a
/// face, or has faces of both orientations, is above.
const OPEN_MAX: f64 = 0.01;
/// Least volume, as a share of area times size: a sheet of 0.3 mm by 1 m has more.
const VOLUME_MIN: f64 = 1e-4;
/// Largest number of pieces of a range of a parameter in an integral.
const PIECES_MAX: usize = 12;
/// Nodes and weights of Gauss' quadrature on [0, 1], of degree 5.
const GAUSS: [[f64; 2]; 3] = [
    [0.112_701_665_379_258_3, 5.0 / 18.0],
    [0.5, 8.0 / 18.0],
    [0.887_298_334_620_741_7, 5.0 / 18.0],
];

/// A solid of a file. Its faces are indices of [`super::Model::faces`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Solid {
    /// The faces of each shell: the outer one, and those of its voids.
    pub shells: Vec<Vec<usize>>,
    /// The faces of its copies in an assembly.
    pub copies: Vec<usize>,
}

/// Turns the normals of each solid that is inside out. Shells are turned together: a void stays one. A solid stays as it is where a shell is not
/// closed or a face cannot be traced.
pub(super) fn turn_outwards(faces: &mut [Face], solids: &[Solid]) {
    for solid in solids {
        if volume_mm3(faces, solid).is_some_and(|volume| volume < 0.0) {
            for index in solid.shells.iter().flatten().chain(&solid.copies) {
                if let Some(face) = faces.get_mut(*index) {
                    face.turn_over();
                }
            }
        }
    }
}

impl Face {
    /// Turns the normal; the material stays on the left of the edges.
    fn turn_over(&mut self) {
        self.sense = -self.sense;
        if let Boundary::Loops(loops) = &mut self.boundary {
            for edges in loops {
                edges.reverse();
                edges.iter_mut().for_each(|edge| edge.reverse());
            }
        }
    }
}

/// The volume in the outer shell of a solid, negative where normals point inwards; `None` where its sign is not certain.
fn volume_mm3(faces: &[Face], solid: &Solid) -> Option<f64> {
    let of_shell = |shell: &Vec<usize>| shell.iter().map(|index| faces.get(*index)).collect();
    let shells: Option<Vec<Vec<&Face>>> = solid.shells.iter().map(of_shell).collect();
    let volumes: Option<Vec<f64>> = shells?.iter().map(|shell| shell_volume_mm3(shell)).collect();
    // A void is smaller than what is around it.
    volumes?.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// The volume in a closed shell; 0 where it is too small to be certain, `None` where the shell is open.
fn shell_volume_mm3(faces: &[&Face]) -> Option<f64> {
    if faces
        .iter()
        .any(|face| matches!(face.boundary, Boundary::Unknown(_)))
    {
        return None;
    }
    let block = Block::around(faces);
    let size = block.size();
    let each: Option<Vec<Moments>> = faces
        .par_iter()
        .map(|face| moments(face, block.centre(), TRIM_SHARE * size))
        .collect();
    let mut all = Moments::default();
    for (moments, face) in each?.iter().zip(faces) {
        all.add(moments, face.sense);
    }
    let open = all.normal.length();
    if open.is_nan() || open > OPEN_MAX * all.area {
        return None;
    }
    let is_certain = all.volume.abs() > size * (open + VOLUME_MIN * all.area);
    Some(if is_certain { all.volume } else { 0.0 })
}

/// The box around the edges of a shell, or around its surfaces where there are none.
struct Block {
    least: DVec3,
    most: DVec3,
}

impl Block {
    fn around(faces: &[&Face]) -> Self {
        let mut block = Self {
            least: DVec3::INFINITY,
            most: DVec3::NEG_INFINITY,
        };
        for face in faces {
            match &face.boundary {
                Boundary::Loops(loops) => loops
                    .iter()
                    .flatten()
                    .flatten()
                    .for_each(|point| block.add(*point)),
                _ => block.add_surface(&face.surface),
            }
        }
        block
    }

    fn add(&mut self, point: DVec3) {
        (self.least, self.most) = (self.least.min(point), self.most.max(point));
    }

    fn add_surface(&mut self, surface: &Surface) {
        let [Some(u), Some(v)] = surface.domain() else {
            return;
        };
        let at = |[low, high]: [f64; 2], k: u32| low + (high - low) * f64::from(k) / 8.0;
        for (i, j) in (0..=8).flat_map(|i| (0..=8).map(move |j| (i, j))) {
            self.add(surface.at(at(u, i), at(v, j)).point);
        }
    }

    fn centre(&self) -> DVec3 {
        0.5 * (self.least + self.most)
    }

    fn size(&self) -> f64 {
        (self.most - self.least).length()
    }
}

/// Integrals over a surface.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    /// Of the unit normal.
    normal: DVec3,
    /// Of 1.
    area: f64,
    /// Of a third of the normal's distance from the centre.
    volume: f64,
}

impl Moments {
    fn add(&mut self, other: &Self, factor: f64) {
        self.normal += factor * other.normal;
        self.area += other.area;
        self.volume += factor * other.volume;
    }

    fn add_place(&mut self, at: &oracle::Derivatives, centre: DVec3, weight: f64) {
        let normal = at.u.cross(at.v);
        self.normal += weight * normal;
        self.area += weight * normal.length();
        self.volume += weight * normal.dot(at.point - centre) / 3.0;
    }
}

/// The integrals over the trimmed region of a face, its normal being `S_u x S_v`.
fn moments(face: &Face, centre: DVec3, tolerance_mm: f64) -> Option<Moments> {
    let outline = outline(face).ok()?;
    let polygons = trim(face, &outline, None, tolerance_mm).ok()?;
    let integral = Integral {
        on: Periodic::new(&face.surface),
        centre,
        pieces: [0, 1].map(|k| pieces(&face.surface, k, outline.rectangle[k])),
        rectangle: outline.rectangle,
    };
    let mut all = Moments::default();
    for (index, polygon) in polygons.iter().enumerate() {
        let is_around = |other: &(usize, &Polygon)| other.0 != index && contains(other.1, middle(polygon));
        let depth = polygons.iter().enumerate().filter(is_around).count();
        integral.add(polygon, if depth % 2 == 0 { 1.0 } else { -1.0 }, &mut all);
    }
    Some(all)
}

/// Into how many pieces a range of a parameter is cut for an integral.
fn pieces(surface: &Surface, k: usize, range: [f64; 2]) -> usize {
    match surface {
        Surface::Plane { .. } => 1,
        Surface::Cylinder { .. }
        | Surface::Cone { .. }
        | Surface::Extrusion { .. }
        | Surface::Ruled { .. }
            if k == 1 =>
        {
            1
        }
        _ => (surface.joints(k, range).len() + 1).clamp(4, PIECES_MAX),
    }
}

/// An integral over polygons of a surface's parameters.
struct Integral<'s> {
    on: Periodic<'s>,
    centre: DVec3,
    pieces: [usize; 2],
    rectangle: [[f64; 2]; 2],
}

impl Integral<'_> {
    /// Adds the integral over a polygon, times a sign. By Green's theorem: along the edges, of the integral along v.
    fn add(&self, polygon: &Polygon, sign: f64, all: &mut Moments) {
        let turn = if area(polygon) < 0.0 { sign } else { -sign };
        let next = polygon.iter().cycle().skip(1);
        let [low, high] = self.rectangle[0];
        for (a, b) in polygon.iter().zip(next) {
            let share = (b[0] - a[0]).abs() / (high - low);
            let pieces = (share * self.pieces[0] as f64).ceil().max(1.0);
            let mut from = 0.0;
            while from < pieces && share > 0.0 {
                for [node, weight] in GAUSS {
                    let at = (from + node) / pieces;
                    let [u, v] = [0, 1].map(|k| a[k] + at * (b[k] - a[k]));
                    self.add_line(u, v, turn * weight * (b[0] - a[0]) / pieces, all);
                }
                from += 1.0;
            }
        }
    }

    /// Adds the integral along v up to a place, times a weight.
    fn add_line(&self, u: f64, v: f64, weight: f64, all: &mut Moments) {
        let [low, high] = self.rectangle[1];
        let pieces = ((v - low).abs() / (high - low) * self.pieces[1] as f64)
            .ceil()
            .max(1.0);
        let step = (v - low) / pieces;
        let mut from = 0.0;
        while from < pieces {
            for [node, share] in GAUSS {
                let at = self.on.at(u, low + (from + node) * step);
                all.add_place(&at, self.centre, weight * share * step);
            }
            from += 1.0;
        }
    }
}

/// The area of a polygon, positive if its vertices turn from u to v.
fn area(polygon: &Polygon) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    let pieces = polygon.iter().zip(next);
    pieces.map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum()
}

/// The middle of the first edge.
fn middle(polygon: &Polygon) -> [f64; 2] {
    [0, 1].map(|k| 0.5 * (polygon[0][k] + polygon[1][k]))
}

/// Whether a place is within a polygon (even-odd rule).
fn contains(polygon: &Polygon, [u, v]: [f64; 2]) -> bool {
    let next = polygon.iter().cycle().skip(1);
    let crossed = polygon
        .iter()
        .zip(next)
        .filter(|(a, b)| (a[1] > v) != (b[1] > v) && u < a[0] + (v - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
    crossed.count() % 2 == 1
}
