//! `cargo xtask compare-packs ID`: the pack beside what gltfpack and gzip make of the same targets. Both are run when they
//! are asked for; nothing is built with them.

use crate::places::{Places, in_workspace, printed};
use glam::Vec3;
use kitsuke::arrays::{GarmentData, Target};
use kitsuke::pack::layout;
use kitsuke::pack::write::write;
use kitsuke::{Garment, Pack};
use kitsuke_pipeline::memo::Memo;
use kitsuke_pipeline::stages::correctives::without_correctives;
use kitsuke_pipeline::{Built, build_garment, ir};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Compare a pack's size with gltfpack's at the same error of the targets
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID
    #[arg(default_value = "komon")]
    id: String,
    /// Only the first so many targets of the pose table
    #[arg(long, value_name = "N")]
    first: Option<usize>,
    /// Let npx fetch gltfpack where it is not installed
    #[arg(long)]
    fetch: bool,
    /// The folder of earlier results
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("target/kitsuke-cache"))]
    cache: PathBuf,
    #[command(flatten)]
    places: Places,
}

/// The version whose sizes are compared.
const GLTFPACK: &str = "gltfpack@1.3.0";
/// Bits of its grid for positions, coarse to fine.
const GRIDS: [u32; 3] = [14, 15, 16];

/// Prints the table; 1 when the kimono cannot be built or gltfpack fails, 0 with a message where there is none.
pub fn run(args: Args) -> ExitCode {
    printed(compare(&args))
}

fn compare(args: &Args) -> Result<String, String> {
    let mut source = args.places.source_with(&args.id, &args.cache).ok_or("there is nothing to compare with")?;
    if let Some(first) = args.first {
        source.targets.truncate(first);
        source.correctives = 0;
    }
    let memo = Memo::new(&args.cache.join("stages"));
    let built = build_garment(&source, &memo, &|_| ()).map_err(|error| error.to_string())?;
    let wanted_m = masked_deltas(&source, &built);
    let errors_mm = errors_mm(&built, &wanted_m);
    let error_mm = f64::from(errors_mm.iter().flatten().copied().fold(0.0, f32::max));
    let own = pose_target_bytes(&built.garment)?;

    let mut text = of_targets(&source, &errors_mm);
    text += &format!("\n{:28} {:>12} {:>14} {:>14}\n", "", "max error mm", "targets bytes", "whole bytes");
    let mut row = |name: &str, error_mm: f64, targets: f64, whole: f64| {
        text += &format!("{name:28} {error_mm:>12.4} {targets:>14.0} {whole:>14.0}\n");
    };
    row("kitsuke", error_mm, own as f64, built.pack.len() as f64);
    if !is_there(args.fetch) {
        return Ok(text + "gltfpack is left out: it needs node, and --fetch where it is not installed\n");
    }
    let folder = std::env::temp_dir().join(format!("kitsuke-compare-{}", std::process::id()));
    fs::create_dir_all(&folder).map_err(|error| format!("cannot write {}: {error}", folder.display()))?;
    let peers = GRIDS.map(|bits| peer(args.fetch, &folder, &source, &wanted_m, bits));
    // Only a folder of its own; where it stays, nothing is lost.
    let _ = fs::remove_dir_all(&folder);
    let peers = peers.into_iter().collect::<Result<Vec<Peer>, String>>()?;
    for (peer, bits) in peers.iter().zip(GRIDS) {
        row(&format!("gltfpack -cc -vp {bits}, gzip"), peer.error_mm, peer.targets, peer.whole);
    }
    // Between two grids bytes go by the logarithm of the error.
    let (coarse, fine) = match peers.windows(2).find(|pair| pair[1].error_mm <= error_mm) {
        Some(pair) => (&pair[0], &pair[1]),
        None => (&peers[1], &peers[2]),
    };
    let at = (coarse.error_mm / error_mm).ln() / (coarse.error_mm / fine.error_mm).ln();
    let between = |coarse: f64, fine: f64| coarse + at * (fine - coarse);
    let (targets, whole) = (between(coarse.targets, fine.targets), between(coarse.whole, fine.whole));
    row("gltfpack at kitsuke's error", error_mm, targets, whole);
    let (of_targets, of_whole) = (own as f64 / targets, built.pack.len() as f64 / whole);
    text += &format!("{:28} {:>12} {of_targets:>14.3} {of_whole:>14.3}\n", "kitsuke / gltfpack", "");
    text +=
        "max error: of one target's deltas in the base's space. gltfpack's whole: positions, triangles and targets;\n";
    text += "kitsuke's besides: skin, masks, texture coordinates, kernel, and what a fit needs.\n";
    Ok(text)
}

