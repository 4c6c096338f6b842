//! A job as it is asked for: the [`Header`] and, as plain words, the surface's data.
//!
//! The words (i32) of a job, in order:
//!
//! | words | what |
//! |---|---|
//! | `side_spans` | width of each side span in units of the surface's side parameter, f32 bits |
//! | `path_spans` | width of each path span, f32 bits (reported, never used to step) |
//! | rest | [`SurfaceKind::Polynomial`], [`SurfaceKind::Rational`]: one record a patch, path index fastest; [`SurfaceKind::RevolvedAlongProfile`], [`SurfaceKind::RevolvedAroundAxis`]: one record |
//!
//! The records are described in the files of [`crate::surface`].

pub mod encode;
pub(crate) mod program;

/// Words of surface data that the reference machine stores: 64 KiB of its 128 KiB RAM, hence 309 polynomial or 237
/// rational patches ([`patches_max`]).
pub const STORE_WORDS: usize = 16_384;

/// Patches that surely fit a store of so many words, however they are arranged: each may need a span width of its own,
/// and one direction has one more.
#[must_use]
pub const fn patches_max(kind: SurfaceKind, store_words: usize) -> usize {
    let words = match kind {
        SurfaceKind::Polynomial => crate::surface::POLYNOMIAL_WORDS,
        SurfaceKind::Rational => crate::surface::RATIONAL_WORDS,
        SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => return 1,
    };
    store_words.saturating_sub(1) / (words + 1)
}

/// Spans a surface may have in one direction. It bounds every loop over spans.
pub const SPANS_MAX: u16 = 1_024;

/// Longest step of a period on a machine with limits, mm.
pub(crate) const STEP_MAX_MM: f32 = 2.0;

/// Cells into which the look-ahead may cut a path, and so the patches that a pass may have on a machine with limits.
pub(crate) const CELLS_MAX: usize = 256;

/// Words of the span widths that head a job's data.
pub(crate) fn width_words(path_spans: u16, side_spans: u16) -> u32 {
    u32::from(path_spans) + u32::from(side_spans)
}

/// The kind of surface, and with it the record of its data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum SurfaceKind {
    /// A grid of bicubic polynomial patches: bicubic, ruled, non-rational B-spline surfaces.
    #[default]
    Polynomial = 0,
    /// A grid of rational bicubic patches.
    Rational = 1,
    /// Cubic profile turned about z; passes run along the profile, the side parameter is the angle.
    RevolvedAlongProfile = 2,
    /// Cubic profile turned about z; passes run around the axis, the side parameter is the profile's.
    RevolvedAroundAxis = 3,
}

impl SurfaceKind {
    /// Every kind, in order of its code.
    pub const ALL: [Self; 4] = [
        Self::Polynomial,
        Self::Rational,
        Self::RevolvedAlongProfile,
        Self::RevolvedAroundAxis,
    ];

    /// The kind with this code.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == code)
    }
}

/// Order of the passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Pattern {
    /// Every pass runs the same way.
    #[default]
    Zig = 0,
    /// Every second pass runs backwards.
    Zigzag = 1,
}

/// How far apart passes lie for the scallop height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Spacing {
    /// As far as the height allows over the gap to the next pass: lengths and curvatures are looked at there, and the ball is round.
    #[default]
    Exact = 0,
    /// By the paper's interval at the pass alone (eqns 10 and 11). The height may be exceeded, by a percent or two where the surface
    /// changes from pass to pass, by more at the ends of skew passes.
    FirstOrder = 1,
}

/// Side of the surface that the tool is on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum ToolSide {
    /// The tool normal is `+ S_path x S_side`.
    #[default]
    Plus = 0,
    /// The tool normal is `- S_path x S_side`.
    Minus = 1,
}

/// What the machine's axes x, y, z can do, and where they may go. A job that says so is run from standstill to standstill, its passes linked;
/// without it the feed is constant from the first sample to the last, as in the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axes {
    /// Greatest velocity of each axis, mm/s, 1e-3 to 1e5.
    pub velocity_mm_s: [f32; 3],
    /// Greatest acceleration of each axis, mm/s^2, 1e-2 to 1e7.
    pub acceleration_mm_s2: [f32; 3],
    /// Greatest jerk of each axis, mm/s^3, 1e-1 to 1e9.
    pub jerk_mm_s3: [f32; 3],
    /// Greatest distance between the path and the chord of a period, mm, 1e-6 to 1e3.
    pub chord_mm: f32,
    /// Travel of each axis, nm, least and most.
    pub travel_nm: [[i32; 2]; 3],
    /// Where the tool centre stands before the first run, nm; within the travel.
    pub home_nm: [i32; 3],
    /// The last part of the way down to the surface, mm, 0 to 1000, that is gone no faster than at the feed.
    pub plunge_mm: f32,
    /// Height (z of the tool centre) at which the tool is clear of the surface everywhere, nm; within the travel.
    pub safe_z_nm: i32,
}

/// What a job asks for, besides its surface data. Ranges are checked when it is loaded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Header {
    /// Kind of surface.
    pub kind: SurfaceKind,
    /// Order of the passes.
    pub pattern: Pattern,
    /// How far apart the passes lie.
    pub spacing: Spacing,
    /// Side of the surface that the tool is on.
    pub tool_side: ToolSide,
    /// Spans along the path parameter, 1 to [`SPANS_MAX`] (1 for a revolved surface).
    pub path_spans: u16,
    /// Spans along the side parameter, 1 to [`SPANS_MAX`] (1 for a revolved surface).
    pub side_spans: u16,
    /// Ball radius r, mm, above 0 and at most 1000.
    pub ball_radius_mm: f32,
    /// Feed of the cutter contact along the surface, mm/s, 0.001 to 10 000.
    pub feed_mm_s: f32,
    /// Scallop height limit h, mm, above 0, at most the ball radius.
    pub scallop_mm: f32,
    /// Sampling period T, s, 1e-5 to 0.1.
    pub period_s: f32,
    /// What the axes can do; none for a constant feed.
    pub axes: Option<Axes>,
}
