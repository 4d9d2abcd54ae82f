//! The default kernel on the sample kimono: exact at its samples, smooth between them, better than the other ways of
//! blending at shapes that it has not seen. The figures are measured here, not read from the pack.

use super::build::WHOLE;
use glam::Vec3;
use kitsuke::pose_blend::Kernel;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Garment, Pack, Rates, Scratch, evaluate};
use kitsuke_pipeline::ir;
use kitsuke_pipeline::look::frames::{Blend, Distance, Stage, in_source_order, own_poses};
use kitsuke_pipeline::measure::audit::audit;
use kitsuke_pipeline::measure::certificate::{Smoothness, fastest, keep_budgets, smoothness};
use kitsuke_pipeline::measure::leave_one_out::{Error, Method, Unseen, errors, unseen_errors};
use kitsuke_pipeline::measure::pose_space::poses;
use kitsuke_pipeline::stages::correctives::without_correctives;
use std::path::Path;
use std::sync::LazyLock;

/// The sample's folder and the kimono in its pack.
pub(super) static KOMON: LazyLock<(ir::Garment, Garment)> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src/komon");
    let source = kitsuke_pipeline::load(&folder).garment.expect("the sample has no mistakes");
    let pack = Pack::open(&WHOLE.files["packs/komon.kitsuke"]).unwrap();
    (source, pack.into_garment())
});

#[test]
fn every_sample_comes_back_from_its_pose() {
    let (source, garment) = &*KOMON;
    assert_eq!(garment.kernel(), Kernel::Rbf);
    let mut stage = Stage::new(garment);
    for (shot, target) in own_poses(garment).iter_mut().skip(1).zip(&source.targets) {
        shot.blend = Blend::Kernel(Kernel::Rbf);
        let found_m = in_source_order(garment, stage.show(shot).0);
        let Distance { max_m, mean_m, .. } = Distance::between(&found_m, &target.positions_m);
        assert!(max_m <= 0.077e-3 && mean_m <= 0.05e-3, "{}: {max_m} m, mean {mean_m} m", target.name);
    }
}

#[test]
fn correctives_are_nothing_at_the_samples_and_lift_the_cloth_out_of_the_body_between_them() {
    let (source, garment) = &*KOMON;
    let data = garment.data();
    assert!(
        (1..=24).contains(&data.corrective_count),
        "at most 8 of each arm and of the legs: {}",
        data.corrective_count
    );
    let mut rates = Rates::new(data);
    for row in 0..=data.sample_count() {
        garment.blend_rates(Kernel::Rbf, &data.poses.pose(row), &mut rates);
        let of_correctives = (0..data.drivers.len()).flat_map(|driver| &rates.driver(driver)[data.sample_count()..]);
        let most = of_correctives.fold(0.0f32, |most, rate| most.max(rate.abs()));
        assert!(most < 1e-6, "{most} in row {row}");
    }

    let without = Garment::new(without_correctives(data)).unwrap();
    let poses = poses(garment, 0, 40);
    let depths = |garment| {
        let mut depths: Vec<f32> = audit(&source.body, garment, &poses).by_pose.iter().map(|d| d.depth_m).collect();
        depths.sort_by(f32::total_cmp);
        [depths[20], depths[39]]
    };
    let ([median_m, worst_m], [median_before_m, worst_before_m]) = (depths(garment), depths(&without));
    assert!(median_m < 0.9 * median_before_m, "{median_m} m instead of {median_before_m} m");
    assert!(worst_m < worst_before_m, "{worst_m} m instead of {worst_before_m} m");
}

/// Shapes that the samples do know are predicted exactly by what is exact at the samples, and by nothing else.
#[test]
fn unseen_shapes_are_held_against_the_frames_in_their_poses() {
    let (source, garment) = &*KOMON;
    let order = &garment.data().mesh.source_vertex;
    let shape = |(row, target): (usize, &ir::TargetShape)| Unseen {
        name: target.name.clone(),
        pose: garment.data().poses.pose(row + 1),
        positions_m: order.iter().map(|&vertex| target.positions_m[vertex as usize]).collect(),
    };
    let shapes: Vec<Unseen> = source.targets.iter().enumerate().map(shape).collect();
    let of = |method| unseen_errors(garment, method, &shapes).unwrap();
    for error in of(Method::Default) {
        assert!(error.max_mm < 0.077 && error.mean_mm <= error.p95_mm && error.p95_mm <= error.p99_mm, "{error:?}");
    }
    assert!(of(Method::Skinning).iter().all(|error| error.max_mm > 5.0));
}

