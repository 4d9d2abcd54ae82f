//! `cargo xtask skinning`: what skinning does to a sleeve in poses far from the T-pose, by several methods.

use crate::places::{Places, ended};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Quat, Vec3};
use kitsuke::Garment;
use kitsuke::arrays::{GarmentData, SkinWeights};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke_pipeline::look::frames::{Blend, Shot, Stage, own_poses};
use std::process::ExitCode;

/// Measure how skinning stretches, crushes and turns over the sleeves in extreme poses
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID
    #[arg(value_name = "ID", default_value = "komon")]
    garment: String,
    #[command(flatten)]
    places: Places,
}

/// Measures; 1 when the pack cannot be read.
pub fn run(args: Args) -> ExitCode {
    ended(args.places.open(&args.garment).map(|pack| print_tables(pack.garment())))
}

/// How a vertex follows its joints.
#[derive(Clone, Copy)]
enum Method {
    /// The weighted mean of the joints' matrices.
    Linear,
    /// The weighted mean of the joints' unit dual quaternions, signs as that of the first joint, normalised (Kavan,
    /// Collins, Zara, O'Sullivan: Geometric Skinning with Approximate Dual Quaternion Blending, 2008).
    DualQuaternion,
}

/// Ways to skin the base: name, method, whether the arms are untwisted before.
const WAYS: [(&str, Method, bool); 4] = [
    ("linear", Method::Linear, false),
    ("dual quaternion", Method::DualQuaternion, false),
    ("linear, untwisted", Method::Linear, true),
    ("dual quat., untwisted", Method::DualQuaternion, true),
];

/// A family of poses: both arms, mirrored.
struct Family {
    name: &'static str,
    degrees: &'static [f32],
    /// Clavicle, upper arm and lower arm of the left side at an angle.
    left: fn(f32) -> [Quat; 3],
}

const RAISED: &[f32] = &[0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 170.0];

const FAMILIES: [Family; 6] = [
    Family {
        name: "arms raised sideways",
        degrees: RAISED,
        // The T-pose is 90 degrees from the arms hanging down.
        left: |degrees| [Quat::IDENTITY, about_z(degrees - 90.0), Quat::IDENTITY],
    },
    Family {
        name: "arms raised, clavicle takes a third above 90",
        degrees: RAISED,
        left: |degrees| {
            let clavicle = ((degrees - 90.0) / 3.0).max(0.0);
            [about_z(clavicle), about_z(degrees - 90.0 - clavicle), Quat::IDENTITY]
        },
    },
    Family {
        name: "forearm twisted",
        degrees: &[-150.0, -90.0, 0.0, 90.0, 150.0],
        left: |degrees| [Quat::IDENTITY, Quat::IDENTITY, Quat::from_rotation_x(degrees.to_radians())],
    },
    Family {
        name: "elbow bent",
        degrees: &[0.0, 45.0, 90.0, 120.0, 140.0],
        left: |degrees| [Quat::IDENTITY, Quat::IDENTITY, Quat::from_rotation_y(-degrees.to_radians())],
    },
    Family {
        name: "upper arm twisted",
        degrees: &[-90.0, -45.0, 0.0, 45.0, 90.0],
        left: |degrees| [Quat::IDENTITY, Quat::from_rotation_x(degrees.to_radians()), Quat::IDENTITY],
    },
    Family {
        name: "upper arm twisted, elbow bent 90",
        degrees: &[-90.0, -45.0, 0.0, 45.0, 90.0],
        left: |degrees| {
            let bent = Quat::from_rotation_y(-std::f32::consts::FRAC_PI_2);
            [Quat::IDENTITY, Quat::from_rotation_x(degrees.to_radians()), bent]
        },
    },
];

fn about_z(degrees: f32) -> Quat {
    Quat::from_rotation_z(degrees.to_radians())
}

