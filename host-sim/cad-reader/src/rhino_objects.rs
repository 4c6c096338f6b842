//! Objects of a 3DM file of which no surface is read. The codec has a record of each object, with what it made of it, and a code for each loss.

use std::collections::{BTreeMap, HashSet};

use cadmpeg_ir::SourceObjectAssociation;
use cadmpeg_ir::report::Severity;
use cadmpeg_ir::report::loss::LossNote;

use crate::ir::{Decoded, Lost};

/// Beginning of the names of the records of objects.
const RECORD: &str = "rhino:object:record#";
/// Typecode of the chunk with an object's type, without the bit for short chunks.
const TYPE_CHUNK: u32 = 0x0200_0071;
/// The bit for short chunks.
const SHORT: u32 = 0x8000_0000;
/// First version of the format with lengths of 8 bytes.
const LONG_LENGTHS: u32 = 50;

// Types of objects, `ON::object_type`.
const BREP: u32 = 0x10;
const MESH: u32 = 0x20;
const BLOCK: u32 = 0x1000;
const SUBD: u32 = 0x4_0000;
const EXTRUSION: u32 = 0x4000_0000;
/// Those without a surface that a tool could cut: points, point clouds, curves, lights, annotations, dots, grips, details, hatches, morphs, polyedges, cages,
/// phantoms, clipping planes.
const WITHOUT_SURFACE: u32 = 0x1
    | 0x2
    | 0x4
    | 0x100
    | 0x200
    | 0x2000
    | 0x4000
    | 0x8000
    | 0x1_0000
    | 0x2_0000
    | 0x80_0000
    | 0x800_0000
    | 0x1000_0000
    | 0x2000_0000;
/// Bits of the typecodes of geometry in archives of version 1, which have no objects.
const V1_GEOMETRY: u32 = 0x0013_0000;

/// The name of a type of objects, singular and plural.
const fn type_name(of: u32) -> [&'static str; 2] {
    match of {
        BREP => ["polysurface", "polysurfaces"],
        MESH => ["mesh", "meshes"],
        BLOCK => ["block", "blocks"],
        SUBD => ["SubD", "SubDs"],
        EXTRUSION => ["extrusion", "extrusions"],
        _ => ["surface", "surfaces"],
    }
}

/// An object's type by its record, which begins with it; `None` for a record that does not.
fn object_type(archive: &[u8], offset: u64) -> Option<u32> {
    let version: u32 = std::str::from_utf8(archive.get(24..32)?)
        .ok()?
        .trim()
        .parse()
        .ok()?;
    let at = usize::try_from(offset).ok()? + if version < LONG_LENGTHS { 8 } else { 12 };
    let word = |at: usize| Some(u32::from_le_bytes(*archive.get(at..)?.first_chunk()?));
    (word(at)? & !SHORT == TYPE_CHUNK).then_some(())?;
    word(at + 4)
}

/// Whether a thing that the codec made is the mesh with which a Brep or an extrusion is drawn.
fn is_drawing(id: &str) -> bool {
    let last = id.rsplit('.').next().unwrap_or(id);
    ["render-", "analysis-", "cache-"]
        .iter()
        .any(|kind| last.starts_with(kind))
}

/// Whether an object is shown in the file.
fn is_shown(object: Option<&SourceObjectAssociation>) -> bool {
    object.is_none_or(|object| object.visible != Some(false))
}

/// Objects that are members of blocks: each block counts by its occurrences.
fn members(decoded: &Decoded) -> HashSet<String> {
    let namespace = decoded.ir.native.namespace("rhino");
    let definitions = namespace.and_then(|all| all.arenas().get("product_definitions"));
    let links = definitions
        .into_iter()
        .flatten()
        .filter_map(|definition| definition.field("links"));
    links
        .filter_map(|links| Some(links.as_array()?.clone()))
        .flatten()
        .filter_map(|link| Some(link.as_str()?.to_owned()))
        .collect()
}

/// Number of objects by their types of which no surface is read, but meshes and `SubDs` that the codec has.
fn without_surface(archive: &[u8], decoded: &Decoded) -> BTreeMap<u32, usize> {
    let members = members(decoded);
    let retained = decoded.source.retained_records();
    let mut lost = BTreeMap::new();
    for object in decoded.ir.native_unknowns_iter("rhino").flatten() {
        let id = object.id.as_str();
        if !id.starts_with(RECORD) || members.contains(id) {
            continue;
        }
        let offset = retained.get(&object.id).map(|record| record.offset());
        let of = offset
            .and_then(|offset| object_type(archive, offset))
            .unwrap_or(0);
        let made = |kinds: &[&str]| {
            let of_kind = |link: &str| kinds.iter().any(|kind| link.contains(kind)) && !is_drawing(link);
            object.links.iter().any(|link| of_kind(link.as_str()))
        };
        let read = match of {
            // Of curves, perhaps.
            BLOCK => !object.links.is_empty(),
            _ => of & WITHOUT_SURFACE != 0 || made(&[":surface#", ":body#", ":subd#", ":tessellation#"]),
        };
        if !read {
            *lost.entry(of).or_default() += 1;
        }
    }
    lost
}

