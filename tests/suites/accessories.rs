//! What comes with a kimono in its pack: obi, texture, measured paths.

use glam::{Affine3A, Quat, Vec3};
use kitsuke::accessories::{Accessories, Obi};
use kitsuke::pack::write::{write, write_with};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, OpenError, Pack, Scratch, evaluate};
use kitsuke_pipeline::memo::Memo;
use kitsuke_pipeline::{build_garment, ir};
use kitsuke_tests::container::Container;
use kitsuke_tests::{random, small_accessories, small_garment};
use std::path::Path;
use std::sync::OnceLock;

#[test]
fn they_come_back_exactly() {
    let garment = small_garment();
    let whole = small_accessories();
    let without_image = {
        let mut some = whole.clone();
        some.texture.as_mut().unwrap().png.clear();
        some
    };
    let obi_alone = Accessories { obi: whole.obi.clone(), ..Accessories::default() };
    for accessories in [whole, without_image, obi_alone, Accessories::default()] {
        let pack = write_with(&garment, &accessories, None).unwrap();
        assert_eq!(*Pack::open(&pack).unwrap().accessories(), accessories);
    }
    assert_eq!(write_with(&garment, &Accessories::default(), None).unwrap(), write(&garment));
}

/// The writer refuses what the reader would; the reader refuses what no writer wrote.
#[test]
fn each_rule_is_kept() {
    let garment = small_garment();
    let refused = |change: &dyn Fn(&mut Accessories)| {
        let mut accessories = small_accessories();
        change(&mut accessories);
        write_with(&garment, &accessories, None).unwrap_err().to_string()
    };
    let obi = |change: &dyn Fn(&mut Obi)| refused(&|all| change(all.obi.as_mut().unwrap()));
    insta::assert_snapshot!(
        refused(&|all| all.body = "b\n".to_owned()),
        @"the body's name must be at most 256 bytes of printable text"
    );
    insta::assert_snapshot!(
        refused(&|all| all.texture.as_mut().unwrap().name.clear()),
        @"the texture's name must be 1 to 256 bytes of printable text"
    );
    insta::assert_snapshot!(
        refused(&|all| all.texture.as_mut().unwrap().size_px = [0, 9]),
        @"a texture of 0 x 9 pixels is not possible; 1 to 16384 on each side are"
    );
    insta::assert_snapshot!(
        refused(&|all| all.texture.as_mut().unwrap().size_px = [3, 3]),
        @"the texture's image is no PNG of 3 x 3 pixels"
    );
    insta::assert_snapshot!(
        refused(&|all| all.texture.as_mut().unwrap().png.truncate(20)),
        @"the texture's image is no PNG of 3 x 2 pixels"
    );
    insta::assert_snapshot!(obi(&|obi| obi.triangles.clear()), @"there are 0 triangles of the obi; 1 to 524288 are possible");
    insta::assert_snapshot!(obi(&|obi| obi.skin.truncate(11)), @"there are 11 skin weights of the obi instead of 12");
    insta::assert_snapshot!(
        obi(&|obi| obi.positions_m[3].y = f32::NAN),
        @"the position of the obi's vertex 3 is not within 100 m of the origin"
    );
    insta::assert_snapshot!(
        obi(&|obi| obi.triangles[1][2] = 12),
        @"triangle 1 of the obi has a corner that does not exist"
    );
    insta::assert_snapshot!(
        obi(&|obi| obi.skin[2].joints[3] = 99),
        @"the obi's vertex 2 follows a joint that the skeleton lacks, or its weights do not sum to 65535"
    );
    insta::assert_snapshot!(
        obi(&|obi| obi.skin[4].weights[0] -= 1),
        @"the obi's vertex 4 follows a joint that the skeleton lacks, or its weights do not sum to 65535"
    );
    insta::assert_snapshot!(
        refused(&|all| all.paths[1].name = "sode_haba".to_owned()),
        @"path 0 must have a name of its own, 1 to 256 bytes of printable text"
    );
    insta::assert_snapshot!(
        refused(&|all| all.paths[1].vertices = vec![0, 60]),
        @"path 1 must join two or more unique vertices of the mesh, with an offset within 100 m"
    );
    insta::assert_snapshot!(
        refused(&|all| all.paths[0].offset_m = f32::INFINITY),
        @"path 0 must join two or more unique vertices of the mesh, with an offset within 100 m"
    );

    let pack = write_with(&garment, &small_accessories(), None).unwrap();
    let mut container = Container::of(&pack).uncompressed();
    container.sections.retain(|section| section.tag != *b"ACCS");
    assert!(matches!(Pack::open(&container.to_pack()), Err(OpenError::Missing(tag)) if tag.0 == *b"ACCS"));
}

/// Whatever the bytes, there is an answer; and what opens can be posed and measured.
#[test]
fn damaged_accessories_never_panic() {
    let pack = write_with(&small_garment(), &small_accessories(), None).unwrap();
    let sound = Container::of(&pack).uncompressed();
    let at = sound.sections.iter().position(|section| section.tag == *b"ACCS").unwrap();
    let mut numbers = random::Numbers(5);
    let mut opened = 0;
    for _ in 0..3000 {
        let mut container = sound.clone();
        let stored = &mut container.sections[at].stored;
        for _ in 0..=numbers.below(3) {
            let place = numbers.below(stored.len());
            stored[place] = match numbers.below(3) {
                0 => 255,
                1 => stored[place] ^ (1 << numbers.below(8)),
                _ => numbers.bits() as u8,
            };
        }
        if let Ok(pack) = Pack::open(&container.to_pack()) {
            opened += 1;
            let (garment, accessories) = (pack.garment(), pack.accessories());
            if let Some(obi) = &accessories.obi {
                posed(obi, garment, &numbers.pose());
            }
            for path in &accessories.paths {
                let _ = path.length_m(&garment.data().mesh.positions_m);
            }
        }
    }
    assert!(opened > 50, "some damage is to numbers that may be any: {opened}");
}

