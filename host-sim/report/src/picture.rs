//! `path.svg`: the surface with the passes on it.

use std::fmt::Write;

use super::furniture;
use super::marks::Marks;
use super::mesh::{Mesh, Quad};
use super::record::{Place, Record};
use super::scene::{Layer, Scene};
use super::svg::{polyline, simplified, tenths};
use super::texts::PictureTexts;
use super::view::Frame;
use glam::DVec3;

/// Size of the picture.
pub(super) const SIZE: [f64; 2] = [960.0, 620.0];
/// Frame of surface and tool.
const FRAME: Frame = [44.0, 84.0, 872.0, 432.0];
/// Tolerance of the simplification of lines, pixels.
const TOLERANCE: f64 = 0.12;
/// Direction to the light: right, up, towards the viewer.
const LIGHT: DVec3 = DVec3::new(-0.45, 0.62, 0.64);
/// Colour ramp of the tool side from shadow to full light, RGB.
const RAMP: [[f64; 3]; 3] = [[74.0, 91.0, 112.0], [156.0, 173.0, 192.0], [232.0, 239.0, 246.0]];
/// Colour ramp of the back of the surface from shadow to full light, RGB.
const BACK_RAMP: [[f64; 3]; 3] = [
    [146.0, 138.0, 130.0],
    [172.0, 165.0, 157.0],
    [203.0, 197.0, 190.0],
];
/// Contrast stretch: target span of brightness.
const CONTRAST: f64 = 0.62;
/// Contrast stretch: largest factor.
const GAIN_MAX: f64 = 2.2;
/// Contrast stretch: brightness at the centre of the span.
const MIDDLE: f64 = 0.66;
/// Approximate number of passes with an arrow.
const ARROWS: usize = 7;
/// Candidate positions of the arrow along a pass, as shares of its length, in order of preference.
const ARROW_PLACES: [f64; 4] = [0.72, 0.25, 0.86, 0.5];
/// Number of normals drawn between the highlighted pass and its CL path.
const COMB: usize = 36;

/// The picture and its view direction.
pub(super) struct Picture {
    pub(super) svg: String,
    /// Direction towards the viewer.
    pub(super) toward: DVec3,
}

/// The whole picture.
pub(super) fn picture(
    mesh: &Mesh,
    record: &Record,
    radius_mm: f64,
    words: &PictureTexts,
    marks: &Marks,
) -> Picture {
    let scene = Scene::new(mesh, record, radius_mm, marks.places(), FRAME);
    let mut out = String::new();
    furniture::open(&mut out, SIZE, words);
    let (quads, front) = scene.quads();
    let shading = Shading::new(&scene, &quads);
    surface(&mut out, &scene, &quads, &shading);
    lines(
        &mut out,
        "iso-line iso-edge",
        scene.edges().iter().map(|(_, run)| run),
    );
    passes(&mut out, &scene, record, Layer::Under);
    marks.ridges(&mut out, &scene, Layer::Under);
    one(&mut out, &scene, Layer::Under);
    if let Some(ball) = &scene.ball {
        normals(&mut out, &scene, Layer::Under);
        furniture::ball(&mut out, ball);
    }
    surface(&mut out, &scene, &front, &shading);
    passes(&mut out, &scene, record, Layer::Over);
    marks.ridges(&mut out, &scene, Layer::Over);
    one(&mut out, &scene, Layer::Over);
    arrows(&mut out, &scene, record);
    if let Some(ball) = &scene.ball {
        tool_path(&mut out, &scene);
        furniture::contact(&mut out, ball);
    }
    marks.numbers(&mut out, &scene, [28.0, 88.0]);
    furniture::triad(&mut out, &scene.camera.view, [70.0, SIZE[1] - 58.0]);
    furniture::scale_bar(&mut out, scene.camera.scale, [SIZE[0] - 44.0, SIZE[1] - 44.0]);
    furniture::key(&mut out, words, scene.ball.is_some(), [150.0, SIZE[1] - 62.0]);
    out.push_str("</svg>\n");
    Picture {
        svg: out,
        toward: scene.camera.view.toward,
    }
}

