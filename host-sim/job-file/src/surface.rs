//! The section `[surface]`: one reader per kind.

use std::f64::consts::TAU;

use job::{JobError, NurbsSpec, SurfaceSpec};
use patches::records::PATCHES_MAX;

use crate::file::{Face, FaceReader, FaceSurface};
use crate::section::{Section, Value};

/// Highest degree of a NURBS surface: the core's patches are bicubic.
const DEGREE_MAX: usize = 3;
/// Largest magnitude of a knot: beyond it a range may have no digits left for its places.
const KNOT_MAX: f64 = 1e9;
/// Excess over a full turn allowed for `v_rad`, rad: rounding of a 2 pi written in decimals.
const TURN_TOLERANCE_RAD: f64 = 1e-9;
/// Negative radius allowed for a profile, mm: rounding of a profile that ends on the axis.
const RADIUS_TOLERANCE_MM: f64 = 1e-9;

/// Every key of any kind of surface, and the kinds that have the key.
const KEYS: [(&str, &str); 17] = [
    ("radius_mm", "only a revolved surface has it"),
    ("height_mm", "only a revolved surface has it"),
    ("v_rad", "only a revolved surface has it; here the range is `v`"),
    ("coefficients_mm", "only a bicubic surface has it"),
    ("rail0_mm", "only a ruled surface has it"),
    ("rail1_mm", "only a ruled surface has it"),
    ("degree", "only a nurbs surface has it"),
    ("knots_u", "only a nurbs surface has it"),
    ("knots_v", "only a nurbs surface has it"),
    ("poles_mm", "only a nurbs surface has it"),
    ("path", "only a surface of kind \"file\" has it"),
    ("face", "only a surface of kind \"file\" has it"),
    ("tolerance_mm", "only a surface of kind \"file\" has it"),
    ("source", "only a nurbs surface has it"),
    ("source_face", "only a nurbs surface has it"),
    ("untrimmed", "only a surface of kind \"file\" has it"),
    ("parameters", "only a surface of kind \"file\" has it"),
];

/// The kind of surface.
#[derive(Clone, Copy)]
enum Kind {
    Revolved,
    Ruled,
    Bicubic,
    Nurbs,
    File,
}

/// Reads the section `[surface]`.
///
/// `around_mm`: how far the surface of a face goes on beyond it. Returns the surface, and the face of a CAD file that it was made from.
pub(super) fn read(
    section: &Section<'_>,
    faces: &dyn FaceReader,
    around_mm: f64,
) -> Result<(FaceSurface, Option<Face>), JobError> {
    let whole = |surface: SurfaceSpec| FaceSurface {
        surface,
        trimmed: false,
    };
    let kind = section.choice(
        "kind",
        &[
            ("revolved", Kind::Revolved),
            ("bicubic", Kind::Bicubic),
            ("ruled", Kind::Ruled),
            ("nurbs", Kind::Nurbs),
            ("file", Kind::File),
        ],
    )?;
    match kind {
        Kind::Revolved => Ok((whole(revolved(section)?), None)),
        Kind::Ruled => Ok((whole(ruled(section)?), None)),
        Kind::Bicubic => Ok((whole(bicubic(section)?), None)),
        Kind::Nurbs => Ok((whole(nurbs(section)?), crate::file::source(section)?)),
        Kind::File => {
            crate::file::read(section, &KEYS, faces, around_mm).map(|(surface, face)| (surface, Some(face)))
        }
    }
}

fn revolved(section: &Section<'_>) -> Result<SurfaceSpec, JobError> {
    let elsewhere: Vec<_> = [("v", "the range of a revolved surface is `v_rad`")]
        .into_iter()
        .chain(KEYS)
        .collect();
    section.only(&["kind", "radius_mm", "height_mm", "u", "v_rad"], &elsewhere)?;
    let radius_mm = section.numbers("radius_mm")?;
    let height_mm = section.numbers("height_mm")?;
    let u = range_or_unit(section, "u")?;
    let v_rad = range(section, "v_rad")?;
    if v_rad[1] - v_rad[0] > TAU + TURN_TOLERANCE_RAD {
        let what = format!("`v_rad` spans {} rad, more than a full turn", v_rad[1] - v_rad[0]);
        return Err(section.error("v_rad", what, "give a range of at most 2 pi = 6.283185307179586"));
    }
    let (least_mm, at) = least_of_cubic(&radius_mm, u);
    if least_mm < -RADIUS_TOLERANCE_MM {
        let what = format!("the profile's radius is negative: {least_mm} mm at u = {at}");
        return Err(section.error(
            "radius_mm",
            what,
            "change `radius_mm` or narrow `u` so that it stays at or above 0",
        ));
    }
    Ok(SurfaceSpec::Revolved {
        radius_mm,
        height_mm,
        u,
        v_rad,
    })
}

