//! Frames against a slow, plainly written evaluation in double precision, and what `evaluate` promises besides.

use glam::{DMat3, DQuat, DVec3, Quat, Vec3};
use kitsuke::arrays::Group;
use kitsuke::arrays::{Driver, GarmentData, Mesh, Part, PoseTable, Segment, SkinWeights, Target};
use kitsuke::garment::Garment;
use kitsuke::pose_blend::Kernel;
use kitsuke::skeleton::{Bone, Joint, Pose, Skeleton};
use kitsuke::{Frame, Rates, Scratch, evaluate, evaluate_with_rates, pose_blend};
use kitsuke_tests::random::{Numbers, garment, with_rbf};
use proptest::prelude::*;

struct Buffers {
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
}

impl Buffers {
    fn new(garment: &Garment) -> Buffers {
        let unset = vec![Vec3::NAN; garment.vertex_count()];
        Buffers { positions_m: unset.clone(), normals: unset }
    }

    fn frame(&mut self) -> Frame<'_> {
        Frame { positions_m: &mut self.positions_m, normals: &mut self.normals }
    }

    fn bits(&self) -> Vec<[u32; 3]> {
        self.positions_m.iter().chain(&self.normals).map(|v| v.to_array().map(f32::to_bits)).collect()
    }

    fn is_finite(&self) -> bool {
        self.positions_m.iter().chain(&self.normals).all(|v| v.is_finite())
    }
}

/// The pose as cloth follows it: every bone of an arm is brought to where it points by the shortest way, seen from the
/// bone before. `None` where one points nearly back, so that the shortest way hangs on rounding.
fn untwisted(pose: &Pose) -> Option<Pose> {
    let arms = [
        [Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand],
        [Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand],
    ];
    let mut out = pose.clone();
    for arm in arms {
        let (mut world, mut untwisted) = (DQuat::IDENTITY, DQuat::IDENTITY);
        for bone in arm {
            world *= pose.rotation(bone).as_dquat().normalize();
            let local = untwisted.inverse() * world;
            let is_hand = bone == arm[2];
            if !is_hand && (local * DVec3::X).x < -0.99 {
                return None;
            }
            let local = if is_hand { local } else { DQuat::from_rotation_arc(DVec3::X, local * DVec3::X) };
            untwisted *= local;
            out = out.with(bone, local.as_quat());
        }
    }
    Some(out)
}

/// World transform of a joint as rotation and translation, root first, by the definition of a pose.
fn posed_joint(skeleton: &Skeleton, pose: &Pose, joint: usize) -> (DQuat, DVec3) {
    let Joint { bone, parent, rest_m } = skeleton.joints()[joint];
    let (turned, moved) = match parent {
        Some(parent) => posed_joint(skeleton, pose, usize::from(parent)),
        None => (DQuat::IDENTITY, pose.hips_translation_m.as_dvec3()),
    };
    let rotation = pose.rotation(bone).as_dquat().normalize();
    let rest_m = rest_m.as_dvec3();
    // x -> turned * (rotation * (x - rest) + rest) + moved
    (turned * rotation, turned * (rest_m - rotation * rest_m) + moved)
}

