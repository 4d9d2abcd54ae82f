//! A synthetic motion of a whole body, and the same written as each input would send or store it. Writers are plain and
//! independent of the readers; they know the formats from their specifications alone.

use glam::{Affine3A, DQuat, DVec3, EulerRot, Quat, Vec3};
use kitsuke::skeleton::positions::Layout;
use kitsuke::skeleton::{Bone, Joint, Pose, Skeleton};
use std::fmt::Write;

/// A woman of 154 cm in the T-pose.
#[must_use]
pub fn wearer() -> Skeleton {
    let joints: [(Bone, [f32; 3]); 20] = [
        (Bone::Hips, [0.0, 0.798, -0.067]),
        (Bone::Spine, [0.0, 0.807, 0.019]),
        (Bone::Chest, [0.0, 0.939, -0.004]),
        (Bone::UpperChest, [0.0, 1.155, 0.009]),
        (Bone::Neck, [0.0, 1.3, 0.0]),
        (Bone::Head, [0.0, 1.402, 0.042]),
        (Bone::LeftShoulder, [0.022, 1.232, 0.016]),
        (Bone::LeftUpperArm, [0.151, 1.222, 0.02]),
        (Bone::LeftLowerArm, [0.392, 1.222, 0.02]),
        (Bone::LeftHand, [0.587, 1.222, 0.024]),
        (Bone::RightShoulder, [-0.022, 1.232, 0.016]),
        (Bone::RightUpperArm, [-0.151, 1.222, 0.02]),
        (Bone::RightLowerArm, [-0.392, 1.222, 0.02]),
        (Bone::RightHand, [-0.587, 1.222, 0.024]),
        (Bone::LeftUpperLeg, [0.094, 0.796, 0.015]),
        (Bone::LeftLowerLeg, [0.077, 0.456, 0.046]),
        (Bone::LeftFoot, [0.045, 0.071, 0.015]),
        (Bone::RightUpperLeg, [-0.094, 0.796, 0.015]),
        (Bone::RightLowerLeg, [-0.077, 0.456, 0.046]),
        (Bone::RightFoot, [-0.045, 0.071, 0.015]),
    ];
    let index = |bone| joints.iter().position(|&(listed, _)| listed == bone).map(|i| i as u8);
    let joint = |&(bone, rest_m): &(Bone, [f32; 3])| Joint {
        bone,
        parent: bone.vrm_parent().and_then(index),
        rest_m: Vec3::from_array(rest_m),
    };
    Skeleton::new(joints.iter().map(joint).collect()).expect("the wearer is a skeleton")
}

/// Upper and lower arms and legs: what every input tells.
pub const LIMBS: [Bone; 8] = [
    Bone::LeftUpperArm,
    Bone::LeftLowerArm,
    Bone::RightUpperArm,
    Bone::RightLowerArm,
    Bone::LeftUpperLeg,
    Bone::LeftLowerLeg,
    Bone::RightUpperLeg,
    Bone::RightLowerLeg,
];

/// Seconds from one pose of [`dance`] to the next.
pub const DANCE_FRAME_S: f64 = 1.0 / 60.0;

/// Four seconds of everything moving. Elbows and knees bend as hinges, by 25° and more; the spine bends as one.
#[must_use]
pub fn dance() -> Vec<Pose> {
    (0..240).map(|frame| dance_pose(f64::from(frame) * DANCE_FRAME_S)).collect()
}

