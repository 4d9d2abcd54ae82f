//! Pictures of meshes, drawn in software: the same bytes on every machine and any number of threads. Knows triangles,
//! colours and a camera; knows no garment and no file.

use crate::look::texture::{Texture, linear, srgb};
use glam::{Mat3, Vec2, Vec3};
use image::RgbImage;
use rayon::prelude::*;

/// Samples per pixel along x and along y.
const SAMPLES: usize = 3;
/// Sample rows that one band draws on its own.
const BAND_ROWS: usize = 16 * SAMPLES;
/// Steps per sample to which corners are rounded, so that neighbouring triangles meet without gap or overlap.
const SUBSAMPLE: f32 = 256.0;
/// Nothing nearer to a perspective camera is drawn, metres.
const NEAR_M: f32 = 0.01;

/// A mesh with its colours.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    /// Corners, metres.
    pub positions_m: &'a [Vec3],
    /// Unit normals outward, one per position; see [`smooth_normals`].
    pub normals: &'a [Vec3],
    /// Counter-clockwise from outside.
    pub triangles: &'a [[u32; 3]],
    /// Colour of the outside.
    pub paint: Paint<'a>,
    /// Colour of the inside, sRGB; as the outside where `None`. The inside is always drawn darker.
    pub inside: Option<[u8; 3]>,
}

/// How a shape is coloured. Colours are sRGB.
#[derive(Clone, Copy, Debug)]
pub enum Paint<'a> {
    /// One colour.
    Plain([u8; 3]),
    /// One colour per position.
    PerVertex(&'a [[u8; 3]]),
    /// A texture, with one coordinate per position.
    Textured(&'a Texture, &'a [Vec2]),
}

/// Where the picture is taken from. The world's up is up.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// The eye, metres.
    pub eye_m: Vec3,
    /// What stands in the middle of the picture, metres; not straight above or below the eye.
    pub target_m: Vec3,
    /// The projection.
    pub lens: Lens,
}

impl Camera {
    /// Two that see all of these places (metres) in square pictures, each with its name.
    #[must_use]
    pub fn front_and_behind(places_m: &[Vec3]) -> [(&'static str, Camera); 2] {
        const MARGIN_M: f32 = 0.05;
        let least_m = places_m.iter().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
        let most_m = places_m.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ONE);
        let (target_m, size_m) = ((least_m + most_m) / 2.0, most_m - least_m);
        let height_m = size_m.x.max(size_m.y) + 2.0 * MARGIN_M;
        [("front", Vec3::Z), ("behind", Vec3::NEG_Z)].map(|(name, side)| {
            let eye_m = target_m + side * (size_m.z + MARGIN_M);
            (name, Camera { eye_m, target_m, lens: Lens::Orthographic { height_m } })
        })
    }
}

/// The projection of a [`Camera`].
#[derive(Clone, Copy, Debug)]
pub enum Lens {
    /// Parallel rays; the picture is so many metres high.
    Orthographic {
        /// Metres.
        height_m: f32,
    },
    /// Rays through the eye. Triangles that reach behind it are left out.
    Perspective {
        /// Angle between the lowest and the highest ray, above 0 and below pi.
        height_rad: f32,
    },
}

/// Draws the shapes into one picture of `width_px` by `height_px`.
///
/// # Panics
/// When a shape's arrays do not belong together or a triangle names a vertex that does not exist.
#[must_use]
pub fn render(shapes: &[Shape<'_>], camera: &Camera, [width_px, height_px]: [u32; 2], background: [u8; 3]) -> RgbImage {
    let samples = [width_px as usize * SAMPLES, height_px as usize * SAMPLES];
    let view = View::new(camera, samples);
    let triangles: Vec<Triangle> = shapes.iter().enumerate().flat_map(|(i, shape)| view.triangles(i, shape)).collect();
    let rows_per_band = BAND_ROWS / SAMPLES;
    let bands: Vec<Vec<u8>> = (0..(height_px as usize).div_ceil(rows_per_band))
        .into_par_iter()
        .map(|band| {
            let first = band * BAND_ROWS;
            let rows = BAND_ROWS.min(samples[1] - first);
            let mut nearness = vec![f32::NEG_INFINITY; rows * samples[0]];
            let mut colours = vec![linear(background); rows * samples[0]];
            for triangle in &triangles {
                triangle.each_sample(samples[0], first..first + rows, |x, y, weights| {
                    let at = (y - first) * samples[0] + x;
                    let near = triangle.corners.iter().zip(weights).map(|(c, w)| c.nearness * w).sum();
                    if near > nearness[at] {
                        nearness[at] = near;
                        colours[at] = view.shade(&shapes[triangle.shape], triangle, weights);
                    }
                });
            }
            pixels(&colours, samples[0])
        })
        .collect();
    RgbImage::from_raw(width_px, height_px, bands.concat()).expect("bands cover the picture")
}

/// Unit normals of the vertices: means of their triangles' normals, weighted by area; zero where no triangle stands.
#[must_use]
pub fn smooth_normals(positions_m: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; positions_m.len()];
    kitsuke::vertex_normals(positions_m, triangles.iter().copied(), &mut normals);
    normals
}