/// The frame by its definition, vertex by vertex: positions, and the unnormalised area-weighted normals.
fn slow_frame(garment: &Garment, pose: &Pose, rates: &Rates) -> (Vec<DVec3>, Vec<DVec3>) {
    let data = garment.data();
    let mut segment_of = Vec::new();
    for (number, segment) in data.segments.iter().enumerate() {
        segment_of.extend((0..segment.vertex_count as usize).map(|row| (number, row)));
    }
    let mask = |vertex: usize, driver: usize| {
        let (number, row) = segment_of[vertex];
        let segment = &data.segments[number];
        match segment.drivers.iter().position(|&d| usize::from(d) == driver) {
            None => 0.0,
            Some(_) if segment.masks.is_empty() => 1.0,
            Some(column) => f64::from(segment.masks[row * segment.drivers.len() + column]) / 65535.0,
        }
    };
    let delta_m = |vertex: usize, target: &Target| {
        let (number, row) = segment_of[vertex];
        let before = |s: &&u16| usize::from(**s) < number;
        let skipped: usize =
            target.segments.iter().filter(before).map(|&s| data.segments[usize::from(s)].vertex_count as usize).sum();
        if target.segments.contains(&(number as u16)) {
            DVec3::from_array(target.deltas[skipped + row].map(f64::from)) * f64::from(target.step_m)
        } else {
            DVec3::ZERO
        }
    };
    let joints: Vec<_> = (0..data.skeleton.joints().len()).map(|j| posed_joint(&data.skeleton, pose, j)).collect();
    let mut positions_m: Vec<DVec3> = (0..data.mesh.positions_m.len())
        .map(|vertex| {
            let mut unposed = data.mesh.positions_m[vertex].as_dvec3();
            for driver in 0..data.drivers.len() {
                for (t, target) in data.targets.iter().enumerate() {
                    let rate = f64::from(rates.driver(driver)[t]);
                    unposed += mask(vertex, driver) * rate * delta_m(vertex, target);
                }
            }
            let skin = data.skin[vertex];
            (0..4)
                .map(|k| {
                    let (rotation, translation) = joints[usize::from(skin.joints[k])];
                    (rotation * unposed + translation) * f64::from(skin.weights[k]) / 65535.0
                })
                .sum()
        })
        .collect();
    let unique = positions_m.len();
    positions_m.extend(data.mesh.twin_of.iter().map(|&v| positions_m[v as usize]).collect::<Vec<_>>());
    let original =
        |v: u32| if (v as usize) < unique { v as usize } else { data.mesh.twin_of[v as usize - unique] as usize };
    let mut normals = vec![DVec3::ZERO; unique];
    for triangle in &data.mesh.triangles {
        let [a, b, c] = triangle.map(original);
        let normal = (positions_m[b] - positions_m[a]).cross(positions_m[c] - positions_m[a]);
        for v in [a, b, c] {
            normals[v] += normal;
        }
    }
    normals.extend(data.mesh.twin_of.iter().map(|&v| normals[v as usize]).collect::<Vec<_>>());
    (positions_m, normals)
}

fn assert_same_frame(garment: &Garment, pose: &Pose, rates: &Rates, found: &Buffers) {
    let Some(pose) = untwisted(pose) else { return };
    let (positions_m, normals) = slow_frame(garment, &pose, rates);
    for (vertex, (&found, expected)) in found.positions_m.iter().zip(positions_m).enumerate() {
        assert!(found.as_dvec3().distance(expected) <= 1e-5, "vertex {vertex}: {found} instead of {expected}");
    }
    for (vertex, (&found, expected)) in found.normals.iter().zip(normals).enumerate() {
        assert!((found.length() - 1.0).abs() <= 1e-5, "normal {vertex}: {found}");
        // Shorter sums are what is left of triangles that cancel; their direction is rounding.
        if expected.length() > 1e-3 {
            let expected = expected.normalize();
            assert!(found.as_dvec3().distance(expected) <= 2e-3, "normal {vertex}: {found} instead of {expected}");
        }
    }
}

