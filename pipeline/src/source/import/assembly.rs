//! Puts an [`ImportedMesh`] together, polygon by polygon, and checks every index and number on the way. Knows no format.

use super::{ImportedMesh, Part};
use crate::source::polygon;
use glam::{DVec3, Vec2};
use std::collections::BTreeMap;

/// Most vertices of an imported mesh: scans are larger than garments.
pub(super) const VERTICES: usize = 1 << 23;
/// Most triangles of an imported mesh.
pub(super) const TRIANGLES: usize = 1 << 24;
/// Most parts.
const PARTS: usize = 1 << 16;
/// Longest coordinate in any unit: 10 km in millimetres.
const FARTHEST: f64 = 1e7;

/// A mesh that is being read.
#[derive(Default)]
pub(super) struct Assembly {
    mesh: ImportedMesh,
    parts: BTreeMap<Part, u32>,
    /// Whether any triangle has texture coordinates.
    is_textured: bool,
    /// Whether any position has a colour.
    is_coloured: bool,
    /// How many polygons had fewer than three corners.
    pub skipped: usize,
}

impl Assembly {
    /// Positions so far.
    pub fn position_count(&self) -> usize {
        self.mesh.positions.len()
    }

    /// One more position; `name` says which it is where it cannot be one.
    pub fn position(
        &mut self,
        position: DVec3,
        colour: Option<[u8; 3]>,
        name: impl FnOnce() -> String,
    ) -> Result<(), String> {
        if !(position.is_finite() && position.abs().max_element() <= FARTHEST) {
            let DVec3 { x, y, z } = position;
            return Err(format!("{} lies at {x} {y} {z}", name()));
        }
        if self.mesh.positions.len() == VERTICES {
            return Err(format!("the mesh has more than {VERTICES} vertices"));
        }
        self.mesh.positions.push(position);
        self.is_coloured |= colour.is_some();
        // Where some have none, white leaves the texture as it is.
        self.mesh.colours.push(colour.unwrap_or([255; 3]));
        Ok(())
    }

    /// The number of a part.
    pub fn part(&mut self, name: &str, material: &str) -> Result<u32, String> {
        let part = Part { name: name.to_owned(), material: material.to_owned() };
        if let Some(&number) = self.parts.get(&part) {
            return Ok(number);
        }
        let number = self.mesh.parts.len();
        if number == PARTS {
            return Err(format!("the mesh has more than {PARTS} parts"));
        }
        self.mesh.parts.push(part.clone());
        self.parts.insert(part, number as u32);
        Ok(number as u32)
    }

    /// One more polygon; all corners are positions so far. Fewer than three corners are counted and passed over.
    pub fn polygon(
        &mut self,
        corners: &[u32],
        uv: Option<&[Vec2]>,
        part: u32,
        name: impl Fn() -> String,
    ) -> Result<(), String> {
        let count = self.mesh.positions.len();
        if let Some(corner) = corners.iter().find(|&&corner| corner as usize >= count) {
            return Err(format!("{} names vertex {corner}, counted from 0, but there are {count}", name()));
        }
        let uv = uv.filter(|uv| uv.len() == corners.len());
        if let Some(place) = uv.and_then(|uv| uv.iter().find(|place| !place.is_finite())) {
            return Err(format!("{} has a texture coordinate {} {}", name(), place.x, place.y));
        }
        if corners.len() < 3 {
            self.skipped += 1;
            return Ok(());
        }
        if self.mesh.triangles.len() + corners.len() - 2 > TRIANGLES {
            return Err(format!("the mesh has more than {TRIANGLES} triangles"));
        }
        self.mesh.polygon_count += 1;
        self.mesh.quad_count += usize::from(corners.len() == 4);
        self.mesh.larger_count += usize::from(corners.len() > 4);
        self.is_textured |= uv.is_some();
        let points: Vec<DVec3> = corners.iter().map(|&corner| self.mesh.positions[corner as usize]).collect();
        for triangle in polygon::cut(&points) {
            self.mesh.triangles.push(triangle.map(|i| corners[i]));
            self.mesh.uv.push(triangle.map(|i| uv.map_or(Vec2::ZERO, |uv| uv[i])));
            self.mesh.part_of_triangle.push(part);
        }
        Ok(())
    }

    /// How many triangles each part has.
    pub fn triangles_of_parts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.mesh.parts.len()];
        self.mesh.part_of_triangle.iter().for_each(|&part| counts[part as usize] += 1);
        counts
    }

    /// The part's names.
    pub fn parts(&self) -> &[Part] {
        &self.mesh.parts
    }

    /// What was put together; the caller adds texture, unit and axes.
    pub fn finish(self) -> ImportedMesh {
        let mut mesh = self.mesh;
        if !self.is_textured {
            mesh.uv = Vec::new();
        }
        if !self.is_coloured {
            mesh.colours = Vec::new();
        }
        mesh
    }
}
