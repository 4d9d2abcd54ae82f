//! What skinning must not do to a sleeve, on the small garment.

use glam::{Quat, Vec3};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Garment, Rates, Scratch, evaluate, evaluate_with_rates};
use kitsuke_tests::{AROUND, RINGS, small_garment};
use proptest::prelude::*;

/// The area that each ring of the small sleeve encloses in a pose, no target blended in, square metres.
fn cross_sections_m2(garment: &Garment, pose: &Pose) -> Vec<f32> {
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut normals = positions_m.clone();
    let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
    evaluate_with_rates(garment, pose, &Rates::new(garment.data()), &mut Scratch::new(garment), frame);
    let enclosed = |ring: &[Vec3]| {
        let next = ring.iter().cycle().skip(1);
        ring.iter().zip(next).map(|(a, b)| (a - ring[0]).cross(b - ring[0])).sum::<Vec3>().length() / 2.0
    };
    positions_m[..RINGS * AROUND].chunks(AROUND).map(enclosed).collect()
}

#[test]
fn sleeves_keep_their_width_in_raised_and_twisted_arms() {
    let garment = small_garment();
    let rest_m2 = cross_sections_m2(&garment, &Pose::REST);
    let about = |axis: Vec3, degrees: f32| Quat::from_axis_angle(axis, degrees.to_radians());
    // Per cent: what linear blending leaves of a ring that two joints share half and half is the cosine of half the
    // bend; twist takes nothing.
    let cases = [
        ("raised to 170 degrees", Bone::LeftUpperArm, about(Vec3::Z, 80.0), 70.0),
        ("upper arm twisted", Bone::LeftUpperArm, about(Vec3::X, 90.0), 99.9),
        ("forearm twisted by 90", Bone::LeftLowerArm, about(Vec3::X, 90.0), 99.9),
        ("forearm twisted by 150", Bone::LeftLowerArm, about(Vec3::X, 150.0), 99.9),
        ("forearm twisted by -150", Bone::LeftLowerArm, about(Vec3::X, -150.0), 99.9),
        ("bent, then twisted", Bone::LeftLowerArm, about(Vec3::Y, -80.0) * about(Vec3::X, 150.0), 70.0),
    ];
    for (name, bone, rotation, least_percent) in cases {
        let found_m2 = cross_sections_m2(&garment, &Pose::REST.with(bone, rotation));
        for (ring, (found, rest)) in found_m2.iter().zip(&rest_m2).enumerate() {
            let percent = 100.0 * found / rest;
            assert!(percent >= least_percent, "{name}: {percent} % of ring {ring} are left");
        }
    }
}

/// Rates and skinning alike: what the hand does to a forearm is nothing to its sleeve.
#[test]
fn frames_do_not_depend_on_the_twist_of_a_forearm() {
    let garment = small_garment();
    let frame_of = |twist: f32| {
        let bent = Quat::from_rotation_y(-0.8) * Quat::from_rotation_x(twist);
        let pose = Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(-1.0)).with(Bone::LeftLowerArm, bent);
        let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
        let mut normals = positions_m.clone();
        let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
        evaluate(&garment, &pose, &mut Scratch::new(&garment), frame);
        positions_m
    };
    let untwisted_m = frame_of(0.0);
    for twist in [-2.6, -1.5, 0.7, 2.6] {
        for (found, expected) in frame_of(twist).iter().zip(&untwisted_m) {
            assert!(found.distance(*expected) < 1e-6, "{twist} rad: {found} instead of {expected}");
        }
    }
}

const ARMS: [[Bone; 3]; 2] = [
    [Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand],
    [Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand],
];

fn turn() -> impl Strategy<Value = Quat> {
    // Within 160 degrees, beyond which the shortest way back hangs on rounding.
    prop::array::uniform3(-1.6f32..1.6).prop_map(|v| Quat::from_scaled_axis(Vec3::from(v)))
}

/// World rotations of an arm's three bones.
fn chain(pose: &Pose, arm: [Bone; 3]) -> [Quat; 3] {
    let [upper, lower, hand] = arm.map(|bone| pose.rotation(bone));
    [upper, upper * lower, upper * lower * hand]
}

proptest! {
    #[test]
    fn untwisted_bones_point_where_they_did(turns in prop::collection::vec(turn(), 6)) {
        let bones = ARMS.as_flattened();
        let pose = bones.iter().zip(&turns).fold(Pose::REST, |pose, (&bone, &turn)| pose.with(bone, turn));
        let untwisted = pose.with_arms_untwisted();
        for arm in ARMS {
            let (before, after) = (chain(&pose, arm), chain(&untwisted, arm));
            for bone in 0..2 {
                prop_assert!((before[bone] * Vec3::X).distance(after[bone] * Vec3::X) < 2e-5);
                prop_assert_eq!(untwisted.rotation(arm[bone]).x, 0.0);
            }
            prop_assert!(before[2].dot(after[2]).abs() > 1.0 - 2e-6, "hands are turned as they were");
        }
        prop_assert_eq!(untwisted.with_arms_untwisted(), untwisted, "a second time changes nothing");
    }

    /// A step of a hundredth of a degree anywhere turns no bone by more than a tenth, whatever way it takes.
    #[test]
    fn untwisting_is_smooth(turns in prop::collection::vec(turn(), 6), step in prop::collection::vec(turn(), 6)) {
        let bones = ARMS.as_flattened();
        let pose = |share: f32| {
            let turned = bones.iter().zip(turns.iter().zip(&step));
            turned.fold(Pose::REST, |pose, (&bone, (&turn, &step))| {
                pose.with(bone, turn * Quat::IDENTITY.slerp(step, share))
            })
        };
        let (from, to) = (pose(0.0).with_arms_untwisted(), pose(1e-4).with_arms_untwisted());
        for arm in ARMS {
            let opposite = chain(&from, arm).iter().any(|q| (*q * Vec3::X).x < -0.8)
                || (from.rotation(arm[1]) * Vec3::X).x < -0.8;
            for (a, b) in chain(&from, arm).iter().zip(chain(&to, arm)) {
                prop_assert!(opposite || a.dot(b).abs() > 0.999_999, "{a} {b}");
            }
        }
    }
}
