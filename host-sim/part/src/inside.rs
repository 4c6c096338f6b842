//! Whether a place lies in a trimmed region: even-odd, by the edges of its strip of v.

/// Most strips.
const STRIPS_MAX: usize = 512;

/// Polygons of (u, v), ready to be asked.
#[derive(Clone, Debug)]
pub struct Inside {
    edges: Vec<[[f64; 2]; 2]>,
    strips: Vec<Vec<u32>>,
    v: [f64; 2],
}

impl Default for Inside {
    /// Nothing is inside.
    fn default() -> Self {
        Self::new(&[])
    }
}

impl Inside {
    /// Of closed polygons.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "fewer than 2^32 edges")]
    pub fn new(polygons: &[Vec<[f64; 2]>]) -> Self {
        let edges: Vec<[[f64; 2]; 2]> = polygons
            .iter()
            .flat_map(|polygon| {
                let next = polygon.iter().cycle().skip(1);
                polygon.iter().zip(next).map(|(a, b)| [*a, *b])
            })
            .collect();
        let v = edges
            .iter()
            .flatten()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                [low.min(place[1]), high.max(place[1])]
            });
        let mut found = Self {
            strips: vec![Vec::new(); edges.len().clamp(1, STRIPS_MAX)],
            edges: Vec::new(),
            v,
        };
        for (index, [a, b]) in edges.iter().enumerate() {
            let (low, high) = (found.strip(a[1].min(b[1])), found.strip(a[1].max(b[1])));
            for strip in &mut found.strips[low..=high] {
                strip.push(index as u32);
            }
        }
        found.edges = edges;
        found
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the strips"
    )]
    fn strip(&self, v: f64) -> usize {
        let count = self.strips.len();
        let share = (v - self.v[0]) / (self.v[1] - self.v[0]).max(f64::MIN_POSITIVE);
        ((share * count as f64).max(0.0) as usize).min(count - 1)
    }

    /// The edges.
    #[must_use]
    pub fn edges(&self) -> &[[[f64; 2]; 2]] {
        &self.edges
    }

    /// Whether the polygons enclose the place an odd number of times.
    #[must_use]
    pub fn contains(&self, [u, v]: [f64; 2]) -> bool {
        if !(v >= self.v[0] && v <= self.v[1]) {
            return false;
        }
        let crossed = |index: &&u32| {
            let [[u0, v0], [u1, v1]] = self.edges[**index as usize];
            (v0 <= v) != (v1 <= v) && u < u0 + (v - v0) * (u1 - u0) / (v1 - v0)
        };
        self.strips[self.strip(v)].iter().filter(crossed).count() % 2 == 1
    }
}
