//! What several suites need: the small sample garment, random garments, packs taken apart. The tests themselves stand in `suites/`
//! and `alloc/`.

pub mod container;
pub mod doll;
pub mod doors;
pub mod hostile;
pub mod motions;
pub mod player;
pub mod random;

use glam::{DVec3, Quat, Vec2, Vec3};
use kitsuke::accessories::{self, Obi};
use kitsuke::arrays::{
    Certificate, Driver, GarmentData, LeftOut, Mesh, NearestPair, Part, PoseBound, PoseLimit, PoseTable, RbfLayer,
    Segment, SkinWeights, Target,
};
use kitsuke::arrays::{ChainJoint, Group, Rbf};
use kitsuke::fit::{Dimension, Field, FitData, SizeBody};
use kitsuke::measurement::{Measurement, Measurements};
use kitsuke::skeleton::{Bone, Hanging, Joint, Skeleton};
use kitsuke::tailoring::{Check, DimensionRule, Level, Limit, Op, RuleSet, Side};
use kitsuke::{Accessories, Garment};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_3, TAU};

/// Vertices around the small garment's tube.
pub const AROUND: usize = 6;
/// Rings of vertices along it.
pub const RINGS: usize = 10;

/// A left sleeve: a tube of 60 vertices from the shoulder along +X with a seam (10 twins), two parts, two drivers,
/// segments with none, one and both of them, with and without masks, and three targets.
#[must_use]
pub fn small_garment() -> Garment {
    Garment::new(small_garment_data()).expect("the small garment is valid")
}

/// The arrays of [`small_garment`], for tests that damage them.
#[must_use]
pub fn small_garment_data() -> GarmentData {
    let rings = |from: usize, to: usize| (from * AROUND..to * AROUND).map(|vertex| vertex % AROUND);
    let shoulder_mask = |ring: usize| (u32::from(u16::MAX) * (7 - ring as u32) / 4) as u16;
    let both = (4..7).flat_map(|ring| [[shoulder_mask(ring), u16::MAX - shoulder_mask(ring)]; AROUND]);
    let fading = (7..10).flat_map(|ring: u16| [u16::MAX - 9000 * (ring - 7); AROUND]);
    let segment = |rings: u32, drivers: &[u8], masks: Vec<u16>| Segment {
        vertex_count: rings * AROUND as u32,
        drivers: drivers.to_vec(),
        masks,
    };
    let target = |name: &str, step_m: f32, segments: &[u16], from: usize, to: usize| Target {
        name: name.to_owned(),
        layer: 0,
        step_m,
        segments: segments.to_vec(),
        deltas: rings(from, to).zip(0..).map(|(j, i)| [i * 7 - 100, -(i * i), 900 * j as i16 - 2000]).collect(),
    };
    GarmentData {
        id: "small-sleeve".to_owned(),
        name: "小さな袖".to_owned(),
        skeleton: small_skeleton(),
        mesh: small_mesh(),
        skin: (0..RINGS).flat_map(|ring| [small_skin(ring); AROUND]).collect(),
        drivers: vec![
            Driver {
                name: "leftShoulder".to_owned(),
                joints: vec![Bone::LeftUpperArm],
                threshold_rad: FRAC_PI_3,
                layer: 0,
            },
            Driver {
                name: "leftElbow".to_owned(),
                joints: vec![Bone::LeftLowerArm],
                threshold_rad: FRAC_PI_3,
                layer: 0,
            },
        ],
        segments: vec![
            segment(1, &[], Vec::new()),
            segment(3, &[0], Vec::new()),
            segment(3, &[0, 1], both.flatten().collect()),
            segment(3, &[1], fading.collect()),
        ],
        targets: vec![
            target("shoulder_down", 1e-5, &[1, 2], 1, 7),
            target("elbow_bent", 2e-5, &[2, 3], 4, 10),
            target("both", 5e-6, &[1, 2, 3], 1, 10),
        ],
        poses: PoseTable {
            bones: vec![Bone::LeftUpperArm, Bone::LeftLowerArm],
            rotations: [(0.0, 0.0), (-FRAC_PI_2, 0.0), (0.0, FRAC_PI_2), (-FRAC_PI_2, FRAC_PI_2)]
                .into_iter()
                .flat_map(|(down, bent)| [Quat::from_rotation_z(down), Quat::from_rotation_y(-bent)])
                .collect(),
        },
        pose_limits: vec![PoseLimit {
            bones: vec![Bone::LeftUpperArm, Bone::LeftLowerArm],
            margin_rad: 0.1,
            bounds: small_bounds(),
        }],
        rbf: Some(small_rbf()),
        certificate: Some(small_certificate()),
        compression: None,
        corrective_count: 0,
    }
}

