//! A pattern on the sample kimono in its sizes.

use glam::{Vec2, Vec3};
use kitsuke::arrays::SkinWeights;
use kitsuke::fit::texture::{TextureScratch, Texturer};
use kitsuke::garment::Garment;
use kitsuke_pipeline::measure::distortion::{Distortion, Worn, distortion, m_per_uv};
use kitsuke_pipeline::stages::{compress, fit_data};
use kitsuke_pipeline::{ir, load};
use std::path::Path;

/// Each size's own shape and flat pieces: nothing is fitted here, so that what is wrong is the correction.
#[test]
fn a_pattern_keeps_its_size_in_every_size() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src/komon");
    let source = ir::Garment { targets: Vec::new(), ..load(&folder).garment.unwrap() };
    let skin = vec![SkinWeights { joints: [0; 4], weights: [65535, 0, 0, 0] }; source.base.positions_m.len()];
    let masks = vec![0; skin.len() * source.drivers.len()];
    let garment = Garment::new(compress::compress(&source, &skin, &masks, &[], source.budget_m).unwrap()).unwrap();
    let mesh = &garment.data().mesh;
    let sizes = source.sizes.as_ref().unwrap();
    let fit = fit_data::fit_data(&source, sizes, Vec::new(), &garment);
    let texturer = Texturer::new(mesh, &fit).unwrap();
    let mut scratch = TextureScratch::new(&texturer);
    let m_per_uv = m_per_uv(mesh);
    // The files give 320 cm per unit.
    assert!((m_per_uv - 3.2).abs() < 0.005, "{m_per_uv}");
    for (size, (shape, own)) in sizes.shapes.iter().zip(&fit.uv).enumerate() {
        let positions_m: Vec<Vec3> = mesh.source_vertex.iter().map(|&v| shape.positions_m[v as usize]).collect();
        let alone = |i: usize| if i % sizes.shapes.len() == size { 1.0 } else { 0.0 };
        let weights: Vec<f32> = (0..mesh.parts.len() * sizes.shapes.len()).map(alone).collect();
        let mut blended = vec![Vec2::NAN; garment.vertex_count()];
        let mut corrected = blended.clone();
        texturer.blend(&weights, &mut blended);
        texturer.correct(&positions_m, &weights, &mut scratch, &mut corrected);
        let [kept, corrected_rows] = [&mesh.uv, &corrected]
            .map(|uv| distortion(&Worn { mesh, positions_m: &positions_m, uv, straight_uv: &blended, m_per_uv }));
        let whole = |rows: &[Distortion]| rows[rows.len() - 1].clone();
        let (kept, after) = (whole(&kept), whole(&corrected_rows));
        assert!(after.rms < 0.25 * kept.rms, "{}: {after:?} of {kept:?}", shape.file);
        assert!(after.motif.abs() < 0.015, "{}: {after:?}", shape.file);
        let farthest = |a: &[Vec2], b: &[Vec2]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(farthest(&blended, own) < 1e-6, "{}", shape.file);
        // On the whole length of 3 m the pattern shifts by less than its finest dots lie apart.
        let shift_m = f64::from(farthest(&corrected, own)) * m_per_uv;
        assert!(shift_m < 0.02, "{}: {shift_m}", shape.file);
    }
}