fn dance_pose(time_s: f64) -> Pose {
    let wave = |hz: f64, phase: f64, low_deg: f64, high_deg: f64| {
        let share = 0.5 + 0.5 * libm::sin(std::f64::consts::TAU * hz * time_s + phase);
        (low_deg + share * (high_deg - low_deg)).to_radians()
    };
    let euler = |x: f64, y: f64, z: f64| DQuat::from_euler(EulerRot::YZX, y, z, x);
    let spine = euler(wave(0.3, 1.0, -3.0, 9.0), wave(0.25, 0.0, -9.0, 9.0), wave(0.4, 2.0, -4.0, 4.0));
    let rotations = [
        (Bone::Hips, euler(wave(0.5, 0.0, -4.0, 4.0), wave(0.25, 0.7, -60.0, 60.0), wave(0.7, 0.0, -5.0, 5.0))),
        (Bone::Spine, spine),
        (Bone::Chest, spine),
        (Bone::UpperChest, spine),
        (Bone::Neck, euler(wave(0.4, 0.0, -10.0, 10.0), wave(0.5, 0.0, -20.0, 20.0), 0.0)),
        (Bone::Head, euler(wave(0.6, 0.0, -10.0, 10.0), wave(0.5, 1.0, -20.0, 20.0), 0.0)),
        (
            Bone::LeftUpperArm,
            euler(wave(0.5, 0.3, -40.0, 40.0), wave(0.4, 0.0, -70.0, 20.0), wave(0.6, 0.0, -80.0, 70.0)),
        ),
        (
            Bone::RightUpperArm,
            euler(wave(0.5, 2.0, -40.0, 40.0), wave(0.4, 1.0, -20.0, 70.0), wave(0.6, 1.0, -70.0, 80.0)),
        ),
        (Bone::LeftLowerArm, DQuat::from_rotation_y(-wave(0.7, 0.0, 25.0, 120.0))),
        (Bone::RightLowerArm, DQuat::from_rotation_y(wave(0.7, 1.5, 25.0, 120.0))),
        (Bone::LeftHand, euler(wave(0.5, 0.0, -60.0, 60.0), 0.0, wave(0.9, 0.0, -40.0, 40.0))),
        (Bone::RightHand, euler(wave(0.5, 2.0, -60.0, 60.0), 0.0, wave(0.9, 2.0, -40.0, 40.0))),
        (
            Bone::LeftUpperLeg,
            euler(wave(0.5, 0.0, -50.0, 15.0), wave(0.5, 0.0, -10.0, 20.0), wave(0.5, 0.0, -3.0, 10.0)),
        ),
        (
            Bone::RightUpperLeg,
            euler(wave(0.5, 3.1, -50.0, 15.0), wave(0.5, 3.0, -20.0, 10.0), wave(0.5, 3.0, -10.0, 3.0)),
        ),
        (Bone::LeftLowerLeg, DQuat::from_rotation_x(wave(0.5, 1.0, 25.0, 70.0))),
        (Bone::RightLowerLeg, DQuat::from_rotation_x(wave(0.5, 4.1, 25.0, 70.0))),
        (Bone::LeftFoot, DQuat::from_rotation_x(wave(0.5, 1.0, -20.0, 20.0))),
        (Bone::RightFoot, DQuat::from_rotation_x(wave(0.5, 4.0, -20.0, 20.0))),
    ];
    let hips_m = Vec3::new(0.1 * time_s as f32, 0.02 * wave(1.0, 0.0, -30.0, 30.0) as f32, 0.2 * time_s as f32);
    let pose = Pose { hips_translation_m: hips_m, ..Pose::REST };
    rotations.into_iter().fold(pose, |pose, (bone, rotation)| pose.with(bone, rotation.as_quat()))
}

/// World positions of the wearer's joints, and where a point that rests somewhere on a bone has gone, metres.
pub struct Posed<'a> {
    skeleton: &'a Skeleton,
    posed_from_rest: Vec<Affine3A>,
}

impl Posed<'_> {
    /// The wearer in a pose.
    #[must_use]
    pub fn new<'a>(skeleton: &'a Skeleton, pose: &Pose) -> Posed<'a> {
        let mut posed_from_rest = vec![Affine3A::IDENTITY; skeleton.joints().len()];
        skeleton.posed_from_rest(pose, &mut posed_from_rest);
        Posed { skeleton, posed_from_rest }
    }

    /// A point that moves with a bone, from its place at rest.
    #[must_use]
    pub fn point(&self, bone: Bone, rest_m: Vec3) -> DVec3 {
        let joint = self.skeleton.index_of(bone).expect("the wearer has the bone");
        self.posed_from_rest[joint].transform_point3(rest_m).as_dvec3()
    }

    /// A bone's joint.
    #[must_use]
    pub fn joint(&self, bone: Bone) -> DVec3 {
        self.point(bone, self.skeleton.rest_m(bone).expect("the wearer has the bone"))
    }

    /// World rotation of a bone.
    #[must_use]
    pub fn rotation(&self, bone: Bone) -> Quat {
        let joint = self.skeleton.index_of(bone).expect("the wearer has the bone");
        Quat::from_mat3a(&self.posed_from_rest[joint].matrix3)
    }
}

/// The angle between two rotations, degrees.
#[must_use]
pub fn apart_deg(a: Quat, b: Quat) -> f64 {
    let between = a.as_dquat().normalize().inverse() * b.as_dquat().normalize();
    2.0 * libm::atan2(between.xyz().length(), between.w.abs()).to_degrees()
}

