//! The part of a surface that a job machines.

use crate::Along;

/// A region of a surface: the points that closed polygons of (u, v) enclose an odd number of times (even-odd rule). A polygon inside another
/// one is a hole; polygons may touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The polygons: vertices `[u, v]`, in the parameters of the placed surface ([`crate::Job::surface`]), within its domain. The edge from the last
    /// vertex back to the first belongs to the polygon. Either sense of rotation.
    pub loops: Vec<Vec<[f64; 2]>>,
    /// Cells of the region in the order in which they are machined, each as polygons like `loops`; together they are the region. Empty: the region is machined line by line.
    pub cells: Vec<Vec<Vec<[f64; 2]>>>,
}

impl Region {
    /// Most vertices of all loops together: more than the board's store takes.
    pub const VERTICES_MAX: usize = 4096;

    /// The region that these polygons enclose, machined line by line.
    #[must_use]
    pub const fn new(loops: Vec<Vec<[f64; 2]>>) -> Self {
        Self {
            loops,
            cells: Vec::new(),
        }
    }

    /// The parts that are machined one after the other, each line by line: the cells, or else the whole region.
    #[must_use]
    pub fn parts(&self) -> Vec<Self> {
        if self.cells.is_empty() {
            vec![Self::new(self.loops.clone())]
        } else {
            self.cells.iter().cloned().map(Self::new).collect()
        }
    }

    /// The edges of all loops, each as its two ends.
    pub fn edges(&self) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
        self.loops.iter().flat_map(|points| {
            let next = points.iter().cycle().skip(1);
            points.iter().zip(next).map(|(from, to)| [*from, *to])
        })
    }

    /// Whether a point lies inside, by the even-odd rule. A point on the boundary may count as either.
    #[must_use]
    pub fn contains(&self, [u, v]: [f64; 2]) -> bool {
        let crossed = |[[u0, v0], [u1, v1]]: &[[f64; 2]; 2]| {
            (*v0 <= v) != (*v1 <= v) && u < u0 + (v - v0) * (u1 - u0) / (v1 - v0)
        };
        self.edges().filter(crossed).count() % 2 == 1
    }

    /// The least and the greatest u, and those of v.
    #[must_use]
    pub fn extent(&self) -> [[f64; 2]; 2] {
        let mut extent = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for point in self.loops.iter().flatten() {
            for ([least, most], value) in extent.iter_mut().zip(point) {
                (*least, *most) = (least.min(*value), most.max(*value));
            }
        }
        extent
    }
}

/// A line near an end of a region is long enough to be the last one from this share of the longest line there.
const FULL_SHARE: f64 = 0.98;
/// Lines near an end that are compared, besides those through vertices.
const LINES_AT_END: u32 = 16;
/// Greatest distance of the last line from an end of a region, in step-overs of a plane: the strip beyond it stays below the scallop height down to a convex radius of a
/// tenth of the ball's.
const END_STEPS: f64 = 0.15;
/// Ends that are nearer to the surface's boundary than this share of the side parameter's range are on it: passes follow it.
const ON_BOUNDARY: f64 = 1e-9;

impl Region {
    /// `[path, side]` of (u, v), and back.
    const fn swapped(along: Along, [u, v]: [f64; 2]) -> [f64; 2] {
        match along {
            Along::U => [u, v],
            Along::V => [v, u],
        }
    }

