//! Whether cloth still has a shape: all of it in one plane, as a pattern lies, or a patch gathered in one place. Knows no pose.

use super::grouped;
use super::target::bounds;
use crate::ir;
use glam::Vec3;

/// Cloth thinner than this share of its extent is flat.
const FLAT: f32 = 0.01;
/// An edge shorter than this share of the median one has no length; tight folds leave more than a tenth.
const NO_LENGTH: f32 = 0.02;
/// So many vertices that edges without length join are a patch; fewer are remnants of modelling.
const PATCH: usize = 8;

/// What is wrong with the shape: code, problem and help.
pub(super) type Mistake = (&'static str, String, &'static str);

/// Why the base is no shape of cloth.
pub(super) fn find_in_base(base: &ir::Surface) -> Option<Mistake> {
    let edges = super::mesh::edges(&base.triangles);
    find(&base.positions_m, &edges, median_m(&base.positions_m, &edges)).or_else(|| {
        // Where more than half of the cloth is gathered, the median says nothing.
        let (low, high) = bounds(&base.positions_m);
        gathered(&base.positions_m, &edges, 0.01 * (high - low).max_element())
    })
}

/// Why these positions are no shape of cloth whose edges have this median length.
pub(super) fn find(positions_m: &[Vec3], edges: &[[u32; 2]], median_m: f32) -> Option<Mistake> {
    gathered(positions_m, edges, median_m).or_else(|| flat(positions_m))
}

fn flat(positions_m: &[Vec3]) -> Option<Mistake> {
    let (low, high) = bounds(positions_m);
    let extent = high - low;
    (extent.min_element() < FLAT * extent.max_element()).then(|| {
        (
            "flat",
            "the whole shape lies in one plane: it is the pattern, or an axis was scaled to nothing".to_owned(),
            "Export the draped garment from the 3D window, all three axes scaled alike.",
        )
    })
}

fn gathered(positions_m: &[Vec3], edges: &[[u32; 2]], median_m: f32) -> Option<Mistake> {
    let mut first: Vec<u32> = (0..positions_m.len() as u32).collect();
    fn root(first: &mut [u32], mut v: u32) -> u32 {
        while first[v as usize] != v {
            first[v as usize] = first[first[v as usize] as usize];
            v = first[v as usize];
        }
        v
    }
    for &[a, b] in edges {
        if positions_m[a as usize].distance(positions_m[b as usize]) < NO_LENGTH * median_m {
            let (a, b) = (root(&mut first, a), root(&mut first, b));
            first[a.max(b) as usize] = a.min(b);
        }
    }
    let mut counts = vec![0usize; first.len()];
    for v in 0..first.len() as u32 {
        counts[root(&mut first, v) as usize] += 1;
    }
    let (vertex, count) = counts.into_iter().enumerate().max_by_key(|(v, count)| (*count, std::cmp::Reverse(*v)))?;
    (count >= PATCH).then(|| {
        (
            "crushed",
            format!(
                "{} neighbouring vertices lie at one place, among them vertex {}: a patch of cloth is crushed to nothing",
                grouped(count),
                vertex + 1
            ),
            "Undo what gathered them (Blender: Merge or Scale to 0), or simulate again; then export.",
        )
    })
}

/// The median length of edges, metres.
pub(super) fn median_m(positions_m: &[Vec3], edges: &[[u32; 2]]) -> f32 {
    let length = |[a, b]: &[u32; 2]| positions_m[*a as usize].distance(positions_m[*b as usize]);
    let mut lengths_m: Vec<f32> = edges.iter().map(length).collect();
    let middle = lengths_m.len() / 2;
    if lengths_m.is_empty() { 0.0 } else { *lengths_m.select_nth_unstable_by(middle, f32::total_cmp).1 }
}
