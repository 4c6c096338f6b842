//! The order of the faces: the one whose links take least time. From home to the nearest face, from its end to the nearest start, and so on; then faces are moved and runs of faces are
//! turned round as long as that saves time.
//!
//! A link between faces is as high as the part requires, by the exact distance, and that takes milliseconds. So a link is looked at only if it would save time at the least height that it
//! could have.

use std::cell::RefCell;
use std::collections::HashMap;

use glam::DVec3;
use part::{Crossings, Times};

/// Rounds of the improvement, at most.
const ROUNDS: usize = 20;
/// Most faces that are moved together.
const MOVED: usize = 3;
/// What is saved at least, s: less is rounding.
const SAVED_S: f64 = 1e-6;

/// The links between the faces of a part. A face is its index, home the index behind the last one.
pub(super) struct Links<'a> {
    crossings: Crossings<'a>,
    times: Times,
    /// Where the passes of a face start and end, the ball's centre, mm; home last.
    ends_mm: Vec<[DVec3; 2]>,
    home_mm: DVec3,
    known: RefCell<HashMap<[usize; 2], f64>>,
}

impl<'a> Links<'a> {
    pub(super) fn new(
        crossings: Crossings<'a>,
        times: Times,
        faces_mm: impl IntoIterator<Item = [DVec3; 2]>,
        home_mm: DVec3,
    ) -> Self {
        Self {
            crossings,
            times,
            ends_mm: faces_mm.into_iter().chain([[home_mm; 2]]).collect(),
            home_mm,
            known: RefCell::default(),
        }
    }

    fn home(&self) -> usize {
        self.ends_mm.len() - 1
    }

    fn ends(&self, [from, to]: [usize; 2]) -> [DVec3; 2] {
        [self.ends_mm[from][1], self.ends_mm[to][0]]
    }

    /// The time of a link at the least height that it could have, s.
    fn least_s(&self, link: [usize; 2]) -> f64 {
        let ends = self.ends(link);
        let height = match link.contains(&self.home()) {
            true => self.home_mm.z,
            false => self.crossings.least_height(ends),
        };
        self.times.across(ends, height)
    }

    /// The time of a link, s.
    fn time_s(&self, link: [usize; 2]) -> f64 {
        if link.contains(&self.home()) {
            return self.least_s(link);
        }
        *self.known.borrow_mut().entry(link).or_insert_with(|| {
            let ends = self.ends(link);
            self.times.across(ends, self.crossings.height(ends))
        })
    }

    /// The time of all links of an order, from home and back, s.
    pub(super) fn sum_s(&self, order: &[usize]) -> f64 {
        self.way_s(self.home(), order, self.home())
    }

    /// The time of the links from a face through others to a third, s.
    fn way_s(&self, from: usize, through: &[usize], to: usize) -> f64 {
        links(from, through, to).map(|link| self.time_s(link)).sum()
    }

    /// Whether a way takes less time than another; and how much, s.
    fn saves(&self, from: usize, through: &[usize], to: usize, than_s: f64) -> bool {
        let least: f64 = links(from, through, to).map(|link| self.least_s(link)).sum();
        least + SAVED_S < than_s && self.way_s(from, through, to) + SAVED_S < than_s
    }

    /// The order of all faces.
    pub(super) fn order(&self) -> Vec<usize> {
        let mut order = self.nearest();
        for _ in 0..ROUNDS {
            if !self.improve(&mut order) {
                break;
            }
        }
        order
    }

    /// From home always to the nearest start.
    fn nearest(&self) -> Vec<usize> {
        let mut left: Vec<usize> = (0..self.home()).collect();
        let mut order = Vec::with_capacity(left.len());
        let mut at = self.home();
        while !left.is_empty() {
            let mut by_least: Vec<(f64, usize)> = left
                .iter()
                .map(|face| (self.least_s([at, *face]), *face))
                .collect();
            by_least.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut best = (f64::INFINITY, at);
            for (least, face) in by_least {
                if least >= best.0 {
                    break;
                }
                let time = self.time_s([at, face]);
                if time < best.0 {
                    best = (time, face);
                }
            }
            at = best.1;
            left.retain(|face| *face != at);
            order.push(at);
        }
        order
    }

    /// One round: every run of faces turned round (2-opt), and a few moved elsewhere (or-opt). Returns whether anything was changed.
    fn improve(&self, order: &mut Vec<usize>) -> bool {
        let mut is_better = false;
        for from in 0..order.len() {
            for to in from + 2..=order.len() {
                is_better |= self.turn_round(order, from, to);
            }
            for count in 1..=MOVED.min(order.len() - from) {
                for place in 0..=order.len() - count {
                    is_better |= self.shift(order, from, count, place);
                }
            }
        }
        is_better
    }