/// What comes with [`small_garment`]: a band round the sleeve, a texture of 3 x 2 pixels of which only the header is there, two paths.
#[must_use]
pub fn small_accessories() -> Accessories {
    let garment = small_garment();
    let data = garment.data();
    let band = (2 * AROUND..4 * AROUND).map(|v| data.mesh.positions_m[v] * Vec3::new(1.0, 1.01, 1.01)).collect();
    let next = |i: u32| (i + 1) % AROUND as u32;
    let quad = |i: u32| [[i, next(i), i + AROUND as u32], [next(i), next(i) + AROUND as u32, i + AROUND as u32]];
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    png.extend([0, 0, 0, 3, 0, 0, 0, 2, 8, 2, 0, 0, 0]);
    let path = |name: &str, ja: &str, vertices: Vec<u32>, offset_m| accessories::Path {
        name: name.to_owned(),
        ja: ja.to_owned(),
        vertices,
        offset_m,
    };
    Accessories {
        body: "b04".to_owned(),
        texture: accessories::Texture::from_png("komon.png".to_owned(), png),
        obi: Some(Obi::over(&garment, band, (0..AROUND as u32).flat_map(quad).collect())),
        paths: vec![
            path("sode_haba", "袖幅", (0..RINGS as u32).map(|ring| ring * AROUND as u32).collect(), 0.0),
            path("sode_guchi", "", vec![0, 1, 2], -0.01),
        ],
    }
}

/// Two sizes of [`small_garment`], one wider and one longer, with a path and a rule set that uses every step of programs.
#[must_use]
pub fn small_fit() -> FitData {
    let garment = small_garment();
    let body = |name: &str, height_m: f32| SizeBody {
        name: name.to_owned(),
        measurements: Measurements::default()
            .with(Measurement::BodyHeight, height_m)
            .with(Measurement::HipGirth, 0.5 * height_m),
        joints_m: garment.data().skeleton.joints().iter().map(|joint| joint.rest_m * height_m / 1.6).collect(),
    };
    let place = |vertex: i16| (vertex / AROUND as i16, vertex % AROUND as i16);
    // The first part bears most, the second the rest.
    let field = |along: i16, around: i16| Field {
        step_m: 2e-5,
        deltas: (0..(RINGS * AROUND) as i16)
            .map(|vertex| [along * place(vertex).0, around * place(vertex).1, around - place(vertex).0])
            .collect(),
    };
    let uv = |scale: f32| garment.data().mesh.uv.iter().map(|uv| (*uv * scale * 1e4).round() / 1e4).collect();
    let ring = |ring: u32| (0..AROUND as u32).map(|around| ring * AROUND as u32 + around).collect();
    let binary = [
        Op::Add,
        Op::Subtract,
        Op::Multiply,
        Op::Divide,
        Op::Minimum,
        Op::Maximum,
        Op::Round,
        Op::RoundUp,
        Op::RoundDown,
        Op::Hypotenuse,
        Op::Less,
        Op::LessOrEqual,
    ];
    let mut every_step = vec![Op::Constant(0.25), Op::IfKnown(Measurement::BodyHeight)];
    every_step.extend(binary.into_iter().flat_map(|op| [Op::Dimension(0), op]));
    every_step.extend([Op::Constant(1.0), Op::Constant(2.0), Op::Select]);
    let rule = |name: &str, program| DimensionRule { name: name.to_owned(), ja: "袖".to_owned(), program };
    let limit =
        |side, level, bound| Limit { side, level, bound: vec![Op::Constant(bound)], text: "広すぎ".to_owned() };
    FitData {
        bodies: vec![body("b0", 1.6), body("wide", 1.62), body("long", 1.7)],
        dimensions: vec![Dimension {
            name: "sode_guchi_left".to_owned(),
            ja: "袖口".to_owned(),
            rule: "sode_guchi".to_owned(),
            vertices: ring(9),
            offset_m: 0.01,
            load: 2.0,
        }],
        parts: garment.data().mesh.parts.iter().map(|part| part.name.clone()).collect(),
        fields: vec![field(0, 40), field(60, 0), field(1, 7), field(5, -1)],
        uv: vec![uv(1.1), uv(0.9)],
        rules: vec![RuleSet {
            name: "small".to_owned(),
            source: "nobody".to_owned(),
            dimensions: vec![
                rule("yuki", vec![Op::Measurement(Measurement::BodyHeight)]),
                rule("sode_guchi", every_step),
            ],
            checks: vec![Check {
                name: "cloth".to_owned(),
                value: vec![Op::Dimension(1)],
                limits: vec![limit(Side::Above, Level::Impossible, 0.4), limit(Side::Below, Level::Warn, 0.1)],
            }],
        }],
    }
}

