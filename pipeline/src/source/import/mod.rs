//! Meshes whose vertices need not be those of a base: scans, exports, dress forms, in any format we read. One file per
//! format; here is what they have in common. Knows no garment.

use glam::{DVec3, Vec2};

/// A mesh as a file brings it: positions in the file's own order, unit and axes, polygons cut into triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportedMesh {
    /// Positions in the file's unit and axes, in the file's order, nodes' transforms applied.
    pub positions: Vec<DVec3>,
    /// Corners of the triangles, each an index into `positions`.
    pub triangles: Vec<[u32; 3]>,
    /// How many polygons they were before they were cut.
    pub polygon_count: usize,
    /// Texture coordinates of each triangle's corners, v upwards (0 at the picture's lowest row): one per triangle, or empty.
    pub uv: Vec<[Vec2; 3]>,
    /// Colours, sRGB: one per position, or empty.
    pub colours: Vec<[u8; 3]>,
    /// Groups, nodes, materials: what the file calls its parts, by first appearance.
    pub parts: Vec<Part>,
    /// The part of each triangle.
    pub part_of_triangle: Vec<u32>,
    /// The base colour's picture.
    pub texture: Option<Picture>,
    /// Metres per unit, where the format or the file says so.
    pub unit_m: Option<f64>,
    /// Which way is up and which is front, where the format or the file says so.
    pub axes: Option<Axes>,
}

/// What a file calls a part of its triangles.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Part {
    /// Group, object, mesh or node.
    pub name: String,
    /// Its material, or nothing.
    pub material: String,
}

/// A picture that belongs to a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Picture {
    /// The name of a file, as the mesh's file writes it.
    Named(String),
    /// PNG or JPEG that the file holds.
    Held(Vec<u8>),
}

/// Axes of a file: which of its axes point up and to the front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// A unit vector along one axis.
    pub up: DVec3,
    /// A unit vector along another axis.
    pub front: DVec3,
}
