//! Whether a body stands as every pose table takes for granted: in metres, upright, facing +Z, in a T-pose, its skin around its joints. Knows
//! no file.

use crate::ir::Body;
use glam::Vec3;
use kitsuke::skeleton::Bone;

/// How large a body can be, metres.
const SIZE_M: std::ops::RangeInclusive<f32> = 0.3..=3.0;
/// How far arms may point from level and sideways, degrees.
const ARM_DEG: f32 = 12.0;
/// How far legs may point from straight down, degrees.
const LEG_DEG: f32 = 16.0;
/// How far the trunk may lean, degrees.
const TRUNK_DEG: f32 = 25.0;
/// How far skin may point from where its joints do, degrees.
const SKIN_DEG: f32 = 15.0;
/// How far along its limb the middle of the skin may lie, as a share of where the middle between the joints lies.
const SKIN_ALONG: std::ops::RangeInclusive<f32> = 0.6..=1.6;
/// How far the skin of both feet together must lie before their joints to say where toes are, metres.
const FEET_M: f32 = 0.01;
/// How far turned a body may be and still face the same way, degrees.
const FACING_DEG: f32 = 30.0;

/// What is wrong, and what to do.
pub(super) struct Fault {
    pub problem: String,
    pub help: String,
}

/// A limb: upper bone, lower bone, end, where both point in the T-pose, and how far they may stray from that.
pub(super) struct Limb {
    pub bones: [Bone; 3],
    towards: Vec3,
    most_deg: f32,
}

pub(super) const LIMBS: [Limb; 4] = [
    Limb { bones: [Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand], towards: Vec3::X, most_deg: ARM_DEG },
    Limb {
        bones: [Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand],
        towards: Vec3::NEG_X,
        most_deg: ARM_DEG,
    },
    Limb { bones: [Bone::LeftUpperLeg, Bone::LeftLowerLeg, Bone::LeftFoot], towards: Vec3::NEG_Y, most_deg: LEG_DEG },
    Limb {
        bones: [Bone::RightUpperLeg, Bone::RightLowerLeg, Bone::RightFoot],
        towards: Vec3::NEG_Y,
        most_deg: LEG_DEG,
    },
];

/// The first thing that is wrong with how a body stands; limbs all together. The body has the bones of all [`LIMBS`] and hips.
pub(super) fn fault(body: &Body) -> Option<Fault> {
    let at = |bone: Bone| body.skeleton.rest_m(bone).unwrap_or_default();
    wrong_size(body.surface.positions_m.iter().copied())
        .or_else(|| lying(&at))
        .or_else(|| turned(body, &at))
        .or_else(|| wrong_limbs(body, &at))
}

/// Whether what has these places, skin or joints, is as large as a body.
pub(super) fn wrong_size(places_m: impl Iterator<Item = Vec3>) -> Option<Fault> {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = places_m.fold(start, |(low, high), place_m| (low.min(place_m), high.max(place_m)));
    let size_m = (high - low).max_element();
    if SIZE_M.contains(&size_m) {
        return None;
    }
    let units = [("centimetres", 0.01), ("millimetres", 0.001), ("inches", 0.0254), ("metres, then scaled", 100.0)];
    let likely = units.into_iter().find(|(_, metres)| (0.8..=2.3).contains(&(size_m * metres)));
    let help = match likely {
        Some((unit, metres)) => {
            format!("It looks as if it was made in {unit}: scale it by {metres} and export it again.")
        }
        None => "Scale it to its true size and export it again.".to_owned(),
    };
    Some(Fault { problem: format!("the body is {size_m:.3} m large; glTF counts in metres"), help })
}

fn lying(at: &dyn Fn(Bone) -> Vec3) -> Option<Fault> {
    let up = (at(Bone::LeftUpperArm) + at(Bone::RightUpperArm)) / 2.0 - at(Bone::Hips);
    let lean_deg = angle_deg(up, Vec3::Y);
    if lean_deg <= TRUNK_DEG {
        return None;
    }
    let problem = match lean_deg > 60.0 {
        true => format!("the body does not stand: from hips to shoulders it points along {}", axis(up)),
        false => format!("the trunk leans by {lean_deg:.0} degrees"),
    };
    Some(Fault { problem, help: "Export the body upright, with +Y up.".to_owned() })
}

