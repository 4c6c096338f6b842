//! A patch, polynomial or rational, with a boundary that collapses into a point, on one pass.
//!
//! A polynomial patch is treated as a rational one of weight 1. Where the boundary lies beside the pass, A vanishes all
//! along it, and the reduced numerators `P̃` (divided by the root across) stand for P in Ã and its derivative. Where it lies at an end
//! of the pass, B vanishes there, and so does its second side derivative; they are divided by the root along the pass, and the
//! quotient rule uses the reduced point.

use super::Ball;
use super::grid::GridPass;
use super::lines::{CoordinateCubics, CoordinatePoint, quotient_across, quotient_along};
use super::range::{Edges, Root};
use super::rational::{Weight, quarter};
use super::{Contact, Factors, IsoLine, Local, Pass, PathSpeed, path_factor};
use crate::fault::Result;
use crate::math::arith::{centred, centred_to_f32, cubic, jet, mul_q30, quarter_of, subtract, tangent};

/// The derivative of the pass that is divided by a root.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Pole {
    /// A vanishes all along the boundary beside the pass.
    #[default]
    Beside,
    /// B vanishes at an end of the pass.
    AtEnd(Root),
}

/// One coordinate divided by the root.
#[derive(Clone, Copy, Debug, Default)]
struct ReducedCubics {
    /// P.
    value: [i32; 4],
    /// P_side and half of P_side,side: divided where the root is at an end of the pass, not divided where it is beside the pass.
    side: [i32; 4],
    side2: [i32; 4],
}

/// Additional data of a patch with a pole on a pass.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reduced {
    axes: [ReducedCubics; 3],
    pole: Pole,
    path_factor: f32,
    inverse_path_factor: f32,
}

/// A patch with a pole on one pass.
pub(crate) struct PolePass<'a>(pub(super) &'a GridPass);

impl Reduced {
    /// Placeholder before the first pole.
    pub(super) const NONE: Self = Self {
        axes: [ReducedCubics::NONE; 3],
        pole: Pole::Beside,
        path_factor: 1.0,
        inverse_path_factor: 1.0,
    };

    /// Divides the coordinates of a patch by the root of its flagged boundary.
    pub(super) fn collapse(
        &mut self,
        lines: &[CoordinateCubics; 3],
        blocks: &[[i32; 16]],
        edges: Edges,
        at: &IsoLine,
    ) {
        self.pole = Pole::of(edges, at);
        (self.path_factor, self.inverse_path_factor) = path_factor(edges, at);
        for ((axis, line), block) in self.axes.iter_mut().zip(lines).zip(blocks) {
            axis.reduce(line, block, self.pole, edges, at);
        }
    }
}

impl Pole {
    fn of(edges: Edges, at: &IsoLine) -> Self {
        match edges.path_root(at.reversed) {
            Some(root) if edges.side_root().is_none() => Self::AtEnd(root),
            _ => Self::Beside,
        }
    }
}

impl Pole {
    /// b of B = b B~.
    fn side_factor(self, w: i32) -> f32 {
        match self {
            Self::Beside => 1.0,
            Self::AtEnd(root) => {
                let [offset, slope] = root.linear();
                offset + slope * centred_to_f32(w)
            }
        }
    }
}

impl ReducedCubics {
    const NONE: Self = Self {
        value: [0; 4],
        side: [0; 4],
        side2: [0; 4],
    };

    /// Divides a coordinate by the root of the patch's flagged boundary.
    #[inline(always)]
    fn reduce(&mut self, line: &CoordinateCubics, block: &[i32; 16], pole: Pole, edges: Edges, at: &IsoLine) {
        if let Pole::AtEnd(root) = pole {
            self.value = quotient_along(&line.value, root);
            self.side = quotient_along(&line.side, root);
            self.side2 = quotient_along(&line.side2, root);
        } else {
            if let Some(root) = edges.side_root() {
                self.value = quotient_across(block, root, at);
            }
            self.side = line.side;
            self.side2 = line.side2;
        }
    }
}

/// The pole of a patch on a line of the side parameter, for an evaluation that collapses one coordinate at a time.
pub(super) struct PoleAt {
    pole: Pole,
    edges: Edges,
    path_factors: (f32, f32),
}

impl PoleAt {
    /// The pole of a patch with these collapsed boundaries, of which there is one.
    pub(super) fn new(edges: Edges, at: &IsoLine) -> Self {
        Self {
            pole: Pole::of(edges, at),
            edges,
            path_factors: path_factor(edges, at),
        }
    }

    /// One coordinate of a [`Local`]. A branch for each pole, in which the derivatives that it does not use are left out.
    #[inline(never)]
    pub(super) fn axis(&self, block: &[i32; 16], at: &IsoLine, weight: &Weight, w: i32) -> CoordinatePoint {
        let of = |pole: Pole| {
            let line = CoordinateCubics::at(block, at.side);
            let mut reduced = ReducedCubics::NONE;
            reduced.reduce(&line, block, pole, self.edges, at);
            let line = PoleLine {
                line: &line,
                reduced: &reduced,
                pole,
            };
            line.at(weight, w)
        };
        match self.pole {
            Pole::AtEnd(Root::Start) => of(Pole::AtEnd(Root::Start)),
            Pole::AtEnd(Root::End) => of(Pole::AtEnd(Root::End)),
            Pole::Beside => of(Pole::Beside),
        }
    }