/// Per target and base vertex what its file has beyond skinning, as far as the masks of its layer reach; metres.
pub fn masked_deltas(source: &ir::Garment, built: &Built) -> Vec<Vec<Vec3>> {
    let masks = built.masks.chunks(source.drivers.len().max(1));
    let of_target = |(target, deltas_m): (&ir::TargetShape, &Vec<Vec3>)| {
        let rows = deltas_m.iter().zip(masks.clone());
        rows.map(|(delta_m, row)| *delta_m * reach(row, &source.drivers, target.layer)).collect()
    };
    source.targets.iter().zip(&built.deltas).map(of_target).collect()
}

/// Which share of a target of this layer the masks of a vertex let through.
fn reach(row: &[u16], drivers: &[ir::Driver], layer: u8) -> f32 {
    let of_layer = row.iter().zip(drivers).filter(|(_, driver)| driver.layer == layer);
    of_layer.map(|(&mask, _)| f32::from(mask)).sum::<f32>() / 65535.0
}

/// What the targets of the poses take in a pack; correctives, which no file gives, are not counted.
pub fn pose_target_bytes(garment: &Garment) -> Result<usize, String> {
    let samples = Garment::new(without_correctives(garment.data())).map_err(|error| error.to_string())?;
    let pack = Pack::open(&write(&samples)).map_err(|error| error.to_string())?;
    Ok(pack.sections().iter().find(|section| section.tag == layout::TGTS).map_or(0, |section| section.stored_length))
}

/// How far the pack's deltas lie from these, per target and vertex, millimetres.
fn errors_mm(built: &Built, wanted_m: &[Vec<Vec3>]) -> Vec<Vec<f32>> {
    let GarmentData { mesh, segments, targets, .. } = built.garment.data();
    let of_target = |(target, wanted_m): (&Target, &Vec<Vec3>)| {
        let mut deltas = target.deltas.iter();
        let moved = segments.iter().enumerate().flat_map(|(number, segment)| {
            let is_moved = target.segments.contains(&(number as u16));
            std::iter::repeat_n(is_moved, segment.vertex_count as usize)
        });
        let error = |(is_moved, &v): (bool, &u32)| {
            let steps = if is_moved { deltas.next().copied().unwrap_or_default() } else { [0; 3] };
            (Vec3::from_array(steps.map(f32::from)) * target.step_m).distance(wanted_m[v as usize]) * 1e3
        };
        moved.zip(&mesh.source_vertex).map(error).collect()
    };
    targets.iter().zip(wanted_m).map(of_target).collect()
}

/// How far the pack's deltas lie from these at most, millimetres.
pub fn target_max_mm(built: &Built, wanted_m: &[Vec<Vec3>]) -> f64 {
    errors_mm(built, wanted_m).into_iter().flatten().fold(0.0, f32::max).into()
}

/// Per target: largest error, its 99th percentile, and which share of the vertices has more than half the budget.
fn of_targets(source: &ir::Garment, errors_mm: &[Vec<f32>]) -> String {
    let mut text = format!("{:28} {:>12} {:>14} {:>14}\n", "error of targets, mm", "max", "p99", "above half");
    let half_mm = source.budget_m * 500.0;
    for (target, errors_mm) in source.targets.iter().zip(errors_mm) {
        let mut errors_mm = errors_mm.clone();
        errors_mm.sort_by(f32::total_cmp);
        let above = errors_mm.len() - errors_mm.partition_point(|&error| error <= half_mm);
        let share = 100.0 * above as f32 / errors_mm.len() as f32;
        let (max, p99) = (errors_mm[errors_mm.len() - 1], errors_mm[(errors_mm.len() - 1) * 99 / 100]);
        text += &format!("{:28} {max:>12.4} {p99:>14.4} {share:>13.1}%\n", target.name);
    }
    text
}

