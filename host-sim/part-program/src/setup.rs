//! How a part lies on the machine: which side looks up, its translation, and the reach of the tool over each face.

use std::sync::Arc;

use cad::{Face, MachinableFace, Model, Placement};
use glam::DVec3;
use job::{FaceReach, SurfaceSpec};
use part::{Part, Request, Tool, placed_part};
use patches::placement::Rotation;

/// A part that reaches farther from the origin than this, mm, is moved there: the machine's range is 2147 mm either way.
const RANGE_MM: f64 = 2000.0;
/// Places along each parameter of a face for a coarse look at its reach: which side of a face that bounds no solid is reached more, and whether any of it is reached.
pub(crate) const COARSE_PLACES: usize = 12;

/// The side of the part that looks up on the machine, in the axes of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpSide {
    /// The file's +z.
    PlusZ,
    /// The file's -z.
    MinusZ,
    /// The file's +x.
    PlusX,
    /// The file's -x.
    MinusX,
    /// The file's +y.
    PlusY,
    /// The file's -y.
    MinusY,
}

impl UpSide {
    /// All sides, in the order in which [`crate::Planner::best_setup`] tries them.
    pub const ALL: [Self; 6] = [
        Self::PlusZ,
        Self::MinusZ,
        Self::PlusX,
        Self::MinusX,
        Self::PlusY,
        Self::MinusY,
    ];

    /// Rotations about x, then y, then z that turn this side up, degrees.
    #[must_use]
    pub const fn rotate_deg(self) -> [f64; 3] {
        match self {
            Self::PlusZ => [0.0, 0.0, 0.0],
            Self::MinusZ => [180.0, 0.0, 0.0],
            Self::PlusX => [0.0, -90.0, 0.0],
            Self::MinusX => [0.0, 90.0, 0.0],
            Self::PlusY => [90.0, 0.0, 0.0],
            Self::MinusY => [-90.0, 0.0, 0.0],
        }
    }

    /// Name of the side: sign and axis.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PlusZ => "+z",
            Self::MinusZ => "-z",
            Self::PlusX => "+x",
            Self::MinusX => "-x",
            Self::PlusY => "+y",
            Self::MinusY => "-y",
        }
    }
}

/// How a part lies on the machine, and the tool over it.
pub struct PartSetup {
    /// The side that looks up.
    pub side: UpSide,
    /// Translation of the part after its rotation, mm.
    pub translate_mm: [f64; 3],
    /// Rotation and translation together: from the file's coordinates to the machine's.
    pub placement: Placement,
    /// The part on the machine.
    pub part: Arc<Part>,
    /// The tool.
    pub tool: Tool,
    /// Scallop height limit, mm.
    pub scallop_mm: f64,
}

impl PartSetup {
    /// A setup with this side up, at the file's origin; a part that reaches more than 2 m from the origin is centred there.
    #[must_use]
    pub fn new(side: UpSide, model: &Arc<Model>, tool: Tool, scallop_mm: f64) -> Self {
        let linear = Rotation::of_degrees(side.rotate_deg()).0;
        let rows = |by: [f64; 3]| Placement {
            rows: std::array::from_fn(|i| [linear[i][0], linear[i][1], linear[i][2], by[i]]),
        };
        let placement = rows([0.0; 3]);
        let mut setup = Self {
            side,
            translate_mm: [0.0; 3],
            placement,
            part: placed_part(model, &placement),
            tool,
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

    /// Position of the ball's centre before the first face and after the last one, mm: above the middle of the part, at the greatest height of a link.
    #[must_use]
    pub fn home_mm(&self) -> DVec3 {
        let block = self.part.block();
        let middle = 0.5 * (block.low + block.high);
        middle.with_z(block.high.z + self.tool.radius + job::CLEARANCE_DEFAULT_MM)
    }

    /// Calls `ask` with the request for the region of a face with this surface, which borrows from this call. `sign`: of the tool's side on `S_u x S_v`.
    pub(crate) fn with_request<T>(
        &self,
        face: &Face,
        sign: f64,
        surface: &MachinableFace,
        ask: impl FnOnce(&Request<'_>) -> T,
    ) -> T {
        let placed = face.placed(&self.placement);
        let spec = surface.spec();
        let [[u0, u1], [v0, v1]] = spec.domain();
        let whole = vec![vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1]]];
        // `surface` is in the file's coordinates.
        let placed_surface = oracle::Surface::new(&moved(&spec, &self.placement));
        let request = Request {
            surface: &placed_surface,
            trimmed: surface.trimmed.as_ref().unwrap_or(&whole),
            face: placed.as_ref().unwrap_or(face),
            placement: &Placement::IDENTITY,
            sign,
            tool: &self.tool,
            scallop_mm: self.scallop_mm,
            steepest_deg: job_file::STEEPEST_DEG,
            touch_mm: job_file::PART_TOLERANCE_MM,
            part: Some((&self.part, self.part.index(face.number))),
        };
        ask(&request)
    }

    /// Sign of the machined side on `S_u x S_v`: out of the material. For a face that bounds no solid the file does not tell it; then the side with the larger reach.
    pub(crate) fn sign(&self, face: &Face, surface: &MachinableFace) -> f64 {
        if face.solid {
            return face.sense;
        }
        let reached = |sign| {
            self.with_request(face, sign, surface, |request| request.reach(COARSE_PLACES))
                .reachable_mm2
        };
        if reached(-face.sense) > reached(face.sense) {
            -face.sense
        } else {
            face.sense
        }
    }

    /// The reach of the tool over a face with this surface, sampled at `places` along each parameter.
    pub(crate) fn reach(&self, face: &Face, surface: &MachinableFace, places: usize) -> FaceReach {
        let sign = self.sign(face, surface);
        let found = self.with_request(face, sign, surface, |request| request.reach(places));
        FaceReach {
            area_mm2: found.area_mm2,
            reachable_mm2: found.reachable_mm2,
            unreachable_mm2: found
                .unreachable_mm2
                .iter()
                .map(|(reason, area)| (reason.name().to_owned(), *area))
                .collect(),
            ..FaceReach::default()
        }
    }
}

/// A B-spline with its poles transformed; another surface as it is.
fn moved(spec: &SurfaceSpec, by: &Placement) -> SurfaceSpec {
    let SurfaceSpec::Nurbs(nurbs) = spec else {
        return spec.clone();
    };
    let mut nurbs = nurbs.clone();
    for pole in nurbs.poles_mm.iter_mut().flatten() {
        let [x, y, z, weight] = *pole;
        let [x, y, z] = by.point([x, y, z].into()).to_array();
        *pole = [x, y, z, weight];
    }
    SurfaceSpec::Nurbs(nurbs)
}
