//! A kimono on its wearer as pictures: which shapes, colours and views. Knows neither files nor sheets.

use crate::frames::{Shot, Stage, in_source_order};
use crate::ir;
use crate::raster::{Camera, Lens, Paint, Shape, Texture, render, smooth_normals};
use glam::{Affine3A, Vec3};
use image::RgbImage;
use kitsuke::Garment;
use kitsuke::skeleton::Pose;

const BACKGROUND: [u8; 3] = [236; 3];
const CLOTH: [u8; 3] = [176, 178, 184];
const LINING: [u8; 3] = [222, 216, 204];
const OBI: [u8; 3] = [196, 160, 64];
const SKIN: [u8; 3] = [228, 204, 182];

/// Where a picture is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// Before the wearer.
    Front,
    /// At the wearer's left.
    Side,
    /// Behind.
    Back,
    /// Before the wearer, a little to the wearer's left and from above.
    Quarter,
}

/// What the colours of the cloth say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Colours {
    /// The cloth as it looks.
    Cloth,
    /// The region masks, one colour per driver; grey belongs to none.
    Regions,
    /// The joints that move the cloth, mixed by skin weight.
    Joints,
    /// The distance from the target files; red is this many metres and beyond.
    Error(f32),
}

/// A kimono and its wearer in one pose, with colours, ready to draw.
#[derive(Clone, Debug)]
pub struct Figure {
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// Colours per vertex, unless the cloth is drawn as it looks.
    colours: Option<Vec<[u8; 3]>>,
    body: Option<(Vec<Vec3>, Vec<Vec3>)>,
}

/// What is drawn: a garment and, where its sources can be read, texture, wearer and obi.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    garment: &'a Garment,
    source: Option<&'a ir::Garment>,
    texture: Option<Texture>,
    obi_normals: Vec<Vec3>,
}

impl<'a> Scene<'a> {
    /// A garment with what it was made from. A texture that cannot be read is left out.
    #[must_use]
    pub fn new(garment: &'a Garment, source: Option<&'a ir::Garment>) -> Scene<'a> {
        let texture =
            source.and_then(|source| source.texture_png.as_deref()).and_then(|png| Texture::from_png(png).ok());
        let obi = source.and_then(|source| source.obi.as_ref());
        let obi_normals = obi.map(|obi| smooth_normals(&obi.positions_m, &obi.triangles)).unwrap_or_default();
        let texture = texture.filter(|_| garment.data().mesh.uv.len() == garment.vertex_count());
        Scene { garment, source, texture, obi_normals }
    }

    /// Poses kimono and wearer.
    #[must_use]
    pub fn figure(&self, stage: &mut Stage<'_>, shot: &Shot, colours: Colours) -> Figure {
        let (positions_m, normals) = stage.show(shot);
        Figure {
            colours: self.colours(shot, positions_m, colours),
            positions_m: positions_m.to_vec(),
            normals: normals.to_vec(),
            body: self.source.map(|source| {
                let positions_m = posed_body(&source.body, &shot.pose);
                let normals = smooth_normals(&positions_m, &source.body.surface.triangles);
                (positions_m, normals)
            }),
        }
    }

    /// Draws one figure, `height_px` high, so that everything in `bounds` is in the picture.
    #[must_use]
    pub fn draw(&self, figure: &Figure, view: View, bounds: Bounds, height_px: u32) -> RgbImage {
        let mesh = &self.garment.data().mesh;
        let paint = match (&figure.colours, &self.texture) {
            (Some(colours), _) => Paint::PerVertex(colours),
            (None, Some(texture)) => Paint::Textured(texture, &mesh.uv),
            (None, None) => Paint::Plain(CLOTH),
        };
        let mut shapes = vec![Shape {
            positions_m: &figure.positions_m,
            normals: &figure.normals,
            triangles: &mesh.triangles,
            paint,
            inside: figure.colours.is_none().then_some(LINING),
        }];
        if let (Some(source), Some((positions_m, normals))) = (self.source, &figure.body) {
            let triangles = &source.body.surface.triangles;
            shapes.push(Shape { positions_m, normals, triangles, paint: Paint::Plain(SKIN), inside: None });
        }
        if let Some(obi) = self.source.and_then(|source| source.obi.as_ref()) {
            let (positions_m, normals, triangles) = (&obi.positions_m, &self.obi_normals, &obi.triangles);
            shapes.push(Shape { positions_m, normals, triangles, paint: Paint::Plain(OBI), inside: None });
        }
        let (camera, width_over_height) = bounds.camera(view);
        let width_px = (height_px as f32 * width_over_height).ceil().clamp(1.0, 8192.0) as u32;
        render(&shapes, &camera, [width_px, height_px], BACKGROUND)
    }

    fn colours(&self, shot: &Shot, positions_m: &[Vec3], colours: Colours) -> Option<Vec<[u8; 3]>> {
        let data = self.garment.data();
        let unique: Vec<[u8; 3]> = match colours {
            Colours::Cloth => return None,
            Colours::Regions => self.region_colours(),
            Colours::Joints => {
                let mix = |skin: &kitsuke::garment::SkinWeights| {
                    let parts = skin.joints.iter().zip(skin.weights);
                    mixed(parts.map(|(&joint, weight)| (hue(usize::from(joint)), f32::from(weight) / 65535.0)))
                };
                data.skin.iter().map(mix).collect()
            }
            Colours::Error(full_m) => {
                let file = self.source.and_then(|source| {
                    let target = source.targets.iter().find(|target| target.name == shot.name);
                    target.map_or_else(
                        || (shot.name == "base").then_some(&source.base.positions_m),
                        |t| Some(&t.positions_m),
                    )
                });
                let file = file.filter(|file| file.len() == self.garment.unique_count());
                let Some(file) = file else { return Some(vec![CLOTH; self.garment.vertex_count()]) };
                let ordered_m = in_source_order(self.garment, positions_m);
                let at = data.mesh.source_vertex.iter().map(|&v| v as usize);
                at.map(|v| heat(ordered_m[v].distance(file[v]) / full_m)).collect()
            }
        };
        let twins = data.mesh.twin_of.iter().map(|&v| unique[v as usize]);
        Some(unique.iter().copied().chain(twins).collect())
    }

    fn region_colours(&self) -> Vec<[u8; 3]> {
        let mut colours = Vec::with_capacity(self.garment.unique_count());
        for segment in &self.garment.data().segments {
            for vertex in 0..segment.vertex_count as usize {
                let width = segment.drivers.len();
                let mask = |i: usize| segment.masks.get(vertex * width + i).map_or(1.0, |&m| f32::from(m) / 65535.0);
                colours.push(mixed((0..width).map(|i| (hue(usize::from(segment.drivers[i])), mask(i)))));
            }
        }
        colours
    }
}

