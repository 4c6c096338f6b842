//! Errors found by a verification, and their bounds.

/// Location and tick of an extreme value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleLocation {
    /// Tick of the sample.
    pub tick: u64,
    /// Pass, from 0.
    pub pass: u32,
    /// Parameter u.
    pub u: f64,
    /// Parameter v.
    pub v: f64,
}

/// Statistics of a quantity over many samples: largest magnitude with its location, and root mean square.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorStatistics {
    /// Largest magnitude; infinite if any value was NaN.
    pub max: f64,
    /// Location of the largest magnitude.
    pub at: SampleLocation,
    /// Number of values.
    pub count: u64,
    sum_of_squares: f64,
}

impl ErrorStatistics {
    /// These, unless there are no values.
    #[must_use]
    pub fn measured(&self) -> Option<&Self> {
        (self.count > 0).then_some(self)
    }

    /// Largest magnitude; `None` without values.
    #[must_use]
    pub fn largest(&self) -> Option<f64> {
        self.measured().map(|errors| errors.max.abs())
    }

    /// Root mean square; 0 without values.
    #[must_use]
    pub fn rms(&self) -> f64 {
        if self.count == 0 {
            0.0
        } else {
            (self.sum_of_squares / self.count as f64).sqrt()
        }
    }

    pub(super) fn add(&mut self, value: f64, at: SampleLocation) {
        let magnitude = if value.is_nan() {
            f64::INFINITY
        } else {
            value.abs()
        };
        self.count += 1;
        self.sum_of_squares += magnitude * magnitude;
        if magnitude > self.max {
            self.max = magnitude;
            self.at = at;
        }
    }
}

/// An error with the bound that applies to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccuracyFigure {
    /// Name in a sentence.
    pub name: &'static str,
    /// What is measured.
    pub label: &'static str,
    /// The errors; none where the figure does not apply to the job.
    pub errors: ErrorStatistics,
    /// Largest permitted magnitude.
    pub bound: f64,
    /// Unit of both.
    pub unit: &'static str,
}

impl AccuracyFigure {
    /// Whether no error exceeds the bound.
    #[must_use]
    pub fn is_met(&self) -> bool {
        self.errors.max.abs() <= self.bound
    }
}

/// Result of a verification. Every error is emitted against oracle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AccuracyReport {
    /// Number of samples.
    pub samples: u64,
    /// Number of passes.
    pub passes: u32,
    /// |CL emitted - CL|, nm. Rounding to whole nanometres alone gives up to 0.87.
    pub position_nm: ErrorStatistics,
    /// |CC emitted - CC|, nm. Rounding as above.
    pub contact_nm: ErrorStatistics,
    /// Angle between (CL - CC) as emitted and N, rad. Rounding alone gives up to 1.7 nm / r: see `normal_floor_rad`.
    pub normal_rad: ErrorStatistics,
    /// Largest contribution of rounding to whole nanometres to `normal_rad`: sqrt(3) nm / r.
    pub normal_floor_rad: f64,
    /// 100 (arc / (f T) - 1), %, of every step within a pass but the last; f is the feed of the step's second sample.
    pub ripple_pct: ErrorStatistics,
    /// Arc of the last step of a pass as a share of f T: above 0 and at most 1.
    pub last_step: ErrorStatistics,
    /// Emitted interval candidate / oracle's - 1, where either is shorter than the side range.
    pub interval: ErrorStatistics,
    /// (side parameter of a pass - (that of the previous pass + its least interval)) / that interval. The sum is limited to
    /// the boundary; the minimum is over the emitted samples. Only for passes spaced by the first order.
    pub side_step: ErrorStatistics,
    /// Largest scallop height after each pass by Lo's formula (eqn 11), mm: h times (actual / candidate interval)^2.
    pub scallop_mm: ErrorStatistics,
    /// Sum of that height over all samples of all passes except the last, and the number of these samples.
    pub(super) scallop_sum_mm: f64,
    pub(super) scallop_samples: u64,
    /// Ball radius times the largest principal curvature towards the tool: a local gouge at 1 or more.
    pub fit: ErrorStatistics,
    /// Length of all passes, mm.
    pub cc_length_mm: f64,
    /// Samples where the surface has no normal.
    pub degenerate: u64,
    /// Passes that do not start or end exactly on the path parameter's boundaries.
    pub off_boundary: u32,
    /// Samples whose side parameter differs from that of their pass, or that run against the pass direction.
    pub off_pass: u64,
    /// The first pass lies exactly on the first boundary of the side parameter.
    pub first_on_boundary: bool,
    /// The last pass lies exactly on the other boundary.
    pub last_on_boundary: bool,
    /// The last pass was complete when the verification ended.
    pub complete: bool,
}

