//! A job file for a face: complete, with comments, ready to run. This file chooses side, ball and place; `text.rs` writes.

mod text;

use super::machinable::outside;
use super::{CadError, Face, Form, MachinableFace, Measures, measure};
use oracle::{Surface, facing};

/// Standard radii of ball-end mills for the automatic choice, mm.
const RADII_MM: [f64; 13] = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
/// Largest ball radius of the automatic choice, as a share of the least concave radius; towards 1 the step-over on a concave
/// surface grows without bound.
const FIT: f64 = 0.8;
/// Default feed, mm/min.
pub const FEED_MM_MIN: f64 = 1200.0;
/// Default scallop height, mm.
const SCALLOP_MM: f64 = 0.01;
/// Largest default scallop height, as a share of the ball's radius.
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
/// No standard ball fits, and the options give none; the job must name the file and cannot.
pub fn write_job(
    source: &str,
    face: &Face,
    surface: &MachinableFace,
    options: &JobOptions,
) -> Result<JobText, CadError> {
    let writer = JobWriter::new(source, face, surface, options)?;
    Ok(JobText {
        text: writer.text(),
        radius_mm: writer.radius_mm,
        side: writer.side,
        measures: writer.measures,
        warnings: writer.warnings,
    })
}

/// A face, its surface, and what was chosen for its job.
struct JobWriter<'a> {
    source: &'a str,
    face: &'a Face,
    surface: &'a MachinableFace,
    options: &'a JobOptions,
    measures: Measures,
    /// The job names the face and its part, and is given a region.
    by_region: bool,
    /// Side of the tool, as in job files, and its sign on `S_u x S_v`.
    side: String,
    sign: f64,
    radius_mm: f64,
    /// The surface is placed with its centre at the origin.
    centred: bool,
    warnings: Vec<String>,
}

impl<'a> JobWriter<'a> {
    fn new(
        source: &'a str,
        face: &'a Face,
        surface: &'a MachinableFace,
        options: &'a JobOptions,
    ) -> Result<Self, CadError> {
        let measures = measure(&surface.spec());
        let by_region = options.in_part || is_of_part(surface);
        let (side, sign) = chosen_side(face, &measures, by_region, options.side.as_deref());
        let concave_mm = measures.concave_mm[usize::from(sign < 0.0)];
        let size_mm = measures.size_mm().into_iter().fold(0.0, f64::max);
        let ball = options.radius_mm.or_else(|| ball(concave_mm, size_mm));
        let radius_mm = ball.ok_or_else(|| no_ball(source, face, concave_mm, size_mm))?;
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
        let mut writer = Self {
            source,
            face,
            surface,
            options,
            centred: far_mm(&measures) > REACH_MM && !options.in_part,
            measures,
            by_region,
            side,
            sign,
            radius_mm,
            warnings: Vec::new(),
        };
        writer.warnings = [
            writer.outline_warning(),
            writer.form_warning(),
            writer.fit_warning(),
            writer.undercut_warning(),
            writer.place_warning(),
        ]
        .into_iter()
        .flatten()
        .collect();
        Ok(writer)
    }

    /// A trimmed face whose whole surface is machined.
    fn outline_warning(&self) -> Option<String> {
        let outline = &self.surface.outline;
        let why = outline
            .trimmed
            .as_ref()
            .filter(|_| self.surface.trimmed.is_none())?;
        Some(if outline.unknown {
            format!("{why}; the whole surface is machined, wherever the face on it ends")
        } else {
            format!("the face is trimmed ({why}); the whole rectangle of the surface around it is machined")
        })
    }

    /// An approximated surface.
    fn form_warning(&self) -> Option<String> {
        let Form::Fitted { why, deviation } = &self.surface.form else {
            return None;
        };
        Some(format!(
            "approximated, for {why}: within {:.6} mm of the face and {:.6} rad of its normal, measured at {} places",
            deviation.max_mm, deviation.normal_rad, deviation.places
        ))
    }

    /// A surface more concave than the ball.
    fn fit_warning(&self) -> Option<String> {
        let radius_mm = self.radius_mm;
        let concave_mm = self.measures.concave_mm[usize::from(self.sign < 0.0)];
        let concave_mm = concave_mm.filter(|concave_mm| *concave_mm <= radius_mm)?;
        Some(format!(
            "the least concave radius on the machined side is {concave_mm:.4} mm: the ball of {radius_mm} mm does not fit"
        ))
    }

    /// A surface that looks down, which no region leaves out.
    fn undercut_warning(&self) -> Option<String> {
        if self.by_region {
            return None;
        }
        let facing = facing(&Surface::new(&self.surface.spec()), self.sign);
        let turn = facing.turn_deg.map_or_else(
            || "no turn makes all of it look up".to_owned(),
            |turn| format!("rotate_deg = {turn:?} in [placement] turns it up"),
        );
        (facing.down_share > 0.0).then(|| {
            format!(
                "{:.2} % of the machined side looks down, where no tool along z can cut; {turn}",
                100.0 * facing.down_share
            )
        })
    }

    /// A surface beyond the machine's range.
    fn place_warning(&self) -> Option<String> {
        self.centred.then(|| {
            format!(
                "it lies up to {:.0} mm from the origin, the machine's range is 2147 mm; it is placed with its centre at the origin",
                far_mm(&self.measures)
            )
        })
    }
}

/// Side of the tool, as in job files, and its sign on `S_u x S_v`.
fn chosen_side(face: &Face, measures: &Measures, by_region: bool, given: Option<&str>) -> (String, f64) {
    let (chosen, sign) = match (by_region, side(face, measures)) {
        // The surface around a face may face another way than the face.
        (true, (_, sign)) => (if sign > 0.0 { "+" } else { "-" }, sign),
        (false, chosen) => chosen,
    };
    let side = given.unwrap_or(chosen).to_owned();
    let sign = match side.as_str() {
        "+" => 1.0,
        "-" => -1.0,
        "up" => measures.facing[2].signum(),
        _ => sign,
    };
    (side, sign)
}

/// Greatest distance of the surface from the origin along an axis, mm.
fn far_mm(measures: &Measures) -> f64 {
    let coordinates = measures.corners_mm.iter().flatten();
    coordinates.fold(0.0_f64, |far, x| far.max(x.abs()))
}

/// No standard ball fits.
fn no_ball(source: &str, face: &Face, concave_mm: Option<f64>, size_mm: f64) -> CadError {
    let [least, ..] = RADII_MM;
    let room = match concave_mm {
        Some(concave_mm) if concave_mm < size_mm => format!("its least concave radius is {concave_mm:.4} mm"),
        _ => format!("it is {size_mm:.4} mm long"),
    };
    CadError::face(
        source,
        format!(
            "face {}: {room}, no standard ball (from {least} mm) fits",
            face.number
        ),
        "give the ball with --radius-mm R (verify shows where it does not fit), or choose another side with --side",
    )
}
