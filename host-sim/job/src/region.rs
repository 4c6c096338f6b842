//! The part of a surface that a job machines.

/// A region of a surface: the points that closed polygons of (u, v) enclose an odd number of times (even-odd rule). A polygon inside another
/// one is a hole; polygons may touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The polygons: vertices `[u, v]`, in the parameters of the placed surface ([`crate::Job::surface`]), within its domain. The edge from the last
    /// vertex back to the first belongs to the polygon. Either sense of rotation.
    pub loops: Vec<Vec<[f64; 2]>>,
    /// Its cells in the order in which they are machined, each as polygons as above; together they are the region. Empty where it is machined line by line.
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

    /// What is machined line by line, one after the other: its cells, or all of it.
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

#[cfg(test)]
mod tests {
    use super::*;

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