#[test]
fn a_thousand_paths_have_no_jump_and_no_corner() {
    let (_, garment) = &*KOMON;
    let Smoothness { step_mm, step_change_mm } = smoothness(garment, 1000, 3);
    assert!(step_mm <= 0.3, "{step_mm} mm in a step of 0.01 degrees");
    assert!(step_change_mm <= 0.01, "{step_change_mm} mm from one step to the next");
}

#[test]
fn unseen_targets_are_predicted_better_than_by_any_other_way() {
    let (_, garment) = &*KOMON;
    for layer in 0..garment.data().layer_count() {
        better_than_any_other_way(garment, layer);
    }
}

/// Percentiles this near to each other differ by less than the simulations do when they are repeated.
const SAME: f64 = 1.03;

fn better_than_any_other_way(garment: &Garment, layer: usize) {
    let samples = garment.data().sample_count();
    let of_layer: Vec<usize> = garment.data().targets_of_layer(layer).filter(|&target| target < samples).collect();
    let mean = |method: Method, of: fn(&Error) -> f64| {
        let errors = errors(garment, method).unwrap();
        of_layer.iter().map(|&target| of(&errors[target])).sum::<f64>() / of_layer.len() as f64
    };
    let figures = |method| [mean(method, |error| error.mean_mm), mean(method, |error| error.p99_mm)];
    let [own_mean, own_p99] = figures(Method::Default);
    for method in [
        Method::Nearest,
        Method::Skinning,
        Method::InverseDistance,
        Method::Paper,
        Method::LinearRbf,
        Method::ThinPlate,
    ] {
        let [mean, p99] = figures(method);
        assert!(
            own_mean < mean && own_p99 < p99 * SAME,
            "layer {layer}, {}: {mean} and {p99}, not {own_mean} and {own_p99}",
            method.name()
        );
    }
}

#[test]
fn a_frame_does_not_depend_on_the_frames_before() {
    let (_, garment) = &*KOMON;
    let poses = poses(garment, 0, 12);
    let mut scratch = Scratch::new(garment);
    let mut bits = |pose: &Pose| {
        let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
        let mut normals = positions_m.clone();
        let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
        evaluate(garment, pose, &mut scratch, frame);
        let all = positions_m.iter().chain(&normals);
        all.flat_map(|v| v.to_array().map(f32::to_bits)).collect::<Vec<_>>()
    };
    let forward: Vec<_> = poses.iter().map(&mut bits).collect();
    let mut backward: Vec<_> = poses.iter().rev().map(&mut bits).collect();
    backward.reverse();
    assert!(forward == backward);
}

/// Far from all samples the targets fade out: an arm across the back, where nobody made a shape.
#[test]
fn far_from_all_samples_the_skinned_base_remains() {
    let (_, garment) = &*KOMON;
    let behind = glam::Quat::from_rotation_y(std::f32::consts::PI * 0.9);
    let pose = Pose::REST.with(Bone::LeftUpperArm, behind).with(Bone::LeftLowerArm, behind);
    let mut rates = kitsuke::Rates::new(garment.data());
    garment.blend_rates(Kernel::Rbf, &pose, &mut rates);
    let left =
        garment.data().rbf.as_ref().unwrap().layers[0].groups.iter().find(|group| group.name == "leftArm").unwrap();
    let largest = left.drivers.iter().flat_map(|&d| rates.driver(usize::from(d))).fold(0.0f32, |a, r| a.max(r.abs()));
    assert!(largest == 0.0, "a rate of {largest}");
}

#[test]
fn a_pack_over_its_budgets_names_joint_and_poses() {
    let (source, garment) = &*KOMON;
    let certificate = garment.data().certificate.as_ref().unwrap();
    assert_eq!(keep_budgets(certificate, source), Ok(()));

    let slow = ir::Garment { speed_budget_m: Some(1e-3), ..source.clone() };
    let said = keep_budgets(certificate, &slow).unwrap_err().to_string();
    let rows = certificate.fastest_rows.map(|row| source.targets[usize::from(row) - 1].name.as_str());
    for name in [certificate.fastest_joint.name(), rows[0], rows[1], "speed_budget"] {
        assert!(said.contains(name), "{said}");
    }

    let wise = ir::Garment { unseen_budget_m: Some(10e-3), ..source.clone() };
    let said = keep_budgets(certificate, &wise).unwrap_err().to_string();
    assert!(said.contains("unseen_budget") && source.targets.iter().any(|t| said.contains(&t.name)), "{said}");
}

#[test]
fn the_certificate_is_what_frames_show() {
    let (_, garment) = &*KOMON;
    let certificate = garment.data().certificate.as_ref().unwrap();
    // More poses than the build measures may find a faster one, but not by much.
    let found = fastest(garment, 40).unwrap();
    assert!(found.speed_mm_per_deg > 1.0 && found.speed_mm_per_deg <= certificate.speed_mm_per_deg * 1.001);
}
