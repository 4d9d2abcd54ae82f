//! Skin that the cloth covers and nobody draws: what is, what never is, and what pictures say.

use glam::{Quat, Vec3};
use kitsuke::arrays::SkinWeights;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Garment, Pack};
use kitsuke_pipeline::ir::{self, Body};
use kitsuke_pipeline::look::frames::{Shot, Stage, npy_header_of, own_poses};
use kitsuke_pipeline::look::scene::{Colours, Framing, Scene, View};
use kitsuke_pipeline::measure::covered::{RIM_M, covered, limb, seen};
use kitsuke_pipeline::memo::Memo;
use kitsuke_tests::small_garment_data;
use std::f32::consts::TAU;
use std::path::Path;

/// Vertices round the cylinder, and rings along it.
const AROUND: usize = 24;
const RINGS: usize = 101;

/// The small garment's sleeve, stiff, and a cylinder in it that is longer by 20 cm on both sides and follows the same joint; and where the
/// sleeve ends along X.
fn arm_in_a_sleeve() -> (Garment, Body, [f32; 2]) {
    let mut data = small_garment_data();
    let joint = data.skeleton.index_of(Bone::LeftUpperArm).expect("the sleeve has an arm") as u8;
    data.skin.fill(SkinWeights { joints: [joint, 0, 0, 0], weights: [u16::MAX, 0, 0, 0] });
    data.targets.iter_mut().for_each(|target| target.deltas.fill([0; 3]));
    let places_m = &data.mesh.positions_m;
    let ends_m = [(f32::min as fn(f32, f32) -> f32, f32::MAX), (f32::max, f32::MIN)]
        .map(|(pick, from)| places_m.iter().map(|p| p.x).fold(from, pick));
    let axis_m = (places_m.iter().sum::<Vec3>() / places_m.len() as f32).with_x(0.0);
    let radius_m = places_m.iter().map(|p| (p - axis_m).with_x(0.0).length()).fold(f32::MAX, f32::min) * 0.8;
    let (first_m, length_m) = (ends_m[0] - 0.2, ends_m[1] - ends_m[0] + 0.4);
    // No ray goes exactly along an edge of the sleeve.
    const TURNED_RAD: f32 = 0.1;
    let place = |i: usize| {
        let (ring, angle) = (i / AROUND, TURNED_RAD + (i % AROUND) as f32 * TAU / AROUND as f32);
        let x = first_m + length_m * ring as f32 / (RINGS - 1) as f32;
        axis_m + Vec3::new(x, radius_m * libm::cosf(angle), radius_m * libm::sinf(angle))
    };
    let at = |ring: usize, i: usize| (ring * AROUND + i % AROUND) as u32;
    let quads = (0..RINGS - 1).flat_map(|ring| (0..AROUND).map(move |i| (ring, i)));
    let corners = quads.map(|(ring, i)| [at(ring, i), at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i)]);
    let triangles = corners.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let positions_m: Vec<Vec3> = (0..AROUND * RINGS).map(place).collect();
    let body = Body {
        skin: vec![[(joint, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]; positions_m.len()],
        surface: ir::Surface { positions_m, triangles, ..ir::Surface::default() },
        skeleton: data.skeleton.clone(),
    };
    (Garment::new(data).expect("a stiff sleeve is valid"), body, ends_m)
}

#[test]
fn a_sleeve_covers_the_middle_of_an_arm_and_not_its_ends() {
    let (garment, body, [low_m, high_m]) = arm_in_a_sleeve();
    let mask = covered(&garment, &body);
    assert_eq!(mask.len(), body.skin.len());
    let (middle_m, length_m) = ((low_m + high_m) / 2.0, high_m - low_m);
    for (place_m, is_covered) in body.surface.positions_m.iter().zip(&mask) {
        if (place_m.x - middle_m).abs() < 0.1 * length_m {
            assert!(is_covered, "{place_m} lies in the middle of {low_m} to {high_m}");
        }
        if place_m.x < low_m + 0.8 * RIM_M || place_m.x > high_m - 0.8 * RIM_M {
            assert!(!is_covered, "{place_m} lies at an end of {low_m} to {high_m}");
        }
    }
    // The rim is as wide, and the mask as it was, when the file keeps the corners of each triangle apart.
    let triangles = &body.surface.triangles;
    let apart = |values: &[Vec3]| triangles.iter().flatten().map(|&v| values[v as usize]).collect::<Vec<_>>();
    let torn = Body {
        skin: triangles.iter().flatten().map(|&v| body.skin[v as usize]).collect(),
        surface: ir::Surface {
            positions_m: apart(&body.surface.positions_m),
            triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..ir::Surface::default()
        },
        skeleton: body.skeleton.clone(),
    };
    let wanted: Vec<bool> = triangles.iter().flatten().map(|&v| mask[v as usize]).collect();
    assert_eq!(covered(&garment, &torn), wanted);
}

