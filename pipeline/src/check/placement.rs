//! Whether the base sits on the body: unit, axes, place, the wearer's left and right, outside and inside, which front lies over the other.

use super::NamedMesh;
use super::near_skin::Pair;
use super::target::{bounds, said_ratio};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::units::LengthUnit;
use glam::Vec3;

/// A kimono's bounding box is so much of the body's, at least and at most; beyond, the unit is wrong.
const SIZE: std::ops::RangeInclusive<f32> = 0.2..=3.0;
/// What a kimono's extent usually is of the body's.
const USUAL_SIZE: f32 = 0.95;
/// How far its middle may lie from the body's, as a share of the body's height.
const AWAY: f32 = 0.25;
/// How far the middles of left pieces must lie on the wrong side, as a share of the body's height.
const WRONG_SIDE: f32 = 0.02;
/// How far from the middle the open edge of the front may lie, as a share of the body's height: sleeves hang farther out.
const FRONT: f32 = 0.15;
/// How far the open edge must lie on the wrong side of the middle, metres.
const OVERLAP_M: f32 = 0.02;
/// Cloth this deep in the skin lies through it, metres.
const THROUGH_M: f32 = 0.01;
/// Share of the cloth near the skin that may lie through it; on the sample none does, on a body that is larger by 5 % an eighth.
const THROUGH: f32 = 0.08;
/// Cloth rests on skin that faces upward this much (sine of its slope).
const UPWARD: f32 = 0.7;
/// Cloth that hangs from the shoulders lies nearer to them, metres: 3 to 4 mm on eleven bodies, 11 to 20 mm on another one's.
const REST_M: f32 = 0.015;
/// A quarter of an obi deeper in the kimono, or a tenth farther outside, are no obi worn: a sound one has +6 and +18 mm.
const OBI_INSIDE_M: f32 = 0.01;
const OBI_OUTSIDE_M: f32 = 0.05;
/// So many places of the obi are looked at.
const OBI_SAMPLE: usize = 400;
/// Fewer vertices near the skin say nothing.
const LEAST_NEAR: usize = 50;

/// Reports why the base does not sit on the body; true when it does.
pub(super) fn check(
    NamedMesh { file, .. }: NamedMesh<'_>,
    base: &ir::Surface,
    unit: LengthUnit,
    body: &ir::Body,
    near: &[Pair],
    report: &mut Vec<Diagnostic>,
) -> bool {
    if base.triangles.is_empty() {
        return false;
    }
    let found = thick(base)
        .or_else(|| wrong_unit(base, unit, body))
        .or_else(|| wrong_axis(base, body))
        .or_else(|| away(base, body))
        .or_else(|| wrong_side(base, body))
        .or_else(|| inside_out(base, body))
        .or_else(|| right_over_left(base, body))
        .or_else(|| through_skin(near));
    let Some((code, problem, help)) = found else {
        check_rest(file, near, report);
        return true;
    };
    report.push(Diagnostic::error(code, file, Place::File).problem(problem).help(help));
    false
}

