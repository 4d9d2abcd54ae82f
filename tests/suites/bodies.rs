//! Bodies as other programs write them: each is read as the body that it is, or refused with the reason. The doll and what is done to it are
//! known, so what must come out is known without the reader.

use glam::{DMat4, DQuat, DVec3, Mat4, Vec3};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke_pipeline::diagnostic::Diagnostic;
use kitsuke_pipeline::ir::Body;
use kitsuke_pipeline::source::body::read;
use kitsuke_tests::doll::{Doll, File, Rig};
use serde_json::json;
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// Positions may differ by this much, metres: files hold 32-bit numbers.
const SAME_M: f64 = 5e-6;

fn read_body(bytes: &[u8]) -> Result<(Body, Vec<String>), Box<Diagnostic>> {
    let mut report = Vec::new();
    match read("body.glb", bytes, &mut report) {
        Some(body) => Ok((body, report.into_iter().map(|warning| warning.code.into_owned()).collect())),
        None => Err(Box::new(report.remove(0))),
    }
}

/// The body must be the doll: every joint at its place, every triangle where it was, moved by the same weights.
fn assert_is_doll(what: &str, body: &Body, doll: &Doll) {
    for (name, _, place_m) in &doll.joints {
        let rest_m = body.skeleton.rest_m(Bone::from_name(name).unwrap()).unwrap_or_else(|| panic!("{what}: {name}"));
        assert!(rest_m.as_dvec3().distance(*place_m) < SAME_M, "{what}: {name} rests at {rest_m}, not {place_m}");
    }
    // Skins may have parted the triangles; each stands for itself.
    let of_body = |triangle: &[u32; 3]| {
        let corner = |v: u32| {
            let rows = body.skin[v as usize].iter().filter(|(_, weight)| *weight > 0.0);
            let mut rows: Vec<(String, i32)> = rows
                .map(|(slot, w)| {
                    (body.skeleton.joints()[usize::from(*slot)].bone.name().to_owned(), (w * 1e4).round() as i32)
                })
                .collect();
            rows.sort();
            (body.surface.positions_m[v as usize].as_dvec3(), rows)
        };
        triangle.map(corner)
    };
    let of_doll = |triangle: &[u32; 3]| {
        let corner = |v: u32| {
            let rows = doll.rows[v as usize].iter().filter(|(_, weight)| *weight > 0.0);
            let mut rows: Vec<(String, i32)> =
                rows.map(|(joint, w)| (doll.joints[*joint].0.clone(), (w * 1e4).round() as i32)).collect();
            rows.sort();
            (doll.positions_m[v as usize], rows)
        };
        triangle.map(corner)
    };
    assert_eq!(body.surface.triangles.len(), doll.triangles.len(), "{what}");
    let mut left: Vec<_> = body.surface.triangles.iter().map(of_body).collect();
    for triangle in doll.triangles.iter().map(of_doll) {
        let is_same = |other: &[(DVec3, Vec<(String, i32)>); 3]| {
            other.iter().zip(&triangle).all(|(a, b)| a.0.distance(b.0) < SAME_M && a.1 == b.1)
        };
        let found = left.iter().position(is_same).unwrap_or_else(|| panic!("{what}: no triangle at {:?}", triangle[0]));
        left.swap_remove(found);
    }
}

/// Some turn that differs from joint to joint.
fn odd_turn(joint: usize) -> DQuat {
    let j = joint as f64;
    DQuat::from_euler(glam::EulerRot::XYZ, 0.7 + j, 1.9 * j - 0.4, 0.3 - 0.8 * j)
}

fn mixamo(name: &str) -> String {
    let bare = match name {
        "hips" => "Hips".into(),
        "spine" => "Spine".into(),
        "chest" => "Spine1".into(),
        "neck" => "Neck".into(),
        "head" => "Head".into(),
        sided => {
            let (side, rest) =
                if let Some(rest) = sided.strip_prefix("left") { ("Left", rest) } else { ("Right", &sided[5..]) };
            let rest = match rest {
                "UpperArm" => "Arm",
                "LowerArm" => "ForeArm",
                "UpperLeg" => "UpLeg",
                "LowerLeg" => "Leg",
                other => other,
            };
            format!("{side}{rest}")
        }
    };
    format!("mixamorig:{bare}")
}

