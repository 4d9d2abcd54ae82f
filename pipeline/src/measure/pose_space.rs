//! Poses that a wearer takes, for measuring a garment away from its samples: a fixed sequence, the same on every
//! machine, each as the kimono allows it. Knows rotations only, no vertex.
//!
//! Layers move independently: arms and legs each take a pose of their own. Half of a layer's poses lie between its samples: each limb,
//! independently, somewhere between two or three rows of the pose table (poses that the artist never made, as an app will
//! play them). A quarter turns all limbs by the same rows. The last quarter are made by hand, as angles with a few
//! degrees of variation: arms let down and swinging, hands before the belly, arms crossed before the chest, arms raised; legs
//! that stand, walk, climb stairs and sit. Joints that the table does not give stay at rest.

use crate::stages::numbers::Numbers;
use glam::Quat;
use kitsuke::arrays::GarmentData;
use kitsuke::garment::Garment;
use kitsuke::pose_blend::rbf::rows_of_layer;
use kitsuke::skeleton::{Bone, Pose};

/// Angles of a left arm, degrees, each with its variation to either side; the right arm mirrors them.
struct ArmFamily {
    /// Down from the T-pose; negative raises.
    down: (f32, f32),
    /// Forward, about the vertical.
    forward: (f32, f32),
    /// The elbow's bend.
    elbow: (f32, f32),
    /// The turn of the upper arm about itself, hands inward.
    inward: (f32, f32),
    /// How much lower the left arm hangs than the right one, so that crossed arms do not meet.
    apart: f32,
}

/// Angles of both legs, degrees, each with its variation to either side.
struct LegFamily {
    /// Both thighs, forward from the vertical; the one in front first. Left and right take turns.
    thighs: [(f32, f32); 2],
    /// Both knees' bends.
    knees: [(f32, f32); 2],
    /// Each thigh outward.
    outward: (f32, f32),
}

const LEG_FAMILIES: [LegFamily; 5] = [
    // Standing.
    LegFamily { thighs: [(0.0, 4.0); 2], knees: [(3.0, 3.0); 2], outward: (2.0, 3.0) },
    // Walking, twice as often as the rest.
    LegFamily { thighs: [(15.0, 10.0), (-7.0, 7.0)], knees: [(9.0, 7.0), (13.0, 10.0)], outward: (1.0, 2.0) },
    LegFamily { thighs: [(18.0, 12.0), (-5.0, 10.0)], knees: [(16.0, 14.0), (18.0, 16.0)], outward: (1.0, 2.0) },
    // Climbing.
    LegFamily { thighs: [(45.0, 25.0), (0.0, 6.0)], knees: [(55.0, 28.0), (5.0, 5.0)], outward: (1.0, 2.0) },
    // Sitting down.
    LegFamily { thighs: [(48.0, 38.0); 2], knees: [(58.0, 34.0); 2], outward: (4.0, 5.0) },
];

const ARM_FAMILIES: [ArmFamily; 5] = [
    // Let down, swinging.
    ArmFamily { down: (68.0, 8.0), forward: (5.0, 20.0), elbow: (15.0, 15.0), inward: (5.0, 10.0), apart: 0.0 },
    // Let down, one more than the other.
    ArmFamily { down: (50.0, 25.0), forward: (10.0, 15.0), elbow: (10.0, 10.0), inward: (0.0, 10.0), apart: 15.0 },
    // Hands before the belly.
    ArmFamily { down: (62.0, 6.0), forward: (18.0, 8.0), elbow: (78.0, 14.0), inward: (28.0, 10.0), apart: 4.0 },
    // Crossed before the chest.
    ArmFamily { down: (35.0, 8.0), forward: (62.0, 8.0), elbow: (60.0, 20.0), inward: (5.0, 10.0), apart: 16.0 },
    // Raised.
    ArmFamily { down: (-30.0, 20.0), forward: (15.0, 25.0), elbow: (25.0, 25.0), inward: (0.0, 15.0), apart: 0.0 },
];

/// The poses of a garment from number `first` on, `count` of them.
#[must_use]
pub fn poses(garment: &Garment, first: u64, count: usize) -> Vec<Pose> {
    (first..first + count as u64).map(|number| garment.limited(&pose(garment.data(), number)).pose).collect()
}

fn pose(data: &GarmentData, number: u64) -> Pose {
    let mut pose = Pose::REST;
    for layer in 0..data.layer_count() {
        let mut numbers = Numbers((number + ((layer as u64) << 32)).wrapping_mul(0xd134_2543_de82_ef95));
        // So that a layer's hand-made poses meet all kinds of the others'.
        let kind = if layer == 0 { number } else { numbers.next() };
        let rows = rows_of_layer(data, layer);
        let limbs = limbs(data, layer);
        match kind % 4 {
            0 | 2 => {
                for bones in limbs {
                    let rotations = between_rows(data, &rows, &mut numbers);
                    turn(&mut pose, data, &rotations, |bone| bones.contains(&bone));
                }
            }
            1 => {
                let rotations = between_rows(data, &rows, &mut numbers);
                turn(&mut pose, data, &rotations, |bone| limbs.iter().flatten().any(|&other| other == bone));
            }
            _ => {
                let family = (kind / 4) as usize;
                by_hand(&mut pose, |bone| limbs.iter().flatten().any(|&other| other == bone), family, &mut numbers);
            }
        }
    }
    pose
}

