//! Conversion of the model of `cadmpeg` to faces; the only file that depends on that model, with `ir_*.rs`.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::Cursor;

use cadmpeg_core::decode::{DecodeDepth, DecodePolicy, ResourceLimits};
use cadmpeg_ir::geometry::{ProceduralSurfaceDefinition as Made, SolvedSurfaceGeometry, SurfaceGeometry};
use cadmpeg_ir::products::{OccurrenceParent, PrototypeReference};
use cadmpeg_ir::report::Severity;
use cadmpeg_ir::report::loss::{LossNote, LossTaxonomy};
use cadmpeg_ir::topology::{BodyKind, Color, Sense};
use cadmpeg_ir::{Codec, CodecFormat, DecodeOptions, SourceFidelity, SourceGeometryRole};

use crate::ir_geometry::{SURFACE_DEPTH_MAX, placement, point, solved_surface, vector};
use crate::ir_index::{Translation, entity};
use cad::Model;
use cad::{Boundary, CadError, Face, Placement, Solid, Surface};
use cadmpeg_ir::document::CadIr;
use glam::DVec3;

/// Limits of a file, far above those of the largest part tested.
const LIMITS: ResourceLimits = ResourceLimits {
    max_input_bytes: 64 << 20,
    max_decompressed_bytes_total: 256 << 20,
    max_decompressed_bytes_per_expand: 128 << 20,
    max_retained_bytes: 1 << 30,
    max_entities: 4_000_000,
    max_recursion_depth: 96,
};
/// Nesting depth of assemblies.
const ASSEMBLY_DEPTH_MAX: usize = 64;
/// Largest number of faces, with all occurrences in an assembly.
const FACES_MAX: usize = 200_000;
/// Text about a surface of an unsupported kind.
const NOT_READ: &str = " is of a kind that is not read";
/// Relative tolerance of a point that was read and scaled twice.
const SAME_POINT: f64 = 1e-9;
/// Largest number of warnings.
const WARNINGS_MAX: usize = 12;
/// Of these, losses that the codec tells.
const TOLD_LEAST: usize = 4;

/// What a codec made of a file.
pub(crate) struct Decoded {
    pub(crate) ir: CadIr,
    pub(crate) losses: Vec<LossNote>,
    pub(crate) source: SourceFidelity,
}

/// What the text of a file says, read apart from the codec: for the cross-check. Entities have their names in the file, such as `#12`.
pub(crate) trait Stated {
    /// Position of a point, mm, before the placement of its part; `None` if the text does not say.
    fn point(&self, _entity: &str) -> Option<DVec3> {
        None
    }

    /// Whether a face's unit of length is known.
    fn has_unit(&self, _entity: &str) -> bool {
        true
    }

    /// Number of boundaries of a face; `None` if the text does not say.
    fn boundaries(&self, _face: &str) -> Option<usize> {
        None
    }

    /// The faces that the file has, by their names.
    fn faces(&self) -> Vec<String> {
        Vec::new()
    }

    /// What trims or derives from a surface, in words; `None` for a surface on its own.
    fn owner(&self, _surface: &str) -> Option<String> {
        None
    }

    /// The objects that have surfaces of which the codec read none.
    fn lost(&self, _decoded: &Decoded) -> Lost {
        Lost::default()
    }

    /// What is told of a loss, of those of the file: of one of surfaces, not of names, colours, or parameter curves.
    fn told(&self, loss: &LossNote, _losses: &[LossNote]) -> Option<String> {
        let text = loss.message.to_lowercase();
        let lost = [
            "not projected",
            "invalid",
            "omitted",
            "not a surface",
            "quarantined",
            "unsupported",
        ];
        let on = [
            "surface",
            "geometry",
            "face",
            "instance #",
            "record",
            "parameter data",
        ];
        let is_lost =
            lost.iter().any(|word| text.contains(word)) && on.iter().any(|word| text.contains(word));
        is_lost.then(|| attributed(loss))
    }

    /// Whether objects that are hidden in the file are left out.
    fn leaves_out_hidden(&self) -> bool {
        false
    }

    /// Why nothing of the file is read, and what to do; `None` if that is not known.
    fn why_empty(&self, _decoded: &Decoded) -> Option<(String, &'static str)> {
        None
    }
}

/// Objects of which no surface is read.
#[derive(Default)]
pub(crate) struct Lost {
    pub(crate) count: usize,
    /// Their kinds, each with its number, in words.
    pub(crate) kinds: String,
}

