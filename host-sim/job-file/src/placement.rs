//! The optional section `[placement]`.

use job::{JobError, SurfaceSpec};
use patches::placement::{Anchor, Placement};

use crate::section::Section;

/// Largest scale factor: nanometres to metres, 1e9.
const SCALE_MAX: f64 = 1e6;
/// Largest rotation in either direction, degrees.
const TURN_MAX_DEG: f64 = 360.0;

/// Reads the section.
pub(super) fn read(section: &Section<'_>) -> Result<Placement, JobError> {
    section.only(&["scale", "rotate_deg", "place", "translate_mm"], &[])?;
    let mut read = Placement::default();
    if section.has("scale") {
        let want = "the scale factor, e.g. 25.4 for a surface in inches";
        read.scale = section.number_within("scale", 0.0, SCALE_MAX, want)?;
    }
    if section.has("rotate_deg") {
        read.rotate_deg = section.numbers("rotate_deg")?;
        if let Some(turn) = read.rotate_deg.iter().find(|turn| turn.abs() > TURN_MAX_DEG) {
            let what = format!("`rotate_deg` must be -360 to 360, not {turn}");
            let remedy = "give the rotations about x, y and z in degrees, e.g. [0, 0, 90]";
            return Err(section.error("rotate_deg", what, remedy));
        }
    }
    if section.has("place") {
        let anchors = [
            ("origin", Anchor::Origin),
            ("centre", Anchor::Centre),
            ("corner", Anchor::Corner),
            ("top", Anchor::Top),
        ];
        read.anchor = section.choice("place", &anchors)?;
    }
    if section.has("translate_mm") {
        read.translate_mm = section.numbers("translate_mm")?;
    }
    Ok(read)
}

/// The surface after the placement of the section, and the placement.
pub(super) fn place(
    section: &Section<'_>,
    surface: &SurfaceSpec,
) -> Result<(SurfaceSpec, Placement), JobError> {
    let placement = read(section)?;
    let placed = placement.place(surface).map_err(|outside| {
        let (keys, remedy) = if outside.too_large {
            (["scale", "translate_mm"], "scale it down, or cut it into smaller surfaces")
        } else {
            (["translate_mm", "scale"], "move it nearer to the origin; `place = \"centre\"` with a small `translate_mm` does so for any coordinates of the surface")
        };
        let key = keys.into_iter().find(|key| section.has(key)).unwrap_or("place");
        section.error(key, outside.to_string(), remedy)
    })?;
    Ok((placed, placement))
}
