//! Speeds of contact and centre, period by period, measured the same way for every approach.

use glam::DVec3;
use oracle::PassSample;

/// Mean speeds over one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodSpeed {
    /// Time at the period's end since the pass began, s.
    pub time_s: f64,
    /// Length of the contact's path since the pass began, at the period's middle, mm.
    pub arc_mm: f64,
    /// Speed of the contact along the surface, mm/s.
    pub cc_mm_s: f64,
    /// Speed of the tool centre, mm/s.
    pub cl_mm_s: f64,
}

/// Least, mean and largest speed over complete periods, mm/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedRange {
    /// Least; infinite without complete periods.
    pub min: f64,
    /// Largest.
    pub max: f64,
    sum: f64,
    periods: f64,
}

impl Default for SpeedRange {
    fn default() -> Self {
        Self {
            min: f64::INFINITY,
            max: 0.0,
            sum: 0.0,
            periods: 0.0,
        }
    }
}

impl SpeedRange {
    fn add(&mut self, speed: f64) {
        self.min = self.min.min(speed);
        self.max = self.max.max(speed);
        self.sum += speed;
        self.periods += 1.0;
    }

    /// Mean over time; 0 without complete periods.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.sum / self.periods.max(1.0)
    }
}

/// Speeds of a run. The last period of each pass is incomplete and is left out of the speeds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedFigures {
    /// Speed of the contact along the surface.
    pub cc: SpeedRange,
    /// Speed of the tool centre.
    pub cl: SpeedRange,
    /// Largest change of the centre's speed from one period to the next, mm/s.
    pub cl_change_mm_s: f64,
    /// Largest step of the commanded speed of the centre, mm/s: from segment to segment; for the core from patch to
    /// patch. The commanded speed is continuous elsewhere.
    pub cl_step_mm_s: f64,
    /// Length of the tool centre's path within the passes, mm.
    pub cl_length_mm: f64,
}

/// Accumulates the speeds of a run, sample by sample.
#[derive(Clone, Debug)]
pub struct SpeedRecorder {
    period_s: f64,
    figures: SpeedFigures,
    before_mm: DVec3,
    time_s: f64,
    arc_mm: f64,
    last: Option<f64>,
}

impl SpeedRecorder {
    /// A recorder for a run with this period.
    #[must_use]
    pub fn new(period_s: f64) -> Self {
        Self {
            period_s,
            figures: SpeedFigures::default(),
            before_mm: DVec3::ZERO,
            time_s: 0.0,
            arc_mm: 0.0,
            last: None,
        }
    }

    /// Adds the next sample. `arc_mm`: arc length of the contact since the previous sample of the same pass; `cl_mm`: the centre.
    /// Returns the speeds over the period that ends at this sample.
    pub fn add(&mut self, sample: &PassSample, arc_mm: Option<f64>, cl_mm: DVec3) -> Option<PeriodSpeed> {
        let way_mm = cl_mm.distance(self.before_mm);
        self.before_mm = cl_mm;
        let Some(arc_mm) = arc_mm else {
            (self.time_s, self.arc_mm, self.last) = (0.0, 0.0, None);
            return None;
        };
        self.figures.cl_length_mm += way_mm;
        self.time_s += self.period_s;
        self.arc_mm += arc_mm;
        let speed = PeriodSpeed {
            time_s: self.time_s,
            arc_mm: self.arc_mm - 0.5 * arc_mm,
            cc_mm_s: arc_mm / self.period_s,
            cl_mm_s: way_mm / self.period_s,
        };
        if sample.last_of_pass || sample.feed_mm_s <= 0.0 {
            self.last = None;
            return Some(speed);
        }
        self.figures.cc.add(speed.cc_mm_s);
        self.figures.cl.add(speed.cl_mm_s);
        if let Some(last) = self.last.replace(speed.cl_mm_s) {
            self.figures.cl_change_mm_s = self.figures.cl_change_mm_s.max((speed.cl_mm_s - last).abs());
        }
        Some(speed)
    }

    /// The speeds, with the largest step of the commanded speed.
    #[must_use]
    pub fn finish(self, cl_step_mm_s: f64) -> SpeedFigures {
        SpeedFigures {
            cl_step_mm_s,
            ..self.figures
        }
    }
}
