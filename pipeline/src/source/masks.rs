//! PNG images in the kimono's texture space: region masks, sampled at texture coordinates, and the colour texture, kept
//! as bytes. Knows no mesh.

use crate::diagnostic::{Diagnostic, Place};
use glam::Vec2;
use image::{ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Widest and highest image, pixels.
const SIDE: u32 = 8192;

/// A grey image, 0 (not this region) to 1 (wholly this region).
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Rows from the top of the image, `width * height` values in 0..=1.
    pub values: Vec<f32>,
}

impl Mask {
    /// The bilinear value at a texture coordinate; v = 0 is the bottom edge, and outside 0..=1 the edge pixels go on.
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> f32 {
        let along = |t: f32, size: u32| {
            let at = (t * size as f32 - 0.5).clamp(0.0, (size - 1) as f32);
            let low = at.floor();
            (low as usize, (low as usize + 1).min(size as usize - 1), at - low)
        };
        let (x0, x1, fx) = along(uv.x, self.width);
        let (y0, y1, fy) = along(1.0 - uv.y, self.height);
        let value = |x: usize, y: usize| self.values[y * self.width as usize + x];
        let top = value(x0, y0) * (1.0 - fx) + value(x1, y0) * fx;
        let bottom = value(x0, y1) * (1.0 - fx) + value(x1, y1) * fx;
        top * (1.0 - fy) + bottom * fy
    }
}

/// The bytes of a colour texture, once its header has shown that it is a PNG of usable size.
pub fn read_texture(file: &str, bytes: Vec<u8>, report: &mut Vec<Diagnostic>) -> Option<Vec<u8>> {
    let size = ImageReader::with_format(Cursor::new(&bytes), ImageFormat::Png).into_dimensions();
    let problem = match size {
        Ok((1..=SIDE, 1..=SIDE)) => return Some(bytes),
        Ok((width, height)) => format!("the texture has {width} x {height} pixels"),
        Err(error) => format!("the texture is no readable PNG: {error}"),
    };
    report.push(
        Diagnostic::error("texture-image", file, Place::File)
            .problem(problem)
            .help(format!("Save the texture as a PNG of at most {SIDE} x {SIDE} pixels.")),
    );
    None
}

/// Decodes a PNG mask of 8 or 16 bits, grey or coloured (then its luminance counts).
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Mask> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE);
    limits.max_image_height = Some(SIDE);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    reader.limits(limits);
    match reader.decode() {
        Ok(image) if image.width() > 0 && image.height() > 0 => {
            let grey = image.to_luma16();
            let (width, height) = grey.dimensions();
            let values = grey.into_raw().into_iter().map(|value| f32::from(value) / 65535.0).collect();
            Some(Mask { width, height, values })
        }
        other => {
            let reason = other.err().map_or("it has no pixels".to_owned(), |error| error.to_string());
            report.push(
                Diagnostic::error("mask-image", file, Place::File)
                    .problem(format!("the mask is no readable PNG: {reason}"))
                    .help(format!("Save the mask as a grey PNG of at most {SIDE} x {SIDE} pixels.")),
            );
            None
        }
    }
}
