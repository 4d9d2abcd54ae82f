//! Painted masks against what the targets move: masks that were inverted, turned over or exchanged, and one for two drivers. Knows no
//! poses but which joints they turn.

use super::poses::is_near;
use super::regions::{mask_of, vertex_values};
use super::{NamedMesh, drivers, value};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir::TargetShape;
use crate::source::folder::Folder;
use crate::source::manifest::{DriverEntry, Field, Manifest};
use crate::source::masks::Mask;
use glam::{Quat, Vec2, Vec3};
use kitsuke::skeleton::Bone;
use std::collections::BTreeMap;

/// Where a mask lies its targets move the cloth this many times as far as on average; less than the whole cloth would, and it lies elsewhere.
/// Masks of a sample have 4 to 8, those of the coarsest 2.9.
const ELSEWHERE: f32 = 0.9;
/// Another mask fits when it has so much, and this many times what the own one has.
const FITS: f32 = 1.5;
const GAIN: f32 = 3.0;
/// Nobody would paint such a mask, whatever was meant.
const NOWHERE: f32 = 0.25;
/// Masks nowhere farther apart are one.
const SAME: f32 = 0.02;

type Turn = fn(Vec2) -> Vec2;

/// How a mask may have been turned, and what to do with it.
const TURNS: [(&str, &str, Turn); 5] = [
    ("turned over from top to bottom", "turn it over", |uv| Vec2::new(uv.x, 1.0 - uv.y)),
    ("turned over from left to right", "turn it over", |uv| Vec2::new(1.0 - uv.x, uv.y)),
    ("turned by 180 degrees", "turn it back", |uv| Vec2::new(1.0 - uv.x, 1.0 - uv.y)),
    ("turned by 90 degrees", "turn it back", |uv| Vec2::new(uv.y, 1.0 - uv.x)),
    ("turned by 90 degrees", "turn it back", |uv| Vec2::new(1.0 - uv.y, uv.x)),
];

/// A driver with its mask.
struct Painted<'a> {
    name: &'a str,
    group: &'a str,
    file: &'a str,
    mask: &'a Mask,
    weights: Vec<f32>,
    bones: Vec<Bone>,
}

/// Reports masks that do not lie where the targets of their drivers move the cloth; `bones` are the columns of the targets' rotations.
pub(super) fn check(
    manifest: &Manifest,
    folder: &Folder,
    (base, base_m): (NamedMesh<'_>, &[Vec3]),
    masks: &BTreeMap<String, Mask>,
    (bones, targets): (&[Bone], &[TargetShape]),
    report: &mut Vec<Diagnostic>,
) {
    let painted = |driver| {
        let (file, mask) = mask_of(driver, folder, masks)?;
        let DriverEntry { name, group, joints, .. } = driver;
        let name = value(name)?;
        let group = group.as_ref().and_then(Field::get).unwrap_or(name);
        let bones = drivers::right_joints(joints).map(|(_, bone)| bone).collect();
        let weights = vertex_values(base.mesh, |uv| mask.sample(uv));
        Some(Painted { name, group, file, mask, weights, bones })
    };
    let painted: Vec<Painted<'_>> = manifest.drivers.iter().filter_map(painted).collect();
    let turns = |target: &TargetShape, driver: &Painted<'_>| {
        let mut joints = bones.iter().zip(&target.rotations);
        joints.any(|(bone, rotation)| driver.bones.contains(bone) && !is_near(*rotation, Quat::IDENTITY))
    };
    for (i, own) in painted.iter().enumerate() {
        let meets = |other: &&Painted<'_>| {
            own.group == other.group || targets.iter().any(|target| turns(target, own) && turns(target, other))
        };
        let is_same = |other: &&Painted<'_>| own.weights.iter().zip(&other.weights).all(|(a, b)| (a - b).abs() < SAME);
        // Two may share a part that each has half of.
        let is_full = own.weights.iter().any(|weight| *weight > 0.75);
        if let Some(other) = painted[..i].iter().filter(meets).find(is_same).filter(|_| is_full) {
            report.push(
                Diagnostic::warning("mask-twice", own.file, Place::File)
                    .problem(format!(
                        "the mask of {} is that of {}, so that neither rules there alone",
                        own.name, other.name
                    ))
                    .help("Give each driver the mask of its own part; where both rule they sum to white."),
            );
            continue;
        }
        let alone = |target: &&TargetShape| {
            turns(target, own) && !painted.iter().any(|other| other.name != own.name && turns(target, other))
        };
        let mut telling: Vec<&TargetShape> = targets.iter().filter(alone).collect();
        if telling.is_empty() {
            telling = targets.iter().filter(|target| turns(target, own)).collect();
        }
        let moved_m = |v: usize| telling.iter().map(|target| target.positions_m[v].distance(base_m[v])).sum::<f32>();
        let moved_m: Vec<f32> = (0..base_m.len()).map(moved_m).collect();
        let share = |weights: &[f32]| share(weights, &moved_m);
        let Some(of_own) = share(&own.weights).filter(|share| *share < ELSEWHERE) else { continue };
        let inverted: Vec<f32> = own.weights.iter().map(|weight| 1.0 - weight).collect();
        let inverted = (
            "; inverted it would".to_owned(),
            "Paint white where the driver rules, black elsewhere: invert it.".to_owned(),
            share(&inverted),
        );
        let turned = TURNS.iter().map(|(said, help, turn)| {
            let weights = vertex_values(base.mesh, |uv| own.mask.sample(turn(uv)));
            let help =
                format!("Probably it was saved the other way up: {help}; v = 0 is the bottom row of the picture.");
            (format!("; {said} it would"), help, share(&weights))
        });
        let others = painted.iter().filter(|other| other.file != own.file).map(|other| {
            let help = format!("Exchange the masks, if {} was meant here.", other.file);
            (format!("; the mask of {} would", other.name), help, share(&other.weights))
        });
        let guesses = std::iter::once(inverted).chain(turned).chain(others);
        let fits = |share: &Option<f32>| share.is_some_and(|share| share > FITS && share > GAIN * of_own);
        // The likeliest first.
        let (said, help) = match guesses.into_iter().find(|(.., share)| fits(share)) {
            Some((said, help, _)) => (said, help),
            None if of_own < NOWHERE => (String::new(), "Paint white where the driver rules.".to_owned()),
            None => continue,
        };
        report.push(
            Diagnostic::warning("mask-elsewhere", own.file, Place::File)
                .problem(format!(
                    "the mask of {} does not lie where the targets that turn its joints move the cloth{said}",
                    own.name
                ))
                .help(help),
        );
    }
}

/// How far the cloth in a mask moves, against all of it; nothing where nothing is painted or moved.
fn share(weights: &[f32], moved_m: &[f32]) -> Option<f32> {
    let whole: f32 = weights.iter().sum();
    let inside_m: f32 = weights.iter().zip(moved_m).map(|(weight, moved_m)| weight * moved_m).sum();
    let all_m: f32 = moved_m.iter().sum();
    (whole > 1.0 && all_m > 0.0).then(|| inside_m / whole / (all_m / moved_m.len() as f32))
}