/// A motion as BVH in centimetres, rotations in this order, `channels` their names.
#[must_use]
pub fn bvh(wearer: &Skeleton, poses: &[Pose], order: EulerRot, channels: [char; 3]) -> String {
    let mut text = "HIERARCHY\n".to_owned();
    let names = channels.map(|axis| format!("{axis}rotation")).join(" ");
    let mut listed = Vec::new();
    write_joint(&mut text, wearer, 0, &names, &mut listed);
    _ = write!(text, "MOTION\nFrames: {}\nFrame Time: {DANCE_FRAME_S:.10}\n", poses.len());
    for pose in poses {
        let hips_m = wearer.joints()[0].rest_m + pose.hips_translation_m;
        _ = write!(text, "{} {} {}", hips_m.x * 100.0, hips_m.y * 100.0, hips_m.z * 100.0);
        for &joint in &listed {
            let (a, b, c) = pose.rotation(wearer.joints()[joint].bone).as_dquat().normalize().to_euler(order);
            _ = write!(text, " {:.8} {:.8} {:.8}", a.to_degrees(), b.to_degrees(), c.to_degrees());
        }
        text.push('\n');
    }
    text
}

fn write_joint(text: &mut String, wearer: &Skeleton, joint: usize, channels: &str, listed: &mut Vec<usize>) {
    listed.push(joint);
    let own = wearer.joints()[joint];
    let from_m = own.parent.map_or(Vec3::ZERO, |parent| wearer.joints()[usize::from(parent)].rest_m);
    let offset = (own.rest_m - from_m) * 100.0;
    let (kind, count, position) = match own.parent {
        None => ("ROOT", 6, "Xposition Yposition Zposition "),
        Some(_) => ("JOINT", 3, ""),
    };
    _ = writeln!(text, "{kind} {}\n{{\nOFFSET {} {} {}", own.bone.name(), offset.x, offset.y, offset.z);
    _ = writeln!(text, "CHANNELS {count} {position}{channels}");
    let children = (0..wearer.joints().len()).filter(|&j| wearer.joints()[j].parent == Some(joint as u8));
    let children: Vec<usize> = children.collect();
    if children.is_empty() {
        text.push_str("End Site\n{\nOFFSET 0 0 5\n}\n");
    }
    for child in children {
        write_joint(text, wearer, child, channels, listed);
    }
    text.push_str("}\n");
}

/// How another program would write a motion as BVH.
#[derive(Clone)]
pub struct Rigged<'a> {
    /// World rotations of the joints' own axes in the T-pose, in the wearer's axes; the OFFSETs are seen from them.
    pub rest: Vec<DQuat>,
    /// The file's world from the wearer's.
    pub world: DQuat,
    /// The file's units per metre.
    pub units: f64,
    /// The order of rotations and its channels.
    pub order: (EulerRot, [char; 3]),
    /// What stands before every name.
    pub prefix: &'a str,
    /// A root above the hips that stands still, turned like this; then the hips have position channels.
    pub reference: Option<DQuat>,
    /// Every joint has position channels, and OFFSETs say nothing.
    pub places_everywhere: bool,
}