    pub(super) fn factors(&self, w: i32) -> Factors {
        let (path, inverse_path) = self.path_factors;
        Factors {
            path,
            inverse_path,
            side: self.pole.side_factor(w),
        }
    }
}

impl PolePass<'_> {
    /// Whether the whole pass is one point: it lies on a collapsed side boundary.
    pub(crate) fn is_point(&self) -> bool {
        self.0.reduced.path_factor <= 0.0
    }

    /// The parametrisation at a fraction of the patch.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        let w = centred(fraction);
        let weight = Weight::new(self.0.weight.point(w));
        let [x, y, z] = self.axes();
        let along = |axis: &PoleLine<'_>| axis.along(&weight, w);
        let ([x1, x2], [y1, y2], [z1, z2]) = (along(&x), along(&y), along(&z));
        let gauge = weight.g * self.0.reduced.inverse_path_factor;
        PathSpeed::new(&[x1, y1, z1], &[x2, y2, z2], weight.excess, gauge)
    }

    #[inline(always)]
    fn axes(&self) -> [PoleLine<'_>; 3] {
        let ([x, y, z], [rx, ry, rz]) = (&self.0.axes, &self.0.reduced.axes);
        let pole = self.0.reduced.pole;
        [(x, rx), (y, ry), (z, rz)].map(|(line, reduced)| PoleLine { line, reduced, pole })
    }

    #[inline(always)]
    fn local(&self, w: i32) -> Local {
        let weight = Weight::new(self.0.weight.point(w));
        let [x, y, z] = self.axes();
        weight.local(x.at(&weight, w), y.at(&weight, w), z.at(&weight, w))
    }
}

/// One coordinate.
struct PoleLine<'a> {
    line: &'a CoordinateCubics,
    reduced: &'a ReducedCubics,
    pole: Pole,
}

impl PoleLine<'_> {
    /// Along the path: the first derivative and half the second, as [`Self::at`] has them.
    #[inline(always)]
    fn along(&self, weight: &Weight, w: i32) -> [i32; 2] {
        match self.pole {
            Pole::Beside => {
                let [reduced, path, path2] = jet(&self.reduced.value, w);
                let part = Part::new(reduced, weight);
                [part.rule(path, weight.path), part.rule(path2, weight.path2)]
            }
            Pole::AtEnd(_) => {
                let [value, path, path2] = jet(&self.line.value, w);
                let s = weight.divide(value);
                [quarter(path, s, weight.path), quarter(path2, s, weight.path2)]
            }
        }
    }

    /// One coordinate of a [`Local`].
    #[inline(always)]
    fn at(&self, weight: &Weight, w: i32) -> CoordinatePoint {
        let [value, path, path2] = jet(&self.line.value, w);
        let [reduced, reduced_path, reduced_path2] = jet(&self.reduced.value, w);
        let [_, mixed] = tangent(&self.line.side, w);
        let (side, side2) = (cubic(&self.reduced.side, w), cubic(&self.reduced.side2, w));
        let s = weight.divide(value);
        let part = Part::new(reduced, weight);
        let mixed = quarter(mixed, s, weight.mixed);
        match self.pole {
            Pole::Beside => [
                s,
                part.rule(reduced_path, weight.path),
                part.rule(reduced_path2, weight.path2),
                quarter(side, s, weight.side),
                mixed,
                quarter(side2, s, weight.side2),
            ],
            Pole::AtEnd(_) => [
                s,
                quarter(path, s, weight.path),
                quarter(path2, s, weight.path2),
                part.rule(side, weight.side),
                mixed,
                part.rule(side2, weight.side2),
            ],
        }
    }
}

/// A quarter of a coordinate of the reduced point, whose full value may exceed i32.
struct Part(i32);

impl Part {
    #[inline(always)]
    fn new(reduced: i32, weight: &Weight) -> Self {
        Self(weight.divide(quarter_of(reduced)))
    }

    /// [`quarter`] with the reduced point.
    #[inline(always)]
    fn rule(&self, numerator: i32, weight: i32) -> i32 {
        subtract(quarter_of(numerator), mul_q30(self.0, weight))
    }
}

impl PolePass<'_> {
    fn factors(&self, w: i32) -> Factors {
        Factors {
            path: self.0.reduced.path_factor,
            inverse_path: self.0.reduced.inverse_path_factor,
            side: self.0.reduced.pole.side_factor(w),
        }
    }
}

impl PolePass<'_> {
    /// The point at a fraction of the patch, with its factors.
    pub(super) fn local_at(&self, fraction: u64) -> (Local, Factors) {
        let w = centred(fraction);
        (self.local(w), self.factors(w))
    }
}

impl Pass for PolePass<'_> {
    #[inline(never)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let w = centred(fraction);
        self.local(w).contact::<true, true>(ball, &self.factors(w))
    }
}
