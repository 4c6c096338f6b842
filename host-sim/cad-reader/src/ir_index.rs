//! The model of `cadmpeg` with its entities by name.

use std::collections::HashMap;

use cadmpeg_ir::document::{CadIr, Model as Source};
use cadmpeg_ir::geometry::CurveGeometry;

use crate::ir_geometry::{point, solved_curve};
use cad::Curve;
use glam::DVec3;

/// Name of an entity in its file, from its identifier in `cadmpeg`: the part after `#`, without the context.
pub(crate) fn entity(id: &str) -> String {
    let key = id.rsplit('#').next().unwrap_or(id);
    match key.split('-').next() {
        Some(first) if first.bytes().all(|byte| byte.is_ascii_digit()) && !first.is_empty() => {
            format!("#{first}")
        }
        _ => key.to_owned(),
    }
}

/// The model with its entities by name.
pub(crate) struct Translation<'m> {
    pub(crate) source: &'m Source,
    pub(crate) surfaces: HashMap<&'m str, usize>,
    curves: HashMap<&'m str, usize>,
    pub(crate) constructions: HashMap<&'m str, usize>,
    pub(crate) loops: HashMap<&'m str, usize>,
    pub(crate) coedges: HashMap<&'m str, usize>,
    pub(crate) edges: HashMap<&'m str, usize>,
    pub(crate) vertices: HashMap<&'m str, DVec3>,
}

impl<'m> Translation<'m> {
    pub(crate) fn new(ir: &'m CadIr) -> Self {
        let source = &ir.model;
        macro_rules! index {
            ($list:expr) => {
                $list
                    .iter()
                    .enumerate()
                    .map(|(index, item)| (item.id.as_str(), index))
                    .collect()
            };
        }
        let points: HashMap<&str, DVec3> = source
            .points
            .iter()
            .map(|item| (item.id.as_str(), point(item.position().get())))
            .collect();
        let vertices = source
            .vertices
            .iter()
            .filter_map(|item| Some((item.id.as_str(), *points.get(item.point.as_str())?)))
            .collect();
        Self {
            source,
            surfaces: index!(source.surfaces),
            curves: index!(source.curves),
            constructions: index!(source.procedural_surfaces),
            loops: index!(source.loops),
            coedges: index!(source.coedges),
            edges: index!(source.edges),
            vertices,
        }
    }

    /// A curve by its name.
    pub(crate) fn curve(&self, id: &str) -> Result<Curve, String> {
        let item = self
            .curves
            .get(id)
            .and_then(|index| self.source.curves.get(*index))
            .ok_or("a curve is missing")?;
        let solved = match &item.geometry {
            CurveGeometry::Solved(solved) => Some(solved),
            CurveGeometry::Procedural { cache, .. } => cache.as_ref(),
        };
        solved
            .and_then(solved_curve)
            .ok_or_else(|| format!("curve {} is of a kind that is not read", entity(id)))
    }
}
