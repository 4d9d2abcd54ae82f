//! What an open pack holds: the kimono as plain arrays ([`GarmentData`]), and the same once its every index and number
//! has been checked ([`Garment`]). Knows neither the bytes of a pack nor how a frame is made.

use crate::clearance::{Proxy, Surfel};
use crate::evaluate::Plan;
use crate::pose_blend::Kernel;
use crate::pose_blend::rbf::{ChainJoint, Rbf, Samples};
use crate::skeleton::{Bone, Pose, Skeleton, SkeletonError};
use glam::{Quat, Vec2, Vec3};
use std::collections::BTreeSet;
use std::f32::consts::PI;

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
    /// Most joints in a chain of the default kernel.
    pub const CHAIN: usize = 16;
    /// Largest width, ridge or scale of the default kernel.
    pub const RBF_WIDTH: f64 = 1e3;
    /// Largest coefficient of the default kernel, either sign.
    pub const RBF_COEFFICIENT: f64 = 1e9;
    /// Most clearance proxies.
    pub const PROXIES: usize = 16;
    /// Most surfels of all clearance proxies together.
    pub const SURFELS: usize = 1 << 16;
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
    /// The default kernel; without it the paper's is used.
    pub rbf: Option<Rbf>,
    /// What was measured of the blending when the pack was built.
    pub certificate: Option<Certificate>,
    /// What the cloth is kept out of; without them it is not.
    pub proxies: Vec<Proxy>,
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

/// A kimono whose every index and number has been checked, with what evaluation derives from it once.
#[derive(Clone, Debug)]
pub struct Garment {
    data: GarmentData,
    samples: Samples,
    plan: Plan,
}

impl Garment {
    /// Checks everything that evaluation relies on, so that it can neither fail nor index out of bounds. Rotations of
    /// the pose table that are unit quaternions within 1e-3 are normalised.
    ///
    /// # Errors
    /// Names the first element that breaks a rule.
    pub fn new(mut data: GarmentData) -> Result<Garment, InvalidGarment> {
        check_mesh(&data.mesh)?;
        check_skin(&data)?;
        check_drivers(&data)?;
        check_segments(&data)?;
        check_targets(&data)?;
        check_poses(&data)?;
        check_rbf(&data)?;
        check_certificate(&data)?;
        check_proxies(&data)?;
        check_texts(&data)?;
        for rotation in &mut data.poses.rotations {
            // Only where needed: a second normalisation may change the last bit, and packs must come back as written.
            if (rotation.length_squared() - 1.0).abs() > 1e-6 {
                *rotation = rotation.normalize();
            }
        }
        Ok(Garment { samples: Samples::new(&data), plan: Plan::new(&data), data })
    }

    /// The samples of the default kernel, embedded.
    pub(crate) fn samples(&self) -> &Samples {
        &self.samples
    }

    /// What frames are made with.
    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The kernel that [`evaluate`](crate::evaluate::evaluate) uses: the default one where the garment has it.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        if self.data.rbf.is_some() { Kernel::Rbf } else { Kernel::Paper }
    }

    /// The checked arrays.
    #[must_use]
    pub fn data(&self) -> &GarmentData {
        &self.data
    }

    /// Vertices of a frame: the unique ones, then the seam twins.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.unique_count() + self.data.mesh.twin_of.len()
    }

    /// Vertices without seam twins.
    #[must_use]
    pub fn unique_count(&self) -> usize {
        self.data.mesh.positions_m.len()
    }

    /// Triangles over all vertices.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.data.mesh.triangles.len()
    }
}

