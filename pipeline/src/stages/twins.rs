//! Vertices of a body at one place, which files keep apart where texture, normals or skins have a seam. Knows no cloth.

use crate::ir::Body;

/// Vertices at one place, which files keep apart where texture or normals have a seam.
pub(crate) struct Twins {
    /// For each vertex the first one at its place.
    pub first: Vec<u32>,
    /// The triangles over those.
    pub triangles: Vec<[u32; 3]>,
}

impl Twins {
    pub fn of(body: &Body) -> Twins {
        let positions_m = &body.surface.positions_m;
        let place = |v: u32| positions_m[v as usize].to_array().map(f32::to_bits);
        let mut sorted: Vec<u32> = (0..positions_m.len() as u32).collect();
        sorted.sort_by_key(|&v| (place(v), v));
        let mut first = vec![0; positions_m.len()];
        for run in sorted.chunk_by(|&a, &b| place(a) == place(b)) {
            run.iter().for_each(|&v| first[v as usize] = run[0]);
        }
        let triangles = body.surface.triangles.iter().map(|triangle| triangle.map(|v| first[v as usize])).collect();
        Twins { first, triangles }
    }
}
