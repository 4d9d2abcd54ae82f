//! `Garment::new` accepts what stands at the edge of a rule and names the element that lies beyond it.

use glam::{Quat, Vec2};
use kitsuke::Garment;
use kitsuke::arrays::RbfLayer;
use kitsuke::arrays::{Certificate, GarmentData, Part, limits};
use kitsuke::skeleton::Bone;
use kitsuke_tests::{small_garment, small_garment_data};
use std::f32::consts::PI;

/// A change of the small garment.
type Change = fn(&mut GarmentData);

/// Each change breaks one rule.
const BROKEN: &[(Change, &str)] = &[
    (|g| g.id = String::new(), "the id \"\" must be 1 to 256 characters of a-z, 0-9, _ and -"),
    (|g| g.id = "Komon".into(), "the id \"Komon\" must be 1 to 256 characters of a-z, 0-9, _ and -"),
    (|g| g.name = String::new(), "the garment's name must be 1 to 256 bytes of printable text"),
    (|g| g.mesh.parts[1].name = "a\nb".into(), "the name of part 1 must be 1 to 256 bytes of printable text"),
    (
        |g| g.targets[2].name = "x".repeat(limits::NAME_BYTES + 1),
        "the name of target 2 must be 1 to 256 bytes of printable text",
    ),
    (|g| g.mesh.parts[1].name = g.mesh.parts[0].name.clone(), "two parts are named \"sode_left\""),
    (|g| g.drivers[1].name = g.drivers[0].name.clone(), "two drivers are named \"leftShoulder\""),
    (|g| g.targets[1].name = g.targets[0].name.clone(), "two targets are named \"shoulder_down\""),
    (|g| g.mesh.positions_m.clear(), "there are 0 unique vertices; 1 to 4194304 are possible"),
    (|g| g.mesh.twin_of = vec![0; limits::VERTICES], "there are 4194364 vertices; 1 to 4194304 are possible"),
    (|g| g.mesh.triangles.clear(), "there are 0 triangles; 1 to 8388608 are possible"),
    (|g| g.mesh.parts.clear(), "there are 0 parts; 1 to 256 are possible"),
    (|g| g.mesh.positions_m[3].y = f32::NAN, "the position of vertex 3 is not within 100 m of the origin"),
    (|g| g.mesh.positions_m[4].z = -100.1, "the position of vertex 4 is not within 100 m of the origin"),
    (|g| _ = g.mesh.uv.pop(), "there are 69 texture coordinates instead of 70"),
    (|g| g.mesh.uv[69].x = f32::INFINITY, "the texture coordinate of vertex 69 is not within ±1024"),
    (|g| g.mesh.uv[1].y = 1025.0, "the texture coordinate of vertex 1 is not within ±1024"),
    (|g| g.mesh.twin_of[1] = 60, "twin 1 copies vertex 60, which is none of the unique vertices"),
    (|g| g.mesh.triangles[5][2] = 70, "triangle 5 has a corner at vertex 70, which does not exist"),
    (|g| g.mesh.parts[1].triangle_count += 1, "there are 109 triangles in parts instead of 108"),
    (|g| g.mesh.parts[1].triangle_count = u32::MAX, "there are 4294967391 triangles in parts instead of 108"),
    (|g| _ = g.mesh.source_vertex.pop(), "there are 59 source vertices instead of 60"),
    (|g| g.mesh.source_vertex[2] = 60, "source vertex 60 of vertex 2 is out of range or occurs twice"),
    (
        |g| g.mesh.source_vertex[2] = g.mesh.source_vertex[1],
        "source vertex 58 of vertex 2 is out of range or occurs twice",
    ),
    (|g| _ = g.skin.pop(), "there are 59 skin weights instead of 60"),
    (|g| g.skin[7].joints[3] = 5, "vertex 7 is skinned to joint 5, which the skeleton lacks"),
    (|g| g.skin[8].weights[0] += 1, "the skin weights of vertex 8 sum to 65536 instead of 65535"),
    (|g| g.drivers[1].joints.clear(), "the joints of driver 1 must be distinct bones of the pose table, at least one"),
    (
        |g| g.drivers[1].joints = vec![Bone::LeftLowerArm; 2],
        "the joints of driver 1 must be distinct bones of the pose table, at least one",
    ),
    (
        |g| g.drivers[0].joints = vec![Bone::Spine],
        "the joints of driver 0 must be distinct bones of the pose table, at least one",
    ),
    (
        |g| g.drivers[0].threshold_rad = 0.0,
        "the threshold of driver 0 must be above 0 and at most π times the root of its joint count",
    ),
    (
        |g| g.drivers[0].threshold_rad = f32::NAN,
        "the threshold of driver 0 must be above 0 and at most π times the root of its joint count",
    ),
    (
        |g| g.drivers[0].threshold_rad = PI * 1.0001,
        "the threshold of driver 0 must be above 0 and at most π times the root of its joint count",
    ),
    (|g| g.drivers = vec![g.drivers[0].clone(); limits::DRIVERS + 1], "there are 33 drivers; 0 to 32 are possible"),
    (|g| g.drivers[1].layer = 2, "the layers of the drivers must be numbered from 0 without gaps"),
    (|g| g.drivers[1].layer = 1, "there are 1 layers of the default kernel instead of 2"),
    (|g| g.targets[1].layer = 1, "target 1 belongs to a layer that no driver belongs to"),
    (|g| g.pose_limits = vec![g.pose_limits[0].clone(); 9], "there are 9 pose limits; 0 to 8 are possible"),
    (|g| g.pose_limits[0].bones.clear(), "there are 0 joints of a pose limit; 1 to 8 are possible"),
    (|g| g.pose_limits[0].bounds[2].normal[1] = 0.5, BOUND),
    (|g| _ = g.pose_limits[0].bounds[2].normal.pop(), BOUND),
    (|g| g.pose_limits[0].bounds[2].most_rad = -0.1, BOUND),
    (|g| g.pose_limits[0].bounds[2].most_rad = f32::NAN, BOUND),
    (|g| g.pose_limits[0].bones[1] = Bone::LeftUpperArm, LIMIT),
    (|g| g.pose_limits[0].bones[1] = Bone::Hips, LIMIT),
    (|g| g.pose_limits[0].margin_rad = 0.0, "the margin of pose limit 0 must be above 0 and at most π"),
    (|g| g.pose_limits[0].margin_rad = f32::NAN, "the margin of pose limit 0 must be above 0 and at most π"),
    (|g| g.segments.clear(), "there are 0 segments; 1 to 4096 are possible"),
    (|g| g.segments[1].vertex_count += 1, "there are 61 vertices in segments instead of 60"),
    (
        |g| {
            g.segments[1].vertex_count += 6;
            g.segments[0].vertex_count = 0;
        },
        "segment 0 is empty",
    ),
    (|g| g.segments[3].drivers = vec![2], "the drivers of segment 3 must be numbers of drivers, ascending"),
    (|g| g.segments[2].drivers = vec![1, 0], "the drivers of segment 2 must be numbers of drivers, ascending"),
    (|g| g.segments[2].drivers = vec![1, 1], "the drivers of segment 2 must be numbers of drivers, ascending"),
    (|g| _ = g.segments[2].masks.pop(), "segment 2 has 35 masks instead of 36"),
    (|g| g.segments[2].masks.clear(), "segment 2 has 0 masks instead of 36"),
    (|g| g.segments[0].masks = vec![0; 6], "segment 0 has 6 masks instead of 0"),
    (|g| g.segments[2].masks[8..10].fill(40_000), "the masks of row 4 of segment 2 sum to 80000, more than 65535"),
    (|g| g.targets[0].step_m = 0.0, "the step of target 0 must be above 0 m, and 32767 steps at most 100 m"),
    (|g| g.targets[1].step_m = f32::NAN, "the step of target 1 must be above 0 m, and 32767 steps at most 100 m"),
    (|g| g.targets[2].step_m = 0.0031, "the step of target 2 must be above 0 m, and 32767 steps at most 100 m"),
    (|g| g.targets[0].segments = vec![1, 4], "the segments of target 0 must be numbers of segments, ascending"),
    (|g| g.targets[0].segments = vec![2, 1], "the segments of target 0 must be numbers of segments, ascending"),
    (|g| _ = g.targets[0].deltas.pop(), "target 0 has 35 deltas instead of 36"),
    (|g| g.targets[0].segments.clear(), "target 0 has 36 deltas instead of 0"),
    (|g| _ = g.targets.pop(), "there are 8 rotations in the pose table instead of 6"),
    (
        |g| g.poses.bones.push(Bone::LeftLowerArm),
        "bone leftLowerArm of the pose table occurs twice or is not in the skeleton",
    ),
    (|g| g.poses.bones.push(Bone::Head), "bone head of the pose table occurs twice or is not in the skeleton"),
    (|g| _ = g.poses.rotations.pop(), "there are 7 rotations in the pose table instead of 8"),
    (
        |g| g.poses.rotations[5] = Quat::from_xyzw(0.0, 0.0, 0.0, 1.002),
        "the rotation of leftLowerArm in row 2 of the pose table is no unit quaternion",
    ),
    (
        |g| g.poses.rotations[0] = Quat::from_xyzw(0.0, f32::NAN, 0.0, 1.0),
        "the rotation of leftUpperArm in row 0 of the pose table is no unit quaternion",
    ),
    (|g| rbf(g).reach = 0.0, "the widths and the ridge of the default kernel must be above 0 and at most 1000"),
    (
        |g| rbf(g).joint_width = f64::NAN,
        "the widths and the ridge of the default kernel must be above 0 and at most 1000",
    ),
    (|g| rbf(g).groups.clear(), "there are 0 groups; 1 to 32 are possible"),
    (|g| rbf(g).groups[0].drivers.push(2), "driver 2 of group 0 does not exist or is in two groups"),
    (|g| rbf(g).groups[0].drivers.push(1), "driver 1 of group 0 does not exist or is in two groups"),
    (|g| _ = rbf(g).groups[0].drivers.pop(), "driver 1 is in no group of the default kernel"),
    (|g| rbf(g).groups[0].mirror = Some(0), MIRROR),
    (
        // Its own mirror image, yet no other group.
        |g| {
            g.poses.bones[0] = Bone::Spine;
            g.drivers[0].joints = vec![Bone::Spine];
            g.pose_limits.clear();
            rbf(g).groups[0].chain.truncate(1);
            rbf(g).groups[0].chain[0].bone = Bone::Spine;
            rbf(g).groups[0].mirror = Some(0);
        },
        MIRROR,
    ),
    (|g| rbf(g).groups[0].chain.clear(), "there are 0 joints in a chain; 1 to 16 are possible"),
    (
        |g| rbf(g).groups[0].chain = vec![rbf(g).groups[0].chain[0]; limits::CHAIN + 1],
        "there are 17 joints in a chain; 1 to 16 are possible",
    ),
    (|g| rbf(g).groups[0].chain[1].bone = Bone::LeftUpperArm, CHAIN),
    (|g| rbf(g).groups[0].chain[1].bone = Bone::Spine, CHAIN),
    (|g| rbf(g).groups[0].chain[0].axis *= 1.1, CHAIN),
    (|g| rbf(g).groups[0].chain[1].parent = Some(1), CHAIN),
    (|g| rbf(g).groups[0].chain[0].twist = -0.1, CHAIN),
    (|g| _ = rbf(g).groups[0].own.pop(), "there are 11 coefficients of a group instead of 12"),
    (|g| rbf(g).groups[0].joint[4] = f64::INFINITY, "the coefficients of group 0 must lie within ±1000000000"),
    (|g| certificate(g).step_mm = f32::NAN, "the figures of the certificate must be finite and 0 or more"),
    (|g| certificate(g).left_out[2].p99_mm = -1.0, "the figures of the certificate must be finite and 0 or more"),
    (|g| _ = certificate(g).left_out.pop(), "there are 2 left-out errors instead of 3"),
    (|g| certificate(g).fastest_rows[1] = 4, "the certificate names row 4, which the pose table lacks"),
    (|g| certificate(g).nearest.rows[0] = 5, "the certificate names row 5, which the pose table lacks"),
    (|g| rbf(g).groups[0].name.clear(), "the name of group 0 must be 1 to 256 bytes of printable text"),
];

