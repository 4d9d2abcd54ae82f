//! All stages of a garment in order, each beside what it is made from: the keys of the memo. Knows no files.

use crate::ir;
use crate::measure::audit::{self, Depth};
use crate::measure::{certificate, compression, pose_space, verify};
use crate::memo::{Key, Memo, Origin};
use crate::stages::{
    StageError, accessories, compress, correctives, deltas, fit_data, hanging, kernel, reach, regions, skin, skin_fit,
    weld,
};
use glam::Vec3;
use kitsuke::Accessories;
use kitsuke::arrays::{GarmentData, Loss, PoseBound, PoseLimit, SkinWeights};
use kitsuke::fit::FitData;
use kitsuke::garment::Garment;
use kitsuke::pack::write::write_with;
use kitsuke::skeleton::Bone;
use rayon::prelude::*;

/// One stage of one build, as progress is told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageRun {
    /// For example `deltas`.
    pub stage: &'static str,
    /// The target, where the stage makes one at a time.
    pub target: Option<String>,
    /// Whether it ran or an earlier result served.
    pub origin: Origin,
}

/// A built garment, with what the stages made on the way.
#[derive(Clone, Debug)]
pub struct Built {
    /// The pack's bytes.
    pub pack: Vec<u8>,
    /// The garment in it.
    pub garment: Garment,
    /// What comes with it in the pack.
    pub accessories: Accessories,
    /// What fitting it needs; `None` when it has no sizes.
    pub fit: Option<FitData>,
    /// How far a mix of sizes lies from what it would be without steps, over random mixes; `None` when it has none.
    pub mixed: Option<Loss>,
    /// How far each target lies from its file.
    pub quality: Vec<verify::TargetQuality>,
    /// How deep the cloth lies in the body, pose after pose of the audit.
    pub inside: Vec<Depth>,
    /// What painted masks cut off.
    pub remainders: Vec<regions::Remainder>,
    /// Skin weights per base vertex.
    pub skin: Vec<SkinWeights>,
    /// Region masks in 1/65535: per base vertex one row of as many as there are drivers.
    pub masks: Vec<u16>,
    /// Per target and base vertex, metres.
    pub deltas: Vec<Vec<Vec3>>,
}

/// Where the poses of the correctives begin among those of the pose space: far from the audit's, which would flatter them.
const CORRECTED: u64 = 1 << 20;

