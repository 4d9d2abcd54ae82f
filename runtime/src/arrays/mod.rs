//! What a pack holds, as plain arrays, and the one check of their every index and number, which writer and reader share. Knows
//! neither the bytes of a pack nor what is computed from the arrays.

mod check;

pub use check::InvalidGarment;
pub(crate) use check::{check_count, check_length, is_name};

use crate::skeleton::{Bone, Pose, Skeleton};
use glam::{DVec3, Quat, Vec2, Vec3};

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
    /// Most pose limits.
    pub const POSE_LIMITS: usize = 8;
    /// Most joints of a pose limit.
    pub const LIMIT_JOINTS: usize = 8;
    /// Farthest bound of a pose limit, radians.
    pub const BOUND_RAD: f32 = 100.0;
    /// Most bounds of a pose limit.
    pub const LIMIT_BOUNDS: usize = 1024;
    /// Most segments of the vertex order.
    pub const SEGMENTS: usize = 4096;
    /// Most parts.
    pub const PARTS: usize = 256;
    /// Longest name, bytes.
    pub const NAME_BYTES: usize = 256;
    /// Most poses between the samples, of all groups together.
    pub const CENTRES: usize = 1024;
    /// Most joints in a chain of the default kernel.
    pub const CHAIN: usize = 16;
    /// Largest width, ridge or scale of the default kernel.
    pub const RBF_WIDTH: f64 = 1e3;
    /// Largest coefficient of the default kernel, either sign.
    pub const RBF_COEFFICIENT: f64 = 1e9;
    /// Largest coordinate, and largest coordinate of a delta, metres.
    pub const EXTENT_M: f32 = 100.0;
    /// Largest texture coordinate.
    pub const UV: f32 = 1024.0;
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

impl Mesh {
    /// The unique vertex that a vertex is, or copies where it is a seam twin.
    ///
    /// # Panics
    /// When there is no such vertex.
    #[must_use]
    pub fn unique(&self, vertex: u32) -> u32 {
        (vertex as usize).checked_sub(self.positions_m.len()).map_or(vertex, |twin| self.twin_of[twin])
    }
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
    /// Frames of the garment's skeleton, joints and then what hangs; unused places have weight 0.
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
    /// Which layer it belongs to. Layers are numbered from 0 without gaps.
    ///
    /// Layers *add*: the drivers of a layer choose among the targets of the same layer and move nothing else, so a pose of arms and legs is
    /// what the arms' layer makes of it plus what the legs' layer makes of it.
    pub layer: u8,
}

/// A run of vertices that the same regions cover.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Segment {
    /// How many unique vertices, following those of the segment before.
    pub vertex_count: u32,
    /// The drivers whose regions cover these vertices, ascending; none where no target moves the cloth.
    pub drivers: Vec<u8>,
    /// Region masks in 1/65535, `vertex_count` rows of `drivers.len()`; what one layer's drivers have in a row sums to at most 65535.
    /// Empty when the one driver owns every vertex wholly.
    pub masks: Vec<u16>,
}

/// A shape, as deltas from the base in its unposed space: that of a sample pose, or a corrective.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// For example `a_pose_45`.
    pub name: String,
    /// The layer whose drivers it answers to.
    pub layer: u8,
    /// Metres per unit of `deltas`; above 0.
    pub step_m: f32,
    /// The segments that this target moves, ascending.
    pub segments: Vec<u16>,
    /// x, y, z per vertex of those segments, one after the other, in units of `step_m`.
    pub deltas: Vec<[i16; 3]>,
}

impl Target {
    /// The unique vertices that this target moves, in the order of its deltas; `segments` are the garment's.
    pub fn vertices(&self, segments: &[Segment]) -> impl Iterator<Item = usize> {
        let runs = segments.iter().scan(0, |next, segment| {
            let first = *next;
            *next += segment.vertex_count as usize;
            Some(first..*next)
        });
        runs.zip(0..).filter(|(_, number)| self.segments.contains(number)).flat_map(|(run, _)| run)
    }
}

