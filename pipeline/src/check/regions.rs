//! Painted regions: whether every driver has a mask, and whether it paints what the driver's joints move. Knows no
//! target.

use super::{NamedMesh, value};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::folder::Folder;
use crate::source::manifest::{DriverEntry, Field, Manifest, RegionSource};
use crate::source::masks::Mask;
use crate::source::obj;
use glam::Vec2;
use kitsuke::skeleton::Bone;
use std::collections::BTreeMap;

/// A mask below this everywhere is empty.
const EMPTY_MASK: f32 = 1.0 / 255.0;
/// A region whose middle lies farther to one side than this share of the kimono's half width lies on that side.
const ASIDE: f64 = 0.1;
/// How far beyond 0..1 coordinates may lie by rounding.
const ROUNDING: f32 = 1e-4;

/// The regions as the manifest wants them; masks are checked even where regions are grown.
pub(super) fn check(
    manifest: &Manifest,
    file: &str,
    folder: &Folder,
    base: NamedMesh<'_>,
    masks: &BTreeMap<String, Mask>,
    report: &mut Vec<Diagnostic>,
) -> Option<ir::Regions> {
    let source = manifest.regions.as_ref().map_or(Some(RegionSource::Auto), |regions| regions.get().copied())?;
    let (base_file, base) = (base.file, base.mesh);
    let mut painted = Vec::new();
    let mut first: Option<(&str, &Mask)> = None;
    for driver in &manifest.drivers {
        if driver.mask.is_none() {
            if source == RegionSource::Painted {
                report.push(
                    Diagnostic::error("missing-mask", file, driver.name.as_ref().map_or(Place::File, Field::place))
                        .problem("regions are painted, but this driver has no mask")
                        .help("Add mask = \"regions/NAME.png\", or set regions = \"auto\"."),
                );
            }
            continue;
        }
        let Some((name, mask)) = mask_of(driver, folder, masks) else { continue };
        let (first_name, first_mask) = *first.get_or_insert((name, mask));
        if (mask.width, mask.height) != (first_mask.width, first_mask.height) {
            report.push(
                Diagnostic::error("mask-size", name, Place::File)
                    .problem(format!(
                        "the mask has {} x {} pixels, but {first_name} has {} x {}",
                        mask.width, mask.height, first_mask.width, first_mask.height
                    ))
                    .help("Paint all masks of a kimono in one size, for example 1024 x 1024."),
            );
        }
        let weights = vertex_values(base, |uv| mask.sample(uv));
        if base.is_textured() && weights.iter().all(|&weight| weight < EMPTY_MASK) {
            report.push(
                Diagnostic::error("empty-mask", name, Place::File)
                    .problem("the mask is black wherever the kimono lies")
                    .help("Paint the driver's region white, in the texture space of the base (v = 0 at the bottom)."),
            );
        }
        painted.push(weights);
    }
    if first.is_some() && !base.is_textured() {
        report.push(
            Diagnostic::error("mask-without-uv", file, Place::File)
                .problem("there are masks, but the base has no texture coordinates to look them up with")
                .help("Export the base with texture coordinates, or remove the masks and set regions = \"auto\"."),
        );
    }
    if source == RegionSource::Painted {
        check_coordinates(base_file, base, report);
    }
    match source {
        RegionSource::Auto => Some(ir::Regions::Auto),
        RegionSource::Painted => (painted.len() == manifest.drivers.len()).then_some(ir::Regions::Painted(painted)),
    }
}

/// The mask of a driver, with its file, where it has one that could be read.
pub(super) fn mask_of<'a>(
    driver: &DriverEntry,
    folder: &Folder,
    masks: &'a BTreeMap<String, Mask>,
) -> Option<(&'a String, &'a Mask)> {
    masks.get_key_value(&folder.name_of(value(&driver.mask)?).ok()?)
}

/// For each vertex the mean of `value` over its distinct texture coordinates; 0 where it has none.
pub(super) fn vertex_values(mesh: &obj::Mesh, value: impl Fn(Vec2) -> f32) -> Vec<f32> {
    let pair = |corner: &obj::Corner| Some((corner.vertex, corner.uv?));
    let mut pairs: Vec<(u32, u32)> = mesh.corners.iter().filter_map(pair).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut sums = vec![(0.0, 0u32); mesh.positions.len()];
    for (vertex, coordinate) in pairs {
        let (sum, count) = &mut sums[vertex as usize];
        *sum += value(mesh.uv[coordinate as usize]);
        *count += 1;
    }
    sums.into_iter().map(|(sum, count)| if count == 0 { 0.0 } else { sum / count as f32 }).collect()
}

