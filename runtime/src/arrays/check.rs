//! The one check of a garment's arrays: after it nothing that evaluation does can fail or index out of bounds.

use super::{Certificate, Compression, GarmentData, Group, Loss, Mesh, PoseTable, RbfLayer, limits};
use crate::skeleton::{Bone, SkeletonError};
use glam::{Quat, Vec2, Vec3};
use std::collections::BTreeSet;
use std::f32::consts::PI;

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
    /// The layers of the drivers are not numbered from 0 without gaps.
    #[error("the layers of the drivers must be numbered from 0 without gaps")]
    Layers,
    /// A target's layer has no driver.
    #[error("target {0} belongs to a layer that no driver belongs to")]
    TargetLayer(usize),
    /// A pose limit has no joints, or the same one twice, or one that the pose table does not give.
    #[error("the joints of pose limit {0} must be distinct bones of the pose table")]
    LimitJoints(usize),
    /// The margin of a pose limit is out of range.
    #[error("the margin of pose limit {0} must be above 0 and at most π")]
    LimitMargin(usize),
    /// A bound of a pose limit has no unit normal of three numbers per joint, or lies out of range.
    #[error("the bounds of pose limit {0} must have unit normals of three numbers per joint and lie within 0 to {max}", max = limits::BOUND_RAD)]
    LimitBound(usize),
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
    /// A group's mirror is no other group of its layer, or has other bones than those of the other side.
    #[error("the mirror of group {0} must be another group of its layer with the same bones on the other side")]
    GroupMirror(usize),
    /// The chain of a group is no list of distinct bones of the pose table with unit axes and usable scales.
    #[error("the chain of group {0} must be distinct bones of the pose table, with unit axes and scales of 0 or more")]
    GroupChain(usize),
    /// A coefficient of a group is not a usable number.
    #[error("the coefficients of group {0} must lie within ±{max}", max = limits::RBF_COEFFICIENT)]
    GroupCoefficient(usize),
    /// A pose between the samples is not a rotation.
    #[error("the poses between the samples of group {0} must be unit quaternions")]
    GroupCentre(usize),
    /// A figure of the certificate is not a finite number of 0 or more.
    #[error("the figures of the certificate must be finite and 0 or more")]
    CertificateFigure,
    /// A figure of what compression lost is out of range, or there are figures of more or fewer targets than samples.
    #[error("what compression lost must be finite, 0 or more, shares at most 1, and be known of every sample")]
    Compression,
    /// The certificate names a row that the pose table lacks.
    #[error("the certificate names row {0}, which the pose table lacks")]
    CertificateRow(u16),
    /// The joints are no skeleton.
    #[error(transparent)]
    Skeleton(SkeletonError),
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

