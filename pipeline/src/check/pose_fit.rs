//! Whether shapes are draped in the poses that their rows say: cloth near the skin goes roughly where the skin goes. Knows no file.
//!
//! A shape that was made in one pose and is listed under another is reproduced exactly in that pose all the same, since deltas take up the
//! rest; so no comparison of a pack with its files can see it. What tells is how far the row's pose carries cloth away from the shape. Per row
//! this is measured as a share: the mean distance of posed skin and shape over the mean distance of base and shape. On komon it is 0.12 to 0.59
//! for arms, 0.52 to 2.2 for legs (a skirt stays behind short steps), and 1.5 to 2.2 for arms whose rotations are negated.

use super::near_skin::Pair;
use crate::ir;
use glam::{Affine3A, DQuat, DVec3, Quat, Vec3};
use kitsuke::skeleton::{Bone, Pose};

/// A joint that is turned less does not count as turned.
const TURNED_RAD: f32 = 0.05;
/// Fewer vertices near turned skin say nothing.
const LEAST: usize = 50;
/// A shape that is no farther from the base says nothing about a whole table, metres.
const MOVED_M: f32 = 0.03;
/// A shape this far from the base says something even where no other pose fits it, metres.
const MOVED_FAR_M: f32 = 0.1;
/// A table with a share above this over all its rows is held against the guesses; that of komon is 0.35, of its legs alone 0.7.
const OFF_TOGETHER: f32 = 0.4;
/// A row with a share above this is looked at.
const OFF: f32 = 0.9;
/// A row with a share above this is off whatever else might fit it.
const FAR_OFF: f32 = 1.1;
/// Another pose fits when its share is below this, and below [`GAIN`] of the row's own.
const FITS: f32 = 0.75;
const GAIN: f32 = 0.6;
/// Two rows are exchanged when the sum of their shares falls below so much of what it is.
const GAIN_OF_TWO: f32 = 0.7;
/// Cloth tells two poses apart where they carry it this far apart, metres.
const TELLING_M: f32 = 0.06;
/// Rotations are meant otherwise when that leaves less than this of the distance where cloth tells the two apart, in three rows or more: where
/// they are right, 0.98 of it or more in the sample and in every part of it that was tried.
const GAIN_OF_MEANT: f32 = 0.85;
/// So many rows at most are compared with all others.
const COMPARED: usize = 256;

/// Another pose than a row's that may be meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Guess {
    /// Every rotation the other way.
    Negated,
    /// The rotations of left joints for right ones.
    SidesExchanged,
    /// The mirrored figure.
    Mirrored,
    /// Half the angles.
    Half,
    /// Twice the angles.
    Double,
    /// Rotations relative to the world where those relative to the joint above are wanted.
    World,
    /// The angles about X, Y and Z in another order, which this numbers.
    Order(usize),
    /// The pose of another target, by its number.
    Row(usize),
    /// None that is known.
    Unknown,
}

/// A shape, or all of them, in another pose than the table says.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fault {
    /// All rows, or most: so many of so many.
    Table(Guess, usize, usize),
    /// One target, by its number; the second is how far its pose carries cloth from it on average, metres.
    Row(usize, f32, Guess),
    /// Two targets have each other's poses.
    Exchanged(usize, usize),
}

/// Everything that a row is measured with.
struct Stage<'a> {
    base_m: &'a [Vec3],
    body: &'a ir::Body,
    bones: &'a [Bone],
    targets: &'a [ir::TargetShape],
    /// The targets' poses as written; their own rotations leave the twist of arms out.
    written: &'a [Pose],
}

/// A row that can be judged.
struct Row {
    target: usize,
    pairs: Vec<Pair>,
    /// How far the shape is from the base, on average over its pairs, metres.
    moved_m: f32,
    /// How far its pose carries cloth from it, as a share of that.
    share: f32,
    turns_arms: bool,
}

