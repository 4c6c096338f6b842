//! A job file for a face: complete, with comments, ready to run.

use std::fmt::Write;

use super::machinable::outside;
use super::{CadError, Face, Form, MachinableFace, Measures, measure};
use job::{NurbsSpec, one_line};
use oracle::{Surface, facing};

/// Standard radii of ball-end mills for the automatic choice, mm.
const RADII_MM: [f64; 13] = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
/// Largest ball radius of the automatic choice, as a share of the least concave radius; towards 1 the step-over on a concave
/// surface grows without bound.
const FIT: f64 = 0.8;
/// Default feed, mm/min.
pub const FEED_MM_MIN: f64 = 1200.0;
/// Default scallop height, mm, and the largest as a share of the ball's radius.
const SCALLOP_MM: f64 = 0.01;
const SCALLOP_SHARE: f64 = 0.1;
/// Least z of the mean normal of a surface that faces up.
const UP: f64 = 0.1;
/// A surface that reaches farther than this from the origin is placed with its centre there, mm: the machine's range is 2147 mm either way, and
/// the ball and its way up and down need some.
const REACH_MM: f64 = 2000.0;
/// Axis limits of a face of a part, those of the job file's defaults: without limits a job has no links, and no place between its passes would be safe.
pub const LIMITS: &str = "# Axis limits: put in those of the machine, or run with its profile.\n\
     velocity_max_mm_s = [100, 100, 50]\n\
     acceleration_max_mm_s2 = [1000, 1000, 500]\n\
     jerk_max_mm_s3 = [20000, 20000, 10000]\n";
/// The same for a face by itself, which may be for studying the geometry.
const NO_LIMITS: &str = "# A machine's axis limits, or its profile (--machine FILE): without them the job is for studying the geometry.\n\
     # velocity_max_mm_s = [100, 100, 50]\n\
     # acceleration_max_mm_s2 = [1000, 1000, 500]\n\
     # jerk_max_mm_s3 = [20000, 20000, 10000]\n";
/// Digits of a written coordinate: full precision of f64.
const COLUMN: usize = 100;

/// Scallop height limit of a job that is given none, mm, for a ball of this radius, mm.
#[must_use]
pub fn default_scallop_mm(radius_mm: f64) -> f64 {
    SCALLOP_MM.min(SCALLOP_SHARE * radius_mm)
}

/// Options of the job; `None`: chosen automatically.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JobOptions {
    /// Ball radius, mm.
    pub radius_mm: Option<f64>,
    /// Feed along the surface, mm/min.
    pub feed_mm_min: Option<f64>,
    /// Scallop height limit, mm.
    pub scallop_mm: Option<f64>,
    /// Surface parameter along a pass, as in job files.
    pub along: Option<String>,
    /// Side of the tool, as in job files.
    pub side: Option<String>,
    /// Order of the passes, as in job files.
    pub pattern: Option<String>,
    /// The job's region is made from the face and its part, whether the face is trimmed or not.
    pub in_part: bool,
    /// Rotation of the part about x, y and z, degrees.
    pub rotate_deg: [f64; 3],
    /// Its translation after that, mm.
    pub translate_mm: [f64; 3],
    /// Path of the CAD file relative to the job file, and the tolerance of an approximation, mm: an approximated surface names its source.
    pub source: Option<(String, f64)>,
}

/// A job file and the chosen options.
#[derive(Clone, Debug, PartialEq)]
pub struct JobText {
    /// The file's text.
    pub text: String,
    /// Ball radius, mm.
    pub radius_mm: f64,
    /// Side of the tool, as in job files.
    pub side: String,
    /// Measures of the surface.
    pub measures: Measures,
    /// Warnings for the user of the job.
    pub warnings: Vec<String>,
}

/// Whether the job names the face and its part: a face that ends within its surface has neighbours there.
const fn is_of_part(surface: &MachinableFace) -> bool {
    surface.trimmed.is_some() || surface.by_edges
}

/// The machined side: away from the material if known, otherwise the upper side; written as `"up"` if that side faces up.
fn side(face: &Face, measures: &Measures) -> (&'static str, f64) {
    let up = measures.facing[2];
    let signed = |sign: f64| if sign > 0.0 { "+" } else { "-" };
    match outside(face) {
        Some(sign) if up * sign > UP => ("up", sign),
        Some(sign) => (signed(sign), sign),
        None if up.abs() > UP => ("up", up.signum()),
        None => (signed(face.sense), face.sense),
    }
}

/// Sign on `S_u x S_v` of the side of a face that is machined unless the user chooses another: out of the material if that is known, else up.
#[must_use]
pub fn machined_sign(face: &Face, measures: &Measures) -> f64 {
    side(face, measures).1
}

/// The largest standard radius below the least concave radius of the machined side; `None` below the smallest.
fn ball(concave_mm: Option<f64>, size_mm: f64) -> Option<f64> {
    let room = concave_mm
        .map_or(f64::INFINITY, |radius| FIT * radius)
        .min(0.5 * size_mm);
    RADII_MM.into_iter().rev().find(|radius| *radius <= room)
}

