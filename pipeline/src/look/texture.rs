//! Base colour images for the rasteriser, and light as sRGB bytes. Knows no mesh.

pub use crate::light::{linear, srgb};
use glam::{Vec2, Vec3};
use image::{ImageError, ImageReader, Rgb, RgbImage};
use std::io::Cursor;

/// Longest side of a texture, pixels.
const TEXTURE_PX: u32 = 8192;

/// A base colour image, with its halves, quarters … for drawing it small.
#[derive(Clone, Debug)]
pub struct Texture {
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    /// Linear light, top row first.
    texels: Vec<Vec3>,
}

impl Texture {
    /// Decodes a PNG; transparency is ignored.
    ///
    /// # Errors
    /// When the bytes are no PNG or a side is longer than 8192 pixels.
    pub fn from_png(bytes: &[u8]) -> Result<Texture, ImageError> {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), image::ImageFormat::Png);
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(TEXTURE_PX);
        limits.max_image_height = Some(TEXTURE_PX);
        reader.limits(limits);
        Ok(Texture::from_rgb(&reader.decode()?.into_rgb8()))
    }

    /// A checker of so many squares along each side.
    #[must_use]
    pub fn checker(squares: u32, colours: [[u8; 3]; 2]) -> Texture {
        const SQUARE_PX: u32 = 16;
        let side_px = (squares * SQUARE_PX).clamp(SQUARE_PX, TEXTURE_PX);
        let colour = |x: u32, y: u32| colours[((x / SQUARE_PX + y / SQUARE_PX) % 2) as usize];
        Texture::from_rgb(&RgbImage::from_fn(side_px, side_px, |x, y| Rgb(colour(x, y))))
    }

    fn from_rgb(image: &RgbImage) -> Texture {
        let texels = image.pixels().map(|p| linear(p.0)).collect();
        let mut levels = vec![Level { width: image.width() as usize, height: image.height() as usize, texels }];
        while levels.last().is_some_and(|level| level.width.max(level.height) > 1) {
            levels.push(levels[levels.len() - 1].half());
        }
        Texture { levels }
    }

    /// Width and height, pixels.
    #[must_use]
    pub fn size_px(&self) -> Vec2 {
        Vec2::new(self.levels[0].width as f32, self.levels[0].height as f32)
    }

    /// Linear light at `uv` (v = 0 is the bottom row; repeats beyond 0..1), where a sample spans 2^`level` texels.
    #[must_use]
    pub fn colour(&self, uv: Vec2, level: f32) -> Vec3 {
        let level = level.clamp(0.0, (self.levels.len() - 1) as f32);
        let (lower, part) = (level as usize, level.fract());
        let coarse = &self.levels[(lower + 1).min(self.levels.len() - 1)];
        self.levels[lower].colour(uv).lerp(coarse.colour(uv), part)
    }
}

impl Level {
    fn texel(&self, x: usize, y: usize) -> Vec3 {
        self.texels[y * self.width + x]
    }

    fn half(&self) -> Level {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let (right, bottom) = (self.width - 1, self.height - 1);
        let texels = (0..width * height)
            .map(|i| {
                let (x, y) = (i % width * 2, i / width * 2);
                let (x1, y1) = ((x + 1).min(right), (y + 1).min(bottom));
                (self.texel(x, y) + self.texel(x1, y) + self.texel(x, y1) + self.texel(x1, y1)) * 0.25
            })
            .collect();
        Level { width, height, texels }
    }

    fn colour(&self, uv: Vec2) -> Vec3 {
        let wrapped = |at: f32, count: usize| (at as i64).rem_euclid(count as i64) as usize;
        let at = Vec2::new(uv.x * self.width as f32, (1.0 - uv.y) * self.height as f32) - 0.5;
        let (corner, part) = (at.floor(), at - at.floor());
        let (x0, x1) = (wrapped(corner.x, self.width), wrapped(corner.x + 1.0, self.width));
        let (y0, y1) = (wrapped(corner.y, self.height), wrapped(corner.y + 1.0, self.height));
        let upper = self.texel(x0, y0).lerp(self.texel(x1, y0), part.x);
        let lower = self.texel(x0, y1).lerp(self.texel(x1, y1), part.x);
        upper.lerp(lower, part.y)
    }
}
