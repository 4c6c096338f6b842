//! A job: the [`Header`] and the surface's data as 32-bit words.
//!
//! The words (i32) of a job, in order:
//!
//! | words | content |
//! |---|---|
//! | `side_spans` | width of each side span in units of the surface's side parameter, f32 bits |
//! | `path_spans` | width of each path span, f32 bits; the step along a path does not use it, [`Spacing::Constant`] does |
//! | of the records | [`SurfaceKind::Polynomial`], [`SurfaceKind::Rational`]: one record per patch, path index fastest; [`SurfaceKind::RevolvedAlongProfile`], [`SurfaceKind::RevolvedAroundAxis`]: one record |
//! | with a region | its cells and edges: [`region`] |
//! | [`Header::links`] | for each pass from the second one on: how the tool goes to it, [`links`] |
//!
//! Widths are those of a surface whose derivatives are continuous from span to span, in proportion to the spans of a knot vector: between unequal
//! patches of equal widths passes would be too far apart. [`WIDTH_MIN`] to [`WIDTH_MAX`]. The core does not check that patches join: a gap is a jump of
//! the tool.
//!
//! Those of a job that is loaded while it runs have another order: [`stream`].
//!
//! The records are described in the files of [`crate::surface`].

mod check;
pub mod encode;
pub mod links;
pub(crate) mod program;
pub mod region;
pub(crate) mod stations;
pub mod stream;

/// Words of surface data that the reference machine stores: 64 KiB of its 128 KiB RAM, hence 309 polynomial or 237
/// rational patches ([`patches_max`]).
pub const STORE_WORDS: usize = 16_384;

/// Patches that fit a store of this size in any grid: each may need its own span width,
/// plus one width for the other direction.
#[must_use]
pub const fn patches_max(kind: SurfaceKind, store_words: usize) -> usize {
    let words = match kind {
        SurfaceKind::Polynomial => crate::surface::POLYNOMIAL_WORDS,
        SurfaceKind::Rational => crate::surface::RATIONAL_WORDS,
        SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => return 1,
    };
    store_words.saturating_sub(1) / (words + 1)
}

/// Least and greatest width of a span: in their range the spacing of passes keeps its digits.
pub const WIDTH_MIN: f32 = 1e-9;
/// See [`WIDTH_MIN`].
pub const WIDTH_MAX: f32 = 1e9;

/// Maximum spans of a surface in one direction. Bounds every loop over spans.
pub const SPANS_MAX: u16 = 1_024;

/// Maximum step per period of a job with axis limits, at the maximum override, mm.
pub const STEP_MAX_MM: f32 = 2.0;

/// Maximum cells of a path in the look-ahead, and so maximum patches of a pass of a job with axis limits.
pub(crate) const CELLS_MAX: usize = 256;

/// Greatest overrun of a turn, mm.
pub const OVERRUN_MAX_MM: f32 = 100.0;

/// Words of the span widths at the start of a job's data.
pub(crate) fn width_words(path_spans: u16, side_spans: u16) -> u32 {
    u32::from(path_spans) + u32::from(side_spans)
}

/// The kind of surface; determines the layout of its records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum SurfaceKind {
    /// A grid of bicubic polynomial patches: bicubic, ruled, non-rational B-spline surfaces.
    #[default]
    Polynomial = 0,
    /// A grid of rational bicubic patches.
    Rational = 1,
    /// Cubic profile revolved about z; passes run along the profile, the side parameter is the angle.
    RevolvedAlongProfile = 2,
    /// Cubic profile revolved about z; passes run around the axis, the side parameter is the profile's.
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
    /// One-way: every pass runs in the same direction.
    #[default]
    Zig = 0,
    /// Zigzag: every second pass runs in the opposite direction.
    Zigzag = 1,
}

/// How the path interval follows from the scallop height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Spacing {
    /// The widest interval whose scallop height stays within the limit over the gap to the next pass, by the surface evaluated in the gap and the ball's circle.
    #[default]
    Exact = 0,
    /// The paper's interval, from the pass alone (eqns 10 and 11). The scallop height may exceed the limit by up to 3 % where the surface
    /// changes from pass to pass, and several times at the ends of skew passes.
    FirstOrder = 1,
    /// Passes of constant scallop height ([`crate::Interpolator::plan`] makes each from the one before): curves `side = g(path)`, the first on the surface's first side
    /// boundary. The limit holds as with [`Self::Exact`]. The store holds their stations besides the job's words: [`crate::front_words`].
    Constant = 2,
    /// As [`Self::Constant`], from the middle of the side parameter to its end, then from the middle to its start.
    ConstantFromMiddle = 3,
    /// As [`Self::Constant`], from the last side boundary to the first.
    ConstantFromEnd = 4,
    /// As [`Self::Exact`], where the last side boundary is a single point: within axis limits that point is one sample with one normal, so the step to it is half as long. With
    /// [`Self::Exact`] the crest beside the point may be four times the limit.
    ExactToPoint = 5,
}

