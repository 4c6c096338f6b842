//! Resolves the faces and the parts of jobs: the surface, then the region that the job's tool reaches.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use cad::{Model, Placement, model_with, surface_of};
use job::{CadSource, FaceReach, Job, PartSource, Region};
use job_file::{Face, FaceError, FaceReader, FaceRegion, FaceSurface, STEEPEST_DEG};
use oracle::{Oracle, Surface};
use patches::placement::Rotation;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::body::Part;
use crate::region::{Made, Request};
use crate::tool::{Reason, Tool};

/// The method by which regions are made: others in a cache are not used.
const METHOD: u32 = 15;
/// Folder beside the job in which regions are kept.
const CACHE: &str = ".isofeed";
/// How deep the tool may enter the part, mm, where no part says it: only the grid of a face alone depends on it.
const TOUCH_MM: f64 = 0.002;

/// Placements that differ by less are one: rounding, as a share and in mm.
const SAME_MM: f64 = 1e-9;

/// The [`FaceReader`] that uses the reader of CAD files.
#[derive(Clone, Copy, Debug)]
pub struct Faces;

impl FaceReader for Faces {
    fn surface(&self, wanted: &Face) -> Result<FaceSurface, FaceError> {
        let model = model_with(&wanted.path, wanted.number)?;
        let made = surface_of(wanted, &model)?;
        Ok(FaceSurface {
            surface: made.spec(),
            trimmed: made.trimmed.is_some(),
        })
    }

    fn region(&self, job: &Job) -> Result<FaceRegion, FaceError> {
        let Some(source) = job.origin.cad() else {
            return Err(FaceError {
                what: "the surface is of no CAD file, so that its place in the part is not known".to_owned(),
                remedy: "give the face of the part: [surface] kind = \"file\", path, face; or remove [part]"
                    .to_owned(),
                of_face: false,
            });
        };
        let file = cache_file(job, source);
        let kept = file.as_ref().and_then(|file| kept(file));
        let found = match kept {
            Some(found) => found,
            None => {
                let found = made(job, source)?;
                if let Some(file) = &file {
                    keep(file, &found);
                }
                found
            }
        };
        if found.loops.is_empty() {
            return Err(nothing(source, &found, job.radius_mm));
        }
        Ok(FaceRegion {
            region: Region::new(found.loops.clone()),
            reach: found.reach(),
        })
    }
}

/// A region as it is kept.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Found {
    loops: Vec<Vec<[f64; 2]>>,
    area_mm2: f64,
    reachable_mm2: f64,
    region_mm2: f64,
    unreachable_mm2: Vec<(String, f64)>,
    radius_mm: Option<f64>,
    top_mm: Option<f64>,
    unknown: Vec<usize>,
}

impl Found {
    fn new(made: Made, part: Option<&Part>) -> Self {
        let named = |(reason, area): (Reason, f64)| (reason.name().to_owned(), area);
        Self {
            loops: made.loops,
            area_mm2: made.area_mm2,
            reachable_mm2: made.reachable_mm2,
            region_mm2: made.inside_mm2,
            unreachable_mm2: made.unreachable_mm2.into_iter().map(named).collect(),
            radius_mm: made.radius_mm,
            top_mm: part.map(|part| part.block().high.z),
            unknown: part.map_or_else(Vec::new, |part| {
                part.missing.iter().map(|missing| missing.number).collect()
            }),
        }
    }

    fn reach(&self) -> FaceReach {
        FaceReach {
            area_mm2: self.area_mm2,
            reachable_mm2: self.reachable_mm2,
            region_mm2: self.region_mm2,
            unreachable_mm2: self.unreachable_mm2.clone(),
            radius_mm: self.radius_mm,
            top_mm: self.top_mm,
            unknown: self.unknown.clone(),
        }
    }
}

/// The map from the file to the machine.
#[must_use]
pub fn placement(job: &Job) -> Placement {
    let Some(source) = job.origin.cad() else {
        return Placement::IDENTITY;
    };
    let rotation = Rotation::of_degrees(job.origin.rotate_deg()).0;
    let linear = rotation.map(|row| row.map(|entry| entry * source.scale));
    let corner = |spec: &job::SurfaceSpec| {
        let [[u, _], [v, _]] = spec.domain();
        Surface::new(spec).at(u, v).point.to_array()
    };
    let (before, after) = (corner(&source.surface), corner(&job.surface));
    Placement {
        rows: std::array::from_fn(|i| {
            let [a, b, c] = linear[i];
            let turned = a * before[0] + b * before[1] + c * before[2];
            [a, b, c, after[i] - turned]
        }),
    }
}

