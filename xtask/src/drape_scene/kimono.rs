//! A kimono of the catalog on its wearer: its base, displaced, is draped anew; the cloth under the obi is held.

use super::Scene;
use super::around::{Around, Moves};
use crate::places::{Places, say};
use glam::{DVec2, DVec3, Quat, Vec3};
use kitsuke::skeleton::Pose;
use kitsuke_drape::body::Body;
use kitsuke_drape::repair;
use kitsuke_drape::sheet::{PatternMesh, Sheet};
use kitsuke_drape::triangle_tree::TriangleTree;
use kitsuke_pipeline::ir;
use std::f64::consts::TAU;

/// Cloth nearer to the obi than this lies under it, metres.
const UNDER_OBI_M: f64 = 0.012;
/// Waves of a displaced start, metres.
const WAVE_M: f64 = 0.5;

/// The base of a kimono with its wearer. A start is the base where it was not displaced, and otherwise bent by smooth waves of the space it is in,
/// so that nothing passes through itself.
/// With a pose of its table, the wearer goes there from the T-pose.
pub fn scene(places: &Places, id: &str, start: u32, displaced_m: f64, pose: Option<&str>) -> Result<Scene, String> {
    let garment = places.source(id).ok_or_else(|| format!("{id} cannot be read: cargo xtask check {id}"))?;
    let base = &garment.base;
    if base.uv_triangles.is_empty() {
        return Err(format!("the base of {id} has no texture coordinates, and cloth is cut by its pattern"));
    }
    let mut positions_m = double(&base.positions_m);
    let body_m = double(&garment.body.surface.positions_m);
    let body = Body::with_holes_closed(&body_m, &garment.body.surface.triangles).map_err(|error| error.to_string())?;
    let repaired = repair::clear(&mut positions_m, &base.triangles);
    if !repaired.left.is_empty() {
        return Err(format!("the base meets itself in {} places that do not come clear", repaired.left.len()));
    }
    say!(
        "{} of {} vertices of the base were moved by at most {:.1} mm, so that it does not meet itself",
        repaired.moved.len(),
        positions_m.len(),
        1e3 * repaired.farthest_m
    );
    let corners_uv: Vec<[DVec2; 3]> =
        base.uv_triangles.iter().map(|corners| corners.map(|v| base.uv[v as usize].as_dvec2())).collect();
    let mut sheet = Sheet::from_pattern(&PatternMesh {
        positions_m: &positions_m,
        triangles: &base.triangles,
        corners_uv: &corners_uv,
        metres_per_uv: metres_per_uv(&positions_m, &base.triangles, &corners_uv),
        welds: &[],
    })
    .map_err(|error| error.to_string())?;
    let mut is_held = vec![false; positions_m.len()];
    if let Some(obi) = &garment.obi {
        let obi_m = double(&obi.positions_m);
        let tree = TriangleTree::new(&obi_m, &obi.triangles);
        for (v, &at_m) in positions_m.iter().enumerate() {
            if tree.nearest(&obi_m, at_m, UNDER_OBI_M).is_some() {
                is_held[v] = true;
                sheet.pin(v as u32, at_m).map_err(|error| error.to_string())?;
            }
        }
    }
    say!("{} vertices are held under the obi", is_held.iter().filter(|held| **held).count());
    let start_m = displaced(&positions_m, &is_held, start, displaced_m);
    let inside = start_m.iter().filter(|at_m| body.contains(**at_m)).count();
    let farthest_m = start_m.iter().zip(&positions_m).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    say!("start {start}: vertices go up to {:.0} mm, {inside} of them into the body", 1e3 * farthest_m);
    let mut start_m = start_m;
    let repaired = repair::clear(&mut start_m, &base.triangles);
    if !repaired.moved.is_empty() {
        say!("{} vertices of the start were moved so that it does not meet itself", repaired.moved.len());
    }
    let (mut moves, mut target_m) = (None, None);
    if let Some(name) = pose {
        let target = garment.targets.iter().find(|target| target.name == name);
        let target = target.ok_or_else(|| {
            let names: Vec<&str> = garment.targets.iter().map(|target| target.name.as_str()).collect();
            format!("{id} has no pose {name}; it has {}", names.join(", "))
        })?;
        target_m = Some(double(&target.positions_m));
        moves = Some(moving(&garment, target));
    }
    Ok(Scene { around: Around { moves, ..Around::of(body) }, start_m: Some(start_m), target_m, ..Scene::of(sheet) })
}

/// The wearer on her way from the T-pose to a target's pose, at 60 degrees a second.
fn moving(garment: &ir::Garment, target: &ir::TargetShape) -> Moves {
    const RAD_PER_S: f64 = TAU / 6.0;
    let widest = target.rotations.iter().map(|rotation| f64::from(rotation.angle_between(Quat::IDENTITY)));
    let seconds = (widest.fold(0.0, f64::max) / RAD_PER_S).max(0.1);
    let (body, bones, rotations) = (garment.body.clone(), garment.pose_bones.clone(), target.rotations.clone());
    let at_m = move |share: f64| {
        let mut pose = Pose::default();
        for (bone, rotation) in bones.iter().zip(&rotations) {
            pose = pose.with(*bone, Quat::IDENTITY.slerp(*rotation, share as f32));
        }
        double(&body.posed_m(&pose))
    };
    Moves { at_m: Box::new(at_m), seconds }
}

fn double(places_m: &[Vec3]) -> Vec<DVec3> {
    places_m.iter().map(|p| p.as_dvec3()).collect()
}

/// How large the pattern is: the median of edges in space over the same in texture coordinates.
fn metres_per_uv(positions_m: &[DVec3], triangles: &[[u32; 3]], corners_uv: &[[DVec2; 3]]) -> f64 {
    let mut ratios = Vec::new();
    for (corners, uv) in triangles.iter().zip(corners_uv) {
        for i in 0..3 {
            let [a, b] = [i, (i + 1) % 3].map(|i| positions_m[corners[i] as usize]);
            let flat = uv[i].distance(uv[(i + 1) % 3]);
            if flat > 0.0 {
                ratios.push(a.distance(b) / flat);
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    ratios[ratios.len() / 2]
}

/// Places bent by waves along each axis, other ones for each start; what is held stays, and what is near it goes less far.
fn displaced(positions_m: &[DVec3], is_held: &[bool], start: u32, by_m: f64) -> Vec<DVec3> {
    /// Cloth this far from what is held goes the whole way, metres.
    const FULL_M: f64 = 0.25;
    let held_m: Vec<DVec3> = positions_m.iter().zip(is_held).filter(|(_, held)| **held).map(|(p, _)| *p).collect();
    let phase = |axis: u32, wave: u32| TAU * f64::from((start * 37 + axis * 17 + wave * 11) % 64) / 64.0;
    let bent = |p: DVec3| {
        let wave = |axis: u32| {
            (0..3).map(|along: u32| libm::sin(TAU * p[along as usize] / WAVE_M + phase(axis, along))).sum::<f64>() / 3.0
        };
        DVec3::new(wave(0), wave(1), wave(2))
    };
    positions_m
        .iter()
        .zip(is_held)
        .map(|(&p, &held)| {
            let away_m = held_m.iter().map(|h| h.distance_squared(p)).fold(f64::INFINITY, f64::min).sqrt();
            let share = if held { 0.0 } else { (away_m / FULL_M).min(1.0) };
            p + bent(p) * (by_m * share)
        })
        .collect()
}
