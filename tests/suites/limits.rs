//! What a kimono lets its wearer do: poses within the samples' reach stay, poses beyond come back smoothly.

use glam::{Quat, Vec3};
use kitsuke::Garment;
use kitsuke::skeleton::{Bone, Pose, angle_between_rad};
use kitsuke_tests::random::Numbers;
use kitsuke_tests::small_garment;

const MARGIN_RAD: f32 = 0.1;

/// The small garment's samples turn the upper arm down by 90 degrees and bend the elbow by 90.
fn arm(down_rad: f32, bent_rad: f32) -> Pose {
    Pose::REST
        .with(Bone::LeftUpperArm, Quat::from_rotation_z(-down_rad))
        .with(Bone::LeftLowerArm, Quat::from_rotation_y(-bent_rad))
}

fn apart_rad(a: &Pose, b: &Pose) -> f32 {
    Bone::ALL.map(|bone| angle_between_rad(a.rotation(bone), b.rotation(bone))).into_iter().fold(0.0, f32::max)
}

#[test]
fn what_the_samples_reach_stays_bit_for_bit() {
    let garment = small_garment();
    for (down, bent) in [(0.0, 0.0), (1.5, 0.0), (0.0, 1.5), (1.5, 1.5), (0.7, 0.2), (0.3, 1.2)] {
        let pose = arm(down, bent).with(Bone::RightHand, Quat::from_rotation_x(3.0));
        let limited = garment.limited(&pose);
        assert_eq!((limited.pose, limited.turned_rad), (pose, 0.0), "{down}, {bent}");
    }
}

#[test]
fn what_lies_beyond_comes_back_to_the_margin() {
    let garment = small_garment();
    for beyond_rad in [0.02f32, 0.2, 1.0] {
        let pose = arm(std::f32::consts::FRAC_PI_2 + beyond_rad, 0.0);
        let limited = garment.limited(&pose);
        let angle = angle_between_rad(limited.pose.rotation(Bone::LeftUpperArm), Quat::IDENTITY);
        let kept = angle - std::f32::consts::FRAC_PI_2;
        let expected = MARGIN_RAD * beyond_rad / (MARGIN_RAD + beyond_rad);
        // Bounds that lean on each other take a little more.
        assert!((0.3 * expected..=expected + 1e-5).contains(&kept), "{beyond_rad}: {kept} rad beyond, not {expected}");
        assert!((limited.turned_rad - (beyond_rad - kept)).abs() < 1e-4);
    }
    // Never raised by any sample.
    let limited = garment.limited(&arm(-1.0, 0.0));
    assert!(angle_between_rad(limited.pose.rotation(Bone::LeftUpperArm), Quat::IDENTITY) <= MARGIN_RAD);
}

/// Small steps through pose space stay small, and their direction changes slowly. Beyond half a turn a rotation comes from the other side.
#[test]
fn nothing_jumps_and_nothing_has_a_corner() {
    let garment = small_garment();
    let mut n = Numbers(5);
    let mut turn = || Quat::from_scaled_axis(Vec3::new(n.signed(), n.signed(), n.signed()) * 0.9);
    for _ in 0..200 {
        let [from, to, bent] = [turn(), turn(), turn()];
        let steps = 2000;
        let at = |i: i32| {
            let upper = from.slerp(to, i as f32 / steps as f32);
            garment.limited(&arm(0.0, 0.0).with(Bone::LeftUpperArm, upper).with(Bone::LeftLowerArm, bent)).pose
        };
        let poses: Vec<Pose> = (0..=steps).map(at).collect();
        let step_rad = angle_between_rad(from, to) / steps as f32;
        let vector = |a: &Pose, b: &Pose| {
            (a.rotation(Bone::LeftUpperArm).conjugate() * b.rotation(Bone::LeftUpperArm)).xyz() * 2.0
        };
        for three in poses.windows(3) {
            assert!(apart_rad(&three[0], &three[1]) <= 4.0 * step_rad + 1e-5);
            let change = vector(&three[0], &three[1]).distance(vector(&three[1], &three[2]));
            assert!(change <= 0.1 * step_rad + 2e-6, "{change} for steps of {step_rad}");
        }
    }
}

#[test]
fn a_garment_without_limits_lets_everything_be() {
    let mut data = small_garment().data().clone();
    data.pose_limits.clear();
    let pose = arm(3.0, -3.0);
    assert_eq!(Garment::new(data).unwrap().limited(&pose).pose, pose);
}

#[test]
fn what_is_no_rotation_is_mended() {
    let broken = arm(0.2, 0.2).with(Bone::LeftUpperArm, Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0));
    assert!(small_garment().limited(&broken).pose.is_valid());
}
