//! Cubic splines over fixed stations.

/// A C2 cubic spline over ascending stations. Its end slopes are those of the parabola through three stations.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    stations: Vec<f64>,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Spline {
    /// The spline through `values` at `stations`, at least three.
    #[must_use]
    pub fn new(stations: &[f64], values: Vec<f64>) -> Self {
        let slopes = spline_slopes(stations, &values);
        Self {
            stations: stations.to_vec(),
            values,
            slopes,
        }
    }

    /// Stations.
    #[must_use]
    pub fn stations(&self) -> &[f64] {
        &self.stations
    }

    /// Values at the stations.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Slopes at the stations.
    #[must_use]
    pub fn slopes(&self) -> &[f64] {
        &self.slopes
    }

    /// Value, first and second derivative at `x`; beyond the ends the end's cubic.
    #[must_use]
    pub fn at(&self, x: f64) -> [f64; 3] {
        let last = self.stations.len() - 1;
        let k = self.stations.partition_point(|at| *at <= x).clamp(1, last) - 1;
        let width = self.stations[k + 1] - self.stations[k];
        let t = (x - self.stations[k]) / width;
        let rise = self.values[k + 1] - self.values[k];
        let (first, second) = (width * self.slopes[k], width * self.slopes[k + 1]);
        let c = 3.0 * rise - 2.0 * first - second;
        let d = first + second - 2.0 * rise;
        [
            self.values[k] + t * (first + t * (c + t * d)),
            (first + t * (2.0 * c + 3.0 * t * d)) / width,
            (2.0 * c + 6.0 * t * d) / (width * width),
        ]
    }
}

/// Slope at the first of three points of the parabola through them.
fn end_slope(x: [f64; 3], y: [f64; 3]) -> f64 {
    let (near, far) = (x[1] - x[0], x[2] - x[0]);
    ((y[1] - y[0]) * far / near - (y[2] - y[0]) * near / far) / (far - near)
}

/// Slopes of the C2 spline (de Boor, "A Practical Guide to Splines", chapter IV): a tridiagonal system.
fn spline_slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let first = end_slope([x[0], x[1], x[2]], [y[0], y[1], y[2]]);
    let last = end_slope([x[n - 1], x[n - 2], x[n - 3]], [y[n - 1], y[n - 2], y[n - 3]]);
    let mut slopes = vec![0.0; n];
    // Forward elimination: slope[i] = value[i] - factor[i] slope[i + 1].
    let mut factor = vec![0.0; n];
    slopes[0] = first;
    for i in 1..n - 1 {
        let (before, after) = (x[i] - x[i - 1], x[i + 1] - x[i]);
        let (below, above) = (1.0 / before, 1.0 / after);
        let diagonal = 2.0 * (below + above);
        let right = 3.0 * ((y[i] - y[i - 1]) / (before * before) + (y[i + 1] - y[i]) / (after * after));
        let pivot = diagonal - below * factor[i - 1];
        factor[i] = above / pivot;
        slopes[i] = (right - below * slopes[i - 1]) / pivot;
    }
    slopes[n - 1] = last;
    for i in (1..n - 1).rev() {
        slopes[i] -= factor[i] * slopes[i + 1];
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spline with end slopes by parabolas is exact for a parabola.
    #[test]
    fn a_parabola_is_exact() {
        let x = [0.0, 0.1, 0.15, 0.3, 0.5, 0.6, 1.0];
        let parabola = |x: f64| 3.0 - 2.0 * x + 5.0 * x * x;
        let spline = Spline::new(&x, x.iter().map(|x| parabola(*x)).collect());
        for k in 0..=50 {
            let at = f64::from(k) / 50.0;
            let [value, first, second] = spline.at(at);
            assert!((value - parabola(at)).abs() < 1e-13, "{at}");
            assert!((first - (10.0 * at - 2.0)).abs() < 1e-12 && (second - 10.0).abs() < 1e-10);
        }
    }
}
