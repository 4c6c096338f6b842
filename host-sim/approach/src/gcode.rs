//! Blocks of G-code: modal words omitted where unchanged, coordinates with a resolution of 0.1 um, feeds with five digits.

use job::units::S_PER_MIN;
use std::fmt::Write;

use glam::DVec3;

/// Resolution of coordinates, mm.
pub const RESOLUTION_MM: f64 = 1e-4;
/// Significant digits of a feed: relative error below 5e-5.
const FEED_DIGITS: i32 = 5;
/// Least angle of an arc, rad. Controllers take less for a full turn: LinuxCNC below 1e-6, Grbl below 5e-7 in single precision. The sagitta of such an arc of 10 m is 0.1 nm.
const ANGLE_MIN: f64 = 1e-5;
const AXES: [&str; 3] = ["X", "Y", "Z"];
const OFFSETS: [&str; 3] = ["I", "J", "K"];

/// Unit of the F words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FeedMode {
    /// mm/min.
    G94,
    /// Inverse time: the block takes 1/F minutes.
    G93,
}

impl FeedMode {
    /// The G word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::G94 => "G94",
            Self::G93 => "G93",
        }
    }
}

/// The plane of an arc. Counterclockwise turns its first axis towards its second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// G17.
    Xy,
    /// G18.
    Zx,
    /// G19.
    Yz,
}

impl Plane {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Xy, Self::Zx, Self::Yz];

    /// The two axes of the plane in the order of counterclockwise rotation, and the axis normal to it: 0, 1, 2 for x, y, z.
    #[must_use]
    pub fn axes(self) -> [usize; 3] {
        match self {
            Self::Xy => [0, 1, 2],
            Self::Zx => [2, 0, 1],
            Self::Yz => [1, 2, 0],
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Xy => "G17",
            Self::Zx => "G18",
            Self::Yz => "G19",
        }
    }
}

/// Shape of a cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Straight.
    Line,
    /// An arc of less than 180 degrees in its plane; the third axis moves in proportion.
    Arc {
        /// Its plane.
        plane: Plane,
        /// Its centre, mm.
        centre_mm: DVec3,
        /// Clockwise in its plane.
        clockwise: bool,
    },
}

/// A cut, of the ball centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// End point, mm.
    pub to_mm: DVec3,
    /// Length, mm.
    pub length_mm: f64,
    /// Speed, mm/s.
    pub speed_mm_s: f64,
    /// Shape.
    pub shape: Shape,
}

impl Cut {
    /// A straight cut.
    #[must_use]
    pub fn line(from_mm: DVec3, to_mm: DVec3, speed_mm_s: f64) -> Self {
        Self {
            to_mm,
            length_mm: to_mm.distance(from_mm),
            speed_mm_s,
            shape: Shape::Line,
        }
    }

    /// Of an arc from this start: its plane, its centre, the arm from there to the start, and the angle by which it turns, positive counterclockwise.
    fn turn(&self, from_mm: DVec3) -> Option<(Plane, DVec3, [f64; 2], f64)> {
        let Shape::Arc {
            plane,
            centre_mm,
            clockwise,
        } = self.shape
        else {
            return None;
        };
        let [first, second, _] = plane.axes();
        let arm = |at: DVec3| [at[first] - centre_mm[first], at[second] - centre_mm[second]];
        let (from, to) = (arm(from_mm), arm(self.to_mm));
        let sense = if clockwise { -1.0 } else { 1.0 };
        let outer = sense * (from[0] * to[1] - from[1] * to[0]);
        let angle = sense * outer.atan2(from[0] * to[0] + from[1] * to[1]);
        Some((plane, centre_mm, from, angle))
    }

    /// Number of equal parts whose chords are within this distance of the cut.
    #[must_use]
    pub fn parts(&self, from_mm: DVec3, chord_mm: f64) -> u32 {
        let Some((_, _, [x, y], angle)) = self.turn(from_mm) else {
            return 1;
        };
        // The sagitta is r (1 - cos(angle / 2)), at most r angle^2 / 8.
        let parts = angle.abs() * (x.hypot(y) / (8.0 * chord_mm)).sqrt();
        parts.ceil().max(1.0) as u32
    }

    /// The position at a share of the way from its start, mm.
    #[must_use]
    pub fn at(&self, from_mm: DVec3, share: f64) -> DVec3 {
        let mut at_mm = from_mm.lerp(self.to_mm, share);
        let Some((plane, centre_mm, from, angle)) = self.turn(from_mm) else {
            return at_mm;
        };
        let [first, second, _] = plane.axes();
        let (sine, cosine) = (share * angle).sin_cos();
        at_mm[first] = centre_mm[first] + from[0] * cosine - from[1] * sine;
        at_mm[second] = centre_mm[second] + from[0] * sine + from[1] * cosine;
        at_mm
    }

    /// Duration, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.length_mm / self.speed_mm_s
    }
}