impl GarmentData {
    /// Checks everything that evaluation relies on.
    ///
    /// # Errors
    /// Names the first element that breaks a rule.
    pub fn check(&self) -> Result<(), InvalidGarment> {
        check_mesh(&self.mesh)?;
        check_skin(self)?;
        check_drivers(self)?;
        check_segments(self)?;
        check_targets(self)?;
        check_poses(self)?;
        check_pose_limits(self)?;
        check_rbf(self)?;
        check_certificate(self)?;
        check_compression(self)?;
        check_texts(self)
    }
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
    let frames = data.skeleton.frame_count();
    for (vertex, skin) in data.skin.iter().enumerate() {
        if let Some(&joint) = skin.joints.iter().find(|&&joint| usize::from(joint) >= frames) {
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
    let layers: BTreeSet<u8> = data.drivers.iter().map(|driver| driver.layer).collect();
    if layers.len() != data.layer_count() {
        return Err(InvalidGarment::Layers);
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
            let mut sums = [0u32; limits::DRIVERS];
            for (&driver, &mask) in segment.drivers.iter().zip(masks) {
                sums[usize::from(data.drivers[usize::from(driver)].layer)] += u32::from(mask);
            }
            if let Some(&sum) = sums.iter().find(|&&sum| sum > u32::from(u16::MAX)) {
                return Err(InvalidGarment::MaskSum { segment: i, row, sum });
            }
        }
    }
    Ok(())
}

fn check_targets(data: &GarmentData) -> Result<(), InvalidGarment> {
    check_count("targets", data.targets.len(), 0, limits::TARGETS)?;
    check_count("correctives", data.corrective_count, 0, data.targets.len())?;
    for (i, target) in data.targets.iter().enumerate() {
        if !(target.step_m > 0.0 && target.step_m * f32::from(i16::MAX) <= limits::EXTENT_M) {
            return Err(InvalidGarment::TargetStep(i));
        }
        // Without drivers nothing moves, and there is one layer that nobody drives.
        if usize::from(target.layer) >= data.layer_count().max(1) {
            return Err(InvalidGarment::TargetLayer(i));
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
    check_length("rotations in the pose table", rotations.len(), (data.sample_count() + 1) * bones.len())?;
    if let Some(i) = rotations.iter().position(skewed) {
        return Err(InvalidGarment::PoseRotation { row: i / bones.len(), bone: bones[i % bones.len()] });
    }
    Ok(())
}

fn skewed(rotation: &Quat) -> bool {
    !(rotation.is_finite() && (rotation.length() - 1.0).abs() <= 1e-3)
}

fn check_pose_limits(data: &GarmentData) -> Result<(), InvalidGarment> {
    check_count("pose limits", data.pose_limits.len(), 0, limits::POSE_LIMITS)?;
    for (i, limit) in data.pose_limits.iter().enumerate() {
        let distinct: BTreeSet<Bone> = limit.bones.iter().copied().collect();
        let given = limit.bones.iter().all(|bone| data.poses.bones.contains(bone));
        check_count("joints of a pose limit", distinct.len(), 1, limits::LIMIT_JOINTS)?;
        if distinct.len() != limit.bones.len() || !given {
            return Err(InvalidGarment::LimitJoints(i));
        }
        if !(limit.margin_rad > 0.0 && limit.margin_rad <= PI) {
            return Err(InvalidGarment::LimitMargin(i));
        }
        check_count("bounds of a pose limit", limit.bounds.len(), 0, limits::LIMIT_BOUNDS)?;
        for bound in &limit.bounds {
            let length_squared: f32 = bound.normal.iter().map(|x| x * x).sum();
            let is_unit = bound.normal.len() == 3 * limit.bones.len() && (length_squared - 1.0).abs() <= 1e-3;
            if !(is_unit && (0.0..=limits::BOUND_RAD).contains(&bound.most_rad)) {
                return Err(InvalidGarment::LimitBound(i));
            }
        }
    }
    Ok(())
}

fn check_rbf(data: &GarmentData) -> Result<(), InvalidGarment> {
    let Some(rbf) = &data.rbf else { return Ok(()) };
    check_length("layers of the default kernel", rbf.layers.len(), data.layer_count())?;
    let mut owned = vec![false; data.drivers.len()];
    let mut number = 0;
    let mut all_centres = 0;
    for (layer, RbfLayer { groups, joint_width, reach, ridge, mirror_ridge }) in rbf.layers.iter().enumerate() {
        let usable = |width: &f64| *width > 1e-9 && *width <= limits::RBF_WIDTH;
        if ![joint_width, reach, ridge, mirror_ridge].into_iter().all(usable) {
            return Err(InvalidGarment::RbfWidth);
        }
        check_count("groups", groups.len(), 1, limits::DRIVERS)?;
        for (place, group) in groups.iter().enumerate() {
            for &driver in &group.drivers {
                let is_of_layer = data.drivers.get(usize::from(driver)).is_some_and(|d| usize::from(d.layer) == layer);
                match owned.get_mut(usize::from(driver)) {
                    Some(owned @ false) if is_of_layer => *owned = true,
                    _ => return Err(InvalidGarment::GroupDriver { group: number, driver }),
                }
            }
            check_chain(group, number, &data.poses)?;
            let targets = data.targets_of_layer(layer).count();
            let samples = data.samples_of_layer(layer).count();
            let centres = check_centres(group, number)?;
            all_centres += centres;
            check_count("poses between the samples", all_centres, 0, limits::CENTRES)?;
            check_mirror(groups, place, number)?;
            let mirrored = if group.mirror.is_some() { samples } else { 0 };
            let rows = samples + 1;
            let lengths = [(rows + mirrored) * targets, rows * targets, centres * (targets - samples)];
            for (coefficients, length) in [&group.own, &group.joint, &group.corrective].into_iter().zip(lengths) {
                check_length("coefficients of a group", coefficients.len(), length)?;
                if !coefficients.iter().all(|coefficient| coefficient.abs() <= limits::RBF_COEFFICIENT) {
                    return Err(InvalidGarment::GroupCoefficient(number));
                }
            }
            number += 1;
        }
    }
    match owned.iter().position(|&owned| !owned) {
        Some(driver) => Err(InvalidGarment::Ungrouped(driver)),
        None => Ok(()),
    }
}

/// A group's mirror is another group with the bones of the other side.
fn check_mirror(groups: &[Group], place: usize, number: usize) -> Result<(), InvalidGarment> {
    let Some(mirror) = groups[place].mirror.map(usize::from) else { return Ok(()) };
    let bones = |group: &Group| -> BTreeSet<Bone> { group.chain.iter().map(|joint| joint.bone).collect() };
    let other = groups.get(mirror).filter(|_| mirror != place);
    let of_other = other.map(|group| bones(group).into_iter().map(Bone::mirrored).collect());
    if of_other == Some(bones(&groups[place])) { Ok(()) } else { Err(InvalidGarment::GroupMirror(number)) }
}

/// How many poses between the samples a group has, whose chain is checked.
fn check_centres(group: &Group, number: usize) -> Result<usize, InvalidGarment> {
    let centres = group.centres.len() / group.chain.len();
    check_length("rotations between the samples", group.centres.len(), centres * group.chain.len())?;
    if group.centres.iter().any(skewed) {
        return Err(InvalidGarment::GroupCentre(number));
    }
    Ok(centres)
}

fn check_chain(group: &Group, number: usize, poses: &PoseTable) -> Result<(), InvalidGarment> {
    check_count("joints in a chain", group.chain.len(), 1, limits::CHAIN)?;
    let distinct: BTreeSet<Bone> = group.chain.iter().map(|joint| joint.bone).collect();
    let scale = |scale: f64| (0.0..=limits::RBF_WIDTH).contains(&scale);
    for (place, joint) in group.chain.iter().enumerate() {
        let sound = poses.bones.contains(&joint.bone)
            && joint.parent.is_none_or(|parent| usize::from(parent) < place)
            && (joint.axis.length() - 1.0).abs() <= 1e-6
            && scale(joint.swing)
            && scale(joint.twist);
        if distinct.len() != group.chain.len() || !sound {
            return Err(InvalidGarment::GroupChain(number));
        }
    }
    Ok(())
}

fn check_compression(data: &GarmentData) -> Result<(), InvalidGarment> {
    let Some(Compression { budget_m, targets, surface, .. }) = &data.compression else { return Ok(()) };
    let is_length = |length_m: f32| length_m.is_finite() && length_m >= 0.0;
    let is_loss =
        |loss: &Loss| is_length(loss.max_m) && is_length(loss.p99_m) && (0.0..=1.0).contains(&loss.above_half);
    let all = targets.iter().chain([surface]).all(is_loss);
    if all && is_length(*budget_m) && targets.len() == data.sample_count() {
        Ok(())
    } else {
        Err(InvalidGarment::Compression)
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
        check_length("left-out errors", left_out.len(), data.sample_count())?;
    }
    match fastest_rows.iter().chain(&nearest.rows).find(|&&row| usize::from(row) > data.sample_count()) {
        Some(&row) => Err(InvalidGarment::CertificateRow(row)),
        None => Ok(()),
    }
}

fn check_texts(data: &GarmentData) -> Result<(), InvalidGarment> {
    let id_char = |c: u8| matches!(c, b'a'..=b'z' | b'0'..=b'9' | b'_' | b'-');
    if !(1..=limits::NAME_BYTES).contains(&data.id.len()) || !data.id.bytes().all(id_char) {
        return Err(InvalidGarment::Id(data.id.clone()));
    }
    if !is_name(&data.name) {
        return Err(InvalidGarment::GarmentName);
    }
    check_names("part", data.mesh.parts.iter().map(|part| part.name.as_str()))?;
    let groups = data.rbf.iter().flat_map(|rbf| &rbf.layers).flat_map(|layer| &layer.groups);
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

pub(crate) fn is_name(text: &str) -> bool {
    (1..=limits::NAME_BYTES).contains(&text.len()) && !text.contains(char::is_control)
}

/// That there are neither too few elements nor too many.
pub(crate) fn check_count(what: &'static str, count: usize, min: usize, max: usize) -> Result<(), InvalidGarment> {
    if (min..=max).contains(&count) { Ok(()) } else { Err(InvalidGarment::Count { what, count, min, max }) }
}

/// That an array is as long as what it describes.
pub(crate) fn check_length(what: &'static str, length: usize, expected: usize) -> Result<(), InvalidGarment> {
    if length == expected { Ok(()) } else { Err(InvalidGarment::Length { what, length, expected }) }
}

/// The sum, which no number of a hostile pack makes overflow.
fn total(counts: impl Iterator<Item = u32>) -> usize {
    counts.fold(0, |sum: usize, count| sum.saturating_add(count as usize))
}

fn ascend<T: PartialOrd>(values: &[T]) -> bool {
    values.windows(2).all(|pair| pair[0] < pair[1])
}
