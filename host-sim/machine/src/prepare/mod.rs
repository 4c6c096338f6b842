//! Converts a job to the data that the machine loads: header and words. Knots are split and degrees elevated exactly, so every
//! piece is one bicubic patch (rational where the surface is); ranges become patches with centred parameters.
//!
//! ```text
//! SurfaceSpec ──patches──► bicubic pieces over any rectangle ──► records of the core ──grid.rs──► Prepared
//! ```

mod axes;
mod fronts;
mod geometry;
mod grid;
mod region;
mod steps;
pub(crate) mod stream;

use interp_core::sample::SpanParameter;
use interp_core::{Header, Pattern, RunStart, Spacing, StepConfig, SurfaceKind, ToolSide, encode};

use job::{Along, AlongChoice, Job, JobError, StartChoice, SurfaceSpec};
use patches::pieces::Source;

pub use axes::safe_z_mm;
pub(crate) use geometry::SurfaceEvaluator;
pub use steps::{config as step_config, configuration};
pub use stream::streamed;

/// One parameter of the prepared surface: its spans, in the parameter's own units.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSpans {
    /// Ends of the spans, ascending, one more than there are spans.
    pub breaks: Vec<f64>,
}

impl ParameterSpans {
    /// The parameter at a place, to f64 precision; exact at a span's ends.
    #[must_use]
    pub fn parameter(&self, place: SpanParameter) -> f64 {
        let span = usize::from(place.span);
        let (start, end) = (self.breaks[span], self.breaks[span + 1]);
        if place.fraction == u64::MAX {
            return end;
        }
        #[allow(clippy::cast_precision_loss, reason = "the nearest f64 is wanted")]
        let fraction = place.fraction as f64 / 18_446_744_073_709_551_616.0;
        start + (end - start) * fraction
    }

    /// Spans of the grid.
    #[must_use]
    pub fn spans(&self) -> usize {
        self.breaks.len() - 1
    }
}

/// A job in the form that the machine loads.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepared {
    /// The header.
    pub header: Header,
    /// The surface's data.
    pub words: Vec<i32>,
    /// The path parameter.
    pub path: ParameterSpans,
    /// The side parameter.
    pub side: ParameterSpans,
    /// Which of u and v is the path parameter.
    pub along: Along,
    /// Step output, if the job gives one.
    pub steps: Option<StepConfig>,
    /// Rows of a streamed job that have to be in the store at once.
    pub least_rows: usize,
    /// Where a run begins: at the start of the job, or where a run that was cut short is resumed.
    pub start: RunStart,
}

impl Prepared {
    /// (u, v) of a place on the path and one on the side parameter.
    #[must_use]
    pub fn parameters(&self, path: SpanParameter, side: SpanParameter) -> [f64; 2] {
        let (path, side) = (self.path.parameter(path), self.side.parameter(side));
        match self.along {
            Along::U => [path, side],
            Along::V => [side, path],
        }
    }

    /// The core's unit of the side parameter in a span, in the parameter's own: 1, except where the widths of the spans make derivatives continuous.
    #[must_use]
    pub fn side_unit(&self, span: u16) -> f32 {
        let span = usize::from(span);
        let own = self.side.breaks.get(span..).and_then(<[f64]>::first_chunk);
        let word = self
            .words
            .get(span)
            .map(|word| f32::from_bits(word.cast_unsigned()));
        match (own, word) {
            (Some([start, end]), Some(width)) => {
                #[allow(clippy::cast_possible_truncation, reason = "the machine's own precision")]
                let unit = (end - start) as f32 / width;
                unit
            }
            _ => 1.0,
        }
    }

    /// Size of the header and of the surface's data in the machine's memory, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.header) + self.data_bytes()
    }

    /// Size of the surface's data in the machine's memory, bytes.
    #[must_use]
    pub fn data_bytes(&self) -> usize {
        size_of_val(self.words.as_slice())
    }

    /// Number of patches.
    #[must_use]
    pub fn patches(&self) -> usize {
        self.path.spans() * self.side.spans()
    }
}