/// Compares targets with their poses; `pairs` are cloth near the base's skin, `bones` the columns of the targets' rotations.
pub(super) fn faults(
    base_m: &[Vec3],
    body: &ir::Body,
    pairs: &[Pair],
    bones: &[Bone],
    targets: &[ir::TargetShape],
    written: &[Pose],
) -> Vec<Fault> {
    let stage = Stage { base_m, body, bones, targets, written };
    let rows: Vec<Row> = (0..targets.len()).filter_map(|target| stage.row(target, pairs)).collect();
    if let Some(fault) = whole_table(&stage, &rows).or_else(|| meant_otherwise(&stage, &rows)) {
        return vec![fault];
    }
    let off: Vec<&Row> = rows.iter().filter(|row| row.share > OFF).take(COMPARED).collect();
    let mut faults = Vec::new();
    let mut is_named = vec![false; targets.len()];
    for (i, a) in off.iter().enumerate() {
        let is_other = |b: &Row| {
            let swapped = [stage.share(a, &stage.pose(b.target)), stage.share(b, &stage.pose(a.target))];
            swapped.iter().all(|share| *share < OFF) && swapped[0] + swapped[1] < GAIN_OF_TWO * (a.share + b.share)
        };
        if let Some(b) = off[..i].iter().find(|b| !is_named[b.target] && is_other(b)) {
            faults.push(Fault::Exchanged(b.target, a.target));
            (is_named[a.target], is_named[b.target]) = (true, true);
        }
    }
    for row in off.iter().filter(|row| !is_named[row.target]) {
        let own = stage.pose(row.target);
        let known = GUESSES.into_iter().map(|guess| (guess, stage.guessed(&own, guess)));
        let others = (0..targets.len()).filter(|&other| other != row.target).take(4 * COMPARED);
        let others = others.map(|other| (Guess::Row(other), stage.pose(other)));
        let shares = known.chain(others).map(|(guess, pose)| (guess, stage.share(row, &pose)));
        let best = shares.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((Guess::Unknown, f32::MAX));
        if best.1 < FITS && best.1 < GAIN * row.share {
            faults.push(Fault::Row(row.target, row.share * row.moved_m, best.0));
        } else if row.moved_m > MOVED_FAR_M && row.share > FAR_OFF {
            faults.push(Fault::Row(row.target, row.share * row.moved_m, Guess::Unknown));
        }
    }
    faults
}

/// A table fits a guess when that leaves less than this of the distance. Cloth stays behind the skin, so twice the angles never fit where
/// the angles are right (2.2 times the distance on komon), while half of them nearly may (0.8 for legs).
fn gain(guess: Guess) -> f32 {
    if guess == Guess::Double { 0.85 } else { GAIN }
}

const GUESSES: [Guess; 5] = [Guess::Negated, Guess::SidesExchanged, Guess::Mirrored, Guess::Half, Guess::Double];

/// What is wrong with all rows, by what explains all shapes together.
fn whole_table(stage: &Stage<'_>, rows: &[Row]) -> Option<Fault> {
    let telling: Vec<&Row> = rows.iter().filter(|row| row.moved_m > MOVED_M).collect();
    let apart_m = |pose: &dyn Fn(usize) -> Pose| -> f32 {
        telling.iter().map(|row| row.moved_m * stage.share(row, &pose(row.target))).sum()
    };
    let moved_m: f32 = telling.iter().map(|row| row.moved_m).sum();
    let own_m: f32 = telling.iter().map(|row| row.moved_m * row.share).sum();
    if telling.len() >= 3 && own_m > OFF_TOGETHER * moved_m {
        let guesses = GUESSES.map(|guess| (guess, apart_m(&|target| stage.guessed(&stage.pose(target), guess))));
        let best = guesses.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).filter(|best| best.1 < gain(best.0) * own_m);
        if let Some((guess, _)) = best {
            return Some(Fault::Table(guess, telling.len(), telling.len()));
        }
    }
    // Sleeves follow arms whatever the cloth, so where many do not, it is the base or the axes.
    let arms: Vec<&Row> = rows.iter().filter(|row| row.turns_arms).collect();
    let off = arms.iter().filter(|row| row.share > OFF).count();
    (off >= 3 && 3 * off > arms.len()).then_some(Fault::Table(Guess::Unknown, off, arms.len()))
}

