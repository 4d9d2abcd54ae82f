//! Normals of any triangle mesh, for what is not a frame: obi, bodies, shapes of a kimono. Frames have a faster way of their own
//! (`evaluate/normals.rs`).

use glam::Vec3;

/// Writes the unit normals of the vertices: means of their triangles' normals, weighted by area; zero where no triangle stands. Does not
/// allocate.
///
/// # Panics
/// When `normals` is not as long as `positions_m`, or a triangle names a vertex that does not exist.
pub fn vertex_normals(positions_m: &[Vec3], triangles: impl IntoIterator<Item = [u32; 3]>, normals: &mut [Vec3]) {
    assert_eq!(normals.len(), positions_m.len(), "one normal per position");
    normals.fill(Vec3::ZERO);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| positions_m[v as usize]);
        let doubled_area = (b - a).cross(c - a);
        triangle.into_iter().for_each(|v| normals[v as usize] += doubled_area);
    }
    normals.iter_mut().for_each(|normal| *normal = normal.normalize_or_zero());
}
