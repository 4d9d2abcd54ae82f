//! Contact sheets: pictures in a grid, each with a caption under it, as one PNG. Knows no garment.

use font8x8::legacy::BASIC_LEGACY;
use image::{ImageEncoder, ImageError, Rgb, RgbImage, codecs::png, imageops};

const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [40; 3];
/// Pixels between cells and round the sheet.
const GAP_PX: u32 = 8;
/// Sides of the letters in pixels; captions that are too wide for the large ones get the small ones.
const LETTER_PX: [u32; 2] = [16, 8];

/// A picture with its caption.
#[derive(Clone, Debug)]
pub struct Cell {
    /// One line; what is not ASCII is shown as `?`, what is wider than the picture even in small letters is cut off.
    pub caption: String,
    /// The picture.
    pub picture: RgbImage,
}

/// Lays the cells out in rows of `columns`; every cell is as large as the largest picture.
///
/// # Panics
/// When `columns` is 0.
#[must_use]
pub fn contact_sheet(cells: &[Cell], columns: usize) -> RgbImage {
    let columns = columns.min(cells.len().max(1));
    let width = cells.iter().map(|cell| cell.picture.width()).max().unwrap_or(0) + GAP_PX;
    let height = cells.iter().map(|cell| cell.picture.height()).max().unwrap_or(0) + GAP_PX + LETTER_PX[0] + 4;
    let rows = cells.len().div_ceil(columns);
    let size = [columns as u32 * width + GAP_PX, rows as u32 * height + GAP_PX];
    let mut sheet = RgbImage::from_pixel(size[0], size[1], Rgb(PAPER));
    for (i, cell) in cells.iter().enumerate() {
        let (x, y) = (GAP_PX + (i % columns) as u32 * width, GAP_PX + (i / columns) as u32 * height);
        imageops::replace(&mut sheet, &cell.picture, i64::from(x), i64::from(y));
        write_line(&mut sheet, &cell.caption, [x, y + cell.picture.height() + 2], width - GAP_PX);
    }
    sheet
}

/// Pictures of one height side by side.
///
/// # Panics
/// When the heights differ.
#[must_use]
pub fn side_by_side(pictures: &[RgbImage]) -> RgbImage {
    let height = pictures.first().map_or(0, RgbImage::height);
    let mut row = RgbImage::new(pictures.iter().map(RgbImage::width).sum(), height);
    let mut x = 0;
    for picture in pictures {
        assert_eq!(picture.height(), height, "pictures side by side have one height");
        imageops::replace(&mut row, picture, x, 0);
        x += i64::from(picture.width());
    }
    row
}

/// PNG bytes of a picture, the same on every machine.
///
/// # Errors
/// When a side is 0 pixels long.
pub fn png_bytes(picture: &RgbImage) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Vec::new();
    let encoder = png::PngEncoder::new_with_quality(&mut bytes, png::CompressionType::Best, png::FilterType::Adaptive);
    encoder.write_image(picture, picture.width(), picture.height(), image::ExtendedColorType::Rgb8)?;
    Ok(bytes)
}

fn write_line(sheet: &mut RgbImage, line: &str, [left, top]: [u32; 2], room_px: u32) {
    let fits = |px: &u32| line.chars().count() as u32 * px <= room_px;
    let letter_px = LETTER_PX.into_iter().find(fits).unwrap_or(LETTER_PX[1]);
    for (i, letter) in line.chars().take((room_px / letter_px) as usize).enumerate() {
        // A glyph is 8 rows of 8 bits, the leftmost lowest.
        let glyph = BASIC_LEGACY[if letter.is_ascii() { letter as usize } else { '?' as usize }];
        for (y, x) in (0..letter_px).flat_map(|y| (0..letter_px).map(move |x| (y, x))) {
            if glyph[(y * 8 / letter_px) as usize] >> (x * 8 / letter_px) & 1 == 1 {
                sheet.put_pixel(left + i as u32 * letter_px + x, top + y, Rgb(INK));
            }
        }
    }
}