/// The part of a job on the machine.
///
/// # Errors
/// The file cannot be read.
pub fn part_of(job: &Job, source: &PartSource) -> Result<Arc<Part>, FaceError> {
    let model = model_with(&source.path, 1)?;
    Ok(placed_part(&model, &placement(job)))
}

/// The part of a file on the machine. The last one is kept: the faces of a part are asked for one after the other.
#[must_use]
pub fn placed_part(model: &Arc<Model>, by: &Placement) -> Arc<Part> {
    type Last = Option<(Arc<Model>, [[f64; 4]; 3], Arc<Part>)>;
    static LAST: Mutex<Last> = Mutex::new(None);
    let lock = || LAST.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let same = |rows: &[[f64; 4]; 3]| {
        let both = rows.iter().flatten().zip(by.rows.iter().flatten());
        both.into_iter().all(|(a, b)| (a - b).abs() <= SAME_MM)
    };
    if let Some((of, rows, part)) = lock().as_ref()
        && Arc::ptr_eq(of, model)
        && same(rows)
    {
        return Arc::clone(part);
    }
    let faces: Vec<cad::Face> = model.faces.iter().filter_map(|face| face.placed(by)).collect();
    let mut part = Part::new(&faces);
    part.left_out = model.left_out + (model.faces.len() - faces.len());
    let part = Arc::new(part);
    *lock() = Some((Arc::clone(model), by.rows, Arc::clone(&part)));
    part
}

/// Whether two paths are of one file.
fn same_file(a: &Path, b: &Path) -> bool {
    let whole = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    whole(a) == whole(b)
}

/// Index of a job's face in its part.
#[must_use]
pub fn own_face(job: &Job, part: &Part, of: &PartSource) -> Option<usize> {
    let source = job
        .origin
        .cad()
        .filter(|source| same_file(&source.path, &of.path))?;
    part.index(source.face)
}

/// All that the region of a job is made of.
pub struct Asked {
    model: Arc<Model>,
    face: usize,
    trimmed: Vec<Vec<[f64; 2]>>,
    oracle: Oracle,
    placement: Placement,
    tool: Tool,
    scallop_mm: f64,
    part: Option<(Arc<Part>, PartSource)>,
    own: Option<usize>,
}

impl Asked {
    /// Of a job whose surface is of a CAD file.
    ///
    /// # Errors
    /// A file cannot be read.
    pub fn new(job: &Job, source: &CadSource) -> Result<Self, FaceError> {
        let model = model_with(&source.path, source.face)?;
        let wanted = Face {
            path: source.path.clone(),
            number: source.face,
            tolerance_mm: source.tolerance_mm,
            untrimmed: source.untrimmed,
            parameters: source.parameters,
            around_mm: source.around_mm,
        };
        let surface = surface_of(&wanted, &model)?;
        let oracle = Oracle::new(job).map_err(|error| FaceError {
            what: error.to_string(),
            remedy: "give side = \"+\" or \"-\" in [cut]".to_owned(),
            of_face: true,
        })?;
        let part = match job.origin.part() {
            Some(of) => Some((part_of(job, of)?, of.clone())),
            None => None,
        };
        let [[u0, u1], [v0, v1]] = job.surface.domain();
        let whole = vec![vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1]]];
        Ok(Self {
            face: source.face - 1,
            trimmed: surface.trimmed.clone().unwrap_or(whole),
            placement: placement(job),
            tool: Tool::of(job),
            scallop_mm: job.scallop_mm,
            own: part.as_ref().and_then(|(part, of)| own_face(job, part, of)),
            model,
            oracle,
            part,
        })
    }

    /// The request.
    #[must_use]
    pub fn request(&self) -> Request<'_> {
        let rules = self.part.as_ref().map(|(_, of)| of);
        Request {
            surface: &self.oracle.surface,
            trimmed: &self.trimmed,
            face: &self.model.faces[self.face],
            placement: &self.placement,
            sign: self.oracle.normal_sign,
            tool: &self.tool,
            scallop_mm: self.scallop_mm,
            steepest_deg: rules.map_or(STEEPEST_DEG, |of| of.steepest_deg),
            touch_mm: rules.map_or(TOUCH_MM, |of| of.tolerance_mm),
            part: self.part.as_ref().map(|(part, _)| (&**part, self.own)),
        }
    }

    /// The part on the machine.
    #[must_use]
    pub fn part(&self) -> Option<&Part> {
        self.part.as_ref().map(|(part, _)| &**part)
    }

    /// The tool.
    #[must_use]
    pub fn tool(&self) -> &Tool {
        &self.tool
    }
}

