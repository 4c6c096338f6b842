//! Visibility: the position of the ball, and the visible parts of lines.

use super::mesh::{FINE, Mesh, Quad};
use super::record::{DrawnPass, Place, Record};
use super::view::{Camera, Depth, Frame, View};
use glam::DVec3;

/// Largest ball radius that is drawn, as a share of the surface's diagonal: a larger ball would cover the picture.
const BALL_SHARE: f64 = 0.4;
/// Candidate positions of the ball along the highlighted pass, in order of preference.
const BALL_PLACES: [f64; 9] = [0.5, 0.56, 0.44, 0.62, 0.38, 0.68, 0.32, 0.76, 0.24];
/// Least cosine between tool normal and view direction at which the contact is visible under the ball.
const BALL_FACING: f64 = 0.15;
/// Least gain in visible share of the ball for a less preferred position.
const BALL_GAIN: f64 = 0.04;

/// Drawing order of a part of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layer {
    /// Behind the surface: not drawn.
    Hidden,
    /// Drawn before the ball, which is in front.
    Under,
    /// Drawn after the ball.
    Over,
}

/// The ball in the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    /// Contact and centre in picture coordinates.
    pub(super) cc: DVec3,
    pub(super) cl: DVec3,
    /// Pixels.
    pub(super) radius: f64,
}

impl Ball {
    /// Whether a point is behind the ball. No point is inside the ball, so the plane through its centre decides.
    fn hides(&self, placed: DVec3, margin: f64) -> bool {
        self.covers(placed, margin) && placed.z < self.cl.z
    }

    /// Whether a point of the picture is within the disc of the ball plus a margin.
    fn covers(&self, placed: DVec3, margin: f64) -> bool {
        (placed.x - self.cl.x).hypot(placed.y - self.cl.y) < self.radius + margin
    }
}

/// The surface and the tool as seen by a camera.
#[derive(Debug)]
pub(super) struct Scene<'a> {
    mesh: &'a Mesh,
    pub(super) camera: Camera,
    depth: Depth,
    pub(super) ball: Option<Ball>,
    /// The highlighted pass.
    pub(super) one: Option<(u32, Vec<Place>)>,
}

impl<'a> Scene<'a> {
    /// The best view of the surface, with the tool on the middle pass of the record, and these places within the frame.
    pub(super) fn new(
        mesh: &'a Mesh,
        record: &Record,
        radius_mm: f64,
        marked: impl Iterator<Item = DVec3>,
        frame: Frame,
    ) -> Self {
        let one = highlighted(record).map(|drawn| (drawn.pass, drawn.places.items()));
        let has_tool = radius_mm < BALL_SHARE * mesh.diagonal();
        let mut extent = mesh.extent();
        let view = View::best(mesh, &extent, frame);
        if let (Some((_, places)), true) = (&one, has_tool) {
            extent.extend(places.iter().map(|place| place.cl_mm));
            let middle = places.len() / 3..(2 * places.len()).div_ceil(3);
            for place in &places[middle] {
                let axes = (0..3).flat_map(|k| [(k, radius_mm), (k, -radius_mm)]);
                extent.extend(axes.map(|(k, by)| {
                    let mut point = place.cl_mm;
                    point[k] += by;
                    point
                }));
            }
        }
        extent.extend(marked);
        let camera = Camera::new(view, &extent, frame);
        let mut scene = Self {
            mesh,
            camera,
            depth: Depth::of(mesh, &camera),
            ball: None,
            one,
        };
        if has_tool {
            scene.ball = scene.best_ball(radius_mm * camera.scale);
        }
        scene
    }

    /// The ball at its most visible position.
    fn best_ball(&self, radius: f64) -> Option<Ball> {
        let (_, places) = self.one.as_ref()?;
        let mut best: Option<(f64, Ball)> = None;
        for (rank, share) in BALL_PLACES.iter().enumerate() {
            let index = ((places.len().checked_sub(1)?) as f64 * share) as usize;
            let place = places[index];
            let ball = Ball {
                cc: self.camera.place(place.cc_mm),
                cl: self.camera.place(place.cl_mm),
                radius,
            };
            let facing = self.facing(&place);
            let score = self.uncovered(&ball) + facing.min(BALL_FACING) - BALL_GAIN * rank as f64;
            if best.is_none_or(|(most, _)| score > most) {
                best = Some((score, ball));
            }
        }
        best.map(|(_, ball)| ball)
    }

    /// Cosine between the tool normal at a point and the direction to the viewer.
    fn facing(&self, place: &Place) -> f64 {
        let normal = place.cl_mm - place.cc_mm;
        normal.dot(self.camera.view.toward) / normal.length().max(1e-12)
    }