/// The paper's rates by its sentences: similar samples, inverse differences, sum 1.
fn slow_paper(garment: &Garment, pose: &Pose, driver: usize) -> Vec<f64> {
    let data = garment.data();
    let Driver { joints, threshold_rad, layer, .. } = &data.drivers[driver];
    let closeness: Vec<f64> = (0..=data.sample_count())
        .map(|row| {
            let squares = joints.iter().map(|&bone| {
                let column = data.poses.bones.iter().position(|&b| b == bone).unwrap();
                let (a, b) = (pose.rotation(bone).as_dquat(), data.poses.row(row)[column].as_dquat());
                (2.0 * libm::acos(a.normalize().dot(b.normalize()).abs().min(1.0))).powi(2)
            });
            let difference_rad = squares.sum::<f64>().sqrt();
            let is_of_layer = row == 0 || data.targets[row - 1].layer == *layer;
            if is_of_layer && difference_rad <= f64::from(*threshold_rad) {
                1.0 / difference_rad.max(1e-5)
            } else {
                0.0
            }
        })
        .collect();
    let sum: f64 = closeness.iter().sum();
    let of_samples = closeness[1..].iter().map(|c| if sum > 0.0 { c / sum } else { 0.0 });
    of_samples.chain(std::iter::repeat_n(0.0, data.corrective_count)).collect()
}

/// Axis times angle of a rotation matrix, which fades to nothing at half a turn.
fn rotation_vector(matrix: DMat3) -> DVec3 {
    use std::f64::consts::PI;
    let (axis, angle) = DQuat::from_mat3(&matrix).to_axis_angle();
    let angle = if angle > PI { angle - 2.0 * PI } else { angle };
    axis * angle * (1.0 - (angle / PI).powi(16))
}

/// The default kernel by its formulas, on matrices.
fn slow_rbf(garment: &Garment, pose: &Pose, driver: usize) -> Vec<f64> {
    let data = garment.data();
    let number = data.drivers[driver].layer;
    let layer = &data.rbf.as_ref().unwrap().layers[usize::from(number)];
    let of_row = |bone: Bone, row: usize| {
        let column = data.poses.bones.iter().position(|&listed| listed == bone).unwrap();
        data.poses.row(row)[column]
    };
    let squared = |group: &Group, sample: &dyn Fn(Bone) -> Quat| -> f64 {
        let mut turned: Vec<(DMat3, DMat3)> = Vec::new();
        let mut sum = 0.0;
        for joint in &group.chain {
            let rest = (DMat3::IDENTITY, DMat3::IDENTITY);
            let (mut input, mut other) = joint.parent.map_or(rest, |parent| turned[usize::from(parent)]);
            let own = [pose.rotation(joint.bone), sample(joint.bone)];
            let [own_input, own_other] = own.map(|rotation| DMat3::from_quat(rotation.as_dquat().normalize()));
            (input, other) = (input * own_input, other * own_other);
            turned.push((input, other));
            let compared = if joint.is_carried { [input, other] } else { [own_input, own_other] };
            let [input, other] = compared.map(rotation_vector);
            let apart = input - other;
            let about = apart.dot(joint.axis);
            sum += joint.swing.powi(2) * (apart.length_squared() - about * about) + (joint.twist * about).powi(2);
        }
        sum
    };
    let group = layer.groups.iter().find(|group| group.drivers.contains(&(driver as u8))).unwrap();
    let of_layer: Vec<usize> = (0..data.targets.len()).filter(|&t| data.targets[t].layer == number).collect();
    let mut far = 1.0;
    let mut rates = vec![0.0; data.targets.len()];
    let (samples, correctives) = of_layer.split_at(of_layer.partition_point(|&target| target < data.sample_count()));
    let bump = |own: f64| {
        let t = (2.0 * own / layer.reach - 1.0).clamp(0.0, 1.0);
        t.powi(3) * (t * (6.0 * t - 15.0) + 10.0)
    };
    if group.mirror.is_some() {
        for (number, sample) in samples.iter().enumerate() {
            // Mirrored at X = 0: turns about X stay, turns about the other axes change their sense.
            let image = |bone: Bone| {
                let (axis, angle) = of_row(bone.mirrored(), sample + 1).to_axis_angle();
                Quat::from_axis_angle(Vec3::new(axis.x, -axis.y, -axis.z), angle)
            };
            let own = squared(group, &image).sqrt();
            far *= bump(own);
            for (place, &target) in of_layer.iter().enumerate() {
                let row = 1 + samples.len() + number;
                rates[target] += group.own[row * of_layer.len() + place] / (1.0 + own.powi(2)).sqrt();
            }
        }
    }
    for (sample, row) in std::iter::once(0).chain(samples.iter().map(|t| t + 1)).enumerate() {
        let own = squared(group, &|bone| of_row(bone, row)).sqrt();
        let all = layer.groups.iter().map(|group| squared(group, &|bone| of_row(bone, row))).sum::<f64>().sqrt();
        far *= bump(own);
        let phi = 1.0 / (1.0 + own.powi(2)).sqrt();
        let r = (all / layer.joint_width).min(1.0);
        let psi = (1.0 - r).powi(4) * (4.0 * r + 1.0);
        for (place, &target) in of_layer.iter().enumerate() {
            let at = sample * of_layer.len() + place;
            rates[target] += phi * group.own[at] + psi * group.joint[at];
        }
    }
    for (number, centre) in group.centres.chunks(group.chain.len()).enumerate() {
        let of_centre = |bone| centre[group.chain.iter().position(|joint| joint.bone == bone).unwrap()];
        let phi = 1.0 / (1.0 + squared(group, &of_centre)).sqrt();
        for (place, &target) in correctives.iter().enumerate() {
            rates[target] += phi * group.corrective[number * correctives.len() + place];
        }
    }
    rates.iter().map(|rate| rate * (1.0 - far)).collect()
}

