//! Frames allocate nothing.

use glam::{Quat, Vec3};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Rates, Scratch, evaluate, evaluate_with_rates};

#[test]
fn evaluating_allocates_nothing() {
    let garment = kitsuke_tests::small_garment();
    let mut scratch = Scratch::new(&garment);
    let mut rates = Rates::new(&garment);
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