/// Builds one garment. Each finished stage is told to `progress`, from any thread.
///
/// # Errors
/// When a stage gives up; the error names stage and element.
pub fn build_garment(
    source: &ir::Garment,
    memo: &Memo,
    progress: &(dyn Fn(StageRun) + Sync),
) -> Result<Built, StageError> {
    let mut source = source.clone();
    let hung = hanging::with_hanging(&source.drivers, &source.body.skeleton);
    source.body.skeleton = hung.map_err(|error| StageError::new("skin", error.to_string()))?;
    let source = &source;
    let ir::Garment { base, body, pose_bones, drivers, targets, .. } = source;
    let tell = |stage, target: Option<&ir::TargetShape>, origin| {
        progress(StageRun { stage, target: target.map(|target| target.name.clone()), origin });
    };

    // The cloth follows the body under it.
    let settings = skin::Settings::default();
    let skirt_top_m = source.skirt_top_m();
    let (words, origin) = memo.recall(&keys::skin(base, body, skirt_top_m, &settings), || {
        skin::skin(base, body, skirt_top_m, &settings).map(|skin| skin.into_iter().map(to_words).collect())
    })?;
    let skin: Vec<SkinWeights> = words.into_iter().map(from_words).collect();
    tell("skin", None, origin);
    let settings = skin_fit::Settings::default();
    let of_body = skin;
    let (words, origin) = memo.recall(&keys::skin_fit(source, &of_body, &settings), || {
        let fitted = skin_fit::fitted(source, &of_body, &settings);
        Ok::<_, StageError>(fitted.into_iter().map(to_words).collect())
    })?;
    let skin: Vec<SkinWeights> = words.into_iter().map(from_words).collect();
    tell("skin fit", None, origin);

    // What the artist's shapes have beyond that.
    let deltas = targets.par_iter().map(|target| {
        let (deltas, origin) = memo.recall(&keys::deltas(base, &body.skeleton, &skin, pose_bones, target), || {
            deltas::deltas(&base.positions_m, &skin, &body.skeleton, pose_bones, target)
        })?;
        tell("deltas", Some(target), origin);
        Ok(deltas)
    });
    let deltas: Vec<Vec<Vec3>> = deltas.collect::<Result<_, StageError>>()?;

    // Which driver owns how much of it, where.
    let settings = regions::Settings::default();
    let (masks, origin) = memo.recall(&keys::regions(source, &deltas, &settings), || {
        regions::regions(base, &source.regions, drivers, pose_bones, targets, &deltas, &settings)
    })?;
    let remainders = regions::remainders(&masks, drivers, pose_bones, targets, &deltas);
    tell("regions", None, origin);

    // What the kimono allows its wearer.
    let settings = reach::Settings::default();
    let poses = compress::pose_table(source);
    let mut pose_limits = source.pose_limits.clone();
    for PoseLimit { bones, bounds, .. } in &mut pose_limits {
        let (numbers, origin) = memo.recall(&keys::reach(bones, &poses, &settings), || {
            let found = reach::bounds(bones, &poses, &settings);
            Ok::<_, StageError>(found.into_iter().flat_map(to_numbers).collect())
        })?;
        *bounds = numbers.chunks_exact(3 * bones.len() + 1).map(from_numbers).collect();
        tell("reach", None, origin);
    }

    // The pack: small numbers in segments, as coarse as the posed surface's budget lets them be, checked, written, opened again and compared with the files.
    let checked = |data| Garment::new(data).map_err(|error| StageError::new("compress", error.to_string()));
    let compressed = |radius_m: f32| {
        let mut data = compress::compress(source, &skin, &masks, &deltas, radius_m)?;
        data.pose_limits.clone_from(&pose_limits);
        data.rbf = Some(kernel::kernel(&data, drivers, &kernel::Settings::default())?);
        let garment = checked(data)?;
        let lost = compression::compression(&garment, &masks, &deltas, source.budget_m);
        let surface = lost.surface;
        Ok(((garment, lost), surface))
    };
    let ((mut garment, lost), _) = compression::within_budget(source.budget_m, compressed)?;
    tell("compress", None, Origin::Computed);
    let mut data = GarmentData { compression: Some(lost), ..garment.data().clone() };
    garment = checked(data.clone())?;

    // What keeps the cloth out of the body between the samples.
    if source.correctives > 0 {
        let settings = correctives::Settings { shapes: source.correctives, ..correctives::Settings::default() };
        let poses = pose_space::poses(&garment, CORRECTED, settings.poses);
        let (numbers, origin) = memo.recall(&keys::correctives(&data, body, &settings), || {
            let found = correctives::correctives(&garment, body, &poses, &settings);
            Ok::<_, StageError>(found.iter().flat_map(correctives::Correctives::numbers).collect())
        })?;
        data = correctives::with_correctives(&garment, &poses, &numbers, &settings)?;
        garment = checked(data.clone())?;
        tell("correctives", None, origin);
    }

    // What it promises between the samples.
    let certificate = certificate::certificate(&garment, &certificate::Settings::default())?;
    certificate::keep_budgets(&certificate, source)?;
    data.certificate = Some(certificate);
    let garment = checked(data)?;
    tell("certificate", None, Origin::Computed);

    // What fitting it to a wearer needs.
    let fit = source.sizes.as_ref().map(|sizes| {
        let (rests, settings) = (rests(&garment, &of_body), weld::Settings::default());
        let (fields_m, origin) = memo.recall(&keys::weld(base, sizes, &rests, &settings), || {
            weld::weld(base, &sizes.shapes, &rests, &settings)
        })?;
        let source_vertex = &garment.data().mesh.source_vertex;
        let fields = |radius_m: f32| {
            let fields = fit_data::fields(base, &sizes.shapes, &fields_m, radius_m, &garment)?;
            let lost = compression::sizes(&fields_m, &fields, source_vertex, sizes.shapes.len(), source.budget_m);
            Ok((fields, lost))
        };
        let (fields, lost) = compression::within_budget(source.budget_m, fields)?;
        tell("weld", None, origin);
        Ok((fit_data::fit_data(source, sizes, fields, &garment), lost))
    });
    let (fit, mixed) = fit.transpose()?.unzip();
    let accessories = accessories::accessories(source, &garment);
    let pack = write_with(&garment, &accessories, fit.as_ref());
    let pack = pack.map_err(|error| StageError::new("write", error.to_string()))?;
    tell("write", None, Origin::Computed);

    // What the pack is worth.
    compression::keep_budget(&garment, &masks, &deltas)?;
    let quality = verify::verify(source, &masks, &deltas, &pack)?;
    tell("verify", None, Origin::Computed);
    let (found, origin) = memo.recall(&keys::audit(&pack, body), || {
        let poses = pose_space::poses(&garment, 0, audit::BUILD_POSES);
        let depths = audit::audit(body, &garment, &poses).by_pose;
        Ok::<_, StageError>(
            depths.iter().map(|d| [d.depth_m.to_bits(), d.pose as u32, d.vertex, d.joint.into()]).collect(),
        )
    })?;
    let depth = |[depth_m, pose, vertex, joint]: &[u32; 4]| Depth {
        depth_m: f32::from_bits(*depth_m),
        pose: *pose as usize,
        vertex: *vertex,
        joint: *joint as u8,
    };
    let inside: Vec<Depth> = found.iter().map(depth).collect();
    audit::keep_budget(&audit::deepest(&inside), &garment, source)?;
    tell("audit", None, origin);
    Ok(Built { pack, garment, accessories, fit, mixed, quality, inside, remainders, skin, masks, deltas })
}

