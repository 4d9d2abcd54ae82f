//! What reads bytes that nobody vouches for, as functions of the bytes: nothing may panic, and what comes out must be valid. The
//! fuzz targets in `fuzz/` and the tests that replay their corpus call the same functions.

use crate::container::{Container, Section, repair};
use crate::random::Numbers;
use glam::{Affine3A, Vec3};
use kitsuke::fit::{FitData, Fitter, Scratch as FitScratch};
use kitsuke::skeleton::vmc::Receiver;
use kitsuke::skeleton::{Bone, Joint, Pose, Skeleton, bvh, recording, vrma};
use kitsuke::{Frame, Garment, Pack, Scratch, evaluate};
use kitsuke_pipeline::source;
use std::sync::LazyLock;

/// The name of a fuzz target and what it feeds.
pub type Target = (&'static str, fn(&[u8]));

/// One function per fuzz target.
pub const TARGETS: [Target; 11] = [
    ("osc", osc),
    ("bvh", bvh_text),
    ("json", json),
    ("glb", glb),
    ("body", body),
    ("obj", obj),
    ("ply", ply),
    ("gltf_mesh", gltf_mesh),
    ("pack", pack),
    ("pack_sections", pack_sections),
    ("pack_fields", pack_fields),
];

/// Datagrams, each behind its length as two bytes, as a sender might interleave them; the time goes on by 10 ms each.
pub fn osc(bytes: &[u8]) {
    let mut receiver = Receiver::new(&small_wearer());
    let (mut rest, mut now_s) = (bytes, 0.0);
    while let Some((length, after)) = rest.split_first_chunk::<2>() {
        let (datagram, after) = after.split_at(usize::from(u16::from_le_bytes(*length)).min(after.len()));
        receiver.datagram(datagram, now_s, |tracked| assert!(tracked.pose.is_valid(), "{tracked:?}"));
        if datagram.len() % 7 == 6 {
            receiver.calibrate();
        }
        now_s += 0.01;
        rest = after;
    }
    assert!(receiver.pose(now_s, 0.5).pose.is_valid());
}

/// BVH text.
pub fn bvh_text(bytes: &[u8]) {
    if let Ok(motion) = bvh::read(bytes, &small_wearer()) {
        assert!(!motion.poses.is_empty() && motion.poses.iter().all(kitsuke::skeleton::Pose::is_valid));
    }
}

/// Everything that is told apart by content: JSON Lines, MediaPipe, DeepMimic, Kinect.
pub fn json(bytes: &[u8]) {
    if let Ok(recording) = recording::read(bytes, &small_wearer()) {
        assert!(recording.frames.iter().all(|frame| frame.pose.is_valid()));
        assert!(!recording.frames.is_empty() && recording.frames.len() == recording.times_s.len());
        assert!(recording.times_s.windows(2).all(|pair| pair[0] <= pair[1]));
    }
}

/// VRM animation, as JSON, a zero byte and the binary part.
pub fn glb(bytes: &[u8]) {
    let file = binary_gltf(bytes);
    if let Ok(recording) = vrma::read(&file, &small_wearer()) {
        assert!(!recording.frames.is_empty() && recording.frames.iter().all(|frame| frame.pose.is_valid()));
    }
    if let Ok(rest) = vrma::read_rest(&file) {
        assert!(rest.local.iter().chain(&rest.world).all(|rotation| rotation.is_normalized()));
    }
    json(bytes);
}

/// A wearer's body, as JSON, a zero byte and the binary part.
pub fn body(bytes: &[u8]) {
    let mut report = Vec::new();
    if let Some(body) = source::body::read("body.glb", &binary_gltf(bytes), &mut report) {
        let count = body.surface.positions_m.len();
        assert!(body.surface.positions_m.iter().all(|place_m| place_m.is_finite()) && body.skin.len() == count);
        assert!(body.surface.triangles.iter().flatten().all(|&v| (v as usize) < count));
        let joints = body.skeleton.joints().len();
        let is_sound = |row: &[(u8, f32); 4]| {
            let sum: f32 = row.iter().map(|(_, weight)| weight).sum();
            (sum - 1.0).abs() < 1e-3 && row.iter().all(|(joint, _)| usize::from(*joint) < joints)
        };
        assert!(body.skin.iter().all(is_sound));
    } else {
        assert!(!report.is_empty());
    }
}

/// OBJ text.
pub fn obj(bytes: &[u8]) {
    let mut report = Vec::new();
    match source::obj::read("mesh.obj", bytes, &mut report) {
        Some(mesh) => {
            let count = mesh.positions.len();
            assert!(mesh.positions.iter().all(|position| position.is_finite()));
            assert!(mesh.triangulate().corners.iter().flatten().all(|corner| (corner.vertex as usize) < count));
        }
        None => assert!(!report.is_empty()),
    }
}

/// PLY, text and binary.
pub fn ply(bytes: &[u8]) {
    imported("mesh.ply", bytes);
}

/// A mesh of any kind of glTF, as JSON, a zero byte and the binary part.
pub fn gltf_mesh(bytes: &[u8]) {
    imported("mesh.glb", &binary_gltf(bytes));
}

fn imported(file: &str, bytes: &[u8]) {
    let mut report = Vec::new();
    let Some(mesh) = source::import::read_bytes(file, bytes, None, &mut report) else {
        assert!(!report.is_empty());
        return;
    };
    let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
    assert!(vertices > 0 && mesh.positions.iter().all(|position| position.is_finite()));
    assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < vertices));
    assert!(mesh.colours.is_empty() || mesh.colours.len() == vertices);
    assert!(mesh.uv.is_empty() || mesh.uv.len() == triangles);
    assert!(mesh.uv.iter().flatten().all(|uv| uv.is_finite()));
    assert_eq!(mesh.part_of_triangle.len(), triangles);
    assert!(mesh.part_of_triangle.iter().all(|&part| (part as usize) < mesh.parts.len()));
    let soundness = mesh.soundness();
    assert!(soundness.components <= triangles && soundness.unused <= vertices);
}

