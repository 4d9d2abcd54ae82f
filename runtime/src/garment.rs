//! What an open pack holds: the kimono as plain arrays ([`GarmentData`]), and the same once its every index and number
//! has been checked ([`Garment`]). Knows neither the bytes of a pack nor how a frame is made.

use crate::skeleton::{Bone, Skeleton};
use glam::{Quat, Vec2, Vec3};

/// Sizes beyond which nothing is opened or written. Each is far above real garments and small enough that a hostile
/// pack cannot exhaust a phone.
pub mod limits {
    /// Longest pack, bytes.
    pub const PACK_BYTES: usize = 256 << 20;
    /// Most bytes that all decoded sections may take together.
    pub const DECODED_BYTES: usize = 512 << 20;
    /// Most vertices, seam twins included.
    pub const VERTICES: usize = 1 << 22;
    /// Most triangles.
    pub const TRIANGLES: usize = 1 << 23;
    /// Most targets (the base is not one).
    pub const TARGETS: usize = 4096;
    /// Most drivers, each with its region.
    pub const DRIVERS: usize = 32;
    /// Most segments of the vertex order.
    pub const SEGMENTS: usize = 4096;
    /// Most parts.
    pub const PARTS: usize = 256;
    /// Longest name, bytes.
    pub const NAME_BYTES: usize = 256;
    /// Farthest coordinate from the origin, metres.
    pub const EXTENT_M: f32 = 100.0;
}

/// The kimono's surface in the T-pose.
///
/// Vertices `0..unique` are the cloth; the rest are *seam twins*: copies that exist because one cloth point carries two
/// texture coordinates. Buffers of this length go to a GPU as they are; twins are copied after each frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// T-pose positions of the unique vertices, metres.
    pub positions_m: Vec<Vec3>,
    /// Texture coordinates of all vertices, twins included; v = 0 is the bottom row of the image. Empty when the
    /// garment has none.
    pub uv: Vec<Vec2>,
    /// For each twin (vertex `unique + i`) the unique vertex it copies.
    pub twin_of: Vec<u32>,
    /// Triangles, counter-clockwise from outside, over all vertices, grouped by part.
    pub triangles: Vec<[u32; 3]>,
    /// Named pieces of cloth (sode, migoro, okumi, eri …), in triangle order.
    pub parts: Vec<Part>,
    /// For each unique vertex its number in the artist's base file.
    pub source_vertex: Vec<u32>,
}

/// A named piece: a run of triangles.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    /// The name in the base file, for example `sode_left`.
    pub name: String,
    /// How many triangles, following those of the part before.
    pub triangle_count: u32,
}

/// Up to four joints that move a vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SkinWeights {
    /// Joint numbers in the garment's skeleton; unused places have weight 0.
    pub joints: [u8; 4],
    /// Weights in 1/65535; they sum to 65535 exactly.
    pub weights: [u16; 4],
}

/// What turns poses into blend rates: a joint or a group of joints, and the region of the mesh that it owns. The
/// garment's driver `i` owns region `i`.
#[derive(Clone, Debug, PartialEq)]
pub struct Driver {
    /// For example `rightShoulder`.
    pub name: String,
    /// The joints whose rotations are compared; all of them stand in the pose table.
    pub joints: Vec<Bone>,
    /// c_j of the paper: samples farther than this are not similar. Radians, above 0.
    pub threshold_rad: f32,
}

/// A run of vertices that the same regions cover.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Segment {
    /// How many unique vertices, following those of the segment before.
    pub vertex_count: u32,
    /// The drivers whose regions cover these vertices, ascending; none where no target moves the cloth.
    pub drivers: Vec<u8>,
    /// Region masks in 1/65535, `vertex_count` rows of `drivers.len()`; a row sums to at most 65535.
    /// Empty when the one driver owns every vertex wholly.
    pub masks: Vec<u16>,
}

/// The shape of one sample pose, as deltas from the base in its unposed space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// For example `a_pose_45`.
    pub name: String,
    /// Metres per unit of `deltas`; above 0.
    pub step_m: f32,
    /// The segments that this target moves, ascending.
    pub segments: Vec<u16>,
    /// x, y, z per vertex of those segments, one after the other, in units of `step_m`.
    pub deltas: Vec<[i16; 3]>,
}

/// The sampled poses: row 0 is the base (T-pose), row `k + 1` belongs to target `k`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseTable {
    /// The joints that the table gives.
    pub bones: Vec<Bone>,
    /// Local rotations relative to the T-pose, row by row, `bones.len()` in each.
    pub rotations: Vec<Quat>,
}

impl PoseTable {
    /// The rotations of one row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[Quat] {
        &self.rotations[row * self.bones.len()..(row + 1) * self.bones.len()]
    }
}

/// A kimono as plain arrays; everything may be wrong until [`Garment::new`] has checked it.
#[derive(Clone, Debug, PartialEq)]
pub struct GarmentData {
    /// The catalog's name for it: `a-z`, `0-9`, `_`, `-`.
    pub id: String,
    /// The name people read.
    pub name: String,
    /// The skeleton of the body on which it was made.
    pub skeleton: Skeleton,
    /// The surface.
    pub mesh: Mesh,
    /// Skin weights of the unique vertices.
    pub skin: Vec<SkinWeights>,
    /// Drivers and, by the same numbers, regions.
    pub drivers: Vec<Driver>,
    /// The vertex order: segments cover the unique vertices one after the other.
    pub segments: Vec<Segment>,
    /// The target shapes.
    pub targets: Vec<Target>,
    /// The poses of base and targets.
    pub poses: PoseTable,
}

/// A kimono whose every index and number has been checked, with what evaluation derives from it once.
#[derive(Clone, Debug)]
pub struct Garment {
    data: GarmentData,
}

impl Garment {
    /// The checked arrays.
    #[must_use]
    pub fn data(&self) -> &GarmentData {
        &self.data
    }
}