/// What the rotations may be, where most rows are the same either way: only those that tell the two apart are compared.
fn meant_otherwise(stage: &Stage<'_>, rows: &[Row]) -> Option<Fault> {
    let fits = |guess: Guess| {
        let (mut telling, mut own_m, mut guessed_m) = (0, 0.0, 0.0);
        for row in rows.iter().filter(|row| row.moved_m > MOVED_M) {
            let shape_m = &stage.targets[row.target].positions_m;
            let own = stage.carried_m(&row.pairs, &stage.pose(row.target));
            let guessed = stage.carried_m(&row.pairs, &stage.meant(row.target, guess));
            let apart = row
                .pairs
                .iter()
                .zip(own.iter().zip(&guessed))
                .filter(|(_, (own, guessed))| own.distance(**guessed) > TELLING_M);
            let apart: Vec<(f32, f32)> = apart
                .map(|(pair, (own, guessed))| {
                    let at_m = shape_m[pair.cloth as usize];
                    (at_m.distance(*own), at_m.distance(*guessed))
                })
                .collect();
            if apart.len() >= LEAST {
                telling += 1;
                let sum = |(a, b): (f32, f32), (c, d): &(f32, f32)| (a + c, b + d);
                let (own, guessed) = apart.iter().fold((0.0, 0.0), sum);
                own_m += own / apart.len() as f32;
                guessed_m += guessed / apart.len() as f32;
            }
        }
        (telling >= 3 && guessed_m < GAIN_OF_MEANT * own_m).then_some((guessed_m / own_m, guess, telling))
    };
    let guesses = std::iter::once(Guess::World).chain((0..ORDERS.len()).map(Guess::Order));
    let best = guesses.filter_map(fits).min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, guess, telling)| Fault::Table(guess, telling, rows.len()))
}

/// Orders in which angles may be meant to turn, the axes named by their numbers; the table's own is 0, 1, 2.
pub(super) const ORDERS: [[usize; 3]; 5] = [[2, 1, 0], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1]];

/// The rotation that the angles of `q` about X, Y and Z, in this order, give when they are turned in another.
fn reordered(q: Quat, order: [usize; 3]) -> Quat {
    let q = q.as_dquat();
    let (x, y, z) = (q * DVec3::X, q * DVec3::Y, q * DVec3::Z);
    let angles = [libm::atan2(y.z, z.z), libm::asin((-x.z).clamp(-1.0, 1.0)), libm::atan2(x.y, x.x)];
    let about = |axis: usize| {
        let half = angles[axis] / 2.0;
        let mut parts = [0.0, 0.0, 0.0, libm::cos(half)];
        parts[axis] = libm::sin(half);
        DQuat::from_array(parts)
    };
    (about(order[2]) * about(order[1]) * about(order[0])).normalize().as_quat()
}

