//! Brings a garment into the pack's order and its small numbers. Knows the arrays of a pack, not their bytes.

use crate::ir;
use crate::stages::StageError;
use glam::{Quat, Vec2, Vec3};
use kitsuke::arrays::{Driver, GarmentData, Mesh, Part, PoseTable, Segment, SkinWeights, Target};
use kitsuke::pack::write::{moved, quantise};
use std::collections::{BTreeMap, BTreeSet};

/// Driver sets owning fewer vertices than this join a larger set that holds them.
const FEWEST_VERTICES: usize = 48;

/// The arrays of a pack from the garment and what the stages made of it: `skin` and `masks` per base vertex, `deltas`
/// per target and base vertex, metres.
///
/// A delta is stored in steps of 2/√3 of `radius_m`: the largest cubic grid of which every ball of that radius holds a
/// point. Where it holds several, the one that takes the fewest bytes is stored.
///
/// # Errors
/// When a target lies too far from the base for its step, naming target and vertex.
pub fn compress(
    garment: &ir::Garment,
    skin: &[SkinWeights],
    masks: &[u16],
    deltas: &[Vec<Vec3>],
    radius_m: f32,
) -> Result<GarmentData, StageError> {
    let step_m = step_m(radius_m);
    let steps: Vec<Vec<[i16; 3]>> = garment
        .targets
        .iter()
        .zip(deltas)
        .map(|(target, deltas)| in_steps(&target.name, deltas, step_m))
        .collect::<Result<_, _>>()?;
    let layers_of_drivers: Vec<u8> = garment.drivers.iter().map(|driver| driver.layer).collect();
    let layers_of_targets: Vec<u8> = garment.targets.iter().map(|target| target.layer).collect();
    let groups = group_numbers(&garment.drivers);
    let order = order(&layers_of_drivers, &groups, masks, &layers_of_targets, &steps);

    let driver = |driver: &ir::Driver| Driver {
        name: driver.name.clone(),
        joints: driver.joints.clone(),
        threshold_rad: driver.threshold_rad,
        layer: driver.layer,
    };
    let mesh = mesh(&garment.base, &order.source_vertex);
    let mut targets: Vec<Target> = garment
        .targets
        .iter()
        .zip(&steps)
        .map(|(t, steps)| target(t, step_m, steps, &layers_of_drivers, &order))
        .collect();
    let wanted: Vec<Vec<Vec3>> =
        targets.iter().zip(deltas).map(|(target, deltas)| wanted(target, deltas, &order)).collect();
    let moved = moved(&order.segments, targets.iter().map(|target| target.segments.as_slice()));
    for (target, deltas) in targets.iter_mut().zip(quantise(&mesh, &moved, &wanted, radius_m / step_m)) {
        target.deltas = deltas;
    }
    Ok(GarmentData {
        id: garment.id.clone(),
        name: garment.name.clone(),
        skeleton: garment.body.skeleton.clone(),
        mesh,
        skin: order.source_vertex.iter().map(|&v| skin[v as usize]).collect(),
        drivers: garment.drivers.iter().map(driver).collect(),
        targets,
        corrective_count: 0,
        segments: order.segments,
        poses: pose_table(garment),
        pose_limits: garment.pose_limits.clone(),
        rbf: None,
        certificate: None,
        compression: None,
    })
}

/// Edge of the largest cubic grid of which every ball of this radius holds a point, metres.
#[must_use]
pub fn step_m(radius_m: f32) -> f32 {
    2.0 * radius_m / 3f32.sqrt()
}

/// The base's row, then the targets'.
#[must_use]
pub fn pose_table(garment: &ir::Garment) -> PoseTable {
    let mut rotations = vec![Quat::IDENTITY; garment.pose_bones.len()];
    rotations.extend(garment.targets.iter().flat_map(|target| &target.rotations));
    PoseTable { bones: garment.pose_bones.clone(), rotations }
}