/// Reports an obi that is not worn over the kimono; true when it shows what lies under it.
pub(super) fn check_obi(
    NamedMesh { file, .. }: NamedMesh<'_>,
    obi: &ir::Surface,
    base: &ir::Surface,
    report: &mut Vec<Diagnostic>,
) -> bool {
    let ((low, high), (base_low, base_high)) = (bounds(&obi.positions_m), bounds(&base.positions_m));
    let reach = 0.1 * (base_high - base_low).max_element();
    let is_worn = (low - base_low).min_element() >= -reach && (base_high - high).min_element() >= -reach;
    if !is_worn || (high - low).length() < reach {
        report.push(
            Diagnostic::error("obi", file, Place::File)
                .problem("the obi does not lie around the kimono")
                .help("Export it from the same scene as the base: same unit, same axes, same place."),
        );
        return false;
    }
    if obi.positions_m == base.positions_m {
        report.push(
            Diagnostic::error("obi", file, Place::File)
                .problem("the obi is the kimono itself")
                .help("Export the obi alone, as a file of its own, or leave the key `obi` out."),
        );
        return false;
    }
    let mut above_m = above_cloth(obi, base);
    let Some(last) = above_m.len().checked_sub(1) else { return false };
    above_m.sort_unstable_by(f32::total_cmp);
    let (lower_m, upper_m) = (above_m[last / 4], above_m[9 * last / 10]);
    let problem = if lower_m < -OBI_INSIDE_M && upper_m > OBI_OUTSIDE_M {
        "on one side the obi lies in the kimono, on the other far outside: it was moved"
    } else if lower_m < -OBI_INSIDE_M {
        "a quarter of the obi or more lies inside the kimono"
    } else if upper_m > OBI_OUTSIDE_M {
        "a part of the obi stands far from the kimono"
    } else {
        return true;
    };
    report.push(
        Diagnostic::warning("obi", file, Place::File)
            .problem(format!(
                "{problem} (a quarter lies at {:+.0} mm or less, a tenth at {:+.0} mm or more, + outside)",
                1e3 * lower_m,
                1e3 * upper_m
            ))
            .help("Export it from the scene of the base, at the same place and scale and round the same body."),
    );
    false
}

/// How far places of the obi lie outside the cloth, each along the normal of the nearest vertex, metres.
fn above_cloth(obi: &ir::Surface, base: &ir::Surface) -> Vec<f32> {
    let mut normals = vec![Vec3::ZERO; base.positions_m.len()];
    kitsuke::vertex_normals(&base.positions_m, base.triangles.iter().copied(), &mut normals);
    let step = obi.positions_m.len().div_ceil(OBI_SAMPLE).max(1);
    let above = |place_m: &Vec3| {
        let distances =
            base.positions_m.iter().zip(&normals).map(|(p, normal)| (p.distance_squared(*place_m), p, normal));
        let (_, nearest_m, normal) = distances.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((*place_m - *nearest_m).dot(*normal))
    };
    obi.positions_m.iter().step_by(step).filter_map(above).collect()
}