/// A pack, its checksums made right.
pub fn pack(bytes: &[u8]) {
    let mut pack = bytes.to_vec();
    repair(&mut pack);
    open(&pack);
}

/// The small pack with another content of one section: its number, then the content.
pub fn pack_sections(bytes: &[u8]) {
    with_section(bytes, |_| true);
}

/// The same of the sections whose entropy coders stand behind counts and names.
pub fn pack_fields(bytes: &[u8]) {
    with_section(bytes, |section| FIELDS.contains(&section.tag));
}

/// The sections that [`pack_fields`] tries.
pub const FIELDS: [[u8; 4]; 3] = [*b"TGTS", *b"FLDS", *b"SFLD"];

fn with_section(bytes: &[u8], is_meant: impl Fn(&Section) -> bool) {
    let Some((&number, content)) = bytes.split_first() else { return };
    let mut pack = SMALL_PACK.clone();
    let mut meant: Vec<&mut Section> = pack.sections.iter_mut().filter(|section| is_meant(section)).collect();
    let number = usize::from(number) % meant.len();
    meant[number].stored = content.to_vec();
    meant[number].decoded_length = content.len() as u32;
    // Of the two that say the same the older one is read.
    if meant[number].tag == *b"SFLD" {
        pack.sections.retain(|section| section.tag != *b"FLDS");
    }
    open(&pack.to_pack());
}

/// A pack with every section that there is or was, none of them compressed.
pub static SMALL_PACK: LazyLock<Container> = LazyLock::new(|| {
    let mut pack = Container::of(include_bytes!("packs/v5_2.kitsuke")).uncompressed();
    let mut newer = Container::of(include_bytes!("packs/v5_3.kitsuke")).uncompressed();
    pack.minor = newer.minor;
    pack.sections.push(newer.section(b"SFLD").clone());
    pack
});

/// What a pack may decode to here, so that an input takes little time and memory.
const DECODED_BYTES: usize = 1 << 20;

/// Opens a pack and does with it what an app does: frames, what comes with it, a fit.
fn open(bytes: &[u8]) {
    let Ok(pack) = Pack::open_with_limit(bytes, DECODED_BYTES) else { return };
    let garment = pack.garment();
    let mut numbers = Numbers(7);
    let poses = [Pose::REST, numbers.pose(), garment.limited(&numbers.pose()).pose];
    frames_are_finite(garment, &poses);
    let accessories = pack.accessories();
    if let Some(obi) = &accessories.obi {
        let mut posed_from_rest = vec![Affine3A::IDENTITY; garment.data().skeleton.frame_count()];
        let mut positions_m = vec![Vec3::NAN; obi.positions_m.len()];
        for pose in &poses {
            obi.pose(garment, pose, &mut posed_from_rest, &mut positions_m);
            assert!(positions_m.iter().all(|place_m| place_m.is_finite()), "the obi in {pose:?}");
        }
    }
    let mut lengths_m = accessories.paths.iter().map(|path| path.length_m(&garment.data().mesh.positions_m));
    assert!(lengths_m.all(f32::is_finite));
    if let Ok(Some(fit)) = pack.fit_data() {
        fits_are_finite(garment, fit);
    }
}

