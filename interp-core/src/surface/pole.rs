//! A patch, polynomial or rational, with a boundary that collapses into a point, on one pass.
//!
//! A polynomial patch is taken as a rational one of weight 1. Where the boundary lies beside the pass, A vanishes all
//! along it, and the reduced numerators `P̃` (divided by the root across) stand for P in Ã and its derivative. Where it lies at an end
//! of the pass, B vanishes there, and so does its second side derivative; they are divided by the root along the pass, and the
//! quotient rule takes the reduced point.

use super::lines::{Line, quotient_across, quotient_along};
use super::range::{Edges, Root};
use super::rational::{WEIGHT_ONE, Weight, quarter};
use super::{Contact, Factors, Local, Pass, PassLine, PathSpeed, path_factor};
use crate::arith::{centred, centred_to_f32, cubic, jet, mul_hi};
use crate::fault::Result;
use crate::offset::Ball;

/// Which derivative of the pass is reduced by a root.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Pole {
    /// A vanishes all along the boundary beside the pass.
    #[default]
    Beside,
    /// B vanishes at an end of the pass.
    AtEnd(Root),
}

/// One coordinate: its cubics, and the reduced numerator.
#[derive(Clone, Copy, Debug, Default)]
struct PoleLine {
    line: Line,
    /// P divided by the root; 0 for a polynomial patch with its pole at an end, where it is not needed.
    reduced: [i32; 4],
    /// P_side and half of P_side,side, divided by the root where that is at an end.
    side: [i32; 4],
    side2: [i32; 4],
}

/// The patch on one pass.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PolePass {
    axes: [PoleLine; 3],
    weight: Line,
    pole: Pole,
    path_factor: f32,
    inverse_path_factor: f32,
}

impl PolePass {
    /// Collapses a patch with a pole; `blocks` are three coordinates, and the weight if it is rational.
    pub(crate) fn collapse(&mut self, blocks: &[[i32; 16]], edges: Edges, at: &PassLine) {
        self.pole = match edges.path_root(at.reversed) {
            Some(root) if edges.side_root().is_none() => Pole::AtEnd(root),
            _ => Pole::Beside,
        };
        (self.path_factor, self.inverse_path_factor) = path_factor(edges, at);
        let mut rest = blocks.iter();
        for (axis, block) in self.axes.iter_mut().zip(&mut rest) {
            axis.line.collapse(block, at);
            axis.side = axis.line.side;
            axis.side2 = axis.line.side2;
            match (self.pole, edges.side_root()) {
                (Pole::AtEnd(root), _) => {
                    axis.reduced = quotient_along(&axis.line.value, root);
                    axis.side = quotient_along(&axis.line.side, root);
                    axis.side2 = quotient_along(&axis.line.side2, root);
                }
                (Pole::Beside, Some(root)) => axis.reduced = quotient_across(block, root, at),
                (Pole::Beside, None) => {}
            }
        }
        match rest.next() {
            Some(block) => self.weight.collapse(block, at),
            None => {
                self.weight = Line {
                    value: [WEIGHT_ONE, 0, 0, 0],
                    ..Line::default()
                };
            }
        }
    }

    /// The whole pass is one point: the side boundary that it lies on collapses.
    pub(crate) fn is_point(&self) -> bool {
        self.path_factor <= 0.0
    }

    /// The parametrisation at a fraction of the patch.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        self.local(centred(fraction)).path_speed(self.inverse_path_factor)
    }

    fn local(&self, w: i32) -> Local {
        let weight = Weight::at(&self.weight, w);
        let axes = self.axes.each_ref().map(|axis| axis.at(self.pole, &weight, w));
        let [x, y, z] = axes;
        let [x0, x1, x2, xs, xm, xx] = x;
        let [y0, y1, y2, ys, ym, yy] = y;
        let [z0, z1, z2, zs, zm, zz] = z;
        Local {
            position: [x0, y0, z0],
            path: [x1, y1, z1],
            side: [xs, ys, zs],
            path2: [x2, y2, z2],
            mixed: [xm, ym, zm],
            side2: [xx, yy, zz],
            g: weight.g,
            inverse_g: weight.inverse_g,
            excess: weight.excess,
        }
    }
}

impl PoleLine {
    /// One coordinate of a [`Local`]: position, path, path2, side, mixed, side2.
    fn at(&self, pole: Pole, weight: &Weight, w: i32) -> [i32; 6] {
        let [value, path, path2] = jet(&self.line.value, w);
        let [reduced, reduced_path, reduced_path2] = jet(&self.reduced, w);
        let [_, mixed, _] = jet(&self.line.side, w);
        let (side, side2) = (cubic(&self.side, w), cubic(&self.side2, w));
        let s = weight.divide(value);
        // A quarter of the reduced point: whole it may be beyond i32.
        let part = weight.divide(reduced >> 2);
        let by_part = |numerator: i32, weight: i32| (numerator >> 2).wrapping_sub(mul_hi(part, weight) << 2);
        let mixed = quarter(mixed, s, weight.mixed);
        match pole {
            Pole::Beside => [
                s,
                by_part(reduced_path, weight.path),
                by_part(reduced_path2, weight.path2),
                quarter(side, s, weight.side),
                mixed,
                quarter(side2, s, weight.side2),
            ],
            Pole::AtEnd(_) => [
                s,
                quarter(path, s, weight.path),
                quarter(path2, s, weight.path2),
                by_part(side, weight.side),
                mixed,
                by_part(side2, weight.side2),
            ],
        }
    }
}

impl Pass for PolePass {
    #[inline(never)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let w = centred(fraction);
        let side = match self.pole {
            Pole::Beside => 1.0,
            Pole::AtEnd(root) => {
                let [offset, slope] = root.linear();
                offset + slope * centred_to_f32(w)
            }
        };
        let factors = Factors {
            path: self.path_factor,
            inverse_path: self.inverse_path_factor,
            side,
        };
        self.local(w).contact(ball, &factors)
    }
}