/// Writes a job for a face. `source` says where it came from, for the comment.
///
/// # Errors
/// No standard ball fits, and the options give none.
pub fn write_job(
    source: &str,
    face: &Face,
    surface: &MachinableFace,
    options: &JobOptions,
) -> Result<JobText, CadError> {
    let measures = measure(&surface.spec());
    let by_region = options.in_part || is_of_part(surface);
    let (chosen, sign) = match (by_region, side(face, &measures)) {
        // The surface around a face may face another way than the face.
        (true, (_, sign)) => (if sign > 0.0 { "+" } else { "-" }, sign),
        (false, chosen) => chosen,
    };
    let side = options.side.clone().unwrap_or_else(|| chosen.to_owned());
    let sign = match side.as_str() {
        "+" => 1.0,
        "-" => -1.0,
        "up" => measures.facing[2].signum(),
        _ => sign,
    };
    let concave_mm = measures.concave_mm[usize::from(sign < 0.0)];
    let size_mm = measures.size_mm().into_iter().fold(0.0, f64::max);
    let radius_mm = options.radius_mm.or_else(|| ball(concave_mm, size_mm)).ok_or_else(|| {
        let [least, ..] = RADII_MM;
        let room = match concave_mm {
            Some(concave_mm) if concave_mm < size_mm => format!("its least concave radius is {concave_mm:.4} mm"),
            _ => format!("it is {size_mm:.4} mm long"),
        };
        CadError::face(
            source,
            format!("face {}: {room}, no standard ball (from {least} mm) fits", face.number),
            "give the ball with --radius-mm R (verify shows where it does not fit), or choose another side with --side",
        )
    })?;
    let mut warnings = Vec::new();
    if by_region && options.source.is_none() {
        return Err(CadError::face(
            source,
            format!(
                "the job of face {} must name its file, and cannot name {source:?}",
                face.number
            ),
            "give the CAD file a plain name, or machine the whole rectangle around the face with --untrimmed",
        ));
    }
    if let Some(why) = surface
        .outline
        .trimmed
        .as_ref()
        .filter(|_| surface.trimmed.is_none())
    {
        warnings.push(if surface.outline.unknown {
            format!("{why}; the whole surface is machined, wherever the face on it ends")
        } else {
            format!("the face is trimmed ({why}); the whole rectangle of the surface around it is machined")
        });
    }
    if let Form::Fitted { why, deviation } = &surface.form {
        warnings.push(format!(
            "approximated, for {why}: within {:.6} mm of the face and {:.6} rad of its normal, measured at {} places",
            deviation.max_mm, deviation.normal_rad, deviation.places
        ));
    }
    if let Some(concave_mm) = concave_mm.filter(|concave_mm| *concave_mm <= radius_mm) {
        warnings.push(format!(
            "the least concave radius on the machined side is {concave_mm:.4} mm: the ball of {radius_mm} mm does not fit"
        ));
    }
    let facing = facing(&Surface::new(&surface.spec()), sign);
    if facing.down_share > 0.0 && !by_region {
        let turn = facing.turn_deg.map_or_else(
            || "no turn makes all of it look up".to_owned(),
            |turn| format!("rotate_deg = {turn:?} in [placement] turns it up"),
        );
        warnings.push(format!(
            "{:.2} % of the machined side looks down, where no tool along z can cut; {turn}",
            100.0 * facing.down_share
        ));
    }
    let far_mm = measures
        .corners_mm
        .iter()
        .flatten()
        .fold(0.0_f64, |far, x| far.max(x.abs()));
    let centred = far_mm > REACH_MM && !options.in_part;
    if centred {
        warnings.push(format!(
            "it lies up to {far_mm:.0} mm from the origin, the machine's range is 2147 mm; it is placed with its centre at the origin"
        ));
    }
    let text = text(
        source, face, surface, options, &measures, &warnings, radius_mm, &side, centred,
    );
    Ok(JobText {
        text,
        radius_mm,
        side,
        measures,
        warnings,
    })
}

