//! The wearer of a fitted kimono: her own body in the place of the base's, once both are found to belong together. Knows neither
//! files nor tables of bodies.

use crate::ir::{self, WearerBody};
use crate::look::frames::in_source_order;
use crate::stages::posed_body::PosedBody;
use glam::Vec3;
use kitsuke::Garment;
use kitsuke::accessories::gone_with;
use kitsuke::skeleton::{Bone, Joint, Pose, Skeleton};
use rayon::prelude::*;

/// How far a joint of the wearer may lie from the fitted one, metres.
pub const JOINT_AWAY_M: f32 = 0.03;
/// How far off the wearer cloth may lie that lies on the base's, metres; a twentieth may lie farther. On the ten sizes' own bodies a
/// twentieth lies 14 to 28 mm off.
pub const CLOTH_OFF_M: f32 = 0.03;
/// How deep in the wearer it may lie, metres; a twentieth may lie deeper. On the sizes' own bodies none does.
pub const CLOTH_INSIDE_M: f32 = 0.015;

/// Cloth no farther from the skin lies on it, metres.
const TOUCHES_M: f32 = 0.01;
/// Skin farther away is not looked for, metres.
const FARTHEST_M: f32 = 0.3;

/// Why a body is not that of a fitted kimono's wearer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WearerError {
    /// The kimono's sources have changed since its pack was built.
    #[error("the kimono's files have {files} vertices, its pack {pack}: run cargo xtask build-catalog")]
    OtherSource {
        /// Vertices of the base file.
        files: usize,
        /// Vertices of the pack, twins left out.
        pack: usize,
    },
    /// A surface without joints is none of the base's body.
    #[error(
        "the file has no skin, and its mesh is not that of the kimono's own body in another shape ({vertices} vertices, not {wanted}, or \
         other triangles): export the wearer with joints and weights"
    )]
    OtherMesh {
        /// Vertices of the surface.
        vertices: usize,
        /// Vertices of the base's body.
        wanted: usize,
    },
    /// A joint is missing that cloth follows.
    #[error("the body has no joint {}, which the kimono follows", .0.name())]
    NoJoint(Bone),
    /// A joint hangs on another one, so the same rotations give another pose.
    #[error("joint {} hangs on {} in the body, on {} in the kimono", bone.name(), named(*body), named(*kimono))]
    OtherParent {
        /// The joint.
        bone: Bone,
        /// On what it hangs in the body.
        body: Option<Bone>,
        /// On what it hangs in the kimono.
        kimono: Option<Bone>,
    },
    /// The joint that lies farthest from where the fit has it, more than [`JOINT_AWAY_M`].
    #[error(
        "joint {} rests {:.1} cm from where the fitted kimono has it (x {:+.1}, y {:+.1}, z {:+.1} cm; {:.0} cm are allowed)",
        bone.name(), away_m.length() * 100.0, away_m.x * 100.0, away_m.y * 100.0, away_m.z * 100.0, JOINT_AWAY_M * 100.0
    )]
    JointAway {
        /// The joint.
        bone: Bone,
        /// From the kimono's to the body's.
        away_m: Vec3,
    },
    /// More than a twentieth of the cloth that should lie on the skin lies farther off than [`CLOTH_OFF_M`] or deeper inside than
    /// [`CLOTH_INSIDE_M`].
    #[error(
        "cloth that should lie on the skin lies {:.1} cm {}",
        distance_m.abs() * 100.0,
        if *distance_m < 0.0 {
            format!("inside the body ({:.1} cm are allowed)", CLOTH_INSIDE_M * 100.0)
        } else {
            format!("off the body ({:.1} cm are allowed)", CLOTH_OFF_M * 100.0)
        }
    )]
    ClothAway {
        /// Outside the body; negative inside. A twentieth lies as far or farther.
        distance_m: f32,
    },
}

fn named(joint: Option<Bone>) -> &'static str {
    joint.map_or("nothing", Bone::name)
}

/// What a fitted kimono would have been made from: her body in the place of the base's, the fitted shape as base, and the obi moved
/// along with the cloth under it. Target files, which show another wearer, are left out.
///
/// # Errors
/// When the body's joints or skin do not lie where the fitted kimono has them.
pub fn worn(source: ir::Garment, fitted: &Garment, body: WearerBody) -> Result<ir::Garment, WearerError> {
    let [files, pack] = [source.base.positions_m.len(), fitted.unique_count()];
    if files != pack {
        return Err(WearerError::OtherSource { files, pack });
    }
    let body = match body {
        WearerBody::Skinned(body) => same_joints(&fitted.data().skeleton, &body.skeleton).map(|()| body)?,
        WearerBody::Bare(surface) => lent(surface, &source.body, &fitted.data().skeleton)?,
    };
    let fitted_m = in_source_order(fitted, &fitted.data().mesh.positions_m);
    near_skin(&source, &fitted_m, &body)?;
    let obi = source.obi.as_ref().map(|obi| moved_with(obi, &source.base.positions_m, &fitted_m));
    let base = ir::Surface { positions_m: fitted_m, ..source.base };
    Ok(ir::Garment { base, body, obi, targets: Vec::new(), ..source })
}

