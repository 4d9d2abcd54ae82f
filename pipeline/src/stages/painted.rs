//! Regions painted as colours on one picture, as one grey mask each. A pixel between two colours belongs to both in the shares in which
//! a paint program mixed them. Knows no file and no texture space.

use crate::light::linear;
use glam::Vec3;
use image::{GrayImage, Rgba, RgbaImage};
use rayon::prelude::*;

/// Farther from all mixes of two colours than this a pixel is none of them; of linear light, whose black and white are 1 apart per channel.
const STRAY: f32 = 0.06;
/// A mix as linear light is preferred to one of sRGB values that is nearer by less than this.
const AS_NEAR: f32 = 1e-3;

/// A region and the colour that it is painted in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// Its name.
    pub name: String,
    /// sRGB.
    pub colour: [u8; 3],
}

/// What a picture's colours say of the regions.
#[derive(Clone, Debug, PartialEq)]
pub struct Painted {
    /// 255 where a pixel is wholly the region's; one per region. At every pixel they sum to at most 255.
    pub masks: Vec<GrayImage>,
    /// How many pixels are at least half each region's.
    pub pixels: Vec<usize>,
    /// Of each region that has none, the pixel that comes nearest to its colour.
    pub nearest: Vec<Option<[u8; 3]>>,
    /// Pixels of no named colour and no mix of two; they were given to the nearest all the same.
    pub strays: usize,
    /// Column, row from above, and colour of the first of them.
    pub first_stray: Option<([u32; 2], [u8; 3])>,
}

/// A colour as light and as its sRGB values, 0 to 1.
#[derive(Clone, Copy)]
struct Colour {
    light: Vec3,
    srgb: Vec3,
}

impl Colour {
    fn new(srgb: [u8; 3]) -> Colour {
        Colour { light: linear(srgb), srgb: Vec3::from(srgb.map(f32::from)) / 255.0 }
    }
}

/// Of which two colours a pixel is mixed: indices, the share of the second, and how far from the mix it lies in linear light.
#[derive(Clone, Copy)]
struct Mix {
    of: [usize; 2],
    share: f32,
    away: f32,
}

/// Tells the regions of a picture apart. What is transparent counts as background.
#[must_use]
pub fn regions(picture: &RgbaImage, regions: &[Region], background: [u8; 3]) -> Painted {
    let (width, height) = picture.dimensions();
    let colours: Vec<Colour> =
        std::iter::once(background).chain(regions.iter().map(|r| r.colour)).map(Colour::new).collect();
    let rows: Vec<(Vec<u8>, Vec<bool>)> = (0..height)
        .into_par_iter()
        .map(|y| {
            let (mut shares, mut is_stray) = (vec![0; width as usize * regions.len()], vec![false; width as usize]);
            let mut last: Option<(Rgba<u8>, Mix)> = None;
            for x in 0..width {
                let pixel = *picture.get_pixel(x, y);
                let Rgba([r, g, b, alpha]) = pixel;
                if alpha == 0 {
                    continue;
                }
                // Neighbours are mostly of one colour.
                let mix = match last {
                    Some((known, mix)) if known == pixel => mix,
                    _ => mix(Colour::new([r, g, b]), &colours),
                };
                last = Some((pixel, mix));
                is_stray[x as usize] = mix.away > STRAY;
                let second = (mix.share * f32::from(alpha)).round() as u8;
                for (of, share) in mix.of.into_iter().zip([alpha - second, second]) {
                    if of > 0 {
                        shares[(of - 1) * width as usize + x as usize] = share;
                    }
                }
            }
            (shares, is_stray)
        })
        .collect();
    let mask = |region: usize| {
        let of_row = |(shares, _): &(Vec<u8>, Vec<bool>)| {
            shares[region * width as usize..(region + 1) * width as usize].to_vec()
        };
        GrayImage::from_raw(width, height, rows.iter().flat_map(of_row).collect()).expect("one byte per pixel")
    };
    let masks: Vec<GrayImage> = (0..regions.len()).map(mask).collect();
    let pixels: Vec<usize> =
        masks.iter().map(|mask| mask.as_raw().iter().filter(|&&share| share >= 128).count()).collect();
    let nearest = regions.iter().zip(&pixels).map(|(region, &count)| (count == 0).then(|| nearest(picture, region))?);
    let strays: Vec<usize> =
        rows.iter().flat_map(|(_, is_stray)| is_stray).enumerate().filter(|(_, s)| **s).map(|(i, _)| i).collect();
    let first_stray = strays.first().map(|&i| {
        let [x, y] = [i as u32 % width, i as u32 / width];
        let Rgba([r, g, b, _]) = *picture.get_pixel(x, y);
        ([x, y], [r, g, b])
    });
    Painted { nearest: nearest.collect(), pixels, masks, strays: strays.len(), first_stray }
}

fn nearest(picture: &RgbaImage, region: &Region) -> Option<[u8; 3]> {
    let colours = picture.pixels().filter(|pixel| pixel.0[3] >= 128).map(|Rgba([r, g, b, _])| [*r, *g, *b]);
    let away = |colour: &[u8; 3]| -> u32 {
        colour.iter().zip(region.colour).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
    };
    colours.min_by_key(|colour| (away(colour), *colour))
}

/// The mix of two colours that is nearest to a pixel: of light, as brushes mix, or of sRGB values, as many programs do.
fn mix(pixel: Colour, colours: &[Colour]) -> Mix {
    let mut best = Mix { of: [0, 0], share: 0.0, away: pixel.light.distance(colours[0].light) };
    for (a, b) in (0..colours.len()).flat_map(|b| (0..b).map(move |a| (a, b))) {
        let (from, to) = (colours[a], colours[b]);
        let along = |at: Vec3, from: Vec3, to: Vec3| {
            let length = (to - from).length_squared();
            if length > 0.0 { ((at - from).dot(to - from) / length).clamp(0.0, 1.0) } else { 0.0 }
        };
        let by_light = along(pixel.light, from.light, to.light);
        let by_value = along(pixel.srgb, from.srgb, to.srgb);
        let of_values = linear((from.srgb.lerp(to.srgb, by_value) * 255.0).round().to_array().map(|c| c as u8));
        let mixes = [(by_light, from.light.lerp(to.light, by_light)), (by_value, of_values)];
        for (share, light) in mixes {
            let away = pixel.light.distance(light);
            if away + AS_NEAR < best.away {
                best = Mix { of: [a, b], share, away };
            }
        }
    }
    best
}
