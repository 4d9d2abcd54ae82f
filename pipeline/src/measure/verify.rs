//! Opens the written pack again and compares every target with the artist's file. Knows only what an app knows: the
//! pack's bytes and the run time.

use crate::ir;
use crate::look::frames::{Blend, Distance, Shot, Stage, in_source_order, own_poses};
use crate::stages::StageError;
use crate::stages::regions::missing_shares;
use glam::Vec3;
use kitsuke::Pack;
use kitsuke::pose_blend::Kernel;
use rayon::prelude::*;

/// What single precision adds to the budget, metres.
const NOISE_M: f32 = 2e-5;

/// How far a blended target lies from its file, over all vertices of the base, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetQuality {
    /// The target's name.
    pub name: String,
    /// With only this target, at full rate: what the pack lost.
    pub alone: Distance,
    /// With the rates that the garment's own kernel gives in this pose: nothing more should be lost.
    pub blended: Distance,
    /// With the rates that the paper's kernel gives in this pose: what blending mixes in besides.
    pub paper: Distance,
}

/// The errors of every target of the pack.
///
/// # Errors
/// When the pack does not open, or a vertex lies farther from its file than the budget, what painted masks cut off
/// (`masks` and `deltas` as given to `compress`) and single precision allow.
pub fn verify(
    source: &ir::Garment,
    masks: &[u16],
    deltas: &[Vec<Vec3>],
    pack: &[u8],
) -> Result<Vec<TargetQuality>, StageError> {
    let pack =
        Pack::open(pack).map_err(|error| StageError::new("verify", format!("the pack does not open: {error}")))?;
    let garment = pack.garment();
    let shots = own_poses(garment);
    (0..source.targets.len())
        .into_par_iter()
        .map(|t| {
            let target = &source.targets[t];
            let missing = missing_shares(masks, &source.drivers, target.layer);
            let mut stage = Stage::new(garment);
            let alone = &shots[t + 1];
            let alone_m = in_source_order(garment, stage.show(alone).0);
            for (v, (found, wanted)) in alone_m.iter().zip(&target.positions_m).enumerate() {
                let allowed_m = source.budget_m + NOISE_M + missing[v] * deltas[t][v].length();
                let error_m = found.distance(*wanted);
                // A NaN is no small error.
                if error_m.is_nan() || error_m > allowed_m {
                    return Err(StageError::new(
                        "verify",
                        format!(
                            "target {} ({}): vertex {v} lies {:.3} mm from its file, over the budget of {:.3} mm",
                            target.name,
                            target.file,
                            error_m * 1e3,
                            allowed_m * 1e3
                        ),
                    ));
                }
            }
            let own = Shot { blend: Blend::Kernel(garment.kernel()), ..alone.clone() };
            let blended_m = in_source_order(garment, stage.show(&own).0);
            let paper = Shot { blend: Blend::Kernel(Kernel::Paper), ..alone.clone() };
            let paper_m = in_source_order(garment, stage.show(&paper).0);
            Ok(TargetQuality {
                name: target.name.clone(),
                alone: Distance::between(&alone_m, &target.positions_m),
                blended: Distance::between(&blended_m, &target.positions_m),
                paper: Distance::between(&paper_m, &target.positions_m),
            })
        })
        .collect()
}