/// Joints that the kimono does not know may hang on the body, but not between those that it does.
fn same_joints(kimono: &Skeleton, body: &Skeleton) -> Result<(), WearerError> {
    let parent =
        |of: &Skeleton, joint: usize| of.joints()[joint].parent.map(|parent| of.joints()[usize::from(parent)].bone);
    let mut farthest = (Bone::Hips, Vec3::ZERO);
    for (at, joint) in kimono.joints().iter().enumerate() {
        let bone = joint.bone;
        let found = body.index_of(bone).ok_or(WearerError::NoJoint(bone))?;
        let (in_body, in_kimono) = (parent(body, found), parent(kimono, at));
        if in_body != in_kimono {
            return Err(WearerError::OtherParent { bone, body: in_body, kimono: in_kimono });
        }
        let away_m = body.joints()[found].rest_m - joint.rest_m;
        if away_m.length() > farthest.1.length() {
            farthest = (bone, away_m);
        }
    }
    let (bone, away_m) = farthest;
    if away_m.length() <= JOINT_AWAY_M { Ok(()) } else { Err(WearerError::JointAway { bone, away_m }) }
}

/// The base's body in another shape: its weights, the kimono's joints. Where the body's own would be, the skin around them says to 1 cm
/// (3 cm for the stoutest size), enough to tell bodies apart.
fn lent(surface: ir::Surface, base: &ir::Body, kimono: &Skeleton) -> Result<ir::Body, WearerError> {
    let [vertices, wanted] = [&surface, &base.surface].map(|surface| surface.positions_m.len());
    if vertices != wanted || surface.triangles != base.surface.triangles {
        return Err(WearerError::OtherMesh { vertices, wanted });
    }
    let with_joints = |rest_m: &dyn Fn(usize, &Joint) -> Vec3| {
        let joints = base.skeleton.joints().iter().enumerate();
        Skeleton::new(joints.map(|(at, joint)| Joint { rest_m: rest_m(at, joint), ..*joint }).collect())
            .expect("the same joints elsewhere")
    };
    // Where a joint bends, its skin follows both it and the joint above.
    let gone_with_skin = |at: usize, joint: &Joint| {
        let share = |row: &[(u8, f32); 4], of: usize| {
            row.iter().filter(|(joint, _)| usize::from(*joint) == of).map(|(_, weight)| *weight).sum::<f32>()
        };
        let (mut sum_m, mut weights) = (Vec3::ZERO, 0.0);
        for ((place_m, base_m), row) in surface.positions_m.iter().zip(&base.surface.positions_m).zip(&base.skin) {
            let own = share(row, at);
            let weight = own * joint.parent.map_or(1.0 - own, |parent| share(row, usize::from(parent)));
            sum_m += weight * (place_m - base_m);
            weights += weight;
        }
        match weights > 0.0 {
            true => joint.rest_m + sum_m / weights,
            false => gone_with(joint.rest_m, &base.surface.positions_m, &surface.positions_m),
        }
    };
    same_joints(kimono, &with_joints(&gone_with_skin))?;
    let of_kimono =
        |_: usize, joint: &Joint| kimono.index_of(joint.bone).map_or(joint.rest_m, |at| kimono.joints()[at].rest_m);
    Ok(ir::Body { skeleton: with_joints(&of_kimono), skin: base.skin.clone(), surface })
}

/// Joints say how long a body is; how wide it is say the places where the base touches its own wearer.
fn near_skin(source: &ir::Garment, fitted_m: &[Vec3], body: &ir::Body) -> Result<(), WearerError> {
    let [base_body, body] = [&source.body, body].map(|body| PosedBody::new(body, &Pose::REST));
    let touches = |place_m: &Vec3| base_body.place(*place_m, TOUCHES_M, TOUCHES_M).is_some();
    let distance_m = |(base_m, fitted_m): (&Vec3, &Vec3)| {
        let found = touches(base_m).then(|| body.place(*fitted_m, FARTHEST_M, FARTHEST_M))?;
        Some(found.map_or(FARTHEST_M, |(distance_m, _)| distance_m))
    };
    let mut distances_m: Vec<f32> = source.base.positions_m.par_iter().zip(fitted_m).filter_map(distance_m).collect();
    distances_m.sort_by(f32::total_cmp);
    let Some(last) = distances_m.len().checked_sub(1) else { return Ok(()) };
    let [low_m, high_m] = [distances_m[last / 20], distances_m[last - last / 20]];
    match (low_m < -CLOTH_INSIDE_M, high_m > CLOTH_OFF_M) {
        (true, _) => Err(WearerError::ClothAway { distance_m: low_m }),
        (false, true) => Err(WearerError::ClothAway { distance_m: high_m }),
        (false, false) => Ok(()),
    }
}

/// A band where the cloth under it has gone.
fn moved_with(band: &ir::Surface, from_m: &[Vec3], to_m: &[Vec3]) -> ir::Surface {
    let positions_m = band.positions_m.par_iter().map(|place_m| gone_with(*place_m, from_m, to_m)).collect();
    ir::Surface { positions_m, ..band.clone() }
}