/// Shaded quads. Each is stroked in its own colour to close the seams between adjacent quads.
fn surface(out: &mut String, scene: &Scene<'_>, quads: &[Quad], shading: &Shading) {
    if quads.is_empty() {
        return;
    }
    out.push_str(
        "<g fill=\"currentColor\" stroke=\"currentColor\" stroke-width=\"1.2\" stroke-linejoin=\"round\">\n",
    );
    for quad in quads {
        let corners = quad
            .corners
            .map(|corner| scene.camera.place(corner).truncate().to_array());
        let [r, g, b] = shading.colour(scene.camera.view.turn(quad.normal));
        let _ = writeln!(
            out,
            "<path color=\"#{r:02x}{g:02x}{b:02x}\" d=\"{}z\"/>",
            polyline(&corners)
        );
    }
    out.push_str("</g>\n");
}

/// Maps the illumination of a face to its colour.
#[derive(Clone, Copy, Debug)]
struct Shading {
    middle: f64,
    gain: f64,
}

impl Shading {
    /// Stretches the contrast so that the shape of a nearly flat surface is visible.
    fn new(scene: &Scene<'_>, quads: &[Quad]) -> Self {
        let turned = quads
            .iter()
            .map(|quad| scene.camera.view.turn(quad.normal))
            .filter(|normal| normal.z > 0.0);
        let [low, high] = turned
            .map(brightness)
            .fold([1.0, 0.0], |[low, high]: [f64; 2], bright| {
                [low.min(bright), high.max(bright)]
            });
        let gain = (CONTRAST / (high - low).max(1e-3)).clamp(1.0, GAIN_MAX);
        Self {
            middle: 0.5 * (low + high),
            gain,
        }
    }

    /// Colour of a face with this normal in camera coordinates.
    fn colour(&self, normal: DVec3) -> [u8; 3] {
        let is_back = normal.z < 0.0;
        let normal = if is_back { -normal } else { normal };
        // With stronger stretch, the centre moves to the light half of the ramp.
        let middle = self.middle + (1.0 - 1.0 / self.gain) * (MIDDLE - self.middle);
        let bright = (middle + self.gain * (brightness(normal) - self.middle)).clamp(0.0, 1.0);
        let [dark, medium, light] = if is_back { BACK_RAMP } else { RAMP };
        let (from, to, share) = if bright < 0.5 {
            (dark, medium, 2.0 * bright)
        } else {
            (medium, light, 2.0 * bright - 1.0)
        };
        std::array::from_fn(|k| (from[k] + (to[k] - from[k]) * share).round() as u8)
    }
}

/// Diffuse illumination of a face, 0 to 1.
fn brightness(normal: DVec3) -> f64 {
    let light = LIGHT.normalize();
    let half = (light + DVec3::Z).normalize();
    let gloss = normal.dot(half).max(0.0).powi(24);
    (0.08 + 0.84 * normal.dot(light).max(0.0) + 0.1 * gloss).min(1.0)
}

/// One SVG path of all these lines.
pub(super) fn lines<'a>(out: &mut String, class: &str, runs: impl Iterator<Item = &'a Vec<[f64; 2]>>) {
    let data: String = runs.map(|run| polyline(&simplified(run, TOLERANCE))).collect();
    if !data.is_empty() {
        let _ = writeln!(out, "<path class=\"{class}\" d=\"{data}\"/>");
    }
}

/// Every drawn pass.
fn passes(out: &mut String, scene: &Scene<'_>, record: &Record, layer: Layer) {
    let runs: Vec<_> = record
        .drawn
        .iter()
        .flat_map(|drawn| scene.on_surface(&drawn.places.items()))
        .collect();
    lines(out, "iso-line iso-pass", of_layer(&runs, layer));
}

