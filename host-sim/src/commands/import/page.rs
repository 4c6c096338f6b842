//! `import --list --page`: a page with the picture of the part, on which faces are chosen.

use glam::DVec3;
use serde_json::{Value, json};

use super::list::{Row, words};
use cad::{Boundary, Edge, Face, Outline};

/// The page; `@DATA@` is where the faces stand.
const PAGE: &str = include_str!("page.html");
/// Quadrilaterals per side of a curved face, for few and for many faces.
const QUADS: [usize; 2] = [12, 5];
/// Number of faces from which they are many.
const MANY: usize = 200;

/// Coordinates of the page: a micrometre is finer than a pixel of any part.
fn rounded(point: impl Into<[f64; 3]>) -> [f64; 3] {
    point.into().map(|x| (x * 1e3).round() / 1e3)
}

/// A face as polygons, each a list of rings: its boundary if it is flat or trimmed, quadrilaterals of its surface otherwise.
fn polygons(face: &Face, outline: Option<&Outline>, quads: usize) -> Vec<Vec<Vec<[f64; 3]>>> {
    let trimmed = outline.is_none_or(|outline| outline.trimmed.is_some() && !outline.unknown);
    if let (Boundary::Loops(loops), true) = (&face.boundary, trimmed || face.surface.kind() == "plane") {
        let ring = |edges: &Vec<Edge>| edges.iter().flatten().map(|point| rounded(*point)).collect();
        return vec![loops.iter().map(ring).collect()];
    }
    let Some([u, v]) = outline.map(|outline| outline.rectangle) else {
        return Vec::new();
    };
    let quads = if face.surface.kind() == "plane" { 1 } else { quads };
    let at = |i: usize, j: usize| {
        let [u, v] =
            [(u, i), (v, j)].map(|([low, high], index)| low + (high - low) * index as f64 / quads as f64);
        face.surface.at_periodic(u, v).point
    };
    let mut polygons = Vec::new();
    for i in 0..quads {
        for j in 0..quads {
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if corners.iter().all(|corner| corner.is_finite()) {
                polygons.push(vec![corners.map(rounded).to_vec()]);
            }
        }
    }
    polygons
}

/// A file's name as one word of a shell's command line.
fn quoted(file: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+,:@".contains(c);
    if !file.is_empty() && file.chars().all(plain) && !file.starts_with('-') {
        return file.to_owned();
    }
    let path = if file.starts_with('-') {
        format!("./{file}")
    } else {
        file.to_owned()
    };
    format!("'{}'", path.replace('\'', "'\\''"))
}

fn face(file: &str, row: &Row<'_>, quads: usize) -> Value {
    let face = row.face;
    let outline = cad::outline(face).ok();
    let (area, size) = match &row.becomes {
        Ok((_, measures)) => {
            let [x, y, z] = measures.size_mm();
            (Some(measures.area_mm2), Some(format!("{x:.2} x {y:.2} x {z:.2}")))
        }
        Err(_) => (None, None),
    };
    let state = match (&row.becomes, row.boundary()) {
        (Err(_), _) => "cannot be imported",
        (Ok(_), "no") => "whole",
        (Ok(_), "yes") => "trimmed",
        (Ok(_), _) => {
            "boundary unknown: --untrimmed machines the whole rectangle of its surface, wherever the face ends"
        }
    };
    let undercut = row.facing.filter(|facing| facing.down_share > 0.0).map(words);
    let state = undercut.map_or_else(
        || state.to_owned(),
        |[undercut, turn]| format!("{state}; {undercut} looks down, turn: {turn}"),
    );
    // A trimmed face is machined as it is; without its boundary it is refused.
    let untrimmed = if row.boundary() == "unknown" {
        " --untrimmed"
    } else {
        ""
    };
    let command = format!(
        "{} import {} --face {}{untrimmed} -o part.toml",
        programs::command_name(),
        quoted(file),
        face.number
    );
    let polygons = polygons(face, outline.as_ref(), quads);
    json!({
        "number": face.number, "entity": face.entity, "kind": face.surface.kind(), "name": face.name, "rgb": face.colour, "area": area,
        "size": size, "state": state, "command": command, "whole_outline": polygons.len() == 1, "polygons": polygons,
    })
}