/// The tube of the test garments on its doll.
fn tube() -> (ir::Garment, Pack) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("garments/tube");
    let mut source = kitsuke_pipeline::load(&folder).garment.expect("the garment is sound");
    source.correctives = 0;
    let cache = tempfile::tempdir().unwrap();
    let built = kitsuke_pipeline::build_garment(&source, &Memo::new(cache.path()), &|_| ()).unwrap();
    (source, Pack::open(&built.pack).unwrap())
}

#[test]
fn a_mask_is_one_flag_per_vertex_of_the_file_the_same_on_any_threads() {
    let (source, pack) = tube();
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| covered(pack.garment(), &source.body))
    });
    assert_eq!(one, two);
    assert_eq!(one.len(), source.body.surface.positions_m.len());
    assert!(one.contains(&true), "the tube covers something");
    for (vertex, is_covered) in one.iter().enumerate() {
        assert!(
            !is_covered || limb(&source.body, vertex as u32).is_some(),
            "vertex {vertex} is of head, hands or feet"
        );
    }
    let header = npy_header_of("|b1", &[one.len()]);
    assert!(String::from_utf8_lossy(&header).contains("'descr': '|b1'") && header.len().is_multiple_of(64));
}

#[test]
fn pictures_of_the_t_pose_are_the_same_without_covered_skin() {
    let (source, pack) = tube();
    let garment = pack.garment();
    let mask = covered(garment, &source.body);
    let all = Scene::new(garment, Some(&source));
    let rest = all.clone().without_covered(&mask);
    let mut stage = Stage::new(garment);
    let base: &Shot = &own_poses(garment)[0];
    let figures = [&all, &rest].map(|scene| scene.figure(&mut stage, base, Colours::Cloth));
    for view in [View::Front, View::Side, View::Back, View::Quarter] {
        let framing = Framing::of(&figures[..1], view);
        assert_eq!(framing, Framing::of(&figures[1..], view), "what is not drawn still has its place");
        let [with, without] = [all.draw(&figures[0], framing, 200), rest.draw(&figures[1], framing, 200)];
        let other = with.pixels().zip(without.pixels()).filter(|(a, b)| a != b).count();
        assert!(other * 1000 <= with.pixels().len(), "{view:?}: {other} pixels");
    }
}

#[test]
fn skin_that_pokes_through_is_seen_until_it_is_left_out() {
    let (garment, mut body, [low_m, high_m]) = arm_in_a_sleeve();
    let mask = covered(&garment, &body);
    let pose = Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(-0.5));
    let found = seen(&garment, &body, &mask, std::slice::from_ref(&pose))[0];
    assert_eq!((found.of_all_m2, found.of_rest_m2), (0.0, 0.0), "a stiff sleeve goes with its arm");
    // The middle of the arm follows another joint, which stays behind.
    let middle_m = (low_m + high_m) / 2.0;
    for (weights, place_m) in body.skin.iter_mut().zip(&body.surface.positions_m) {
        if (place_m.x - middle_m).abs() < 0.1 * (high_m - low_m) {
            weights[0].1 = 0.0;
            weights[1] = (body.skeleton.index_of(Bone::LeftShoulder).unwrap_or(0) as u8, 1.0);
        }
    }
    let found = seen(&garment, &body, &mask, &[pose])[0];
    assert!(found.of_all_m2 > 0.0 && found.of_rest_m2 < 0.5 * found.of_all_m2, "{found:?}");
}
