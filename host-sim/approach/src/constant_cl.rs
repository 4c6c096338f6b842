//! Existing practice: constant speed of the cutter location (CL). The speed of the contact varies by eqn 4.

use super::chords::{self, Chord, even_chords};
use super::{Approach, ApproachError, Each, PassPath, Program};
use job::Job;

/// A step that leaves less than this share of itself before the end is extended to the end.
const END_SHARE: f64 = 1e-9;

/// The approach for a job.
#[derive(Clone, Copy, Debug)]
pub struct ConstantCl {
    chord_mm: f64,
    feed_mm_s: f64,
}

impl ConstantCl {
    /// The approach with a job's feed, as the speed of the centre, and chord error limit.
    #[must_use]
    pub fn new(job: &Job) -> Self {
        Self {
            chord_mm: job.chord_mm,
            feed_mm_s: job.feed_mm_s(),
        }
    }

    /// Chords of a pass, each with the CL at the feed.
    ///
    /// # Errors
    /// As [`Approach::plan`].
    pub fn chords(&self, pass: &PassPath<'_>) -> Result<Vec<Chord>, ApproachError> {
        let mut chords = even_chords(pass, self.chord_mm, self.feed_mm_s)?;
        for chord in &mut chords {
            chord.speed_mm_s = self.feed_mm_s;
        }
        Ok(chords)
    }
}

impl Approach for ConstantCl {
    fn plan(&self, pass: &PassPath<'_>) -> Result<Box<dyn Program>, ApproachError> {
        Ok(Box::new(ConstantSpeed {
            chords: self.chords(pass)?,
            feed_mm_s: self.feed_mm_s,
        }))
    }
}

/// The chords of one pass, as a CNC would receive them. Followed is the exact path at constant speed, so that the result shows
/// only the effect of the constant speed.
struct ConstantSpeed {
    chords: Vec<Chord>,
    feed_mm_s: f64,
}

impl Program for ConstantSpeed {
    fn segments(&self) -> usize {
        self.chords.len()
    }

    fn write(&self, out: &mut String) {
        chords::write(&self.chords, out);
    }

    fn speed_step_mm_s(&self) -> f64 {
        chords::speed_step_mm_s(&self.chords)
    }

    fn follow(&self, pass: &PassPath<'_>, period_s: f64, each: &mut Each<'_>) -> Result<(), ApproachError> {
        if self.chords.is_empty() {
            return Ok(());
        }
        follow(self.feed_mm_s, pass, period_s, each)
    }
}

/// Follows the CL path of a pass at constant speed.
fn follow(
    feed_mm_s: f64,
    pass: &PassPath<'_>,
    period_s: f64,
    each: &mut Each<'_>,
) -> Result<(), ApproachError> {
    let way = feed_mm_s * period_s;
    let rate = |path: f64| -> Result<f64, ApproachError> {
        let speed = pass.at(pass.kept(path))?.cl_velocity.length();
        Ok(pass.sense() / speed.max(1e-9))
    };
    let mut path = pass.ends[0];
    // Bounded by the length of the path over the distance of a period.
    loop {
        // Runge-Kutta of order 4, with the arc length as the independent variable.
        let first = rate(path)?;
        let second = rate(path + 0.5 * way * first)?;
        let third = rate(path + 0.5 * way * second)?;
        let fourth = rate(path + way * third)?;
        let step = way * (first + 2.0 * (second + third) + fourth) / 6.0;
        if step.abs() * (1.0 + END_SHARE) >= pass.left(path) {
            let end = pass.at(pass.ends[1])?;
            return each(end.contact.cl_mm, end.path);
        }
        path += step;
        each(pass.at(path)?.contact.cl_mm, path)?;
    }
}
