//! A patch of a grid on one pass: cubics of the path parameter. One type for every kind of patch, so that the next patch replaces
//! the last without a copy.

use super::lines::CoordinateCubics;
use super::pole::Reduced;
use super::{Edges, IsoLine};

/// The evaluation routine of the cubics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum GridKind {
    /// A polynomial patch in which no derivative is known to be zero.
    #[default]
    Free,
    /// A polynomial patch with zero second side derivative: ruled across the pass.
    Ruled,
    /// A ruled patch with zero mixed derivative too: the rulings are parallel and equal, an extrusion of its passes.
    Extruded,
    /// A rational patch.
    Rational,
    /// A patch with a boundary that collapses.
    Pole,
}

/// A patch on one pass.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct GridPass {
    pub(super) kind: GridKind,
    pub(super) axes: [CoordinateCubics; 3],
    /// The weight of a rational patch or a patch with a pole.
    pub(super) weight: CoordinateCubics,
    /// The reduced coordinates of a patch with a pole.
    pub(super) reduced: Reduced,
}

impl GridPass {
    /// Placeholder before the first patch.
    pub(crate) const NONE: Self = Self {
        kind: GridKind::Free,
        axes: [CoordinateCubics::NONE; 3],
        weight: CoordinateCubics::NONE,
        reduced: Reduced::NONE,
    };

    /// Collapses a patch of three coordinates, and the weight if it is rational.
    pub(crate) fn collapse(&mut self, blocks: &[[i32; 16]], edges: Edges, at: &IsoLine) {
        let mut rest = blocks.iter();
        let (mut side2, mut mixed) = (0, 0);
        for (line, block) in self.axes.iter_mut().zip(&mut rest) {
            line.collapse(block, at);
            let ([_, s1, s2, s3], [h0, h1, h2, h3]) = (line.side, line.side2);
            mixed |= s1 | s2 | s3;
            side2 |= h0 | h1 | h2 | h3;
        }
        let weight = rest.next();
        self.kind = if edges.count() > 0 {
            GridKind::Pole
        } else if weight.is_some() {
            GridKind::Rational
        } else {
            match (side2, mixed) {
                (0, 0) => GridKind::Extruded,
                (0, _) => GridKind::Ruled,
                _ => GridKind::Free,
            }
        };
        if let Some(block) = weight {
            self.weight.collapse(block, at);
        }
        if self.kind == GridKind::Pole {
            if weight.is_none() {
                self.weight = CoordinateCubics::ONE;
            }
            self.reduced.collapse(&self.axes, blocks, edges, at);
        }
    }
}