proptest! {
    #[test]
    fn poses_give_the_rates_of_the_default_kernel(seed: u64) {
        let mut n = Numbers(seed);
        let garment = with_rbf(&garment(seed), &mut n);
        prop_assume!(garment.data().rbf.is_some());
        let pose = n.pose();
        let mut rates = Rates::new(garment.data());
        garment.blend_rates(Kernel::Rbf, &pose, &mut rates);
        let followed = untwisted(&pose);
        prop_assume!(followed.is_some());
        for driver in 0..garment.data().drivers.len() {
            let expected = slow_rbf(&garment, followed.as_ref().unwrap(), driver);
            for (&found, expected) in rates.driver(driver).iter().zip(expected) {
                prop_assert!((f64::from(found) - expected).abs() <= 1e-4 * (1.0 + expected.abs()), "{found} {expected}");
            }
        }
        let mut negated = pose.clone();
        negated.rotations.iter_mut().for_each(|rotation| *rotation = -*rotation);
        let mut again = Rates::new(garment.data());
        garment.blend_rates(Kernel::Rbf, &negated, &mut again);
        prop_assert_eq!(rates, again, "a rotation and its negated quaternion are the same");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn frames_agree_with_the_slow_evaluation(seed: u64) {
        let garment = garment(seed);
        let n = &mut Numbers(!seed);
        let pose = n.pose();
        let mut rates = Rates::new(garment.data());
        for driver in 0..garment.data().drivers.len() {
            for target in 0..garment.data().targets.len() {
                rates.set(driver, target, if n.below(3) == 0 { 0.0 } else { n.signed() });
            }
        }
        let (mut scratch, mut found) = (Scratch::new(&garment), Buffers::new(&garment));
        evaluate_with_rates(&garment, &pose, &rates, &mut scratch, found.frame());
        assert_same_frame(&garment, &pose, &rates, &found);
    }

    #[test]
    fn poses_give_the_rates_of_the_paper(seed: u64) {
        let garment = garment(seed);
        let pose = {
            let mut pose = Numbers(!seed).pose();
            pose.rotations.iter_mut().for_each(|rotation| *rotation = Quat::IDENTITY.slerp(*rotation, 0.3));
            pose
        };
        let (mut scratch, mut found) = (Scratch::new(&garment), Buffers::new(&garment));
        evaluate(&garment, &pose, &mut scratch, found.frame());
        let followed = untwisted(&pose);
        prop_assume!(followed.is_some());
        for driver in 0..garment.data().drivers.len() {
            let expected = slow_paper(&garment, followed.as_ref().unwrap(), driver);
            for (target, (&rate, expected)) in scratch.rates().driver(driver).iter().zip(expected).enumerate() {
                prop_assert!((f64::from(rate) - expected).abs() <= 1e-4, "{driver}/{target}: {rate} for {expected}");
            }
        }
        assert_same_frame(&garment, &pose, scratch.rates(), &found);
    }

    #[test]
    fn a_pose_gives_the_same_bytes_whatever_came_before_and_whatever_its_signs(seed: u64) {
        let garment = garment(seed);
        let n = &mut Numbers(!seed);
        let (pose, other) = (n.pose(), n.pose());
        let (mut scratch, mut first) = (Scratch::new(&garment), Buffers::new(&garment));
        evaluate(&garment, &pose, &mut scratch, first.frame());
        let mut second = Buffers::new(&garment);
        evaluate(&garment, &other, &mut scratch, second.frame());
        evaluate(&garment, &pose, &mut scratch, second.frame());
        prop_assert_eq!(first.bits(), second.bits());
        let negated = Pose { rotations: pose.rotations.map(|q| -q), ..pose };
        evaluate(&garment, &negated, &mut scratch, second.frame());
        prop_assert_eq!(first.bits(), second.bits());
    }

    #[test]
    fn any_numbers_as_a_pose_give_a_finite_frame(seed: u64, numbers in prop::array::uniform8(any::<f32>())) {
        let garment = garment(seed);
        let special = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, f32::MAX, f32::MIN_POSITIVE];
        let n = &mut Numbers(seed);
        let mut number = || if n.below(3) == 0 { special[n.below(6)] } else { numbers[n.below(8)] };
        let mut pose = Pose::REST;
        pose.hips_translation_m = Vec3::new(number(), number(), number());
        pose.rotations.iter_mut().for_each(|q| *q = Quat::from_xyzw(number(), number(), number(), number()));
        let (mut scratch, mut found) = (Scratch::new(&garment), Buffers::new(&garment));
        evaluate(&garment, &pose, &mut scratch, found.frame());
        prop_assert!(found.is_finite());
        let mut rates = Rates::new(garment.data());
        pose_blend::paper(garment.data(), &pose, &mut rates);
        for driver in 0..garment.data().drivers.len() {
            for target in 0..garment.data().targets.len() {
                rates.set(driver, target, number());
            }
        }
        evaluate_with_rates(&garment, &pose, &rates, &mut scratch, found.frame());
        prop_assert!(found.is_finite());
    }
}

