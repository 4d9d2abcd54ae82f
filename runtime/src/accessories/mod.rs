//! What an app shows beside the kimono: the obi that ties it, its texture, the paths along which it is measured, the name of the body on
//! which it was made. Knows no bytes of a pack; a kimono is worn without any of it.

mod check;

pub use check::{InvalidAccessories, limits};

use crate::arrays::SkinWeights;
use crate::garment::Garment;
use crate::skeleton::Pose;
use glam::{Affine3A, Vec3};

/// What comes with a kimono; anything may be wrong until [`Accessories::check`] has passed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Accessories {
    /// The body on which it was made, for example `b04`; empty where nobody said.
    pub body: String,
    /// The colour texture of the kimono.
    pub texture: Option<Texture>,
    /// The obi.
    pub obi: Option<Obi>,
    /// Tailoring dimensions that can be measured on any shape of the kimono.
    pub paths: Vec<Path>,
}

/// A colour texture, sRGB; v = 0 of the kimono's texture coordinates is its bottom row.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texture {
    /// The artist's file name.
    pub name: String,
    /// Width and height, pixels.
    pub size_px: [u32; 2],
    /// The image as PNG; empty where the app is to bring it.
    pub png: Vec<u8>,
}

impl Texture {
    /// A texture by its image; `None` where that is no PNG.
    #[must_use]
    pub fn from_png(name: String, png: Vec<u8>) -> Option<Texture> {
        Some(Texture { name, size_px: check::png_size_px(&png)?, png })
    }
}

/// The obi as a rigid band over the cloth, in the T-pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Obi {
    /// Metres.
    pub positions_m: Vec<Vec3>,
    /// Counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// What moves each vertex: the frames of the garment's skeleton.
    pub skin: Vec<SkinWeights>,
}

/// A tailoring dimension as a path along edges of the kimono.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// For example `sode_take_left`.
    pub name: String,
    /// Kanji; may be empty.
    pub ja: String,
    /// Unique vertices, each joined to the next by an edge.
    pub vertices: Vec<u32>,
    /// Added to the sum of the edges' lengths, metres.
    pub offset_m: f32,
}

impl Path {
    /// Its length on this shape of the kimono, metres.
    ///
    /// # Panics
    /// When there are fewer positions than the garment has unique vertices.
    #[must_use]
    pub fn length_m(&self, positions_m: &[Vec3]) -> f32 {
        let edge_m = |edge: &[u32]| f64::from(positions_m[edge[0] as usize].distance(positions_m[edge[1] as usize]));
        (self.vertices.windows(2).map(edge_m).sum::<f64>() + f64::from(self.offset_m)) as f32
    }
}

impl Obi {
    /// A band that lies over the kimono in the T-pose (metres): each vertex moves as the nearest vertex of the cloth does.
    #[must_use]
    pub fn over(garment: &Garment, positions_m: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Obi {
        let data = garment.data();
        let nearest = |place_m: &Vec3| {
            let distance = |v: &usize| data.mesh.positions_m[*v].distance_squared(*place_m);
            (0..garment.unique_count()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
        };
        let skin = positions_m.iter().map(|place_m| data.skin[nearest(place_m)]).collect();
        Obi { positions_m, triangles, skin }
    }

    /// Writes the obi in a pose, by linear blend skinning, into `positions_m`; give it the pose of the kimono, so a
    /// [limited](Garment::limited) one where that is. `posed_from_rest` is working memory. Neither allocates nor fails.
    ///
    /// # Panics
    /// When `positions_m` is not as long as the obi's, `posed_from_rest` not as long as the skeleton's
    /// [`frame_count`](crate::skeleton::Skeleton::frame_count), or the obi is another garment's.
    pub fn pose(&self, garment: &Garment, pose: &Pose, posed_from_rest: &mut [Affine3A], positions_m: &mut [Vec3]) {
        assert_eq!(positions_m.len(), self.positions_m.len(), "one position per vertex of the obi");
        garment.data().skeleton.posed_from_rest(&pose.sanitised().with_arms_untwisted(), posed_from_rest);
        for ((posed_m, &rest_m), skin) in positions_m.iter_mut().zip(&self.positions_m).zip(&self.skin) {
            *posed_m = Vec3::ZERO;
            for (&joint, &weight) in skin.joints.iter().zip(&skin.weights) {
                let share = f32::from(weight) * (1.0 / 65535.0);
                *posed_m += posed_from_rest[usize::from(joint)].transform_point3(rest_m) * share;
            }
        }
    }

    /// The obi of a fitted kimono: gone with the cloth under it from the base's shape (unique vertices, metres) to the fitted one.
    /// Takes some 20 ms: once per fit.
    #[must_use]
    pub fn fitted(&self, base_m: &[Vec3], fitted_m: &[Vec3]) -> Obi {
        let gone = |place_m: &Vec3| gone_with(*place_m, base_m, fitted_m);
        Obi { positions_m: self.positions_m.iter().map(gone).collect(), ..self.clone() }
    }
}

/// Where a place has gone with what is nearest to it, smoothed so that no fold shows; metres.
#[must_use]
pub fn gone_with(place_m: Vec3, from_m: &[Vec3], to_m: &[Vec3]) -> Vec3 {
    /// About the width of a fold.
    const SMOOTH_M: f32 = 0.02;
    let nearest_m = from_m.iter().map(|from_m| from_m.distance(place_m)).fold(f32::INFINITY, f32::min);
    let (mut sum_m, mut weights) = (Vec3::ZERO, 0.0);
    for (from_m, to_m) in from_m.iter().zip(to_m) {
        // Measured from the nearest, so that what is far from everything goes with something.
        let away = (from_m.distance(place_m) - nearest_m) / SMOOTH_M;
        if away < 4.0 {
            let weight = libm::expf(-away * away);
            sum_m += weight * (to_m - from_m);
            weights += weight;
        }
    }
    if weights > 0.0 { place_m + sum_m / weights } else { place_m }
}
