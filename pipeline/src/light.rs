//! Light as sRGB bytes and back. Knows neither pictures nor meshes.

use glam::Vec3;
use std::sync::LazyLock;

/// Linear light of each sRGB byte (IEC 61966-2-1).
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| match byte as f32 / 255.0 {
        c if c <= 0.040_45 => c / 12.92,
        c => libm::powf((c + 0.055) / 1.055, 2.4),
    })
});

/// Linear light of an sRGB colour.
#[must_use]
pub fn linear(colour: [u8; 3]) -> Vec3 {
    Vec3::from(colour.map(|c| LINEAR[usize::from(c)]))
}

/// The sRGB colour of linear light.
#[must_use]
pub fn srgb(light: Vec3) -> [u8; 3] {
    light.to_array().map(|c| {
        let c = match c.clamp(0.0, 1.0) {
            c if c <= 0.003_130_8 => c * 12.92,
            c => 1.055 * libm::powf(c, 1.0 / 2.4) - 0.055,
        };
        (c * 255.0).round() as u8
    })
}