type Mistake = (&'static str, String, String);

fn thick(base: &ir::Surface) -> Option<Mistake> {
    super::thick::is_thick(base).then(|| {
        (
            "thick",
            "the cloth has two layers, one inside the other: it was exported with its thickness".to_owned(),
            "Export Thin, not Thick: base, targets and sizes alike (Blender: without a Solidify modifier).".to_owned(),
        )
    })
}

fn extent(surface: &ir::Surface) -> Vec3 {
    let (low, high) = bounds(&surface.positions_m);
    high - low
}

fn wrong_unit(base: &ir::Surface, unit: LengthUnit, body: &ir::Body) -> Option<Mistake> {
    let ratio = extent(base).length() / extent(&body.surface).length().max(f32::MIN_POSITIVE);
    if SIZE.contains(&ratio) {
        return None;
    }
    let misfit = |other: &LengthUnit| {
        let size = ratio * (other.metres() / unit.metres()) as f32 / USUAL_SIZE;
        size.max(1.0 / size)
    };
    let likely = LengthUnit::ALL.into_iter().min_by(|a, b| misfit(a).total_cmp(&misfit(b)))?;
    let help = if misfit(&likely) < 2.0 {
        format!(
            "Set unit = \"{}\" in garment.toml (it counts for base, targets and obi), or export in {unit}.",
            likely.name(),
            unit = unit.name()
        )
    } else {
        "Set `unit` in garment.toml to the unit of the files, or use the body on which the kimono was made.".to_owned()
    };
    Some(("unit", format!("the kimono is {} the body", said_ratio(ratio)), help))
}

fn wrong_axis(base: &ir::Surface, body: &ir::Body) -> Option<Mistake> {
    let (body_low, body_high) = bounds(&body.surface.positions_m);
    let misfit = |turn: fn(Vec3) -> Vec3| {
        let (a, b) = bounds(&base.positions_m);
        let (low, high) = (turn(a).min(turn(b)), turn(a).max(turn(b)));
        (low - body_low).abs().max_element().max((high - body_high).abs().max_element())
    };
    let as_is = misfit(|p| p);
    let lying = misfit(|p| Vec3::new(p.x, p.z, -p.y)).min(misfit(|p| Vec3::new(p.x, -p.z, p.y)));
    if as_is < 0.3 * (body_high.y - body_low.y) || lying > 0.6 * as_is {
        return None;
    }
    Some((
        "up-axis",
        "the kimono lies on its back or face while the body stands".to_owned(),
        "Set up = \"+Z\" (or \"+Y\") in garment.toml to the axis that points up in base, targets and obi.".to_owned(),
    ))
}

fn away(base: &ir::Surface, body: &ir::Body) -> Option<Mistake> {
    let middle = |surface: &ir::Surface| {
        let (low, high) = bounds(&surface.positions_m);
        (low + high) / 2.0
    };
    let apart = middle(base) - middle(&body.surface);
    if apart.length() <= AWAY * extent(&body.surface).y {
        return None;
    }
    let problem = format!(
        "the kimono's middle lies {:.2} m from the body's (x {:+.2}, y {:+.2}, z {:+.2} m)",
        apart.length(),
        apart.x,
        apart.y,
        apart.z
    );
    Some(("not-at-body", problem, "Export the kimono where it hangs on this body, or name the right body.".to_owned()))
}

/// The positions of a part's triangle corners.
fn part_corners<'a>(base: &'a ir::Surface, is_wanted: impl Fn(&str) -> bool + 'a) -> impl Iterator<Item = Vec3> + 'a {
    let mut first = 0;
    let runs = base.parts.iter().map(move |part| {
        let run = first..first + part.triangle_count as usize;
        first = run.end;
        (part, run)
    });
    let wanted = runs.filter(move |(part, _)| is_wanted(&part.name.to_lowercase()));
    wanted.flat_map(|(_, run)| &base.triangles[run]).flatten().map(|&vertex| base.positions_m[vertex as usize])
}

fn mean(points: impl Iterator<Item = Vec3>) -> Option<Vec3> {
    let (sum, count) = points.fold((Vec3::ZERO, 0u32), |(sum, count), point| (sum + point, count + 1));
    (count > 0).then(|| sum / count as f32)
}

/// Pieces that are called left lie on the wearer's left, +X.
fn wrong_side(base: &ir::Surface, body: &ir::Body) -> Option<Mistake> {
    let left = mean(part_corners(base, |name| name.contains("left")))?;
    let right = mean(part_corners(base, |name| name.contains("right")))?;
    if left.x - right.x >= -WRONG_SIDE * extent(&body.surface).y {
        return None;
    }
    Some((
        "mirrored",
        "the pieces called left lie on the wearer's right: the kimono is mirrored, or faces backwards".to_owned(),
        "Export without mirroring; front is +Z and the wearer's left +X, and left lies over right (右前). Where only the names are exchanged: left is the wearer's.".to_owned(),
    ))
}

/// Seen from the bones, faces show their backs: their normals point away from the nearest bone.
fn inside_out(base: &ir::Surface, body: &ir::Body) -> Option<Mistake> {
    let joints = body.skeleton.joints();
    let parent_of = |joint: &kitsuke::skeleton::Joint| joint.parent.map(|p| joints[usize::from(p)].rest_m);
    let bones: Vec<(Vec3, Vec3)> = joints.iter().filter_map(|j| Some((parent_of(j)?, j.rest_m))).collect();
    let away_from_bone = |point: Vec3| {
        let offset = |&(from, to): &(Vec3, Vec3)| {
            let along = to - from;
            let t = (point - from).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
            point - (from + along * t.clamp(0.0, 1.0))
        };
        bones.iter().map(offset).min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
    };
    let mut outward = 0.0;
    for &[a, b, c] in &base.triangles {
        let [a, b, c] = [a, b, c].map(|vertex| base.positions_m[vertex as usize]);
        let away = away_from_bone((a + b + c) / 3.0)?;
        outward += (b - a).cross(c - a).dot(away.normalize_or_zero());
    }
    if outward >= 0.0 {
        return None;
    }
    Some((
        "inside-out",
        "most faces show their inside: the kimono is mirrored or its normals are flipped".to_owned(),
        "Export without mirroring and with the faces' outside outside (counter-clockwise).".to_owned(),
    ))
}

/// The outer front panel ends in an edge that can be seen from the front. On a kimono worn left over right it lies on the wearer's right.
fn right_over_left(base: &ir::Surface, body: &ir::Body) -> Option<Mistake> {
    let at = |v: u32| base.positions_m[v as usize];
    let (low, high) = bounds(&body.surface.positions_m);
    let (middle, height_m) = ((low + high) / 2.0, high.y - low.y);
    // Between knees and hips, in front.
    let is_front = |p: Vec3| {
        (0.3..0.5).contains(&((p.y - low.y) / height_m)) && (p.x - middle.x).abs() < FRONT * height_m && p.z > middle.z
    };
    let mut uses = std::collections::BTreeMap::<[u32; 2], u32>::new();
    for &[a, b, c] in &base.triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *uses.entry([from.min(to), from.max(to)]).or_default() += 1;
        }
    }
    let open = uses.into_iter().filter(|(_, uses)| *uses == 1).map(|(edge, _)| edge.map(at));
    let upright = open.filter(|[from, to]| (to.y - from.y).abs() > 0.7 * from.distance(*to));
    let covers = |p: Vec3| {
        move |triangle: &&[u32; 3]| {
            let [a, b, c] = triangle.map(at);
            let turn = |from: Vec3, to: Vec3| (to - from).truncate().perp_dot((p - from).truncate());
            let turns = [turn(a, b), turn(b, c), turn(c, a)];
            let is_over = turns.iter().all(|turn| *turn > 0.0) || turns.iter().all(|turn| *turn < 0.0);
            let sum: f32 = turns.iter().sum();
            is_over && (turns[1] * a.z + turns[2] * b.z + turns[0] * c.z) / sum > p.z + 1e-3
        }
    };
    let seen: Vec<f32> = upright
        .map(|[from, to]| (from + to) / 2.0)
        .filter(|p| is_front(*p) && !base.triangles.iter().any(|triangle| covers(*p)(&triangle)))
        .map(|p| p.x - middle.x)
        .collect();
    let on_left = seen.iter().filter(|x_m| **x_m > OVERLAP_M).count();
    let on_right = seen.iter().filter(|x_m| **x_m < -OVERLAP_M).count();
    // An open front shows both edges.
    if on_left < 4 || on_left < 4 * on_right {
        return None;
    }
    Some((
        "right-over-left",
        "the right front panel lies over the left (左前)".to_owned(),
        "A kimono is worn left over right (右前); export without mirroring, or dress it anew.".to_owned(),
    ))
}

