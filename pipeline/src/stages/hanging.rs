//! Where cloth may hang: the last joint of every limb that moves alone. Knows drivers and skeleton, no cloth.

use super::kernel::limbs;
use crate::ir;
use kitsuke::skeleton::{Hanging, Skeleton, SkeletonError};
use std::collections::BTreeSet;

/// The layers of which every group drives one limb: joints that follow each other, as those of an arm do. A skirt is a tube round two
/// limbs and follows neither.
pub(super) fn layers_of_limbs(drivers: &[ir::Driver], skeleton: &Skeleton) -> BTreeSet<u8> {
    let is_of_limbs = |layer: &u8| {
        let limbs = limbs(drivers, usize::from(*layer), skeleton);
        limbs.iter().all(|limb| limb.roots() <= 1)
    };
    drivers.iter().map(|driver| driver.layer).filter(is_of_limbs).collect()
}

/// The skeleton with a hanging frame at the last joint of every limb of these layers: it turns with the joint before, upright on what
/// carries the limb. Limbs of one joint have none.
///
/// # Errors
/// When there are more limbs than joints, which no checked garment has.
pub fn with_hanging(drivers: &[ir::Driver], skeleton: &Skeleton) -> Result<Skeleton, SkeletonError> {
    let mut hanging = Vec::new();
    for layer in layers_of_limbs(drivers, skeleton) {
        for limb in limbs(drivers, usize::from(layer), skeleton) {
            let (Some(first), Some(last)) = (limb.chain.first(), limb.chain.last()) else { continue };
            let Some(before) = last.parent.map(|parent| limb.chain[usize::from(parent)].bone) else { continue };
            let joint = |bone| skeleton.index_of(bone).expect("a checked driver's joint is in the skeleton") as u8;
            let trunk = skeleton.joints()[usize::from(joint(first.bone))].parent;
            hanging.push(Hanging {
                joint: joint(last.bone),
                heading: joint(before),
                trunk: trunk.unwrap_or(joint(first.bone)),
            });
        }
    }
    skeleton.clone().with_hanging(hanging)
}
