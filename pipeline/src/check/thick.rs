//! Whether cloth was exported with its thickness: two layers, each the other's inside. Knows neither body nor file.

use crate::ir;
use glam::{IVec3, Vec3};
use std::collections::BTreeMap;

/// Layers of one cloth lie no farther apart, metres.
const APART_M: f32 = 0.006;
/// So much of cloth in two layers has its other layer there. Of a kimono in one layer only the bags of the sleeves, hanging flat, have.
const DOUBLED: f32 = 0.9;
/// About so many vertices are looked at.
const SAMPLE: usize = 2000;

/// Whether nearly everywhere another vertex lies close by that faces the other way.
pub(super) fn is_thick(surface: &ir::Surface) -> bool {
    let mut normals = vec![Vec3::ZERO; surface.positions_m.len()];
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|v| surface.positions_m[v as usize]);
        triangle.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
    }
    normals.iter_mut().for_each(|normal| *normal = normal.normalize_or_zero());
    let cell = |place_m: Vec3| (place_m / APART_M).floor().as_ivec3();
    let mut cells: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
    for (v, place_m) in surface.positions_m.iter().enumerate() {
        cells.entry(cell(*place_m).to_array()).or_default().push(v);
    }
    let around = |v: usize| {
        let middle = cell(surface.positions_m[v]);
        let cells = &cells;
        (0..27)
            .filter_map(move |i| cells.get(&(middle + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)).to_array()))
            .flatten()
    };
    let is_doubled = |v: &usize| {
        around(*v).any(|&other| {
            normals[other].dot(normals[*v]) < -0.7
                && surface.positions_m[other].distance_squared(surface.positions_m[*v]) < APART_M * APART_M
        })
    };
    let count = normals.len();
    let sample: Vec<usize> = (0..count).step_by((count / SAMPLE).max(1)).collect();
    let doubled = sample.iter().filter(|v| is_doubled(v)).count();
    doubled as f32 > DOUBLED * sample.len() as f32
}
