//! Pose targets of one body on the kimono of another.

use glam::{Mat3, Quat, Vec3};
use kitsuke::Pack;
use kitsuke::arrays::{InvalidGarment, Target};
use kitsuke::fit::{FitData, FitError, Tailor, TailorError, Transfer};
use kitsuke::garment::Garment;
use kitsuke::measurement::{Measurement, Measurements};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke_pipeline::build_garment;
use kitsuke_pipeline::look::frames::{Blend, Shot, Stage};
use kitsuke_pipeline::memo::Memo;
use kitsuke_tests::{AROUND, small_fit, small_garment, small_garment_data};

fn joints_m(garment: &Garment) -> Vec<Vec3> {
    garment.data().skeleton.joints().iter().map(|joint| joint.rest_m).collect()
}

/// A target's deltas, metres.
fn deltas_m(target: &Target) -> Vec<Vec3> {
    target.deltas.iter().map(|delta| Vec3::from_array(delta.map(f32::from)) * target.step_m).collect()
}

#[test]
fn the_base_itself_keeps_its_targets_and_a_larger_one_has_larger_ones() {
    let garment = small_garment();
    let transfer = Transfer::new(&garment).unwrap();
    for scale in [1.0, 1.25, 0.5] {
        let grown = |places: &[Vec3]| -> Vec<Vec3> { places.iter().map(|place| *place * scale).collect() };
        let (positions_m, joints_m) = (grown(&garment.data().mesh.positions_m), grown(&joints_m(&garment)));
        let tailored = transfer.tailored(&garment, &positions_m, &joints_m).unwrap();
        assert_eq!(tailored.data().mesh.positions_m, positions_m);
        assert_eq!(tailored.data().skeleton.joints()[3].rest_m, joints_m[3]);
        for (target, original) in tailored.data().targets.iter().zip(&garment.data().targets) {
            for (v, (delta, original)) in deltas_m(target).iter().zip(deltas_m(original)).enumerate() {
                let error_m = delta.distance(original * scale);
                assert!(error_m < 2.0 * target.step_m, "vertex {v} of {} at {scale}: {error_m} m", target.name);
            }
        }
    }
}

/// A target turns the outer half of the sleeve as a whole; on a sleeve a third longer the outer half must keep its shape.
#[test]
fn what_a_target_turns_is_turned_not_stretched() {
    let turn = Mat3::from_quat(Quat::from_rotation_z(-1.0));
    let mut data = small_garment_data();
    let positions_m = data.mesh.positions_m.clone();
    let pivot_m = positions_m[4 * AROUND];
    data.targets[2].step_m = 5e-5;
    for (delta, place_m) in data.targets[2].deltas.iter_mut().zip(&positions_m[AROUND..]) {
        let along = ((place_m.x - pivot_m.x) / 0.1).clamp(0.0, 1.0);
        let turned = (turn * (*place_m - pivot_m) - (*place_m - pivot_m)) * along;
        *delta = (turned / 5e-5).round().to_array().map(|step| step as i16);
    }
    let garment = Garment::new(data).unwrap();
    let longer: Vec<Vec3> = positions_m.iter().map(|p| Vec3::new(0.15 + (p.x - 0.15) * 1.33, p.y, p.z)).collect();
    let tailored = Transfer::new(&garment).unwrap().tailored(&garment, &longer, &joints_m(&garment)).unwrap();
    let moved: Vec<Vec3> =
        longer[AROUND..].iter().zip(deltas_m(&tailored.data().targets[2])).map(|(p, d)| *p + d).collect();
    for ring in 7..9 {
        for around in 0..AROUND {
            let at = ring * AROUND + around;
            let (before, after) = (longer[at].distance(longer[at + AROUND]), moved[at - AROUND].distance(moved[at]));
            assert!((after / before - 1.0).abs() < 0.03, "ring {ring}: {before} m became {after} m");
        }
    }
}