/// How much of each vertex hangs from the shoulders, 0 to 1: there a kimono rests, whatever its size.
fn rests(garment: &Garment, skin: &[SkinWeights]) -> Vec<f64> {
    const BONES: [Bone; 5] = [Bone::Chest, Bone::UpperChest, Bone::Neck, Bone::LeftShoulder, Bone::RightShoulder];
    let joints = garment.data().skeleton.joints();
    let rests = |skin: &SkinWeights| {
        let places = skin.joints.iter().zip(skin.weights);
        let resting = places.filter(|(joint, _)| BONES.contains(&joints[usize::from(**joint)].bone));
        resting.map(|(_, weight)| f64::from(weight) / 65535.0).sum()
    };
    skin.iter().map(rests).collect()
}

/// Skin weights as the memo keeps them: four joints, four weights.
fn to_words(skin: SkinWeights) -> [u16; 8] {
    let ([a, b, c, d], [e, f, g, h]) = (skin.joints.map(u16::from), skin.weights);
    [a, b, c, d, e, f, g, h]
}

fn from_words([a, b, c, d, e, f, g, h]: [u16; 8]) -> SkinWeights {
    SkinWeights { joints: [a, b, c, d].map(|joint| joint as u8), weights: [e, f, g, h] }
}

/// A bound as the memo keeps it: its normal, then how far it lies.
fn to_numbers(bound: PoseBound) -> Vec<f32> {
    [bound.normal, vec![bound.most_rad]].concat()
}

fn from_numbers(numbers: &[f32]) -> PoseBound {
    let (normal, most_rad) = numbers.split_at(numbers.len() - 1);
    PoseBound { normal: normal.to_vec(), most_rad: most_rad[0] }
}

/// What each remembered stage is made from. An input that is missing here would make a stale pack.
mod keys {
    use super::{Key, SkinWeights, correctives, ir, reach, regions, skin, skin_fit, to_words, weld};
    use glam::Vec3;
    use kitsuke::arrays::{GarmentData, PoseTable};
    use kitsuke::skeleton::{Bone, Skeleton};

    pub fn skin(base: &ir::Surface, body: &ir::Body, skirt_top_m: f32, settings: &skin::Settings) -> Key {
        let key = Key::new("skin").text(&format!("{settings:?} {skirt_top_m:?}"));
        surface(wearer(key, body), base)
    }

    pub fn skin_fit(source: &ir::Garment, first: &[SkinWeights], settings: &skin_fit::Settings) -> Key {
        let words: Vec<[u16; 8]> = first.iter().copied().map(to_words).collect();
        let key = Key::new("skin fit").text(&format!("{settings:?} {:?}", source.drivers)).array(&words);
        let key = bones(surface(skeleton(key, &source.body.skeleton), &source.base), &source.pose_bones);
        source
            .targets
            .iter()
            .fold(key, |key, target| key.array(&[target.layer]).array(&target.rotations).array(&target.positions_m))
    }