fn turned(body: &Body, at: &dyn Fn(Bone) -> Vec3) -> Option<Fault> {
    let left = at(Bone::LeftUpperArm) - at(Bone::RightUpperArm);
    let left = Vec3::new(left.x, 0.0, left.z);
    let off_deg = angle_deg(left, Vec3::X);
    if off_deg <= FACING_DEG {
        return None;
    }
    let front = left.cross(Vec3::Y);
    let toes: f32 = [Bone::LeftFoot, Bone::RightFoot]
        .into_iter()
        .filter_map(|foot| Some((middle(body, foot)? - at(foot)).dot(front.normalize_or_zero())))
        .sum();
    let faces = format!("the body faces {}, but body and kimono face +Z, with the wearer's left at +X", axis(front));
    let turn = format!("Turn the body by {off_deg:.0} degrees about its upright axis, apply that, and export it again");
    let exchanged = "left and right are exchanged: the left arm's joints lie on the body's right, as its feet point";
    let rename = "Name the joints for the wearer's own left and right";
    Some(if toes > FEET_M {
        Fault { problem: faces, help: format!("{turn}.") }
    } else if toes < -FEET_M {
        Fault { problem: exchanged.to_owned(), help: format!("{rename}.") }
    } else {
        Fault { problem: format!("{faces}; or left and right are exchanged"), help: format!("{turn}. {rename}.") }
    })
}

fn wrong_limbs(body: &Body, at: &dyn Fn(Bone) -> Vec3) -> Option<Fault> {
    let (mut posed, mut torn) = (Vec::new(), Vec::new());
    for Limb { bones: [upper, lower, end], towards, most_deg } in LIMBS {
        for [from, to] in [[upper, lower], [lower, end]] {
            let points = at(to) - at(from);
            let off_deg = angle_deg(points, towards);
            if off_deg > most_deg {
                posed.push(format!("{} points {off_deg:.0} degrees {}", from.name(), way(points, towards)));
            }
        }
        let Some(skin_m) = middle(body, lower) else { continue };
        let [by_skin, by_joints] = [skin_m - at(upper), (at(lower) + at(end)) / 2.0 - at(upper)];
        let off_deg = angle_deg(by_skin, by_joints);
        let along = by_skin.length() / by_joints.length().max(f32::MIN_POSITIVE);
        if off_deg > SKIN_DEG || !SKIN_ALONG.contains(&along) {
            let apart_cm = 100.0 * by_skin.distance(by_joints);
            let way = if off_deg > SKIN_DEG {
                format!(", {off_deg:.0} degrees {}", way(by_skin, by_joints))
            } else {
                String::new()
            };
            torn.push(format!("that of {} lies {apart_cm:.0} cm from its joints{way}", lower.name()));
        }
    }
    if !posed.is_empty() {
        return Some(Fault {
            problem: format!("the body is not in a T-pose: {}", posed.join(", ")),
            help: "Hold the arms level and to the sides and the legs straight down, make that the rest pose, and export it again."
                .to_owned(),
        });
    }
    (!torn.is_empty()).then(|| Fault {
        problem: format!("the skin was not bound where the joints rest: {}", torn.join(", ")),
        help: "Bind the mesh to its joints in the T-pose and export it again.".to_owned(),
    })
}

/// The middle of the skin that follows a bone most.
fn middle(body: &Body, bone: Bone) -> Option<Vec3> {
    let slot = body.skeleton.index_of(bone)?;
    let follows = |row: &[(u8, f32); 4]| {
        row.iter().max_by(|a, b| a.1.total_cmp(&b.1)).is_some_and(|(joint, _)| usize::from(*joint) == slot)
    };
    let own = body.surface.positions_m.iter().zip(&body.skin).filter(|(_, row)| follows(row));
    let (sum_m, count) = own.fold((Vec3::ZERO, 0u32), |(sum_m, count), (place_m, _)| (sum_m + place_m, count + 1));
    (count > 0).then(|| sum_m / count as f32)
}

/// The angle between two directions; that of no direction counts as opposite.
pub(super) fn angle_deg(a: Vec3, b: Vec3) -> f32 {
    let cosine = a.normalize_or_zero().dot(b.normalize_or_zero());
    if cosine == 0.0 && (a == Vec3::ZERO || b == Vec3::ZERO) {
        return 180.0;
    }
    libm::acosf(cosine.clamp(-1.0, 1.0)).to_degrees()
}

/// The axis that a direction is nearest to.
fn axis(direction: Vec3) -> &'static str {
    let axes = [
        (Vec3::X, "+X"),
        (Vec3::NEG_X, "-X"),
        (Vec3::Y, "+Y"),
        (Vec3::NEG_Y, "-Y"),
        (Vec3::Z, "+Z"),
        (Vec3::NEG_Z, "-Z"),
    ];
    axes.into_iter().max_by(|a, b| direction.dot(a.0).total_cmp(&direction.dot(b.0))).map_or("", |(_, name)| name)
}

/// Where a direction strays from another one.
fn way(direction: Vec3, from: Vec3) -> &'static str {
    let strays = direction.normalize_or_zero() - from.normalize_or_zero();
    let ways = [
        (Vec3::NEG_Y, "down"),
        (Vec3::Y, "up"),
        (Vec3::Z, "forward"),
        (Vec3::NEG_Z, "back"),
        (Vec3::X, "to the left"),
        (Vec3::NEG_X, "to the right"),
    ];
    ways.into_iter().max_by(|a, b| strays.dot(a.0).total_cmp(&strays.dot(b.0))).map_or("", |(_, name)| name)
}