/// Names as Sketchfab's converter writes them.
fn numbered(name: &str) -> String {
    format!("{}_0{}", mixamo(name), name.len())
}

fn vroid(name: &str) -> String {
    let upper = |name: &str| format!("{}{}", name[..1].to_uppercase(), &name[1..]);
    match (name.strip_prefix("left"), name.strip_prefix("right")) {
        (Some(rest), _) => format!("J_Bip_L_{rest}"),
        (_, Some(rest)) => format!("J_Bip_R_{rest}"),
        _ => format!("J_Bip_C_{}", upper(name)),
    }
}

fn armature(scale: f64) -> (DVec3, DQuat, f64) {
    (DVec3::new(0.0, 0.0, 0.0), DQuat::from_rotation_x(-FRAC_PI_2), scale)
}

/// The armature's own transform, into whose space its mesh is bound.
fn from_armature(scale: f64) -> DMat4 {
    let (at, turn, scale) = armature(scale);
    DMat4::from_scale_rotation_translation(DVec3::splat(scale), turn, at).inverse()
}

type Case = (&'static str, File, Vec<&'static str>);

/// Every way of writing the doll that must give the doll, and which warnings it must give.
fn sound(doll: &Doll) -> Vec<Case> {
    let plain = || doll.written(&Rig::default());
    let mut cases: Vec<Case> = vec![
        ("plain", plain(), vec![]),
        ("joints turned along their bones", doll.written(&Rig { turned: &odd_turn, ..Rig::default() }), vec![]),
        (
            "centimetres, Z up, under a scaled armature",
            doll.written(&Rig { above: armature(0.01), mesh_from_world: from_armature(0.01), ..Rig::default() }),
            vec![],
        ),
        (
            "metres under a turned armature, joints turned too",
            doll.written(&Rig {
                above: armature(1.0),
                mesh_from_world: from_armature(1.0),
                turned: &odd_turn,
                ..Rig::default()
            }),
            vec![],
        ),
        (
            "a mesh in a space of its own",
            doll.written(&Rig {
                mesh_from_world: DMat4::from_scale_rotation_translation(
                    DVec3::splat(37.0),
                    DQuat::from_rotation_y(1.1),
                    DVec3::new(900.0, -20.0, 3.0),
                ),
                ..Rig::default()
            }),
            vec![],
        ),
        ("Mixamo's names", doll.written(&Rig { name: &mixamo, ..Rig::default() }), vec![]),
        ("Sketchfab's numbers", doll.written(&Rig { name: &numbered, ..Rig::default() }), vec![]),
        ("VRoid's names", doll.written(&Rig { name: &vroid, ..Rig::default() }), vec![]),
        (
            "two skins, joints in another order",
            doll.written(&Rig { skin_of: &|triangle| usize::from(triangle[0] % 3 == 0), ..Rig::default() }),
            vec![],
        ),
        (
            "three skins over turned joints",
            doll.written(&Rig { skin_of: &|triangle| (triangle[0] % 3) as usize, turned: &odd_turn, ..Rig::default() }),
            vec![],
        ),
        (
            "a walking pose is shown",
            doll.written(&Rig {
                shown: &|joint| DQuat::from_rotation_x(0.3 * ((joint % 5) as f64 - 2.0)),
                ..Rig::default()
            }),
            vec!["body-pose"],
        ),
        (
            "a walking pose is shown under a scaled armature",
            doll.written(&Rig {
                above: armature(0.01),
                mesh_from_world: from_armature(0.01),
                shown: &|joint| DQuat::from_rotation_x(0.3 * ((joint % 5) as f64 - 2.0)),
                ..Rig::default()
            }),
            vec!["body-pose"],
        ),
    ];

    // Shapes: the mesh is another one until they are on.
    let ways: Vec<DVec3> =
        (0..doll.positions_m.len()).map(|v| DVec3::new(0.01, -0.02, 0.03) * (v % 4) as f64).collect();
    let other = Doll {
        positions_m: doll.positions_m.iter().zip(&ways).map(|(p, way)| p - 0.5 * way).collect(),
        ..doll.clone()
    };
    let floats: Vec<f32> = ways.iter().flat_map(|way| way.as_vec3().to_array()).collect();
    for (what, on_node) in [("a shape is on by the mesh", false), ("a shape is on by the node", true)] {
        let mut file = other.written(&Rig::default());
        let moves = file.floats("VEC3", &floats);
        // One that moves nothing, without any bytes, as sparse tools write it.
        let still = file.accessor(json!({"componentType": 5126, "count": ways.len(), "type": "VEC3"}));
        file.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": still}, {"POSITION": moves}]);
        file.json["meshes"][0]["weights"] = if on_node { json!([0.0, 9.0]) } else { json!([1.0, 0.5]) };
        if on_node {
            let mesh = file.node("mesh0");
            file.json["nodes"][mesh]["weights"] = json!([0.7, 0.5]);
        }
        cases.push((what, file, vec![]));
    }
    let mut sparse = other.written(&Rig::default());
    let moved: Vec<usize> = (0..ways.len()).filter(|&v| ways[v] != DVec3::ZERO).collect();
    let indices: Vec<u8> = moved.iter().flat_map(|&v| (v as u16).to_le_bytes()).collect();
    let values: Vec<u8> =
        moved.iter().flat_map(|&v| ways[v].as_vec3().to_array()).flat_map(|float| float.to_le_bytes()).collect();
    let (indices, values) = (sparse.view(&indices), sparse.view(&values));
    let moves = sparse.accessor(json!({"componentType": 5126, "count": ways.len(), "type": "VEC3", "sparse": {
        "count": moved.len(), "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": values},
    }}));
    sparse.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": moves}]);
    sparse.json["meshes"][0]["weights"] = json!([0.5]);
    cases.push(("a sparse shape is on", sparse, vec![]));

    // Quantised: whole numbers, their grid in the bind matrices.
    let step = 1.0 / 4096.0;
    let on_grid =
        Doll { positions_m: doll.positions_m.iter().map(|p| (p / step).round() * step).collect(), ..doll.clone() };
    assert!(on_grid.positions_m.iter().zip(&doll.positions_m).all(|(a, b)| a.distance(*b) < 3e-4));
    let grid = DMat4::from_scale(DVec3::splat(1.0 / step));
    let mut quantised = on_grid.written(&Rig { mesh_from_world: grid, ..Rig::default() });
    let words: Vec<u8> = on_grid
        .positions_m
        .iter()
        .flat_map(|p| (p / step).to_array())
        .flat_map(|number| (number.round() as i16).to_le_bytes())
        .collect();
    let view = quantised.view(&words);
    let count = on_grid.positions_m.len();
    let position =
        quantised.accessor(json!({"bufferView": view, "componentType": 5122, "count": count, "type": "VEC3"}));
    quantised.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(position);
    quantised.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    quantised.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    cases.push(("quantised", quantised, vec!["quantised"]));

    // What a body does not need and the glTF library refuses.
    let mut decorated = plain();
    decorated.json["images"] = json!([{"uri": "skin.webp"}]);
    decorated.json["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]);
    decorated.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    decorated.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    decorated.json["extensionsRequired"] = json!(["EXT_texture_webp", "KHR_animation_pointer"]);
    decorated.json["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/x"}}}}],
        "samplers": [{"input": 99, "output": 99}],
    }]);
    cases.push(("WebP pictures and animated pointers", decorated, vec![]));

    // More joints per vertex than four: the same weights, spread.
    let mut eight = plain();
    let halves: Vec<f32> = doll.rows.iter().flatten().map(|(_, weight)| weight / 2.0).collect();
    let joints: Vec<u16> = doll.rows.iter().flatten().map(|(joint, _)| *joint as u16).collect();
    for set in 0..2 {
        let (joints, weights) = (eight.words("VEC4", &joints), eight.floats("VEC4", &halves));
        eight.json["meshes"][0]["primitives"][0]["attributes"][format!("JOINTS_{set}")] = json!(joints);
        eight.json["meshes"][0]["primitives"][0]["attributes"][format!("WEIGHTS_{set}")] = json!(weights);
    }
    cases.push(("eight joints per vertex", eight, vec![]));

    // Hair and twist joints: half of what the head and an arm move, they move.
    let with_others = |names: fn(&str) -> String| {
        let mut more = doll.clone();
        for (bone, name) in [("head", "hair_01"), ("leftLowerArm", "twist.L")] {
            let at = more.joints.iter().position(|(own, ..)| own == bone).unwrap();
            more.joints.push((name.to_owned(), Some(at), more.joints[at].2 + DVec3::new(0.02, 0.01, 0.0)));
            let other = more.joints.len() - 1;
            for row in &mut more.rows {
                let Some(place) = row.iter().position(|(joint, weight)| *joint == at && *weight > 0.0) else {
                    continue;
                };
                let Some(free) = row.iter().position(|(_, weight)| *weight == 0.0) else { continue };
                row[place].1 /= 2.0;
                row[free] = (other, row[place].1);
            }
        }
        more.written(&Rig { name: &names, turned: &odd_turn, ..Rig::default() })
    };
    cases.push(("hair and twist joints", with_others(str::to_owned), vec!["body-joints"]));

    // VRM says which node is which bone, whatever it is called; VRM 0.x faces -Z.
    fn nameless(name: &str) -> String {
        let sum: u32 = name.bytes().map(u32::from).sum();
        format!("Knochen{sum}{}", name.len())
    }
    let mut vrm1 = with_others(nameless);
    let bones: serde_json::Map<String, serde_json::Value> =
        doll.joints.iter().map(|(name, ..)| (name.clone(), json!({"node": vrm1.node(&nameless(name))}))).collect();
    vrm1.json["extensions"] = json!({"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}});
    cases.push(("VRM 1.0", vrm1, vec!["body-joints"]));
    let back = doll.moved(DMat4::from_rotation_y(std::f64::consts::PI));
    let mut vrm0 = back.written(&Rig { name: &nameless, ..Rig::default() });
    let bones: Vec<serde_json::Value> =
        doll.joints.iter().map(|(name, ..)| json!({"bone": name, "node": vrm0.node(&nameless(name))})).collect();
    vrm0.json["extensions"] = json!({"VRM": {"humanoid": {"humanBones": bones}}});
    cases.push(("VRM 0.x", vrm0, vec!["body-turned"]));

    // A mesh that no joint moves, and one in no scene.
    let mut props = plain();
    let count = props.json["nodes"].as_array().unwrap().len();
    let mesh = json!({"name": "glasses", "primitives": [props.json["meshes"][0]["primitives"][0].clone()]});
    props.json["meshes"].as_array_mut().unwrap().push(mesh);
    props.json["nodes"].as_array_mut().unwrap().extend([json!({"mesh": 1}), json!({"mesh": 1})]);
    props.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(count));
    cases.push(("glasses without a skin", props, vec!["body-parts"]));
    cases
}