/// Prepares a job.
///
/// # Errors
/// The surface cannot be encoded: coordinates out of the core's range, weights that vary too much, a surface without an
/// upper side where `side = "up"`, `along = "auto"` without a trial; with the location in the job file.
pub fn prepare(job: &Job) -> Result<Prepared, JobError> {
    if job.origin.along_choice() == &AlongChoice::Auto {
        return Err(job.origin.error(
            "cut.along",
            "the direction of the passes has not been chosen",
            "write along = \"u\" or \"v\", or call `direction::choose`",
        ));
    }
    if job.origin.start_choice() == &StartChoice::Auto {
        return Err(job.origin.error(
            "cut.start",
            "the start of the passes has not been chosen",
            "write start = \"edge\" or \"middle\", or call `direction::choose`",
        ));
    }
    let sign = geometry::tool_sign(job)?;
    geometry::check_points(job, sign)?;
    #[allow(clippy::cast_possible_truncation, reason = "the machine's own precision")]
    let header = Header {
        kind: SurfaceKind::Polynomial,
        pattern: match job.pattern {
            job::Pattern::Zig => Pattern::Zig,
            job::Pattern::Zigzag => Pattern::Zigzag,
        },
        spacing: match job.spacing {
            job::Spacing::Exact => Spacing::Exact,
            job::Spacing::FirstOrder => Spacing::FirstOrder,
            // Each cell of a region gives its direction.
            job::Spacing::Constant(_) if job.region.is_some() => Spacing::Constant,
            job::Spacing::Constant(job::Start::Edge) => Spacing::Constant,
            job::Spacing::Constant(job::Start::Middle) => Spacing::ConstantFromMiddle,
        },
        tool_side: if geometry::along_path(sign, job.along) > 0.0 {
            ToolSide::Plus
        } else {
            ToolSide::Minus
        },
        path_spans: 1,
        side_spans: 1,
        ball_radius_mm: job.radius_mm as f32,
        feed_mm_s: job.feed_mm_s() as f32,
        scallop_mm: job.scallop_mm as f32,
        period_s: job.machine.period_s() as f32,
        edges: 0,
        links: 0,
        window: 0,
        strips: 0,
        axes: None,
    };
    let mut prepared = match &job.surface {
        SurfaceSpec::Revolved {
            radius_mm,
            height_mm,
            u,
            v_rad,
        } => revolved(job, header, [*radius_mm, *height_mm], *u, *v_rad),
        surface => grid::prepare(job, header, &Source::new(surface)),
    }?;
    let [us, vs] = job.surface.domain();
    fronts::smooth_widths(job, &mut prepared)?;
    let start = match &job.region {
        Some(region) => region::add(job, region, &mut prepared)?,
        None => [us[0], vs[0]],
    };
    if prepared.header.spacing == Spacing::Constant && job.region.is_none() {
        prepared.header.spacing = fronts::spacing_from_edge(job, &prepared);
    }
    prepared.header.axes = axes::axes(job, sign, start)?;
    if prepared.header.spacing == Spacing::Exact && prepared.header.axes.is_some() {
        prepared.header.spacing = fronts::exact_spacing(job, &prepared);
    }
    fronts::check(job, &prepared)?;
    stream::fit(job, prepared)
}

/// Words of the widths of spans.
fn widths(job: &Job, axis: &ParameterSpans) -> Result<Vec<i32>, JobError> {
    width_words(job, axis.breaks.windows(2).map(|ends| ends[1] - ends[0]))
}

fn width_words(job: &Job, widths: impl Iterator<Item = f64>) -> Result<Vec<i32>, JobError> {
    widths
        .map(|width| {
            encode::width(width)
                .map_err(|error| job.origin.error("surface", error.to_string(), "widen its range"))
        })
        .collect()
}

fn revolved(
    job: &Job,
    header: Header,
    profile: [[f64; 4]; 2],
    u: [f64; 2],
    v_rad: [f64; 2],
) -> Result<Prepared, JobError> {
    let [radius, height] = profile.map(|[c3, c2, c1, c0]| encode::substitute_cubic(&[c0, c1, c2, c3], u));
    let record = encode::revolved(&radius, &height, v_rad).map_err(|error| {
        job.origin.error(
            "surface",
            format!("the machine cannot represent this surface: {error}"),
            patches::records::REMEDY,
        )
    })?;
    let [profile, angle] = [u, v_rad].map(|range| ParameterSpans {
        breaks: range.to_vec(),
    });
    let (kind, path, side) = match job.along {
        Along::U => (SurfaceKind::RevolvedAlongProfile, profile, angle),
        Along::V => (SurfaceKind::RevolvedAroundAxis, angle, profile),
    };
    let mut words = widths(job, &side)?;
    words.extend(widths(job, &path)?);
    words.extend(record.to_words());
    Ok(Prepared {
        least_rows: 0,
        start: RunStart::FIRST,
        header: Header { kind, ..header },
        words,
        path,
        side,
        along: job.along,
        steps: steps::config(&job.machine),
    })
}
