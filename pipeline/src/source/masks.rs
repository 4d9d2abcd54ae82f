//! PNG images in the kimono's texture space: region masks, sampled at texture coordinates, and the colour texture, kept
//! as bytes. Knows no mesh.

use crate::diagnostic::{Diagnostic, Place};
use glam::Vec2;
use png::{BitDepth, Decoder, DecodingError, Transformations};
use std::io::{Cursor, ErrorKind};

/// Widest and highest image, pixels.
const SIDE: u32 = 8192;

/// A grey image, 0 (not this region) to 65535 (wholly this region).
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Rows from the top of the image, `width * height` values.
    pub values: Vec<u16>,
}

impl Mask {
    /// The bilinear value in 0..=1 at a texture coordinate; v = 0 is the bottom edge. Outside 0..=1 the mask repeats, as textures do.
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> f32 {
        let along = |t: f32, size: u32| {
            let at = (t * size as f32 - 0.5).clamp(0.0, (size - 1) as f32);
            let low = at.floor();
            (low as usize, (low as usize + 1).min(size as usize - 1), at - low)
        };
        let uv = repeated(uv);
        let (x0, x1, fx) = along(uv.x, self.width);
        let (y0, y1, fy) = along(1.0 - uv.y, self.height);
        let value = |x: usize, y: usize| f32::from(self.values[y * self.width as usize + x]) / 65535.0;
        let top = value(x0, y0) * (1.0 - fx) + value(x1, y0) * fx;
        let bottom = value(x0, y1) * (1.0 - fx) + value(x1, y1) * fx;
        top * (1.0 - fy) + bottom * fy
    }
}

/// The place in the image of a texture coordinate outside 0..=1; those inside, both edges too, stay as they are.
fn repeated(uv: Vec2) -> Vec2 {
    let along = |t: f32| if (0.0..=1.0).contains(&t) { t } else { t - t.floor() };
    Vec2::new(along(uv.x), along(uv.y))
}

/// What a decoded row is made of.
struct Rows {
    width: u32,
    height: u32,
    /// Grey, grey and alpha, colour, or colour and alpha.
    samples: usize,
    is_16_bit: bool,
    is_interlaced: bool,
}

/// Decodes a PNG row by row, so that the whole image is never held; what is wrong with it comes back in words. Rows of an
/// interlaced image are those of its passes.
fn decode(
    bytes: &[u8],
    begin: impl FnOnce(&Rows) -> Result<(), String>,
    mut row: impl FnMut(&Rows, &[u8]),
) -> Result<(), String> {
    let wrong = |error: DecodingError| match &error {
        DecodingError::IoError(io) if io.kind() == ErrorKind::UnexpectedEof => {
            "it ends in the middle, cut off when it was copied or saved".to_owned()
        }
        _ => error.to_string(),
    };
    if bytes.starts_with(b"\xff\xd8\xff") {
        return Err("it is a JPEG, whatever its name says".to_owned());
    }
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(wrong)?;
    let (colour, depth) = reader.output_color_type();
    let info = reader.info();
    let rows = Rows {
        width: info.width,
        height: info.height,
        samples: colour.samples(),
        is_16_bit: depth == BitDepth::Sixteen,
        is_interlaced: info.interlaced,
    };
    if rows.width > SIDE || rows.height > SIDE {
        return Err(format!("it has {} x {} pixels", rows.width, rows.height));
    }
    begin(&rows)?;
    while let Some(decoded) = reader.next_interlaced_row().map_err(wrong)? {
        row(&rows, decoded.data());
    }
    reader.finish().map_err(wrong)
}

/// The bytes of a colour texture, once all of it has been decoded.
pub fn read_texture(file: &str, bytes: Vec<u8>, report: &mut Vec<Diagnostic>) -> Option<Vec<u8>> {
    match decode(&bytes, |_| Ok(()), |_, _| ()) {
        Ok(()) => Some(bytes),
        Err(reason) => {
            report.push(
                Diagnostic::error("texture-image", file, Place::File)
                    .problem(format!("the texture is no readable PNG: {reason}"))
                    .help(format!("Save the texture again, as a PNG of at most {SIDE} x {SIDE} pixels.")),
            );
            None
        }
    }
}