#[test]
fn whatever_wrote_the_doll_it_is_read_as_the_doll() {
    let doll = Doll::read();
    for (what, file, warnings) in sound(&doll) {
        let (body, said) = read_body(&file.glb()).unwrap_or_else(|fault| panic!("{what}: {fault:?}"));
        if warnings == ["quantised"] {
            let step = 1.0 / 4096.0;
            let on_grid = doll.positions_m.iter().map(|p| (p / step).round() * step).collect();
            assert_is_doll(what, &body, &Doll { positions_m: on_grid, ..doll.clone() });
            assert!(said.is_empty(), "{what}: {said:?}");
            continue;
        }
        assert_is_doll(what, &body, &doll);
        assert_eq!(said, warnings, "{what}");
    }
}

/// Programs of today, run by `bodies/blender.py`.
#[test]
fn blender_s_own_bodies_are_the_doll() {
    let doll = Doll::read();
    for file in ["blender_drawn.glb", "blender_mixamo.glb"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("bodies").join(file);
        let (body, said) = read_body(&std::fs::read(path).unwrap()).unwrap();
        assert_is_doll(file, &body, &doll);
        assert!(said.is_empty(), "{file}: {said:?}");
    }
}

#[test]
fn a_body_that_does_not_stand_as_poses_take_for_granted_is_refused_with_the_reason() {
    let doll = Doll::read();
    let arms_down = |degrees: f64| {
        move |name: &str| match name {
            "leftUpperArm" => DQuat::from_rotation_z(-degrees.to_radians()),
            "rightUpperArm" => DQuat::from_rotation_z(degrees.to_radians()),
            _ => DQuat::IDENTITY,
        }
    };
    let forearm_forward = |name: &str| match name {
        "leftLowerArm" => DQuat::from_rotation_y(-0.5),
        _ => DQuat::IDENTITY,
    };
    let written = |doll: &Doll| doll.written(&Rig::default());
    let a_pose = doll.posed(&arms_down(35.0));
    let mut no_binds = written(&doll);
    no_binds.json["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    let mut lost = written(&doll);
    lost.json["meshes"][0]["primitives"][0]["indices"] = json!(99);
    let mut draco = written(&doll);
    draco.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    let mut two = written(&doll);
    let count = two.json["nodes"].as_array().unwrap().len();
    let twin: Vec<serde_json::Value> = two.json["nodes"].as_array().unwrap()[..doll.joints.len()].to_vec();
    two.json["nodes"].as_array_mut().unwrap().extend(twin.into_iter().map(|mut node| {
        node.as_object_mut().unwrap().remove("children");
        node
    }));
    two.json["skins"]
        .as_array_mut()
        .unwrap()
        .push(json!({"joints": (count..count + doll.joints.len()).collect::<Vec<_>>()}));
    let exchanged = |name: &str| match (name.strip_prefix("left"), name.strip_prefix("right")) {
        (Some(rest), _) => format!("right{rest}"),
        (_, Some(rest)) => format!("left{rest}"),
        _ => name.to_owned(),
    };
    let cases: Vec<(&str, File, &[&str])> = vec![
        ("A-pose", written(&a_pose), &["not in a T-pose", "leftUpperArm points 35 degrees down", "rightLowerArm"]),
        (
            "A-pose, joints turned along their bones",
            a_pose.written(&Rig {
                turned: &odd_turn,
                above: armature(0.01),
                mesh_from_world: from_armature(0.01),
                ..Rig::default()
            }),
            &["not in a T-pose", "leftUpperArm points 35 degrees down"],
        ),
        (
            "a forearm forward",
            written(&doll.posed(&forearm_forward)),
            &["not in a T-pose: leftLowerArm points 29 degrees forward"],
        ),
        (
            "skin in A-pose, joints in T-pose",
            written(&Doll { positions_m: a_pose.positions_m.clone(), ..doll.clone() }),
            &["the skin was not bound where the joints rest", "leftLowerArm", "35 degrees down"],
        ),
        ("faces -Z", written(&doll.moved(DMat4::from_rotation_y(std::f64::consts::PI))), &["faces -Z", "face +Z"]),
        ("faces +X", written(&doll.moved(DMat4::from_rotation_y(FRAC_PI_2))), &["faces +X"]),
        ("Z up", written(&doll.moved(DMat4::from_rotation_x(FRAC_PI_2))), &["does not stand", "along +Z"]),
        (
            "centimetres",
            written(&doll.moved(DMat4::from_scale(DVec3::splat(100.0)))),
            &["m large", "centimetres", "0.01"],
        ),
        (
            "left and right exchanged",
            doll.written(&Rig { name: &exchanged, ..Rig::default() }),
            &["left and right are exchanged"],
        ),
        ("no bind matrices", no_binds, &["no bind matrices", "export"]),
        ("a list of triangles that is not there", lost, &["names accessor 99"]),
        ("Draco", draco, &["Draco", "without compression"]),
        ("two bodies", two, &["two joints are called hips", "one body"]),
        (
            "names that say nothing",
            doll.written(&Rig { name: &|name| format!("b{}", name.len()), ..Rig::default() }),
            &["no joint is"],
        ),
        (
            "a misspelt joint",
            doll.written(&Rig { name: &|name| name.replace("leftHand", "leftHond"), ..Rig::default() }),
            &["no joint is leftHand", "did you mean `leftHand`"],
        ),
    ];
    for (what, file, words) in cases {
        let fault = read_body(&file.glb()).err().unwrap_or_else(|| panic!("{what} is read"));
        let said = format!("{} {}", fault.problem, fault.help).to_lowercase();
        for word in words {
            assert!(said.contains(&word.to_lowercase()), "{what}: {word:?} is not in {said:?}");
        }
    }
}

/// Feet tell which way a body faces, so exchanged sides are told from a body that faces backwards.
#[test]
fn feet_tell_exchanged_sides_from_a_body_that_faces_back() {
    let sample = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src/bodies/b04.glb")).unwrap();
    let mut exchanged = sample.clone();
    for at in 0..sample.len() {
        let rest = &sample[at..];
        if rest.starts_with(b"\"left") {
            exchanged.splice(at + 1..at + 5, *b"RIGH");
        } else if rest.starts_with(b"\"right") {
            exchanged.splice(at + 1..at + 6, *b"LEFT ");
        }
    }
    // Names of the same length: RIGHand and LEFT Hand, mended in the text.
    let length = u32::from_le_bytes(exchanged[12..16].try_into().unwrap()) as usize;
    let text = String::from_utf8(exchanged[20..20 + length].to_vec()).unwrap();
    let mut text = text.replace("\"RIGH", "\"right").replace("\"LEFT ", "\"left").trim_end().to_owned().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = sample[..8].to_vec();
    let rest = &sample[20 + length..];
    bytes.extend(((20 + text.len() + rest.len()) as u32).to_le_bytes());
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend(rest);
    let fault = read_body(&bytes).unwrap_err();
    assert!(fault.problem.starts_with("left and right are exchanged"), "{fault:?}");
}

/// A small lean, as sculptors' and scanners' bodies have, is no mistake.
#[test]
fn a_pose_near_the_t_pose_is_read() {
    let doll = Doll::read();
    let nearly = doll.posed(&|name| match name {
        "leftUpperArm" => DQuat::from_rotation_z(-0.12),
        "rightLowerArm" => DQuat::from_rotation_y(0.15),
        "leftUpperLeg" => DQuat::from_rotation_z(0.15),
        _ => DQuat::IDENTITY,
    });
    let (body, said) = read_body(&nearly.written(&Rig::default()).glb()).unwrap();
    assert_is_doll("nearly", &body, &nearly);
    assert!(said.is_empty(), "{said:?}");
}

/// Skins that meet along a seam give a closed body: the same places are inside as in one skin.
#[test]
fn a_seam_between_skins_is_closed() {
    use kitsuke_pipeline::measure::covered::{Limb, area_m2, limb};
    let doll = Doll::read();
    let parted = doll.written(&Rig { skin_of: &|triangle| usize::from(triangle[0] % 2 == 0), ..Rig::default() });
    let [whole, parted] = [doll.written(&Rig::default()), parted].map(|file| read_body(&file.glb()).unwrap().0);
    assert!(parted.surface.positions_m.len() > whole.surface.positions_m.len());
    for part in [Limb::Arms, Limb::Trunk, Limb::Legs] {
        let [a, b] = [&whole, &parted].map(|body| area_m2(body, |v| limb(body, v) == Some(part)));
        assert!((a - b).abs() < 1e-3 * a, "{a} {b}");
    }
    let posed = |body: &Body| {
        let mut places_m = body.posed_m(&Pose::REST.with(Bone::LeftUpperArm, glam::Quat::from_rotation_z(-0.7)));
        places_m.sort_by(|a, b| a.to_array().map(f32::to_bits).cmp(&b.to_array().map(f32::to_bits)));
        places_m.dedup();
        places_m
    };
    assert_eq!(posed(&whole).len(), posed(&parted).len());
}

fn shared(file: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(file);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
    }
    path.exists().then_some(path)
}

