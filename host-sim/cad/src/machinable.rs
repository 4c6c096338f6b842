//! Conversion of a face to the surface of a job: exact up to the degree of the core, otherwise fitted within a tolerance.

use super::aspect::with_even_patches;
use super::edges::along_edges;
use super::exact::exact;
use super::fit::{Deviation, FitError, Knots, deviation_of_moved, fit};
use super::plane::suited;
use super::removal::without_needless_knots;
use super::spline::SplineSurface;
use super::straight::straightened;
use super::surface::Periodic;
use super::trim::{Polygon, trim};
use super::{CadError, Face, Outline, Surface, outline};
use job::{FaceParameters, NurbsSpec, SurfaceSpec};
use job_file::{TOLERANCE_DEFAULT_MM, TOLERANCE_MAX_MM};
use patches::records::{patch_count, streamed_patch_count};

/// Highest degree of the surface of a job.
const DEGREE_EXACT: usize = 3;
/// Precision of a trimmed region's polygons, mm.
const TRIM_MM: f64 = 0.002;

/// Share of the tolerance for corners that are straightened.
const CORNER_SHARE: f64 = 0.9;

/// Options of an import.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Largest deviation of a fit from the surface, mm.
    pub tolerance_mm: f64,
    /// Accept a trimmed face, as the rectangle around its boundary.
    pub untrimmed: bool,
    /// The parameters: with [`FaceParameters::Edges`] a face that is whole in them ends on its edges, with [`FaceParameters::Surface`] the surface goes on beyond it.
    pub parameters: FaceParameters,
    /// How far the surface goes on beyond the face, where it has more, mm.
    pub around_mm: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            tolerance_mm: TOLERANCE_DEFAULT_MM,
            untrimmed: false,
            parameters: FaceParameters::Edges,
            around_mm: 0.0,
        }
    }
}

/// Form of a converted surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// Exact.
    Exact,
    /// Approximated by a bicubic B-spline.
    Fitted {
        /// Reason of the approximation.
        why: String,
        /// Measured deviation.
        deviation: Deviation,
    },
}

/// A face converted for a job.
#[derive(Clone, Debug, PartialEq)]
pub struct MachinableFace {
    /// The surface.
    pub nurbs: NurbsSpec,
    /// Exact or not.
    pub form: Form,
    /// The part of the surface that the face uses.
    pub outline: Outline,
    /// The face on it, as polygons of (u, v); `None` where the surface is all that is known or wanted of it.
    pub trimmed: Option<Vec<Polygon>>,
    /// Patches on the board.
    pub patches: usize,
    /// Its parameters are between four edges of the face that are not iso-parametric lines of its surface.
    pub by_edges: bool,
    /// The parameters that were asked for.
    pub parameters: FaceParameters,
}

impl MachinableFace {
    /// The surface of a job.
    #[must_use]
    pub fn spec(&self) -> SurfaceSpec {
        SurfaceSpec::Nurbs(self.nurbs.clone())
    }
}

/// The surface of a job from a B-spline of degree up to 3.
fn nurbs(spline: &SplineSurface) -> NurbsSpec {
    let rational = spline.rational();
    let plain = |pole: &[f64; 4]| {
        let w = pole[3];
        [
            pole[0] / w,
            pole[1] / w,
            pole[2] / w,
            if rational { w } else { 1.0 },
        ]
    };
    NurbsSpec {
        degree: [spline.axes[0].degree, spline.axes[1].degree],
        knots_u: spline.axes[0].knots.clone(),
        knots_v: spline.axes[1].knots.clone(),
        poles_mm: spline
            .poles
            .iter()
            .map(|row| row.iter().map(plain).collect())
            .collect(),
        rational,
    }
}

/// This surface around the origin, for the number of its patches: where it lies does not count, a job's `[placement]` moves it.
fn centred(nurbs: &NurbsSpec) -> SurfaceSpec {
    let mut centred = nurbs.clone();
    let poles = || nurbs.poles_mm.iter().flatten();
    for axis in 0..3 {
        let [low, high] = poles().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], pole| {
            [low.min(pole[axis]), high.max(pole[axis])]
        });
        let middle = 0.5 * (low + high);
        centred
            .poles_mm
            .iter_mut()
            .flatten()
            .for_each(|pole| pole[axis] -= middle);
    }
    SurfaceSpec::Nurbs(centred)
}

