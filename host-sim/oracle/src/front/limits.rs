//! What lowers a front until slope and turning can be followed.

use super::FrontOptions;
use super::strip::Forms;

/// Limits of slope and turning at the stations.
pub(super) struct Limits<'a> {
    x: &'a [f64],
    /// Greatest rise of each interval, and greatest fall.
    up: Vec<f64>,
    down: Vec<f64>,
    /// Greatest increase of the slope from interval to interval, at each station.
    more: Vec<f64>,
    /// Twice integrated greatest decrease of the slope.
    bend: Vec<f64>,
}

impl<'a> Limits<'a> {
    /// `forms` and `slopes` at the stations of the front half a step out.
    pub(super) fn new(
        x: &'a [f64],
        forms: &[Forms],
        slopes: &[f64],
        sample_mm: f64,
        options: &FrontOptions,
    ) -> Self {
        let n = x.len();
        let tan = options.angle_max_rad.tan();
        let slope = |form: &Forms, sign: f64| {
            let under = form.area - sign * form.f * tan;
            if under > 1e-9 * form.e {
                form.e * tan / under
            } else {
                f64::INFINITY
            }
        };
        let lesser =
            |i: usize, sign: f64| slope(&forms[i], sign).min(slope(&forms[i + 1], sign)) * (x[i + 1] - x[i]);
        let up = (0..n - 1).map(|i| lesser(i, 1.0)).collect();
        let down = (0..n - 1).map(|i| lesser(i, -1.0)).collect();
        // A turn by 1 rad changes the slope by |T|^2 / D.
        let per_turn: Vec<f64> = (0..n)
            .map(|i| forms[i].speed_squared(slopes[i]) / forms[i].area)
            .collect();
        // An interval may not turn by more than its length over the least radius.
        let turns = |i: usize, most: f64| {
            let (form, p) = (&forms[i], slopes[i]);
            let speed = form.speed_squared(p).sqrt();
            let tan = (form.f + form.g * p).abs() / form.area;
            let radius = options.radius_min * sample_mm * (1.0 + tan);
            let before = if i > 0 { x[i] - x[i - 1] } else { x[1] };
            let after = if i + 1 < n { x[i + 1] - x[i] } else { before };
            most.min(0.5 * (before + after) * speed / radius)
        };
        let more = (0..n)
            .map(|i| per_turn[i] * turns(i, options.turn_towards))
            .collect();
        let mut bend = vec![0.0; n];
        let mut slope = 0.0;
        for i in 1..n {
            if i > 1 {
                slope += per_turn[i - 1] * turns(i - 1, options.turn_away);
            }
            bend[i] = bend[i - 1] + slope * (x[i] - x[i - 1]);
        }
        Self {
            x,
            up,
            down,
            more,
            bend,
        }
    }

    pub(super) fn lower(&self, new: &mut [f64]) {
        let (n, x) = (new.len(), self.x);
        for i in 0..n - 1 {
            new[i + 1] = new[i + 1].min(new[i] + self.up[i]);
        }
        for i in (0..n - 1).rev() {
            new[i] = new[i].min(new[i + 1] + self.down[i]);
        }
        // A valley would become a corner: from its bottom outwards.
        let share = |slope: f64| if slope > 0.0 { 1.0 } else { 0.5 };
        for i in 1..n - 1 {
            let slope = (new[i] - new[i - 1]) / (x[i] - x[i - 1]);
            let most = slope.max(0.0) + self.more[i] * share(slope);
            new[i + 1] = new[i + 1].min(new[i] + (x[i + 1] - x[i]) * most);
        }
        for i in (1..n - 1).rev() {
            let slope = (new[i] - new[i + 1]) / (x[i + 1] - x[i]);
            let most = slope.max(0.0) + self.more[i] * share(slope);
            new[i - 1] = new[i - 1].min(new[i] + (x[i] - x[i - 1]) * most);
        }
        self.cut_crests(new);
    }

    /// Lower convex hull (monotone chain) of the front plus its permitted bend.
    fn cut_crests(&self, new: &mut [f64]) {
        let x = self.x;
        let y: Vec<f64> = new.iter().zip(&self.bend).map(|(y, q)| y + q).collect();
        let mut hull: Vec<usize> = Vec::with_capacity(x.len());
        for i in 0..x.len() {
            while let [.., a, b] = hull[..]
                && (y[b] - y[a]) * (x[i] - x[b]) >= (y[i] - y[b]) * (x[b] - x[a])
            {
                hull.pop();
            }
            hull.push(i);
        }
        for pair in hull.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            for i in a + 1..b {
                let line = y[a] + (y[b] - y[a]) * (x[i] - x[a]) / (x[b] - x[a]);
                new[i] = new[i].min(line - self.bend[i]);
            }
        }
    }
}