/// Which element of a [`GarmentData`] is wrong, and what is wrong with it. Elements are numbered from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidGarment {
    /// The id holds other characters, none, or too many.
    #[error("the id {0:?} must be 1 to {max} characters of a-z, 0-9, _ and -", max = limits::NAME_BYTES)]
    Id(String),
    /// The garment's name is empty, too long or not printable.
    #[error("the garment's name must be 1 to {max} bytes of printable text", max = limits::NAME_BYTES)]
    GarmentName,
    /// The name of an element is empty, too long or not printable.
    #[error("the name of {what} {index} must be 1 to {max} bytes of printable text", max = limits::NAME_BYTES)]
    Name {
        /// `part`, `driver`, `target` …
        what: &'static str,
        /// Its number.
        index: usize,
    },
    /// Two elements of one kind share a name.
    #[error("two {what}s are named {name:?}")]
    DuplicateName {
        /// `part`, `driver`, `target` …
        what: &'static str,
        /// The name.
        name: String,
    },
    /// There are more elements than the limit, or none where one is needed.
    #[error("there are {count} {what}; {min} to {max} are possible")]
    Count {
        /// Of what there are too many or too few.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there must be.
        min: usize,
        /// How many there may be.
        max: usize,
    },
    /// Two arrays that describe the same elements differ in length.
    #[error("there are {length} {what} instead of {expected}")]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        length: usize,
        /// The length it must have.
        expected: usize,
    },
    /// A position is not finite or out of bounds.
    #[error("the position of vertex {0} is not within {max} m of the origin", max = limits::EXTENT_M)]
    Position(usize),
    /// A texture coordinate is not finite or out of bounds.
    #[error("the texture coordinate of vertex {0} is not within ±{max}", max = limits::UV)]
    Uv(usize),
    /// A twin copies a vertex that is not among the unique ones.
    #[error("twin {twin} copies vertex {vertex}, which is none of the unique vertices")]
    Twin {
        /// Number of the twin.
        twin: usize,
        /// What it wants to copy.
        vertex: u32,
    },
    /// A triangle has a corner that does not exist.
    #[error("triangle {triangle} has a corner at vertex {vertex}, which does not exist")]
    Triangle {
        /// Number of the triangle.
        triangle: usize,
        /// The missing vertex.
        vertex: u32,
    },
    /// The source vertices are no permutation: out of range, or the same one twice.
    #[error("source vertex {source_vertex} of vertex {vertex} is out of range or occurs twice")]
    SourceVertex {
        /// Number of the vertex.
        vertex: usize,
        /// Its source vertex.
        source_vertex: u32,
    },
    /// A vertex is skinned to a joint that the skeleton lacks.
    #[error("vertex {vertex} is skinned to joint {joint}, which the skeleton lacks")]
    SkinJoint {
        /// Number of the vertex.
        vertex: usize,
        /// The missing joint.
        joint: u8,
    },
    /// Skin weights of a vertex do not sum to one.
    #[error("the skin weights of vertex {vertex} sum to {sum} instead of 65535")]
    SkinWeights {
        /// Number of the vertex.
        vertex: usize,
        /// Their sum.
        sum: u32,
    },
    /// A driver has no joints, or the same one twice, or one that the pose table does not give.
    #[error("the joints of driver {0} must be distinct bones of the pose table, at least one")]
    DriverJoints(usize),
    /// A driver's threshold is out of range.
    #[error("the threshold of driver {0} must be above 0 and at most π times the root of its joint count")]
    DriverThreshold(usize),
    /// A segment has no vertices.
    #[error("segment {0} is empty")]
    EmptySegment(usize),
    /// A segment's drivers do not ascend or do not exist.
    #[error("the drivers of segment {0} must be numbers of drivers, ascending")]
    SegmentDrivers(usize),
    /// A segment has another number of masks than its vertices and drivers need.
    #[error("segment {segment} has {length} masks instead of {expected}")]
    SegmentMasks {
        /// Number of the segment.
        segment: usize,
        /// How many masks it has.
        length: usize,
        /// How many it needs.
        expected: usize,
    },
    /// The masks of a vertex sum to more than one.
    #[error("the masks of row {row} of segment {segment} sum to {sum}, more than 65535")]
    MaskSum {
        /// Number of the segment.
        segment: usize,
        /// The vertex, counted from the segment's first.
        row: usize,
        /// The sum.
        sum: u32,
    },
    /// A target's step is not a usable length.
    #[error("the step of target {0} must be above 0 m, and 32767 steps at most {max} m", max = limits::EXTENT_M)]
    TargetStep(usize),
    /// A target's segments do not ascend or do not exist.
    #[error("the segments of target {0} must be numbers of segments, ascending")]
    TargetSegments(usize),
    /// A target has another number of deltas than its segments have vertices.
    #[error("target {target} has {length} deltas instead of {expected}")]
    TargetDeltas {
        /// Number of the target.
        target: usize,
        /// How many deltas it has.
        length: usize,
        /// How many vertices its segments have.
        expected: usize,
    },
    /// A width or the ridge of the default kernel is out of range.
    #[error("the widths and the ridge of the default kernel must be above 0 and at most {max}", max = limits::RBF_WIDTH)]
    RbfWidth,
    /// A group names a driver that does not exist or is in another group too.
    #[error("driver {driver} of group {group} does not exist or is in two groups")]
    GroupDriver {
        /// Number of the group.
        group: usize,
        /// Number of the driver.
        driver: u8,
    },
    /// A driver is in no group.
    #[error("driver {0} is in no group of the default kernel")]
    Ungrouped(usize),
    /// The chain of a group is no list of distinct bones of the pose table with unit axes and usable scales.
    #[error("the chain of group {0} must be distinct bones of the pose table, with unit axes and scales of 0 or more")]
    GroupChain(usize),
    /// A coefficient of a group is not a usable number.
    #[error("the coefficients of group {0} must lie within ±{max}", max = limits::RBF_COEFFICIENT)]
    GroupCoefficient(usize),
    /// A figure of the certificate is not a finite number of 0 or more.
    #[error("the figures of the certificate must be finite and 0 or more")]
    CertificateFigure,
    /// The certificate names a row that the pose table lacks.
    #[error("the certificate names row {0}, which the pose table lacks")]
    CertificateRow(u16),
    /// The joints are no skeleton.
    #[error(transparent)]
    Skeleton(SkeletonError),
    /// A clearance proxy breaks a rule.
    #[error("clearance proxy {proxy}: {problem}")]
    Proxy {
        /// Number of the proxy.
        proxy: usize,
        /// The rule.
        problem: &'static str,
    },
    /// A bone of the pose table occurs twice or is not in the skeleton.
    #[error("bone {} of the pose table occurs twice or is not in the skeleton", .0.name())]
    PoseBone(Bone),
    /// A rotation of the pose table is no unit quaternion.
    #[error("the rotation of {} in row {row} of the pose table is no unit quaternion", bone.name())]
    PoseRotation {
        /// Row of the table.
        row: usize,
        /// Which bone.
        bone: Bone,
    },
}

