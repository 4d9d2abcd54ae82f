//! The texture that `register` makes of a scan's colours, and what it looks like on the kimono.

use crate::places::{say, write_whole};
use crate::scans::picture_of;
use glam::{DVec3, Vec2, Vec3};
use kitsuke_pipeline::ir;
use kitsuke_pipeline::look::raster::{Camera, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use kitsuke_pipeline::look::texture::Texture;
use kitsuke_pipeline::source::import::ImportedMesh;
use kitsuke_pipeline::source::picture;
use kitsuke_pipeline::stages::bake::{self, Baked, Base, Colours, Scan, Settings, bake};
use kitsuke_pipeline::stages::register::Registered;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A texture made of a scan, as options of `register`.
#[derive(clap::Args)]
pub struct TextureArgs {
    /// The scan's colours in the kimono's texture space
    #[arg(long, value_name = "FILE.png")]
    texture: Option<PathBuf>,
    /// Width and height of the texture, pixels
    #[arg(long, value_name = "PX", default_value_t = 2048, requires = "texture", value_parser = clap::value_parser!(u32).range(1..=i64::from(bake::SIDE_PX)))]
    texture_px: u32,
    /// How far each pixel of the texture can be trusted: white where the scan was seen, black where it was filled
    #[arg(long, value_name = "FILE.png", requires = "texture")]
    confidence: Option<PathBuf>,
    /// Pictures of the scan, of the kimono with the texture made of it and with its own
    #[arg(long, value_name = "FILE.png", requires = "texture")]
    texture_picture: Option<PathBuf>,
}

impl TextureArgs {
    /// Makes and writes what is asked for, of the cleaned scan with its colours (see `Cleaned::carried`).
    pub fn write(
        &self,
        file: &Path,
        garment: &ir::Garment,
        laid: &Registered,
        scan: &ImportedMesh,
    ) -> Result<(), String> {
        let Some(out) = &self.texture else { return Ok(()) };
        let image = picture_of(file, scan)?.filter(|_| !scan.uv.is_empty());
        let colours = match &image {
            Some(image) => Colours::Picture(image, &scan.uv),
            None if !scan.colours.is_empty() => Colours::PerVertex(&scan.colours),
            None => {
                return Err(format!(
                    "{} has no colours: neither a picture with texture coordinates nor colours of vertices",
                    file.display()
                ));
            }
        };
        let moved: Vec<DVec3> = scan.positions.iter().map(|&p| laid.base_from_scan.place(p)).collect();
        let base = Base {
            positions_m: &laid.positions_m,
            triangles: &garment.base.triangles,
            confidence: &laid.confidence,
            uv: &garment.base.uv,
            uv_triangles: &garment.base.uv_triangles,
        };
        let scan = Scan { positions_m: &moved, triangles: &scan.triangles, colours };
        let settings = Settings { size_px: self.texture_px, ..Settings::default() };
        let started = Instant::now();
        let baked = bake(&base, &scan, &settings).map_err(|error| error.to_string())?;
        say!("{}", figures(&baked, started.elapsed().as_secs_f64()));
        let own = garment.texture.as_ref().map(|own| picture::decode(&own.png)).transpose()?.map(|own| own.into_rgb8());
        if let Some(own) = &own {
            say!("{}", beside(&baked, own));
        }
        let png = png_bytes(&baked.colour).map_err(|error| error.to_string())?;
        write_whole(out, |file| file.write_all(&png))?;
        if let Some(path) = &self.confidence {
            let mut png = Cursor::new(Vec::new());
            baked.confidence.write_to(&mut png, image::ImageFormat::Png).map_err(|error| error.to_string())?;
            write_whole(path, |file| file.write_all(png.get_ref()))?;
        }
        if let Some(path) = &self.texture_picture {
            let png = look(&base, &scan, &baked, own.as_ref())?;
            write_whole(path, |file| file.write_all(&png))?;
        }
        Ok(())
    }
}

fn figures(baked: &Baked, seconds: f64) -> String {
    let share = 100.0 * baked.seen as f64 / baked.covered.max(1) as f64;
    let sure = baked.confidence.as_raw().iter().filter(|&&c| c >= 128).count();
    format!(
        "texture: {} of {} covered pixels got a colour of the scan ({share:.0} %, {sure} of them surely), the others were filled; {seconds:.1} s",
        baked.seen, baked.covered
    )
}

/// How far a texture lies from the kimono's own, where it can be trusted: means only anything when the scan is of that cloth.
fn beside(baked: &Baked, own: &image::RgbImage) -> String {
    let size = baked.colour.width();
    let (mut sums, mut count) = ([0.0_f64; 3], 0);
    for (x, y, image::Rgb(colour)) in baked.colour.enumerate_pixels() {
        if baked.confidence.get_pixel(x, y).0[0] < 128 {
            continue;
        }
        let at = |p: u32, side: u32| ((u64::from(p) * 2 + 1) * u64::from(side) / (2 * u64::from(size))) as u32;
        let image::Rgb(other) = own.get_pixel(at(x, own.width()), at(y, own.height()));
        (0..3).for_each(|i| sums[i] += f64::from(colour[i].abs_diff(other[i])));
        count += 1;
    }
    let [r, g, b] = sums.map(|sum| sum / f64::from(count.max(1)));
    format!(
        "beside the kimono's own texture, where it is sure: red {r:.1}, green {g:.1}, blue {b:.1} of 255 apart on average"
    )
}

/// Scan, kimono with the texture, with its own, and what was seen, from the front and behind.
fn look(base: &Base<'_>, scan: &Scan<'_>, baked: &Baked, own: Option<&image::RgbImage>) -> Result<Vec<u8>, String> {
    let texture = |image: &image::RgbImage| -> Result<Texture, String> {
        let png = png_bytes(image).map_err(|error| error.to_string())?;
        Texture::from_png(&png).map_err(|error| error.to_string())
    };
    let grey = image::DynamicImage::from(baked.confidence.clone()).into_rgb8();
    let scan_texture = match scan.colours {
        Colours::Picture(image, _) => Some(texture(image)?),
        Colours::PerVertex(_) => None,
    };
    let mut pictures = vec![("texture of the scan", texture(&baked.colour)?)];
    if let Some(own) = own {
        pictures.push(("the kimono's own texture", texture(own)?));
    }
    pictures.push(("white: seen", texture(&grey)?));
    let base_uv: Vec<[Vec2; 3]> = base.uv_triangles.iter().map(|t| t.map(|i| base.uv[i as usize])).collect();
    let base = Split::new(base.positions_m, base.triangles, &base_uv);
    let scan_split = match scan.colours {
        Colours::Picture(_, uv) => Split::new(scan.positions_m, scan.triangles, uv),
        Colours::PerVertex(_) => {
            Split::new(scan.positions_m, scan.triangles, &vec![[Vec2::ZERO; 3]; scan.triangles.len()])
        }
    };
    let colours: Vec<[u8; 3]> = match scan.colours {
        Colours::PerVertex(colours) => scan.triangles.iter().flatten().map(|&v| colours[v as usize]).collect(),
        Colours::Picture(..) => Vec::new(),
    };
    let mut cells = Vec::new();
    for (name, camera) in Camera::front_and_behind(&base.positions_m) {
        let paint = match &scan_texture {
            Some(texture) => Paint::Textured(texture, &scan_split.uv),
            None => Paint::PerVertex(&colours),
        };
        let mut draw = |caption: &str, split: &Split, paint: Paint<'_>| {
            let picture = render(&[split.shape(paint)], &camera, [720, 720], [244, 243, 240]);
            cells.push(Cell { caption: format!("{caption}, {name}"), picture });
        };
        draw("scan", &scan_split, paint);
        for (caption, texture) in &pictures {
            draw(caption, &base, Paint::Textured(texture, &base.uv));
        }
    }
    png_bytes(&contact_sheet(&cells, 1 + pictures.len())).map_err(|error| error.to_string())
}

/// A mesh whose triangles share no vertices, because the rasteriser wants one texture coordinate each.
struct Split {
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    uv: Vec<Vec2>,
}

impl Split {
    fn new(positions_m: &[DVec3], triangles: &[[u32; 3]], uv: &[[Vec2; 3]]) -> Split {
        let whole_m: Vec<Vec3> = positions_m.iter().map(|p| p.as_vec3()).collect();
        let normals = smooth_normals(&whole_m, triangles);
        let of = |values: &[Vec3]| triangles.iter().flatten().map(|&v| values[v as usize]).collect();
        Split {
            positions_m: of(&whole_m),
            normals: of(&normals),
            triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            uv: uv.iter().flatten().copied().collect(),
        }
    }

    fn shape<'a>(&'a self, paint: Paint<'a>) -> Shape<'a> {
        let inside = Some([120, 110, 100]);
        Shape { positions_m: &self.positions_m, normals: &self.normals, triangles: &self.triangles, paint, inside }
    }
}