/// Compares the points with what the text says of them, and refuses a unit that is in doubt.
fn cross_check(file: &str, ir: &CadIr, stated: &dyn Stated) -> Result<(), CadError> {
    let again = "export the part again with one unit, alone, or in another format";
    for item in &ir.model.points {
        let name = entity(item.id.as_str());
        let read = point(item.position().get());
        if let Some(said) = stated.point(&name).filter(|said| !agree(read, *said)) {
            let what = format!(
                "the unit of point {name} is in doubt: it is at [{}, {}, {}] or at [{}, {}, {}] mm",
                read.x, read.y, read.z, said.x, said.y, said.z
            );
            return Err(CadError::new(file, what, again));
        }
    }
    for face in &ir.model.faces {
        let name = entity(face.id.as_str());
        if !stated.has_unit(&name) {
            return Err(CadError::new(
                file,
                format!("face {name} has no unit of length"),
                again,
            ));
        }
    }
    Ok(())
}

/// Whether a point is where the text says.
fn agree(read: DVec3, said: DVec3) -> bool {
    read.distance(said) <= SAME_POINT * (1.0 + said.abs().max_element())
}

/// Reads a file with one of the codecs; `stated` is what its text says.
///
/// # Errors
/// The file is invalid, or the codec read another unit than the text gives.
pub(crate) fn decode(
    file: &str,
    codec: &dyn Codec,
    bytes: &[u8],
    stated: &dyn Stated,
) -> Result<Model, CadError> {
    let options = DecodeOptions {
        depth: DecodeDepth::Geometry,
        policy: DecodePolicy {
            limits: LIMITS,
            ..DecodePolicy::desktop()
        },
    };
    let decoded = codec.decode(&mut Cursor::new(bytes), &options).map_err(|error| {
        let what = format!("the file is invalid: {}", shortened(&error.to_string()));
        CadError::new(
            file,
            what,
            "export the part again, or in another format (STEP is read best)",
        )
    })?;
    let (ir, report, source) = decoded.into_parts();
    let decoded = Decoded {
        ir,
        losses: report.losses,
        source,
    };
    cross_check(file, &decoded.ir, stated)?;
    let translation = Translation::new(&decoded.ir);
    let mut model = translation.model(file, stated)?;
    for warning in &mut model.warnings {
        explain(warning, decoded.losses.iter().map(|loss| loss.message.as_str()));
    }
    if model.faces.is_empty()
        && let Some((what, remedy)) = stated.why_empty(&decoded)
    {
        return Err(CadError::new(file, what, remedy));
    }
    let losses = &decoded.losses;
    let mut told: Vec<&LossNote> = losses
        .iter()
        .filter(|loss| loss.severity >= Severity::Warning)
        .collect();
    // Faces whose edges are lost come first.
    told.sort_by_key(|loss| loss.code.taxonomy() != LossTaxonomy::TopologyNotTransferred);
    let told = told.into_iter().filter_map(|loss| stated.told(loss, losses));
    let told: Vec<String> = told.map(|text| shortened(&text)).collect();
    // Room for some of what the codec tells, however many surfaces are left out.
    model.warnings.truncate(WARNINGS_MAX - told.len().min(TOLD_LEAST));
    let room = WARNINGS_MAX - model.warnings.len();
    model.warnings.extend(told.into_iter().take(room));
    let lost = stated.lost(&decoded);
    if lost.count > 0 {
        model.left_out += lost.count;
        let what = format!("objects of the file of which nothing was read: {}", lost.kinds);
        model.warnings.insert(0, what);
    }
    let unread = translation.unread_faces(stated);
    if let Some(first) = unread.first() {
        let count = unread.len();
        // Of a file without a face the first warning is the reason.
        let at = if model.faces.is_empty() {
            model.warnings.len()
        } else {
            0
        };
        model.warnings.insert(
            at,
            format!("faces of the file that were not read: {count}, the first is {first}"),
        );
    }
    Ok(model)
}

/// The message of a loss, with the IGES directory entry that it is about: `D33: ...`.
fn attributed(loss: &LossNote) -> String {
    let tag = loss.provenance.as_ref().and_then(|place| place.tag.as_deref());
    match tag.and_then(|tag| tag.strip_prefix("directory_entry:")) {
        Some(entry) => format!("{entry}: {}", loss.message),
        None => loss.message.clone(),
    }
}