fn check_mesh(mesh: &Mesh) -> Result<(), InvalidGarment> {
    let unique = mesh.positions_m.len();
    let vertices = unique + mesh.twin_of.len();
    check_count("unique vertices", unique, 1, limits::VERTICES)?;
    check_count("vertices", vertices, 1, limits::VERTICES)?;
    check_count("triangles", mesh.triangles.len(), 1, limits::TRIANGLES)?;
    check_count("parts", mesh.parts.len(), 1, limits::PARTS)?;

    let far = |position: &Vec3| !(position.is_finite() && position.abs().max_element() <= limits::EXTENT_M);
    if let Some(vertex) = mesh.positions_m.iter().position(far) {
        return Err(InvalidGarment::Position(vertex));
    }
    if !mesh.uv.is_empty() {
        check_length("texture coordinates", mesh.uv.len(), vertices)?;
    }
    let far = |uv: &Vec2| !(uv.is_finite() && uv.abs().max_element() <= limits::UV);
    if let Some(vertex) = mesh.uv.iter().position(far) {
        return Err(InvalidGarment::Uv(vertex));
    }
    for (twin, &vertex) in mesh.twin_of.iter().enumerate() {
        if vertex as usize >= unique {
            return Err(InvalidGarment::Twin { twin, vertex });
        }
    }
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= vertices) {
            return Err(InvalidGarment::Triangle { triangle, vertex });
        }
    }
    let in_parts = total(mesh.parts.iter().map(|part| part.triangle_count));
    check_length("triangles in parts", in_parts, mesh.triangles.len())?;

    check_length("source vertices", mesh.source_vertex.len(), unique)?;
    let mut seen = vec![false; unique];
    for (vertex, &source_vertex) in mesh.source_vertex.iter().enumerate() {
        match seen.get_mut(source_vertex as usize) {
            Some(seen @ false) => *seen = true,
            _ => return Err(InvalidGarment::SourceVertex { vertex, source_vertex }),
        }
    }
    Ok(())
}

