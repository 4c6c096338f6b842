//! The order of the faces: the one whose links take least time. From home to the nearest face, from its end to the nearest start, and so on; then faces are moved and runs of faces are
//! turned round as long as that saves time. The links themselves are made when the job is read, by exact distances.

use glam::DVec3;
use part::{HeightMap, Times};

/// Rounds of the improvement, at most.
const ROUNDS: usize = 20;
/// Most faces that are moved together.
const MOVED: usize = 3;
/// What is saved at least, s: less is rounding.
const SAVED_S: f64 = 1e-6;

/// The faces that have a job, in the order of machining.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaceOrder {
    /// Their indices among the plans.
    pub faces: Vec<usize>,
    /// Time of the links from home through all of them and back, s; an estimate.
    pub links_s: f64,
}

/// Times of the links between the faces of a part. A face is its index, home the index behind the last one.
pub(crate) struct FaceLinks {
    faces: usize,
    /// From the face of the row to that of the column, s.
    times_s: Vec<f64>,
}

impl FaceLinks {
    /// Between faces whose passes start and end here, the ball's centre, mm.
    pub(crate) fn new(heights: &HeightMap, times: &Times, faces_mm: &[[DVec3; 2]], home_mm: DVec3) -> Self {
        let ends: Vec<[DVec3; 2]> = faces_mm.iter().copied().chain([[home_mm; 2]]).collect();
        let pairs = ends
            .iter()
            .flat_map(|from| ends.iter().map(move |to| [from[1], to[0]]));
        let time = |link| times.across(link, heights.over(link).min(home_mm.z));
        Self {
            faces: faces_mm.len(),
            times_s: pairs.map(time).collect(),
        }
    }

    const fn home(&self) -> usize {
        self.faces
    }

    fn time_s(&self, from: usize, to: usize) -> f64 {
        self.times_s[from * (self.faces + 1) + to]
    }

    /// The time of all links of an order, from home and back, s.
    pub(crate) fn sum_s(&self, order: &[usize]) -> f64 {
        self.way_s(self.home(), order, self.home())
    }

    /// The time of the links from a face through others to a third, s.
    fn way_s(&self, from: usize, through: &[usize], to: usize) -> f64 {
        let before = std::iter::once(from).chain(through.iter().copied());
        let behind = through.iter().copied().chain([to]);
        before.zip(behind).map(|(from, to)| self.time_s(from, to)).sum()
    }

    /// The order of all faces.
    pub(crate) fn order(&self) -> Vec<usize> {
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
        let mut left: Vec<usize> = (0..self.faces).collect();
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

    /// One round: every run of faces turned round (2-opt), and a few moved elsewhere (or-opt). Returns whether anything was changed.
    fn improve(&self, order: &mut [usize]) -> bool {
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

    fn turn_round(&self, order: &mut [usize], from: usize, to: usize) -> bool {
        self.replace(order, from, to, <[usize]>::reverse)
    }

    /// Moves some faces to another place of the order without them.
    fn shift(&self, order: &mut [usize], from: usize, count: usize, place: usize) -> bool {
        // Only what is between the old place and the new one changes.
        let (low, high) = (from.min(place), from.max(place) + count);
        self.replace(order, low, high, |moved| {
            if from < place {
                moved.rotate_left(count);
            } else {
                moved.rotate_right(count);
            }
        })
    }

    /// Changes a part of an order where that saves time.
    fn replace(
        &self,
        order: &mut [usize],
        from: usize,
        to: usize,
        change: impl FnOnce(&mut [usize]),
    ) -> bool {
        let before = from.checked_sub(1).map_or(self.home(), |before| order[before]);
        let behind = order.get(to).copied().unwrap_or(self.home());
        let now = &mut order[from..to];
        let mut new = now.to_vec();
        change(&mut new);
        let saves = self.way_s(before, &new, behind) + SAVED_S < self.way_s(before, now, behind);
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

    /// Faces of a row, each as long as it is apart from the next, in the file from both ends to the middle.
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