    /// Visible share of the disc of the ball.
    fn uncovered(&self, ball: &Ball) -> f64 {
        const STEPS: i32 = 8;
        let offsets = || (-STEPS..=STEPS).map(|k| f64::from(k) / f64::from(STEPS));
        let disc = offsets()
            .flat_map(|x| offsets().map(move |y| (x, y)))
            .filter(|(x, y)| x.hypot(*y) <= 1.0);
        let (shown, all) = disc.fold((0.0, 0.0), |(shown, all), (x, y)| {
            let spot = ball.cl + DVec3::new(x * ball.radius, y * ball.radius, 0.0);
            (shown + f64::from(u8::from(self.depth.shows(spot))), all + 1.0)
        });
        shown / all
    }

    /// The quads of the surface, farthest first; and those in front of the ball.
    pub(super) fn quads(&self) -> (Vec<Quad>, Vec<Quad>) {
        let depth = |quad: &Quad| self.camera.place(middle(quad)).z;
        let mut quads: Vec<_> = self.mesh.quads(FINE).collect();
        quads.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        let in_front = |quad: &&Quad| {
            let placed = self.camera.place(middle(quad));
            let reach = 0.5 * quad.area.sqrt() * self.camera.scale;
            self.ball
                .is_some_and(|ball| ball.covers(placed, reach) && !ball.hides(placed, reach))
        };
        let front = quads.iter().filter(in_front).copied().collect();
        (quads, front)
    }

    /// Visible parts of a line on the tool side of the surface.
    pub(super) fn on_surface(&self, places: &[Place]) -> Vec<(Layer, Vec<[f64; 2]>)> {
        let layers = places.iter().map(|place| {
            let placed = self.camera.place(place.cc_mm);
            let layer = if self.facing(place) > 0.0 {
                self.layer(placed)
            } else {
                Layer::Hidden
            };
            (placed, layer)
        });
        runs(layers)
    }

    /// A place in the picture, and whether it is visible.
    pub(super) fn spot(&self, place: DVec3) -> ([f64; 2], bool) {
        let placed = self.camera.place(place);
        (placed.truncate().to_array(), self.depth.shows(placed))
    }

    /// Visible parts of a line in space.
    pub(super) fn in_space(&self, points: &[DVec3]) -> Vec<(Layer, Vec<[f64; 2]>)> {
        runs(points.iter().map(|point| {
            let placed = self.camera.place(*point);
            (placed, self.layer(placed))
        }))
    }

    /// Visible parts of the boundary of the surface.
    pub(super) fn edges(&self) -> Vec<(Layer, Vec<[f64; 2]>)> {
        self.mesh
            .edges()
            .iter()
            .flat_map(|edge| self.in_space(edge))
            .collect()
    }

    /// Position of a contact in the picture and direction of the pass there, if visible.
    pub(super) fn arrow(&self, places: &[Place], share: f64) -> Option<[[f64; 2]; 2]> {
        let index = (places.len() as f64 * share) as usize;
        let reach = (places.len() / 40).max(1);
        let (from, at, to) = (
            places.get(index.checked_sub(reach)?)?,
            places.get(index)?,
            places.get(index + reach)?,
        );
        let placed = self.camera.place(at.cc_mm);
        if self.facing(at) < 0.1
            || !self.depth.shows(placed)
            || self.ball.is_some_and(|b| b.covers(placed, 8.0))
        {
            return None;
        }
        let [from, to] = [from, to].map(|place| self.camera.place(place.cc_mm));
        Some([placed, to - from].map(|at| at.truncate().to_array()))
    }

    fn layer(&self, placed: DVec3) -> Layer {
        if !self.depth.shows(placed) {
            Layer::Hidden
        } else if self.ball.is_some_and(|ball| ball.hides(placed, 0.0)) {
            Layer::Under
        } else {
            Layer::Over
        }
    }
}

/// The middle pass, or the pass nearest to the middle if the run ended before it.
pub(super) fn highlighted(record: &Record) -> Option<&DrawnPass> {
    let middle = record.drawn.iter().find(|drawn| drawn.pass == record.middle_pass);
    middle.or_else(|| record.drawn.get(record.drawn.len() / 2))
}

/// The middle of a quad.
pub(super) fn middle(quad: &Quad) -> DVec3 {
    quad.corners
        .iter()
        .fold(DVec3::ZERO, |sum, corner| sum + corner * 0.25)
}

/// Runs of consecutive visible points of one layer. Where a line changes layers, both runs contain the point.
fn runs(points: impl Iterator<Item = (DVec3, Layer)>) -> Vec<(Layer, Vec<[f64; 2]>)> {
    let mut runs: Vec<(Layer, Vec<[f64; 2]>)> = Vec::new();
    let mut before: Option<([f64; 2], Layer)> = None;
    for (placed, layer) in points {
        let point = placed.truncate().to_array();
        if layer != Layer::Hidden {
            match (runs.last_mut(), before) {
                (Some((_, run)), Some((_, was))) if was == layer => run.push(point),
                (_, Some((from, was))) if was != Layer::Hidden => runs.push((layer, vec![from, point])),
                _ => runs.push((layer, vec![point])),
            }
        }
        before = Some((point, layer));
    }
    runs.retain(|(_, run)| run.len() > 1);
    runs
}