/// A driver of one side's joints, and where its mask's region lies.
struct Sided<'a> {
    driver: &'a DriverEntry,
    bones: Vec<Bone>,
    is_left: bool,
    /// The middle of the region, from -1 (the right end of the kimono) to 1 (the left one); left is +x in every file.
    middle: f64,
}

fn side<'a>(driver: &'a DriverEntry, base: &obj::Mesh, weights: &[f32]) -> Option<Sided<'a>> {
    let bones: Vec<Bone> = super::drivers::right_joints(&driver.joints).map(|(_, bone)| bone).collect();
    let is_left = bones.first()?.name().starts_with("left");
    let prefix = if is_left { "left" } else { "right" };
    if !bones.iter().all(|bone| bone.name().starts_with(prefix)) {
        return None;
    }
    let (low, high) = base.positions.iter().fold((f64::MAX, f64::MIN), |(low, high), p| (low.min(p.x), high.max(p.x)));
    let (sum, whole) = base.positions.iter().zip(weights).fold((0.0, 0.0), |(sum, whole), (position, &weight)| {
        (sum + position.x * f64::from(weight), whole + f64::from(weight))
    });
    let middle = (sum / whole - (low + high) / 2.0) / ((high - low) / 2.0);
    middle.is_finite().then_some(Sided { driver, bones, is_left, middle })
}

/// Masks that lie on the other side of what their drivers' joints move. Tells only where the base itself is not mirrored.
pub(super) fn check_sides(
    manifest: &Manifest,
    folder: &Folder,
    base: NamedMesh<'_>,
    masks: &BTreeMap<String, Mask>,
    report: &mut Vec<Diagnostic>,
) {
    let of_driver = |driver| {
        let (name, mask) = mask_of(driver, folder, masks)?;
        Some((name, side(driver, base.mesh, &vertex_values(base.mesh, |uv| mask.sample(uv)))?))
    };
    let sided: Vec<(&String, Sided<'_>)> = manifest.drivers.iter().filter_map(of_driver).collect();
    let is_wrong = |sided: &Sided<'_>| sided.middle.abs() > ASIDE && (sided.middle > 0.0) != sided.is_left;
    for (mask, own) in sided.iter().filter(|(_, sided)| is_wrong(sided)) {
        let mirrored: Vec<Bone> = own.bones.iter().map(|bone| bone.mirrored()).collect();
        let exchanged = sided.iter().find(|(_, other)| other.bones == mirrored && is_wrong(other));
        let name = |driver: &DriverEntry| value(&driver.name).cloned().unwrap_or_default();
        let (is, should) = if own.is_left { ("right", "left") } else { ("left", "right") };
        let help = match exchanged {
            Some((other, _)) => format!("Exchange {mask} and {other}: probably left and right as seen, not as worn."),
            None => {
                "Paint the wearer's own side: her left is +x; or correct `mask` or `joints` of the driver.".to_owned()
            }
        };
        report.push(
            Diagnostic::error("mask-side", *mask, Place::File)
                .problem(format!(
                    "the mask of {} lies on the wearer's {is} side, but its joints move the {should} one",
                    name(own.driver)
                ))
                .help(help),
        );
    }
}

/// Masks repeat beyond 0..1, as textures do; whoever paints them wants to know.
fn check_coordinates(file: &str, base: &obj::Mesh, report: &mut Vec<Diagnostic>) {
    let is_outside = |uv: &&Vec2| uv.min_element() < -ROUNDING || uv.max_element() > 1.0 + ROUNDING;
    let mut outside = base.uv.iter().filter(is_outside);
    let Some(first) = outside.next() else { return };
    let count = 1 + outside.count();
    report.push(
        Diagnostic::warning("mask-repeats", file, Place::File)
            .problem(format!(
                "{count} of {} texture coordinates lie outside 0 to 1 (the first at {:.3}, {:.3}); masks repeat there, as textures do",
                base.uv.len(),
                first.x,
                first.y
            ))
            .help("Lay the pattern pieces within 0 to 1, or paint masks that are right when they repeat."),
    );
}
