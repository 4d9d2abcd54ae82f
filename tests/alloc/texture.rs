//! Correcting a texture allocates nothing.

use glam::Vec2;
use kitsuke::fit::FitData;
use kitsuke::fit::texture::{TextureScratch, Texturer};

#[test]
fn correcting_allocates_nothing() {
    let garment = kitsuke_tests::small_garment();
    let mesh = &garment.data().mesh;
    let stretched: Vec<Vec2> = mesh.uv.iter().map(|uv| Vec2::new(uv.x, 1.2 * uv.y)).collect();
    let fit = FitData { uv: vec![stretched], ..FitData::default() };
    let texturer = Texturer::new(mesh, &fit).expect("a garment with texture coordinates");
    let mut scratch = TextureScratch::new(&texturer);
    let mut uv = vec![Vec2::NAN; garment.vertex_count()];
    let weights = vec![0.5; mesh.parts.len()];
    let (_, usage) = super::usage(|| {
        texturer.blend(&weights, &mut uv);
        texturer.correct(&mesh.positions_m, &weights, &mut scratch, &mut uv);
    });
    assert_eq!(usage, super::Usage::default());
    assert!(uv.iter().all(|uv| uv.is_finite()));
}