impl AccuracyReport {
    /// Mean of the scallop height over all samples, mm; 0 with a single pass.
    #[must_use]
    pub fn scallop_mean_mm(&self) -> f64 {
        if self.scallop_samples == 0 {
            0.0
        } else {
            self.scallop_sum_mm / self.scallop_samples as f64
        }
    }

    /// Whether every error is within its bound and every pass is where the schedule puts it.
    #[must_use]
    pub fn passed(&self, bounds: &AccuracyBounds) -> bool {
        self.failures(bounds).is_empty()
    }

    /// Every error with the bound that applies to it.
    #[must_use]
    pub fn figures(&self, bounds: &AccuracyBounds) -> [AccuracyFigure; 8] {
        let figure = |name, label, errors: ErrorStatistics, bound, unit| AccuracyFigure {
            name,
            label,
            errors,
            bound,
            unit,
        };
        let normal_rad = bounds.normal_rad + self.normal_floor_rad;
        let whole_step = 1.0 + bounds.ripple_pct / 100.0;
        [
            figure(
                "position error",
                "cutter location",
                self.position_nm,
                bounds.position_nm,
                "nm",
            ),
            figure(
                "contact error",
                "cutter contact",
                self.contact_nm,
                bounds.contact_nm,
                "nm",
            ),
            figure("normal error", "tool normal", self.normal_rad, normal_rad, "rad"),
            figure(
                "feed ripple",
                "feed ripple",
                self.ripple_pct,
                bounds.ripple_pct,
                "%",
            ),
            figure(
                "last step of a pass",
                "last step of a pass",
                self.last_step,
                whole_step,
                "of a full step",
            ),
            figure(
                "path interval error",
                "interval candidates",
                self.interval,
                bounds.interval,
                "(relative)",
            ),
            figure(
                "error of the pass position",
                "step to the next pass",
                self.side_step,
                bounds.side_step,
                "of its interval",
            ),
            figure(
                "curvature times ball radius",
                "ball fits (r k)",
                self.fit,
                bounds.fit,
                "",
            ),
        ]
    }

    /// One sentence per error that exceeds its bound.
    #[must_use]
    pub fn failures(&self, bounds: &AccuracyBounds) -> Vec<String> {
        let mut failures: Vec<String> = self
            .figures(bounds)
            .into_iter()
            .filter(|figure| !figure.is_met())
            .map(|figure| {
                let SampleLocation { tick, pass, u, v } = figure.errors.at;
                format!(
                    "{} {:.6e} {} exceeds {:.6e} at tick {tick}, pass {pass}, u = {u}, v = {v}",
                    figure.name, figure.errors.max, figure.unit, figure.bound
                )
            })
            .collect();
        let counts = [
            (self.degenerate, "samples without a surface normal"),
            (
                u64::from(self.off_boundary),
                "passes that do not start and end on the boundaries",
            ),
            (self.off_pass, "samples off their pass or against its direction"),
        ];
        failures.extend(
            counts
                .iter()
                .filter(|(count, _)| *count > 0)
                .map(|(count, what)| format!("{count} {what}")),
        );
        let conditions = [
            (self.first_on_boundary, "the first pass is not on the boundary"),
            (self.last_on_boundary, "the last pass is not on the boundary"),
            (self.complete, "the last pass is not complete"),
        ];
        failures.extend(
            conditions
                .iter()
                .filter(|(met, _)| !met)
                .map(|(_, what)| (*what).to_owned()),
        );
        failures
    }
}

/// Bounds of a verification, each on the largest magnitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccuracyBounds {
    /// Cutter location, nm.
    pub position_nm: f64,
    /// Cutter contact, nm.
    pub contact_nm: f64,
    /// Normal, rad, in addition to the rounding of the emitted positions.
    pub normal_rad: f64,
    /// Feed ripple, %.
    pub ripple_pct: f64,
    /// Interval candidate, relative.
    pub interval: f64,
    /// Side parameter of a pass, as a share of its interval.
    pub side_step: f64,
    /// Ball radius times curvature towards the tool.
    pub fit: f64,
}

impl Default for AccuracyBounds {
    /// A tenth of a micrometre is the resolution of a good machine; the 32-bit core has to stay a decade below it.
    fn default() -> Self {
        Self {
            position_nm: 10.0,
            contact_nm: 10.0,
            normal_rad: 1e-6,
            ripple_pct: 0.01,
            interval: 1e-4,
            side_step: 1e-4,
            fit: 1.0,
        }
    }
}
