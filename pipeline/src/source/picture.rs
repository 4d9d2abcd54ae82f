//! Pictures that are painted or come with a scan: PNG and JPEG, told apart by what they hold. Knows no mesh and no texture space.

use image::{DynamicImage, ImageError, ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Widest and highest picture, pixels.
pub const SIDE: u32 = 16_384;
/// Most pixels of a picture: scanners write 16384 x 8192, not more.
const PIXELS: u64 = 1 << 27;
/// What a decoder may take, bytes: four channels of 16 bits.
const DECODED_BYTES: u64 = PIXELS * 8;

/// Decodes a picture.
///
/// # Errors
/// In words: it is another kind of file, larger than it may be, or damaged.
pub fn decode(bytes: &[u8]) -> Result<DynamicImage, String> {
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
        Ok(other) => return Err(format!("it is {other:?}; pictures are read as PNG or JPEG, so save it as one")),
        Err(_) => return Err("it begins neither as a PNG nor as a JPEG; save the picture as one of them".to_owned()),
    };
    let damaged = |error: ImageError| match error {
        ImageError::Limits(_) => format!("it is larger than {SIDE} pixels along a side; save it smaller"),
        error => format!("it is damaged: {error}"),
    };
    // Its size first: it is refused before there is room for it.
    let (width, height) = ImageReader::with_format(Cursor::new(bytes), format).into_dimensions().map_err(damaged)?;
    if width.max(height) > SIDE || u64::from(width) * u64::from(height) > PIXELS {
        return Err(format!(
            "it has {width} x {height} pixels; at most {SIDE} along a side and {PIXELS} in all are read, so save it smaller"
        ));
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE);
    limits.max_image_height = Some(SIDE);
    limits.max_alloc = Some(DECODED_BYTES);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    reader.decode().map_err(damaged)
}
