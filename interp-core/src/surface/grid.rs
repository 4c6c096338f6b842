//! A patch of a grid on one pass: cubics of the path parameter. The same for every kind of patch, so that the next one takes the
//! place of the last without being copied.

use super::lines::CoordinateCubics;
use super::pole::Reduced;
use super::rational::WEIGHT_ONE;
use super::{Edges, IsoLine};

/// What evaluates the cubics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum GridKind {
    /// A polynomial patch of which nothing is known to vanish.
    #[default]
    Free,
    /// Its second side derivative vanishes: ruled across the pass.
    Ruled,
    /// The mixed derivative too: every ruling is the same, and the surface an extrusion of its passes.
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
    /// Of a rational patch, or one with a pole.
    pub(super) weight: CoordinateCubics,
    /// Of a patch with a pole.
    pub(super) reduced: Reduced,
}

impl GridPass {
    /// Of no patch yet.
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
                self.weight = CoordinateCubics {
                    value: [WEIGHT_ONE, 0, 0, 0],
                    ..CoordinateCubics::NONE
                };
            }
            self.reduced.collapse(&self.axes, blocks, edges, at);
        }
    }
}