/// The joints of a layer's limbs: those of each group of the default kernel, or all together where there is none.
fn limbs(data: &GarmentData, layer: usize) -> Vec<Vec<Bone>> {
    match &data.rbf {
        Some(rbf) => {
            let groups = rbf.layers[layer].groups.iter();
            groups.map(|group| group.chain.iter().map(|joint| joint.bone).collect()).collect()
        }
        None => {
            let drivers = data.drivers.iter().filter(|driver| usize::from(driver.layer) == layer);
            vec![drivers.flat_map(|driver| driver.joints.iter().copied()).collect()]
        }
    }
}

/// Gives the pose the rotations of those bones of the pose table that are meant.
fn turn(pose: &mut Pose, data: &GarmentData, rotations: &[Quat], is_meant: impl Fn(Bone) -> bool) {
    for (&bone, &rotation) in data.poses.bones.iter().zip(rotations).filter(|(bone, _)| is_meant(**bone)) {
        pose.rotations[bone as usize] = rotation;
    }
}

/// The rotations of two or three of these rows, mixed.
fn between_rows(data: &GarmentData, rows: &[usize], numbers: &mut Numbers) -> Vec<Quat> {
    let mut mixed = data.poses.row(rows[numbers.below(rows.len())]).to_vec();
    for _ in 0..1 + numbers.below(2) {
        let (other, share) = (rows[numbers.below(rows.len())], numbers.between(0.0, 1.0));
        for (rotation, &end) in mixed.iter_mut().zip(data.poses.row(other)) {
            // The chord instead of the arc: no trigonometry, so the same on every machine.
            let end = if rotation.dot(end) < 0.0 { -end } else { end };
            *rotation = (*rotation * (1.0 - share) + end * share).normalize();
        }
    }
    mixed
}

fn by_hand(pose: &mut Pose, is_meant: impl Fn(Bone) -> bool, family: usize, numbers: &mut Numbers) {
    let arms = &ARM_FAMILIES[family % ARM_FAMILIES.len()];
    let legs = &LEG_FAMILIES[family % LEG_FAMILIES.len()];
    let leads = numbers.below(2);
    let mut turns = Vec::new();
    for (side, upper, lower) in
        [(1.0, Bone::LeftUpperArm, Bone::LeftLowerArm), (-1.0, Bone::RightUpperArm, Bone::RightLowerArm)]
    {
        let mut angle =
            |(middle, variation): (f32, f32)| (middle + numbers.between(-variation, variation)).to_radians() * side;
        let down = angle(arms.down) + arms.apart.to_radians() / 2.0;
        let forward = angle(arms.forward);
        let (elbow, inward) = (angle(arms.elbow), angle(arms.inward));
        turns.push((upper, about_y(-forward) * about_z(-down) * about_x(-inward * side)));
        turns.push((lower, about_y(-elbow)));
    }
    for (place, (side, upper, lower)) in
        [(1.0, Bone::LeftUpperLeg, Bone::LeftLowerLeg), (-1.0, Bone::RightUpperLeg, Bone::RightLowerLeg)]
            .into_iter()
            .enumerate()
    {
        let mut angle =
            |(middle, variation): (f32, f32)| (middle + numbers.between(-variation, variation)).to_radians();
        let in_front = (place + leads) % 2;
        let (forward, knee) = (angle(legs.thighs[in_front]), angle(legs.knees[in_front]));
        let outward = angle(legs.outward) * side;
        turns.push((upper, about_x(-forward) * about_z(outward)));
        turns.push((lower, about_x(knee)));
    }
    for (bone, rotation) in turns.into_iter().filter(|(bone, _)| is_meant(*bone)) {
        pose.rotations[bone as usize] = rotation;
    }
}

fn about_x(angle_rad: f32) -> Quat {
    Quat::from_xyzw(libm::sinf(angle_rad / 2.0), 0.0, 0.0, libm::cosf(angle_rad / 2.0))
}

fn about_y(angle_rad: f32) -> Quat {
    Quat::from_xyzw(0.0, libm::sinf(angle_rad / 2.0), 0.0, libm::cosf(angle_rad / 2.0))
}

fn about_z(angle_rad: f32) -> Quat {
    Quat::from_xyzw(0.0, 0.0, libm::sinf(angle_rad / 2.0), libm::cosf(angle_rad / 2.0))
}