/// A body that is larger than the one on which the kimono was draped, or another one, comes through the cloth.
fn through_skin(near: &[Pair]) -> Option<Mistake> {
    let through = near.iter().filter(|pair| pair.outside_m < -THROUGH_M).count();
    if near.len() < LEAST_NEAR || (through as f32) < THROUGH * near.len() as f32 {
        return None;
    }
    let deepest_m = near.iter().fold(0.0f32, |deepest_m, pair| deepest_m.max(-pair.outside_m));
    let problem = format!(
        "{:.0} % of the cloth near the skin lies more than {:.0} mm inside the body, up to {:.0} mm",
        100.0 * through as f32 / near.len() as f32,
        1e3 * THROUGH_M,
        1e3 * deepest_m
    );
    Some((
        "wrong-body",
        problem,
        "Name the body on which the kimono was draped, in the size, place and pose it had then; the kimono must not have been moved since."
            .to_owned(),
    ))
}

/// A kimono hangs from the shoulders. On a smaller body than that on which it was draped it lies on nothing.
fn check_rest(file: &str, near: &[Pair], report: &mut Vec<Diagnostic>) {
    let faces_up = |pair: &&Pair| pair.upward > UPWARD;
    let mut above_m: Vec<f32> = near.iter().filter(faces_up).map(|pair| pair.outside_m).collect();
    above_m.sort_unstable_by(f32::total_cmp);
    let Some(lowest_m) = above_m.get(above_m.len() / 10).filter(|m| **m > REST_M && above_m.len() >= LEAST_NEAR) else {
        return;
    };
    report.push(
        Diagnostic::warning("loose-body", file, Place::File)
            .problem(format!(
                "the cloth rests nowhere on the shoulders: nine tenths of it lie more than {:.0} mm above the skin",
                1e3 * lowest_m
            ))
            .help("Name the body on which the kimono was draped, not a smaller one; what is worn beneath may explain a few millimetres."),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::obj;

    /// The sample, whose mistakes `change` makes, must be refused with `code`.
    fn check_sample(change: impl FnOnce(&mut ir::Surface), code: Option<&str>) {
        let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets-src/komon");
        let mut garment = crate::load(std::path::Path::new(sample)).garment.unwrap();
        change(&mut garment.base);
        let mut report = Vec::new();
        let near = super::super::near_skin::pairs(&garment.base.positions_m, &garment.body);
        let mesh = NamedMesh { file: "komon/base.obj", mesh: &obj::Mesh::default() };
        let is_sound = check(mesh, &garment.base, LengthUnit::M, &garment.body, &near, &mut report);
        assert_eq!(report.first().map(|diagnostic| &*diagnostic.code), code);
        assert_eq!(is_sound, code.is_none());
    }

    fn mirror(base: &mut ir::Surface) {
        base.positions_m.iter_mut().for_each(|p| p.x = -p.x);
        base.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }

    #[test]
    fn the_front_is_worn_left_over_right() {
        check_sample(|_| {}, None);
        check_sample(mirror, Some("mirrored"));
        let mirror_and_rename = |base: &mut ir::Surface| {
            mirror(base);
            for part in &mut base.parts {
                part.name = match part.name.rsplit_once('_') {
                    Some((piece, "left")) => format!("{piece}_right"),
                    Some((piece, "right")) => format!("{piece}_left"),
                    _ => continue,
                };
            }
        };
        check_sample(mirror_and_rename, Some("right-over-left"));
        // Names of an exporter's own say nothing of sides.
        let nameless = |base: &mut ir::Surface| {
            for (number, part) in base.parts.iter_mut().enumerate() {
                part.name = format!("Pattern2D_{number}");
            }
        };
        check_sample(nameless, None);
        let mirror_nameless = |base: &mut ir::Surface| {
            nameless(base);
            mirror(base);
        };
        check_sample(mirror_nameless, Some("right-over-left"));
        check_sample(|base| base.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2)), Some("inside-out"));
    }

    #[test]
    fn a_larger_body_comes_through_the_cloth_and_a_smaller_one_hangs_loose() {
        let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets-src/komon");
        let garment = crate::load(std::path::Path::new(sample)).garment.unwrap();
        for (scale, is_said) in [(0.9, false), (0.95, false), (0.98, false), (1.0, false), (1.05, true), (1.15, true)] {
            let mut body = garment.body.clone();
            body.surface.positions_m.iter_mut().for_each(|place_m| *place_m *= scale);
            let said = through_skin(&super::super::near_skin::pairs(&garment.base.positions_m, &body));
            assert_eq!(said.is_some(), is_said, "{scale}: {said:?}");
            let mut report = Vec::new();
            check_rest("base.obj", &super::super::near_skin::pairs(&garment.base.positions_m, &body), &mut report);
            assert_eq!(report.iter().any(|d| d.code == "loose-body"), scale < 1.0, "{scale}: {report:?}");
        }
    }
}