fn ruled(section: &Section<'_>) -> Result<SurfaceSpec, JobError> {
    section.only(&["kind", "rail0_mm", "rail1_mm", "u", "v"], &KEYS)?;
    Ok(SurfaceSpec::Ruled {
        rail0_mm: section.matrix("rail0_mm")?,
        rail1_mm: section.matrix("rail1_mm")?,
        u: range_or_unit(section, "u")?,
        v: range_or_unit(section, "v")?,
    })
}

fn bicubic(section: &Section<'_>) -> Result<SurfaceSpec, JobError> {
    section.only(&["kind", "coefficients_mm", "u", "v"], &KEYS)?;
    let mut coefficients_mm = [[[0.0; 4]; 4]; 3];
    let coordinates = section.value("coefficients_mm")?.list_of(3, "coordinate")?;
    for (matrix, value) in coefficients_mm.iter_mut().zip(&coordinates) {
        *matrix = value.matrix()?;
    }
    let u = range_or_unit(section, "u")?;
    Ok(SurfaceSpec::Bicubic {
        coefficients_mm,
        u,
        v: range_or_unit(section, "v")?,
    })
}

fn nurbs(section: &Section<'_>) -> Result<SurfaceSpec, JobError> {
    let own_range = "the range of a nurbs surface is that of its knots";
    let elsewhere: Vec<_> = [("u", own_range), ("v", own_range), ("v_rad", own_range)]
        .into_iter()
        .chain(KEYS)
        .collect();
    section.only(
        &[
            "kind",
            "degree",
            "knots_u",
            "knots_v",
            "poles_mm",
            "source",
            "source_face",
            "tolerance_mm",
        ],
        &elsewhere,
    )?;
    let degree = [read_degree(section, 0)?, read_degree(section, 1)?];
    let mut poles_mm = read_poles(section)?;
    let columns = poles_mm.first().map_or(0, Vec::len);
    let knots_u = read_knots(section, "knots_u", degree[0], poles_mm.len())?;
    let knots_v = read_knots(section, "knots_v", degree[1], columns)?;
    few_enough(section, degree, [&knots_u, &knots_v])?;
    let weight = poles_mm[0][0][3];
    let rational = poles_mm.iter().flatten().any(|pole| pole[3] != weight);
    if !rational {
        poles_mm.iter_mut().flatten().for_each(|pole| pole[3] = 1.0);
    }
    Ok(SurfaceSpec::Nurbs(NurbsSpec {
        degree,
        knots_u,
        knots_v,
        poles_mm,
        rational,
    }))
}

/// The patches between the knots.
fn few_enough(section: &Section<'_>, degree: [usize; 2], knots: [&[f64]; 2]) -> Result<(), JobError> {
    let spans = |knots: &[f64], degree: usize| {
        let inside = &knots[degree..knots.len() - degree];
        inside.windows(2).filter(|pair| pair[0] < pair[1]).count()
    };
    let patches = spans(knots[0], degree[0]) * spans(knots[1], degree[1]);
    if patches <= PATCHES_MAX {
        return Ok(());
    }
    let what = format!("the knots make {patches} patches; a job has at most {PATCHES_MAX}");
    Err(section.error(
        "poles_mm",
        what,
        "use fewer knots, or cut the part into several jobs",
    ))
}

/// Degree in u (direction 0) or v (direction 1).
fn read_degree(section: &Section<'_>, direction: usize) -> Result<usize, JobError> {
    let entries = section.value("degree")?.list_of(2, "number")?;
    let entry = &entries[direction];
    let number = entry.number()?;
    let found = (1..=DEGREE_MAX).find(|degree| *degree as f64 == number);
    found.ok_or_else(|| {
        let remedy = format!("give whole numbers from 1 to {DEGREE_MAX}, e.g. [3, 3]");
        entry.error(
            &format!("must be a whole number from 1 to {DEGREE_MAX}, not {number}"),
            remedy,
        )
    })
}

/// Poles with their weights; all rows have the length of the first.
fn read_poles(section: &Section<'_>) -> Result<Vec<Vec<[f64; 4]>>, JobError> {
    let rows = section.value("poles_mm")?.list("row")?;
    let mut poles: Vec<Vec<[f64; 4]>> = Vec::with_capacity(rows.len());
    for row in &rows {
        let entries = row.list("pole")?;
        if let Some(first) = poles.first().filter(|first| first.len() != entries.len()) {
            let what = format!("has {} poles, but row 1 has {}", entries.len(), first.len());
            return Err(row.error(
                &what,
                "give every row the same number of poles (one row for each pole along u)",
            ));
        }
        poles.push(entries.iter().map(read_pole).collect::<Result<_, _>>()?);
    }
    if poles.first().is_none_or(Vec::is_empty) {
        return Err(section.error(
            "poles_mm",
            "`poles_mm` is empty",
            "give rows of poles [x, y, z] or [x, y, z, w]",
        ));
    }
    Ok(poles)
}

