//! `import --list`: the faces of a file, measured, chosen and in order.

use std::cmp::Ordering as Order;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use clap::ValueEnum;
use serde_json::{Value, json};

use super::super::out::say;
use super::super::{Result, output_file, progress, region_words};
use super::{Arguments, condition, deviation_json, page, whole_part};
use cad::{
    CadError, Face, Form, MachinableFace, Measures, Model, Options, degrees, machinable, machined_sign,
    measure,
};
use job::{FaceReach, one_line};
use oracle::{Facing, Surface, facing};

/// What the faces are sorted by, ascending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Key {
    /// The number in the file.
    Face,
    /// The area.
    Area,
    /// The number of patches.
    Patches,
    /// The kind of surface.
    Kind,
    /// The name.
    Name,
    /// The colour.
    Colour,
    /// The centre's x.
    X,
    /// The centre's y.
    Y,
    /// The centre's z.
    Z,
    /// The least concave radius of the two sides; faces that are not concave come last.
    Concave,
}

impl Key {
    /// Sorts rows that are in the order of the file; those without the key come last.
    fn sort(self, rows: &mut [Row<'_>]) {
        let by_number = |of: &dyn Fn(&(MachinableFace, Measures)) -> f64, a: &Row<'_>, b: &Row<'_>| {
            let of = |row: &Row<'_>| row.becomes.as_ref().map_or(f64::INFINITY, of);
            of(a).total_cmp(&of(b))
        };
        let last = |a: Option<&str>, b: Option<&str>| match (a, b) {
            (Some(a), Some(b)) => a.cmp(b),
            (a, b) => b.is_some().cmp(&a.is_some()),
        };
        rows.sort_by(|a, b| match self {
            Self::Face => Order::Equal,
            Self::Area => by_number(&|(_, measures)| measures.area_mm2, a, b),
            #[allow(clippy::cast_precision_loss, reason = "some hundred")]
            Self::Patches => by_number(&|(made, _)| made.patches as f64, a, b),
            Self::Kind => a.face.surface.kind().cmp(b.face.surface.kind()),
            Self::Name => last(a.face.name.as_deref(), b.face.name.as_deref()),
            Self::Colour => b
                .face
                .colour
                .is_some()
                .cmp(&a.face.colour.is_some())
                .then(a.face.colour.cmp(&b.face.colour)),
            Self::X => by_number(&|(_, measures)| measures.centre_mm()[0], a, b),
            Self::Y => by_number(&|(_, measures)| measures.centre_mm()[1], a, b),
            Self::Z => by_number(&|(_, measures)| measures.centre_mm()[2], a, b),
            Self::Concave => by_number(
                &|(_, measures)| {
                    measures
                        .concave_mm
                        .into_iter()
                        .flatten()
                        .fold(f64::INFINITY, f64::min)
                },
                a,
                b,
            ),
        });
    }
}

/// Mean normal of a face of a solid out of the material, of another face by its orientation; `None` for a closed surface.
fn normal(face: &Face, measures: &Measures) -> Option<[f64; 3]> {
    unit(measures.facing, face.sense)
}

/// A vector, turned by a sign, of length 1; `None` for a vanishing one.
fn unit(vector: [f64; 3], sign: f64) -> Option<[f64; 3]> {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length > 1e-6).then(|| vector.map(|x| x * sign / length))
}

/// A line of the list.
pub(super) struct Row<'f> {
    pub(super) face: &'f Face,
    /// Why the face is not a whole rectangle.
    pub(super) trimmed: Option<String>,
    /// Whether its boundary could not be read.
    unknown: bool,
    pub(super) becomes: std::result::Result<(MachinableFace, Measures), CadError>,
    /// How the side that is machined faces.
    pub(super) facing: Option<Facing>,
}

impl Row<'_> {
    /// Mean normal of the side that is machined; `None` for a closed surface.
    pub(super) fn machined_normal(&self) -> Option<[f64; 3]> {
        let (_, measures) = self.becomes.as_ref().ok()?;
        unit(measures.facing, machined_sign(self.face, measures))
    }

    /// Whether the face is trimmed, in a word.
    pub(super) fn boundary(&self) -> &'static str {
        match (&self.trimmed, self.unknown) {
            (None, _) => "no",
            (Some(_), false) => "yes",
            (Some(_), true) => "unknown",
        }
    }
}