/// The sampled poses: row 0 is the base (T-pose), row `k + 1` belongs to target `k`. Correctives have
/// no row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseTable {
    /// The joints that the table gives.
    pub bones: Vec<Bone>,
    /// Local rotations relative to the T-pose, row by row, `bones.len()` in each.
    pub rotations: Vec<Quat>,
}

impl PoseTable {
    /// How many rows the table has; a table without bones has none.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rotations.len() / self.bones.len().max(1)
    }

    /// One row as a pose; joints that the table does not give are at rest.
    #[must_use]
    pub fn pose(&self, row: usize) -> Pose {
        self.bones.iter().zip(self.row(row)).fold(Pose::REST, |pose, (&bone, &rotation)| pose.with(bone, rotation))
    }

    /// The rotations of one row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[Quat] {
        &self.rotations[row * self.bones.len()..(row + 1) * self.bones.len()]
    }
}

/// A kimono as plain arrays; everything may be wrong until [`GarmentData::check`] has passed.
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
    /// The target shapes: those of the samples, then the correctives.
    pub targets: Vec<Target>,
    /// How many of the last targets are *correctives*: shapes that belong to no pose of their own and keep the cloth out of the body
    /// between the samples. Only the default kernel sets their rates, to 0 at every sample.
    pub corrective_count: usize,
    /// The poses of base and samples.
    pub poses: PoseTable,
    /// What the kimono allows its wearer.
    pub pose_limits: Vec<PoseLimit>,
    /// The default kernel; without it the paper's is used.
    pub rbf: Option<Rbf>,
    /// What was measured of the blending when the pack was built.
    pub certificate: Option<Certificate>,
    /// What its small numbers cost, as measured when it was built; of the kimono as it was made, not of one fitted from it.
    pub compression: Option<Compression>,
}

impl GarmentData {
    /// How many layers the drivers form.
    #[must_use]
    pub fn layer_count(&self) -> usize {
        self.drivers.iter().map(|driver| usize::from(driver.layer) + 1).max().unwrap_or(0)
    }

    /// How many targets are shapes of a sample pose: the first ones, in the order of the pose table.
    #[must_use]
    pub fn sample_count(&self) -> usize {
        self.targets.len().saturating_sub(self.corrective_count)
    }

    /// The numbers of a layer's samples, ascending.
    pub fn samples_of_layer(&self, layer: usize) -> impl Iterator<Item = usize> {
        let samples = self.sample_count();
        self.targets_of_layer(layer).filter(move |&target| target < samples)
    }

    /// The numbers of a layer's targets, ascending: its samples, then its correctives.
    pub fn targets_of_layer(&self, layer: usize) -> impl Iterator<Item = usize> {
        self.targets.iter().enumerate().filter(move |(_, target)| usize::from(target.layer) == layer).map(|(i, _)| i)
    }
}

/// Joints that a kimono keeps from turning farther than its samples do: a skirt stops a stride.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseLimit {
    /// The joints, which stand in the pose table.
    pub bones: Vec<Bone>,
    /// How far they may exceed a bound at most, radians; above 0.
    pub margin_rad: f32,
    /// What the samples reach; every sample keeps every bound.
    pub bounds: Vec<PoseBound>,
}

/// The angles x of a limit's joints, three rotation-vector components for each in radians, keep it when `normal · x` is at most
/// `most_rad`.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseBound {
    /// Three numbers per joint, together of length 1.
    pub normal: Vec<f32>,
    /// 0 or more, so that the T-pose keeps it.
    pub most_rad: f32,
}

/// What a pack's blending promises between its samples, as measured when it was built. Rows are those of the pose
/// table.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// Fastest movement of any vertex found over the sampled pose space, mm per degree of one joint.
    pub speed_mm_per_deg: f32,
    /// The joint that was turned there.
    pub fastest_joint: Bone,
    /// The two rows nearest to that pose.
    pub fastest_rows: [u16; 2],
    /// Farthest that any vertex moves when no joint turns by more than 0.01 degrees, along sampled paths, mm.
    pub step_mm: f32,
    /// Farthest that any vertex's movement differs between two such steps that follow each other, mm.
    pub step_change_mm: f32,
    /// Error of every target when its row is left out of the table; empty without a default kernel.
    pub left_out: Vec<LeftOut>,
    /// The two rows that are hardest to tell apart.
    pub nearest: NearestPair,
}