/// Deltas in steps, rounded to the nearest.
fn in_steps(target: &str, deltas: &[Vec3], step_m: f32) -> Result<Vec<[i16; 3]>, StageError> {
    let limit = f32::from(i16::MAX);
    let quantised = |(v, delta): (usize, &Vec3)| {
        let steps = (*delta / step_m).round();
        if steps.abs().max_element() <= limit {
            return Ok(steps.to_array().map(|s| s as i16));
        }
        Err(StageError::new(
            "compress",
            format!(
                "target {target}: vertex {v} lies {:.2} m from the skinned base, but numbers as fine as {:.4} mm reach at \
                 most {:.2} m; give a larger budget or mend the target",
                delta.length(),
                step_m * 3f32.sqrt() / 2.0 * 1e3,
                limit * step_m
            ),
        ))
    };
    deltas.iter().enumerate().map(quantised).collect()
}

/// The order of the unique vertices.
struct Order {
    /// Base vertices in the pack's order.
    source_vertex: Vec<u32>,
    segments: Vec<Segment>,
}

/// For each driver the first one of its group.
fn group_numbers(drivers: &[ir::Driver]) -> Vec<u8> {
    let first =
        |driver: &ir::Driver| drivers.iter().position(|other| other.group == driver.group).expect("itself at least");
    drivers.iter().map(|driver| first(driver) as u8).collect()
}

/// Vertices by the set of groups that own them, then in file order: drivers of a group blend alike, and the fewer segments there are,
/// the longer are the runs of a frame. A group owns nothing where no target of its layer moves.
fn order(
    layers_of_drivers: &[u8],
    groups: &[u8],
    masks: &[u16],
    layers_of_targets: &[u8],
    steps: &[Vec<[i16; 3]>],
) -> Order {
    let driver_count = groups.len();
    let vertex_count = masks.len() / driver_count.max(1);
    let mut by_drivers: BTreeMap<BTreeSet<u8>, Vec<u32>> = BTreeMap::new();
    for v in 0..vertex_count {
        let moves = |layer: u8| {
            let mut of_layer = layers_of_targets.iter().zip(steps).filter(|(other, _)| **other == layer);
            of_layer.any(|(_, steps)| steps[v] != [0; 3])
        };
        let owners = (0..driver_count).filter(|&d| masks[v * driver_count + d] > 0 && moves(layers_of_drivers[d]));
        let owning: BTreeSet<u8> = owners.map(|d| groups[d]).collect();
        let drivers = (0..driver_count).filter(|&d| owning.contains(&groups[d])).map(|d| d as u8).collect();
        by_drivers.entry(drivers).or_default().push(v as u32);
    }
    join_small_sets(&mut by_drivers);

    let segments = by_drivers
        .iter()
        .map(|(drivers, vertices)| {
            let row = |&v: &u32| drivers.iter().map(move |&d| masks[v as usize * driver_count + usize::from(d)]);
            let mut rows: Vec<u16> = vertices.iter().flat_map(row).collect();
            if drivers.len() == 1 && rows.iter().all(|&mask| mask == u16::MAX) {
                rows.clear();
            }
            let vertex_count = vertices.len() as u32;
            Segment { vertex_count, drivers: drivers.iter().copied().collect(), masks: rows }
        })
        .collect();
    Order { source_vertex: by_drivers.into_values().flatten().collect(), segments }
}

/// Moves the vertices of rare sets into the smallest other set that holds all their drivers, so that there are few
/// segments; their masks for the drivers added are 0.
fn join_small_sets(by_drivers: &mut BTreeMap<BTreeSet<u8>, Vec<u32>>) {
    let mut small: Vec<BTreeSet<u8>> =
        by_drivers.iter().filter(|(_, v)| v.len() < FEWEST_VERTICES).map(|(set, _)| set.clone()).collect();
    small.sort_by_key(BTreeSet::len);
    for set in small {
        let holds_it = |other: &&BTreeSet<u8>| **other != set && other.is_superset(&set);
        if let Some(larger) = by_drivers.keys().filter(holds_it).min_by_key(|other| other.len()).cloned() {
            let vertices = by_drivers.remove(&set).expect("a set is removed once, by itself");
            let joined = by_drivers.get_mut(&larger).expect("found among the keys");
            joined.extend(vertices);
            joined.sort_unstable();
        }
    }
}