const LIMIT: &str = "the joints of pose limit 0 must be distinct bones of the pose table";

const BOUND: &str =
    "the bounds of pose limit 0 must have unit normals of three numbers per joint and lie within 0 to 100";

const MIRROR: &str = "the mirror of group 0 must be another group of its layer with the same bones on the other side";

const CHAIN: &str =
    "the chain of group 0 must be distinct bones of the pose table, with unit axes and scales of 0 or more";

fn certificate(data: &mut GarmentData) -> &mut Certificate {
    data.certificate.as_mut().expect("the small garment has a certificate")
}

fn rbf(data: &mut GarmentData) -> &mut RbfLayer {
    &mut data.rbf.as_mut().expect("the small garment has a default kernel").layers[0]
}

#[test]
fn each_rule_names_its_element() {
    for (i, (change, message)) in BROKEN.iter().enumerate() {
        let mut data = small_garment_data();
        change(&mut data);
        let refused = Garment::new(data).map(|_| "no error".to_owned()).unwrap_or_else(|error| error.to_string());
        assert_eq!(refused, *message, "case {i}");
    }
}

#[test]
fn the_edge_of_each_rule_is_accepted() {
    let edges: &[Change] = &[
        |g| g.id = "z".repeat(limits::NAME_BYTES),
        |g| g.mesh.positions_m[0].x = -limits::EXTENT_M,
        |g| g.mesh.uv[0] = Vec2::splat(limits::UV),
        |g| g.mesh.uv.clear(),
        |g| g.mesh.parts.push(Part { name: "empty".into(), triangle_count: 0 }),
        |g| g.mesh.triangles[0] = [0, 0, 69],
        |g| g.drivers[0].threshold_rad = PI,
        |g| g.drivers[0].threshold_rad = f32::MIN_POSITIVE,
        |g| {
            g.drivers[0].joints = g.poses.bones.clone();
            g.drivers[0].threshold_rad = PI * 2f32.sqrt();
        },
        |g| g.segments[2].masks[0..2].copy_from_slice(&[65_535, 0]),
        |g| g.segments[3].masks.clear(),
        |g| g.targets[0].step_m = limits::EXTENT_M / 32_768.0,
        |g| g.targets[0].deltas.fill([i16::MIN; 3]),
        |g| {
            g.targets.clear();
            g.poses.rotations.truncate(2);
            g.rbf = None;
            g.certificate = None;
        },
    ];
    for (i, change) in edges.iter().enumerate() {
        let mut data = small_garment_data();
        change(&mut data);
        assert_eq!(Garment::new(data).err(), None, "case {i}");
    }
}

#[test]
fn rotations_are_normalised_once() {
    let mut data = small_garment_data();
    data.poses.rotations[3] = Quat::from_xyzw(0.0, 0.6, 0.0, 0.8) * 1.0009;
    let garment = Garment::new(data).unwrap();
    assert!((garment.data().poses.rotations[3].length() - 1.0).abs() < 1e-6);
    assert_eq!(Garment::new(garment.data().clone()).unwrap().data(), garment.data());
}

#[test]
fn counts_are_those_of_the_arrays() {
    let garment = small_garment();
    assert_eq!((garment.unique_count(), garment.vertex_count(), garment.triangle_count()), (60, 70, 108));
}
