//! Poses that a wearer takes, for measuring a garment away from its samples: a fixed sequence, the same on every
//! machine. Knows rotations only, no vertex.
//!
//! Half of the poses lie between samples: each arm, independently, somewhere between two or three rows of the pose
//! table (poses that the artist never made, as an app will play them). A quarter turns both arms by the same rows. The
//! last quarter are made by hand, as angles with a few degrees of variation: arms let down and swinging, hands
//! before the belly, arms crossed before the chest, arms raised. Joints that the table does not give stay at rest.

use glam::Quat;
use kitsuke::arrays::PoseTable;
use kitsuke::skeleton::{Bone, Pose};

/// Angles of a left arm, degrees, each with its variation to either side; the right arm mirrors them.
struct Family {
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

const FAMILIES: [Family; 5] = [
    // Let down, swinging.
    Family { down: (68.0, 8.0), forward: (5.0, 20.0), elbow: (15.0, 15.0), inward: (5.0, 10.0), apart: 0.0 },
    // Let down, one more than the other.
    Family { down: (50.0, 25.0), forward: (10.0, 15.0), elbow: (10.0, 10.0), inward: (0.0, 10.0), apart: 15.0 },
    // Hands before the belly.
    Family { down: (62.0, 6.0), forward: (18.0, 8.0), elbow: (78.0, 14.0), inward: (28.0, 10.0), apart: 4.0 },
    // Crossed before the chest.
    Family { down: (35.0, 8.0), forward: (62.0, 8.0), elbow: (60.0, 20.0), inward: (5.0, 10.0), apart: 16.0 },
    // Raised.
    Family { down: (-30.0, 20.0), forward: (15.0, 25.0), elbow: (25.0, 25.0), inward: (0.0, 15.0), apart: 0.0 },
];

/// The first `count` poses.
#[must_use]
pub fn poses(table: &PoseTable, count: usize) -> Vec<Pose> {
    (0..count as u64).map(|number| pose(table, number)).collect()
}

fn pose(table: &PoseTable, number: u64) -> Pose {
    let mut numbers = Numbers(number.wrapping_mul(0xd134_2543_de82_ef95));
    match number % 4 {
        0 | 2 => {
            let left = between_rows(table, &mut numbers);
            let right = between_rows(table, &mut numbers);
            let is_left = |bone: Bone| bone.name().starts_with("left");
            let mixed = table.bones.iter().zip(left.iter().zip(right));
            mixed.fold(Pose::REST, |pose, (&b, (&l, r))| pose.with(b, if is_left(b) { l } else { r }))
        }
        1 => {
            let rotations = between_rows(table, &mut numbers);
            table.bones.iter().zip(rotations).fold(Pose::REST, |pose, (&b, rotation)| pose.with(b, rotation))
        }
        _ => by_hand(table, &FAMILIES[(number / 4) as usize % FAMILIES.len()], &mut numbers),
    }
}

/// The rotations of two or three rows, mixed.
fn between_rows(table: &PoseTable, numbers: &mut Numbers) -> Vec<Quat> {
    let rows = table.rows();
    let mut mixed = table.row(numbers.below(rows)).to_vec();
    for _ in 0..1 + numbers.below(2) {
        let (other, share) = (numbers.below(rows), numbers.between(0.0, 1.0));
        for (rotation, &end) in mixed.iter_mut().zip(table.row(other)) {
            // The chord instead of the arc: no trigonometry, so the same on every machine.
            let end = if rotation.dot(end) < 0.0 { -end } else { end };
            *rotation = (*rotation * (1.0 - share) + end * share).normalize();
        }
    }
    mixed
}

fn by_hand(table: &PoseTable, family: &Family, numbers: &mut Numbers) -> Pose {
    let mut pose = Pose::REST;
    for (side, upper, lower) in
        [(1.0, Bone::LeftUpperArm, Bone::LeftLowerArm), (-1.0, Bone::RightUpperArm, Bone::RightLowerArm)]
    {
        let mut angle =
            |(middle, variation): (f32, f32)| (middle + numbers.between(-variation, variation)).to_radians() * side;
        let down = angle(family.down) + family.apart.to_radians() / 2.0;
        let forward = angle(family.forward);
        let (elbow, inward) = (angle(family.elbow), angle(family.inward));
        let turns = [(upper, about_y(-forward) * about_z(-down) * about_x(-inward * side)), (lower, about_y(-elbow))];
        for (bone, rotation) in turns {
            if table.bones.contains(&bone) {
                pose = pose.with(bone, rotation);
            }
        }
    }
    pose
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

/// SplitMix64 (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators, 2014).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    fn between(&mut self, least: f32, most: f32) -> f32 {
        least + (most - least) * ((self.next() >> 40) as f32 / (1u64 << 24) as f32)
    }
}
