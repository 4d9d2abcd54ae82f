//! Writes what the stages made under readable names, for looking at it.

use super::{CatalogError, write_renamed};
use crate::build::Built;
use crate::ir;
use crate::look::frames::npy_header;
use glam::Vec3;
use std::fmt::Write;
use std::path::Path;

/// Into `folder`: `skin_<joint>.npy` and `region_<driver>.npy` (float32 per base vertex, 0 to 1), `delta_<target>.npy`
/// (float32 [vertices, 3], metres) and `unposed_<target>.obj` (base and delta, in the T-pose).
pub fn emit(folder: &Path, garment: &ir::Garment, built: &Built) -> Result<(), CatalogError> {
    let vertex_count = built.skin.len();
    for (j, joint) in garment.body.skeleton.joints().iter().enumerate() {
        let weight = |skin: &kitsuke::arrays::SkinWeights| -> f32 {
            let own = skin.joints.iter().zip(skin.weights).filter(|&(&joint, _)| usize::from(joint) == j);
            own.map(|(_, weight)| f32::from(weight) / 65535.0).sum()
        };
        let weights: Vec<f32> = built.skin.iter().map(weight).collect();
        if weights.iter().any(|&weight| weight > 0.0) {
            write_npy(&folder.join(format!("skin_{}.npy", joint.bone.name())), &[vertex_count], &weights)?;
        }
    }
    for (d, driver) in garment.drivers.iter().enumerate() {
        let masks = built.masks.chunks(garment.drivers.len()).map(|row| f32::from(row[d]) / 65535.0);
        let path = folder.join(format!("region_{}.npy", driver.name));
        write_npy(&path, &[vertex_count], &masks.collect::<Vec<_>>())?;
    }
    for (target, deltas) in garment.targets.iter().zip(&built.deltas) {
        let path = folder.join(format!("delta_{}.npy", target.name));
        write_npy(&path, &[vertex_count, 3], bytemuck::cast_slice(deltas))?;
        let unposed_m = garment.base.positions_m.iter().zip(deltas).map(|(&base, &delta)| base + delta);
        write_obj(&folder.join(format!("unposed_{}.obj", target.name)), unposed_m, &garment.base.triangles)?;
    }
    Ok(())
}

/// A NumPy array, format version 1.0.
fn write_npy(path: &Path, shape: &[usize], values: &[f32]) -> Result<(), CatalogError> {
    let mut bytes = npy_header(shape);
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    write_renamed(path, &bytes)
}

fn write_obj(path: &Path, positions_m: impl Iterator<Item = Vec3>, triangles: &[[u32; 3]]) -> Result<(), CatalogError> {
    let mut text = String::new();
    for p in positions_m {
        let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
    }
    for [a, b, c] in triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    write_renamed(path, text.as_bytes())
}
