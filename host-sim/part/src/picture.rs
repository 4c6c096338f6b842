//! A face in cells, each with what becomes of it: for a picture.

use glam::DVec3;
use rayon::prelude::*;

use crate::inside::Inside;
use crate::region::Request;
use crate::tool::Reason;

/// State of a place of a face in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// In the region.
    Finished,
    /// Reached, but not in the region.
    Left,
    /// Not reached, by this rule.
    Unreachable(Reason),
}

impl Request<'_> {
    /// The trimmed face in `side` times `side` cells: the four corners of each, and what becomes of its middle; `region`: what is machined.
    #[must_use]
    pub fn picture(&self, region: &[Vec<[f64; 2]>], side: usize) -> Vec<(State, [DVec3; 4])> {
        let (trimmed, region) = (Inside::new(self.trimmed), Inside::new(region));
        let clearance = self.clearance();
        let places = || self.trimmed.iter().flatten();
        let ranges: [[f64; 2]; 2] = std::array::from_fn(|k| {
            places().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                [low.min(place[k]), high.max(place[k])]
            })
        });
        let at = |index: f64, [low, high]: [f64; 2]| low + index / side as f64 * (high - low);
        let cell = |index: usize| {
            let (i, j) = ((index / side) as f64, (index % side) as f64);
            let middle = [at(i + 0.5, ranges[0]), at(j + 0.5, ranges[1])];
            if !trimmed.contains(middle) {
                return None;
            }
            let state = match clearance.check(middle) {
                _ if region.contains(middle) => State::Finished,
                Ok(()) => State::Left,
                Err(reason) => State::Unreachable(reason),
            };
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[di, dj]| {
                let (u, v) = (at(i + di, ranges[0]), at(j + dj, ranges[1]));
                self.surface.at(u, v).point
            });
            Some((state, corners))
        };
        (0..side * side).into_par_iter().filter_map(cell).collect()
    }
}