impl Stage<'_> {
    fn pose(&self, target: usize) -> Pose {
        let rotations = self.bones.iter().zip(&self.targets[target].rotations);
        rotations.fold(Pose::REST, |pose, (&bone, &rotation)| pose.with(bone, rotation))
    }

    fn guessed(&self, pose: &Pose, guess: Guess) -> Pose {
        let mirrored = |q: Quat| Quat::from_xyzw(q.x, -q.y, -q.z, q.w);
        let turn = |guessed: Pose, &bone: &Bone| {
            let q = pose.rotation(bone);
            match guess {
                Guess::Negated => guessed.with(bone, q.inverse()),
                Guess::SidesExchanged => guessed.with(bone.mirrored(), q),
                Guess::Mirrored => guessed.with(bone.mirrored(), mirrored(q)),
                Guess::Half => guessed.with(bone, Quat::IDENTITY.slerp(q, 0.5)),
                Guess::Double => guessed.with(bone, q * q),
                Guess::World | Guess::Order(_) | Guess::Row(_) | Guess::Unknown => guessed.with(bone, q),
            }
        };
        self.bones.iter().fold(Pose::REST, turn)
    }

    /// The pose of a target if its rotations are meant otherwise, without the twist of arms as its own.
    fn meant(&self, target: usize, guess: Guess) -> Pose {
        let written = &self.written[target];
        let turn = |meant: Pose, &bone: &Bone| {
            let q = written.rotation(bone);
            match guess {
                Guess::World => {
                    meant.with(bone, self.above(bone).map_or(q, |above| written.rotation(above).inverse() * q))
                }
                Guess::Order(number) => meant.with(bone, reordered(q, ORDERS[number])),
                _ => meant.with(bone, q),
            }
        };
        self.bones.iter().fold(Pose::REST, turn).with_arms_untwisted()
    }

    /// The nearest joint above that the table turns.
    fn above(&self, bone: Bone) -> Option<Bone> {
        let joints = self.body.skeleton.joints();
        let parent = |joint: usize| joints[joint].parent.map(usize::from);
        let above = std::iter::successors(parent(self.body.skeleton.index_of(bone)?), |joint| parent(*joint));
        above.map(|joint| joints[joint].bone).find(|bone| self.bones.contains(bone))
    }

    fn row(&self, target: usize, pairs: &[Pair]) -> Option<Row> {
        let pose = self.pose(target);
        let is_turned = |bone: &&Bone| 2.0 * libm::acosf(pose.rotation(**bone).w.abs().min(1.0)) > TURNED_RAD;
        let turned: Vec<Bone> = self.bones.iter().filter(is_turned).flat_map(|bone| [*bone, bone.mirrored()]).collect();
        let arms = [Bone::LeftShoulder, Bone::LeftUpperArm, Bone::LeftLowerArm];
        let turns_arms = turned.iter().any(|bone| arms.contains(bone));
        let pairs = self.moved_by(&turned, pairs);
        if pairs.len() < LEAST {
            return None;
        }
        let moved_m = self.apart_m(&pairs, &Pose::REST, target);
        let share = self.apart_m(&pairs, &pose, target) / moved_m;
        share.is_finite().then_some(Row { target, pairs, moved_m, share, turns_arms })
    }

    /// How far a pose carries cloth from a row's shape, as a share of how far the shape is from the base.
    fn share(&self, row: &Row, pose: &Pose) -> f32 {
        self.apart_m(&row.pairs, pose, row.target) / row.moved_m
    }

    /// The pairs that any of these bones, or what hangs on them, moves.
    fn moved_by(&self, bones: &[Bone], pairs: &[Pair]) -> Vec<Pair> {
        let joints = self.body.skeleton.joints();
        let mut moves = vec![false; joints.len()];
        for (i, joint) in joints.iter().enumerate() {
            moves[i] = bones.contains(&joint.bone) || joint.parent.is_some_and(|parent| moves[usize::from(parent)]);
        }
        let share = |skin: u32| -> f32 {
            let row = self.body.skin[skin as usize].iter().filter(|(joint, _)| moves[usize::from(*joint)]);
            row.map(|(_, weight)| weight).sum()
        };
        pairs.iter().copied().filter(|pair| share(pair.skin) > 0.5).collect()
    }

    /// How far a pose carries cloth from a target's shape, on average, metres.
    fn apart_m(&self, pairs: &[Pair], pose: &Pose, target: usize) -> f32 {
        let shape_m = &self.targets[target].positions_m;
        let carried_m = self.carried_m(pairs, pose);
        pairs.iter().zip(carried_m).map(|(pair, at_m)| at_m.distance(shape_m[pair.cloth as usize])).sum::<f32>()
            / pairs.len() as f32
    }

    /// Where a pose carries cloth that goes with the skin.
    fn carried_m(&self, pairs: &[Pair], pose: &Pose) -> Vec<Vec3> {
        let skeleton = &self.body.skeleton;
        let mut posed_from_rest = vec![Affine3A::IDENTITY; skeleton.frame_count()];
        skeleton.posed_from_rest(pose, &mut posed_from_rest);
        let carried = |pair: &Pair| {
            let rest_m = self.base_m[pair.cloth as usize];
            let row = self.body.skin[pair.skin as usize].iter();
            row.map(|&(joint, weight)| posed_from_rest[usize::from(joint)].transform_point3(rest_m) * weight).sum()
        };
        pairs.iter().map(carried).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::near_skin;
    use std::path::Path;
    use std::sync::LazyLock;

    static SAMPLE: LazyLock<(ir::Garment, Vec<Pair>)> = LazyLock::new(|| {
        let garment = crate::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src/komon")).garment.unwrap();
        let pairs = near_skin::pairs(&garment.base.positions_m, &garment.body);
        (garment, pairs)
    });

    fn found(change: impl FnOnce(&mut ir::Garment)) -> Vec<Fault> {
        let (garment, _) = &*SAMPLE;
        let mut garment = garment.clone();
        change(&mut garment);
        let pairs = near_skin::pairs(&garment.base.positions_m, &garment.body);
        of_garment(&garment, &pairs, &garment.targets)
    }

    fn of_garment(garment: &ir::Garment, pairs: &[Pair], targets: &[ir::TargetShape]) -> Vec<Fault> {
        let turn = |pose: Pose, (bone, rotation): (&Bone, &Quat)| pose.with(*bone, *rotation);
        let pose = |target: &ir::TargetShape| garment.pose_bones.iter().zip(&target.rotations).fold(Pose::REST, turn);
        let written: Vec<Pose> = targets.iter().map(pose).collect();
        faults(&garment.base.positions_m, &garment.body, pairs, &garment.pose_bones, targets, &written)
    }

    fn number(name: &str) -> usize {
        SAMPLE.0.targets.iter().position(|target| target.name == name).unwrap()
    }

    /// Each row's rotations as the bones of another pose.
    fn turn(garment: &mut ir::Garment, of: impl Fn(&dyn Fn(Bone) -> Quat, Bone) -> Quat) {
        let bones = garment.pose_bones.clone();
        for target in &mut garment.targets {
            let rotations = target.rotations.clone();
            let at = |bone: Bone| bones.iter().position(|b| *b == bone).map_or(Quat::IDENTITY, |i| rotations[i]);
            target.rotations = bones.iter().map(|&bone| of(&at, bone)).collect();
        }
    }

    #[test]
    fn right_rows_are_left_alone() {
        let (garment, pairs) = &*SAMPLE;
        let found = of_garment(garment, pairs, &garment.targets);
        assert_eq!(found, []);
        // Arms alone, legs alone, and whatever part of them an artist has made so far.
        for legs in [false, true] {
            let of_legs = |target: &&ir::TargetShape| {
                ["leg", "step", "knee", "squat", "sit"].iter().any(|word| target.name.contains(word))
            };
            let kept = garment.targets.iter().filter(|target| of_legs(target) == legs);
            let kept: Vec<ir::TargetShape> = kept.cloned().collect();
            assert_eq!(of_garment(garment, pairs, &kept), []);
        }
        for keep in [3, 5, 7] {
            for first in 0..keep {
                let kept = garment.targets.iter().enumerate().filter(|(i, _)| i % keep == first);
                let kept: Vec<ir::TargetShape> = kept.map(|(_, target)| target.clone()).collect();
                assert_eq!(of_garment(garment, pairs, &kept), []);
            }
        }
    }

    #[test]
    fn a_table_that_is_wrong_throughout_is_explained() {
        let guess = |found: &[Fault]| match found {
            [Fault::Table(guess, ..)] => *guess,
            other => panic!("{other:?}"),
        };
        assert_eq!(guess(&found(|g| turn(g, |at, bone| at(bone).inverse()))), Guess::Negated);
        assert_eq!(guess(&found(|g| turn(g, |at, bone| at(bone.mirrored())))), Guess::SidesExchanged);
        assert_eq!(guess(&found(|g| turn(g, |at, bone| at(bone) * at(bone)))), Guess::Half);
        let half = |q: Quat| Quat::IDENTITY.slerp(q, 0.5);
        assert_eq!(guess(&found(|g| turn(g, |at, bone| half(at(bone))))), Guess::Double);
        let mirrored = |q: Quat| Quat::from_xyzw(q.x, -q.y, -q.z, q.w);
        assert_eq!(guess(&found(|g| turn(g, |at, bone| mirrored(at(bone.mirrored()))))), Guess::Mirrored);
        let a_pose = number("a_pose_45");
        assert_eq!(guess(&found(|g| g.base.positions_m = g.targets[a_pose].positions_m.clone())), Guess::Unknown);
        // In the axes of another program: Y and Z for each other.
        let axes = |q: Quat| Quat::from_xyzw(q.x, q.z, q.y, q.w);
        assert_eq!(guess(&found(|g| turn(g, |at, bone| axes(at(bone))))), Guess::Unknown);
    }

    #[test]
    fn single_rows_are_named_with_what_fits_them() {
        for (a, b) in [
            ("right_45", "left_45"),
            ("both_forward", "both_down"),
            ("right_elbow_90", "left_elbow_90"),
            ("left_knee_45", "right_knee_45"),
        ] {
            let (a, b) = (number(a), number(b));
            let exchanged = found(|g| {
                let rotations = g.targets[a].rotations.clone();
                g.targets[a].rotations = std::mem::replace(&mut g.targets[b].rotations, rotations);
            });
            assert_eq!(exchanged, [Fault::Exchanged(a.min(b), a.max(b))]);
        }
        let row = number("right_forward");
        let negated = found(|g| g.targets[row].rotations.iter_mut().for_each(|q| *q = q.inverse()));
        assert!(
            matches!(negated[..], [Fault::Row(at, apart_m, Guess::Negated)] if at == row && apart_m > 0.1),
            "{negated:?}"
        );
        // A stale simulation under a new name.
        let (old, new) = (number("both_forward"), number("hands_before_belly"));
        let stale = found(|g| g.targets[new].positions_m = g.targets[old].positions_m.clone());
        assert!(stale.is_empty() || matches!(stale[..], [Fault::Row(at, _, Guess::Row(_))] if at == new), "{stale:?}");
        let stale = found(|g| {
            g.targets[number("right_raised_45")].positions_m = g.targets[number("right_forward")].positions_m.clone()
        });
        assert!(
            matches!(stale[..], [Fault::Row(at, _, Guess::Row(_))] if at == number("right_raised_45")),
            "{stale:?}"
        );
    }

    /// Rotations of the world, and angles that were meant in another order than the table's.
    #[test]
    fn rotations_that_are_meant_otherwise_are_named() {
        use glam::EulerRot;
        // First about Z, then Y, then X.
        let as_written = |q: Quat| {
            let (x, y, z) = q.to_euler(EulerRot::XYZ);
            Quat::from_euler(EulerRot::ZYX, z, y, x)
        };
        let of_table = |found: &[Fault], guess: Guess| matches!(found, [Fault::Table(other, ..)] if *other == guess);
        let order = found(|g| turn(g, |at, bone| as_written(at(bone))));
        assert!(of_table(&order, Guess::Order(0)), "{order:?}");
        let world = |at: &dyn Fn(Bone) -> Quat, bone: Bone| match bone {
            Bone::LeftUpperArm => at(Bone::LeftShoulder) * at(bone),
            Bone::LeftLowerArm => at(Bone::LeftShoulder) * at(Bone::LeftUpperArm) * at(bone),
            Bone::RightUpperArm => at(Bone::RightShoulder) * at(bone),
            Bone::RightLowerArm => at(Bone::RightShoulder) * at(Bone::RightUpperArm) * at(bone),
            Bone::LeftLowerLeg => at(Bone::LeftUpperLeg) * at(bone),
            Bone::RightLowerLeg => at(Bone::RightUpperLeg) * at(bone),
            _ => at(bone),
        };
        let world = found(|g| turn(g, world));
        assert!(of_table(&world, Guess::World), "{world:?}");
    }
}