/// A target's steps in the pack's order, without the segments that it leaves alone.
fn target(shape: &ir::TargetShape, step_m: f32, steps: &[[i16; 3]], layers_of_drivers: &[u8], order: &Order) -> Target {
    let (name, layer) = (shape.name.clone(), shape.layer);
    let mut target = Target { name, layer, step_m, segments: Vec::new(), deltas: Vec::new() };
    let mut start = 0;
    for (s, segment) in order.segments.iter().enumerate() {
        let end = start + segment.vertex_count as usize;
        let run = order.source_vertex[start..end].iter().map(|&v| steps[v as usize]);
        let is_driven = segment.drivers.iter().any(|&driver| layers_of_drivers[usize::from(driver)] == layer);
        if is_driven && run.clone().any(|step| step != [0; 3]) {
            target.segments.push(s as u16);
            target.deltas.extend(run);
        }
        start = end;
    }
    target
}

/// What a target's steps would be if they need not be whole.
fn wanted(target: &Target, deltas: &[Vec3], order: &Order) -> Vec<Vec3> {
    let mut start = 0;
    let runs = order.segments.iter().map(|segment| {
        let run = &order.source_vertex[start..start + segment.vertex_count as usize];
        start += segment.vertex_count as usize;
        run
    });
    let runs: Vec<&[u32]> = runs.collect();
    let moved = target.segments.iter().flat_map(|&segment| runs[usize::from(segment)]);
    moved.map(|&vertex| deltas[vertex as usize] / target.step_m).collect()
}

/// The surface in the pack's order: unique vertices, then a twin for every further texture coordinate of one.
fn mesh(base: &ir::Surface, source_vertex: &[u32]) -> Mesh {
    let mut packed_from_source = vec![0u32; source_vertex.len()];
    for (packed, &source) in source_vertex.iter().enumerate() {
        packed_from_source[source as usize] = packed as u32;
    }
    let position = |&v: &u32| base.positions_m[v as usize];
    let part = |part: &ir::Part| Part { name: part.name.clone(), triangle_count: part.triangle_count };
    let mut mesh = Mesh {
        // Plus 0, so that no coordinate is -0: whole steps have none.
        positions_m: source_vertex.iter().map(|v| position(v) + Vec3::ZERO).collect(),
        triangles: base.triangles.iter().map(|t| t.map(|v| packed_from_source[v as usize])).collect(),
        parts: base.parts.iter().map(part).collect(),
        source_vertex: source_vertex.to_vec(),
        ..Mesh::default()
    };
    if !base.uv_triangles.is_empty() {
        split_seams(base, &mut mesh);
    }
    mesh
}

