//! The order of the faces by the time of the links between them: nearest neighbour from home, then 2-opt and or-opt. A local minimum, not proven to be the least time.
//!
//! Heights of these links are from a map of the part; when the job is read, the links are made by exact distances.

use glam::DVec3;
use part::{HeightMap, Times};

/// Largest number of rounds of 2-opt and or-opt.
const ROUNDS_MAX: usize = 20;
/// Largest number of consecutive faces that or-opt moves together.
const MOVED_MAX: usize = 3;
/// Least saving of an accepted change, s; a smaller one is rounding.
const SAVED_MIN_S: f64 = 1e-6;

/// The faces that have a job, in the order of machining.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaceOrder {
    /// Indices of the faces among the plans.
    pub faces: Vec<usize>,
    /// Estimated time of the links from home through all faces and back, s.
    pub links_s: f64,
}

/// Times of the links between the faces of a part. Faces are numbered from 0; the number after the last face is home.
pub(crate) struct FaceLinks {
    face_count: usize,
    /// Matrix, row by row: the time from the end of the row's face to the start of the column's, s.
    times_s: Vec<f64>,
}

impl FaceLinks {
    /// `faces_mm`: the ball's centre at the start of the first pass and at the end of the last pass of each face.
    pub(crate) fn new(heights: &HeightMap, times: &Times, faces_mm: &[[DVec3; 2]], home_mm: DVec3) -> Self {
        let ends: Vec<[DVec3; 2]> = faces_mm.iter().copied().chain([[home_mm; 2]]).collect();
        let pairs = ends
            .iter()
            .flat_map(|from| ends.iter().map(move |to| [from[1], to[0]]));
        let time = |link| times.across(link, heights.over(link).min(home_mm.z));
        Self {
            face_count: faces_mm.len(),
            times_s: pairs.map(time).collect(),
        }
    }

    const fn home(&self) -> usize {
        self.face_count
    }

    fn time_s(&self, from: usize, to: usize) -> f64 {
        self.times_s[from * (self.face_count + 1) + to]
    }

    /// The time of the links from home through the faces in this order and back home, s.
    pub(crate) fn sum_s(&self, order: &[usize]) -> f64 {
        self.way_s(self.home(), order, self.home())
    }

    /// The time of the links from one face through others to a last one, s.
    fn way_s(&self, from: usize, through: &[usize], to: usize) -> f64 {
        let before = std::iter::once(from).chain(through.iter().copied());
        let after = through.iter().copied().chain([to]);
        before.zip(after).map(|(from, to)| self.time_s(from, to)).sum()
    }

    /// The order of all faces.
    pub(crate) fn order(&self) -> Vec<usize> {
        let mut order = self.nearest();
        for _ in 0..ROUNDS_MAX {
            if !self.improve(&mut order) {
                break;
            }
        }
        order
    }

    /// Nearest neighbour: from home, always the face with the shortest link to its start.
    fn nearest(&self) -> Vec<usize> {
        let mut left: Vec<usize> = (0..self.face_count).collect();
        let mut order = Vec::with_capacity(left.len());
        let mut at = self.home();
        let nearest = |at: usize, left: &[usize]| {
            let to = |face: &usize| self.time_s(at, *face);
            (0..left.len()).min_by(|a, b| to(&left[*a]).total_cmp(&to(&left[*b])))
        };
        while let Some(place) = nearest(at, &left) {
            at = left.remove(place);
            order.push(at);
        }
        order
    }

    /// One round: reverses stretches of the order (2-opt) and moves up to [`MOVED_MAX`] faces elsewhere (or-opt) where that saves time. Returns whether the order changed.
    fn improve(&self, order: &mut [usize]) -> bool {
        let mut is_better = false;
        for from in 0..order.len() {
            for to in from + 2..=order.len() {
                is_better |= self.replace(order, from, to, <[usize]>::reverse);
            }
            for count in 1..=MOVED_MAX.min(order.len() - from) {
                for place in 0..=order.len() - count {
                    is_better |= self.shift(order, from, count, place);
                }
            }
        }
        is_better
    }

    /// Moves `count` faces from index `from` to index `place` where that saves time.
    fn shift(&self, order: &mut [usize], from: usize, count: usize, place: usize) -> bool {
        // The order changes between the old place and the new one only.
        let (low, high) = (from.min(place), from.max(place) + count);
        self.replace(order, low, high, |moved| {
            if from < place {
                moved.rotate_left(count);
            } else {
                moved.rotate_right(count);
            }
        })
    }

    /// Applies `change` to the faces `from..to` of the order where that saves time. Returns whether it did.
    fn replace(
        &self,
        order: &mut [usize],
        from: usize,
        to: usize,
        change: impl FnOnce(&mut [usize]),
    ) -> bool {
        let before = from.checked_sub(1).map_or(self.home(), |before| order[before]);
        let after = order.get(to).copied().unwrap_or(self.home());
        let now = &mut order[from..to];
        let mut new = now.to_vec();
        change(&mut new);
        let saves = self.way_s(before, &new, after) + SAVED_MIN_S < self.way_s(before, now, after);
        if saves {
            now.copy_from_slice(&new);
        }
        saves
    }
}

#[cfg(test)]
mod tests {
    use super::FaceLinks;
    use glam::DVec3;
    use job::AxisLimits;
    use part::{HeightMap, Part, Times};

    const SAFE_MM: f64 = 30.0;

    /// Faces of a plane that is as large as they need.
    fn links(faces_mm: &[[DVec3; 2]]) -> FaceLinks {
        let text = "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [0, 0, 1, 1]\nknots_v = [0, 0, 1, 1]\n\
            poles_mm = [[[0, 0, -3], [0, 100, -3]], [[100, 0, -3], [100, 100, -3]]]\n\
            [tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 1200\nscallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n";
        let job = job_file::parse("plane.toml", text).unwrap();
        let plane = Part::of_surface(&oracle::Surface::new(&job.surface));
        let times = Times::new(20.0, AxisLimits::DEFAULT);
        FaceLinks::new(
            &HeightMap::new(&plane, 3.0),
            &times,
            faces_mm,
            DVec3::new(0.0, 0.0, SAFE_MM),
        )
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

    /// A row of faces 5 mm long and 5 mm apart, numbered from both ends to the middle.
    #[test]
    fn a_row_is_machined_from_one_end_to_the_other() {
        let face = |x: f64| [DVec3::new(x, 0.0, 0.0), DVec3::new(x + 5.0, 0.0, 0.0)];
        let faces = [10.0, 60.0, 20.0, 50.0, 30.0, 40.0].map(face);
        assert_eq!(links(&faces).order(), [0, 2, 4, 5, 3, 1]);
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
            let links = links(&faces);
            let all = orders(&[0, 1, 2, 3, 4, 5]);
            let best = all
                .iter()
                .map(|order| links.sum_s(order))
                .fold(f64::INFINITY, f64::min);
            let found = links.sum_s(&links.order());
            assert!(found <= links.sum_s(&links.nearest()), "{case}");
            assert!(found <= 1.05 * best, "{case}: {found} {best}");
        }
    }
}
