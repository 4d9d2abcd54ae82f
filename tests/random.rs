//! Random garments and poses, the same for the same seed.

use glam::{DVec3, Quat, Vec2, Vec3};
use kitsuke::arrays::{ChainJoint, Group, PoseBound, PoseLimit, Rbf, RbfLayer};
use kitsuke::arrays::{Driver, GarmentData, Mesh, Part, PoseTable, Segment, SkinWeights, Target};
use kitsuke::garment::Garment;
use kitsuke::skeleton::{Bone, Joint, Pose, Skeleton};

/// SplitMix64 (Steele, Lea and Flood 2014): one seed is one garment.
pub struct Numbers(pub u64);

impl Numbers {
    /// Any number.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In `0..end`.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    /// In -1..1.
    pub fn signed(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    /// Coordinates in -1..1.
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    /// Any rotation.
    pub fn rotation(&mut self) -> Quat {
        let q = Quat::from_xyzw(self.signed(), self.signed(), self.signed(), self.signed());
        if q.length() > 0.1 { q.normalize() } else { Quat::IDENTITY }
    }

    /// Any pose, its hips within a metre of rest.
    pub fn pose(&mut self) -> Pose {
        let mut pose = Pose { hips_translation_m: self.vector(), ..Pose::REST };
        pose.rotations.iter_mut().for_each(|rotation| *rotation = self.rotation());
        pose
    }
}

const BONES: [(Bone, Option<u8>); 7] = [
    (Bone::Hips, None),
    (Bone::Spine, Some(0)),
    (Bone::LeftUpperArm, Some(1)),
    (Bone::LeftLowerArm, Some(2)),
    (Bone::RightUpperArm, Some(1)),
    (Bone::RightLowerArm, Some(4)),
    (Bone::LeftUpperLeg, Some(0)),
];

/// A garment without sense but within the rules: any sharing of segments, masks, targets, parts, twins and weights.
#[must_use]
pub fn garment(seed: u64) -> Garment {
    let n = &mut Numbers(seed);
    let joints = BONES.map(|(bone, parent)| Joint { bone, parent, rest_m: n.vector() });
    let mut drivers: Vec<Driver> = (0..n.below(7))
        .map(|i| Driver {
            name: format!("driver{i}"),
            joints: BONES[i..=(i + n.below(3)).min(BONES.len() - 1)].iter().map(|&(bone, _)| bone).collect(),
            threshold_rad: 0.5 + 2.0 * (n.signed() + 1.0) / 2.0,
            layer: 0,
        })
        .collect();
    let layers = (1 + n.below(3)).min(drivers.len());
    drivers.iter_mut().enumerate().for_each(|(i, driver)| driver.layer = (i % layers.max(1)) as u8);
    let segments: Vec<Segment> = (0..1 + n.below(6))
        .map(|_| {
            let vertex_count = if n.below(4) == 0 { 500 + n.below(700) } else { 1 + n.below(40) };
            let covering: Vec<u8> = (0..drivers.len() as u8).filter(|_| n.below(2) == 0).collect();
            let whole = covering.len() == 1 && n.below(2) == 0;
            let rows = if whole { 0 } else { vertex_count };
            let masks = (0..rows)
                .flat_map(|_| covering.iter().map(|_| (n.below(65536) / covering.len()) as u16).collect::<Vec<_>>())
                .collect();
            Segment { vertex_count: vertex_count as u32, drivers: covering, masks }
        })
        .collect();
    let targets: Vec<Target> = (0..n.below(7))
        .map(|i| {
            let moved: Vec<u16> = (0..segments.len() as u16).filter(|_| n.below(3) > 0).collect();
            let count = moved.iter().map(|&s| segments[usize::from(s)].vertex_count as usize).sum();
            let deltas = (0..count).map(|_| [0; 3].map(|_: i16| n.bits() as i16)).collect();
            let layer = n.below(layers.max(1)) as u8;
            Target {
                name: format!("target{i}"),
                layer,
                step_m: 1e-6 + 1e-5 * n.signed().abs(),
                segments: moved,
                deltas,
            }
        })
        .collect();
    let unique = segments.iter().map(|segment| segment.vertex_count as usize).sum::<usize>();
    let twins = n.below(20);
    let triangles: Vec<[u32; 3]> =
        (0..1 + n.below(3 * unique)).map(|_| [0; 3].map(|_: u32| n.below(unique + twins) as u32)).collect();
    let in_first_part = n.below(triangles.len() + 1);
    let parts = [("first", in_first_part), ("片方", triangles.len() - in_first_part)];
    let mut source_vertex: Vec<u32> = (0..unique as u32).collect();
    (0..unique).for_each(|vertex| source_vertex.swap(vertex, n.below(unique)));
    let uv = (0..n.below(2) * (unique + twins)).map(|_| Vec2::new(n.signed(), 1e-30 * n.signed())).collect();
    let bones: Vec<Bone> = BONES.iter().map(|&(bone, _)| bone).collect();
    let corrective_count = n.below(targets.len() + 1) / 2;
    Garment::new(GarmentData {
        id: "random".to_owned(),
        name: "適当".to_owned(),
        skeleton: Skeleton::new(joints.to_vec()).expect("joints in order"),
        mesh: Mesh {
            positions_m: (0..unique).map(|_| n.vector()).collect(),
            uv,
            twin_of: (0..twins).map(|_| n.below(unique) as u32).collect(),
            triangles,
            parts: parts.map(|(name, count)| Part { name: name.to_owned(), triangle_count: count as u32 }).to_vec(),
            source_vertex,
        },
        skin: (0..unique)
            .map(|_| {
                let joints = [0; 4].map(|_: u8| n.below(BONES.len()) as u8);
                let first = n.below(65536) as u16;
                let second = n.below(65536 - usize::from(first)) as u16;
                let weights = match n.below(3) {
                    0 => [65535, 0, 0, 0],
                    1 => [first, 65535 - first, 0, 0],
                    _ => [first, 0, second, 65535 - first - second],
                };
                SkinWeights { joints, weights }
            })
            .collect(),
        poses: PoseTable {
            rotations: (0..(targets.len() - corrective_count + 1) * bones.len())
                .map(|i| if i < bones.len() { Quat::IDENTITY } else { Quat::IDENTITY.slerp(n.rotation(), 0.4) })
                .map(|rotation| rotation * 1.0005)
                .collect(),
            bones,
        },
        pose_limits: (0..n.below(3))
            .map(|_| {
                let bones: Vec<Bone> = BONES[n.below(3)..4 + n.below(4)].iter().map(|&(bone, _)| bone).collect();
                let bounds = (0..n.below(9)).map(|_| {
                    let normal: Vec<f32> = (0..3 * bones.len()).map(|_| n.signed() + 1e-3).collect();
                    let length = normal.iter().map(|x| x * x).sum::<f32>().sqrt();
                    let normal = normal.iter().map(|x| x / length).collect();
                    PoseBound { normal, most_rad: n.signed().abs() }
                });
                PoseLimit { bounds: bounds.collect(), margin_rad: 0.01 + n.signed().abs(), bones }
            })
            .collect(),
        rbf: None,
        certificate: None,
        compression: None,
        drivers,
        segments,
        targets,
        corrective_count,
    })
    .expect("random garments keep the rules")
}

/// The same garment with a default kernel of any coefficients: one group per driver.
#[must_use]
pub fn with_rbf(garment: &Garment, n: &mut Numbers) -> Garment {
    let mut data = garment.data().clone();
    let layers = (0..data.layer_count()).map(|layer| {
        let targets = data.targets_of_layer(layer).count();
        let samples = data.targets_of_layer(layer).filter(|&target| target < data.sample_count()).count();
        let centres = n.below(4);
        let of_layer: Vec<usize> =
            (0..data.drivers.len()).filter(|&driver| usize::from(data.drivers[driver].layer) == layer).collect();
        let groups = of_layer.iter().map(|&driver| {
            let is_mirror = |&other: &usize| other != driver && BONES[other].0 == BONES[driver].0.mirrored();
            let mirror = of_layer.iter().position(is_mirror);
            let mirror = mirror.filter(|_| n.below(2) == 0);
            let mut coefficients = |count: usize| (0..count).map(|_| f64::from(n.signed())).collect::<Vec<_>>();
            Group {
                name: format!("group {driver}"),
                drivers: vec![driver as u8],
                chain: vec![ChainJoint {
                    bone: BONES[driver].0,
                    parent: None,
                    is_carried: false,
                    axis: DVec3::X,
                    swing: 1.0,
                    twist: 0.5,
                }],
                mirror: mirror.map(|mirror| mirror as u8),
                own: coefficients((samples + 1 + mirror.map_or(0, |_| samples)) * targets),
                joint: coefficients((samples + 1) * targets),
                corrective: coefficients(centres * (targets - samples)),
                centres: (0..centres).map(|_| n.rotation()).collect(),
            }
        });
        RbfLayer { groups: groups.collect(), joint_width: 1.0, reach: 2.0, ridge: 0.01, mirror_ridge: 0.1 }
    });
    let layers: Vec<_> = layers.collect();
    data.rbf = (!layers.is_empty()).then_some(Rbf { layers });
    Garment::new(data).expect("random garments keep the rules")
}