/// One pole: `[x, y, z]` or `[x, y, z, w]`.
fn read_pole(value: &Value<'_, '_>) -> Result<[f64; 4], JobError> {
    let entries = value.list("number")?;
    if entries.len() != 3 && entries.len() != 4 {
        let what = format!("must have 3 or 4 numbers, not {}", entries.len());
        return Err(value.error(&what, "write [x, y, z], or [x, y, z, w] with a weight"));
    }
    let mut pole = [0.0, 0.0, 0.0, 1.0];
    for (number, entry) in pole.iter_mut().zip(&entries) {
        *number = entry.number()?;
    }
    if pole[3] <= 0.0 {
        let what = format!("has the weight {}, which must be above 0", pole[3]);
        return Err(value.error(&what, "give a weight above 0, or leave it out for 1"));
    }
    Ok(pole)
}

/// Knots of one direction for this degree and number of poles.
fn read_knots(section: &Section<'_>, key: &str, degree: usize, poles: usize) -> Result<Vec<f64>, JobError> {
    let rows_or_columns = if key == "knots_u" { "rows" } else { "poles a row" };
    if poles <= degree {
        let what = format!("`poles_mm` has {poles} {rows_or_columns}, too few for degree {degree}");
        return Err(section.error(
            "poles_mm",
            what,
            format!("give at least {} {rows_or_columns}", degree + 1),
        ));
    }
    let entries = section.value(key)?.list("knot")?;
    let wanted = poles + degree + 1;
    if entries.len() != wanted {
        let what = format!(
            "`{key}` has {} knots, but {poles} {rows_or_columns} of degree {degree} \
             take {poles} + {degree} + 1 = {wanted}",
            entries.len()
        );
        return Err(section.error(
            key,
            what,
            format!("give {wanted} knots, or change the poles or the degree"),
        ));
    }
    let knots = entries.iter().map(Value::number).collect::<Result<Vec<_>, _>>()?;
    if let Some(at) = knots.iter().position(|knot| knot.abs() > KNOT_MAX) {
        let what = format!("is {}, beyond {KNOT_MAX:e}", knots[at]);
        return Err(entries[at].error(&what, "scale the knots: the surface stays as it is"));
    }
    if let Some(at) = (1..knots.len()).find(|i| knots[*i] < knots[i - 1]) {
        let what = format!("is {}, below the previous one ({})", knots[at], knots[at - 1]);
        return Err(entries[at].error(&what, "give knots in ascending order"));
    }
    let (start, end) = (knots[degree], knots[poles]);
    if start >= end {
        let what = format!("`{key}` leaves an empty range: it starts and ends at {start}");
        return Err(section.error(key, what, "repeat the end knots at most degree + 1 times"));
    }
    check_multiplicity(&knots, &entries, degree)?;
    Ok(knots)
}

/// No knot inside the domain has a multiplicity above `degree`: the surface would be discontinuous there. No end knot has one above
/// `degree + 1`: its pole would have no influence.
fn check_multiplicity(knots: &[f64], entries: &[Value<'_, '_>], degree: usize) -> Result<(), JobError> {
    let (start, end) = (knots[degree], knots[knots.len() - 1 - degree]);
    for (at, knot) in knots.iter().enumerate() {
        let times = knots[..=at]
            .iter()
            .rev()
            .take_while(|other| *other == knot)
            .count();
        let (most, place) = if *knot > start && *knot < end {
            (degree, "inside the range")
        } else {
            (degree + 1, "at an end")
        };
        if times > most {
            let what = format!("gives {knot} a multiplicity of {times}; {place} it may be at most {most}");
            return Err(entries[at].error(
                &what,
                "remove the repeated knot and its row of poles, or split the surface there",
            ));
        }
    }
    Ok(())
}

/// A range; `[0, 1]` by default.
fn range_or_unit(section: &Section<'_>, key: &str) -> Result<[f64; 2], JobError> {
    if section.has(key) {
        range(section, key)
    } else {
        Ok([0.0, 1.0])
    }
}

/// An ascending range.
fn range(section: &Section<'_>, key: &str) -> Result<[f64; 2], JobError> {
    let range: [f64; 2] = section.numbers(key)?;
    if range[0] < range[1] {
        return Ok(range);
    }
    let what = format!("`{key}` must ascend, not run from {} to {}", range[0], range[1]);
    Err(section.error(key, what, "give [least, most]"))
}

/// Minimum of a cubic (highest power first) on a range and its location: at an end or at a zero of the derivative.
fn least_of_cubic(c: &[f64; 4], range: [f64; 2]) -> (f64, f64) {
    let (a, b, d) = (3.0 * c[0], 2.0 * c[1], c[2]);
    let root = (b * b - 4.0 * a * d).max(0.0).sqrt();
    let q = -0.5 * (b + root.copysign(b));
    let extremes = [q / a, d / q, range[0], range[1]];
    let value = |u: f64| ((c[0] * u + c[1]) * u + c[2]) * u + c[3];
    let inside = extremes.into_iter().filter(|u| *u >= range[0] && *u <= range[1]);
    inside
        .map(|u| (value(u), u))
        .fold((f64::INFINITY, range[0]), |least, next| {
            if next.0 < least.0 { next } else { least }
        })
}
