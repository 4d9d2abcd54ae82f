//! Clearance against a body whose distance is known, and what the push-out promises.

use glam::{Quat, Vec3};
use kitsuke::clearance::{MARGIN_M, RAMP_M, push_m};
use kitsuke::evaluate::clear;
use kitsuke::garment::GarmentData;
use kitsuke::pack::write::write;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Garment, Pack, Scratch};
use kitsuke_tests::{rod, small_garment, small_garment_data};

const RADIUS_M: f32 = 0.05;

fn with_rod() -> GarmentData {
    GarmentData { proxies: vec![rod(0..40)], ..small_garment_data() }
}

/// Far from every sample, while the rod rests.
fn between() -> Pose {
    Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(-0.6))
}

/// Where cloth at these places comes to.
fn cleared(garment: &Garment, pose: &Pose, places_m: &[Vec3]) -> Vec<Vec3> {
    let mut positions_m = vec![Vec3::new(9.0, 9.0, 9.0); garment.unique_count()];
    positions_m[..places_m.len()].copy_from_slice(places_m);
    clear(garment, pose, &mut Scratch::new(garment), &mut positions_m);
    positions_m.truncate(places_m.len());
    positions_m
}

fn around_x(angle_deg: f32) -> Vec3 {
    Quat::from_rotation_x(angle_deg.to_radians()) * Vec3::Y
}

#[test]
fn cloth_outside_keeps_its_every_bit_and_cloth_inside_comes_out() {
    let garment = Garment::new(with_rod()).unwrap();
    for depth_mm in -30..=10 {
        let depth_m = depth_mm as f32 * 1e-3;
        let before_m: Vec<Vec3> = (0..40)
            .map(|i| Vec3::X * (0.005 * i as f32 - 0.1) + around_x(37.0 * i as f32) * (RADIUS_M - depth_m))
            .collect();
        for (before_m, after_m) in before_m.iter().zip(cleared(&garment, &between(), &before_m)) {
            let outside_m = after_m.with_x(0.0).length() - RADIUS_M;
            if depth_mm <= -7 {
                assert_eq!(*before_m, after_m, "{depth_mm} mm deep");
            } else if depth_mm >= 0 {
                assert!((-5e-4..=MARGIN_M + RAMP_M).contains(&outside_m), "{depth_mm} mm deep comes to {outside_m} m");
            }
        }
    }
}

#[test]
fn the_push_is_once_smoothly_differentiable() {
    let step_m = 1e-5;
    let at = |i: i32| push_m(i as f32 * step_m);
    for i in -1000..1000 {
        let (slope, next) = ((at(i + 1) - at(i)) / step_m, (at(i + 2) - at(i + 1)) / step_m);
        assert!((-1.001..=1e-3).contains(&slope) && (next - slope).abs() < 0.01, "{slope} then {next} at {i}");
    }
    assert_eq!(push_m(MARGIN_M + 0.5 * RAMP_M), 0.0);
}

#[test]
fn nothing_jumps_where_cloth_dives_through_the_body() {
    let garment = Garment::new(with_rod()).unwrap();
    let steps = 8000;
    let at = |i: i32| {
        // In by one side and out by the other, past the axis.
        let t = i as f32 / steps as f32;
        cleared(&garment, &between(), &[Vec3::new(0.1 * t, 0.2 * t - 0.1, 0.013)])[0]
    };
    let places_m: Vec<Vec3> = (0..=steps).map(at).collect();
    let steps_m: Vec<Vec3> = places_m.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let largest_m = steps_m.iter().map(|step| step.length()).fold(0.0, f32::max);
    let turn_m = steps_m.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, f32::max);
    // One step of the cloth itself is 28 µm.
    assert!(largest_m < 4e-4, "{largest_m} m in one step");
    assert!(turn_m < 2e-5, "steps differ by {turn_m} m");
}

#[test]
fn exactness_wins_at_the_samples() {
    let garment = Garment::new(with_rod()).unwrap();
    let deep_m = [Vec3::new(0.0, 0.04, 0.0)];
    assert_ne!(cleared(&garment, &between(), &deep_m), deep_m);
    assert_eq!(cleared(&garment, &Pose::REST, &deep_m), deep_m, "the base is a sample");
}

#[test]
fn packs_with_and_without_proxies_come_back() {
    for data in [with_rod(), small_garment_data()] {
        let garment = Garment::new(data).unwrap();
        let pack = Pack::open(&write(&garment)).unwrap();
        assert_eq!(pack.garment().data(), garment.data());
    }
    assert_eq!(small_garment().data().proxies, []);
}

#[test]
fn proxies_that_break_a_rule_are_refused() {
    type Change = fn(&mut GarmentData);
    let broken: [(Change, &str); 9] = [
        (|g| g.proxies = vec![g.proxies[0].clone(); 17], "there are 17 clearance proxies; 0 to 16 are possible"),
        (|g| g.proxies.push(g.proxies[0].clone()), "two clearance limbs are named \"rod\""),
        (|g| g.proxies[0].guarded[1].vertex = 0, "clearance proxy 0: it must guard unique vertices, each once"),
        (|g| g.proxies[0].guarded[1].vertex = 999, "clearance proxy 0: it must guard unique vertices, each once"),
        (|g| g.proxies[0].surfels[1].place_m.y = f32::NAN, "clearance proxy 0: its surfels must lie within 100 m"),
        (|g| g.proxies[0].surfels[1].normal *= 2.0, "clearance proxy 0: its normals must be unit vectors"),
        (|g| g.proxies[0].surfels[1].radius_m = 0.0, SIZES),
        (|g| g.proxies[0].surfels[1].share = f32::INFINITY, SIZES),
        (|g| g.proxies[0].surfels[1].skin.joints[3] = 200, SKIN),
    ];
    for (change, message) in broken {
        let mut data = with_rod();
        change(&mut data);
        assert_eq!(Garment::new(data).unwrap_err().to_string(), message);
    }
}

const SIZES: &str = "clearance proxy 0: its radii must be 1 mm to 1 m, its shares 1e-6 to 1e3";
const SKIN: &str = "clearance proxy 0: its skin weights must name joints of the skeleton and sum to 65535";