/// One triangle, one driver that owns it, two targets at 90 degrees about X and about Z.
fn triangle() -> GarmentData {
    let quarter = std::f32::consts::FRAC_PI_2;
    let names = ["about_x", "about_z"];
    GarmentData {
        id: "triangle".to_owned(),
        name: "triangle".to_owned(),
        skeleton: Skeleton::new(vec![Joint { bone: Bone::Hips, parent: None, rest_m: Vec3::ZERO }]).unwrap(),
        mesh: Mesh {
            positions_m: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            uv: Vec::new(),
            twin_of: vec![2],
            triangles: vec![[0, 1, 3]],
            parts: vec![Part { name: "all".to_owned(), triangle_count: 1 }],
            source_vertex: vec![0, 1, 2],
        },
        skin: vec![SkinWeights { joints: [0; 4], weights: [65535, 0, 0, 0] }; 3],
        drivers: vec![Driver { name: "hips".to_owned(), joints: vec![Bone::Hips], threshold_rad: 2.0, layer: 0 }],
        segments: vec![Segment { vertex_count: 3, drivers: vec![0], masks: Vec::new() }],
        targets: names
            .map(|name| Target {
                name: name.to_owned(),
                layer: 0,
                step_m: 0.001,
                segments: vec![0],
                deltas: vec![[0, 0, 0], [1000, 0, 0], [0, 0, 500]],
            })
            .to_vec(),
        poses: PoseTable {
            bones: vec![Bone::Hips],
            rotations: vec![Quat::IDENTITY, Quat::from_rotation_x(quarter), Quat::from_rotation_z(quarter)],
        },
        pose_limits: Vec::new(),
        rbf: None,
        certificate: None,
        compression: None,
        corrective_count: 0,
    }
}