/// The highlighted pass.
fn one(out: &mut String, scene: &Scene<'_>, layer: Layer) {
    if let Some((_, places)) = &scene.one {
        let runs = scene.on_surface(places);
        lines(out, "iso-line iso-casing", of_layer(&runs, layer));
        lines(out, "iso-line iso-one", of_layer(&runs, layer));
    }
}

fn of_layer(runs: &[(Layer, Vec<[f64; 2]>)], layer: Layer) -> impl Iterator<Item = &Vec<[f64; 2]>> {
    runs.iter()
        .filter(move |(of, _)| *of == layer)
        .map(|(_, run)| run)
}

/// Normals between the highlighted pass and its CL path.
fn normals(out: &mut String, scene: &Scene<'_>, layer: Layer) {
    const STEPS: u32 = 8;
    let Some((_, places)) = &scene.one else {
        return;
    };
    let normal = |place: &Place| {
        let apart = place.cl_mm - place.cc_mm;
        let points = (0..=STEPS).map(|k| place.cc_mm + apart * (f64::from(k) / f64::from(STEPS)));
        scene.in_space(&points.collect::<Vec<_>>())
    };
    let runs: Vec<_> = even(places, COMB).flat_map(normal).collect();
    lines(out, "iso-line iso-comb", of_layer(&runs, layer));
}

/// CL path of the highlighted pass.
fn tool_path(out: &mut String, scene: &Scene<'_>) {
    let Some((_, places)) = &scene.one else {
        return;
    };
    normals(out, scene, Layer::Over);
    let centres: Vec<DVec3> = places.iter().map(|place| place.cl_mm).collect();
    let runs = scene.in_space(&centres);
    lines(out, "iso-line iso-casing", runs.iter().map(|(_, run)| run));
    lines(out, "iso-line iso-cl", runs.iter().map(|(_, run)| run));
}

/// `count` points evenly spaced along a pass, ends included.
fn even(places: &[Place], count: usize) -> impl Iterator<Item = &Place> {
    let last = places.len().saturating_sub(1);
    (0..=count).filter_map(move |k| places.get(k * last / count))
}

/// Arrow heads in the direction of the passes.
fn arrows(out: &mut String, scene: &Scene<'_>, record: &Record) {
    let one = scene.one.as_ref().map(|(pass, _)| *pass);
    // Odd, so that passes of both directions have arrows with zigzag.
    let every = (record.drawn.len() / ARROWS).max(1) | 1;
    let others = record
        .drawn
        .iter()
        .skip(every / 2)
        .step_by(every)
        .filter(|drawn| Some(drawn.pass) != one);
    for drawn in others {
        arrow(out, scene, &drawn.places.items(), "iso-head", 1.0);
    }
    if let Some((_, places)) = &scene.one {
        arrow(out, scene, places, "iso-one-fill iso-head-one", 2.1);
    }
}

fn arrow(out: &mut String, scene: &Scene<'_>, places: &[Place], class: &str, size: f64) {
    let found = ARROW_PLACES.iter().find_map(|share| scene.arrow(places, *share));
    let Some([[x, y], [dx, dy]]) = found else {
        return;
    };
    let length = dx.hypot(dy).max(1e-9);
    let (dx, dy) = (dx / length * size, dy / length * size);
    let corner = |along: f64, across: f64| {
        format!(
            "{} {}",
            tenths(x + along * dx - across * dy),
            tenths(y + along * dy + across * dx)
        )
    };
    let (tip, left, notch, right) = (
        corner(6.0, 0.0),
        corner(-4.0, 3.2),
        corner(-2.2, 0.0),
        corner(-4.0, -3.2),
    );
    let _ = writeln!(
        out,
        "<path class=\"{class}\" d=\"M{tip} {left} {notch} {right}z\"/>"
    );
}