/// Message of `cadmpeg` about the surface that a warning names.
fn explain<'l>(warning: &mut String, mut said: impl Iterator<Item = &'l str>) {
    let Some((named, _)) = warning.split_once(NOT_READ) else {
        return;
    };
    let Some(number) = named.rsplit('#').next() else {
        return;
    };
    let name = format!("#{number} ");
    if let Some(why) = said.find(|message| message.contains(&name)) {
        *warning = format!("{named}{NOT_READ}: {}", shortened(why));
    }
}

/// Shortens a long text.
fn shortened(text: &str) -> String {
    const LENGTH: usize = 240;
    if text.chars().count() <= LENGTH {
        return text.to_owned();
    }
    let start: String = text.chars().take(LENGTH).collect();
    format!("{start} ...")
}

/// The first name that is not blank.
fn label<const N: usize>(names: [Option<&str>; N]) -> Option<String> {
    let mut named = names.into_iter().flatten().map(str::trim);
    named.find(|text| !text.is_empty()).map(shortened)
}

/// A colour as red, green, blue.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounded, 0 to 255"
)]
fn rgb(colour: Color) -> [u8; 3] {
    [colour.r(), colour.g(), colour.b()].map(|share| (share * 255.0).round().clamp(0.0, 255.0) as u8)
}

/// The Brep of one of its surfaces in a 3DM file, by the surface's name.
fn brep_of(surface: &str) -> Option<&str> {
    surface.rsplit_once(".slot-").map(|(brep, _)| brep)
}

/// Natural sort key: 2 before 10.
fn natural(id: &str) -> Vec<(u64, String)> {
    let mut key: Vec<(u64, String)> = Vec::new();
    let mut digits = String::new();
    let mut text = String::new();
    for character in id.chars() {
        if character.is_ascii_digit() {
            digits.push(character);
            continue;
        }
        if !digits.is_empty() {
            key.push((digits.parse().unwrap_or(u64::MAX), std::mem::take(&mut text)));
            digits.clear();
        }
        text.push(character);
    }
    key.push((digits.parse().unwrap_or(0), text));
    key
}

/// The faces of a body by their shells, and those of its copies.
#[derive(Default)]
struct BodyFaces<'m> {
    shells: BTreeMap<&'m str, Vec<usize>>,
    copies: Vec<usize>,
}

/// The solids of a file by their bodies.
#[derive(Default)]
struct Solids<'m>(BTreeMap<&'m str, BodyFaces<'m>>);

impl<'m> Solids<'m> {
    /// Adds a face of a shell of a copy of a body.
    fn add(&mut self, body: &'m str, shell: &'m str, copy: usize, face: usize) {
        let faces = self.0.entry(body).or_default();
        if copy == 0 {
            faces.shells.entry(shell).or_default().push(face);
        } else {
            faces.copies.push(face);
        }
    }

    fn all(self) -> Vec<Solid> {
        let solid = |faces: BodyFaces<'_>| Solid {
            shells: faces.shells.into_values().collect(),
            copies: faces.copies,
        };
        self.0.into_values().map(solid).collect()
    }
}

