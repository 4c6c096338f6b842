//! The stock as an obstacle: the box without the material that the ball clears.
//!
//! Seen from above, all material within the ball's radius of a position in contact counts as removed, at any time of the run. The rest of the box stands up to its full
//! height.

use std::cell::Cell;

use glam::DVec3;
use job::Block;

use super::path::PathTree;
use super::search::{Obstacle, Spot};

/// Cells per side with which the search begins.
const START: u32 = 32;
/// So much more than the ball's radius is cleared, mm: walls that the ball has made do not touch it.
const SLACK_MM: f64 = 1e-3;

/// The remaining stock, seen from above.
pub(super) struct StockObstacle<'a> {
    pub(super) block: &'a Block,
    /// Chords in contact.
    pub(super) cleared: &'a PathTree,
    pub(super) radius_mm: f64,
}

/// A rectangle: least corner and sides, mm.
pub(super) type Rectangle = [f64; 4];

impl StockObstacle<'_> {
    /// Distance of a place from the positions in contact, seen from above, if below a limit; else the limit.
    fn distance(&self, place: DVec3, limit: f64) -> f64 {
        let least = Cell::new(limit);
        self.cleared.walk(
            |bounds| -bounds.across(place),
            || -least.get(),
            |chord| {
                let off = (chord.at(chord.nearest(place)) - place).truncate();
                least.set(least.get().min(off.length()));
            },
        );
        least.get()
    }
}

impl Obstacle for StockObstacle<'_> {
    type Cell = Rectangle;

    fn start(&self) -> Vec<Rectangle> {
        let [x, y, _] = self.block.low_mm;
        let [wide, deep] = [0, 1].map(|k: usize| self.block.high_mm[k] - self.block.low_mm[k]);
        let (wide, deep) = (wide / f64::from(START), deep / f64::from(START));
        (0..START)
            .flat_map(|i| (0..START).map(move |j| (f64::from(i), f64::from(j))))
            .map(|(i, j)| [x + i * wide, y + j * deep, wide, deep])
            .collect()
    }

    fn spot(&self, &[x, y, wide, deep]: &Rectangle) -> Option<Spot> {
        let place = DVec3::new(x + 0.5 * wide, y + 0.5 * deep, self.block.low_mm[2]);
        let around_mm = 0.5 * wide.hypot(deep);
        let radius = self.radius_mm + SLACK_MM;
        let distance = self.distance(place, radius + around_mm);
        (distance + around_mm > radius).then_some(Spot {
            place,
            up_to: self.block.high_mm[2],
            around_mm,
            normal: Some(DVec3::Z),
            curvature: 0.0,
            counts: distance >= radius,
        })
    }

    fn split(&self, &[x, y, wide, deep]: &Rectangle, into: &mut Vec<Rectangle>) {
        let (wide, deep) = (0.5 * wide, 0.5 * deep);
        for (i, j) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)] {
            into.push([x + i * wide, y + j * deep, wide, deep]);
        }
    }
}
