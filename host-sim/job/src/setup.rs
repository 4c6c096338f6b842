//! The body of the tool above its ball, and what stands around the surface: stock and fixtures.

/// Largest diameter and length of a part of the tool, mm.
pub const TOOL_SIZE_MAX_MM: f64 = 2000.0;

/// A part of the holder: a cylinder, or a frustum of a cone, around the tool's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HolderPart {
    /// Diameters at the lower and at the upper end, mm, above 0, at most [`TOOL_SIZE_MAX_MM`].
    pub diameter_mm: [f64; 2],
    /// Length along the axis, mm, above 0, at most [`TOOL_SIZE_MAX_MM`].
    pub length_mm: f64,
}

/// The tool above its ball. Lengths are from the ball's tip, along the axis, which is z.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolBody {
    /// Diameter of the shank, mm. `None`: that of the ball.
    pub shank_mm: Option<f64>,
    /// Height above the tip at which the shank begins, mm, at least the ball's radius; below it the stem has the ball's diameter.
    /// `None`: at the ball's centre.
    pub neck_mm: Option<f64>,
    /// Length from the tip to the holder's face, mm. `None`: not known, the shank has no end.
    pub length_mm: Option<f64>,
    /// Parts of the holder from its face upwards; empty: not known. Above the last part the tool is as wide as its upper end.
    pub holder: Vec<HolderPart>,
}

/// A box with sides along the axes, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Least corner.
    pub low_mm: [f64; 3],
    /// Greatest corner, above the least one on each axis.
    pub high_mm: [f64; 3],
}

/// A clamp, a vice, a screw: what the tool must not touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixture {
    /// Its name in the file; else its number, from 1.
    pub name: String,
    /// The box around it.
    pub block: Block,
}

/// What stands around the surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Setup {
    /// The raw part.
    pub stock: Option<Block>,
    /// Fixtures, in the order of the file.
    pub fixtures: Vec<Fixture>,
}