fn check_skin(data: &GarmentData) -> Result<(), InvalidGarment> {
    check_length("skin weights", data.skin.len(), data.mesh.positions_m.len())?;
    let joint_count = data.skeleton.joints().len();
    for (vertex, skin) in data.skin.iter().enumerate() {
        if let Some(&joint) = skin.joints.iter().find(|&&joint| usize::from(joint) >= joint_count) {
            return Err(InvalidGarment::SkinJoint { vertex, joint });
        }
        let sum = skin.weights.iter().map(|&weight| u32::from(weight)).sum();
        if sum != u32::from(u16::MAX) {
            return Err(InvalidGarment::SkinWeights { vertex, sum });
        }
    }
    Ok(())
}

fn check_drivers(data: &GarmentData) -> Result<(), InvalidGarment> {
    check_count("drivers", data.drivers.len(), 0, limits::DRIVERS)?;
    for (i, driver) in data.drivers.iter().enumerate() {
        let distinct: BTreeSet<Bone> = driver.joints.iter().copied().collect();
        let given = driver.joints.iter().all(|bone| data.poses.bones.contains(bone));
        if distinct.is_empty() || distinct.len() != driver.joints.len() || !given {
            return Err(InvalidGarment::DriverJoints(i));
        }
        // The distance of two poses is the root of the sum over joints of squared angles, each at most π.
        let farthest_rad = PI * (driver.joints.len() as f32).sqrt();
        if !(driver.threshold_rad > 0.0 && driver.threshold_rad <= farthest_rad) {
            return Err(InvalidGarment::DriverThreshold(i));
        }
    }
    Ok(())
}

fn check_segments(data: &GarmentData) -> Result<(), InvalidGarment> {
    check_count("segments", data.segments.len(), 1, limits::SEGMENTS)?;
    let covered = total(data.segments.iter().map(|segment| segment.vertex_count));
    check_length("vertices in segments", covered, data.mesh.positions_m.len())?;
    for (i, segment) in data.segments.iter().enumerate() {
        if segment.vertex_count == 0 {
            return Err(InvalidGarment::EmptySegment(i));
        }
        let exist = segment.drivers.iter().all(|&driver| usize::from(driver) < data.drivers.len());
        if !exist || !ascend(&segment.drivers) {
            return Err(InvalidGarment::SegmentDrivers(i));
        }
        let columns = segment.drivers.len();
        let (length, expected) = (segment.masks.len(), segment.vertex_count as usize * columns);
        if length != expected && !(segment.masks.is_empty() && columns == 1) {
            return Err(InvalidGarment::SegmentMasks { segment: i, length, expected });
        }
        for (row, masks) in segment.masks.chunks_exact(columns.max(1)).enumerate() {
            let sum = masks.iter().map(|&mask| u32::from(mask)).sum();
            if sum > u32::from(u16::MAX) {
                return Err(InvalidGarment::MaskSum { segment: i, row, sum });
            }
        }
    }
    Ok(())
}

fn check_targets(data: &GarmentData) -> Result<(), InvalidGarment> {
    check_count("targets", data.targets.len(), 0, limits::TARGETS)?;
    for (i, target) in data.targets.iter().enumerate() {
        if !(target.step_m > 0.0 && target.step_m * f32::from(i16::MAX) <= limits::EXTENT_M) {
            return Err(InvalidGarment::TargetStep(i));
        }
        let exist = target.segments.iter().all(|&segment| usize::from(segment) < data.segments.len());
        if !exist || !ascend(&target.segments) {
            return Err(InvalidGarment::TargetSegments(i));
        }
        let vertex_count = |&segment: &u16| data.segments[usize::from(segment)].vertex_count as usize;
        let (length, expected) = (target.deltas.len(), target.segments.iter().map(vertex_count).sum());
        if length != expected {
            return Err(InvalidGarment::TargetDeltas { target: i, length, expected });
        }
    }
    Ok(())
}