    pub fn deltas(
        base: &ir::Surface,
        body: &Skeleton,
        skin: &[SkinWeights],
        pose_bones: &[Bone],
        target: &ir::TargetShape,
    ) -> Key {
        let words: Vec<[u16; 8]> = skin.iter().copied().map(to_words).collect();
        let key = skeleton(Key::new("deltas"), body).array(&base.positions_m).array(&words);
        bones(key, pose_bones).array(&target.rotations).array(&target.positions_m)
    }

    pub fn regions(source: &ir::Garment, deltas: &[Vec<Vec3>], settings: &regions::Settings) -> Key {
        let key = Key::new("regions").text(&format!("{settings:?}"));
        let mut key = bones(surface(key, &source.base), &source.pose_bones);
        for driver in &source.drivers {
            key = bones(key.text("driver").array(&[driver.layer]), &driver.joints);
        }
        for (target, deltas) in source.targets.iter().zip(deltas) {
            key = key.array(&[target.layer]).array(&target.rotations).array(deltas);
        }
        match &source.regions {
            ir::Regions::Auto => key.text("auto"),
            ir::Regions::Painted(masks) => masks.iter().fold(key.text("painted"), |key, mask| key.array(mask)),
        }
    }

    pub fn reach(limited: &[Bone], poses: &PoseTable, settings: &reach::Settings) -> Key {
        let key = bones(Key::new("reach").text(&format!("{settings:?}")), limited);
        bones(key, &poses.bones).array(&poses.rotations)
    }

    pub fn correctives(data: &GarmentData, body: &ir::Body, settings: &correctives::Settings) -> Key {
        let key = wearer(Key::new("correctives").text(&format!("{settings:?}")), body);
        let key = key.array(&data.mesh.positions_m).array(&data.mesh.triangles).array(&data.mesh.twin_of);
        let words: Vec<[u16; 8]> = data.skin.iter().copied().map(to_words).collect();
        let key = bones(key.array(&words), &data.poses.bones).array(&data.poses.rotations);
        let key = key.text(&format!("{:?} {:?} {:?}", data.drivers, data.pose_limits, data.rbf));
        let key = data
            .segments
            .iter()
            .fold(key, |key, segment| key.array(&[segment.vertex_count]).array(&segment.drivers).array(&segment.masks));
        data.targets.iter().fold(key, |key, target| {
            key.array(&[target.layer]).array(&[target.step_m]).array(&target.segments).array(&target.deltas)
        })
    }

    pub fn weld(base: &ir::Surface, sizes: &ir::Sizes, rests: &[f64], settings: &weld::Settings) -> Key {
        let key = surface(Key::new("weld").text(&format!("{settings:?}")), base).array(rests);
        let counts: Vec<u32> = base.parts.iter().map(|part| part.triangle_count).collect();
        sizes.shapes.iter().fold(key.array(&counts), |key, size| key.array(&size.positions_m))
    }

    pub fn audit(pack: &[u8], body: &ir::Body) -> Key {
        wearer(Key::new("audit"), body).array(pack)
    }

    fn wearer(key: Key, body: &ir::Body) -> Key {
        let joints: Vec<u8> = body.skin.iter().flatten().map(|(joint, _)| *joint).collect();
        let weights: Vec<f32> = body.skin.iter().flatten().map(|(_, weight)| *weight).collect();
        surface(skeleton(key, &body.skeleton).array(&joints).array(&weights), &body.surface)
    }

    fn surface(key: Key, surface: &ir::Surface) -> Key {
        key.array(&surface.positions_m).array(&surface.triangles)
    }

    fn skeleton(key: Key, skeleton: &Skeleton) -> Key {
        let hanging: Vec<u8> =
            skeleton.hanging().iter().flat_map(|frame| [frame.joint, frame.heading, frame.trunk]).collect();
        skeleton.joints().iter().fold(key.text("skeleton").array(&hanging), |key, joint| {
            key.array(&[joint.bone as u8, joint.parent.map_or(u8::MAX, |parent| parent)]).array(&[joint.rest_m])
        })
    }

    fn bones(key: Key, bones: &[Bone]) -> Key {
        key.array(&bones.iter().map(|&bone| bone as u8).collect::<Vec<_>>())
    }
}