/// What gltfpack made.
struct Peer {
    error_mm: f64,
    /// Compressed bytes of everything, less those of the base alone.
    targets: f64,
    whole: f64,
}

fn gltfpack(fetch: bool) -> Command {
    let mut command = Command::new("npx");
    command.args(if fetch { ["--yes", GLTFPACK] } else { ["--no", "gltfpack"] });
    command
}

fn is_there(fetch: bool) -> bool {
    let output = gltfpack(fetch).arg("-v").output();
    output.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains("gltfpack"))
}

fn peer(fetch: bool, folder: &Path, source: &ir::Garment, wanted_m: &[Vec<Vec3>], bits: u32) -> Result<Peer, String> {
    let pack = |name: &str, targets_m: &[Vec<Vec3>], options: &[&str]| -> Result<Vec<u8>, String> {
        let (from, to) = (folder.join("in.glb"), folder.join(format!("{name}.glb")));
        fs::write(&from, glb(source, targets_m))
            .map_err(|error| format!("cannot write {}: {error}", from.display()))?;
        let bits = bits.to_string();
        let run = gltfpack(fetch).arg("-i").arg(&from).arg("-o").arg(&to).args(["-vp", &bits]).args(options).output();
        match run {
            Ok(output) if output.status.success() => {
                fs::read(&to).map_err(|error| format!("cannot read {}: {error}", to.display()))
            }
            Ok(output) => Err(format!("gltfpack: {}", String::from_utf8_lossy(&output.stderr).trim())),
            Err(error) => Err(format!("gltfpack: {error}")),
        }
    };
    let compressed = |name: &str, targets_m: &[Vec<Vec3>]| -> Result<f64, String> {
        pack(name, targets_m, &["-cc"])?;
        let output = Command::new("gzip").args(["-9", "-c"]).arg(folder.join(format!("{name}.glb"))).output();
        Ok(output.map_err(|error| format!("gzip: {error}"))?.stdout.len() as f64)
    };
    let (whole, base) = (compressed("all", wanted_m)?, compressed("base", &[])?);
    let error_mm =
        error_mm(&pack("plain", wanted_m, &[])?, source, wanted_m).ok_or("gltfpack's output is not understood")?;
    Ok(Peer { error_mm, targets: whole - base, whole })
}

/// A GLB of the base and these targets, nothing else.
fn glb(source: &ir::Garment, targets_m: &[Vec<Vec3>]) -> Vec<u8> {
    let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut add = |content: Vec<u8>, accessor: Value| {
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": content.len() }));
        let mut accessor = accessor;
        accessor["bufferView"] = json!(views.len() - 1);
        accessors.push(accessor);
        bytes.extend(content);
        accessors.len() - 1
    };
    let floats = |vectors: &[Vec3]| vectors.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes).collect();
    let vectors = |vectors: &[Vec3]| {
        let (least, most) =
            vectors.iter().fold((Vec3::MAX, Vec3::MIN), |(least, most), v| (least.min(*v), most.max(*v)));
        json!({ "componentType": 5126, "type": "VEC3", "count": vectors.len(), "min": least.to_array(), "max": most.to_array() })
    };
    let base_m = &source.base.positions_m;
    let position = add(floats(base_m), vectors(base_m));
    let corners: Vec<u32> = source.base.triangles.iter().flatten().copied().collect();
    let indices = corners.iter().flat_map(|corner| corner.to_le_bytes()).collect();
    let indices = add(indices, json!({ "componentType": 5125, "type": "SCALAR", "count": corners.len() }));
    let targets: Vec<Value> =
        targets_m.iter().map(|deltas| json!({ "POSITION": add(floats(deltas), vectors(deltas)) })).collect();
    let mut primitive = json!({ "attributes": { "POSITION": position }, "indices": indices });
    if !targets.is_empty() {
        primitive["targets"] = json!(targets);
    }
    let document = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [primitive] }], "accessors": accessors, "bufferViews": views,
        "buffers": [{ "byteLength": bytes.len() }],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF".to_vec();
    let length = 28 + text.len() + bytes.len();
    glb.extend([2, length as u32, text.len() as u32, 0x4e4f_534a].iter().flat_map(|word| word.to_le_bytes()));
    glb.extend(text);
    glb.extend([bytes.len() as u32, 0x004e_4942].iter().flat_map(|word| word.to_le_bytes()));
    glb.extend(bytes);
    glb
}

