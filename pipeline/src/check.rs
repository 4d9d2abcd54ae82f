//! Source → Ir: units become metres and radians, names become numbers, and every mistake of the artist is reported, all
//! in one run. Knows what garments are like, and no file format.

use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::Source;
use crate::source::manifest::{self, RegionSource, Up};
use crate::source::obj;
use crate::source::units::{Length, LengthUnit};
use glam::{DVec3, Vec2, Vec3};

/// The budget where the manifest gives none.
const DEFAULT_BUDGET: Length = Length { value: 0.05, unit: LengthUnit::Mm };

/// Turns what was read into a garment, or reports why that cannot be.
pub fn check(source: Source, report: &mut Vec<Diagnostic>) -> Option<ir::Garment> {
    let Source { folder, manifest, poses, meshes, masks, body, paths, texture_png } = source;
    let manifest_file = format!("{}/{}", folder.id(), manifest::FILE_NAME);
    let unit = manifest.unit.as_ref().map_or(Some(LengthUnit::M), |unit| unit.get().copied())?;
    let up = manifest.up.as_ref().map_or(Some(Up::Y), |up| up.get().copied())?;
    let place = |position: &DVec3| in_metres(*position, unit, up);
    let mesh_of = |written: &str| {
        let name = folder.name_of(written).ok()?;
        meshes.get(&name).map(|mesh| (name, mesh))
    };
    let surface_of = |mesh: &obj::Mesh| surface(mesh, &place);

    let (base_name, base_mesh) = mesh_of(manifest.base.as_ref()?.get()?)?;
    let base = surface_of(base_mesh);
    let obi = manifest.obi.as_ref().and_then(|obi| mesh_of(obi.get()?)).map(|(_, mesh)| surface_of(mesh));
    let poses = poses?;
    let mut targets = Vec::new();
    for row in poses.rows.iter().skip(1) {
        let (name, mesh) = mesh_of(&row.file)?;
        if mesh.positions.len() != base.positions_m.len() {
            report.push(
                Diagnostic::error("vertex-count", name, Place::File)
                    .problem(format!(
                        "{} vertices, but {base_name} has {}",
                        mesh.positions.len(),
                        base.positions_m.len()
                    ))
                    .help("Export base and targets from the same mesh."),
            );
            continue;
        }
        targets.push(ir::TargetShape {
            name: row.name.clone(),
            file: row.file.clone(),
            rotations: row.rotations.clone(),
            positions_m: mesh.positions.iter().map(place).collect(),
        });
    }
    let mut drivers = Vec::new();
    for driver in &manifest.drivers {
        drivers.push(ir::Driver {
            name: driver.name.as_ref()?.get()?.clone(),
            joints: driver.joints.iter().flatten().filter_map(|joint| joint.get()).map(|joint| joint.0).collect(),
            threshold_rad: driver.threshold.as_ref()?.get()?.radians() as f32,
        });
    }
    let regions = match manifest.regions.as_ref().and_then(|regions| regions.get()).copied().unwrap_or_default() {
        RegionSource::Auto => ir::Regions::Auto,
        RegionSource::Painted => {
            let corners: Vec<obj::Corner> = base_mesh.corners.clone();
            let mut painted = Vec::new();
            for driver in &manifest.drivers {
                let mask = masks.get(&folder.name_of(driver.mask.as_ref()?.get()?).ok()?)?;
                painted.push(vertex_values(base.positions_m.len(), &corners, &base.uv, |uv| mask.sample(uv)));
            }
            ir::Regions::Painted(painted)
        }
    };
    let paths = paths.into_iter().flat_map(|paths| paths.0).map(|(name, path)| ir::MeasuredPath {
        name,
        ja: path.ja,
        vertices: path.vertices.iter().flatten().filter_map(|vertex| vertex.get()).copied().collect(),
        offset_m: path.offset.map_or(0.0, |offset| offset.metres() as f32),
    });
    let _ = &manifest_file;
    Some(ir::Garment {
        id: folder.id().to_owned(),
        name: manifest.name.as_ref()?.get()?.clone(),
        body: body?,
        obi,
        texture_png,
        pose_bones: poses.bones,
        targets,
        drivers,
        regions,
        paths: paths.collect(),
        budget_m: manifest.budget.as_ref().map_or(Some(DEFAULT_BUDGET), |b| b.get().copied())?.metres() as f32,
        base,
    })
}

/// A position of a file as metres, Y up, front +Z.
fn in_metres(position: DVec3, unit: LengthUnit, up: Up) -> Vec3 {
    let turned = match up {
        Up::Y => position,
        Up::Z => DVec3::new(position.x, position.z, -position.y),
    };
    (turned * unit.metres()).as_vec3()
}

/// A mesh as triangles in metres.
fn surface(mesh: &obj::Mesh, place: &dyn Fn(&DVec3) -> Vec3) -> ir::Surface {
    let triangles = mesh.triangulate();
    let is_textured = mesh.is_textured();
    ir::Surface {
        positions_m: mesh.positions.iter().map(place).collect(),
        triangles: triangles.corners.iter().map(|corners| corners.map(|corner| corner.vertex)).collect(),
        uv: if is_textured { mesh.uv.clone() } else { Vec::new() },
        uv_triangles: if is_textured {
            triangles.corners.iter().map(|corners| corners.map(|corner| corner.uv.unwrap_or(0))).collect()
        } else {
            Vec::new()
        },
        parts: mesh
            .parts
            .iter()
            .zip(&triangles.part_counts)
            .map(|(name, &triangle_count)| ir::Part { name: name.clone(), triangle_count })
            .collect(),
    }
}

/// For each vertex the mean of `value` over its distinct texture coordinates; 0 where it has none.
fn vertex_values(count: usize, corners: &[obj::Corner], uv: &[Vec2], value: impl Fn(Vec2) -> f32) -> Vec<f32> {
    let mut pairs: Vec<(u32, u32)> = corners.iter().filter_map(|corner| Some((corner.vertex, corner.uv?))).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut sums = vec![(0.0, 0u32); count];
    for (vertex, coordinate) in pairs {
        let (sum, n) = &mut sums[vertex as usize];
        *sum += value(uv[coordinate as usize]);
        *n += 1;
    }
    sums.into_iter().map(|(sum, n)| if n == 0 { 0.0 } else { sum / n as f32 }).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_sample_is_clean() {
        let loaded =
            crate::source::load(std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../assets-src/komon")));
        assert_eq!(loaded.diagnostics, []);
        let garment = loaded.garment.unwrap();
        assert_eq!(garment.base.positions_m.len(), 13_924);
        assert_eq!(garment.base.triangles.len(), 27_340);
        assert_eq!(garment.base.uv.len(), 14_585);
        assert_eq!(garment.targets.len(), 18);
        assert_eq!(garment.body.skeleton.joints().len(), 20);
        assert_eq!(garment.paths.len(), 17);
        assert_eq!(garment.drivers.len(), 4);
    }
}
