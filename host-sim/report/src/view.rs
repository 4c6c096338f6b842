//! The camera: parallel projection and visibility of the surface.

use super::mesh::{FINE, Mesh};
use glam::DVec3;

/// Cells of the depth buffer per pixel.
const CELLS_PER_PIXEL: f64 = 2.0;
/// Depth tolerance for facets and rounding, pixels: a point this far behind the surface counts as on it.
const DEPTH_SLACK: f64 = 1.5;
/// Candidate elevations of the camera, degrees, each with its weight: low ones show the shape, high ones the inside of concave
/// regions.
const ELEVATIONS: [(f64, f64); 4] = [(26.0, 0.95), (34.0, 1.0), (43.0, 0.82), (56.0, 0.62)];
/// Number of candidate azimuths.
const AZIMUTHS: u32 = 36;
/// Preferred azimuth, degrees: x to the right and towards the viewer, y away.
const AZIMUTH_LIKED: f64 = -60.0;
/// Weight of the preferred azimuth.
const AZIMUTH_WEIGHT: f64 = 0.15;
/// Weight of a view along a side of the surface, relative to one across a corner.
const STRAIGHT_ON: f64 = 0.5;
/// Weight of visible back side, relative to visible tool side.
const BACK_COUNTS: f64 = 5.0;
/// Exponent of the visible share of the surface in the rating of a view.
const SEEN_POWER: f64 = 0.6;
/// Exponent of the filled share of the frame in the rating of a view.
const FILL_POWER: f64 = 0.4;

/// A frame in the picture: left, top, width, height.
pub(super) type Frame = [f64; 4];

/// Axes of the camera in space.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    right: DVec3,
    up: DVec3,
    /// Towards the viewer.
    pub(super) toward: DVec3,
}

impl View {
    /// A camera at this azimuth and elevation, degrees.
    fn at(azimuth: f64, elevation: f64) -> Self {
        let (sin_a, cos_a) = azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = elevation.to_radians().sin_cos();
        let toward = DVec3::new(cos_a * cos_e, sin_a * cos_e, sin_e);
        let right = DVec3::new(-sin_a, cos_a, 0.0);
        Self {
            right,
            up: toward.cross(right),
            toward,
        }
    }

    /// A direction in camera coordinates: right, up, towards the viewer.
    pub(super) fn turn(&self, direction: DVec3) -> DVec3 {
        DVec3::new(
            direction.dot(self.right),
            direction.dot(self.up),
            direction.dot(self.toward),
        )
    }

    /// The candidate with the highest score: visible share of the tool side, filled frame, oblique sides.
    pub(super) fn best(mesh: &Mesh, extent: &[DVec3], frame: Frame) -> Self {
        let small = [0.0, 0.0, frame[2] / 6.0, frame[3] / 6.0];
        let below = mesh.mean_normal().z < -0.1;
        let mut best = (f64::NEG_INFINITY, Self::at(AZIMUTH_LIKED, 34.0));
        for (elevation, liking) in ELEVATIONS {
            for step in 0..AZIMUTHS {
                let azimuth = AZIMUTH_LIKED + 360.0 * f64::from(step) / f64::from(AZIMUTHS);
                let view = Self::at(azimuth, if below { -elevation } else { elevation });
                let turned = (azimuth - AZIMUTH_LIKED).to_radians().cos();
                let worth = liking * (1.0 + AZIMUTH_WEIGHT * turned) * view.across_corner(mesh.side());
                let score = worth * shown(mesh, &Camera::new(view, extent, small));
                if score > best.0 {
                    best = (score, view);
                }
            }
        }
        best.1
    }

    /// 1 if the sides of the surface are oblique in the picture, less if one is horizontal or along the view.
    fn across_corner(&self, side: DVec3) -> f64 {
        let away = DVec3::Z.cross(self.right);
        let aslant = (2.0 * side.dot(away).atan2(side.dot(self.right))).sin().abs();
        STRAIGHT_ON + (1.0 - STRAIGHT_ON) * (aslant / 0.8).min(1.0)
    }
}

/// Score of a camera: visible area of the tool side minus that of the back, as a share of the surface, and the filled share
/// of the frame.
fn shown(mesh: &Mesh, camera: &Camera) -> f64 {
    const CELLS: f64 = 0.5;
    let mut depth = Depth::new(camera, CELLS);
    let mut area = 0.0;
    for quad in mesh.quads(FINE) {
        area += quad.area;
        depth.quad(&quad.corners, quad.normal.dot(camera.view.toward) > 0.0);
    }
    let (front, back) = depth.seen();
    let cell_mm = 1.0 / (CELLS * camera.scale);
    let seen = ((front - BACK_COUNTS * back) * cell_mm * cell_mm / area.max(1e-12)).max(0.0);
    let fill = front / (CELLS * CELLS * camera.frame[2] * camera.frame[3]);
    seen.powf(SEEN_POWER) * fill.powf(FILL_POWER)
}

/// A camera with scale and position in the frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    pub(super) view: View,
    /// Pixels per mm.
    pub(super) scale: f64,
    origin: DVec3,
    centre: [f64; 2],
    frame: Frame,
}