    /// The face before a place in the order, and the one at it.
    fn around(&self, order: &[usize], from: usize, to: usize) -> [usize; 2] {
        let before = from.checked_sub(1).map_or(self.home(), |before| order[before]);
        [before, order.get(to).copied().unwrap_or(self.home())]
    }

    fn turn_round(&self, order: &mut [usize], from: usize, to: usize) -> bool {
        let [before, behind] = self.around(order, from, to);
        let now_s = self.way_s(before, &order[from..to], behind);
        let turned: Vec<usize> = order[from..to].iter().rev().copied().collect();
        let saves = self.saves(before, &turned, behind, now_s);
        if saves {
            order[from..to].copy_from_slice(&turned);
        }
        saves
    }

    /// Moves some faces to another place of the order without them.
    fn shift(&self, order: &mut Vec<usize>, from: usize, count: usize, place: usize) -> bool {
        if from == place {
            return false;
        }
        // Only what is between the old place and the new one changes.
        let (low, high) = (from.min(place), from.max(place) + count);
        let [before, behind] = self.around(order, low, high);
        let now = &order[low..high];
        let mut moved = now.to_vec();
        if from < place {
            moved.rotate_left(count);
        } else {
            moved.rotate_right(count);
        }
        let now_s = self.way_s(before, now, behind);
        let saves = self.saves(before, &moved, behind, now_s);
        if saves {
            order.splice(low..high, moved);
        }
        saves
    }
}

/// The links of a way.
fn links(from: usize, through: &[usize], to: usize) -> impl Iterator<Item = [usize; 2]> {
    let before = std::iter::once(from).chain(through.iter().copied());
    let behind = through.iter().copied().chain([to]);
    before.zip(behind).map(|(from, to)| [from, to])
}

#[cfg(test)]
mod tests {
    use super::Links;
    use glam::DVec3;
    use job::{AxisLimits, ToolBody};
    use part::{Crossings, Part, Times, Tool};

    const SAFE_MM: f64 = 30.0;

    fn with_links<T>(faces_mm: &[[DVec3; 2]], take: impl FnOnce(&Links<'_>) -> T) -> T {
        let part = Part::default();
        let tool = Tool::new(3.0, &ToolBody::default());
        let crossings = Crossings::new(&part, &tool, 0.002, SAFE_MM);
        let times = Times::new(20.0, AxisLimits::DEFAULT);
        take(&Links::new(
            crossings,
            times,
            faces_mm.iter().copied(),
            DVec3::new(0.0, 0.0, SAFE_MM),
        ))
    }

    /// Every order of these faces.
    fn orders(faces: &[usize]) -> Vec<Vec<usize>> {
        if faces.is_empty() {
            return vec![Vec::new()];
        }
        let first = |place: usize| {
            let mut rest = faces.to_vec();
            let face = rest.remove(place);
            orders(&rest)
                .into_iter()
                .map(move |order| [vec![face], order].concat())
        };
        (0..faces.len()).flat_map(first).collect()
    }

    /// Faces of a row, each as long as it is apart from the next, in the file from both ends to the middle.
    #[test]
    fn a_row_is_machined_from_one_end_to_the_other() {
        let face = |x: f64| [DVec3::new(x, 0.0, 0.0), DVec3::new(x + 5.0, 0.0, 0.0)];
        let faces = [10.0, 60.0, 20.0, 50.0, 30.0, 40.0].map(face);
        assert_eq!(with_links(&faces, |links| links.order()), [0, 2, 4, 5, 3, 1]);
    }

    #[test]
    fn the_order_is_near_the_best_of_all() {
        let mut state = 7_u64;
        let mut random = |range: f64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            range * ((state >> 40) as f64 / (1_u64 << 24) as f64)
        };
        for case in 0..40 {
            let faces: Vec<[DVec3; 2]> = (0..6)
                .map(|_| {
                    let start = DVec3::new(random(80.0), random(50.0), random(20.0));
                    [start, start + DVec3::new(random(15.0), random(15.0), 0.0)]
                })
                .collect();
            with_links(&faces, |links| {
                let all = orders(&[0, 1, 2, 3, 4, 5]);
                let best = all
                    .iter()
                    .map(|order| links.sum_s(order))
                    .fold(f64::INFINITY, f64::min);
                let found = links.sum_s(&links.order());
                assert!(found <= links.sum_s(&links.nearest()), "{case}");
                assert!(found <= 1.05 * best, "{case}: {found} {best}");
            });
        }
    }
}