impl<'m> Translation<'m> {
    /// All faces of all bodies, once per occurrence of their part; then surfaces without a face.
    fn model(&self, file: &str, stated: &dyn Stated) -> Result<Model, CadError> {
        let mut model = Model::default();
        let homes = self.placements();
        let shell_body = self.bodies_of_shells();
        let mut order: Vec<_> = self.source.faces.iter().collect();
        order.sort_by_cached_key(|face| natural(face.id.as_str()));
        let identity = vec![Placement::IDENTITY];
        let parts = self.names_of_parts();
        let mut solids = Solids::default();
        let mut hidden = 0;
        for face in order {
            let body = shell_body.get(face.shell.as_str());
            let solid = body.is_some_and(|body| body.kind == BodyKind::Solid);
            let own = body
                .and_then(|body| body.transform.as_ref())
                .map_or(Placement::IDENTITY, placement);
            let homes = body
                .and_then(|body| homes.get(body.id.as_str()))
                .unwrap_or(&identity);
            if stated.leaves_out_hidden() && body.is_some_and(|body| body.visible == Some(false)) {
                hidden += homes.len();
                continue;
            }
            let name = entity(face.id.as_str());
            let surface = match self.surface(face.surface.as_str(), 0) {
                Ok(surface) => surface,
                Err(why) => {
                    model.warnings.push(format!("face {name} is left out: {why}"));
                    model.left_out += homes.len();
                    continue;
                }
            };
            let loops: Vec<_> = face.loops.iter().map(|id| id.as_str()).collect();
            let boundary = match stated.boundaries(&name).filter(|count| *count != loops.len()) {
                Some(count) => {
                    Boundary::Unknown(format!("{} of its {count} boundaries were read", loops.len()))
                }
                None if !loops.is_empty() && self.ends_with_surface(face.surface.as_str()) => {
                    Boundary::Unknown(
                        "its outer boundary is that of its surface, of which holes alone are given"
                            .to_owned(),
                    )
                }
                None => self.boundary(loops.into_iter()),
            };
            let sense = if (face.sense == Sense::Forward) != self.turned_over(face.surface.as_str()) {
                1.0
            } else {
                -1.0
            };
            let colour = face.color.or(body.and_then(|body| body.color)).map(rgb);
            let part = body.and_then(|body| parts.get(body.id.as_str()).copied());
            let label = label([
                face.name.as_deref(),
                body.and_then(|body| body.name.as_deref()),
                part,
            ]);
            for (copy, home) in homes.iter().enumerate() {
                if model.faces.len() >= FACES_MAX {
                    let what = format!("the file's assembly places more than {FACES_MAX} faces");
                    return Err(CadError::new(file, what, "export the part alone"));
                }
                let home = home.after(&own);
                let Some(surface) = surface.placed(&home) else {
                    model
                        .warnings
                        .push(format!("face {name} is left out: its placement distorts it"));
                    model.left_out += 1;
                    continue;
                };
                let turn = if home.mirrors() { -1.0 } else { 1.0 };
                if let Some(body) = body.filter(|_| solid) {
                    solids.add(body.id.as_str(), face.shell.as_str(), copy, model.faces.len());
                }
                model.faces.push(Face {
                    number: 0,
                    entity: name.clone(),
                    name: label.clone(),
                    colour,
                    // A reflection keeps the parameters, so that S_u x S_v is reversed.
                    sense: sense * turn,
                    surface,
                    boundary: boundary.placed(&home),
                    solid,
                });
            }
        }
        model.solids = solids.all();
        let named = model.left_out;
        let owned = self.lone_surfaces(&mut model, stated, &mut hidden);
        let unread = self.unread_faces(stated).len();
        // A face that was not read may be counted already, by its surface.
        model.left_out = model.left_out.max((named + unread).saturating_sub(owned));
        if hidden > 0 {
            let what = format!(
                "faces of hidden objects, which are left out: {hidden}; show the objects to have them"
            );
            model.warnings.insert(0, what);
        }
        model.warnings.truncate(WARNINGS_MAX);
        Ok(model)
    }

    /// Faces that the file has and of which the reader gave nothing but, perhaps, their surfaces.
    fn unread_faces(&self, stated: &dyn Stated) -> Vec<String> {
        let read: HashSet<String> = self
            .source
            .faces
            .iter()
            .map(|face| entity(face.id.as_str()))
            .collect();
        let mut unread = stated.faces();
        unread.retain(|name| !read.contains(name));
        unread
    }