/// How far a pack's targets and surface lie from what they were before they became small numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Compression {
    /// How far they may lie, metres.
    pub budget_m: f32,
    /// Of every sample's target, where its masks let it through.
    pub targets: Vec<Loss>,
    /// At how many poses between the samples the posed surface was compared.
    pub poses: u32,
    /// Of all vertices at all those poses.
    pub surface: Loss,
}

/// Distances from what was before, over vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loss {
    /// Largest, metres.
    pub max_m: f32,
    /// 99th percentile, metres.
    pub p99_m: f32,
    /// Which share is above half the budget, 0 to 1.
    pub above_half: f32,
}

/// How far a target lies from its prediction by the others, over all vertices, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeftOut {
    /// Mean.
    pub mean_mm: f32,
    /// 99th percentile.
    pub p99_mm: f32,
    /// Largest.
    pub max_mm: f32,
}

/// Two rows of the pose table and the root of the summed squared angles between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPair {
    /// The rows.
    pub rows: [u16; 2],
    /// Degrees.
    pub apart_deg: f32,
}

/// The default kernel of a garment, as the pipeline fitted it.
#[derive(Clone, Debug, PartialEq)]
pub struct Rbf {
    /// One per layer.
    pub layers: Vec<RbfLayer>,
}

/// The default kernel among the samples of one layer: the base, then the layer's targets.
#[derive(Clone, Debug, PartialEq)]
pub struct RbfLayer {
    /// Drivers that blend together; every driver of the layer is in exactly one group.
    pub groups: Vec<Group>,
    /// Distance over all groups beyond which a sample's correction ends; above 0.
    pub joint_width: f64,
    /// Distance from every sample beyond which the skinned base remains; above 0.
    pub reach: f64,
    /// Ridge with which `own` was solved, above 0: unused per frame, and needed to solve it anew without a sample.
    pub ridge: f64,
    /// The ridge of mirrored samples, likewise: how much less they are believed.
    pub mirror_ridge: f64,
}

/// Drivers that blend together, usually those of one arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// For example `rightArm`.
    pub name: String,
    /// The drivers whose rates this group sets.
    pub drivers: Vec<u8>,
    /// The joints that tell poses apart, from the trunk outward.
    pub chain: Vec<ChainJoint>,
    /// The group of the layer that has the same bones on the other side: its samples, mirrored, are further samples of this one.
    pub mirror: Option<u8>,
    /// Coefficients of φ: one row per sample of the layer (the base first), then one per mirrored sample where there is a
    /// `mirror` (not the base, whose mirror image is the base); one column per target of the layer.
    pub own: Vec<f64>,
    /// Coefficients of ψ: one row per sample of the layer (the base first), the same columns.
    pub joint: Vec<f64>,
    /// Poses between the samples where cloth had to be pushed out of the body: rotations of the chain's joints, pose by pose.
    pub centres: Vec<Quat>,
    /// Coefficients of φ at those poses: one row per pose, one column per corrective of the layer.
    pub corrective: Vec<f64>,
}

/// A joint of a group's chain and how much its turning matters to the shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainJoint {
    /// The bone that turns.
    pub bone: Bone,
    /// The place in the chain, before this one, of the joint that carries it; `None`: the trunk does.
    pub parent: Option<u8>,
    /// Whether the joint counts by how it is turned against the trunk: after all joints of the chain that carry it.
    pub is_carried: bool,
    /// The bone's direction in the T-pose, unit length.
    pub axis: DVec3,
    /// Scale of turns across that direction; 0 or more.
    pub swing: f64,
    /// Scale of turns about that direction; 0 or more.
    pub twist: f64,
}
