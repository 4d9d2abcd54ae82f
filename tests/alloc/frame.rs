//! Frames allocate nothing.

use glam::{Quat, Vec3};
use kitsuke::skeleton::{Bone, Pose, bvh};
use kitsuke::{Frame, Pack, Rates, Scratch, evaluate, evaluate_with_rates};

#[test]
fn evaluating_allocates_nothing() {
    let garment = kitsuke_tests::small_garment();
    let mut scratch = Scratch::new(&garment);
    let mut rates = Rates::new(garment.data());
    rates.set(0, 2, 1.0);
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut normals = positions_m.clone();
    let pose = Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(-0.7));
    let broken = Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(f32::NAN));
    let (_, usage) = super::usage(|| {
        for pose in [&Pose::REST, &pose, &broken] {
            let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
            evaluate(&garment, pose, &mut scratch, frame);
            let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
            evaluate_with_rates(&garment, pose, &rates, &mut scratch, frame);
        }
    });
    assert_eq!(usage, super::Usage::default());
}

#[test]
fn a_whole_recording_plays_without_an_allocation() {
    let pack = Pack::open(include_bytes!("../packs/v5_0.kitsuke")).expect("a sound pack");
    let garment = pack.garment();
    let recording = include_bytes!("../../assets-src/motions/two_arms.bvh");
    let motion = bvh::read(recording, &garment.data().skeleton).expect("a sound recording");
    assert!(motion.poses.len() > 1000, "{} frames", motion.poses.len());
    let mut scratch = Scratch::new(garment);
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut normals = positions_m.clone();
    let (moved, usage) = super::usage(|| {
        let mut moved = 0;
        let mut before_m = Vec3::NAN;
        for pose in &motion.poses {
            evaluate(garment, pose, &mut scratch, Frame { positions_m: &mut positions_m, normals: &mut normals });
            let sum_m = positions_m.iter().sum();
            moved += usize::from(std::mem::replace(&mut before_m, sum_m) != sum_m);
        }
        moved
    });
    assert_eq!(usage, super::Usage::default());
    assert!(moved > 100, "the kimono moves in {moved} frames");
}