    /// Length of a line of constant side parameter in the region, in the path parameter.
    fn length_on(&self, along: Along, side: f64) -> f64 {
        let edges = self.edges().map(|ends| ends.map(|end| Self::swapped(along, end)));
        let mut crossings: Vec<f64> = edges
            .filter(|[a, b]| (a[1] <= side) != (b[1] <= side))
            .map(|[a, b]| a[0] + (side - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
            .collect();
        crossings.sort_by(f64::total_cmp);
        let pairs = crossings.as_chunks::<2>().0;
        pairs.iter().map(|[from, to]| to - from).sum()
    }

    /// The least and the greatest side parameter.
    fn ends(&self, along: Along) -> [f64; 2] {
        let [u, v] = self.extent();
        match along {
            Along::U => v,
            Along::V => u,
        }
    }

    /// The side parameters of the first and the last line: the region's ends, or, where a line there would be a sliver, at most 0.15 step-overs inwards. An
    /// end on the boundary of the surface stays. `step_mm`: step-over on a plane; `across_mm`: length of the surface's derivative by the side parameter;
    /// `sides`: range of the side parameter on the surface.
    #[must_use]
    pub fn trimmed_lines(&self, along: Along, step_mm: f64, across_mm: f64, sides: [f64; 2]) -> [f64; 2] {
        let ends = self.ends(along);
        let full = self.full_lines(along, END_STEPS * step_mm / across_mm);
        let on_boundary = |k: usize| (ends[k] - sides[k]).abs() <= ON_BOUNDARY * (sides[1] - sides[0]);
        [0, 1].map(|k| if on_boundary(k) { ends[k] } else { full[k] })
    }

    /// The first and the last side parameter whose line is (nearly) the longest of those up to `within` from the region's end. On an end nearly parallel to the
    /// lines the last line would be a sliver, and the strip beside it a step-over wide.
    fn full_lines(&self, along: Along, within: f64) -> [f64; 2] {
        let ends = self.ends(along);
        let within = within.min(0.25 * (ends[1] - ends[0]));
        let vertices: Vec<f64> = self
            .edges()
            .map(|[vertex, _]| Self::swapped(along, vertex)[1])
            .collect();
        [(ends[0], 1.0), (ends[1], -1.0)].map(|(end, inwards)| {
            let last = end + inwards * within;
            let even = (0..=LINES_AT_END).map(|k| f64::from(k) / f64::from(LINES_AT_END));
            let mut lines: Vec<f64> = even
                .map(|share| end + share * (last - end))
                .chain(
                    vertices
                        .iter()
                        .copied()
                        .filter(|side| (side - end) * inwards <= within),
                )
                // On the vertex itself a line has the length of one side of it.
                .map(|side| side + 1e-9 * (last - end))
                .collect();
            lines.sort_by(|a, b| (a * inwards).total_cmp(&(b * inwards)));
            let lengths: Vec<f64> = lines.iter().map(|side| self.length_on(along, *side)).collect();
            let longest = lengths.iter().copied().fold(0.0, f64::max);
            let full = lengths.iter().position(|length| *length >= FULL_SHARE * longest);
            match full {
                Some(index) if index > 0 => lines[index],
                _ => end,
            }
        })
    }

    /// The part of the region between two lines of constant side parameter.
    #[must_use]
    pub fn between(&self, along: Along, [low, high]: [f64; 2]) -> Self {
        let cut = |polygon: &[[f64; 2]], side: f64, upwards: f64| {
            let mut kept: Vec<[f64; 2]> = Vec::with_capacity(polygon.len());
            let next = polygon.iter().cycle().skip(1);
            for (from, to) in polygon.iter().zip(next) {
                let [a, b] = [*from, *to].map(|place| Self::swapped(along, place));
                let is_in = |place: [f64; 2]| (place[1] - side) * upwards >= 0.0;
                if is_in(a) {
                    kept.push(*from);
                }
                if is_in(a) != is_in(b) {
                    let share = (side - a[1]) / (b[1] - a[1]);
                    kept.push(Self::swapped(along, [a[0] + share * (b[0] - a[0]), side]));
                }
            }
            kept
        };
        let loops = self.loops.iter().filter_map(|polygon| {
            let kept = cut(&cut(polygon, low, 1.0), high, -1.0);
            (kept.len() > 2).then_some(kept)
        });
        Self::new(loops.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An end that is slanted by less than [`END_STEPS`] is cut at its lower end; a flat end, and one that is slanted more, stays.
    #[test]
    fn the_last_line_is_no_sliver() {
        let region = |high: [f64; 2]| {
            Region::new(vec![vec![
                [0.0, 0.0],
                [10.0, 0.0],
                [10.0, high[0]],
                [0.0, high[1]],
            ]])
        };
        let lines = |high: [f64; 2]| region(high).full_lines(Along::U, 0.1);
        assert_eq!(lines([5.0, 5.0]), [0.0, 5.0]);
        let [first, last] = lines([5.0, 4.95]);
        assert!(first == 0.0 && (last - 4.95).abs() < 2e-3, "{last}");
        let [_, last] = lines([5.0, 4.999_999_9]);
        assert!(last < 5.0 && last > 4.999_999_8, "{last}");
        // The longest line within reach has a tenth of the length.
        let [_, last] = lines([5.0, 4.0]);
        assert!((last - 4.9).abs() < 7e-3, "{last}");
        let cut = region([5.0, 4.95]).between(Along::U, [0.5, 4.95]);
        assert_eq!(cut.extent(), [[0.0, 10.0], [0.5, 4.95]]);
        assert!(cut.contains([9.0, 4.9]) && !cut.contains([9.0, 4.97]));
        // The other way round.
        let turned = Region::new(vec![vec![[0.0, 0.0], [0.0, 10.0], [5.0, 10.0], [4.95, 0.0]]]);
        let [_, last] = turned.full_lines(Along::V, 0.1);
        assert!((last - 4.95).abs() < 2e-3, "{last}");
    }

    /// An end on the surface's boundary stays where one within it is cut; a step-over of 2/3 mm at 1 mm for each unit reaches 0.1 far.
    #[test]
    fn a_sliver_on_the_boundary_stays() {
        let region = Region::new(vec![vec![[0.0, 0.0], [10.0, 0.0], [10.0, 5.0], [0.0, 4.95]]]);
        let lines = |sides: [f64; 2]| region.trimmed_lines(Along::U, 0.1 / END_STEPS, 1.0, sides);
        assert_eq!(lines([-1.0, 5.0]), [0.0, 5.0]);
        let [first, last] = lines([0.0, 5.1]);
        assert!(first == 0.0 && (last - 4.95).abs() < 2e-3, "{last}");
        // Half as far on a surface with derivatives twice as long.
        let [_, last] = region.trimmed_lines(Along::U, 0.1 / END_STEPS, 4.0, [0.0, 5.1]);
        assert!(last > 4.97, "{last}");
    }

    #[test]
    fn a_loop_inside_another_is_a_hole() {
        let square = |low: f64, high: f64| vec![[low, low], [high, low], [high, high], [low, high]];
        let region = Region::new(vec![square(0.0, 10.0), square(3.0, 7.0), square(4.0, 5.0)]);
        for (at, inside) in [
            ([1.0, 1.0], true),
            ([3.5, 6.0], false),
            ([4.5, 4.5], true),
            ([11.0, 4.5], false),
            ([-1.0, 4.5], false),
        ] {
            assert_eq!(region.contains(at), inside, "{at:?}");
        }
        assert_eq!(region.edges().count(), 12);
        assert_eq!(region.extent(), [[0.0, 10.0]; 2]);
    }
}