#[allow(clippy::too_many_arguments, reason = "all of them are of one file")]
fn text(
    source: &str,
    face: &Face,
    surface: &MachinableFace,
    options: &JobOptions,
    measures: &Measures,
    warnings: &[String],
    radius_mm: f64,
    side: &str,
    centred: bool,
) -> String {
    let mut out = String::new();
    let size = measures.size_mm();
    let _ = writeln!(
        out,
        "# Face {} ({}, {}) of {}: {:.3} x {:.3} x {:.3} mm, {} patches{}.",
        face.number,
        one_line(&face.entity),
        face.surface.kind(),
        one_line(source),
        size[0],
        size[1],
        size[2],
        surface.patches,
        if surface.form == Form::Exact {
            ", exact"
        } else {
            ""
        }
    );
    for warning in warnings {
        let _ = writeln!(out, "# Note: {}.", one_line(warning));
    }
    out.push('\n');
    let of_file = options
        .source
        .as_ref()
        .filter(|_| options.in_part || is_of_part(surface));
    if let Some((path, tolerance_mm)) = of_file {
        // Its region is made when the job is read.
        let _ = writeln!(
            out,
            "[surface]\nkind = \"file\"\npath = {path:?}\nface = {}\ntolerance_mm = {tolerance_mm}\nparameters = {:?}      # \"edges\": of four edges of the face where it has them; \"surface\"\n\n\
             # What must not be cut; the region of the face is what the tool reaches without cutting it.\n\
             [part]\npath = {path:?}",
            face.number,
            surface.parameters.name(),
        );
    } else {
        write_surface(&mut out, &surface.nurbs);
    }
    if let (Form::Fitted { .. }, None, Some((path, tolerance_mm))) = (&surface.form, of_file, &options.source)
    {
        let _ = writeln!(
            out,
            "# What the surface approximates: `cargo sim verify` measures against it\nsource = {path:?}\nsource_face = {}\ntolerance_mm = {tolerance_mm}",
            face.number
        );
    }
    if options.rotate_deg != [0.0; 3] || options.translate_mm != [0.0; 3] {
        let _ = write!(
            out,
            "\n[placement]\nrotate_deg = {:?}    # of the whole part\ntranslate_mm = {:?}\n",
            options.rotate_deg, options.translate_mm
        );
    } else if centred {
        out.push_str("\n[placement]\nplace = \"centre\"            # the centre of its box, at translate_mm\ntranslate_mm = [0, 0, 0]\n");
    }
    let or = |given: &Option<String>, default: &str| given.clone().unwrap_or_else(|| default.to_owned());
    let concave = match measures.concave_mm {
        [None, None] => "the surface is not concave".to_owned(),
        [plus, minus] => {
            let shown =
                |radius: Option<f64>| radius.map_or("none".to_owned(), |radius| format!("{radius:.4} mm"));
            format!(
                "least concave radius: {} seen from +, {} from -",
                shown(plus),
                shown(minus)
            )
        }
    };
    let _ = write!(
        out,
        "\n[tool]\nkind = \"ball\"\nradius_mm = {radius_mm}               # {concave}\n\n\
         [cut]\n\
         feed_mm_min = {}           # of the cutter contact along the surface\n\
         scallop_mm = {}            # scallop height limit between passes\n\
         along = {}                # surface parameter along a pass\n\
         side = {}                # machined side: \"up\", or the sign on S_u x S_v\n\
         pattern = {}              # \"zig\": every pass in the same direction; \"zigzag\": alternating\n\
         chord_mm = 0.005            # chord error limit, for export and the approaches made of chords\n\n\
         [machine]\n\
         period_us = 1000            # sampling period\n{}",
        options.feed_mm_min.unwrap_or(FEED_MM_MIN),
        options
            .scallop_mm
            .unwrap_or_else(|| default_scallop_mm(radius_mm)),
        quoted(&or(&options.along, "u")),
        quoted(side),
        quoted(&or(
            &options.pattern,
            if options.in_part { "zigzag" } else { "zig" }
        )),
        if options.in_part { LIMITS } else { NO_LIMITS }
    );
    out
}

/// A TOML string.
fn quoted(text: &str) -> String {
    format!(
        "\"{}\"",
        one_line(&text.replace('\\', "\\\\").replace('"', "\\\""))
    )
}

fn write_surface(out: &mut String, nurbs: &NurbsSpec) {
    let list = |name: &str, numbers: &[f64]| {
        let mut text = format!("{name} = [");
        let mut column = text.len();
        for (index, number) in numbers.iter().enumerate() {
            let word = format!("{number}{}", if index + 1 < numbers.len() { ", " } else { "" });
            if column + word.len() > COLUMN {
                text.push_str("\n    ");
                column = 4;
            }
            column += word.len();
            text.push_str(&word);
        }
        text.push_str("]\n");
        text
    };
    let _ = writeln!(
        out,
        "[surface]\nkind = \"nurbs\"\ndegree = [{}, {}]",
        nurbs.degree[0], nurbs.degree[1]
    );
    out.push_str(&list("knots_u", &nurbs.knots_u));
    out.push_str(&list("knots_v", &nurbs.knots_v));
    let what = if nurbs.rational {
        "[x, y, z, weight]"
    } else {
        "[x, y, z]"
    };
    let _ = writeln!(
        out,
        "# {what}; one block per pole along u, containing the poles along v\npoles_mm = ["
    );
    for row in &nurbs.poles_mm {
        out.push_str("    [\n");
        for [x, y, z, w] in row {
            let weight = if nurbs.rational {
                format!(", {w}")
            } else {
                String::new()
            };
            let _ = writeln!(out, "        [{x}, {y}, {z}{weight}],");
        }
        out.push_str("    ],\n");
    }
    out.push_str("]\n");
}