    /// Surfaces without a face, common in IGES files. Returns how many of them are taken in with the boundary of a face that was not read.
    fn lone_surfaces(&self, model: &mut Model, stated: &dyn Stated, hidden: &mut usize) -> usize {
        let mut owned = 0;
        let mut used: Vec<&str> = self
            .source
            .faces
            .iter()
            .map(|face| face.surface.as_str())
            .collect();
        for made in &self.source.procedural_surfaces {
            match made.definition() {
                Made::ParallelOffset(offset) => used.push(offset.support().as_str()),
                Made::Offset(offset) => used.push(offset.support().as_str()),
                Made::Subset(subset) => used.push(subset.support().as_str()),
                Made::SubSurface(subset) => used.push(subset.support().as_str()),
                Made::Replica { source, .. } => used.push(source.as_str()),
                Made::CurveBounded { support, .. } => used.push(support.as_str()),
                _ => {}
            }
        }
        used.sort_unstable();
        let mut order: Vec<_> = self
            .source
            .surfaces
            .iter()
            .filter(|surface| used.binary_search(&surface.id.as_str()).is_err())
            .collect();
        order.sort_by_cached_key(|surface| natural(surface.id.as_str()));
        let joined: HashSet<&str> = self
            .source
            .faces
            .iter()
            .filter_map(|face| brep_of(face.surface.as_str()))
            .collect();
        for item in order {
            let name = entity(item.id.as_str());
            let object = item.source_object.as_ref();
            let is_of_brep = object.is_some_and(|object| {
                object.format == CodecFormat::Rhino
                    && object.geometry_role == Some(SourceGeometryRole::Support)
            });
            if is_of_brep && brep_of(item.id.as_str()).is_some_and(|brep| joined.contains(brep)) {
                // A leftover of which no face of its Brep is a part.
                continue;
            }
            if stated.leaves_out_hidden() && object.is_some_and(|object| object.visible == Some(false)) {
                *hidden += 1;
                continue;
            }
            let of = match stated.owner(&name) {
                Some(owner) => Some(format!("it is of {owner}, which was not read")),
                None if is_of_brep => Some("the edges of its polysurface were not read".to_owned()),
                None => None,
            };
            match self.surface(item.id.as_str(), 0) {
                Ok(surface) if surface.domain().iter().all(Option::is_some) => {
                    owned += usize::from(of.is_some() && !is_of_brep);
                    let is_part = self.is_part_of_surface(item.id.as_str());
                    let why = of.or(is_part.then(|| "it is a part of another surface".to_owned()));
                    model.faces.push(Face {
                        number: 0,
                        name: label([object.and_then(|object| object.name.as_deref())]),
                        colour: object.and_then(|object| object.color).map(rgb),
                        boundary: why.map_or(Boundary::Natural, Boundary::Unknown),
                        entity: name,
                        surface,
                        sense: 1.0,
                        solid: false,
                    });
                }
                Ok(_) => {
                    if let Some(why) = of {
                        model.left_out += 1;
                        model.warnings.push(format!("surface {name} is left out: {why}"));
                    }
                }
                Err(why) => {
                    model.left_out += 1;
                    model.warnings.push(format!("surface {name} is left out: {why}"));
                }
            }
        }
        owned
    }

    fn bodies_of_shells(&self) -> HashMap<&'m str, &'m cadmpeg_ir::topology::Body> {
        let bodies: HashMap<&str, _> = self
            .source
            .bodies
            .iter()
            .map(|body| (body.id.as_str(), body))
            .collect();
        let regions: HashMap<&str, &str> = self
            .source
            .regions
            .iter()
            .map(|region| (region.id.as_str(), region.body.as_str()))
            .collect();
        self.source
            .shells
            .iter()
            .filter_map(|shell| {
                let body = regions.get(shell.region.as_str())?;
                Some((shell.id.as_str(), *bodies.get(body)?))
            })
            .collect()
    }

    /// Names of the parts, by their bodies.
    fn names_of_parts(&self) -> HashMap<&'m str, &'m str> {
        let parts = self.source.product_definitions.iter();
        parts
            .filter_map(|part| Some((part, part.label.as_deref().or(part.source_name.as_deref())?)))
            .flat_map(|(part, name)| part.bodies.iter().map(move |body| (body.as_str(), name)))
            .collect()
    }