fn rates_at(data: GarmentData, rotation: Quat) -> Vec<f32> {
    let garment = Garment::new(data).unwrap();
    let mut rates = Rates::new(garment.data());
    pose_blend::paper(garment.data(), &Pose::REST.with(Bone::Hips, rotation), &mut rates);
    rates.driver(0).to_vec()
}

#[test]
fn a_target_at_rate_one_is_reproduced_and_twins_follow() {
    let garment = Garment::new(triangle()).unwrap();
    let mut rates = Rates::new(garment.data());
    rates.set(0, 1, 1.0);
    let (mut scratch, mut found) = (Scratch::new(&garment), Buffers::new(&garment));
    evaluate_with_rates(&garment, &Pose::REST, &rates, &mut scratch, found.frame());
    let top = Vec3::new(0.0, 1.0, 0.5);
    assert_eq!(found.positions_m, [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), top, top]);
    let normal = Vec3::new(0.0, -0.5, 1.0).normalize();
    assert!(found.normals.iter().all(|n| n.distance(normal) < 1e-6), "{:?}", found.normals);
}

#[test]
fn samples_share_by_inverse_difference_within_the_threshold() {
    let quarter = std::f32::consts::FRAC_PI_2;
    // On the base: the base has nearly everything.
    assert!(rates_at(triangle(), Quat::IDENTITY).iter().all(|&rate| rate < 1e-5));
    // On a sample; about_z is 120 degrees away, beyond the threshold.
    let on = rates_at(triangle(), Quat::from_rotation_x(quarter));
    assert!(on[0] > 0.999_98 && on[1] == 0.0, "{on:?}");
    // A third of the way to about_x: base at 30, about_x at 60 degrees, so 2 to 1; about_z is near enough to count.
    let near = rates_at(triangle(), Quat::from_rotation_x(quarter / 3.0));
    assert!(near[0] > near[1] && near[1] > 0.0, "{near:?}");
    let mut narrow = triangle();
    narrow.drivers[0].threshold_rad = 1.1;
    let near = rates_at(narrow, Quat::from_rotation_x(quarter / 3.0));
    assert!((near[0] - 1.0 / 3.0).abs() < 1e-5 && near[1] == 0.0, "{near:?}");
    // Far from everything: the base alone.
    assert_eq!(rates_at(triangle(), Quat::from_rotation_y(3.0)), [0.0, 0.0]);
    // Two samples of the same rotation, one written with the other sign, share evenly.
    let mut doubled = triangle();
    doubled.poses.rotations[2] = -doubled.poses.rotations[1];
    let rates = rates_at(doubled, Quat::from_rotation_x(quarter));
    assert!((rates[0] - 0.5).abs() < 2e-5 && (rates[1] - 0.5).abs() < 2e-5, "{rates:?}");
}

#[test]
fn a_vertex_without_area_has_a_unit_normal() {
    let mut data = triangle();
    data.mesh.triangles = vec![[0, 0, 1]];
    let garment = Garment::new(data).unwrap();
    let (mut scratch, mut found) = (Scratch::new(&garment), Buffers::new(&garment));
    evaluate(&garment, &Pose::REST, &mut scratch, found.frame());
    assert_eq!(found.normals, [Vec3::Y; 4]);
}

#[test]
#[should_panic(expected = "one position per vertex")]
fn a_short_buffer_panics_as_documented() {
    let garment = Garment::new(triangle()).unwrap();
    let mut found = Buffers::new(&garment);
    found.positions_m.pop();
    evaluate(&garment, &Pose::REST, &mut Scratch::new(&garment), found.frame());
}