/// The upper arm is let down and the elbow bent by up to 90 degrees, and neither is turned otherwise.
fn small_bounds() -> Vec<PoseBound> {
    let bound = |angle: usize, sign: f32| {
        let mut normal = vec![0.0; 6];
        normal[angle] = sign;
        let is_reached = (angle, sign) == (2, -1.0) || (angle, sign) == (4, -1.0);
        PoseBound { normal, most_rad: if is_reached { FRAC_PI_2 } else { 0.0 } }
    };
    (0..6).flat_map(|angle| [bound(angle, 1.0), bound(angle, -1.0)]).collect()
}

/// Both drivers as one arm, with coefficients that are no interpolation of anything.
fn small_rbf() -> Rbf {
    let joint = |bone, parent, swing| ChainJoint {
        bone,
        parent,
        is_carried: parent.is_some(),
        axis: DVec3::X,
        swing,
        twist: 0.25,
    };
    let coefficients = |scale: f64| (0..12).map(|i| scale * f64::from(i - 5)).collect();
    let layer = RbfLayer {
        groups: vec![Group {
            name: "leftArm".to_owned(),
            drivers: vec![0, 1],
            chain: vec![joint(Bone::LeftUpperArm, None, 1.0), joint(Bone::LeftLowerArm, Some(0), 0.5)],
            mirror: None,
            own: coefficients(0.1),
            joint: coefficients(-0.05),
            centres: Vec::new(),
            corrective: Vec::new(),
        }],
        joint_width: 0.75,
        reach: 2.0,
        ridge: 0.01,
        mirror_ridge: 0.1,
    };
    Rbf { layers: vec![layer] }
}

/// Figures that nobody measured.
fn small_certificate() -> Certificate {
    Certificate {
        speed_mm_per_deg: 12.5,
        fastest_joint: Bone::LeftLowerArm,
        fastest_rows: [1, 3],
        step_mm: 0.125,
        step_change_mm: 0.002,
        left_out: (1..4u8).map(f32::from).map(|i| LeftOut { mean_mm: i, p99_mm: 5.0 * i, max_mm: 9.0 * i }).collect(),
        nearest: NearestPair { rows: [0, 2], apart_deg: 90.0 },
    }
}

fn small_skeleton() -> Skeleton {
    let joint = |bone, parent, x, y| Joint { bone, parent, rest_m: Vec3::new(x, y, 0.0) };
    Skeleton::new(vec![
        joint(Bone::Hips, None, 0.0, 0.9),
        joint(Bone::Spine, Some(0), 0.0, 1.1),
        joint(Bone::LeftUpperArm, Some(1), 0.15, 1.4),
        joint(Bone::LeftLowerArm, Some(2), 0.4, 1.4),
    ])
    .and_then(|skeleton| skeleton.with_hanging(vec![Hanging { joint: 3, heading: 2, trunk: 1 }]))
    .expect("the small skeleton is valid")
}

fn small_mesh() -> Mesh {
    let unique = RINGS * AROUND;
    let vertex = |ring: usize, around: usize| match around {
        // The last column of faces ends at the twins.
        AROUND => (unique + ring) as u32,
        _ => (ring * AROUND + around) as u32,
    };
    let along = |ring: usize| ring as f32 / (RINGS - 1) as f32;
    let position = |vertex: usize| {
        let (ring, around) = (vertex / AROUND, vertex % AROUND);
        let circle = Vec2::from_angle(TAU * around as f32 / AROUND as f32) * 0.1;
        Vec3::new(0.15 + 0.5 * along(ring), 1.4 + circle.y, circle.x)
    };
    let uv = (0..unique).map(|vertex| Vec2::new((vertex % AROUND) as f32 / AROUND as f32, along(vertex / AROUND)));
    let faces = (0..RINGS - 1).flat_map(|ring| (0..AROUND).map(move |around| (ring, around)));
    let triangles = faces.flat_map(|(ring, around)| {
        let [a, b] = [vertex(ring, around), vertex(ring, around + 1)];
        let [c, d] = [vertex(ring + 1, around), vertex(ring + 1, around + 1)];
        [[a, c, b], [b, c, d]]
    });
    let part = |name: &str, rings: usize| Part { name: name.to_owned(), triangle_count: (2 * rings * AROUND) as u32 };
    Mesh {
        positions_m: (0..unique).map(position).collect(),
        uv: uv.chain((0..RINGS).map(|ring| Vec2::new(1.0, along(ring)))).collect(),
        twin_of: (0..RINGS).map(|ring| vertex(ring, 0)).collect(),
        triangles: triangles.collect(),
        parts: vec![part("sode_left", RINGS - 2), part("sodeguchi_left", 1)],
        source_vertex: (0..unique as u32).rev().collect(),
    }
}

/// From the spine over the upper to the lower arm.
fn small_skin(ring: usize) -> SkinWeights {
    let lower = u16::try_from(ring * 7000).expect("within 16 bits");
    let spine = if ring == 0 { 30000 } else { 0 };
    let hanging = lower / 4;
    SkinWeights { joints: [2, 3, 1, 4], weights: [u16::MAX - lower - spine, lower - hanging, spine, hanging] }
}