/// Decodes a PNG mask of any depth, grey or coloured (then its luminance counts). What is transparent counts as black, so
/// that white paint on a transparent layer is what it looks like.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Mask> {
    let mut values = Vec::new();
    let mut size = (0, 0);
    let begin = |rows: &Rows| {
        size = (rows.width, rows.height);
        match rows.is_interlaced {
            true => Err("it is interlaced".to_owned()),
            false => Ok(()),
        }
    };
    let decoded = decode(bytes, begin, |rows, row| {
        let bytes = if rows.is_16_bit { 2 } else { 1 };
        let sample = |pixel: &[u8], i: usize| match pixel[i * bytes..(i + 1) * bytes] {
            [high, low] => u64::from(u16::from_be_bytes([high, low])),
            [byte] => u64::from(byte) * 257,
            _ => 0,
        };
        values.extend(row.chunks_exact(rows.samples * bytes).map(|pixel| {
            let grey = match rows.samples {
                1 | 2 => sample(pixel, 0),
                _ => (2126 * sample(pixel, 0) + 7152 * sample(pixel, 1) + 722 * sample(pixel, 2)) / 10_000,
            };
            let alpha = if rows.samples % 2 == 0 { sample(pixel, rows.samples - 1) } else { 65535 };
            (grey * alpha / 65535) as u16
        }));
    });
    match decoded {
        Ok(()) => Some(Mask { width: size.0, height: size.1, values }),
        Err(reason) => {
            report.push(
                Diagnostic::error("mask-image", file, Place::File)
                    .problem(format!("the mask is no readable PNG: {reason}"))
                    .help(format!(
                        "Save the mask as a grey PNG of at most {SIDE} x {SIDE} pixels, without interlacing."
                    )),
            );
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, ImageFormat, LumaA, Rgba};

    fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn transparent_paint_is_black_and_masks_repeat() {
        let bright_left = |x: u32| if x < 4 { 255 } else { 0 };
        let grey = image::GrayImage::from_fn(8, 8, |x, _| image::Luma([bright_left(x)]));
        let wanted = read("m.png", &png(grey), &mut Vec::new()).unwrap();
        let grey_alpha = image::GrayAlphaImage::from_fn(8, 8, |x, _| LumaA([255, bright_left(x)]));
        let colour = image::RgbaImage::from_fn(8, 8, |x, _| Rgba([255, 255, 255, bright_left(x)]));
        let deep = DynamicImage::from(colour.clone()).into_rgba16();
        for bytes in [png(grey_alpha), png(colour), png(deep)] {
            assert_eq!(read("m.png", &bytes, &mut Vec::new()).unwrap(), wanted);
        }
        for (uv, value) in [((0.2, 0.5), 1.0), ((0.8, 0.5), 0.0), ((1.0, 0.5), 0.0), ((0.0, 0.5), 1.0)] {
            assert_eq!(wanted.sample(uv.into()), value);
            for whole in [-3.0, 2.0] {
                let away = Vec2::new(uv.0 + whole, uv.1 - whole);
                if uv.0 % 1.0 != 0.0 {
                    assert_eq!(wanted.sample(away), value, "{away}");
                }
            }
        }
    }

    #[test]
    fn images_that_end_early_are_refused() {
        let noise =
            image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([(x * 37 + y * y * 11) as u8, (x * y) as u8, y as u8]));
        let bytes = png(noise);
        for length in [bytes.len() / 4, bytes.len() / 2, bytes.len() - 20] {
            let mut report = Vec::new();
            assert_eq!(read_texture("t.png", bytes[..length].to_vec(), &mut report), None);
            assert_eq!(read("m.png", &bytes[..length], &mut report), None);
            assert!(report.iter().all(|d| d.problem.contains("it ends in the middle")), "{report:?}");
        }
        assert!(read_texture("t.png", bytes.clone(), &mut Vec::new()).is_some());
    }
}