impl Spacing {
    /// Every rule, in order of its code.
    pub const ALL: [Self; 6] = [
        Self::Exact,
        Self::FirstOrder,
        Self::Constant,
        Self::ConstantFromMiddle,
        Self::ConstantFromEnd,
        Self::ExactToPoint,
    ];

    /// The rule with this code.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|spacing| *spacing as u8 == code)
    }

    /// Whether the step to the next pass is that of the whole gap.
    #[must_use]
    pub const fn is_exact(self) -> bool {
        matches!(self, Self::Exact | Self::ExactToPoint)
    }

    /// Whether the passes are curves of constant scallop height.
    #[must_use]
    pub const fn is_constant(self) -> bool {
        matches!(
            self,
            Self::Constant | Self::ConstantFromMiddle | Self::ConstantFromEnd
        )
    }
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

/// Limits of the machine's axes x, y, z, and their travel. With limits each pass starts and ends at standstill, unless turns join them ([`Self::overrun_mm`]), and links join the passes;
/// without limits the feed is constant from the first sample to the last, as in Lo 1998.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisLimits {
    /// Maximum velocity of each axis, mm/s, 1e-3 to 1e5.
    pub velocity_mm_s: [f32; 3],
    /// Maximum acceleration of each axis, mm/s^2, 1e-2 to 1e7.
    pub acceleration_mm_s2: [f32; 3],
    /// Maximum jerk of each axis, mm/s^3, 1e-1 to 1e9.
    pub jerk_mm_s3: [f32; 3],
    /// Maximum chord error of a period, mm, 1e-6 to 1e3.
    pub chord_mm: f32,
    /// Travel of each axis, nm: minimum and maximum.
    pub travel_nm: [[i32; 2]; 3],
    /// Home: position of the tool centre before the first run, nm; within the travel.
    pub home_nm: [i32; 3],
    /// Where a run ends, nm, if not at home; within the travel.
    pub end_nm: Option<[i32; 3]>,
    /// Height of the way to [`Self::end_nm`], nm, or that of the last pass's end where that is higher; within the travel.
    pub end_height_nm: i32,
    /// Length of the end of the plunge, mm, 0 to 1000, over which the speed does not exceed the feed.
    pub plunge_mm: f32,
    /// Safe height (z of the tool centre), nm, above every point of the surface; within the travel.
    pub safe_z_nm: i32,
    /// Greatest length by which a turn of a zigzag job leaves the surface beyond its boundary, mm, 0 to 100; 0 for a standstill at each pass end.
    pub overrun_mm: f32,
}

/// A job's parameters without its surface data. Loading checks their ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Header {
    /// Kind of surface.
    pub kind: SurfaceKind,
    /// Order of the passes.
    pub pattern: Pattern,
    /// Rule for the path interval.
    pub spacing: Spacing,
    /// Side of the surface that the tool is on.
    pub tool_side: ToolSide,
    /// Spans along the path parameter, 1 to [`SPANS_MAX`] (1 for a revolved surface); at most 1023 with a region, 256 with axis limits, 128 with passes of constant scallop height.
    pub path_spans: u16,
    /// Spans along the side parameter, 1 to [`SPANS_MAX`] (1 for a revolved surface); at most 1023 with a region.
    pub side_spans: u16,
    /// Ball radius r, mm, above 0 and at most 1000.
    pub ball_radius_mm: f32,
    /// Feed of the cutter contact along the surface, mm/s, 0.001 to 10 000; with axis limits at most [`STEP_MAX_MM`] a period at twice the feed.
    pub feed_mm_s: f32,
    /// Scallop height limit h, mm, above 0, at most the ball radius.
    pub scallop_mm: f32,
    /// Sampling period T, s, 1e-5 to 0.1.
    pub period_s: f32,
    /// Records of the region that is machined, in the words after the patches: [`region`]; 0 for the whole surface. With passes of constant scallop height each cell gives its direction, and the spacing is [`Spacing::Constant`].
    pub edges: u16,
    /// Words of links: passes after them are reached at the safe height. Only with axis limits, and straight passes or a region.
    pub links: u16,
    /// Rows of patches that a pass and what is planned on it may use, for a job that is loaded while it runs: [`stream`]. 0 for one that is stored as a whole.
    pub window: u16,
    /// Strips of rows in which a streamed job with a region comes; 0 for any other one.
    pub strips: u16,
    /// Axis limits; none for a constant feed.
    pub axes: Option<AxisLimits>,
}