impl Rigged<'_> {
    /// A rig with such axes, centimetres, Y up.
    #[must_use]
    pub fn new(rest: Vec<DQuat>) -> Rigged<'static> {
        Rigged {
            rest,
            world: DQuat::IDENTITY,
            units: 100.0,
            order: (EulerRot::ZXY, ['Z', 'X', 'Y']),
            prefix: "",
            reference: None,
            places_everywhere: false,
        }
    }

    /// Joints from ROOT on, and the numbers of each frame.
    #[must_use]
    pub fn skeleton(&self, wearer: &Skeleton, poses: &[Pose]) -> (String, Vec<String>) {
        let rotations = self.order.1.map(|axis| format!("{axis}rotation")).join(" ");
        let places = "Xposition Yposition Zposition";
        let above = self.reference.unwrap_or(DQuat::IDENTITY);
        let mut text = String::new();
        let mut listed = Vec::new();
        if self.reference.is_some() {
            _ = write!(text, "ROOT {}Reference\n{{\nOFFSET 0 0 0\nCHANNELS 6 {places} {rotations}\n", self.prefix);
        }
        self.joint(&mut text, wearer, 0, [places, &rotations], &mut listed);
        if self.reference.is_some() {
            text.push_str("}\n");
        }
        let turn = |rotation: DQuat| {
            let (a, b, c) = rotation.normalize().to_euler(self.order.0);
            format!("{:.8} {:.8} {:.8}", a.to_degrees(), b.to_degrees(), c.to_degrees())
        };
        let place = |place: DVec3| format!("{:.7} {:.7} {:.7}", place.x, place.y, place.z);
        let frames = poses.iter().map(|pose| {
            let raw = raw_rotations(wearer, &self.rest, pose);
            let mut numbers = Vec::new();
            if let Some(reference) = self.reference {
                numbers.extend([place(DVec3::ZERO), turn(reference)]);
            }
            for &joint in &listed {
                if joint == 0 {
                    let hips_m = (wearer.joints()[0].rest_m + pose.hips_translation_m).as_dvec3();
                    numbers.push(place(above.inverse() * self.world * hips_m * self.units));
                    numbers.push(turn(above.inverse() * self.world * raw[0]));
                } else {
                    if self.places_everywhere {
                        numbers.push(place(self.offset(wearer, joint)));
                    }
                    numbers.push(turn(raw[joint]));
                }
            }
            numbers.join(" ")
        });
        (text, frames.collect())
    }

    /// The whole file.
    #[must_use]
    pub fn bvh(&self, wearer: &Skeleton, poses: &[Pose]) -> String {
        let (joints, frames) = self.skeleton(wearer, poses);
        bvh_file(&[joints], &[frames])
    }

    fn offset(&self, wearer: &Skeleton, joint: usize) -> DVec3 {
        let parent = wearer.joints()[joint].parent.map(usize::from);
        parent.map_or(DVec3::ZERO, |parent| {
            let along_m = wearer.joints()[joint].rest_m - wearer.joints()[parent].rest_m;
            self.rest[parent].inverse() * along_m.as_dvec3() * self.units
        })
    }

    fn joint(&self, text: &mut String, wearer: &Skeleton, joint: usize, channels: [&str; 2], listed: &mut Vec<usize>) {
        listed.push(joint);
        let offset = if self.places_everywhere { DVec3::Y } else { self.offset(wearer, joint) };
        let kind = if joint == 0 && self.reference.is_none() { "ROOT" } else { "JOINT" };
        let [places, rotations] = channels;
        let channels_own = if joint == 0 || self.places_everywhere {
            format!("6 {places} {rotations}")
        } else {
            format!("3 {rotations}")
        };
        let name = wearer.joints()[joint].bone.name();
        _ = writeln!(text, "{kind} {}{name}\n{{\nOFFSET {:.7} {:.7} {:.7}", self.prefix, offset.x, offset.y, offset.z);
        _ = writeln!(text, "CHANNELS {channels_own}");
        let children = (0..wearer.joints().len()).filter(|&j| wearer.joints()[j].parent == Some(joint as u8));
        for child in children {
            self.joint(text, wearer, child, channels, listed);
        }
        text.push_str("}\n");
    }
}

/// Skeletons and their frames, side by side, as one BVH file.
#[must_use]
pub fn bvh_file(skeletons: &[String], frames: &[Vec<String>]) -> String {
    let count = frames[0].len();
    let mut text =
        format!("HIERARCHY\n{}MOTION\nFrames: {count}\nFrame Time: {DANCE_FRAME_S:.10}\n", skeletons.concat());
    for frame in 0..count {
        let numbers: Vec<&str> = frames.iter().map(|frames| frames[frame].as_str()).collect();
        _ = writeln!(text, "{}", numbers.join(" "));
    }
    text
}

/// Joint axes of a rig whose bones all lie along one axis of their own, twisted about it by this angle times the joint's
/// number.
#[must_use]
pub fn bones_along(wearer: &Skeleton, axis: DVec3, twist_rad: f64) -> Vec<DQuat> {
    let joints = wearer.joints();
    let rest = |(i, joint): (usize, &Joint)| {
        // The hips bear the trunk: of several children the middle one; an end continues the bone above it.
        let children =
            joints.iter().filter(|child| child.parent == Some(i as u8)).map(|child| child.rest_m - joint.rest_m);
        let middle = children.min_by(|a, b| a.x.abs().total_cmp(&b.x.abs()));
        let above = joint.parent.map_or(Vec3::Y, |parent| joint.rest_m - joints[usize::from(parent)].rest_m);
        let along = middle.unwrap_or(above).as_dvec3().normalize();
        DQuat::from_rotation_arc(axis, along) * DQuat::from_axis_angle(axis, twist_rad * i as f64)
    };
    joints.iter().enumerate().map(rest).collect()
}