/// A corner on the picture.
#[derive(Clone, Copy)]
struct Corner {
    /// Samples from the upper left, in 1/256.
    x: i64,
    y: i64,
    /// Larger is nearer; affine over the picture.
    nearness: f32,
    /// 1 / distance under perspective, 1 otherwise: what makes other quantities affine over the picture.
    weight: f32,
}

struct Triangle {
    shape: usize,
    /// Vertices of the shape, in the order of `corners`: positive area with y downward.
    vertices: [u32; 3],
    corners: [Corner; 3],
    doubled_area: i64,
    from_outside: bool,
    /// Texels per sample as a power of two.
    texture_level: f32,
}

impl Triangle {
    /// Calls `draw` with each sample whose centre the triangle covers and the weights of its corners. On a border that
    /// two triangles share, a sample belongs to one of them (upper and left borders are inside).
    fn each_sample(&self, width: usize, rows: std::ops::Range<usize>, mut draw: impl FnMut(usize, usize, [f32; 3])) {
        let unit = SUBSAMPLE as i64;
        let first = |least: i64| (least - unit / 2).div_euclid(unit).max(0) as usize;
        let last = |most: i64| ((most + unit / 2).div_euclid(unit) + 1).max(0) as usize;
        let xs = self.corners.map(|c| c.x);
        let ys = self.corners.map(|c| c.y);
        let [x_min, y_min] = [xs, ys].map(|v| first(v[0].min(v[1]).min(v[2])));
        let [x_max, y_max] = [xs, ys].map(|v| last(v[0].max(v[1]).max(v[2])));
        // Twice the area between a sample and the edge opposite of each corner.
        let edges = [0, 1, 2].map(|i| (self.corners[(i + 1) % 3], self.corners[(i + 2) % 3]));
        for y in y_min.max(rows.start)..y_max.min(rows.end) {
            for x in x_min..x_max.min(width) {
                let (px, py) = (x as i64 * unit + unit / 2, y as i64 * unit + unit / 2);
                let areas = edges.map(|(a, b)| (b.x - a.x) * (py - a.y) - (b.y - a.y) * (px - a.x));
                let inside = areas.iter().zip(&edges).all(|(&area, (a, b))| {
                    let upper_or_left = b.y < a.y || (b.y == a.y && b.x > a.x);
                    area > 0 || (area == 0 && upper_or_left)
                });
                if inside {
                    draw(x, y, areas.map(|area| area as f32 / self.doubled_area as f32));
                }
            }
        }
    }
}

/// A camera and its lights, ready to draw.
struct View {
    eye_m: Vec3,
    /// Rows: right, up, toward the viewer.
    view_from_world: Mat3,
    samples: [usize; 2],
    lens: Lens,
    /// Samples per metre at distance 1 m (perspective) or everywhere.
    scale: f32,
    key: Vec3,
    fill: Vec3,
}

impl View {
    fn new(camera: &Camera, samples: [usize; 2]) -> View {
        let back = (camera.eye_m - camera.target_m).normalize();
        let right = Vec3::Y.cross(back).normalize();
        let up = back.cross(right);
        let height = match camera.lens {
            Lens::Orthographic { height_m } => height_m,
            Lens::Perspective { height_rad } => 2.0 * libm::tanf(height_rad / 2.0),
        };
        View {
            eye_m: camera.eye_m,
            view_from_world: Mat3::from_cols(right, up, back).transpose(),
            samples,
            lens: camera.lens,
            scale: samples[1] as f32 / height,
            key: (-0.55 * right + 0.65 * up + 0.75 * back).normalize(),
            fill: (0.85 * right + 0.1 * up + 0.5 * back).normalize(),
        }
    }