/// Appends blocks to a text; tracks the modal words.
#[derive(Debug)]
pub struct Blocks<'a> {
    out: &'a mut String,
    feed_mode: FeedMode,
    motion: &'static str,
    plane: Plane,
    /// Position of the tool, in steps of the resolution.
    at: [Option<i64>; 3],
    feed: String,
}

fn steps(mm: f64) -> i64 {
    (mm / RESOLUTION_MM).round() as i64
}

/// Formats a number of steps as a coordinate without trailing zeros.
fn push_steps(out: &mut String, letter: &str, steps: i64) {
    let (sign, steps) = (if steps < 0 { "-" } else { "" }, steps.unsigned_abs());
    let (whole, rest) = (steps / 10_000, steps % 10_000);
    // Writing to a `String` cannot fail.
    let _ = write!(out, "{letter}{sign}{whole}");
    if rest > 0 {
        out.push('.');
        out.push_str(format!("{rest:04}").trim_end_matches('0'));
    }
}

/// Formats a feed.
fn feed_digits(feed: f64) -> String {
    let decimals = (FEED_DIGITS - 1 - feed.log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{feed:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

impl<'a> Blocks<'a> {
    /// Appends to this text; assumes plane XY and no other modal state.
    #[must_use]
    pub fn new(out: &'a mut String, feed_mode: FeedMode) -> Self {
        Self {
            out,
            feed_mode,
            motion: "",
            plane: Plane::Xy,
            at: [None; 3],
            feed: String::new(),
        }
    }

    /// Appends a line unchanged.
    pub fn line(&mut self, text: &str) {
        self.out.push_str(text);
        self.out.push('\n');
    }

    /// Appends a comment; characters that are not allowed in it are replaced.
    pub fn comment(&mut self, text: &str) {
        let clean = text.chars().map(|c| match c {
            '(' | ')' | ';' | '%' | '!' | '?' | '~' => '_',
            c if c == ' ' || c.is_ascii_graphic() => c,
            _ => '_',
        });
        let clean: String = clean.collect();
        self.line(&format!("({clean})"));
    }

    /// Sets the position without a block.
    pub fn start(&mut self, at_mm: DVec3) {
        self.at = at_mm.to_array().map(|mm| Some(steps(mm)));
    }

    /// Appends a rapid move of some axes.
    pub fn rapid(&mut self, to_mm: [Option<f64>; 3]) {
        self.block("G0", to_mm.map(|mm| mm.map(steps)), "", None);
    }

    /// Appends a cut. A cut of zero length, at the resolution, is omitted.
    pub fn cut(&mut self, cut: &Cut) {
        let to = cut.to_mm.to_array().map(|mm| Some(steps(mm)));
        if to == self.at {
            // Computed before the plane word is written.
            return;
        }
        let (motion, offsets) = match cut.shape {
            Shape::Arc {
                plane,
                centre_mm,
                clockwise,
            } if !self.turns(plane, centre_mm, clockwise, to) => ("G1", String::new()),
            Shape::Line => ("G1", String::new()),
            Shape::Arc {
                plane,
                centre_mm,
                clockwise,
            } => {
                if plane != self.plane {
                    self.out.push_str(plane.word());
                    self.plane = plane;
                }
                let mut words = String::new();
                let [first, second, _] = plane.axes();
                for axis in [first.min(second), first.max(second)] {
                    let from = self.at[axis].unwrap_or_default();
                    push_steps(&mut words, OFFSETS[axis], steps(centre_mm[axis]) - from);
                }
                (if clockwise { "G2" } else { "G3" }, words)
            }
        };
        let feed = match self.feed_mode {
            FeedMode::G94 => cut.speed_mm_s * S_PER_MIN,
            FeedMode::G93 => S_PER_MIN / cut.time_s(),
        };
        self.block(motion, to, &offsets, Some(feed_digits(feed)));
    }

    /// Whether an arc between the rounded ends around the rounded centre turns by enough to be written as one: its ends may be rounded to one place in its plane, or to
    /// places in one direction from the centre.
    fn turns(&self, plane: Plane, centre_mm: DVec3, clockwise: bool, to: [Option<i64>; 3]) -> bool {
        let [first, second, _] = plane.axes();
        let arm = |at: &[Option<i64>; 3]| {
            [first, second].map(|axis| (at[axis].unwrap_or_default() - steps(centre_mm[axis])) as f64)
        };
        let (from, to) = (arm(&self.at), arm(&to));
        let sense = if clockwise { -1.0 } else { 1.0 };
        let outer = sense * (from[0] * to[1] - from[1] * to[0]);
        let angle = outer.atan2(from[0] * to[0] + from[1] * to[1]);
        // At a small radius, rounding alone turns by half of a step.
        angle > ANGLE_MIN.max(0.5 / from[0].hypot(from[1]).max(1.0))
    }

    fn block(&mut self, motion: &'static str, to: [Option<i64>; 3], offsets: &str, feed: Option<String>) {
        if self.at.iter().zip(to).all(|(at, to)| to.is_none() || to == *at) {
            return;
        }
        if motion != self.motion {
            self.out.push_str(motion);
            self.motion = motion;
        }
        for ((at, to), axis) in self.at.iter_mut().zip(to).zip(AXES) {
            if let Some(to) = to.filter(|to| *at != Some(*to)) {
                push_steps(self.out, axis, to);
                *at = Some(to);
            }
        }
        self.out.push_str(offsets);
        if let Some(feed) = feed {
            // An inverse-time feed applies only to its block.
            if self.feed_mode == FeedMode::G93 || feed != self.feed {
                self.out.push('F');
                self.out.push_str(&feed);
            }
            self.feed = feed;
        }
        self.out.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(feed_mode: FeedMode, cuts: &[Cut]) -> String {
        let mut out = String::new();
        let mut blocks = Blocks::new(&mut out, feed_mode);
        blocks.start(DVec3::ZERO);
        cuts.iter().for_each(|cut| blocks.cut(cut));
        out
    }

    #[test]
    fn words_that_hold_are_left_out() {
        let (corner, above) = (DVec3::new(3.0, -4.0, 0.0), DVec3::new(3.0, -4.0, 0.12));
        let lines = [
            Cut::line(DVec3::ZERO, corner, 10.0),
            Cut::line(corner, DVec3::new(3.0, -4.000_04, 0.0), 10.0),
            Cut::line(corner, above, 10.0),
            Cut::line(above, DVec3::new(0.0, 0.0, 0.12), 10.123_456),
        ];
        assert_eq!(text(FeedMode::G94, &lines), "G1X3Y-4F600\nZ0.12\nX0Y0F607.41\n");
        assert_eq!(
            text(FeedMode::G93, &lines),
            "G1X3Y-4F120\nZ0.12F5000\nX0Y0F121.48\n"
        );
    }

    #[test]
    fn places_of_an_arc_are_on_its_circle() {
        let from_mm = DVec3::new(5.0, 0.0, 0.0);
        let arc = Cut {
            to_mm: DVec3::new(0.0, -5.0, 2.0),
            length_mm: 1.0,
            speed_mm_s: 1.0,
            shape: Shape::Arc {
                plane: Plane::Xy,
                centre_mm: DVec3::ZERO,
                clockwise: true,
            },
        };
        assert!(arc.at(from_mm, 1.0).distance(arc.to_mm) < 1e-12);
        let half = 5.0 * std::f64::consts::FRAC_1_SQRT_2;
        assert!(arc.at(from_mm, 0.5).distance(DVec3::new(half, -half, 1.0)) < 1e-12);
    }

    /// Equal ends in the plane of an arc are a full turn in G-code.
    #[test]
    fn an_arc_without_a_turn_in_its_plane_is_a_line() {
        let arc = |to_mm| Cut {
            to_mm,
            length_mm: 0.003,
            speed_mm_s: 10.0,
            shape: Shape::Arc {
                plane: Plane::Xy,
                centre_mm: DVec3::new(0.0, 1.0, 0.0),
                clockwise: false,
            },
        };
        let steep = [arc(DVec3::new(3e-5, 1e-5, 0.003))];
        assert_eq!(text(FeedMode::G94, &steep), "G1Z0.003F600\n");
        // A step towards the centre does not turn, either.
        let inwards = [arc(DVec3::new(4e-5, 6e-5, 0.003))];
        assert_eq!(text(FeedMode::G94, &inwards), "G1Y0.0001Z0.003F600\n");
        let step = [arc(DVec3::new(6e-5, 0.0, 0.003))];
        assert_eq!(text(FeedMode::G94, &step), "G3X0.0001Z0.003I0J1F600\n");
    }

    /// LinuxCNC takes an arc of less than 1e-6 rad for a full turn, Grbl one of 5e-7 rad.
    #[test]
    fn an_arc_of_a_small_angle_is_a_line() {
        for (radius_mm, letter) in [(10_000.0, "G1"), (90.0, "G3")] {
            let arc = Cut {
                to_mm: DVec3::new(0.002, 0.0, 0.0),
                length_mm: 0.002,
                speed_mm_s: 10.0,
                shape: Shape::Arc {
                    plane: Plane::Xy,
                    centre_mm: DVec3::new(0.0, radius_mm, 0.0),
                    clockwise: false,
                },
            };
            assert!(text(FeedMode::G94, &[arc]).starts_with(letter), "{radius_mm}");
        }
    }

    #[test]
    fn arcs_name_their_plane_once() {
        let arc = |to_mm| Cut {
            to_mm,
            length_mm: 5.0 * std::f64::consts::FRAC_PI_2,
            speed_mm_s: 1.0,
            shape: Shape::Arc {
                plane: Plane::Zx,
                centre_mm: DVec3::new(5.0, 0.0, 0.0),
                clockwise: false,
            },
        };
        let cuts = [arc(DVec3::new(5.0, 0.0, 5.0)), arc(DVec3::new(10.0, 0.0, 0.0))];
        assert_eq!(text(FeedMode::G94, &cuts), "G18G3X5Z5I5K0F60\nX10Z0I0K-5\n");
    }
}