/// How far the targets of an uncompressed output of gltfpack lie from what it was given at most. It reorders vertices:
/// each of ours is looked for among those whose base lies within two steps of its own.
fn error_mm(glb: &[u8], source: &ir::Garment, wanted_m: &[Vec<Vec3>]) -> Option<f64> {
    let text_length = u32::from_le_bytes(glb.get(12..16)?.try_into().ok()?) as usize;
    let document: Value = serde_json::from_slice(glb.get(20..20 + text_length)?).ok()?;
    let bytes = glb.get(28 + text_length..)?;
    let node = document["nodes"].as_array()?.iter().find(|node| node.get("mesh").is_some())?;
    let scale = node["scale"][0].as_f64()?;
    let offset = Vec3::from_array([0, 1, 2].map(|i| node["translation"][i].as_f64().unwrap_or(0.0) as f32));
    let vectors = |accessor: &Value| -> Option<Vec<Vec3>> {
        let accessor = &document["accessors"][accessor.as_u64()? as usize];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64()? as usize];
        let signed = accessor["componentType"].as_u64()? == 5122;
        let stride = view["byteStride"].as_u64()? as usize;
        let first = view["byteOffset"].as_u64().unwrap_or(0) + accessor["byteOffset"].as_u64().unwrap_or(0);
        let number = |at: usize| -> Option<f32> {
            let word = u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?);
            Some((if signed { f64::from(word as i16) } else { f64::from(word) } * scale) as f32)
        };
        let vector = |v: usize| {
            let at = first as usize + v * stride;
            Some(Vec3::new(number(at)?, number(at + 2)?, number(at + 4)?))
        };
        (0..accessor["count"].as_u64()? as usize).map(vector).collect()
    };
    let primitive = &document["meshes"][0]["primitives"][0];
    let base_m: Vec<Vec3> = vectors(&primitive["attributes"]["POSITION"])?.into_iter().map(|p| p + offset).collect();
    let targets_m: Vec<Vec<Vec3>> =
        primitive["targets"].as_array()?.iter().map(|target| vectors(&target["POSITION"])).collect::<Option<_>>()?;

    let mut by_x: Vec<usize> = (0..base_m.len()).collect();
    by_x.sort_by(|&a, &b| base_m[a].x.total_cmp(&base_m[b].x));
    let near = 2.0 * scale as f32;
    let mut largest = 0.0f32;
    for (v, position_m) in source.base.positions_m.iter().enumerate() {
        let first = by_x.partition_point(|&other| base_m[other].x < position_m.x - near);
        let candidates = by_x[first..].iter().take_while(|&&other| base_m[other].x <= position_m.x + near);
        let candidates = candidates.filter(|&&other| base_m[other].distance(*position_m) <= 2.0 * near);
        let error = |&other: &usize| {
            targets_m.iter().zip(wanted_m).map(|(found, wanted)| found[other].distance(wanted[v])).fold(0.0, f32::max)
        };
        largest = largest.max(candidates.map(error).min_by(f32::total_cmp)?);
    }
    Some(f64::from(largest) * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_goes_by_the_masks_of_its_own_layer() {
        let driver = |layer: u8| ir::Driver {
            name: String::new(),
            group: String::new(),
            joints: Vec::new(),
            threshold_rad: 1.0,
            layer,
        };
        let drivers = [driver(0), driver(0), driver(1)];
        let row = [20000, 45535, 65535];
        assert_eq!([0, 1].map(|layer| reach(&row, &drivers, layer)), [1.0; 2]);
    }
}
