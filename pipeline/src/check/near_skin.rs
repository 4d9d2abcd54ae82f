//! Which cloth of the base lies near which skin of the wearer. Knows neither files nor poses.

use crate::ir;
use glam::Vec3;
use rayon::prelude::*;

/// Cloth no farther from the skin goes roughly where it goes, metres.
const NEAR_M: f32 = 0.06;
/// So many vertices of the cloth are looked at, evenly taken.
const CLOTH: usize = 4096;
/// And so many of the skin.
const SKIN: usize = 16384;

/// A vertex of the cloth and the skin's vertex that is nearest to it.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    /// Vertex of the base.
    pub cloth: u32,
    /// Vertex of the body.
    pub skin: u32,
    /// How far the cloth lies outside, along the skin's normal, metres; negative inside.
    pub outside_m: f32,
    /// How much the skin faces upward there, -1 to 1.
    pub upward: f32,
}

/// The pairs that lie near each other, in the order of the base.
pub(super) fn pairs(base_m: &[Vec3], body: &ir::Body) -> Vec<Pair> {
    let skin_m = &body.surface.positions_m;
    let mut normals = vec![Vec3::ZERO; skin_m.len()];
    for triangle in &body.surface.triangles {
        let [a, b, c] = triangle.map(|v| skin_m[v as usize]);
        triangle.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
    }
    let every = |count: usize, most: usize| (0..count).step_by(count.div_ceil(most).max(1));
    let skin: Vec<(u32, Vec3)> = every(skin_m.len(), SKIN).map(|s| (s as u32, skin_m[s])).collect();
    let cloth: Vec<usize> = every(base_m.len(), CLOTH).collect();
    let nearest = |&v: &usize| {
        let from_m = base_m[v];
        let distances = skin.iter().map(|(s, skin_m)| (skin_m.distance_squared(from_m), *s));
        let (distance_m2, skin) = distances.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let away_m = from_m - skin_m[skin as usize];
        let normal = normals[skin as usize].normalize_or_zero();
        let (outside_m, upward) = (away_m.dot(normal), normal.y);
        (distance_m2 < NEAR_M * NEAR_M).then_some(Pair { cloth: v as u32, skin, outside_m, upward })
    };
    cloth.par_iter().filter_map(nearest).collect()
}