/// Converts a face to the surface of a job.
///
/// # Errors
/// The boundary of the face is not known, open or crosses itself, and `untrimmed` is not set; it is unbounded; no fit within the tolerance is small enough for the
/// board, and it has no exact form that can be streamed; the tolerance is out of range.
pub fn machinable(file: &str, face: &Face, options: &Options) -> Result<MachinableFace, CadError> {
    let name = format!("face {} ({}, {})", face.number, face.entity, face.surface.kind());
    if !(options.tolerance_mm > 0.0 && options.tolerance_mm <= TOLERANCE_MAX_MM) {
        let what = format!(
            "a tolerance of {} mm is not above 0 and at most {TOLERANCE_MAX_MM}",
            options.tolerance_mm
        );
        return Err(CadError::new(file, what, "give a tolerance in mm, e.g. 0.001"));
    }
    let outline = outline(face).map_err(|why| {
        CadError::face(
            file,
            format!("{name}: {why}"),
            "choose another face; import --list shows them",
        )
    })?;
    if outline.unknown && !options.untrimmed {
        let why = outline.trimmed.as_deref().unwrap_or_default();
        return Err(CadError::face(
            file,
            format!("{name}: {why}"),
            "export the part as STEP, or import it with --untrimmed (in a job: untrimmed = true) to machine the whole \
             surface, wherever the face on it ends",
        ));
    }
    let suited = if options.untrimmed {
        None
    } else {
        suited(face, &outline)
    };
    let (face, outline) = match &suited {
        Some((face, outline)) => (face, outline),
        None => (face, &outline),
    };
    let is_by_edges = !options.untrimmed && options.parameters == FaceParameters::Edges;
    if is_by_edges && let Some(made) = between_edges(file, face, options, outline, &name) {
        return Ok(made);
    }
    let around_mm = if is_by_edges && outline.trimmed.is_none() {
        0.0
    } else {
        options.around_mm
    };
    let grown = grown(&face.surface, outline.rectangle, around_mm);
    let made = converted(file, face, options, outline, grown, &name);
    let (mut made, rectangle) = match made {
        // What is around a face is wanted, the face is needed.
        Err(_) if grown != outline.rectangle => (
            converted(file, face, options, outline, outline.rectangle, &name)?,
            outline.rectangle,
        ),
        made => (made?, grown),
    };
    if !options.untrimmed && (outline.trimmed.is_some() || rectangle != outline.rectangle) {
        let over = (made.form == Form::Exact).then_some(rectangle);
        let polygons = trim(face, outline, over, TRIM_MM).map_err(|error| {
            CadError::face(
                file,
                format!("{name}: {}", error.what),
                "repair the face in the CAD system, or import it with --untrimmed (in a job: untrimmed = true) to machine the \
                 whole rectangle around it",
            )
        })?;
        made.trimmed = Some(polygons);
    }
    Ok(made)
}

/// A trimmed face with parameters between its four edges, where that is exact and the store holds it.
fn between_edges(
    file: &str,
    face: &Face,
    options: &Options,
    outline: &Outline,
    name: &str,
) -> Option<MachinableFace> {
    let (face, outline) = along_edges(face, outline)?;
    let made = converted(file, &face, options, &outline, outline.rectangle, name).ok()?;
    let fits = made.form == Form::Exact && patch_count(&centred(&made.nurbs)).is_ok();
    fits.then_some(MachinableFace {
        by_edges: true,
        ..made
    })
}

/// A rectangle of parameters with more of the surface around it, as far as there is any.
fn grown(surface: &Surface, rectangle: [[f64; 2]; 2], around_mm: f64) -> [[f64; 2]; 2] {
    if around_mm <= 0.0 {
        return rectangle;
    }
    let middle = rectangle.map(|[low, high]| 0.5 * (low + high));
    let on = Periodic::new(surface);
    std::array::from_fn(|k| {
        let [mut low, mut high] = rectangle[k];
        if let Some(period) = on.periods[k]
            && high - low >= period * (1.0 - 1e-9)
        {
            return [low, high];
        }
        // Where the parameter is slower than in the middle, more of it is needed, but not at a pole.
        let by = |end: f64| {
            let speed = |at: [f64; 2]| {
                let at = on.at(at[0], at[1]);
                if k == 0 { at.u.length() } else { at.v.length() }
            };
            let mut at = middle;
            at[k] = end;
            around_mm / speed(at).max(0.3 * speed(middle)).max(f64::MIN_POSITIVE)
        };
        (low, high) = (low - by(low), high + by(high));
        (low, high) = match (on.domain[k], on.periods[k]) {
            (_, Some(period)) if high - low > period => (middle[k] - 0.5 * period, middle[k] + 0.5 * period),
            (Some([least, most]), None) => (low.max(least), high.min(most)),
            _ => (low, high),
        };
        let [least, most] = surface.between_points(k, middle[k]);
        [low.max(least), high.min(most)]
    })
}

