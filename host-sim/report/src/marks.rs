//! What is wrong, in the picture: numbered marks as on the page, and the places above the scallop limit.

use std::fmt::Write;

use super::content::{Mark, Remarks};
use super::furniture::text;
use super::picture::lines;
use super::record::Place;
use super::scallops::{RidgePoint, Scallops};
use super::scene::{Layer, Scene};
use super::svg::tenths;
use glam::DVec3;
use oracle::Oracle;

/// Marks in the list; more are counted.
const LISTED_MAX: usize = 8;
/// Distance of the list's lines, pixels.
const LINE: f64 = 19.0;
/// Marks nearer than this share a label, pixels.
const SAME: f64 = 8.0;

/// The marks of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Marks {
    marks: Vec<Mark>,
    /// Parts of ridges above the limit, as contacts with the ball's centre above them.
    above: Vec<Vec<Place>>,
}

impl Marks {
    /// The marks of these remarks.
    pub(super) fn new(oracle: &Oracle, remarks: &Remarks) -> Self {
        let above = remarks.scallops.as_ref().map(|scallops| above(oracle, scallops));
        Self {
            marks: remarks.marks.clone(),
            above: above.unwrap_or_default(),
        }
    }

    /// The marked places, mm.
    pub(super) fn places(&self) -> impl Iterator<Item = DVec3> {
        self.marks.iter().map(|mark| mark.place_mm)
    }

    /// The ridges above the limit, on this layer.
    pub(super) fn ridges(&self, out: &mut String, scene: &Scene<'_>, layer: Layer) {
        let runs: Vec<_> = self.above.iter().flat_map(|run| scene.on_surface(run)).collect();
        let of_layer = runs.iter().filter(|(of, _)| *of == layer);
        lines(out, "iso-line iso-over", of_layer.map(|(_, run)| run));
    }

    /// The marks with their numbers, hidden ones as outlines, and the list, whose first line begins at `corner`.
    pub(super) fn numbers(&self, out: &mut String, scene: &Scene<'_>, corner: [f64; 2]) {
        let mut labels: Vec<([f64; 2], String)> = Vec::new();
        for (index, mark) in self.marks.iter().enumerate() {
            let (at, is_shown) = scene.spot(mark.place_mm);
            let [x, y] = at.map(tenths);
            let class = if is_shown { "iso-mark" } else { "iso-mark-hidden" };
            let _ = writeln!(
                out,
                "<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"5\" stroke-width=\"1.5\"/>"
            );
            let number = (index + 1).to_string();
            let same =
                |(other, _): &&mut ([f64; 2], String)| (at[0] - other[0]).hypot(at[1] - other[1]) < SAME;
            match labels.iter_mut().find(same) {
                Some((_, numbers)) => *numbers += &format!(", {number}"),
                None => labels.push((at, number)),
            }
        }
        for ([x, y], numbers) in labels {
            let place = [x + 9.0, y - 6.0];
            text(
                out,
                "iso-bad iso-halo",
                place,
                15.0,
                "font-weight=\"700\"",
                &numbers,
            );
        }
        for (line, words) in self.list().iter().enumerate() {
            let place = [corner[0], corner[1] + LINE * line as f64];
            text(out, "iso-bad iso-halo", place, 14.0, "", words);
        }
    }

    fn list(&self) -> Vec<String> {
        let marks = self.marks.iter().enumerate().take(LISTED_MAX);
        let mut list: Vec<String> = marks
            .map(|(index, mark)| format!("{} {}", index + 1, mark.what))
            .collect();
        if self.marks.len() > LISTED_MAX {
            list.push(format!("and {} more", self.marks.len() - LISTED_MAX));
        }
        if !self.above.is_empty() {
            list.push("thick lines: above the scallop limit".to_owned());
        }
        list
    }
}

/// The parts of ridges that are above the limit by more than the measuring may be off, as the page colours them.
fn above(oracle: &Oracle, scallops: &Scallops) -> Vec<Vec<Place>> {
    let limit_mm = scallops.limit_mm + scallops.measurement_error_mm;
    let place = |point: &RidgePoint| {
        let cc_mm = oracle.surface.at(point.u, point.v).point;
        let normal = oracle.contact(point.u, point.v).ok()?.normal;
        Some(Place {
            cc_mm,
            cl_mm: cc_mm + normal,
        })
    };
    let mut runs = Vec::new();
    for (_, ridge) in &scallops.ridges {
        let is_above = |point: &RidgePoint| f64::from(point.height_mm) > limit_mm;
        for run in ridge.split(|point| !is_above(point)) {
            let mut places: Vec<Place> = run.iter().filter_map(place).collect();
            if let [one] = places[..] {
                // A point is drawn as a line of no length, with round ends.
                places.push(one);
            }
            if !places.is_empty() {
                runs.push(places);
            }
        }
    }
    runs
}