    /// Placements of each body, one per occurrence of its part.
    fn placements(&self) -> BTreeMap<&'m str, Vec<Placement>> {
        let occurrences: HashMap<&str, _> = self
            .source
            .occurrences
            .iter()
            .map(|occurrence| (occurrence.id.as_str(), occurrence))
            .collect();
        let mut of_part: BTreeMap<&str, Vec<Placement>> = BTreeMap::new();
        for occurrence in &self.source.occurrences {
            let PrototypeReference::Local { definition } = &occurrence.prototype else {
                continue;
            };
            let mut whole = Placement::IDENTITY;
            let mut next = Some(occurrence);
            // Assemblies that contain each other have no root: such an occurrence is left out.
            let mut depth = 0;
            while let Some(inner) = next.filter(|_| depth < ASSEMBLY_DEPTH_MAX) {
                let Ok(transform) = inner.effective_transform() else {
                    break;
                };
                whole = placement(&transform).after(&whole);
                next = match &inner.parent {
                    OccurrenceParent::Root {} => None,
                    OccurrenceParent::Occurrence { occurrence } => {
                        occurrences.get(occurrence.as_str()).copied()
                    }
                };
                depth += 1;
            }
            if next.is_none() {
                of_part.entry(definition.as_str()).or_default().push(whole);
            }
        }
        let mut of_body: BTreeMap<&str, Vec<Placement>> = BTreeMap::new();
        for part in &self.source.product_definitions {
            for body in &part.bodies {
                if let Some(places) = of_part.get(part.id.as_str()) {
                    of_body.entry(body.as_str()).or_default().extend(places);
                }
            }
        }
        of_body
    }

    /// A surface by its name.
    fn surface(&self, id: &str, depth: usize) -> Result<Surface, String> {
        if depth > SURFACE_DEPTH_MAX {
            return Err("its surface is defined by itself".to_owned());
        }
        let item = self
            .surfaces
            .get(id)
            .and_then(|index| self.source.surfaces.get(*index))
            .ok_or("its surface is missing")?;
        match &item.geometry {
            SurfaceGeometry::Solved(SolvedSurfaceGeometry::Unknown { .. }) => {
                Err(format!("surface {}{NOT_READ}", entity(id)))
            }
            SurfaceGeometry::Solved(solved) => solved_surface(solved, 0),
            SurfaceGeometry::Procedural { construction, cache } => match cache {
                Some(solved) if !matches!(solved, SolvedSurfaceGeometry::Unknown { .. }) => {
                    solved_surface(solved, 0)
                }
                _ => self.made(construction.as_str(), depth),
            },
        }
    }

    /// Whether the normal of the surface is `- S_u x S_v`.
    fn turned_over(&self, id: &str) -> bool {
        let item = self
            .surfaces
            .get(id)
            .and_then(|index| self.source.surfaces.get(*index));
        let solved = item.and_then(|item| item.geometry.solved());
        matches!(solved, Some(SolvedSurfaceGeometry::Nurbs(nurbs)) if nurbs.normal_reversed())
    }

    /// Whether a face on this surface has the surface's own ends, and its loops are holes.
    fn ends_with_surface(&self, id: &str) -> bool {
        matches!(
            self.definition(id),
            Some(Made::CurveBounded {
                implicit_outer: true,
                ..
            })
        )
    }

    /// Whether a surface is a part of another one, whose parameters alone are known here.
    fn is_part_of_surface(&self, id: &str) -> bool {
        let made = self.definition(id);
        matches!(
            made,
            Some(Made::CurveBounded { .. } | Made::Subset(_) | Made::SubSurface(_))
        )
    }

    /// What a surface is made of.
    fn definition(&self, id: &str) -> Option<&Made> {
        let item = self.source.surfaces.get(*self.surfaces.get(id)?)?;
        let SurfaceGeometry::Procedural { construction, .. } = &item.geometry else {
            return None;
        };
        let index = self.constructions.get(construction.as_str())?;
        let made = self.source.procedural_surfaces.get(*index)?;
        Some(made.definition())
    }

    /// A surface derived from curves or from another surface.
    fn made(&self, id: &str, depth: usize) -> Result<Surface, String> {
        let item = self
            .constructions
            .get(id)
            .and_then(|index| self.source.procedural_surfaces.get(*index))
            .ok_or("its construction is missing")?;
        match item.definition() {
            Made::LinearSweep(sweep) => {
                let profile = self.curve(sweep.directrix().as_str())?;
                Ok(Surface::Extrusion {
                    range: profile.domain(),
                    profile,
                    direction: vector(sweep.direction().finite().as_raw()),
                })
            }
            Made::Extrusion(sweep) => {
                let profile = self.curve(sweep.directrix().as_str())?;
                Ok(Surface::Extrusion {
                    range: sweep
                        .parameter_interval()
                        .map(|range| range.get())
                        .or(profile.domain()),
                    profile,
                    direction: vector(sweep.direction().as_raw()),
                })
            }
            Made::AxisRevolution(turn) => {
                let profile = self.curve(turn.directrix().as_str())?;
                let range = profile.domain().unwrap_or([-1e3, 1e3]);
                Ok(Surface::Revolution {
                    profile,
                    range,
                    origin: point(turn.axis_origin().get()),
                    axis: vector(turn.axis_direction().as_raw()),
                })
            }
            Made::ParallelOffset(offset) => Ok(Surface::Offset {
                base: Box::new(self.surface(offset.support().as_str(), depth + 1)?),
                distance: offset.distance().get(),
            }),
            Made::Offset(offset) => Ok(Surface::Offset {
                base: Box::new(self.surface(offset.support().as_str(), depth + 1)?),
                distance: offset.distance().get(),
            }),
            Made::Replica { source, transform } => self
                .surface(source.as_str(), depth + 1)?
                .placed(&placement(transform))
                .ok_or_else(|| "a copy of a surface is distorted".to_owned()),
            Made::CurveBounded { support, .. } => self.surface(support.as_str(), depth + 1),
            Made::Subset(subset) => self.surface(subset.support().as_str(), depth + 1),
            Made::SubSurface(subset) => self.surface(subset.support().as_str(), depth + 1),
            _ => Err(format!("surface {} has an unsupported construction", entity(id))),
        }
    }
}
