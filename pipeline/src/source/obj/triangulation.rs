//! The polygons of an OBJ mesh as triangles. Knows nothing of text.

use super::{Corner, Mesh};
use crate::source::polygon;
use glam::DVec3;

/// The triangles of a [`Mesh`], grouped by part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// The corners.
    pub corners: Vec<[Corner; 3]>,
    /// The polygon of each triangle.
    pub faces: Vec<u32>,
    /// How many triangles each of the mesh's parts has.
    pub part_counts: Vec<u32>,
}

impl Mesh {
    /// Cuts the polygons into triangles, those of one part together, otherwise in file order.
    #[must_use]
    pub fn triangulate(&self) -> Triangles {
        let mut triangles: Vec<(u32, u32, [Corner; 3])> = Vec::with_capacity(self.faces.len());
        for (number, face) in self.faces.iter().enumerate() {
            let corners = self.corners_of(face);
            let points: Vec<DVec3> = corners.iter().map(|corner| self.positions[corner.vertex as usize]).collect();
            let cut = polygon::cut(&points).into_iter();
            triangles.extend(cut.map(|triangle| (face.part, number as u32, triangle.map(|i| corners[i]))));
        }
        triangles.sort_by_key(|(part, ..)| *part);
        let mut part_counts = vec![0; self.parts.len()];
        for (part, ..) in &triangles {
            part_counts[*part as usize] += 1;
        }
        let faces = triangles.iter().map(|(_, face, _)| *face).collect();
        Triangles { corners: triangles.into_iter().map(|(.., corners)| corners).collect(), faces, part_counts }
    }
}