    fn corner(&self, position_m: Vec3) -> Option<Corner> {
        let at = self.view_from_world * (position_m - self.eye_m);
        let (weight, nearness) = match self.lens {
            Lens::Orthographic { .. } => (1.0, at.z),
            Lens::Perspective { .. } if -at.z < NEAR_M => return None,
            Lens::Perspective { .. } => (-1.0 / at.z, -1.0 / at.z),
        };
        let x = (at.x * weight * self.scale + self.samples[0] as f32 / 2.0) * SUBSAMPLE;
        let y = (-at.y * weight * self.scale + self.samples[1] as f32 / 2.0) * SUBSAMPLE;
        let drawable = at.is_finite() && x.abs().max(y.abs()) < (1 << 28) as f32;
        drawable.then(|| Corner { x: x.round() as i64, y: y.round() as i64, nearness, weight })
    }

    fn triangles(&self, index: usize, shape: &Shape<'_>) -> Vec<Triangle> {
        assert_eq!(shape.normals.len(), shape.positions_m.len(), "one normal per position");
        let corners: Vec<Option<Corner>> = shape.positions_m.iter().map(|&p| self.corner(p)).collect();
        let setup = |&[a, b, c]: &[u32; 3]| {
            let [ca, cb, cc] = [corners[a as usize]?, corners[b as usize]?, corners[c as usize]?];
            let area = (cb.x - ca.x) * (cc.y - ca.y) - (cb.y - ca.y) * (cc.x - ca.x);
            // y points downward, so counter-clockwise triangles have negative area.
            let from_outside = area < 0;
            let (vertices, corners) = if from_outside { ([a, c, b], [ca, cc, cb]) } else { ([a, b, c], [ca, cb, cc]) };
            let doubled_area = area.abs();
            let texture_level = texture_level(shape, vertices, doubled_area);
            (area != 0).then_some(Triangle {
                shape: index,
                vertices,
                corners,
                doubled_area,
                from_outside,
                texture_level,
            })
        };
        shape.triangles.iter().filter_map(setup).collect()
    }

    /// Linear light of a sample of `triangle`.
    fn shade(&self, shape: &Shape<'_>, triangle: &Triangle, weights: [f32; 3]) -> Vec3 {
        let weights = [0, 1, 2].map(|i| weights[i] * triangle.corners[i].weight);
        let total: f32 = weights.iter().sum();
        let weights = weights.map(|w| w / total);
        let at = triangle.vertices.map(|v| v as usize);
        let mean = |value: &dyn Fn(usize) -> Vec3| {
            value(at[0]) * weights[0] + value(at[1]) * weights[1] + value(at[2]) * weights[2]
        };
        let albedo = match (shape.inside.filter(|_| !triangle.from_outside), shape.paint) {
            (Some(colour), _) | (None, Paint::Plain(colour)) => linear(colour),
            (None, Paint::PerVertex(colours)) => mean(&|v| linear(colours[v])),
            (None, Paint::Textured(texture, uv)) => {
                let uv = mean(&|v| uv[v].extend(0.0)).truncate();
                texture.colour(uv, triangle.texture_level)
            }
        };
        let normal = mean(&|v| shape.normals[v]).normalize_or_zero();
        let (normal, dimming) = if triangle.from_outside { (normal, 1.0) } else { (-normal, 0.55) };
        let sky = 0.26 + 0.14 * normal.y;
        let key = 0.72 * normal.dot(self.key).max(0.0);
        let fill = 0.16 * normal.dot(self.fill).max(0.0);
        albedo * (dimming * (sky + key + fill))
    }
}

fn texture_level(shape: &Shape<'_>, vertices: [u32; 3], doubled_area: i64) -> f32 {
    let Paint::Textured(texture, uv) = shape.paint else { return 0.0 };
    let [a, b, c] = vertices.map(|v| uv[v as usize] * texture.size_px());
    let texels = (b - a).perp_dot(c - a).abs();
    let samples = doubled_area as f32 / (SUBSAMPLE * SUBSAMPLE);
    0.5 * libm::log2f((texels / samples).max(1.0))
}

/// Means of SAMPLES x SAMPLES samples as sRGB bytes.
fn pixels(colours: &[Vec3], samples_per_row: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(colours.len() / (SAMPLES * SAMPLES) * 3);
    for rows in colours.chunks_exact(samples_per_row * SAMPLES) {
        for x in (0..samples_per_row).step_by(SAMPLES) {
            let sum: Vec3 = rows.chunks_exact(samples_per_row).flat_map(|row| &row[x..x + SAMPLES]).sum();
            bytes.extend(srgb(sum / (SAMPLES * SAMPLES) as f32));
        }
    }
    bytes
}