/// The reports of people who use other tools, as small files: what is right stands in their README.
#[test]
fn reported_bodies_are_right_or_refused() {
    let Some(reports) = shared("reports") else { return };
    let body = |file: &str| read_body(&std::fs::read(reports.join(file)).unwrap());
    let bounds = |body: &Body| {
        let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        body.surface.positions_m.iter().fold(start, |(low, high), p| (low.min(*p), high.max(*p)))
    };
    let (plain, _) = body("plain/plain.glb").unwrap();
    for (file, vertices) in [
        ("two_skins/two_skins.glb", 2873),
        ("two_skins/arms_own_skin.glb", 2888),
        ("armature_scaled/armature_scaled.glb", 2852),
    ] {
        let (read, said) = body(file).unwrap();
        assert_eq!((read.surface.positions_m.len(), read.surface.triangles.len()), (vertices, 5895), "{file}");
        let ((low, high), (plain_low, plain_high)) = (bounds(&read), bounds(&plain));
        assert!(low.distance(plain_low) < 1e-5 && high.distance(plain_high) < 1e-5, "{file}: {low} {high}");
        for (a, b) in read.skeleton.joints().iter().zip(plain.skeleton.joints()) {
            assert!(a.bone == b.bone && a.rest_m.distance(b.rest_m) < 1e-5, "{file}: {a:?} {b:?}");
        }
        assert!(said.is_empty(), "{file}: {said:?}");
    }
    let [shaped, true_body] =
        ["shape_on/shape_on_by_mesh.glb", "shape_on/true_body.glb"].map(|file| body(file).unwrap().0);
    let apart = shaped.surface.positions_m.iter().zip(&true_body.surface.positions_m).map(|(a, b)| a.distance(*b));
    assert!(apart.fold(0.0, f32::max) < 2e-4, "the shape is on");
    let fault = body("facing_back/facing_back.glb").unwrap_err();
    assert!(fault.problem.contains("faces -Z"), "{fault:?}");
}

