//! What fitting needs of a garment, in the pack's vertex order. Knows the arrays of a pack, not their bytes.

use crate::ir;
use crate::stages::{StageError, compress};
use glam::{Vec2, Vec3};
use kitsuke::arrays::{Mesh, limits};
use kitsuke::fit::{Dimension, Field, FitData};
use kitsuke::garment::Garment;
use kitsuke::pack::write::quantise_size_fields;

/// Steps of a field at most: what the other parts leave of a sum may be a step more for each.
const MOST_STEPS: f32 = (i16::MAX - 2 * limits::PARTS as i16) as f32;

/// The fields of [`weld`](crate::stages::weld) (per part, size and base vertex, metres) in the pack's order and in steps, such that they
/// take few bytes. The sum over all parts of a size lies within `radius_m` of its displacement, and so does what is stored of each part;
/// the first part of which a vertex is a corner takes what the others leave of the sum.
///
/// # Errors
/// When a size lies too far from the base for the steps, naming size and vertex.
pub fn fields(
    base: &ir::Surface,
    sizes: &[ir::SizeShape],
    fields_m: &[[f32; 3]],
    radius_m: f32,
    garment: &Garment,
) -> Result<Vec<Field>, StageError> {
    let step_m = compress::step_m(radius_m);
    let mesh = &garment.data().mesh;
    let in_steps = |size: usize, of_vertex: &dyn Fn(usize) -> Vec3| -> Result<Vec<Vec3>, StageError> {
        let steps = |&vertex: &u32| {
            let moved_m = of_vertex(vertex as usize);
            let steps = moved_m / step_m;
            if steps.abs().max_element() <= MOST_STEPS {
                return Ok(steps);
            }
            let (file, far_m, most_m) = (&sizes[size].file, moved_m.length(), MOST_STEPS * step_m);
            let problem = format!(
                "{file}: vertex {vertex} moves {far_m:.2} m, but numbers as fine as {:.4} mm store at most {most_m:.2} m; give a larger \
                 budget",
                radius_m * 1e3
            );
            Err(StageError::new("weld", problem))
        };
        mesh.source_vertex.iter().map(steps).collect()
    };
    let sum = |size: usize| in_steps(size, &|v| sizes[size].positions_m[v] - base.positions_m[v]);
    let sums = (0..sizes.len()).map(sum).collect::<Result<Vec<_>, _>>()?;
    let of_part = |(at, field_m): (usize, &[[f32; 3]])| in_steps(at % sizes.len(), &|v| Vec3::from_array(field_m[v]));
    let wanted = fields_m.chunks_exact(mesh.source_vertex.len()).enumerate().map(of_part);
    let wanted = wanted.collect::<Result<Vec<_>, _>>()?;
    let deltas = quantise_size_fields(mesh, &sums, &wanted, radius_m / step_m);
    Ok(deltas.into_iter().map(|deltas| Field { step_m, deltas }).collect())
}

/// Puts together what the garment's fit needs.
#[must_use]
pub fn fit_data(source: &ir::Garment, sizes: &ir::Sizes, fields: Vec<Field>, garment: &Garment) -> FitData {
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
    FitData {
        bodies: sizes.bodies.clone(),
        dimensions: source.paths.iter().filter_map(dimension).collect(),
        parts: mesh.parts.iter().map(|part| part.name.clone()).collect(),
        fields,
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