fn made(job: &Job, source: &CadSource) -> Result<Found, FaceError> {
    let asked = Asked::new(job, source)?;
    Ok(Found::new(asked.request().make(), asked.part()))
}

/// The tool reaches nothing of the face.
fn nothing(source: &CadSource, found: &Found, radius_mm: f64) -> FaceError {
    let why: Vec<String> = found
        .unreachable_mm2
        .iter()
        .map(|(reason, area)| format!("{reason} {area:.3} mm2"))
        .collect();
    FaceError {
        what: format!(
            "a ball of radius {radius_mm} mm reaches nothing of face {} ({:.3} mm2): {}",
            source.face,
            found.area_mm2,
            why.join(", ")
        ),
        remedy: match found.radius_mm {
            Some(radius_mm) => format!("take a ball of radius {radius_mm:.3} mm at most, or turn the part with [placement]"),
            None => "turn the part with [placement], or choose another face; `cargo sim import FILE --part` tells what can be reached".to_owned(),
        },
        of_face: true,
    }
}

/// 64-bit FNV-1a.
fn digest(pieces: &[&[u8]]) -> u64 {
    pieces
        .iter()
        .flat_map(|piece| piece.iter().chain(std::iter::once(&0)))
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
}

/// Where the region of a job is kept: a file beside the job, named by a digest of all that the region depends on. `None` for a job without a folder.
fn cache_file(job: &Job, source: &CadSource) -> Option<PathBuf> {
    let name = Path::new(job.origin.name());
    let folder = name.parent().filter(|_| name.file_name().is_some())?;
    if !folder.as_os_str().is_empty() && !folder.is_dir() {
        return None;
    }
    let bytes = std::fs::read(&source.path).ok()?;
    let part = match job.origin.part() {
        Some(of) if !same_file(&of.path, &source.path) => std::fs::read(&of.path).ok()?,
        _ => Vec::new(),
    };
    let part_rules = job.origin.part().map(|of| (of.tolerance_mm, of.steepest_deg));
    let rules = format!(
        "{METHOD} {} {} {} {:?} {} {:?} {:?} {} {:?} {:?} {:?}",
        source.face,
        source.untrimmed,
        source.tolerance_mm,
        source.parameters,
        source.around_mm,
        placement(job).rows,
        Tool::of(job),
        job.scallop_mm,
        job.side,
        part_rules,
        job.surface.domain(),
    );
    let name_of = digest(&[&bytes, &part, rules.as_bytes()]);
    Some(folder.join(CACHE).join(format!("region-{name_of:016x}.json")))
}

/// A value from the cache beside the job, else from `make`. Its file is named by `what` and a digest of all that it depends on: `keys`, and the bytes of `file`.
/// A job without a folder, or without a face of a CAD file, has no cache.
///
/// # Errors
/// Those of `make`.
pub(crate) fn cached<T: Serialize + DeserializeOwned, E>(
    job: &Job,
    what: &str,
    keys: &[&[u8]],
    file: Option<&Path>,
    make: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let name = Path::new(job.origin.name());
    let folder = name.parent().filter(|folder| {
        let is_named = name.file_name().is_some() && job.origin.cad().is_some();
        is_named && (folder.as_os_str().is_empty() || folder.is_dir())
    });
    let bytes = file.and_then(|file| std::fs::read(file).ok()).unwrap_or_default();
    let keys: Vec<&[u8]> = keys.iter().copied().chain([bytes.as_slice()]).collect();
    let place = folder.map(|folder| {
        folder
            .join(CACHE)
            .join(format!("{what}-{:016x}.json", digest(&keys)))
    });
    if let Some(kept) = place.as_ref().and_then(|place| kept(place)) {
        return Ok(kept);
    }
    let made = make()?;
    if let Some(place) = &place {
        keep(place, &made);
    }
    Ok(made)
}

fn kept<T: DeserializeOwned>(file: &Path) -> Option<T> {
    serde_json::from_slice(&std::fs::read(file).ok()?).ok()
}

/// Writes a value into the cache; where that fails, the value is made again the next time.
fn keep<T: Serialize>(file: &Path, found: &T) {
    let (Some(folder), Ok(text)) = (file.parent(), serde_json::to_vec(found)) else {
        return;
    };
    // Whole or not at all: another process may read it.
    let new = file.with_extension(format!("{}.new", std::process::id()));
    if std::fs::create_dir_all(folder).is_ok() && std::fs::write(&new, text).is_ok() {
        let _ = std::fs::rename(&new, file);
    }
}