/// Real files that are no bodies say why.
#[test]
fn real_files_that_are_no_bodies_say_why() {
    let Some(folder) = shared("gltf") else { return };
    for (file, word) in [
        ("Fox.glb", "no joint is hips"),
        ("assimp_quad_skin.glb", "names that say nothing"),
        ("SimpleSkin.gltf", "without a name"),
        ("VRMC_vrm_expressions_isBinary_Overrides.vrm", "no skin"),
        ("VRMC_materials_mtoon_UV_Animation_Test.vrm", "no skin"),
        ("assimp_RecursiveNodes.gltf", "no skin"),
        ("bevy_gltf_primitives.glb", "no skin"),
    ] {
        let fault =
            read_body(&std::fs::read(folder.join(file)).unwrap()).err().unwrap_or_else(|| panic!("{file} is read"));
        assert!(fault.problem.contains(word), "{file}: {fault:?}");
    }
}

/// Damaged files are refused, never a panic.
#[test]
fn damaged_bodies_are_refused() {
    let doll = Doll::read();
    let sound = sound(&doll);
    let mut refused = 0;
    for (_, file, _) in &sound {
        let bytes = file.glb();
        for at in (0..bytes.len()).step_by(97) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << (at % 8);
            refused += usize::from(read_body(&damaged).is_err());
            refused += usize::from(read_body(&bytes[..at]).is_err());
        }
    }
    assert!(refused > 1000, "{refused}");
    let singular = {
        let mut file = doll.written(&Rig::default());
        let matrices = file.floats("MAT4", &vec![0.0; 16 * doll.joints.len()]);
        file.json["skins"][0]["inverseBindMatrices"] = json!(matrices);
        file
    };
    assert!(read_body(&singular.glb()).is_err_and(|fault| fault.problem.contains("bind matrix")));
    assert_eq!(Mat4::ZERO.determinant(), 0.0);
}

/// Writes the fuzz target's seeds: the doll in a few ways, with few vertices. Run by hand where the writer changes:
/// `cargo test -p kitsuke-tests -- --ignored write_the_seeds_of_bodies`.
#[test]
#[ignore = "writes fuzz/corpus/body"]
fn write_the_seeds_of_bodies() {
    let mut doll = Doll::read();
    doll.triangles.retain(|triangle| triangle[0] % 8 == 0);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus/body");
    let wanted = [
        "joints turned along their bones",
        "two skins, joints in another order",
        "a sparse shape is on",
        "quantised",
        "VRM 1.0",
        "VRM 0.x",
    ];
    for (what, file, _) in sound(&doll).into_iter().filter(|(what, ..)| wanted.contains(what)) {
        let mut json = file.json.clone();
        json["buffers"] = json!([{"byteLength": file.bin.len()}]);
        let bytes = [json.to_string().as_bytes(), &[0], &file.bin].concat();
        std::fs::write(folder.join(what.replace([' ', ',', '.'], "_")), bytes).unwrap();
    }
}
