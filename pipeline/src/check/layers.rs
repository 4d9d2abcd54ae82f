//! Which drivers and targets form a layer: groups that no pose turns together are independent and add. Knows rotations only.

use super::poses::is_near;
use crate::ir;
use glam::Quat;
use kitsuke::skeleton::Bone;

/// Gives every driver and every target its layer: two groups share one when some pose turns joints of both. A target that
/// turns no driver's joint belongs to the first.
pub(super) fn assign(drivers: &mut [ir::Driver], bones: &[Bone], targets: &mut [ir::TargetShape]) {
    let mut groups: Vec<String> = Vec::new();
    for driver in drivers.iter() {
        if !groups.contains(&driver.group) {
            groups.push(driver.group.clone());
        }
    }
    let group_of =
        |driver: &ir::Driver| groups.iter().position(|group| *group == driver.group).expect("collected above");
    // Every group begins as a layer of its own; layers that a pose turns together become one, the first of them.
    let mut layer_of: Vec<usize> = (0..groups.len()).collect();
    let turned: Vec<Vec<usize>> = targets
        .iter()
        .map(|target| {
            let turns = |driver: &&ir::Driver| {
                let joints = bones.iter().zip(&target.rotations);
                joints.into_iter().any(|(bone, &q)| driver.joints.contains(bone) && !is_near(q, Quat::IDENTITY))
            };
            drivers.iter().filter(turns).map(group_of).collect()
        })
        .collect();
    for groups in &turned {
        let layers: Vec<usize> = groups.iter().map(|&group| layer_of[group]).collect();
        if let Some(&first) = layers.iter().min() {
            layer_of.iter_mut().filter(|layer| layers.contains(layer)).for_each(|layer| *layer = first);
        }
    }
    let mut used = layer_of.clone();
    used.sort_unstable();
    used.dedup();
    let number = |group: usize| used.iter().position(|&layer| layer == layer_of[group]).expect("it is used") as u8;
    let numbers: Vec<u8> = drivers.iter().map(|driver| number(group_of(driver))).collect();
    drivers.iter_mut().zip(numbers).for_each(|(driver, layer)| driver.layer = layer);
    for (target, groups) in targets.iter_mut().zip(turned) {
        target.layer = groups.first().map_or(0, |&group| number(group));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_that_a_pose_turns_together_share_a_layer() {
        const BONES: [Bone; 3] = [Bone::LeftUpperArm, Bone::LeftUpperLeg, Bone::RightUpperArm];
        let driver = |(name, bone): (&str, Bone)| ir::Driver {
            name: name.to_owned(),
            group: name.to_owned(),
            joints: vec![bone],
            threshold_rad: 1.0,
            layer: 9,
        };
        let target = |turned: &[usize]| ir::TargetShape {
            name: String::new(),
            file: String::new(),
            layer: 9,
            rotations: (0..3).map(|i| Quat::from_rotation_x(if turned.contains(&i) { 0.5 } else { 0.001 })).collect(),
            positions_m: Vec::new(),
        };
        let check = |turned: &[&[usize]], of_drivers: [u8; 3], of_targets: &[u8]| {
            let mut drivers: Vec<_> = ["left", "leg", "right"].into_iter().zip(BONES).map(driver).collect();
            let mut targets: Vec<_> = turned.iter().map(|turned| target(turned)).collect();
            assign(&mut drivers, &BONES, &mut targets);
            assert_eq!(drivers.iter().map(|d| d.layer).collect::<Vec<_>>(), of_drivers);
            assert_eq!(targets.iter().map(|t| t.layer).collect::<Vec<_>>(), of_targets);
        };
        check(&[&[0], &[1], &[2]], [0, 1, 2], &[0, 1, 2]);
        check(&[&[0, 2], &[1], &[2], &[]], [0, 1, 0], &[0, 1, 0, 0]);
        check(&[&[1, 2], &[0]], [0, 1, 1], &[1, 0]);
        check(&[&[1, 2], &[0, 1]], [0, 0, 0], &[0, 0]);
    }
}