fn check_poses(data: &GarmentData) -> Result<(), InvalidGarment> {
    let PoseTable { bones, rotations } = &data.poses;
    let mut seen = BTreeSet::new();
    for &bone in bones {
        if data.skeleton.index_of(bone).is_none() || !seen.insert(bone) {
            return Err(InvalidGarment::PoseBone(bone));
        }
    }
    check_length("rotations in the pose table", rotations.len(), (data.targets.len() + 1) * bones.len())?;
    let skewed = |q: &Quat| !(q.is_finite() && (q.length() - 1.0).abs() <= 1e-3);
    if let Some(i) = rotations.iter().position(skewed) {
        return Err(InvalidGarment::PoseRotation { row: i / bones.len(), bone: bones[i % bones.len()] });
    }
    Ok(())
}

fn check_rbf(data: &GarmentData) -> Result<(), InvalidGarment> {
    let Some(rbf) = &data.rbf else { return Ok(()) };
    let usable = |width: f64| width > 1e-9 && width <= limits::RBF_WIDTH;
    if ![rbf.joint_width, rbf.reach, rbf.ridge].into_iter().all(usable) {
        return Err(InvalidGarment::RbfWidth);
    }
    check_count("groups", rbf.groups.len(), 1, limits::DRIVERS)?;
    let mut owned = vec![false; data.drivers.len()];
    for (i, group) in rbf.groups.iter().enumerate() {
        for &driver in &group.drivers {
            match owned.get_mut(usize::from(driver)) {
                Some(owned @ false) => *owned = true,
                _ => return Err(InvalidGarment::GroupDriver { group: i, driver }),
            }
        }
        check_count("joints in a chain", group.chain.len(), 1, limits::CHAIN)?;
        let distinct: BTreeSet<Bone> = group.chain.iter().map(|joint| joint.bone).collect();
        let scale = |scale: f64| (0.0..=limits::RBF_WIDTH).contains(&scale);
        let sound = |joint: &ChainJoint| {
            data.poses.bones.contains(&joint.bone)
                && (joint.axis.length() - 1.0).abs() <= 1e-6
                && scale(joint.swing)
                && scale(joint.twist)
        };
        if distinct.len() != group.chain.len() || !group.chain.iter().all(sound) {
            return Err(InvalidGarment::GroupChain(i));
        }
        let expected = (data.targets.len() + 1) * data.targets.len();
        for coefficients in [&group.own, &group.joint] {
            check_length("coefficients of a group", coefficients.len(), expected)?;
            if !coefficients.iter().all(|coefficient| coefficient.abs() <= limits::RBF_COEFFICIENT) {
                return Err(InvalidGarment::GroupCoefficient(i));
            }
        }
    }
    match owned.iter().position(|&owned| !owned) {
        Some(driver) => Err(InvalidGarment::Ungrouped(driver)),
        None => Ok(()),
    }
}

fn check_certificate(data: &GarmentData) -> Result<(), InvalidGarment> {
    let Some(certificate) = &data.certificate else { return Ok(()) };
    let Certificate { speed_mm_per_deg, fastest_rows, step_mm, step_change_mm, left_out, nearest, .. } = certificate;
    let errors = left_out.iter().flat_map(|error| [error.mean_mm, error.p99_mm, error.max_mm]);
    let mut figures = [*speed_mm_per_deg, *step_mm, *step_change_mm, nearest.apart_deg].into_iter().chain(errors);
    if !figures.all(|figure| (0.0..f32::INFINITY).contains(&figure)) {
        return Err(InvalidGarment::CertificateFigure);
    }
    if !left_out.is_empty() {
        check_length("left-out errors", left_out.len(), data.targets.len())?;
    }
    match fastest_rows.iter().chain(&nearest.rows).find(|&&row| usize::from(row) > data.targets.len()) {
        Some(&row) => Err(InvalidGarment::CertificateRow(row)),
        None => Ok(()),
    }
}