fn posed(obi: &Obi, garment: &kitsuke::Garment, pose: &Pose) -> Vec<Vec3> {
    let mut frames = vec![Affine3A::IDENTITY; garment.data().skeleton.frame_count()];
    let mut positions_m = vec![Vec3::ZERO; obi.positions_m.len()];
    obi.pose(garment, pose, &mut frames, &mut positions_m);
    positions_m
}

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn komon() -> &'static (ir::Garment, Pack) {
    static KOMON: OnceLock<(ir::Garment, Pack)> = OnceLock::new();
    KOMON.get_or_init(|| {
        let mut source = kitsuke_pipeline::load(&repository().join("assets-src/komon")).garment.unwrap();
        // What comes with it does not depend on these, which take long.
        source.targets.truncate(2);
        (source.correctives, source.sizes) = (0, None);
        source.drivers.retain(|driver| driver.layer == 0);
        source.pose_limits.clear();
        let memo = Memo::new(&tempfile::tempdir().unwrap().path().join("stages"));
        let built = build_garment(&source, &memo, &|_| ()).unwrap();
        let pack = Pack::open(&built.pack).unwrap();
        (source, pack)
    })
}

/// The paths of komon, measured on the shape in the pack, are as long as on the artist's base.
#[test]
fn komon_brings_paths_texture_and_body() {
    let (source, pack) = komon();
    let accessories = pack.accessories();
    assert_eq!(accessories.body, "b04");
    assert_eq!(accessories.texture, source.texture);
    assert_eq!(accessories.texture.as_ref().unwrap().size_px, [2048, 2048]);
    assert_eq!(accessories.paths.len(), source.paths.len());
    let base_m = &source.base.positions_m;
    for (path, measured) in accessories.paths.iter().zip(&source.paths) {
        let edges = measured.vertices.windows(2).map(|v| base_m[v[0] as usize].distance(base_m[v[1] as usize]));
        let expected_m = edges.sum::<f32>() + measured.offset_m;
        let length_m = path.length_m(&pack.garment().data().mesh.positions_m);
        assert!((length_m - expected_m).abs() < 1e-5, "{}: {length_m} instead of {expected_m}", path.name);
    }
    assert!(accessories.paths.iter().any(|path| path.ja == "袖丈"));
}

/// The obi keeps its shape and its distance from the cloth: it is tied.
#[test]
fn komons_obi_goes_with_the_cloth_under_it() {
    let (source, pack) = komon();
    let obi = pack.accessories().obi.as_ref().unwrap();
    assert_eq!(obi.positions_m, source.obi.as_ref().unwrap().positions_m);
    let garment = pack.garment();
    let rest_m = posed(obi, garment, &Pose::REST);
    let farthest_m = rest_m.iter().zip(&obi.positions_m).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(farthest_m < 1e-5, "in the T-pose it lies as it was made: {farthest_m}");

    let bent = Pose::REST.with(Bone::Spine, Quat::from_rotation_x(0.3)).with(Bone::Hips, Quat::from_rotation_y(0.8));
    let moved_m = posed(obi, garment, &bent);
    let mut scratch = Scratch::new(garment);
    let mut cloth_m = vec![Vec3::ZERO; garment.vertex_count()];
    evaluate(garment, &bent, &mut scratch, Frame { positions_m: &mut cloth_m, normals: &mut [] });
    let nearest_m = |places_m: &[Vec3], p: &Vec3| places_m.iter().map(|q| q.distance(*p)).fold(f32::MAX, f32::min);
    let base_m = &garment.data().mesh.positions_m;
    for (moved, rest) in moved_m.iter().zip(&rest_m).step_by(7) {
        let [now_m, before_m] = [nearest_m(&cloth_m, moved), nearest_m(base_m, rest)];
        assert!((now_m - before_m).abs() < 0.01, "{before_m} m off the cloth before, {now_m} now");
    }
}

#[test]
fn a_fitted_obi_goes_where_the_cloth_goes() {
    let (_, pack) = komon();
    let obi = pack.accessories().obi.as_ref().unwrap();
    let base_m = &pack.garment().data().mesh.positions_m;
    let wider_m: Vec<Vec3> = base_m.iter().map(|p| *p * Vec3::new(1.1, 1.0, 1.1) + Vec3::Y * 0.05).collect();
    for (place_m, fitted_m) in obi.positions_m.iter().zip(&obi.fitted(base_m, &wider_m).positions_m) {
        let wanted_m = *place_m * Vec3::new(1.1, 1.0, 1.1) + Vec3::Y * 0.05;
        assert!(fitted_m.distance(wanted_m) < 0.006, "{fitted_m} instead of {wanted_m}");
    }
}

#[test]
fn frames_without_normals_have_the_same_positions() {
    let garment = small_garment();
    let mut scratch = Scratch::new(&garment);
    let pose = random::Numbers(9).pose();
    let count = garment.vertex_count();
    let [mut with_m, mut without_m, mut normals] = [(); 3].map(|()| vec![Vec3::ZERO; count]);
    evaluate(&garment, &pose, &mut scratch, Frame { positions_m: &mut with_m, normals: &mut normals });
    evaluate(&garment, &pose, &mut scratch, Frame { positions_m: &mut without_m, normals: &mut [] });
    assert_eq!(with_m, without_m);
    assert!(normals.iter().all(|normal| normal.is_normalized()));
}