/// The surface of a job over a rectangle of a face's surface.
fn converted(
    file: &str,
    face: &Face,
    options: &Options,
    outline: &Outline,
    rectangle: [[f64; 2]; 2],
    name: &str,
) -> Result<MachinableFace, CadError> {
    let with_form = |nurbs: NurbsSpec, patches, form: &Form| MachinableFace {
        nurbs,
        form: form.clone(),
        outline: outline.clone(),
        trimmed: None,
        patches,
        by_edges: false,
        parameters: options.parameters,
    };
    let mut why_fitted = "it has no exact form".to_owned();
    let mut larger = None;
    if let Some(spline) = exact(&face.surface, rectangle) {
        let (spline, form) = without_corners(
            &face.surface,
            without_needless_knots(&spline),
            options.tolerance_mm,
        );
        let degree = spline.axes.iter().map(|axis| axis.degree).max().unwrap_or(0);
        if degree <= DEGREE_EXACT {
            // Even patches where there is room for them.
            for spline in with_even_patches(&spline).into_iter().chain([spline]) {
                let nurbs = nurbs(&spline);
                let surface = centred(&nurbs);
                match patch_count(&surface) {
                    Ok(patches) => return Ok(with_form(nurbs, patches, &form)),
                    Err(why) => (why_fitted, larger) = (why, Some((nurbs, surface, form.clone()))),
                }
            }
        } else {
            why_fitted = format!("its degree is {degree}, the core's at most {DEGREE_EXACT}");
        }
    }
    // What the store holds at once needs no host while it runs: a fit is taken before a larger surface.
    fitted(file, face, options, outline, rectangle, why_fitted, name).or_else(|error| {
        let streamed = larger.and_then(|(nurbs, surface, form)| {
            let patches = streamed_patch_count(&surface).ok()?;
            Some(with_form(nurbs, patches, &form))
        });
        streamed.ok_or(error)
    })
}

/// The exact form of a B-spline with its corners of some arc minutes straightened, within the tolerance.
fn without_corners(surface: &Surface, spline: SplineSurface, tolerance_mm: f64) -> (SplineSurface, Form) {
    // The parameters of others are not those of their exact form.
    let is_spline = matches!(surface, Surface::Spline(_));
    let straight = is_spline.then(|| straightened(&spline, CORNER_SHARE * tolerance_mm));
    let Some((straight, moved_mm)) = straight.flatten() else {
        return (spline, Form::Exact);
    };
    let form = Form::Fitted {
        why: "its pieces meet in small corners, which are straightened".to_owned(),
        deviation: deviation_of_moved(surface, &straight, moved_mm),
    };
    (straight, form)
}

fn fitted(
    file: &str,
    face: &Face,
    options: &Options,
    outline: &Outline,
    rectangle: [[f64; 2]; 2],
    why: String,
    name: &str,
) -> Result<MachinableFace, CadError> {
    let too_fine = |what: String| {
        CadError::face(
            file,
            format!("{name}: {why}, and {what}"),
            format!(
                "give a larger --tolerance than {} mm, or split the face in the CAD system",
                options.tolerance_mm
            ),
        )
    };
    let counted = |spline: &SplineSurface| {
        let nurbs = nurbs(spline);
        let patches = patch_count(&centred(&nurbs))
            .map_err(|still| too_fine(format!("of a fit within {} mm {still}", options.tolerance_mm)))?;
        Ok((nurbs, patches))
    };
    let too_many_spans = || {
        too_fine(format!(
            "no fit within {} mm has few enough spans",
            options.tolerance_mm
        ))
    };
    let made = |knots: Knots| match fit(&face.surface, rectangle, options.tolerance_mm, knots) {
        Ok((spline, deviation)) => counted(&spline).map(|(nurbs, patches)| (nurbs, patches, deviation)),
        Err(FitError::TooManyPatches(spline)) => Err(counted(&spline).err().unwrap_or_else(too_many_spans)),
        Err(FitError::TooManySpans) => Err(too_many_spans()),
        Err(FitError::NotFinite) => Err(CadError::face(
            file,
            format!("{name}: it has no point at some of its parameters"),
            "choose another face; import --list shows them",
        )),
    };
    // A surface of many short pieces may be smoother than its knots tell.
    let (nurbs, patches, deviation) =
        made(Knots::OfSurface).or_else(|error| made(Knots::Fewest).map_err(|_: CadError| error))?;
    Ok(MachinableFace {
        nurbs,
        form: Form::Fitted { why, deviation },
        outline: outline.clone(),
        trimmed: None,
        patches,
        by_edges: false,
        parameters: options.parameters,
    })
}

/// Sign on `S_u x S_v` of the direction out of the material; `None` if the face does not bound a solid.
#[must_use]
pub(super) fn outside(face: &Face) -> Option<f64> {
    face.solid.then_some(face.sense)
}

/// Degrees of the surface in u and v in its file.
#[must_use]
pub fn degrees(surface: &Surface) -> Option<[usize; 2]> {
    match surface {
        Surface::Spline(spline) => Some([spline.axes[0].degree, spline.axes[1].degree]),
        Surface::Ruled { first, second } => Some([first.axis.degree.max(second.axis.degree), 1]),
        Surface::Offset { .. } => None,
        other => {
            let range = [0.0, 1.0];
            exact(other, other.domain().map(|domain| domain.unwrap_or(range)))
                .map(|spline| [spline.axes[0].degree, spline.axes[1].degree])
        }
    }
}