impl Family {
    fn pose(&self, degrees: f32) -> Pose {
        let [clavicle, upper, lower] = (self.left)(degrees);
        // Mirrored in the plane x = 0.
        let right = |q: Quat| Quat::from_xyzw(q.x, -q.y, -q.z, q.w);
        Pose::REST
            .with(Bone::LeftShoulder, clavicle)
            .with(Bone::LeftUpperArm, upper)
            .with(Bone::LeftLowerArm, lower)
            .with(Bone::RightShoulder, right(clavicle))
            .with(Bone::RightUpperArm, right(upper))
            .with(Bone::RightLowerArm, right(lower))
    }
}

/// The base in a pose, metres.
fn posed(data: &GarmentData, method: Method, pose: &Pose) -> Vec<Vec3> {
    let mut posed_from_rest = vec![Affine3A::IDENTITY; data.skeleton.frame_count()];
    data.skeleton.posed_from_rest(pose, &mut posed_from_rest);
    let affine: Vec<DAffine3> = posed_from_rest.iter().map(|transform| transform.as_daffine3()).collect();
    let dual: Vec<[DQuat; 2]> = affine
        .iter()
        .map(|transform| {
            let rotation = DQuat::from_mat3(&transform.matrix3).normalize();
            [rotation, DQuat::from_vec4(transform.translation.extend(0.0)) * rotation * 0.5]
        })
        .collect();
    let place = |(p, skin): (&Vec3, &SkinWeights)| {
        let p = p.as_dvec3();
        let parts = skin.joints.iter().zip(skin.weights);
        let mut parts = parts.map(|(&joint, weight)| (usize::from(joint), f64::from(weight) / 65535.0));
        match method {
            Method::Linear => parts.map(|(joint, weight)| affine[joint].transform_point3(p) * weight).sum::<DVec3>(),
            Method::DualQuaternion => {
                let first = dual[usize::from(skin.joints[0])][0];
                let zero = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
                let [rotation, moved] = parts.by_ref().fold([zero; 2], |[rotation, moved], (joint, weight)| {
                    let weight = weight.copysign(dual[joint][0].dot(first));
                    [rotation + dual[joint][0] * weight, moved + dual[joint][1] * weight]
                });
                let length = rotation.length();
                let (rotation, moved) = (rotation / length, moved / length);
                rotation * p + 2.0 * (moved * rotation.conjugate()).xyz()
            }
        }
        .as_vec3()
    };
    data.mesh.positions_m.iter().zip(&data.skin).map(place).collect()
}

/// What the arms move.
struct Sleeves {
    vertices: Vec<usize>,
    edges: Vec<[usize; 2]>,
    triangles: Vec<[usize; 3]>,
}

/// What a pose does to the sleeves, relative to the base.
struct Figures {
    /// Length of edges, at 1, 50 and 99 % of them.
    edges: [f32; 3],
    /// The whole area.
    area: f32,
    /// The area of triangles, at 1 % of them.
    least_area: f32,
    /// How many triangles face away from where their heaviest joint turns them, per cent.
    turned_over: f32,
}

impl Sleeves {
    fn new(data: &GarmentData) -> Sleeves {
        let is_arm = |joint: u8| {
            let name = data.skeleton.bone(joint).name();
            ["Shoulder", "UpperArm", "LowerArm"].iter().any(|arm| name.ends_with(arm))
        };
        let arm_weight = |skin: &SkinWeights| -> u32 {
            let parts = skin.joints.into_iter().zip(skin.weights);
            parts.filter(|&(joint, _)| is_arm(joint)).map(|(_, weight)| u32::from(weight)).sum()
        };
        let moved: Vec<bool> = data.skin.iter().map(|skin| arm_weight(skin) > 65535 / 20).collect();
        let triangles = data.mesh.triangles.iter().map(|corners| corners.map(|v| data.mesh.unique(v) as usize));
        let triangles: Vec<[usize; 3]> = triangles.filter(|corners| corners.iter().all(|&v| moved[v])).collect();
        let edges = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let mut edges: Vec<[usize; 2]> = edges.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.dedup();
        Sleeves { vertices: (0..moved.len()).filter(|&v| moved[v]).collect(), edges, triangles }
    }

