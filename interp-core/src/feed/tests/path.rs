//! Paths in closed form, and the plan of one.

use std::boxed::Box;
use std::vec::Vec;

use crate::feed::deadlines::Deadlines;
use crate::feed::limits::MotionLimits;
use crate::feed::plan::Plan;
use crate::feed::planner::Planner;
use crate::feed::stations::Station;

/// A path: position and its derivatives by arc, in pieces with a jump between them.
pub(super) struct Path {
    /// Arc at the start of each piece, and at the end.
    pub(super) ends: Vec<f64>,
    /// The piece's value or derivative of this order at an arc.
    of: Box<dyn Fn(usize, f64, usize) -> [f64; 3]>,
}

impl Path {
    fn smooth(length: f64, of: impl Fn(f64, usize) -> [f64; 3] + 'static) -> Self {
        Self {
            ends: std::vec![0.0, length],
            of: Box::new(move |_, s, order| of(s, order)),
        }
    }

    pub(super) fn straight(length: f64) -> Self {
        Self::smooth(length, |s, order| match order {
            0 => [s, 0.0, 0.0],
            1 => [1.0, 0.0, 0.0],
            _ => [0.0; 3],
        })
    }

    /// Around a circle.
    pub(super) fn circle(length: f64, radius: f64) -> Self {
        Self::smooth(length, move |s, order| {
            let scale = radius.powi(1 - order as i32);
            let angle = s / radius + order as f64 * std::f64::consts::FRAC_PI_2;
            [scale * angle.cos(), scale * angle.sin(), 0.0]
        })
    }

    /// Straight, an arc, straight, an arc to the other side: the curvature jumps.
    pub(super) fn slalom(pieces: usize, length: f64, radius: f64) -> Self {
        let mut starts: Vec<([f64; 2], f64)> = std::vec![([0.0; 2], 0.0)];
        let bend = move |piece: usize| match piece % 4 {
            1 => 1.0 / radius,
            3 => -1.0 / radius,
            _ => 0.0,
        };
        let along = |([x, y], angle): ([f64; 2], f64), k: f64, s: f64| {
            let turned = angle + k * s;
            if k == 0.0 {
                ([x + s * angle.cos(), y + s * angle.sin()], angle)
            } else {
                let (dx, dy) = ((turned.sin() - angle.sin()) / k, (angle.cos() - turned.cos()) / k);
                ([x + dx, y + dy], turned)
            }
        };
        for piece in 0..pieces {
            let next = along(starts[piece], bend(piece), length);
            starts.push(next);
        }
        Self {
            ends: (0..=pieces).map(|piece| piece as f64 * length).collect(),
            of: Box::new(move |piece, s, order| {
                let k = bend(piece);
                let ([x, y], angle) = along(starts[piece], k, s - piece as f64 * length);
                match order {
                    0 => [x, y, 0.0],
                    1 => [angle.cos(), angle.sin(), 0.0],
                    2 => [-k * angle.sin(), k * angle.cos(), 0.0],
                    _ => [-k * k * angle.cos(), -k * k * angle.sin(), 0.0],
                }
            }),
        }
    }

    /// Straight, with a speed of the centre that jumps by this share of the contact's from piece to piece, as over knots where the curvature jumps.
    pub(super) fn stepped(pieces: usize, length: f64, share: f64) -> Self {
        let slope = move |piece: usize| if piece.is_multiple_of(2) { 1.0 } else { 1.0 - share };
        let start = move |piece: usize| (0..piece).map(|piece| slope(piece) * length).sum::<f64>();
        Self {
            ends: (0..=pieces).map(|piece| piece as f64 * length).collect(),
            of: Box::new(move |piece, s, order| match order {
                0 => [
                    start(piece) + slope(piece) * (s - piece as f64 * length),
                    0.0,
                    0.0,
                ],
                1 => [slope(piece), 0.0, 0.0],
                _ => [0.0; 3],
            }),
        }
    }

    pub(super) fn length(&self) -> f64 {
        *self.ends.last().unwrap()
    }

    pub(super) fn at(&self, s: f64) -> [f64; 3] {
        let s = s.clamp(0.0, self.length());
        let pieces = self.ends.len() - 1;
        let piece = self.ends[1..pieces].iter().filter(|end| **end <= s).count();
        (self.of)(piece, s, 0)
    }

    pub(super) fn plan(&self, limits: &MotionLimits) -> Box<Plan> {
        let mut plan = Box::new(Plan::NONE);
        plan.limits = *limits;
        plan.stations.clear();
        let pieces = self.ends.len() - 1;
        let cells = (160 / pieces).min(168 / pieces - 1).max(2);
        for piece in 0..pieces {
            for station in 0..=cells {
                let part = station as f64 / cells as f64;
                let s = self.ends[piece] + part * (self.ends[piece + 1] - self.ends[piece]);
                let station = Station {
                    arc_nm: (s * 1e6).round() as u32,
                    q: [0, 1, 2].map(|axis| [1, 2, 3].map(|order| (self.of)(piece, s, order)[axis] as f32)),
                };
                plan.stations.push(station);
            }
        }
        let mut planner = Box::new(Planner::IDLE);
        // It may be waited for.
        let deadlines = Deadlines {
            spent: 0,
            least: 0,
            left: None,
            waits: false,
        };
        planner.begin(&mut plan);
        while !planner.is_done() {
            planner.work(&mut plan, deadlines);
        }
        plan
    }
}
