//! How a part lies on the machine: which side is up, and where it stands.

use std::sync::Arc;

use cad::{CadError, Face, MachinableFace, Model, Placement};
use clap::ValueEnum;
use glam::DVec3;
use part::{Part, Tool, placed_part};
use patches::placement::Rotation;
use rayon::prelude::*;

use super::face::Asked;

/// Default of what is the machine's range: a part that reaches farther is moved to the origin, mm.
const RANGE_MM: f64 = 2000.0;
/// Places a side of a face at which the best side of a part is looked for.
const LOOKS: usize = 16;

/// The side of the part that looks up on the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in super::super) enum Up {
    /// The file's +z.
    #[value(name = "+z")]
    PlusZ,
    /// Its -z.
    #[value(name = "-z")]
    MinusZ,
    /// Its +x.
    #[value(name = "+x")]
    PlusX,
    /// Its -x.
    #[value(name = "-x")]
    MinusX,
    /// Its +y.
    #[value(name = "+y")]
    PlusY,
    /// Its -y.
    #[value(name = "-y")]
    MinusY,
    /// The one of the six of which most can be reached.
    Auto,
}

impl Up {
    pub(super) const SIX: [Self; 6] = [
        Self::PlusZ,
        Self::MinusZ,
        Self::PlusX,
        Self::MinusX,
        Self::PlusY,
        Self::MinusY,
    ];

    /// Rotations about x, y and z that turn it up.
    pub(super) fn rotate_deg(self) -> [f64; 3] {
        match self {
            Self::PlusZ | Self::Auto => [0.0, 0.0, 0.0],
            Self::MinusZ => [180.0, 0.0, 0.0],
            Self::PlusX => [0.0, -90.0, 0.0],
            Self::MinusX => [0.0, 90.0, 0.0],
            Self::PlusY => [90.0, 0.0, 0.0],
            Self::MinusY => [-90.0, 0.0, 0.0],
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::PlusZ => "+z",
            Self::MinusZ => "-z",
            Self::PlusX => "+x",
            Self::MinusX => "-x",
            Self::PlusY => "+y",
            Self::MinusY => "-y",
            Self::Auto => "auto",
        }
    }
}

/// How a part lies on the machine.
pub(super) struct Setup {
    pub(super) up: Up,
    pub(super) translate_mm: [f64; 3],
    pub(super) placement: Placement,
    pub(super) part: Arc<Part>,
    pub(super) scallop_mm: f64,
}

impl Setup {
    pub(super) fn new(up: Up, model: &Arc<Model>, scallop_mm: f64) -> Self {
        let linear = Rotation::of_degrees(up.rotate_deg()).0;
        let rows = |by: [f64; 3]| Placement {
            rows: std::array::from_fn(|i| [linear[i][0], linear[i][1], linear[i][2], by[i]]),
        };
        let placement = rows([0.0; 3]);
        let mut setup = Self {
            up,
            translate_mm: [0.0; 3],
            placement,
            part: placed_part(model, &placement),
            scallop_mm,
        };
        let block = setup.part.block();
        if block.low.abs().max(block.high.abs()).max_element() > RANGE_MM {
            setup.translate_mm = (-0.5 * (block.low + block.high)).round().to_array();
            setup.placement = rows(setup.translate_mm);
            setup.part = placed_part(model, &setup.placement);
        }
        setup
    }
}

impl Setup {
    /// Where a ball's centre stands before and after the faces: above the middle of the part, as high as links go at most, mm.
    pub(super) fn home_mm(&self, radius_mm: f64) -> DVec3 {
        let block = self.part.block();
        let middle = 0.5 * (block.low + block.high);
        middle.with_z(block.high.z + radius_mm + job::CLEARANCE_DEFAULT_MM)
    }
}

/// The side of which most can be reached.
pub(super) fn best_side(
    model: &Arc<Model>,
    faces: &[&Face],
    made: &[std::result::Result<Arc<MachinableFace>, CadError>],
    tool: &Tool,
    scallop_mm: f64,
) -> Setup {
    let tried = Up::SIX.map(|up| {
        let setup = Setup::new(up, model, scallop_mm);
        let asked = Asked {
            part: &setup.part,
            tool,
            scallop_mm,
            setup: &setup,
        };
        let known = faces
            .par_iter()
            .zip(made)
            .filter_map(|(face, made)| Some((face, made.as_ref().ok()?)));
        let reached: f64 = known
            .map(|(face, made)| asked.reach(face, made, LOOKS).reachable_mm2)
            .sum();
        (reached, up)
    });
    let best = tried.into_iter().fold(
        (-1.0, Up::PlusZ),
        |best, one| if one.0 > best.0 { one } else { best },
    );
    Setup::new(best.1, model, scallop_mm)
}