/// A rest rotation of some kind for each joint, as rigs have them.
#[must_use]
pub fn odd_rest(wearer: &Skeleton) -> Vec<DQuat> {
    let odd = |i: usize| {
        let i = i as f64;
        DQuat::from_euler(EulerRot::XYZ, 0.7 * i, 1.3 * i + 0.5, -0.4 * i)
    };
    (0..wearer.joints().len()).map(odd).collect()
}

/// Local rotations of a rig with such world rest rotations in a pose, by joint.
#[must_use]
pub fn raw_rotations(wearer: &Skeleton, rest: &[DQuat], pose: &Pose) -> Vec<DQuat> {
    let raw = |(i, joint): (usize, &Joint)| {
        let above = joint.parent.map_or(DQuat::IDENTITY, |parent| rest[usize::from(parent)]);
        // A world turn of the bone on top of its rest, seen from the bone above.
        above.inverse() * pose.rotation(joint.bone).as_dquat().normalize() * rest[i]
    };
    wearer.joints().iter().enumerate().map(raw).collect()
}

/// A motion as binary glTF with the extension `VRMC_vrm_animation`, on a rig with these world rest rotations.
#[must_use]
pub fn vrma(wearer: &Skeleton, poses: &[Pose], rest: &[DQuat]) -> Vec<u8> {
    let mut binary: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut channels, mut samplers) = (vec![], vec![], vec![], vec![]);
    let mut add = |numbers: &[f32], kind: &str, count: usize| {
        views.push(serde_json::json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": numbers.len() * 4}));
        binary.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        accessors.push(serde_json::json!({
            "bufferView": views.len() - 1, "componentType": 5126, "count": count, "type": kind,
        }));
        accessors.len() - 1
    };
    let count = poses.len();
    let times: Vec<f32> = (0..count).map(|frame| (frame as f64 * DANCE_FRAME_S) as f32).collect();
    let input = add(&times, "SCALAR", count);
    let raw: Vec<Vec<DQuat>> = poses.iter().map(|pose| raw_rotations(wearer, rest, pose)).collect();
    let (mut nodes, mut bones) = (vec![], serde_json::Map::new());
    let resting = raw_rotations(wearer, rest, &Pose::REST);
    for (i, joint) in wearer.joints().iter().enumerate() {
        let from_m = joint.parent.map_or(Vec3::ZERO, |parent| wearer.joints()[usize::from(parent)].rest_m);
        let above = joint.parent.map_or(DQuat::IDENTITY, |parent| rest[usize::from(parent)]);
        let offset = above.inverse() * (joint.rest_m - from_m).as_dvec3();
        let children: Vec<usize> =
            (0..wearer.joints().len()).filter(|&j| wearer.joints()[j].parent == Some(i as u8)).collect();
        let mut node = serde_json::json!({"translation": offset.to_array(), "rotation": resting[i].to_array()});
        if !children.is_empty() {
            node["children"] = children.into();
        }
        nodes.push(node);
        bones.insert(joint.bone.name().to_owned(), serde_json::json!({"node": i}));
        let keys: Vec<f32> = raw.iter().flat_map(|raw| raw[i].to_array().map(|number| number as f32)).collect();
        samplers.push(serde_json::json!({"input": input, "output": add(&keys, "VEC4", count)}));
        channels.push(serde_json::json!({"sampler": i, "target": {"node": i, "path": "rotation"}}));
    }
    let places = poses.iter().flat_map(|pose| (wearer.joints()[0].rest_m + pose.hips_translation_m).to_array());
    let places: Vec<f32> = places.collect();
    samplers.push(serde_json::json!({"input": input, "output": add(&places, "VEC3", count)}));
    channels.push(serde_json::json!({"sampler": samplers.len() - 1, "target": {"node": 0, "path": "translation"}}));
    let document = serde_json::json!({
        "asset": {"version": "2.0"}, "nodes": nodes, "buffers": [{"byteLength": binary.len()}],
        "bufferViews": views, "accessors": accessors,
        "animations": [{"channels": channels, "samplers": samplers}],
        "extensionsUsed": ["VRMC_vrm_animation"],
        "extensions": {"VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}},
    });
    glb(&document, &binary)
}

/// Binary glTF.
#[must_use]
pub fn glb(document: &serde_json::Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// What a camera with this layout would see of a posed wearer who faces it: x, y, z in the layout's axes and units, or
/// nothing where the layout's joint is none that the wearer has.
#[must_use]
pub fn positions(layout: Layout, posed: &Posed<'_>) -> Vec<Option<[f64; 3]>> {
    use Bone::*;
    let joint = |bone| posed.joint(bone);
    let mid = |a, b| 0.5 * (joint(a) + joint(b));
    let hips = mid(LeftUpperLeg, RightUpperLeg);
    let on = |bone: Bone, offset: [f32; 3]| {
        posed.point(bone, posed.skeleton.rest_m(bone).expect("a bone of the wearer") + Vec3::from_array(offset))
    };
    let toes = |bone| on(bone, [0.0, -0.06, 0.12]);
    let chest_up = |up: f32| on(UpperChest, [0.0, up, 0.0]);
    let spine = on(Hips, [0.0, 0.3, 0.082]);
    let places: Vec<(usize, DVec3)> = match layout {
        Layout::MediaPipe33 => vec![
            (0, on(Head, [0.0, 0.05, 0.1])),
            (7, on(Head, [0.07, 0.05, 0.0])),
            (8, on(Head, [-0.07, 0.05, 0.0])),
            (11, joint(LeftUpperArm)),
            (12, joint(RightUpperArm)),
            (13, joint(LeftLowerArm)),
            (14, joint(RightLowerArm)),
            (15, joint(LeftHand)),
            (16, joint(RightHand)),
            (17, on(LeftHand, [0.08, 0.0, -0.03])),
            (18, on(RightHand, [-0.08, 0.0, -0.03])),
            (19, on(LeftHand, [0.08, 0.0, 0.03])),
            (20, on(RightHand, [-0.08, 0.0, 0.03])),
            (23, joint(LeftUpperLeg)),
            (24, joint(RightUpperLeg)),
            (25, joint(LeftLowerLeg)),
            (26, joint(RightLowerLeg)),
            (27, joint(LeftFoot)),
            (28, joint(RightFoot)),
            (31, toes(LeftFoot)),
            (32, toes(RightFoot)),
        ],
        Layout::Kinect20 | Layout::Kinect25 => vec![
            (0, on(Hips, [0.0, -0.002, 0.082])),
            (1, spine),
            (2, chest_up(0.15)),
            (3, on(Head, [0.0, 0.1, 0.0])),
            (4, joint(LeftUpperArm)),
            (5, joint(LeftLowerArm)),
            (6, joint(LeftHand)),
            (7, on(LeftHand, [0.08, 0.0, 0.0])),
            (8, joint(RightUpperArm)),
            (9, joint(RightLowerArm)),
            (10, joint(RightHand)),
            (11, on(RightHand, [-0.08, 0.0, 0.0])),
            (12, joint(LeftUpperLeg)),
            (13, joint(LeftLowerLeg)),
            (14, joint(LeftFoot)),
            (15, toes(LeftFoot)),
            (16, joint(RightUpperLeg)),
            (17, joint(RightLowerLeg)),
            (18, joint(RightFoot)),
            (19, toes(RightFoot)),
        ],
        Layout::Azure32 => vec![
            (0, on(Hips, [0.0, -0.002, 0.082])),
            (1, spine),
            (3, chest_up(0.15)),
            (5, joint(LeftUpperArm)),
            (6, joint(LeftLowerArm)),
            (7, joint(LeftHand)),
            (8, on(LeftHand, [0.08, 0.0, 0.0])),
            (12, joint(RightUpperArm)),
            (13, joint(RightLowerArm)),
            (14, joint(RightHand)),
            (15, on(RightHand, [-0.08, 0.0, 0.0])),
            (18, joint(LeftUpperLeg)),
            (19, joint(LeftLowerLeg)),
            (20, joint(LeftFoot)),
            (21, toes(LeftFoot)),
            (22, joint(RightUpperLeg)),
            (23, joint(RightLowerLeg)),
            (24, joint(RightFoot)),
            (25, toes(RightFoot)),
            (26, on(Head, [0.0, 0.1, 0.0])),
        ],
    };
    let mut listed = vec![None; layout.joint_count()];
    for (index, at) in places {
        let seen = match layout {
            Layout::MediaPipe33 => {
                let at = at - hips;
                [at.x, -at.y, -at.z]
            }
            // The sensor hangs 1 m high, 3 m in front.
            Layout::Kinect20 | Layout::Kinect25 => [-at.x, at.y - 1.0, 3.0 - at.z],
            Layout::Azure32 => [at.x, 1.0 - at.y, 3.0 - at.z].map(|metres| metres * 1000.0),
        };
        listed[index] = Some(seen);
    }
    listed
}