/// Measures all faces on all cores; rows in the order of the faces.
fn rows<'f>(file: &str, faces: &'f [Face], options: &Options) -> Vec<Row<'f>> {
    let bar = progress(faces.len() as u64, "measuring");
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(faces.len()));
    // A trimmed face is listed with the size of its untrimmed rectangle.
    let options = Options {
        untrimmed: true,
        ..*options
    };
    let threads = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    std::thread::scope(|scope| {
        for _ in 0..threads.min(faces.len()) {
            scope.spawn(|| {
                while let Some(face) = faces.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let becomes = machinable(file, face, &options).map(|made| {
                        let measures = measure(&made.spec());
                        (made, measures)
                    });
                    let trimmed = becomes
                        .as_ref()
                        .ok()
                        .and_then(|(made, _)| made.outline.trimmed.clone());
                    let unknown = becomes.as_ref().is_ok_and(|(made, _)| made.outline.unknown);
                    let facing = becomes.as_ref().ok().map(|(made, measures)| {
                        facing(&Surface::new(&made.spec()), machined_sign(face, measures))
                    });
                    bar.inc(1);
                    if let Ok(mut done) = done.lock() {
                        done.push(Row {
                            face,
                            trimmed,
                            unknown,
                            becomes,
                            facing,
                        });
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    let mut rows = done.into_inner().unwrap_or_default();
    rows.sort_by_key(|row| row.face.number);
    rows
}

fn row_json(row: &Row<'_>) -> Value {
    let face = row.face;
    let mut value = json!({
        "face": face.number,
        "entity": face.entity,
        "kind": face.surface.kind(),
        "degree": degrees(&face.surface),
        "solid": face.solid,
        "name": face.name,
        "colour": face.colour.map(condition::hex),
        "trimmed": row.trimmed.is_some(),
        "trimmed_why": row.trimmed,
        "boundary_known": !row.unknown,
    });
    let more = match &row.becomes {
        Ok((made, measures)) => json!({
            "poles": [made.nurbs.poles_mm.len(), made.nurbs.poles_mm[0].len()],
            "patches": made.patches,
            "rational": made.nurbs.rational,
            "size_mm": measures.size_mm(),
            "corners_mm": measures.corners_mm,
            "centre_mm": measures.centre_mm(),
            "area_mm2": measures.area_mm2,
            "normal": normal(face, measures),
            "least_concave_radius_mm": { "plus": measures.concave_mm[0], "minus": measures.concave_mm[1] },
            "becomes": if made.form == Form::Exact { "exact" } else { "approximated" },
            "deviation": deviation_json(&made.form),
            "undercut_share": row.facing.map(|facing| facing.down_share),
            "undercut_error_share": row.facing.map(|facing| facing.error_share),
            "turn_deg": row.facing.and_then(|facing| facing.turn_deg),
            "error": Value::Null,
        }),
        Err(error) => json!({ "becomes": Value::Null, "error": error.what }),
    };
    if let (Value::Object(value), Value::Object(more)) = (&mut value, more) {
        value.extend(more);
    }
    value
}

/// Share of the area that looks down, and the turn after which nothing does.
pub(super) fn words(facing: Facing) -> [String; 2] {
    let share = 100.0 * facing.down_share;
    let turn = match facing.turn_deg {
        Some(turn) if turn == [0.0; 3] => "-".to_owned(),
        Some([x, y, z]) => format!("[{x}, {y}, {z}]"),
        None => "none".to_owned(),
    };
    let undercut = if facing.down_share > 0.0 && share < 0.01 {
        "< 0.01 %".to_owned()
    } else {
        format!("{share:.2} %")
    };
    [undercut, turn]
}

fn print_rows(rows: &[Row<'_>]) {
    say!(
        "{:>5} {:<18} {:<6} {:>8} {:>26} {:>11} {:>11} {:<8} {:>11} {:>28} {:<17} {:>8} {:<20} {:<28} {:<8} name",
        "face",
        "kind",
        "degree",
        "patches",
        "size mm",
        "concave +",
        "concave -",
        "trimmed",
        "area mm2",
        "centre mm",
        "normal",
        "undercut",
        "turn",
        "becomes",
        "colour"
    );
    for row in rows {
        let face = row.face;
        let degree = degrees(&face.surface).map_or("-".to_owned(), |[p, q]| format!("{p} x {q}"));
        let (kind, number) = (face.surface.kind(), face.number);
        let colour = face.colour.map_or("-".to_owned(), condition::hex);
        let name = one_line(face.name.as_deref().unwrap_or("-"));
        let trimmed = row.boundary();
        match &row.becomes {
            Ok((made, measures)) => {
                let [x, y, z] = measures.size_mm();
                let size = format!("{x:.2} x {y:.2} x {z:.2}");
                let [plus, minus] = measures
                    .concave_mm
                    .map(|radius| radius.map_or("-".to_owned(), |radius| format!("{radius:.3}")));
                let becomes = match &made.form {
                    Form::Exact => "exact".to_owned(),
                    Form::Fitted { deviation, .. } => {
                        format!("approximated, within {:.1e} mm", deviation.max_mm)
                    }
                };
                let patches = made.patches;
                let area = measures.area_mm2;
                let [x, y, z] = measures.centre_mm();
                // Without the sign of a zero.
                let plain = |x: f64| if x.abs() < 0.005 { 0.0 } else { x };
                let [x, y, z] = [x, y, z].map(plain);
                let centre = format!("{x:.2}, {y:.2}, {z:.2}");
                let normal = normal(face, measures).map_or("-".to_owned(), |[x, y, z]| {
                    let [x, y, z] = [x, y, z].map(plain);
                    format!("{x:.2} {y:.2} {z:.2}")
                });
                let [undercut, turn] = row.facing.map_or([const { String::new() }; 2], words);
                say!(
                    "{number:>5} {kind:<18} {degree:<6} {patches:>8} {size:>26} {plus:>11} {minus:>11} {trimmed:<8} {area:>11.2} {centre:>28} \
                     {normal:<17} {undercut:>8} {turn:<20} {becomes:<28} {colour:<8} {name}"
                );
            }
            Err(error) => say!("{number:>5} {kind:<18} {degree:<6} {:>8} {}", "-", error.what),
        }
    }
}

/// Prints the faces that meet the conditions, in the order that is asked for.
///
/// # Errors
/// The page cannot be written.
pub(super) fn list(arguments: &Arguments, file: &str, model: &Arc<Model>, options: &Options) -> Result<()> {
    let mut rows = rows(file, &model.faces, options);
    rows.retain(|row| arguments.only.iter().all(|condition| condition.holds(row)));
    arguments.sort.sort(&mut rows);
    if arguments.reverse {
        rows.reverse();
    }
    if let Some(path) = &arguments.page {
        output_file::write(path, page::page(file, &rows).as_bytes(), arguments.force)?;
    }
    let faces: Vec<&Face> = rows.iter().map(|row| row.face).collect();
    let reaches = arguments
        .radius_mm
        .map(|radius_mm| whole_part::reaches(arguments, file, model, &faces, radius_mm));
    if arguments.json {
        let faces = rows.iter().enumerate().map(|(index, row)| {
            let mut value = row_json(row);
            if let Some(reaches) = &reaches {
                value["reach"] = reaches[index].as_ref().map_or(Value::Null, region_words::json);
            }
            value
        });
        let value = json!({
            "file": file,
            "faces": faces.collect::<Vec<_>>(),
            "warnings": model.warnings,
        });
        say!("{value}");
        return Ok(());
    }
    print_rows(&rows);
    say!(
        "{} of {} faces. concave: least concave radius, mm, seen from the side of + or - S_u x S_v. normal: mean, out of the material where \
         that is known. undercut: share of the machined side's area that looks down, where no tool along z can cut. turn: rotate_deg in [placement] \
         after which nothing of it does. Size, area and radii of a trimmed face are those of the rectangle around it.",
        rows.len(),
        model.faces.len()
    );
    if let Some(reaches) = &reaches {
        print_reaches(arguments, &faces, reaches);
    }
    if let Some(path) = &arguments.page {
        say!("page: {}", path.display());
    }
    Ok(())
}

/// What the ball reaches of each face without touching another.
fn print_reaches(arguments: &Arguments, faces: &[&Face], reaches: &[std::result::Result<FaceReach, String>]) {
    let radius_mm = arguments.radius_mm.unwrap_or(0.0);
    say!("reach of a ball of radius {radius_mm} mm from +z, without touching another face:");
    let mut sums = [0.0; 2];
    for (face, reach) in faces.iter().zip(reaches) {
        let reach = match reach {
            Ok(reach) => reach,
            Err(why) => {
                say!("{:>5} not known: {why}", face.number);
                continue;
            }
        };
        sums = [sums[0] + reach.reachable_mm2, sums[1] + reach.area_mm2];
        let lost: Vec<String> = (reach.unreachable_mm2.iter())
            .map(|(reason, area)| format!("{area:.2} mm2 {reason}"))
            .collect();
        say!(
            "{:>5} {:>11.2} of {:>11.2} mm2  {}",
            face.number,
            reach.reachable_mm2,
            reach.area_mm2,
            lost.join(", ")
        );
    }
    let share = if sums[1] > 0.0 {
        100.0 * sums[0] / sums[1]
    } else {
        0.0
    };
    say!("  all {:>11.2} of {:>11.2} mm2 ({share:.2} %)", sums[0], sums[1]);
}
