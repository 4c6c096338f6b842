//! Fixtures: the tool against boxes, exactly, chord by chord.

use glam::{DVec2, DVec3};
use job::Block;

use super::path::Chord;
use super::search::Shape;

/// Steps of the search along a chord: the golden ratio's power is below 1e-9.
const STEPS: usize = 44;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Largest depth of a box in a shape on the way along a chord, and the share of the way.
pub(super) fn deepest(block: &Block, shape: &Shape, chord: &Chord, floor_mm: f64) -> Option<(f64, f64)> {
    let at = |share: f64| depth(block, shape, chord.at(share));
    let ends = [at(0.0), at(1.0)];
    let length = chord.ends[0].distance(chord.ends[1]);
    // The depth changes by at most the way.
    if 0.5 * (ends[0] + ends[1] + length) <= floor_mm {
        return None;
    }
    // It is concave along the way: both bodies are convex.
    let (mut low, mut high) = (0.0, 1.0);
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut depths = inner.map(at);
    for _ in 0..STEPS {
        if depths[0] > depths[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            depths = [at(inner[0]), depths[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            depths = [depths[1], at(inner[1])];
        }
    }
    let found = [(ends[0], 0.0), (ends[1], 1.0), (depths[0], inner[0])];
    found.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Depth of a box in a shape with the ball's centre here, mm: the shortest horizontal or vertical motion that separates them; below zero their
/// distance.
pub(super) fn depth(block: &Block, shape: &Shape, centre: DVec3) -> f64 {
    let (low, high) = (DVec3::from(block.low_mm), DVec3::from(block.high_mm));
    let outside = (low - centre).max(centre - high);
    let across: DVec2 = outside.truncate();
    let rho = if across.max_element() > 0.0 {
        across.max(DVec2::ZERO).length()
    } else {
        across.max_element()
    };
    let heights = [low.z - centre.z, high.z - centre.z];
    match shape {
        // In the ball's case the nearest place of a box around the centre is on one of its six sides.
        Shape::Ball(radius) if outside.max_element() <= 0.0 => radius - outside.max_element(),
        Shape::Ball(_) => shape.depth(rho.max(0.0), heights),
        Shape::Solid(_) => shape.depth(rho, heights),
    }
}

/// The box's place nearest to the ball's centre.
pub(super) fn nearest(block: &Block, centre: DVec3) -> DVec3 {
    centre.clamp(block.low_mm.into(), block.high_mm.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reach::body::{Solid, ToolPart};

    #[test]
    fn boxes_at_known_distances() {
        let block = Block {
            low_mm: [10.0, -5.0, 0.0],
            high_mm: [20.0, 5.0, 30.0],
        };
        let shank = Shape::Solid(Solid {
            part: ToolPart::Shank,
            z: [0.0, 40.0],
            radius: [3.0; 2],
        });
        let ball = Shape::Ball(4.0);
        for (shape, centre, exact) in [
            (&shank, [6.0, 0.0, 10.0], -1.0),
            (&shank, [8.0, 0.0, 10.0], 1.0),
            // In the box: out by its nearest side.
            (&shank, [12.0, 0.0, 10.0], 5.0),
            (&shank, [6.0, 8.0, 10.0], 3.0 - 5.0),
            (&shank, [15.0, 0.0, 32.0], -2.0),
            (&shank, [15.0, 0.0, 29.5], 0.5),
            (&shank, [6.0, 0.0, 30.0 + 3.0], -(1.0_f64.hypot(3.0))),
            (&ball, [6.0, 0.0, 10.0], 0.0),
            (&ball, [15.0, 0.0, 33.0], 1.0),
            (&ball, [7.0, 9.0, 10.0], -1.0),
            (&ball, [15.0, 0.0, 29.0], 5.0),
        ] {
            let found = depth(&block, shape, centre.into());
            assert!((found - exact).abs() < 1e-12, "{shape:?} {centre:?}: {found}");
        }
        // Past the corner: the nearest point of the way is inside of it.
        let chord = Chord {
            ends: [DVec3::new(0.0, 0.0, 10.0), DVec3::new(10.0, 15.0, 10.0)],
            samples: [0, 10],
            in_contact: false,
        };
        let (found, share) = deepest(&block, &shank, &chord, f64::NEG_INFINITY).unwrap();
        // The corner (10, 5) is (15 * 10 - 10 * 5) / |way| from the way.
        let exact = 3.0 - 100.0 / 10.0_f64.hypot(15.0);
        assert!((found - exact).abs() < 1e-9, "{found} {exact} at {share}");
        assert!(deepest(&block, &shank, &chord, 20.0).is_none());
    }
}
