//! Whether the base sits on the body: unit, axes, place, the wearer's left and right, outside and inside.

use super::NamedMesh;
use super::target::{bounds, said_ratio};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::units::LengthUnit;
use glam::{Vec2, Vec3};

/// A kimono's bounding box is so much of the body's, at least and at most; beyond, the unit is wrong.
const SIZE: std::ops::RangeInclusive<f32> = 0.2..=3.0;
/// What a kimono's extent usually is of the body's.
const USUAL_SIZE: f32 = 0.95;
/// How far its middle may lie from the body's, as a share of the body's height.
const AWAY: f32 = 0.25;
/// How far the middles of left pieces must lie on the wrong side, as a share of the body's height.
const WRONG_SIDE: f32 = 0.02;
/// Side of the cells in which the layers of the front are compared, metres.
const CELL_M: f32 = 0.04;

/// Reports why the base does not sit on the body; true when it does.
pub(super) fn check(
    NamedMesh { file, .. }: NamedMesh<'_>,
    base: &ir::Surface,
    unit: LengthUnit,
    body: &ir::Body,
    report: &mut Vec<Diagnostic>,
) -> bool {
    if base.triangles.is_empty() {
        return false;
    }
    let found = wrong_unit(base, unit, body)
        .or_else(|| wrong_axis(base, body))
        .or_else(|| away(base, body))
        .or_else(|| wrong_side(base, body))
        .or_else(|| inside_out(base, body))
        .or_else(|| right_over_left(base));
    let Some((code, problem, help)) = found else { return true };
    report.push(Diagnostic::error(code, file, Place::File).problem(problem).help(help));
    false
}

/// Reports an obi that is not worn over the kimono.
pub(super) fn check_obi(
    NamedMesh { file, .. }: NamedMesh<'_>,
    obi: &ir::Surface,
    base: &ir::Surface,
    report: &mut Vec<Diagnostic>,
) {
    let ((low, high), (base_low, base_high)) = (bounds(&obi.positions_m), bounds(&base.positions_m));
    let reach = 0.1 * (base_high - base_low).max_element();
    let is_worn = (low - base_low).min_element() >= -reach && (base_high - high).min_element() >= -reach;
    if !is_worn || (high - low).length() < reach {
        report.push(
            Diagnostic::error("obi", file, Place::File)
                .problem("the obi does not lie around the kimono")
                .help("Export it from the same scene as the base: same unit, same axes, same place."),
        );
    }
}

type Mistake = (&'static str, String, String);

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
        "Export without mirroring; front is +Z and the wearer's left +X, and left lies over right (右前).".to_owned(),
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

/// Where both front panels (okumi) overlap, the left one lies in front.
fn right_over_left(base: &ir::Surface) -> Option<Mistake> {
    let cell = |p: Vec3| (Vec2::new(p.x, p.y) / CELL_M).floor().as_ivec2().to_array();
    let mut cells = std::collections::BTreeMap::<[i32; 2], [(f32, u32); 2]>::new();
    for (side, name) in ["okumi_left", "okumi_right"].into_iter().enumerate() {
        for point in part_corners(base, move |part| part == name) {
            let (sum, count) = &mut cells.entry(cell(point)).or_default()[side];
            *sum += point.z;
            *count += 1;
        }
    }
    let shared: Vec<f32> = cells
        .into_values()
        .filter(|[(_, left), (_, right)]| *left > 0 && *right > 0)
        .map(|[(left, left_count), (right, right_count)]| left / left_count as f32 - right / right_count as f32)
        .collect();
    let right_in_front = shared.iter().filter(|lead| **lead < 0.0).count();
    if shared.len() < 8 || right_in_front * 10 < shared.len() * 7 {
        return None;
    }
    Some((
        "right-over-left",
        "the right front panel lies over the left (左前)".to_owned(),
        "A kimono is worn left over right (右前); export without mirroring, or dress it anew.".to_owned(),
    ))
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
        let mesh = NamedMesh { file: "komon/base.obj", mesh: &obj::Mesh::default() };
        let is_sound = check(mesh, &garment.base, LengthUnit::M, &garment.body, &mut report);
        assert_eq!(report.first().map(|diagnostic| diagnostic.code), code);
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
        check_sample(|base| base.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2)), Some("inside-out"));
    }
}