/// Number of records of geometry that the codec did not read in an archive of version 1, by a loss's message: `V1 typecode 0x00100015: 3 flat ...`.
fn of_version_1(loss: &LossNote) -> Option<usize> {
    let (code, rest) = loss.message.strip_prefix("V1 typecode 0x")?.split_once(": ")?;
    let code = u32::from_str_radix(code, 16).ok()?;
    let count = rest.split(' ').next()?.parse().ok()?;
    (code & V1_GEOMETRY != 0).then_some(count)
}

/// The objects of an archive of which no surface is read.
pub(crate) fn lost(archive: &[u8], decoded: &Decoded) -> Lost {
    let mut kinds = without_surface(archive, decoded);
    let model = &decoded.ir.model;
    let meshes = model.tessellations.iter();
    let meshes = meshes.filter(|mesh| !is_drawing(mesh.id.as_str()) && is_shown(mesh.source_object.as_ref()));
    *kinds.entry(MESH).or_default() += meshes.count();
    let subds = model
        .subds
        .iter()
        .filter(|subd| is_shown(subd.source_object.as_ref()));
    *kinds.entry(SUBD).or_default() += subds.count();
    let losses = decoded.losses.iter();
    *kinds.entry(0).or_default() += losses.filter_map(of_version_1).sum::<usize>();
    kinds.retain(|_, count| *count > 0);
    let named = |(of, count): (&u32, &usize)| format!("{count} {}", type_name(*of)[usize::from(*count != 1)]);
    Lost {
        count: kinds.values().sum(),
        kinds: kinds.iter().map(named).collect::<Vec<_>>().join(", "),
    }
}

/// Whether the document has no unit of length, without which the codec reads nothing.
pub(crate) fn has_no_unit(decoded: &Decoded) -> bool {
    let source = decoded.ir.source.as_ref();
    source.is_some_and(|source| {
        let is_named = |name: &str| source.attributes.keys().any(|key| key.as_str() == name);
        is_named("unit_system") && !is_named("millimeters_per_unit")
    })
}

/// The class of the objects that a loss is about, and their type, where surfaces are lost with them.
fn lost_class(loss: &LossNote) -> Option<(&str, u32)> {
    let tag = loss.provenance.as_ref()?.tag.as_deref()?;
    let (class, of) = tag.strip_prefix("OBJECT_RECORD/class=")?.split_once("/type=0x")?;
    let of = u32::from_str_radix(of, 16).ok()?;
    let lost = matches!(
        loss.code.local_code(),
        "object.family-not-transferred" | "object.framing-undecodable"
    );
    (lost && of & WITHOUT_SURFACE == 0).then_some((class, of))
}

/// What is told of a loss, if it is one of surfaces.
pub(crate) fn told(loss: &LossNote, losses: &[LossNote]) -> Option<String> {
    let is_told = match loss.code.local_code() {
        "topology.brep-fallback" => {
            let why = loss.message.strip_prefix("Brep topology fallback: ");
            let why = why.unwrap_or(&loss.message);
            return Some(format!("the edges of a polysurface were not read: {why}"));
        }
        "curve.polycurve-join-gap" | "container.instance-definition-degraded" => true,
        // Their number is told with the objects that are lost; here is why.
        "object.decode-diagnostic" => {
            let (class, why) = loss.message.split_once(':')?;
            let (_, of) = losses
                .iter()
                .filter_map(lost_class)
                .find(|(lost, _)| *lost == class)?;
            return Some(format!("{}:{why}", type_name(of)[0]));
        }
        "object.family-not-transferred" | "object.framing-undecodable" => false,
        // Layers, colours and names of single objects.
        "container.scan-diagnostic" => !loss.message.starts_with("object "),
        _ => loss.severity >= Severity::Error,
    };
    is_told.then(|| loss.message.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_of_breps_are_drawings() {
        for (id, drawing) in [
            ("rhino:object:tessellation#1ef1.render-0", true),
            ("rhino:object:tessellation#1ef1.cache-12", true),
            ("rhino:object:tessellation#1ef1", false),
            ("rhino:object:tessellation#legacy-000001", false),
        ] {
            assert_eq!(is_drawing(id), drawing, "{id}");
        }
    }

    #[test]
    fn an_object_begins_with_its_type() {
        for (version, length) in [("4", 4), ("70", 8)] {
            let mut archive = format!("3D Geometry File Format {version:>8}").into_bytes();
            archive.extend([0x70, 0x80, 0, 0x20]);
            archive.extend(std::iter::repeat_n(9, length));
            archive.extend([0x71, 0, 0, 0x82, 0x20, 0, 0, 0]);
            assert_eq!(object_type(&archive, 32), Some(MESH), "{version}");
            assert_eq!(object_type(&archive, 33), None);
            assert_eq!(object_type(&archive, 1 << 40), None);
        }
    }
}