fn check_proxies(data: &GarmentData) -> Result<(), InvalidGarment> {
    check_count("clearance proxies", data.proxies.len(), 0, limits::PROXIES)?;
    let surfels = data.proxies.iter().map(|proxy| proxy.surfels.len()).sum();
    check_count("surfels of clearance proxies", surfels, 0, limits::SURFELS)?;
    let (joints, unique) = (data.skeleton.joints().len(), data.mesh.positions_m.len());
    for (i, proxy) in data.proxies.iter().enumerate() {
        let fail = |problem| Err(InvalidGarment::Proxy { proxy: i, problem });
        for Surfel { place_m, normal, radius_m, share, skin } in &proxy.surfels {
            if !(place_m.is_finite() && place_m.abs().max_element() <= limits::EXTENT_M) {
                return fail("its surfels must lie within 100 m");
            }
            if !(0.999..=1.001).contains(&normal.length_squared()) {
                return fail("its normals must be unit vectors");
            }
            if !((1e-3..=1.0).contains(radius_m) && (1e-6..=1e3).contains(share)) {
                return fail("its radii must be 1 mm to 1 m, its shares 1e-6 to 1e3");
            }
            let is_known = skin.joints.iter().all(|&joint| usize::from(joint) < joints);
            if !is_known || skin.weights.iter().map(|&weight| u32::from(weight)).sum::<u32>() != u32::from(u16::MAX) {
                return fail("its skin weights must name joints of the skeleton and sum to 65535");
            }
        }
        let mut is_guarded = vec![false; unique];
        for guarded in &proxy.guarded {
            match is_guarded.get_mut(guarded.vertex as usize) {
                Some(known @ false) => *known = true,
                _ => return fail("it must guard unique vertices, each once"),
            }
        }
    }
    Ok(())
}

fn check_texts(data: &GarmentData) -> Result<(), InvalidGarment> {
    let id_char = |c: u8| matches!(c, b'a'..=b'z' | b'0'..=b'9' | b'_' | b'-');
    if !(1..=limits::NAME_BYTES).contains(&data.id.len()) || !data.id.bytes().all(id_char) {
        return Err(InvalidGarment::Id(data.id.clone()));
    }
    if !is_name(&data.name) {
        return Err(InvalidGarment::GarmentName);
    }
    check_names("clearance limb", data.proxies.iter().map(|proxy| proxy.name.as_str()))?;
    check_names("part", data.mesh.parts.iter().map(|part| part.name.as_str()))?;
    let groups = data.rbf.iter().flat_map(|rbf| &rbf.groups);
    check_names("group", groups.map(|group| group.name.as_str()))?;
    check_names("driver", data.drivers.iter().map(|driver| driver.name.as_str()))?;
    check_names("target", data.targets.iter().map(|target| target.name.as_str()))
}

fn check_names<'a>(what: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), InvalidGarment> {
    let mut seen = BTreeSet::new();
    for (index, name) in names.enumerate() {
        if !is_name(name) {
            return Err(InvalidGarment::Name { what, index });
        }
        if !seen.insert(name) {
            return Err(InvalidGarment::DuplicateName { what, name: name.to_owned() });
        }
    }
    Ok(())
}

fn is_name(text: &str) -> bool {
    (1..=limits::NAME_BYTES).contains(&text.len()) && !text.contains(char::is_control)
}

fn check_count(what: &'static str, count: usize, min: usize, max: usize) -> Result<(), InvalidGarment> {
    if (min..=max).contains(&count) { Ok(()) } else { Err(InvalidGarment::Count { what, count, min, max }) }
}

fn check_length(what: &'static str, length: usize, expected: usize) -> Result<(), InvalidGarment> {
    if length == expected { Ok(()) } else { Err(InvalidGarment::Length { what, length, expected }) }
}

/// The sum, which no number of a hostile pack makes overflow.
fn total(counts: impl Iterator<Item = u32>) -> usize {
    counts.fold(0, |sum: usize, count| sum.saturating_add(count as usize))
}

fn ascend<T: PartialOrd>(values: &[T]) -> bool {
    values.windows(2).all(|pair| pair[0] < pair[1])
}
