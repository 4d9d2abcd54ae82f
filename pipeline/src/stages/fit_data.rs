//! What fitting needs of a garment, in the pack's vertex order. Knows the arrays of a pack, not their bytes.

use crate::ir;
use glam::Vec2;
use kitsuke::arrays::Mesh;
use kitsuke::fit::{Dimension, Field, FitData};
use kitsuke::garment::Garment;

/// Puts together what the garment's fit needs; `steps` of `step_m` are the fields of [`weld`](crate::stages::weld) per part, size and base
/// vertex.
#[must_use]
pub fn fit_data(
    source: &ir::Garment,
    sizes: &ir::Sizes,
    steps: &[[i16; 3]],
    step_m: f32,
    garment: &Garment,
) -> FitData {
    let mesh = &garment.data().mesh;
    let packed_from_source = packed_from_source(mesh);
    let dimension = |path: &ir::MeasuredPath| {
        Some(Dimension {
            name: path.name.clone(),
            ja: path.ja.clone(),
            rule: path.rule.clone()?,
            vertices: path.vertices.iter().map(|&v| packed_from_source[v as usize]).collect(),
            offset_m: path.offset_m,
            load: path.load,
        })
    };
    let field =
        |steps: &[[i16; 3]]| Field { step_m, deltas: mesh.source_vertex.iter().map(|&v| steps[v as usize]).collect() };
    FitData {
        bodies: sizes.bodies.clone(),
        dimensions: source.paths.iter().filter_map(dimension).collect(),
        parts: mesh.parts.iter().map(|part| part.name.clone()).collect(),
        fields: steps.chunks_exact(garment.unique_count()).map(field).collect(),
        uv: uv(&source.base, sizes, garment),
        rules: source.rules.clone(),
    }
}

/// For each base vertex its number in the pack.
#[must_use]
pub fn packed_from_source(mesh: &Mesh) -> Vec<u32> {
    let mut packed_from_source = vec![0; mesh.source_vertex.len()];
    for (packed, &source) in mesh.source_vertex.iter().enumerate() {
        packed_from_source[source as usize] = packed as u32;
    }
    packed_from_source
}

/// Each size's texture coordinates at the pack's vertices.
fn uv(base: &ir::Surface, sizes: &ir::Sizes, garment: &Garment) -> Vec<Vec<Vec2>> {
    if base.uv_triangles.is_empty() {
        return Vec::new();
    }
    let mut source_uv = vec![None; garment.vertex_count()];
    for (&vertex, &uv) in garment.data().mesh.triangles.iter().flatten().zip(base.uv_triangles.iter().flatten()) {
        source_uv[vertex as usize].get_or_insert(uv);
    }
    let of = |size: &ir::SizeShape| {
        source_uv.iter().map(|source| source.map_or(Vec2::ZERO, |source| size.uv[source as usize])).collect()
    };
    sizes.shapes.iter().map(of).collect()
}
