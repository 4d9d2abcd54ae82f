//! A kimono on its wearer as pictures: which shapes, colours and views. Knows neither files nor sheets.

use crate::ir;
use crate::look::frames::{Shot, Stage, in_source_order};
use crate::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use crate::look::texture::Texture;
use glam::{Mat3, Vec2, Vec3};
use image::RgbImage;
use kitsuke::Garment;
use kitsuke::accessories::Obi;
use kitsuke::arrays::SkinWeights;

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
    /// Texture coordinates; empty where the garment's own serve.
    uv: Vec<Vec2>,
    /// Colours per vertex, unless the cloth is drawn as it looks.
    colours: Option<Vec<[u8; 3]>>,
    /// Positions and normals of what stands round the cloth, as in the scene.
    context: Vec<(Vec<Vec3>, Vec<Vec3>)>,
}

/// What is drawn: a garment and, where its sources can be read, texture, wearer and obi.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    garment: &'a Garment,
    source: Option<&'a ir::Garment>,
    texture: Option<Texture>,
    context: Vec<Skinned>,
}

/// A surface that joints move, in one colour.
#[derive(Clone, Debug)]
struct Skinned {
    body: ir::Body,
    /// Those of the body's triangles that are drawn.
    drawn: Vec<[u32; 3]>,
    colour: [u8; 3],
}

impl Skinned {
    fn new(body: ir::Body, colour: [u8; 3]) -> Skinned {
        Skinned { drawn: body.surface.triangles.clone(), body, colour }
    }
}

impl<'a> Scene<'a> {
    /// A garment with what it was made from. A texture that cannot be read is left out.
    #[must_use]
    pub fn new(garment: &'a Garment, source: Option<&'a ir::Garment>) -> Scene<'a> {
        let texture =
            source.and_then(|source| source.texture.as_ref()).and_then(|texture| Texture::from_png(&texture.png).ok());
        let texture = texture.filter(|_| garment.data().mesh.uv.len() == garment.vertex_count());
        let body = source.map(|source| Skinned::new(source.body.clone(), SKIN));
        let obi = source.and_then(|source| source.obi.as_ref()).map(|obi| worn_over(garment, obi));
        Scene { garment, source, texture, context: body.into_iter().chain(obi).collect() }
    }

    /// Poses kimono and wearer.
    #[must_use]
    pub fn figure(&self, stage: &mut Stage<'_>, shot: &Shot, colours: Colours) -> Figure {
        let (positions_m, normals) = stage.show(shot);
        let pose = shot.pose.sanitised();
        let posed = |Skinned { body, .. }: &Skinned| {
            let positions_m = body.posed_m(&pose);
            let normals = smooth_normals(&positions_m, &body.surface.triangles);
            (positions_m, normals)
        };
        Figure {
            colours: self.colours(shot, positions_m, colours),
            positions_m: positions_m.to_vec(),
            normals: normals.to_vec(),
            uv: Vec::new(),
            context: self.context.iter().map(posed).collect(),
        }
    }

    /// The same with another texture on the cloth.
    #[must_use]
    pub fn with_texture(&self, texture: Texture) -> Scene<'a> {
        Scene { texture: Some(texture), ..self.clone() }
    }

    /// The same without the wearer's triangles of which all corners are flagged as covered by the cloth, one flag per
    /// vertex of her body. Changes nothing where no wearer is drawn.
    ///
    /// # Panics
    /// When the body has more vertices than there are flags.
    #[must_use]
    pub fn without_covered(mut self, covered: &[bool]) -> Scene<'a> {
        // The wearer stands first.
        if let (Some(_), Some(wearer)) = (self.source, self.context.first_mut()) {
            wearer.drawn.retain(|triangle| !triangle.iter().all(|&v| covered[v as usize]));
        }
        self
    }

    /// The same without wearer and obi.
    #[must_use]
    pub fn unworn(self) -> Scene<'a> {
        Scene { context: Vec::new(), ..self }
    }

    /// The kimono alone in a shape of its own: positions of its unique vertices (metres), and texture coordinates for all.
    ///
    /// # Panics
    /// When there are fewer of either than the garment has vertices.
    #[must_use]
    pub fn alone(&self, positions_m: &[Vec3], uv: &[Vec2]) -> Figure {
        assert_eq!(uv.len(), self.garment.vertex_count(), "one texture coordinate per vertex");
        let mesh = &self.garment.data().mesh;
        let unique = |v: u32| mesh.unique(v);
        let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|triangle| triangle.map(unique)).collect();
        // Normals of the welded cloth.
        let normals = smooth_normals(positions_m, &triangles);
        let all = |values: &[Vec3]| (0..uv.len() as u32).map(|v| values[unique(v) as usize]).collect();
        Figure {
            positions_m: all(positions_m),
            normals: all(&normals),
            uv: uv.to_vec(),
            colours: None,
            context: Vec::new(),
        }
    }

    /// Draws one figure in a picture that is `height_px` high.
    ///
    /// # Panics
    /// When the figure was posed by a scene of another garment.
    #[must_use]
    pub fn draw(&self, figure: &Figure, framing: Framing, height_px: u32) -> RgbImage {
        let mesh = &self.garment.data().mesh;
        let paint = match (&figure.colours, &self.texture) {
            (Some(colours), _) => Paint::PerVertex(colours),
            (None, Some(texture)) => Paint::Textured(texture, if figure.uv.is_empty() { &mesh.uv } else { &figure.uv }),
            (None, None) => Paint::Plain(CLOTH),
        };
        let cloth = Shape {
            positions_m: &figure.positions_m,
            normals: &figure.normals,
            triangles: &mesh.triangles,
            paint,
            inside: figure.colours.is_none().then_some(LINING),
        };
        let context = self.context.iter().zip(&figure.context).map(|(skinned, (positions_m, normals))| Shape {
            positions_m,
            normals,
            triangles: &skinned.drawn,
            paint: Paint::Plain(skinned.colour),
            inside: None,
        });
        let shapes: Vec<Shape<'_>> = std::iter::once(cloth).chain(context).collect();
        let (camera, width_over_height) = framing.camera();
        let width_px = (height_px as f32 * width_over_height).ceil().clamp(1.0, 8192.0) as u32;
        render(&shapes, &camera, [width_px, height_px], BACKGROUND)
    }

    fn colours(&self, shot: &Shot, positions_m: &[Vec3], colours: Colours) -> Option<Vec<[u8; 3]>> {
        let data = self.garment.data();
        let unique: Vec<[u8; 3]> = match colours {
            Colours::Cloth => return None,
            Colours::Regions => region_colours(self.garment),
            Colours::Joints => joint_colours(self.garment),
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
}

impl Figure {
    /// Paints these unique vertices red, where the figure's colours say something.
    pub fn mark(&mut self, vertices: &[u32]) {
        const MARK: [u8; 3] = [214, 24, 24];
        if let Some(colours) = &mut self.colours {
            vertices.iter().for_each(|&vertex| colours[vertex as usize] = MARK);
        }
    }
}

/// How much of the world a series of pictures shows, so that all of them have one scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Framing {
    view: View,
    /// Along the picture's right, up and the direction to the viewer, metres.
    least_m: Vec3,
    most_m: Vec3,
}