/// A box round everything that a series of pictures shows, so that all of them have one scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    least_m: Vec3,
    most_m: Vec3,
}

impl Bounds {
    /// Round these figures.
    #[must_use]
    pub fn of(figures: &[Figure]) -> Bounds {
        let body =
            |figure: &Figure| figure.body.iter().flat_map(|(positions_m, _)| positions_m.clone()).collect::<Vec<_>>();
        let points = figures.iter().flat_map(|figure| figure.positions_m.iter().copied().chain(body(figure)));
        let empty = Bounds { least_m: Vec3::INFINITY, most_m: Vec3::NEG_INFINITY };
        let all = points.fold(empty, |b, p| Bounds { least_m: b.least_m.min(p), most_m: b.most_m.max(p) });
        if all.least_m.is_finite() { all } else { Bounds { least_m: Vec3::ZERO, most_m: Vec3::ONE } }
    }

    /// An orthographic camera that sees the whole box, and the picture's width over its height.
    fn camera(self, view: View) -> (Camera, f32) {
        const MARGIN: f32 = 1.06;
        let back = match view {
            View::Front => Vec3::Z,
            View::Side => Vec3::X,
            View::Back => -Vec3::Z,
            View::Quarter => Vec3::new(0.5, 0.16, 0.85).normalize(),
        };
        let right = Vec3::Y.cross(back).normalize();
        let (target_m, size_m) = ((self.least_m + self.most_m) / 2.0, self.most_m - self.least_m);
        let width_m = right.abs().dot(size_m) * MARGIN;
        let height_m = back.cross(right).abs().dot(size_m) * MARGIN;
        let eye_m = target_m + back * (size_m.length() + 1.0);
        (Camera { eye_m, target_m, lens: Lens::Orthographic { height_m } }, width_m / height_m.max(1e-6))
    }
}

/// The wearer's surface in a pose, by linear blend skinning; metres.
fn posed_body(body: &ir::Body, pose: &Pose) -> Vec<Vec3> {
    let mut posed_from_rest = vec![Affine3A::IDENTITY; body.skeleton.joints().len()];
    body.skeleton.posed_from_rest(pose, &mut posed_from_rest);
    let posed = |(p, weights): (&Vec3, &[(u8, f32); 4])| {
        weights.iter().map(|&(joint, w)| posed_from_rest[usize::from(joint)].transform_point3(*p) * w).sum()
    };
    body.surface.positions_m.iter().zip(&body.skin).map(posed).collect()
}

/// A colour of its own for every small number.
fn hue(number: usize) -> [u8; 3] {
    const HUES: [[u8; 3]; 12] = [
        [214, 72, 62],
        [240, 178, 60],
        [58, 112, 196],
        [88, 182, 176],
        [122, 88, 168],
        [112, 170, 72],
        [222, 120, 170],
        [146, 102, 66],
        [40, 70, 110],
        [236, 222, 110],
        [150, 40, 80],
        [130, 200, 236],
    ];
    HUES[number % HUES.len()]
}

/// Colours by weight; grey for what is missing to 1.
fn mixed(parts: impl Iterator<Item = ([u8; 3], f32)>) -> [u8; 3] {
    let (sum, weight) = parts.fold((Vec3::ZERO, 0.0), |(sum, total), (colour, weight)| {
        (sum + Vec3::from(colour.map(f32::from)) * weight, total + weight)
    });
    (sum + Vec3::from(CLOTH.map(f32::from)) * (1.0 - weight).max(0.0)).to_array().map(|c| c.round() as u8)
}

/// Grey at 0, yellow at the half, red from 1 on.
fn heat(share: f32) -> [u8; 3] {
    let stops = [CLOTH, [244, 214, 70], [190, 20, 20]].map(|c| Vec3::from(c.map(f32::from)));
    let at = share.clamp(0.0, 1.0) * 2.0;
    let colour = if at < 1.0 { stops[0].lerp(stops[1], at) } else { stops[1].lerp(stops[2], at - 1.0) };
    colour.to_array().map(|c| c.round() as u8)
}
