//! Method 1: cutter contacts by chord error, the CL points joined by straight segments, each at the speed that keeps the contact
//! at the feed (Lo eqns 6, 7), followed by a linear interpolator that divides a segment into whole periods.

use super::chords::{self, Chord, Chords, even_chords};
use super::{Approach, ApproachError, Each, PassPath, Program};
use job::Job;

/// Rounding tolerance of the duration of a segment, periods: an excess below it adds no period.
const PERIOD_SLACK: f64 = 1e-9;

/// The approach for a job.
#[derive(Clone, Copy, Debug)]
pub struct Linear {
    chords: Chords,
    chord_mm: f64,
    feed_mm_s: f64,
}

impl Linear {
    /// The approach with a job's feed and chord error limit.
    #[must_use]
    pub fn new(job: &Job, chords: Chords) -> Self {
        Self {
            chords,
            chord_mm: job.chord_mm,
            feed_mm_s: job.feed_mm_s(),
        }
    }
}

impl Approach for Linear {
    fn plan(&self, pass: &PassPath<'_>) -> Result<Box<dyn Program>, ApproachError> {
        let chords = match self.chords {
            Chords::Held => even_chords(pass, self.chord_mm, self.feed_mm_s)?,
            equation => chords::chords(pass, equation, self.chord_mm, self.feed_mm_s)?,
        };
        Ok(Box::new(WholePeriods(chords)))
    }
}

/// The chords of one pass, each followed in whole sampling periods, as in a traditional linear interpolator.
struct WholePeriods(Vec<Chord>);

impl Program for WholePeriods {
    fn segments(&self) -> usize {
        self.0.len()
    }

    fn write(&self, out: &mut String) {
        chords::write(&self.0, out);
    }

    fn speed_step_mm_s(&self) -> f64 {
        chords::speed_step_mm_s(&self.0)
    }

    fn follow(&self, pass: &PassPath<'_>, period_s: f64, each: &mut Each<'_>) -> Result<(), ApproachError> {
        let mut begin = pass.ends[0];
        for chord in &self.0 {
            let apart = chord.to_mm - chord.from_mm;
            let periods = (apart.length() / (chord.speed_mm_s * period_s) - PERIOD_SLACK)
                .ceil()
                .max(1.0);
            let mut period = 1.0;
            while period <= periods {
                let share = period / periods;
                each(
                    chord.from_mm + apart * share,
                    begin + (chord.path - begin) * share,
                )?;
                period += 1.0;
            }
            begin = chord.path;
        }
        Ok(())
    }
}