/// Gives every corner its texture coordinate; a vertex keeps the first of its coordinates, each further one makes a twin.
fn split_seams(base: &ir::Surface, mesh: &mut Mesh) {
    let bits = |uv: Vec2| uv.to_array().map(f32::to_bits);
    let corners = mesh.triangles.iter().flatten().zip(base.uv_triangles.iter().flatten());
    let mut coordinates: Vec<Vec<Vec2>> = vec![Vec::new(); mesh.positions_m.len()];
    for (&v, &vt) in corners {
        let uv = base.uv[vt as usize];
        let known = &mut coordinates[v as usize];
        if !known.iter().any(|&other| bits(other) == bits(uv)) {
            known.push(uv);
        }
    }
    mesh.uv = coordinates.iter().map(|known| known.first().copied().unwrap_or(Vec2::ZERO)).collect();
    let mut first_twin = Vec::with_capacity(coordinates.len());
    for (v, known) in coordinates.iter().enumerate() {
        first_twin.push(mesh.uv.len() as u32);
        for &uv in known.iter().skip(1) {
            mesh.uv.push(uv);
            mesh.twin_of.push(v as u32);
        }
    }
    for (corner, &vt) in mesh.triangles.iter_mut().flatten().zip(base.uv_triangles.iter().flatten()) {
        let v = *corner as usize;
        let uv = bits(base.uv[vt as usize]);
        let place = coordinates[v].iter().position(|&other| bits(other) == uv).expect("collected above") as u32;
        if place > 0 {
            *corner = first_twin[v] + place - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_stays_within_the_budget_and_overflow_names_the_target() {
        let budget_m = 5e-5;
        let step_m = 2.0 * budget_m / 3f32.sqrt();
        let deltas: Vec<Vec3> = (0..1000).map(|i| Vec3::new(i as f32 * 7.3e-6, i as f32 * -3.1e-6, 0.4)).collect();
        for (delta, steps) in deltas.iter().zip(in_steps("t", &deltas, step_m).unwrap()) {
            let stored = Vec3::from_array(steps.map(f32::from)) * step_m;
            assert!(stored.distance(*delta) <= budget_m * 1.01, "{stored} is not {delta}");
        }
        let error = in_steps("a_pose", &[Vec3::ZERO, Vec3::X * 3.0], step_m).unwrap_err().to_string();
        assert!(error.contains("target a_pose: vertex 1 lies 3.00 m"), "{error}");
    }

    #[test]
    fn vertices_go_by_owners_and_rare_owners_join_the_next_larger_set() {
        let n = 200u32;
        // Driver 0 owns the first hundred, both own the rest but one; that one is driver 1's alone.
        let masks: Vec<u16> = (0..n)
            .flat_map(|v| match v {
                150 => [0, 65535],
                v if v % 2 == 0 => [65535, 0],
                _ => [30000, 35535],
            })
            .collect();
        let steps = vec![vec![[1, 0, 0]; n as usize]];
        let order = order(&[0, 0], &[0, 1], &masks, &[0], &steps);
        assert_eq!(order.segments.len(), 2);
        assert_eq!(order.segments[0].drivers, [0]);
        assert!(order.segments[0].masks.is_empty(), "one owner of everything needs no masks");
        assert_eq!(order.segments[1].drivers, [0, 1]);
        assert_eq!(order.segments[1].vertex_count, 101);
        assert!(order.source_vertex[..99].is_sorted() && order.source_vertex[99..].is_sorted());
        let at = order.source_vertex[99..].iter().position(|&v| v == 150).unwrap();
        assert_eq!(order.segments[1].masks[2 * at..2 * at + 2], [0, 65535]);
    }

    #[test]
    fn a_seam_vertex_has_one_twin_per_further_coordinate() {
        let uv = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5], [1.0, 0.0]].map(Vec2::from_array).to_vec();
        let base = ir::Surface {
            positions_m: (0..4).map(|v| Vec3::new(v as f32, (v * v) as f32, 0.0)).collect(),
            triangles: vec![[0, 1, 2], [1, 3, 2]],
            uv,
            uv_triangles: vec![[0, 1, 2], [3, 0, 2]],
            parts: vec![],
        };
        let mesh = mesh(&base, &[3, 2, 1, 0]);
        assert_eq!(mesh.twin_of, [2], "only vertex 1 (packed 2) has two coordinates");
        assert_eq!(mesh.triangles, [[3, 2, 1], [4, 0, 1]]);
        assert_eq!(mesh.uv.len(), 5);
        assert_eq!((mesh.uv[2], mesh.uv[4]), (Vec2::new(1.0, 0.0), Vec2::new(0.5, 0.5)));
    }
}