    fn figures(&self, data: &GarmentData, pose: &Pose, posed_m: &[Vec3]) -> Figures {
        let rest_m = &data.mesh.positions_m;
        let mut posed_from_rest = vec![Affine3A::IDENTITY; data.skeleton.frame_count()];
        data.skeleton.posed_from_rest(pose, &mut posed_from_rest);
        let ratio = |&[a, b]: &[usize; 2]| posed_m[a].distance(posed_m[b]) / rest_m[a].distance(rest_m[b]);
        let edges = self.edges.iter().map(ratio).collect();
        let doubled_area = |at: &[Vec3], [a, b, c]: [usize; 3]| (at[b] - at[a]).cross(at[c] - at[a]);
        let (mut area, mut rest_area, mut turned_over) = (0.0, 0.0, 0);
        let mut areas = Vec::new();
        for &corners in &self.triangles {
            let (found, rest) = (doubled_area(posed_m, corners), doubled_area(rest_m, corners));
            let skin = data.skin[corners[0]];
            let heaviest = (0..4).max_by_key(|&k| skin.weights[k]).unwrap_or(0);
            let carried = posed_from_rest[usize::from(skin.joints[heaviest])].transform_vector3(rest);
            turned_over += usize::from(found.dot(carried) < 0.0);
            area += found.length();
            rest_area += rest.length();
            areas.push(found.length() / rest.length().max(1e-12));
        }
        Figures {
            edges: quantiles(edges, [0.01, 0.5, 0.99]),
            area: area / rest_area,
            least_area: quantiles(areas, [0.01])[0],
            turned_over: turned_over as f32 / self.triangles.len() as f32 * 100.0,
        }
    }
}

/// The values below which these shares of the values lie; 0 of none.
fn quantiles<const N: usize>(mut values: Vec<f32>, shares: [f32; N]) -> [f32; N] {
    values.sort_by(f32::total_cmp);
    let place = |share: f32| (values.len().saturating_sub(1) as f32 * share).round() as usize;
    shares.map(|share| values.get(place(share)).copied().unwrap_or(0.0))
}

fn print_tables(garment: &Garment) {
    let data = garment.data();
    let sleeves = Sleeves::new(data);
    let mut stage = Stage::new(garment);
    println!("{:<8}{:<24}{:<21}{:<15}turned", "", "posed / rest", "edge length", "area");
    println!("{:<8}{:<22}{:>6}{:>7}{:>7}{:>8}{:>7}{:>8}", "degrees", "", "1 %", "50 %", "99 %", "all", "1 %", "over %");
    for family in &FAMILIES {
        println!("{}", family.name);
        for &degrees in family.degrees {
            let pose = family.pose(degrees);
            let untwisted = pose.with_arms_untwisted();
            let print = |name: &str, pose: &Pose, posed_m: &[Vec3]| {
                let Figures { edges: [low, middle, high], area, least_area, turned_over } =
                    sleeves.figures(data, pose, posed_m);
                print!("{degrees:>6}  {name:<22}{low:>6.2}{middle:>7.2}{high:>7.2}");
                println!("{area:>8.2}{least_area:>7.2}{turned_over:>8.2}");
            };
            for (name, method, is_untwisted) in WAYS {
                let pose = if is_untwisted { &untwisted } else { &pose };
                print(name, pose, &posed(data, method, pose));
            }
            let shot = Shot { name: String::new(), pose, blend: Blend::Kernel(garment.kernel()) };
            print("frame, blended", &untwisted, stage.show(&shot).0);
        }
    }

    println!("\nfrom the base skinned alone to the targets, mm");
    for (name, method, is_untwisted) in WAYS {
        let mut errors_mm = Vec::new();
        for shot in own_poses(garment).iter().skip(1) {
            let pose = if is_untwisted { shot.pose.with_arms_untwisted() } else { shot.pose.clone() };
            let (found_m, target_m) = (posed(data, method, &pose), stage.show(shot).0);
            errors_mm.extend(sleeves.vertices.iter().map(|&v| found_m[v].distance(target_m[v]) * 1e3));
        }
        let mean_mm = errors_mm.iter().sum::<f32>() / errors_mm.len() as f32;
        println!("        {name:<22}mean {mean_mm:.1}, 99 % {:.1}", quantiles(errors_mm, [0.99])[0]);
    }
}