fn frames_are_finite(garment: &Garment, poses: &[Pose]) {
    let mut scratch = Scratch::new(garment);
    let mut positions_m = vec![Vec3::NAN; garment.vertex_count()];
    let mut normals = positions_m.clone();
    for pose in poses {
        evaluate(garment, pose, &mut scratch, Frame { positions_m: &mut positions_m, normals: &mut normals });
        let is_finite = positions_m.iter().chain(&normals).all(|vector| vector.is_finite());
        assert!(is_finite, "not finite in {pose:?}");
    }
}

/// By every rule set for every body that the fit knows, where it is small.
fn fits_are_finite(garment: &Garment, fit: FitData) {
    assert!(fit.uv.iter().flatten().all(|uv| uv.is_finite()));
    if fit.fields.len() > 16 || garment.unique_count() > 1000 {
        return;
    }
    let Ok(fitter) = Fitter::new(garment, fit) else { return };
    let mut scratch = FitScratch::default();
    let mut shape_m = vec![Vec3::NAN; garment.unique_count()];
    for rules in 0..fitter.data().rules.len().min(3) {
        for body in fitter.data().bodies.iter().take(3) {
            let Ok(fit) = fitter.fit(&body.measurements, rules, &mut scratch) else { continue };
            assert!(fit.weights.iter().all(|weight| weight.is_finite()), "{fit:?}");
            assert!(!fitter.explain(&fit, &body.measurements).is_empty());
            fitter.shape(&fit, &mut shape_m);
            assert!(shape_m.iter().all(|place_m| place_m.is_finite()), "{fit:?}");
        }
    }
}

/// The JSON up to the first zero byte, the binary part after it, so that a fuzzer need not count bytes.
fn binary_gltf(bytes: &[u8]) -> Vec<u8> {
    let middle = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let mut file = b"glTF\x02\0\0\0".to_vec();
    let chunks = [(b"JSON", &bytes[..middle]), (b"BIN\0", bytes.get(middle + 1..).unwrap_or_default())];
    let padded = |chunk: &[u8]| chunk.len().next_multiple_of(4);
    let length = 12 + chunks.iter().map(|(_, chunk)| 8 + padded(chunk)).sum::<usize>();
    file.extend((length as u32).to_le_bytes());
    for (kind, chunk) in chunks {
        file.extend((padded(chunk) as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
        file.resize(file.len().next_multiple_of(4), b' ');
    }
    file
}

fn small_wearer() -> Skeleton {
    let joints = [
        (Bone::Hips, None, Vec3::new(0.0, 0.8, 0.0)),
        (Bone::Chest, Some(0), Vec3::new(0.0, 1.0, 0.0)),
        (Bone::LeftUpperArm, Some(1), Vec3::new(0.15, 1.2, 0.0)),
        (Bone::LeftLowerArm, Some(2), Vec3::new(0.4, 1.2, 0.0)),
        (Bone::LeftHand, Some(3), Vec3::new(0.6, 1.2, 0.0)),
        (Bone::RightUpperArm, Some(1), Vec3::new(-0.15, 1.2, 0.0)),
        (Bone::RightLowerArm, Some(5), Vec3::new(-0.4, 1.2, 0.0)),
        (Bone::LeftUpperLeg, Some(0), Vec3::new(0.1, 0.8, 0.0)),
        (Bone::LeftLowerLeg, Some(7), Vec3::new(0.1, 0.4, 0.0)),
        (Bone::LeftFoot, Some(8), Vec3::new(0.1, 0.1, 0.0)),
    ];
    let joint = |&(bone, parent, rest_m): &(Bone, Option<u8>, Vec3)| Joint { bone, parent, rest_m };
    Skeleton::new(joints.iter().map(joint).collect()).expect("the small wearer is a skeleton")
}
