//! A change of the pace as a function of time: to a goal, or up above the plan's own pace, for a while, and back to it.

/// From any rates to rest at a goal.
#[derive(Clone, Copy, Debug)]
struct Quintic {
    coefficients: [f32; 6],
    duration: f32,
}

impl Quintic {
    fn new([r, d, e]: [f32; 3], goal: f32, duration: f32) -> Self {
        let inverse = 1.0 / duration;
        let (h, d, e) = (goal - r, d * duration, e * duration * duration);
        let [i3, i4, i5] = {
            let i2 = inverse * inverse;
            [i2 * inverse, i2 * i2, i2 * i2 * inverse]
        };
        Self {
            coefficients: [
                r,
                d * inverse,
                0.5 * e * inverse * inverse,
                (10.0 * h - 6.0 * d - 1.5 * e) * i3,
                (-15.0 * h + 8.0 * d + 1.5 * e) * i4,
                (6.0 * h - 3.0 * d - 0.5 * e) * i5,
            ],
            duration,
        }
    }

    fn rates(&self, t: f32) -> [f32; 3] {
        let [c0, c1, c2, c3, c4, c5] = self.coefficients;
        [
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
            2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
        ]
    }
}

/// The way back from above the plan's own pace: how long the pace stays there, and which it is.
#[derive(Clone, Copy, Debug)]
struct Return {
    hold_s: f32,
    top: f32,
    quintic: Quintic,
}

/// A change of the pace: from these rates to rest at its end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    to: Quintic,
    back: Option<Return>,
}

impl Change {
    /// To a goal.
    #[inline(never)]
    pub(crate) fn new(rates: [f32; 3], goal: f32, duration: f32) -> Self {
        Self {
            to: Quintic::new(rates, goal, duration),
            back: None,
        }
    }

    /// To a pace above 1 and back to 1. Durations of the rise, of the stay and of the return, s.
    #[inline(never)]
    pub(super) fn above(rates: [f32; 3], top: f32, [rise_s, hold_s, back_s]: [f32; 3]) -> Self {
        Self {
            to: Quintic::new(rates, top, rise_s),
            back: Some(Return {
                hold_s,
                top,
                quintic: Quintic::new([top, 0.0, 0.0], 1.0, back_s),
            }),
        }
    }

    /// Duration, s.
    pub(crate) fn duration(&self) -> f32 {
        let back = self.back.map_or(0.0, |back| back.hold_s + back.quintic.duration);
        self.to.duration + back
    }

    /// r, r', r'' at a time within its duration.
    #[inline(never)]
    pub(crate) fn rates(&self, t: f32) -> [f32; 3] {
        match &self.back {
            Some(back) if t > self.to.duration => {
                let since = t - self.to.duration - back.hold_s;
                if since > 0.0 {
                    back.quintic.rates(since)
                } else {
                    [back.top, 0.0, 0.0]
                }
            }
            _ => self.to.rates(t),
        }
    }

    /// Duration of its first part, to the goal or to the pace above 1, s.
    pub(super) const fn rise_s(&self) -> f32 {
        self.to.duration
    }

    /// The pace above 1 that it goes to, and the time at which it returns, s.
    pub(super) fn above_until(&self) -> Option<(f32, f32)> {
        self.back.map(|back| (back.top, self.to.duration + back.hold_s))
    }
}