/// The page of these faces.
pub(super) fn page(file: &str, rows: &[Row<'_>]) -> String {
    let quads = QUADS[usize::from(rows.len() > MANY)];
    let data = json!({
        "file": file, "faces": rows.iter().map(|row| face(file, row, quads)).collect::<Vec<_>>(),
        // Areas of trimmed faces are not theirs.
        "rectangles": rows.iter().any(|row| row.boundary() != "no"),
    });
    // No text of the file ends the script.
    PAGE.replace("@DATA@", &data.to_string().replace('<', "\\u003c"))
}

/// A face of a whole part, as the page shows it.
pub(super) struct PartRow<'f> {
    /// The face on the machine.
    pub(super) face: &'f Face,
    /// Area, mm2.
    pub(super) area_mm2: Option<f64>,
    /// What becomes of it.
    pub(super) state: String,
    /// Its job, if it has one.
    pub(super) job: Option<String>,
    /// What is finished of it, as rings in space.
    pub(super) region: Vec<Vec<[f64; 3]>>,
    /// The face in cells, each with its colour; empty where the polygons above are exact.
    pub(super) cells: Vec<([u8; 3], [DVec3; 4])>,
    /// Red, green, blue.
    pub(super) tint: [u8; 3],
    /// Its place in the order in which the faces are machined, from 1.
    pub(super) run: Option<usize>,
}

/// What a colour stands for, or a sentence without one.
pub(super) type LegendEntry = (Option<[u8; 3]>, String);

/// An edge with few enough points for a picture.
fn thinned(edge: &Edge) -> Vec<[f64; 3]> {
    const POINTS: usize = 24;
    let step = edge.len().div_ceil(POINTS).max(1);
    let last = edge.last().filter(|_| edge.len() % step != 1);
    edge.iter()
        .step_by(step)
        .chain(last)
        .map(|point| rounded(*point))
        .collect()
}

/// The page of a whole part.
pub(super) fn part_page(file: &str, legend: &[LegendEntry], rows: &[PartRow<'_>]) -> String {
    let quads = QUADS[usize::from(rows.len() > MANY)];
    let faces = rows.iter().map(|row| {
        let outline = cad::outline(row.face).ok();
        let in_cells = !row.cells.is_empty();
        let polygons = if in_cells { Vec::new() } else { polygons(row.face, outline.as_ref(), quads) };
        let cells: Vec<_> = row.cells.iter().map(|(tint, corners)| (tint, corners.map(rounded))).collect();
        let edges: Vec<Vec<[f64; 3]>> = match &row.face.boundary {
            Boundary::Loops(loops) if in_cells => loops.iter().flatten().map(thinned).collect(),
            _ => Vec::new(),
        };
        let ring = |ring: &Vec<[f64; 3]>| ring.iter().map(|point| rounded(*point)).collect::<Vec<_>>();
        let region: Vec<_> = row.region.iter().map(ring).collect();
        // What CAD systems write where there is no name.
        let name = row.face.name.as_ref().filter(|name| !name.trim().is_empty() && *name != "NONE");
        let command = row.job.as_ref().map_or(String::new(), |job| {
            format!("{} verify {}", programs::command_name(), quoted(job))
        });
        json!({
            "run": row.run, "number": row.face.number, "entity": row.face.entity, "kind": row.face.surface.kind(), "name": name, "rgb": row.tint,
            "area": row.area_mm2, "size": null, "state": row.state, "command": command, "whole_outline": polygons.len() == 1,
            "polygons": polygons, "cells": cells, "edges": edges,
            "regions": if region.is_empty() || in_cells { Vec::new() } else { vec![region] },
        })
    });
    let data = json!({ "file": file, "legend": legend, "faces": faces.collect::<Vec<_>>() });
    PAGE.replace("@DATA@", &data.to_string().replace('<', "\\u003c"))
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_file_is_one_word() {
        for (file, word) in [
            ("jobs/cad/blade.step", "jobs/cad/blade.step"),
            ("a b.step", "'a b.step'"),
            ("x;rm -rf .step", "'x;rm -rf .step'"),
            ("it's $(1).igs", "'it'\\''s $(1).igs'"),
            ("-o", "'./-o'"),
        ] {
            assert_eq!(quoted(file), word);
        }
    }
}
