//! Distances of a triangle: from a point, and of its part between two heights from a vertical line.

use glam::DVec3;

/// The nearest point of a triangle, and its distance: weights of its second and third corner (C. Ericson, "Real-Time Collision Detection", 2005,
/// 5.1.5).
#[must_use]
pub(crate) fn nearest(p: DVec3, [a, b, c]: [DVec3; 3]) -> (f64, [f64; 2]) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let weights = weights(ab, ac, ap);
    ((ap - ab * weights[0] - ac * weights[1]).length(), weights)
}

fn weights(ab: DVec3, ac: DVec3, ap: DVec3) -> [f64; 2] {
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [0.0, 0.0];
    }
    let bp = ap - ab;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    // Where the first two corners are one, both are 0, and the nearest point is on another side.
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3 {
        return [d1 / (d1 - d3), 0.0];
    }
    let cp = ap - ac;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return [0.0, d2 / (d2 - d6)];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [1.0 - share, share];
    }
    let sum = va + vb + vc;
    [vb / sum, vc / sum]
}

/// A corner of a clipped triangle: place across the axis, and its weights.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    x: f64,
    y: f64,
    z: f64,
    weights: [f64; 2],
}

fn mixed(a: &Corner, b: &Corner, share: f64) -> Corner {
    let mix = |a: f64, b: f64| a + share * (b - a);
    Corner {
        x: mix(a.x, b.x),
        y: mix(a.y, b.y),
        z: mix(a.z, b.z),
        weights: [mix(a.weights[0], b.weights[0]), mix(a.weights[1], b.weights[1])],
    }
}

/// A convex polygon of at most 5 corners.
struct Clipped {
    corners: [Corner; 6],
    count: usize,
}

impl Clipped {
    /// The part above (`sign` 1) or below (-1) a height.
    fn cut(&self, z: f64, sign: f64) -> Self {
        let mut out = Self {
            corners: [Corner::default(); 6],
            count: 0,
        };
        for index in 0..self.count {
            let (here, next) = (self.corners[index], self.corners[(index + 1) % self.count]);
            let (above, next_above) = (sign * (here.z - z) >= 0.0, sign * (next.z - z) >= 0.0);
            if above {
                out.push(here);
            }
            if above != next_above {
                out.push(mixed(&here, &next, (z - here.z) / (next.z - here.z)));
            }
        }
        out
    }

    fn push(&mut self, corner: Corner) {
        if self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }
}

/// Distance of the part of a triangle between two heights from the vertical line through `p`, and the weights of the nearest point; `None` where
/// there is no such part.
#[must_use]
pub(crate) fn beside(p: DVec3, triangle: [DVec3; 3], z: [f64; 2]) -> Option<(f64, [f64; 2])> {
    let weights = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let mut corners = [Corner::default(); 6];
    for (corner, (point, weights)) in corners.iter_mut().zip(triangle.into_iter().zip(weights)) {
        *corner = Corner {
            x: point.x - p.x,
            y: point.y - p.y,
            z: point.z,
            weights,
        };
    }
    let mut part = Clipped { corners, count: 3 };
    if triangle.iter().any(|point| point.z < z[0]) {
        part = part.cut(z[0], 1.0);
    }
    if triangle.iter().any(|point| point.z > z[1]) {
        part = part.cut(z[1], -1.0);
    }
    if part.count == 0 {
        return None;
    }
    let mut best = (f64::INFINITY, [0.0; 2]);
    let mut inside = false;
    for index in 0..part.count {
        let (a, b) = (part.corners[index], part.corners[(index + 1) % part.count]);
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let length = dx * dx + dy * dy;
        let share = if length > 0.0 {
            (-(a.x * dx + a.y * dy) / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let near = mixed(&a, &b, share);
        let square = near.x * near.x + near.y * near.y;
        if square < best.0 {
            best = (square, near.weights);
        }
        inside ^= (a.y > 0.0) != (b.y > 0.0) && 0.0 < a.x - dx * a.y / dy;
    }
    if inside {
        let [a, b, c] = triangle;
        let (ab, ac, ap) = (b - a, c - a, p - a);
        let det = ab.x * ac.y - ab.y * ac.x;
        let weights = [
            (ap.x * ac.y - ap.y * ac.x) / det,
            (ab.x * ap.y - ab.y * ap.x) / det,
        ];
        return Some((0.0, weights));
    }
    let (square, weights) = best;
    Some((square.sqrt(), weights))
}

/// Distance of a straight edge from a point, and the nearest point.
#[must_use]
pub(crate) fn edge_nearest(p: DVec3, [a, b]: [DVec3; 2]) -> (f64, DVec3) {
    let along = b - a;
    let length = along.length_squared();
    let share = if length > 0.0 {
        ((p - a).dot(along) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let near = a + along * share;
    (near.distance(p), near)
}

/// Distance of the part of a straight edge between two heights from the vertical line through `p`.
#[must_use]
pub(crate) fn edge_beside(p: DVec3, [a, b]: [DVec3; 2], z: [f64; 2]) -> Option<f64> {
    let (low, high) = if a.z <= b.z { (a, b) } else { (b, a) };
    if high.z < z[0] || low.z > z[1] {
        return None;
    }
    let rise = high.z - low.z;
    let at = |height: f64| low + (high - low) * ((height - low.z) / rise);
    let from = if low.z < z[0] { at(z[0]) } else { low };
    let to = if high.z > z[1] { at(z[1]) } else { high };
    let flat = |q: DVec3| DVec3::new(q.x, q.y, 0.0);
    Some(edge_nearest(flat(p), [flat(from), flat(to)]).0)
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    /// A side of two equal corners makes a triangle a line, whichever side it is.
    #[test]
    fn a_triangle_with_two_equal_corners_has_the_distances_of_a_line() {
        let (pole, end) = (dvec3(25.0, 25.0, 8.0), dvec3(26.0, 25.0, 5.0));
        let points = [
            dvec3(27.85, 25.0, 7.0),
            dvec3(25.4, 25.3, 6.4),
            dvec3(24.0, 25.0, 11.0),
            dvec3(27.0, 26.0, 1.0),
        ];
        for corners in [
            [pole, pole, end],
            [pole, end, pole],
            [end, pole, pole],
            [pole, pole, pole],
        ] {
            for p in points {
                let (found, [x, y]) = nearest(p, corners);
                let wanted = (0..=1000)
                    .map(|k| {
                        p.distance(corners[0].lerp(
                            if corners[0] == corners[1] {
                                corners[2]
                            } else {
                                corners[1]
                            },
                            f64::from(k) / 1000.0,
                        ))
                    })
                    .fold(f64::INFINITY, f64::min);
                assert!(
                    (found - wanted).abs() < 1e-3,
                    "{corners:?} {p}: {found}, {wanted}"
                );
                let at = corners[0] * (1.0 - x - y) + corners[1] * x + corners[2] * y;
                assert!((at.distance(p) - found).abs() < 1e-9, "{corners:?} {p}: {at}");
            }
        }
    }
}