impl Camera {
    /// The camera that fits these points into the frame.
    pub(super) fn new(view: View, points: &[DVec3], frame: Frame) -> Self {
        let origin = points.first().copied().unwrap_or_default();
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for point in points {
            let turned = view.turn(*point - origin);
            for k in 0..2 {
                low[k] = low[k].min(turned[k]);
                high[k] = high[k].max(turned[k]);
            }
        }
        let size = [0, 1].map(|k| (high[k] - low[k]).max(1e-9));
        let scale = (frame[2] / size[0]).min(frame[3] / size[1]);
        let centre = [
            frame[0] + 0.5 * frame[2] - 0.5 * (low[0] + high[0]) * scale,
            frame[1] + 0.5 * frame[3] + 0.5 * (low[1] + high[1]) * scale,
        ];
        Self {
            view,
            scale,
            origin,
            centre,
            frame,
        }
    }

    /// A point in the picture: x to the right, y down, depth towards the viewer; all in pixels.
    pub(super) fn place(&self, point: DVec3) -> DVec3 {
        let turned = self.view.turn(point - self.origin);
        DVec3::new(
            self.centre[0] + turned.x * self.scale,
            self.centre[1] - turned.y * self.scale,
            turned.z * self.scale,
        )
    }
}

/// Depth buffer of the frame.
#[derive(Clone, Debug)]
pub(super) struct Depth {
    camera: Camera,
    cells: f64,
    size: [usize; 2],
    foremost: Vec<f32>,
    is_front: Vec<bool>,
}

impl Depth {
    fn new(camera: &Camera, cells: f64) -> Self {
        // A margin of one cell each way.
        let size = [camera.frame[2], camera.frame[3]].map(|length| (length * cells).ceil() as usize + 3);
        let count = size[0] * size[1];
        Self {
            camera: *camera,
            cells,
            size,
            foremost: vec![f32::NEG_INFINITY; count],
            is_front: vec![false; count],
        }
    }

    /// The depths of a surface.
    pub(super) fn of(mesh: &Mesh, camera: &Camera) -> Self {
        let mut depth = Self::new(camera, CELLS_PER_PIXEL);
        for quad in mesh.quads(1) {
            depth.quad(&quad.corners, quad.normal.dot(camera.view.toward) > 0.0);
        }
        depth
    }

    fn quad(&mut self, corners: &[DVec3; 4], is_front: bool) {
        let [a, b, c, d] = corners.map(|corner| self.cell(self.camera.place(corner)));
        self.triangle([a, b, c], is_front);
        self.triangle([a, c, d], is_front);
    }

    /// A point of the picture in cells.
    fn cell(&self, placed: DVec3) -> DVec3 {
        let [left, top, ..] = self.camera.frame;
        DVec3::new(
            (placed.x - left) * self.cells + 1.0,
            (placed.y - top) * self.cells + 1.0,
            placed.z,
        )
    }

    /// Fills the cells whose centre is in a triangle.
    fn triangle(&mut self, [a, b, c]: [DVec3; 3], is_front: bool) {
        let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let range = |k: usize| {
            let low = a[k].min(b[k]).min(c[k]).floor().max(0.0) as usize;
            let high = a[k].max(b[k]).max(c[k]).ceil().max(0.0) as usize;
            low..(high + 1).min(self.size[k])
        };
        let (columns, rows) = (range(0), range(1));
        for row in rows {
            for column in columns.clone() {
                let (x, y) = (column as f64, row as f64);
                let at_b = ((x - a.x) * (c.y - a.y) - (y - a.y) * (c.x - a.x)) / area;
                let at_c = ((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)) / area;
                if at_b < -1e-9 || at_c < -1e-9 || at_b + at_c > 1.0 + 1e-9 {
                    continue;
                }
                let depth = (a.z + at_b * (b.z - a.z) + at_c * (c.z - a.z)) as f32;
                let index = row * self.size[0] + column;
                if depth > self.foremost[index] {
                    self.foremost[index] = depth;
                    self.is_front[index] = is_front;
                }
            }
        }
    }

    /// Number of cells that show the tool side and the back.
    fn seen(&self) -> (f64, f64) {
        let covered = self
            .foremost
            .iter()
            .zip(&self.is_front)
            .filter(|(depth, _)| depth.is_finite());
        covered.fold((0.0, 0.0), |(front, back), (_, is_front)| {
            if *is_front {
                (front + 1.0, back)
            } else {
                (front, back + 1.0)
            }
        })
    }

    /// Whether a point is not hidden by the surface. At silhouettes the farthest adjacent cell decides, so that lines on the
    /// surface are visible up to its edge.
    pub(super) fn shows(&self, placed: DVec3) -> bool {
        let DVec3 { x, y, z: depth } = self.cell(placed);
        let around = |value: f64, size: usize| {
            let middle = value.round().clamp(0.0, (size - 1) as f64) as usize;
            middle.saturating_sub(1)..(middle + 2).min(size)
        };
        let columns = around(x, self.size[0]);
        around(y, self.size[1]).any(|row| {
            columns.clone().any(|column| {
                let foremost = f64::from(self.foremost[row * self.size[0] + column]);
                foremost <= depth + DEPTH_SLACK
            })
        })
    }
}