#[test]
fn wrong_counts_are_refused() {
    let garment = small_garment();
    let transfer = Transfer::new(&garment).unwrap();
    let positions_m = &garment.data().mesh.positions_m;
    let few = transfer.tailored(&garment, &positions_m[1..], &joints_m(&garment));
    assert!(matches!(few, Err(InvalidGarment::Length { what: "fitted positions", .. })));
    let few = transfer.tailored(&garment, positions_m, &[]);
    assert!(matches!(few, Err(InvalidGarment::Length { what: "joints of the wearer", .. })));
    let lost = vec![Vec3::NAN; positions_m.len()];
    assert_eq!(transfer.tailored(&garment, &lost, &joints_m(&garment)).err(), Some(InvalidGarment::Position(0)));
}

#[test]
fn a_wearer_between_bodies_has_joints_between_theirs() {
    let fit: FitData = small_fit();
    assert_eq!(fit.joints_m(&[0.0, 1.0, 0.0]), fit.bodies[1].joints_m);
    let middle = fit.joints_m(&[0.5, 0.0, 0.5])[3];
    assert!(middle.abs_diff_eq((fit.bodies[0].joints_m[3] + fit.bodies[2].joints_m[3]) / 2.0, 1e-6));
}

/// From the artist's folder through the pack to the kimono of a wearer who is one of the bodies: shape and skeleton are those
/// of that size, and the arm takes the sleeve along.
#[test]
fn a_wearer_gets_a_kimono_that_moves() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("garments/tube");
    let source = kitsuke_pipeline::load(&folder).garment.unwrap();
    let cache = tempfile::tempdir().unwrap();
    let built = build_garment(&source, &Memo::new(cache.path()), &|_| ()).unwrap();
    let pack = Pack::open(&built.pack).unwrap();
    let garment = pack.garment();
    let tailor = Tailor::new(garment, pack.fit_data().unwrap().unwrap()).unwrap();
    let fitter = tailor.fitter();
    assert_eq!(fitter.data().rules, source.rules, "the pack alone says how long a kimono should be");
    assert_eq!(fitter.data().rules[0].name, "plain");

    let (body, size) = (&fitter.data().bodies[2], &source.sizes.as_ref().unwrap().shapes[1]);
    let tall = tailor.fitted(garment, &body.measurements, 0).unwrap().garment;
    let (mesh, base) = (&tall.data().mesh, &garment.data().mesh);
    for (v, (place_m, &source)) in mesh.positions_m.iter().zip(&mesh.source_vertex).enumerate() {
        let error_m = place_m.distance(size.positions_m[source as usize]);
        assert!(error_m < 2e-3, "vertex {v} lies {error_m} m off the size");
    }
    assert_ne!(mesh.uv, base.uv);
    assert!(mesh.uv.iter().all(|uv| uv.is_finite()));
    for (joint_m, wanted_m) in joints_m(&tall).iter().zip(&body.joints_m) {
        assert!(joint_m.distance(*wanted_m) < 2e-3, "{joint_m}, not {wanted_m}");
    }

    let pose = Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(-1.0));
    let shot = Shot { name: String::new(), pose, blend: Blend::Kernel(tall.kernel()) };
    let lowest_sleeve_m = |garment: &Garment| {
        let mesh = &garment.data().mesh;
        let mut stage = Stage::new(garment);
        let posed_m = stage.show(&shot).0;
        assert!(posed_m.iter().all(|place_m| place_m.is_finite()));
        let sleeve = (0..mesh.positions_m.len()).filter(|&v| base.positions_m[v].x > 0.4);
        sleeve.map(|v| posed_m[v].y).fold(f32::INFINITY, f32::min)
    };
    // Who is a tenth taller holds a somewhat shorter sleeve more than a tenth higher.
    let ratio = lowest_sleeve_m(&tall) / lowest_sleeve_m(garment);
    assert!((ratio - 1.1).abs() < 0.05, "{ratio}");

    let unknown = Measurements::default().with(Measurement::BustGirth, 0.9);
    let error = tailor.fitted(garment, &unknown, 0).unwrap_err();
    assert!(matches!(error, TailorError::Fit(FitError::Rules(_))), "{error}");
}