impl Framing {
    /// Everything that these figures show from there.
    #[must_use]
    pub fn of(figures: &[Figure], view: View) -> Framing {
        let view_from_world = view.axes().transpose();
        let points = figures.iter().flat_map(|figure| {
            let context = figure.context.iter().flat_map(|(positions_m, _)| positions_m);
            figure.positions_m.iter().chain(context).map(|&p| view_from_world * p)
        });
        let empty = Framing { view, least_m: Vec3::INFINITY, most_m: Vec3::NEG_INFINITY };
        let all = points.fold(empty, |f, p| Framing { view, least_m: f.least_m.min(p), most_m: f.most_m.max(p) });
        if all.least_m.is_finite() { all } else { Framing { view, least_m: Vec3::ZERO, most_m: Vec3::ONE } }
    }

    /// An orthographic camera that sees all of it, and the picture's width over its height.
    fn camera(self) -> (Camera, f32) {
        const MARGIN_M: f32 = 0.05;
        let axes = self.view.axes();
        let middle_m = (self.least_m + self.most_m) / 2.0;
        let size_m = self.most_m - self.least_m + 2.0 * MARGIN_M;
        let target_m = axes * middle_m;
        let eye_m = target_m + axes.z_axis * size_m.z;
        (Camera { eye_m, target_m, lens: Lens::Orthographic { height_m: size_m.y } }, size_m.x / size_m.y)
    }
}

impl View {
    /// The picture's right, up and the direction to the viewer, as columns.
    fn axes(self) -> Mat3 {
        let back = match self {
            View::Front => Vec3::Z,
            View::Side => Vec3::X,
            View::Back => -Vec3::Z,
            View::Quarter => Vec3::new(0.5, 0.16, 0.85).normalize(),
        };
        let right = Vec3::Y.cross(back).normalize();
        Mat3::from_cols(right, back.cross(right), back)
    }
}

/// A band that moves with the cloth under it.
fn worn_over(garment: &Garment, band: &ir::Surface) -> Skinned {
    let obi = Obi::over(garment, band.positions_m.clone(), band.triangles.clone());
    let weights = |skin: &SkinWeights| std::array::from_fn(|i| (skin.joints[i], f32::from(skin.weights[i]) / 65535.0));
    let skin = obi.skin.iter().map(weights).collect();
    Skinned::new(ir::Body { surface: band.clone(), skeleton: garment.data().skeleton.clone(), skin }, OBI)
}

/// One colour per unique vertex: the region masks, one hue per driver; grey belongs to none.
#[must_use]
pub fn region_colours(garment: &Garment) -> Vec<[u8; 3]> {
    let mut colours = Vec::with_capacity(garment.unique_count());
    for segment in &garment.data().segments {
        for vertex in 0..segment.vertex_count as usize {
            let width = segment.drivers.len();
            let mask = |i: usize| segment.masks.get(vertex * width + i).map_or(1.0, |&m| f32::from(m) / 65535.0);
            colours.push(mixed((0..width).map(|i| (hue(usize::from(segment.drivers[i])), mask(i)))));
        }
    }
    colours
}

/// One colour per unique vertex: the joints that move it, mixed by skin weight.
#[must_use]
pub fn joint_colours(garment: &Garment) -> Vec<[u8; 3]> {
    let mix = |skin: &SkinWeights| {
        let parts = skin.joints.iter().zip(skin.weights);
        mixed(parts.map(|(&joint, weight)| (hue(usize::from(joint)), f32::from(weight) / 65535.0)))
    };
    garment.data().skin.iter().map(mix).collect()
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
